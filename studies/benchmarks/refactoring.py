"""Costs and gains by a change of the library.

Every case runs on another checkout and on this one, in alternating processes. The first run of a process, which
compiles, is not counted; of the others the least processor time counts. ``--cold`` counts only the first, with imports,
each with empty caches. A worse value is a loss, and so is more than 1.05 times the seconds. Smaller values are better
unless they are named in ``MAXIMISED``.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from studies.benchmarks.checkouts import ROOT, run_in
from studies.reporting import LOSS, Row, goal_row, losses_first, report, study_parser, tell

TABLE = "this checkout compared with the one before"
GOAL = 1.05  # times the seconds before
VALUE_TOLERANCE = 1e-9  # relative
MAXIMISED = ("hypervolume", "sum of speeds")


@dataclass(frozen=True, kw_only=True)
class Case:
    """Code that defines ``run()``, which returns values by name, and the number of repeats in a process."""

    code: str
    repeats: int = 3


SHARED = """
import json, time
import numpy as np
import paretoik as pk
from pymoo.indicators.hv import HV
from problems import kim_2021, marcos_2012, panda, tringali_2020, tringali_2021
arms, methods, capability = (getattr(pk, name, pk) for name in ("arms", "methods", "capability"))

def measure(front, ideal, nadir):
    F = (front.minimised - np.array(ideal)) / (np.array(nadir) - np.array(ideal))
    return {"hypervolume": HV(ref_point=np.full(F.shape[1], 1.1))(F)}

directions = np.stack([np.cos(np.arange(16) * np.pi / 8), np.sin(np.arange(16) * np.pi / 8)], axis=1)
"""
TIMED = """
values = run()
seconds = [time.process_time()] if {repeats} == 0 else []
for _ in range({repeats}):
    begin = time.process_time()
    values = run()
    seconds.append(time.process_time() - begin)
print(json.dumps({{"seconds": min(seconds), "values": {{name: float(value) for name, value in values.items()}}}}))
"""
PLAN = """
whole = tringali_2020.simulation_{number}().task
problem = pk.Tracking(
    arms.tringali_3r({masses!r}),
    tringali_2020.round_trip(101) if whole.cyclic else tringali_2020.straight(101),
    objectives=whole.objectives,
    limits=pk.Limits(**{{kind: (bounds[0, :, 0], bounds[0, :, 1]) for kind, bounds in whole.bounds.items()}}),
    cyclic=whole.cyclic,
    differences="backward",
)
def run():
    return {{"objective": pk.plan(problem, seed=0).best.objective}}
"""
LOOP = """
start = {start}
loop = marcos_2012.loop({links}, 0.7, blocked={blocked}, steps=10, generations=200, start=np.array(start))
def run():
    return {{"drift": loop.run().drift}}
"""
STARTS = {
    3: [-1.3, 1.26579276, 1.67196742],
    4: [5.335439423562647, -4.426791963408871, -0.9728216230198674, -3.1651527807926714],
}
EXACT = """
loop = marcos_2012.loop(3, 0.7, blocked={blocked}, steps=400, start=np.array({start}), as_printed=True)
task = loop.task
from studies.marcos_2012.exact_loop import exact_steps
follow = lambda: exact_steps(task.truncate(100), loop.start, weight=0.5)
def run():
    return dict(zip(("joint 1", "joint 2", "joint 3"), follow().sum(axis=0)))
"""
MAXIMA = """
arm, motors = arms.kim_3r(), capability.kim_{motors}()
def run():
    for _ in range(20):
        maxima = pk.directional_maxima(arm, motors, kim_2021.PLACE, directions)
    return {{"sum of speeds": sum(maxima.values)}}
"""
POINT_TO_POINT = """
problem = kim_2021.point_to_point_jam()
def run():
    front = pk.epsilon_front(problem, points={points}, starts=4, seed=0)
    ends = dict(zip(("least time", "least energy"), front.minimised.min(axis=0)))
    return measure(front, [1.5, 0.045], [3.6, 0.3]) | ends
"""
CASES: dict[str, Case] = {
    **{
        f"plan, simulation {number}, {masses}": Case(code=PLAN.format(number=number, masses=masses), repeats=15)
        for masses in ("printed", "fitted")
        for number in (1, 2, 3, 4, 5)
    },
    "20-point front, energy_torque": Case(
        code="""
problem = tringali_2020.energy_torque()
def run():
    return measure(pk.epsilon_front(problem, points=20, seed=0), [0.038, 0.049], [0.06, 0.1])
"""
    ),
    "certified front of 5 points, Panda": Case(
        code="""
problem = panda.across_the_table()
def run():
    return measure(pk.epsilon_front(problem, points=5, seed=0), [0.62, 750.0, 0.006], [0.8, 1700.0, 0.03])
""",
        repeats=2,
    ),
    "directional front of 10 points, sliders": Case(
        code="""
problem = kim_2021.directions_dam()
def run():
    return measure(pk.epsilon_front(problem, points=10, seed=0), [-0.054, -0.126, 0.0], [0.0, 0.0, 0.45])
