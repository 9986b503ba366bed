"""Motions that satisfy limits on joint positions, velocities, accelerations, and distances in every step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Shaped

from paretoik.errors import SolverFailed
from paretoik.nlp.convex_subproblem import solve_subproblem
from paretoik.nlp.program import Constraints, dense_rows
from paretoik.resolution.protocol import (
    DAMPED,
    DONE,
    HELD,
    LIMITED,
    MISSED,
    Criterion,
    StepProgram,
    Traces,
    step_program,
)
from paretoik.tables import represented
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import OPTIONS as RETRACTION_OPTIONS
from paretoik.task.retraction import row_scales

# One step within limits: a quadratic program of joint rates
#
# With rates z of the criteria and weights W, a step solves
#
#     minimise    ½ (q̇ − z)ᵀ W (q̇ − z)
#     subject to  J q̇ = v                  (task)
#                 lower ≤ q̇ ≤ upper        (joint limits, as rates)
#                 ∇d · q̇ ≥ −approach       (distances from obstacles)
#
# If the task is damped by ρ, or has no solution within limits, it is relaxed:
#
#     minimise    ½ ‖J q̇ − v‖² + ½ ρ² (q̇ − z)ᵀ W (q̇ − z)
#
# With q̇ = free + W^(−½) N x, where ``free`` is the solution without limits, both are: minimise ½ xᵀPx subject to
# Gx ≤ h. In the first, N is the null space of J W^(−½) and P = I; in the second, N = I and
# P = I + W^(−½) Jᵀ J W^(−½) / ρ². If a limit is active, the convex subproblem of the SQP solves it.
#
# Source: Cheng, Chen & Sun 1994, Resolving Manipulator Redundancy under Inequality Constraints; Faverjon & Tournassoud
# 1987 for distances.


@dataclass(frozen=True, kw_only=True)
class StepOptions:
    """Tolerances of a step within limits."""

    tolerance: float = 1e-9  # share of the largest rate or bound: a smaller excess is accepted
    singular: float = 1e-13  # share of the largest singular value: the Jacobian counts as singular
    least_damping: float = 1e-4  # share of the largest singular value, if an undamped task is relaxed
    penalty: float = 1e6  # weight of the rates, relative to the largest, at which distances shrink too fast


OPTIONS = StepOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class StepGoal:
    """Goal of a step: rates of the task and of the criteria, inverse joint weights D, and damping."""

    jacobian: Float[np.ndarray, "rows dof"]
    task_rates: Float[np.ndarray, " rows"]
    secondary: Float[np.ndarray, " dof"]
    inverse_weights: Float[np.ndarray, " dof"]
    region: float
    damping: float


@dataclass(frozen=True, kw_only=True, eq=False)
class StepLimits:
    """Bounds of joint rates, and gradients and lower bounds of distances' rates."""

    bounds: Float[np.ndarray, "dof 2"]
    gradients: Float[np.ndarray, "distances dof"]
    lowest_rates: Float[np.ndarray, " distances"]

    def slack(self, rates: Float[np.ndarray, " dof"]) -> Float[np.ndarray, " limits"]:
        """Return the slacks of distances, lower bounds and upper bounds at rates; negative if violated."""
        return np.concatenate(
            [self.gradients @ rates - self.lowest_rates, rates - self.bounds[:, 0], self.bounds[:, 1] - rates]
        )

    def keep(self, rates: Float[np.ndarray, " dof"], free: Float[np.ndarray, " dof"]) -> bool:
        """Return whether rates satisfy all limits within the tolerance.

        The tolerance is relative to the rates without limits, or to the bounds if these are smaller.
        """
        size = min(float(np.abs(free).max()), float(np.abs(self.bounds).max()))
        return bool(self.slack(rates).min() >= -OPTIONS.tolerance * size)


@dataclass(frozen=True, kw_only=True, eq=False)
class LimitedStep:
    """A step's rates with and without limits, projector onto the null space, damping ρ, and index into STATUS."""

    rates: Float[np.ndarray, " dof"]
    free: Float[np.ndarray, " dof"]
    projector: Float[np.ndarray, "dof dof"]
    damping: float
    status: int


