"""The part of a motion that a front relies on, so that it depends on no robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from paretoik.tables import field_representation, html_representation


@runtime_checkable
class JointMotions(Protocol):
    """A batch of joint motions: ``time`` (points, time) in s, ``q`` (points, time, dof) in rad or m."""

    @property
    def arm(self) -> Any:
        """The arm that moves, whose ``joint_names`` are those of the columns of q."""

    @property
    def time(self) -> np.ndarray:
        """Sample times."""

    @property
    def q(self) -> np.ndarray:
        """Joint positions."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: Any, /) -> Any: ...


@dataclass(frozen=True, kw_only=True)
class StoredJoints:
    """The joint names of a stored motion, the only part of the arm in its file."""

    joint_names: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class StoredMotions:
    """Motions as read from a run folder, without their arm."""

    arm: StoredJoints
    time: np.ndarray
    q: np.ndarray

    __repr__ = field_representation
    _repr_html_ = html_representation

    def __len__(self) -> int:
        return len(self.q)

    def __getitem__(self, index: Any, /) -> StoredMotions:
        return StoredMotions(arm=self.arm, time=self.time[index], q=self.q[index])
