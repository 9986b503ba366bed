"""Limits that cannot all be satisfied: early detection, conflicts, and error text."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float

from paretoik.arrays import JointPaths
from paretoik.collision.obstacles import clearance, closest_pair, describe_obstacle, radii, radius_of, signed_distance
from paretoik.errors import Infeasible, InvalidInput, warn_user
from paretoik.nlp.minimise import minimise_violation
from paretoik.nlp.program import Solutions
from paretoik.robot.dynamics import gravity_torques
from paretoik.robot.kinematics import joint_scales, link_nodes
from paretoik.stop_flag import check_interruption
from paretoik.task.joint_curve import target_rates
from paretoik.task.limits import LIMIT_TOLERANCE, Bounds
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask, evaluate_motions
from paretoik.task.random_starts import sample_postures
from paretoik.task.retraction import ON_PATH_TOLERANCE, retract_nearest, task_errors
from paretoik.trajectory.levels import OPTIONS as LEVELS
from paretoik.trajectory.levels import (
    LevelProgress,
    ObserveLevel,
    at_samples,
    coarsest_level,
    distinct_rows,
    first_levels,
    resample,
)
from paretoik.trajectory.plan_starts import sample_travelling, squared_velocity
from paretoik.trajectory.transcription import MotionProgram, motion_program

# Obstacles on the path, which make all motions infeasible.


def warn_of_obstructed_path(task: MotionTask) -> None:
    """Warn if an obstacle is too near to the tool's path.

    It is no error, because a search may still look for the least-violating motion. The tool is the last link's end.
    """
    for distances in _tool_distances(task):
        obstacle, sample = np.unravel_index(int(np.argmin(distances)), distances.shape)
        distance = float(distances[obstacle, sample])
        if task.min_clearance - distance <= LIMIT_TOLERANCE * task.clearance_range:
            continue
        count = int((distances[obstacle] < task.min_clearance).sum())
        where = f"reaches {-distance:.3g} m into it" if distance < 0 else f"is {distance:.3g} m away from it"
        warn_user(
            f"path: {describe_obstacle(task.obstacles, int(obstacle))}, is in its way: at sample {sample} "
            f"({task.times[sample]:.4g} s, the worst of {count}) the end of link {task.arm.dof} "
            f"(radius {radius_of(task.link_radius, task.arm.dof):g} m) {where}, but the clearance must be "
            f"{task.min_clearance:g} m; no motion along the path is feasible"
        )


def obstructed_sample(task: MotionTask, sample: int | None = None) -> int | None:
    """Return the sample (None: the worst) if an obstacle is too near there, else None."""
    worst, found = 0.0, None
    for distances in _tool_distances(task):
        excess = task.min_clearance - distances.min(axis=0)
        excess = excess if sample is None else excess[[sample]]
        if excess.max() > max(worst, LIMIT_TOLERANCE * task.clearance_range):
            worst, found = float(excess.max()), int(np.argmax(excess)) if sample is None else sample
    return found


def _tool_distances(task: MotionTask) -> Iterator[Float[np.ndarray, "obstacles time"]]:
    """Yield the tool's distances from all obstacles, along each of its paths.

    Only paths that fix all coordinates of the tool's position count.
    """
    for followed in task.tasks if task.obstacles else ():
        follows_tool = task.arm.frame(followed.frame).pose is task.arm.tool
        if follows_tool and (task.arm.is_planar or followed.axes not in ("xy", "xy+angle")):
            tool = followed.path.positions
            if task.arm.is_planar:
                height = link_nodes(task.arm, np.zeros(task.arm.dof))[-1, 2]
                tool = np.column_stack([tool[:, :2], np.full(len(tool), height)])
            distances = np.stack([signed_distance(obstacle, tool, tool) for obstacle in task.obstacles])
            yield distances - radius_of(task.link_radius, task.arm.dof)


# Limits that cannot all be satisfied: detection and error text.


@dataclass(frozen=True, kw_only=True)
class InfeasibilityOptions:
    """Settings of the decision whether all limits can be satisfied."""

    doubt: float = 1e-3  # share of a range: searches decide about smaller violations
    clear: float = 0.1  # share of a range: no finer level or posture removes larger violations of rates and torques
    starts: int = 24  # number of roll-outs, and number of motions that travel along the self-motion
    finer: int = 8  # number of least-violating motions that continue on a finer level, and number of new starts there
    halvings: int = 6  # number of halvings of the interval that contains the least violation of all limits
    postures: int = 256  # number of postures tried at a sample
    improved: int = 32  # number of best postures that are moved along the self-motion
    moves: tuple[float, ...] = (0.3, 0.3, 0.1, 0.1, 0.03, 0.03, 0.01, 0.01)  # rad or arm lengths: standard deviations
    samples: int = 3  # largest number of samples whose postures are tested
    apart: float = 0.1  # share of the duration: least time between these samples
    clear_posture: float = 0.02  # share of a range: if every posture violates a limit by more, no motion satisfies it
    boxes: int = 10_000  # largest number of boxes of joint positions in a proof
    proofs: int = 3  # number of samples along the path at which a proof against low velocities is tried
    inner: int = 5  # number of samples from a spline's end at which the end conditions have an effect


OPTIONS = InfeasibilityOptions()

REMEDIES = {  # by kind of limit
    "position": "another place of the path, or fewer axes of the task",
    "velocity": "a longer duration",
    "acceleration": "a longer duration",
    "torque": "a longer duration, or a smaller payload",
    "power": "a longer duration",
    "clearance": "obstacles or a path elsewhere, a smaller link_radius or Limits(clearance=)",
}


def require_feasible(task: MotionTask, rollouts: JointPaths, observe: ObserveLevel | None = None) -> None:
    """Raise Infeasible, with the least-violating motion, if limits clearly cannot be satisfied.

    First, postures are tested at the samples at which no motion of ``rollouts`` (motions on the path) satisfies the
    limits. Then the violation of limits is minimised from roll-outs and motions that travel along the self-motion on
    the coarsest level, and from the best of these and new ones on finer levels. The decision is left to the search if a
    motion (nearly) satisfies the limits, or if a limited function has no value or no derivative, or is a function of
    the whole motion. Raises Interrupted after a signal.
    """
    if not (_violations(task, rollouts) > OPTIONS.doubt).all():
        return
    levels = [coarsest_level(task, first) for first in first_levels(len(task.times))]
    q = rollouts[: OPTIONS.starts, np.searchsorted(task.times, levels[0].times)]
    sample = _sample_without_posture(task, rollouts[: 2 * OPTIONS.starts])
    for level, finer in zip(levels, [*levels[1:], None], strict=True):
        program = _limits_program(level)
        if program is None:
            return
        if sample is not None:
            raise infeasible_error(task, level, _least_violating(program, q[:1]), sample=sample)
        rng = np.random.default_rng(len(level.times))
        starts = np.concatenate([q, sample_travelling(level, len(q), rng)])
        ends = _minimise_violation(program, starts)
        violation = _violations(level, ends.x)
        if not (violation > OPTIONS.doubt).all():
            return
        rows = distinct_rows(level, ends, violation, limit=OPTIONS.finer)
        q = _least_violating(program, ends.x[rows])
        if not _violations(level, q[:1])[0] > OPTIONS.doubt:
            return
        if observe is not None:
            progress = {"starts": starts, "ends": ends.x, "converged": ends.converged, "optima": q}
            observe(LevelProgress(task=level, **progress, feasible=False))
        if finer is None or is_clearly_infeasible(level, level.motion(q[0])):
            break
        try:
            q = resample(level, q, finer)
        except Infeasible:  # the least-violating motions leave the path between samples
            q = rollouts[: OPTIONS.finer, np.searchsorted(task.times, finer.times)]
    raise infeasible_error(task, level, q)


def _violations(level: MotionTask, q: JointPaths) -> Float[np.ndarray, " motions"]:
    """Return each motion's worst violation, as a share of its range."""
    _, violations, _ = evaluate_motions(replace(level, objectives=()), level.motion(q))
    return np.asarray(violations.max(axis=1, initial=0.0))