def limited_step(goal: StepGoal, limits: StepLimits) -> LimitedStep:
    """Return the step without limits if it satisfies them, else that of the quadratic program."""
    root = np.sqrt(goal.inverse_weights)
    weighted = goal.jacobian * root
    U, sizes, V = np.linalg.svd(weighted)
    rows, largest, smallest = len(sizes), float(sizes[0]), float(sizes[-1])

    def step(damping: float, status: int) -> LimitedStep:
        inverse = root[:, None] * V[:rows].T * (sizes / (sizes**2 + damping**2)) @ U.T
        projector = np.eye(len(root)) - inverse @ goal.jacobian
        free = inverse @ goal.task_rates + projector @ goal.secondary
        return LimitedStep(rates=free, free=free, projector=projector, damping=damping, status=status)

    if goal.damping > 0 and smallest < goal.region:
        damping = float(goal.damping * np.sqrt(1 - (smallest / goal.region) ** 2))  # Wan et al. 2018, Eq. 4
        without = step(damping, DAMPED)
    elif smallest > OPTIONS.singular * largest:
        damping, without = goal.damping, step(0.0, DONE)
    else:
        # the least rates that satisfy the limits, or only the joint bounds if none satisfies all
        zeros, identity = np.zeros_like(root), np.eye(len(root))
        still: np.ndarray = np.clip(zeros, *limits.bounds.T)
        if limits.slack(still).min() < 0:
            nearest = _nearest(zeros, identity, root, identity, limits)
            still = still if nearest is None else nearest
        return replace(step(1.0, HELD if limits.keep(still, still) else LIMITED), rates=still, free=still)
    if limits.keep(without.free, without.free):
        return without
    identity = np.eye(len(root))
    if without.status == DONE:
        rates = _nearest(without.free, V[rows:].T, root, identity[rows:, rows:], limits)
        if rates is not None and limits.keep(rates, without.free):
            return replace(without, rates=rates)
    relaxed = step(max(damping, OPTIONS.least_damping * largest), LIMITED if without.status == DONE else DAMPED)
    rates = _nearest(relaxed.free, identity, root, identity + weighted.T @ weighted / relaxed.damping**2, limits)
    if rates is None:
        rates = np.clip(relaxed.free, *limits.bounds.T)
    return replace(relaxed, rates=rates, status=relaxed.status if limits.keep(rates, relaxed.free) else LIMITED)


def _nearest(free: np.ndarray, N: np.ndarray, root: np.ndarray, P: np.ndarray, limits: StepLimits) -> np.ndarray | None:
    """Return free + root N x within limits with the least ½ xᵀPx, None if no rates are within the joint bounds.

    If these bounds require it, distances shrink faster than allowed, by as little as possible.
    """
    values, distances, basis = limits.slack(free), len(limits.lowest_rates), root[:, None] * N
    G = np.concatenate([limits.gradients @ basis, basis, -basis])
    size = max(float(np.abs(free).max()), float(-values.min()))
    farthest = np.abs(limits.bounds - free[:, None]).max(axis=1) / size
    radius = float((np.abs(N.T) @ (farthest / root)).max())
    constraints = Constraints(unknowns=len(P), values=values / size, jacobian=dense_rows(G))
    out_of_reach = values / size + np.abs(G).sum(axis=1) * radius < 0
    if out_of_reach[distances:].any():
        return None
    try:
        solution = solve_subproblem(
            np.zeros(len(P)),
            dense_rows(P / np.abs(P).max()),
            constraints,
            elastic=distances,
            radius=radius,
            penalty=OPTIONS.penalty,
        )
    except SolverFailed:
        return None
    return np.asarray(free + size * (basis @ solution.step))


# Rates that satisfy the limits of joints and distances in this step and in all later steps
#
# Rates are constant in a step, and change between steps within acceleration limits. A joint that approaches a limit
# must be able to brake before it: from a rate v, with decelerations aⱼ in later steps, it moves at least v Tₙ − Sₙ in
# n + 1 steps, with Tₙ = Σ hⱼ and Sₙ = Σ hⱼ Σᵢ≤ⱼ aᵢ hᵢ. If no such move exceeds the distance from a limit, an admissible
# rate exists in the next step too.
#
# Source: Del Prete 2018, Joint Position and Velocity Bounds in Discrete-Time Acceleration/Torque Control of Robot
# Arms, for any steps and for limits that vary.


