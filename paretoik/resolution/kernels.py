"""Motions followed step by step, compiled: any of the methods, on lanes of starts and parameters.

With weights D, A = J D Jᵀ + ρ²I and velocities v that the task wants, a step is D Jᵀ A⁻¹ v + z − B z, where z is the
sum of what pushes joints off their limits and of the gradients of criteria, and B is D Jᵀ A⁻¹ J; in the paper's variant
E Jᵀ A⁻¹ J E, D = E².
"""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run_first
from paretoik.compilation import compiled
from paretoik.resolution.matrices import decomposed, least_eigenvalue, substituted
from paretoik.resolution.traces import DAMPED, DONE, HELD, LONGEST, SHORTENED

ALIKE, LEAST_NORM, CLAMPING = 0, 1, 2  # how joints are weighed
FEEDBACK, REGION, DAMPING, BUFFER, REPULSION, BAND = 0, 1, 2, 3, 4, 5  # columns of settings
BEYOND = 1e12  # weight of a joint at its limit or past it


@compiled
def followed(first, last, parts, table, steps, limits, modes, settings, gains, signs, traces):
    """Follow the motions of lanes ``first`` to ``last``; everything that comes out is in ``traces``.

    ``table`` (time, rows) is what the program wants of every sample besides positions and rates, ``steps`` (time − 1)
    the times between them, ``limits`` (1 or time, dof, 3) lower, upper and the range between. ``modes``: how joints are
    weighed, whether the projector is the paper's, whether criteria are normalised. ``settings`` (lanes, columns);
    ``gains`` (lanes, criteria, 2): gain and rank, 0 for the first; ``signs`` (criteria, 3): −1 for what is maximised,
    reference, scale.
    """
    q, errors, damping, weights, coefficients, repulsion, projected, velocities, status = traces
    lower, upper, ranges = limits[..., 0], limits[..., 1], limits[..., 2]
    time, n = q.shape[1], q.shape[2]
    rows, criteria = errors.shape[2], signs.shape[0]
    weighing, printed, normalised = modes
    count = last - first
    given = np.zeros((4 * n + table.shape[1], count))
    found = np.empty((parts[3].shape[0], count))
    leaning = np.zeros((count, n))  # |∂H/∂qᵢ| at the last sample, of the weighted least norm
    J, A, factor, spare = (
        np.empty((rows, n)),
        np.empty((rows, rows)),
        np.empty((rows, rows)),
        np.empty((rows + 4, rows)),
    )
    D, E, z, pushes, wanted = np.ones(n), np.ones(n), np.empty(n), np.zeros(n), np.empty(rows)
    for k in range(time):
        for j in range(n):
            for lane in range(count):
                given[j, lane] = q[first + lane, k, j]
                given[n + j, lane] = velocities[first + lane, k - 1, j] if k > 0 else 0.0
        for j in range(table.shape[1]):
            for lane in range(count):
                given[4 * n + j, lane] = table[k, j]
        run_first(parts, given, found, count)
        for lane in range(count):
            here = first + lane
            for i in range(rows):
                errors[here, k, i] = found[i, lane]
            if k == time - 1:
                continue
            dt, at = steps[k], min(k, lower.shape[0] - 1)
            for i in range(rows):
                wanted[i] = found[rows + i, lane] / dt + settings[here, FEEDBACK] * found[i, lane]
                for j in range(n):
                    J[i, j] = found[2 * rows + i * n + j, lane]
            for j in range(n):
                place = q[here, k, j]
                if weighing == LEAST_NORM:
                    E[j] = _least_norm(place, lower[at, j], upper[at, j], ranges[at, j], leaning, lane, j)
                    weights[here, k, j] = 1.0 / E[j] if E[j] > 0 else BEYOND
                    D[j] = E[j]
                elif weighing == CLAMPING:
                    into = depth(place, lower[at, j], upper[at, j], settings[here, BUFFER] * ranges[at, j])
                    E[j] = clamping(into)
                    pushes[j] = -(1.0 - E[j]) * into * settings[here, REPULSION] if ranges[at, j] > 0.0 else 0.0
                    weights[here, k, j] = E[j]
                    D[j] = E[j] * E[j]
            for i in range(rows):
                for m in range(i + 1):
                    total = 0.0
                    for j in range(n):
                        total += J[i, j] * D[j] * J[m, j]
                    A[i, m] = A[m, i] = total
            squared = damped(A, settings[here, REGION], settings[here, DAMPING], factor, spare)
            for i in range(rows):
                A[i, i] += squared
            damping[here, k] = np.sqrt(squared)
            status[here, k] = DAMPED if squared > 0 else DONE
            if not decomposed(A, factor):
                farthest = 0.0
                for j in range(n):
                    repulsion[here, k, j] = velocities[here, k, j] = pushes[j]
                    farthest = max(farthest, abs(dt * pushes[j]))
                _shortened(here, k, farthest, velocities, repulsion, projected, status)
                status[here, k] = HELD
                for j in range(n):
                    q[here, k + 1, j] = q[here, k, j] + dt * velocities[here, k, j]
                continue
            substituted(factor, wanted)
            for j in range(n):
                total = 0.0
                for i in range(rows):
                    total += J[i, j] * wanted[i]
                velocities[here, k, j] = D[j] * total
            if weighing == CLAMPING:
                for j in range(n):
                    z[j] = pushes[j]
                _projected(J, D, E, factor, printed, z, wanted, repulsion[here, k])
                for j in range(n):
                    velocities[here, k, j] += repulsion[here, k, j]
            for c in range(criteria):
                base = 2 * rows + rows * n + c * (n + 1)
                sign, scale = signs[c, 0], signs[c, 2]
                share = gains[here, c, 0]
                if normalised:
                    share *= coefficient(sign * (signs[c, 1] - found[base, lane] / scale), sign, settings[here, BAND])
                for j in range(n + 1):
                    if not abs(found[base + j, lane]) < np.inf:
                        share = np.nan
                coefficients[here, k, c] = share
                if not abs(share) < np.inf:
                    continue
                for j in range(n):
                    priority = np.exp(-gains[here, c, 1] / criteria * E[j]) if normalised else 1.0
                    fixed = weighing == CLAMPING and not ranges[at, j] > 0.0
                    z[j] = 0.0 if fixed else -sign * share * priority * found[base + 1 + j, lane]
                _projected(J, D, E, factor, printed, z, wanted, projected[here, k, c])
                for j in range(n):
                    velocities[here, k, j] += projected[here, k, c, j]
            farthest = 0.0
            for j in range(n):
                farthest = np.maximum(farthest, abs(dt * velocities[here, k, j]))  # NaN stays
            _shortened(here, k, farthest, velocities, repulsion, projected, status)
            for j in range(n):
                q[here, k + 1, j] = q[here, k, j] + dt * velocities[here, k, j]


