"""Fronts of small smooth programs: every point polished and certified, as those of motions are.

A formulation writes its program once, with its objectives among the unknowns; see ``SmoothProblem``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from paretoik.errors import EvaluationFailed, SolverFailed
from paretoik.front.certificates import Certificates
from paretoik.nlp.criticality import Criticality, criticality
from paretoik.nlp.dense_sqp import Caps, Local, Minimum, local, minimised
from paretoik.nlp.interior_point import minimise_dense
from paretoik.nlp.traced import Rows
from paretoik.pareto.exchange_rates import ACTIVE, COUNTS, exchange_intervals, exchange_rates, weight_ratios

CURVED = 1e-7  # second derivative along a direction of length one, in ranges, below which it is taken for none
CRITICAL = 1e-6  # χ up to which a point counts as critical, so that its curvature says something
HELD = 1e-8  # violation of a row up to which a point counts
SETTLED = 1e-8  # χ up to which polishing leaves a point as it is
BESIDE = 0.1  # of the sum of all objectives: so much each counts at least
BRIEF = 10  # iterations of a step back onto all rows
STEPS = (1e-2, 1e-3, 1e-4)  # along a direction of descent


@dataclass(frozen=True, kw_only=True, eq=False)
class Sketch:
    """A program and its objectives: rows of ``costs`` times the unknowns, less being better."""

    program: Rows
    costs: Float[np.ndarray, "n_obj unknowns"]


@runtime_checkable
class SmoothProblem(Protocol):
    """A pymoo problem whose individuals are points of a smooth program."""

    names: Sequence[str]
    units: Sequence[str]
    maximised: Sequence[bool]

    def sketch(self) -> Sketch:
        """Return the program."""

    def candidates(self, count: int, rng: np.random.Generator) -> Float[np.ndarray, "points genes"]:
        """Return genes to start from."""

    def unknowns(self, genes: Float[np.ndarray, "points genes"]) -> Float[np.ndarray, "points unknowns"]:
        """Return the unknowns of genes."""

    def genes_of(self, z: Float[np.ndarray, "points unknowns"]) -> Float[np.ndarray, "points genes"]:
        """Return the genes of unknowns, whose objectives are those of the program."""

    def between(self, genes: Float[np.ndarray, "points genes"]) -> Float[np.ndarray, " points"]:
        """Return the violation (points,) of limits where the program does not look, 0 where it looks everywhere."""


def least(
    sketch: Sketch, cost: Float[np.ndarray, " unknowns"], z: Float[np.ndarray, " unknowns"], caps: Caps | None = None
) -> Minimum | None:
    """Return the local minimum of a cost below caps that interior points lead to; None where they lead to none."""
    try:
        end = minimise_dense(sketch.program, cost, z, caps=caps)
    except (EvaluationFailed, SolverFailed):
        return None
    return end if end.converged and end.violation <= HELD else None


def quadratic(
    sketch: Sketch,
    cost: Float[np.ndarray, " unknowns"],
    z: Float[np.ndarray, " unknowns"],
    caps: Caps,
    *,
    iterations: int = 200,
) -> Minimum | None:
    """Return the same by quadratic programs, which stay nearer; it need not have converged."""
    try:
        end = minimised(sketch.program, cost, z, caps=caps, iterations=iterations)
    except (EvaluationFailed, SolverFailed):
        return None
    return end if end.violation <= HELD else None


def polished(
    sketch: Sketch,
    z: Float[np.ndarray, "points unknowns"],
    ranges: Float[np.ndarray, " n_obj"],
    observe: Callable[[int, int], object] | None = None,
) -> tuple[Float[np.ndarray, "points unknowns"], np.ndarray]:
    """Return points no worse in any objective, and which of them (points,) a search ended well for.

    The first objective over its range is minimised, every other to gain as much: each point goes straight ahead, and
    none to where its neighbours go (Pascoletti & Serafini 1984); some of the sum of all leaves no gain that costs
    next to nothing. By interior points; where these lead nowhere, quadratic programs minimise the sum, none allowed to
    rise. Points that are critical stay. ``observe`` is called with points done and wanted; where it returns true, the
    others stay.
    """
    found, good = z.copy(), np.zeros(len(z), dtype=bool)
    shares = sketch.costs / ranges[:, None]
    rows, total = np.vstack([shares[:1], shares[1:] - shares[0]]), shares.sum(axis=0)
    for i, one in enumerate(z):
        if _settled(sketch, one, ranges):
            good[i] = True
        else:
            end = least(sketch, shares[0] + BESIDE * total, one, Caps(rows=rows, most=rows @ one))
            if end is None:
                end = quadratic(sketch, total, one, Caps(rows=shares, most=shares @ one))
            good[i] = end is not None and end.converged
            if end is not None:
                found[i] = end.z
        if observe is not None and observe(i + 1, len(z)):
            break
    return found, good


def certified(
    sketch: Sketch,
    z: Float[np.ndarray, "points unknowns"],
    ranges: Float[np.ndarray, " n_obj"],
    signs: Float[np.ndarray, " n_obj"],
    between: Float[np.ndarray, " points"],
) -> Certificates:
    """Return the certificates of points; ``between`` is their violation where the program does not look.

    As for motions; directions are measured in the program's own scale.
    """
    every = [_certified(sketch, one, ranges) for one in z]
    n_obj = len(ranges)
    weights = np.array([found.weights for _, found, *_ in every]).reshape(len(z), n_obj)
    ratios = np.array([ratio for *_, ratio in every]).reshape(len(z), n_obj, n_obj, 2)
    violation = np.array([at.violation for at, *_ in every])
    return Certificates(
        violation=violation,
        violation_between=np.maximum(violation, between),
        kkt_residual=np.array([found.value for _, found, *_ in every]),
        weights=weights,
        exchange_rates=exchange_rates(weights, ranges, signs),
        exchange_intervals=exchange_intervals(ratios, ranges, signs),
        status=np.array([status for _, _, status, _ in every], dtype=np.str_),
    )


def _settled(sketch: Sketch, z: np.ndarray, ranges: np.ndarray) -> bool:
    try:
        at = local(sketch.program, z)
    except (EvaluationFailed, SolverFailed):
        return False
    return at.violation <= HELD and _critical(sketch, at, ranges).value <= SETTLED


def _certified(sketch: Sketch, z: np.ndarray, ranges: np.ndarray) -> tuple[Local, Criticality, str, np.ndarray]:
    at = local(sketch.program, z)
    gradients, constraints = sketch.costs @ at.basis / ranges[:, None], at.constraints(at.room)
    found = _critical(sketch, at, ranges)
    status = _status(sketch, at, found, gradients, ranges) if found.value <= CRITICAL else "undetermined"
    return at, found, status, weight_ratios(gradients, constraints, found.weights)


def _critical(sketch: Sketch, at: Local, ranges: np.ndarray) -> Criticality:
    return criticality(sketch.costs @ at.basis / ranges[:, None], at.constraints(at.room), 1.0)


def _status(sketch: Sketch, at: Local, found: Criticality, gradients: np.ndarray, ranges: np.ndarray) -> str:
    """Return whether the curvature on the critical cone says minimum or saddle."""
    slopes = at.slopes @ at.basis
    strong, counts = found.multipliers > COUNTS, found.weights >= COUNTS
    weak = ~strong & (at.room <= ACTIVE)
    pulls = -at.back.T @ ((sketch.costs / ranges[:, None]).T @ found.weights - at.slopes.T @ found.multipliers)
    table = at.basis.T @ sketch.program.curvature(at.z, np.concatenate([pulls, -found.multipliers])) @ at.basis
    held = np.concatenate([gradients[counts], slopes[strong]])
    held = held / np.maximum(np.linalg.norm(held, axis=1, keepdims=True), 1e-300)
    _, sizes, rows = np.linalg.svd(held)
    free = rows[np.count_nonzero(sizes > 1e-9 * sizes.max(initial=0.0)) :].T
    values, vectors = np.linalg.eigh(free.T @ table @ free)
    if not len(values) or values[0] >= -CURVED:
        return "minimum"
    direction = free @ vectors[:, 0]
    for sign in (1.0, -1.0):
        fits = np.all(slopes[weak] @ (sign * direction) >= -1e-9)
        if (
            fits
            and np.all(gradients[~counts] @ (sign * direction) <= 1e-9)
            and _dominated(sketch, at, sign * direction)
        ):
            return "saddle"
    return "undetermined"


def _dominated(sketch: Sketch, at: Local, direction: np.ndarray) -> bool:
    """Return whether a step along a direction, led back onto all rows, is better in every objective."""
    values = sketch.costs @ at.z
    for length in STEPS:
        aim = at.z + length * (at.basis @ direction)
        end: Any = minimised(
            sketch.program,
            sketch.costs.sum(axis=0),
            aim,
            caps=Caps(rows=sketch.costs, most=values),
            radius=length,
            iterations=BRIEF,
        )
        if end.violation <= HELD and np.all(sketch.costs @ end.z < values):
            return True
    return False
