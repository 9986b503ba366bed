"""Summaries of fronts and choices: text for people, entries for machines."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paretoik.api.run_text import resume_command, status_text
from paretoik.formulations.protocol import is_loop
from paretoik.front.certificate_text import certificate_text
from paretoik.front.choices import preference_data
from paretoik.front.provenance import confirmation_text
from paretoik.review.limits_between import describe_limits_between
from paretoik.run_files import problem_words
from paretoik.shell_command import shell_command
from paretoik.tables import columns

if TYPE_CHECKING:
    from paretoik.front.front import Choice, Front


LINE = 100  # characters a line of running text


def result_text(front: Front, out: Path) -> str:
    """Return a summary of a front, or of a closed loop's motion, and the commands that choose from it and replay it."""
    lines = _loop_lines(front) if is_loop(front) else _front_lines(front)
    if (command := resume_command(out, front.provenance["status"])) is not None:
        lines.append(f"go on:   {command}")
    named = problem_words(front.provenance.get("problem"))
    lines.append(f"choose:  {shell_command('paretoik', 'select', out, *_preference_words(front), *named)}")
    lines.append(f"replay:  {shell_command('paretoik', 'show', out, *named)}")
    return "\n".join(lines)


def _preference_words(front: Front) -> list[str]:
    """Return equal weights as the command line has them, or a preference without names where these do not fit there."""
    if any(sign in name for name in front.names for sign in ",="):
        return ["--compromise"]
    return ["--weights", ",".join(f"{name}={1 / len(front.names):.2g}" for name in front.names)]


def _loop_lines(front: Front) -> list[str]:
    provenance = front.provenance
    weights = provenance["settings"]["weights"]
    lines = [
        status_text(front),
        f"position error {provenance['position_error']:.6g} m (mean over the steps), "
        f"drift {provenance['drift']:.6g} rad",
    ]
    rows = [("objective", "unit", "weight", "mean over the steps")]
    for name, unit, value in zip(front.names, front.units, front.objectives[0], strict=True):
        rows.append((name, unit, f"{weights[name]:.3g}", f"{value:.6g}"))
    lines.append(columns(rows))
    assert front.violation is not None
    if front.violation[0] > 0:
        lines.append(f"limits of the arm are violated by {100 * front.violation[0]:.3g} % of their range")
    return lines


def _front_lines(front: Front) -> list[str]:
    counts, lines = front.provenance["counts"], [status_text(front)]
    rows = [("objective", "unit", "best", "worst on the front")]
    for name, unit, maximised, values in zip(
        front.names, front.units, front.maximised, front.objectives.T, strict=True
    ):
        best, worst = (values.max(), values.min()) if maximised else (values.min(), values.max())
        rows.append((name, unit, f"{best:.6g}", f"{worst:.6g}"))
    lines.append(columns(rows))
    if front.certificates is not None:
        lines.append(certificate_text(front.certificates))
    lines += filter(None, [confirmation_text(front.provenance), gap_text(front), describe_limits_between(front)])
    if counts.get("failed"):
        lines.append(f"{counts['failed']} evaluations failed, the first with: {counts['first_cause']}")
    return lines


def choice_text(front: Front, choice: Choice) -> str:
    """Return a chosen point, the reason of the choice, and its certificate."""
    rows = [
        (f"  {name}", f"{value:.6g} {unit}")
        for name, unit, value in zip(front.names, front.units, choice.objectives, strict=True)
    ]
    lines = [f"point {choice.id}", columns(rows), textwrap.fill(choice.reason, LINE)]
    if front.certificates is not None:
        lines.append(certificate_text(front.certificates[[choice.index]]))
    lines += filter(None, [describe_limits_between(front, [choice.index])])
    return "\n".join(lines)


def choice_entry(front: Front, choice: Choice) -> dict[str, Any]:
    """Return a chosen point as data: its entry, the reason, and all that the reason is made from."""
    return {
        **entries(front)[choice.index],
        "reason": choice.reason,
        "verdict": choice.verdict,
        "preference": None if choice.preference is None else preference_data(choice.preference),
        "score": choice.score,
        "details": choice.details,
        "shares": dict(zip(front.names, choice.shares, strict=True)),
        "ends": [asdict(each) for each in choice.ends],
        "neighbours": [asdict(each) for each in choice.neighbours],
        "rates": [asdict(each) for each in choice.rates],
        "jumps": choice.jumps,
    }


def gap_text(front: Front) -> str:
    """Return where a front of two objectives jumps, and what hypervolume further points could add; "" if unknown."""
    lines = [_jump_text(front.jumps)] if front.jumps else []
    if front.missing_hypervolume is not None:
        lines.append(f"further points could add about {100 * front.missing_hypervolume:.2g} % of the hypervolume")
    return "\n".join(lines)


def _jump_text(jumps: Sequence[tuple[int, int]]) -> str:
    pairs = ", ".join(f"{one} and {other}" for one, other in jumps)
    return f"jump{'s' * (len(jumps) > 1)} to another branch of optima between points {pairs}"


def entries(front: Front) -> list[dict[str, Any]]:
    """Return all points as data: id, objectives by name, certificate by name."""
    rows: list[dict[str, Any]] = [
        {"id": int(number), "objectives": dict(zip(front.names, values, strict=True))}
        for number, values in zip(front.ids, front.objectives, strict=True)
    ]
    certificates = front.certificates
    if certificates is not None:
        for index, entry in enumerate(rows):
            entry["certificate"] = {part.name: getattr(certificates, part.name)[index] for part in fields(certificates)}
    return rows
