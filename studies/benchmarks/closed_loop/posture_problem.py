"""OLGA in pymoo, readable: what ``closed_loop/open_loop`` runs compiled (Marcos et al. 2012, section 4.2)."""

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
from paretoik.closed_loop.control_step import rotation_rows
from paretoik.closed_loop.open_loop import posture_bounds
from paretoik.errors import Infeasible
from paretoik.search.constraints import Floats
from paretoik.search.maximin import column
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import task_errors
from studies.benchmarks.closed_loop.operators import RankWeighting, ReplaceOne, RowCrossover


class PostureProblem(Problem):  # type: ignore[misc]  # pymoo is not typed
    """Search joint positions whose task error at the first sample is least (Eqs. 18, 21, 22), clear of obstacles.

    F is the distance from the target [m], with the angle [rad] where a task asks for one; G the clearance that is
    missing. Joints without limits range over two turns, as in the paper.
    """

    def __init__(self, task: MotionTask) -> None:
        self.task = task
        arm, bounds = task.arm, posture_bounds(task)
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
        error = task_errors(task.arm, task.tasks, X, task.targets[0])[0].T
        rotations = rotation_rows(task)
        out["F"] = (np.linalg.norm(error[~rotations], axis=0) + np.linalg.norm(error[rotations], axis=0))[:, None]
        out["G"] = np.full((len(X), 1), -1.0)
        if task.obstacles:
            resting = np.repeat(X[:, None], 3, axis=1)
            motion = Motion(
                arm=task.arm, time=np.arange(3.0), q=resting, obstacles=task.obstacles, link_radius=task.link_radius
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
        survivors = np.delete(np.arange(n_survive), _best_first(offspring)[-1])
        return Population.merge(parents[_best_first(parents)[:1]], offspring[survivors])


def _best_first(pop: Population) -> np.ndarray:
    violation: Floats = np.maximum(column(pop, "G")[:, 0], 0.0)
    return np.lexsort((column(pop, "F")[:, 0], violation))


def search_in_pymoo(task: MotionTask, *, population: int, generations: int, seed: int) -> Float[np.ndarray, " dof"]:
    """Return joint positions (dof,) whose tool is near the first sample of the path.

    Raises Infeasible where none is clear of the obstacles.
    """
    problem = PostureProblem(task)
    result = minimize(problem, problem.algorithm(population), ("n_gen", generations), seed=seed)
    if result.X is None:
        raise Infeasible("start: a posture clear of the obstacles wanted, none found")
    return np.asarray(result.X, dtype=float)
