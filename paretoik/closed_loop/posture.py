"""OLGA: a posture whose tool is where a path begins, by a genetic algorithm (Marcos et al. 2012, section 4.2)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from pymoo.algorithms.base.genetic import GeneticAlgorithm
from pymoo.core.population import Population
from pymoo.core.problem import Problem
from pymoo.core.survival import Survival
from pymoo.operators.sampling.rnd import FloatRandomSampling
from pymoo.optimize import minimize

from paretoik.arrays import Genes
from paretoik.closed_loop.step import turning_rows
from paretoik.errors import Infeasible
from paretoik.search.constraints import Floats
from paretoik.search.maximin import column
from paretoik.search.rowwise import RankWeighting, ReplaceOne, RowCrossover
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import task_errors

TURN = 2 * np.pi  # of joints without limits, either way
SLIDE = 1.0  # likewise, of joints that slide [m]


class Posture(Problem):  # type: ignore[misc]  # pymoo is not typed
    """Search joint positions whose task error at the first sample is least (Eqs. 18, 21, 22), clear of obstacles.

    F is the distance from the target [m], with the angle [rad] where a task asks for one; G the clearance that is
    missing. Joints without limits range over two turns, as in the paper.
    """

    def __init__(self, task: MotionTask) -> None:
        self.task = task
        arm = task.arm
        widest = np.where(arm.periodic, TURN, SLIDE)[:, None] * [-1.0, 1.0]
        bounds = np.where(np.isfinite(arm.position_limits), arm.position_limits, widest)
        super().__init__(n_var=arm.dof, n_obj=1, n_ieq_constr=1, xl=bounds[:, 0], xu=bounds[:, 1])

    def algorithm(self, population: int) -> GeneticAlgorithm:
        """Return the paper's genetic algorithm: rank weighting, single-point crossover, one gene replaced, an elite."""
        return GeneticAlgorithm(
            pop_size=population,
            sampling=FloatRandomSampling(),
            selection=RankWeighting(),
            crossover=RowCrossover(self.n_var),
            mutation=ReplaceOne(),
            survival=OneElite(),
            eliminate_duplicates=False,
        )

    def _evaluate(self, X: Genes, out: dict[str, object], *args: object, **kwargs: object) -> None:
        task = self.task
        error, _ = task_errors(task.arm, task.tasks, X, np.tile(task.targets[0], (len(X), 1)))
        turns = turning_rows(task)
        out["F"] = (np.linalg.norm(error[~turns], axis=0) + np.linalg.norm(error[turns], axis=0))[:, None]
        out["G"] = np.full((len(X), 1), -1.0)
        if task.obstacles:
            held = np.repeat(X[:, None], 3, axis=1)
            motion = Motion(
                arm=task.arm, time=np.arange(3.0), q=held, obstacles=task.obstacles, link_radius=task.link_radius
            )
            out["G"] = (task.min_clearance - motion.clearance[:, 0])[:, None]


class OneElite(Survival):  # type: ignore[misc]  # pymoo is not typed
    """The offspring replace their parents, but the best parent stays in place of the worst of them."""

    def __init__(self) -> None:
        super().__init__(filter_infeasible=False)

    def _do(self, problem: Problem, pop: Population, *args: object, n_survive: int, **kwargs: object) -> Population:
        if len(pop) <= n_survive:
            return pop
        parents, offspring = pop[: len(pop) - n_survive], pop[len(pop) - n_survive :]
        kept = np.delete(np.arange(n_survive), _best_first(offspring)[-1])
        return Population.merge(parents[_best_first(parents)[:1]], offspring[kept])


def _best_first(pop: Population) -> np.ndarray:
    violation: Floats = np.maximum(column(pop, "G")[:, 0], 0.0)
    return np.lexsort((column(pop, "F")[:, 0], violation))


def first_posture(
    task: MotionTask, *, population: int = 1600, generations: int = 200, seed: int = 0
) -> Float[np.ndarray, " dof"]:
    """Return joint positions (dof,) whose tool is near the first sample of the path, by OLGA.

    Raises Infeasible where none is clear of the obstacles.
    """
    problem = Posture(task)
    found = minimize(problem, problem.algorithm(population), ("n_gen", generations), seed=seed)
    if found.X is None:
        raise Infeasible(
            f"start: a posture clear of the obstacles wanted, none of {population * generations} had its tool there"
        )
    q: np.ndarray = np.asarray(found.X, dtype=float)
    return q
