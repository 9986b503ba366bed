"""Compiled steps of all methods, on a batch of starts and parameters.

With weights D, A = J D Jᵀ + ρ²I and task velocities v, a step is D Jᵀ A⁻¹ v + z − B z, where z is the sum of the
repulsion from joint limits and of the gradients of criteria, and B is D Jᵀ A⁻¹ J; in the paper's variant
E Jᵀ A⁻¹ J E, D = E².
"""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run_first
from paretoik.compilation.numba_cache import compiled
from paretoik.nlp.linear_algebra import cholesky, rotate_back, solve_cholesky, triangularise, weighted_square
from paretoik.resolution.protocol import CLAMPING, DAMPED, DONE, HELD, LEAST_NORM, SHORTENED, UNWEIGHTED

# Weights of joints near their position limits, and of criteria; compiled
#
# Equation numbers are those of Wan et al. 2018.


@compiled
def buffer_depth(q, lower, upper, width):
    """Return a joint's depth in a buffer: −1 at the lower limit, 0 between, 1 at the upper (Eqs. 16, 20)."""
    if not width < np.inf:
        return 0.0
    low, high = lower + width - q, q - (upper - width)
    if low >= 0 and low >= high:
        return -min(low / width, 1.0) if width > 0 else -1.0
    if high >= 0:
        return min(high / width, 1.0) if width > 0 else 1.0
    return 0.0


@compiled
def clamping_weight(depth):
    """Return a joint's weight: 1 outside its buffer, 0 at its limit (Eq. 17)."""
    d = abs(depth)
    if d <= 0.0:
        return 1.0
    if d >= 1.0:
        return 0.0
    return 0.5 - 0.5 * np.tanh(1.0 / (1.0 - d) - 1.0 / d)


@compiled
def criterion_weight(exponent, sign, band):
    """Return a criterion's weight: 1 if its normalised value is below ``band``, 0 above 1 − band.

    ``exponent`` is (reference − H) times the sign. Source: Eqs. 24 to 28, the cubic being 1 − 3s² + 2s³.
    """
    value = np.exp(min(exponent, 0.0)) if sign > 0 else 1.0 - np.exp(min(-exponent, 700.0))
    s = min(max((value - band) / (1.0 - 2.0 * band), 0.0), 1.0)
    return 1.0 - s * s * (3.0 - 2.0 * s)


@compiled
def least_norm_weight(q, lower, upper, span, previous_slope, j):
    """Return the inverse weight of joint j (Eq. 10), and write its slope for the next step.

    A joint with one limit is slowed in the half of its range next to the limit.
    """
    if not span < np.inf:
        return 1.0
    largest = 1e12  # slope at a limit, where the criterion grows without bounds
    above, below = upper - q, q - lower
    if above == np.inf:
        above = max(span - below, below)
    elif below == np.inf:
        below = max(span - above, above)
    if above <= 0.0 or below <= 0.0:
        slope = largest
    else:
        derivative = span**2 * (below - above) / (4.0 * above * above * below * below)  # Eq. 11
        slope = min(abs(derivative), largest)
    approaching = slope >= previous_slope[j]
    previous_slope[j] = slope
    return 1.0 / (1.0 + slope) if approaching else 1.0


# Steps of all methods along a path; compiled.


FEEDBACK, REGION, DAMPING, BUFFER, REPULSION, BAND = 0, 1, 2, 3, 4, 5  # columns of settings


