"""``paretoik list``, ``check-robot`` and ``warmup``: preparations for the first run."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from shutil import get_terminal_size
from typing import Annotated, Any

import typer

from paretoik.cli.console import JsonFlag, QuietFlag, print_json, print_message, print_text, stdout_for_results
from paretoik.compilation_notices import list_compiled, print_line
from paretoik.errors import InvalidInput, ParetoikError
from paretoik.tables import SCREEN, columns, wrap_text

# ``paretoik check-robot``: the faults of a URDF file.


def check_robot(
    file: Annotated[Path, typer.Argument(help="A URDF file.")],
    base: Annotated[str | None, typer.Option(help="First link of the chain (the root).")] = None,
    tip: Annotated[str | None, typer.Option(help="Last link of the chain (the only leaf).")] = None,
    soft: Annotated[bool, typer.Option("--soft", help="Take the limits of safety controllers.")] = False,
    repair_inertias: Annotated[
        bool, typer.Option("--repair-inertias", help="Replace impossible inertias by the nearest possible ones.")
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """List the faults of a URDF file and the arm it describes.

    The arm is that of Arm.from_urdf. Similar warnings are printed as one line with the first names, and of many lines
    only the first ones are printed. --json has every fault and every warning.
    """
    from paretoik.robot.urdf import check_robot as check
    from paretoik.robot.urdf import report_text

    report = check(file, base, tip, soft=soft, repair_inertias=repair_inertias)
    if as_json:
        print_json({"summary": report.summary, "warnings": report.warnings, "faults": report.faults})
    else:
        print_text(wrap_text(report_text(report), get_terminal_size((SCREEN.width, SCREEN.lines)).columns))
    if report.faults:
        raise typer.Exit(InvalidInput.exit_code)


# ``paretoik list``: the problems that files offer.


def list_problems(
    files: Annotated[list[str] | None, typer.Argument(help="Problem files; problems/*.py if none.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """List the problems that files offer."""
    from paretoik.loading import problems_in

    places = dict.fromkeys(files or sorted(str(file) for file in Path("problems").glob("[!_]*.py")))
    if not places:
        raise InvalidInput(f"files must be at least one, got none, and there is no problems/*.py in {Path.cwd()}")
    rows: list[tuple[str, str]] = []
    errors: list[ParetoikError] = []
    silent: dict[str, list[str]] = {}
    for place in places:
        try:
            with stdout_for_results():
                offered, silent[place] = problems_in(place)
                rows += [(f"{place}:{name}", about) for name, about in offered.items()]
        except ParetoikError as fault:
            errors.append(fault)
    if as_json:
        print_json([{"problem": name, "about": about} for name, about in rows])
    else:
        print_text(columns(rows))
    for place, names in silent.items():
        if not names:
            continue
        text = f"{place} has functions that do not say what they return and may be problems too: {', '.join(names)}"
        print_message("note:", "bold", f"{text}; an annotation, as -> Tracking, lists them")
    for error in errors:
        print_message("error:", "bold red", str(error))
    if errors:
        raise typer.Exit(errors[0].exit_code)


# ``paretoik warmup``: compile everything once, before the first run needs it.


def warmup(quiet: QuietFlag = False, as_json: JsonFlag = False) -> None:
    """Compile the code of every kind of problem.

    Otherwise each kind is compiled in its first run. The command solves small problems, and takes a few minutes once.
    It prints one line per compiled function, with its compile time.
    """
    compiled: list[tuple[str, float]] = []

    def tell(name: str, seconds: float) -> None:
        compiled.append((name, seconds))
        if not quiet:
            print_line(f"{name.removeprefix('paretoik.')}: {seconds:.1f} s")

    began = time.monotonic()
    with stdout_for_results(), warnings.catch_warnings(action="ignore"), list_compiled(tell):
        for kind in solved_kinds():
            if not quiet:
                print_line(f"{kind} is ready")
    took = time.monotonic() - began
    if as_json:
        print_json({"compiled": [{"name": name, "seconds": seconds} for name, seconds in compiled], "seconds": took})
    else:
        print_text(f"{len(compiled)} functions compiled in {took:.0f} s; all others were compiled before")


FEW: dict[str, Any] = {"population": 8, "generations": 2, "points": 4, "observe": False}
CODED: dict[str, Any] = {"coefficients": 4, "bases": 2}


def solved_kinds() -> Iterator[str]:
    """Solve one small problem of every kind; yield each kind's name."""
    yield from _solved_paths()
    from paretoik.api.directional_maxima import directional_maxima
    from paretoik.api.solve import solve
    from paretoik.capability.actuation import kim_joint_motors
    from paretoik.formulations.closed_loop import ClosedLoop
    from paretoik.formulations.directional_maxima import DirectionalMaxima
    from paretoik.formulations.point_to_point import PointToPoint
    from paretoik.robot.arms import kim_3r, marcos_nr
    from paretoik.task.path import circle

    around = circle((0.7, 0.0), 0.5, duration=0.01, samples=5, turns=0.011, timing="uniform")
    solve(ClosedLoop(marcos_nr(3), around, population=8, generations=2), observe=False)
    yield "ClosedLoop"

    arm, motors = kim_3r(), kim_joint_motors()
    directional_maxima(arm, motors, [0.2, -0.15], observe=False)
    solve(DirectionalMaxima(arm, motors, [0.2, -0.15], [[1.0, 0.0], [0.0, 1.0]], starts=8), **FEW)
    yield "DirectionalMaxima"

    solve(PointToPoint(arm, motors, [0.1, -0.15], [0.2, -0.15], samples=7, **CODED), refine=True, **FEW)
    yield "PointToPoint"


