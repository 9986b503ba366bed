"""What a formulation offers to be refined, planned or swept by gradients: its nonlinear program, and what points mean.

A formulation without ``program`` has no gradients; the verbs that need them refuse it before any work.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Genes, Objectives, Points
from paretoik.errors import InvalidInput
from paretoik.front.front import Front
from paretoik.nlp.program import Program, Solver
from paretoik.pareto.epsilon import ColdSearch
from paretoik.task.motion import Motion

OBJECTIVE_TOLERANCE = 1e-6  # relative, and absolute below 1: what genes may miss a point's objectives by


@dataclass(frozen=True, kw_only=True, eq=False)
class Individuals:
    """What points of a program are as solutions of their formulation.

    ``x`` are the points, ``objectives`` minimised, ``genes`` and ``motions`` where the formulation has them for points,
    ``violation_between`` the violation of limits where the program does not look.
    """

    x: Points
    objectives: Objectives
    genes: Genes | None
    motions: Motion | None
    violation_between: Float[np.ndarray, " points"]


@runtime_checkable
class Differentiable(Protocol):
    """The part of a formulation that gradients need."""

    names: Sequence[str]
    units: Sequence[str]
    maximised: Sequence[bool]

    def program(self, scales: Float[np.ndarray, " n_obj"] | None = None) -> Program:
        """Return the nonlinear program, its objectives divided by ``scales``."""

    def front_points(self, front: Front) -> Points:
        """Return the points of a front; raises InvalidInput where it does not hold them."""

    def points(self, genes: Genes) -> Points:
        """Return the points that genes stand for."""

    def genes(self, x: Points) -> Genes:
        """Return the genes of points, or the nearest within their bounds."""

    def individuals(self, x: Points, genes: Genes | None = None) -> Individuals:
        """Return points as individuals; ``genes`` are theirs where they are known."""

    def branches(self, x: Points) -> list[str]:
        """Return a label for each point: those of one branch can be led into each other."""

    def cold_search(self, *, starts: int, seed: int, solver: Solver = "auto") -> ColdSearch:
        """Return how local optima are found from nothing, from so many starts."""

    def sample_starts(self, count: int, rng: np.random.Generator) -> Genes:
        """Return genes to start from."""


def require_program(verb: str, problem: Any) -> Differentiable:
    """Return a formulation that has gradients; raise InvalidInput, naming the verb, for others."""
    if not hasattr(problem, "program"):
        name = type(problem).__name__
        raise InvalidInput(
            f"{verb}: a problem with gradients wanted, such as Tracking, got {name}, which offers no program()"
        )
    formulation: Differentiable = problem
    return formulation


def dense_individuals(problem: Any, x: Points, genes: Genes | None) -> Individuals:
    """Return points of a dense program as individuals.

    What is certified is what is reported: a point whose genes miss its objectives becomes the point of its genes.
    """
    own = problem.genes(x) if genes is None else genes
    F, G = problem.evaluate(own, return_values_of=["F", "G"])
    objectives = np.array([problem.program().evaluate(one)[0] for one in x])
    missed = (np.abs(F - objectives) > OBJECTIVE_TOLERANCE * np.maximum(1.0, np.abs(objectives))).any(axis=1)
    x = np.where(missed[:, None], problem.points(own), x)
    return Individuals(
        x=x,
        objectives=F,
        genes=own,
        motions=problem.decode(own) if hasattr(problem, "decode") else None,
        violation_between=np.maximum(problem.violation_between(own), G.max(axis=1)),
    )


def dense_front_points(problem: Any, front: Front) -> Points:
    """Return the points of a front's genes; raises InvalidInput where it has none."""
    if front.genes is None:
        raise InvalidInput(f"refine: a front of {', '.join(problem.names)} with its genes wanted, got one without")
    return np.asarray(problem.points(np.array(front.genes)))
