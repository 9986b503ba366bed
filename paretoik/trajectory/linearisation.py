"""A motion's program to first order at one motion, along the self-motion of every sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.nlp.conic import Cone, stack_rows, structural_product
from paretoik.robot.scales import joint_scales
from paretoik.task.retraction import retract, row_space_basis
from paretoik.trajectory.compiled.curve_states import linearise_instants
from paretoik.trajectory.curve_states import curve_arrays
from paretoik.trajectory.lagrangian import lagrangian_hessian, whole_basis
from paretoik.trajectory.program import MotionProgram, MotionValues


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionLinearisation:
    """A program at a motion ``x``, to first order; see ``Linearisation``.

    Columns are steps of the self-motion, slides in lengths of the arm, then slack and epigraph variables of samples,
    peaks and functions of the whole motion. Sample s moves by ``normal``[s] times its own unknowns, the null space of
    the tasks' ``path_jacobian``. ``basis`` (variables · instants, columns) says how all variables move,
    ``function_gradients`` are those of the functions of an instant by its variables.
    """

    program: MotionProgram
    values: MotionValues
    x: Float[np.ndarray, "time dof"]
    normal: Float[np.ndarray, "time dof redundancy"]
    path_jacobian: Float[np.ndarray, "time rows dof"]
    basis: sparse.csr_array
    function_gradients: Float[np.ndarray, "functions variables instants"]
    gradients: Float[np.ndarray, "objectives columns"]
    inequalities: Float[np.ndarray, " inequalities"]
    jacobian: sparse.csr_array
    cones: tuple[Cone, ...]

    @property
    def columns(self) -> int:
        """Number of columns."""
        return self.gradients.shape[1]

    @property
    def unknowns(self) -> int:
        """Number of unknowns of the self-motion."""
        return self.program.stencil.unknowns

    @property
    def unit(self) -> float:
        """Euclidean length of a step that is one RMS over time [rad, the arm's length]."""
        return float(np.sqrt(self.unknowns / self.normal.shape[2]))

    @property
    def objectives(self) -> Float[np.ndarray, " objectives"]:
        """F at the motion."""
        return self.values.objectives

    @property
    def equalities(self) -> Float[np.ndarray, " equalities"]:
        """None: the motion is on the path."""
        return np.zeros(0)

    @property
    def elastic(self) -> int:
        """Number of limits; the other inequalities tie slack and epigraph variables."""
        return self.program.elastic

    def hessian(
        self,
        weights: Float[np.ndarray, " objectives"],
        multipliers: Float[np.ndarray, " inequalities"],
        cone_multipliers: tuple[np.ndarray, ...] = (),
    ) -> sparse.csr_array:
        """Return the Hessian (columns, columns) of the Lagrangian, the path's curvature included."""
        return lagrangian_hessian(
            self.program,
            self.values.inputs,
            self.values.curve,
            self.basis,
            self.function_gradients,
            self.path_jacobian,
            weights,
            multipliers,
            cone_multipliers,
        )

    def displacement(self, step: Float[np.ndarray, " columns"]) -> Float[np.ndarray, "time dof"]:
        """Return how positions move, to first order, with a step."""
        first_unknown, r = self.program.stencil.first_unknown, self.normal.shape[2]
        unknowns = np.where(first_unknown[:, None] < 0, 0.0, step[np.maximum(first_unknown, 0)[:, None] + np.arange(r)])
        return np.einsum("tja,ta->tj", self.normal, unknowns) * joint_scales(self.program.task.arm)

    def retract(self, step: Float[np.ndarray, " columns"]) -> Float[np.ndarray, "time dof"] | None:
        """Return the motion that a step leads to, back on the path; None where it leaves the self-motion manifold."""
        task = self.program.task
        q = self.x + self.displacement(step)
        targets = task.targets.copy()
        if task.cyclic:
            q[-1], targets[-1] = q[0], targets[0]
        if task.ties_end:
            q[-1] = q[-2]
        directions = row_space_basis(self.path_jacobian) * joint_scales(task.arm)[:, None]
        retracted = retract(task.arm, task.tasks, q, targets, directions)
        if not retracted.on_path.all():
            return None
        q = retracted.q
        if task.start is not None:
            q[0] = task.start
        if task.cyclic:
            q[-1] = q[0]
        return q

    def corrected_inequalities(
        self, step: Float[np.ndarray, " columns"], x: Float[np.ndarray, "time dof"]
    ) -> Float[np.ndarray, " inequalities"]:
        """Return limits and ties at the motion x, slack and epigraph variables being what the step makes them."""
        p, u, instants = self.program, self.unknowns, len(self.program.task.instants)
        values = p.values(x)
        inputs, column = values.inputs.copy(), u + p.slacks * instants
        inputs[p.slack_inputs] = self.values.inputs[p.slack_inputs] + step[u:column].reshape(p.slacks, instants)
        inputs[p.peak_inputs] = self.values.inputs[p.peak_inputs] + step[column : column + p.peaks, None]
        parts, column = list(p.limit_values(inputs, p.evaluators.value(inputs))), column + p.peaks
        for each, before, after in zip(p.whole_functions, self.values.parts, values.parts, strict=True):
            for group in each.slices:
                if group.stop - group.start > 1:
                    parts.append(before[group].max() + step[column] - after[group])
                    column += 1
            column += not len(each.groups)
        return np.concatenate(parts)


def linearise(program: MotionProgram, q: Float[np.ndarray, "time dof"]) -> MotionLinearisation:
    """Return the program's values and first derivatives at a motion on the path."""
    task, samples, instants, n = program.task, len(q), len(program.task.instants), q.shape[1]
    values = program.values(q)
    linearise_instants(curve_arrays(task), values.curve)
    evaluators, sparsity = program.evaluators, program.evaluators.gradient_sparsity
    inputs = values.inputs[:, :: task.stride].copy()
    inputs[:n] = (q / joint_scales(task.arm)).T  # the samples are on the path; a spline passes near them
    at_samples = evaluators.path(inputs)
    path_jacobian = at_samples[task.rows :].reshape(task.rows, n, samples).transpose(2, 0, 1)
    normal = np.linalg.svd(path_jacobian)[2][:, task.rows :].swapaxes(-1, -2)
    if task.cyclic:
        normal[-1] = normal[0]
    if task.ties_end:
        across = row_space_basis(path_jacobian[-1])
        normal[-1] = normal[-2] - across @ (across.T @ normal[-2])
    slopes = evaluators.gradient(values.inputs)
    functions = len(slopes) - len(sparsity.rows)
    function_gradients = np.zeros((functions, len(program.variables), instants))
    function_gradients[sparsity.rows, sparsity.columns] = slopes[functions:]
    basis, columns = _basis(
        program, values.curve.chain, normal, sum(each.epigraph_columns for each in program.whole_functions)
    )
    gradients, ties, tie_rows, cones = _whole_functions(program, values, basis, columns)
    for k, total in enumerate(program.totals):
        if total.kind == "sum":
            gradients[k] = basis.T @ (function_gradients[total.index] * task.weights).ravel()
        elif total.kind == "peak":
            gradients[k, program.stencil.unknowns + program.slacks * instants + total.index] = 1.0
    return MotionLinearisation(
        program=program,
        values=values,
        x=q,
        normal=normal,
        path_jacobian=path_jacobian,
        basis=basis,
        function_gradients=function_gradients,
        gradients=gradients,
        inequalities=np.concatenate([values.inequalities, values.ties, *ties]),
        jacobian=stack_rows([_limit_rows(program, function_gradients, basis), *tie_rows]),
        cones=tuple(cones),
    )


def _basis(program: MotionProgram, chain: np.ndarray, normal: np.ndarray, wholes: int) -> tuple[sparse.csr_array, int]:
    """Return how variables (variables · instants) change with the columns, and how many columns there are."""
    stencil, instants, (_, n, r) = program.stencil, len(program.task.instants), normal.shape
    variables, orders = len(program.variables), stencil.orders
    moves = np.einsum("oik,ikja->ojika", stencil.coefficients, normal[stencil.neighbours])
    splines, moving = moves, stencil.coefficients != 0
    if len(chain):
        moves = np.einsum("iab,bikc->aikc", chain, moves.reshape(-1, *moves.shape[2:]))
        moves, moving = moves.reshape(orders, n, *moves.shape[1:]), np.broadcast_to(moving.any(axis=0), moving.shape)
    begin = stencil.first_unknown[stencil.neighbours][..., None] + np.arange(r)  # (instants, width, r)
    if program.rates > program.states:  # those of the spline
        moves, moving = np.concatenate([moves, splines]), np.concatenate([moving, moving])
    row = np.arange(program.rates * instants).reshape(-1, n, instants)
    rows = np.broadcast_to(row[..., None, None], moves.shape)
    places = np.broadcast_to(begin, moves.shape)
    moving = moving & (stencil.first_unknown[stencil.neighbours] >= 0)
    free = np.broadcast_to(moving[:, None, :, :, None], moves.shape)
    slacks, peaks = np.arange(program.slacks * instants), np.arange(program.peaks * instants)
    columns = stencil.unknowns + len(slacks) + program.peaks + wholes
    entries = np.concatenate([moves[free], np.ones(len(slacks) + len(peaks))])
    row = np.concatenate([rows[free], program.rates * instants + np.arange(len(slacks) + len(peaks))])
    column = np.concatenate(
        [places[free], stencil.unknowns + slacks, stencil.unknowns + len(slacks) + peaks // instants]
    )
    return sparse.csr_array(sparse.coo_array((entries, (row, column)), shape=(variables * instants, columns))), columns


def _whole_functions(
    program: MotionProgram, values: MotionValues, basis: sparse.csr_array, columns: int
) -> tuple[np.ndarray, list[np.ndarray], list[sparse.csr_array], list[Cone]]:
    """Return gradients of all objectives, as far as wholes go, and the ties, their rows and the cones of wholes."""
    gradients = np.zeros((len(program.totals), columns))
    ties, tie_rows, cones = list[np.ndarray](), list[sparse.csr_array](), list[Cone]()
    if not program.whole_functions:
        return gradients, ties, tie_rows, cones
    inputs_by_columns, u = whole_basis(program, basis), program.whole_inputs(values.inputs)
    column = columns - sum(each.epigraph_columns for each in program.whole_functions)
    for k, total in enumerate(program.totals):
        if total.kind != "whole":
            continue
        each, parts = program.whole_functions[total.index], values.parts[total.index]
        rows = structural_product(each.jacobian(u), inputs_by_columns)
        if not len(each.groups):
            gradients[k, column] = 1.0
            cones.append(Cone(column=column, values=each.factor * parts, rows=sparse.csr_array(each.factor * rows)))
            column += 1
            continue
        for group in each.slices:
            if group.stop - group.start == 1:
                gradients[k] += rows[[group.start]].toarray()[0]
                continue
            gradients[k, column] = 1.0
            ties.append(parts[group].max() - parts[group])
            tie_rows.append(_epigraph_rows(rows[group], column))
            column += 1
    return gradients, ties, tie_rows, cones


def _epigraph_rows(rows: sparse.csr_array, column: int) -> sparse.csr_array:
    """Return a column, behind all those of ``rows``, minus the rows."""
    ends = rows.indptr[1:]
    entries, indices = np.insert(-rows.data, ends, 1.0), np.insert(rows.indices, ends, column)
    return sparse.csr_array((entries, indices, rows.indptr + np.arange(len(rows.indptr))), shape=rows.shape)


def _limit_rows(program: MotionProgram, function_gradients: np.ndarray, basis: sparse.csr_array) -> sparse.csr_array:
    """Return the Jacobian of limits, divided by their ranges, and of ties of instants."""
    which, at = program.limited.T
    functions, variables, instants = function_gradients.shape
    scales = np.append(program.ranges[: program.elastic], np.ones(len(which) - program.elastic))
    sides, simple = program.sides / scales, which < variables
    i, function = np.flatnonzero(~simple), program.sums + which[~simple] - variables
    nonzero = np.zeros((functions, variables), dtype=bool)
    sparsity = program.evaluators.gradient_sparsity
    nonzero[sparsity.rows, sparsity.columns] = True
    k, v = np.nonzero(nonzero[function])
    entries = np.concatenate([sides[simple], function_gradients[function[k], v, at[i[k]]] * sides[i[k]]])
    rows = np.concatenate([np.flatnonzero(simple), i[k]])
    columns = np.concatenate([which[simple] * instants + at[simple], v * instants + at[i[k]]])
    by_variables = sparse.coo_array((entries, (rows, columns)), shape=(len(which), variables * instants))
    return structural_product(by_variables.tocsr(), basis)