KINDS = "acceleration", "step", "velocity", "position"  # kinds of limits on a joint's rate, most important first


@dataclass(frozen=True, kw_only=True, eq=False)
class RateLimits:
    """Limits (steps, dof, 2) at the sample after every step, ∓inf if there are none; ``steps`` are durations [s]."""

    position: Float[np.ndarray, "steps dof 2"]
    velocity: Float[np.ndarray, "steps dof 2"]
    acceleration: Float[np.ndarray, "steps dof 2"]
    steps: Float[np.ndarray, " steps"]

    @classmethod
    def of(cls, task: MotionTask) -> RateLimits:
        """Return the limits of a task."""
        steps, dof = np.diff(task.times), task.arm.dof
        shape, none = (len(task.times), dof, 2), np.array([-np.inf, np.inf])
        bounds = {"velocity": none, "acceleration": none, "position": task.arm.position_limits, **task.bounds}
        kinds = ("position", "velocity", "acceleration")
        return cls(**{kind: np.broadcast_to(bounds[kind], shape)[1:] for kind in kinds}, steps=steps)

    def bounds(self, k: int, q: np.ndarray, previous: np.ndarray) -> Float[np.ndarray, "kinds *batch dof 2"]:
        """Return bounds of rates in step k, which begins at q (*batch, dof) after ``previous`` rates."""
        sides = []
        for side, sign in ((0, -1.0), (1, 1.0)):
            braking = self._braking(k, side)
            slack = sign * (self.position[k : k + len(braking), :, side] - q[..., None, :])
            drop = np.cumsum(braking * self.steps[k : k + len(braking), None], axis=0)
            bounds = (
                sign * previous + sign * self.acceleration[k, :, side] * self.steps[k],
                np.full_like(q, 1.0 / self.steps[k]),  # at most 1 rad or m: farther away the Jacobian is wrong
                np.broadcast_to((sign * self.velocity[k : k + len(braking), :, side] + drop).min(axis=0), q.shape),
                highest_rate(slack, braking, self.steps[k : k + len(braking)]),
            )
            sides.append(sign * np.stack(bounds))
        return np.stack(sides, axis=-1)

    def approach(self, k: int, slack: np.ndarray, gradients: np.ndarray) -> Float[np.ndarray, "*batch"]:
        """Return the highest rates at which distances (*batch,) with a ``slack`` [m] may shrink in step k.

        Every joint brakes within its acceleration limits; the gradients (*batch, dof) are taken as constant.
        """
        lower, upper = (self._braking(k, side) for side in (0, 1))  # braking of downward and of upward motion
        rising, falling = np.maximum(gradients, 0.0), np.maximum(-gradients, 0.0)
        with np.errstate(invalid="ignore"):
            braking = np.nan_to_num(rising[..., None, :] * lower, nan=0.0, posinf=np.inf)
            braking = (braking + np.nan_to_num(falling[..., None, :] * upper, nan=0.0, posinf=np.inf)).sum(axis=-1)
        steps = self.steps[k : k + len(lower)]
        return highest_rate(slack[..., None, None], braking[..., None], steps)[..., 0]

    def _braking(self, k: int, side: int) -> Float[np.ndarray, "later dof"]:
        """Return the possible decelerations towards a side: 0 in step k, then those in later steps.

        If no acceleration is limited, there is only step k, because rates can then become 0 at once.
        """
        opposite = self.acceleration[k:, :, 1 - side] * (1.0 if side == 0 else -1.0)
        later = opposite if np.isfinite(opposite).any() else opposite[:1]
        return np.concatenate([np.zeros((1, later.shape[1])), np.maximum(later[1:], 0.0)])


def highest_rate(
    slack: Float[np.ndarray, "*batch #later columns"],
    braking: Float[np.ndarray, "*#batch later columns"],
    steps: Float[np.ndarray, " later"],
) -> Float[np.ndarray, "*batch columns"]:
    """Return the highest rate whose moves are within ``slack`` at the end of this step and of every later one.

    braking: possible deceleration in these steps, 0 in the first
    """
    drop = np.cumsum(braking * steps[:, None], axis=-2)
    return np.asarray(((slack + np.cumsum(drop * steps[:, None], axis=-2)) / np.cumsum(steps)[:, None]).min(axis=-2))


