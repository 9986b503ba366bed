"""Tracking of a path as a pymoo problem over the self-motion manifold.

An individual is a base motion on the path, and a spline of self-motion around it (``Encoding``). Every motion of the
search follows the path, so that the search only has to satisfy the limits. The base motions are weighted-pseudoinverse
roll-outs (Tringali & Cocuzza 2020, section 3.1.2), spread over their branches.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Genes, JointPaths, Objectives, Values
from paretoik.collision.obstacles import Obstacle
from paretoik.errors import Infeasible, InvalidInput
from paretoik.formulations.encoding import Encoding, choose_coefficients, encoding
from paretoik.formulations.formulation import Formulation, check_motions, of_genes
from paretoik.formulations.motions import values_between
from paretoik.formulations.navigation import navigate, predict
from paretoik.front.front import Front
from paretoik.front.points import ADDED_SAMPLES
from paretoik.inputs import ArrayLike, check_seed, check_size
from paretoik.nlp.program import Solver
from paretoik.pareto.certificates import Discretisation
from paretoik.pareto.differentiable import Differentiable, Individuals
from paretoik.pareto.scalarisation import Observe
from paretoik.robot.arm import Arm
from paretoik.search.nsga2 import MaxiMinNSGA2
from paretoik.search.operators import Differential, SmoothMutation
from paretoik.stop_flag import STOP
from paretoik.task.differences import DIFFERENCES, Differences
from paretoik.task.limits import LIMIT_TOLERANCE, Constraint, Limits
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask, evaluate_motions, examine_functions
from paretoik.task.objectives import Objective
from paretoik.task.path import Path
from paretoik.task.random_starts import rollout_starts
from paretoik.task.retraction import relative_errors, task_errors
from paretoik.task.self_motion import branch_labels
from paretoik.task.task import Task, describe_errors
from paretoik.task.validation import START_TOLERANCE, motion_task, with_ends
from paretoik.trajectory.infeasibility import explain_violation, require_feasible, warn_of_obstructed_path
from paretoik.trajectory.levels import ObserveLevel, explained_interruption
from paretoik.trajectory.motion_terms import joint_distance
from paretoik.trajectory.plan import MotionColdSearch, Plan, find_optima, resolve_plan
from paretoik.trajectory.tightening import hold_all
from paretoik.trajectory.transcription import MotionProgram, motion_program

# Base motions of ``Tracking``, from roll-outs; motions of the user.


@dataclass(frozen=True, kw_only=True)
class TrackingOptions:
    """Settings of roll-outs and of the search."""

    most: int = 256  # number of roll-outs
    samples: int = 101  # number of samples above which there are fewer roll-outs
    least: int = 64  # least number of roll-outs
    infeasible_share: float = 0.3  # largest share of infeasible parents: optima on limits are found sooner


OPTIONS = TrackingOptions()


def sample_rollouts(task: MotionTask, rng: np.random.Generator) -> tuple[JointPaths, Objectives, np.ndarray]:
    """Return roll-outs, F and causes of failure, sorted by violation, then by non-domination."""
    count = OPTIONS.most * OPTIONS.samples // len(task.times)
    q = rollout_starts(task, min(max(count, OPTIONS.least), OPTIONS.most), rng)
    F, limits, causes = evaluate_motions(task, task.motion(q))
    violation = np.maximum(np.nan_to_num(limits, nan=1e3), 0).sum(axis=1).round(6)
    finite = np.where(np.isfinite(F), F, np.nanmax(np.where(np.isfinite(F), F, np.nan), axis=0, initial=0.0))
    rank = np.sum(np.all(finite[None] <= finite[:, None], axis=-1), axis=1)
    order = np.lexsort((rank, violation))
    return q[order], F[order], causes[order]


def choose_bases(task: MotionTask, rollouts: JointPaths, count: int) -> Float[np.ndarray, "bases time dof"]:
    """Return each branch's best roll-out, then the farthest from these in the better halves."""
    branch = np.array(branch_labels(task.motion(rollouts)))
    members = [np.flatnonzero(branch == name) for name in dict.fromkeys(branch)]
    chosen = [int(rows[0]) for rows in members][:count]
    pool = np.concatenate([rows[: (len(rows) + 1) // 2] for rows in members])
    distances = joint_distance(task, rollouts[pool, None], rollouts[chosen]).min(axis=1)
    while len(chosen) < min(count, len(pool)):
        chosen.append(int(pool[np.argmax(distances)]))
        distances = np.minimum(distances, joint_distance(task, rollouts[pool], rollouts[chosen[-1]]))
    return rollouts[chosen]


def without_added_samples(task: MotionTask, motions: Motion) -> Motion:
    """Return motions at the samples of a task, without those that refinement added."""
    times = motions.time.reshape(-1, motions.time.shape[-1])[0]
    index = np.searchsorted(times, task.times).clip(max=len(times) - 1)
    added = len(times) > len(index) and np.array_equal(times[index], task.times)
    return replace(motions, time=task.times, q=motions.q[..., index, :]) if added else motions


def positions_on_path(task: MotionTask, motions: Motion) -> JointPaths:
    """Return the joint positions of a user's motions.

    Raises InvalidInput unless they have the task's arm and samples and are on the path.
    """
    if not isinstance(motions, Motion):
        raise InvalidInput(f"initial must be motions, got {type(motions).__name__}")
    motions = without_added_samples(task, motions)
    q = np.array(motions.q if motions.q.ndim == 3 else motions.q[None])
    if motions.arm.joint_names != task.arm.joint_names or q.shape[1] != len(task.times):
        raise InvalidInput(
            f"initial must be motions of {task.arm.name} with {len(task.times)} samples, got {motions.arm.name} with "
            f"{q.shape[1]}"
        )
    if np.abs(relative_errors(task.arm, task.tasks, q, task.targets)[0]).max() > START_TOLERANCE:
        largest = np.abs(task_errors(task.arm, task.tasks, q, task.targets)[0]).max(axis=(0, 1))
        distance = describe_errors(task.tasks, largest)
        raise InvalidInput(f"initial must be motions on the path, got some that are {distance} off")
    return q


# Tracking of a path as a pymoo problem.


class Tracking(Formulation, Differentiable):
    """Follow ``path`` with ``arm``, trading ``objectives`` against each other.

    A vectorised pymoo problem.

    Parameters
    ----------
    arm
        Redundant arm.
    path
        Path, Task or several of them with the same times.
    objectives
        Functions decorated with ``@objective``, the library's (``pk.kinetic_energy``, ...) or your own; at least one.
    limits
        Joint limits; None: the arm's own.
    constraints
        Functions decorated with ``@constraint``.
    obstacles
        Obstacles from which links keep the distance ``limits.clearance``.
    link_radius
        Radius [m] of the links, which are capsules; or one per link, those of the base and after each joint.
    start
        First joint positions (dof,), or "free".
    end_velocity
        Velocity at the end: None (free) or 0 (stop).
    cyclic
        Flag: whether the motion must close.
    differences
        Discretisation of motions. "spline" satisfies limits between samples too; ``violation_between`` is the violation
        that remains after refinement. "backward" and "central", as in the papers, satisfy limits at samples only;
        ``Limits(margin=...)`` tightens them by a share of their ranges.
    coefficients
        Number of spline coefficients per direction of redundancy; None: 12, or fewer if there are few samples.
    bases
        Largest number of base motions.
    seed
        Seed of the roll-outs that become base motions; genes depend on it.

    Raises
    ------
    InvalidInput
        Names the argument that cannot be used.
    OutOfReach
        Names the first sample that the arm cannot reach.
    Infeasible
        If every sample can be reached but no continuous motion was found.
    """

    task: MotionTask
    encoding: Encoding
    finer_than: Tracking | None = None
    computed_attributes = ("_rollouts", "encoding")
    search_attributes = ("_encoded_with", "_rollout_values")  # other attributes have their effects
    next_step = "pk.solve(problem) or pk.epsilon_front(problem)"
    species_gene = 0  # the gene that selects the base motion
    follows_path = True
    navigate = navigate
    predict = predict

    def __init__(
        self,
        arm: Arm,
        path: Path | Task | Sequence[Path | Task],
        *,
        objectives: Sequence[Objective],
        limits: Limits | None = None,
        constraints: Sequence[Constraint] = (),
        obstacles: Sequence[Obstacle] = (),
        link_radius: ArrayLike = 0.0,
        start: object = "free",
        end_velocity: float | None = None,
        cyclic: bool = False,
        differences: Differences = DIFFERENCES,
        coefficients: int | None = None,
        bases: int = 12,
        seed: int = 0,
    ) -> None:
        check_size("bases", bases, 1)
        check_seed("seed", seed)
        task = motion_task(
            arm,
            path,
            objectives=objectives,
            limits=limits,
            constraints=constraints,
            obstacles=obstacles,
            link_radius=link_radius,
            differences=differences,
        )
        self.task = with_ends(task, start=start, end_velocity=end_velocity, cyclic=cyclic)
        warn_of_obstructed_path(self.task)
        self.add_objectives(self.task.objectives)
        self.constraint_names = ("tracking", "evaluation", *self.task.limit_names)
        self._encoded_with = coefficients, bases, seed
        self._encode_motions()

    def _encode_motions(self) -> None:
        """Set the encoding of motions, from roll-outs at the task's samples."""
        coefficients, bases, seed = self._encoded_with
        coefficients = choose_coefficients(coefficients, len(self.task.times))
        self._rollouts, *self._rollout_values = sample_rollouts(self.task, np.random.default_rng(seed))
        self.encoding = encoding(self.task, choose_bases(self.task, self._rollouts, bases), coefficients)
        self.n_species = self.encoding.bases
        super().__init__(*self.encoding.bounds)

    def with_midpoints(self) -> Tracking:
        """Return the problem with midpoints added to the samples of its path."""
        finer = copy(self)
        finer.task, finer.finer_than = self.task.with_midpoints(), self.finer_than or self
        finer._encode_motions()
        return finer

    def curve_points(self, motions: Motion) -> Float[np.ndarray, "points time dof"]:
        """Return motions' curves at the problem's samples; NaN if a curve cannot be retracted to the path."""
        try:
            return motions.at(self.task.times)
        except Infeasible:
            if len(motions) == 1:
                return np.full((1, len(self.task.times), self.task.arm.dof), np.nan)
        return np.concatenate([self.curve_points(motions[i : i + 1]) for i in range(len(motions))])

    def species(self, genes: Genes) -> Int[np.ndarray, " points"]:
        """Return the index of each individual's base motion. Only individuals of the same base mate."""
        return self.encoding.species(genes)

    @of_genes
    def decode(self, genes: Genes) -> Motion:
        """Return the motions (points, time, dof) of genes (points, n_var)."""
        return self.task.motion(self.encoding.decode(self.task, genes)[0])

    def encode(self, motions: Motion) -> tuple[Genes, Float[np.ndarray, " points"]]:
        """Return the genes nearest to motions on the path, and their motions' distances [rad, arm's length].

        A distance is the largest over joints and samples. A motion's base is the one with the smallest distance. If it
        is large, use the motion itself.
        """
        check_motions(motions, self.task)
        motions = without_added_samples(self.task, motions)
        check_motions(motions, self.task, samples=len(self.task.times))
        return self.encoding.encode_nearest(self.task, motions.q)

    def translated(self, genes: Genes, labels: Int[np.ndarray, " points"]) -> Genes:
        """Return genes of the same motions around other bases, as closely as bounds allow."""
        q, _ = self.encoding.decode(self.task, genes)
        return np.clip(self.encoding.encode(self.task, np.asarray(labels), q), *self.encoding.bounds)

    def algorithm(self, population: int, *, offspring: int | None = None, initial: Genes | None = None) -> MaxiMinNSGA2:
        """Return MaxiMinNSGA2 with differential crossover, smooth mutation and infeasible parents."""
        return MaxiMinNSGA2(
            pop_size=population,
            n_offsprings=offspring,
            sampling=initial,
            crossover=Differential(),
            mutation=SmoothMutation(self.encoding.coefficients),
            infeasible_share=OPTIONS.infeasible_share,
        )

    def program(self, scales: Float[np.ndarray, " n_obj"] | None = None) -> MotionProgram:
        """Return the nonlinear program of whole motions, its objectives divided by ``scales``."""
        return motion_program(self.task, scales)

    def front_points(self, front: Front) -> Float[np.ndarray, "points time dof"]:
        """Return the joint positions of a front's motions."""
        if front.motions is None:
            raise InvalidInput("front must have motions, got a front without motions")
        return self.motion_points(front.motions)  # type: ignore[arg-type]  # a front of motions holds Motion

    def motion_points(self, motions: Motion) -> Float[np.ndarray, "points time dof"]:
        """Return the joint positions of motions. Raises InvalidInput if they are not of this problem."""
        return positions_on_path(self.task, motions)

    def points(self, genes: Genes) -> Float[np.ndarray, "points time dof"]:
        """Return the joint positions of genes."""
        return np.array(self.decode(genes).q)

    def genes(self, x: Float[np.ndarray, "points time dof"]) -> Genes:
        """Return the genes nearest to motions on the path."""
        return self.encode(self.task.motion(x))[0]

    def individuals(self, x: Float[np.ndarray, "points time dof"], genes: Genes | None = None) -> Individuals:
        """Return motions as individuals; without genes, because genes are inexact."""
        motions = self.task.motion(x)
        values = np.stack([o(motions) * o.sign for o in self.task.objectives], axis=1)
        return Individuals(
            x=x,
            objectives=values,
            genes=None,
            motions=motions,
            violation_between=np.full(len(x), np.nan) if STOP[0] else self.task.violation_between(motions),
            discretisation=None
            if STOP[0]
            else Discretisation(
                names=self.names, values=values, errors=self.task.discretisation_errors(motions), judged=self.tightens
            ),
        )

    def exceeded(self, individuals: Individuals) -> list[str]:
        """Return as text the limits that splines of individuals exceed between samples."""
        words = [""] * len(individuals.x)
        for i in np.flatnonzero(~(individuals.violation_between <= LIMIT_TOLERANCE) & self.tightens).tolist():
            bound = individuals.violation_between[i]
            narrow = f"between samples: a limit is exceeded by up to {bound:.2g} of its range; more samples help"
            words[i] = self.task.describe_between(individuals.motions[i : i + 1]) or narrow
        return words

    @property
    def tightens(self) -> bool:
        """Whether ``hold_between`` tightens limits: only for splines."""
        return self.task.differences == "spline"

    @property
    def added_samples(self) -> dict[str, dict[str, int]]:
        """Provenance entry with the old and new number of samples, if refinement added any."""
        given = self.finer_than
        return {} if given is None else {ADDED_SAMPLES: {"path": len(given.task.times), "used": len(self.task.times)}}

    def hold_between(
        self,
        x: Float[np.ndarray, "points time dof"],
        ranges: Float[np.ndarray, " n_obj"],
        *,
        solver: Solver = "auto",
        observe: Observe | None = None,
    ) -> tuple[Float[np.ndarray, "points time dof"], Sequence[MotionProgram]]:
        """Return motions that satisfy limits between samples if possible, and their programs."""
        natural = self.program()
        if not (self.tightens and len(x)):
            return x, [natural] * len(x)
        motions = hold_all(self.program(ranges), x, len(self.names), solver, observe)
        return np.stack([each.x for each in motions]), [each.program(natural) for each in motions]

    def values_between(self, front: Front, shares: Values) -> Float[np.ndarray, "gaps shares n_obj"]:
        """Return minimised objectives between consecutive motions of a front; inf if impossible."""
        return values_between(self.task, self.front_points(front), shares)

    def branches(self, x: Float[np.ndarray, "points time dof"]) -> list[str]:
        """Return the label of each motion's branch."""
        return branch_labels(self.task.motion(x))

    def require_feasible(self) -> None:
        """Raise Infeasible if the limits clearly cannot be satisfied. The error has the least-violating motion."""
        require_feasible(self.task, self._rollouts)

    def cold_search(
        self, *, starts: int | None, seed: int, solver: Solver = "auto", observe: Observe | None = None
    ) -> MotionColdSearch:
        """Return the search for optima without initial points: each objective, level by level."""
        with explained_interruption(self.task, self._rollouts, None):
            examine_functions(self.task, self.task.motion(self._rollouts), *self._rollout_values)
        return MotionColdSearch(
            task=self.task, rollouts=self._rollouts, starts=starts, seed=seed, solver=solver, observe=observe
        )

    def plan(
        self,
        *,
        starts: int | None,
        seed: int,
        initial: Motion | None = None,
        solver: Solver = "auto",
        observe: ObserveLevel | None = None,
    ) -> Plan:
        """Return the distinct local optima of the one objective. Raises as ``find_optima`` does."""
        q = None if initial is None else positions_on_path(self.task, initial)
        with explained_interruption(self.task, self._rollouts, observe) as show:
            examine_functions(self.task, self.task.motion(self._rollouts), *self._rollout_values)
            plan = find_optima(
                self.task,
                starts=starts,
                seed=seed,
                initial=q,
                solver=solver,
                observe=show,
                rollouts=self._rollouts,
            )
            given = len((self.finer_than or self).task.times)
            return resolve_plan(self.task, plan, self._rollouts, given=given, solver=solver, observe=show)

    def sample_starts(self, count: int, rng: np.random.Generator) -> Genes:
        """Return genes that approximate the ``count`` best roll-outs."""
        return self.encode(self.task.motion(self._rollouts[:count]))[0]

    def self_motion_samples(self, count: int, rng: np.random.Generator) -> Genes:
        """Return genes of ``count`` smooth motions near the bases; the first ones are the bases."""
        return self.encoding.sample(count, rng)

    @property
    def constraint_units(self) -> tuple[str, ...]:
        """Units of the violations."""
        return ("of the samples", "", *("of its range",) * len(self.task.limit_names))

    def explain(self, genes: Genes) -> list[str]:
        """Return a reason for each infeasible individual; "" if it is feasible."""
        q, on_path = self.encoding.decode(self.task, genes)
        reasons = [explain_violation(self.task, motion) for motion in self.task.motion(q)]
        for i in np.flatnonzero(~on_path.all(axis=1)):
            sample, base = int(np.argmin(on_path[i])), int(self.species(genes[i : i + 1])[0])
            where = f"at sample {sample} ({self.task.times[sample]:.3g} s)"
            reasons[i] = f"off the path {where}: beyond a fold of the self-motion manifold around base {base}"
        return reasons

    def _evaluate(self, X: Genes, out: dict[str, object], *args: object, **kwargs: object) -> None:
        q, on_path = self.encoding.decode(self.task, X)
        F, limits, out["cause"] = evaluate_motions(self.task, self.task.motion(q))
        failed = ~np.isfinite(F).all(axis=1) | ~np.isfinite(limits).all(axis=1)
        out["F"] = np.where(np.isfinite(F), F, np.inf)
        out["G"] = np.column_stack([np.mean(~on_path, axis=1), failed.astype(float), np.nan_to_num(limits, nan=1.0)])
