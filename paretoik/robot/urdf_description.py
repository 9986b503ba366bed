"""A robot as its URDF describes it: links, joints and their tree, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from paretoik.arrays import Matrix3
from paretoik.robot.pose import Pose

OTHER_TYPES = ("fixed", "planar", "floating")
INERTIA_ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")

Numbers: TypeAlias = tuple[float, ...]
Fault: TypeAlias = tuple[int, str]
"""Line of the file, and message."""
ORIGIN = Pose(np.zeros(3))


@dataclass(frozen=True, kw_only=True)
class LinkDescription:
    """A link: mass [kg], the pose of its inertial frame on it, and the inertia in that frame.

    ``inertia_fault`` says why no real body has this inertia. A link with other ``faults`` has no mass.
    """

    name: str
    mass: float = 0.0
    origin: Pose = ORIGIN
    inertia_entries: Numbers = (0.0,) * 6  # as INERTIA_ENTRIES [kg m²]
    inertia_fault: Fault | None = None
    faults: tuple[Fault, ...] = ()

    @property
    def inertia(self) -> Matrix3:
        """Inertia about the centre of gravity in the axes of the inertial frame [kg m²]."""
        return inertia_matrix(self.inertia_entries)


@dataclass(frozen=True, kw_only=True)
class JointLimits:
    """Limits of a joint, infinite if there is none; ``soft`` are those of its safety controller, if it has any."""

    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    effort: float = np.inf
    acceleration: float = np.inf
    jerk: float = np.inf
    soft: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class JointDescription:
    """A joint and its origin on the parent link; ``axis`` has length 1.

    ``misplaced`` says that its origin or axis cannot be read: nobody knows where its child is.
    """

    name: str
    type: str
    parent: str
    child: str
    origin: Pose = ORIGIN
    axis: Numbers = (0.0, 0.0, 1.0)
    limits: JointLimits = JointLimits()
    mimic: tuple[str, float, float] | None = None  # leader, multiplier, offset
    line: int = 1
    faults: tuple[Fault, ...] = ()
    misplaced: bool = False


@dataclass(frozen=True, kw_only=True)
class RobotDescription:
    """All links and joints of a file, with the faults and warnings that its validation gave, and its SHA-256.

    ``faults`` are all of the file's if its links and joints are not one tree, else none: those of a link or joint,
    which it has itself, matter only on a chain.
    """

    name: str
    digest: str
    links: Mapping[str, LinkDescription]
    joints: Mapping[str, JointDescription]
    faults: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    def part_faults(self) -> list[Fault]:
        """Every fault of a link or joint, also of those that are on no chain."""
        of_links = [fault for link in self.links.values() for fault in (*link.faults, link.inertia_fault) if fault]
        return of_links + [fault for joint in self.joints.values() for fault in joint.faults]

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

    def leaves_below(self, link: str) -> list[str]:
        """Return the leaves that a link carries, itself if it is one; of a robot without faults."""
        below = {joint.child for joint in self.joints_below(link)}
        return [leaf for leaf in self.leaves if leaf in below or leaf == link]

    def trunk(self, base: str) -> list[str]:
        """Return the links, from ``base`` on, that carry all leaves below it; of a robot without faults."""
        children: dict[str, list[str]] = {}
        for joint in self.joints.values():
            children.setdefault(joint.parent, []).append(joint.child)
        trunk = [base]
        while len(below := children.get(trunk[-1], [])) == 1:
            trunk += below
        return trunk

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
