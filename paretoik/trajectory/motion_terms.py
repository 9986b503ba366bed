"""A motion's nonlinear program: one evaluation of all functions per instant, and first and second derivatives.

    minimise    weights · F,  each F a sum Σᵢ wᵢ f(uᵢ, vᵢ), a peak σ, or a ``WholeFunction`` of all samples
    subject to  path equations = 0 at every sample
                ±(u or f(u, v) − bound) / range ≥ 0 at limited instants i
                σ − piece ≥ 0,  ±(v − piece) ≥ 0

The instants are the samples and, if differences="spline", the midpoints between them. The variables of an instant are
u = (q, q̇, q̈, q⃛), prismatic joints in arm lengths (``joint_scales``), and slacks v if functions have kinks. Each peak
has an epigraph variable σ for the whole motion. u is linear in the positions of a few samples (``Stencil``); the u of a
spline is then projected onto the path (``curve_states``). If integrals have kinks, the spline's own u are variables
too, after those of the curve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from paretoik.autodiff.evaluator import Evaluator
from paretoik.nlp.program import Cone, Linearisation, stack_rows, structural_product
from paretoik.robot.kinematics import joint_scales
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import normal_directions, retract, row_space_basis
from paretoik.trajectory.curve_state_kernel import (
    CurveWork,
    add_twist,
    allocate_curve,
    chain_gradient,
    curve_multipliers,
    linearise_instants,
    project_instants,
)
from paretoik.trajectory.curve_states import curve_arrays
from paretoik.trajectory.discretisation import Stencil
from paretoik.trajectory.functions import Total, WholeFunction, function_names

KINK_TOLERANCE = 1e-8  # share of the larger operand of a maximum, minimum or absolute value: nearer operands meet
ORDERS = ("position", "velocity", "acceleration", "jerk")


class Sparsity(NamedTuple):
    """Rows and columns of the derivatives that are not always 0."""

    rows: Int[np.ndarray, " entries"]
    columns: Int[np.ndarray, " entries"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Evaluators:
    """Evaluators of an instant's functions, sums first, then rows, and of their derivatives."""

    inputs: int  # number of inputs, in this order: u, then v and σ (at ``auxiliary``), parameters, multipliers
    auxiliary: Int[np.ndarray, " auxiliary"]
    # index of the first multiplier of path equations (of a sample, then of a curve's instant), of sums, and of rows
    multipliers: Int[np.ndarray, 3]
    slacks: int
    # number of rows that tie slacks, two per slack; they bound the slack from below if its sign in ``signs`` is 1, from
    # above if it is −1
    ties: int
    signs: tuple[int, ...]
    slack: Evaluator  # evaluator of the values of the ``slacks`` v at a point
    kinked: tuple[int, ...]
    # evaluator of both operands of each kink without slack; ``kinked`` has the index of its function
    kink_operands: Evaluator
    value: Evaluator  # evaluator of sums and rows
    gradient: Evaluator  # evaluator of sums and rows, then the entries of their gradients by variables
    gradient_sparsity: Sparsity
    hessian: Evaluator  # evaluator of the entries of the Lagrangian's Hessian by u and v
    hessian_sparsity: Sparsity
    path: Evaluator  # evaluator of path equations of a sample and their Jacobian by q
    path_hessian: Evaluator  # evaluator of the Hessian (dof, dof) by q of the sum of path equations times multipliers


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionValues:
    """Objectives F and constraints of a program at a motion."""

    # inputs of the evaluators, with slack and epigraph variables at their true values
    inputs: Float[np.ndarray, "inputs instants"]
    objectives: Float[np.ndarray, " objectives"]
    inequalities: Float[np.ndarray, " inequalities"]  # limits divided by their ranges, positive if satisfied
    ties: Float[np.ndarray, " ties"]  # inequalities that tie slack and epigraph variables
    parts: tuple[np.ndarray, ...]  # smooth parts of every function of the whole motion
    curve: CurveWork  # state of the motion's curve


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionTerms:
    """The nonlinear program of a MotionTask."""

    task: MotionTask
    scales: Float[np.ndarray, " n_obj"]
    stencil: Stencil
    totals: tuple[Total, ...]  # numbers of the whole motion: the objectives, divided by ``scales``, then bounded ones
    evaluators: Evaluators
    # values (inputs, instants) of the evaluators' inputs, 0 except for parameters
    inputs: Float[np.ndarray, "inputs instants"]
    variables: Int[np.ndarray, " variables"]  # rows of u, v and σ in the inputs
    peaks: int  # number of σ
    sums: int
    rows: tuple[str, ...]
    epigraph_rows: Int[np.ndarray, " pieces"]  # rows σ − piece of peaks
    epigraph_peaks: Int[np.ndarray, " pieces"]  # index of the peak of each of these rows
    limited: Int[np.ndarray, "limits 2"]  # variable (or row, after the variables) and instant of each limit
    sides: Float[np.ndarray, " limits"]  # 1 for a lower limit, −1 for an upper one
    bounds: Float[np.ndarray, " limits"]  # bound of each limit
    ranges: Float[np.ndarray, " limits"]  # unit of each violation
    kinks: int  # number of the ties of v and σ, which are the last entries of ``limited``
    whole_functions: tuple[WholeFunction, ...]

    @property
    def slacks(self) -> int:
        """Number of slack variables of a sample."""
        return self.evaluators.slacks

    @property
    def states(self) -> int:
        """Number of entries of u: positions and their rates, of all joints."""
        return self.stencil.orders * self.task.arm.dof

    @property
    def rates(self) -> int:
        """Number of entries of u, including the spline's if they are variables."""
        return len(self.variables) - len(self.evaluators.auxiliary)

    @property
    def slack_inputs(self) -> Int[np.ndarray, " slacks"]:
        """Indices of the inputs that are slack variables."""
        return self.variables[self.rates : self.rates + self.slacks]

    @property
    def peak_inputs(self) -> Int[np.ndarray, " peaks"]:
        """Indices of the inputs that are epigraph variables of peaks."""
        return self.variables[self.rates + self.slacks :]

    @property
    def elastic(self) -> int:
        """Number of limits, before the ties of slack and epigraph variables."""
        return len(self.sides) - self.kinks

    @property
    def upper(self) -> Float[np.ndarray, " totals"]:
        """Upper bounds of the totals."""
        return np.array([total.upper for total in self.totals])

    @property
    def objective_names(self) -> tuple[str, ...]:
        """Names of the totals, the task's objectives first."""
        return tuple(total.name for total in self.totals)

    @property
    def inequality_names(self) -> tuple[str, ...]:
        """Names of the limits, each a function of a sample; see ``limited``."""
        kinds = [f"{order} of {joint}" for order in ORDERS for joint in self.task.arm.joint_names]
        names = [*kinds[: self.states], *[""] * (len(self.variables) - self.states), *self.rows]
        return tuple(names[row] for row in self.limited[: self.elastic, 0])

    @property
    def kinked(self) -> tuple[str, ...]:
        """Names of totals with kinks; one general name if only other functions have kinks."""
        sparsity = self.evaluators.gradient_sparsity
        by_slack = (sparsity.columns >= self.rates) & (sparsity.columns < self.rates + self.slacks)
        kinked_functions = set(sparsity.rows[by_slack].tolist())
        names = tuple(total.name for total in self.totals if total.kind != "sum" or total.index in kinked_functions)
        return names or ("an absolute value, maximum or minimum",) * bool(self.slacks)

    def kinks_at(self, x: Float[np.ndarray, "time dof"]) -> tuple[str, ...]:
        """Return the names of functions that have a kink at x without an auxiliary variable."""
        kinked = self.evaluators.kinked
        if not kinked:
            return ()
        one, other = self.evaluators.kink_operands(self.values(x).inputs).reshape(len(kinked), 2, -1).swapaxes(0, 1)
        size = np.maximum(np.abs(one), np.abs(other)).max(axis=1, keepdims=True)
        meet = (np.abs(one - other) <= KINK_TOLERANCE * size).any(axis=1)
        names = function_names(self.totals, self.rows, self.epigraph_peaks)
        return tuple(dict.fromkeys(names[k] for k, touches in zip(kinked, meet, strict=True) if touches))

    @property
    def unsupported(self) -> tuple[str, ...]:
        """Names of totals that relate samples, other than sums and peaks."""
        return tuple(total.name for total in self.totals if total.kind == "whole")

    @property
    def rounding(self) -> float:
        """Rounding error of stationarity, not 0 if the motion ends at rest: its last sample is inexact."""
        return 1e-6 if self.task.ties_end else 0.0

    def project(self, x: Float[np.ndarray, "motions time dof"]) -> Float[np.ndarray, "motions time dof"]:
        """Return motions with the given start, and with an end at rest if the task has one."""
        if self.task.ties_end:  # the last sample is the posture nearest to the one before, without self-motion
            arm, tasks, target = self.task.arm, self.task.tasks, self.task.targets[-1]
            retracted = retract(arm, tasks, x[:, -2], target, normal_directions(arm, tasks, x[:, -1], target))
            ends = np.where(retracted.on_path[:, None], retracted.q, x[:, -1])
            x = np.concatenate([x[:, :-1], ends[:, None]], axis=1)
        return self.pin(x)

    def pin(self, x: Float[np.ndarray, "motions time dof"]) -> Float[np.ndarray, "motions time dof"]:
        """Return motions that begin exactly at the start, if one is given."""
        if self.task.start is None:
            return x
        q = x.copy()
        q[:, 0] = self.task.start  # retraction may have rounded it
        return q

    def evaluate(self, x: Float[np.ndarray, "time dof"]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return F, no h, and limits divided by their ranges."""
        values = self.values(x)
        return values.objectives, np.zeros(0), values.inequalities

    def values(self, q: Float[np.ndarray, "time dof"]) -> MotionValues:
        """Return the values of functions at a motion on the path."""
        inputs = self.inputs.copy()
        relative = q / joint_scales(self.task.arm)
        u = np.einsum("oik,ikj->oji", self.stencil.coefficients, relative[self.stencil.neighbours])
        for first in range(0, self.rates, self.states):  # first the curve, then the spline if its u are variables
            inputs[self.variables[first : first + self.states]] = u.reshape(self.states, -1)
        arrays = curve_arrays(self.task)
        curve = allocate_curve(arrays, self.states)
        project_instants(arrays, curve, inputs[: self.states])
        if self.slacks:
            inputs[self.slack_inputs] = self.evaluators.slack(inputs)
        values = self.evaluators.value(inputs)
        if self.peaks:
            peaks = np.full(self.peaks, -np.inf)
            np.maximum.at(peaks, self.epigraph_peaks, -values[self.sums + self.epigraph_rows].min(axis=1))
            inputs[self.peak_inputs] = peaks[:, None]
            values[self.sums + self.epigraph_rows] += peaks[self.epigraph_peaks, None]
        parts = tuple(each.value(self.whole_inputs(inputs)[:, None])[:, 0] for each in self.whole_functions)
        objectives = [
            values[total.index] @ self.task.weights
            if total.kind == "sum"
            else float(inputs[self.peak_inputs[total.index], 0])
            if total.kind == "peak"
            else self.whole_functions[total.index].combine(parts[total.index])
            for total in self.totals
        ]
        inequalities, ties = self.limit_values(inputs, values)
        limits = {"inequalities": inequalities, "ties": ties}
        return MotionValues(inputs=inputs, objectives=np.array(objectives), **limits, parts=parts, curve=curve)

    def linearise(self, q: Float[np.ndarray, "time dof"]) -> MotionLinearisation:
        """Return the values and first derivatives at a motion on the path."""
        task, samples, instants, n = self.task, len(q), len(self.task.instants), q.shape[1]
        values = self.values(q)
        linearise_instants(curve_arrays(task), values.curve)
        evaluators, sparsity = self.evaluators, self.evaluators.gradient_sparsity
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
        function_gradients = np.zeros((functions, len(self.variables), instants))
        function_gradients[sparsity.rows, sparsity.columns] = slopes[functions:]
        wholes = sum(each.epigraph_columns for each in self.whole_functions)
        basis, spline, by_samples = _basis(self, values.curve.chain, normal, wholes)
        gradients, ties, tie_rows, cones = _whole_functions(self, values, basis, wholes)
        for k, total in enumerate(self.totals):
            if total.kind == "sum":
                gradients[k] = basis.T @ (function_gradients[total.index] * task.weights).ravel()
            elif total.kind == "peak":
                gradients[k, self.stencil.unknowns + self.slacks * instants + total.index] = 1.0
        # the Jacobian of limits, divided by their ranges, and of ties of instants
        (which, at), variables = self.limited.T, len(self.variables)
        scales = np.append(self.ranges[: self.elastic], np.ones(len(which) - self.elastic))
        sides, simple = self.sides / scales, which < variables
        i, function = np.flatnonzero(~simple), self.sums + which[~simple] - variables
        nonzero = np.zeros((functions, variables), dtype=bool)
        nonzero[sparsity.rows, sparsity.columns] = True
        row, v = np.nonzero(nonzero[function])
        entries = np.concatenate([sides[simple], function_gradients[function[row], v, at[i[row]]] * sides[i[row]]])
        rows = np.concatenate([np.flatnonzero(simple), i[row]])
        columns = np.concatenate([which[simple] * instants + at[simple], v * instants + at[i[row]]])
        by_variables = sparse.coo_array((entries, (rows, columns)), shape=(len(which), variables * instants))
        limit_rows = structural_product(by_variables.tocsr(), basis)
        return MotionLinearisation(
            program=self,
            values=values,
            x=q,
            unknowns=self.stencil.unknowns,
            elastic=self.elastic,
            unit=float(np.sqrt(self.stencil.unknowns / normal.shape[2])),  # rad; arm lengths if prismatic
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

    def limit_values(
        self, inputs: Float[np.ndarray, "inputs instants"], values: Float[np.ndarray, "functions instants"]
    ) -> tuple[Float[np.ndarray, " inequalities"], Float[np.ndarray, " ties"]]:
        """Return the values of limits, divided by their ranges, and of ties."""
        every = np.concatenate([inputs[self.variables], values[self.sums :]])
        row, sample = self.limited.T
        limits = self.sides * (every[row, sample] - self.bounds)
        return limits[: self.elastic] / self.ranges[: self.elastic], limits[self.elastic :]

    def whole_inputs(self, inputs: Float[np.ndarray, "inputs instants"]) -> Float[np.ndarray, " whole_inputs"]:
        """Return all orders of u, (instants, dof) each, unused ones 0."""
        u = inputs[: self.states].reshape(self.stencil.orders, self.task.arm.dof, -1).swapaxes(1, 2)
        return np.concatenate([u.ravel(), np.zeros((4 - len(u)) * u[0].size)])

    def distance(self, x: np.ndarray, others: np.ndarray) -> Float[np.ndarray, " others"]:
        """Return the distances of a motion from others; see ``joint_distance``."""
        return joint_distance(self.task, x, others)


# The program to first order, along the self-motion of every sample.


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionLinearisation(Linearisation):
    """A program at a motion ``x``, to first order.

    Columns are steps of the self-motion [rad; arm lengths if prismatic], then slack variables of instants, and epigraph
    variables of peaks and functions of the whole motion.
    """

    program: MotionTerms
    values: MotionValues
    # null space of the tasks' Jacobian; sample s moves by ``normal``[s] times the unknowns of the sample
    normal: Float[np.ndarray, "time dof redundancy"]
    path_jacobian: Float[np.ndarray, "time rows dof"]
    basis: sparse.csr_array  # derivatives of all variables by the columns (variables · instants, columns)
    spline: sparse.csr_array  # derivatives of the spline's state by the columns
    samples: sparse.csr_array  # derivatives of q by the columns (dof · time, columns)
    # derivatives of the functions of an instant by its variables
    function_gradients: Float[np.ndarray, "functions variables instants"]
    sample_inputs: Float[np.ndarray, "inputs time"]  # inputs of evaluators at the samples

    def hessian(
        self,
        weights: Float[np.ndarray, " objectives"],
        multipliers: Float[np.ndarray, " inequalities"],
        cone_multipliers: tuple[np.ndarray, ...] = (),
    ) -> sparse.csr_array:
        """Return the Hessian (columns, columns) of the Lagrangian.

        The Lagrangian is weights · F + ν · h − multipliers · c − cone_multipliers · cones. The path's multipliers ν
        make its gradient 0 in the row space of the path's Jacobian. For a spline, h includes the equations of its
        instants and their first and second derivatives.
        """
        p, curve, path_jacobian = self.program, self.values.curve, self.path_jacobian
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
        """Return the motion on the path after a step; None if it is not reached."""
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


def _basis(
    program: MotionTerms, chain: np.ndarray, normal: np.ndarray, wholes: int
) -> tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array]:
    """Return the derivatives of variables, spline state, and q by the columns.

    Their rows are variables · instants, states · instants, and dof · time.
    """
    stencil, instants, r = program.stencil, len(program.task.instants), normal.shape[2]
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
    program: MotionTerms, values: MotionValues, basis: sparse.csr_array, wholes: int
) -> tuple[np.ndarray, list[np.ndarray], list[sparse.csr_array], list[Cone]]:
    """Return gradients, ties, rows of ties, and cones of the whole functions."""
    gradients, column = np.zeros((len(program.totals), basis.shape[1])), basis.shape[1] - wholes
    ties, tie_rows, cones = list[np.ndarray](), list[sparse.csr_array](), list[Cone]()
    if program.whole_functions:
        u, by_columns = program.whole_inputs(values.inputs), _whole_basis(program, basis)
    for k, total in enumerate(program.totals):
        if total.kind == "whole":
            each, parts = program.whole_functions[total.index], values.parts[total.index]
            gradients[k], new_ties, new_rows, new_cones = each.linearise(u, parts, by_columns, column)
            ties, tie_rows, cones = ties + new_ties, tie_rows + new_rows, cones + new_cones
            column += each.epigraph_columns
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
    """Return the multipliers of limits and ties, and of whole functions' parts."""
    count, elastic = len(program.sides), program.elastic
    by_limit = np.concatenate([multipliers[:elastic] / program.ranges[:elastic], multipliers[elastic:count]])
    by_part, tie, cone = list[np.ndarray](), count, 0
    whole_weights = [weight for total, weight in zip(program.totals, weights, strict=True) if total.kind == "whole"]
    for weight, each in zip(whole_weights, program.whole_functions, strict=True):
        part = np.zeros(each.parts)
        for group in each.slices:
            if group.stop - group.start == 1:
                part[group] = weight
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
    """Return second derivatives by variables · instants as one symmetric matrix."""
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


def joint_distance(task: MotionTask, q: np.ndarray, other: np.ndarray) -> Float[np.ndarray, "*batch"]:
    """Return the RMS joint distance over time between motions (..., time, dof).

    Angles are modulo 2π. The distance is in rad, or arm lengths if prismatic.
    """
    difference = (q - other) / joint_scales(task.arm)
    difference = np.where(task.arm.periodic, (difference + np.pi) % (2 * np.pi) - np.pi, difference)
    return np.asarray(np.sqrt(np.mean(np.sum(difference**2, axis=-1), axis=-1)))
