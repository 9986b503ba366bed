"""A motion's program at one motion: values and derivatives by steps in the self-motion, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.refinement.program import MotionProgram


@dataclass(frozen=True, kw_only=True, eq=False)
class Linearised:
    """Sums, gaps of all limits (positive where they hold), and how both change with the unknowns.

    ``normal`` (time, dof, redundancy) spans the null space of the tasks' Jacobian: sample s moves by normal[s] times
    its own unknowns. ``jacobian`` is that of the path equations.
    """

    program: MotionProgram
    q: Float[np.ndarray, "time dof"]
    inputs: Float[np.ndarray, "inputs time"]
    normal: Float[np.ndarray, "time dof redundancy"]
    jacobian: Float[np.ndarray, "time rows dof"]
    sums: Float[np.ndarray, " sums"]
    gradients: Float[np.ndarray, "sums unknowns"]
    of_positions: Float[np.ndarray, "sums time dof"]
    gaps: Float[np.ndarray, " limits"]
    slopes: sparse.csr_array
    limits_by_u: Float[np.ndarray, "limits variables"]

    @property
    def unknowns(self) -> int:
        """Number of unknowns."""
        return self.gradients.shape[1]

    def displacement(self, step: Float[np.ndarray, " unknowns"]) -> Float[np.ndarray, "time dof"]:
        """Return how positions move, to first order, with a step of the unknowns."""
        place, r = self.program.stencil.place, self.normal.shape[2]
        own = np.where(place[:, None] < 0, 0.0, step[np.maximum(place, 0)[:, None] + np.arange(r)])
        moved: np.ndarray = np.einsum("tja,ta->tj", self.normal, own)
        return moved

    def curvature(
        self, factors: Float[np.ndarray, " sums"], forces: Float[np.ndarray, " limits"]
    ) -> Float[np.ndarray, "unknowns unknowns"]:
        """Return the second derivatives of Σ factors · sums − Σ forces · gaps, the path's curvature included.

        The path's multipliers are those that leave no gradient in the row space of its Jacobian.
        """
        p, inputs = self.program, self.inputs.copy()
        variables = self.limits_by_u.shape[1]
        by_u = np.zeros((variables, len(self.q)))
        np.add.at(by_u.T, p.limited[:, 1], -forces[:, None] * self.limits_by_u)
        of_q = np.einsum("k,ktj->tj", factors, self.of_positions) + positions_of(p, by_u)
        right = -np.einsum("trj,tj->tr", self.jacobian, of_q)
        square = self.jacobian @ np.swapaxes(self.jacobian, -1, -2)
        inputs[p.multipliers[0] : p.multipliers[1]] = np.linalg.solve(square, right[..., None])[..., 0].T
        inputs[p.multipliers[1] : p.multipliers[2]] = factors[:, None] * p.task.weights
        inputs[p.multipliers[2] :] = 0.0
        rows = p.limited[:, 0] >= variables
        np.add.at(
            inputs,
            (p.multipliers[2] + p.limited[rows, 0] - variables, p.limited[rows, 1]),
            -p.sides[rows] * forces[rows],
        )
        phi = np.zeros((len(self.q), variables, variables))
        for i, j, values in zip(p.second.function, p.second.variable, p.curvature(inputs), strict=True):
            phi[:, i, j] = phi[:, j, i] = values
        table = np.zeros((self.unknowns, self.unknowns))
        for s in range(len(self.q)):
            basis, columns = self._basis(s)
            np.add.at(table, (columns[:, None], columns), basis.T @ phi[s] @ basis)
        return table

    def _basis(self, s: int) -> tuple[np.ndarray, np.ndarray]:
        return local_basis(self.program, self.normal, s)


def linearised(program: MotionProgram, q: Float[np.ndarray, "time dof"]) -> Linearised:
    """Return the program's values and first derivatives at a motion on the path."""
    stencil, n, task = program.stencil, program.task.arm.dof, program.task
    orders, sums = len(stencil.weights), len(program.sums)
    variables, samples = orders * n, len(q)
    inputs = program.inputs.copy()
    u = np.einsum("oik,ikj->oji", stencil.weights, q[stencil.window]).reshape(variables, samples)
    inputs[:variables] = u
    jacobian = program.track(inputs)[task.rows :].reshape(task.rows, n, samples).transpose(2, 0, 1)
    normal = np.linalg.svd(jacobian)[2][:, task.rows :].swapaxes(-1, -2)
    if task.cyclic:
        normal[-1] = normal[0]
    values = program.slope(inputs)
    functions = sums + len(program.rows)
    by_u = np.zeros((functions, variables, samples))
    by_u[program.slopes.function, program.slopes.variable] = values[functions:]
    of_positions = np.stack([positions_of(program, by_u[k] * task.weights) for k in range(sums)])
    every = np.concatenate([u, values[sums:functions]])
    which, at = program.limited.T
    limits_by_u = np.where(which[:, None] == np.arange(variables), 1.0, 0.0)
    rows = which >= variables
    limits_by_u[rows] = by_u[sums + which[rows] - variables, :, at[rows]]
    limits_by_u *= program.sides[:, None]
    unknowns = int(stencil.place.max()) + task.redundancy
    return Linearised(
        program=program,
        q=q,
        inputs=inputs,
        normal=normal,
        jacobian=jacobian,
        sums=values[:sums] @ task.weights,
        gradients=np.stack([_reduced(program, normal, part, unknowns) for part in of_positions]),
        of_positions=of_positions,
        gaps=program.sides * (every[which, at] - program.bounds),
        slopes=_limit_slopes(program, normal, limits_by_u, unknowns),
        limits_by_u=limits_by_u,
    )


