"""The numbers of (weighted) gradient projection as a pymoo problem: who sets them by hand sets them by trial and error.

An individual is a method's numbers and a place to start from. It is judged by the worst of several starts around that
place, so that numbers that suit one posture alone are not taken for good ones. All individuals and starts are resolved
at once.

Source: Wan et al. 2018, whose numbers these are; that they are searched for, and by several objectives, is new.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float, Int
from pymoo.core.problem import Problem

from paretoik.arrays import Genes
from paretoik.errors import InvalidInput, check_size
from paretoik.resolution.batch import ranges
from paretoik.resolution.methods import Criterion, GradientProjection, Variant, WeightedGradientProjection
from paretoik.resolution.resolve import resolve
from paretoik.resolution.step_program import step_program
from paretoik.resolution.traces import ResolvedMotion
from paretoik.robot.arm import Arm
from paretoik.robot.pose import finite_array
from paretoik.self_motion.postures import order_by_neighbour, reach_error, sample_postures, wrap_difference
from paretoik.task.motion_task import MotionTask
from paretoik.task.motion_task_validation import motion_task
from paretoik.task.objectives import Objective, joint_limit_nearness, joint_travel
from paretoik.task.obstacles import Obstacle
from paretoik.task.path import Path
from paretoik.task.task import Task

POSTURES = 400  # tried for starts
GAINS = -4.0, 1.0  # powers of ten
DAMPING = -3.0, -1.0  # powers of ten, of ε and ρ_max alike
SHARES = 0.02, 0.48  # of Ω and λ
REPULSION = 2 * np.pi  # rad/s, at most
LEAST_FEEDBACK = 0.02  # share of the most
RANGES: tuple[tuple[str, str, bool], ...] = (
    ("tracking_error", "m, rad", False),
    ("limit_margin", "", True),
    ("speed_ratio", "", False),
    ("roughness", "rad²/s⁵", False),
)


class ProjectionGains(Problem):  # type: ignore[misc]  # pymoo is not typed
    """Find the numbers of a projection method along ``path``: a vectorised pymoo problem.

    Objectives, each the worst over the starts: ``tracking_error``, the greatest task error [m, rad]; ``limit_margin``,
    the least distance of a joint from its position limits over its range, negative past them, maximised;
    ``speed_ratio``, the greatest joint speed over its limit (over 1 rad/s where it has none); ``roughness``, the
    integral of squared jerks.

    Parameters
    ----------
    arm, path
        The arm, and a Path, a Task or several of them.
    family
        "weighted" for ``WeightedGradientProjection``, "plain" for ``GradientProjection``.
    criteria
        Objectives or ``Criterion``: their gains, and for "weighted" their order, are searched for. Plain projection has
        the nearness to position limits by default, which the weighted one has built in.
    starts
        Postures (starts, dof) that motions may begin in, in some order; by default those on the path's first sample
        within the limits, one after its nearest neighbour.
    several
        How many starts an individual is judged by: the one at its place and those around it.
    variant
        Of ``WeightedGradientProjection``.
    obstacles, link_radius
        What criteria may look at.
    seed
        Of the starts; part of the problem.

    Genes: place, feedback, damping, then buffer Ω, repulsion and band λ ("weighted"), a gain for each criterion and,
    "weighted" with several, a key for each: the lowest comes first.

    Raises
    ------
    InvalidInput
        Naming what cannot be used; OutOfReach where the path's first sample is.
    """

    names = tuple(name for name, _, _ in RANGES)
    units = tuple(unit for _, unit, _ in RANGES)
    maximised = tuple(turned for _, _, turned in RANGES)

    def __init__(
        self,
        arm: Arm,
        path: Path | Task | Sequence[Path | Task],
        *,
        family: Literal["weighted", "plain"] = "weighted",
        criteria: Sequence[Criterion | Objective] | None = None,
        starts: Sequence[Sequence[float]] | Float[np.ndarray, "starts dof"] | None = None,
        several: int = 5,
        variant: Variant = "consistent",
        obstacles: Sequence[Obstacle] = (),
        link_radius: float = 0.0,
        seed: int = 0,
    ) -> None:
        if family not in ("weighted", "plain"):
            raise InvalidInput(f"family must be one of weighted, plain, got {family!r}")
        default = [] if family == "weighted" else [joint_limit_nearness]
        given = GradientProjection(criteria=default if criteria is None else criteria).settled
        for one in given:
            if np.ndim(one.gain):
                raise InvalidInput(f"criterion {one.objective.name}: one gain wanted, got {one.gain}")
        WeightedGradientProjection(variant=variant)  # refuses another
        check_size("seed", seed, 0)
        self.family, self.variant, self.criteria = family, variant, given
        self.path = path
        self.task: MotionTask = motion_task(
            arm,
            path,
            objectives=[one.objective for one in given] or [joint_travel],
            obstacles=obstacles,
            link_radius=link_radius,
        )
        step_program(self.task, [one.objective for one in given])  # refuses criteria that cannot be projected
        self.starts = _ordered(self.task, seed) if starts is None else finite_array("starts", starts)
        if self.starts.ndim != 2 or self.starts.shape[1] != arm.dof or not self.starts.size:
            raise InvalidInput(f"starts: postures (starts, {arm.dof}) wanted, got shape {self.starts.shape}")
        check_size("several", several, 1)
        if several > len(self.starts):
            raise InvalidInput(f"several: 1 to {len(self.starts)} starts wanted, got {several!r}")
        self.several = int(several)
        self.most = 1.0 / float(np.diff(self.task.times).max())
        count = len(given)
        low, high = [0.0, LEAST_FEEDBACK, DAMPING[0]], [1.0, 1.0, DAMPING[1]]
        if family == "weighted":
            low += [SHARES[0], 0.0, SHARES[0]]
            high += [SHARES[1], REPULSION, SHARES[1]]
        low += [GAINS[0]] * count
        high += [GAINS[1]] * count
        if family == "weighted" and count > 1:
            low += [0.0] * count
            high += [1.0] * count
        super().__init__(n_var=len(low), n_obj=len(self.names), xl=np.array(low), xu=np.array(high))

    def method(self, genes: Genes) -> GradientProjection:
        """Return the method of genes (points, n_var), its numbers (points, 1): the second axis is that of starts."""
        columns = genes.T[..., None]
        count, begun = len(self.criteria), 6 if self.family == "weighted" else 3
        criteria = [
            Criterion(
                objective=one.objective,
                gain=one.gain * 10.0 ** columns[begun + c],
                reference=one.reference,
                scale=one.scale,
            )
            for c, one in enumerate(self.criteria)
        ]
        damping, feedback = 10.0 ** columns[2], self.most * columns[1]
        if self.family == "plain":
            return GradientProjection(criteria=criteria, feedback=feedback, region=damping, damping=damping)
        return WeightedGradientProjection(
            criteria=criteria,
            feedback=feedback,
            region=damping,
            damping=damping,
            buffer=columns[3],
            repulsion=columns[4],
            band=columns[5],
            priorities=genes[:, None, begun + count :] if count > 1 else None,
            variant=self.variant,
        )

    def begun(self, genes: Genes) -> Int[np.ndarray, "points several"]:
        """Return which starts an individual is judged by, that at its place first."""
        place = np.minimum((genes[:, 0] * len(self.starts)).astype(int), len(self.starts) - 1)
        around = np.arange(self.several)
        shifts = np.where(around % 2, (around + 1) // 2, -(around // 2))
        return np.asarray((place[:, None] + shifts) % len(self.starts))

    def decode(self, genes: Genes) -> ResolvedMotion:
        """Return the motions (points, time, dof) of genes from the starts at their places."""
        return self._resolved(genes, 1)[:, 0]

    def fingerprint_parts(self) -> list[object]:
        """Return what makes genes mean what they mean: the starts, the task, the method and its criteria."""
        task = self.task
        parts: list[object] = [self.starts, task.targets, task.times, task.arm.joint_names, self.family, self.variant]
        parts += [self.several, self.names, self.maximised, task.arm.position_limits, task.arm.velocity_limits]
        parts += [task.link_radius, *task.obstacles]
        return parts + [(one.objective.name, one.gain, one.reference, one.scale) for one in self.criteria]

    def _resolved(self, genes: Genes, several: int) -> ResolvedMotion:
        starts = self.starts[self.begun(genes)[:, :several]]
        return resolve(
            self.task.arm,
            self.path,
            self.method(genes),
            start=starts,
            obstacles=self.task.obstacles,
            link_radius=self.task.link_radius,
            unreachable="track",
        )

    def _evaluate(self, X: Genes, out: dict[str, object], *args: object, **kwargs: object) -> None:
        motion = self._resolved(X, self.several)
        arm = self.task.arm
        lower, upper = arm.position_limits.T
        between = ranges(arm, arm.position_limits)
        limited = np.isfinite(between)
        span = np.where(limited, between, 1.0)
        room = np.where(limited, np.minimum(motion.q - lower, upper - motion.q) / span, np.inf)
        margin = room.min(axis=(-2, -1)) if limited.any() else np.zeros(motion.q.shape[:2])
        speeds = np.where(np.isfinite(arm.velocity_limits), arm.velocity_limits, 1.0)
        rough = motion.integral(np.sum(motion.jerk**2, axis=-1))
        errors = np.abs(motion.traces.errors).max(axis=(-2, -1))
        values = [errors, -margin, (np.abs(motion.dq) / speeds).max(axis=(-2, -1)), rough]
        out["F"] = np.stack([each.max(axis=1) for each in values], axis=1)


def _ordered(task: MotionTask, seed: int) -> Float[np.ndarray, "starts dof"]:
    """Return postures on the first sample within the limits, each after its nearest neighbour."""
    rng = np.random.default_rng(seed)
    found = sample_postures(task, POSTURES, rng)
    if not len(found):
        raise reach_error(task, rng, 0)
    found = wrap_difference(found, task.arm.periodic)
    lower, upper = task.arm.position_limits.T
    inside = ((found >= lower) & (found <= upper)).all(axis=1)
    return order_by_neighbour(found[inside] if inside.any() else found, task.arm.periodic)
