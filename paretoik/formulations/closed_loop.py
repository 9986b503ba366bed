"""The closed loop as a problem: at every sample a search, a choice by weights, a step (Marcos et al. 2012)."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NoReturn

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Objectives
from paretoik.closed_loop.control_step import HISTORY, StepState
from paretoik.closed_loop.loop import StepRecord, state_before, take_steps
from paretoik.closed_loop.objectives import StepObjective, joint_displacement, position_error
from paretoik.closed_loop.open_loop import search_start
from paretoik.closed_loop.programs import StepPrograms, trace_step
from paretoik.closed_loop.step_evolution import StepEvolution
from paretoik.errors import InvalidInput
from paretoik.formulations.control_step import (
    ControlStep,
    check_even,
    check_limits,
    check_longest_step,
    check_objectives,
    check_start,
    check_steps,
    normalise_weights,
)
from paretoik.formulations.formulation import loop_text
from paretoik.formulations.protocol import Timeline
from paretoik.front.choice import Choice, Preference
from paretoik.front.front import Front
from paretoik.front.preferences import Weights
from paretoik.inputs import check_call, check_flag, check_seed, check_size, shown
from paretoik.robot.arm import Arm
from paretoik.search.genes import SMALLEST_POPULATION
from paretoik.tables import html_representation
from paretoik.task.limits import Limits
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import AnyMotion, AnyValues, Objective, joint_drift, objective
from paretoik.task.obstacles import Obstacle
from paretoik.task.path import Path
from paretoik.task.task import Task
from paretoik.task.validation import motion_task

# The result of a closed loop: the motion, every step's choice, and what it is as a front.


@objective(unit="m", form="general")
def mean_position_error(motion: AnyMotion) -> AnyValues:
    """Mean over the steps of the distance of the tool from its target. Source: Marcos et al. 2012, Eq. 23."""
    return motion.position_error[..., 1:].mean(axis=-1)  # Eq. 23


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedLoopRun:
    """What a closed loop did: ``q`` (time, dof), and of each step its choice.

    ``F`` (steps, n_obj) are the objectives of the choices, minimised, ``ranges`` (steps, n_obj, 2) the smallest and
    largest on each step's front, ``fronts`` the records of the steps that were asked for, by sample, some with their
    generations, ``digests`` those of the state on the way. Where the loop was stopped early, ``q`` ends there.
    """

    loop: ClosedLoop
    q: Float[np.ndarray, "time dof"]
    F: Objectives
    ranges: Float[np.ndarray, "steps n_obj 2"]
    fronts: Mapping[int, StepRecord]
    digests: tuple[str, ...]

    @cached_property
    def task(self) -> MotionTask:
        """The task up to the last step that was taken."""
        return self.loop.task.truncate(len(self.q))

    @cached_property
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

    @property
    def values(self) -> Objectives:
        """The objectives of the choices (steps, n_obj), in their own sign."""
        return self.F * self.loop.signs

    def front(self, provenance: Mapping[str, Any]) -> Front:
        """Return the motion as a front of one point: the mean over the steps of every objective."""
        loop, motions = self.loop, self.task.motion(self.q[None])
        return Front(
            ids=np.zeros(1, dtype=np.int64),
            objectives=self.values.mean(axis=0, keepdims=True),
            names=loop.names,
            units=[each.unit for each in loop.objectives],
            maximised=[each.maximise for each in loop.objectives],
            motions=motions,
            violation=np.maximum(self.task.violations(motions).max(axis=1, initial=0.0), 0.0),
            problem=loop,
            provenance={
                **provenance,
                "timeline": loop.timeline,
                "position_error": self.position_error,
                "drift": self.drift,
            },
        )


def explain_choice(front: Front) -> Choice:
    """Return the one motion of a closed loop's front, and in words how its steps were chosen."""
    weights = ", ".join(f"{name} {weight:.0%}" for name, weight in front.provenance["settings"]["weights"].items())
    means = [front.quantity(axis, value) for axis, value in enumerate(front.objectives[0])]
    error = f"{front.provenance['position_error']:.4g} m"
    if f"position_error {error}" not in means:  # the objective of that name says the same
        means.append(f"position error {error}")
    return front.choice(
        0,
        f"At every step the point with the least weighted sum ({weights}) was taken. Means over the steps: "
        f"{', '.join(means)}. Joint drift {front.provenance['drift']:.4g} rad.",
    )