def _limits_program(level: MotionTask) -> MotionProgram | None:
    """Return the program of a task's limits, if there is one.

    Limits without a derivative, or on functions of the whole motion, have no program.
    """
    try:
        program = motion_program(replace(level, objectives=(squared_velocity,)))
    except InvalidInput:  # solvers name the limit in their error; searches need no derivatives
        return None
    return None if program.unsupported else program


def _minimise_violation(program: MotionProgram, q: JointPaths, share: float = 0.0) -> Solutions:
    """Return local minima of the violation of limits widened by ``share`` of their ranges."""
    limits = slice(program.elastic)
    bounds = program.bounds.copy()
    bounds[limits] -= share * program.sides[limits] * program.ranges[limits]
    wider = replace(program, bounds=bounds)
    return minimise_violation(wider, q, np.full(len(program.upper), np.inf), LEVELS.restoration)


def _least_violating(program: MotionProgram, q: JointPaths) -> Float[np.ndarray, "more time dof"]:
    """Return motions, first a new one that has the least largest violation.

    It is found by bisection of the share by which all limits are widened.
    """
    q = q[np.argsort(_violations(program.task, q))]
    low, high = 0.0, float(_violations(program.task, q[:1])[0])
    for _ in range(OPTIONS.halvings):
        share = (low + high) / 2
        ends = _minimise_violation(program, q[:2], share)
        violation = _violations(program.task, ends.x)
        best = int(np.argmin(violation))
        if violation[best] < high:
            q, high = np.concatenate([ends.x[best : best + 1], q]), float(violation[best])
        low = share if violation[best] > share + OPTIONS.doubt else low
        if high - low <= OPTIONS.doubt:
            break
    return q


