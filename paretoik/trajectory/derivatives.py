"""First derivatives of a motion's program, along the self-motion of every sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.nlp.program import Cone, Linearisation, stack_rows, structural_product
from paretoik.robot.kinematics import joint_scales
from paretoik.task.retraction import retract, row_space_basis
from paretoik.trajectory.curve_state_kernel import add_twist, chain_gradient, curve_multipliers, linearise_instants
from paretoik.trajectory.curve_states import curve_arrays
from paretoik.trajectory.motion_terms import MotionTerms, MotionValues


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionLinearisation(Linearisation):
    """A program at a motion ``x``, to first order.

    Columns are steps of the self-motion, slides in arm lengths, then slack and epigraph variables of samples, peaks and
    functions of the whole motion.

    normal: null space of the tasks' Jacobian; sample s moves by ``normal``[s] times the unknowns of the sample
    basis: derivatives of all variables by the columns (variables · instants, columns)
    spline: derivatives of the spline's state by the columns
    samples: derivatives of q by the columns (dof · time, columns)
    function_gradients: derivatives of the functions of an instant by its variables
    sample_inputs: inputs of evaluators at the samples
    """

    program: MotionTerms
    values: MotionValues
    normal: Float[np.ndarray, "time dof redundancy"]
    path_jacobian: Float[np.ndarray, "time rows dof"]
    basis: sparse.csr_array
    spline: sparse.csr_array
    samples: sparse.csr_array
    function_gradients: Float[np.ndarray, "functions variables instants"]
    sample_inputs: Float[np.ndarray, "inputs time"]

    def hessian(
        self,
        weights: Float[np.ndarray, " objectives"],
        multipliers: Float[np.ndarray, " inequalities"],
        cone_multipliers: tuple[np.ndarray, ...] = (),
    ) -> sparse.csr_array:
        """Return the Hessian (columns, columns) of the Lagrangian.

        The Lagrangian is weights · F + ν · h − multipliers · c − cone_multipliers · cones. The path's multipliers ν
        make the gradient in the row space of its Jacobian 0. For a spline, h includes the equations of its instants
        with their first and second derivatives.
        """
        p, curve, path_jacobian = self.program, self.values.curve, self.path_jacobian
        _, variables, instants = self.function_gradients.shape
        orders, n = p.stencil.orders, p.task.arm.dof
        by_limit, by_part = _part_multipliers(p, weights, multipliers, cone_multipliers)
        # the Lagrangian's weights of all functions of an instant, and of the variables that limits bound
        functions, variables, instants = self.function_gradients.shape
        factors, by_variable = np.zeros((functions, instants)), np.zeros((variables, instants))
        for total, weight in zip(p.totals, weights, strict=True):
            if total.kind == "sum":
                factors[total.index] += weight * p.task.weights
        which, at = p.limited.T
        rows = which >= variables
        np.add.at(factors, (p.sums + which[rows] - variables, at[rows]), -p.sides[rows] * by_limit[rows])
        np.add.at(by_variable, (which[~rows], at[~rows]), -p.sides[~rows] * by_limit[~rows])
        by_variable += np.einsum("fs,fvs->vs", factors, self.function_gradients)
        gradient = by_variable[: p.states].reshape(orders, n, instants).swapaxes(1, 2).ravel()
        u = p.whole_inputs(self.values.inputs)
        for each, part in zip(p.whole_functions, by_part, strict=True):
            gradient = gradient + (each.jacobian(u).T @ part)[: len(gradient)]
        by_curve = np.ascontiguousarray(gradient.reshape(orders, instants, n).swapaxes(1, 2)).reshape(-1, instants)
        by_spline = np.empty_like(by_curve)
        chain_gradient(curve, np.concatenate([by_curve, by_variable[p.states : p.rates]]), by_spline)
        shares = np.einsum("oik,oji->ikj", p.stencil.coefficients, by_spline.reshape(orders, n, instants))
        by_position = np.zeros((len(path_jacobian), n))
        np.add.at(by_position, p.stencil.neighbours, shares)
        right = -np.einsum("trj,tj->tr", path_jacobian, by_position)
        square = path_jacobian @ np.swapaxes(path_jacobian, -1, -2)
        inputs, (first, last) = self.values.inputs.copy(), p.evaluators.multipliers[:2]
        at_samples = self.sample_inputs.copy()
        at_samples[first : first + p.task.rows] = np.linalg.solve(square, right[..., None])[..., 0].T
        by_sample = p.evaluators.path_hessian(at_samples).reshape(n, n, -1).transpose(2, 0, 1)
        if p.task.differences == "spline":
            curve_multipliers(curve_arrays(p.task), curve, by_curve, inputs[first + p.task.rows : last])
        inputs[last:] = factors
        hessian = self.basis.T @ (_by_variables(p, p.evaluators.hessian(inputs), variables, instants) @ self.basis)
        hessian = hessian + self.samples.T @ (_block_diagonal(by_sample) @ self.samples)
        if p.task.differences == "spline":
            twist = np.zeros((instants, p.states, p.states))
            for i in range(instants):
                add_twist(curve, i, twist[i])
            hessian = hessian + self.spline.T @ (_block_diagonal(twist) @ self.spline)
        if p.whole_functions:
            unknowns = p.stencil.unknowns
            directions = _whole_basis(p, self.basis)[:, :unknowns]
            for each, part in zip(p.whole_functions, by_part, strict=True):
                dense = each.hessian_along(u, directions, part)
                hessian = hessian + sparse.csr_array(np.pad(dense, (0, self.basis.shape[1] - unknowns)))
        return sparse.csr_array(hessian)

    def displacement(self, step: Float[np.ndarray, " columns"]) -> Float[np.ndarray, "time dof"]:
        """Return the first-order change of positions with a step."""
        first_unknown, r = self.program.stencil.first_unknown, self.normal.shape[2]
        unknowns = np.where(first_unknown[:, None] < 0, 0.0, step[np.maximum(first_unknown, 0)[:, None] + np.arange(r)])
        return np.einsum("tja,ta->tj", self.normal, unknowns) * joint_scales(self.program.task.arm)

    def retract(self, step: Float[np.ndarray, " columns"]) -> Float[np.ndarray, "time dof"] | None:
        """Return the motion after a step, retracted to the path.

        None if it leaves the self-motion manifold.
        """
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
        """Return limits and ties at the motion x after a step.

        Slack and epigraph variables are those after the step.
        """
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


def linearise(program: MotionTerms, q: Float[np.ndarray, "time dof"]) -> MotionLinearisation:
    """Return the program's values and first derivatives at a motion.

    The motion must be on the path.
    """
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
    basis, spline, by_samples = _basis(program, values.curve.chain, normal)
    gradients, ties, tie_rows, cones = _whole_functions(program, values, basis)
    for k, total in enumerate(program.totals):
        if total.kind == "sum":
            gradients[k] = basis.T @ (function_gradients[total.index] * task.weights).ravel()
        elif total.kind == "peak":
            gradients[k, program.stencil.unknowns + program.slacks * instants + total.index] = 1.0
    # the Jacobian of limits, divided by their ranges, and of ties of instants
    which, at = program.limited.T
    functions, variables, instants = function_gradients.shape
    scales = np.append(program.ranges[: program.elastic], np.ones(len(which) - program.elastic))
    sides, simple = program.sides / scales, which < variables
    i, function = np.flatnonzero(~simple), program.sums + which[~simple] - variables
    nonzero = np.zeros((functions, variables), dtype=bool)
    nonzero[sparsity.rows, sparsity.columns] = True
    row, v = np.nonzero(nonzero[function])
    entries = np.concatenate([sides[simple], function_gradients[function[row], v, at[i[row]]] * sides[i[row]]])
    rows = np.concatenate([np.flatnonzero(simple), i[row]])
    columns = np.concatenate([which[simple] * instants + at[simple], v * instants + at[i[row]]])
    by_variables = sparse.coo_array((entries, (rows, columns)), shape=(len(which), variables * instants))
    limit_rows = structural_product(by_variables.tocsr(), basis)
    return MotionLinearisation(
        program=program,
        values=values,
        x=q,
        unknowns=program.stencil.unknowns,
        elastic=program.elastic,
        unit=float(np.sqrt(program.stencil.unknowns / normal.shape[2])),  # rad, slides in arm lengths
        objectives=values.objectives,
        normal=normal,
        path_jacobian=path_jacobian,
        basis=basis,
        spline=spline,
        samples=by_samples,
        function_gradients=function_gradients,
        sample_inputs=inputs,
        gradients=gradients,
        inequalities=np.concatenate([values.inequalities, values.ties, *ties]),
        jacobian=stack_rows([limit_rows, *tie_rows]),
        cones=tuple(cones),
    )


def _basis(
    program: MotionTerms, chain: np.ndarray, normal: np.ndarray
) -> tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array]:
    """Return derivatives by columns: of variables, spline state, and q.

    Their rows are variables · instants, states · instants, and dof · time.
    """
    stencil, instants, r = program.stencil, len(program.task.instants), normal.shape[2]
    wholes = sum(each.epigraph_columns for each in program.whole_functions)
    columns = stencil.unknowns + program.slacks * instants + program.peaks + wholes
    begin = stencil.first_unknown[stencil.neighbours]
    moves = np.einsum("oik,ikja->ojika", stencil.coefficients, normal[stencil.neighbours])
    moves = moves.reshape(-1, *moves.shape[2:])  # (states, instants, width, r)
    places = np.broadcast_to(begin[..., None] + np.arange(r), moves.shape)
    rows = np.broadcast_to(np.arange(len(moves) * instants).reshape(-1, instants, 1, 1), moves.shape)
    free = np.broadcast_to(((begin >= 0) & (stencil.coefficients != 0).any(axis=0))[..., None], moves.shape)

    def matrix(entries: np.ndarray) -> sparse.coo_array:
        return sparse.coo_array((entries[free], (rows[free], places[free])), shape=(moves[..., 0, 0].size, columns))

    spline = matrix(moves)
    parts = [matrix(np.einsum("abi,bikc->aikc", chain, moves)) if chain.size else spline]
    parts += [spline] * (program.rates > program.states)
    slacks, peaks = program.slacks * instants, np.arange(program.peaks * instants)
    column = stencil.unknowns + np.concatenate([np.arange(slacks), slacks + peaks // instants])
    ones = (np.ones(len(column)), (np.arange(len(column)), column))
    parts.append(sparse.coo_array(ones, shape=(len(column), columns)))
    # q of every sample depends only on the unknowns of the sample
    (samples, n, _), first = normal.shape, stencil.first_unknown
    entries = np.where((first >= 0)[:, None, None], normal, 0.0).transpose(1, 0, 2)
    rows = np.broadcast_to(np.arange(n * samples).reshape(n, samples, 1), entries.shape)
    places = np.broadcast_to(np.maximum(first, 0)[:, None] + np.arange(r), entries.shape)
    by_sample = sparse.coo_array((entries.ravel(), (rows.ravel(), places.ravel())), shape=(n * samples, columns))
    return sparse.csr_array(sparse.vstack(parts)), sparse.csr_array(spline), by_sample.tocsr()


def _whole_functions(
    program: MotionTerms, values: MotionValues, basis: sparse.csr_array
) -> tuple[np.ndarray, list[np.ndarray], list[sparse.csr_array], list[Cone]]:
    """Return the parts that functions of the whole motion add.

    They are parts of the objectives' gradients, then ties, rows of the ties, and cones.
    """
    columns = basis.shape[1]
    gradients = np.zeros((len(program.totals), columns))
    ties, tie_rows, cones = list[np.ndarray](), list[sparse.csr_array](), list[Cone]()
    if not program.whole_functions:
        return gradients, ties, tie_rows, cones
    inputs_by_columns, u = _whole_basis(program, basis), program.whole_inputs(values.inputs)
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
            part = rows[group]  # the new last column minus the rows
            entries = np.insert(-part.data, part.indptr[1:], 1.0)
            indices = np.insert(part.indices, part.indptr[1:], column)
            indptr = part.indptr + np.arange(len(part.indptr))
            tie_rows.append(sparse.csr_array((entries, indices, indptr), shape=part.shape))
            column += 1
    return gradients, ties, tie_rows, cones


def _whole_basis(program: MotionTerms, basis: sparse.csr_array) -> sparse.csr_array:
    """Return the derivatives of whole functions' inputs by the columns."""
    orders, n, instants = program.stencil.orders, program.task.arm.dof, len(program.task.instants)
    order = np.arange(orders * n * instants).reshape(orders, n, instants).swapaxes(1, 2).ravel()
    rows = basis[order]
    rows.resize((4 * n * instants, basis.shape[1]))
    return rows


