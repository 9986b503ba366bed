"""The command ``paretoik``, and its sub-commands that prepare or make a run. A user's error is one line and a code."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from shutil import get_terminal_size
from signal import SIGTERM
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from paretoik.cli.choices import navigate, select
from paretoik.cli.console import (
    ClusterAddress,
    JsonFlag,
    Live,
    OutFolder,
    Overwrite,
    Problem,
    QuietFlag,
    RunFolder,
    RunProblem,
    Seed,
    SolverName,
    SolverOption,
    Starts,
    TimeLimit,
    Workers,
    agreed_problem,
    exit_code,
    finish_front,
    finish_plan,
    print_error,
    print_json,
    print_message,
    print_text,
    process_output,
    running,
    stdout_for_results,
)
from paretoik.cli.results import compare, export, report, show, verify
from paretoik.compilation_notices import list_compiled, print_line
from paretoik.errors import InvalidInput, ParetoikError
from paretoik.front.front import Front
from paretoik.inputs import shown
from paretoik.runs.files import RUN, read_run
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
    collision: Annotated[bool, typer.Option("--collision", help="Show the convex bodies of all links.")] = False,
    package: Annotated[
        list[str] | None, typer.Option(metavar="NAME=FOLDER", help="Folder of a package with meshes, with --collision.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """List the faults of a URDF file and the arm it describes.

    The arm is that of Arm.from_urdf. Similar warnings share one line, and long lists are cut; --json has every fault
    and every warning. Convex bodies have one row per link: how far they are outside the link's shapes, and their volume
    over that of the shapes.
    """
    from paretoik.robot.urdf import check_robot as check
    from paretoik.robot.urdf import report_text

    folders = dict[str, str | Path]()
    for each in package or ():
        name, separator, folder = each.partition("=")
        if not (name and separator and folder):
            raise InvalidInput(f"--package must be NAME=FOLDER, got {shown(each)}")
        folders[name] = Path(folder)
    report = check(
        file, base, tip, soft=soft, repair_inertias=repair_inertias, collision=collision, packages=folders or None
    )
    if as_json:
        said: dict[str, Any] = {"summary": report.summary, "warnings": report.warnings, "faults": report.faults}
        if collision:
            names, *rows = report.collision or ((),)
            said["collision"] = [dict(zip(names, row, strict=True)) for row in rows]
        print_json(said)
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
        raise InvalidInput(f"files must not be empty, got none, and there is no problems/*.py in {Path.cwd()}")
    rows, errors, silent = list[tuple[str, str]](), list[ParetoikError](), dict[str, list[str]]()
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
        print_message("note:", "bold", f"{text}; annotate the return type, such as -> Tracking, to list them")
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
    from paretoik.collision.obstacles import Circle, Sphere
    from paretoik.formulations.tracking import Tracking
    from paretoik.formulations.tuning import Tuning
    from paretoik.resolution import methods
    from paretoik.robot.arm import Arm
    from paretoik.robot.arms import tringali_3r
    from paretoik.robot.pose import Pose
    from paretoik.task.limits import Limits
    from paretoik.task.objectives import kinetic_energy, manipulability, torque_norm
    from paretoik.task.path import line

    planar, across = tringali_3r(), line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=11)
    both, obstacle, limits = [kinetic_energy, torque_norm], Circle([1.5, 1.5], 0.1), Limits(velocity=9.0)
    tracking = Tracking(planar, across, objectives=both, limits=limits, obstacles=[obstacle], link_radius=0.02, **CODED)
    solve(tracking, refine=True, **FEW)
    yield "Tracking, planar"

    front = epsilon_front(tracking, points=3, starts=2, observe=False)
    front.navigate(int(front.ids[0]), improve="torque_norm", allow="kinetic_energy")
    yield "epsilon_front, navigate"

    projected = methods.GradientProjection(criteria=[manipulability])
    followers = methods.WeightedLeastNorm(), methods.ConstrainedQP(), methods.PredictiveKineticEnergy()
    for method in (methods.PseudoInverse(), projected, *followers):
        resolve(planar, across, method, start=[0.0, 0.327, -0.754], unreachable="track", observe=False)
    solve(Tuning(planar, across, projected, judged_starts=2, tolerance=None), **FEW)
    yield "resolve, Tuning"

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


# The commands that make a run. An option that is also an argument of the verb has the same name, and is passed on.


OF_COMMAND = ("problem", "run", "quiet", "as_json")  # options that are not arguments of the verb


def arguments(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that a verb takes unchanged."""
    return {name: value for name, value in options.items() if name not in OF_COMMAND}


