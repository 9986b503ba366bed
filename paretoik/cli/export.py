"""``paretoik export``: hand a motion of a run to a robot."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from paretoik.cli.console import JsonFlag, RunFolder, print_json
from paretoik.errors import InvalidInput

if TYPE_CHECKING:  # so that the command line starts quickly
    from paretoik.front.front import Choice, Front
    from paretoik.joint_trajectory.trajectory import JointTrajectory

ENDINGS = {"csv": ".csv", "parquet": ".parquet", "npz": ".npz", "joint-trajectory": ".yaml", "ros2-bag": "_bag"}


def export(
    run: RunFolder,
    point: Annotated[
        int | None, typer.Option(help="Id of the point instead of the present choice.", show_default=False)
    ] = None,
    format: Annotated[
        Literal["csv", "parquet", "npz", "joint-trajectory", "ros2-bag"] | None,
        typer.Option(help="What to write: the ending of --out, or else csv.", show_default=False),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(help="Samples a second (the controller's; else as many as the motion has).", show_default=False),
    ] = None,
    controller: Annotated[
        str | None,
        typer.Option(
            help="Whose limits must hold: franka, ur or kinova, or one of panda, fr3, ur3e, ur5e, ur10e, ur16e, gen3.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="File, of a bag a folder, to write (point-ID in the run).", show_default=False)
    ] = None,
    slow_down: Annotated[
        bool, typer.Option("--slow-down", help="Slow down as little as the controller's limits ask for.")
    ] = False,
    time_scale: Annotated[float, typer.Option(help="Slow down so many times.")] = 1.0,
    ramp: Annotated[float, typer.Option(help="Start from rest and stop, each within so many seconds.")] = 0.0,
    joints: Annotated[
        str | None, typer.Option(help="Order of the joints: NAME,NAME (the arm's).", show_default=False)
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Replace a file that is there.")] = False,
    as_json: JsonFlag = False,
) -> None:
    """Write the motion of a point for a robot: sampled at a controller's rate, and checked against its limits."""
    with redirect_stdout(sys.stderr):  # a user's functions may print, and stdout is for the result
        from paretoik.api.export import export as export_motion
        from paretoik.api.load_front import load_front

        front = load_front(run)
        choice = _choice(front, point)
        place = out or run / f"point-{choice.id}{ENDINGS[format or 'csv']}"
        objectives = {
            name: f"{value:.6g} {unit}".rstrip()
            for name, unit, value in zip(front.names, front.units, choice.objectives, strict=True)
        }
        trajectory = export_motion(
            choice,
            place,
            format=format or ("csv" if out is None else None),
            rate=rate,
            controller=controller,
            joint_names=None if joints is None else [name.strip() for name in joints.split(",")],
            time_scale=time_scale,
            slow_down=slow_down,
            ramp=ramp,
            metadata={"run": run, "problem": front.provenance.get("problem"), "objectives": objectives},
            overwrite=overwrite,
        )
    if as_json:
        print_json(
            {**trajectory.metadata, "out": place, "samples": len(trajectory.time), "seconds": trajectory.time[-1]}
        )
    else:
        print(_text(trajectory, place))


def _choice(front: Front, point: int | None) -> Choice:
    """Return the point, or the present choice; raises InvalidInput where there is none."""
    from paretoik.front.choices import chosen

    choice = chosen(front) if point is None else front[point]
    if choice is None:
        raise InvalidInput("--point: the id of a point wanted, got none, and paretoik select has kept no choice")
    return choice


def _text(trajectory: JointTrajectory, place: Path) -> str:
    made: dict[str, Any] = dict(trajectory.metadata)
    scaled = f", slowed down {made['time_scale']:.4g} times" if made["time_scale"] > 1 else ""
    ramped = f", with ramps of {made['ramp']:g} s" if made["ramp"] else ""
    lines = [
        f"{place}: point {made['point']}, {len(trajectory.time)} samples of {len(trajectory.joint_names)} joints at "
        f"{made['rate']:g} Hz, {trajectory.time[-1]:g} s{scaled}{ramped}"
    ]
    if made["controller"] is None:
        lines.append("checked against no controller's limits: --controller NAME does it")
    else:
        uses = ", ".join(f"{kind} {100 * use:.3g} %" for kind, use in made["use of limits"].items())
        lines.append(f"within the limits of {made['controller']}, of which it uses: {uses}")
        if made["rate"] < made["controller rate"]:
            lines.append(
                f"that is the motion at the controller's {made['controller rate']:g} Hz; how it interpolates between "
                f"these samples at {made['rate']:g} Hz is not checked"
            )
    return "\n".join(lines)