def intersection(bounds: Float[np.ndarray, "kinds *batch dof 2"]) -> Float[np.ndarray, "*batch dof 2"]:
    """Return the interval within the bounds of all kinds; if they contradict each other, the first kinds prevail."""
    lower, upper = bounds[0, ..., 0], bounds[0, ..., 1]
    for each in bounds[1:]:
        lower, upper = np.clip(each[..., 0], lower, upper), np.clip(each[..., 1], lower, upper)
    return np.stack([lower, upper], axis=-1)


# Motions with limits in every step.


ACTIVE = np.array(["", *(f"{side} {kind}" for kind in KINDS for side in ("lower", "upper")), "clearance"])


@represented
@dataclass(frozen=True, kw_only=True, eq=False)
class ConstrainedTraces(Traces):
    """Traces of a motion within limits.

    repulsion: change of velocities by limits
    active: active limit of each joint, such as "upper position", or ""; the last column is "clearance" if a link must
        not come nearer to an obstacle
    """

    active: Shaped[np.ndarray, "*batch steps limits"]


class _Linearisation(NamedTuple):
    """The results of the step program at a posture; a criterion's row has its value and its gradient."""

    errors: Float[np.ndarray, " rows"]
    travel: Float[np.ndarray, " rows"]
    jacobian: Float[np.ndarray, "rows dof"]
    criteria: Float[np.ndarray, "criteria columns"]
    distances: Float[np.ndarray, " distances"]
    gradients: Float[np.ndarray, "distances dof"]


def follow_constrained(
    task: MotionTask,
    criteria: Sequence[Criterion],
    inverse_weights: Float[np.ndarray, " dof"],
    settings: Float[np.ndarray, "motions columns"],
    gains: Float[np.ndarray, "motions criteria 2"],
    q: Float[np.ndarray, "motions time dof"],
    traces: dict[str, np.ndarray],
    *,
    exact: bool,
) -> None:
    """Write the traces, and the positions after the first sample.

    settings: feedback, region and damping of each motion
    exact: whether a step is computed again about its own end
    """
    dof = task.arm.dof
    signs = np.array([each.objective.sign for each in criteria]).reshape(-1, 1)
    program = step_program(task, tuple(each.objective for each in criteria), with_distances=bool(task.obstacles))
    traces["active"] = np.zeros((*traces["velocities"].shape[:2], dof + 1), dtype=np.int8)
    stepper = _Stepper(task, program, exact=exact, inverse_weights=inverse_weights)
    for k in range(len(task.times)):
        for motion in range(len(q)):
            previous = traces["velocities"][motion, k - 1] if k else np.zeros(dof)
            at = stepper.linearise(k, q[motion, k], previous)
            traces["errors"][motion, k] = at.errors
            if k == len(task.times) - 1:
                continue
            # Rates that decrease each criterion (Wan et al. 2018, Eq. 12), 0 if the criterion is not finite.
            finite, gain = np.isfinite(at.criteria).all(axis=1), gains[motion, :, 0]
            secondary = np.where(finite[:, None], -signs * gain[:, None] * at.criteria[:, 1:], 0.0)
            goal = StepGoal(
                jacobian=at.jacobian,
                task_rates=at.travel / stepper.limits.steps[k] + settings[motion, 0] * at.errors,
                secondary=secondary.sum(axis=0),
                inverse_weights=stepper.inverse_weights,
                region=settings[motion, 1],
                damping=settings[motion, 2],
            )
            step, active = stepper.take(k, q[motion, k], previous, at, goal)
            q[motion, k + 1] = q[motion, k] + stepper.limits.steps[k] * step.rates
            traces["coefficients"][motion, k] = np.where(finite, gain, np.nan)
            traces["projected"][motion, k] = secondary @ step.projector.T
            traces["velocities"][motion, k], traces["damping"][motion, k] = step.rates, step.damping
            traces["repulsion"][motion, k], traces["status"][motion, k] = step.rates - step.free, step.status
            traces["active"][motion, k] = active


