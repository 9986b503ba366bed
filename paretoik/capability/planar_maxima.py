"""The directional maxima of a planar arm with three joints, over all its postures at a position: compiled.

The postures that reach a position lie on closed curves: the first link turns within an interval, from one end of which
to the other the elbow bends one way, and back the other way. Each curve is looked at all around, evenly in a parameter
along which it is smooth; for every direction the best few places are then searched further by golden sections.
"""

from __future__ import annotations

import numpy as np

from paretoik.capability.motors import ANGLE, HOLD, ROD, SPEED, STRIP, bent, joint
from paretoik.compilation import compiled

AROUND = 360  # places on each curve, besides those where limits begin and end to be kept
KEPT_TO = -1e-12  # rad: the room that limits leave at least
KEPT = 4  # of each direction and curve that are searched further
WITHIN = 4  # pieces that a stretch between two places is looked at in
NEW, OUTSIDE = -1, -2  # places that were not looked at
BISECTIONS = 40  # to where limits begin or end to be kept
GOLDEN = 0.6180339887498949
HALVINGS = 40
BELOW = 1e-14  # share of a direction across a normal: those that point this little along it are not bounded by it


@compiled
def _curves(reach, lengths, found):
    """Write the curves as (centre, half width, way the elbow bends or 0 for both) of the first link's angle β.

    β is measured from the direction of the position, which is ``reach`` away. Returns how many there are.
    """
    first, second, third = lengths
    product = 2.0 * reach * first
    far = (reach * reach + first * first - (second + third) ** 2) / product if product > 0.0 else -np.inf
    near = (reach * reach + first * first - (second - third) ** 2) / product if product > 0.0 else np.inf
    if product == 0.0 and not abs(second - third) <= first <= second + third:
        return 0
    if far > 1.0 or near < -1.0:
        return 0
    most, least = np.arccos(max(far, -1.0)), np.arccos(min(near, 1.0))
    if least <= 0.0 and most >= np.pi:
        for k in range(2):
            found[k, 0], found[k, 1], found[k, 2] = 0.0, np.pi, 2.0 * k - 1.0
        return 2
    found[0, 2] = found[1, 2] = 0.0
    if least <= 0.0:
        found[0, 0], found[0, 1] = 0.0, most
        return 1
    if most >= np.pi:
        found[0, 0], found[0, 1] = np.pi, np.pi - least
        return 1
    for k in range(2):
        found[k, 0], found[k, 1] = (2.0 * k - 1.0) * 0.5 * (least + most), 0.5 * (most - least)
    return 2


@compiled
def _posed(curve, place, arm, target, q, columns):
    """Write the posture at a place on a curve and the columns of its Jacobian; return what room limits leave [rad]."""
    lengths, turned, offsets, base, _, limits = arm
    x, y = target[0] - base[0], target[1] - base[1]
    ahead = np.arctan2(y, x)
    if curve[2] != 0.0:
        beta, way = place, curve[2]
    else:
        beta, way = curve[0] - curve[1] * np.cos(place), (1.0 if np.sin(place) >= 0.0 else -1.0)
    first = ahead + beta
    x, y = x - lengths[0] * np.cos(first), y - lengths[0] * np.sin(first)
    bent = (x * x + y * y - lengths[1] ** 2 - lengths[2] ** 2) / (2.0 * lengths[1] * lengths[2])
    elbow = way * np.arccos(min(max(bent, -1.0), 1.0))
    second = np.arctan2(y, x) - np.arctan2(lengths[2] * np.sin(elbow), lengths[1] + lengths[2] * np.cos(elbow))
    third = second + elbow
    q[0], q[1], q[2] = first - offsets[0], second - offsets[1], third - offsets[2]  # how links lie in the world
    u, v = 0.0, 0.0
    for j in range(2, -1, -1):
        angle = first if j == 0 else second if j == 1 else third
        u, v = u + lengths[j] * np.cos(angle), v + lengths[j] * np.sin(angle)
        columns[j, 0], columns[j, 1] = -v, u
    before, room = base[2], np.inf
    for j in range(3):
        lying = q[j]
        q[j] = lying - before - turned[j]
        before = lying
        low, high = limits[j]
        if np.isfinite(low):
            middle = 0.5 * (low + high) if np.isfinite(high) else low + np.pi
        else:
            middle = high - np.pi if np.isfinite(high) else 0.0
        q[j] -= 2.0 * np.pi * np.floor((q[j] - middle + np.pi) / (2.0 * np.pi))
        room = min(room, q[j] - low, high - q[j])
    return room


