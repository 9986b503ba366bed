"""What a change of the library's inside costs or gains: ``python -m studies.benchmarks.refactoring --before DIR``.

Every case runs on another checkout and on this one, in processes that take turns. The first run of a process, which
compiles or loads what is compiled, is not counted; of the others the least processor time is. Values are held against
the other checkout's, the smaller the better where they are objectives of a minimum.

    python -m studies.benchmarks.refactoring --before DIR [--cases NAME ...] [--rounds N] [--json FILE]

Cases whose values may differ without either being wrong say why in their note.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console

from studies.benchmarks.checkouts import ROOT, run_in
from studies.reporting import Row, report

TABLE = "this checkout beside the one before"
GOAL = 1.05  # times the seconds before
VALUE_TOLERANCE = 1e-9  # relative


@dataclass(frozen=True, kw_only=True)
class Case:
    """Code that defines ``run()``, which returns the numbers it ends with, and how often a process repeats it.

    ``maximised`` says that the numbers are a hypervolume, ``reason`` why they may differ.
    """

    code: str
    repeats: int = 3
    maximised: bool = False
    reason: str = ""


SHARED = """
import json, time
import numpy as np
import paretoik as pk
from pymoo.indicators.hv import HV
from problems import kim_2021, marcos_2012, panda, tringali_2020, tringali_2021
arms, methods, capability = (getattr(pk, name, pk) for name in ("arms", "methods", "capability"))

def hypervolume(front, ideal, nadir):
    F = (front.minimised - np.array(ideal)) / (np.array(nadir) - np.array(ideal))
    return [float(HV(ref_point=np.full(F.shape[1], 1.1))(F))]
"""
TIMED = """
run()
seconds = []
for _ in range({repeats}):
    begin = time.process_time()
    values = run()
    seconds.append(time.process_time() - begin)
print(json.dumps({{"seconds": min(seconds), "values": [float(value) for value in values]}}))
"""
PLAN = """
from studies.benchmarks.planner.peers import tracking
problem = tracking("simulation_{number}", {masses!r})
def run():
    return [pk.plan(problem, seed=0).best.objective]
"""
LOOP = """
start = {start}
loop = marcos_2012.loop({links}, 0.7, blocked={blocked}, steps=10, generations=200, start=np.array(start))
def run():
    return [loop.run().drift]
"""
STARTS = {
    3: [-1.3, 1.26579276, 1.67196742],
    4: [5.335439423562647, -4.426791963408871, -0.9728216230198674, -3.1651527807926714],
}
EXACT = """
loop = marcos_2012.loop(3, 0.7, blocked={blocked}, steps=400, start=np.array({start}), as_printed=True)
task = loop.task
try:
    from paretoik.closed_loop.exact_loop import exact_steps
    run = lambda: exact_steps(task.truncate(100), loop.start, weight=0.5).sum(axis=0)
except ImportError:
    from paretoik.redundancy.extended_jacobian import exact_steps
    run = lambda: exact_steps(
        task.arm, task.targets[:100], loop.start, weight=0.5, obstacles=task.obstacles
    ).sum(axis=0)
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
    return hypervolume(pk.epsilon_front(problem, points=20, seed=0), [0.038, 0.049], [0.06, 0.1])
""",
        maximised=True,
    ),
    "certified front of 5 points, Panda": Case(
        code="""
problem = panda.across_the_table()
def run():
    return hypervolume(pk.epsilon_front(problem, points=5, seed=0), [0.62, 750.0, 0.006], [0.8, 1700.0, 0.03])
""",
        maximised=True,
        repeats=2,
    ),
    "directional front of 10 points, sliders": Case(
        code="""
problem = kim_2021.directions_dam()
def run():
    return hypervolume(pk.epsilon_front(problem, points=10, seed=0), [-0.054, -0.126, 0.0], [0.0, 0.0, 0.45])
""",
        maximised=True,
        reason="points stand elsewhere along the same front",
    ),
    "point-to-point front of 5 points, joint motors": Case(
        code="""
problem = kim_2021.point_to_point_jam()
def run():
    return hypervolume(pk.epsilon_front(problem, points=5, starts=4, seed=0), [1.5, 0.045], [3.6, 0.3])
""",
        maximised=True,
        repeats=1,
        reason="sweeps follow branches and try cold starts now: less work at the slow end, points stand elsewhere",
    ),
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
    "16 directional maxima, joint motors": Case(
        code="""
directions = np.stack([np.cos(np.arange(16) * np.pi / 8), np.sin(np.arange(16) * np.pi / 8)], axis=1)
arm, motors = arms.kim_3r(), capability.kim_joint_motors()
def run():
    return [-sum(pk.directional_maxima(arm, motors, kim_2021.PLACE, directions).values) for _ in range(20)]
