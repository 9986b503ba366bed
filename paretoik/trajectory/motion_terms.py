"""A motion's nonlinear program: one evaluation of all functions per instant.

The instants are the samples; with differences="spline" also the middles between samples. The variables of an instant
are u = (q, q̇, q̈, q⃛), slides in arm lengths (``joint_scales``), and slacks v if functions have kinks. Each peak has
an epigraph variable σ for the whole motion. u is linear in the positions of a few samples (``Stencil``); the u of a
spline is then projected onto the path (``curve_states``). If integrals have kinks, the spline's own u are variables
too, after those of the curve. Integral objectives are sums over instants of functions of these; limits bound u or other
functions, such as torque. The path is an equation in q at every sample. Functions that relate samples to one another
are ``WholeFunction``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from paretoik.autodiff.evaluator import Evaluator
from paretoik.robot.kinematics import joint_scales
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import normal_directions, retract
from paretoik.trajectory.curve_state_kernel import CurveWork, allocate_curve, project_instants
from paretoik.trajectory.curve_states import curve_arrays
from paretoik.trajectory.discretisation import Stencil
from paretoik.trajectory.functions import Total, WholeFunction, function_names

KINK_TOLERANCE = 1e-8  # share of the larger operand of a maximum, minimum or absolute value: nearer operands meet
ORDERS = ("position", "velocity", "acceleration", "jerk")


@dataclass(frozen=True, kw_only=True, eq=False)
class Sparsity:
    """Rows and columns of the derivatives that are not always 0."""

    rows: Int[np.ndarray, " entries"]
    columns: Int[np.ndarray, " entries"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Evaluators:
    """Compiled functions of a sample and their derivatives: sums first, then rows.

    inputs: number of inputs, in this order: u, then v and σ (at ``auxiliary``), parameters, multipliers
    multipliers: index of the first multiplier of path equations (of a sample, then of a curve's instant), of sums, and
        of rows
    slack: evaluator of the values of the ``slacks`` v at a point
    ties: number of rows that tie slacks, two per slack; they bound it from below if its entry of ``signs`` is 1, from
        above if it is −1
    kink_operands: evaluator of both operands of each kink without slack, which is in the function ``kinked``
    value: evaluator of sums and rows
    gradient: evaluator of sums and rows, then the entries of their gradients by variables
    hessian: evaluator of the entries of the Lagrangian's Hessian by u and v
    path: evaluator of path equations of a sample and their Jacobian by q
    path_hessian: evaluator of the Hessian (dof, dof) by q of the sum of path equations times multipliers
    """

    inputs: int
    auxiliary: Int[np.ndarray, " auxiliary"]
    multipliers: Int[np.ndarray, 3]
    slacks: int
    ties: int
    signs: tuple[int, ...]
    slack: Evaluator
    kinked: tuple[int, ...]
    kink_operands: Evaluator
    value: Evaluator
    gradient: Evaluator
    gradient_sparsity: Sparsity
    hessian: Evaluator
    hessian_sparsity: Sparsity
    path: Evaluator
    path_hessian: Evaluator


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionValues:
    """Objectives F and constraints of a program at a motion.

    inputs: inputs of the evaluators, with slack and epigraph variables at their true values
    inequalities: limits divided by their ranges, positive if satisfied
    ties: inequalities that tie slack and epigraph variables
    parts: smooth parts of every function of the whole motion
    curve: state of the motion's curve
    """

    inputs: Float[np.ndarray, "inputs instants"]
    objectives: Float[np.ndarray, " objectives"]
    inequalities: Float[np.ndarray, " inequalities"]
    ties: Float[np.ndarray, " ties"]
    parts: tuple[np.ndarray, ...]
    curve: CurveWork


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionTerms:
    """The nonlinear program of a MotionTask.

    totals: numbers of the whole motion: the objectives, divided by ``scales``, then bounded ones
    inputs: values (inputs, instants) of the evaluators' inputs, 0 except for parameters
    variables: rows of u, v and σ in the inputs
    peaks: number of σ
    limited: variable (or row, after the variables) and instant of each limit
    sides: 1 for a lower limit, −1 for an upper one
    bounds: bound of each limit
    ranges: unit of each violation
    kinks: number of the ties of v and σ, which are the last entries of ``limited``
    epigraph_rows, epigraph_peaks: rows σ − piece of peaks, and the index of the peak of each
    """

    task: MotionTask
    scales: Float[np.ndarray, " n_obj"]
    stencil: Stencil
    totals: tuple[Total, ...]
    evaluators: Evaluators
    inputs: Float[np.ndarray, "inputs instants"]
    variables: Int[np.ndarray, " variables"]
    peaks: int
    sums: int
    rows: tuple[str, ...]
    epigraph_rows: Int[np.ndarray, " pieces"]
    epigraph_peaks: Int[np.ndarray, " pieces"]
    limited: Int[np.ndarray, "limits 2"]
    sides: Float[np.ndarray, " limits"]
    bounds: Float[np.ndarray, " limits"]
    ranges: Float[np.ndarray, " limits"]
    kinks: int
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
        """Number of entries of u, with the spline's if they are variables."""
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
        """Number of limits, which come before the ties.

        Ties are the inequalities of slack and epigraph variables.
        """
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
        """Names of totals with kinks.

        If only other functions have kinks, it is a general name.
        """
        sparsity = self.evaluators.gradient_sparsity
        by_slack = (sparsity.columns >= self.rates) & (sparsity.columns < self.rates + self.slacks)
        kinked_functions = set(sparsity.rows[by_slack].tolist())
        names = tuple(total.name for total in self.totals if total.kind != "sum" or total.index in kinked_functions)
        return names or ("an absolute value, maximum or minimum",) * bool(self.slacks)

    def kinks_at(self, x: Float[np.ndarray, "time dof"]) -> tuple[str, ...]:
        """Return the names of objectives and limits with a kink.

        The kink is at this motion, and no auxiliary variable represents it.
        """
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
        """Rounding error of stationarity.

        It is larger if a motion stops: its last sample is known only up to a step.
        """
        return 1e-6 if self.task.ties_end else 0.0

    def project(self, x: Float[np.ndarray, "motions time dof"]) -> Float[np.ndarray, "motions time dof"]:
        """Return motions that begin at the start and end at rest.

        Each only if the task requires it.
        """
        if self.task.ties_end:  # the last step is the shortest that the path allows, without self-motion
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

    def evaluate(
        self, x: Float[np.ndarray, "time dof"]
    ) -> tuple[Float[np.ndarray, " objectives"], Float[np.ndarray, " equalities"], Float[np.ndarray, " inequalities"]]:
        """Return F, h and c of a motion.

        h is empty, because motions are on the path; c are the limits divided by their ranges.
        """
        values = self.values(x)
        return values.objectives, np.zeros(0), values.inequalities

    def values(self, q: Float[np.ndarray, "time dof"]) -> MotionValues:
        """Return objectives and constraints at a motion, with evaluator inputs.

        The motion must be on the path.
        """
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
        return MotionValues(
            inputs=inputs,
            objectives=np.array(objectives),
            inequalities=inequalities,
            ties=ties,
            parts=parts,
            curve=curve,
        )

    def limit_values(
        self, inputs: Float[np.ndarray, "inputs instants"], values: Float[np.ndarray, "functions instants"]
    ) -> tuple[Float[np.ndarray, " inequalities"], Float[np.ndarray, " ties"]]:
        """Return limits and ties from inputs and function values.

        Limits are divided by their ranges.
        """
        every = np.concatenate([inputs[self.variables], values[self.sums :]])
        row, sample = self.limited.T
        limits = self.sides * (every[row, sample] - self.bounds)
        return limits[: self.elastic] / self.ranges[: self.elastic], limits[self.elastic :]

    def whole_inputs(self, inputs: Float[np.ndarray, "inputs instants"]) -> Float[np.ndarray, " whole_inputs"]:
        """Return the inputs of functions of the whole motion.

        They are position, velocity, acceleration and jerk, (instants, dof) each; unused orders are 0.
        """
        u = inputs[: self.states].reshape(self.stencil.orders, self.task.arm.dof, -1).swapaxes(1, 2)
        return np.concatenate([u.ravel(), np.zeros((4 - len(u)) * u[0].size)])

    def distance(
        self, x: Float[np.ndarray, "time dof"], others: Float[np.ndarray, "others time dof"]
    ) -> Float[np.ndarray, " others"]:
        """Return the distance of a motion from others.

        It is the RMS over time [rad, the arm's length], angles modulo 2π.
        """
        return joint_distance(self.task, x, others)


def joint_distance(task: MotionTask, q: np.ndarray, other: np.ndarray) -> Float[np.ndarray, "*batch"]:
    """Return the RMS joint distance between motions over time.

    Motions are (..., time, dof); angles are modulo 2π. The distance is in rad, slides in arm lengths.
    """
    difference = (q - other) / joint_scales(task.arm)
    difference = np.where(task.arm.periodic, (difference + np.pi) % (2 * np.pi) - np.pi, difference)
    return np.asarray(np.sqrt(np.mean(np.sum(difference**2, axis=-1), axis=-1)))
