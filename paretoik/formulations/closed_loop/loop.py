"""The closed loop: at every sample a search, a choice by weights, a step (Marcos et al. 2012, section 4.1, Fig. 1)."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Objectives
from paretoik.errors import Infeasible, InvalidInput
from paretoik.formulations.closed_loop.objectives import StepObjective, joint_displacement, of_step, position_error
from paretoik.formulations.closed_loop.posture import first_posture
from paretoik.formulations.closed_loop.programs import StepPrograms, step_programs
from paretoik.formulations.closed_loop.searching import Population, StepSearch
from paretoik.formulations.closed_loop.step import HISTORY, Instant
from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import link_nodes
from paretoik.robot.pose import finite_array
from paretoik.search.seeding import SMALLEST_POPULATION, check_size
from paretoik.task.limits import Limits
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask, motion_task
from paretoik.task.objectives import Found, Moving, Objective, joint_drift, objective
from paretoik.task.obstacles import Obstacle, clearance
from paretoik.task.path import Path
from paretoik.task.task import Task

PAPERS = (joint_displacement, position_error)
LONGEST = 0.1  # rad or m that a joint may move in a step, unless its velocity limit says less
HASHED = 100  # steps between digests of the state


@objective(unit="m", form="general")
def mean_position_error(motion: Moving) -> Found:
    """Mean over the steps of the distance of the tool from its target. Source: Marcos et al. 2012, Eq. 23."""
    return motion.position_error[..., 1:].mean(axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Taken:
    """A step that was taken: to which sample, the front that was found, which of its points was chosen."""

    sample: int
    front: Population
    index: int

    @property
    def q(self) -> Float[np.ndarray, " dof"]:
        """The joint positions after it."""
        return self.front.q[self.index]


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedLoopRun:
    """What a closed loop did: ``q`` (time, dof), the steps that were asked for, and digests of the state on the way."""

    task: MotionTask
    q: Float[np.ndarray, "time dof"]
    fronts: dict[int, Taken]
    digests: tuple[str, ...]

    @property
    def motion(self) -> Motion:
        """The motion, on its samples."""
        return self.task.motion(self.q)

    @cached_property
    def position_error(self) -> float:
        """Mean over the steps of the distance [m] of the tool from its target (Eq. 23)."""
        return float(mean_position_error(self.motion))

    @cached_property
    def drift(self) -> float:
        """Distance of the last configuration from the first, over the number of joints [rad] (Eq. 25)."""
        return float(joint_drift(self.motion))


class ClosedLoop:
    """Follow ``path`` with ``arm`` step by step, each step found by an evolutionary search and chosen by weights.

    Parameters
    ----------
    arm, path
        The arm, and a Path, a Task or several of them with the same times, evenly spaced: a step leads from one sample
        to the next.
    objectives
        What a step is worth: ``joint_displacement`` and ``position_error`` (the paper's), any function decorated with
        ``@step_objective``, or an ``@objective`` of form integral or peak; at least two.
    weights
        Of the choice, one an objective, scaled to a sum of 1 (Eqs. 19 and 20); equal if None.
    start
        Joint positions (dof,) that the loop begins in; None searches for some by OLGA (section 4.2).
    obstacles, link_radius, limits
        What the links, capsules of this radius [m], must be clear of (by ``limits.clearance``) where a step ends;
        between its ends nothing is looked at. Position limits bound the search for a start alone, velocity limits the
        length of a step.
    longest_step
        The most that a joint may move in a step [rad, m]; None takes 0.1, or what the velocity limits allow if that is
        less; np.inf is the paper's.
    population, generations, seed
        Of the search in every step, and of all chance.

    Raises
    ------
    InvalidInput
        Naming what cannot be used.
    Infeasible
        Where no start is clear of the obstacles.
    """

    def __init__(
        self,
        arm: Arm,
        path: Path | Task | Sequence[Path | Task],
        *,
        objectives: Sequence[StepObjective | Objective] = PAPERS,
        weights: Sequence[float] | None = None,
        start: Sequence[float] | np.ndarray | None = None,
        obstacles: Sequence[Obstacle] = (),
        link_radius: float = 0.0,
        limits: Limits | None = None,
        longest_step: float | None = None,
        population: int = 200,
        generations: int = 200,
        seed: int = 0,
    ) -> None:
        check_size("population", population, SMALLEST_POPULATION)
        check_size("generations", generations, 1)
        check_size("seed", seed, 0)
        self.objectives = tuple(of_step(given) for given in objectives)
        if len(self.objectives) < 2:
            raise InvalidInput(f"objectives: at least two wanted, got {len(self.objectives)}")
        if len(set(self.names)) != len(self.names):
            raise InvalidInput(f"objectives: names must differ, got {', '.join(self.names)}")
        self.weights = _weights(weights, self.names)
        self.task = motion_task(
            arm,
            path,
            objectives=[mean_position_error, joint_drift],
            limits=limits,
            constraints=(),
            obstacles=obstacles,
            link_radius=link_radius,
            start="free",
            end_velocity=None,
            cyclic=False,
            differences="backward",
        )
        steps = np.diff(self.task.times)
        if np.ptp(steps) > 1e-9 * steps.mean():
            raise InvalidInput("path: samples evenly spaced in time wanted, one a control step")
        self.population, self.generations, self.seed = int(population), int(generations), int(seed)
        self.start = first_posture(self.task, seed=seed) if start is None else _given_start(arm, start)
        self.longest = _longest(self.task, longest_step)

    def weighed(self, weights: Sequence[float]) -> ClosedLoop:
        """Return the same loop, from the same start, with other weights."""
        other = copy(self)
        other.weights = _weights(weights, self.names)
        return other

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the objectives."""
        return tuple(objective.name for objective in self.objectives)

    @cached_property
    def programs(self) -> StepPrograms:
        """The objectives and the clearance as the engine takes them."""
        times = self.task.times
        return step_programs(self.task, self.objectives, float(times[1] - times[0]))

    def instant(self, sample: int, history: Float[np.ndarray, "history dof"] | None = None) -> Instant:
        """Return what is known before a step, after these joint positions; at rest in the start if None."""
        before = np.tile(self.start, (HISTORY, 1)) if history is None else history
        return Instant(task=self.task, sample=sample, history=before, home=self.start, longest=self.longest)

    def search(self) -> StepSearch:
        """Return the compiled search of its steps; one a thread."""
        return StepSearch(
            programs=self.programs,
            redundancy=self.task.redundancy,
            dof=self.task.arm.dof,
            objectives=len(self.objectives),
            population=self.population,
            generations=self.generations,
            seed=self.seed,
        )

    def steps(self) -> Iterator[Taken]:
        """Take one step after the other.

        Raises Infeasible, naming the step, where no configuration is free or none can be had.
        """
        search, history = self.search(), np.tile(self.start, (HISTORY, 1))
        for sample in range(1, len(self.task.times)):
            instant = self.instant(sample, history)
            population = search(instant)
            if not len(population.F):
                raise self._blocked(instant)
            front = undominated(population)
            taken = Taken(sample=sample, front=front, index=chosen(front.F, self.weights))
            yield taken
            history = np.concatenate([history[1:], taken.q[None]])

    def run(self, *, fronts: Sequence[int] = (), observe: Callable[[Taken], object] | None = None) -> ClosedLoopRun:
        """Follow the path; ``fronts`` are samples whose fronts are kept, ``observe`` is shown every step."""
        q, kept, digests = [self.start], dict[int, Taken](), list[str]()
        state = hashlib.sha256()
        for taken in self.steps():
            q.append(taken.q)
            state.update(taken.front.F.tobytes() + taken.q.tobytes())
            if taken.sample % HASHED == 0:
                digests.append(state.hexdigest())
            if taken.sample in fronts:
                kept[taken.sample] = taken
            if observe is not None:
                observe(taken)
        return ClosedLoopRun(task=self.task, q=np.array(q), fronts=kept, digests=tuple(digests))

    def _blocked(self, instant: Instant) -> Infeasible:
        time = self.task.times[instant.sample]
        most = float(instant.longest.max())
        said = f"step {instant.sample} ({time:.3g} s): a free configuration wanted, none was found"
        said += f" within {most:.3g} rad" if np.isfinite(most) else ""
        if not self.task.obstacles:
            return Infeasible(said)
        gap = float(instant.gaps(instant.previous[None])[0])
        return Infeasible(f"{said}; the arm is {gap:.3g} m from {self._nearest(instant.previous)}")

    def _nearest(self, q: np.ndarray) -> str:
        """Return in words which obstacle is nearest to a configuration."""
        nodes = link_nodes(self.task.arm, q)
        gaps = [float(clearance([obstacle], nodes, self.task.link_radius)) for obstacle in self.task.obstacles]
        k = int(np.argmin(gaps))
        return f"obstacle {k + 1} of {len(gaps)}, {self.task.obstacles[k]}"


def _weights(given: Sequence[float] | None, names: tuple[str, ...]) -> Float[np.ndarray, " n_obj"]:
    weights = np.ones(len(names)) if given is None else finite_array("weights", given, shape=(len(names),))
    if (weights < 0).any() or weights.sum() <= 0:
        raise InvalidInput(f"weights: none below 0 and one above it wanted, got {weights.tolist()}")
    return np.asarray(weights / weights.sum())


def _given_start(arm: Arm, start: Sequence[float] | np.ndarray) -> Float[np.ndarray, " dof"]:
    return finite_array("start", start, shape=(arm.dof,))


def _longest(task: MotionTask, given: float | None) -> Float[np.ndarray, " dof"]:
    """Return the most that each joint may move in a step."""
    if given is not None and not given > 0:
        raise InvalidInput(f"longest_step: a positive number wanted, got {given!r}")
    if given is not None:
        return np.full(task.arm.dof, float(given))
    dt = float(task.times[1] - task.times[0])
    fastest = np.full(task.arm.dof, np.inf)
    if "velocity" in task.bounds:
        fastest = np.abs(task.bounds["velocity"]).max(axis=(0, 2))
    return np.minimum(LONGEST, fastest * dt)


def undominated(population: Population) -> Population:
    """Return the non-dominated ones, by the first objective."""
    from moocore import is_nondominated

    kept = np.flatnonzero(is_nondominated(population.F, keep_weakly=False))
    kept = kept[np.lexsort(population.F[kept].T[::-1])]
    return Population(genes=population.genes[kept], F=population.F[kept], q=population.q[kept])


def chosen(F: Objectives, weights: Float[np.ndarray, " n_obj"]) -> int:
    """Return the point with the least weighted sum of objectives, scaled to the range of the front (Eqs. 19, 20)."""
    least, width = F.min(axis=0), np.ptp(F, axis=0)
    z = np.where(width > 0, (F - least) / np.where(width > 0, width, 1.0), 0.0)
    return int(np.argmin(z @ weights))