def is_clearly_infeasible(task: MotionTask, motion: Motion) -> bool:
    """Return whether clearly no motion satisfies all limits, without proof."""
    kind, limit, size = _worst_limit(task, motion)
    if kind in ("position", "clearance"):
        _, violation = _best_postures(task, task.worst_sample(limit, motion))
        return bool(violation.min(initial=np.inf) > OPTIONS.clear_posture)
    return kind != "" and size > OPTIONS.clear


def explain_violation(task: MotionTask, motion: Motion) -> str:
    """Return in words which limit a motion violates most, with remedies."""
    return task.describe_violation(motion) + remedy_text(task, motion)


def infeasible_error(
    task: MotionTask, level: MotionTask, q: JointPaths, *, status: str = "", sample: int | None = None
) -> Infeasible:
    """Return the error of limits that cannot all be satisfied.

    q: least-violating motions on a level of the task, best first
    status: status of the solver
    sample: sample of ``task`` at which no posture satisfies the limits, if known
    """
    motion = level.motion(q[0])
    violations = level.violations(motion)
    limit = level.limit_names[int(np.argmax(violations))] if level.limit_names else ""
    message = "no motion within the limits was found"
    # whether there is a motion without obstacles
    free = replace(level, obstacles=())
    program = _limits_program(free) if level.obstacles and sample is None and limit != "clearance" else None
    if program is not None and _violations(free, _minimise_violation(program, q).x).min() <= OPTIONS.doubt:
        place = level.worst_instant(level.limit_names.index("clearance"), motion)
        pair = closest_pair(level.obstacles, motion.instants.links[place], level.link_radius)
        message, limit = f"{message}, though there is one without the obstacles (closest: {pair})", "clearance"
    numbers, full = np.searchsorted(task.times, level.times), at_samples(task, motion)
    # a sample at which it is proved that no posture satisfies the limits
    kind, number, _ = _worst_limit(task, full)
    proof = ""
    if kind in ("position", "clearance", "velocity"):
        samples = [task.worst_sample(number, full) if sample is None else sample]
        if kind == "velocity":  # velocity limits are often too low at other samples too, first at the fastest one
            pace = sum(
                np.linalg.norm(np.gradient(one.path.positions, task.times, axis=0), axis=1) for one in task.tasks
            )
            samples += [
                int(np.argmax(pace)),
                *np.linspace(0, len(task.times) - 1, OPTIONS.proofs + 2).astype(int)[1:-1],
            ]
        proved = next((each for each in samples if no_posture_keeps_limits(task, each)), None)
        if proved is not None:
            message = "no motion can satisfy the limits"
            proof = f" (proved: no posture at sample {proved}, {task.times[proved]:.3g} s, satisfies them)"
    return Infeasible(
        f"{message}{proof}; of the least-violating one, {level.describe_violation(motion, numbers) or status}"
        + remedy_text(task, full, sample),
        motion=full,
        limit=limit,
        violation=float(violations.max(initial=0.0)),
    )


