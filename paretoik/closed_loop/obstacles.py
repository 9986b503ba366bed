"""How far an arm is from what surrounds it, compiled: the distances of ``task/obstacles``, as far as they are positive.

Lanes are configurations; a loop over them has no branches, so that several are computed at once.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from paretoik.compilation import compiled
from paretoik.task.obstacles import Box, Capsule, Circle, Obstacle

POINT, SEGMENT, BOX = range(3)
ENDLESS = 1e30  # half a size that has no end
KIND, RADIUS, FIRST, SECOND, AXES = 0, 1, 2, 5, 8
NUMBERS = 17


def scene(obstacles: Sequence[Obstacle]) -> Float[np.ndarray, "obstacles columns"]:
    """Return a row an obstacle: kind, radius, two points or center and half sizes, axes.

    Of a circle, which is a cylinder in space, z counts nothing: its last axis is 0.
    """
    rows = np.zeros((len(obstacles), NUMBERS))
    for row, each in zip(rows, obstacles, strict=True):
        row[AXES:] = np.eye(3).ravel()
        if isinstance(each, Box):
            halves = np.append(each.half_sizes, [ENDLESS] * (3 - len(each.half_sizes)))
            row[KIND], row[FIRST : FIRST + 3], row[SECOND : SECOND + 3] = BOX, each.pose.position, halves
            row[AXES:] = each.pose.rotation.T.ravel()
        elif isinstance(each, Capsule):
            row[KIND], row[RADIUS] = SEGMENT, each.radius
            row[FIRST : FIRST + 3], row[SECOND : SECOND + 3] = each.start, each.end
        else:
            row[KIND], row[RADIUS], row[FIRST : FIRST + len(each.center)] = POINT, each.radius, each.center
            row[AXES + 8] = 0.0 if isinstance(each, Circle) else 1.0
    return rows


def round_scene(obstacles: Sequence[Obstacle]) -> Float[np.ndarray, "obstacles columns"]:
    """Return what encloses each obstacle and is quicker to look at: a ball, or a circle; where there is none, all."""
    rows = scene(obstacles)
    for row, each in zip(rows, obstacles, strict=True):
        if isinstance(each, Box):
            halves = each.half_sizes
            upright = len(halves) == 3 or abs(each.pose.rotation[2, 2]) == 1.0
            row[KIND], row[RADIUS] = POINT, np.linalg.norm(halves) if upright else np.inf
            row[AXES + 8] = float(len(halves) == 3)
        elif isinstance(each, Capsule):
            row[KIND], row[FIRST : FIRST + 3] = POINT, (each.start + each.end) / 2
            row[RADIUS] = each.radius + np.linalg.norm(each.end - each.start) / 2
    return rows


@compiled
def gaps(obstacles, nodes, lanes, found):
    """Write the least distance of the polyline of each lane from all obstacles; no more than 0 where it meets one.

    ``nodes`` (3 · nodes, lanes) are x, y, z of each node in turn, ``obstacles`` what ``scene`` returns.
    """
    for lane in range(lanes):
        found[lane] = np.inf
    for i in range(obstacles.shape[0]):
        for k in range(0, nodes.shape[0] - 3, 3):
            if obstacles[i, KIND] == POINT:
                _to_point(obstacles[i], nodes[k : k + 6], lanes, found)
            elif obstacles[i, KIND] == SEGMENT:
                _to_segment(obstacles[i], nodes[k : k + 6], lanes, found)
            else:
                _to_box(obstacles[i], nodes[k : k + 6], lanes, found)


@compiled
def _share(part, whole):
    """Return part / whole within [0, 1], and 0 where there is no whole."""
    share = part / (whole if whole > 0.0 else 1.0)
    share = share if share > 0.0 else 0.0
    return share if share < 1.0 else 1.0


@compiled
def _from_segment(px, py, pz, ax, ay, az, dx, dy, dz):
    """Return the squared distance of a point from a segment that begins in a and goes d."""
    x, y, z = px - ax, py - ay, pz - az
    share = _share(x * dx + y * dy + z * dz, dx * dx + dy * dy + dz * dz)
    x, y, z = x - share * dx, y - share * dy, z - share * dz
    return x * x + y * y + z * z


@compiled
def _to_point(point, link, lanes, found):
    x, y, flat = point[FIRST], point[FIRST + 1], point[AXES + 8]
    z, radius = flat * point[FIRST + 2], point[RADIUS]
    x0, y0, z0, x1, y1, z1 = link[0], link[1], link[2], link[3], link[4], link[5]
    for lane in range(lanes):
        ax, ay, az = x0[lane], y0[lane], flat * z0[lane]
        dx, dy, dz = x1[lane] - ax, y1[lane] - ay, flat * z1[lane] - az
        gap = np.sqrt(_from_segment(x, y, z, ax, ay, az, dx, dy, dz)) - radius
        found[lane] = gap if gap < found[lane] else found[lane]


@compiled
def _to_segment(segment, link, lanes, found):
    """At an end of one, or where their lines are nearest if that is within both."""
    sx, sy, sz, radius = segment[FIRST], segment[FIRST + 1], segment[FIRST + 2], segment[RADIUS]
    ex, ey, ez = segment[SECOND] - sx, segment[SECOND + 1] - sy, segment[SECOND + 2] - sz
    x0, y0, z0, x1, y1, z1 = link[0], link[1], link[2], link[3], link[4], link[5]
    for lane in range(lanes):
        ax, ay, az = x0[lane], y0[lane], z0[lane]
        bx, by, bz = x1[lane], y1[lane], z1[lane]
        dx, dy, dz = bx - ax, by - ay, bz - az
        rx, ry, rz = sx - ax, sy - ay, sz - az
        cx, cy, cz = dy * ez - dz * ey, dz * ex - dx * ez, dx * ey - dy * ex
        size = cx * cx + cy * cy + cz * cz
        share = _share((ry * ez - rz * ey) * cx + (rz * ex - rx * ez) * cy + (rx * ey - ry * ex) * cz, size)
        other = _share((ry * dz - rz * dy) * cx + (rz * dx - rx * dz) * cy + (rx * dy - ry * dx) * cz, size)
        x, y, z = rx + other * ex - share * dx, ry + other * ey - share * dy, rz + other * ez - share * dz
        square = x * x + y * y + z * z
        square = min(square, _from_segment(ax, ay, az, sx, sy, sz, ex, ey, ez))
        square = min(square, _from_segment(bx, by, bz, sx, sy, sz, ex, ey, ez))
        square = min(square, _from_segment(sx, sy, sz, ax, ay, az, dx, dy, dz))
        square = min(square, _from_segment(sx + ex, sy + ey, sz + ez, ax, ay, az, dx, dy, dz))
        gap = np.sqrt(square) - radius
        found[lane] = gap if gap < found[lane] else found[lane]


@compiled
def _beyond(place, half):
    """Return how far a coordinate is beyond −half or half, signed; 0 between them."""
    over = place - half
    over = over if over > 0.0 else 0.0
    under = place + half
    return over + (under if under < 0.0 else 0.0)


@compiled
def _slope(share, ax, ay, az, dx, dy, dz, hx, hy, hz):
    """Return how the squared distance from a box grows along a segment, halved."""
    return _beyond(ax + share * dx, hx) * dx + _beyond(ay + share * dy, hy) * dy + _beyond(az + share * dz, hz) * dz


@compiled
def _to_box(box, link, lanes, found):
    """Where the slope of the squared distance, which grows from plane to plane of the box, is zero."""
    hx, hy, hz = box[SECOND], box[SECOND + 1], box[SECOND + 2]
    cx, cy, cz = box[FIRST], box[FIRST + 1], box[FIRST + 2]
    xx, xy, xz, yx, yy = box[AXES], box[AXES + 1], box[AXES + 2], box[AXES + 3], box[AXES + 4]
    yz, zx, zy, zz = box[AXES + 5], box[AXES + 6], box[AXES + 7], box[AXES + 8]
    x0, y0, z0, x1, y1, z1 = link[0], link[1], link[2], link[3], link[4], link[5]
    for lane in range(lanes):
        x, y, z = x0[lane] - cx, y0[lane] - cy, z0[lane] - cz
        ax, ay, az = xx * x + xy * y + xz * z, yx * x + yy * y + yz * z, zx * x + zy * y + zz * z
        x, y, z = x1[lane] - cx, y1[lane] - cy, z1[lane] - cz
        dx, dy, dz = xx * x + xy * y + xz * z - ax, yx * x + yy * y + yz * z - ay, zx * x + zy * y + zz * z - az
        low, high = 0.0, 1.0
        low_slope = _slope(0.0, ax, ay, az, dx, dy, dz, hx, hy, hz)
        high_slope = _slope(1.0, ax, ay, az, dx, dy, dz, hx, hy, hz)
        for place in (
            _share((-hx - ax) * dx, dx * dx),
            _share((hx - ax) * dx, dx * dx),
            _share((-hy - ay) * dy, dy * dy),
            _share((hy - ay) * dy, dy * dy),
            _share((-hz - az) * dz, dz * dz),
            _share((hz - az) * dz, dz * dz),
        ):
            slope = _slope(place, ax, ay, az, dx, dy, dz, hx, hy, hz)
            falls, rises = (slope <= 0.0) & (place > low), (slope >= 0.0) & (place < high)
            low, low_slope = (place if falls else low), (slope if falls else low_slope)
            high, high_slope = (place if rises else high), (slope if rises else high_slope)
        nearest = low + (high - low) * _share(-low_slope, high_slope - low_slope)
        x, y, z = _beyond(ax + nearest * dx, hx), _beyond(ay + nearest * dy, hy), _beyond(az + nearest * dz, hz)
        gap = np.sqrt(x * x + y * y + z * z)
        found[lane] = gap if gap < found[lane] else found[lane]
