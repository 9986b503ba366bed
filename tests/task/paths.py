"""Paths of every kind, for tests."""

from __future__ import annotations

import numpy as np

from paretoik.robot.pose import Pose
from paretoik.task.path import circle, line, poses, waypoints

CORNERS = np.array([[0.0, 0.0, 0.0], [0.4, 0.1, 0.0], [0.5, 0.5, 0.2], [0.1, 0.6, 0.3]])
TURNED = [Pose.from_rpy(position, [0.3 * i, -0.2 * i, 0.9 * i]) for i, position in enumerate(CORNERS)]
EVERY_KIND = {
    "line of points": line([0.4, 0.0], [0.1, 0.2], duration=0.7, samples=31),
    "line of poses": line(TURNED[0], TURNED[3], duration=0.7, samples=31),
    "circle of points": circle([0.5, 0.0], 0.2, duration=0.7, samples=31),
    "circle of poses": circle(TURNED[1], 0.2, duration=0.7, samples=31, turns=2),
    "waypoints": waypoints(CORNERS, duration=0.7, samples=31),
    "waypoints of poses": waypoints(TURNED, duration=0.7, samples=31),
    "timed points": poses([0.0, 0.1, 0.5, 0.7], CORNERS),
    "timed poses": poses([0.0, 0.1, 0.5, 0.7], TURNED),
}
