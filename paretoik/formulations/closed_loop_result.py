"""The result of a closed loop: the motion, every step's choice, and what it is as a front."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Objectives
from paretoik.closed_loop.loop import StepRecord
from paretoik.front.front import Choice, Front
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import AnyMotion, AnyValues, joint_drift, objective

if TYPE_CHECKING:
    from paretoik.formulations.closed_loop import ClosedLoop


@objective(unit="m", form="general")
def mean_position_error(motion: AnyMotion) -> AnyValues:
    """Mean over the steps of the distance of the tool from its target. Source: Marcos et al. 2012, Eq. 23."""
    return motion.position_error[..., 1:].mean(axis=-1)  # Eq. 23


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedLoopRun:
    """What a closed loop did: ``q`` (time, dof), and of each step its choice.

    ``F`` (steps, n_obj) are the objectives of the choices, minimised, ``ranges`` (steps, n_obj, 2) the smallest and
    largest on each step's front, ``fronts`` the records of the steps that were asked for, by sample, some with their
    generations, ``digests`` those of the state on the way. Where the loop was stopped early, ``q`` ends there.
    """

    loop: ClosedLoop
    q: Float[np.ndarray, "time dof"]
    F: Objectives
    ranges: Float[np.ndarray, "steps n_obj 2"]
    fronts: Mapping[int, StepRecord]
    digests: tuple[str, ...]

    @cached_property
    def task(self) -> MotionTask:
        """The task up to the last step that was taken."""
        return self.loop.task.truncate(len(self.q))

    @cached_property
    def motion(self) -> Motion:
        """The motion, on its samples."""
        return self.task.motion(self.q)

    @cached_property
    def position_error(self) -> float:
        """Mean over the steps of the distance [m] of the tool from its target (Eq. 23)."""
        return float(mean_position_error(self.motion))

    @cached_property
    def drift(self) -> float:
        """Distance of the last configuration from the first, over the number of joints [rad] (Eq. 25)."""
        return float(joint_drift(self.motion))

    @property
    def values(self) -> Objectives:
        """The objectives of the choices (steps, n_obj), in their own sign."""
        return self.F * self.loop.signs

    def front(self, provenance: Mapping[str, Any]) -> Front:
        """Return the motion as a front of one point: the mean over the steps of every objective."""
        loop, motions = self.loop, self.task.motion(self.q[None])
        return Front(
            ids=np.zeros(1, dtype=np.int64),
            objectives=self.values.mean(axis=0, keepdims=True),
            names=loop.names,
            units=[each.unit for each in loop.objectives],
            maximised=[each.maximise for each in loop.objectives],
            motions=motions,
            violation=np.maximum(self.task.violations(motions).max(axis=1, initial=0.0), 0.0),
            problem=loop,
            provenance={
                **provenance,
                "timeline": loop.timeline,
                "position_error": self.position_error,
                "drift": self.drift,
            },
        )


def explain_choice(front: Front) -> Choice:
    """Return the one motion of a closed loop's front, and in words how its steps were chosen."""
    weights = ", ".join(f"{name} {weight:.0%}" for name, weight in front.provenance["settings"]["weights"].items())
    means = [front.quantity(axis, value) for axis, value in enumerate(front.objectives[0])]
    error = f"{front.provenance['position_error']:.4g} m"
    if f"position_error {error}" not in means:  # the objective of that name says the same
        means.append(f"position error {error}")
    return front.choice(
        0,
        f"At every step the point with the least weighted sum ({weights}) was taken. Means over the steps: "
        f"{', '.join(means)}. Joint drift {front.provenance['drift']:.4g} rad.",
    )
