"""Elastic inequalities of an interior-point method, compiled.

    minimise    f(x) + Σ (penalty · t − μ log s − μ log t)
    subject to  c(x) − s + t = r,  s > 0,  t > 0;  the residual r goes to 0

The multiplier of s is z, that of t is penalty − z. For a given c the best s and t are known (``slacks``). With these,
r is 0 and the constraints add only a smooth function of c, which tends to penalty · max(0, −c) as μ falls.
Source: Nocedal & Wright, Numerical Optimization, section 17.2 (exact penalty) and chapter 19 (barrier).
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation.numba_cache import compiled

ASYMPTOTE = 1e6  # |penalty · c| / μ above which the exact root loses its digits to cancellation
MULTIPLIER_ROUNDING = 1e-15  # least distance of z from 0 and from the penalty, as a share of the penalty


@compiled
def slacks(c, mu, penalty):
    """Return the (s, t) with s − t = c that minimise penalty · t − μ log s − μ log t."""
    root = np.sqrt((penalty * c) ** 2 + 4 * mu * mu)
    if c > 0:
        t = (2 * mu - penalty * c + root) / (2 * penalty) if penalty * c < ASYMPTOTE * mu else mu / penalty
        return c + t, t
    s = (2 * mu + penalty * c + root) / (2 * penalty) if -penalty * c < ASYMPTOTE * mu else mu / penalty
    return s, s - c


@compiled
def reset_slacks(c, mu, penalty, s, t, r):
    """Write the best slacks; their residual is 0."""
    for i in range(len(c)):
        s[i], t[i] = slacks(c[i], mu, penalty)
        r[i] = 0.0


@compiled
def begin_slacks(c, mu, penalty, shortest, s, t, r):
    """Write slacks s of at least ``shortest``, for any violation, and residuals."""
    for i in range(len(c)):
        t[i] = mu / penalty
        s[i] = max(c[i] + t[i], shortest)
        r[i] = min(0.0, c[i] + t[i] - s[i])


@compiled
def step_slacks(c, s, t, ds, dt, length, trial_s, trial_t, trial_r):
    """Write slacks after a step, negative if it is too long, and their residuals.

    A positive residual is added to s, and becomes 0.
    """
    for i in range(len(c)):
        trial_s[i], trial_t[i] = s[i] + length * ds[i], t[i] + length * dt[i]
        trial_r[i] = c[i] - trial_s[i] + trial_t[i]
        if trial_r[i] > 0.0:
            trial_s[i] += trial_r[i]
            trial_r[i] = 0.0


@compiled
def merit_terms(s, t, mu, penalty):
    """Return the slacks' part of the merit function; a large c adds only a barrier term."""
    total = 0.0
    for i in range(len(s)):
        total += penalty * t[i] - mu * np.log(s[i]) - mu * np.log(t[i] * penalty / mu)
    return total


@compiled
def central_multipliers(s, mu, penalty, z):
    """Write the multipliers on the central path, s z = μ."""
    for i in range(len(s)):
        z[i] = min(mu / s[i], (1 - MULTIPLIER_ROUNDING) * penalty)


@compiled
def approach_central_path(s, mu, penalty, factor, z):
    """Bring multipliers within a factor of the central path; used if rounding prevents a better x."""
    for i in range(len(s)):
        central = mu / s[i]
        z[i] = min(max(z[i], central / factor), central * factor, (1 - MULTIPLIER_ROUNDING) * penalty)


@compiled
def barrier_terms(s, t, r, z, mu, penalty, stiffness, force):
    """Write each constraint's stiffness Σ, and ``force``, which replaces z in Newton's right side."""
    for i in range(len(s)):
        w = penalty - z[i]
        stiffness[i] = 1.0 / (s[i] / z[i] + t[i] / w)
        force[i] = z[i] + stiffness[i] * (mu / z[i] - s[i] - mu / w + t[i] - r[i])


@compiled
def newton_slacks(s, t, r, z, dz, dc, mu, penalty, ds, dt):
    """Write Newton's steps of the slacks.

    They linearise s z = μ and t (penalty − z) = μ. The step of the longer slack follows from dc − ds + dt = −r, because
    this has smaller rounding errors.
    """
    for i in range(len(s)):
        w = penalty - z[i]
        ds[i] = mu / z[i] - s[i] - s[i] / z[i] * dz[i]
        if s[i] < t[i]:
            dt[i] = ds[i] - dc[i] - r[i]
        else:
            dt[i] = mu / w - t[i] + t[i] / w * dz[i]
            ds[i] = dc[i] + dt[i] + r[i]


@compiled
def limit_implied_step(c, s, dc, mu, length, fraction):
    """Return the merit terms' slope along dc and a step length with all s > 0, for slacks that follow c.

    Fraction to the boundary: Nocedal & Wright, Eq. 19.9.
    """
    slope = 0.0
    for i in range(len(c)):
        slope -= mu / s[i] * dc[i]
        if c[i] > 0 and dc[i] * length < -fraction * s[i]:
            length = -fraction * s[i] / dc[i]
    return slope, length


@compiled
def limit_step(s, t, ds, dt, mu, penalty, length, fraction):
    """Return what ``limit_implied_step`` returns, for slacks with their own steps."""
    slope = 0.0
    for i in range(len(s)):
        slope += penalty * dt[i] - mu * ds[i] / s[i] - mu * dt[i] / t[i]
        if ds[i] * length < -fraction * s[i]:
            length = -fraction * s[i] / ds[i]
        if dt[i] * length < -fraction * t[i]:
            length = -fraction * t[i] / dt[i]
    return slope, length


@compiled
def step_multipliers(dz, s, t, mu, penalty, options, z):
    """Move multipliers by Newton's step; they stay positive and near the central path of the new slacks.

    Source: Wächter & Biegler 2006, Eq. 16.
    """
    fraction, spread, length = options.boundary_fraction, options.multiplier_range, 1.0
    for i in range(len(z)):
        if dz[i] * length < -fraction * z[i]:
            length = -fraction * z[i] / dz[i]
        if dz[i] * length > fraction * (penalty - z[i]):
            length = fraction * (penalty - z[i]) / dz[i]
    for i in range(len(z)):
        target = z[i] + length * dz[i]
        target = min(max(target, mu / s[i] / spread), mu / s[i] * spread)
        w = min(max(penalty - target, mu / t[i] / spread), mu / t[i] * spread)
        if w != penalty - target:
            target = min(max(penalty - w, MULTIPLIER_ROUNDING * penalty), (1 - MULTIPLIER_ROUNDING) * penalty)
        z[i] = target
