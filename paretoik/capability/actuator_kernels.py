"""Compiled capability of a joint: highest speed under a torque, and torque that it can hold.

A row of the table (see ``actuation``) is a joint: its motors' curves and, with sliders, the rod's geometry. A motor at
an effort e may run between −h(−e) and h(e); so may a joint at a torque, and these kernels compute h.
Source: Kim, Choi & Jang 2021, Eqs. 3 and 4, read as a diamond; the rod's geometry is derived, not printed there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.compilation.numba_cache import compiled, inlined

# Searches along a line, compiled into their callers; ``arguments`` is a tuple of what ``function`` reads and writes.
# After a change here, delete the caches of callers: they keep the code that they were compiled with.


GOLDEN = 0.6180339887498949  # (√5 − 1) / 2


@inlined
def golden_section(function, arguments, low, high, iterations, tie=np.inf, target=-np.inf):
    """Return (value, x) of a minimum between two places, exact if there is only one local minimum.

    If two values are equal, the search continues towards ``tie``. It ends at the first value at or below ``target``.
    Source: Kiefer 1953, Sequential minimax search for a maximum.
    """
    a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_a, at_b = function(a, arguments), function(b, arguments)
    for _ in range(iterations):
        if at_a <= target or at_b <= target:
            break
        if at_a < at_b or (at_a == at_b and b > tie):
            high, b, at_b = b, a, at_a
            a = high - GOLDEN * (high - low)
            at_a = function(a, arguments)
        else:
            low, a, at_a = a, b, at_b
            b = low + GOLDEN * (high - low)
            at_b = function(b, arguments)
    return (at_a, a) if at_a <= at_b else (at_b, b)


@inlined
def bisect(function, arguments, inside, outside, iterations):
    """Return the last place towards ``outside`` at which a function is ≥ 0."""
    for _ in range(iterations):
        middle = 0.5 * (inside + outside)
        if function(middle, arguments) >= 0.0:
            inside = middle
        else:
            outside = middle
    return inside


# Highest speed and torque of each joint.


DIAMOND, STRIP, BOX = range(3)
SHAPE, STALL, FASTEST, BACK_STALL, BACK_FASTEST, ROD, ZERO, BEND, ANGLE, FRONT, BACK = 0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 12
COLUMNS = 14  # ANGLE, FRONT and BACK have two each: lower and upper
SPEED, HOLD = range(2)  # the maximised quantity


class SliderOptions(NamedTuple):
    """Settings of the search over the front slider's position."""

    overload: float = 1e-9  # share of the stall effort by which rounding may exceed it
    pieces: int = 12  # number of pieces of each feasible interval, compared before the best are refined
    bisections: int = 50  # for the end of an interval where sliders bear a torque: 1e-15 of it
    sections: int = 44  # golden sections, to 1e-9 of a piece: there a smooth maximum is flat to 1e-18


OPTIONS = SliderOptions()


@compiled
def motor_speed(shape, stall, fastest, effort):
    """Return h(e), the highest speed of a motor at an effort; NaN if it cannot bear the effort."""
    share = effort / stall
    if not abs(share) <= 1.0 + OPTIONS.overload:
        return np.nan
    if shape == DIAMOND:
        return fastest * max(0.0, 1.0 - abs(share))
    if shape == STRIP:
        return fastest * max(0.0, min(1.0, 1.0 - share))
    return fastest


@compiled
def gears(sine, cosine, front, rod):
    """Return (s_b, A, B) of the back slider and dθ = A ds + B ds_b at the sine and cosine of θ."""
    back = -front * cosine + np.sqrt(rod * rod - front * front * sine * sine)
    across = front * back * sine
    return back, (front + back * cosine) / across, (back + front * cosine) / across


@compiled
def slider_value(slider, sine, cosine, torque, front, quantity):
    """Return a joint's highest speed, or holdable torque, at a front slider; NaN if the joint cannot hold.

    ``slider`` are the numbers of both motors and the rod: not an array, since numba spends time counting references.
    """
    shape, stall, fastest, back_stall, back_fastest, rod = slider
    _, a, b = gears(sine, cosine, front, rod)
    if quantity == HOLD:
        return min(stall / abs(a), back_stall / abs(b))
    ahead = motor_speed(shape, stall, fastest, torque * abs(a))  # a sign changes both effort and speed
    behind = motor_speed(shape, back_stall, back_fastest, torque * abs(b))
    return abs(a) * ahead + abs(b) * behind


@inlined
def _negative_value(front, arguments):
    slider, sine, cosine, torque, quantity = arguments
    return -slider_value(slider, sine, cosine, torque, front, quantity)


@compiled
def _torque_reserve(front, arguments):
    slider, sine, cosine, torque, _ = arguments
    return slider_value(slider, sine, cosine, torque, front, HOLD) - abs(torque)


