"""One control step as a pymoo problem: rows that extend the Jacobian to a square matrix are searched for.

Source: Marcos et al. 2012, section 4.1. This is the readable form, for any arm, task and number of objectives;
``engine`` runs the same search compiled.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from pymoo.algorithms.base.genetic import GeneticAlgorithm
from pymoo.core.population import Population
from pymoo.core.problem import Problem
from pymoo.core.repair import Repair
from pymoo.core.sampling import Sampling

from paretoik.arrays import Genes, Objectives
from paretoik.closed_loop.objectives import Step, StepObjective
from paretoik.closed_loop.workspace import BOUND, FINEST, SLACK, TRIES
from paretoik.search.maximin import MaxiMin
from paretoik.search.rowwise import BinaryTournament, ReplaceOne, RowCrossover
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import task_errors

HISTORY = 3  # configurations before a step: enough for a jerk


@dataclass(frozen=True, kw_only=True, eq=False)
class Instant:
    """What is known when a step is taken to sample ``sample`` of the path.

    ``history`` are the last joint positions, the present ones last; ``home`` are those in which the loop began;
    ``lower`` and ``upper`` [rad, m] are how far each joint may move; ``swept`` says that all of a step is to be clear
    of obstacles, not its end alone, which then keeps a ``standoff`` [m].
    """

    task: MotionTask
    sample: int
    history: Float[np.ndarray, "history dof"]
    home: Float[np.ndarray, " dof"]
    lower: Float[np.ndarray, " dof"]
    upper: Float[np.ndarray, " dof"]
    swept: bool
    standoff: float

    @property
    def previous(self) -> Float[np.ndarray, " dof"]:
        """The joint positions that the step begins in."""
        return self.history[-1]

    @property
    def dt(self) -> float:
        """Time between steps [s]."""
        return float(self.task.times[self.sample] - self.task.times[self.sample - 1])

    @property
    def target(self) -> Float[np.ndarray, " numbers"]:
        """What the tool is to reach, as ``Task.targets`` gives it."""
        return self.task.targets[self.sample]

    def asked(self) -> tuple[Float[np.ndarray, " rows"], Float[np.ndarray, "rows dof"]]:
        """Return (Δx, J): what the tool still wants, and the Jacobian there."""
        error, jacobian = task_errors(self.task.arm, self.task.tasks, self.previous[None], self.target[None])
        return error[:, 0], jacobian[:, :, 0]

    def step(self, q: Float[np.ndarray, "points dof"]) -> Step:
        """Return steps to joint positions."""
        task, count = self.task, len(q)
        before = np.broadcast_to(self.history, (count, *self.history.shape))
        motion = Motion(
            arm=task.arm,
            time=task.times[self.sample] + self.dt * np.arange(-len(self.history), 1),
            q=np.concatenate([before, q[:, None]], axis=1),
            obstacles=task.obstacles,
            link_radius=task.link_radius,
        )
        error, _ = task_errors(task.arm, task.tasks, q, np.tile(self.target, (count, 1)))
        turns = turning_rows(task)
        return Step(
            motion=motion,
            home=self.home,
            position_error=error[~turns].T[:, None],
            rotation_error=error[turns].T[:, None],
            dt=self.dt,
        )

    def free(self, q: Float[np.ndarray, "points dof"]) -> Bool[np.ndarray, " points"]:
        """Return which steps keep within their bounds and clear of obstacles.

        Where all of a step is to be clear, it is halved until no point of the arm moves farther in a part of it than
        the arm is away from obstacles at the part's ends, both distances together. What is too near for that is not
        free.
        """
        moved = q - self.previous
        free: Bool[np.ndarray, " points"] = ((moved >= self.lower - SLACK) & (moved <= self.upper + SLACK)).all(axis=1)
        if not self.task.obstacles or not free.any():
            return free
        moved = np.where(free[:, None], moved, 0.0)
        end = self.gaps(self.previous + moved)
        free &= end > self.standoff
        if not self.swept:
            return free
        far, width = np.abs(moved) @ reaches(self.task), 1.0
        which, begin = np.arange(len(q)), np.zeros(len(q))
        low, high = self.gaps(self.previous[None]).repeat(len(q)), end
        while True:
            left = free[which] & (low + high <= far[which] * width)
            which, begin, low, high = which[left], begin[left], low[left], high[left]
            if width <= FINEST:
                free[which] = False
            if not which.size:
                return free
            width /= 2
            middle = self.gaps(self.previous + (begin + width)[:, None] * moved[which])
            free[which[~(middle > 0)]] = False
            which, begin = np.tile(which, 2), np.concatenate([begin, begin + width])
            low, high = np.concatenate([low, middle]), np.concatenate([middle, high])

    def gaps(self, q: Float[np.ndarray, "points dof"]) -> Float[np.ndarray, " points"]:
        """Return by how much [m] configurations keep more than the required clearance."""
        task = self.task
        motion = Motion(
            arm=task.arm,
            time=np.arange(3.0),
            q=np.repeat(q[:, None], 3, axis=1),
            obstacles=task.obstacles,
            link_radius=task.link_radius,
        )
        return motion.clearance[:, 0] - task.min_clearance


class ControlStep(Problem):  # type: ignore[misc]  # pymoo is not typed
    """Search the rows J* and Δx* that extend Δx = J Δq to a square system (Eqs. 7 to 18): a vectorised pymoo problem.

    An individual is the matrix (redundancy, dof + 1) of these rows, flattened. F has the objectives, minimised; G, one
    column, is 1 where ``instant.free`` says no. ``algorithm`` replaces such chromosomes before they are evaluated, as
    the paper does; where all of a step is to be clear, only the first ones, and later ones fail: their F is inf.
    """

    def __init__(self, instant: Instant, objectives: Sequence[StepObjective]) -> None:
        self.instant = instant
        self.objectives = tuple(objectives)
        self.rows, self.row = instant.task.redundancy, instant.task.arm.dof + 1
        self._asked = instant.asked()
        size = self.rows * self.row
        super().__init__(
            n_var=size, n_obj=len(self.objectives), n_ieq_constr=1, xl=-BOUND * np.ones(size), xu=BOUND * np.ones(size)
        )

    def decode(self, genes: Genes) -> Float[np.ndarray, "points dof"]:
        """Return the joint positions after the step; not a number where the extended Jacobian is singular."""
        wanted, jacobian = self._asked
        rows = genes.reshape(-1, self.rows, self.row)
        table = np.concatenate([np.tile(jacobian, (len(rows), 1, 1)), rows[..., :-1]], axis=1)
        right = np.concatenate([np.tile(wanted, (len(rows), 1)), rows[..., -1]], axis=1)
        singular = np.linalg.det(table) == 0
        table[singular] = np.eye(self.row - 1)
        right[singular] = np.nan
        step: np.ndarray = np.linalg.solve(table, right[..., None])[..., 0]
        return self.instant.previous + step

    def free(self, genes: Genes) -> Bool[np.ndarray, " points"]:
        """Return which chromosomes need not be replaced."""
        return self.instant.free(self.decode(genes))

    def shortened(self, genes: Genes) -> Genes:
        """Return genes of steps with no more self-motion than keeps every joint within its bounds.

        What the step to the target itself takes is not shortened.
        """
        wanted, jacobian = self._asked
        least, instant = np.linalg.pinv(jacobian) @ wanted, self.instant
        more = np.nan_to_num(self.decode(genes) - instant.previous - least)
        far = (least + more < instant.lower) | (least + more > instant.upper)
        left = np.maximum(
            (np.where(more > 0, instant.upper, instant.lower) - least) / np.where(far & (more != 0), more, 1.0), 0.0
        )
        kept = np.where(far, np.minimum(left, 1.0), 1.0).min(axis=1, keepdims=True)
        rows = genes.reshape(-1, self.rows, self.row)
        ahead = np.einsum("prk,pk->pr", rows[..., :-1], least + kept * more)
        found = np.concatenate([rows[..., :-1], np.where(kept < 1, ahead, rows[..., -1])[..., None]], axis=-1)
        made: Genes = found.reshape(genes.shape)
        return made

    def scores(self, q: Float[np.ndarray, "points dof"]) -> Objectives:
        """Return the objectives of steps, minimised; inf where one is not a number."""
        known = np.isfinite(q).all(axis=1)
        F = np.full((len(q), len(self.objectives)), np.inf)
        step = self.instant.step(q[known])
        F[known] = np.stack([objective.function(step)[..., -1] * objective.sign for objective in self.objectives], 1)
        F[~np.isfinite(F).all(axis=1)] = np.inf
        return F

    def algorithm(self, population: int) -> GeneticAlgorithm:
        """Return the paper's NSGA-II: tournaments, crossover by rows, one gene replaced, MaxiMin selection."""
        return GeneticAlgorithm(
            pop_size=population,
            sampling=FreeChromosomes(),
            selection=BinaryTournament(),
            crossover=RowCrossover(self.row),
            mutation=ReplaceOne(),
            survival=MaxiMin(),
            repair=Shorten() if self.instant.swept else ReplaceBlocked(),
            eliminate_duplicates=False,
            advance_after_initial_infill=True,
        )

    def _evaluate(self, X: Genes, out: dict[str, object], *args: object, **kwargs: object) -> None:
        q = self.decode(X)
        free, F = self.instant.free(q), self.scores(q)
        out["F"] = np.where(free[:, None], F, np.inf) if self.instant.swept else F
        out["G"] = (~free).astype(float)[:, None]