@compiled
def follow(first, last, parts, table, steps, limits, method, traces):
    """Follow the motions ``first`` to ``last`` of a batch, and write the ``traces``.

    table: data (time, rows) of the step program
    steps: times between samples (time − 1)
    limits: lower limit, upper limit and range (1 or time, dof, 3)
    method: modes (kind of joint weights, whether the projector is the paper's, whether criteria are normalised),
        settings (motions, columns), gain and rank of each criterion, 0 for the first (motions, criteria, 2), and sign
        (−1 if maximised), reference and scale of each criterion (criteria, 3)
    """
    modes, settings, gains, scaling = method
    q, errors, damping, weights, coefficients, repulsion, projected, velocities, status = traces
    time, n = q.shape[1], q.shape[2]
    rows, criteria = errors.shape[2], scaling.shape[0]
    weighting, printed, _ = modes
    count = last - first
    inputs = np.zeros((4 * n + table.shape[1], count))
    outputs = np.empty((parts[3].shape[0], count))
    previous_slope = np.zeros((count, n))  # |∂H/∂qᵢ| at the last sample, for the weighted least norm
    J, A, factor = np.empty((rows, n)), np.empty((rows, rows)), np.empty((rows, rows))
    work, v = np.empty((rows, rows)), np.empty(rows)
    reflectors, triangle, scaled = np.empty((rows, n)), np.zeros((rows, rows)), np.empty(n)
    D, E, z, repulsive = np.ones(n), np.ones(n), np.empty(n), np.zeros(n)
    for k in range(time):
        _fill_inputs(k, first, q, velocities, table, inputs)
        run_first(parts, inputs, outputs, count)
        for local in range(count):
            motion = first + local
            for i in range(rows):
                errors[motion, k, i] = outputs[i, local]
            if k == time - 1:
                continue
            dt, at = steps[k], min(k, limits.shape[0] - 1)
            _read_task(outputs[:, local], dt, settings[motion, FEEDBACK], v, J)
            slope, joints = previous_slope[local], (D, E, repulsive)
            _weigh_joints(weighting, q[motion, k], limits[at], settings[motion], slope, joints, weights[motion, k])
            weighted_square(J, D, A)
            squared = squared_damping(A, settings[motion, REGION], settings[motion, DAMPING], factor, work)
            for i in range(rows):
                A[i, i] += squared
            damping[motion, k] = np.sqrt(squared)
            status[motion, k] = DAMPED if squared > 0 else DONE
            if not cholesky(A, factor):
                repulsion[motion, k] = repulsive
                velocities[motion, k] = repulsive
                _take_step(motion, k, dt, _largest_move(dt, repulsive), q, velocities, repulsion, projected, status)
                status[motion, k] = HELD
                continue
            if weighting == UNWEIGHTED or squared > 0.0:
                solve_cholesky(factor, v)
                _solve_task(J, D, v, velocities[motion, k])
            else:
                solve_weighted_task(J, D, v, reflectors, triangle, scaled, velocities[motion, k])
            if weighting == CLAMPING:
                z[:] = repulsive
                _project(J, D, E, factor, printed, z, v, repulsion[motion, k])
                _add(velocities[motion, k], repulsion[motion, k])
            for c in range(criteria):
                gradient = outputs[2 * rows + rows * n + c * (n + 1) :, local]
                gain = _criterion_gain(gradient, modes, settings[motion], gains[motion, c], scaling[c], n)
                coefficients[motion, k, c] = gain
                if not abs(gain) < np.inf:
                    continue
                _descend(gradient, gain, modes, gains[motion, c, 1] / criteria, scaling[c, 0], limits[at], E, z)
                _project(J, D, E, factor, printed, z, v, projected[motion, k, c])
                _add(velocities[motion, k], projected[motion, k, c])
            largest = _largest_move(dt, velocities[motion, k])
            _take_step(motion, k, dt, largest, q, velocities, repulsion, projected, status)


@compiled
def _fill_inputs(k, first, q, velocities, table, inputs):
    """Write the inputs of the step program at sample k: positions, last velocities, the sample's data."""
    n, count = q.shape[2], inputs.shape[1]
    for j in range(n):
        for local in range(count):
            inputs[j, local] = q[first + local, k, j]
            inputs[n + j, local] = velocities[first + local, k - 1, j] if k > 0 else 0.0
    for j in range(table.shape[1]):
        for local in range(count):
            inputs[4 * n + j, local] = table[k, j]