@compiled
def _loads(q, arm, loads):
    """Write the torques that hold the arm still."""
    lengths, turned, offsets, base, weights, _ = arm
    lying = base[2] + q[0] + turned[0] + q[1] + turned[1] + q[2] + turned[2]
    torque, push_x, push_y = 0.0, 0.0, 0.0
    for j in range(2, -1, -1):  # from the tip: what hangs beyond the end of a link pulls there
        angle = lying + offsets[j]
        torque += lengths[j] * (np.sin(angle) * push_x - np.cos(angle) * push_y)
        cosine, sine = np.cos(lying), np.sin(lying)
        mass, at_x, at_y = weights[j, 0], weights[j, 1], weights[j, 2]
        x, y = cosine * at_x - sine * at_y, sine * at_x + cosine * at_y
        pull_x, pull_y = mass * weights[3, 0], mass * weights[3, 1]
        torque += y * pull_x - x * pull_y
        push_x, push_y = push_x + pull_x, push_y + pull_y
        loads[j] = torque
        lying -= q[j] + turned[j]


@compiled
def _able(q, loads, table, what, able, ends):
    """Write (lowest, highest) speed, or torque left, of every joint; return whether all can hold."""
    for j in range(3):
        if what == SPEED:
            able[j, 1] = joint(table[j], q[j], loads[j], what, ends)[0]
            able[j, 0] = -able[j, 1]
            if table[j, 0] == STRIP:
                able[j, 0] = -joint(table[j], q[j], -loads[j], what, ends)[0]
        else:
            hold = joint(table[j], q[j], 0.0, what, ends)[0]
            able[j, 0], able[j, 1] = -hold - loads[j], hold - loads[j]
        if not (able[j, 0] <= 0.0 <= able[j, 1]):
            return False
    return True


@compiled
def fastest(columns, able, x, y):
    """Return the highest speed along (x, y): the nearest edge of the polygon of tool velocities."""
    best = np.inf
    for i in range(5):  # edges are along a joint's column; where all columns are parallel an axis stands in
        if i < 3:
            u, v = -columns[i, 1], columns[i, 0]
        else:
            u, v = (1.0, 0.0) if i == 3 else (0.0, 1.0)
        across = u * x + v * y
        if abs(across) <= BELOW * (abs(u * x) + abs(v * y)):
            continue
        if across < 0.0:
            u, v, across = -u, -v, -across
        support = 0.0
        for j in range(3):
            if j != i:
                share = u * columns[j, 0] + v * columns[j, 1]
                support += share * (able[j, 1] if share > 0.0 else able[j, 0])
        best = min(best, support / across)
    return best


@compiled
def strongest(columns, able, x, y):
    """Return the greatest force along (x, y) that the torques left can bear."""
    best = np.inf
    for j in range(3):
        share = columns[j, 0] * x + columns[j, 1] * y
        if share != 0.0:
            best = min(best, (able[j, 1] if share > 0.0 else able[j, 0]) / share)
    return best


@compiled
def _most(columns, able, direction, what):
    """Return the highest speed, or the greatest force, along a direction."""
    if what == SPEED:
        return fastest(columns, able, direction[0], direction[1])
    return strongest(columns, able, direction[0], direction[1])


