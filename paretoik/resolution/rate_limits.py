"""The rates that keep joints, and distances, within their limits in a step and in all steps after it.

Rates are constant over a step, and change from step to step as accelerations allow. What approaches a limit must be
able to brake before it: at a rate v, braking by aⱼ in the steps after, it goes no less than v Tₙ − Sₙ in n + 1 steps,
where Tₙ = Σ hⱼ and Sₙ = Σ hⱼ Σᵢ≤ⱼ aᵢ hᵢ. A rate by which this exceeds no distance from a limit leaves another such rate
in the next step.

Source: Del Prete 2018, Joint Position and Velocity Bounds in Discrete-Time Acceleration/Torque Control of Robot Arms,
for any steps and for limits that vary.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.task.motion_task import MotionTask

KINDS = "acceleration", "step", "velocity", "position"  # of limits on a joint's rate, the first to be kept first


@dataclass(frozen=True, kw_only=True, eq=False)
class RateLimits:
    """Limits (steps, dof, 2) at the sample after every step, −inf and inf where there are none, and ``steps`` [s]."""

    position: Float[np.ndarray, "steps dof 2"]
    velocity: Float[np.ndarray, "steps dof 2"]
    acceleration: Float[np.ndarray, "steps dof 2"]
    steps: Float[np.ndarray, " steps"]

    @classmethod
    def of(cls, task: MotionTask) -> RateLimits:
        """Return those of a task."""
        steps, dof = np.diff(task.times), task.arm.dof
        shape, none = (len(task.times), dof, 2), np.array([-np.inf, np.inf])
        limits = {
            kind: np.broadcast_to(task.bounds.get(kind, none), shape)[1:] for kind in ("velocity", "acceleration")
        }
        position = np.broadcast_to(task.bounds.get("position", task.arm.position_limits), shape)[1:]
        return cls(position=position, **limits, steps=steps)

    def bounds(self, k: int, q: np.ndarray, previous: np.ndarray) -> Float[np.ndarray, "kinds *batch dof 2"]:
        """Return lower and upper bounds of the rates in step k from q (*batch, dof), after ``previous`` rates."""
        sides = []
        for side, sign in ((0, -1.0), (1, 1.0)):
            braking = self._braking(k, side)
            slack = sign * (self.position[k : k + len(braking), :, side] - q[..., None, :])
            drop = np.cumsum(braking * self.steps[k : k + len(braking), None], axis=0)
            bounds = (
                sign * previous + sign * self.acceleration[k, :, side] * self.steps[k],
                np.full_like(q, 1.0 / self.steps[k]),  # rad or m: a Jacobian says nothing farther away
                np.broadcast_to((sign * self.velocity[k : k + len(braking), :, side] + drop).min(axis=0), q.shape),
                highest_rate(slack, braking, self.steps[k : k + len(braking)]),
            )
            sides.append(sign * np.stack(bounds))
        return np.stack(sides, axis=-1)

    def approach(self, k: int, slack: np.ndarray, gradients: np.ndarray) -> Float[np.ndarray, "*batch"]:
        """Return how fast distances (*batch,) may shrink in step k, their ``slack`` [m] being left.

        Every joint brakes as its acceleration limits let it, the gradients (*batch, dof) staying as they are.
        """
        lower, upper = (self._braking(k, side) for side in (0, 1))  # of motion downwards, and upwards
        rising, falling = np.maximum(gradients, 0.0), np.maximum(-gradients, 0.0)
        with np.errstate(invalid="ignore"):
            braking = np.nan_to_num(rising[..., None, :] * lower, nan=0.0, posinf=np.inf)
            braking = (braking + np.nan_to_num(falling[..., None, :] * upper, nan=0.0, posinf=np.inf)).sum(axis=-1)
        steps = self.steps[k : k + len(lower)]
        return highest_rate(slack[..., None, None], braking[..., None], steps)[..., 0]

    def _braking(self, k: int, side: int) -> Float[np.ndarray, "later dof"]:
        """Return by how much rates towards a side can shrink in step k, where they cannot any more, and in later ones.

        One step where nothing limits accelerations: then rates can end at once.
        """
        opposite = self.acceleration[k:, :, 1 - side] * (1.0 if side == 0 else -1.0)
        later = opposite if np.isfinite(opposite).any() else opposite[:1]
        return np.concatenate([np.zeros((1, later.shape[1])), np.maximum(later[1:], 0.0)])


def highest_rate(
    slack: Float[np.ndarray, "*batch #later columns"],
    braking: Float[np.ndarray, "*#batch later columns"],
    steps: Float[np.ndarray, " later"],
) -> Float[np.ndarray, "*batch columns"]:
    """Return the highest rate from which no ``slack``, until the end of this step and of each later one, is exceeded.

    ``braking`` is by how much rates can shrink per second in these steps, 0 in the first.
    """
    drop = np.cumsum(braking * steps[:, None], axis=-2)
    return np.asarray(((slack + np.cumsum(drop * steps[:, None], axis=-2)) / np.cumsum(steps)[:, None]).min(axis=-2))


def intersection(bounds: Float[np.ndarray, "kinds *batch dof 2"]) -> Float[np.ndarray, "*batch dof 2"]:
    """Return the interval within bounds of all kinds; where they contradict each other the first kinds are kept."""
    lower, upper = bounds[0, ..., 0], bounds[0, ..., 1]
    for each in bounds[1:]:
        lower, upper = np.clip(each[..., 0], lower, upper), np.clip(each[..., 1], lower, upper)
    return np.stack([lower, upper], axis=-1)
