"""The Hessian of the Lagrangian of a motion's program, along the self-motion."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy import sparse

from paretoik.trajectory.compiled.curve_states import CurveWork, add_curve_multipliers, chain_gradient
from paretoik.trajectory.curve_states import curve_arrays
from paretoik.trajectory.program import MotionProgram


def lagrangian_hessian(
    program: MotionProgram,
    inputs: Float[np.ndarray, "inputs instants"],
    curve: CurveWork,
    basis: sparse.csr_array,
    function_gradients: Float[np.ndarray, "functions variables instants"],
    path_jacobian: Float[np.ndarray, "time rows dof"],
    weights: Float[np.ndarray, " objectives"],
    multipliers: Float[np.ndarray, " inequalities"],
    cone_multipliers: tuple[np.ndarray, ...],
) -> sparse.csr_array:
    """Return the Hessian (columns, columns) of weights · F + ν · h − multipliers · c − cone_multipliers · cones.

    The path's multipliers ν are those that leave no gradient in the row space of its Jacobian. Of a spline h are also
    the equations of its instants, with their first and second derivatives.
    """
    p, (_functions, variables, instants) = program, function_gradients.shape
    orders, n = p.stencil.orders, p.task.arm.dof
    by_limit, by_part = _part_multipliers(p, weights, multipliers, cone_multipliers)
    factors, by_variable = _function_weights(p, weights, by_limit, function_gradients.shape)
    by_variable += np.einsum("fs,fvs->vs", factors, function_gradients)
    gradient = by_variable[: p.states].reshape(orders, n, instants).swapaxes(1, 2).ravel()
    u = p.whole_inputs(inputs)
    for each, part in zip(p.whole_functions, by_part, strict=True):
        gradient = gradient + (each.jacobian(u).T @ part)[: len(gradient)]
    by_curve = np.ascontiguousarray(gradient.reshape(orders, instants, n).swapaxes(1, 2)).reshape(-1, instants)
    by_spline = np.empty_like(by_curve)
    chain_gradient(curve, np.concatenate([by_curve, by_variable[p.states : p.rates]]), by_spline)
    by_position = _by_positions(p, by_spline.reshape(orders, n, instants), len(path_jacobian))
    right = -np.einsum("trj,tj->tr", path_jacobian, by_position)
    square = path_jacobian @ np.swapaxes(path_jacobian, -1, -2)
    inputs, (first, last) = inputs.copy(), p.evaluators.multipliers[:2]
    inputs[first : first + p.task.rows, :: p.task.stride] = np.linalg.solve(square, right[..., None])[..., 0].T
    add_curve_multipliers(curve_arrays(p.task), curve, by_curve, inputs[first:last])
    inputs[last:] = factors
    hessian = basis.T @ (_by_variables(p, p.evaluators.hessian(inputs), variables, instants) @ basis)
    if p.whole_functions:
        unknowns = p.stencil.unknowns
        directions = whole_basis(p, basis)[:, :unknowns]
        for each, part in zip(p.whole_functions, by_part, strict=True):
            dense = each.hessian_along(u, directions, part)
            hessian = hessian + sparse.csr_array(np.pad(dense, (0, basis.shape[1] - unknowns)))
    return sparse.csr_array(hessian)


def whole_basis(program: MotionProgram, basis: sparse.csr_array) -> sparse.csr_array:
    """Return how the inputs of functions of the whole motion change with the columns."""
    orders, n, instants = program.stencil.orders, program.task.arm.dof, len(program.task.instants)
    order = np.arange(orders * n * instants).reshape(orders, n, instants).swapaxes(1, 2).ravel()
    rows = basis[order]
    rows.resize((4 * n * instants, basis.shape[1]))
    return rows


def _part_multipliers(
    program: MotionProgram, weights: np.ndarray, multipliers: np.ndarray, cone_multipliers: tuple[np.ndarray, ...]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the multipliers of limits and ties of samples, in their own units, and of the parts of every whole."""
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


def _function_weights(
    program: MotionProgram, weights: np.ndarray, by_limit: np.ndarray, shape: tuple[int, int, int]
) -> tuple[Float[np.ndarray, "functions instants"], Float[np.ndarray, "variables instants"]]:
    """Return the Lagrangian's weights of all functions of an instant, and those of the variables that limits bound."""
    functions, variables, instants = shape
    factors, by_variable = np.zeros((functions, instants)), np.zeros((variables, instants))
    for total, weight in zip(program.totals, weights, strict=True):
        if total.kind == "sum":
            factors[total.index] += weight * program.task.weights
    which, at = program.limited.T
    rows = which >= variables
    np.add.at(factors, (program.sums + which[rows] - variables, at[rows]), -program.sides[rows] * by_limit[rows])
    np.add.at(by_variable, (which[~rows], at[~rows]), -program.sides[~rows] * by_limit[~rows])
    return factors, by_variable


def _by_positions(
    program: MotionProgram, by_u: Float[np.ndarray, "orders dof instants"], samples: int
) -> Float[np.ndarray, "time dof"]:
    """Return what a gradient by positions and rates of all instants is by positions of the samples."""
    shares = np.einsum("oik,oji->ikj", program.stencil.coefficients, by_u)
    gradient = np.zeros((samples, by_u.shape[1]))
    np.add.at(gradient, program.stencil.neighbours, shares)
    return gradient


def _by_variables(
    program: MotionProgram, seconds: Float[np.ndarray, "entries instants"], variables: int, instants: int
) -> sparse.csr_array:
    """Return second derivatives by the variables of all instants as a symmetric matrix."""
    i, j = program.evaluators.hessian_sparsity.rows, program.evaluators.hessian_sparsity.columns
    s = np.arange(instants)
    row, column = (i[:, None] * instants + s).ravel(), (j[:, None] * instants + s).ravel()
    off = np.repeat(i != j, instants)
    places = np.concatenate([row, column[off]]), np.concatenate([column, row[off]])
    entries = np.concatenate([seconds.ravel(), seconds.ravel()[off]])
    return sparse.coo_array((entries, places), shape=(variables * instants,) * 2).tocsr()
