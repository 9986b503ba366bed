"""The protocol between formulations and verbs such as ``solve`` and ``refine``.

It has the parts that a problem may offer, and the parts that verbs require.

Any pymoo problem with real genes can be solved. If its ``timeline`` is "step", it is a loop that runs sample by sample
(``ClosedLoop``). Verbs ask a problem for parts; its class does not count. ``ProblemParts`` lists what any problem may
offer, ``pareto.differentiable`` what gradients need. Parts that other packages ask for:

- ``names, units, maximised``: objectives in the user's own sign; default: f1, f2, ... minimised
- ``computed_attributes``: names of attributes that follow from others; fingerprints round them
- ``search_attributes``: names of attributes that describe the search; fingerprints leave them out
- ``sample_starts(count, rng)``: genes that searches and local solvers start from
- ``species(genes), n_species``: branches; individuals mate within one, and objectives are first searched separately
- ``algorithm(population, ...)``: the pymoo algorithm that suits the genes
- ``values_between(front, shares)``: minimised objectives (gaps, shares, n_obj) at shares of the way from each point to
  the next, inf if that is impossible (``front.jumps``)
- ``navigate(front, request)``, ``predict(front, request)``: ``front.navigate``, ``front.refine_around`` and
  ``front.predict``; they need all of ``pareto.differentiable.Differentiable``
- ``select(front, preference)``: the choice from a front of one motion, which may be computed again
- ``plan(...)``: the distinct local optima of one objective
- ``curve_points(motions)``: the points of motions on fewer samples, NaN off the path
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, final

import numpy as np

from paretoik.arrays import Genes, JointPaths
from paretoik.errors import InvalidInput
from paretoik.front.choice import Preference
from paretoik.front.front import Front
from paretoik.front.points import check_names
from paretoik.inputs import user_function

if TYPE_CHECKING:
    from paretoik.pareto.differentiable import Differentiable
    from paretoik.task.motion_task import MotionTask
    from paretoik.trajectory.plan import Plan

Timeline: TypeAlias = Literal["generation", "step", "level", "refinement"]
"""Unit that a run counts: generations of a search, steps of a loop, levels of ε, or a front's refinement."""


@final
class ProblemParts:
    """Parts of a problem that verbs ask for. A part that the problem does not offer has its default."""

    constraint_names: Sequence[str] | None = None  # in the order of violations; None: constraint 1, constraint 2, ...
    constraint_units: Sequence[str] | None = None  # units of violations, written after a number
    task: Any = None  # ``MotionTask`` of the motions, with their arm and limits
    finer_than: Any = None  # the user's problem if refinement added samples to it
    follows_path: object = False  # True if every motion, stored ones included, follows the task's path exactly
    with_midpoints: Callable[[], Any] | None = None  # returns the problem with midpoints as samples
    explain: Callable[[Genes], Sequence[str]] | None = None  # returns a reason for each infeasible individual

    def __init__(self, problem: Any) -> None:
        """Replace defaults by the parts of the problem."""
        names = [name for name in vars(ProblemParts) if not name.startswith("_")]
        vars(self).update({name: getattr(problem, name) for name in names if hasattr(problem, name)})

    def decode(self, genes: Genes) -> Any:
        """Return the motions of genes; None if there are none."""
        return None

    def encode(self, motions: Any) -> tuple[Genes, np.ndarray]:
        """Return genes of motions, and the distances of the decoded motions. Raises InvalidInput if impossible."""
        raise InvalidInput("initial must be genes, got motions, which this problem cannot encode")

    def require_feasible(self) -> None:
        """Raise Infeasible if it is clear that no motion satisfies the limits."""

    def reweigh(self, front: Front, preference: Preference) -> Any:
        """Return the problem to solve again for a preference. None if the front already has the answer."""
        return None


def timeline(problem: Any) -> Timeline:
    """Return what a run counts: generations of a search or steps of a loop.

    Raises InvalidInput if the problem raises when it is asked for an attribute.
    """
    with user_function("problem must be a pymoo problem, got one whose attributes cannot be read: it", InvalidInput):
        kind = getattr(problem, "timeline", None)
    return "step" if isinstance(kind, str) and kind == "step" else "generation"


def is_loop(front: Front) -> bool:
    """Return whether a front is the one motion of a loop."""
    return front.provenance.get("timeline") == "step"


def task_of(problem: Any) -> MotionTask | None:
    """Return the task of a problem's motions; None if it has none."""
    from paretoik.task.motion_task import MotionTask  # imported here so that a problem loads fast

    task = ProblemParts(problem).task
    return task if isinstance(task, MotionTask) else None


def describe(problem: Any) -> str:
    """Return what a problem asks for as text: its own representation, without the call to make next."""
    return repr(problem).partition("\nnext:")[0]


def at_samples_of(problem: Any, q: JointPaths | None) -> Any:
    """Return a problem with as many samples as motions (points, time, dof), by adding midpoints."""
    if q is not None and q.ndim == 3:
        while (finer := ProblemParts(problem).with_midpoints) is not None and len(problem.task.times) < q.shape[1]:
            problem = finer()
    return problem


# Limits that an individual breaks, in words.


def violation_words(problem: Any, violation: np.ndarray) -> tuple[str, ...]:
    """Return an individual's constraint violations (n_constr,) as text, worst first."""
    return broken_words(*_constraints(problem, violation), violation)


def broken_words(names: Sequence[str], units: Sequence[str], violation: np.ndarray) -> tuple[str, ...]:
    """Return violated constraints with names, numbers and units as text, worst first."""
    broken = [row for row in np.argsort(-violation, kind="stable") if violation[row] > 0]
    return tuple(f"{names[row]}: violated by {violation[row]:.3g} {units[row]}".rstrip() for row in broken)


def _constraints(problem: Any, violation: np.ndarray) -> tuple[Sequence[str], Sequence[str]]:
    """Return the names of a problem's constraints, and their violations' units."""
    parts, count = ProblemParts(problem), len(violation)
    names = [f"constraint {i + 1}" for i in range(count)] if parts.constraint_names is None else parts.constraint_names
    return names, ("",) * count if parts.constraint_units is None else parts.constraint_units


def explain_violation(problem: Any, genes: Genes, violation: np.ndarray) -> tuple[str, str]:
    """Return an individual's most violated limit, and a sentence about it.

    ``genes``: genes of the individual (1, n_var)
    """
    worst, explain = int(np.argmax(violation)), ProblemParts(problem).explain
    name = _constraints(problem, violation)[0][worst]
    return name, f"{name} is violated by {violation[worst]:.3g}" if explain is None else explain(genes)[0]


# Requirements of verbs: other problems are refused by name, before any work.


def require_program(verb: str, problem: Any) -> Differentiable:
    """Return a formulation that has gradients. Raises InvalidInput, naming the verb, for other problems."""
    timeline(problem)
    if isinstance(problem, type) or not hasattr(problem, "program"):
        raise InvalidInput(
            f"{verb}: the problem must have gradients, as Tracking has, got {type(problem).__name__} without program()"
        )
    formulation: Differentiable = problem
    check_names(formulation.names, formulation.units)
    return formulation


def require_plan(problem: Any) -> Callable[..., Plan]:
    """Return a formulation's ``plan``. Raises InvalidInput unless it has one, and one objective."""
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