def positions_of(program: MotionProgram, by_u: Float[np.ndarray, "variables time"]) -> Float[np.ndarray, "time dof"]:
    """Return what a gradient by the variables of all samples means for positions."""
    stencil, n = program.stencil, program.task.arm.dof
    shares = np.einsum("oik,oji->ikj", stencil.weights, by_u.reshape(len(stencil.weights), n, -1))
    found = np.zeros((by_u.shape[1], n))
    np.add.at(found, stencil.window, shares)
    return found


def local_basis(program: MotionProgram, normal: np.ndarray, s: int) -> tuple[np.ndarray, np.ndarray]:
    """Return how the variables of sample s follow from unknowns (variables, columns), and which unknowns these are."""
    stencil, r = program.stencil, normal.shape[2]
    begin = stencil.place[stencil.window[s]]
    free = begin >= 0
    basis = np.einsum("ok,kja->ojka", stencil.weights[:, s, free], normal[stencil.window[s, free]])
    columns = (begin[free, None] + np.arange(r)).ravel()
    return basis.reshape(-1, len(columns)), columns


def _reduced(program: MotionProgram, normal: np.ndarray, of_q: np.ndarray, unknowns: int) -> np.ndarray:
    place, found = program.stencil.place, np.zeros(unknowns)
    own = np.einsum("tja,tj->ta", normal, of_q)
    free = place >= 0
    np.add.at(found, place[free, None] + np.arange(normal.shape[2]), own[free])
    return found


def _limit_slopes(program: MotionProgram, normal: np.ndarray, by_u: np.ndarray, unknowns: int) -> sparse.csr_array:
    rows, columns, entries = [np.empty(0, dtype=int)], [np.empty(0, dtype=int)], [np.empty(0)]
    for s in range(len(normal)):
        mine = np.flatnonzero(program.limited[:, 1] == s)
        if len(mine):
            basis, places = local_basis(program, normal, s)
            rows.append(np.repeat(mine, len(places)))
            columns.append(np.tile(places, len(mine)))
            entries.append((by_u[mine] @ basis).ravel())
    table = (np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns)))
    return sparse.csr_array(sparse.coo_array(table, shape=(len(by_u), unknowns)))
