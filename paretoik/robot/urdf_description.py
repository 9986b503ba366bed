"""A robot as its URDF describes it: links, joints and their tree, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from paretoik.arrays import Matrix3

OTHER_TYPES = ("fixed", "planar", "floating")
INERTIA_ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")

Numbers: TypeAlias = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class LinkDescription:
    """A link: mass [kg], then position [m] and roll, pitch, yaw [rad] of its inertial frame and the inertia in it.

    ``inertia_fault`` is why that inertia is none of a real body, with the line of the file; None where it is one.
    """

    name: str
    mass: float = 0.0
    xyz: Numbers = (0.0, 0.0, 0.0)
    rpy: Numbers = (0.0, 0.0, 0.0)
    inertia_entries: Numbers = (0.0,) * 6  # as INERTIA_ENTRIES [kg m²]
    inertia_fault: tuple[int, str] | None = None

    @property
    def inertia(self) -> Matrix3:
        """Inertia about the centre of gravity in the axes of the inertial frame [kg m²]; 0 where it has a fault."""
        return inertia_matrix(self.inertia_entries) * (self.inertia_fault is None)


@dataclass(frozen=True, kw_only=True)
class JointDescription:
    """A joint and its origin on the parent link; ``axis`` has length 1, limits are infinite where there is none."""

    name: str
    type: str
    parent: str
    child: str
    xyz: Numbers
    rpy: Numbers
    axis: Numbers
    lower: float
    upper: float
    velocity: float
    effort: float
    mimic: tuple[str, float, float] | None = None  # leader, multiplier, offset


@dataclass(frozen=True, kw_only=True)
class RobotDescription:
    """All links and joints of a file, with the faults and warnings that its validation gave, and its SHA-256.

    Of a robot whose only faults are inertias there are no ``faults``: they matter on a chain alone.
    """

    name: str
    digest: str
    links: Mapping[str, LinkDescription]
    joints: Mapping[str, JointDescription]
    faults: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    def roots(self) -> list[str]:
        """Links that are the child of no joint."""
        children = {joint.child for joint in self.joints.values()}
        return [link for link in self.links if link not in children]

    @property
    def leaves(self) -> list[str]:
        """Links that are the parent of no joint."""
        parents = {joint.parent for joint in self.joints.values()}
        return [link for link in self.links if link not in parents]

    @property
    def trunk(self) -> list[str]:
        """Links that all leaves are below, or are, from the root on; of a robot without faults."""
        parents = {joint.child: joint.parent for joint in self.joints.values()}
        common: list[str] | None = None
        for leaf in self.leaves:
            line = [leaf]
            while line[-1] in parents:
                line.append(parents[line[-1]])
            common = line[::-1] if common is None else [link for link in common if link in line]
        return common or []

    def joints_below(self, link: str) -> list[JointDescription]:
        """Return every joint below a link, a parent before its children; of a robot without faults."""
        by_parent: dict[str, list[JointDescription]] = {}
        for joint in self.joints.values():
            by_parent.setdefault(joint.parent, []).append(joint)
        below: list[JointDescription] = []
        stack = [link]
        while stack:
            joints = by_parent.get(stack.pop(), [])
            below += joints
            stack += [joint.child for joint in joints]
        return below


def inertia_matrix(entries: Numbers) -> Matrix3:
    """Return the symmetric matrix of ixx, ixy, ixz, iyy, iyz and izz."""
    xx, xy, xz, yy, yz, zz = entries
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