class FreeChromosomes(Sampling):  # type: ignore[misc]  # pymoo is not typed
    """Chromosomes drawn uniformly from those whose configuration is free."""

    def _do(
        self, problem: ControlStep, n_samples: int, *, random_state: np.random.Generator, **kwargs: object
    ) -> Genes:
        return replaced(problem, _drawn(problem, n_samples, random_state), random_state)


class Shorten(Repair):  # type: ignore[misc]  # pymoo is not typed
    """Steps that would go out of bounds are shortened."""

    def _do(self, problem: ControlStep, X: Genes, **kwargs: object) -> Genes:
        return problem.shortened(np.array(X, dtype=float))


class ReplaceBlocked(Repair):  # type: ignore[misc]  # pymoo is not typed
    """A chromosome whose configuration is not free is rejected and a new one is drawn (section 5.2)."""

    def do(
        self, problem: ControlStep, pop: Population, random_state: np.random.Generator, **kwargs: object
    ) -> Population:
        """Return the population with such chromosomes replaced."""
        pop.set("X", replaced(problem, pop.get("X"), random_state))
        return pop


def replaced(problem: ControlStep, genes: Genes, rng: np.random.Generator) -> Genes:
    """Return genes of steps that are short enough, those that are not free replaced by drawn ones."""
    genes = problem.shortened(np.array(genes, dtype=float))
    for _ in range(TRIES):
        blocked = np.flatnonzero(~problem.free(genes))
        if not blocked.size:
            break
        genes[blocked] = problem.shortened(_drawn(problem, blocked.size, rng))
    return genes


def _drawn(problem: ControlStep, count: int, rng: np.random.Generator) -> Genes:
    drawn: Genes = rng.uniform(problem.xl, problem.xu, size=(count, problem.n_var))
    return drawn


def turning_rows(task: MotionTask) -> Bool[np.ndarray, " rows"]:
    """Return which rows of the task errors are rotations [rad]."""
    return np.concatenate([np.arange(each.rows) >= each.position_rows for each in task.tasks])


def reaches(task: MotionTask) -> Float[np.ndarray, " dof"]:
    """Return the most [m] that any point of the arm moves when a joint moves by 1 (rad or m).

    Beyond a joint no point is farther from it than all that follows is long, stretched out. A joint that slides moves
    what it carries as far as itself; how far it may be out adds to what is beyond the joints before it.
    """
    arm = task.arm
    offsets = [float(np.linalg.norm(place.position)) for place in (*arm.placements[1:], arm.tool)]
    slides = ~arm.periodic
    out = np.where(slides, np.abs(arm.position_limits).max(axis=1), 0.0)
    beyond = np.cumsum((offsets + np.append(out[1:], 0.0))[::-1])[::-1]
    return np.where(slides, 1.0, beyond)
