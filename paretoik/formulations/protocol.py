"""The protocol between formulations and verbs, with defaults for its optional parts.

Any pymoo problem with real genes can be solved. If ``timeline`` is "step", it is a loop that is followed sample by
sample (``ClosedLoop``). Each further part makes one more thing possible. Verbs ask for optional parts through the
functions below: these return a default for a problem without the part, or refuse it. No verb looks at a class.

=======================================  ===========================================================================
part                                     what it makes possible
=======================================  ===========================================================================
``names, units, maximised``              named objectives in the user's own sign; without: f1, f2, ... minimised
``constraint_names, explain(genes)``     the name of the limit that binds, and the reason why genes are infeasible
``constraint_units``                     units of violations: words that follow a number
``computed_attributes``                  names of attributes that follow from others: they are rounded in fingerprints,
                                         by which a run is matched with its problem
``search_attributes``                    names of attributes that fingerprints leave out: how solutions are searched
``decode(genes), encode(motions)``       motions of a front; starting from motions
``task``                                 the ``MotionTask`` of its motions: stored motions get their arm
                                         (``stored_motions``), and the limits that the least-violating one breaks
``with_midpoints()``                     refinement adds samples if values are under-resolved: the same problem with
                                         one more sample in the middle of every interval; the old one is ``finer_than``
``curve_points(motions)``                the points there of motions on fewer samples, NaN off the path
``follows_path``                         true if every motion, also a stored one, follows the task's path exactly
all of ``Differentiable``                ``refine``, ``epsilon_front`` and certificates; a formulation without it has
                                         no gradients, and these verbs refuse it before any work
``values_between(front, shares)``        ``front.jumps``: minimised objectives (gaps, shares, n_obj) at shares of the
way
                                         from each point to the next, inf if that is impossible
``navigate(front, request)``             ``front.navigate``, ``front.refine_around``: the front with the certified point
                                         of a ``NavigationRequest``; it needs all of ``Differentiable``
``predict(front, request)``              ``front.predict``: the ``Prediction`` of such a move; it needs the same
``require_feasible()``                   refusals before a search: raises Infeasible if limits clearly cannot hold
``plan(...)``                            ``plan``: the distinct local optima of one objective
``sample_starts(count, rng)``            genes that searches and local solvers start from
``species(genes), n_species``            branches: mating within each, anchors for the end points of a front
``algorithm(population, ...)``           the pymoo algorithm that suits its genes
``reweigh`` and ``select``               preferences that need a new run
=======================================  ===========================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Genes, JointPaths, Objectives, Points
from paretoik.errors import InvalidInput
from paretoik.front.choice import Preference
from paretoik.front.front import Front
from paretoik.front.points import ADDED_SAMPLES, check_names
from paretoik.inputs import user_function
from paretoik.task.limits import LIMIT_TOLERANCE

if TYPE_CHECKING:
    from paretoik.nlp.program import Program, Solver
    from paretoik.pareto.certificates import Discretisation
    from paretoik.pareto.scalarisation import ColdSearch, Observe
    from paretoik.task.motion import Motion
    from paretoik.task.motion_task import MotionTask
    from paretoik.trajectory.plan import Plan

Timeline: TypeAlias = Literal["generation", "step", "level", "refinement"]
"""Unit that a run counts: generations of a search, steps of a loop, levels of ε, or a front's refinement."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Individuals:
    """Points of a program as solutions of their formulation.

    Attributes
    ----------
    x
        Points of the program.
    objectives
        Objectives, minimised.
    genes
        Genes of the points; None if the formulation has none for points.
    motions
        Motions of the points; None if the formulation has none for points.
    violation_between
        Violation of limits (points,) at places that the program does not check.
    discretisation
        Distance of the objectives from those of a motion's curve; None if they are exact.
    """

    x: Points
    objectives: Objectives
    genes: Genes | None
    motions: Motion | None
    violation_between: Float[np.ndarray, " points"]
    discretisation: Discretisation | None = None


