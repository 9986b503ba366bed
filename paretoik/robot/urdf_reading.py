"""Reading a URDF's links and joints, and every fault of them, before anything is built."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.inputs import check_magnitude, degrees_hint, shown
from paretoik.robot.arm_inputs import JOINT_TYPES, OWN_FRAMES
from paretoik.robot.body import inertia_fault
from paretoik.robot.pose import Pose, rpy_to_quaternion
from paretoik.robot.urdf_description import (
    INERTIA_ENTRIES,
    ORIGIN,
    OTHER_TYPES,
    Fault,
    JointDescription,
    JointLimits,
    LinkDescription,
    Numbers,
    RobotDescription,
    inertia_matrix,
)
from paretoik.robot.urdf_faults import list_messages
from paretoik.robot.urdf_tree import find_mimic_faults, find_tree_faults
from paretoik.robot.urdf_xml import Element, is_macro, parse_elements, read_bytes

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?inf(inity)?|[+-]?nan", re.ASCII | re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class ValidationOptions:
    """How much of a file is read, and how much of it messages quote."""

    max_links: int = 1000
    max_name: int = 200  # characters, those that are not printable as they are written in Python
    max_text: int = 80  # characters of a value that a message quotes
    length_tolerance: float = 1e-3  # an axis or quaternion whose length is farther from 1 is told


OPTIONS = ValidationOptions()


def read_robot(file: Path) -> RobotDescription:
    """Return what a URDF describes, each link and joint with its own faults.

    Raises InvalidInput if there is no such file, InvalidRobot if it is not the XML of a robot.
    """
    data = read_bytes(file)
    root, macros = parse_elements(data, str(file))
    reader = _Reader("", version=root.attributes.get("version", "1.0"))
    elements = {tag: reader.by_name(root, tag) for tag in ("link", "joint")}
    count = len(elements["link"])
    if not count:
        reader.fault(root, "the robot must have a link, got none")
    elif count > OPTIONS.max_links:
        reader.fault(root, f"the robot must have at most {OPTIONS.max_links} links, got {count}")
    links = {name: _read_link(name, each, reader.part(f"link {name!r}")) for name, each in elements["link"].items()}
    joints = {
        name: _read_joint(name, each, reader, reader.part(f"joint {name!r}"))
        for name, each in elements["joint"].items()
    }
    lines = {name: each.line for name, each in elements["joint"].items()}
    for name, fault in find_mimic_faults(joints, lines):
        joints[name] = replace(joints[name], faults=(*joints[name].faults, fault))
    if reader.with_friction:
        first = reader.with_friction[0]
        text = f"damping or friction of {len(reader.with_friction)} joints, from {first!r} on, is not modelled"
        reader.warnings.append((lines[first], text))
    if macros:
        reader.warnings.append((macros[0], f"{len(macros)} macros of xacro, in parts that are not read, are left out"))
    faults = [*reader.faults, *find_tree_faults(links, joints, lines)]
    robot = RobotDescription(
        name=root.attributes.get("name") or file.stem,
        digest=sha256(data).hexdigest(),
        links=links,
        joints=joints,
        faults=(),
        warnings=list_messages(reader.warnings),
    )
    return replace(robot, faults=list_messages([*faults, *robot.part_faults])) if faults else robot


@dataclass
class _Reader:
    """Reads values of elements of one ``owner``, and collects their faults and warnings, each with its line.

    The readers of all links and joints share their warnings with that of the file.
    """

    owner: str
    version: str
    faults: list[Fault] = field(default_factory=list)
    warnings: list[Fault] = field(default_factory=list)
    with_friction: list[str] = field(default_factory=list)

    def part(self, owner: str) -> _Reader:
        """Return the reader of a link or joint."""
        return _Reader(owner, self.version, [], self.warnings, self.with_friction)

    def fault(self, element: Element, message: str, owner: str = "") -> None:
        """Add a fault of the owner at the line of an element."""
        name = owner or self.owner
        self.faults.append((element.line, f"{name}: {message}" if name else message))

    def warning(self, element: Element, message: str) -> None:
        """Add a warning of the owner at the line of an element."""
        self.warnings.append((element.line, f"{self.owner}: {message}"))

    def by_name(self, root: Element, tag: str) -> dict[str, Element]:
        """Return the children of a tag by their names, which must differ."""
        elements: dict[str, Element] = {}
        for element in root.find_all(tag):
            name = element.attributes.get("name", "")
            if not name:
                self.fault(element, f"a <{tag}> must have a name, got none")
            elif len(repr(name)) - 2 > OPTIONS.max_name:
                wish = f"name must have at most {OPTIONS.max_name} characters as they are printed"
                self.fault(element, f"{wish}, got {len(repr(name)) - 2}", f"{tag} {shown(name)}")
            elif name in OWN_FRAMES:
                wish = f"name must be none of the library's own frames, {', '.join(OWN_FRAMES)}"
                self.fault(element, f"{wish}, got {name!r}", f"{tag} {name!r}")
            elif name in elements:
                wish = "name must be its own"
                self.fault(element, f"{wish}, got that of line {elements[name].line}", f"{tag} {name!r}")
            else:
                elements[name] = element
        return elements

    def child(self, element: Element, tag: str) -> Element | None:
        """Return the only child of a tag, or None; several are a fault."""
        children = element.find_all(tag)
        if len(children) > 1:
            self.fault(children[1], f"must have one <{tag}>, got {len(children)}")
        return children[0] if children else None

    def numbers(self, element: Element, name: str, default: str | None, count: int = 1) -> Numbers | None:
        """Return ``count`` numbers of an attribute, not NaN; None, with a fault, if they are not there."""
        text = element.attributes.get(name, default)
        if text is None:
            self.fault(element, f"<{element.tag}> must have {name}, got none")
            return None
        words = text.split()
        values = [float(word) for word in words if NUMBER.fullmatch(word)]
        if len(words) != count or len(values) != count or np.isnan(values).any():
            wish = "a number" if count == 1 else f"{count} numbers"
            self.fault(element, f"{element.tag} {name} must be {wish}, got {text[: OPTIONS.max_text]!r}")
            return None
        return tuple(values)

    def finite(self, element: Element, name: str, default: str | None, count: int = 1) -> Numbers | None:
        """Return ``numbers``; infinite ones are a fault too."""
        values = self.numbers(element, name, default, count)
        if values is not None and np.isinf(values).any():
            text = element.attributes[name][: OPTIONS.max_text]
            self.fault(element, f"{element.tag} {name} must be finite, got {text!r}")
            return None
        return values

    def origin(self, element: Element) -> Pose | None:
        """Return the pose of a child ``<origin>``, the identity if there is none; None if it cannot be read."""
        origin = self.child(element, "origin")
        if origin is None:
            return ORIGIN
        xyz = self.finite(origin, "xyz", "0 0 0", 3)
        quaternion = self.orientation(origin)
        if xyz is None or quaternion is None:
            return None
        try:
            check_magnitude("origin xyz", xyz, "m")
            return Pose(xyz, quaternion)
        except InvalidInput as error:
            self.fault(origin, str(error))
            return None

    def orientation(self, origin: Element) -> Numbers | None:
        """Return the quaternion (w, x, y, z) of an origin from its rpy [rad], or from quat_xyzw of URDF 1.1."""
        if "quat_xyzw" not in origin.attributes:
            rpy = self.finite(origin, "rpy", "0 0 0", 3)
            if rpy is None:
                return None
            if hint := degrees_hint(rpy):
                self.warning(origin, f"origin rpy: {hint}")
            return tuple(rpy_to_quaternion(np.array(rpy)).tolist())
        if "rpy" in origin.attributes:
            self.fault(origin, "origin must have rpy or quat_xyzw, got both")
            return None
        if self.version in ("1", "1.0"):
            text = 'quat_xyzw is of URDF 1.1; without version="1.1" on <robot>, other programs may read no rotation'
            self.warning(origin, text)
        xyzw = self.finite(origin, "quat_xyzw", None, 4)
        unit = None if xyzw is None else self.direction(origin, "quat_xyzw", xyzw)
        return None if unit is None else (unit[3], *unit[:3])

    def direction(self, element: Element, name: str, values: Numbers) -> Numbers | None:
        """Return numbers scaled to length 1; None, with a fault, for zeros."""
        largest = max(abs(value) for value in values)  # divided by first, so that no square overflows or vanishes
        if largest == 0.0:
            self.fault(element, f"{name} must not be zero, got {' '.join(['0'] * len(values))}")
            return None
        scaled = np.array(values) / largest
        length = float(np.linalg.norm(scaled)) * largest
        if abs(length - 1) > OPTIONS.length_tolerance:
            self.warning(element, f"{name} has length {length:.6g}, taken as a direction")
        return tuple(float(value) for value in scaled / np.linalg.norm(scaled))

    def no_macros(self, element: Element) -> None:
        """Add a fault for the first macro of xacro below an element."""
        pending = element.children[::-1]
        while pending:
            child = pending.pop()
            if is_macro(child.tag):
                self.fault(child, f"must be expanded by xacro, got the macro <{child.tag[: OPTIONS.max_text]}>")
                return
            pending += child.children[::-1]


def _read_link(name: str, element: Element, reader: _Reader) -> LinkDescription:
    reader.no_macros(element)
    inertial = reader.child(element, "inertial")
    if inertial is None:
        return LinkDescription(name=name, faults=tuple(reader.faults))
    origin = reader.origin(inertial)
    mass = _read_mass(inertial, reader)
    entries, line = _read_inertia(inertial, mass, reader)
    fault = inertia_fault(inertia_matrix(entries))
    wrong = (line, f"{reader.owner}: {fault}") if fault else None
    if origin is None or mass is None or reader.faults:
        return LinkDescription(name=name, inertia_fault=wrong, faults=tuple(reader.faults))
    return LinkDescription(name=name, mass=mass, origin=origin, inertia_entries=entries, inertia_fault=wrong)


def _read_mass(inertial: Element, reader: _Reader) -> float | None:
    element = reader.child(inertial, "mass")
    if element is None:
        reader.fault(inertial, "its <inertial> must have a <mass>, got none")
        return None
    value = reader.finite(element, "value", None)
    if value is not None and value[0] < 0:
        reader.fault(element, f"mass must not be negative, got {value[0]:g} kg")
        return None
    return value[0] if value else None


def _read_inertia(inertial: Element, mass: float | None, reader: _Reader) -> tuple[Numbers, int]:
    """Return the entries of an inertia, whether any body has it or not, and their line."""
    zeros = (0.0,) * len(INERTIA_ENTRIES)
    element = reader.child(inertial, "inertia")
    if element is None:
        if mass != 0.0:
            reader.fault(inertial, "its <inertial> must have an <inertia>, got none")
        return zeros, inertial.line
    values = [reader.finite(element, name, None) for name in INERTIA_ENTRIES]
    entries = tuple(value[0] for value in values if value)
    if len(entries) < len(INERTIA_ENTRIES):
        return zeros, element.line
    if mass and not any(entries):
        reader.warning(element, "has mass but no inertia, taken as a point mass")
    if mass == 0.0 and any(entries):
        reader.warning(element, "has inertia but no mass")
    return entries, element.line


def _read_joint(name: str, element: Element, whole: _Reader, reader: _Reader) -> JointDescription:
    """Return a joint; faults of the links that it names are those of the ``whole`` file, as then there is no tree."""
    reader.no_macros(element)
    joint_type = element.attributes.get("type", "")
    types = (*JOINT_TYPES, *OTHER_TYPES)
    if joint_type not in types:
        text = joint_type[: OPTIONS.max_text]
        reader.fault(element, f"type must be one of {', '.join(types)}, got {text!r}")
    ends = {}
    for tag in ("parent", "child"):
        end = reader.child(element, tag)
        ends[tag] = end.attributes.get("link", "") if end else ""
        if not ends[tag]:
            whole.fault(element, f"must name a {tag} link, got none", reader.owner)
    origin = reader.origin(element)
    axis = _read_axis(element, reader) if joint_type in (*JOINT_TYPES, "planar") else (0.0, 0.0, 1.0)
    limits = _read_limits(joint_type, element, reader) if joint_type in JOINT_TYPES else JointLimits()
    if joint_type in JOINT_TYPES and _has_friction(element, reader):
        reader.with_friction.append(name)
    return JointDescription(
        name=name,
        type=joint_type,
        parent=ends["parent"],
        child=ends["child"],
        origin=ORIGIN if origin is None else origin,
        axis=axis or (1.0, 0.0, 0.0),
        limits=limits,
        mimic=_read_mimic(element, reader),
        line=element.line,
        faults=tuple(reader.faults),
        misplaced=origin is None or axis is None,
    )


def _read_axis(joint: Element, reader: _Reader) -> Numbers | None:
    """Return the axis, scaled to length 1; None if it cannot be read."""
    element = reader.child(joint, "axis")
    if element is None:
        return (1.0, 0.0, 0.0)  # the URDF format's default
    axis = reader.finite(element, "xyz", None, 3)
    return None if axis is None else reader.direction(element, "axis", axis)


def _read_limits(joint_type: str, joint: Element, reader: _Reader) -> JointLimits:
    element = reader.child(joint, "limit")
    soft = _read_soft_limits(joint, reader)
    if element is None:
        if joint_type != "continuous":
            reader.fault(joint, f"a {joint_type} joint must have a <limit>, got none")
        return JointLimits(soft=soft)
    positions = [reader.numbers(element, name, "0") for name in ("lower", "upper")]
    # URDF 1.2 has limits of acceleration, deceleration and jerk, too.
    defaults = {"velocity": None, "effort": None, "acceleration": "inf", "deceleration": "inf", "jerk": "inf"}
    magnitudes = {}
    for name, default in defaults.items():
        values = reader.numbers(element, name, default)
        magnitudes[name] = values[0] if values else 0.0
        if magnitudes[name] < 0:
            reader.fault(element, f"{name} limit must not be negative, got {magnitudes[name]:g}")
    lower, upper = (position[0] if position else 0.0 for position in positions)
    if joint_type == "continuous":
        lower, upper = -np.inf, np.inf
    if lower > upper:
        reader.fault(element, f"limits must not be swapped, got lower {lower:g} and upper {upper:g}")
    elif lower == upper:
        reader.warning(element, f"its limits leave it no way to move, both are {lower:g}")
    deceleration = magnitudes.pop("deceleration")
    magnitudes["acceleration"] = min(magnitudes["acceleration"], deceleration)
    return JointLimits(lower=lower, upper=upper, soft=soft, **magnitudes)


def _read_soft_limits(joint: Element, reader: _Reader) -> tuple[float, float] | None:
    """Return the position limits of a safety controller, infinite on a side without; None if it has none."""
    element = reader.child(joint, "safety_controller")
    names = {"soft_lower_limit": "-inf", "soft_upper_limit": "inf"}
    if element is None or not any(name in element.attributes for name in names):
        return None
    lower, upper = (reader.numbers(element, name, default) for name, default in names.items())
    return None if lower is None or upper is None else (lower[0], upper[0])


def _has_friction(joint: Element, reader: _Reader) -> bool:
    element = reader.child(joint, "dynamics")
    if element is None:
        return False
    values = [reader.finite(element, name, "0") for name in ("damping", "friction")]
    return any(value is not None and value[0] != 0.0 for value in values)


def _read_mimic(joint: Element, reader: _Reader) -> tuple[str, float, float] | None:
    element = reader.child(joint, "mimic")
    if element is None:
        return None
    multiplier = reader.finite(element, "multiplier", "1")
    offset = reader.finite(element, "offset", "0")
    leader = element.attributes.get("joint", "")
    return leader, multiplier[0] if multiplier else 1.0, offset[0] if offset else 0.0
