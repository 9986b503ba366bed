"""A quadratic program solved from a guess of its multipliers: its optimum followed while its data change.

    minimise    ½ dᵀH d + gᵀd
    subject to  c + A d ≥ 0

With gradient Aᵀy and no slack where y > 0 the step d = 0 and the multipliers y ≥ 0 are optimal. From these data to the
true ones the optimum moves in straight pieces; where one ends a constraint is added or dropped. Near the answer there
are few pieces. H has to be positive definite along the active constraints only: where dropping one would leave
negative curvature, the optimum ends, and so does the way. Source: Best 1996, An algorithm for the solution of the
parametric quadratic programming problem; Ferreau, Bock & Diehl 2008.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import sparse
from scipy.linalg.lapack import dgetrf, dgetrs, dsytrf  # by themselves: systems are small


@dataclass(frozen=True, kw_only=True)
class ParametricQpOptions:
    """Tolerances; none has a unit, rows of A being divided by their lengths.

    More than so many ``changes`` of the active set are taken for cycling; after ``updates`` the matrix is factorised
    anew.
    """

    changes: int = 100
    updates: int = 24
    dependent: float = 1e-9  # length of a row across the active ones: what counts as none
    rate: float = 1e-13  # by which a slack or a multiplier falls: less is rounding
    lift: float = 1e-4  # of slacks at the beginning, each by another multiple of it from 1 to 2: ties would cycle
    end: float = 1e-9  # of the way: what is as good as none of it
    curvature: float = 1e-10  # along active constraints, a share of H's largest entry: what counts as none


OPTIONS = ParametricQpOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class QpSolution:
    """The step and the multipliers at the end of the way, the ``share`` of it that was gone, and how many changes.

    A share below 1 says that the optimum ends there: constraints cannot all hold, or curvature becomes negative.
    """

    step: Float[np.ndarray, " columns"]
    multipliers: Float[np.ndarray, " constraints"]
    share: float
    changes: int


def solve_from(
    hessian: Float[np.ndarray, "columns columns"],
    gradient: Float[np.ndarray, " columns"],
    jacobian: sparse.csr_array,
    values: Float[np.ndarray, " constraints"],
    multipliers: Float[np.ndarray, " constraints"],
) -> QpSolution:
    """Return the optimum that is followed from the one that ``multipliers`` belong to.

    The constraints with positive multipliers have to be independent.
    """
    counts = np.diff(jacobian.indptr)
    square = np.bincount(np.repeat(np.arange(len(counts)), counts), jacobian.data**2, minlength=len(counts))
    lengths, scale = np.sqrt(np.maximum(square, 1e-300)), max(float(np.linalg.norm(gradient)), 1e-300)
    unit = jacobian.data / np.repeat(lengths, counts)
    rows = sparse.csr_array((unit, jacobian.indices, jacobian.indptr), shape=jacobian.shape)
    way = _Way(hessian / scale, gradient / scale, rows, values / lengths, multipliers * lengths / scale)
    with suppress(np.linalg.LinAlgError):  # of a bordered system: no one optimum goes on from there
        way.follow()
    return QpSolution(
        step=way.step, multipliers=way.multipliers * scale / lengths, share=way.share, changes=way.changes
    )


class _Way:
    """A way on which the optimum is followed: where it is, and the constraints that are active there."""

    def __init__(
        self, hessian: np.ndarray, gradient: np.ndarray, rows: sparse.csr_array, values: np.ndarray, guess: np.ndarray
    ) -> None:
        self.hessian, self.rows, self.columns = hessian, rows, len(gradient)
        self.active: list[int] = np.flatnonzero(guess > 0).tolist()
        self.multipliers = np.where(guess > 0, guess, 0.0)
        self.step = np.zeros(len(gradient))
        lift = OPTIONS.lift * (1.0 + np.arange(len(values)) * (np.sqrt(5.0) - 1.0) / 2 % 1.0)
        self.slacks = np.maximum(values, 0.0) + lift  # of those that are not active, at the step
        self.slacks[self.active] = 0.0
        self.gradient_rate = gradient - self._dense(self.active).T @ self.multipliers[self.active]
        self.value_rate = values - self.slacks
        self.share, self.changes = 0.0, 0

    def follow(self) -> None:
        """Follow the optimum to the end of the way, or to where it ends."""
        system = _System(self.hessian, self._dense(self.active), self.active)
        if not system.is_regular:
            return
        while self.changes <= OPTIONS.changes:
            if system.updates > OPTIONS.updates:
                system = _System(self.hessian, self._dense(self.active), self.active)
                if not system.is_regular:
                    return
            step_rate, rates = system.solve(-self.gradient_rate, -self.value_rate)
            slack_rates = self.value_rate + self.rows @ step_rate
            slack_rates[self.active] = 0.0
            length, row, dropped = self._next_change(slack_rates, rates)
            self.step += length * step_rate
            self.slacks = np.maximum(self.slacks + length * slack_rates, 0.0)
            self.multipliers[self.active] += length * rates
            self.share += length
            if row is None or self.share > 1.0 - OPTIONS.end:
                self.share = 1.0
                return
            self.changes += 1
            if not (self._drop(system, row) if dropped else self._add(system, row)):
                return

    def _next_change(self, slack_rates: np.ndarray, rates: np.ndarray) -> tuple[float, int | None, bool]:
        """Return how far the piece goes, the constraint at its end, None for the whole way, and if it is dropped."""
        length, row, dropped = 1.0 - self.share, None, False
        falling = np.flatnonzero(slack_rates < -OPTIONS.rate)
        if len(falling):
            lengths = self.slacks[falling] / -slack_rates[falling]
            first = int(np.argmin(lengths))
            if lengths[first] < length:
                length, row = float(lengths[first]), int(falling[first])
        falling = np.flatnonzero(rates < -OPTIONS.rate)
        if len(falling):
            lengths = np.maximum(self.multipliers[self.active][falling], 0.0) / -rates[falling]
            first = int(np.argmin(lengths))
            if lengths[first] < length:
                length, row, dropped = float(lengths[first]), self.active[falling[first]], True
        return length, row, dropped

    def _drop(self, system: _System, row: int) -> bool:
        """Drop an active constraint; return whether the optimum goes on without."""
        if system.multiplier_response(row) >= -OPTIONS.curvature * np.abs(self.hessian).max():
            return False  # no curvature or a negative one is left, by Haynsworth's inertia formula
        self.multipliers[row] = 0.0
        system.drop(row)
        self.active = system.active
        return True

    def _add(self, system: _System, row: int) -> bool:
        """Add a constraint, in place of one that it depends on if it does; return whether they can all hold."""
        normal = self._dense([row])[0]
        across, along = system.response(normal)
        if np.linalg.norm(across) <= OPTIONS.dependent * max(1.0, float(np.abs(along).max(initial=0.0))):
            falling = np.flatnonzero(along > OPTIONS.dependent)
            if not len(falling):
                return False
            current = self.multipliers[self.active]
            lengths = current[falling] / along[falling]
            first = int(np.argmin(lengths))
            self.multipliers[self.active] = np.maximum(current - lengths[first] * along, 0.0)
            self.multipliers[row] = lengths[first]
            leaving = self.active[falling[first]]
            self.multipliers[leaving] = 0.0
            system.exchange(leaving, row, normal)
        else:
            system.add(row, normal)
        self.slacks[row] = 0.0
        self.active = system.active
        return True

    def _dense(self, rows: list[int]) -> np.ndarray:
        dense, pointers = np.zeros((len(rows), self.columns)), self.rows.indptr
        for out, row in zip(dense, rows, strict=True):
            part = slice(pointers[row], pointers[row + 1])
            out[self.rows.indices[part]] += self.rows.data[part]
        return dense


class _System:
    """[[H, Aᵀ], [A, 0]] of the active constraints: factorised once, then bordered as constraints come and go."""

    def __init__(self, hessian: np.ndarray, normals: np.ndarray, rows: list[int]) -> None:
        self.size, self.base = len(hessian), list(rows)
        count = len(rows)
        matrix = np.zeros((self.size + count, self.size + count))
        matrix[: self.size, : self.size] = hessian
        matrix[self.size :, : self.size] = normals
        matrix[: self.size, self.size :] = normals.T
        self._factors, self._pivots, _ = dgetrf(matrix)
        # as many negative eigenvalues as constraints: positive curvature along these (Gould 1985)
        self.is_regular = _negative_eigenvalues(matrix, self.size) == count
        self.added: list[int] = []
        self.dropped: list[int] = []
        self._border = np.zeros((self.size + count, 0))
        self._solved = np.zeros((self.size + count, 0))

    @property
    def updates(self) -> int:
        """Number of borders."""
        return len(self.added) + len(self.dropped)

    @property
    def active(self) -> list[int]:
        """The active constraints: those factorised and not dropped, then those that were added."""
        return [row for row in self.base if row not in self.dropped] + self.added

    def solve(self, right: np.ndarray, below: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return d and y of H d − Aᵀ y = ``right``, A d = ``below`` (of every constraint) on the active ones."""
        top = np.concatenate([right, below[self.base]])
        return self._solve(top, np.concatenate([np.zeros(len(self.dropped)), below[self.added]]))

    def response(self, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return d across the active constraints and y of H d + Aᵀ y = ``normal``, A d = 0."""
        top = np.concatenate([normal, np.zeros(len(self.base))])
        across, along = self._solve(top, np.zeros(self.updates))
        return across, -along

    def multiplier_response(self, row: int) -> float:
        """Return the diagonal entry of the inverse that belongs to an active constraint."""
        top, bottom = np.zeros(self.size + len(self.base)), np.zeros(self.updates)
        if row in self.added:
            bottom[len(self.dropped) + self.added.index(row)] = 1.0
        else:
            top[self.size + self.base.index(row)] = 1.0
        return -float(self._solve(top, bottom)[1][self.active.index(row)])

    def add(self, row: int, normal: np.ndarray) -> None:
        """Add a constraint."""
        if row in self.dropped:
            self._remove_border(self.dropped.index(row))
            self.dropped.remove(row)
            return
        self._insert_border(self.updates, np.concatenate([normal, np.zeros(len(self.base))]))
        self.added.append(row)

    def drop(self, row: int) -> None:
        """Drop a constraint."""
        if row in self.added:
            self._remove_border(len(self.dropped) + self.added.index(row))
            self.added.remove(row)
            return
        unit = np.zeros(self.size + len(self.base))
        unit[self.size + self.base.index(row)] = 1.0
        self._insert_border(len(self.dropped), unit)
        self.dropped.append(row)

    def exchange(self, leaving: int, row: int, normal: np.ndarray) -> None:
        """Put a constraint in the place of another one."""
        self.add(row, normal)
        self.drop(leaving)

    def _base_solve(self, right: np.ndarray) -> np.ndarray:
        return np.asarray(dgetrs(self._factors, self._pivots, right)[0])

    def _insert_border(self, place: int, column: np.ndarray) -> None:
        solved = self._base_solve(column)
        self._border = np.insert(self._border, place, column, axis=1)
        self._solved = np.insert(self._solved, place, solved, axis=1)

    def _remove_border(self, place: int) -> None:
        self._border = np.delete(self._border, place, axis=1)
        self._solved = np.delete(self._solved, place, axis=1)

    def _solve(self, top: np.ndarray, bottom: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return d and −v of the bordered system, v those of the active constraints in their order."""
        z = self._base_solve(top)
        w = np.zeros(self.updates)
        if len(w):
            w = np.linalg.solve(self._border.T @ self._solved, self._border.T @ z - bottom)
            z = z - self._solved @ w
        remaining = [i for i, row in enumerate(self.base) if row not in self.dropped]
        v = np.concatenate([z[self.size :][remaining], w[len(self.dropped) :]])
        return z[: self.size], -v


def _negative_eigenvalues(matrix: np.ndarray, size: int) -> int | None:
    """Return how many eigenvalues of [[H, Aᵀ], [A, 0]] are negative, H of a ``size``; None where one is as good as 0.

    By Sylvester's law those of its Bunch-Kaufman factors, of whose blocks of two each has one; H is scaled to 1 first.
    """
    scaled = matrix.copy()
    scaled[:size, :size] /= max(float(np.abs(matrix[:size, :size]).max()), 1e-300)
    factors, pivots, _ = dsytrf(scaled)
    single = np.diagonal(factors)[pivots > 0]
    if not np.isfinite(factors).all() or (np.abs(single) <= OPTIONS.curvature).any():
        return None
    return int(np.count_nonzero(single < 0.0)) + int(np.count_nonzero(pivots < 0)) // 2
