"""What motors let a joint do, joint by joint: compiled.

A row of the table (see ``actuation``) is a joint: its motors' curves and, where sliders drive it, the rod's geometry. A
motor at an effort e may turn or slide between −h(−e) and h(e); so does a joint at a torque, and h is all there is here.
Source: Kim, Choi & Jang 2021, Eqs. 3 and 4, read as a diamond; the rod's geometry is derived, not printed there.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled

DIAMOND, STRIP, BOX = range(3)
SHAPE, STALL, FASTEST, BACK_STALL, BACK_FASTEST, ROD, ZERO, BEND, ANGLE, FRONT, BACK = 0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 12
COLUMNS = 14  # ANGLE, FRONT and BACK are two each: lower and upper
ROUNDING = 1e-9  # of what a motor can bear: an effort at its very limit is one
SPEED, HOLD = range(2)  # what is to be most
PIECES = 12  # that each bearable stretch of a slider is looked at in
BISECTIONS = 50  # to where a stretch begins or ends to be bearable
GOLDEN = 0.6180339887498949
HALVINGS = 44  # of golden sections: to 1e-9 of a piece, where a smooth maximum is flat to 1e-18


@compiled
def motor(shape, stall, fastest, effort):
    """Return h(e), the highest speed of a motor at an effort; NaN where it is more than the motor can bear."""
    share = effort / stall
    if not abs(share) <= 1.0 + ROUNDING:
        return np.nan
    if shape == DIAMOND:
        return fastest * max(0.0, 1.0 - abs(share))
    if shape == STRIP:
        return fastest * max(0.0, min(1.0, 1.0 - share))
    return fastest


@compiled
def gears(sine, cosine, front, rod):
    """Return (s_b, A, B): where the back slider is, and dθ = A ds + B ds_b, at the sine and cosine of θ."""
    back = -front * cosine + np.sqrt(rod * rod - front * front * sine * sine)
    across = front * back * sine
    return back, (front + back * cosine) / across, (back + front * cosine) / across


@compiled
def slid(row, sine, cosine, torque, front, what):
    """Return the joint's highest speed with the front slider there, or the torque it can hold; NaN where it cannot."""
    _, a, b = gears(sine, cosine, front, row[ROD])
    if what == HOLD:
        return min(row[STALL] / abs(a), row[BACK_STALL] / abs(b))
    fast = motor(row[SHAPE], row[STALL], row[FASTEST], torque * abs(a))  # a sign turns both effort and speed
    slow = motor(row[SHAPE], row[BACK_STALL], row[BACK_FASTEST], torque * abs(b))
    return abs(a) * fast + abs(b) * slow


@compiled
def _stretches(row, sine, cosine, ends):
    """Write where feasibility of the front slider may begin or end, and where A is zero, in order; return how many."""
    low, high, rod = row[FRONT], row[FRONT + 1], row[ROD]
    ends[0], ends[1], count = low, high, 2
    for k in range(2):
        back = row[BACK + k]
        under = rod * rod - back * back * sine * sine
        if under >= 0.0:
            for sign in (-1.0, 1.0):
                place = -back * cosine + sign * np.sqrt(under)
                if low < place < high:
                    ends[count] = place
                    count += 1
    if cosine < 0.0:
        place = -rod * cosine / sine
        if low < place < high:
            ends[count] = place
            count += 1
    for i in range(1, count):
        k = i
        while k > 0 and ends[k - 1] > ends[k]:
            ends[k - 1], ends[k] = ends[k], ends[k - 1]
            k -= 1
    return count


@compiled
def bent(row, q):
    """Return the rod's angle θ, between −π and π."""
    angle = row[BEND] * (q - row[ZERO])
    return angle - 2.0 * np.pi * np.floor((angle + np.pi) / (2.0 * np.pi))


