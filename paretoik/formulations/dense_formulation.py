"""Formulations with a small, dense nonlinear program, for motors or sliders."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Genes, Points, Values
from paretoik.capability.actuation import Actuation, DistributedActuation
from paretoik.capability.user_functions import LanesOf, TermRows, constraint_terms, objective_term, smooth_term
from paretoik.errors import InvalidInput
from paretoik.formulations.formulation import Formulation
from paretoik.formulations.motions import possible_values
from paretoik.formulations.navigation import navigate, predict
from paretoik.front.front import Front
from paretoik.inputs import read_list
from paretoik.nlp.dense.dense_program import DenseProgram
from paretoik.nlp.dense.traced_rows import AssembledRows
from paretoik.nlp.program import Program, Solver
from paretoik.pareto.differentiable import Differentiable, Individuals
from paretoik.pareto.scalarisation import COLD_OPTIONS as COLD
from paretoik.pareto.scalarisation import Observe, StartSearch
from paretoik.robot.arm import Arm
from paretoik.task.limits import Constraint
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask, evaluate_motions, require_values
from paretoik.task.objectives import Objective, joint_travel
from paretoik.task.path import Path
from paretoik.task.validation import motion_task

# Users' own objectives and constraints in formulations with a small, dense program.


def function_task(
    arm: Arm, path: Path, objectives: Sequence[Objective], constraints: Sequence[Constraint]
) -> MotionTask:
    """Return a checked task with the user's functions, without limits. Raises InvalidInput."""
    read_list("objectives", objectives, Objective, "a list of functions decorated with @objective")
    checked = motion_task(
        arm,
        path,
        objectives=objectives or [joint_travel],
        constraints=constraints,
        differences="backward",
        redundant=False,
    )
    return replace(checked, arm=arm, objectives=tuple(objectives), bounds={})


def read_times(task: MotionTask, motions: Motion) -> bool:
    """Return whether an objective or constraint depends on the times of motions.

    Several paces are tried: a limit on rates may be constant at the motions' own pace. Raises EvaluationFailed if
    functions have no values.
    """
    require_values(task, motions)
    shares = motions.time / motions.duration[:, None]
    for pace in (0.1, 1.0, 10.0):
        time = pace * motions.time
        before, after = (
            np.hstack(evaluate_motions(task, replace(motions, time=each))[:2]) for each in (time, time * (1 + shares))
        )
        if not np.allclose(before, after, rtol=1e-9, atol=0, equal_nan=True):
            return True
    return False


@dataclass(frozen=True, kw_only=True, eq=False)
class WholeProgram:
    """The rows and costs of a formulation, with users' functions.

    intervals: indices of the unknowns that are intervals of time; empty if motions share their times
    """

    base: AssembledRows  # rows without users' functions
    base_costs: Float[np.ndarray, "objectives unknowns"]  # costs without users' functions
    task: MotionTask  # task with users' functions
    near: Motion  # sample of the motions
    lanes: LanesOf  # map from the unknowns to motions
    intervals: Int[np.ndarray, " intervals"]
    pace: float = 1.0  # unit of the intervals [s]

    @cached_property
    def own(self) -> TermRows:
        """Rows of the user's objectives and constraints, and their additional unknowns."""
        task = self.task
        sizes = [float(np.median(np.abs(each(self.near)))) or 1.0 for each in task.objectives]
        terms = [objective_term(each, size) for each, size in zip(task.objectives, sizes, strict=True)]
        terms += [term for each in task.constraints for term in constraint_terms(each)]
        own_times = len(self.intervals) > 0
        return TermRows(
            terms=tuple(smooth_term(term, task, self.near, own_times=own_times) for term in terms),
            samples=len(task.times),
            first=self.base.unknowns,
            intervals=self.intervals,
            pace=self.pace,
        )

    @cached_property
    def rows(self) -> AssembledRows:
        """All rows."""
        return AssembledRows(unknowns=self.own.unknowns, parts=(*self.base.parts, *self.own.parts(self.lanes)))

    @cached_property
    def costs(self) -> Float[np.ndarray, "n_obj unknowns"]:
        """Gradients of all objectives, minimised."""
        extra = self.own.unknowns - self.base.unknowns
        return np.concatenate([np.pad(self.base_costs, ((0, 0), (0, extra))), self.own.costs])


# Formulations with a small, dense program.


