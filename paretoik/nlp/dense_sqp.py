"""Sequential quadratic programming for small smooth programs: a linear cost, equalities and inequalities.

A step back to the equalities, of least length, and one along them that a convex model by Clarabel decides on: exact
second derivatives of the Lagrangian, made positive where they are not, and inequalities that give way at a price. A
merit function of the true values accepts it; where it fails for curvature alone, the step is bent to follow it.
Source: Nocedal & Wright, Numerical Optimization, chapters 15.3 and 18.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.errors import EvaluationFailed, SolverFailed
from paretoik.nlp.conic import Constraints
from paretoik.nlp.criticality import criticality
from paretoik.nlp.subproblem import Step, solve_subproblem
from paretoik.nlp.traced import Rows

PRICE, DEAREST = 10.0, 1e6  # of a violation, beside a cost of length one
ACCEPTED, GOOD = 1e-4, 0.75  # of the promised gain
SHORTEST = 1e-11
SETTLED = 1e-13  # promised gain that is none
KEPT = 1e-9  # violation that counts as none
FLAT = 1e-8  # of the largest: a second derivative at least this is what the model has
ASTRAY = 1e-2  # violation that no step should lead to
STIFF, COUNTS = 10.0, 1e-6  # of the largest second derivative, across limits whose multiplier is so much of the largest
CORRECTIONS = 3  # of a step for the limits' curvature
BACK = 6  # steps back to the equalities with one Jacobian


@dataclass(frozen=True, kw_only=True, eq=False)
class Caps:
    """Linear functions of the unknowns that may not exceed what they are given: rows · z ≤ most."""

    rows: Float[np.ndarray, "caps unknowns"]
    most: Float[np.ndarray, " caps"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Minimum:
    """Where a search ended: unknowns, multipliers of inequalities and caps, the worst violation of any row.

    ``converged`` where no model promised more.
    """

    z: Float[np.ndarray, " unknowns"]
    limits: Float[np.ndarray, " inequalities"]
    violation: float
    converged: bool
    iterations: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Local:
    """A program to first order about a place, along its equalities: z + ``basis`` · y."""

    z: Float[np.ndarray, " unknowns"]
    equal: Float[np.ndarray, " equalities"]
    room: Float[np.ndarray, " inequalities"]
    slopes: Float[np.ndarray, "inequalities unknowns"]
    basis: Float[np.ndarray, "unknowns freedoms"]
    back: Float[np.ndarray, "unknowns equalities"]

    @property
    def violation(self) -> float:
        """The worst violation of any row."""
        return _violation(self.equal, self.room)

    def constraints(self, room: Float[np.ndarray, " inequalities"]) -> Constraints:
        """Return the inequalities along the equalities, with what ``room`` they have."""
        return Constraints(
            unknowns=self.basis.shape[1], values=room, jacobian=sparse.csr_array(self.slopes @ self.basis)
        )


def local(program: Rows, z: Float[np.ndarray, " unknowns"], caps: Caps | None = None) -> Local:
    """Return the program to first order; caps come after its own inequalities.

    Raises EvaluationFailed where a row or a slope is not finite, or too few unknowns move the equalities.
    """
    (equal, room), table = rows_of(program, z, caps), slopes_of(program, z, caps)
    if not (np.isfinite(equal).all() and np.isfinite(room).all() and np.isfinite(table).all()):
        raise EvaluationFailed("program: finite rows and slopes wanted, got others")
    rows = len(equal)
    held = table[:rows].any(axis=0)  # all others are free, and stay what they are
    if np.count_nonzero(held) < rows:
        raise EvaluationFailed(
            f"program: {rows} unknowns that move its equalities wanted, got {np.count_nonzero(held)}"
        )
    turned, upper = np.linalg.qr(table[:rows, held].T, mode="complete")
    basis, back = np.zeros((len(z), len(z) - rows)), np.zeros((len(z), rows))
    free = np.count_nonzero(held) - rows
    basis[held, :free] = turned[:, rows:]
    basis[~held, free:] = np.eye(int(np.count_nonzero(~held)))
    back[held] = np.linalg.lstsq(upper[:rows], turned[:, :rows].T, rcond=None)[0].T
    return Local(z=z, equal=equal, room=room, slopes=table[rows:], basis=basis, back=back)


def minimised(
    program: Rows,
    cost: Float[np.ndarray, " unknowns"],
    z: Float[np.ndarray, " unknowns"],
    *,
    caps: Caps | None = None,
    radius: float = 0.1,
    iterations: int = 200,
) -> Minimum:
    """Return a local minimum of cost · z below caps, from a place that is near the equalities.

    Raises EvaluationFailed where the program is not finite.
    """
    longest, worth = radius, float(np.linalg.norm(cost))
    at, price, converged, done = local(program, z, caps), PRICE * worth, False, 0
    limits = np.zeros(len(at.room))
    while done < iterations:
        done += 1
        bent = _bent(program, at, caps, cost, limits)
        found, radius = _stepped(program, at, caps, cost, bent, price, radius)
        if found is not None:
            limits = found.model.multipliers
            if found.gained >= GOOD * found.promised and found.moved > 0.9 * radius:
                radius = min(2.0 * radius, 4.0 * longest)
            at = local(program, found.z, caps)
            if at.violation > ASTRAY:  # the price is too low to come back by
                price *= 10.0
        elif at.violation > KEPT and price < DEAREST * worth:
            price, radius = 10.0 * price, longest
        else:
            converged = at.violation <= KEPT and (radius > SHORTEST or _critical(at, at.basis.T @ cost))
            break
    return Minimum(z=at.z, limits=limits, violation=at.violation, converged=converged, iterations=done)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Step:
    """A step that is taken: where it leads, its model, and what was promised and gained."""

    z: Float[np.ndarray, " unknowns"]
    model: Step
    promised: float
    gained: float

    @property
    def moved(self) -> float:
        return float(np.abs(self.model.step).max(initial=0.0))


def _stepped(
    program: Rows, at: Local, caps: Caps | None, cost: np.ndarray, bent: np.ndarray, price: float, radius: float
) -> tuple[_Step | None, float]:
    """Return the first step, of ever shorter ones, that keeps its promise, None where none promises; and the radius."""
    gradient, before = at.basis.T @ cost, float(cost @ at.z) + price * at.violation
    while radius > SHORTEST:
        model = _asked(gradient, bent, at.constraints(at.room), radius, price)
        if model is None:
            radius /= 4
            continue
        linear = float(gradient @ model.step + 0.5 * model.step @ bent @ model.step)
        promised = price * (at.violation - model.violation) - linear
        if promised <= SETTLED * (1.0 + abs(before)):
            break
        z, gained = _tried(program, at, caps, cost, price, model, before)
        last, led = model, z
        for _ in range(CORRECTIONS):
            if gained >= GOOD * promised or not np.isfinite(led).all():
                break
            room = rows_of(program, led, caps)[1] - at.slopes @ at.basis @ last.step
            again = _asked(gradient, bent, at.constraints(room), radius, price)
            if again is None:
                break
            led, more = _tried(program, at, caps, cost, price, again, before)
            last = again
            z, gained = (led, more) if more > gained else (z, gained)
        found = _Step(z=z, model=model, promised=promised, gained=gained)
        if gained >= ACCEPTED * promised:
            return found, radius
        radius = min(radius, found.moved) / 4
    return None, radius


def _tried(
    program: Rows, at: Local, caps: Caps | None, cost: np.ndarray, price: float, model: Step, before: float
) -> tuple[np.ndarray, float]:
    """Return where a step leads, back on the equalities, and what is gained."""
    z = at.z + at.basis @ model.step
    for _ in range(BACK):
        equal = program.rows(z)[0]
        if not np.isfinite(equal).all() or float(np.abs(equal).max(initial=0.0)) < SETTLED:
            break
        z = z - at.back @ equal
    worth = float(cost @ z) + price * _violation(*rows_of(program, z, caps)) if np.isfinite(z).all() else np.inf
    return z, before - worth if np.isfinite(worth) else -np.inf


def rows_of(program: Rows, z: np.ndarray, caps: Caps | None) -> tuple[np.ndarray, np.ndarray]:
    """Return equalities and inequalities, caps the last of them."""
    equal, room = program.rows(z)
    return equal, room if caps is None else np.append(room, caps.most - caps.rows @ z)


def slopes_of(program: Rows, z: np.ndarray, caps: Caps | None) -> Float[np.ndarray, "rows unknowns"]:
    """Return the Jacobian of the same rows."""
    table = program.jacobian(z)
    return table if caps is None else np.concatenate([table, -caps.rows])


def _violation(equal: np.ndarray, room: np.ndarray) -> float:
    return max(0.0, float(np.abs(equal).max(initial=0.0)), -float(room.min(initial=0.0)))


def _bent(program: Rows, at: Local, caps: Caps | None, cost: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Return the second derivatives of the Lagrangian along the equalities, made positive."""
    capped = 0 if caps is None else len(caps.most)
    pulls = -at.back.T @ (cost - at.slopes.T @ limits)
    table = at.basis.T @ program.curvature(at.z, np.concatenate([pulls, -limits[: len(limits) - capped]])) @ at.basis
    held = at.slopes[limits > 0.0] @ at.basis
    held = held / np.maximum(np.linalg.norm(held, axis=1, keepdims=True), 1e-300)
    size = max(float(np.abs(np.linalg.eigvalsh(table)).max(initial=0.0)), 1e-8)
    strong = limits[limits > 0.0] > COUNTS * limits.max(initial=0.0)
    table = table + STIFF * size * held[strong].T @ held[strong]
    values, vectors = np.linalg.eigh(table)
    bent: np.ndarray = (vectors * np.maximum(values, FLAT * size)) @ vectors.T
    return bent


def _asked(
    gradient: np.ndarray, bent: np.ndarray, constraints: Constraints, radius: float, price: float
) -> Step | None:
    try:
        return solve_subproblem(
            gradient, sparse.csr_array(bent), constraints, elastic=len(constraints.values), radius=radius, penalty=price
        )
    except SolverFailed:
        return None


def _critical(at: Local, gradient: np.ndarray) -> bool:
    return criticality(gradient[None], at.constraints(at.room), 1.0).value <= 1e-6 * float(np.linalg.norm(gradient))
