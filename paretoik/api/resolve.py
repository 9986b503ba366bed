"""Resolve one motion along a path by a method, step by step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from paretoik.api.result import motion_bytes
from paretoik.api.session import RunRequest, Session, open_session
from paretoik.collision.obstacles import Obstacle
from paretoik.errors import Infeasible
from paretoik.inputs import ArrayLike, check_flag
from paretoik.progress import Observer
from paretoik.resolution.protocol import TRACKING_TOLERANCE, Criterion, Method, ResolvedMotion
from paretoik.resolution.resolve import Resolution, Unreachable, resolution_of
from paretoik.resolution.resolve import resolve as resolve_motion
from paretoik.review.recording.messages import ResolutionEnd, ResolvedScene, record_traces, workcell_of
from paretoik.robot.arm import Arm
from paretoik.runs.files import DRAWING, MOTIONS, TRACES, array_bytes, write_result
from paretoik.task.limits import Limits
from paretoik.task.objectives import Objective
from paretoik.task.path import Path
from paretoik.task.task import Task, error_unit

HOLDS = f"a resolved motion, its joint positions in {MOTIONS} and what its method did in {TRACES}"


def resolve(
    arm: Arm,
    path: Path | Task | Sequence[Path | Task],
    method: Method,
    *,
    start: object = None,
    limits: Limits | None = None,
    obstacles: Sequence[Obstacle] = (),
    link_radius: ArrayLike = 0.0,
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
        Joint positions (*batch, dof) at the start; default: a posture on the path, far from singularities (see Notes).
    limits
        Position limits of the joints, which methods avoid; default: those of the arm.
    obstacles
        Obstacles for criteria; ``ConstrainedQP`` also avoids them (default: none).
    link_radius
        Radius [m] of the capsules around links (default 0), or one per link: of the base, then after each joint.
    unreachable
        Reaction to a lost path: "refuse" it (default), or "track" it as well as possible.
    tolerance
        Distance from the path [m, rad] above which it is lost; methods do not predict beyond it.
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
        Motion with ``traces``: one for each start and each set of the method's parameters, broadcast together.

    Raises
    ------
    InvalidInput
        If an argument cannot be used.
    OutOfReach
        If there is no start.
    Infeasible
        If the path is lost and ``unreachable="refuse"``; see Notes.
    EvaluationFailed
        If a criterion is not finite and ``unreachable="refuse"``.

    Notes
    -----
    The methods are ``PseudoInverse``, ``DampedLeastSquares``, ``WeightedLeastNorm``, ``GradientProjection``,
    ``WeightedGradientProjection``, ``ConstrainedQP``, ``LeastSquaresVelocity``, ``PredictiveKineticEnergy`` and
    ``Nedungadi``. Only ``ConstrainedQP`` guarantees limits on position, velocity, acceleration and clearance.
    ``Nedungadi`` takes only starts less than 1e-6 off the path; it stops at a singularity.

    The default start is on the path's first sample, and within the limits if such a posture is found. If a joint has
    only one limit, its range is 2π rad, or 1 m.

    The task's velocity over a step is that of its target plus feedback; for a pose it includes the angular velocity of
    the target's frame. The task is given up for a step ("held") if the Jacobian, with weighted joints, is singular and
    nothing is damped. A step is shortened if a joint would move more than 1 rad or m. If a path leaves the reach of the
    arm, the arm follows as well as it can and returns with it. More damping than the default, or less feedback, makes
    it slower there.

    The Infeasible error names the sample, the tracking error, and the Jacobian's condition number or the limits that
    block the motion. review.rrd shows the arm and the method's traces over time; if the path is lost, up to the loss.
    traces.npz has all ``traces``.

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
    if out is None and observe is None:  # no session: thousands of motions may be resolved one after the other
        return resolve_motion(resolution)
    settings = {"method": _method_settings(method), "unreachable": unreachable, "tolerance": float(tolerance)}
    request = RunRequest(
        verb="resolve",
        problem=resolution,
        title=f"{type(method).__name__} of {resolution.task.arm.name}",
        settings={**settings, "seed": seed},
        out=out,
        overwrite=overwrite,
        observe=observe,
        catch_signals=False,  # a motion is computed completely or not at all
    )
    with open_session(request) as session:
        return _resolve_recorded(resolution, session)


def _resolve_recorded(resolution: Resolution, session: Session) -> ResolvedMotion:
    """Resolve the motion, save and draw it. If the path is lost, record the motion up to the loss."""
    task, cell = resolution.task, workcell_of(resolution)
    criteria = [each.objective.name for each in resolution.method.criterion_list]
    assert cell is not None
    scene = ResolvedScene(
        workcell=cell,
        method=type(resolution.method).__name__,
        criteria=tuple(criteria),
        tolerance=float(resolution.tolerance),
        error_unit=error_unit(task.tasks),
        min_clearance=float(task.min_clearance),
    )
    session.start_recording(scene)

    def end(motion: ResolvedMotion, ending: Mapping[str, Any]) -> ResolutionEnd:
        motions, count = record_traces(motion)
        return ResolutionEnd(motions=motions, count=count, provenance={**session.provenance, **ending})

    def draw(folder: FilePath) -> None:
        from paretoik.review.pictures.motions import resolution_picture  # here: matplotlib loads slowly

        resolution_picture(first, criteria, folder / DRAWING)

    try:
        motion = first = resolve_motion(resolution)
    except Infeasible as lost:  # the motion is recorded up to the loss
        if isinstance(lost.motion, ResolvedMotion) and session.recorder is not None:
            session.finish_recording(end(lost.motion, {"status": "the path is lost", "reason": str(lost)}))
        raise
    while first.q.ndim > 2:
        first = first[0]
    steps, count = Counter(motion.traces.status.ravel().tolist()), int(np.prod(motion.q.shape[:-2]))
    provenance = session.ended("resolved", motions=count, steps=dict(steps))
    provenance["largest_error"] = float(np.abs(motion.traces.errors).max())
    # In `traces.npz` every array of ``motion.traces`` has one row per motion, as in `motions.npz`.
    shape = motion.q.shape[:-2]
    traces = {each.name: np.asarray(getattr(motion.traces, each.name)) for each in fields(motion.traces)}
    contents = {
        MOTIONS: motion_bytes(motion.arm, motion.time.reshape(count, -1), motion.q.reshape(count, -1, task.arm.dof)),
        TRACES: array_bytes({name: each.reshape(count, *each.shape[len(shape) :]) for name, each in traces.items()}),
    }
    entries = {**provenance, "holds": HOLDS, "batch": list(shape)}
    session.finish(
        motion,
        partial(write_result, entries=entries, contents=contents),
        status=provenance["status"],
        end=lambda: end(motion, {"status": "resolved"}),
        draw=draw,
    )
    return motion


def _method_settings(method: Method) -> dict[str, Any]:
    """Return a method's name and parameters. A criterion is described by its objective and gain."""

    def plain(value: Any) -> Any:
        return value if value is None or isinstance(value, bool | str) else np.asarray(value).tolist()

    settings: dict[str, Any] = {"name": type(method).__name__}
    for each in fields(method):
        value = getattr(method, each.name)
        if isinstance(value, tuple | list) and all(isinstance(one, Criterion) for one in value):
            settings[each.name] = [{"objective": one.objective.name, "gain": plain(one.gain)} for one in value]
        elif isinstance(value, Objective):
            settings[each.name] = value.name
        elif value is None or isinstance(value, bool | str) or np.asarray(value).dtype.kind in "biuf":
            settings[each.name] = plain(value)
    return settings
