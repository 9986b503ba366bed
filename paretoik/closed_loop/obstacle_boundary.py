"""The best step on the boundary of what is clear of obstacles, compiled: from one near it along the boundary.

Where obstacles keep a step from being better, what is minimised falls across the boundary, which is there across its
gradient: lines along the gradient, side by side, each lead to a step on the boundary.
"""

from __future__ import annotations

import numpy as np

from paretoik.closed_loop.null_space_steps import is_admissible, weighted_sum
from paretoik.compilation import compiled, inlined
from paretoik.nlp.compiled.scalar_search import bisect, golden_section


@compiled
def follow_boundary(best, weights, options, s, place):
    """Return the least value on the boundary about a step with the ``best`` one; write the step to ``place``."""
    radius = np.sqrt(best / weights[0]) if weights[0] > 0.0 else np.hypot(place[0], place[1])
    span, narrowest = options.boundary_span * radius, options.narrowest_span * radius
    for _ in range(options.boundary_rounds):
        u, v = place[0], place[1]
        _, (fu, fv), _ = weighted_sum(weights[0], weights[1], u, v, s)
        steepness = np.hypot(fu, fv)
        if not steepness > 0.0:
            break
        arguments = (
            u,
            v,
            fu / steepness,
            fv / steepness,
            span,
            options.boundary_iterations,
            options.boundary_standoff,
            weights,
            s,
        )
        value, shift = golden_section(_boundary_value, arguments, -span, span, options.boundary_iterations)
        is_better = value < best
        if is_better:
            best = value
            place[0], place[1] = _boundary_step(shift, arguments)
        span *= options.wider if is_better and abs(shift) > 0.5 * span else options.narrower
        if span < narrowest:
            break
    return best


@compiled
def _boundary_step(shift, arguments):
    """Return the step on the boundary so far to the side of the first step; NaN where there is none."""
    u, v, nu, nv, span, iterations, standoff, _, s = arguments
    u, v = u - shift * nv, v + shift * nu
    if not is_admissible(u + span * nu, v + span * nv, s):
        return np.nan, np.nan
    along = bisect(_admissible_along, (u, v, nu, nv, s), span, -span, iterations)
    clear = along + standoff * span
    if is_admissible(u + clear * nu, v + clear * nv, s):  # not so near that rounding says which side it is on
        along = clear
    return u + along * nu, v + along * nv


@inlined
def _boundary_value(shift, arguments):
    u, v = _boundary_step(shift, arguments)
    value, _, _ = weighted_sum(arguments[7][0], arguments[7][1], u, v, arguments[8])
    return value if value < np.inf else np.inf


@inlined
def _admissible_along(along, arguments):
    u, v, nu, nv, s = arguments
    return 1.0 if is_admissible(u + along * nu, v + along * nv, s) else -1.0