@compiled
def stepped(k, dt, slopes, wanted, free, q, velocities, repulsion, projected, status):
    """Take a step of every lane with what the task wants and, of ``free`` (lanes, dof), what it leaves.

    ``slopes`` (lanes, rows · dof) are the entries of the Jacobian, ``wanted`` (lanes, rows) the task's velocities.
    Source: Tringali & Cocuzza 2021, Eq. 2.
    """
    n, rows = free.shape[1], wanted.shape[1]
    A, factor, left, right = np.empty((rows, rows)), np.empty((rows, rows)), np.empty(rows), np.empty(rows)
    for lane in range(free.shape[0]):
        J = slopes[lane]
        for i in range(rows):
            left[i] = right[i] = wanted[lane, i]
            for j in range(n):
                left[i] -= J[i * n + j] * free[lane, j]
            for m in range(i + 1):
                total = 0.0
                for j in range(n):
                    total += J[i * n + j] * J[m * n + j]
                A[i, m] = A[m, i] = total
        status[lane, k] = DONE
        farthest = np.inf
        if decomposed(A, factor):
            substituted(factor, left)
            substituted(factor, right)
            farthest = 0.0
            for j in range(n):
                both, own = free[lane, j], 0.0
                for i in range(rows):
                    both += J[i * n + j] * left[i]
                    own += J[i * n + j] * right[i]
                velocities[lane, k, j], projected[lane, k, 0, j] = both, both - own
                farthest = np.maximum(farthest, abs(dt * both))  # NaN stays
        _shortened(lane, k, farthest, velocities, repulsion, projected, status)
        for j in range(n):
            q[lane, k + 1, j] = q[lane, k, j] + dt * velocities[lane, k, j]