def _worst_limit(task: MotionTask, motion: Motion) -> tuple[str, int, float]:
    """Return kind, index and violation of the most violated limit.

    The kind is "" if no limit is violated, or if it is a user's own.
    """
    violations = task.violations(motion)
    if not len(violations) or not violations.max() > 0:
        return "", 0, 0.0
    limit = int(np.argmax(violations))
    kind = task.limit_names[limit].partition(" of ")[0]
    is_own = kind not in task.bounds and not (kind == "clearance" and task.obstacles)
    return "" if is_own else kind, limit, float(violations.max())


def remedy_text(task: MotionTask, motion: Motion, sample: int | None = None) -> str:
    """Return remedies for the limit that the least-violating motion violates most.

    The text is "" for a user's own limit. It tells if gravity is too large to hold the arm at rest, or if none of the
    postures tried at ``sample`` (None: the worst one) satisfies the limits.
    """
    kind, limit, _ = _worst_limit(task, motion)
    if not kind:
        return ""
    if kind in ("torque", "power") and "torque" in task.bounds and task.arm.gravity.any():
        # whether gravity is too much at the sample at which the motion's posture needs the largest share of a limit
        rest = int(np.argmax([_overload(task, k, motion.q[k][None])[0] for k in range(len(task.times))]))
        q, load = _best_postures(task, rest, _overload)
        if len(q) and not load.min() <= 1.0:
            torque = gravity_torques(task.arm, q[int(np.argmin(load))])
            limits = _at_sample(task.bounds["torque"], rest)[np.arange(task.arm.dof), (torque > 0).astype(int)]
            with np.errstate(divide="ignore", invalid="ignore"):
                joint = int(np.nanargmax(torque / limits))
            unit = "N m" if task.arm.periodic[joint] else "N"
            return (
                f"; gravity is too large to hold the arm at rest at sample {rest} ({task.times[rest]:.3g} s): in the "
                f"best of {len(q)} postures tried {task.arm.joint_names[joint]} needs {abs(torque[joint]):.3g} {unit}, "
                f"its limit is {abs(limits[joint]):.3g} {unit}; it may help: a smaller payload, a higher torque limit, "
                "another place of the path"
            )
    text = f"; it may help: {REMEDIES[kind]}"
    if kind in ("position", "clearance"):
        worst = task.worst_sample(limit, motion) if sample is None else sample
        q, violation = _best_postures(task, worst)
        if len(q) > 1 and violation.min() > 0:
            return f"; none of {len(q)} postures tried at sample {worst} satisfies the limits{text}"
    return text


def _sample_without_posture(task: MotionTask, rollouts: JointPaths) -> int | None:
    """Return a sample at which no posture found satisfies the limits.

    These are limits on position, clearance and velocity. Only samples at which no roll-out satisfies them are tried.
    """
    obstructed = obstructed_sample(task)
    if obstructed is not None:
        return obstructed
    for measure, clear in ((_posture_violation, OPTIONS.clear_posture), (_speed_violation, OPTIONS.clear)):
        least = np.array([measure(task, k, rollouts[:, k]).min() for k in range(len(task.times))])
        for _ in range(OPTIONS.samples):
            worst = int(np.argmax(least))
            if least[worst] <= clear:
                break
            if _best_postures(task, worst, measure, rollouts[:, worst])[1].min() > clear:
                return worst
            least[np.abs(task.times - task.times[worst]) <= OPTIONS.apart * task.times[-1]] = 0.0
    return None


