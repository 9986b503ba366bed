"""A robot as its URDF describes it: links, joints and their tree, as data."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from paretoik.arrays import Matrix3
from paretoik.robot.pose import Pose

OTHER_TYPES = ("fixed", "planar", "floating")

Numbers: TypeAlias = tuple[float, ...]
Fault: TypeAlias = tuple[int, str]
"""Line of the file, and message."""
ORIGIN = Pose(np.zeros(3))


@dataclass(frozen=True, kw_only=True, eq=False)
class ShapeDescription:
    """A collision shape of a link, as the file describes it.

    link: name of the link
    kind: "box", "cylinder", "sphere", "capsule" or "mesh"
    sizes: lengths [m]: sides of a box; otherwise the radius, then the length along z, of a capsule without its caps
    file: file of a mesh as the URDF names it, "" for other shapes
    scale: factors along a mesh's own axes, which may be negative
    pose: pose of the shape on the link
    line: line of the URDF
    """

    link: str
    kind: str
    sizes: Numbers = ()
    file: str = ""
    scale: Numbers = (1.0, 1.0, 1.0)
    pose: Pose = ORIGIN
    line: int = 1


@dataclass(frozen=True, kw_only=True)
class LinkDescription:
    """A link: mass [kg], inertial frame, inertia in this frame, and collision shapes.

    The inertial frame is a pose on the link. Faults and warnings of shapes matter only if shapes are used.
    """

    name: str
    mass: float = 0.0
    origin: Pose = ORIGIN
    inertia: Matrix3 = field(default_factory=lambda: np.zeros((3, 3)))  # kg m²
    inertia_fault: Fault | None = None  # reason why no real body has this inertia
    faults: tuple[Fault, ...] = ()  # other faults; a link that has any gets no mass
    shapes: tuple[ShapeDescription, ...] = ()
    has_visuals: bool = False
    shape_faults: tuple[Fault, ...] = ()
    shape_warnings: tuple[Fault, ...] = ()


@dataclass(frozen=True, kw_only=True)
class JointLimits:
    """Limits of a joint, infinite if there are none; ``soft`` limits are its safety controller's, or None."""

    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    effort: float = np.inf
    acceleration: float = np.inf
    jerk: float = np.inf
    soft: tuple[float, float] | None = None

    @property
    def narrowed(self) -> JointLimits:
        """Limits with positions narrowed to the soft ones."""
        low, high = self.soft or (-np.inf, np.inf)
        return replace(self, lower=max(self.lower, low), upper=min(self.upper, high))


@dataclass(frozen=True, kw_only=True)
class JointDescription:
    """A joint; ``origin`` is its pose on the parent link, ``axis`` has length 1."""

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
    misplaced: bool = False  # whether the origin or axis cannot be read: the pose of the child is then unknown

    @property
    def units(self) -> tuple[str, str]:
        """Units of positions and of efforts."""
        return ("m", "N") if self.type == "prismatic" else ("rad", "N m")

    @property
    def text(self) -> str:
        """Name, type and limits."""
        (length, force), limits = self.units, self.limits
        positions = f"{limits.lower:g} to {limits.upper:g} {length}"
        parts = [positions if np.isfinite(limits.upper - limits.lower) else "unlimited"]
        parts += [f"{limits.velocity:g} {length}/s", f"{limits.effort:g} {force}"]
        parts += [f"{limits.acceleration:g} {length}/s²"] * bool(np.isfinite(limits.acceleration))
        return f"{self.name}: {self.type}, {', '.join(parts)}"

    def frozen_text(self, value: float) -> str:
        """Return in words the position of a frozen joint."""
        if self.type in OTHER_TYPES:
            return f"frozen at zero {self.type} motion"
        outside = "" if self.limits.lower <= value <= self.limits.upper else ", outside its limits"
        return f"frozen at {value:g} {self.units[0]}{outside}"


