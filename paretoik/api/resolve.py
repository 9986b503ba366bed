"""Resolve one motion along a path by a method, step by step."""

from __future__ import annotations

import pathlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from paretoik.api.progress import Observer
from paretoik.api.session import RunSession, Subject, run_session
from paretoik.errors import Infeasible
from paretoik.front.points import StoredJoints, StoredMotions
from paretoik.front.storage import array_bytes, motion_arrays
from paretoik.inputs import check_call, check_flag
from paretoik.resolution.protocol import TRACKING_TOLERANCE, Criterion, Method, ResolvedMotion
from paretoik.resolution.resolve import Resolution, Unreachable, resolution_of
from paretoik.resolution.resolve import resolve as resolve_motion
from paretoik.review.recording.messages import ResolutionEnd, ResolvedScene, record_traces, workcell_of
from paretoik.robot.arm import Arm
from paretoik.runs.files import DRAWING, MOTIONS, TRACES, write_result
from paretoik.runs.fingerprint import fingerprint
from paretoik.task.limits import Limits
from paretoik.task.objectives import Objective
from paretoik.task.obstacles import Obstacle
from paretoik.task.path import Path
from paretoik.task.task import Task, error_unit

# The run folder of one resolved motion.


HOLDS = f"a resolved motion, its joint positions in {MOTIONS} and what its method did in {TRACES}"


def resolution_settings(resolution: Resolution, seed: int) -> dict[str, Any]:
    """Return the settings of a resolution by name."""
    return {
        "method": method_settings(resolution.method),
        "unreachable": resolution.unreachable,
        "tolerance": float(resolution.tolerance),
        "seed": seed,
    }


def resolution_subject(resolution: Resolution) -> Subject:
    """Return a resolution as the subject of a run."""
    title = f"{type(resolution.method).__name__} of {resolution.task.arm.name}"
    return Subject(title=title, fingerprint=fingerprint(resolution))


def method_settings(method: Method) -> dict[str, Any]:
    """Return the name and numbers of a method; for criteria their objective and gain."""
    settings: dict[str, Any] = {"name": type(method).__name__}
    for each in fields(method):
        value = getattr(method, each.name)
        if isinstance(value, tuple | list) and all(isinstance(one, Criterion) for one in value):
            settings[each.name] = [{"objective": one.objective.name, "gain": _plain(one.gain)} for one in value]
        elif isinstance(value, Objective):
            settings[each.name] = value.name
        elif value is None or isinstance(value, bool | str) or np.asarray(value).dtype.kind in "biuf":
            settings[each.name] = _plain(value)
    return settings


def motion_ending(motion: ResolvedMotion, seconds: float) -> dict[str, Any]:
    """Return the status of a motion, its number of steps by status, and its largest error."""
    steps = Counter(motion.traces.status.ravel().tolist())
    counts = {"motions": int(np.prod(motion.q.shape[:-2])), "steps": dict(steps), "seconds": round(seconds, 3)}
    return {"status": "resolved", "counts": counts, "largest_error": float(np.abs(motion.traces.errors).max())}


def save_resolution(motion: ResolvedMotion, provenance: dict[str, Any], folder: pathlib.Path) -> None:
    """Write a motion, or a batch of them, into a folder, all of its files at once or none.

    In `traces.npz` every array of ``motion.traces`` has one row per motion, as in `motions.npz`.
    """
    shape, dof = motion.q.shape[:-2], motion.arm.dof
    count = int(np.prod(shape))
    stored = StoredMotions(
        arm=StoredJoints(joint_names=motion.arm.joint_names),
        time=motion.time.reshape(count, -1),
        q=motion.q.reshape(count, -1, dof),
    )
    traces = {each.name: np.asarray(getattr(motion.traces, each.name)) for each in fields(motion.traces)}
    files = {
        MOTIONS: array_bytes({"id": np.arange(count), **motion_arrays(stored)}),
        TRACES: array_bytes({name: each.reshape(count, *each.shape[len(shape) :]) for name, each in traces.items()}),
    }
    write_result(folder, {**provenance, "holds": HOLDS, "batch": list(shape)}, files)


def _plain(value: Any) -> Any:
    """Return a number or an array of numbers as JSON has it; other values as they are."""
    return value if value is None or isinstance(value, bool | str) else np.asarray(value).tolist()


# The recording and the picture of a resolved motion.


def resolve_recorded(resolution: Resolution, session: RunSession) -> ResolvedMotion:
    """Return the motion, with its recording begun; if the path is lost, record the motion up to there.

    Raises as ``resolution.resolve``.
    """
    cell = workcell_of(resolution)
    assert cell is not None
    scene = ResolvedScene(
        workcell=cell,
        method=type(resolution.method).__name__,
        criteria=tuple(each.objective.name for each in resolution.criteria),
        tolerance=float(resolution.tolerance),
        error_unit=error_unit(resolution.task.tasks),
        min_clearance=float(resolution.task.min_clearance),
    )
    session.start_recording(scene)
    try:
        return resolve_motion(resolution)
    except Infeasible as lost:
        if isinstance(lost.motion, ResolvedMotion):
            ending = {"status": "the path is lost", "reason": str(lost)}
            _finish_recording(lost.motion, {**session.provenance, **ending}, session)
        raise


def _finish_recording(motion: ResolvedMotion, provenance: Mapping[str, Any], session: RunSession) -> None:
    if session.recorder is not None:
        motions, count = record_traces(motion)
        session.finish_recording(ResolutionEnd(motions=motions, count=count, provenance=provenance))