def _best_postures(
    task: MotionTask,
    sample: int,
    measure: Callable[[MotionTask, int, np.ndarray], np.ndarray] | None = None,
    others: Float[np.ndarray, "postures dof"] | None = None,
) -> tuple[Float[np.ndarray, "tried dof"], Float[np.ndarray, " tried"]]:
    """Return postures that reach a sample, and their violations (``measure``).

    They are random postures and ``others``, then the best of these, moved along the self-motion to violate less.
    """
    value_of, rng = partial(measure or _posture_violation, task, sample), np.random.default_rng(0)
    if task.start is not None and sample == 0:
        return task.start[None], value_of(task.start[None])
    q = sample_postures(task, OPTIONS.postures, rng, sample=sample)
    limits = task.arm.position_limits  # revolute joints are in the turn nearest to the middle of their limits
    middle = np.where(np.isfinite(limits).all(axis=1, keepdims=True), limits, 0.0).mean(axis=1)
    q = q - 2 * np.pi * np.where(task.arm.periodic, np.round((q - middle) / (2 * np.pi)), 0.0)
    q = q if others is None else np.concatenate([q, others])
    value = value_of(q)
    best = np.argsort(value, kind="stable")[: OPTIONS.improved]
    x, least = q[best], value[best]
    for size in OPTIONS.moves if len(x) else ():
        move = size * rng.normal(size=x.shape) * joint_scales(task.arm)
        moved = retract_nearest(task.arm, task.tasks, x + move, task.targets[sample])
        trial = np.where(moved.on_path, value_of(moved.q), np.inf)
        better = trial < least
        x[better], least[better] = moved.q[better], trial[better]
    return np.concatenate([q, x]), np.concatenate([value, least])


def _posture_violation(task: MotionTask, sample: int, q: np.ndarray) -> np.ndarray:
    """Return the worst relative violation (postures,) of position limits and clearance."""
    worst = np.zeros(len(q))
    if "position" in task.bounds:
        here = _at_sample(task.bounds["position"], sample)
        lower, upper = here.T
        ranges = task.limit_ranges("position", here)
        worst = np.maximum(worst, (np.maximum(q - upper, lower - q) / ranges).max(axis=1))
    if task.obstacles:
        distance = clearance(task.obstacles, link_nodes(task.arm, q), task.link_radius)
        worst = np.maximum(worst, (task.min_clearance - distance) / task.clearance_range)
    return worst


def _speed_violation(task: MotionTask, sample: int, q: np.ndarray) -> np.ndarray:
    """Return the least relative excess (postures,) over velocity limits.

    On the curve of a spline the tool moves at ẋ = J q̇ for any self-motion. If |q̇ᵢ| ≤ f sᵢ, with limits sᵢ, then
    u·ẋ ≤ f Σᵢ |u·Jᵢ| sᵢ for every unit vector u. The result is 0 if a joint has no limit, and for finite differences,
    because their velocities are those of chords.
    """
    fastest = np.abs(task.bounds.get("velocity", np.full((1, task.arm.dof, 2), np.inf))).max(axis=(0, 2))
    if task.differences != "spline" or not np.isfinite(fastest).all():
        return np.zeros(len(q))
    _, (velocity,), _ = target_rates(task.tasks, task.times[[sample]])
    _, jacobian = task_errors(task.arm, task.tasks, q, task.targets[sample])
    needed, row, column = np.ones(len(q)), 0, 0  # f, at least 1
    for one in task.tasks:
        size = one.position_rows
        here, wanted = jacobian[:, row : row + size], velocity[column : column + size]
        u = _directions(wanted, here)
        most = (np.abs(np.einsum("nbr,brd->nbd", u, here)) * fastest).sum(axis=-1)
        needed = np.maximum(needed, (u @ wanted / np.maximum(most, 1e-300)).max(axis=0))
        row, column = row + one.rows, column + one.target_size
    return (needed - 1) / 2