@runtime_checkable
class Differentiable(Protocol):
    """The part of a formulation that gradients need: its nonlinear program, and the meaning of its points."""

    names: Sequence[str]
    units: Sequence[str]
    maximised: Sequence[bool]

    def program(self, scales: Float[np.ndarray, " n_obj"] | None = None) -> Program:
        """Return the nonlinear program, its objectives divided by ``scales``."""

    def front_points(self, front: Front) -> Points:
        """Return the points of a front. Raises InvalidInput if the front does not contain them."""

    def motion_points(self, motions: Motion) -> Points:
        """Return the points of motions. Raises InvalidInput if they are not of the problem, or it has none."""

    def points(self, genes: Genes) -> Points:
        """Return the points of genes."""

    def genes(self, x: Points) -> Genes:
        """Return the genes of points, or the nearest within their bounds."""

    def individuals(self, x: Points, genes: Genes | None = None) -> Individuals:
        """Return points as individuals; ``genes`` are their genes if known."""

    def hold_between(
        self,
        x: Points,
        ranges: Float[np.ndarray, " n_obj"],
        *,
        solver: Solver = "auto",
        observe: Observe | None = None,
    ) -> tuple[Points, Sequence[Program]]:
        """Return optimal points that satisfy limits between the places that the program checks, and their programs.

        A violation that no program can remove remains. Objectives are divided by ``ranges``; ``observe`` gets the share
        of the work that is done.
        """

    def branches(self, x: Points) -> list[str]:
        """Return a label for each point: points of one branch can be led into each other."""

    def cold_search(
        self, *, starts: int | None, seed: int, solver: Solver = "auto", observe: Observe | None = None
    ) -> ColdSearch:
        """Return how local optima are found without initial points, from a number of ``starts``.

        The formulation has a default for None. ``observe`` gets the share of the work that is done.
        """


def timeline(problem: Any) -> Timeline:
    """Return what a run of a problem counts: the generations of a search, or the steps of a loop.

    A pymoo problem may have its own ``timeline`` that is not text: then it is searched.
    Raises InvalidInput if the problem raises when it is asked for an attribute that it may lack.
    """
    with user_function("problem must be a pymoo problem, got one whose attributes cannot be read: it", InvalidInput):
        kind = getattr(problem, "timeline", None)
    return "step" if isinstance(kind, str) and kind == "step" else "generation"


def is_loop(front: Front) -> bool:
    """Return whether a front is the one motion of a loop that was followed step by step."""
    return front.provenance.get("timeline") == "step"


def task_of(problem: Any) -> MotionTask | None:
    """Return the task of a problem's motions; None if it has none."""
    from paretoik.task.motion_task import MotionTask  # imported here: a problem loads quickly

    task = getattr(problem, "task", None)
    return task if isinstance(task, MotionTask) else None


def at_samples_of(problem: Any, q: JointPaths | None) -> Any:
    """Return a problem with the samples that refinement added to a run's motions (points, time, dof)."""
    if q is not None and q.ndim == 3 and hasattr(problem, "with_midpoints"):
        while len(problem.task.times) < q.shape[1]:
            problem = problem.with_midpoints()
    return problem


def added_samples(problem: Any) -> dict[str, dict[str, int]]:
    """Return the provenance entry with the old and new numbers of samples, if refinement added some."""
    given = getattr(problem, "finer_than", None)
    return {} if given is None else {ADDED_SAMPLES: {"path": len(given.task.times), "used": len(problem.task.times)}}


def exceeded_between(problem: Any, individuals: Individuals) -> list[str]:
    """Return the limit that each individual exceeds between samples, as text.

    It is "" without any, or if nothing is promised. Only splines promise it: motions of finite differences satisfy
    limits at their samples.
    """
    task = task_of(problem)
    if task is None or task.differences != "spline" or individuals.motions is None:
        return [""] * len(individuals.x)
    return [
        "" if violation <= LIMIT_TOLERANCE else task.describe_between(individuals.motions[i : i + 1])
        for i, violation in enumerate(individuals.violation_between)
    ]


