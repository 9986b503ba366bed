"""Reading a URDF's links and joints, and every fault of them, before anything is built."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path

import numpy as np

from paretoik.inputs import shown
from paretoik.robot.arm_inputs import JOINT_TYPES
from paretoik.robot.body import inertia_fault
from paretoik.robot.urdf_description import (
    INERTIA_ENTRIES,
    OTHER_TYPES,
    JointDescription,
    LinkDescription,
    Numbers,
    RobotDescription,
    inertia_matrix,
)
from paretoik.robot.urdf_faults import Fault, inertia_faults, list_messages
from paretoik.robot.urdf_tree import find_tree_faults
from paretoik.robot.urdf_xml import Element, parse_elements, read_bytes

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?inf(inity)?|[+-]?nan", re.ASCII | re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class ValidationOptions:
    """How much of a file is read, and how much of it messages quote."""

    max_links: int = 1000
    max_name: int = 200  # characters, those that are not printable as they are written in Python
    max_text: int = 80  # characters of a value that a message quotes
    axis_tolerance: float = 1e-3  # an axis whose length is farther from 1 was hardly meant as a direction


OPTIONS = ValidationOptions()


def read_robot(file: Path) -> RobotDescription:
    """Return what a URDF describes, with every fault of it in ``faults``.

    Raises InvalidInput where there is no such file, InvalidRobot where it is not the XML of a robot.
    """
    data = read_bytes(file)
    root = parse_elements(data, str(file))
    reader = _Reader()
    elements = {tag: reader.by_name(root, tag) for tag in ("link", "joint")}
    count = len(elements["link"])
    if not count:
        reader.fault(root, "the robot must have a link, got none")
    elif count > OPTIONS.max_links:
        reader.fault(root, f"the robot: at most {OPTIONS.max_links} links wanted, got {count}")
    links = {name: _read_link(name, element, reader) for name, element in elements["link"].items()}
    joints = {name: _read_joint(name, element, reader) for name, element in elements["joint"].items()}
    lines = {name: element.line for name, element in elements["joint"].items()}
    reader.faults += find_tree_faults(links, joints, lines)
    if reader.with_friction:
        first = reader.with_friction[0]
        text = f"damping or friction of {len(reader.with_friction)} joints, from {first!r} on, is not modelled"
        reader.warnings.append((lines[first], text))
    return RobotDescription(
        name=root.attributes.get("name") or file.stem,
        digest=sha256(data).hexdigest(),
        links=links,
        joints=joints,
        faults=list_messages([*reader.faults, *inertia_faults(links.values())] if reader.faults else []),
        warnings=list_messages(reader.warnings),
    )


@dataclass
class _Reader:
    """Reads values of elements and collects the faults and warnings, each with its line.

    In every method ``owner`` names the link or joint in messages.
    """

    faults: list[Fault] = field(default_factory=list)
    warnings: list[Fault] = field(default_factory=list)
    with_friction: list[str] = field(default_factory=list)

    def fault(self, element: Element, message: str) -> None:
        """Add a fault at the line of an element."""
        self.faults.append((element.line, message))

    def warning(self, element: Element, message: str) -> None:
        """Add a warning at the line of an element."""
        self.warnings.append((element.line, message))

    def by_name(self, root: Element, tag: str) -> dict[str, Element]:
        """Return the children of a tag by their names, which must differ."""
        elements: dict[str, Element] = {}
        for element in root.find_all(tag):
            name = element.attributes.get("name", "")
            if not name:
                self.fault(element, f"a <{tag}> must have a name, got none")
            elif len(repr(name)) - 2 > OPTIONS.max_name:
                wish = f"a name of at most {OPTIONS.max_name} characters as they are printed"
                self.fault(element, f"{tag} {shown(name)}: {wish} wanted, got {len(repr(name)) - 2}")
            elif name in elements:
                self.fault(element, f"{tag} {name!r}: a name of its own wanted, got that of line {elements[name].line}")
            else:
                elements[name] = element
        return elements

    def child(self, owner: str, element: Element, tag: str) -> Element | None:
        """Return the only child of a tag, or None; several are a fault."""
        children = element.find_all(tag)
        if len(children) > 1:
            self.fault(children[1], f"{owner}: wants one <{tag}>, got {len(children)}")
        return children[0] if children else None

    def numbers(self, owner: str, element: Element, name: str, default: str | None, count: int = 1) -> Numbers | None:
        """Return ``count`` numbers of an attribute, not NaN; None, with a fault, where they are not there."""
        text = element.attributes.get(name, default)
        if text is None:
            self.fault(element, f"{owner}: <{element.tag}> must have {name}, got none")
            return None
        words = text.split()
        values = [float(word) for word in words if NUMBER.fullmatch(word)]
        if len(words) != count or len(values) != count or np.isnan(values).any():
            wish = "a number" if count == 1 else f"{count} numbers"
            self.fault(element, f"{owner}: {element.tag} {name} must be {wish}, got {text[: OPTIONS.max_text]!r}")
            return None
        return tuple(values)

    def finite(self, owner: str, element: Element, name: str, default: str | None, count: int = 1) -> Numbers | None:
        """Return ``numbers``; infinite ones are a fault too."""
        values = self.numbers(owner, element, name, default, count)
        if values is not None and np.isinf(values).any():
            text = element.attributes[name][: OPTIONS.max_text]
            self.fault(element, f"{owner}: {element.tag} {name} must be finite, got {text!r}")
            return None
        return values

    def origin(self, owner: str, element: Element) -> tuple[Numbers, Numbers]:
        """Return xyz and rpy of a child ``<origin>``; zeros where there is none."""
        zeros = (0.0, 0.0, 0.0)
        origin = self.child(owner, element, "origin")
        if origin is None:
            return zeros, zeros
        xyz, rpy = (self.finite(owner, origin, name, "0 0 0", 3) for name in ("xyz", "rpy"))
        return xyz or zeros, rpy or zeros


def _read_link(name: str, element: Element, reader: _Reader) -> LinkDescription:
    owner = f"link {name!r}"
    inertial = reader.child(owner, element, "inertial")
    if inertial is None:
        return LinkDescription(name=name)
    xyz, rpy = reader.origin(owner, inertial)
    mass = _read_mass(owner, inertial, reader)
    entries, line = _read_inertia(owner, inertial, mass, reader)
    fault = inertia_fault(inertia_matrix(entries))
    return LinkDescription(
        name=name,
        mass=mass or 0.0,
        xyz=xyz,
        rpy=rpy,
        inertia_entries=entries,
        inertia_fault=(line, f"{owner}: {fault}") if fault else None,
    )


def _read_mass(owner: str, inertial: Element, reader: _Reader) -> float | None:
    element = reader.child(owner, inertial, "mass")
    if element is None:
        reader.fault(inertial, f"{owner}: its <inertial> must have a <mass>, got none")
        return None
    value = reader.finite(owner, element, "value", None)
    if value is not None and value[0] < 0:
        reader.fault(element, f"{owner}: mass must not be negative, got {value[0]:g} kg")
        return None
    return value[0] if value else None


def _read_inertia(owner: str, inertial: Element, mass: float | None, reader: _Reader) -> tuple[Numbers, int]:
    """Return the entries of an inertia, whether any body has it or not, and their line."""
    zeros = (0.0,) * len(INERTIA_ENTRIES)
    element = reader.child(owner, inertial, "inertia")
    if element is None:
        if mass != 0.0:
            reader.fault(inertial, f"{owner}: its <inertial> must have an <inertia>, got none")
        return zeros, inertial.line
    values = [reader.finite(owner, element, name, None) for name in INERTIA_ENTRIES]
    entries = tuple(value[0] for value in values if value)
    if len(entries) < len(INERTIA_ENTRIES):
        return zeros, element.line
    if mass and not any(entries):
        reader.warning(element, f"{owner}: has mass but no inertia, taken as a point mass")
    if mass == 0.0 and any(entries):
        reader.warning(element, f"{owner}: has inertia but no mass")
    return entries, element.line


def _read_joint(name: str, element: Element, reader: _Reader) -> JointDescription:
    owner = f"joint {name!r}"
    joint_type = element.attributes.get("type", "")
    types = (*JOINT_TYPES, *OTHER_TYPES)
    if joint_type not in types:
        text = joint_type[: OPTIONS.max_text]
        reader.fault(element, f"{owner}: type must be one of {', '.join(types)}, got {text!r}")
    xyz, rpy = reader.origin(owner, element)
    parent, child = (_read_link_name(owner, element, tag, reader) for tag in ("parent", "child"))
    axis = _read_axis(owner, element, reader) if joint_type in (*JOINT_TYPES, "planar") else (0.0, 0.0, 1.0)
    lower, upper, velocity, effort = _read_limits(owner, joint_type, element, reader)
    if joint_type in JOINT_TYPES and _has_friction(owner, element, reader):
        reader.with_friction.append(name)
    return JointDescription(
        name=name,
        type=joint_type,
        parent=parent,
        child=child,
        xyz=xyz,
        rpy=rpy,
        axis=axis,
        lower=lower,
        upper=upper,
        velocity=velocity,
        effort=effort,
        mimic=_read_mimic(owner, element, reader),
    )


def _read_link_name(owner: str, joint: Element, tag: str, reader: _Reader) -> str:
    element = reader.child(owner, joint, tag)
    link = element.attributes.get("link", "") if element else ""
    if not link:
        reader.fault(joint, f"{owner}: must name a {tag} link, got none")
    return link


def _read_axis(owner: str, joint: Element, reader: _Reader) -> Numbers:
    """Return the axis, scaled to length 1."""
    default = (1.0, 0.0, 0.0)  # the URDF format's
    element = reader.child(owner, joint, "axis")
    axis = reader.finite(owner, element, "xyz", None, 3) if element else default
    if element is None or axis is None:
        return default
    largest = max(abs(value) for value in axis)  # divided by first, so that no square overflows or vanishes
    if largest == 0.0:
        reader.fault(element, f"{owner}: axis must not be zero, got 0 0 0")
        return default
    scaled = np.array(axis) / largest
    length = float(np.linalg.norm(scaled)) * largest
    if abs(length - 1) > OPTIONS.axis_tolerance:
        reader.warning(element, f"{owner}: axis has length {length:.6g}, taken as a direction")
    return tuple(float(value) for value in scaled / np.linalg.norm(scaled))


def _read_limits(owner: str, joint_type: str, joint: Element, reader: _Reader) -> tuple[float, float, float, float]:
    """Return lower, upper, velocity and effort limit; only joints of one degree of freedom have any."""
    unlimited = (-np.inf, np.inf, np.inf, np.inf)
    if joint_type not in JOINT_TYPES:
        return unlimited
    element = reader.child(owner, joint, "limit")
    if element is None:
        if joint_type != "continuous":
            reader.fault(joint, f"{owner}: a {joint_type} joint wants a <limit>, got none")
        return unlimited
    positions = [reader.numbers(owner, element, name, "0") for name in ("lower", "upper")]
    magnitudes = [reader.numbers(owner, element, name, None) for name in ("velocity", "effort")]
    for name, magnitude in zip(("velocity", "effort"), magnitudes, strict=True):
        if magnitude is not None and magnitude[0] < 0:
            reader.fault(element, f"{owner}: {name} limit must not be negative, got {magnitude[0]:g}")
    lower, upper = (position[0] if position else 0.0 for position in positions)
    velocity, effort = (magnitude[0] if magnitude else 0.0 for magnitude in magnitudes)
    if joint_type == "continuous":
        return -np.inf, np.inf, velocity, effort
    if lower > upper:
        reader.fault(element, f"{owner}: limits must not be swapped, got lower {lower:g} and upper {upper:g}")
    elif lower == upper:
        reader.warning(element, f"{owner}: its limits leave it no way to move, both are {lower:g}")
    return lower, upper, velocity, effort


def _has_friction(owner: str, joint: Element, reader: _Reader) -> bool:
    element = reader.child(owner, joint, "dynamics")
    if element is None:
        return False
    values = [reader.finite(owner, element, name, "0") for name in ("damping", "friction")]
    return any(value is not None and value[0] != 0.0 for value in values)


def _read_mimic(owner: str, joint: Element, reader: _Reader) -> tuple[str, float, float] | None:
    element = reader.child(owner, joint, "mimic")
    if element is None:
        return None
    multiplier = reader.finite(owner, element, "multiplier", "1")
    offset = reader.finite(owner, element, "offset", "0")
    leader = element.attributes.get("joint", "")
    return leader, multiplier[0] if multiplier else 1.0, offset[0] if offset else 0.0
