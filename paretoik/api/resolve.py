"""Resolve one motion along a path by a method, step by step."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path as FilePath

from paretoik.api.progress import Observer
from paretoik.api.resolution_run import motion_ending, resolution_settings, resolution_subject, save_resolution
from paretoik.api.review_resolution import resolve_recorded, review_resolution
from paretoik.api.run_session import run_session
from paretoik.call_arguments import check_call
from paretoik.inputs import check_flag
from paretoik.resolution.follow import TRACKING_TOLERANCE
from paretoik.resolution.method import Method
from paretoik.resolution.resolve import Unreachable, resolution_of
from paretoik.resolution.resolve import resolve as resolve_motion
from paretoik.resolution.traces import ResolvedMotion
from paretoik.robot.arm import Arm
from paretoik.task.limits import Limits
from paretoik.task.obstacles import Obstacle
from paretoik.task.path import Path
from paretoik.task.task import Task


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
    arm, path
        A redundant arm, and a path or tasks for it.
    method
        ``PseudoInverse``, ``DampedLeastSquares``, ``WeightedLeastNorm``, ``GradientProjection``,
        ``WeightedGradientProjection``, ``ConstrainedQP``, ``LeastSquaresVelocity``, ``PredictiveKineticEnergy`` or
        ``Nedungadi``.
    start
        Joint positions (*batch, dof) to start in; by default a posture on the path's first sample, within the limits if
        one is found there, that is far from singular. Starts and the method's numbers are broadcast against each
        other: one motion for each.
    limits
        Position limits that methods keep joints from; the arm's own by default. A joint with one limit counts as having
        a range of 2π rad, or 1 m. ``ConstrainedQP`` alone promises to keep them, and those of velocity, acceleration
        and clearance.
    obstacles, link_radius
        What criteria may look at, and what the links, capsules of this radius [m], stay clear of by ``ConstrainedQP``.
    unreachable
        What to do where the path is lost: to "refuse" it, or to "track" it as well as can be.
    tolerance
        The distance [m, rad] from the path at which it counts as lost; so far off nothing is predicted either.
    seed
        Of the postures that the default start is chosen from.
    out
        Folder to keep the run in: run.json, motions.npz, traces.npz with everything in ``traces``, review.rrd, in which
        the arm moves beside what the method does, and picture.png. Where the path is lost the recording shows how far
        the arm came. ``overwrite`` allows it to replace a run that is there.
    observe
        Called with a ``RunProgress`` while something is compiled or saved; as for ``plan``.

    ``Nedungadi`` takes starts on the path alone, less than 1e-6 off it; where its motion runs into a singularity it
    stands still.

    The task's velocity over a step is that of its target, with a pose the angular velocity of the target's frame, plus
    feedback. The task is given up for a step ("held") where the Jacobian, its joints weighted, is singular and nothing
    is damped, and a step is shortened where a joint were to go more than 1 rad or m in it. Where a path leaves what can
    be reached, the arm follows as it can and returns with it; it takes more damping than the default, or less feedback,
    to keep it calm meanwhile.

    Raises
    ------
    InvalidInput
        Naming what cannot be used; OutOfReach where there is no start.
    Infeasible
        Where the path is lost and ``unreachable="refuse"``, with sample, error and the Jacobian's condition number, or
        the limits that leave no way on.
    EvaluationFailed
        Where a criterion is not finite and ``unreachable="refuse"``.

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
    if out is None and observe is None:  # as where thousands are resolved in turn
        return resolve_motion(resolution)
    with run_session(
        resolution_subject(resolution),
        verb="resolve",
        settings=resolution_settings(resolution, seed),
        out=out,
        overwrite=overwrite,
        observe=observe,
        catch_signals=False,  # a motion is whole or none
    ) as session:
        motion = resolve_recorded(resolution, session)
        provenance = {**session.provenance, **motion_ending(motion, session.seconds)}
        session.keep(motion, lambda folder: save_resolution(motion, provenance, folder), status=provenance["status"])
        with session.reviewing():
            review_resolution(motion, resolution, session)
    return motion