@compiled
def _room(curve, place, given, q, room):
    """Return by how much limits and motors are kept at a place, negative where they are not.

    Limits, and the angles of rods, in rad; torques as shares of what can be held, asked only where positions are kept.
    """
    arm, table, target, _ = given
    columns, loads, _, ends = room
    left = _posed(curve, place, arm, target, q, columns) - KEPT_TO
    for j in range(3):
        if table[j, ROD] != 0.0:
            angle = bent(table[j], q[j])
            left = min(left, angle - table[j, ANGLE], table[j, ANGLE + 1] - angle)
    if left < 0.0:
        return left
    _loads(q, arm, loads)
    for j in range(3):
        left = min(left, 1.0 - abs(loads[j]) / joint(table[j], q[j], 0.0, HOLD, ends)[0])
    return left


@compiled
def _worths(curve, place, directions, given, q, room, found):
    """Write what a place is worth along each direction; −1 where the arm cannot be there. Return whether it can."""
    arm, table, target, what = given
    columns, loads, able, ends = room
    found[:] = -1.0
    if not _posed(curve, place, arm, target, q, columns) >= KEPT_TO:
        return False
    _loads(q, arm, loads)
    if not _able(q, loads, table, what, able, ends):
        return False
    for k in range(directions.shape[0]):
        found[k] = _most(columns, able, directions[k], what)
    return True


@compiled
def _refined(curve, low, high, direction, given, q, room, found):
    """Return (worth, place) of the most between two places, by golden sections."""
    a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    _worths(curve, a, direction, given, q, room, found)
    at_a = found[0]
    _worths(curve, b, direction, given, q, room, found)
    at_b = found[0]
    for _ in range(HALVINGS):
        if at_a > at_b:
            high, b, at_b = b, a, at_a
            a = high - GOLDEN * (high - low)
            _worths(curve, a, direction, given, q, room, found)
            at_a = found[0]
        else:
            low, a, at_a = a, b, at_b
            b = low + GOLDEN * (high - low)
            _worths(curve, b, direction, given, q, room, found)
            at_b = found[0]
    return (at_a, a) if at_a >= at_b else (at_b, b)


@compiled
def _roomiest(curve, low, high, given, q, room):
    """Return the place between two others with the most room, by golden sections; where there is some, that is it."""
    a, b = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_a, at_b = _room(curve, a, given, q, room), _room(curve, b, given, q, room)
    for _ in range(HALVINGS):
        if at_a >= 0.0 or at_b >= 0.0:
            break
        if at_a > at_b:
            high, b, at_b = b, a, at_a
            a = high - GOLDEN * (high - low)
            at_a = _room(curve, a, given, q, room)
        else:
            low, a, at_a = a, b, at_b
            b = low + GOLDEN * (high - low)
            at_b = _room(curve, b, given, q, room)
    return (at_a, a) if at_a >= at_b else (at_b, b)


@compiled
def _end(curve, inside, outside, given, q, room):
    """Return the place nearest to one outside that still is inside, by bisection."""
    for _ in range(BISECTIONS):
        middle = 0.5 * (inside + outside)
        if _room(curve, middle, given, q, room) >= 0.0:
            inside = middle
        else:
            outside = middle
    return inside


