"""A robot as its URDF describes it: links, joints and their tree, as data."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
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


# Faults and warnings of a URDF: each has the line that it is on, and of very many a text lists the first.


LINK_OR_JOINT_MESSAGE = re.compile(r"(?:line \d+: )?(link|joint) ('(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\"): (.*)")
GOT_CLAUSE = re.compile(r", got [^;]*")


@dataclass(frozen=True, kw_only=True)
class FaultOptions:
    """How many faults, or warnings, a text lists, and of how many links or joints that have the same one the names."""

    listed_messages: int = 100
    listed_names: int = 3


OPTIONS = FaultOptions()


def list_messages(messages: Iterable[Fault]) -> tuple[str, ...]:
    """Return messages by line, as text."""
    return tuple(f"line {line}: {text}" for line, text in sorted(messages, key=lambda message: message[0]))


def shorten_list(messages: Sequence[str]) -> list[str]:
    """Return messages, of very many the first, and how many more there are."""
    excess = len(messages) - OPTIONS.listed_messages
    return [*messages[: OPTIONS.listed_messages], *([f"and {excess} more"] if excess > 0 else [])]


def group_messages(messages: Iterable[str]) -> list[str]:
    """Return messages, those of several links or joints that are the same once, with their number and the first names.

    >>> group_messages([f"line {n}: link 'l{n}': mass wanted, got {n}; left out" for n in range(5)])
    ["each of 5 links, 'l0', 'l1', 'l2' and 2 more: mass wanted; left out"]
    """
    groups = dict[tuple[str, str], list[str]]()
    for message in messages:
        match = LINK_OR_JOINT_MESSAGE.fullmatch(message)
        key = ("", message) if match is None else (match[1], GOT_CLAUSE.sub("", match[3]))
        groups.setdefault(key, []).append(message)
    return [each[0] if len(each) == 1 else _group_text(*key, each) for key, each in groups.items()]


def _group_text(kind: str, text: str, messages: Sequence[str]) -> str:
    """Return in one line the messages of several of a ``kind``: the whole text of all where it is one, else ``text``.

    Messages of neither links nor joints are in one group only where they are equal: the line is the message itself.
    """
    matches = [match for message in messages if (match := LINK_OR_JOINT_MESSAGE.fullmatch(message))]
    if not matches:
        return messages[0]
    names, texts = [match[2] for match in matches], {match[3] for match in matches}
    first, more = names[: OPTIONS.listed_names], len(names) - OPTIONS.listed_names
    listed = f"{', '.join(first)} and {more} more" if more > 0 else " and ".join([", ".join(first[:-1]), first[-1]])
    return f"each of {len(names)} {kind}s, {listed}: {texts.pop() if len(texts) == 1 else text}"
