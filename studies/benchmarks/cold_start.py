"""The first results of a machine with empty caches: ``python -m studies.benchmarks.cold_start [--before DIR]``.

Every case is a process of its own from import to first result, with an empty folder for caches; another one, with
filled caches, shows the part without compilation. Cases of another checkout alternate with those of this one. Seconds
are of the processor; those of the clock are in the notes.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from studies.benchmarks.checkouts import ROOT, run_in
from studies.reporting import Row, goal_row, report, study_parser

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
# prints the seconds of the processor and the clock from import to result, and the result
TIMED = """
import json, time
clock = time.perf_counter()
{case}
print(json.dumps({{"processor": time.process_time(), "clock": time.perf_counter() - clock, "result": result}}))
"""


def case_rows(case: str, checkouts: Mapping[str, Path]) -> list[Row]:
    """Return the rows of a case: seconds with empty caches per checkout, and the ratio of two checkouts."""
    place, rows, colds = ("first result with empty caches", case), list[Row](), dict[str, dict[str, Any]]()
    for label, path in checkouts.items():
        with tempfile.TemporaryDirectory() as cache:
            cold, warm = (run_in(path, TIMED.format(case=CASES[case]), cache=Path(cache)) for _ in range(2))
        note = f"{warm['processor']:.2g} s once compiled; by the clock {cold['clock']:.3g} and {warm['clock']:.2g} s"
        rows.append(Row(*place, label, "s", cold["processor"], note=note))
        colds[label] = cold
    if "before" in colds:
        now, before = colds["now"], colds["before"]
        is_same = now["result"] == before["result"]
        same = "the same bits" if is_same else f"results {now['result']} and {before['result']}"
        rows.append(goal_row(*place, "ratio", "", now["processor"] / before["processor"], GOALS[case], same))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Time all cases, print the table, and write the rows if ``--json`` names a file."""
    parser = study_parser("First results with empty caches of compiled code.")
    parser.add_argument("--before", type=Path, help="another checkout, timed alternately with this one")
    options = parser.parse_args(arguments)
    checkouts = {"now": ROOT} | ({"before": options.before.resolve()} if options.before else {})
    report([row for case in CASES for row in case_rows(case, checkouts)], json_file=options.json)


if __name__ == "__main__":
    main()