def _solved_paths() -> Iterator[str]:
    """Solve a planar and a spatial tracking problem; yield their kinds' names."""
    import numpy as np

    from paretoik.api.epsilon_front import epsilon_front
    from paretoik.api.plan import plan
    from paretoik.api.resolve import resolve
    from paretoik.api.solve import solve
    from paretoik.formulations.tracking import Tracking
    from paretoik.resolution.methods import ConstrainedQP, PseudoInverse
    from paretoik.robot.arm import Arm
    from paretoik.robot.arms import tringali_3r
    from paretoik.robot.pose import Pose
    from paretoik.task.limits import Limits
    from paretoik.task.objectives import kinetic_energy, torque_norm
    from paretoik.task.obstacles import Circle, Sphere
    from paretoik.task.path import line

    planar, across = tringali_3r(), line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=11)
    both, obstacle, limits = [kinetic_energy, torque_norm], Circle([1.5, 1.5], 0.1), Limits(velocity=9.0)
    tracking = Tracking(planar, across, objectives=both, limits=limits, obstacles=[obstacle], link_radius=0.02, **CODED)
    solve(tracking, refine=True, **FEW)
    yield "Tracking, planar"

    front = epsilon_front(tracking, points=3, starts=2, observe=False)
    front.navigate(int(front.ids[0]), improve="torque_norm", allow="kinetic_energy")
    yield "epsilon_front, navigate"

    for method in (PseudoInverse(), ConstrainedQP()):
        resolve(planar, across, method, start=[0.0, 0.327, -0.754], unreachable="track", observe=False)
    yield "resolve"

    spatial = Arm.from_dh(
        a=[0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088],
        alpha=(np.pi / 2 * np.array([0, -1, 1, 1, -1, 1, 1])).tolist(),
        d=[0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.107],
        theta=[0.0] * 7,
        convention="modified",
        masses=[1.0] * 7,
        centers=np.zeros((7, 3)),
        inertias=np.tile(0.01 * np.eye(3), (7, 1, 1)),
        position_limits=2.8,
    )
    down = [Pose.from_rpy([0.45, y, 0.4], [np.pi, 0.0, 0.0]) for y in (-0.05, 0.05)]
    path, ball = line(*down, duration=1.0, samples=9), Sphere([2.0, 0.0, 0.5], 0.1)
    reach = Tracking(spatial, path, objectives=[kinetic_energy], obstacles=[ball], link_radius=0.02, **CODED)
    solve(reach, **FEW)
    plan(reach, starts=1, observe=False)
    yield "Tracking, spatial"
