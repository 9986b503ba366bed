"""Motions as arrays for compiled code: program and interior-point workspace."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation.numba_cache import compiled
from paretoik.trajectory.curve_state_kernel import Curve, CurveWork, allocate_curve
from paretoik.trajectory.discretisation import Stencil


class MotionKernel(NamedTuple):
    """A MotionProgram of sums and peaks as arrays.

    See ``MotionProgram``. A point has a row of joint positions per sample,
    divided by ``scales``, then rows with the epigraph variables σ of its peaks. Path equations are evaluated at the
    samples, functions at all instants. Functions of an instant are sums, limited rows (with the rows σ − piece of
    peaks), then the ties of slacks v.
    """

    value: tuple[np.ndarray, ...]
    slope: tuple[np.ndarray, ...]
    slope_of: np.ndarray
    slope_by: np.ndarray
    curvature: tuple[np.ndarray, ...]
    second_i: np.ndarray
    second_j: np.ndarray
    track: tuple[np.ndarray, ...]
    track_curvature: tuple[np.ndarray, ...]
    curve: Curve
    kinked: bool  # whether the spline's u are variables too, after the curve's
    stencil: Stencil
    stride: int  # number of instants from one sample to the next
    stops: bool  # whether the last sample is the posture nearest to the one before
    ones: np.ndarray
    quadrature: np.ndarray
    inputs: np.ndarray
    multipliers: np.ndarray
    limited: np.ndarray  # (limits, 2): variable or row, and sample
    factors: np.ndarray  # (limits,): 1 / range for a lower limit, −1 / range for an upper one
    bounds: np.ndarray  # (limits,)
    scales: np.ndarray  # (dof,): units of joints
    totals: np.ndarray  # (totals,): index of the sum, or −1 − index of the peak
    peak_inputs: np.ndarray  # (peaks,)
    row_peaks: np.ndarray  # (rows,): index of the row's peak, −1 if it has none
    kinks: np.ndarray  # (kinks, 4): input, variable, sign and first tie of a slack v, innermost first
    nesting: int  # largest depth of nested kinks
    smoothing: float  # width of kinks, in barriers μ times sizes of arguments: number of kinks at all instants
    longest_step: float = 0.4  # largest step of a joint [rad, arm's length]: too short to skip to another branch
    penalty: float = 10.0  # penalty of a violation by a whole range, in sizes of the objective
    implied_slacks: bool = True
    large_multiplier: float = np.inf
    dual_fraction: float = 0.25  # largest share of the way to its bounds that a kink's multiplier moves in a step
    least_smoothing: float = 1e-9  # least width of a kink, in sizes of its argument: rounding error


class Workspace(NamedTuple):
    """Arrays that steps write.

    Numbers: U variables of an instant, V slacks, K sums, G limited rows, r unknowns per sample.
    """

    inputs: np.ndarray
    curve: CurveWork
    path_inputs: np.ndarray  # (inputs, time)
    tracked: np.ndarray  # path equations and their Jacobian
    track_seconds: np.ndarray  # (dof², time): second derivatives of the path equations, times their multipliers
    tangent: np.ndarray  # (time, dof, r)
    normal: np.ndarray  # (time, dof, rows)
    triangle: np.ndarray  # (time, rows, rows)
    values: np.ndarray  # (K + G + 2V, instants)
    slopes: np.ndarray
    seconds: np.ndarray
    gradients: np.ndarray  # (K + G + 2V, U + V + peaks, instants): gradients of functions, by u, then v, then σ
    objective_gradients: np.ndarray  # (K, time, dof): gradients of sums by q
    by_row: np.ndarray  # (U + G, instants): one number per variable and limited row
    gradient_u: np.ndarray  # (U, instants)
    gradient_spline: np.ndarray  # (states, instants): gradient by the spline's state
    gradient_q: np.ndarray  # (time, dof)
    du: np.ndarray  # (U, instants)
    projected: np.ndarray  # (unknowns,)
    widths: np.ndarray  # (V, 2): size of a kink's argument, and width of its smoothing
    arguments: np.ndarray  # (V, instants): half the difference of a kink's pieces
    arguments_at: np.ndarray  # (V, instants): arguments at the last linearisation
    slopes_at: np.ndarray  # (V, instants): λ there, derivative of the argument's smoothed absolute value
    duals: np.ndarray  # (V, instants): λ̂, predicted by Newton's method
    bends: np.ndarray  # (V, instants): second derivative of the smoothed absolute value, from λ and its dual
    slack_gradients: np.ndarray  # (V, U, instants)
    slack_weights: np.ndarray  # (V, instants): weight of a kink's second derivative in the Lagrangian


@compiled
def sample_count(kernel):
    """Return the number of samples."""
    return (len(kernel.ones) - 1) // kernel.stride + 1


@compiled
def allocate(kernel, n):
    """Return the workspace for motions of n joints."""
    samples, instants = sample_count(kernel), len(kernel.ones)
    slacks, rows = len(kernel.kinks), len(kernel.curve.row_scales)
    states = kernel.stencil.coefficients.shape[0] * n
    variables = 2 * states if kernel.kinked else states
    sums = kernel.multipliers[2] - kernel.multipliers[1]
    limited = len(kernel.row_peaks)
    functions = sums + limited + 2 * slacks
    by_slack = np.zeros((6, slacks, instants))
    return Workspace(
        kernel.inputs.copy(),
        allocate_curve(kernel.curve, states),
        kernel.inputs[:, :: kernel.stride].copy(),
        np.empty((rows + rows * n, samples)),
        np.empty((n * n, samples)),
        np.zeros((samples, n, n - rows)),
        np.zeros((samples, n, rows)),
        np.zeros((samples, rows, rows)),
        np.empty((functions, instants)),
        np.empty((functions + len(kernel.slope_of), instants)),
        np.empty((len(kernel.second_i), instants)),
        np.zeros((functions, variables + slacks + len(kernel.peak_inputs), instants)),
        np.zeros((sums, samples, n)),
        np.zeros((variables + limited, instants)),
        np.zeros((variables, instants)),
        np.zeros((states, instants)),
        np.zeros((samples, n)),
        np.zeros((variables, instants)),
        np.zeros(kernel.stencil.unknowns),
        np.zeros((slacks, 2)),
        by_slack[0],
        by_slack[1],
        by_slack[2],
        by_slack[3],
        by_slack[4],
        np.zeros((slacks, variables, instants)),
        by_slack[5],
    )
