"""Small smooth programs, solved by sequential quadratic programming: a linear cost, equalities and inequalities.

A step back to the equalities, of least length, and one along them that a convex model by Clarabel decides on: exact
second derivatives of the Lagrangian, made positive where they are not, and inequalities that give way at a price. A
merit function of the true values accepts it; where it fails for curvature alone, the step is bent to follow it.
Source: Nocedal & Wright, Numerical Optimization, chapters 15.3 and 18.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.calculus.differentiation import gradient, hessian
from paretoik.calculus.expressions import Expression, Tape, entry
from paretoik.calculus.machine import Program, program
from paretoik.convex.criticality import criticality
from paretoik.convex.models import Constraints
from paretoik.convex.stepping import Step, step
from paretoik.errors import EvaluationFailed

PRICE, DEAREST = 10.0, 1e6  # of a violation, beside a cost of length one
ACCEPTED, GOOD = 1e-4, 0.75  # of the promised gain
SHORTEST = 1e-11
SETTLED = 1e-13  # promised gain that is none
KEPT = 1e-9  # violation that counts as none
FLAT = 1e-8  # of the largest: a second derivative at least this is what the model has
ASTRAY = 1e-2  # violation that no step should lead to
STIFF, COUNTS = 10.0, 1e-6  # of the largest second derivative, across limits whose multiplier is so much of the largest
BACK = 6  # steps back to the equalities with one Jacobian


@runtime_checkable
class Rows(Protocol):
    """Rows that must be 0 and rows that must not be negative, with derivatives, of unknowns of the order of 1."""

    def rows(self, z: Float[np.ndarray, " unknowns"]) -> tuple[np.ndarray, np.ndarray]:
        """Return both kinds of rows."""

    def jacobian(self, z: Float[np.ndarray, " unknowns"]) -> Float[np.ndarray, "rows unknowns"]:
        """Return the first derivatives of all rows, equalities first."""

    def curvature(self, z: Float[np.ndarray, " unknowns"], weights: Float[np.ndarray, " rows"]) -> np.ndarray:
        """Return the second derivatives of weights · rows, (unknowns, unknowns)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Smooth:
    """Rows that must be 0 and rows that must not be negative, of unknowns and parameters; made with ``smooth``.

    ``values`` computes both kinds, one below the other, ``first`` their Jacobian's entries at ``places``, ``second``,
    of weights too, those of the second derivatives of their weighted sum at ``bends``.
    """

    equalities: int
    inequalities: int
    parameters: Float[np.ndarray, " parameters"]
    values: Program
    first: Program
    second: Program
    places: tuple[np.ndarray, np.ndarray]
    bends: tuple[np.ndarray, np.ndarray]

    def rows(self, z: Float[np.ndarray, " unknowns"]) -> tuple[np.ndarray, np.ndarray]:
        """Return both kinds of rows."""
        found = self.values(self._given(z, np.zeros(self.equalities + self.inequalities)))[:, 0]
        return found[: self.equalities], found[self.equalities :]

    def jacobian(self, z: Float[np.ndarray, " unknowns"]) -> Float[np.ndarray, "rows unknowns"]:
        """Return the first derivatives of all rows, equalities first."""
        found = np.zeros((self.equalities + self.inequalities, len(z)))
        found[self.places] = self.first(self._given(z, np.zeros(len(found))))[:, 0]
        return found

    def curvature(self, z: Float[np.ndarray, " unknowns"], weights: Float[np.ndarray, " rows"]) -> np.ndarray:
        """Return the second derivatives of weights · rows, (unknowns, unknowns)."""
        found = np.zeros((len(z), len(z)))
        found[self.bends] = self.second(self._given(z, weights))[:, 0]
        return found + np.tril(found, -1).T

    def _given(self, z: np.ndarray, weights: np.ndarray) -> np.ndarray:
        return np.concatenate([z, self.parameters, weights])[:, None]


Written = Callable[[list[Any], list[Any]], tuple[list[Any], list[Any]]]


def smooth(unknowns: int, parameters: int, written: Written) -> Smooth:
    """Write down a program once, for all parameters: ``written`` of both lists gives equalities and inequalities."""
    tape = Tape()
    z, known = [tape.input() for _ in range(unknowns)], [tape.input() for _ in range(parameters)]
    equal, room = written(z, known)
    variables, rows = [entry(tape, one) for one in z], [entry(tape, one) for one in (*equal, *room)]
    slopes = {
        (i, j): value
        for i, row in enumerate(rows)
        for j, value in enumerate(gradient(tape, row, variables))
        if value != tape.constant(0.0)
    }
    weighed: Any = 0.0
    for row in rows:
        weighed = weighed + tape.input() * Expression(tape, row)
    second = hessian(tape, entry(tape, weighed), variables)
    return Smooth(
        equalities=len(equal),
        inequalities=len(room),
        parameters=np.zeros(parameters),
        values=program(tape, rows),
        first=program(tape, list(slopes.values())),
        second=program(tape, list(second.values())),
        places=_places(slopes),
        bends=_places(second),
    )


