"""Small runs of every kind, and their problems."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import paretoik as pk
from problems import kim_2021
from problems.marcos_2012 import loop as marcos_loop

ARM = pk.arms.tringali_3r()
LINE = pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=13)
LIMITS = {"position": 2.5, "velocity": 3.0, "acceleration": 30.0, "torque": 2.0, "power": 3.0}
BOTH = (pk.kinetic_energy, pk.torque_norm)
TUNED = [pk.kinetic_energy, pk.measures.tracking_error, pk.measures.speed_ratio]
SMALL: dict[str, Any] = {"population": 12, "generations": 5, "seed": 1, "observe": False}


@pk.objective(unit="rad²/s", form="integral")
def wrist_effort(motion: pk.Motion) -> Any:
    return motion.dq[..., -1] ** 2


def tracking(
    *objectives: Any, path: Any = LINE, limits: Mapping[str, float] | None = None, **options: Any
) -> pk.Tracking:
    return pk.Tracking(
        ARM,
        path,
        objectives=objectives or BOTH,
        limits=pk.Limits(**(limits or LIMITS)),
        coefficients=4,
        bases=2,
        **options,
    )


def cyclic() -> pk.Tracking:
    path = pk.circle([0.3, 0.05], 0.08, duration=1.5, samples=13)
    return pk.Tracking(ARM, path, objectives=BOTH, cyclic=True, coefficients=4, bases=2)


def obstructed() -> pk.Tracking:
    obstacles = [pk.obstacles.Circle([0.1, 0.25], 0.03), pk.obstacles.Box([-0.2, 0.1], [0.05, 0.05])]
    objectives = (pk.kinetic_energy, pk.obstacle_clearance, wrist_effort)
    return tracking(*objectives, obstacles=obstacles, link_radius=0.01)


def spatial() -> pk.Tracking:
    urdf = Path(__file__).parents[3] / "problems" / "robots" / "panda.urdf"
    arm = pk.Arm.from_urdf(urdf, base="panda_link0", tip="panda_hand_tcp")
    path = pk.line([0.45, -0.25, 0.3], [0.45, 0.25, 0.3], duration=1.5, samples=9)
    objectives = [pk.kinetic_energy, pk.joint_limit_distance, pk.manipulability]
    return pk.Tracking(arm, path, objectives=objectives, coefficients=4, bases=2)


def tuned(**options: Any) -> pk.Tuning:
    method = pk.methods.DampedLeastSquares(damping=0.05)
    arm = replace(ARM, position_limits=np.tile([-2.5, 2.5], (3, 1)))
    return pk.Tuning(arm, LINE, method, starts=tracking().encoding.charts.base[:3, 0], tolerance=None, **options)


def navigate(problem: Any, out: Path) -> None:
    front = pk.epsilon_front(problem, points=4, starts=4, observe=False)
    front.navigate(front[front.ids[1]], improve="kinetic_energy", by=0.1 * np.ptp(front.ranges[0])).save(out)


def resolve(problem: Any, out: Path) -> None:
    method, start = pk.methods.DampedLeastSquares(damping=0.05), problem.encoding.charts.base[0][0]
    pk.resolve(ARM, problem.task.tasks[0].path, method, start=start, unreachable="track", out=out)


def make_polygon(problem: Any, out: Path) -> None:
    pk.directional_maxima(problem.arm, problem.actuation, problem.position, directions=4, out=out)


def search(problem: Any, out: Path, **settings: Any) -> None:
    pk.solve(problem, **SMALL, **settings, out=out)


SWEEP = partial(pk.epsilon_front, points=4, starts=4, observe=False)
KINDS: dict[str, tuple[Callable[[], Any], Callable[..., Any]]] = {
    "search": (tracking, search),
    "backward": (partial(tracking, limits={"velocity": 4.0}, differences="backward"), search),
    "obstacles": (obstructed, search),
    "spatial": (spatial, search),
    "islands": (tracking, partial(search, islands=2)),
    "refined search": (tracking, partial(search, refine=True)),
    "refined search of directions": (kim_2021.directions_jam, partial(search, refine=True)),
    "refined search from point to point": (kim_2021.point_to_point_jam, partial(search, refine=True)),
    "refinement": (tracking, lambda problem, out: pk.refine(pk.solve(problem, **SMALL), out=out, observe=False)),
    "navigation": (tracking, navigate),
    "tuning": (tuned, search),
    "tuning from one start": (partial(tuned, judged_starts=1, objectives=TUNED), search),
    "certified": (tracking, SWEEP),
    "certified cyclic": (cyclic, SWEEP),
    "plan": (partial(tracking, pk.kinetic_energy), partial(pk.plan, starts=6, observe=False)),
    "closed loop": (
        partial(marcos_loop, 3, 0.7, blocked=True, steps=20, population=20, generations=8),
        partial(pk.solve, observe=False),
    ),
    "directional maxima": (kim_2021.directions_jam, search),
    "point to point": (kim_2021.point_to_point_jam, search),
    "resolved": (partial(tracking, limits={"velocity": 4.0}, differences="backward"), resolve),
    "polygon": (kim_2021.directions_jam, make_polygon),
}
"""By name: the function that makes the problem, and the one that runs it into a folder."""


def make_run(kind: str, folder: Path) -> tuple[Any, Any]:
    """Make a good run in a folder; return its problem, and the subject that its motions are verified against."""
    make_problem, run = KINDS[kind]
    problem = make_problem()
    run(problem, out=folder)
    return problem, problem.arm if kind == "polygon" else problem
