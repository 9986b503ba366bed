"""A motion's program at one motion: values and derivatives by steps in the self-motion, as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.nlp.conic import Cone
from paretoik.task.retraction import row_space_basis
from paretoik.trajectory.transcription import MotionProgram


@dataclass(frozen=True, kw_only=True, eq=False)
class Values:
    """What a program is worth at a motion: its totals, and the gaps of its limits, positive where they hold.

    ``inputs`` are those of its programs, slacks and peaks at their true values; ``parts`` those of the functions of the
    whole motion. ``gaps`` end with those of kinks.
    """

    inputs: Float[np.ndarray, "inputs time"]
    totals: Float[np.ndarray, " totals"]
    gaps: Float[np.ndarray, " limits"]
    parts: tuple[np.ndarray, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Linearised:
    """A program at a motion, to first order in ``columns``: steps of the self-motion, then v, σ and those of wholes.

    Sample s moves by ``normal``[s] times its own unknowns, the null space of the tasks' ``jacobian``. ``gradients`` are
    those of totals, ``gaps`` and ``slopes`` those of limits, then of the kinks: (v − what it stands for) and the like.
    ``cones`` tie columns to lengths.
    """

    program: MotionProgram
    values: Values
    q: Float[np.ndarray, "time dof"]
    normal: Float[np.ndarray, "time dof redundancy"]
    jacobian: Float[np.ndarray, "time rows dof"]
    basis: sparse.csr_array
    by_u: Float[np.ndarray, "functions variables time"]
    gradients: Float[np.ndarray, "totals columns"]
    gaps: Float[np.ndarray, " limits"]
    slopes: sparse.csr_array
    kinks: int
    cones: tuple[Cone, ...]

    @property
    def unknowns(self) -> int:
        """Number of unknowns of the self-motion."""
        return self.program.stencil.unknowns

    def displacement(self, step: Float[np.ndarray, " columns"]) -> Float[np.ndarray, "time dof"]:
        """Return how positions move, to first order, with a step."""
        place, r = self.program.stencil.place, self.normal.shape[2]
        own = np.where(place[:, None] < 0, 0.0, step[np.maximum(place, 0)[:, None] + np.arange(r)])
        moved: np.ndarray = np.einsum("tja,ta->tj", self.normal, own)
        return moved

    def curvature(
        self,
        factors: Float[np.ndarray, " totals"],
        forces: Float[np.ndarray, " limits"],
        pulls: tuple[np.ndarray, ...] = (),
    ) -> sparse.csr_array:
        """Return the second derivatives of Σ factors · totals − Σ forces · gaps, the path's curvature included.

        ``pulls`` are the multipliers of cones, in their order. The path's multipliers are those that leave no gradient
        in the row space of its Jacobian.
        """
        p, inputs = self.program, self.values.inputs.copy()
        variables, samples, n = self.by_u.shape[1], len(self.q), self.q.shape[1]
        orders = len(p.stencil.weights)
        local, dense = self._shares(factors, forces, pulls)
        of_u = np.zeros((variables, samples))
        weights = np.zeros((self.by_u.shape[0], samples))
        for total, factor in zip(p.totals, factors, strict=True):
            if total.kind == "sum":
                weights[total.index] += factor * p.task.weights
        which, at = p.limited.T
        rows = which >= variables
        np.add.at(weights, (p.sums + which[rows] - variables, at[rows]), -p.sides[rows] * local[rows])
        of_u += np.einsum("fs,fvs->vs", weights, self.by_u)
        np.add.at(of_u, (which[~rows], at[~rows]), -p.sides[~rows] * local[~rows])
        flat = of_u[: orders * n].reshape(orders, n, samples).swapaxes(1, 2).ravel()
        for each, multipliers in zip(p.wholes, dense, strict=True):
            flat = flat + (each.slopes(self._whole_u).T @ multipliers)[: len(flat)]
        of_q = positions_of(p, flat.reshape(orders, samples, n).swapaxes(1, 2).reshape(orders * n, samples))
        right = -np.einsum("trj,tj->tr", self.jacobian, of_q)
        square = self.jacobian @ np.swapaxes(self.jacobian, -1, -2)
        inputs[p.multipliers[0] : p.multipliers[1]] = np.linalg.solve(square, right[..., None])[..., 0].T
        inputs[p.multipliers[1] :] = weights
        phi = sparse.coo_array((variables * samples, variables * samples))
        i, j = p.second.function, p.second.variable
        found = p.curvature(inputs)
        s = np.arange(samples)
        lower = [(i[:, None] * samples + s).ravel(), (j[:, None] * samples + s).ravel()]
        off = np.repeat(i != j, samples)
        places = np.concatenate([lower[0], lower[1][off]]), np.concatenate([lower[1], lower[0][off]])
        entries = np.concatenate([found.ravel(), found.ravel()[off]])
        phi = sparse.coo_array((entries, places), shape=phi.shape)
        table = self.basis.T @ (phi.tocsr() @ self.basis)
        for each, multipliers in zip(p.wholes, dense, strict=True):
            own = each.second(self._whole_u, self._whole_basis, multipliers)
            extra = self.gradients.shape[1] - self.unknowns
            table = table + sparse.csr_array(np.pad(own, (0, extra)))
        return sparse.csr_array(table)

    def _shares(
        self, factors: np.ndarray, forces: np.ndarray, pulls: tuple[np.ndarray, ...]
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return the multipliers of limits at samples, and those of the parts of every whole."""
        p, dense, begun, cone = self.program, list[np.ndarray](), len(self.program.sides), 0
        totals = {total.index: factor for total, factor in zip(p.totals, factors, strict=True) if total.kind == "whole"}
        for k, each in enumerate(p.wholes):
            own = np.zeros(each.parts)
            for span in each.spans if len(each.groups) else ():
                if span.stop - span.start == 1:
                    own[span] = totals[k]
                    continue
                own[span] = forces[begun : begun + span.stop - span.start]
                begun += span.stop - span.start
            if not len(each.groups):
                own = each.factor * np.asarray(pulls[cone]) if pulls else own
                cone += 1
            dense.append(own)
        return forces[: len(p.sides)], dense

    @cached_property
    def _whole_u(self) -> np.ndarray:
        return whole_inputs(self.program, self.values.inputs)

    @cached_property
    def _whole_basis(self) -> sparse.csr_array:
        return whole_basis(self.program, self.basis)[:, : self.unknowns]


