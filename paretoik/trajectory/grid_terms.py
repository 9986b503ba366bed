"""Costs and limits of motions over a grid of postures, by the number of consecutive samples that they depend on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from paretoik.errors import EvaluationFailed, InvalidInput
from paretoik.stop_flag import check_interruption
from paretoik.task.limits import LIMIT_TOLERANCE, Constraint, relative_violation
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import evaluate_function

Series = Callable[[Motion], np.ndarray]
At = Callable[[int, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]  # (q, dq, ddq) of some of a sample's


@dataclass(frozen=True, kw_only=True)
class GridOptions:
    """How a grid is laid and what it returns."""

    pace: float = 2.5  # times the path's own that joints without velocity limit may go
    quick_nodes: int = 30_000  # of a quick grid, at most
    distinct: float = 0.15  # rad or arm lengths, RMS: paths nearer to a better one are not told from it
    transitions: int = 40_000_000  # more do not fit the memory of a small machine
    block: int = 200_000  # samples that are evaluated at once
    cell: int = 2  # nodes by which steps between a cell's corners are longer than those of a motion in it (the bound)
    margin: int = 4  # nodes beyond windows and ranges of joints that transitions are evaluated (the bound)


OPTIONS = GridOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Terms:
    """The cost, and limits that may not exceed 0 at any sample; ``second`` where one depends on accelerations."""

    cost: Series
    postures: list[Series]
    rates: list[Series]
    second: bool

    def sample_costs(self, motion: Motion) -> np.ndarray:
        """Return the share of every sample in the integral of the cost."""
        return self.cost(motion) * motion.weights

    def feasible_costs(self, motion: Motion) -> np.ndarray:
        """Return the cost of every sample, infinite where a limit on rates does not hold."""
        return np.where(self.satisfied(motion, self.rates), self.sample_costs(motion), np.inf)

    def satisfied(self, motion: Motion, limits: list[Series]) -> np.ndarray:
        """Return at which samples limits hold."""
        return self.worst(limits)(motion) <= LIMIT_TOLERANCE

    @staticmethod
    def worst(limits: list[Series]) -> Series:
        """Return the excess over the limit that is broken most, −1 where there is none."""
        nothing = [lambda motion: np.full(motion.q.shape[:-1], -1.0)]
        return lambda motion: np.max([limit(motion) for limit in limits or nothing], axis=0)


def build_terms(task: MotionTask, probe: np.ndarray) -> Terms:
    """Return objectives and limits, sorted by what they depend on."""
    for kind, functions, form in (("objective", task.objectives, "integral"), ("constraint", task.constraints, "peak")):
        for one in functions:
            if one.form != form:
                raise InvalidInput(f"grid_oracle: {kind} {one.name}: form {form!r} wanted, got {one.form!r}")

    def cost(motion: Motion) -> np.ndarray:
        return np.sum(
            [o.sign * evaluate_function(f"objective {o.name}", o.function, motion, o.form) for o in task.objectives],
            axis=0,
        )

    def joint_excess(kind: str) -> Series:
        return lambda motion: relative_violation(kind, task.bounds[kind], motion).max(axis=-1)

    def constraint_excess(c: Constraint) -> Series:
        def excess_of(motion: Motion) -> np.ndarray:
            values = evaluate_function(f"constraint {c.name}", c.function, motion, c.form)
            return np.maximum(values - c.upper, c.lower - values) / c.scale

        return excess_of

    limits = [joint_excess(kind) for kind in task.bounds] + [constraint_excess(c) for c in task.constraints]
    if task.obstacles:
        limits.append(lambda motion: (task.min_clearance - motion.clearance) / task.clearance_range)
    orders = [derivative_order(task, limit, probe) for limit in limits]
    return Terms(
        cost=cost,
        postures=[limit for limit, order in zip(limits, orders, strict=True) if order == 0],
        rates=[limit for limit, order in zip(limits, orders, strict=True) if order > 0],
        second=max([derivative_order(task, cost, probe), *orders]) == 2,
    )


def derivative_order(task: MotionTask, term: Series, q: np.ndarray) -> int:
    """Return the highest derivative that a function of motions depends on: NaN in higher ones does not change it."""
    for order, rates in enumerate([(np.nan, np.nan), (0.1, np.nan), (0.1, 0.1)]):
        with np.errstate(all="ignore"):
            try:
                values = term(instant_motions(task, q, *rates))
            except EvaluationFailed as error:
                raise InvalidInput(f"grid_oracle: functions that bear NaN in rates wanted, got {error}") from error
        if not np.isnan(values).any():
            return order
    raise InvalidInput("grid_oracle: objectives and limits must be numbers and look no further than accelerations")


def instant_motions(task: MotionTask, q: np.ndarray, dq: np.ndarray | float, ddq: np.ndarray | float) -> Motion:
    """Return rows (rows, time, dof) of postures with given rates; what comes before and after each is elsewhere."""
    motion = replace(task, cyclic=False).motion(q)
    rates = {"dq": dq, "ddq": ddq, "jerk": np.nan}  # these stand in for what Motion would find from the row itself
    vars(motion).update({name: np.broadcast_to(values, q.shape) for name, values in rates.items()})
    return motion


def evaluate_at(task: MotionTask, term: Series, counts: Sequence[int], at: At) -> list[np.ndarray]:
    """Return ``term`` of so many instants of every sample; ``at`` gives some of a sample's: (q, dq, ddq)."""
    if sum(counts) > OPTIONS.transitions:
        raise InvalidInput(
            f"resolution: at most {OPTIONS.transitions:.3g} transitions wanted, got {sum(counts):.3g}: make it coarser"
        )
    values_at = [np.empty(count) for count in counts]
    rows, longest = max(1, OPTIONS.block // len(counts)), max(counts)
    for first in range(0, longest, rows):
        check_interruption()
        picks = [np.minimum(np.arange(first, min(first + rows, longest)), max(count - 1, 0)) for count in counts]
        parts = [at(i, pick) for i, pick in enumerate(picks)]
        values = term(instant_motions(task, *(np.stack(part, axis=1) for part in zip(*parts, strict=True))))
        for i, count in enumerate(counts):
            values_at[i][first : first + rows] = values[: max(count - first, 0), i]
    return values_at
