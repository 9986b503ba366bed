"""Commands that show runs and export motions.

These are ``paretoik show``, ``export``, ``report``, ``compare`` and ``verify``.
"""

from __future__ import annotations

import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from paretoik.cli.console import (
    JsonFlag,
    QuietFlag,
    RunFolder,
    RunProblem,
    agreed_problem,
    exit_code,
    print_json,
    print_text,
    running,
    stdout_for_results,
)
from paretoik.errors import InvalidInput
from paretoik.file_paths import missing_file, shell_command
from paretoik.runs.files import DRAWING, PICTURE_MARK, RECORDING, RUN, check_target, is_run, read_run

if TYPE_CHECKING:  # keeps the start of the command line quick
    from paretoik.front.front import Choice
    from paretoik.joint_trajectory.trajectory import JointTrajectory
    from paretoik.task.motion import Motion

# ``paretoik show``: open the recording of a run in the Rerun viewer, on a motion of its front.


def show(
    run: RunFolder,
    point: Annotated[
        int | None, typer.Option(help="Open on the motion of this point instead of the present choice.", metavar="ID")
    ] = None,
    compare: Annotated[
        int | None, typer.Option(help="Show the motion of another point next to it, on one timeline.", metavar="ID")
    ] = None,
    problem: RunProblem = None,
) -> None:
    """Open the recording of a run in the Rerun viewer.

    It opens on the present choice of the run (paretoik select), or else on the search.
    """
    from paretoik.front.choice_tree import read_choices
    from paretoik.review.recording.viewer import run_viewer

    recording = run / RECORDING
    if not recording.is_file():
        holds = read_run(run / RUN).get("holds") if is_run(run / RUN) else None
        picture = f"; its picture is {run / DRAWING}" if (run / DRAWING).is_file() else ""
        fact = "none; solve with --out to make one" if holds is None else f"a run that holds {holds}{picture}"
        raise InvalidInput(f"{recording} must be a recording, got {fact if run.is_dir() else missing_file(recording)}")
    with tempfile.TemporaryDirectory(prefix="paretoik-show-") as folder:
        file = recording
        if point is not None or compare is not None or read_choices(run).chosen is not None:  # open on a point
            from paretoik.api.load import load_front
            from paretoik.formulations.protocol import is_loop
            from paretoik.front.choice_tree import pick_point
            from paretoik.front.preferences.knee_and_compromise import compromise
            from paretoik.review.drawing.choice_layer import recording_with_choice

            front = load_front(run, agreed_problem(run, problem))
            if not is_loop(front):
                choice = pick_point(front, point, name="--point", otherwise=compromise)
                compared, file = None if compare is None else front[compare], Path(folder) / RECORDING
                file.write_bytes(recording_with_choice(front, choice, recording=recording, compare=compared))
            elif point is not None or compare is not None:
                wish = "point must come with a run that has a front"
                raise InvalidInput(f"{wish}, got a closed loop, whose only motion is shown")
        viewer = run_viewer(str(file.absolute()))  # until the viewer is closed; without a screen it fails
    if viewer.returncode != 0:
        # The last line ends with the cause.
        message = (viewer.stderr.strip().splitlines() or [f"exit status {viewer.returncode}"])[-1].rsplit(": ", 1)[-1]
        command = shell_command("rerun", "--serve-web", "--bind", "127.0.0.1", recording)
        raise InvalidInput(
            f"{recording} must open in the Rerun viewer, got {message!r}; without a screen, copy the file to a machine "
            f"that has one, or run: {command}"
        )


# ``paretoik export``: hand a motion of a run to a robot.


ENDINGS = {"csv": ".csv", "parquet": ".parquet", "npz": ".npz", "joint-trajectory": ".yaml", "ros2-bag": "_bag"}


PointOption = Annotated[int | None, typer.Option(help="Id of the point instead of the present choice.")]
FormatOption = Annotated[
    Literal["csv", "parquet", "npz", "joint-trajectory", "ros2-bag"] | None,
    typer.Option(help="Format (the ending of --out, or else csv)."),
]
RateOption = Annotated[
    float | None, typer.Option(help="Samples per second (the controller's; else as many as the motion has).")
]
ControllerOption = Annotated[
    str | None,
    typer.Option(
        help="Controller whose limits must hold: a family (franka, ur, kinova), a model (panda, fr3, ur3e, ur5e, "
        "ur10e, ur16e, gen3), or your own pk.controllers.Controller as FILE.py:NAME, whose file is run."
    ),
]
OutOption = Annotated[Path | None, typer.Option(help="File to write, or folder of a bag (point-ID in the run).")]
SlowDownOption = Annotated[
    bool, typer.Option("--slow-down", help="Slow down as little as the controller's limits require.")
]
TimeScaleOption = Annotated[float, typer.Option(help="Factor by which to slow down.")]
RampOption = Annotated[float, typer.Option(help="Duration of the ramps at start and stop [s].")]
JointsOption = Annotated[str | None, typer.Option(help="Order of the joints: NAME,NAME (the arm's).")]
OverwriteOption = Annotated[bool, typer.Option(help="Replace an existing file.")]


