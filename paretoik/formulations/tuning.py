"""Tuning of a method that resolves motions, as a pymoo problem.

An individual is a set of the method's parameters. It is judged by the motions from several starts, so that parameters
must suit more than one posture. The motions of all individuals and starts are computed at once.

Sources of the parameters: Wan et al. 2018; Tringali & Cocuzza 2021, section 2.2; Kim et al. 2021. They all choose
them by hand; tuning them for several objectives is new.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Genes
from paretoik.collision.obstacles import Obstacle
from paretoik.errors import InvalidInput
from paretoik.formulations.formulation import Formulation, of_genes
from paretoik.inputs import (
    ArrayLike,
    check_choice,
    check_seed,
    check_size,
    finite_array,
    positive_number,
    shown,
)
from paretoik.resolution.measures import limit_margin, speed_ratio, tracking_error
from paretoik.resolution.protocol import Method, Parameter, ResolvedMotion
from paretoik.robot.arm import Arm
from paretoik.task.limits import Constraint
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective, jerk
from paretoik.task.path import Path
from paretoik.task.random_starts import order_by_neighbour, reach_error, sample_postures, wrap_difference
from paretoik.task.task import Task, error_unit
from paretoik.task.validation import motion_task
from paretoik.trajectory.infeasibility import remedy_text

JudgedBy = Literal["worst", "mean"]
START = Parameter("start", 0.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class TuningOptions:
    """Settings of the starts."""

    candidates: int = 400  # number of random postures from which the starts are found
    judged_starts: int = 5  # default number of starts that judge an individual


OPTIONS = TuningOptions()


class Tuning(Formulation):
    """Tune the parameters of a method on ``path``: a vectorised pymoo problem.

    It has no gradients: ``refine``, ``plan`` and ``epsilon_front`` refuse it.

    Parameters
    ----------
    arm
        Arm that follows the path.
    path
        Path, Task or several of them.
    method
        Method of ``pk.methods``, or a ``TimeOptimalControl``; parameters that are not tuned keep its values.
    parameters
        Parameters to tune: names, with default ranges, or ``Parameter(name, lower, upper, scale=)``; None: all of the
        method. Criteria add "gain of NAME" and, if they have an order, "priority of NAME". "start" tunes the start too.
    objectives
        Objectives of the motions: any ``@objective``, and ``tracking_error``, ``limit_margin``, ``speed_ratio``,
        ``evaluations``, ``duration`` and ``distance_to(motion)``. Default: the first three and ``jerk``.
    starts
        Postures (starts, dof) in which motions may begin, similar ones next to each other; None: sampled postures on
        the path's first sample, within limits.
    judged_starts
        Number of starts from which an individual is judged: those around its own if "start" is tuned, otherwise spread
        evenly over ``starts``. None: all given starts if "start" is not tuned, otherwise 5.
    judged_by
        Value of an objective over the starts: "worst" or "mean".
    constraints
        User's functions decorated with ``@constraint``: an individual is infeasible if a motion from its starts
        violates one.
    tolerance
        Largest distance [m, rad] from the path: an individual is infeasible if a motion from its starts exceeds it.
        None: no limit.
    obstacles
        Obstacles that criteria and objectives may use.
    link_radius
        Radius [m] of the links that criteria and objectives may use, or one per link.
    seed
        Seed of the starts; genes depend on it.

    Raises
    ------
    InvalidInput
        Names the argument that cannot be used.
    OutOfReach
        If the path's first sample is out of reach.
    """

    computed_attributes = ("starts",)

    def __init__(
        self,
        arm: Arm,
        path: Path | Task | Sequence[Path | Task],
        method: Method,
        *,
        parameters: Sequence[str | Parameter] | None = None,
        objectives: Sequence[Objective] = (tracking_error, limit_margin, speed_ratio, jerk),
        constraints: Sequence[Constraint] = (),
        starts: ArrayLike | Sequence[ArrayLike] | None = None,
        judged_starts: int | None = None,
        judged_by: JudgedBy = "worst",
        tolerance: float | None = 0.05,
        obstacles: Sequence[Obstacle] = (),
        link_radius: ArrayLike = 0.0,
        seed: int = 0,
    ) -> None:
        if not isinstance(method, Method):
            raise InvalidInput(f"method must be one of pk.methods, such as DampedLeastSquares(), got {shown(method)}")
        check_choice("judged_by", judged_by, get_args(JudgedBy))
        if tolerance is not None:
            tolerance = positive_number("tolerance", tolerance, "m or rad")
        check_seed("seed", seed)
        self.task: MotionTask = motion_task(
            arm,
            path,
            objectives=objectives,
            constraints=constraints,
            obstacles=obstacles,
            link_radius=link_radius,
            differences="backward",
        )
        self.add_objectives(objectives)
        self.constraint_names = (*(("tracking",) if tolerance is not None else ()), *(c.name for c in constraints))
        if tolerance is not None and "tracking" in self.constraint_names[1:]:
            raise InvalidInput("constraints must have names other than tracking, got tracking")
        self.resolver, self.judged_by, self.tolerance = method, judged_by, tolerance
        self.parameters = _checked_parameters(method, parameters, self.task.times)
        self.starts = sample_starts(self.task, seed) if starts is None else finite_array("starts", starts)
        if self.starts.ndim != 2 or self.starts.shape[1] != arm.dof or not self.starts.size:
            raise InvalidInput(f"starts must be postures (starts, {arm.dof}), got shape {self.starts.shape}")
        self._searches_start = START.name in [each.name for each in self.parameters]
        every = starts is not None and not self._searches_start
        default = len(self.starts) if every else min(OPTIONS.judged_starts, len(self.starts))
        self.judged_starts = default if judged_starts is None else judged_starts
        check_size("judged_starts", self.judged_starts, 1)
        if self.judged_starts > len(self.starts):
            raise InvalidInput(f"judged_starts must be from 1 to {len(self.starts)}, got {shown(judged_starts)}")
        super().__init__(*np.array([each.gene_bounds for each in self.parameters]).T)
        # A motion from the first start raises errors of the method and the objectives before any search.
        motion = self._follow((self.xl + 0.5 * (self.xu - self.xl))[None], np.zeros((1, 1), dtype=int))
        for each in self.task.objectives:
            each(motion)
        self._violations(motion, 1)

    def values(self, genes: Genes) -> dict[str, np.ndarray]:
        """Return the values (points,) of the method's fields that genes (points, n_var) set."""
        columns = zip(self.parameters, genes.T, strict=True)
        decoded = [(each, each.decode(column)) for each, column in columns if each.name != START.name]
        return {field: values for each, values in decoded for field in each.fields}

    def method(self, genes: Genes) -> Method:
        """Return the method with the parameters (points,) of genes (points, n_var)."""
        return self.resolver.with_values(self.values(genes), self.task.times)

    def start_indices(self, genes: Genes) -> Int[np.ndarray, "points judged"]:
        """Return indices of the starts from which each individual is judged, its own start first."""
        count, judged = len(self.starts), np.arange(self.judged_starts)
        if not self._searches_start:
            return np.tile(judged * count // self.judged_starts, (len(genes), 1))
        column = [each.name for each in self.parameters].index(START.name)
        first = np.minimum((genes[:, column] * count).astype(int), count - 1)
        shifts = np.where(judged % 2, (judged + 1) // 2, -(judged // 2))
        return np.asarray((first[:, None] + shifts) % count)

    @of_genes
    def decode(self, genes: Genes) -> ResolvedMotion:
        """Return the motions (points, time, dof) of individuals from their own starts."""
        return self._follow(genes, self.start_indices(genes)[:, :1])

    def explain(self, genes: Genes) -> list[str]:
        """Return a reason for each infeasible individual; "" if it is feasible."""
        indices = self.start_indices(genes)
        motions = self._follow(genes, indices)
        reasons = list[str]()
        for i, row in enumerate(self._violations(motions, len(genes))):
            worst = int(np.argmax(row)) if (row > 0).any() else -1
            if worst < 0:
                reasons.append("")
            elif self.tolerance is not None and worst == 0:
                reasons.append(f"{(1 + row[0]) * self.tolerance:.3g} {error_unit(self.task.tasks)} off the path")
            else:
                words = f"{self.constraint_names[worst]} is violated by {100 * row[worst]:.3g} % of its range"
                reasons.append(words + remedy_text(self.task, motions[i * indices.shape[1]]))
        return reasons

    def _follow(self, genes: Genes, indices: Int[np.ndarray, "points judged"]) -> ResolvedMotion:
        """Return the motions (points · judged, time, dof) of individuals from their starts."""
        method = self.method(np.repeat(genes, indices.shape[1], axis=0))
        starts = self.starts[indices.ravel()]
        return method.follow(self.task, starts, tolerance=self.tolerance)

    def _violations(self, motion: ResolvedMotion, points: int) -> Float[np.ndarray, "points limits"]:
        """Return each individual's largest violation of each limit over its starts, as a share of its range."""
        columns = [each.violation(motion) for each in self.task.constraints]
        if self.tolerance is not None:
            columns.insert(0, np.abs(motion.traces.errors).max(axis=(-2, -1)) / self.tolerance - 1.0)
        each = np.array(columns).reshape(len(columns), points, len(motion) // points)
        return np.where(np.isnan(each), 1.0, each).max(axis=2).T

    def _evaluate(self, X: Genes, out: dict[str, object], *args: object, **kwargs: object) -> None:
        motion = self._follow(X, self.start_indices(X))
        values = np.stack([each.sign * each(motion) for each in self.task.objectives], axis=1)
        values = values.reshape(len(X), self.judged_starts, len(self.task.objectives))
        judged = values.max(axis=1) if self.judged_by == "worst" else values.mean(axis=1)
        out["F"] = np.where(np.isfinite(judged), judged, np.inf)
        if self.constraint_names:
            out["G"] = self._violations(motion, len(X))


def sample_starts(task: MotionTask, seed: int) -> Float[np.ndarray, "starts dof"]:
    """Return postures on the first sample, within limits if any, similar ones adjacent. Raises OutOfReach."""
    rng = np.random.default_rng(seed)
    candidates = sample_postures(task, OPTIONS.candidates, rng)
    if not len(candidates):
        raise reach_error(task, rng, 0)
    candidates = wrap_difference(candidates, task.arm.periodic)
    lower, upper = task.arm.position_limits.T
    within = ((candidates >= lower) & (candidates <= upper)).all(axis=1)
    return order_by_neighbour(task.arm, candidates[within] if within.any() else candidates)


def _checked_parameters(
    method: Method, parameters: Sequence[str | Parameter] | None, times: np.ndarray
) -> tuple[Parameter, ...]:
    """Return the parameters to tune. Raises InvalidInput for unknown names, fields set twice, and an empty list."""
    by_name = {each.name: each for each in (*method.parameters(times), START)}
    if isinstance(parameters, str | Parameter) or not isinstance(parameters, Sequence | None):
        raise InvalidInput(f"parameters must be a list of names and Parameters, got {shown(parameters)}")
    chosen = list[Parameter]()
    for each in method.parameters(times) if parameters is None else parameters:
        if not isinstance(each, Parameter) and each not in by_name:
            raise InvalidInput(
                f"parameters must be among {', '.join(by_name)}, or a Parameter(name, lower, upper), got {shown(each)}"
            )
        chosen.append(each if isinstance(each, Parameter) else by_name[each])
    if not chosen:
        raise InvalidInput("parameters must not be empty, got none")
    names = [name for each in chosen for name in each.fields]
    if len(set(names)) != len(names):
        raise InvalidInput(f"parameters must set each field once, got {', '.join(names)}")
    return tuple(chosen)
