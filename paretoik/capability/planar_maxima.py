"""Compiled directional maxima of a planar arm with three joints, over all its postures at a position.

Each curve of postures (``posture_curves``) is sampled all around, evenly in a parameter along which it is smooth; for
every direction the best few places are then refined by golden sections. ``problem`` is (arm, table of actuators,
position, quantity); ``work`` is (columns, loads, ranges of the joints, ends of intervals), arrays to write to.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from paretoik.capability.actuator_kernels import (
    ANGLE,
    HOLD,
    ROD,
    SPEED,
    STRIP,
    bisect,
    golden_section,
    joint_maximum,
    rod_angle,
)
from paretoik.compilation.numba_cache import compiled, inlined

# All postures of a planar arm with three joints at a position: curves, places on curves, limits and loads, compiled.
# ``arm`` is (lengths, rotations before each joint, angles of the links, base, masses with gravity, limits).


@compiled
def posture_curves(reach, lengths, curves):
    """Write the curves of the first link's angle β as (centre, half width, elbow's bend or 0); return how many.

    The postures at a position are on closed curves: the first link turns within an interval, with the elbow bent one
    way from one end to the other, and the other way back. β is measured from the direction of the position, at distance
    ``reach``. The bend is 0 on a curve with both bends.
    """
    first, second, third = lengths
    product = 2.0 * reach * first
    far = (reach * reach + first * first - (second + third) ** 2) / product if product > 0.0 else -np.inf
    near = (reach * reach + first * first - (second - third) ** 2) / product if product > 0.0 else np.inf
    if product == 0.0 and not abs(second - third) <= first <= second + third:
        return 0
    if far > 1.0 or near < -1.0:
        return 0
    largest, smallest = np.arccos(max(far, -1.0)), np.arccos(min(near, 1.0))
    if smallest <= 0.0 and largest >= np.pi:
        for k in range(2):
            curves[k, 0], curves[k, 1], curves[k, 2] = 0.0, np.pi, 2.0 * k - 1.0
        return 2
    curves[0, 2] = curves[1, 2] = 0.0
    if smallest <= 0.0:
        curves[0, 0], curves[0, 1] = 0.0, largest
        return 1
    if largest >= np.pi:
        curves[0, 0], curves[0, 1] = np.pi, np.pi - smallest
        return 1
    for k in range(2):
        curves[k, 0], curves[k, 1] = (2.0 * k - 1.0) * 0.5 * (smallest + largest), 0.5 * (largest - smallest)
    return 2


@compiled
def write_posture(curve, place, arm, target, q, columns):
    """Write the posture at a place on a curve, and its Jacobian's columns; return the limits' slack [rad]."""
    lengths, turned, offsets, base, _, limits = arm
    x, y = target[0] - base[0], target[1] - base[1]
    ahead = np.arctan2(y, x)
    if curve[2] != 0.0:
        beta, bend = place, curve[2]
    else:
        beta, bend = curve[0] - curve[1] * np.cos(place), (1.0 if np.sin(place) >= 0.0 else -1.0)
    first = ahead + beta
    x, y = x - lengths[0] * np.cos(first), y - lengths[0] * np.sin(first)
    cosine = (x * x + y * y - lengths[1] ** 2 - lengths[2] ** 2) / (2.0 * lengths[1] * lengths[2])
    elbow = bend * np.arccos(min(max(cosine, -1.0), 1.0))
    second = np.arctan2(y, x) - np.arctan2(lengths[2] * np.sin(elbow), lengths[1] + lengths[2] * np.cos(elbow))
    third = second + elbow
    q[0], q[1], q[2] = first - offsets[0], second - offsets[1], third - offsets[2]  # of the links in the world
    u, v = 0.0, 0.0
    for j in range(2, -1, -1):
        angle = first if j == 0 else second if j == 1 else third
        u, v = u + lengths[j] * np.cos(angle), v + lengths[j] * np.sin(angle)
        columns[j, 0], columns[j, 1] = -v, u
    before, slack = base[2], np.inf
    for j in range(3):
        world_angle = q[j]
        q[j] = world_angle - before - turned[j]
        before = world_angle
        low, high = limits[j]
        if np.isfinite(low):
            middle = 0.5 * (low + high) if np.isfinite(high) else low + np.pi
        else:
            middle = high - np.pi if np.isfinite(high) else 0.0
        q[j] -= 2.0 * np.pi * np.floor((q[j] - middle + np.pi) / (2.0 * np.pi))
        slack = min(slack, q[j] - low, high - q[j])
    return slack


@compiled
def write_loads(q, arm, loads):
    """Write the torques that hold the arm at rest."""
    lengths, turned, offsets, base, weights, _ = arm
    link_angle = base[2] + q[0] + turned[0] + q[1] + turned[1] + q[2] + turned[2]
    torque, force_x, force_y = 0.0, 0.0, 0.0
    for j in range(2, -1, -1):  # from the tip: the weight beyond a link acts at the link's end
        angle = link_angle + offsets[j]
        torque += lengths[j] * (np.sin(angle) * force_x - np.cos(angle) * force_y)
        cosine, sine = np.cos(link_angle), np.sin(link_angle)
        mass, center_x, center_y = weights[j, 0], weights[j, 1], weights[j, 2]
        x, y = cosine * center_x - sine * center_y, sine * center_x + cosine * center_y
        weight_x, weight_y = mass * weights[3, 0], mass * weights[3, 1]
        torque += y * weight_x - x * weight_y
        force_x, force_y = force_x + weight_x, force_y + weight_y
        loads[j] = torque
        link_angle -= q[j] + turned[j]


# Directional maxima of a planar arm over all postures.


class PlanarSearchOptions(NamedTuple):
    """Settings of the search over all postures of a planar arm."""

    around: int = 360  # number of places on each curve, without those at which limits begin or end to be satisfied
    refined: int = 4  # number of places refined per direction and curve
    pieces: int = 4  # number of pieces of a feasible interval between two places
    overshoot: float = 1e-12  # rad by which rounding may exceed a joint limit
    bisections: int = 40  # number of bisections for places at which limits begin or end to be satisfied
    sections: int = 40  # golden sections
    parallel: float = 1e-14  # least |n · d|, as a share of its terms, for a normal n that bounds a direction d


OPTIONS = PlanarSearchOptions()
NEW, OUTSIDE = -1, -2  # places off the grid: feasible places, and places without a posture
INFEASIBLE = -1.0  # value of a posture that exceeds limits or is overloaded


@compiled
def highest_speed(columns, ranges, x, y):
    """Return the highest speed along (x, y), to the nearest edge of the polygon of tool velocities."""
    best = np.inf
    for i in range(5):  # edges are along a joint's column; an axis replaces parallel columns
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
    """Return the slack of limits and motors at a place; negative if they are violated.

    For limits and angles of rods it is in rad. If these are satisfied, it includes torques, as shares of the capacity.
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
    """Write the values of a place along each direction, ``INFEASIBLE`` if the arm cannot be there."""
    arm, table, target, quantity = problem
    columns, loads, ranges, ends = work
    values[:] = INFEASIBLE
    if not write_posture(curve, place, arm, target, q, columns) >= -OPTIONS.overshoot:
        return
    write_loads(q, arm, loads)
    for j in range(3):  # every joint's lowest and highest speed, or remaining torque
        if quantity == SPEED:
            ranges[j, 1] = joint_maximum(table[j], q[j], loads[j], quantity, ends)[0]
            ranges[j, 0] = -ranges[j, 1]
            if table[j, 0] == STRIP:
                ranges[j, 0] = -joint_maximum(table[j], q[j], -loads[j], quantity, ends)[0]
        else:
            hold = joint_maximum(table[j], q[j], 0.0, quantity, ends)[0]
            ranges[j, 0], ranges[j, 1] = -hold - loads[j], hold - loads[j]
        if not (ranges[j, 0] <= 0.0 <= ranges[j, 1]):
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
def _feasible_end(curve, inside, outside, problem, q, work):
    """Return the feasible place nearest to an infeasible one."""
    return bisect(_slack_at, (curve, problem, q, work), inside, outside, OPTIONS.bisections)


