"""What verbs require of a problem: others are refused by name, before any work."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import Differentiable, timeline
from paretoik.front.names import check_names

if TYPE_CHECKING:
    from paretoik.trajectory.plan import Plan


def require_program(verb: str, problem: Any) -> Differentiable:
    """Return a formulation that has gradients; raise InvalidInput, naming the verb, for others."""
    timeline(problem)
    if isinstance(problem, type) or not hasattr(problem, "program"):
        raise InvalidInput(
            f"{verb}: a problem with gradients wanted, such as Tracking, got {type(problem).__name__}, which offers no "
            "program()"
        )
    formulation: Differentiable = problem
    check_names(formulation.names, formulation.units)
    return formulation


def require_plan(problem: Any) -> Callable[..., Plan]:
    """Return how a formulation plans its one objective; raise InvalidInput for others."""
    names = require_program("plan", problem).names
    if not hasattr(problem, "plan"):
        raise InvalidInput(
            f"plan: a Tracking wanted, got {type(problem).__name__}; epsilon_front or solve finds its front"
        )
    if len(names) != 1:
        raise InvalidInput(
            f"plan: one objective wanted, got {len(names)}: {', '.join(names)}; epsilon_front (paretoik front) finds "
            "their front"
        )
    find: Callable[..., Plan] = problem.plan
    return find
