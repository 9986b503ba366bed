"""``paretoik export``: hand a motion of a run to a robot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from paretoik.cli.console import (
    JsonFlag,
    RunFolder,
    RunProblem,
    agreed_problem,
    print_json,
    print_text,
    stdout_for_results,
)
from paretoik.errors import InvalidInput

if TYPE_CHECKING:  # keeps the start of the command line quick
    from paretoik.front.front import Choice
    from paretoik.joint_trajectory.trajectory import JointTrajectory
    from paretoik.task.motion import Motion

ENDINGS = {"csv": ".csv", "parquet": ".parquet", "npz": ".npz", "joint-trajectory": ".yaml", "ros2-bag": "_bag"}


def export(
    run: RunFolder,
    point: Annotated[
        int | None, typer.Option(help="Id of the point instead of the present choice.", show_default=False)
    ] = None,
    format: Annotated[
        Literal["csv", "parquet", "npz", "joint-trajectory", "ros2-bag"] | None,
        typer.Option(help="Format (the ending of --out, or else csv).", show_default=False),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(help="Samples per second (the controller's; else as many as the motion has).", show_default=False),
    ] = None,
    controller: Annotated[
        str | None,
        typer.Option(
            help="Controller whose limits must hold: franka, ur or kinova, or one of panda, fr3, ur3e, ur5e, ur10e, "
            "ur16e, gen3, or your own pk.controllers.Controller, FILE.py:NAME, whose file is run.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="File to write, or folder of a bag (point-ID in the run).", show_default=False)
    ] = None,
    slow_down: Annotated[
        bool, typer.Option("--slow-down", help="Slow down as little as the controller's limits ask for.")
    ] = False,
    time_scale: Annotated[float, typer.Option(help="Factor by which to slow down.")] = 1.0,
    ramp: Annotated[float, typer.Option(help="Seconds in which to start from rest, and to stop.")] = 0.0,
    joints: Annotated[
        str | None, typer.Option(help="Order of the joints: NAME,NAME (the arm's).", show_default=False)
    ] = None,
    problem: RunProblem = None,
    overwrite: Annotated[bool, typer.Option(help="Replace a file that is there.")] = False,
    as_json: JsonFlag = False,
) -> None:
    """Write the motion of a point for a robot: sampled at a controller's rate, and checked against its limits.

    Points of a plan are its optima; the default is the best one.
    """
    with stdout_for_results():
        from paretoik.api.export import export as export_motion
        from paretoik.api.result import holds_plan
        from paretoik.loading import load_value

        limits = load_value("controller", controller) if controller is not None and ":" in controller else controller
        named = agreed_problem(run, problem, needed=True)
        id, motion, about, which = (_optimum if holds_plan(run) else _point)(run, point, named)
        place = out or run / f"point-{id}{ENDINGS[format or 'csv']}"
        trajectory = export_motion(
            motion,
            place,
            format=format or ("csv" if out is None else None),
            rate=rate,
            controller=limits,
            joint_names=None if joints is None else [name.strip() for name in joints.split(",")],
            time_scale=time_scale,
            slow_down=slow_down,
            ramp=ramp,
            metadata={"run": run, **about},
            overwrite=overwrite,
        )
    if as_json:
        print_json(
            {**trajectory.metadata, "out": place, "samples": len(trajectory.time), "seconds": trajectory.time[-1]}
        )
    else:
        print_text(_text(trajectory, place, which=which if point is None else ""))


def _point(run: Path, point: int | None, problem: str | None) -> tuple[int, Choice, dict[str, Any], str]:
    """Return a point of a front or the present choice: its id, the choice, metadata, and which default it is."""
    from paretoik.api.load import load_front
    from paretoik.front.choice_tree import pick_point

    front = load_front(run, problem)
    choice = pick_point(front, point, name="--point")
    objectives = {
        name: _with_unit(value, unit)
        for name, unit, value in zip(front.names, front.units, choice.objectives, strict=True)
    }
    which = " (the present choice)" if len(front) > 1 else ""
    return choice.id, choice, {"problem": front.provenance.get("problem"), "objectives": objectives}, which


def _optimum(run: Path, point: int | None, problem: str | None) -> tuple[int, Motion, dict[str, Any], str]:
    """Return an optimum of a plan or the best, as ``_point`` does; raises InvalidInput without one."""
    from paretoik.api.load import load_plan
    from paretoik.runs.files import RUN, read_run

    plan, id = load_plan(run, problem), 0 if point is None else point
    if not 0 <= id < len(plan.optima):
        raise InvalidInput(f"--point must be an optimum from 0 to {len(plan.optima) - 1}, got {id}")
    optimum, objective = plan.optima[id], read_run(run / RUN)["objective"]
    return (
        id,
        optimum.motion,
        {
            "problem": plan.provenance.get("problem"),
            "point": id,
            "objectives": {objective["name"]: _with_unit(optimum.objective, objective["unit"])},
        },
        " (the best)",
    )


def _with_unit(value: float, unit: str) -> str:
    return f"{value:.6g} {unit}".rstrip()


def _text(trajectory: JointTrajectory, place: Path, *, which: str) -> str:
    made: dict[str, Any] = dict(trajectory.metadata)
    scaled = f", slowed down {made['time_scale']:.4g} times" if made["time_scale"] > 1 else ""
    ramped = f", with ramps of {made['ramp']:g} s" if made["ramp"] else ""
    lines = [
        f"{place}: point {made['point']}{which}, {len(trajectory.time)} samples of {len(trajectory.joint_names)} "
        f"joints at {made['rate']:g} Hz, {trajectory.time[-1]:g} s{scaled}{ramped}"
    ]
    if made["controller"] is None:
        lines.append("not checked against a controller's limits: --controller NAME does it")
    else:
        uses = ", ".join(f"{kind} {100 * use:.3g} %" for kind, use in made["use of limits"].items())
        lines.append(f"within the limits of {made['controller']}; the motion uses: {uses}")
        if made["rate"] < made["controller rate"]:
            lines.append(
                f"this was checked at the controller's {made['controller rate']:g} Hz; how it interpolates between "
                f"these samples at {made['rate']:g} Hz is not checked"
            )
    return "\n".join(lines)
