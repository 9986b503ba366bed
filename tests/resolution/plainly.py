"""Independent resolvers in plain NumPy by the papers' formulas, one motion at a time."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from paretoik.robot import kinematics
from paretoik.task.retraction import task_errors


def weights_of_clamping(q, lower, upper, buffer):
    """Return e_c of every joint (Eqs. 16 and 17)."""
    weights = np.ones(len(q))
    for i, place in enumerate(q):
        if not np.isfinite(upper[i] - lower[i]):
            continue
        high, low = (1 - buffer) * upper[i] + buffer * lower[i], (1 - buffer) * lower[i] + buffer * upper[i]
        d = (low - place) / (low - lower[i]) if place <= low else (place - high) / (upper[i] - high)
        if d >= 1:
            weights[i] = 0.0
        elif d > 0:
            weights[i] = 0.5 - 0.5 * np.tanh(1 / (1 - d) - 1 / d)
    return weights


def repulsions(q, lower, upper, buffer, maximum_speed):
    """Return t_r of every joint (Eq. 20), past its limit the same as at it."""
    speeds = np.zeros(len(q))
    for i, place in enumerate(q):
        if np.isfinite(upper[i] - lower[i]):
            high, low = (1 - buffer) * upper[i] + buffer * lower[i], (1 - buffer) * lower[i] + buffer * upper[i]
            speeds[i] = min(max(place - high, 0) / (upper[i] - high), 1) - min(
                max(low - place, 0) / (low - lower[i]), 1
            )
    return maximum_speed * speeds


def coefficient(value, band):
    s = np.clip((value - band) / (1 - 2 * band), 0, 1)
    return 1 - 3 * s**2 + 2 * s**3


def damping(matrix, region, maximum_damping):
    """Return ρ² (Eq. 4)."""
    smallest = np.linalg.svd(matrix)[1].min()
    return max(0.0, maximum_damping**2 * (1 - (smallest / region) ** 2)) if region > 0 else 0.0


class Plainly:
    """A resolver, step by step; ``rates(self, q, J, v, dq)`` computes the step."""

    def __init__(self, motion, rates, feedback):
        self.motion, self.rates, self.feedback = motion, rates, feedback
        self.lower, self.upper = motion.arm.position_limits.T

    def at(self, q, k):
        targets = np.concatenate([task.targets(self.motion.time) for task in self.motion.tasks], axis=1)
        return task_errors(self.motion.arm, self.motion.tasks, q, targets[k])

    def wanted(self, q, k):
        dt = self.motion.time[k + 1] - self.motion.time[k]
        return self.travelled(q, k) / dt + self.feedback * self.at(q, k)[0]

    def travelled(self, q, k):
        """Return the travel of the target: positions in world axes, the turn of its frame in the tool's axes."""
        (task,) = self.motion.tasks
        now, later = (task.targets(self.motion.time)[i] for i in (k, k + 1))
        size = task.position_rows
        if len(now) == size:
            return later - now
        before, after = (Rotation.from_matrix(each[size:].reshape(3, 3)) for each in (now, later))
        tool = Rotation.from_matrix(kinematics.forward_kinematics(self.motion.arm, q)[0])
        turn = tool.inv().apply((after * before.inv()).as_rotvec())
        return np.concatenate([later[:size] - now[:size], turn])

    def followed(self):
        q, dq, postures = self.motion.q[0], np.zeros(self.motion.arm.dof), [self.motion.q[0]]
        for k, dt in enumerate(np.diff(self.motion.time)):
            dq = self.rates(self, q, self.at(q, k)[1], self.wanted(q, k), dq)
            q = q + dt * dq
            postures.append(q)
        return np.array(postures)
