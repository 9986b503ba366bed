"""``paretoik verify``: check a run a second time, independently of what made it."""

from __future__ import annotations

from dataclasses import asdict

import typer

from paretoik.cli.console import (
    NOT_VERIFIED,
    JsonFlag,
    QuietFlag,
    RunFolder,
    RunProblem,
    agreed_problem,
    print_json,
    print_text,
    running,
)


def verify(run: RunFolder, problem: RunProblem = None, quiet: QuietFlag = False, as_json: JsonFlag = False) -> None:
    """Check files, motions, limits, collisions, objectives and certificates of a run, without its own kernels.

    Exit code 7 if a check fails.
    """
    with running(quiet=quiet) as observe:
        from paretoik.api.verify import verify as verify_folder

        verification = verify_folder(run, agreed_problem(run, problem), observe=observe)
    if as_json:
        rows = [asdict(row) for row in verification.rows]
        words = {"headline": verification.headline, "passed": verification.passed, "verified": verification.verified}
        print_json({"run": run, **words, "rows": rows})
    else:
        print_text(verification)
    raise typer.Exit(0 if verification.passed else NOT_VERIFIED)
