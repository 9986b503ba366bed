"""The closed loop: search a front, choose a point and move, at every sample.

Source: Marcos et al. 2012.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NoReturn

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Objectives
from paretoik.closed_loop.control_step import HISTORY, StepState
from paretoik.closed_loop.loop import StepRecord, choose, explain_no_step, nondominated_rows, state_before
from paretoik.closed_loop.objectives import StepObjective, joint_displacement, position_error
from paretoik.closed_loop.open_loop import search_start
from paretoik.closed_loop.programs import StepPrograms, trace_step
from paretoik.closed_loop.step_evolution import Population, StepEvolution
from paretoik.collision.obstacles import Obstacle
from paretoik.errors import Infeasible, InvalidInput
from paretoik.formulations.control_step import (
    ControlStep,
    check_limits,
    check_longest_step,
    check_objectives,
    check_start,
    check_steps,
)
from paretoik.formulations.formulation import task_rows
from paretoik.formulations.protocol import Timeline
from paretoik.front.choice import Choice, Preference
from paretoik.front.front import Front
from paretoik.front.preferences import Weights
from paretoik.inputs import ArrayLike, check_flag, check_seed, check_size, finite_array, likely_spelling, shown
from paretoik.robot.arm import Arm
from paretoik.search.genes import SMALLEST_POPULATION
from paretoik.tables import columns, fit_screen, html_representation
from paretoik.task.limits import Limits
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import AnyMotion, AnyValues, Objective, joint_drift, objective
from paretoik.task.path import Path
from paretoik.task.task import Task
from paretoik.task.validation import motion_task

# Result of a closed loop: the motion, the choice of every step, and the motion as a front.


@objective(unit="m", form="general")
def mean_position_error(motion: AnyMotion) -> AnyValues:
    """Return the mean distance of the tool from its target over steps.

    Source: Marcos et al. 2012, Eq. 23.
    """
    return motion.position_error[..., 1:].mean(axis=-1)  # Eq. 23


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedLoopRun:
    """Result of a closed loop: its motion and every step's choice."""

    loop: ClosedLoop  # loop that was run
    q: Float[np.ndarray, "time dof"]  # joint positions up to the last step
    F: Objectives  # objectives of the chosen points (steps, n_obj), minimised
    ranges: Float[np.ndarray, "steps n_obj 2"]  # least and largest value of each objective on each step's front
    fronts: Mapping[int, StepRecord]  # records of requested steps, by sample

    @cached_property
    def task(self) -> MotionTask:
        """The task up to the last step."""
        return self.loop.task.truncate(len(self.q))

    @cached_property
    def motion(self) -> Motion:
        """The motion up to the last step."""
        return self.task.motion(self.q)

    @cached_property
    def position_error(self) -> float:
        """Mean distance [m] of the tool from its target over the steps (Eq. 23)."""
        return float(mean_position_error(self.motion))

    @cached_property
    def drift(self) -> float:
        """Distance between first and last joint positions, divided by dof [rad] (Eq. 25)."""
        return float(joint_drift(self.motion))

    @property
    def values(self) -> Objectives:
        """Objectives of the chosen points (steps, n_obj), in the user's sign."""
        return self.F * self.loop.signs

    def front(self, provenance: Mapping[str, Any]) -> Front:
        """Return the motion as a front of one point. Its objectives are the means over the steps."""
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
    """Return a closed loop's one motion as a choice. Its reason says how points were chosen."""
    weights = ", ".join(f"{name} {weight:.0%}" for name, weight in front.provenance["settings"]["weights"].items())
    means = [front.quantity(axis, value) for axis, value in enumerate(front.objectives[0])]
    error = f"{front.provenance['position_error']:.4g} m"
    if f"position_error {error}" not in means:  # the objective of that name has the same value
        means.append(f"position error {error}")
    return front.choice(
        0,
        f"At every step the point with the least weighted sum ({weights}) was taken. Means over the steps: "
        f"{', '.join(means)}. Joint drift {front.provenance['drift']:.4g} rad.",
    )


# The closed loop as a problem.


def normalise_weights(
    weights: Weights | Sequence[float] | np.ndarray | None, names: tuple[str, ...]
) -> Float[np.ndarray, " n_obj"]:
    """Return weights in the order of ``names``, scaled to sum 1; None: equal. Raises InvalidInput."""
    if isinstance(weights, Weights):
        unknown = [name for name in weights.weights if name not in names]
        if unknown:
            hint = likely_spelling(unknown[0], names)
            raise InvalidInput(f"weights must have names among {', '.join(names)}, got {shown(unknown[0])}{hint}")
        weights = [weights.weights.get(name, 0.0) for name in names]
    values = np.ones(len(names)) if weights is None else finite_array("weights", weights, shape=(len(names),))
    if (values < 0).any() or values.sum() <= 0:
        raise InvalidInput(f"weights must be at least 0, one of them above 0, got {values.tolist()}")
    return np.asarray(values / values.sum())