@compiled
def _shortened(lane, k, farthest, velocities, repulsion, projected, status):
    """Shorten a step that is too long; take none where there is none."""
    if farthest < np.inf and farthest <= LONGEST:
        return
    held = not farthest < np.inf
    status[lane, k] = HELD if held else SHORTENED
    share = 0.0 if held else LONGEST / farthest
    for j in range(velocities.shape[2]):
        velocities[lane, k, j] = 0.0 if held else share * velocities[lane, k, j]
        repulsion[lane, k, j] = 0.0 if held else share * repulsion[lane, k, j]
        for c in range(projected.shape[2]):
            projected[lane, k, c, j] = 0.0 if held else share * projected[lane, k, c, j]


@compiled
def depth(place, lower, upper, width):
    """Return how deep in a buffer so wide a joint is: −1 at its lower limit or past it, 0 between, 1 at the upper.

    Source: Wan et al. 2018, Eqs. 16 and 20.
    """
    if not width < np.inf:
        return 0.0
    low, high = lower + width - place, place - (upper - width)
    if low >= 0 and low >= high:
        return -min(low / width, 1.0) if width > 0 else -1.0
    if high >= 0:
        return min(high / width, 1.0) if width > 0 else 1.0
    return 0.0


@compiled
def clamping(into):
    """Return the weight of a joint so deep in its buffer: from 1 outside to 0 at its limit. Source: Eq. 17."""
    d = abs(into)
    if d <= 0.0:
        return 1.0
    if d >= 1.0:
        return 0.0
    return 0.5 - 0.5 * np.tanh(1.0 / (1.0 - d) - 1.0 / d)


@compiled
def coefficient(exponent, sign, band):
    """Return the weight of a criterion: 1 where its normalised value is below ``band``, 0 above 1 − band.

    ``exponent`` is (reference − H) times the sign. Source: Eqs. 24 to 28, the cubic being 1 − 3s² + 2s³.
    """
    value = np.exp(min(exponent, 0.0)) if sign > 0 else 1.0 - np.exp(min(-exponent, 700.0))
    s = min(max((value - band) / (1.0 - 2.0 * band), 0.0), 1.0)
    return 1.0 - s * s * (3.0 - 2.0 * s)


@compiled
def _least_norm(place, lower, upper, between, leaning, lane, j):
    """Return the inverse weight of a joint, that of Eq. 10, and remember its slope for the next step.

    A joint with one limit is slowed in the half of its range that is next to it.
    """
    if not between < np.inf:
        return 1.0
    above, below = upper - place, place - lower
    if above == np.inf:
        above = max(between - below, below)
    elif below == np.inf:
        below = max(between - above, above)
    if above <= 0.0 or below <= 0.0:
        steep = BEYOND
    else:
        inside = between**2 * (below - above) / (4.0 * above * above * below * below)
        steep = min(abs(inside), BEYOND)
    nearer = steep >= leaning[lane, j]
    leaning[lane, j] = steep
    return 1.0 / (1.0 + steep) if nearer else 1.0


@compiled
def damped(A, region, most, factor, spare):
    """Return ρ² of Eq. 4 for A = J D Jᵀ, whose least eigenvalue is σ_min².

    That is looked for only where A − ε²I is not positive definite, for which it is enough to try.
    """
    if not (region > 0.0 and most > 0.0):
        return 0.0
    rows = A.shape[0]
    for i in range(rows):
        for m in range(rows):
            spare[i, m] = A[i, m]
        spare[i, i] -= region * region
    if decomposed(spare[:rows], factor):
        return 0.0
    least = max(least_eigenvalue(A, spare), 0.0)
    return max(most * most * (1.0 - least / (region * region)), 0.0)


@compiled
def _projected(J, D, E, factor, printed, z, room, found):
    """Write what is left of velocities where they may not disturb the task."""
    rows, n = J.shape
    for i in range(rows):
        total = 0.0
        for j in range(n):
            total += J[i, j] * (z[j] * E[j] if printed else z[j])
        room[i] = total
    substituted(factor, room)
    for j in range(n):
        total = 0.0
        for i in range(rows):
            total += J[i, j] * room[i]
        found[j] = z[j] - (E[j] if printed else D[j]) * total