def solve(
    problem: Problem,
    out: OutFolder,
    population: Annotated[
        int | None, typer.Option(help="Size of the population (200; for a closed loop its own).")
    ] = None,
    generations: Annotated[
        int | None, typer.Option(help="Maximum number of generations (500; for a closed loop its own).")
    ] = None,
    points: Annotated[int, typer.Option(help="Maximum number of points, spread over the front.")] = 200,
    seed: Annotated[int | None, typer.Option(help="Seed of all random numbers (0).")] = None,
    islands: Annotated[int, typer.Option(help="Number of populations; some points migrate to the next one.")] = 1,
    time_limit: TimeLimit = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
    evaluation_timeout: Annotated[
        float | None, typer.Option(help="Seconds after which an evaluation is ended and fails.")
    ] = None,
    refine: Annotated[bool, typer.Option("--refine", help="Use gradients; add optima and certificates.")] = False,
    solver: Annotated[
        SolverName,
        typer.Option(help="Solver of --refine: interior points (smooth functions), or SQP by Clarabel (any)."),
    ] = "auto",
    record_steps: Annotated[
        list[int] | None,
        typer.Option("--record-step", help="Step of a closed loop whose generations are recorded; may be repeated."),
    ] = None,
    live: Live = False,
    overwrite: Overwrite = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Search for the front of a problem, or run a closed loop.

    Ctrl-C ends it early and keeps the result.
    """
    given = {**arguments(locals()), "record_steps": record_steps or ()}
    with running(out, quiet=quiet, time_limit=time_limit) as observe:
        from paretoik.api.load import named_problem
        from paretoik.api.solve import solve as solve_problem

        loaded = named_problem(problem, time_limit=time_limit, evaluation_timeout=evaluation_timeout)
        result = solve_problem(loaded, **given, reference=problem, observe=observe)
    finish_front(result, out, as_json=as_json)


def plan(
    problem: Problem,
    out: OutFolder,
    starts: Starts = None,
    seed: Seed = 0,
    solver: SolverOption = "auto",
    time_limit: TimeLimit = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
    overwrite: Overwrite = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Find the distinct optima of one objective.

    Ctrl-C ends it early and keeps the result.
    """
    given = arguments(locals())
    with running(out, quiet=quiet, time_limit=time_limit) as observe:
        from paretoik.api.load import named_problem
        from paretoik.api.plan import plan as find_plan

        loaded = named_problem(problem, time_limit=time_limit)
        result = find_plan(loaded, **given, reference=problem, observe=observe)
    finish_plan(result, loaded.names[0], loaded.units[0], out, as_json=as_json)


def front(
    problem: Problem,
    out: OutFolder,
    points: Annotated[int, typer.Option(help="Maximum number of points, spread over the front.")] = 20,
    starts: Starts = None,
    seed: Seed = 0,
    solver: SolverOption = "auto",
    time_limit: TimeLimit = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
    overwrite: Overwrite = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Find a certified front by gradients only.

    One objective is minimised while the others are bounded by ε, one level after another.
    Ctrl-C ends it early and keeps the result.
    """
    given = arguments(locals())
    with running(out, quiet=quiet, time_limit=time_limit) as observe:
        from paretoik.api.epsilon_front import epsilon_front
        from paretoik.api.load import named_problem

        loaded = named_problem(problem, time_limit=time_limit)
        result = epsilon_front(loaded, **given, reference=problem, observe=observe)
    finish_front(result, out, as_json=as_json)


def refine(
    run: RunFolder,
    out: OutFolder,
    problem: RunProblem = None,
    solver: SolverOption = "auto",
    time_limit: TimeLimit = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
    overwrite: Overwrite = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Refine and certify the front of a run, as a new run.

    No certified point becomes worse in any objective. Other points may become worse by about 1e-4 of a range if limits
    between samples require it. Ctrl-C ends it early and keeps the result.
    """
    given = arguments(locals())
    with running(out, quiet=quiet, time_limit=time_limit) as observe:
        from paretoik.api.load import load_front
        from paretoik.api.refine import refine as refine_front

        problem = agreed_problem(run, problem, needed=True)
        loaded = load_front(run, problem)
        if problem is None:
            raise InvalidInput(
                f"{run} must be a run that names its problem, got one made without reference=; --problem FILE.py:NAME "
                "names it, or in Python paretoik.refine(load_front(run), problem)"
            )
        result = refine_front(loaded, **given, observe=observe)
    finish_front(result, out, as_json=as_json)


def resume(
    run: RunFolder,
    problem: RunProblem = None,
    generations: Annotated[int | None, typer.Option(help="Generations to add to a finished search.")] = None,
    time_limit: TimeLimit = None,
    workers: Workers = None,
    cluster: ClusterAddress = None,
    live: Live = False,
    quiet: QuietFlag = False,
    as_json: JsonFlag = False,
) -> None:
    """Resume a stopped or killed run, or continue a finished search.

    The result is that of a run that never stopped.
    """
    given = arguments(locals())
    with running(run, quiet=quiet, time_limit=time_limit) as observe:
        from paretoik.api.resume import resume as resume_run

        result = resume_run(run, agreed_problem(run, problem, needed=True), **given, observe=observe)
    if isinstance(result, Front):
        finish_front(result, run, as_json=as_json)
    objective = read_run(run / RUN)["objective"]
    finish_plan(result, objective["name"], objective["unit"], run, as_json=as_json)


# The command itself: its sub-commands, their errors and the exit codes.


USAGE_ERRORS: Any = typer.BadParameter.__base__  # base of all errors of the parser; it has no public name


class Commands(TyperGroup):
    """The sub-commands. Wrong arguments, and a signal before there is a result, are reported in one line."""

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Return the context of a command line. Raises InvalidInput for wrong arguments."""
        with _one_line():
            return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: Any) -> object:
        """Run a sub-command."""
        try:
            with _one_line():
                return super().invoke(ctx)
        except (KeyboardInterrupt, SystemExit) as end:
            if isinstance(end, SystemExit) and end.code != 128 + SIGTERM:
                raise
            print_error("interrupted before there was a whole result", end)
            sys.exit(exit_code("no result"))


@contextmanager
def _one_line() -> Iterator[None]:
    """Turn the parser's errors into InvalidInput."""
    try:
        yield
    except USAGE_ERRORS as error:
        if type(error).__name__ == "NoArgsIsHelpError":
            raise
        about = "paretoik" if error.ctx is None else error.ctx.command_path
        text = error.format_message().rstrip(".")
        raise InvalidInput(f"{text}; see '{about} --help'") from None


app = typer.Typer(
    cls=Commands,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="The whole Pareto front of joint motions for a redundant arm.",
    epilog="Exit codes: 0 done, 2 bad input, 3 infeasible, 4 all evaluations failed or no solver had a solution, "
    "5 stopped by a limit or 130 or 143 interrupted (the result is kept), 6 interrupted without a result, "
    "7 verification failed.",
)
COMMANDS = (
    *(list_problems, solve, plan, front, refine, resume, select, navigate, show, export, report, compare, verify),
    *(warmup, check_robot),
)  # in the order of the help
for command in COMMANDS:
    app.command({list_problems: "list", check_robot: "check-robot"}.get(command))(command)


def main() -> None:
    """Run the command line."""
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_, **__: print_message("warning:", "yellow", str(message))
        try:
            with process_output():
                app(prog_name="paretoik")
        except ParetoikError as error:
            print_error(str(error), error)
            sys.exit(error.exit_code)


def _print_version(requested: bool) -> bool:
    if requested:
        from paretoik import __version__

        print(f"paretoik {__version__}")
        raise typer.Exit
    return requested


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass
