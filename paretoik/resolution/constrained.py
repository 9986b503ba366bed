"""Motions whose every step keeps its limits: joints' positions, velocities and accelerations, and distances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Shaped

from paretoik.errors import InvalidInput
from paretoik.resolution.limited_step import LimitedStep, StepGoal, StepLimits, limited_step
from paretoik.resolution.methods import ConstrainedQP, Criterion
from paretoik.resolution.rate_limits import KINDS, RateLimits, intersection
from paretoik.resolution.step_program import StepProgram, step_program
from paretoik.resolution.traces import DONE, LIMITED, MISSED, Traces
from paretoik.tables import field_representation, html_representation
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import OPTIONS, row_scales

ACTIVE = np.array(["", *(f"{side} {kind}" for kind in KINDS for side in ("lower", "upper")), "clearance"])


@dataclass(frozen=True, kw_only=True, eq=False)
class ConstrainedTraces(Traces):
    """The limits that steps are at besides the motion; ``repulsion`` is what limits change of the velocities.

    ``active`` names, "upper position" for one, the limit that each joint is at, "" for none, and in its last column
    "clearance" where a link may come no nearer to an obstacle.
    """

    active: Shaped[np.ndarray, "*batch steps limits"]

    __repr__ = field_representation
    _repr_html_ = html_representation


@dataclass(frozen=True, kw_only=True, eq=False)
class _Linearisation:
    """The step program's results at a posture; a criterion's row is its value and its gradient."""

    errors: Float[np.ndarray, " rows"]
    travel: Float[np.ndarray, " rows"]
    jacobian: Float[np.ndarray, "rows dof"]
    criteria: Float[np.ndarray, "criteria columns"]
    distances: Float[np.ndarray, " distances"]
    gradients: Float[np.ndarray, "distances dof"]


def follow_constrained(
    task: MotionTask,
    method: ConstrainedQP,
    settings: Float[np.ndarray, "motions columns"],
    gains: Float[np.ndarray, "motions criteria 2"],
    q: Float[np.ndarray, "motions time dof"],
    traces: dict[str, np.ndarray],
) -> None:
    """Fill positions after the first and the traces; ``settings`` are feedback, region and damping of each motion.

    Raises InvalidInput for joint weights that do not fit the arm.
    """
    criteria, dof = method.criterion_list, task.arm.dof
    weights = np.ones(dof) if method.joint_weights is None else np.asarray(method.joint_weights, dtype=float)
    if weights.shape != (dof,):
        raise InvalidInput(f"ConstrainedQP: joint_weights ({dof},) wanted, got shape {weights.shape}")
    program = step_program(task, tuple(each.objective for each in criteria), with_distances=bool(task.obstacles))
    traces["active"] = np.zeros((*traces["velocities"].shape[:2], dof + 1), dtype=np.int8)
    stepper = _Stepper(task, program, exact=method.feedback is None, inverse_weights=1.0 / weights)
    for k in range(len(task.times)):
        for motion in range(len(q)):
            previous = traces["velocities"][motion, k - 1] if k else np.zeros(dof)
            at = stepper.linearise(k, q[motion, k], previous)
            traces["errors"][motion, k] = at.errors
            if k == len(task.times) - 1:
                continue
            secondary, coefficients = _secondary(criteria, gains[motion, :, 0], at.criteria)
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
            traces["coefficients"][motion, k] = coefficients
            traces["projected"][motion, k] = secondary @ step.projector.T
            traces["velocities"][motion, k], traces["damping"][motion, k] = step.rates, step.damping
            traces["repulsion"][motion, k], traces["status"][motion, k] = step.rates - step.free, step.status
            traces["active"][motion, k] = active


class _Stepper:
    """Takes the steps of motions of one task."""

    def __init__(
        self, task: MotionTask, program: StepProgram, *, exact: bool, inverse_weights: Float[np.ndarray, " dof"]
    ) -> None:
        self.task, self.program, self.exact, self.inverse_weights = task, program, exact, inverse_weights
        self.limits = RateLimits.of(task)

    def linearise(self, k: int, q: Float[np.ndarray, " dof"], dq: Float[np.ndarray, " dof"]) -> _Linearisation:
        """Return the task of sample k, the criteria and the distances about a posture with its last rates."""
        n, rows, count = len(q), self.task.rows, self.program.distances
        inputs = np.concatenate([q, dq, np.zeros(2 * n), self.program.table[k]])
        outputs = self.program.program(inputs[:, None])[:, 0]
        cuts = np.cumsum([rows, rows, rows * n, len(outputs) - 2 * rows - rows * n - count * (n + 1)])
        errors, travel, jacobian, criteria, distances = np.split(outputs, cuts)
        of_distances = distances.reshape(count, n + 1)
        return _Linearisation(
            errors=errors,
            travel=travel,
            jacobian=jacobian.reshape(rows, n),
            criteria=criteria.reshape(-1, n + 1),
            distances=of_distances[:, 0],
            gradients=of_distances[:, 1:],
        )

    def take(
        self, k: int, q: np.ndarray, previous: np.ndarray, at: _Linearisation, goal: StepGoal
    ) -> tuple[LimitedStep, np.ndarray]:
        """Return step k from q, after rates ``previous``, and what limits are active, as indices into ACTIVE.

        An exact step is solved for again about its own end, until that is on the path and distances are what they must
        be: Newton's method.
        """
        dt, bounds = self.limits.steps[k], self.limits.bounds(k, q, previous)
        interval = intersection(bounds)
        nearest = at.distances - dt * self.limits.approach(k, at.distances - self.task.min_clearance, at.gradients)
        scales, moved = row_scales(self.task.arm, self.task.tasks), np.zeros_like(q)
        for _ in range(OPTIONS.max_iterations):
            lowest_rates = (nearest - at.distances + at.gradients @ moved) / dt
            limits = StepLimits(bounds=interval, gradients=at.gradients, lowest_rates=lowest_rates)
            step = limited_step(goal, limits)
            if not self.exact or step.status != DONE:
                break
            moved = dt * step.rates
            at = self.linearise(k + 1, q + moved, previous)
            missing = np.concatenate([np.abs(at.errors) / scales, (nearest - at.distances) / self.task.clearance_range])
            if missing.max() <= OPTIONS.tolerance:
                break
            goal = replace(goal, jacobian=at.jacobian, task_rates=(at.jacobian @ moved + at.errors) / dt)
        else:
            step = replace(step, status=MISSED)
        active = _active(step, bounds, limits)
        broken = np.stack([bounds[..., 0] - interval[:, 1], interval[:, 0] - bounds[..., 1]], axis=-1) > _rounding(step)
        if broken.any():  # by limits that come before: accelerations, or velocities
            step = replace(step, status=LIMITED)
            kinds = broken.transpose(1, 0, 2).reshape(len(q), -1)
            active[:-1] = np.where(kinds.any(axis=1), 1 + kinds.argmax(axis=1), active[:-1])
        return step, active


def _secondary(
    criteria: Sequence[Criterion], gains: np.ndarray, rows: np.ndarray
) -> tuple[Float[np.ndarray, "criteria dof"], Float[np.ndarray, " criteria"]]:
    """Return the rates that descend each criterion (Wan et al. 2018, Eq. 12) and their coefficients.

    A criterion that is not finite asks for nothing, its coefficient being NaN.
    """
    finite = np.isfinite(rows).all(axis=1)
    signs = np.array([each.objective.sign for each in criteria]).reshape(-1, 1)
    rates = np.where(finite[:, None], -signs * gains[:, None] * rows[:, 1:], 0.0)
    return rates, np.where(finite, gains, np.nan)


def _rounding(step: LimitedStep) -> float:
    """Return the slack at which a limit of rates counts as active."""
    return 1e-7 * float(np.abs([step.rates, step.free]).max())


def _active(step: LimitedStep, bounds: np.ndarray, limits: StepLimits) -> np.ndarray:
    """Return the limit that each joint is at and whether one of distances is, as indices into ACTIVE."""
    first, rounding = len(limits.lowest_rates), _rounding(step)
    distances, lower, upper = np.split(limits.slack(step.rates), [first, first + len(step.rates)])
    kinds = 1 + 2 * np.abs(bounds - limits.bounds).argmin(axis=0) + [0, 1]
    active = np.where(lower <= rounding, kinds[:, 0], np.where(upper <= rounding, kinds[:, 1], 0))
    return np.append(active, len(ACTIVE) - 1 if (distances <= rounding).any() else 0)
