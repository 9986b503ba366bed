"""A frame on an arm."""

from __future__ import annotations

from dataclasses import dataclass

from paretoik.robot.pose import Pose


@dataclass(frozen=True, kw_only=True)
class Frame:
    """A named frame on the arm: a pose in the frame of link ``link`` (−1: the base)."""

    link: int
    pose: Pose