ASKED_BY_PYMOO = ("vars", "vtype", "xl", "xu", "bounds", "has_bounds", "n_ieq_constr", "n_eq_constr")


class ClosedLoop:
    """Follow ``path`` with ``arm``: each step finds a front and chooses by weights.

    ``solve`` follows the path and returns the motion as a front of one point. Each of its objectives is the mean over
    the steps. ``front.select`` follows the path again with other weights.

    Parameters
    ----------
    arm
        Planar or spatial arm.
    path
        Path, Task or several of them with the same times, evenly spaced: each step leads from a sample to the next.
    objectives
        Objectives of a step, any number: ``joint_displacement`` and ``position_error`` (the paper's), functions
        decorated with ``@step_objective``, and ``@objective`` functions of form integral or peak.
    weights
        Weights of the choice, or one number per objective, scaled to a sum of 1 (Eqs. 19 and 20); None: equal.
    start
        Joint positions (dof,) at the start; None: the open-loop genetic algorithm (section 4.2) finds them.
    obstacles
        Obstacles from which links keep the distance ``limits.clearance``, also between samples.
    link_radius
        Radius [m] of the links, which are capsules; or one per link, those of the base and after each joint.
    limits
        Limits on position, velocity and clearance; other limits are refused. The arm's own torque limits are not
        enforced, but the result reports how far they are violated.
    longest_step
        Largest move of a joint in one step [rad, m]. With np.inf, as in the paper, steps have any length and only their
        ends are clear of obstacles: the arm may jump through an obstacle.
    warm_start
        Flag: True begins a search with the population of the last step, False with a random one, as the paper does.
    population
        Number of individuals of the search in every step.
    generations
        Number of generations of the search in every step.
    seed
        Seed of all random numbers.

    Raises
    ------
    InvalidInput
        Names the argument that cannot be used.
    """

    timeline: Timeline = "step"
    search_attributes = ("weights", "_given_start", "population", "generations", "seed")  # ``changed`` can set them
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
        link_radius: ArrayLike = 0.0,
        limits: Limits | None = None,
        longest_step: float = 0.1,
        warm_start: bool = False,
        population: int = 200,
        generations: int = 200,
        seed: int = 0,
    ) -> None:
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
            differences="backward",
        )
        steps = np.diff(self.task.times)
        if np.ptp(steps) > 1e-9 * steps.mean():  # rounding
            raise InvalidInput("path must have samples evenly spaced in time, one per control step, got uneven ones")
        check_flag("warm_start", warm_start)
        self.longest, self.warm_start = check_longest_step(longest_step), bool(warm_start)
        self._set(weights, start, population, generations, seed)

    def __repr__(self) -> str:
        weights = ", ".join(f"{name} {weight:.0%}" for name, weight in self.named_weights.items())
        search = f"{self.population} individuals, {self.generations} generations, seed {self.seed}"
        rows = [*task_rows(self.task), ("each step", f"{weights}; {search}")]
        return fit_screen(f"Closed loop\n{columns(rows)}\nnext: pk.solve(loop)")

    def changed(
        self,
        *,
        weights: Weights | Sequence[float] | np.ndarray | None = None,
        start: Sequence[float] | np.ndarray | None = None,
        population: int | None = None,
        generations: int | None = None,
        seed: int | None = None,
    ) -> ClosedLoop:
        """Return the same loop with other settings; None keeps the current one. Raises InvalidInput."""
        other = copy(self)
        if start is not None or (seed is not None and seed != self.seed):
            other.__dict__.pop("start", None)
        other._set(
            self.weights if weights is None else weights,
            self._given_start if start is None else start,
            self.population if population is None else population,
            self.generations if generations is None else generations,
            self.seed if seed is None else seed,
        )
        return other

    def _set(self, weights: Any, start: Any, population: int, generations: int, seed: int) -> None:
        """Check and store the settings that ``changed`` can change."""
        check_size("population", population, SMALLEST_POPULATION)
        check_size("generations", generations, 1)
        check_seed("seed", seed)
        self.weights = normalise_weights(weights, self.names)
        self._given_start = None if start is None else check_start(self.task, start)
        self.population, self.generations, self.seed = int(population), int(generations), int(seed)

    @cached_property
    def start(self) -> Float[np.ndarray, " dof"]:
        """Joint positions at the start, given or found. Raises Infeasible if all postures collide."""
        return search_start(self.task, seed=self.seed) if self._given_start is None else self._given_start

    @property
    def named_weights(self) -> dict[str, float]:
        """Weights by objective."""
        return dict(zip(self.names, self.weights.tolist(), strict=True))

    @property
    def n_var(self) -> int:
        """Number of genes in the search of a step."""
        return self.task.redundancy * (self.task.arm.dof + 1)

    def __getattr__(self, name: str) -> Any:
        """Raise InvalidInput for attributes of pymoo problems, which a loop does not have."""
        if name in ASKED_BY_PYMOO:
            self.evaluate()
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def evaluate(self, *args: object, **kwargs: object) -> NoReturn:
        """Raise InvalidInput, which says what to use instead."""
        raise InvalidInput(
            "problem must be a pymoo problem, got a ClosedLoop; use pk.solve(loop), or loop.control_step(k), the pymoo "
            "problem of step k"
        )

    @cached_property
    def programs(self) -> StepPrograms:
        """Evaluators of a step's objectives and of the distance from obstacles."""
        times = self.task.times
        return trace_step(self.task, self.objectives, float(times[1] - times[0]))

    def control_step(self, sample: int, history: np.ndarray | None = None) -> ControlStep:
        """Return the step to a sample as a pymoo problem.

        ``history``: joint positions (rows, dof) before the step, the latest last; None: at rest at the start.
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
        """Return the state before the step to a sample. ``history``: as in ``control_step``."""
        before = np.tile(self.start, (HISTORY, 1)) if history is None else history
        return state_before(self.task, sample, before, home=self.start, longest=self.longest)

    def step_evolution(self) -> StepEvolution:
        """Return the compiled search of a step; each thread needs its own."""
        return StepEvolution(
            programs=self.programs,
            redundancy=self.task.redundancy,
            objectives=self.n_obj,
            population=self.population,
            generations=self.generations,
            seed=self.seed,
            warm_start=self.warm_start,
        )

    def prepare(self) -> None:
        """Find the start and compile the search, before the first step."""
        search = self.step_evolution()
        search.generations = 1
        search(self.step_state(1))

    def steps(self, record_steps: Collection[int] = ()) -> Iterator[StepRecord]:
        """Yield each step: search a front, choose a point, move (Marcos et al. 2012, Fig. 1).

        ``record_steps``: as in ``run``. Raises Infeasible, naming the step, if no configuration is admissible.
        """
        search, history = self.step_evolution(), np.tile(self.start, (HISTORY, 1))
        for sample in range(1, len(self.task.times)):
            step, recorded = self.step_state(sample, history), sample in record_steps
            population, generations = search.with_generations(step) if recorded else (search(step), None)
            if not len(population.F):
                raise Infeasible(explain_no_step(step))
            rows = nondominated_rows(population.F)
            front = Population(genes=population.genes[rows], F=population.F[rows], q=population.q[rows])
            index = choose(front.F, self.weights)
            record = StepRecord(sample=sample, front=front, index=index, generations=generations)
            yield record
            history = np.concatenate([history[1:], record.q[None]])

    def run(
        self,
        *,
        fronts: Sequence[int] = (),
        record_steps: Sequence[int] = (),
        observe: Callable[[StepRecord], object] | None = None,
        should_stop: Callable[[], bool] = lambda: False,
    ) -> ClosedLoopRun:
        """Follow the path and return the result.

        Parameters
        ----------
        fronts
            Samples whose fronts are recorded.
        record_steps
            Samples whose steps are recorded with all generations of the search, one population each.
        observe
            Function that is called with every step.
        should_stop
            Function that ends the loop if it returns True after a step; it is not called after the first one.

        Raises
        ------
        InvalidInput
            If a step of ``record_steps`` does not exist.
        Infeasible
            As ``steps`` does.
        """
        recorded = check_steps(record_steps, len(self.task.times) - 1)
        q, F, ranges, records = [self.start], [], [], dict[int, StepRecord]()
        for record in self.steps(recorded):
            front = record.front.F
            q.append(record.q)
            F.append(front[record.index])
            ranges.append(np.stack([front.min(axis=0), front.max(axis=0)], axis=1))
            if record.sample in fronts or record.generations is not None:
                records[record.sample] = record
            if observe is not None:
                observe(record)
            if record.sample > 1 and should_stop():
                break
        return ClosedLoopRun(loop=self, q=np.array(q), F=np.array(F), ranges=np.array(ranges), fronts=records)

    def select(self, front: Front, preference: Preference) -> Choice:
        """Return the motion for other weights; the other settings are those of ``front``.

        Raises InvalidInput if the preference is not Weights, and as ``run`` does.
        """
        other = self.reweigh(front, preference)
        if other is not None:
            front = other.run().front({**front.provenance, "settings": {"weights": other.named_weights}})
        return explain_choice(front)

    def reweigh(self, front: Front, preference: Preference) -> ClosedLoop | None:
        """Return the loop of ``front`` with other weights; None if they are the same."""
        if not isinstance(preference, Weights):
            raise InvalidInput(f"select: preference must be Weights for a closed loop, got {shown(preference)}")
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
