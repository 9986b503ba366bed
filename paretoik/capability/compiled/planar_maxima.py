"""The directional maxima of a planar arm with three joints, over all its postures at a position: compiled.

Each curve of postures (``planar_postures``) is sampled all around, evenly in a parameter along which it is smooth; for
every direction the best few places are then refined by golden sections. ``problem`` is (arm, table of actuators,
position, quantity); ``work`` is (columns, loads, ranges of the joints, ends of stretches), arrays to write to.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.capability.compiled.actuators import ANGLE, HOLD, ROD, SPEED, STRIP, joint_maximum, rod_angle
from paretoik.capability.compiled.planar_postures import posture_curves, write_loads, write_posture
from paretoik.compilation import compiled, inlined
from paretoik.nlp.compiled.scalar_search import bisect, golden_section


class PlanarSearchOptions(NamedTuple):
    """Settings of the search over all postures of a planar arm."""

    around: int = 360  # places on each curve, besides those where limits begin and end to be kept
    refined: int = 4  # places of each direction and curve that are refined
    pieces: int = 4  # of a feasible stretch between two places
    overshoot: float = 1e-12  # rad by which rounding may exceed a joint limit
    bisections: int = 40  # to where limits begin or end to be kept
    sections: int = 40  # golden sections
    parallel: float = 1e-14  # share of a direction across a normal below which that does not bound it


OPTIONS = PlanarSearchOptions()
NEW, OUTSIDE = -1, -2  # places that are not on the grid: feasible ones, and those that no posture is at
INFEASIBLE = -1.0  # the value of a posture that is past limits or overloaded


@compiled
def _write_ranges(q, loads, table, quantity, ranges, ends):
    """Write (lowest, highest) speed, or torque left, of every joint; return whether all can hold."""
    for j in range(3):
        if quantity == SPEED:
            ranges[j, 1] = joint_maximum(table[j], q[j], loads[j], quantity, ends)[0]
            ranges[j, 0] = -ranges[j, 1]
            if table[j, 0] == STRIP:
                ranges[j, 0] = -joint_maximum(table[j], q[j], -loads[j], quantity, ends)[0]
        else:
            hold = joint_maximum(table[j], q[j], 0.0, quantity, ends)[0]
            ranges[j, 0], ranges[j, 1] = -hold - loads[j], hold - loads[j]
        if not (ranges[j, 0] <= 0.0 <= ranges[j, 1]):
            return False
    return True


@compiled
def highest_speed(columns, ranges, x, y):
    """Return the highest speed along (x, y): the nearest edge of the polygon of tool velocities."""
    best = np.inf
    for i in range(5):  # edges are along a joint's column; where all columns are parallel an axis stands in
        if i < 3:
            u, v = -columns[i, 1], columns[i, 0]
        else:
            u, v = (1.0, 0.0) if i == 3 else (0.0, 1.0)
        across = u * x + v * y
        if abs(across) <= OPTIONS.parallel * (abs(u * x) + abs(v * y)):
            continue
        if across < 0.0:
            u, v, across = -u, -v, -across
        support = 0.0
        for j in range(3):
            if j != i:
                share = u * columns[j, 0] + v * columns[j, 1]
                support += share * (ranges[j, 1] if share > 0.0 else ranges[j, 0])
        best = min(best, support / across)
    return best


@compiled
def greatest_force(columns, ranges, x, y):
    """Return the greatest force along (x, y) that the torques left can bear."""
    best = np.inf
    for j in range(3):
        share = columns[j, 0] * x + columns[j, 1] * y
        if share != 0.0:
            best = min(best, (ranges[j, 1] if share > 0.0 else ranges[j, 0]) / share)
    return best


@compiled
def _slack(curve, place, problem, q, work):
    """Return by how much limits and motors are kept at a place, negative where they are not.

    Limits, and the angles of rods, in rad; torques as shares of what can be held, where positions are kept.
    """
    arm, table, target, _ = problem
    columns, loads, _, ends = work
    slack = write_posture(curve, place, arm, target, q, columns) + OPTIONS.overshoot
    for j in range(3):
        if table[j, ROD] != 0.0:
            angle = rod_angle(table[j], q[j])
            slack = min(slack, angle - table[j, ANGLE], table[j, ANGLE + 1] - angle)
    if slack < 0.0:
        return slack
    write_loads(q, arm, loads)
    for j in range(3):
        slack = min(slack, 1.0 - abs(loads[j]) / joint_maximum(table[j], q[j], 0.0, HOLD, ends)[0])
    return slack


@inlined
def _slack_at(place, arguments):
    curve, problem, q, work = arguments
    return _slack(curve, place, problem, q, work)


@inlined
def _negative_slack_at(place, arguments):
    curve, problem, q, work = arguments
    return -_slack(curve, place, problem, q, work)


@compiled
def _write_values(curve, place, directions, problem, q, work, values):
    """Write the values of a place along each direction, ``INFEASIBLE`` where the arm cannot be there."""
    arm, table, target, quantity = problem
    columns, loads, ranges, ends = work
    values[:] = INFEASIBLE
    if not write_posture(curve, place, arm, target, q, columns) >= -OPTIONS.overshoot:
        return
    write_loads(q, arm, loads)
    if not _write_ranges(q, loads, table, quantity, ranges, ends):
        return
    for k in range(directions.shape[0]):
        if quantity == SPEED:
            values[k] = highest_speed(columns, ranges, directions[k, 0], directions[k, 1])
        else:
            values[k] = greatest_force(columns, ranges, directions[k, 0], directions[k, 1])


@inlined
def _negative_value_at(place, arguments):
    curve, direction, problem, q, work, value = arguments
    _write_values(curve, place, direction, problem, q, work, value)
    return -value[0]


@compiled
def _refined_maximum(curve, low, high, direction, problem, q, work, value):
    """Return (value, place) of the maximum along one direction between two places."""
    arguments = (curve, direction, problem, q, work, value)
    minimum, place = golden_section(_negative_value_at, arguments, low, high, OPTIONS.sections)
    return -minimum, place


@compiled
def _feasible_place(curve, low, high, problem, q, work):
    """Return (slack, place) where the slack is largest between two places, or not negative."""
    arguments = (curve, problem, q, work)
    minimum, place = golden_section(_negative_slack_at, arguments, low, high, OPTIONS.sections, np.inf, 0.0)
    return -minimum, place


@compiled
def _feasible_end(curve, inside, outside, problem, q, work):
    """Return the feasible place nearest to one that is not."""
    return bisect(_slack_at, (curve, problem, q, work), inside, outside, OPTIONS.bisections)


@compiled
def _write_places(curve, grid_values, problem, q, work, places, grid_index):
    """Write the places of a curve that are to be compared, in order, and their number on the grid; return how many.

    Feasible places of the grid; as ``NEW`` the ends of every feasible stretch, between places ``OUTSIDE``. Stretches
    between two places of the grid too: where the slack has a local maximum, that is searched for.
    """
    step, count = 2.0 * np.pi / OPTIONS.around, 0
    slacks = np.empty(OPTIONS.around)
    for i in range(OPTIONS.around):
        slacks[i] = 1.0
        if not grid_values[i, 0] >= 0.0:
            slacks[i] = min(_slack(curve, (i + 0.5) * step, problem, q, work), -1e-300)
    for i in range(OPTIONS.around):
        here, before, after = (i + 0.5) * step, slacks[i - 1], slacks[(i + 1) % OPTIONS.around]
        if slacks[i] >= 0.0:
            if before < 0.0:
                places[count], grid_index[count] = here - step, OUTSIDE
                places[count + 1] = _feasible_end(curve, here, here - step, problem, q, work)
                grid_index[count + 1] = NEW
                count += 2
            places[count], grid_index[count] = here, i
            count += 1
            if after < 0.0:
                places[count] = _feasible_end(curve, here, here + step, problem, q, work)
                grid_index[count] = NEW
                places[count + 1], grid_index[count + 1] = here + step, OUTSIDE
                count += 2
        elif before < 0.0 and after < 0.0 and slacks[i] >= before and slacks[i] >= after:
            slack, middle = _feasible_place(curve, here - step, here + step, problem, q, work)
            if slack >= 0.0:
                low = _feasible_end(curve, middle, here - step, problem, q, work)
                high = _feasible_end(curve, middle, here + step, problem, q, work)
                for k in range(-1, OPTIONS.pieces + 2):
                    places[count] = low + (high - low) * k / OPTIONS.pieces
                    grid_index[count] = NEW if 0 <= k <= OPTIONS.pieces else OUTSIDE
                    count += 1
    return count


@compiled(level=3)  # a sixth faster than at level 1
def write_maxima(problem, directions, values, postures):
    """Write the greatest value and its posture of every direction; −1 where no posture can be held.

    Returns how many curves of postures there are.
    """
    arm, _, target, _ = problem
    count = directions.shape[0]
    curves, q = np.empty((2, 3)), np.empty(3)
    work = np.empty((3, 2)), np.empty(3), np.empty((3, 2)), np.empty(7)
    curve_count = posture_curves(np.hypot(target[0] - arm[3][0], target[1] - arm[3][1]), arm[0], curves)
    step, capacity = 2.0 * np.pi / OPTIONS.around, (OPTIONS.pieces + 3) * OPTIONS.around
    grid_values, place_values = np.empty((OPTIONS.around, count)), np.empty((capacity, count))
    places, grid_index = np.empty(capacity), np.empty(capacity, dtype=np.int64)
    values[:] = INFEASIBLE
    for c in range(curve_count):
        for i in range(OPTIONS.around):
            _write_values(curves[c], (i + 0.5) * step, directions, problem, q, work, grid_values[i])
        size = _write_places(curves[c], grid_values, problem, q, work, places, grid_index)
        for i in range(size):
            if grid_index[i] >= 0:
                place_values[i] = grid_values[grid_index[i]]
            elif grid_index[i] == OUTSIDE:
                place_values[i] = INFEASIBLE
            else:
                _write_values(curves[c], places[i], directions, problem, q, work, place_values[i])
        for k in range(count):
            _update_maximum(
                curves[c], places[:size], place_values[:size, k], directions[k : k + 1], problem, q, work,
                values[k : k + 1], postures[k],
            )  # fmt: skip
    return curve_count


@compiled
def _update_maximum(curve, places, place_values, direction, problem, q, work, value, posture):
    """Write the maximum along one direction on a curve, refined from its best places, if it is above the value."""
    count = len(places)
    tops, index, one = np.full(OPTIONS.refined, -1.0), np.zeros(OPTIONS.refined, dtype=np.int64), np.empty(1)
    for i in range(count):
        top = place_values[i]
        if top <= tops[-1] or top < place_values[i - 1] or top < place_values[(i + 1) % count]:
            continue
        k = OPTIONS.refined - 1
        while k > 0 and tops[k - 1] < top:
            tops[k], index[k] = tops[k - 1], index[k - 1]
            k -= 1
        tops[k], index[k] = top, i
    step = 2.0 * np.pi / OPTIONS.around
    for k in range(OPTIONS.refined):
        if tops[k] < 0.0:
            break
        i = index[k]
        after = (i + 1) % count
        low = places[i - 1] - (2.0 * np.pi if i == 0 else 0.0) if place_values[i - 1] >= 0.0 else places[i]
        high = places[after] + (2.0 * np.pi if after == 0 else 0.0) if place_values[after] >= 0.0 else places[i]
        low, high = max(low, places[i] - step), min(high, places[i] + step)
        refined, place = _refined_maximum(curve, low, high, direction, problem, q, work, one)
        if tops[k] > refined:
            refined, place = tops[k], places[i]
        if refined > value[0]:
            _write_values(curve, place, direction, problem, posture, work, one)
            value[0] = one[0]