@compiled
def _read_task(outputs, dt, feedback, v, J):
    """Write task velocities and Jacobian from the program's outputs (Eqs. 32, 33)."""
    rows, n = J.shape
    for i in range(rows):
        v[i] = outputs[rows + i] / dt + feedback * outputs[i]
        for j in range(n):
            J[i, j] = outputs[2 * rows + i * n + j]


@compiled
def _solve_task(J, D, multipliers, velocities):
    """Write D Jᵀ A⁻¹ v, given A⁻¹ v."""
    rows, n = J.shape
    for j in range(n):
        total = 0.0
        for i in range(rows):
            total += J[i, j] * multipliers[i]
        velocities[j] = D[j] * total


@compiled
def solve_weighted_task(J, D, v, reflectors, triangle, scaled, velocities):
    """Write D^½ (J D^½)⁺ v, exact up to rounding for all weights.

    A⁻¹ v is very large if joints are near their limits; Householder reflections of D^½ Jᵀ, largest rows first, avoid
    it (Cox & Higham 1998).
    """
    rows, n = J.shape
    order = np.argsort(-D)
    for i in range(rows):
        for j in range(n):
            reflectors[i, j] = np.sqrt(D[order[j]]) * J[i, order[j]]
    triangularise(reflectors, triangle)  # the matrix A, the square of D^½ Jᵀ, is positive definite
    scaled[:] = 0.0
    for i in range(rows):
        total = v[i]
        for k in range(i):
            total -= triangle[k, i] * scaled[k]
        scaled[i] = total / triangle[i, i]
    rotate_back(reflectors, scaled)
    for j in range(n):
        velocities[order[j]] = np.sqrt(D[order[j]]) * scaled[j]


@compiled
def _add(velocities, term):
    for j in range(velocities.shape[0]):
        velocities[j] += term[j]


@compiled
def _largest_move(dt, velocities):
    """Return the largest move of a joint in a step, NaN if undefined."""
    largest = 0.0
    for j in range(velocities.shape[0]):
        largest = np.maximum(largest, abs(dt * velocities[j]))  # NaN stays
    return largest


@compiled
def _weigh_joints(weighting, q, limits, settings, previous_slope, joints, weights):
    """Write joint weights, and D, E and the repulsion from limits (Wan et al. 2018, Eqs. 15 to 20)."""
    D, E, repulsive = joints
    for j in range(q.shape[0] if weighting != UNWEIGHTED else 0):
        lower, upper, span = limits[j, 0], limits[j, 1], limits[j, 2]
        if weighting == LEAST_NORM:
            D[j] = E[j] = least_norm_weight(q[j], lower, upper, span, previous_slope, j)
            weights[j] = 1.0 / E[j]
        else:
            depth = buffer_depth(q[j], lower, upper, settings[BUFFER] * span)
            E[j] = clamping_weight(depth)
            repulsive[j] = -(1.0 - E[j]) * depth * settings[REPULSION] if span > 0.0 else 0.0
            weights[j] = E[j]
            D[j] = E[j] * E[j]


@compiled
def _criterion_gain(outputs, modes, settings, gains, scaling, n):
    """Return a criterion's gain, normalised or not; NaN if its value or gradient is not finite."""
    gain = gains[0]
    if modes[2]:
        sign = scaling[0]
        gain *= criterion_weight(sign * (scaling[1] - outputs[0] / scaling[2]), sign, settings[BAND])
    for j in range(n + 1):
        if not abs(outputs[j]) < np.inf:
            gain = np.nan
    return gain


@compiled
def _descend(outputs, gain, modes, rank, sign, limits, E, z):
    """Write the velocities that decrease a criterion (Wan et al. 2018, Eqs. 12 and 29)."""
    weighting, _, normalised = modes
    for j in range(z.shape[0]):
        priority = np.exp(-rank * E[j]) if normalised else 1.0
        fixed = weighting == CLAMPING and not limits[j, 2] > 0.0
        z[j] = 0.0 if fixed else -sign * gain * priority * outputs[1 + j]