class _Stepper:
    """Computation of steps of one task's motions."""

    def __init__(
        self, task: MotionTask, program: StepProgram, *, exact: bool, inverse_weights: Float[np.ndarray, " dof"]
    ) -> None:
        self.task, self.program, self.exact, self.inverse_weights = task, program, exact, inverse_weights
        self.limits = RateLimits.of(task)

    def linearise(self, k: int, q: Float[np.ndarray, " dof"], dq: Float[np.ndarray, " dof"]) -> _Linearisation:
        """Return errors and derivatives at sample k, in a posture with previous rates dq."""
        n, rows, count = len(q), self.task.rows, self.program.distances
        inputs = np.concatenate([q, dq, np.zeros(2 * n), self.program.table[k]])
        outputs = self.program.program(inputs[:, None])[:, 0]
        cuts = [rows, 2 * rows, (2 + n) * rows, len(outputs) - count * (n + 1)]
        errors, travel, jacobian, criteria, distances = np.split(outputs, cuts)
        of_distances = distances.reshape(count, n + 1)
        tables = jacobian.reshape(rows, n), criteria.reshape(-1, n + 1), of_distances[:, 0], of_distances[:, 1:]
        return _Linearisation(errors, travel, *tables)

    def take(
        self, k: int, q: np.ndarray, previous: np.ndarray, at: _Linearisation, goal: StepGoal
    ) -> tuple[LimitedStep, np.ndarray]:
        """Return step k from q, after rates ``previous``, and its active limits, as indices into ACTIVE.

        An exact step is computed again about its own end by Newton's method, until the end is on the path and distances
        are correct.
        """
        dt, bounds = self.limits.steps[k], self.limits.bounds(k, q, previous)
        interval = intersection(bounds)
        nearest = at.distances - dt * self.limits.approach(k, at.distances - self.task.min_clearance, at.gradients)
        scales, moved = row_scales(self.task.arm, self.task.tasks), np.zeros_like(q)
        for _ in range(RETRACTION_OPTIONS.max_iterations):
            lowest_rates = (nearest - at.distances + at.gradients @ moved) / dt
            limits = StepLimits(bounds=interval, gradients=at.gradients, lowest_rates=lowest_rates)
            step = limited_step(goal, limits)
            if not self.exact or step.status != DONE:
                break
            moved = dt * step.rates
            at = self.linearise(k + 1, q + moved, previous)
            missing = np.concatenate([np.abs(at.errors) / scales, (nearest - at.distances) / self.task.clearance_range])
            if missing.max() <= RETRACTION_OPTIONS.tolerance:
                break
            goal = replace(goal, jacobian=at.jacobian, task_rates=(at.jacobian @ moved + at.errors) / dt)
        else:
            step = replace(step, status=MISSED)
        # The active limit of each joint, and whether the limit of a distance is active.
        first, rounding = len(nearest), 1e-7 * float(np.abs([step.rates, step.free]).max())
        kinds = 1 + 2 * np.abs(bounds - interval).argmin(axis=0) + [0, 1]

        def reached(rates: np.ndarray) -> np.ndarray:
            distances, lower, upper = np.split(limits.slack(rates), [first, first + len(q)])
            joints = np.where(lower <= rounding, kinds[:, 0], np.where(upper <= rounding, kinds[:, 1], 0))
            return np.append(joints, len(ACTIVE) - 1 if (distances <= rounding).any() else 0)

        active = reached(step.rates)
        if step.status == LIMITED and not active.any():  # only the undamped step would exceed limits
            rest = goal.task_rates - goal.jacobian @ step.rates
            active = reached(step.rates + np.linalg.lstsq(goal.jacobian, rest, rcond=None)[0])
        broken = np.stack([bounds[..., 0] - interval[:, 1], interval[:, 0] - bounds[..., 1]], axis=-1) > rounding
        if broken.any():  # limits that are exceeded to satisfy more important ones
            step = replace(step, status=LIMITED)
            kinds = broken.transpose(1, 0, 2).reshape(len(q), -1)
            active[:-1] = np.where(kinds.any(axis=1), 1 + kinds.argmax(axis=1), active[:-1])
        return step, active
