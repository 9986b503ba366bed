"""Compiled tests of whether steps are admissible.

A step is admissible if it is within its bounds and clear of obstacles, at its end or all the way. The travel of a step
is Σ reach · |Δq|: an upper bound of the move of every point of the arm. Obstacles farther away than the travel need no
test. Between two configurations, the arm is clear if the sum of their distances from obstacles exceeds the travel.
"""

from __future__ import annotations

import numpy as np

from paretoik.autodiff.interpreter import run_first
from paretoik.closed_loop.programs import AXES, FIRST, KIND, PLANE, POINT, RADIUS, SECOND, SEGMENT
from paretoik.compilation.numba_cache import compiled

# Distance of an arm's axes from obstacles, compiled. If positive, it is that of ``collision/obstacles.py``, which takes
# up to 3.4 times as long when it is traced. Loops over configurations have no branches, for vector instructions.


@compiled
def evaluate_distances(obstacles, widths, nodes, count, distances):
    """Write the distances of the arm from obstacles in ``count`` configurations.

    A distance is at most 0 if the arm meets an obstacle. If it is not positive, some point of the arm is at least that
    deep in an obstacle. ``obstacles`` is the result of ``tabulate``; ``widths`` (links,) [m] are subtracted from the
    distances of each link's axis; ``nodes`` (3 · nodes, count) are x, y and z of each node in order.
    """
    for k in range(count):
        distances[k] = np.inf
    for i in range(obstacles.shape[0]):
        obstacle = obstacles[i]
        for row in range(0, nodes.shape[0] - 3, 3):
            width = widths[row // 3]
            if obstacle[KIND] == POINT:
                x, y, flat = obstacle[FIRST], obstacle[FIRST + 1], obstacle[AXES + 8]
                z, radius = flat * obstacle[FIRST + 2], obstacle[RADIUS]
                x0, y0, z0 = nodes[row], nodes[row + 1], nodes[row + 2]
                x1, y1, z1 = nodes[row + 3], nodes[row + 4], nodes[row + 5]
                for k in range(count):
                    ax, ay, az = x0[k], y0[k], flat * z0[k]
                    dx, dy, dz = x1[k] - ax, y1[k] - ay, flat * z1[k] - az
                    distance = np.sqrt(_squared_distance(x, y, z, ax, ay, az, dx, dy, dz)) - radius - width
                    distances[k] = distance if distance < distances[k] else distances[k]
            elif obstacle[KIND] == SEGMENT:
                _to_segment(obstacle, nodes, row, width, count, distances)
            elif obstacle[KIND] == PLANE:
                _to_plane(obstacle, nodes, row, width, count, distances)
            else:
                _to_box(obstacle, nodes, row, width, count, distances)


@compiled
def _to_plane(plane, nodes, row, width, count, distances):
    """Write the distance from a half-space, that of the nearer end."""
    px, py, pz = plane[FIRST], plane[FIRST + 1], plane[FIRST + 2]
    nx, ny, nz = plane[AXES], plane[AXES + 1], plane[AXES + 2]
    x0, y0, z0, x1, y1, z1 = nodes[row], nodes[row + 1], nodes[row + 2], nodes[row + 3], nodes[row + 4], nodes[row + 5]
    for k in range(count):
        first = (x0[k] - px) * nx + (y0[k] - py) * ny + (z0[k] - pz) * nz
        last = (x1[k] - px) * nx + (y1[k] - py) * ny + (z1[k] - pz) * nz
        distance = (first if first < last else last) - width
        distances[k] = distance if distance < distances[k] else distances[k]


@compiled
def _fraction(part, whole):
    """Return part / whole within [0, 1], and 0 if the whole is not positive."""
    fraction = part / (whole if whole > 0.0 else 1.0)
    fraction = fraction if fraction > 0.0 else 0.0
    return fraction if fraction < 1.0 else 1.0


@compiled
def _squared_distance(px, py, pz, ax, ay, az, dx, dy, dz):
    """Return the squared distance of a point from the segment from a to a + d."""
    x, y, z = px - ax, py - ay, pz - az
    fraction = _fraction(x * dx + y * dy + z * dz, dx * dx + dy * dy + dz * dz)
    x, y, z = x - fraction * dx, y - fraction * dy, z - fraction * dz
    return x * x + y * y + z * z


@compiled
def _to_segment(segment, nodes, row, width, count, distances):
    """Write the distance from a segment; the nearest points are an end of one, or within both segments."""
    sx, sy, sz, radius = segment[FIRST], segment[FIRST + 1], segment[FIRST + 2], segment[RADIUS]
    ex, ey, ez = segment[SECOND] - sx, segment[SECOND + 1] - sy, segment[SECOND + 2] - sz
    x0, y0, z0, x1, y1, z1 = nodes[row], nodes[row + 1], nodes[row + 2], nodes[row + 3], nodes[row + 4], nodes[row + 5]
    for k in range(count):
        ax, ay, az = x0[k], y0[k], z0[k]
        bx, by, bz = x1[k], y1[k], z1[k]
        dx, dy, dz = bx - ax, by - ay, bz - az
        rx, ry, rz = sx - ax, sy - ay, sz - az
        nx, ny, nz = dy * ez - dz * ey, dz * ex - dx * ez, dx * ey - dy * ex
        size = nx * nx + ny * ny + nz * nz
        fraction = _fraction((ry * ez - rz * ey) * nx + (rz * ex - rx * ez) * ny + (rx * ey - ry * ex) * nz, size)
        other = _fraction((ry * dz - rz * dy) * nx + (rz * dx - rx * dz) * ny + (rx * dy - ry * dx) * nz, size)
        x, y, z = rx + other * ex - fraction * dx, ry + other * ey - fraction * dy, rz + other * ez - fraction * dz
        squared = x * x + y * y + z * z
        squared = min(squared, _squared_distance(ax, ay, az, sx, sy, sz, ex, ey, ez))
        squared = min(squared, _squared_distance(bx, by, bz, sx, sy, sz, ex, ey, ez))
        squared = min(squared, _squared_distance(sx, sy, sz, ax, ay, az, dx, dy, dz))
        squared = min(squared, _squared_distance(sx + ex, sy + ey, sz + ez, ax, ay, az, dx, dy, dz))
        distance = np.sqrt(squared) - radius - width
        distances[k] = distance if distance < distances[k] else distances[k]


@compiled
def _outside(coordinate, half_size):
    """Return how far a coordinate is beyond ± half_size, signed."""
    above, below = coordinate - half_size, coordinate + half_size
    return (above if above > 0.0 else 0.0) + (below if below < 0.0 else 0.0)


@compiled
def _slope(fraction, start, step, half):
    """Return half the derivative of the squared distance from a box along a segment."""
    (ax, ay, az), (dx, dy, dz), (hx, hy, hz) = start, step, half
    x, y, z = ax + fraction * dx, ay + fraction * dy, az + fraction * dz
    return _outside(x, hx) * dx + _outside(y, hy) * dy + _outside(z, hz) * dz


@compiled
def _narrow(bracket, fraction, start, step, half):
    """Return the bracket of a segment's nearest place, with slopes at its ends, narrowed at a fraction."""
    low, low_slope, high, high_slope = bracket
    slope = _slope(fraction, start, step, half)
    falls, rises = (slope <= 0.0) & (fraction > low), (slope >= 0.0) & (fraction < high)
    low, low_slope = (fraction if falls else low), (slope if falls else low_slope)
    high, high_slope = (fraction if rises else high), (slope if rises else high_slope)
    return low, low_slope, high, high_slope


@compiled
def _to_box(box, nodes, row, width, count, distances):
    """Write the distance from a box.

    At the nearest place the derivative of the squared distance is zero; it is linear between the box's planes.
    """
    half = hx, hy, hz = box[SECOND], box[SECOND + 1], box[SECOND + 2]
    cx, cy, cz = box[FIRST], box[FIRST + 1], box[FIRST + 2]
    xx, xy, xz, yx, yy = box[AXES], box[AXES + 1], box[AXES + 2], box[AXES + 3], box[AXES + 4]
    yz, zx, zy, zz = box[AXES + 5], box[AXES + 6], box[AXES + 7], box[AXES + 8]
    x0, y0, z0, x1, y1, z1 = nodes[row], nodes[row + 1], nodes[row + 2], nodes[row + 3], nodes[row + 4], nodes[row + 5]
    for k in range(count):
        x, y, z = x0[k] - cx, y0[k] - cy, z0[k] - cz
        ax, ay, az = xx * x + xy * y + xz * z, yx * x + yy * y + yz * z, zx * x + zy * y + zz * z
        x, y, z = x1[k] - cx, y1[k] - cy, z1[k] - cz
        dx, dy, dz = xx * x + xy * y + xz * z - ax, yx * x + yy * y + yz * z - ay, zx * x + zy * y + zz * z - az
        low, high = 0.0, 1.0
        start, step = (ax, ay, az), (dx, dy, dz)
        low_slope = _slope(0.0, start, step, half)
        high_slope = _slope(1.0, start, step, half)
        bracket = low, low_slope, high, high_slope
        bracket = _narrow(bracket, _fraction((-hx - ax) * dx, dx * dx), start, step, half)
        bracket = _narrow(bracket, _fraction((hx - ax) * dx, dx * dx), start, step, half)
        bracket = _narrow(bracket, _fraction((-hy - ay) * dy, dy * dy), start, step, half)
        bracket = _narrow(bracket, _fraction((hy - ay) * dy, dy * dy), start, step, half)
        bracket = _narrow(bracket, _fraction((-hz - az) * dz, dz * dz), start, step, half)
        bracket = _narrow(bracket, _fraction((hz - az) * dz, dz * dz), start, step, half)
        low, low_slope, high, high_slope = bracket
        steepening = high_slope - low_slope  # 0 if both ends are within the box: the middle is then inside too
        share = _fraction(-low_slope, steepening)
        nearest = low + (high - low) * (share if steepening > 0.0 else 0.5)
        px, py, pz = ax + nearest * dx, ay + nearest * dy, az + nearest * dz
        x, y, z = _outside(px, hx), _outside(py, hy), _outside(pz, hz)
        depth = min(hx - abs(px), hy - abs(py), hz - abs(pz))
        distance = np.sqrt(x * x + y * y + z * z) - (depth if depth > 0.0 else 0.0) - width
        distances[k] = distance if distance < distances[k] else distances[k]


# Tests of steps: bounds, and distance from obstacles.


@compiled
def clearance_at_start(start, constraints, w):
    """Return the clearance before a step, beyond the required distance; inf without obstacles."""
    if constraints.obstacles.shape[0] == 0:
        return np.inf
    for j in range(start.previous.shape[0]):
        w.configurations[j, 0] = start.previous[j]
    run_first(constraints.nodes, w.configurations, w.nodes, 1)
    _evaluate_excess(constraints.obstacles, constraints, 1, w)
    return w.distances[0]


@compiled
def _evaluate_excess(obstacles, constraints, count, w):
    """Write the clearances of the first ``count`` in ``w.nodes``, beyond the required distance."""
    evaluate_distances(obstacles, constraints.widths, w.nodes, count, w.distances)
    for k in range(count):
        w.distances[k] -= constraints.required


@compiled
def shorten(genes, positions, count, start, constraints, w):
    """Scale down the self-motion of steps that exceed joint bounds, and change their genes to match."""
    if not constraints.bounded:
        return
    scale, shortened = w.scale[:count], np.int64(0)
    scale[:] = 1.0
    for j in range(start.previous.shape[0]):
        q, previous, shortest = positions[j], start.previous[j], start.particular[j]
        lower, upper = constraints.lower[j], constraints.upper[j]
        for k in range(count):  # without branches, for vector instructions
            self_motion = q[k] - previous - shortest
            beyond = (shortest + self_motion < lower) | (shortest + self_motion > upper)
            bound = upper if self_motion > 0.0 else lower
            share = min(scale[k], max((bound - shortest) / self_motion, 0.0))
            scale[k] = share if beyond else scale[k]
    for k in range(count):
        shortened += np.int64(scale[k] < 1.0)
    if shortened > 0:
        # scale the self-motion of steps, and change their genes to match
        n = start.previous.shape[0]
        for j in range(n):
            q, base = positions[j], start.previous[j] + start.particular[j]
            for k in range(count):
                scaled = base + scale[k] * (q[k] - base)
                q[k] = scaled if scale[k] < 1.0 else q[k]
        for row in range(0, genes.shape[0], n + 1):
            target = genes[row + n]
            for j in range(n):
                gene, q, previous = genes[row + j], positions[j], start.previous[j]
                for k in range(count):
                    total = (0.0 if j == 0 else target[k]) + gene[k] * (q[k] - previous)
                    target[k] = total if scale[k] < 1.0 else target[k]


@compiled
def find_inadmissible(count, start, constraints, clearance, options, w):
    """Move inadmissible pending steps to the front of ``w.pending``; return their number.

    ``clearance`` is the result of ``clearance_at_start``. Balls around the obstacles are tested first.
    """
    # pending steps beyond their bounds are rejected; those that may meet an obstacle become candidates
    rejected, near, n = 0, 0, start.previous.shape[0]
    for i in range(count):
        k = w.pending[i]
        travel, within = 0.0, True
        for j in range(n):
            step = w.inputs[j, k] - start.previous[j]
            travel += constraints.reach[j] * abs(step)
            within &= step >= constraints.lower[j] - options.bound_tolerance  # False for NaN
            within &= step <= constraints.upper[j] + options.bound_tolerance
        if not within:
            w.pending[rejected] = k
            rejected += 1
        elif travel >= clearance - constraints.standoff:
            for j in range(n):
                w.configurations[j, near] = w.inputs[j, k]
            w.candidates[near], w.travel[near] = k, travel
            near += 1
    if near == 0:
        return rejected
    # candidates that are clear of the balls around obstacles are removed; the others are kept with distances
    run_first(constraints.nodes, w.configurations, w.nodes, near)
    _evaluate_excess(constraints.bounding, constraints, near, w)
    close = 0
    for i in range(near):
        travel = w.travel[i] - clearance if constraints.swept else 0.0
        if not w.distances[i] > max(constraints.standoff, travel):
            w.candidates[close], w.travel[close] = w.candidates[i], w.travel[i]
            for m in range(w.nodes.shape[0]):
                w.nodes[m, close] = w.nodes[m, i]
            close += 1
    _evaluate_excess(constraints.obstacles, constraints, close, w)
    doubtful = 0
    for i in range(close):
        if not w.distances[i] > constraints.standoff:
            w.pending[rejected] = w.candidates[i]
            rejected += 1
        elif constraints.swept and clearance + w.distances[i] <= w.travel[i]:
            w.candidates[doubtful], w.travel[doubtful] = w.candidates[i], w.travel[i]
            w.intervals[4, doubtful] = w.distances[i]
            doubtful += 1
    if doubtful > 0:
        _sweep(doubtful, start, clearance, constraints, options, w)
    for i in range(doubtful):
        if w.travel[i] < 0.0:
            w.pending[rejected] = w.candidates[i]
            rejected += 1
    return rejected


@compiled
def _sweep(count, start, clearance, constraints, options, w):
    """Mark candidates by negative travel if their steps are not proven clear all the way.

    Intervals of steps (candidate, begin, width, distance at begin and end) wait on a stack. An interval is halved if
    the distances at its ends do not prove it clear.
    """
    intervals = w.intervals
    waiting = count
    for i in range(count):
        intervals[0, i], intervals[1, i], intervals[2, i], intervals[3, i] = i, 0.0, 1.0, clearance
    popped = np.empty((5, options.interval_batch))
    while waiting > 0:
        batch = min(waiting, options.interval_batch)
        waiting -= batch
        for i in range(batch):
            for m in range(5):
                popped[m, i] = intervals[m, waiting + i]
            k, share = w.candidates[np.int64(popped[0, i])], popped[1, i] + 0.5 * popped[2, i]
            for j in range(start.previous.shape[0]):
                w.configurations[j, i] = start.previous[j] + share * (w.inputs[j, k] - start.previous[j])
        run_first(constraints.nodes, w.configurations, w.nodes, batch)
        _evaluate_excess(constraints.obstacles, constraints, batch, w)
        for i in range(batch):
            # halves of an interval that are not proven clear are put on the stack. If the distance in the middle is not
            # positive, or halves would be too short, the travel of the candidate becomes negative
            middle = w.distances[i]
            candidate, begin, width = np.int64(popped[0, i]), popped[1, i], 0.5 * popped[2, i]
            first, last, travel = popped[3, i], popped[4, i], w.travel[candidate]
            if not (travel < 0.0):
                first_clear, second_clear = first + middle > travel * width, middle + last > travel * width
                if not middle > 0.0 or (not (first_clear and second_clear) and width <= options.shortest_interval):
                    w.travel[candidate] = -1.0
                else:
                    if not first_clear:
                        _push(intervals, waiting, candidate, begin, width, first, middle)
                        waiting += 1
                    if not second_clear:
                        _push(intervals, waiting, candidate, begin + width, width, middle, last)
                        waiting += 1


@compiled
def _push(intervals, i, candidate, begin, width, first_distance, last_distance):
    intervals[0, i], intervals[1, i], intervals[2, i] = candidate, begin, width
    intervals[3, i], intervals[4, i] = first_distance, last_distance