""",
    ),
    **{
        f"point-to-point front of {points} points, joint motors": Case(
            code=POINT_TO_POINT.format(points=points),
            repeats=1,
        )
        for points in (5, 20)
    },
    **{
        f"10 closed-loop steps of 200 generations, {links}R{' with obstacles' * blocked}": Case(
            code=LOOP.format(links=links, blocked=blocked, start=STARTS[links])
        )
        for links in (3, 4)
        for blocked in (False, True)
    },
    **{
        f"100 exact steps, 3R{' with obstacles' * blocked}": Case(
            code=EXACT.format(blocked=blocked, start=STARTS[3]), repeats=9
        )
        for blocked in (False, True)
    },
    **{
        f"16 directional maxima, {motors.replace('_', ' ')}": Case(code=MAXIMA.format(motors=motors), repeats=5)
        for motors in ("joint_motors", "sliders")
    },
    "PMKE along trajectory 1": Case(
        code="""
arm, path, start = arms.tringali_3r(), tringali_2021.trajectory(1), tringali_2021.START
method = methods.PredictiveKineticEnergy()
def run():
    return {"kinetic energy": pk.kinetic_energy(pk.resolve(arm, path, method, start=start, unreachable="track"))}
""",
        repeats=9,
    ),
    "fit of ellipsoids to 16 positions": Case(
        code="""
motors = capability.kim_joint_motors()
positions = np.stack(np.meshgrid(np.linspace(0.1, 0.2, 4), np.linspace(-0.2, -0.1, 4)), axis=-1).reshape(-1, 2)
speeds = np.stack([pk.directional_maxima(arms.kim_3r(), motors, each, directions).values for each in positions])
def run():
    roots, _ = capability.fit_ellipsoids(positions, directions, speeds).roots(positions)
    ratios = 1 / (speeds * np.linalg.norm(roots @ directions.T, axis=1))
    return {"error": np.linalg.norm(ratios - 1 / ratios), "error of logarithms": np.linalg.norm(np.log(ratios))}
""",
        repeats=9,
    ),
    "steps of time-optimal control": Case(
        code="""
class Ellipses:
    lower, upper = np.array([-0.1, -0.3]), np.array([0.3, 0.1])
    def roots(self, positions):
        slowness, change = np.array([4.0, 6.0]) + positions * [10.0, -8.0], np.zeros((2, 2, 2))
        change[0, 0, 0], change[1, 1, 1] = 10.0, -8.0
        return slowness[..., None] * np.eye(2), np.broadcast_to(change, (*positions.shape[:-1], 2, 2, 2))
def run():
    steps = capability.time_optimal_control(Ellipses(), [-0.05, -0.25], [0.25, 0.05], horizon=10, period=2e-3)
    return {"arrival": steps.arrival}
"""
    ),
}


def run_case(
    case: Case, checkouts: Mapping[str, Path], caches: Path, rounds: int, *, cold: bool = False
) -> dict[str, dict[str, Any]]:
    """Return ``seconds`` of all rounds and the last ``values`` by name of every checkout; processes alternate."""
    code = SHARED + case.code + TIMED.format(repeats=0 if cold else case.repeats)
    results: dict[str, dict[str, Any]] = {name: {"seconds": []} for name in checkouts}
    for _ in range(rounds):
        for name, checkout in checkouts.items():
            if cold:
                shutil.rmtree(caches / name, ignore_errors=True)
            result = run_in(checkout, code, cache=caches / name, threads=1)
            results[name]["seconds"].append(result["seconds"])
            results[name]["values"] = result["values"]
    return results


def compare(name: str, now: float, before: float) -> tuple[str, bool]:
    """Return the words for a value and the one before, and whether it is worse by more than rounding."""
    gain = (now - before if name in MAXIMISED else before - now) / max(abs(before), np.finfo(float).tiny)
    if abs(gain) <= VALUE_TOLERANCE:
        return f"{name} {'the same bits' if now == before else 'equal to 1e-9'}", False
    return f"{name} {now:.5g} against {before:.5g}, {abs(gain):.1e} {'better' if gain > 0 else 'worse'}", gain < 0


def tabulate(name: str, case: Case, results: Mapping[str, Mapping[str, Any]]) -> Row:
    """Return a case's row: the ratio of the least seconds; the note has seconds, values, and missed goals."""
    now, before = results["now"], results["before"]
    seconds, reference = min(now["seconds"]), min(before["seconds"])
    values = [compare(name, now["values"][name], value) for name, value in before["values"].items()]
    notes = [f"{seconds:.3g} against {reference:.3g} s", *(words for words, _ in values)]
    if any(worse for _, worse in values):
        notes.insert(0, LOSS)
    return goal_row(TABLE, name, "times the seconds", "", seconds / reference, GOAL, "; ".join(notes))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the cases, print the table, losses first, and write the rows if ``--json`` names a file."""
    parser = study_parser(__doc__ or "")
    parser.add_argument("--before", type=Path, required=True, help="the other checkout")
    parser.add_argument("--cases", nargs="+", choices=list(CASES), metavar="NAME", help="only these")
    parser.add_argument("--rounds", type=int, default=2, help="processes of each checkout per case")
    parser.add_argument("--cold", action="store_true", help="first results with empty caches of compiled code")
    settings = parser.parse_args(arguments)
    checkouts = {"before": settings.before.resolve(), "now": ROOT}
    rows = list[Row]()
    with tempfile.TemporaryDirectory() as caches:
        for name in settings.cases or CASES:
            tell(name)
            try:
                results = run_case(CASES[name], checkouts, Path(caches), settings.rounds, cold=settings.cold)
            except RuntimeError as error:
                rows.append(Row(TABLE, name, "failed", "", np.nan, note=f"{LOSS}{error}"))
            else:
                rows.append(tabulate(name, CASES[name], results))
    report(losses_first(rows), json_file=settings.json)


if __name__ == "__main__":
    main()