def evaluated(program: MotionProgram, q: Float[np.ndarray, "time dof"]) -> Values:
    """Return what a program is worth at a motion on the path."""
    stencil, n = program.stencil, q.shape[1]
    orders, inputs = len(stencil.weights), program.inputs.copy()
    u = np.einsum("oik,ikj->oji", stencil.weights, q[stencil.window])
    inputs[: orders * n] = u.reshape(orders * n, -1)
    own = program.variables[orders * n :]
    if program.slacks:
        inputs[own[: program.slacks]] = program.slack(inputs)
    found = program.value(inputs)
    if program.peaks:
        tops = np.full(program.peaks, -np.inf)
        np.maximum.at(tops, program.over, -found[program.sums + program.under].min(axis=1))
        inputs[own[program.slacks :]] = tops[:, None]
        found[program.sums + program.under] += tops[program.over, None]
    parts = tuple(each.value(whole_inputs(program, inputs)[:, None])[:, 0] for each in program.wholes)
    totals = [
        found[total.index] @ program.task.weights
        if total.kind == "sum"
        else float(inputs[own[program.slacks + total.index], 0])
        if total.kind == "peak"
        else program.wholes[total.index].worth(parts[total.index])
        for total in program.totals
    ]
    every = np.concatenate([inputs[program.variables], found[program.sums :]])
    which, at = program.limited.T
    gaps = program.sides * (every[which, at] - program.bounds)
    return Values(inputs=inputs, totals=np.array(totals), gaps=gaps, parts=parts)


def linearised(program: MotionProgram, q: Float[np.ndarray, "time dof"], values: Values | None = None) -> Linearised:
    """Return the program's values and first derivatives at a motion on the path."""
    task, samples, n = program.task, len(q), q.shape[1]
    known = evaluated(program, q) if values is None else values
    jacobian = program.track(known.inputs)[task.rows :].reshape(task.rows, n, samples).transpose(2, 0, 1)
    normal = np.linalg.svd(jacobian)[2][:, task.rows :].swapaxes(-1, -2)
    if task.cyclic:
        normal[-1] = normal[0]
    if task.ends_at_rest:
        across = row_space_basis(np.moveaxis(jacobian[-1:], 0, -1))[0]
        normal[-1] = normal[-2] - across @ (across.T @ normal[-2])
    found = program.slope(known.inputs)
    functions = program.sums + len(program.rows) + len(program.under) + _slack_rows(program)
    by_u = np.zeros((functions, len(program.variables), samples))
    by_u[program.slopes.function, program.slopes.variable] = found[functions:]
    basis, columns = _basis(program, normal, sum(each.tops for each in program.wholes))
    gradients, gaps, slopes, cones = _wholes(program, known, basis, columns)
    for k, total in enumerate(program.totals):
        if total.kind == "sum":
            of_u = (by_u[total.index] * task.weights).ravel()
            gradients[k] = basis.T @ of_u
        elif total.kind == "peak":
            gradients[k, program.stencil.unknowns + program.slacks * samples + total.index] = 1.0
    return Linearised(
        program=program,
        values=known,
        q=q,
        normal=normal,
        jacobian=jacobian,
        basis=basis,
        by_u=by_u,
        gradients=gradients,
        gaps=np.concatenate([known.gaps, *gaps]),
        slopes=sparse.csr_array(sparse.vstack([_limit_slopes(program, by_u, basis), *slopes])),
        kinks=program.kinks + sum(len(gap) for gap in gaps),
        cones=tuple(cones),
    )


def positions_of(program: MotionProgram, by_u: Float[np.ndarray, "variables time"]) -> Float[np.ndarray, "time dof"]:
    """Return what a gradient by positions and rates of all samples means for positions."""
    stencil, n = program.stencil, program.task.arm.dof
    shares = np.einsum("oik,oji->ikj", stencil.weights, by_u.reshape(len(stencil.weights), n, -1))
    found = np.zeros((by_u.shape[1], n))
    np.add.at(found, stencil.window, shares)
    return found