def review_resolution(motion: ResolvedMotion, resolution: Resolution, session: RunSession) -> None:
    """Complete the recording, and draw the first motion."""
    if session.folder is None:
        return
    _finish_recording(motion, {**session.provenance, "status": "resolved"}, session)
    from paretoik.review.pictures.motions import resolution_picture  # here: matplotlib loads slowly

    while motion.q.ndim > 2:
        motion = motion[0]
    resolution_picture(motion, [each.objective.name for each in resolution.criteria], session.folder / DRAWING)


# The verb that resolves one motion along a path.


@check_call
def resolve(
    arm: Arm,
    path: Path | Task | Sequence[Path | Task],
    method: Method,
    *,
    start: object = None,
    limits: Limits | None = None,
    obstacles: Sequence[Obstacle] = (),
    link_radius: float = 0.0,
    unreachable: Unreachable = "refuse",
    tolerance: float = TRACKING_TOLERANCE,
    seed: int = 0,
    out: str | FilePath | None = None,
    overwrite: bool = False,
    observe: Observer | bool | None = None,
) -> ResolvedMotion:
    """Return the motion by which a method follows a path.

    Parameters
    ----------
    arm
        Redundant arm.
    path
        Path, task, or several tasks for the arm.
    method
        Method of ``pk.methods``, such as ``PseudoInverse``, ``GradientProjection`` or ``ConstrainedQP``.
    start
        Joint positions (*batch, dof) to start in; default: a posture on the path, far from singular (see Notes).
    limits
        Position limits that methods keep joints away from; default: those of the arm.
    obstacles
        Obstacles that criteria can use, and that ``ConstrainedQP`` keeps the links away from (default: none).
    link_radius
        Radius of the capsules around links [m] (default 0).
    unreachable
        Reaction to a lost path: "refuse" it (default), or "track" it as well as possible.
    tolerance
        Distance from the path [m, rad] at which it counts as lost; nothing is predicted farther from the path.
    seed
        Seed of the postures that the default start is chosen from (default 0).
    out
        Folder for the run (default: none): run.json, motions.npz, traces.npz, review.rrd and picture.png.
    overwrite
        Whether to replace a run in ``out`` (default False).
    observe
        Observer of compilation and saving, as for ``plan``.

    Returns
    -------
    ResolvedMotion
        Motion with ``traces``: one for each start and each set of the method's numbers, broadcast against each other.

    Raises
    ------
    InvalidInput
        If an argument cannot be used.
    OutOfReach
        If there is no start.
    Infeasible
        If the path is lost and ``unreachable="refuse"``; names sample, error and condition number, or limits.
    EvaluationFailed
        If a criterion is not finite and ``unreachable="refuse"``.

    Notes
    -----
    The methods are ``PseudoInverse``, ``DampedLeastSquares``, ``WeightedLeastNorm``, ``GradientProjection``,
    ``WeightedGradientProjection``, ``ConstrainedQP``, ``LeastSquaresVelocity``, ``PredictiveKineticEnergy`` and
    ``Nedungadi``. Only ``ConstrainedQP`` promises to keep limits of position, velocity, acceleration and clearance.
    ``Nedungadi`` takes only starts less than 1e-6 off the path; it stops at a singularity.

    The default start is on the path's first sample, and within the limits if such a posture is found. A joint with one
    limit counts as having a range of 2π rad, or 1 m.

    The task's velocity over a step is that of its target plus feedback; for a pose it includes the angular velocity of
    the target's frame. The task is given up for a step ("held") if the Jacobian, with weighted joints, is singular and
    nothing is damped. A step is shortened if a joint would move more than 1 rad or m. If a path leaves the reach of the
    arm, the arm follows as well as it can and returns with it; more damping than the default, or less feedback, keeps
    it calm meanwhile.

    The Infeasible error names the condition number of the Jacobian, or the limits that leave no way to continue. In
    review.rrd the arm moves next to what the method does; if the path is lost, up to there. traces.npz has all
    ``traces``.

    Examples
    --------
    >>> import paretoik as pk
    >>> path = pk.line([0.4678, 0.0], [0.3678, 0.0], duration=1.0, samples=101)
    >>> motion = resolve(pk.arms.tringali_3r(), path, pk.methods.PseudoInverse(), start=[0.0, 0.327, -0.754])
    >>> motion.q.shape
    (101, 3)
    """
    resolution = resolution_of(
        arm,
        path,
        method,
        start=start,
        limits=limits,
        obstacles=obstacles,
        link_radius=link_radius,
        unreachable=unreachable,
        tolerance=tolerance,
        seed=seed,
    )
    check_flag("overwrite", overwrite)
    if out is None and observe is None:  # as when thousands are resolved one after the other
        return resolve_motion(resolution)
    with run_session(
        resolution_subject(resolution),
        verb="resolve",
        settings=resolution_settings(resolution, seed),
        out=out,
        overwrite=overwrite,
        observe=observe,
        catch_signals=False,  # a motion is complete or missing
    ) as session:
        motion = resolve_recorded(resolution, session)
        provenance = {**session.provenance, **motion_ending(motion, session.seconds)}
        session.keep(motion, lambda folder: save_resolution(motion, provenance, folder), status=provenance["status"])
        with session.reviewing():
            review_resolution(motion, resolution, session)
    return motion