def _at_sample(bounds: Bounds, sample: int) -> Float[np.ndarray, "dof 2"]:
    return bounds[min(sample, len(bounds) - 1)]


def _overload(task: MotionTask, sample: int, q: np.ndarray) -> np.ndarray:
    """Return the largest share (postures,) of torque limits that gravity needs."""
    lower, upper = _at_sample(task.bounds["torque"], sample).T
    torque = gravity_torques(task.arm, q)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(torque > 0, torque / upper, torque / lower)
    return np.asarray(np.nan_to_num(shares, posinf=np.inf).max(axis=1))


def no_posture_keeps_limits(task: MotionTask, sample: int) -> bool:
    """Return whether provably no posture at a sample satisfies the limits.

    The limits are those on position and clearance, and on velocity from the sample before to the sample after. Boxes
    of joint positions are halved until each violates one (branch and bound, Land & Doig 1960). A box of half widths w
    about c may contain a feasible posture only if, for any unit vector u,

        |u·e(c)| ≤ Σᵢ |u·Jᵢ(c)| wᵢ + ½ Σᵢⱼ Bᵢⱼ wᵢ wⱼ                    e: error of the task
        d(c) + Σᵢ Rᵢ wᵢ ≥ the smallest clearance                      d: distance of a link
        u·Δx ≤ Σᵢ (|u·Jᵢ(c)| + Σⱼ Bᵢⱼ wⱼ) sᵢ + ½ Σᵢⱼ Bᵢⱼ sᵢ sⱼ          Δx: from sample to sample, s: steps of joints

    Bᵢⱼ is a bound of |∂²x/∂qᵢ∂qⱼ|; links end at most Rᵢ from joint i. The result is False if more than OPTIONS.boxes
    boxes are needed.
    """
    arm = task.arm
    limits = _at_sample(task.bounds["position"], sample) if "position" in task.bounds else arm.position_limits
    wide = arm.periodic & ~(np.diff(limits, axis=1)[:, 0] < 2 * np.pi)
    limits = np.where(wide[:, None], [-np.pi, np.pi], limits)
    if task.start is not None and sample == 0:
        limits = np.stack([task.start, task.start], axis=1)
    if obstructed_sample(task, sample) is not None:
        return True
    if not np.isfinite(limits).all():
        return False
    # R: largest distance of each link's end from the axis of each joint; 1 for prismatic joints, 0 if the link does not
    # move with the joint. The last link includes the frames of tasks
    arm, frames = task.arm, [task.arm.frame(each.frame) for each in task.tasks]
    strokes = np.where(arm.periodic, 0.0, np.abs(limits).max(axis=1))
    lengths = [float(np.linalg.norm(pose.position)) for pose in arm.placements] + strokes
    offsets = [float(np.linalg.norm(pose.position)) for pose in (arm.tool, *(frame.pose for frame in frames))]
    ends = np.cumsum(np.append(lengths, max(offsets)))
    reach = np.maximum(ends[None] - ends[:-1, None], 0.0)
    moves = np.arange(arm.dof + 1)[None] > np.arange(arm.dof)[:, None] - ~arm.periodic[:, None]
    reach = np.where(moves, np.where(arm.periodic[:, None], reach, 1.0), 0.0)
    first, last = np.minimum.outer(*[np.arange(arm.dof)] * 2), np.maximum.outer(*[np.arange(arm.dof)] * 2)
    bend = np.where(arm.periodic[first], np.where(arm.periodic[last], reach[last, -1], 1.0), 0.0)  # bounds B
    # the neighbouring samples, and the largest joint steps to them within velocity limits. A step of a spline's samples
    # is an average of steps of its control points, which are limited. There is no result for uneven times, near ends of
    # a spline, or for central differences
    steps = list[tuple[int, np.ndarray]]()
    if "velocity" in task.bounds and task.differences != "central":
        times, count = task.times, len(task.times)
        even = np.allclose(np.diff(times), times[1], rtol=1e-9)
        if task.differences != "spline" or (even and OPTIONS.inner <= sample < count - OPTIONS.inner):
            fastest = np.abs(task.bounds["velocity"]).max(axis=(0, 2))
            others = [other for other in (sample - 1, sample + 1) if 0 <= other < count]
            steps = [(other, fastest * abs(times[other] - times[sample]) * (1 + OPTIONS.doubt)) for other in others]
    center, half = limits.mean(axis=1)[None], np.diff(limits, axis=1).T / 2 * (1 + 1e-6)
    looked_at = 0
    while len(center) and looked_at + len(center) <= OPTIONS.boxes:
        check_interruption()
        looked_at += len(center)
        keep = _may_reach(task, sample, center, half, bend, steps)
        if task.obstacles:
            nodes, motion = link_nodes(arm, center), half @ reach
            smallest = task.min_clearance + radii(task.link_radius) - LIMIT_TOLERANCE * task.clearance_range
            for each in task.obstacles:
                keep &= (signed_distance(each, nodes[:, :-1], nodes[:, 1:]) + motion >= smallest).all(axis=1)
        center, half = center[keep], half[keep]
        rows, widest = np.arange(len(center)), np.argmax(half * reach[:, -1], axis=1)
        half[rows, widest] /= 2
        step = np.zeros_like(center)
        step[rows, widest] = half[rows, widest]
        center, half = np.concatenate([center - step, center + step]), np.concatenate([half, half])
    return not len(center)