@dataclass(frozen=True, kw_only=True)
class RobotDescription:
    """All links and joints of a file, with faults, warnings and SHA-256.

    faults: all faults if links and joints are not one tree; otherwise none, as faults of a link or joint matter only on
        a chain
    """

    name: str
    digest: str
    links: Mapping[str, LinkDescription]
    joints: Mapping[str, JointDescription]
    faults: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    def part_faults(self) -> list[Fault]:
        """Faults of all links and joints, on a chain or not."""
        of_links = [fault for link in self.links.values() for fault in (*link.faults, link.inertia_fault) if fault]
        return of_links + [fault for joint in self.joints.values() for fault in joint.faults]

    @property
    def roots(self) -> list[str]:
        """Links that are no joint's child."""
        children = {joint.child for joint in self.joints.values()}
        return [link for link in self.links if link not in children]

    @property
    def leaves(self) -> list[str]:
        """Links that are no joint's parent."""
        parents = {joint.parent for joint in self.joints.values()}
        return [link for link in self.links if link not in parents]

    def trunk(self, base: str) -> list[str]:
        """Return the links from ``base`` to the first one with several joints or none."""
        trunk = [base]
        while len(below := self._joints_of(trunk[-1])) == 1:
            trunk.append(below[0].child)
        return trunk

    def joints_below(self, link: str) -> list[JointDescription]:
        """Return every joint below a link, parents first."""
        below, stack = list[JointDescription](), [link]
        while stack:
            joints = self._joints_of(stack.pop())
            below += joints
            stack += [joint.child for joint in joints]
        return below

    def _joints_of(self, link: str) -> list[JointDescription]:
        return [joint for joint in self.joints.values() if joint.parent == link]


# Faults and warnings of a URDF, each with its line.


LINK_OR_JOINT_MESSAGE = re.compile(r"(?:line \d+: )?(link|joint) ('(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\"): (.*)")
GOT_CLAUSE = re.compile(r", got [^;]*")


@dataclass(frozen=True, kw_only=True)
class FaultOptions:
    """Maximum numbers of messages in a text, and of names in a message."""

    listed_messages: int = 100
    listed_names: int = 3


OPTIONS = FaultOptions()


def list_messages(messages: Iterable[Fault]) -> tuple[str, ...]:
    """Return messages by line, as text."""
    return tuple(f"line {line}: {text}" for line, text in sorted(messages, key=lambda message: message[0]))


def shorten_list(messages: Sequence[str]) -> list[str]:
    """Return the first messages, then the number of others if there are more."""
    excess = len(messages) - OPTIONS.listed_messages
    return [*messages[: OPTIONS.listed_messages], *([f"and {excess} more"] if excess > 0 else [])]


def group_messages(messages: Iterable[str]) -> list[str]:
    """Return messages; equal messages of several links or joints become one.

    This message has the number of links or joints and their first names.

    >>> group_messages([f"line {n}: link 'l{n}': mass must be positive, got {n}; left out" for n in range(5)])
    ["each of 5 links, 'l0', 'l1', 'l2' and 2 more: mass must be positive; left out"]
    """
    groups = dict[tuple[str, str], list[tuple[str, str, str]]]()
    for message in messages:
        match = LINK_OR_JOINT_MESSAGE.fullmatch(message)
        kind, name, text = match.groups() if match else ("", "", message)
        key = kind, GOT_CLAUSE.sub("", text) if match else text
        groups.setdefault(key, []).append((message, name, text))
    lines = []
    for (kind, common), group in groups.items():
        whole, names, texts = zip(*group, strict=True)
        first, more = names[: OPTIONS.listed_names], len(names) - OPTIONS.listed_names
        listed = f"{', '.join(first)} and {more} more" if more > 0 else " and ".join([", ".join(first[:-1]), first[-1]])
        several = f"each of {len(names)} {kind}s, {listed}: {texts[0] if len(set(texts)) == 1 else common}"
        lines.append(several if kind and len(names) > 1 else whole[0])
    return lines