def require_feasible(problem: Any) -> None:
    """Raise Infeasible if it is clear that no motion satisfies a problem's limits."""
    if hasattr(problem, "require_feasible"):
        problem.require_feasible()


def has_branches(problem: Any) -> bool:
    """Return whether genes belong to species, so that end points of the front may be in different ones."""
    return hasattr(problem, "species")


def decode(problem: Any, genes: Genes) -> Any:
    """Return motions of genes; None if the problem has none."""
    return problem.decode(genes) if hasattr(problem, "decode") else None


def encode(problem: Any, motions: Any) -> tuple[Genes, np.ndarray]:
    """Return genes of motions, and how far they miss each motion.

    Raises InvalidInput if a problem cannot encode motions.
    """
    if not hasattr(problem, "encode"):
        raise InvalidInput("initial must be genes, got motions, which this problem cannot encode")
    genes, deviation = problem.encode(motions)
    return genes, deviation


def violation_words(problem: Any, violation: np.ndarray) -> tuple[str, ...]:
    """Return the constraints that an individual's violations (n_constr,) break, and by how much, the worst first."""
    units = getattr(problem, "constraint_units", ("",) * len(violation))
    return broken_words(_constraint_names(problem, violation), units, violation)


def broken_words(names: Sequence[str], units: Sequence[str], violation: np.ndarray) -> tuple[str, ...]:
    """Return the names of violated constraints with their violations in their units, the worst first."""
    broken = [row for row in np.argsort(-violation, kind="stable") if violation[row] > 0]
    return tuple(f"{names[row]}: violated by {violation[row]:.3g} {units[row]}".rstrip() for row in broken)


def _constraint_names(problem: Any, violation: np.ndarray) -> Sequence[str]:
    return getattr(problem, "constraint_names", [f"constraint {i + 1}" for i in range(len(violation))])


def explain_violation(problem: Any, genes: Genes, violation: np.ndarray) -> tuple[str, str]:
    """Return the limit that an individual (genes (1, n_var)) breaks most, and a sentence."""
    worst = int(np.argmax(violation))
    names = _constraint_names(problem, violation)
    if hasattr(problem, "explain"):
        return names[worst], problem.explain(genes)[0]
    return names[worst], f"{names[worst]} is violated by {violation[worst]:.3g}"


def reweigh(problem: Any, front: Front, preference: Preference) -> Any:
    """Return the formulation to solve again for a preference; None if the front has the answer."""
    return problem.reweigh(front, preference) if hasattr(problem, "reweigh") else None


# Requirements of verbs: other problems are refused by name, before any work.


def require_program(verb: str, problem: Any) -> Differentiable:
    """Return a formulation that has gradients. Raises InvalidInput, naming the verb, for others."""
    timeline(problem)
    if isinstance(problem, type) or not hasattr(problem, "program"):
        raise InvalidInput(
            f"{verb}: the problem must have gradients, such as Tracking, got {type(problem).__name__}, which offers no "
            "program()"
        )
    formulation: Differentiable = problem
    check_names(formulation.names, formulation.units)
    return formulation


def require_plan(problem: Any) -> Callable[..., Plan]:
    """Return how a formulation plans its one objective. Raises InvalidInput for others."""
    names = require_program("plan", problem).names
    if not hasattr(problem, "plan"):
        raise InvalidInput(
            f"plan: problem must be a Tracking, got {type(problem).__name__}; epsilon_front or solve finds its front"
        )
    if len(names) != 1:
        raise InvalidInput(
            f"plan: problem must have one objective, got {len(names)}: {', '.join(names)}; epsilon_front (paretoik "
            "front) finds their front"
        )
    find: Callable[..., Plan] = problem.plan
    return find