class DenseFormulation(Formulation, Differentiable):
    """A pymoo problem with a ``DenseProgram``.

    The first gene selects one of ``base_count`` bases: postures or paths. ``functions`` is a task with the user's
    objectives and constraints.
    """

    constraint_units: tuple[str, ...]
    functions: MotionTask
    base_count: int
    navigate = navigate
    predict = predict

    @cached_property
    @abstractmethod
    def whole_program(self) -> WholeProgram:
        """Rows and costs of the program, with those of users' functions."""

    @abstractmethod
    def decode(self, genes: Genes) -> Motion:
        """Return the motions of genes."""

    @abstractmethod
    def sample_starts(self, count: int, rng: np.random.Generator) -> Genes:
        """Return genes that searches start from."""

    def program(self, scales: Float[np.ndarray, " n_obj"] | None = None) -> DenseProgram:
        """Return the nonlinear program, its objectives divided by ``scales``."""
        whole, divisors = self.whole_program, np.ones(self.n_obj) if scales is None else scales
        return DenseProgram(rows=whole.rows, costs=whole.costs / divisors[:, None], objective_names=self.names)

    def add_functions(self, task: MotionTask) -> None:
        """Append the objectives and constraints of a task. Raises InvalidInput if a name is taken."""
        taken = (*self.names, *self.constraint_names)
        added = [*(each.name for each in task.objectives), *task.limit_names]
        for name in (name for name in added if name in taken):
            raise InvalidInput(f"functions must have names other than {', '.join(taken)}, got {name}")
        self.functions = task
        self.add_objectives(task.objectives)
        self.constraint_names += task.limit_names
        self.constraint_units += ("of its range",) * len(task.limit_names)

    def violation_between(self, genes: Genes) -> Float[np.ndarray, " points"]:
        """Return the violation between samples, which is 0 if motions stand still."""
        return np.zeros(len(genes))

    def front_points(self, front: Front) -> Points:
        """Return the points of a front's genes. Raises InvalidInput if the front has no genes."""
        if front.genes is None:
            raise InvalidInput(f"front must have the genes of {', '.join(self.names)}, got a front without genes")
        return self.points(np.array(front.genes))

    def motion_points(self, motions: Motion) -> Points:
        """Raise InvalidInput: motions do not determine the points of this problem."""
        raise InvalidInput("initial must be genes or a front, got motions, which do not determine what the motors do")

    def hold_between(
        self,
        x: Points,
        ranges: Float[np.ndarray, " n_obj"],
        *,
        solver: Solver = "auto",
        observe: Observe | None = None,
    ) -> tuple[Points, Sequence[Program]]:
        """Return the points unchanged, and their programs."""
        return x, [self.program()] * len(x)

    def individuals(self, x: Points, genes: Genes | None = None) -> Individuals:
        """Return points as individuals; genes replace a point if their objectives differ from its own."""
        rows = self.genes(x) if genes is None else genes
        F, G = self.evaluate(rows, return_values_of=["F", "G"])
        objectives = np.array([self.program().evaluate(one)[0] for one in x])
        tolerance = 1e-6 * np.abs(objectives).max(axis=0, initial=0.0)  # share of an objective's largest magnitude
        deviates = (np.abs(F - objectives) > tolerance).any(axis=1)
        return Individuals(
            x=np.where(deviates[:, None], self.points(rows), x),
            objectives=F,
            genes=rows,
            motions=self.decode(rows),
            violation_between=np.maximum(self.violation_between(rows), G.max(axis=1)),
        )

    def values_between(self, front: Front, shares: Values) -> Float[np.ndarray, "gaps shares n_obj"]:
        """Return minimised objectives between consecutive points of a front; inf if impossible."""
        x = self.front_points(front)
        between = x[:-1, None] + shares[:, None] * np.diff(x, axis=0)[:, None]
        F, G = self.evaluate(self.genes(between.reshape(-1, x.shape[1])), return_values_of=["F", "G"])
        return possible_values(F, G).reshape(*between.shape[:2], self.n_obj)

    def branches(self, x: Points) -> list[str]:
        """Return the number of each point's nearest base, as text."""
        return [str(int(place * self.base_count)) for place in self.genes(x)[:, 0]]

    def base_indices(self, genes: Genes) -> np.ndarray:
        """Return the index of the base of each individual (points, n_var)."""
        return np.minimum((genes[:, 0] * self.base_count).astype(int), self.base_count - 1)

    def cold_search(
        self, *, starts: int | None, seed: int, solver: Solver = "auto", observe: Observe | None = None
    ) -> StartSearch:
        """Return the search for optima from ``starts`` starts (None: 48) that motors can hold."""
        starts, rng = COLD.starts if starts is None else starts, np.random.default_rng(seed)
        x = self.points(self.sample_starts(starts, rng))
        for _ in range(10):
            if np.isfinite(x).all(axis=1).sum() >= starts:
                break
            x = np.concatenate([x, self.points(self.sample_starts(starts, rng))])
        x = x[np.isfinite(x).all(axis=1)][:starts]
        return StartSearch(program_of=self.program, starts=x, names=self.names, solver=solver, observe=observe)

    def explain(self, genes: Genes) -> list[str]:
        """Return each individual's most violated limit, with number and unit; "" if it is feasible."""
        G = self.evaluate(genes, return_values_of=["G"])
        return [
            f"{self.constraint_names[k]} violated by {row[k]:.3g} {self.constraint_units[k]}".rstrip()
            if row[k] > 0
            else ""
            for row, k in zip(G, G.argmax(axis=1), strict=True)
        ]


def front_sliders(actuation: Actuation, shares: np.ndarray) -> np.ndarray:
    """Return positions [m] of front sliders at shares (..., dof) of their range; 0 without sliders."""
    if not isinstance(actuation, DistributedActuation):
        return np.zeros((*shares.shape[:-1], actuation.dof))
    low, high = actuation.front_bounds.T
    places: np.ndarray = low + shares * (high - low)
    return places


def slider_shares(actuation: DistributedActuation, front: np.ndarray) -> np.ndarray:
    """Return the positions of front sliders [m] (..., dof) as shares of their range."""
    low, high = actuation.front_bounds.T
    shares: np.ndarray = (front - low) / np.where(high > low, high - low, 1.0)
    return shares