@compiled
def joint(row, q, torque, what, ends):
    """Return (highest speed, or torque it can hold; front slider) of a joint at its best; NaN where there is none.

    A joint that the rod bends the other way turns at −θ̇ under −τ: its highest speed is the same function of its torque.
    """
    if row[ROD] == 0.0:
        return (row[STALL] if what == HOLD else motor(row[SHAPE], row[STALL], row[FASTEST], torque)), 0.0
    angle = bent(row, q)
    if not row[ANGLE] <= angle <= row[ANGLE + 1]:
        return np.nan, 0.0
    sine, cosine = np.sin(angle), np.cos(angle)
    best, place = np.nan, 0.0
    for i in range(_stretches(row, sine, cosine, ends) - 1):
        low, high = ends[i], ends[i + 1]
        middle = gears(sine, cosine, 0.5 * (low + high), row[ROD])[0]
        if high <= low or not row[BACK] <= middle <= row[BACK + 1]:
            continue
        if what == HOLD:
            value, front = _within(row, sine, cosine, torque, what, low, high)
            for end in (low, high):
                more = slid(row, sine, cosine, torque, end, what)
                if more > value:
                    value, front = more, end
        else:
            low, high = _bearable(row, sine, cosine, torque, low, high)
            if low != low:
                continue
            value, front = _stretch(row, sine, cosine, torque, what, low, high)
        if not value <= best:
            best, place = value, front
    return best, place


@compiled
def _bearable(row, sine, cosine, torque, low, high):
    """Return from where to where in a stretch the sliders can bear a torque; NaN where nowhere.

    What they can hold rises to one maximum along a stretch and falls: |A| and |B| fall and rise.
    """
    able_low = slid(row, sine, cosine, torque, low, HOLD) >= abs(torque)
    able_high = slid(row, sine, cosine, torque, high, HOLD) >= abs(torque)
    if able_low and able_high:
        return low, high
    top = low if able_low else high
    if not (able_low or able_high):
        hold, top = _within(row, sine, cosine, torque, HOLD, low, high)
        if not hold >= abs(torque):
            return np.nan, np.nan
    ends = np.array([low, high])
    for k in range(2):
        if (able_low, able_high)[k]:
            continue
        inside, outside = top, ends[k]
        for _ in range(BISECTIONS):
            middle = 0.5 * (inside + outside)
            if slid(row, sine, cosine, torque, middle, HOLD) >= abs(torque):
                inside = middle
            else:
                outside = middle
        ends[k] = inside
    return ends[0], ends[1]


@compiled
def _stretch(row, sine, cosine, torque, what, low, high):
    """Return (value, front slider) of the most in a stretch that can bear the torque.

    Of places evenly spaced, it is searched about every one that its neighbours are not above.
    """
    step = (high - low) / PIECES
    best, place = slid(row, sine, cosine, torque, low, what), low
    before, value = -np.inf, best
    for k in range(PIECES + 1):
        after = slid(row, sine, cosine, torque, low + (k + 1) * step, what) if k < PIECES else -np.inf
        if before <= value >= after:
            first, last = low + max(k - 1, 0) * step, low + min(k + 1, PIECES) * step
            more, at = _within(row, sine, cosine, torque, what, first, last)
            if value > more:
                more, at = value, low + k * step
            if more > best:
                best, place = more, at
        before, value = value, after
    return best, place


@compiled
def _within(row, sine, cosine, torque, what, low, high):
    """Return (value, front slider) of the most between two places, by golden sections."""
    a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_a, at_b = slid(row, sine, cosine, torque, a, what), slid(row, sine, cosine, torque, b, what)
    for _ in range(HALVINGS):
        if at_a > at_b:
            high, b, at_b = b, a, at_a
            a = high - GOLDEN * (high - low)
            at_a = slid(row, sine, cosine, torque, a, what)
        else:
            low, a, at_a = a, b, at_b
            b = low + GOLDEN * (high - low)
            at_b = slid(row, sine, cosine, torque, b, what)
    return (at_a, a) if at_a >= at_b else (at_b, b)


@compiled
def joints(table, q, torque, what, found):
    """Write (samples, dof, 2): of every joint what ``joint`` returns."""
    ends = np.empty(7)
    for i in range(q.shape[0]):
        for j in range(q.shape[1]):
            found[i, j, 0], found[i, j, 1] = joint(table[j], q[i, j], torque[i, j], what, ends)