@compiled
def _write_places(curve, grid_values, problem, q, work, places, grid_index):
    """Write the places of a curve that are compared, with their grid numbers; return their number.

    These are the feasible places of the grid and, marked ``NEW``, the ends of feasible intervals. ``OUTSIDE`` marks
    separate the intervals. Intervals narrower than the grid are searched for at the local maxima of the slack.
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
            # (slack, place) of the largest slack between two places, or of the first that is not negative
            arguments = (curve, problem, q, work)
            minimum, middle = golden_section(
                _negative_slack_at, arguments, here - step, here + step, OPTIONS.sections, np.inf, 0.0
            )
            slack = -minimum
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
    """Write every direction's greatest value, −1 without any, and its posture; return the number of curves."""
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
    """Write the maximum along one direction on a curve, refined from its best places, if it is larger."""
    count = len(places)
    best, index, one = np.full(OPTIONS.refined, -1.0), np.zeros(OPTIONS.refined, dtype=np.int64), np.empty(1)
    for i in range(count):
        here = place_values[i]
        if here <= best[-1] or here < place_values[i - 1] or here < place_values[(i + 1) % count]:
            continue
        k = OPTIONS.refined - 1
        while k > 0 and best[k - 1] < here:
            best[k], index[k] = best[k - 1], index[k - 1]
            k -= 1
        best[k], index[k] = here, i
    step = 2.0 * np.pi / OPTIONS.around
    for k in range(OPTIONS.refined):
        if best[k] < 0.0:
            break
        i = index[k]
        after = (i + 1) % count
        low = places[i - 1] - (2.0 * np.pi if i == 0 else 0.0) if place_values[i - 1] >= 0.0 else places[i]
        high = places[after] + (2.0 * np.pi if after == 0 else 0.0) if place_values[after] >= 0.0 else places[i]
        low, high = max(low, places[i] - step), min(high, places[i] + step)
        # (value, place) of the maximum along one direction between two places
        arguments = (curve, direction, problem, q, work, one)
        minimum, place = golden_section(_negative_value_at, arguments, low, high, OPTIONS.sections)
        refined = -minimum
        if best[k] > refined:
            refined, place = best[k], places[i]
        if refined > value[0]:
            _write_values(curve, place, direction, problem, posture, work, one)
            value[0] = one[0]
