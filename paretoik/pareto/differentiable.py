"""The protocol between certified fronts and formulations with gradients."""

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
    genes: Genes | None  # None if the formulation has no genes for points
    motions: Any  # a ``Motion``; None if the formulation has no motions for points
    violation_between: Float[ndarray, " points"]  # violation of limits at places that the program does not check
    discretisation: Discretisation | None = None  # errors relative to the motion's curve; None if exact


@runtime_checkable
class Differentiable(Protocol):
    """The part of a formulation that refinement by gradients needs: its program and points."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    maximised: tuple[bool, ...]

    @property
    def tightens(self) -> bool:
        """Whether ``hold_between`` tightens limits; only limits of splines are satisfied between samples."""
        return False

    @property
    def added_samples(self) -> Mapping[str, Any]:
        """Provenance entry with the old and the new number of samples; empty if none were added."""
        return {}

    def program(self, scales: Float[ndarray, " n_obj"] | None = None) -> Program:
        """Return the nonlinear program, its objectives divided by ``scales``."""

    def front_points(self, front: Front) -> Points:
        """Return the points of a front.

        Raises InvalidInput if the front does not contain them.
        """

    def motion_points(self, motions: Any) -> Points:
        """Return the points of motions.

        Raises InvalidInput if the motions do not belong to the problem, or if it has no motions.
        """

    def points(self, genes: Genes) -> Points:
        """Return the points of genes."""

    def genes(self, x: Points) -> Genes:
        """Return the genes of points, or the nearest within their bounds."""

    def individuals(self, x: Points, genes: Genes | None = None) -> Individuals:
        """Return points as individuals; ``genes`` are their genes if known."""

    def exceeded(self, individuals: Individuals) -> list[str]:
        """Return the limit that each individual exceeds between samples, in words; "" if none."""
        return [""] * len(individuals.x)

    def hold_between(
        self,
        x: Points,
        ranges: Float[ndarray, " n_obj"],
        *,
        solver: Solver = "auto",
        observe: Observe | None = None,
    ) -> tuple[Points, Sequence[Program]]:
        """Return optimal points with limits satisfied between samples, and their programs.

        Limits are then satisfied also at places that the programs do not check, unless no program can remove a
        violation. Objectives are divided by ``ranges``; ``observe`` is called with the progress.
        """

    def branches(self, x: Points) -> list[str]:
        """Return the label of each point's branch; points with equal labels may be joined by continuous moves."""

    def cold_search(
        self, *, starts: int | None, seed: int, solver: Solver = "auto", observe: Observe | None = None
    ) -> ColdSearch:
        """Return the search for local optima without initial points.

        ``starts`` is the number of starts, None for the formulation's default. ``observe`` is called with the progress.
        """
