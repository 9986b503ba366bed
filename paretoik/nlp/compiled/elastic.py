"""Limits that give way at a price, for an interior-point method, compiled.

A limit gap ≥ 0 becomes gap + t = s with s, t > 0: the barrier −μ log s − μ log t and the price penalty · t. For a given
gap the best t is known, so that limits only add a smooth function of the gap, which is defined everywhere; as μ falls
it tends to penalty · max(0, −gap). The multiplier z of s follows Newton's primal–dual rule, w = penalty − z is that of
t. Source: the exact penalty of Nocedal & Wright, Numerical Optimization, section 17.2, and their barrier, chapter 19.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled

FAR = 1e6  # beyond so many barrier widths one of s and t is what the penalty alone says
NEAR = 0.995  # of the way to the boundary
HELD = 1e8  # by what factor a multiplier may differ from the one that its gap asks for


@compiled
def slack(gap, mu, penalty):
    """Return (s, t), the best for a gap."""
    away = np.sqrt((penalty * gap) ** 2 + 4 * mu * mu)
    if gap > 0:
        t = (2 * mu - penalty * gap + away) / (2 * penalty) if penalty * gap < FAR * mu else mu / penalty
        return gap + t, t
    s = (2 * mu + penalty * gap + away) / (2 * penalty) if -penalty * gap < FAR * mu else mu / penalty
    return s, s - gap


@compiled
def price(gap, mu, penalty):
    """Return what a limit adds to the merit function, 0 at a wide gap but for the barrier."""
    s, t = slack(gap, mu, penalty)
    return penalty * t - mu * np.log(s) - mu * np.log(t * penalty / mu)


@compiled
def pushed(gap, z, mu, penalty):
    """Return (Σ, push): how stiff a limit is in Newton's system, and how hard it pushes there."""
    s, t = slack(gap, mu, penalty)
    w = penalty - z
    stiffness = 1.0 / (s / z + t / w)
    return stiffness, z + stiffness * (mu / z - s - mu / w + t)


@compiled
def prices(gaps, mu, penalty):
    """Return what all limits add to the merit function."""
    total = 0.0
    for i in range(len(gaps)):
        total += price(gaps[i], mu, penalty)
    return total


@compiled
def central(gaps, mu, penalty, z):
    """Write the multipliers that the gaps ask for."""
    for i in range(len(gaps)):
        z[i] = mu / slack(gaps[i], mu, penalty)[0]


@compiled
def off_centre(gaps, z, mu, penalty):
    """Return (how far the products s z are from μ, the worst violation)."""
    apart, worst = 0.0, 0.0
    for i in range(len(gaps)):
        apart = max(apart, abs(slack(gaps[i], mu, penalty)[0] * z[i] - mu))
        worst = max(worst, -gaps[i])
    return apart, worst


@compiled
def descent(gaps, changes, mu, penalty, longest):
    """Return (slope of the prices along changes of the gaps, the step, at most ``longest``, that closes no gap)."""
    slope = 0.0
    for i in range(len(gaps)):
        s = slack(gaps[i], mu, penalty)[0]
        slope -= mu / s * changes[i]
        if gaps[i] > 0 and changes[i] * longest < -NEAR * s:
            longest = -NEAR * s / changes[i]
    return slope, longest


@compiled
def step_multipliers(gaps, changes, after, mu, penalty, z):
    """Move the multipliers by Newton's step while they stay positive; hold them near what ``after`` asks for."""
    longest = 1.0
    for i in range(len(gaps)):
        stiffness, push = pushed(gaps[i], z[i], mu, penalty)
        dz = push - z[i] - stiffness * changes[i]
        if dz * longest < -NEAR * z[i]:
            longest = -NEAR * z[i] / dz
        if dz * longest > NEAR * (penalty - z[i]):
            longest = NEAR * (penalty - z[i]) / dz
    for i in range(len(gaps)):
        stiffness, push = pushed(gaps[i], z[i], mu, penalty)
        wanted = z[i] + longest * (push - z[i] - stiffness * changes[i])
        s, t = slack(after[i], mu, penalty)
        wanted = min(max(wanted, mu / s / HELD), mu / s * HELD)
        other = min(max(penalty - wanted, mu / t / HELD), mu / t * HELD)
        z[i] = (
            min(max(penalty - other, 1e-15 * penalty), (1 - 1e-15) * penalty) if other != penalty - wanted else wanted
        )