def whole_inputs(program: MotionProgram, inputs: np.ndarray) -> Float[np.ndarray, " inputs"]:
    """Return the inputs of functions of the whole motion: position, velocity, acceleration, jerk (time, dof) each."""
    orders, n = len(program.stencil.weights), program.task.arm.dof
    u = inputs[: orders * n].reshape(orders, n, -1).swapaxes(1, 2)
    return np.concatenate([u.ravel(), np.zeros((4 - orders) * u[0].size)])


def whole_basis(program: MotionProgram, basis: sparse.csr_array) -> sparse.csr_array:
    """Return how the inputs of functions of the whole motion change with the columns."""
    orders, n, samples = len(program.stencil.weights), program.task.arm.dof, len(program.task.times)
    order = np.arange(orders * n * samples).reshape(orders, n, samples).swapaxes(1, 2).ravel()
    found = basis[order]
    found.resize((4 * n * samples, basis.shape[1]))
    return found


def _slack_rows(program: MotionProgram) -> int:
    return program.kinks // len(program.task.times) - len(program.under)


def _basis(program: MotionProgram, normal: np.ndarray, wholes: int) -> tuple[sparse.csr_array, int]:
    """Return how variables (variables · time) change with the columns, and how many columns there are."""
    stencil, (samples, n, r) = program.stencil, normal.shape
    variables, orders = len(program.variables), len(stencil.weights)
    moves = np.einsum("oik,ikja->ojika", stencil.weights, normal[stencil.window])
    begin = stencil.place[stencil.window][..., None] + np.arange(r)  # (time, width, r)
    row = np.arange(orders * n * samples).reshape(orders, n, samples)
    rows = np.broadcast_to(row[..., None, None], moves.shape)
    places = np.broadcast_to(begin, moves.shape)
    free = np.broadcast_to((stencil.place[stencil.window] >= 0)[..., None], moves.shape) & (moves != 0)
    own = np.arange(program.slacks * samples)
    shared = np.arange(program.peaks * samples)
    columns = stencil.unknowns + program.slacks * samples + program.peaks + wholes
    entries = np.concatenate([moves[free], np.ones(len(own) + len(shared))])
    at = np.concatenate([rows[free], orders * n * samples + np.arange(len(own) + len(shared))])
    to = np.concatenate([places[free], stencil.unknowns + own, stencil.unknowns + len(own) + shared // samples])
    return sparse.csr_array(sparse.coo_array((entries, (at, to)), shape=(variables * samples, columns))), columns


def _wholes(
    program: MotionProgram, known: Values, basis: sparse.csr_array, columns: int
) -> tuple[np.ndarray, list[np.ndarray], list[sparse.csr_array], list[Cone]]:
    """Return gradients of all totals, as far as wholes go, and the gaps, slopes and cones that come with wholes."""
    gradients = np.zeros((len(program.totals), columns))
    gaps, slopes, cones = list[np.ndarray](), list[sparse.csr_array](), list[Cone]()
    if not program.wholes:
        return gradients, gaps, slopes, cones
    by, u = whole_basis(program, basis), whole_inputs(program, known.inputs)
    column = columns - sum(each.tops for each in program.wholes)
    for k, total in enumerate(program.totals):
        if total.kind != "whole":
            continue
        each, parts = program.wholes[total.index], known.parts[total.index]
        rows = sparse.csr_array(each.slopes(u) @ by)
        if not len(each.groups):
            gradients[k, column] = 1.0
            cones.append(Cone(column=column, values=each.factor * parts, rows=sparse.csr_array(each.factor * rows)))
            column += 1
            continue
        for span in each.spans:
            if span.stop - span.start == 1:
                gradients[k] += rows[[span.start]].toarray()[0]
                continue
            gradients[k, column] = 1.0
            ahead = np.zeros((span.stop - span.start, columns))
            ahead[:, column] = 1.0
            gaps.append(parts[span].max() - parts[span])
            slopes.append(sparse.csr_array(ahead - rows[span].toarray()))
            column += 1
    return gradients, gaps, slopes, cones


def _limit_slopes(program: MotionProgram, by_u: np.ndarray, basis: sparse.csr_array) -> sparse.csr_array:
    which, at = program.limited.T
    _, variables, samples = by_u.shape
    own = which < variables
    i, row = np.flatnonzero(~own), which[~own] - variables
    slopes = by_u[program.sums + row, :, at[~own]] * program.sides[~own, None]
    k, v = np.nonzero(slopes)
    entries = np.concatenate([program.sides[own], slopes[k, v]])
    rows = np.concatenate([np.flatnonzero(own), i[k]])
    columns = np.concatenate([which[own] * samples + at[own], v * samples + at[~own][k]])
    table = sparse.coo_array((entries, (rows, columns)), shape=(len(which), variables * samples))
    return sparse.csr_array(table.tocsr() @ basis)