DIGEST_INTERVAL = 100  # steps from one digest of the state to the next
ASKED_BY_PYMOO = ("vars", "vtype", "xl", "xu", "bounds", "has_bounds", "n_ieq_constr", "n_eq_constr")


@check_call
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
        Of a step: ``joint_displacement`` and ``position_error`` (the paper's), any function decorated with
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
    search_attributes = ("weights", "_given_start", "population", "generations", "seed")  # ``changed`` changes them
    __repr__ = loop_text
    _repr_html_ = html_representation

    def __init__(
        self,
        arm: Arm,
        path: Path | Task | Sequence[Path | Task],
        *,
        objectives: Sequence[StepObjective | Objective] = (joint_displacement, position_error),
        weights: Weights | Sequence[float] | np.ndarray | None = None,
        start: Sequence[float] | np.ndarray | None = None,
        obstacles: Sequence[Obstacle] = (),
        link_radius: float = 0.0,
        limits: Limits | None = None,
        longest_step: float = 0.1,
        warm_start: bool = False,
        population: int = 200,
        generations: int = 200,
        seed: int = 0,
    ) -> None:
        """Make the problem; the class says of what."""
        self.objectives = check_objectives(objectives)
        self.names = tuple(each.name for each in self.objectives)
        self.signs = np.array([each.sign for each in self.objectives])
        self.n_obj = len(self.objectives)
        check_limits(limits, supported=("position", "velocity", "clearance"), where="in a closed loop")
        self.limits = limits
        self.task = motion_task(
            arm,
            path,
            objectives=[mean_position_error, joint_drift],
            limits=limits,
            obstacles=obstacles,
            link_radius=link_radius,
        )
        check_even(self.task.times)
        check_flag("warm_start", warm_start)
        self.longest, self.warm_start = check_longest_step(longest_step), bool(warm_start)
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
        check_seed("seed", seed)
        self.weights = normalise_weights(weights, self.names)
        self._given_start = None if start is None else check_start(self.task, start)
        self.population, self.generations, self.seed = int(population), int(generations), int(seed)

    @cached_property
    def start(self) -> Float[np.ndarray, " dof"]:
        """The joint positions in which the loop begins; where none are given, searched for on first use.

        Raises Infeasible where none is clear of the obstacles.
        """
        return search_start(self.task, seed=self.seed) if self._given_start is None else self._given_start

    @property
    def named_weights(self) -> dict[str, float]:
        """The weights by objective."""
        return dict(zip(self.names, self.weights.tolist(), strict=True))

    @property
    def n_var(self) -> int:
        """Number of genes in a step's search."""
        return self.task.redundancy * (self.task.arm.dof + 1)

    def __getattr__(self, name: str) -> Any:
        """Raise InvalidInput for what pymoo asks a problem for: a loop is a search at every step, not one."""
        if name in ASKED_BY_PYMOO:
            self.evaluate()
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def evaluate(self, *args: object, **kwargs: object) -> NoReturn:
        """Raise InvalidInput, which says what to use."""
        raise InvalidInput(
            "problem must be one search, got a ClosedLoop: pk.solve(loop) follows it, loop.control_step(k) is the "
            "pymoo problem of step k"
        )

    @cached_property
    def programs(self) -> StepPrograms:
        """The evaluators of a step's objectives and of the arm's distance to obstacles."""
        times = self.task.times
        return trace_step(self.task, self.objectives, float(times[1] - times[0]))

    def control_step(self, sample: int, history: np.ndarray | None = None) -> ControlStep:
        """Return the search of the step to a sample, as a pymoo problem.

        ``history`` (rows, dof) are the joint positions before it, the present ones last; at rest in the start if None.
        Raises InvalidInput and Infeasible as ``ControlStep`` does.
        """
        task = self.task
        return ControlStep(
            task.arm,
            task.tasks,
            self.start if history is None else history,
            sample=sample,
            home=self.start,
            objectives=self.objectives,
            obstacles=task.obstacles,
            link_radius=task.link_radius,
            limits=self.limits,
            longest_step=self.longest,
        )

    def step_state(self, sample: int, history: Float[np.ndarray, "history dof"] | None = None) -> StepState:
        """Return what is known before the step to a sample; ``history`` as for ``control_step``."""
        before = np.tile(self.start, (HISTORY, 1)) if history is None else history
        return state_before(self.task, sample, before, home=self.start, longest=self.longest)

    def step_evolution(self) -> StepEvolution:
        """Return the compiled search of its steps; one a thread."""
        return StepEvolution(
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
        """Search for the start and compile the search, so that the first step takes no longer than the others."""
        search = self.step_evolution()
        search.generations = 1
        search(self.step_state(1))

    def steps(self, record_steps: Collection[int] = ()) -> Iterator[StepRecord]:
        """Take one step after the other; ``record_steps`` as for ``run``, raises as ``take_steps`` does."""
        return take_steps(
            self.step_evolution(),
            self.step_state,
            start=self.start,
            weights=self.weights,
            samples=len(self.task.times),
            record_steps=record_steps,
        )

    def run(
        self,
        *,
        fronts: Sequence[int] = (),
        record_steps: Sequence[int] = (),
        observe: Callable[[StepRecord], object] | None = None,
        should_stop: Callable[[], bool] = lambda: False,
    ) -> ClosedLoopRun:
        """Follow the path; ``fronts`` are samples whose fronts are recorded, ``observe`` is called with every step.

        Of the steps to samples in ``record_steps`` all generations of the search are kept, a population each.
        After a step (the second at the earliest) at which ``should_stop`` says so the loop ends. Raises InvalidInput
        for samples that the path does not have, and as ``take_steps`` does.
        """
        recorded = check_steps(record_steps, len(self.task.times) - 1)
        q, F, ranges, records, digests = [self.start], [], [], dict[int, StepRecord](), list[str]()
        state = hashlib.sha256()
        for record in self.steps(recorded):
            front = record.front.F
            q.append(record.q)
            F.append(front[record.index])
            ranges.append(np.stack([front.min(axis=0), front.max(axis=0)], axis=1))
            state.update(front.tobytes() + record.q.tobytes())
            if record.sample % DIGEST_INTERVAL == 0:
                digests.append(state.hexdigest())
            if record.sample in fronts or record.generations is not None:
                records[record.sample] = record
            if observe is not None:
                observe(record)
            if record.sample > 1 and should_stop():
                break
        columns = {"q": np.array(q), "F": np.array(F), "ranges": np.array(ranges)}
        return ClosedLoopRun(loop=self, **columns, fronts=records, digests=tuple(digests))

    def select(self, front: Front, preference: Preference) -> Choice:
        """Return the motion that follows from these weights at every step, with the settings recorded in ``front``.

        Raises InvalidInput for any other preference, and as ``run`` does.
        """
        other = self.reweigh(front, preference)
        if other is not None:
            front = other.run().front({**front.provenance, "settings": {"weights": other.named_weights}})
        return explain_choice(front)

    def reweigh(self, front: Front, preference: Preference) -> ClosedLoop | None:
        """Return the loop that ``front`` came of, with other weights; None where they are the same."""
        if not isinstance(preference, Weights):
            raise InvalidInput(f"select: of a closed loop weights are wanted, got {shown(preference)}")
        weights, settings = normalise_weights(preference, self.names), dict(front.provenance.get("settings", {}))
        before = settings.get("weights")
        if before is not None and np.allclose(
            normalise_weights(Weights(before), self.names), weights, rtol=1e-9, atol=0
        ):
            return None
        motions = front.motions
        return self.changed(
            weights=preference,
            start=None if motions is None else motions.q[0, 0],
            **{name: settings.get(name) for name in ("population", "generations", "seed")},
        )
