"""Bad inputs by rules: every class of wrong values for every argument of every public name; objects and files, too.

    python -m studies.benchmarks.reliability.inputs [--quick] [--json FILE]

Good is a refusal in one line that names the argument, says the wish and the fact, before any work; poor lacks one of
these. Bad is any other error, a warning, or an accepted value without a meaning. Poor and bad cases are printed.
"""

from __future__ import annotations

import os
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from studies.benchmarks.reliability.inputs.examples import Examples
from studies.benchmarks.reliability.inputs.judging import Case, cases, judge, make_files, reason
from studies.benchmarks.reliability.inputs.problems import outcomes
from studies.benchmarks.reliability.inputs.surfaces import surfaces
from studies.reporting import Row, report, study_parser, tell

QUICK = 20  # with --quick one of this many cases is tried


def main() -> None:
    """Run the benchmark."""
    arguments = study_parser(__doc__ or "", quick=f"one of {QUICK} inputs").parse_args()
    chosen = list(cases(surfaces()))[:: QUICK if arguments.quick else 1]
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        make_files(place)
        before = Path.cwd()
        os.chdir(place)
        try:
            rows = list(_rows(chosen, Examples(place)))
        finally:
            os.chdir(before)
    report(rows, json_file=arguments.json)


def _rows(chosen: list[Case], examples: Examples) -> Iterator[Row]:
    counts: dict[str, Counter[str]] = {}
    _ = examples.run_folder, examples.plan_folder  # made before the first judgement
    for case in chosen:
        outcome = judge(case, examples)
        verdict = outcome.verdict
        if verdict == "taken" and case.is_certain and reason(case.name) is None:
            verdict = "bad"
        counts.setdefault(case.surface.name.split(".")[0], Counter())[verdict] += 1
        if verdict in ("poor", "bad"):
            tell(f"{verdict}: {case.name}: {outcome.words or 'taken'}")
    for surface, fault, outcome in outcomes(examples.folder):
        counts.setdefault(surface, Counter())[outcome.verdict] += 1
        if outcome.verdict != "good":
            tell(f"{outcome.verdict}: {surface}: {fault}: {outcome.words}")
    for name, verdicts in {**counts, "all": sum(counts.values(), Counter())}.items():
        for verdict in ("good", "taken", "poor", "bad"):
            goal = {"poor": 0, "bad": 0}.get(verdict)
            source = "" if goal is None else "goal"
            yield Row("inputs", name, verdict, "", verdicts[verdict], reference=goal, source=source)


if __name__ == "__main__":
    main()