def _may_reach(
    task: MotionTask,
    sample: int,
    center: np.ndarray,
    half: np.ndarray,
    bend: np.ndarray,
    steps: Sequence[tuple[int, np.ndarray]],
) -> np.ndarray:
    """Return a mask of the boxes that may reach a sample, and its neighbours within ``steps``."""
    error, jacobian = task_errors(task.arm, task.tasks, center, task.targets[sample])
    rest, blur = np.einsum("bi,ij,bj->b", half, bend, half) / 2, half @ bend
    turning = (half * task.arm.periodic).sum(axis=1)
    keep, row, column = np.ones(len(center), dtype=bool), 0, 0
    for one in task.tasks:
        size = one.position_rows
        position, rotation = slice(row, row + size), slice(row + size, row + one.rows)
        length = np.linalg.norm(error[:, position], axis=1)
        along = np.einsum("br,brd->bd", error[:, position] / np.maximum(length, 1e-300)[:, None], jacobian[:, position])
        keep &= length <= (np.abs(along) * half).sum(axis=1) + rest + ON_PATH_TOLERANCE
        keep &= np.linalg.norm(error[:, rotation], axis=1) <= turning + ON_PATH_TOLERANCE
        for other, step in steps if np.isfinite([step for _, step in steps]).all() else ():
            path = (task.targets[other] - task.targets[sample])[column : column + size]
            u = _directions(path, jacobian[:, position])
            most = ((np.abs(np.einsum("nbr,brd->nbd", u, jacobian[:, position])) + blur) * step).sum(axis=-1)
            keep &= (u @ path <= most + step @ bend @ step / 2).all(axis=0)
        row, column = row + one.rows, column + one.target_size
    return keep


def _directions(path: np.ndarray, jacobian: np.ndarray) -> Float[np.ndarray, "directions boxes axes"]:
    """Return unit vectors along which the tool may be too slow.

    One is along the path, the others are normal to columns of J, as are the facets of the zonotope of the tool's
    possible velocities.
    """
    along = path / max(float(np.linalg.norm(path)), 1e-300)
    columns = np.moveaxis(jacobian, 2, 0)
    if len(path) == 2:
        normals = np.stack([-columns[..., 1], columns[..., 0]], axis=-1)
    else:
        i, j = np.tril_indices(len(columns), -1)
        normals = np.cross(columns[i], columns[j])
    candidates = np.concatenate([np.broadcast_to(along, (1, *jacobian.shape[:2])), normals])
    length = np.linalg.norm(candidates, axis=-1, keepdims=True)
    u = np.where(length > 1e-9, candidates / np.maximum(length, 1e-9), along)
    return np.where((u @ path)[..., None] < 0, -u, u)