""",
        repeats=5,
    ),
    "16 directional maxima, sliders": Case(
        code="""
directions = np.stack([np.cos(np.arange(16) * np.pi / 8), np.sin(np.arange(16) * np.pi / 8)], axis=1)
arm, motors = arms.kim_3r(), capability.kim_sliders()
def run():
    return [-sum(pk.directional_maxima(arm, motors, kim_2021.PLACE, directions).values) for _ in range(20)]
""",
        repeats=5,
    ),
    "PMKE along trajectory 1": Case(
        code="""
arm, path, start = arms.tringali_3r(), tringali_2021.trajectory(1), tringali_2021.START
method = methods.PredictiveKineticEnergy()
def run():
    return [pk.kinetic_energy(pk.resolve(arm, path, method, start=start, unreachable="track"))]
""",
        repeats=9,
    ),
    "steps of time-optimal control": Case(
        code="""
directions = np.stack([np.cos(np.arange(16) * np.pi / 8), np.sin(np.arange(16) * np.pi / 8)], axis=1)
arm, motors = arms.kim_3r(), capability.kim_joint_motors()
positions = np.stack(np.meshgrid(np.linspace(0.1, 0.2, 4), np.linspace(-0.2, -0.1, 4)), axis=-1).reshape(-1, 2)
speeds = np.stack([pk.directional_maxima(arm, motors, place, directions).values for place in positions])
model = capability.fit_ellipsoids(positions, directions, speeds)
def run():
    return [capability.time_optimal_control(model, kim_2021.START, kim_2021.TARGET, horizon=10, period=2e-3).arrival]
""",
        reason="ellipsoids are fitted by a convex program now, with less error: another fastest path",
    ),
}


def run_case(case: Case, checkouts: Mapping[str, Path], caches: Path, rounds: int) -> dict[str, dict[str, list[float]]]:
    """Return seconds of all rounds and the last values of every checkout; processes take turns."""
    code = SHARED + case.code + TIMED.format(repeats=case.repeats)
    results: dict[str, dict[str, list[float]]] = {name: {"seconds": []} for name in checkouts}
    for _ in range(rounds):
        for name, checkout in checkouts.items():
            result = run_in(checkout, code, cache=caches / name, threads=1)
            results[name]["seconds"].append(result["seconds"])
            results[name]["values"] = result["values"]
    return results


def tabulate(name: str, case: Case, results: Mapping[str, Mapping[str, Sequence[float]]]) -> Row:
    """Return a case's row: the ratio of the least seconds, and in the note seconds, values, and what was missed."""
    now, before = results["now"], results["before"]
    seconds, reference = min(now["seconds"]), min(before["seconds"])
    ratio = seconds / reference
    gain = np.array(before["values"]) - np.array(now["values"])
    gain = (-gain if case.maximised else gain) / np.maximum(np.abs(before["values"]), np.finfo(float).tiny)
    worst = float(gain.min())
    worse = worst < -VALUE_TOLERANCE
    notes = ["LOSS" if ratio > GOAL or (worse and not case.reason) else "", f"{seconds:.3g} beside {reference:.3g} s"]
    if worse:
        notes.append(f"values worse by {-worst:.1e}")
    else:
        better = f"values better by {gain.max():.1e}" if gain.max() > VALUE_TOLERANCE else "values equal to 1e-9"
        notes.append(better if gain.any() else "the same bits")
    notes += [case.reason] if gain.any() and case.reason else []
    return Row(
        table=TABLE,
        row=name,
        column="times the seconds",
        unit="",
        ours=ratio,
        paper=GOAL,
        note="; ".join(filter(None, notes)),
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the cases, print the table, losses first, and write the rows where ``--json`` says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", type=Path, required=True, help="the other checkout")
    parser.add_argument("--cases", nargs="+", choices=list(CASES), metavar="NAME", help="only these")
    parser.add_argument("--rounds", type=int, default=2, help="processes of each checkout a case")
    parser.add_argument("--json", type=Path, help="file to write the rows to")
    settings = parser.parse_args(arguments)
    checkouts = {"before": settings.before.resolve(), "now": ROOT}
    console, rows = Console(stderr=True), []
    with tempfile.TemporaryDirectory() as caches:
        for name in settings.cases or CASES:
            console.print(name, markup=False)
            try:
                results = run_case(CASES[name], checkouts, Path(caches), settings.rounds)
            except RuntimeError as error:
                rows.append(Row(table=TABLE, row=name, column="failed", unit="", ours=np.nan, note=f"LOSS; {error}"))
            else:
                rows.append(tabulate(name, CASES[name], results))
    report(sorted(rows, key=lambda row: not row.note.startswith("LOSS")), json_file=settings.json)


if __name__ == "__main__":
    main()
