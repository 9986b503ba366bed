"""The protocol between certified fronts and formulations: what gradients need of a problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from jaxtyping import Float
from numpy import ndarray

from paretoik.arrays import Genes, Objectives, Points
from paretoik.front.front import Front
from paretoik.nlp.program import Program, Solver
from paretoik.pareto.certificates import Discretisation
from paretoik.pareto.scalarisation import ColdSearch, Observe


@dataclass(frozen=True, kw_only=True, eq=False)
class Individuals:
    """Points of a program as solutions of their formulation."""

    x: Points
    objectives: Objectives  # minimised
    genes: Genes | None  # None if the formulation has none for points
    motions: Any  # a ``Motion``; None if the formulation has none for points
    violation_between: Float[ndarray, " points"]  # of limits at places that the program does not check
    discretisation: Discretisation | None = None  # distance of objectives from those of a curve; None: exact


@runtime_checkable
class Differentiable(Protocol):
    """The part of a formulation that gradients need: its nonlinear program, and the meaning of its points."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    maximised: tuple[bool, ...]

    @property
    def tightens(self) -> bool:
        """Whether ``hold_between`` tightens limits; only splines promise limits between samples."""
        return False

    @property
    def added_samples(self) -> Mapping[str, Any]:
        """Provenance entry with the old and new numbers of samples, if refinement added some."""
        return {}

    def program(self, scales: Float[ndarray, " n_obj"] | None = None) -> Program:
        """Return the nonlinear program, its objectives divided by ``scales``."""

    def front_points(self, front: Front) -> Points:
        """Return the points of a front. Raises InvalidInput if the front does not contain them."""

    def motion_points(self, motions: Any) -> Points:
        """Return the points of motions. Raises InvalidInput if they are not of the problem, or it has none."""

    def points(self, genes: Genes) -> Points:
        """Return the points of genes."""

    def genes(self, x: Points) -> Genes:
        """Return the genes of points, or the nearest within their bounds."""

    def individuals(self, x: Points, genes: Genes | None = None) -> Individuals:
        """Return points as individuals; ``genes`` are their genes if known."""

    def exceeded(self, individuals: Individuals) -> list[str]:
        """Return for each individual the limits that it exceeds between samples in words, "" if it exceeds none."""
        return [""] * len(individuals.x)

    def hold_between(
        self,
        x: Points,
        ranges: Float[ndarray, " n_obj"],
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