@compiled
def _places(curve, looked, given, q, room, places, known):
    """Write the places of a curve that are to be compared, in order, and which are ``known``; return how many.

    Those evenly around where limits and motors are kept, by their number, and as ``NEW`` the ends of every stretch of
    them, between places ``OUTSIDE``. Stretches between two places too: where the room that is lacking has a least, that
    is searched for.
    """
    step, count = 2.0 * np.pi / AROUND, 0
    rooms = np.empty(AROUND)
    for i in range(AROUND):
        rooms[i] = 1.0 if looked[i, 0] >= 0.0 else min(_room(curve, (i + 0.5) * step, given, q, room), -1e-300)
    for i in range(AROUND):
        here, before, after = (i + 0.5) * step, rooms[i - 1], rooms[(i + 1) % AROUND]
        if rooms[i] >= 0.0:
            if before < 0.0:
                places[count], known[count] = here - step, OUTSIDE
                places[count + 1], known[count + 1] = _end(curve, here, here - step, given, q, room), NEW
                count += 2
            places[count], known[count] = here, i
            count += 1
            if after < 0.0:
                places[count], known[count] = _end(curve, here, here + step, given, q, room), NEW
                places[count + 1], known[count + 1] = here + step, OUTSIDE
                count += 2
        elif before < 0.0 and after < 0.0 and rooms[i] >= before and rooms[i] >= after:
            left, middle = _roomiest(curve, here - step, here + step, given, q, room)
            if left >= 0.0:
                low = _end(curve, middle, here - step, given, q, room)
                high = _end(curve, middle, here + step, given, q, room)
                for k in range(-1, WITHIN + 2):
                    places[count] = low + (high - low) * k / WITHIN
                    known[count] = NEW if 0 <= k <= WITHIN else OUTSIDE
                    count += 1
    return count


@compiled
def maxima(given, directions, values, postures):
    """Write the greatest value and the posture that attains it, of every direction; −1 where no posture can be held.

    ``given`` is (arm, table of motors, position, what is to be most). Returns how many curves of postures there are.
    """
    arm, _, target, _ = given
    count = directions.shape[0]
    curves, q = np.empty((2, 3)), np.empty(3)
    room = np.empty((3, 2)), np.empty(3), np.empty((3, 2)), np.empty(7)
    many = _curves(np.hypot(target[0] - arm[3][0], target[1] - arm[3][1]), arm[0], curves)
    step, most = 2.0 * np.pi / AROUND, (WITHIN + 3) * AROUND
    looked, worths = np.empty((AROUND, count)), np.empty((most, count))
    places, known = np.empty(most), np.empty(most, dtype=np.int64)
    values[:] = -1.0
    for c in range(many):
        for i in range(AROUND):
            _worths(curves[c], (i + 0.5) * step, directions, given, q, room, looked[i])
        found = _places(curves[c], looked, given, q, room, places, known)
        for i in range(found):
            if known[i] >= 0:
                worths[i] = looked[known[i]]
            elif known[i] == OUTSIDE:
                worths[i] = -1.0
            else:
                _worths(curves[c], places[i], directions, given, q, room, worths[i])
        for k in range(count):
            _searched(
                curves[c], places[:found], worths[:found, k], directions[k : k + 1], given, q, room,
                values[k : k + 1], postures[k],
            )  # fmt: skip
    return many


@compiled
def _searched(curve, places, worths, direction, given, q, room, value, posture):
    """Write the most along one direction on a curve, from the best local maxima of places, if it is more than known."""
    many = len(places)
    tops, where, one = np.full(KEPT, -1.0), np.zeros(KEPT, dtype=np.int64), np.empty(1)
    for i in range(many):
        top = worths[i]
        if top <= tops[KEPT - 1] or top < worths[i - 1] or top < worths[(i + 1) % many]:
            continue
        k = KEPT - 1
        while k > 0 and tops[k - 1] < top:
            tops[k], where[k] = tops[k - 1], where[k - 1]
            k -= 1
        tops[k], where[k] = top, i
    for k in range(KEPT):
        if tops[k] < 0.0:
            break
        i = where[k]
        after = (i + 1) % many
        low = places[i - 1] - (2.0 * np.pi if i == 0 else 0.0) if worths[i - 1] >= 0.0 else places[i]
        high = places[after] + (2.0 * np.pi if after == 0 else 0.0) if worths[after] >= 0.0 else places[i]
        step = 2.0 * np.pi / AROUND
        found, at = _refined(
            curve, max(low, places[i] - step), min(high, places[i] + step), direction, given, q, room, one
        )
        if tops[k] > found:
            found, at = tops[k], places[i]
        if found > value[0]:
            _worths(curve, at, direction, given, posture, room, one)
            value[0] = one[0]
