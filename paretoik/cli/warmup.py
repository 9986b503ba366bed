"""``paretoik warmup``: compile everything once, before the first run needs it."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from typing import Any

from paretoik.cli.console import JsonFlag, QuietFlag, print_json, print_text, stdout_for_results
from paretoik.compilation_notices import list_compiled, print_line


def warmup(quiet: QuietFlag = False, as_json: JsonFlag = False) -> None:
    """Compile the code of every kind of problem, which otherwise happens in the first run of each.

    It solves small problems, and takes a few minutes once. One line per compiled function says how long it took.
    """
    compiled: list[tuple[str, float]] = []

    def tell(name: str, seconds: float) -> None:
        compiled.append((name, seconds))
        if not quiet:
            print_line(f"{name.removeprefix('paretoik.')}: {seconds:.1f} s")

    began = time.monotonic()
    with stdout_for_results(), warnings.catch_warnings(action="ignore"), list_compiled(tell):
        for kind in _solved_kinds():
            if not quiet:
                print_line(f"{kind} is ready")
    took = time.monotonic() - began
    if as_json:
        print_json({"compiled": [{"name": name, "seconds": seconds} for name, seconds in compiled], "seconds": took})
    else:
        print_text(f"{len(compiled)} functions compiled in {took:.0f} s; all others were compiled before")


def _solved_kinds() -> Iterator[str]:
    """Solve one small problem of every kind; yield the kind's name after each."""
    import numpy as np

    from paretoik.api.directional_maxima import directional_maxima
    from paretoik.api.epsilon_front import epsilon_front
    from paretoik.api.plan import plan
    from paretoik.api.resolve import resolve
    from paretoik.api.solve import solve
    from paretoik.capability.actuation import kim_joint_motors
    from paretoik.formulations.closed_loop import ClosedLoop
    from paretoik.formulations.directional_maxima import DirectionalMaxima
    from paretoik.formulations.point_to_point import PointToPoint
    from paretoik.formulations.tracking import Tracking
    from paretoik.resolution.methods import ConstrainedQP, PseudoInverse
    from paretoik.robot.arm import Arm
    from paretoik.robot.arms import kim_3r, marcos_nr, tringali_3r
    from paretoik.robot.pose import Pose
    from paretoik.task.limits import Limits
    from paretoik.task.objectives import kinetic_energy, torque_norm
    from paretoik.task.obstacles import Circle, Sphere
    from paretoik.task.path import circle, line

    few: dict[str, Any] = {"population": 8, "generations": 2, "points": 4, "observe": False}
    planar, across = tringali_3r(), line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=11)
    coded: dict[str, Any] = {"coefficients": 4, "bases": 2}
    tracking = Tracking(
        planar,
        across,
        objectives=[kinetic_energy, torque_norm],
        limits=Limits(velocity=9.0),
        obstacles=[Circle([1.5, 1.5], 0.1)],
        link_radius=0.02,
        **coded,
    )
    solve(tracking, refine=True, **few)
    yield "Tracking, planar"

    front = epsilon_front(tracking, points=3, starts=2, observe=False)
    front.navigate(front.ids[0], improve="torque_norm", allow="kinetic_energy")
    yield "epsilon_front, navigate"

    zeros = [0.0] * 7
    spatial = Arm.from_dh(
        a=[0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088],
        alpha=(np.pi / 2 * np.array([0, -1, 1, 1, -1, 1, 1])).tolist(),
        d=[0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.107],
        theta=zeros,
        convention="modified",
        masses=[1.0] * 7,
        centers=np.zeros((7, 3)),
        inertias=np.tile(0.01 * np.eye(3), (7, 1, 1)),
        position_limits=2.8,
    )
    down = [Pose.from_rpy([0.45, y, 0.4], [np.pi, 0.0, 0.0]) for y in (-0.05, 0.05)]
    reach = Tracking(
        spatial,
        line(*down, duration=1.0, samples=9),
        objectives=[kinetic_energy],
        obstacles=[Sphere([2.0, 0.0, 0.5], 0.1)],
        link_radius=0.02,
        **coded,
    )
    solve(reach, **few)
    plan(reach, starts=1, observe=False)
    yield "Tracking, spatial"

    around = circle((0.7, 0.0), 0.5, duration=0.01, samples=5, turns=0.011, timing="uniform")
    solve(ClosedLoop(marcos_nr(3), around, population=8, generations=2), observe=False)
    yield "ClosedLoop"

    arm, motors = kim_3r(), kim_joint_motors()
    directional_maxima(arm, motors, [0.2, -0.15], observe=False)
    solve(DirectionalMaxima(arm, motors, [0.2, -0.15], np.eye(2), starts=8), **few)
    yield "DirectionalMaxima"

    solve(PointToPoint(arm, motors, [0.1, -0.15], [0.2, -0.15], samples=7, **coded), refine=True, **few)
    yield "PointToPoint"

    for method in (PseudoInverse(), ConstrainedQP()):
        resolve(planar, across, method, start=[0.0, 0.327, -0.754], unreachable="track", observe=False)
    yield "resolve"
