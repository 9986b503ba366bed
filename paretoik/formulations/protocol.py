"""The protocol that formulations offer to the verbs, and what holds where a part of it is missing.

Any pymoo problem with real genes can be solved; each further part that a formulation has makes one more thing possible.
Verbs ask for optional parts through the functions below, which say what holds for a problem without them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, Protocol, TypeAlias

import numpy as np

from paretoik.arrays import Genes
from paretoik.errors import InvalidInput
from paretoik.front.front import Choice, Front, Preference

Timeline: TypeAlias = Literal["generation", "step"]


class Formulation(Protocol):
    """What a formulation can offer; only ``n_var``, ``n_obj`` and a way to evaluate are required.

    Searched as a population (``timeline`` "generation", where it says nothing) it is a pymoo ``Problem`` with
    ``evaluate``; with ``timeline`` "step" it is a loop that is followed sample by sample (``ClosedLoop``).

    ======================================  ============================================================================
    part                                    what it makes possible
    ======================================  ============================================================================
    ``names, units, maximised``             named objectives in the user's own sign; without: f1, f2, ... minimised
    ``constraint_names``                    the limit that binds, by name
    ``fingerprint_parts()``                 a run is recognised as this problem's; without: its bounds
    ``decode(genes)``                       motions of a front
    ``encode(motions)``                     starting from motions: genes, and by how much they miss each motion
    ``explain(genes)``                      why genes are infeasible, in words
    ``task``                                motions of a stored run with their arm
    ``program()``                           refinement and certificates: its nonlinear program
    ``sample_starts(count, rng)``           genes that local solvers start from
    ``species(genes), n_species``           branches: mating within each, anchors for the ends of a front
    ``algorithm(population, ...)``          the pymoo algorithm that suits its genes
    ``reweigh(front, preference)``          a preference that needs a new run: the formulation to solve for it
    ``select(front, preference)``           the choice that comes of this new run
    ======================================  ============================================================================
    """

    n_var: int
    n_obj: int
    names: Sequence[str]
    units: Sequence[str]
    maximised: Sequence[bool]
    timeline: Timeline

    def evaluate(self, genes: Genes) -> Any:
        """Return objectives F, minimised, and constraints G, as pymoo does."""

    def decode(self, genes: Genes) -> Any:
        """Return motions (points, time, dof)."""

    def encode(self, motions: Any) -> tuple[Genes, np.ndarray]:
        """Return genes of motions, and by how much [rad, m] they miss each of them."""

    def explain(self, genes: Genes) -> list[str]:
        """Return for each individual why it is infeasible."""

    def program(self) -> Any:
        """Return the nonlinear program whose points the genes are."""

    def sample_starts(self, count: int, rng: np.random.Generator) -> Genes:
        """Return genes to start from."""

    def fingerprint_parts(self) -> list[object]:
        """Return what makes genes mean what they mean."""

    def reweigh(self, front: Front, preference: Preference) -> Formulation | None:
        """Return the formulation to solve anew for a preference, None where the front has its answer."""

    def select(self, front: Front, preference: Preference) -> Choice:
        """Return the choice, from a new run where it needs one."""


def check_formulation(problem: Any) -> None:
    """Raise InvalidInput unless something has genes and objectives, as pymoo's problems do."""
    if not (hasattr(problem, "n_obj") and hasattr(problem, "n_var")):
        raise InvalidInput(f"problem: a pymoo problem wanted, such as Tracking, got {problem!r}")


def timeline(problem: Any) -> Timeline:
    """Return what a run of a problem counts: the generations of a search, or the steps of a loop."""
    kind: Timeline = getattr(problem, "timeline", "generation")
    return kind


def has_branches(problem: Any) -> bool:
    """Say whether a problem's genes fall into species, so that the ends of its front may lie in different ones."""
    return hasattr(problem, "species")


def decode(problem: Any, genes: Genes) -> Any:
    """Return motions of genes, None where a problem has none."""
    return problem.decode(genes) if hasattr(problem, "decode") else None


def encode(problem: Any, motions: Any) -> tuple[Genes, np.ndarray]:
    """Return genes of motions, and by how much they miss each.

    Raises InvalidInput where a problem cannot encode motions.
    """
    if not hasattr(problem, "encode"):
        raise InvalidInput("initial: wants genes, as this problem cannot encode motions")
    genes, deviation = problem.encode(motions)
    return genes, deviation


def explain_violation(problem: Any, genes: Genes, violation: np.ndarray) -> tuple[str, str]:
    """Return the limit that an individual's genes (1, n_var) and violations (n_constr,) break most, and a sentence."""
    worst = int(np.argmax(violation))
    names = getattr(problem, "constraint_names", tuple(f"constraint {i + 1}" for i in range(len(violation))))
    if hasattr(problem, "explain"):
        return names[worst], problem.explain(genes)[0]
    return names[worst], f"{names[worst]} is violated by {violation[worst]:.3g}"


def restore_motions(problem: Any, front: Front) -> Any:
    """Return the motions of a stored front with their arm: from its joint positions, or else from its genes."""
    if front.motions is None:
        return None
    if hasattr(problem, "task"):
        q, names = np.asarray(front.motions.q), list(front.motions.arm.joint_names)
        task = problem.task.truncate(q.shape[-2])
        if np.allclose(front.motions.time, task.times):  # otherwise motions have times of their own
            return task.motion(q[..., [names.index(name) for name in task.arm.joint_names]])
    decodes = hasattr(problem, "decode") and front.genes is not None
    return problem.decode(np.array(front.genes)) if decodes else front.motions


def reweigh(problem: Any, front: Front, preference: Preference) -> Any:
    """Return the formulation to solve anew for a preference, None where the front has its answer."""
    return problem.reweigh(front, preference) if hasattr(problem, "reweigh") else None
