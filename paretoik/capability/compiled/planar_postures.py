"""All postures of a planar arm with three joints at a position: curves, places on them, limits and loads, compiled.

The postures that reach a position lie on closed curves: the first link turns within an interval, from one end of which
to the other the elbow bends one way, and back the other way. ``arm`` is (lengths, rotations before each joint, angles
of the links, base, masses with gravity, limits), as ``best_postures`` writes it.
"""

from __future__ import annotations

import numpy as np

from paretoik.compilation import compiled


@compiled
def posture_curves(reach, lengths, curves):
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
    """Write the posture at a place on a curve and the columns of its Jacobian; return the limits' slack [rad]."""
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
    for j in range(2, -1, -1):  # from the tip: the weight beyond the end of a link acts there
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