def export(
    run: RunFolder,
    point: PointOption = None,
    format: FormatOption = None,
    rate: RateOption = None,
    controller: ControllerOption = None,
    out: OutOption = None,
    slow_down: SlowDownOption = False,
    time_scale: TimeScaleOption = 1.0,
    ramp: RampOption = 0.0,
    joints: JointsOption = None,
    problem: RunProblem = None,
    overwrite: OverwriteOption = False,
    as_json: JsonFlag = False,
) -> None:
    """Write the motion of a point as a trajectory for a robot.

    It is sampled at the controller's rate and checked against its limits. Points of a plan are its optima; the default
    is the best one.
    """
    with stdout_for_results():
        from paretoik.api.export import export as export_motion
        from paretoik.loading import load_value

        limits = load_value("controller", controller) if controller is not None and ":" in controller else controller
        named = agreed_problem(run, problem, needed=True)
        id, motion, about, which = _motion(run, point, named)
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


def _motion(run: Path, point: int | None, problem: str | None) -> tuple[int, Choice | Motion, dict[str, Any], str]:
    """Return a point of a front, or an optimum of a plan: id, motion, metadata, and the name of the default."""
    from paretoik.api.load import load_front, load_plan
    from paretoik.api.result import holds_plan
    from paretoik.front.choice_tree import pick_point

    if holds_plan(run):
        plan, id = load_plan(run, problem), point or 0
        if not 0 <= id < len(plan.optima):
            raise InvalidInput(f"--point must be an optimum from 0 to {len(plan.optima) - 1}, got {id}")
        stored, which, about = read_run(run / RUN)["objective"], " (the best)", {"point": id}
        motion: Choice | Motion = plan.optima[id].motion
        values = [(stored["name"], stored["unit"], plan.optima[id].objective)]
        reference = plan.provenance.get("problem")
    else:
        front = load_front(run, problem)
        motion = choice = pick_point(front, point, name="--point")
        id, which, about = choice.id, " (the present choice)" if len(front) > 1 else "", {}
        values = list(zip(front.names, front.units, choice.objectives, strict=True))
        reference = front.provenance.get("problem")
    objectives = {name: f"{value:.6g} {unit}".rstrip() for name, unit, value in values}
    return id, motion, {"problem": reference, **about, "objectives": objectives}, which


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


# ``paretoik report``, ``compare`` and ``verify``.


def report(
    run: RunFolder,
    out: Annotated[Path | None, typer.Option(help="HTML file to write; report.html in the run's folder.")] = None,
    problem: RunProblem = None,
    overwrite: Annotated[bool, typer.Option(help="Replace a file that is not a report.")] = False,
    as_json: JsonFlag = False,
) -> None:
    """Write one self-contained HTML page about a run.

    It shows the front, motions, certificates, choices and settings, and needs no network.
    """
    with stdout_for_results():
        from paretoik.api.report import report as write_report

        file = write_report(run, out, overwrite=overwrite, problem=agreed_problem(run, problem))
    if as_json:
        print_json({"out": file})
    else:
        print_text(file)


def compare(
    runs: Annotated[list[Path], typer.Argument(help="Folders of finished runs, at least two.")],
    labels: Annotated[
        str | None, typer.Option(help="LABEL,LABEL: one per run; equal labels mark runs of one method.")
    ] = None,
    picture: Annotated[Path | None, typer.Option(help="Draw the fronts into this PNG.")] = None,
    merge: Annotated[Path | None, typer.Option(help="Folder to keep the nondominated points of all runs in.")] = None,
    overwrite: Annotated[
        bool, typer.Option(help="Replace a run in the folder of --merge, or a file that is not a picture by paretoik.")
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Compare the fronts of runs.

    The tables have hypervolume, coverage, additive epsilon, and the settings that differ.
    """
    with stdout_for_results():
        from paretoik.api.compare import compare as compare_fronts
        from paretoik.front.comparison import comparison_entries
        from paretoik.runs.folder import check_other_folder, claim_folder

        if picture is not None:
            check_target("picture", picture, overwrite=overwrite, mark=PICTURE_MARK)
        if merge is not None:
            check_other_folder("merge", merge, *runs)
        comparison = compare_fronts(*runs, labels=None if labels is None else labels.split(","))
        if merge is not None:
            merged = comparison.merged
            left_out = merged.provenance["merged"]["left_out"]
            with claim_folder(merge, overwrite=overwrite) as folder:
                merged.save(folder)
        if picture is not None:
            from paretoik.review.pictures.fronts import comparison_picture

            comparison_picture(comparison, picture)
    if as_json:
        merge_entries = {} if merge is None else {"merged": {"out": merge, "points": len(merged), "left_out": left_out}}
        print_json({**comparison_entries(comparison), **merge_entries})
    else:
        print_text(comparison)
        if merge is not None:
            print_text(f"\n{merge}: {len(merged)} points; its run.json says which run each comes from")
            if left_out:
                print_text(f"not every run has the same {' and '.join(left_out)}, so the merged front has none")


def verify(run: RunFolder, problem: RunProblem = None, quiet: QuietFlag = False, as_json: JsonFlag = False) -> None:
    """Check a run independently of the code that made it.

    Checked are files, motions, limits, collisions, objectives and certificates. Exit code 7 if a check fails.
    """
    with running(quiet=quiet) as observe:
        from paretoik.api.verify import verify as verify_folder

        verification = verify_folder(run, agreed_problem(run, problem), observe=observe)
    if as_json:
        rows = [asdict(row) for row in verification.rows]
        words = {"headline": verification.headline, "passed": verification.passed, "verified": verification.verified}
        print_json({"run": run, **words, "rows": rows})
    else:
        print_text(verification)
    raise typer.Exit(exit_code("verified" if verification.passed else "not verified"))