def _places(table: Iterable[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray]:
    row, column = np.array(list(table), dtype=int).reshape(-1, 2).T
    return row, column


@dataclass(frozen=True, kw_only=True, eq=False)
class Caps:
    """Linear functions of the unknowns that may not exceed what they are given: rows · z ≤ most."""

    rows: Float[np.ndarray, "caps unknowns"]
    most: Float[np.ndarray, " caps"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Minimum:
    """Where a search ended: the unknowns, the worst violation of any row, and whether no model promised more."""

    z: Float[np.ndarray, " unknowns"]
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
        return Constraints(unknowns=self.basis.shape[1], gaps=room, slopes=sparse.csr_array(self.slopes @ self.basis))


def local(program: Rows, z: Float[np.ndarray, " unknowns"], caps: Caps | None = None) -> Local:
    """Return the program to first order; caps come after its own inequalities."""
    (equal, room), table = _rows(program, z, caps), program.jacobian(z)
    rows = len(equal)
    slopes = table[rows:] if caps is None else np.concatenate([table[rows:], -caps.rows])
    held = table[:rows].any(axis=0)  # all others are free, and stay what they are
    turned, upper = np.linalg.qr(table[:rows, held].T, mode="complete")
    basis, back = np.zeros((len(z), len(z) - rows)), np.zeros((len(z), rows))
    free = np.count_nonzero(held) - rows
    basis[held, :free] = turned[:, rows:]
    basis[~held, free:] = np.eye(int(np.count_nonzero(~held)))
    back[held] = np.linalg.lstsq(upper[:rows], turned[:, :rows].T, rcond=None)[0].T
    return Local(z=z, equal=equal, room=room, slopes=slopes, basis=basis, back=back)


def minimised(
    program: Rows,
    cost: Float[np.ndarray, " unknowns"],
    z: Float[np.ndarray, " unknowns"],
    *,
    caps: Caps | None = None,
    radius: float = 0.1,
    iterations: int = 200,
) -> Minimum:
    """Return a local minimum of cost · z below caps, from a place that is near the equalities."""
    at, price, taken, longest = local(program, z, caps), PRICE * float(np.linalg.norm(cost)), None, radius
    converged, done = False, 0
    while done < iterations:
        done += 1
        gradient = at.basis.T @ cost
        bent = _bent(program, at, caps, cost, taken)
        trial, accepted = None, False
        while radius > SHORTEST:
            model = _asked(gradient, bent, at.constraints(at.room), radius, price)
            if model is None:
                radius /= 4
                continue
            before = float(cost @ at.z) + price * at.violation
            promised = price * (at.violation - model.violation) - float(
                gradient @ model.step + 0.5 * model.step @ bent @ model.step
            )
            moved = float(np.abs(model.step).max(initial=0.0))
            if promised <= SETTLED * (1.0 + abs(before)):
                break
            trial, gained = _tried(program, at, caps, cost, price, model, before)
            if gained < GOOD * promised:
                room = _rows(program, trial, caps)[1] - at.slopes @ at.basis @ model.step
                again = _asked(gradient, bent, at.constraints(room), radius, price)
                if again is not None:
                    other, more = _tried(program, at, caps, cost, price, again, before)
                    if more > gained:
                        trial, gained = other, more
            accepted = gained >= ACCEPTED * promised
            if accepted:
                taken = model
                break
            radius = min(radius, moved) / 4
        if accepted:
            assert trial is not None
            if gained >= GOOD * promised and moved > 0.9 * radius:
                radius = min(2.0 * radius, 4.0 * longest)
            at = local(program, trial, caps)
            if at.violation > ASTRAY:  # the price is too low to come back by
                price *= 10.0
            continue
        if at.violation > KEPT and price < DEAREST * float(np.linalg.norm(cost)):
            price, radius = 10.0 * price, longest
            continue
        converged = at.violation <= KEPT and (radius > SHORTEST or _critical(at, gradient))
        break
    return Minimum(z=at.z, violation=at.violation, converged=converged, iterations=done)


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
    worth = float(cost @ z) + price * _violation(*_rows(program, z, caps)) if np.isfinite(z).all() else np.inf
    return z, before - worth if np.isfinite(worth) else -np.inf


def _rows(program: Rows, z: np.ndarray, caps: Caps | None) -> tuple[np.ndarray, np.ndarray]:
    equal, room = program.rows(z)
    return equal, room if caps is None else np.append(room, caps.most - caps.rows @ z)


def _violation(equal: np.ndarray, room: np.ndarray) -> float:
    return max(0.0, float(np.abs(equal).max(initial=0.0)), -float(room.min(initial=0.0)))


def _bent(program: Rows, at: Local, caps: Caps | None, cost: np.ndarray, taken: Step | None) -> np.ndarray:
    """Return the second derivatives of the Lagrangian along the equalities, made positive."""
    limits = np.zeros(len(at.room)) if taken is None else taken.limits
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
        return step(
            gradient, sparse.csr_array(bent), constraints, yielding=len(constraints.gaps), radius=radius, price=price
        )
    except EvaluationFailed:
        return None


def _critical(at: Local, gradient: np.ndarray) -> bool:
    return criticality(gradient[None], at.constraints(at.room), 1.0).value <= 1e-6 * float(np.linalg.norm(gradient))