@compiled
def step(k, dt, jacobian, task_velocity, secondary, q, velocities, repulsion, projected, status):
    """Take a step of every motion.

    The velocities are those of the task plus the projection of ``secondary`` (motions, dof). ``jacobian`` (motions,
    rows · dof), ``task_velocity`` (motions, rows). Source: Tringali & Cocuzza 2021, Eq. 2.
    """
    n, rows = secondary.shape[1], task_velocity.shape[1]
    A, factor, both, task_only = np.empty((rows, rows)), np.empty((rows, rows)), np.empty(rows), np.empty(rows)
    unweighted = np.ones(n)
    for motion in range(secondary.shape[0]):
        J = jacobian[motion].reshape((rows, n))
        weighted_square(J, unweighted, A)
        for i in range(rows):
            both[i] = task_only[i] = task_velocity[motion, i]
            for j in range(n):
                both[i] -= J[i, j] * secondary[motion, j]
        status[motion, k] = DONE
        largest = np.inf
        if cholesky(A, factor):
            solve_cholesky(factor, both)
            solve_cholesky(factor, task_only)
            largest = 0.0
            for j in range(n):
                velocity, shortest = secondary[motion, j], 0.0
                for i in range(rows):
                    velocity += J[i, j] * both[i]
                    shortest += J[i, j] * task_only[i]
                velocities[motion, k, j], projected[motion, k, 0, j] = velocity, velocity - shortest
                largest = np.maximum(largest, abs(dt * velocity))  # NaN stays
        _take_step(motion, k, dt, largest, q, velocities, repulsion, projected, status)


@compiled
def _take_step(motion, k, dt, largest, q, velocities, repulsion, projected, status):
    """Take a step, shortened if its largest move is too long, and none if the move is not finite."""
    limit = 1.0  # rad or m: largest move of a joint in one step; farther away the Jacobian is wrong
    if not (largest < np.inf and largest <= limit):
        stops = not largest < np.inf
        status[motion, k] = HELD if stops else SHORTENED
        share = 0.0 if stops else limit / largest
        for j in range(velocities.shape[2]):
            velocities[motion, k, j] = 0.0 if stops else share * velocities[motion, k, j]
            repulsion[motion, k, j] = 0.0 if stops else share * repulsion[motion, k, j]
            for c in range(projected.shape[2]):
                projected[motion, k, c, j] = 0.0 if stops else share * projected[motion, k, c, j]
    for j in range(q.shape[2]):
        q[motion, k + 1, j] = q[motion, k, j] + dt * velocities[motion, k, j]


@compiled
def squared_damping(A, region, highest, factor, work):
    """Return ρ² for A = J D Jᵀ (Wan et al. 2018, Eq. 4).

    The smallest eigenvalue of A is σ_min². The eigenvalue is computed only if A − ε²I is not positive definite.
    """
    if not (region > 0.0 and highest > 0.0):
        return 0.0
    rows = A.shape[0]
    for i in range(rows):
        for m in range(rows):
            work[i, m] = A[i, m]
        work[i, i] -= region * region
    if cholesky(work, factor) or not np.isfinite(A).all():
        return 0.0
    smallest = max(np.linalg.eigvalsh(A)[0], 0.0)
    return max(highest * highest * (1.0 - smallest / (region * region)), 0.0)


@compiled
def _project(J, D, E, factor, printed, z, work, projected):
    """Write the projection of z onto the null space of the task."""
    rows, n = J.shape
    for i in range(rows):
        total = 0.0
        for j in range(n):
            total += J[i, j] * (z[j] * E[j] if printed else z[j])
        work[i] = total
    solve_cholesky(factor, work)
    for j in range(n):
        total = 0.0
        for i in range(rows):
            total += J[i, j] * work[i]
        projected[j] = z[j] - (E[j] if printed else D[j]) * total