def _part_multipliers(
    program: MotionTerms, weights: np.ndarray, multipliers: np.ndarray, cone_multipliers: tuple[np.ndarray, ...]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the multipliers of limits and ties of samples, and of wholes.

    The first are in their own units; the second are those of the parts of every function of the whole motion.
    """
    count, elastic = len(program.sides), program.elastic
    by_limit = np.concatenate([multipliers[:elastic] / program.ranges[:elastic], multipliers[elastic:count]])
    by_part, tie, cone = list[np.ndarray](), count, 0
    totals = {
        total.index: weight for total, weight in zip(program.totals, weights, strict=True) if total.kind == "whole"
    }
    for k, each in enumerate(program.whole_functions):
        part = np.zeros(each.parts)
        for group in each.slices:
            if group.stop - group.start == 1:
                part[group] = totals[k]
                continue
            part[group] = multipliers[tie : tie + group.stop - group.start]
            tie += group.stop - group.start
        if not len(each.groups):
            part = each.factor * np.asarray(cone_multipliers[cone]) if cone_multipliers else part
            cone += 1
        by_part.append(part)
    return by_limit, by_part


def _by_variables(
    program: MotionTerms, seconds: Float[np.ndarray, "entries instants"], variables: int, instants: int
) -> sparse.csr_array:
    """Return second derivatives by all variables as one symmetric matrix.

    The variables are those of all instants.
    """
    i, j = program.evaluators.hessian_sparsity.rows, program.evaluators.hessian_sparsity.columns
    s = np.arange(instants)
    row, column = (i[:, None] * instants + s).ravel(), (j[:, None] * instants + s).ravel()
    off = np.repeat(i != j, instants)
    places = np.concatenate([row, column[off]]), np.concatenate([column, row[off]])
    entries = np.concatenate([seconds.ravel(), seconds.ravel()[off]])
    return sparse.coo_array((entries, places), shape=(variables * instants,) * 2).tocsr()


def _block_diagonal(seconds: Float[np.ndarray, "blocks entries entries"]) -> sparse.csr_array:
    """Return a block-diagonal matrix, rows sorted by entry, then by block."""
    blocks, entries, _ = seconds.shape
    places = np.arange(entries * blocks).reshape(entries, blocks).T
    row, column = np.broadcast_arrays(places[:, :, None], places[:, None, :])
    shape = (entries * blocks,) * 2
    return sparse.coo_array((seconds.ravel(), (row.ravel(), column.ravel())), shape=shape).tocsr()
