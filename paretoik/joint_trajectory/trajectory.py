"""A joint trajectory: one motion as samples at a controller's rate, as a file or a controller takes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Times
from paretoik.errors import InvalidInput
from paretoik.inputs import shown
from paretoik.joint_trajectory.controller import check_joint_names
from paretoik.joint_trajectory.time_scaling import TimeScaling
from paretoik.tables import html_representation
from paretoik.task.motion import Motion

JointSeries = Float[np.ndarray, "time dof"]


@dataclass(frozen=True, kw_only=True, eq=False)
class JointTrajectory:
    """Samples of one motion for a controller: ``time`` (time,) [s] from 0, evenly spaced in whole nanoseconds.

    ``q``, ``dq`` and ``ddq`` (time, dof) [rad, m; per s; per s²] have one column for each of ``joint_names``;
    ``metadata`` says of what motion they are, and how they were made. Arrays are read-only.
    """

    joint_names: tuple[str, ...]
    time: Times
    q: JointSeries
    dq: JointSeries
    ddq: JointSeries
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("time", "q", "dq", "ddq"):
            values = np.array(getattr(self, name), dtype=float, order="C")
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    def __repr__(self) -> str:
        return f"JointTrajectory({len(self.time)} samples of {', '.join(self.joint_names)}, {self.time[-1]:g} s)"

    _repr_html_ = html_representation

    def reorder(self, joint_names: Sequence[str]) -> JointTrajectory:
        """Return the trajectory with its columns in the order of ``joint_names``.

        Raises InvalidInput where these are not the same joints.
        """
        names = same_joints(joint_names, self.joint_names)
        order = [self.joint_names.index(joint) for joint in names]
        q, dq, ddq = (values[:, order] for values in (self.q, self.dq, self.ddq))
        return replace(self, joint_names=names, q=q, dq=dq, ddq=ddq)


def same_joints(joint_names: object, joints: Sequence[str]) -> tuple[str, ...]:
    """Return joint names in their order; raises InvalidInput where they are not those of ``joints``, each once."""
    names = check_joint_names("joint_names", joint_names)
    for listed, others, fact in ((names, joints, "which is none of them"), (joints, names, "which is missing")):
        strange = next((joint for joint in listed if joint not in others), None)
        if strange is not None:
            raise InvalidInput(f"joint_names: {', '.join(joints)} in any order wanted, got {shown(strange)}, {fact}")
    return names


def sample_motion(motion: Motion, scaling: TimeScaling, rate: float | None = None) -> JointTrajectory:
    """Return the samples of one motion in scaled time, at the scaling's own rate or at another [Hz].

    Raises Infeasible where the motion leaves its path between its own samples.
    """
    sigma, speed, bend = scaling.evaluate(rate)
    q, by_sigma, curved = motion.state(motion.time[0] + sigma)
    return JointTrajectory(
        joint_names=motion.arm.joint_names,
        time=scaling.times(rate),
        q=q,
        dq=by_sigma * speed[:, None],
        ddq=curved * speed[:, None] ** 2 + by_sigma * bend[:, None],
    )