@compiled
def _interval_ends(row, sine, cosine, ends):
    """Write the sorted places at which feasibility may change or A is zero; return their number."""
    low, high, rod = row[FRONT], row[FRONT + 1], row[ROD]
    ends[0], ends[1], count = low, high, 2
    for k in range(2):
        back = row[BACK + k]
        square = rod * rod - back * back * sine * sine
        if square >= 0.0:
            for sign in (-1.0, 1.0):
                front = -back * cosine + sign * np.sqrt(square)
                if low < front < high:
                    ends[count] = front
                    count += 1
    if cosine < 0.0:
        front = -rod * cosine / sine
        if low < front < high:
            ends[count] = front
            count += 1
    for i in range(1, count):
        k = i
        while k > 0 and ends[k - 1] > ends[k]:
            ends[k - 1], ends[k] = ends[k], ends[k - 1]
            k -= 1
    return count


@compiled
def rod_angle(row, q):
    """Return the rod's angle θ, between −π and π."""
    angle = row[BEND] * (q - row[ZERO])
    return angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))


@compiled
def joint_maximum(row, q, torque, quantity, ends):
    """Return (highest speed or holdable torque, front slider's position) of a joint; NaN if infeasible.

    The other bend of the rod flips the signs of both θ̇ and τ, so the highest speed stays the same.
    """
    if row[ROD] == 0.0:
        if quantity == HOLD:
            return row[STALL], 0.0
        return motor_speed(row[SHAPE], row[STALL], row[FASTEST], torque), 0.0
    angle = rod_angle(row, q)
    if not row[ANGLE] <= angle <= row[ANGLE + 1]:
        return np.nan, 0.0
    sine, cosine = np.sin(angle), np.cos(angle)
    slider = row[SHAPE], row[STALL], row[FASTEST], row[BACK_STALL], row[BACK_FASTEST], row[ROD]
    best, best_front = np.nan, 0.0
    for i in range(_interval_ends(row, sine, cosine, ends) - 1):
        low, high = ends[i], ends[i + 1]
        middle = gears(sine, cosine, 0.5 * (low + high), row[ROD])[0]
        if high <= low or not row[BACK] <= middle <= row[BACK + 1]:
            continue
        if quantity == HOLD:
            value, front = _refined_maximum(slider, sine, cosine, torque, quantity, low, high)
            for end in (low, high):
                at_end = slider_value(slider, sine, cosine, torque, end, quantity)
                if at_end > value:
                    value, front = at_end, end
        else:
            low, high = _bearable_interval(slider, sine, cosine, torque, low, high)
            if low != low:
                continue
            # (value, front slider) of the maximum in an interval where sliders bear the torque. Places are evenly
            # spaced; the maximum is refined about each place that is not below its neighbours
            step = (high - low) / OPTIONS.pieces
            top, top_front = slider_value(slider, sine, cosine, torque, low, quantity), low
            before, value = -np.inf, top
            for k in range(OPTIONS.pieces + 1):
                after = -np.inf
                if k < OPTIONS.pieces:
                    after = slider_value(slider, sine, cosine, torque, low + (k + 1) * step, quantity)
                if before <= value >= after:
                    first, last = low + max(k - 1, 0) * step, low + min(k + 1, OPTIONS.pieces) * step
                    refined, front = _refined_maximum(slider, sine, cosine, torque, quantity, first, last)
                    if value > refined:
                        refined, front = value, low + k * step
                    if refined > top:
                        top, top_front = refined, front
                before, value = value, after
            value, front = top, top_front
        if not value <= best:
            best, best_front = value, front
    return best, best_front


@compiled
def _bearable_interval(slider, sine, cosine, torque, low, high):
    """Return the ends of the part of an interval where sliders bear a torque; NaN without one.

    |A| and |B| first fall, then rise along it, so the torque that they can hold has one maximum.
    """
    arguments = (slider, sine, cosine, torque, HOLD)
    low_bears, high_bears = _torque_reserve(low, arguments) >= 0.0, _torque_reserve(high, arguments) >= 0.0
    if low_bears and high_bears:
        return low, high
    inside = low if low_bears else high
    if not (low_bears or high_bears):
        hold, inside = _refined_maximum(slider, sine, cosine, torque, HOLD, low, high)
        if not hold >= abs(torque):
            return np.nan, np.nan
    ends = np.array([low, high])
    for k in range(2):
        if not (low_bears, high_bears)[k]:
            ends[k] = bisect(_torque_reserve, arguments, inside, ends[k], OPTIONS.bisections)
    return ends[0], ends[1]


@compiled
def _refined_maximum(slider, sine, cosine, torque, quantity, low, high):
    """Return (maximum, front slider's position there) between low and high, by golden section."""
    arguments = (slider, sine, cosine, torque, quantity)
    value, front = golden_section(_negative_value, arguments, low, high, OPTIONS.sections)
    return -value, front


@compiled
def joint_maxima(table, q, torque, quantity, maxima):
    """Write the results of ``joint_maximum`` for every joint (samples, dof, 2)."""
    ends = np.empty(7)
    for i in range(q.shape[0]):
        for j in range(q.shape[1]):
            maxima[i, j, 0], maxima[i, j, 1] = joint_maximum(table[j], q[i, j], torque[i, j], quantity, ends)
