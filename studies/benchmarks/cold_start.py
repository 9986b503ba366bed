"""The first results of a machine with empty caches: ``python -m studies.benchmarks.cold_start``.

Every case is a process of its own from import to first result, with an empty folder for caches. ``--before DIR`` runs
the cases of another checkout alternately with those of this one. Seconds are of the processor, which a busy machine
changes less; those of the clock are in the notes. A further process, with filled caches, shows the part without
compilation.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from studies.benchmarks.checkouts import ROOT, run_in
from studies.reporting import Row, report, study_parser

GOALS = {"tracking": 0.5, "plan": 0.4, "closed loop": 0.25}  # of the seconds before
CASES = {
    "tracking": """
import numpy as np
from problems.tringali_2020 import energy_torque
problem = energy_torque()
genes = np.random.default_rng(0).uniform(problem.xl, problem.xu, (8, problem.n_var))
result = problem.evaluate(genes, return_values_of=["F"]).ravel().tolist()
""",
    "plan": """
import paretoik as pk
from problems.tringali_2020 import simulation_4
result = [float(pk.plan(simulation_4(), starts=8, seed=0).best.objective)]
""",
    "closed loop": """
import numpy as np
from problems.marcos_2012 import loop
start = np.array([-1.3, 1.26579276, 1.67196742])
run = loop(3, 0.7, blocked=True, steps=3, generations=3, population=20, start=start).run()
result = [float(run.drift), float(run.position_error)]
""",
}
TIMED = """
import json, time
clock = time.perf_counter()
{case}
print(json.dumps({{"processor": time.process_time(), "clock": time.perf_counter() - clock, "result": result}}))
"""


@dataclass(frozen=True, kw_only=True)
class Timing:
    """Seconds [s] of the processor and the clock from import to first result, and the result itself."""

    processor: float
    clock: float
    result: tuple[float, ...]


def time_case(case: str, checkout: Path, cache: Path) -> Timing:
    """Return the timing of a case in a new process with a cache folder; raise RuntimeError if it fails."""
    try:
        record = run_in(checkout, TIMED.format(case=CASES[case]), cache=cache)
    except RuntimeError as error:
        raise RuntimeError(f"{case} in {error}") from None
    return Timing(processor=record["processor"], clock=record["clock"], result=tuple(record["result"]))


def time_cold_and_warm(case: str, checkout: Path) -> tuple[Timing, Timing]:
    """Return the timings of a case with an empty cache folder, then with the filled one."""
    with tempfile.TemporaryDirectory() as cache:
        return time_case(case, checkout, Path(cache)), time_case(case, checkout, Path(cache))


def tabulate(case: str, timings: Mapping[str, tuple[Timing, Timing]]) -> list[Row]:
    """Return the rows of a case: seconds cold and warm per checkout, and the ratio of two checkouts."""
    table = "first result with empty caches"
    rows = []
    for label, (cold, warm) in timings.items():
        note = f"{warm.processor:.2g} s once compiled; by the clock {cold.clock:.3g} and {warm.clock:.2g} s"
        rows.append(Row(table, case, label, "s", cold.processor, note=note))
    if "before" in timings:
        now, before = timings["now"][0], timings["before"][0]
        ratio = now.processor / before.processor
        same = "the same bits" if now.result == before.result else f"results {now.result} and {before.result}"
        goal = "goal met" if ratio <= GOALS[case] else "goal missed"
        rows.append(Row(table, case, "ratio", "", ratio, reference=GOALS[case], source="goal", note=f"{goal}; {same}"))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Time all cases, print the table, and write the rows if ``--json`` names a file."""
    parser = study_parser("First results with empty caches of compiled code.")
    parser.add_argument("--before", type=Path, help="another checkout, timed alternately with this one")
    options = parser.parse_args(arguments)
    checkouts = {"now": ROOT} | ({"before": options.before.resolve()} if options.before else {})
    rows: list[Row] = []
    for case in CASES:
        rows += tabulate(case, {label: time_cold_and_warm(case, path) for label, path in checkouts.items()})
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
