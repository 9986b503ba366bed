"""The closed loop: at every sample a search, a choice by weights, a step (Marcos et al. 2012, section 4.1, Fig. 1)."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from functools import cached_property

import numpy as np
from jaxtyping import Float

from paretoik.closed_loop.objectives import StepObjective, joint_displacement, of_step, position_error
from paretoik.closed_loop.posture import first_posture
from paretoik.closed_loop.programs import StepPrograms, step_programs
from paretoik.closed_loop.searching import StepSearch
from paretoik.closed_loop.settings import check_limits, nearest_obstacle, settled_start, settled_weights
from paretoik.closed_loop.step import HISTORY, Instant, reaches
from paretoik.closed_loop.workspace import FINEST
from paretoik.errors import Infeasible, InvalidInput, check_size
from paretoik.formulations.closed_loop_result import (
    ClosedLoopRun,
    Taken,
    chosen,
    mean_position_error,
    told,
    undominated,
)
from paretoik.formulations.protocol import Timeline
from paretoik.front.front import Choice, Front, Preference
from paretoik.front.preferences import Weights
from paretoik.robot.arm import Arm
from paretoik.search.seeding import SMALLEST_POPULATION
from paretoik.task.limits import Limits
from paretoik.task.motion_task_validation import motion_task
from paretoik.task.objectives import Objective, joint_drift
from paretoik.task.obstacles import Obstacle
from paretoik.task.path import Path
from paretoik.task.task import Task

PAPERS = (joint_displacement, position_error)
LONGEST = 0.1  # rad or m that a joint may move in a step, unless its velocity limit says less
HASHED = 100  # steps between digests of the state


class ClosedLoop:
    """Follow ``path`` with ``arm`` step by step, each step found by an evolutionary search and chosen by weights.

    ``solve`` follows it and returns the motion as a front of one point, of which every objective is the mean over the
    steps; ``front.select`` follows it anew with other weights.

    Parameters
    ----------
    arm, path
        The arm, planar or spatial, and a Path, a Task or several of them with the same times, evenly spaced: a step
        leads from one sample to the next.
    objectives
        What a step is worth: ``joint_displacement`` and ``position_error`` (the paper's), any function decorated with
        ``@step_objective``, or an ``@objective`` of form integral or peak; any number.
    weights
        Of the choice: Weights, or numbers, one an objective; scaled to a sum of 1 (Eqs. 19 and 20); equal if None.
    start
        Joint positions (dof,) that the loop begins in; None searches for some by OLGA (section 4.2) when they are
        needed.
    obstacles, link_radius, limits
        What the links, capsules of this radius [m], are clear of all the way (by ``limits.clearance``), and the limits
        on position and velocity that every step keeps. Others are refused; an arm's own limits on torque are not kept,
        but the result says how far they are violated.
    longest_step
        The most that a joint may move in a step [rad, m]. np.inf is the paper's reading: steps of any length, that are
        clear of obstacles where they end; the arm may then jump through one.
    warm_start
        Whether a search begins with the population of the step before; the paper's begins with a random one.
    population, generations, seed
        Of the search in every step, and of all chance.

    Raises
    ------
    InvalidInput
        Naming what cannot be used.
    """

    timeline: Timeline = "step"

    def __init__(
        self,
        arm: Arm,
        path: Path | Task | Sequence[Path | Task],
        *,
        objectives: Sequence[StepObjective | Objective] = PAPERS,
        weights: Weights | Sequence[float] | np.ndarray | None = None,
        start: Sequence[float] | np.ndarray | None = None,
        obstacles: Sequence[Obstacle] = (),
        link_radius: float = 0.0,
        limits: Limits | None = None,
        longest_step: float = LONGEST,
        warm_start: bool = False,
        population: int = 200,
        generations: int = 200,
        seed: int = 0,
    ) -> None:
        self.objectives = tuple(of_step(given) for given in objectives)
        if not self.objectives:
            raise InvalidInput("objectives: wants at least one, got none")
        if len(set(self.names)) != len(self.names):
            raise InvalidInput(f"objectives: names must differ, got {', '.join(self.names)}")
        check_limits(limits)
        self.task = motion_task(
            arm,
            path,
            objectives=[mean_position_error, joint_drift],
            limits=limits,
            obstacles=obstacles,
            link_radius=link_radius,
        )
        steps = np.diff(self.task.times)
        if np.ptp(steps) > 1e-9 * steps.mean():
            raise InvalidInput("path: samples evenly spaced in time wanted, one a control step")
        if not longest_step > 0:
            raise InvalidInput(f"longest_step: a positive number wanted, got {longest_step!r}")
        self.longest, self.warm_start = float(longest_step), bool(warm_start)
        self._set(weights=weights, start=start, population=population, generations=generations, seed=seed)

    def changed(
        self,
        *,
        weights: Weights | Sequence[float] | np.ndarray | None = None,
        start: Sequence[float] | np.ndarray | None = None,
        population: int | None = None,
        generations: int | None = None,
        seed: int | None = None,
    ) -> ClosedLoop:
        """Return the same loop with other settings; None keeps its own.

        Raises InvalidInput, naming what cannot be used.
        """
        other = copy(self)
        if start is not None or (seed is not None and seed != self.seed):
            other.__dict__.pop("start", None)
        other._set(
            weights=self.weights if weights is None else weights,
            start=self._given_start if start is None else start,
            population=self.population if population is None else population,
            generations=self.generations if generations is None else generations,
            seed=self.seed if seed is None else seed,
        )
        return other

    def _set(
        self,
        *,
        weights: Weights | Sequence[float] | np.ndarray | None,
        start: Sequence[float] | np.ndarray | None,
        population: int,
        generations: int,
        seed: int,
    ) -> None:
        check_size("population", population, SMALLEST_POPULATION)
        check_size("generations", generations, 1)
        check_size("seed", seed, 0)
        self.weights = settled_weights(weights, self.names)
        self._given_start = None if start is None else settled_start(self.task, start)
        self.population, self.generations, self.seed = int(population), int(generations), int(seed)

    @cached_property
    def start(self) -> Float[np.ndarray, " dof"]:
        """The joint positions that the loop begins in; where none are given, searched for when first asked for.

        Raises Infeasible where none is clear of the obstacles.
        """
        return first_posture(self.task, seed=self.seed) if self._given_start is None else self._given_start

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the objectives."""
        return tuple(each.name for each in self.objectives)

    @property
    def named_weights(self) -> dict[str, float]:
        """The weights by objective."""
        return dict(zip(self.names, self.weights.tolist(), strict=True))

    @property
    def signs(self) -> Float[np.ndarray, " n_obj"]:
        """−1 for each objective that is maximised, 1 for the others."""
        return np.array([each.sign for each in self.objectives])

    @property
    def n_obj(self) -> int:
        """Number of objectives."""
        return len(self.objectives)

    @property
    def n_var(self) -> int:
        """Number of genes in a step's search."""
        return self.task.redundancy * (self.task.arm.dof + 1)

    def fingerprint_parts(self) -> list[object]:
        """Return what makes the loop itself, but for weights and the settings of its search."""
        task = self.task
        parts: list[object] = [task.targets, task.times, task.arm.joint_names, self.names, self.signs, self.longest]
        parts += [task.obstacles, task.link_radius, task.min_clearance]
        return parts + [bounds for _, bounds in sorted(task.bounds.items())]

    @cached_property
    def programs(self) -> StepPrograms:
        """The objectives and the arm's polyline as the engine takes them."""
        times = self.task.times
        return step_programs(self.task, self.objectives, float(times[1] - times[0]))

    def instant(self, sample: int, history: Float[np.ndarray, "history dof"] | None = None) -> Instant:
        """Return what is known before a step, after these joint positions; at rest in the start if None."""
        before = np.tile(self.start, (HISTORY, 1)) if history is None else history
        bounds, swept = self.task.bounds, bool(np.isfinite(self.longest))
        box = np.tile([-self.longest, self.longest], (self.task.arm.dof, 1))
        dt = float(self.task.times[sample] - self.task.times[sample - 1])
        for kind, scale, origin in (("velocity", dt, 0.0), ("position", 1.0, before[-1][:, None])):
            if kind in bounds:
                limits = bounds[kind][sample if len(bounds[kind]) > 1 else 0] * scale - origin
                box = np.stack([np.maximum(box[:, 0], limits[:, 0]), np.minimum(box[:, 1], limits[:, 1])], axis=1)
        return Instant(
            task=self.task,
            sample=sample,
            history=before,
            home=self.start,
            lower=box[:, 0].copy(),
            upper=box[:, 1].copy(),
            swept=swept,
            standoff=FINEST * self.longest * self._reach if swept else 0.0,
        )

    @cached_property
    def _reach(self) -> float:
        return float(reaches(self.task).sum())

    def search(self) -> StepSearch:
        """Return the compiled search of its steps; one a thread."""
        return StepSearch(
            programs=self.programs,
            redundancy=self.task.redundancy,
            dof=self.task.arm.dof,
            objectives=self.n_obj,
            population=self.population,
            generations=self.generations,
            seed=self.seed,
            warm_start=self.warm_start,
        )

    def prepare(self) -> None:
        """Search for the start and compile what needs it, so that the first step takes no longer than the others."""
        search = self.search()
        search.generations = 1
        search(self.instant(1))

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

    def run(
        self,
        *,
        fronts: Sequence[int] = (),
        observe: Callable[[Taken], object] | None = None,
        ended: Callable[[], bool] = lambda: False,
    ) -> ClosedLoopRun:
        """Follow the path; ``fronts`` are samples whose fronts are kept, ``observe`` is shown every step.

        After a step (the second at the earliest) at which ``ended`` says so the rest of the path is left.
        Raises as ``steps`` does.
        """
        q, F, ranges, kept, digests = [self.start], [], [], dict[int, Taken](), list[str]()
        state = hashlib.sha256()
        for taken in self.steps():
            front = taken.front.F
            q.append(taken.q)
            F.append(front[taken.index])
            ranges.append(np.stack([front.min(axis=0), front.max(axis=0)], axis=1))
            state.update(front.tobytes() + taken.q.tobytes())
            if taken.sample % HASHED == 0:
                digests.append(state.hexdigest())
            if taken.sample in fronts:
                kept[taken.sample] = taken
            if observe is not None:
                observe(taken)
            if taken.sample > 1 and ended():
                break
        return ClosedLoopRun(
            loop=self, q=np.array(q), F=np.array(F), ranges=np.array(ranges), fronts=kept, digests=tuple(digests)
        )

    def select(self, front: Front, preference: Preference) -> Choice:
        """Return the motion that comes of following the loop anew, as in ``front``, with these weights at every step.

        Raises InvalidInput for any other preference, and as ``run`` does.
        """
        other = self.reweigh(front, preference)
        if other is not None:
            front = other.run().front({**front.provenance, "settings": {"weights": other.named_weights}})
        return told(front)

    def reweigh(self, front: Front, preference: Preference) -> ClosedLoop | None:
        """Return the loop that ``front`` was found by, with other weights; None where they are its own."""
        if not isinstance(preference, Weights):
            raise InvalidInput(f"select: of a closed loop weights are wanted, got {preference!r}")
        weights, settings = settled_weights(preference, self.names), dict(front.provenance.get("settings", {}))
        own = settings.get("weights")
        if own is not None and np.allclose(settled_weights(Weights(own), self.names), weights, rtol=1e-9, atol=0):
            return None
        motions = front.motions
        return self.changed(
            weights=preference,
            start=None if motions is None else motions.q[0, 0],
            **{name: settings.get(name) for name in ("population", "generations", "seed")},
        )

    def _blocked(self, instant: Instant) -> Infeasible:
        said = (
            f"step {instant.sample} ({self.task.times[instant.sample]:.3g} s): a free configuration wanted, none found"
        )
        wanted, jacobian = instant.asked()
        least = np.linalg.pinv(jacobian) @ wanted
        over = np.maximum(instant.lower - least, least - instant.upper)
        if over.max() > 0:
            k = int(np.argmax(over))
            said += (
                f"; {self.task.arm.joint_names[k]} would have to move {least[k]:.3g} rad or m at least, but may move"
            )
            return Infeasible(f"{said} from {instant.lower[k]:.3g} to {instant.upper[k]:.3g}")
        if not self.task.obstacles:
            return Infeasible(said)
        gap = float(instant.gaps(instant.previous[None])[0])
        return Infeasible(f"{said}; the arm is {gap:.3g} m from {nearest_obstacle(self.task, instant.previous)}")
