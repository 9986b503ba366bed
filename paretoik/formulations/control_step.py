"""One step of a closed loop as a pymoo problem.

The unknowns are rows that extend the Jacobian to a square matrix. ``ClosedLoop`` takes such steps one after the other
with a compiled search. Source: Marcos et al. 2012, section 4.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from pymoo.algorithms.base.genetic import GeneticAlgorithm
from pymoo.core.population import Population
from pymoo.core.repair import Repair

from paretoik.arrays import Genes
from paretoik.closed_loop.control_step import HISTORY, OPTIONS, describe_nearest_obstacle, excess_clearance
from paretoik.closed_loop.loop import explain_no_step, reachable_share, state_before
from paretoik.closed_loop.objectives import StepObjective, as_step_objective, joint_displacement, position_error
from paretoik.collision.obstacles import Obstacle
from paretoik.errors import Infeasible, InvalidInput
from paretoik.formulations.formulation import Formulation, of_genes
from paretoik.inputs import (
    ArrayLike,
    check_magnitude,
    check_size,
    finite_array,
    read_list,
    real_array,
    shown,
)
from paretoik.robot.arm import Arm
from paretoik.search.maximin import MaxiMin
from paretoik.search.operators import BinaryTournament, ReplaceOne, RowCrossover, Seeded
from paretoik.task.limits import LIMITED, Limits
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective, joint_travel
from paretoik.task.path import Path
from paretoik.task.task import Task
from paretoik.task.validation import motion_task

# Checks of arguments that a step and a closed loop share: objectives, limits, steps, a start.


def check_objectives(objectives: Sequence[StepObjective | Objective]) -> tuple[StepObjective, ...]:
    """Return the objectives of a step. Raises InvalidInput for other objects and repeated names."""
    if not isinstance(objectives, Sequence):
        raise InvalidInput(f"objectives must be a list, got {shown(objectives)}")
    if not objectives:
        raise InvalidInput("objectives must be at least one, got none")
    of_step = tuple(as_step_objective(each) for each in objectives)
    names = [each.name for each in of_step]
    if len(set(names)) != len(names):
        raise InvalidInput(f"objectives: names must differ, got {', '.join(names)}")
    return of_step


def check_limits(limits: Limits | None, *, supported: tuple[str, ...], where: str) -> None:
    """Raise InvalidInput for kinds of limits that are not ``supported``."""
    if not isinstance(limits, Limits | None):
        raise InvalidInput(f"limits must be Limits, got {shown(limits)}")
    for kind in LIMITED if limits is not None else ():
        limit = getattr(limits, kind)
        if kind not in supported and limit is not None and not (isinstance(limit, float) and limit == np.inf):
            raise InvalidInput(f"limits {where} must be on {', '.join(supported[:-1])} and {supported[-1]}, got {kind}")


def check_longest_step(longest_step: object) -> float:
    """Return the largest move of a joint in a step. Raises InvalidInput if it is not a positive number."""
    longest = real_array("longest_step", longest_step)
    if longest.shape != () or not longest > 0:
        raise InvalidInput(f"longest_step must be a positive number, got {shown(longest_step)}")
    return float(longest)


def read_steps(record_steps: object) -> tuple[Any, ...]:
    """Return the items of a list of steps, unchecked. Raises InvalidInput if it is not a list."""
    return read_list("record_steps", record_steps, object, "a list of steps")


def check_steps(record_steps: Sequence[int], last: int) -> frozenset[int]:
    """Return the steps of a loop to record. Raises InvalidInput if one is not from 1 to ``last``."""
    for step in read_steps(record_steps):
        check_size("record_steps", step, 1)
        if step > last:
            raise InvalidInput(f"record_steps must be from 1 to {last}, got {step}")
    return frozenset(int(step) for step in record_steps)


def check_start(
    task: MotionTask, start: Sequence[float] | np.ndarray, *, name: str = "start"
) -> Float[np.ndarray, " dof"]:
    """Return the joint positions at the start. Raises InvalidInput if they exceed a limit or the clearance."""
    q: np.ndarray = finite_array(name, start, shape=(task.arm.dof,))
    lower, upper = task.arm.position_limits.T
    tolerance = OPTIONS.bound_tolerance
    outside = np.flatnonzero((q < lower - tolerance) | (q > upper + tolerance))
    if outside.size:
        k = int(outside[0])
        raise InvalidInput(
            f"{name}: {task.arm.joint_names[k]} must be from {lower[k]:.6g} to {upper[k]:.6g}, got {q[k]:.6g}"
        )
    distance = float(excess_clearance(task, q))
    if distance <= 0:
        nearest = describe_nearest_obstacle(task, q)
        raise InvalidInput(f"{name} must be clear of obstacles, got a posture {abs(distance):.3g} m too near {nearest}")
    return q


# One control step as a pymoo problem.


class ControlStep(Formulation):
    """Find the next joint positions on ``path``: a vectorised pymoo problem.

    An individual is the matrix (J*, Δx*) that extends Δx = J Δq to a square system (Eqs. 7 to 13), so that every step
    reaches its target to first order. Its genes are within ±1. If a step exceeds the joints' bounds, its self-motion is
    reduced. ``pk.solve(step)`` runs the paper's search; any other pymoo algorithm works too. ``loop.control_step(k)``
    is the step of a ``ClosedLoop`` to sample k. Motions of a front have four samples: the last three joint positions
    and the next ones, ``front.motions.q[:, -1]``.

    Parameters
    ----------
    arm
        Planar or spatial arm.
    path
        Path, Task or several of them with the same times.
    q
        Joint positions (dof,) before the step, or with earlier ones (rows, dof), one step apart, oldest first.
    sample
        Sample of the path to which the step leads.
    home
        Joint positions (dof,) at the start of the loop; None: the first of ``q``.
    objectives
        Objectives of a step, any number, as in ``ClosedLoop``.
    obstacles
        Obstacles, as in ``ClosedLoop``.
    link_radius
        Radius [m] of the links, or one per link, as in ``ClosedLoop``.
    limits
        Limits on position, velocity and clearance, as in ``ClosedLoop``.
    longest_step
        Largest move of a joint in the step [rad, m], as in ``ClosedLoop``.

    Raises
    ------
    InvalidInput
        Names the argument that cannot be used.
    Infeasible
        If the arm is singular in ``q``, or its joints cannot move far enough to reach the target.

    >>> import paretoik as pk
    >>> path = pk.line([2.495, 0.627], [2.495, 0.7], duration=0.01, samples=11)
    >>> step = pk.ControlStep(pk.arms.marcos_nr(3), path, [-0.5, 0.9, 0.4])
    >>> step.decode(np.full((1, step.n_var), 0.5)).q.shape
    (1, 4, 3)
    """

    def __init__(
        self,
        arm: Arm,
        path: Path | Task | Sequence[Path | Task],
        q: Sequence[float] | Sequence[Sequence[float] | np.ndarray] | np.ndarray,
        *,
        sample: int = 1,
        home: Sequence[float] | np.ndarray | None = None,
        objectives: Sequence[StepObjective | Objective] = (joint_displacement, position_error),
        obstacles: Sequence[Obstacle] = (),
        link_radius: ArrayLike = 0.0,
        limits: Limits | None = None,
        longest_step: float = 0.1,
    ) -> None:
        self.objectives = check_objectives(objectives)
        check_limits(limits, supported=("position", "velocity", "clearance"), where="in a control step")
        whole = motion_task(
            arm,
            path,
            objectives=[joint_travel],
            limits=limits,
            obstacles=obstacles,
            link_radius=link_radius,
            differences="backward",
        )
        check_size("sample", sample, 1)
        if sample >= len(whole.times):
            raise InvalidInput(f"sample must be at most {len(whole.times) - 1}, the path's last, got {sample}")
        before = np.atleast_2d(given := finite_array("q", q))
        if before.ndim != 2 or before.shape[1] != arm.dof or not len(before):
            raise InvalidInput(f"q must have shape ({arm.dof},) or (rows, {arm.dof}), got {given.shape}")
        start = before[0] if home is None else finite_array("home", home, shape=(arm.dof,))
        for name, values in (("q", before), ("home", start)):
            check_magnitude(name, values, "rad or m")
        history = np.concatenate([np.tile(before[:1], (HISTORY, 1)), before])[-HISTORY:]
        check_start(whole, history[-1], name="q")
        self.state = state_before(
            whole,
            int(sample),
            history,
            home=start,
            longest=check_longest_step(longest_step),
        )
        self.task = self.state.ending
        self.add_objectives(self.objectives)
        kinds = {"joint step": "rad or m"} if self.state.bounded else {}
        kinds |= {"clearance": "m"} if whole.obstacles else {}
        self.constraint_names, self.constraint_units = tuple(kinds), tuple(kinds.values())
        shortest, null_space = self.state.shortest_and_null_space
        bounds = np.full(null_space.shape[1] * (arm.dof + 1), OPTIONS.gene_bound)
        super().__init__(-bounds, bounds)
        if reachable_share(self.state)[0] < 1.0:
            raise Infeasible(explain_no_step(self.state))
        self._score((history[-1] + shortest)[None])  # raises errors of the objectives before any search

    def positions(self, genes: Genes) -> Float[np.ndarray, "points dof"]:
        """Return the joint positions after steps; NaN if an extended Jacobian is singular."""
        return self.state.shorten(self.state.decode(genes))

    @of_genes
    def decode(self, genes: Genes) -> Motion:
        """Return the motions (points, 4, dof) of genes, which end with the step."""
        return self.state.motions(self.positions(genes))

    def algorithm(
        self, population: int, *, offspring: int | None = None, initial: Genes | None = None
    ) -> GeneticAlgorithm:
        """Return the paper's NSGA-II: crossover by rows, mutation of one gene, MaxiMin selection."""
        return GeneticAlgorithm(
            pop_size=population,
            n_offsprings=offspring,
            sampling=AdmissibleChromosomes(initial),
            selection=BinaryTournament(),
            crossover=RowCrossover(self.task.arm.dof + 1),
            mutation=ReplaceOne(),
            survival=MaxiMin(),
            repair=None if self.state.swept else ReplaceInadmissible(),
            eliminate_duplicates=False,
            advance_after_initial_infill=True,
        )

    def redraw(self, genes: Genes, rng: np.random.Generator) -> Genes:
        """Return genes with random chromosomes in place of inadmissible ones (section 5.2)."""
        genes = np.array(genes, dtype=float)
        for _ in range(OPTIONS.max_redraws):
            inadmissible = np.flatnonzero(~self.state.is_admissible(self.positions(genes)))
            if not inadmissible.size:
                break
            genes[inadmissible] = rng.uniform(self.xl, self.xu, size=(inadmissible.size, self.n_var))
        return genes

    def _score(self, q: Float[np.ndarray, "points dof"]) -> Float[np.ndarray, "points n_obj"]:
        """Return the objectives of steps, minimised."""
        steps, shape = self.state.steps(q), (len(q), len(self.task.times))
        columns = []
        for each in self.objectives:
            values = np.asarray(each.function(steps))
            if values.shape != shape:
                raise InvalidInput(
                    f"objective {each.name} must return one value per step and sample, shape {shape}, "
                    f"got {values.shape}"
                )
            columns.append(each.sign * values[:, -1])
        return np.stack(columns, axis=1)

    def _evaluate(self, X: Genes, out: dict[str, object], *args: object, **kwargs: object) -> None:
        q = self.positions(X)
        usable = np.isfinite(q).all(axis=1)  # the other individuals have singular extended Jacobians
        F, excess = np.full((len(X), self.n_obj), np.inf), np.full((len(X), self.n_ieq_constr), 1.0)
        F[usable] = self._score(steps := q[usable])
        columns = []
        if self.state.bounded:  # excess over the bounds [rad, m]
            columns.append(self.state.excess_over_bounds(steps))
        if self.task.obstacles:  # missing clearance [m]
            left = self.state.clearance_left(steps)
            columns.append(np.where(left > 0, -left, np.maximum(-left, np.finfo(float).tiny)))
        if columns:
            excess[usable] = np.stack(columns, axis=1)
        out["F"], out["G"] = np.where(np.isfinite(F).all(axis=1, keepdims=True), F, np.inf), excess


class AdmissibleChromosomes(Seeded):
    """The ``initial`` genes, if any, then random genes with admissible steps."""

    def _do(self, problem: Any, n_samples: int, *, random_state: np.random.Generator, **kwargs: Any) -> Genes:
        genes = super()._do(problem, n_samples, random_state=random_state)
        given = 0 if self.initial is None else len(self.initial)
        genes[given:] = problem.redraw(genes[given:], random_state)
        return genes


class ReplaceInadmissible(Repair):  # type: ignore[misc]  # pymoo is not typed
    """Repair by random chromosomes in place of inadmissible ones (section 5.2)."""

    def do(self, problem: Any, pop: Population, *, random_state: np.random.Generator, **kwargs: object) -> Population:
        """Return the population without inadmissible chromosomes."""
        pop.set("X", problem.redraw(pop.get("X"), random_state))
        return pop
