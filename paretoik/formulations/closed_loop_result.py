"""What a closed loop did: every step's choice, the motion, and what both are worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Objectives
from paretoik.closed_loop.searching import Population
from paretoik.front.front import Choice, Front
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import AnyMotion, AnyValues, joint_drift, objective

if TYPE_CHECKING:
    from paretoik.formulations.closed_loop import ClosedLoop


@objective(unit="m", form="general")
def mean_position_error(motion: AnyMotion) -> AnyValues:
    """Mean over the steps of the distance of the tool from its target. Source: Marcos et al. 2012, Eq. 23."""
    return motion.position_error[..., 1:].mean(axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Taken:
    """A step that was taken: to which sample, the front that was found, which of its points was chosen."""

    sample: int
    front: Population
    index: int

    @property
    def q(self) -> Float[np.ndarray, " dof"]:
        """The joint positions after it."""
        return self.front.q[self.index]


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedLoopRun:
    """What a closed loop did: ``q`` (time, dof), and what of each step is kept.

    ``F`` (steps, n_obj) are the objectives of the choices, minimised, ``ranges`` (steps, n_obj, 2) the least and most
    on each step's front, ``fronts`` the steps that were asked for by sample, ``digests`` those of the state on the way.
    Where it was ended early, ``q`` goes as far as it came.
    """

    loop: ClosedLoop
    q: Float[np.ndarray, "time dof"]
    F: Objectives
    ranges: Float[np.ndarray, "steps n_obj 2"]
    fronts: Mapping[int, Taken]
    digests: tuple[str, ...]

    @cached_property
    def task(self) -> MotionTask:
        """The task, as far as the loop came."""
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
            provenance={**provenance, "position_error": self.position_error, "drift": self.drift},
        )


def told(front: Front) -> Choice:
    """Return the one motion of a closed loop's front, and what it was chosen by."""
    weighed = ", ".join(f"{name} {weight:.0%}" for name, weight in front.provenance["settings"]["weights"].items())
    means = ", ".join(
        f"{name} {value:.4g} {unit}".rstrip()
        for name, value, unit in zip(front.names, front.objectives[0], front.units, strict=True)
    )
    return Choice(
        id=int(front.ids[0]),
        index=0,
        objectives=front.objectives[0],
        motion=None if front.motions is None else front.motions[0],
        reason=(
            f"At every step the point with the least weighted sum ({weighed}) was taken. Means over the steps: "
            f"{means}; position error {front.provenance['position_error']:.4g} m, "
            f"drift {front.provenance['drift']:.4g} rad."
        ),
    )


def undominated(population: Population) -> Population:
    """Return the non-dominated ones, by the first objective."""
    from moocore import is_nondominated

    kept = np.flatnonzero(is_nondominated(population.F, keep_weakly=False))
    kept = kept[np.lexsort(population.F[kept].T[::-1])]
    return Population(genes=population.genes[kept], F=population.F[kept], q=population.q[kept])


def chosen(F: Objectives, weights: Float[np.ndarray, " n_obj"]) -> int:
    """Return the point with the least weighted sum of objectives, scaled to the range of the front (Eqs. 19, 20)."""
    least, width = F.min(axis=0), np.ptp(F, axis=0)
    z = np.where(width > 0, (F - least) / np.where(width > 0, width, 1.0), 0.0)
    return int(np.argmin(z @ weights))
