"""The numbers of a method that resolves motions as a pymoo problem: setting them by hand is trial and error.

An individual is a set of numbers. It is judged by the motions from several starts, so that numbers that suit one
posture alone are not taken for good ones. All individuals and starts are resolved at once.

Sources of the methods' numbers: Wan et al. 2018; Tringali & Cocuzza 2021, section 2.2; Kim et al. 2021. All of them
choose these by hand; that they are searched for, and by several objectives, is new.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Genes
from paretoik.errors import InvalidInput
from paretoik.formulations.formulation import Formulation, of_genes
from paretoik.inputs import (
    ArrayLike,
    check_call,
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
from paretoik.task.obstacles import Obstacle
from paretoik.task.path import Path
from paretoik.task.starts import order_by_neighbour, reach_error, sample_postures, wrap_difference
from paretoik.task.task import Task, error_unit
from paretoik.task.validation import motion_task
from paretoik.trajectory.infeasibility import remedy_text

JudgedBy = Literal["worst", "mean"]
START = Parameter("start", 0.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class TuningOptions:
    """Settings of the starts."""

    candidates: int = 400  # random postures that the starts on the first sample are found from
    judged_starts: int = 5  # that an individual is judged by


OPTIONS = TuningOptions()


@check_call
class Tuning(Formulation):
    """Find the numbers of a method along ``path``: a vectorised pymoo problem.

    Parameters
    ----------
    arm, path
        The arm, and a Path, a Task or several of them.
    method
        Any of ``pk.methods``, or a ``TimeOptimalControl``; numbers that are not searched keep its values.
    parameters
        What is searched: names of the method's numbers, with ranges by default, or ``Parameter(name, lower, upper,
        scale=)``. Of a method with criteria there are "gain of NAME" and, where they have an order, "priority of NAME".
        "start" searches for the start too. By default all of the method's own.
    objectives
        Of the motions: any ``@objective``, and ``tracking_error``, ``limit_margin``, ``speed_ratio``, ``evaluations``,
        ``duration`` and ``distance_to(motion)``. By default the first three and ``jerk``.
    starts
        Postures (starts, dof) that motions may begin in, in some order; by default those on the path's first sample
        within the limits, one after its nearest neighbour.
    judged_starts
        By how many of them an individual is judged: those around its own where "start" is searched, otherwise spread
        evenly. By default 5, without "start" all that are given.
    judged_by
        Whether an objective is its "worst" over the starts or its "mean".
    constraints
        A user's own, decorated with ``@constraint``: an individual is infeasible where the motion from any of its
        starts violates one.
    tolerance
        Distance [m, rad] from the path past which an individual is infeasible, by any of its starts; None for none.
    obstacles, link_radius
        What criteria and objectives may look at.
    seed
        Of the starts; part of the problem.

    It has no gradients: ``refine``, ``plan`` and ``epsilon_front`` refuse it.

    Raises
    ------
    InvalidInput
        Naming what cannot be used; OutOfReach where the path's first sample is.
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
        link_radius: float = 0.0,
        seed: int = 0,
    ) -> None:
        """Make the problem; the class says of what."""
        if not isinstance(method, Method):
            raise InvalidInput(f"method: one of pk.methods wanted, such as DampedLeastSquares(), got {shown(method)}")
        check_choice("judged_by", judged_by, get_args(JudgedBy))
        if tolerance is not None:
            tolerance = positive_number("tolerance", tolerance, "m or rad")
        check_seed("seed", seed)
        self.task: MotionTask = motion_task(
            arm, path, objectives=objectives, constraints=constraints, obstacles=obstacles, link_radius=link_radius
        )
        self.names = tuple(each.name for each in objectives)
        self.units = tuple(each.unit for each in objectives)
        self.maximised = tuple(each.maximise for each in objectives)
        self.constraint_names = (*(("tracking",) if tolerance is not None else ()), *(c.name for c in constraints))
        if tolerance is not None and "tracking" in self.constraint_names[1:]:
            raise InvalidInput("constraints: a name other than tracking wanted, got tracking")
        self.resolver, self.judged_by, self.tolerance = method, judged_by, tolerance
        self.parameters = _checked_parameters(method, parameters, self.task.times)
        self.starts = sample_starts(self.task, seed) if starts is None else _checked_starts(arm, starts)
        self._searches_start = START.name in [each.name for each in self.parameters]
        every = starts is not None and not self._searches_start
        default = len(self.starts) if every else min(OPTIONS.judged_starts, len(self.starts))
        self.judged_starts = default if judged_starts is None else judged_starts
        check_size("judged_starts", self.judged_starts, 1)
        if self.judged_starts > len(self.starts):
            raise InvalidInput(f"judged_starts: 1 to {len(self.starts)} wanted, got {shown(judged_starts)}")
        lower, upper = np.array([each.gene_bounds for each in self.parameters]).T
        limits = len(self.constraint_names)
        super().__init__(n_var=len(lower), n_obj=len(objectives), n_ieq_constr=limits, xl=lower, xu=upper)
        self._check_trial()

    def values(self, genes: Genes) -> dict[str, np.ndarray]:
        """Return the values (points,) of all fields that genes (points, n_var) stand for, ``start`` aside."""
        columns = zip(self.parameters, genes.T, strict=True)
        decoded = [(each, each.decode(column)) for each, column in columns if each.name != START.name]
        return {field: values for each, values in decoded for field in each.fields}

    def method(self, genes: Genes) -> Method:
        """Return the method of genes (points, n_var), its numbers (points,)."""
        return self.resolver.with_values(self.values(genes), self.task.times)

    def start_indices(self, genes: Genes) -> Int[np.ndarray, "points judged"]:
        """Return by which starts individuals are judged; the first is their own."""
        count, judged = len(self.starts), np.arange(self.judged_starts)
        if not self._searches_start:
            return np.tile(judged * count // self.judged_starts, (len(genes), 1))
        column = [each.name for each in self.parameters].index(START.name)
        first = np.minimum((genes[:, column] * count).astype(int), count - 1)
        shifts = np.where(judged % 2, (judged + 1) // 2, -(judged // 2))
        return np.asarray((first[:, None] + shifts) % count)

    @of_genes
    def decode(self, genes: Genes) -> ResolvedMotion:
        """Return the motions (points, time, dof) of genes from their own, or first, starts."""
        return self._follow(genes, self.start_indices(genes)[:, :1])

    def explain(self, genes: Genes) -> list[str]:
        """Return for each individual why it is infeasible, in words; "" where it is feasible."""
        indices = self.start_indices(genes)
        motions = self._follow(genes, indices)
        rows = enumerate(self._violations(motions, len(genes)))
        return [self._explain(row, motions[i * indices.shape[1]]) if (row > 0).any() else "" for i, row in rows]

    def _explain(self, violations: Float[np.ndarray, " limits"], motion: ResolvedMotion) -> str:
        worst = int(np.argmax(violations))
        if self.tolerance is not None and worst == 0:
            return f"{(1 + violations[0]) * self.tolerance:.3g} {error_unit(self.task.tasks)} off the path"
        words = f"{self.constraint_names[worst]} is violated by {100 * violations[worst]:.3g} % of its range"
        return words + remedy_text(self.task, motion)

    def _follow(self, genes: Genes, indices: Int[np.ndarray, "points judged"]) -> ResolvedMotion:
        """Return the motions (points · judged, time, dof) of individuals from their starts."""
        method = self.method(np.repeat(genes, indices.shape[1], axis=0))
        return method.follow(self.task, self.starts[indices.ravel()], tolerance=self.tolerance)

    def _violations(self, motion: ResolvedMotion, points: int) -> Float[np.ndarray, "points limits"]:
        """Return by how much individuals violate each limit at most from any of their starts, over its range."""
        columns = [each.violation(motion) for each in self.task.constraints]
        if self.tolerance is not None:
            columns.insert(0, np.abs(motion.traces.errors).max(axis=(-2, -1)) / self.tolerance - 1.0)
        each = np.array(columns).reshape(len(columns), points, len(motion) // points)
        return np.where(np.isnan(each), 1.0, each).max(axis=2).T

    def _check_trial(self) -> None:
        """Raise what the method and the objectives raise for the first start, before any search."""
        genes = (self.xl + 0.5 * (self.xu - self.xl))[None]
        motion = self._follow(genes, np.zeros((1, 1), dtype=int))
        for each in self.task.objectives:
            each(motion)
        self._violations(motion, 1)

    def _evaluate(self, X: Genes, out: dict[str, object], *args: object, **kwargs: object) -> None:
        motion = self._follow(X, self.start_indices(X))
        values = np.stack([each.sign * each(motion) for each in self.task.objectives], axis=1)
        values = values.reshape(len(X), self.judged_starts, len(self.task.objectives))
        judged = values.max(axis=1) if self.judged_by == "worst" else values.mean(axis=1)
        out["F"] = np.where(np.isfinite(judged), judged, np.inf)
        if self.constraint_names:
            out["G"] = self._violations(motion, len(X))


def sample_starts(task: MotionTask, seed: int) -> Float[np.ndarray, "starts dof"]:
    """Return postures on the first sample within the limits, each after its nearest neighbour.

    Raises OutOfReach where there are none.
    """
    rng = np.random.default_rng(seed)
    candidates = sample_postures(task, OPTIONS.candidates, rng)
    if not len(candidates):
        raise reach_error(task, rng, 0)
    candidates = wrap_difference(candidates, task.arm.periodic)
    lower, upper = task.arm.position_limits.T
    within = ((candidates >= lower) & (candidates <= upper)).all(axis=1)
    return order_by_neighbour(task.arm, candidates[within] if within.any() else candidates)


def _checked_starts(arm: Arm, starts: Any) -> Float[np.ndarray, "starts dof"]:
    array = finite_array("starts", starts)
    if array.ndim != 2 or array.shape[1] != arm.dof or not array.size:
        raise InvalidInput(f"starts: postures (starts, {arm.dof}) wanted, got shape {array.shape}")
    return array


def _checked_parameters(
    method: Method, parameters: Sequence[str | Parameter] | None, times: np.ndarray
) -> tuple[Parameter, ...]:
    """Return what is searched; raise InvalidInput for unknown names, fields set twice, and nothing."""
    by_name = {each.name: each for each in (*method.parameters(times), START)}
    if isinstance(parameters, str | Parameter) or not isinstance(parameters, Sequence | None):
        raise InvalidInput(f"parameters: a list of names and Parameters wanted, got {shown(parameters)}")
    chosen = list[Parameter]()
    for each in method.parameters(times) if parameters is None else parameters:
        if not isinstance(each, Parameter) and each not in by_name:
            raise InvalidInput(
                f"parameters: {', '.join(by_name)}, or a Parameter(name, lower, upper) wanted, got {shown(each)}"
            )
        chosen.append(each if isinstance(each, Parameter) else by_name[each])
    if not chosen:
        raise InvalidInput("parameters: at least one wanted, got none")
    names = [name for each in chosen for name in each.fields]
    if len(set(names)) != len(names):
        raise InvalidInput(f"parameters: each number once wanted, got {', '.join(names)}")
    return tuple(chosen)
