"""Reading of a URDF's links and joints, and of all their faults.

Nothing is built before all faults are known.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from xml.parsers import expat

import numpy as np

from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.file_paths import missing_file
from paretoik.inputs import check_magnitude, degrees_hint, shown
from paretoik.robot.arm_arguments import JOINT_TYPES, OWN_FRAMES
from paretoik.robot.body import inertia_fault
from paretoik.robot.pose import Pose, rpy_to_quaternion
from paretoik.robot.urdf_description import (
    ORIGIN,
    OTHER_TYPES,
    Fault,
    JointDescription,
    JointLimits,
    LinkDescription,
    Numbers,
    RobotDescription,
    ShapeDescription,
    list_messages,
)

# Faults of the tree of links and joints, and of mimic joints.


def find_tree_faults(links: Mapping[str, LinkDescription], joints: Mapping[str, JointDescription]) -> list[Fault]:
    """Return the faults that keep links and joints from being one tree, with their lines."""
    faults: list[Fault] = []
    parent_joint: dict[str, str] = {}
    for name, joint in joints.items():
        for tag, link in (("parent", joint.parent), ("child", joint.child)):
            if link and link not in links:
                wish = f"joint {shown(name)}: {tag} must be a link of the robot"
                faults.append((joint.line, f"{wish}, got {shown(link)}"))
        if joint.child in parent_joint:
            two = f"{shown(parent_joint[joint.child])} and {shown(name)}"
            faults.append((joint.line, f"link {shown(joint.child)}: must be the child of one joint, got {two}"))
        elif joint.child in links:
            parent_joint[joint.child] = name
    for loop in _find_loops(joints, lambda joint: parent_joint.get(joint.parent)):
        names = ", ".join(repr(name) for name in loop)
        faults.append((joints[loop[0]].line, f"joints must form a tree, got the loop {names}"))
    roots = [link for link in links if link not in parent_joint]
    if len(roots) > 1:
        names = ", ".join(repr(root) for root in roots[:10]) + (", ..." if len(roots) > 10 else "")
        faults.append((1, f"the robot must have one root link, got {len(roots)}: {names}"))
    return faults


def find_mimic_faults(joints: Mapping[str, JointDescription]) -> list[tuple[str, str]]:
    """Return names and faults of mimic joints that follow no other joint."""
    faults = []
    for name, joint in joints.items():
        if joint.mimic and joint.mimic[0] not in joints:
            leader = shown(joint.mimic[0][:200])
            faults.append((name, f"joint {shown(name)}: must mimic a joint of the robot, got {leader}"))
    for loop in _find_loops(joints, lambda joint: joint.mimic[0] if joint.mimic else None):
        faults += [(name, f"joint {name!r}: must mimic another joint, got itself") for name in loop]
    return faults


def _find_loops(
    joints: Mapping[str, JointDescription], successor: Callable[[JointDescription], str | None]
) -> list[list[str]]:
    """Return each cycle of the graph in which each joint points to its ``successor``, once."""
    visited: set[str] = set()
    loops = []
    for name in joints:
        trail: list[str] = []
        current: str | None = name
        while current is not None and current in joints and current not in visited:
            visited.add(current)
            trail.append(current)
            current = successor(joints[current])
        if current in trail:
            loops.append(trail[trail.index(current) :])
    return loops


# Reading of XML within bounds: no entities, no network, limited size, depth and number of elements.


PARTS = ("link", "joint")  # elements read below <robot>; transmissions, materials and plug-ins are not read
SHAPES = ("visual", "collision")  # kept aside in links, skipped elsewhere
SIZES = {"box": {"size": 3}, "cylinder": {"radius": 1, "length": 1}, "sphere": {"radius": 1}}
SIZES |= {"capsule": SIZES["cylinder"], "mesh": {}}  # attributes of a shape, and how many numbers each has


NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?inf(inity)?|[+-]?nan", re.ASCII | re.IGNORECASE)
MACRO = "xacro:"  # first characters of the tags that xacro should have expanded


@dataclass(frozen=True, kw_only=True)
class ReadingOptions:
    """Bounds of a file that is read, and of quotes in messages."""

    max_bytes: int = 10_000_000
    max_depth: int = 64  # elements nested in each other
    max_elements: int = 50_000  # a humanoid with hands has some 10,000
    max_links: int = 1000
    max_name: int = 200  # characters; unprintable ones count as Python's escapes
    max_text: int = 80  # characters of a value that a message quotes
    largest_shape: float = 1e4  # m: largest size of a collision shape
    largest_scale: float = 1e6  # largest factor of a mesh's scale; its inverse is the smallest
    length_tolerance: float = 1e-3  # largest difference of an axis's or quaternion's length from 1 without a warning


OPTIONS = ReadingOptions()


@dataclass(frozen=True, kw_only=True)
class Element:
    """One XML element that is read, and the line where it begins; a link's ``shapes`` are not among its children."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)
    shapes: list[Element] = field(default_factory=list)

    def find_all(self, tag: str) -> list[Element]:
        """Return the children of that tag, in order."""
        return [child for child in self.children if child.tag == tag]

    def find_macro(self) -> Element | None:
        """Return the first macro of xacro below, or None."""
        return next((m for child in self.children if (m := child if child.is_macro else child.find_macro())), None)

    @property
    def is_macro(self) -> bool:
        """Whether the element is one that xacro should have expanded."""
        return self.tag.startswith(MACRO)


def parse_elements(data: bytes, source: str) -> tuple[Element, list[int]]:
    """Return the ``<robot>`` element, and the lines of macros that were not read.

    Raises InvalidRobot, with ``source`` and the line, if the data are not the XML of a robot.
    """
    parser, count = expat.ParserCreate(), 0
    robot, unread_macros = list[Element](), list[int]()
    opened = list[Element | None]()  # None: inside a part that is skipped
    shape_depth: int | None = None  # number of elements around the collision shape that is being read

    def error(message: str, line: int | None = None) -> InvalidRobot:
        number = parser.CurrentLineNumber if line is None else line
        return InvalidRobot(source, [f"line {number}: {message}"])

    def doctype(*_: object) -> None:
        raise error("the file must have no DOCTYPE, as no robot needs entities, got one")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count, shape_depth
        count += 1
        if count > OPTIONS.max_elements:
            raise error(f"the file must have at most {OPTIONS.max_elements:,} elements, got more")
        if len(opened) == OPTIONS.max_depth:
            raise error(f"elements must be nested at most {OPTIONS.max_depth} deep, got deeper ones")
        element = Element(tag=tag, attributes=attributes, line=parser.CurrentLineNumber)
        parent, below_robot = opened[-1] if opened else None, len(opened) == 1
        if not opened:
            if tag != "robot":
                raise error(f"the root element must be <robot>, got <{tag[:80]}>")
            robot.append(element)
        elif below_robot and element.is_macro:  # the macro may stand for any number of links and joints
            raise error(f"the robot must be expanded by xacro, got the macro <{tag[:80]}>")
        elif parent is None or (below_robot and tag not in PARTS) or (tag in SHAPES and shape_depth is None):
            unread_macros.extend([element.line] * element.is_macro)
            if tag not in SHAPES or parent is None or parent.tag != "link" or len(opened) != 2:
                opened.append(None)
                return
            parent.shapes.append(element)
            shape_depth = len(opened) if tag == "collision" else None
            opened.append(element if tag == "collision" else None)
            return
        else:
            unread_macros.extend([element.line] * (element.is_macro and shape_depth is not None))
            parent.children.append(element)
        opened.append(element)

    def end(_: str) -> None:
        nonlocal shape_depth
        opened.pop()
        if len(opened) == shape_depth:
            shape_depth = None

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as fault:
        fact = expat.ErrorString(fault.code)
        raise error(f"the file must be well-formed XML, got {fact}", fault.lineno) from None
    except (LookupError, ValueError) as fault:
        if isinstance(fault, InvalidInput):
            raise
        raise error(f"the file must be readable text, got {fault}", 1) from None
    return robot[0], unread_macros


# Reading of links and joints, with all their faults.


def read_robot(file: Path) -> RobotDescription:
    """Return the robot of a URDF, with faults. Raises InvalidInput and InvalidRobot."""
    try:
        if not file.is_file():
            raise InvalidInput(f"{file} must be a plain file, got {missing_file(file)}")
        with file.open("rb") as stream:
            data = stream.read(OPTIONS.max_bytes + 1)
    except OSError as error:
        raise InvalidInput(f"{file} cannot be read: {error.strerror}") from None
    if not data:
        raise InvalidRobot(str(file), ["the file must describe a robot, got an empty file"])
    if len(data) > OPTIONS.max_bytes:
        wish = f"the file must have at most {OPTIONS.max_bytes // 1_000_000} MB"
        raise InvalidRobot(str(file), [f"{wish}, got a larger file"])
    root, macros = parse_elements(data, str(file))
    reader = _Reader("", version=root.attributes.get("version", "1.0"))
    elements = {tag: reader.by_name(root, tag) for tag in ("link", "joint")}
    count = len(elements["link"])
    if not count:
        reader.fault(root, "the robot must have a link, got none")
    elif count > OPTIONS.max_links:
        reader.fault(root, f"the robot must have at most {OPTIONS.max_links} links, got {count}")
    links = {name: _read_link(name, each, reader) for name, each in elements["link"].items()}
    joints = {name: _read_joint(name, each, reader) for name, each in elements["joint"].items()}
    for name, fault in find_mimic_faults(joints):
        joints[name] = replace(joints[name], faults=(*joints[name].faults, (joints[name].line, fault)))
    if reader.with_friction:
        first = reader.with_friction[0]
        text = f"damping or friction of {len(reader.with_friction)} joints (first: {first!r}) is not modelled"
        reader.warnings.append((joints[first].line, text))
    if macros:
        reader.warnings.append((macros[0], f"{len(macros)} macros of xacro are ignored: their parts are not read"))
    faults = [*reader.faults, *find_tree_faults(links, joints)]
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
    """Reads elements of one ``owner``, a link, a joint or the file; collects faults and warnings with their lines."""

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
        """Return the children of a tag by name; names must differ."""
        elements: dict[str, Element] = {}
        for element in root.find_all(tag):
            name = element.attributes.get("name", "")
            if not name:
                self.fault(element, f"a <{tag}> must have a name, got none")
            elif len(repr(name)) - 2 > OPTIONS.max_name:
                wish = f"name must have at most {OPTIONS.max_name} characters as they are printed"
                self.fault(element, f"{wish}, got {len(repr(name)) - 2}", f"{tag} {shown(name)}")
            elif name in OWN_FRAMES:
                wish = f"name must differ from the library's own frames {', '.join(OWN_FRAMES)}"
                self.fault(element, f"{wish}, got {name!r}", f"{tag} {name!r}")
            elif name in elements:
                wish = "name must be unique"
                self.fault(element, f"{wish}, got that of line {elements[name].line}", f"{tag} {name!r}")
            else:
                elements[name] = element
        return elements

    def child(self, element: Element, tag: str) -> Element | None:
        """Return the only child of a tag, or None. Several children are a fault."""
        children = element.find_all(tag)
        if len(children) > 1:
            self.fault(children[1], f"must have one <{tag}>, got {len(children)}")
        return children[0] if children else None

    def numbers(
        self, element: Element, name: str, default: str | None = None, count: int = 1, *, infinite: bool = False
    ) -> Numbers | None:
        """Return ``count`` numbers of an attribute. If they are missing or invalid, add a fault and return None."""
        text = element.attributes.get(name, default)
        if text is None:
            self.fault(element, f"<{element.tag}> must have {name}, got none")
            return None
        words, shortened = text.split(), repr(text[: OPTIONS.max_text])
        values = [float(word) for word in words if NUMBER.fullmatch(word)]
        if len(words) != count or len(values) != count or np.isnan(values).any():
            wish = "a number" if count == 1 else f"{count} numbers"
            self.fault(element, f"{element.tag} {name} must be {wish}, got {shortened}")
        elif not infinite and np.isinf(values).any():
            self.fault(element, f"{element.tag} {name} must be finite, got {shortened}")
        else:
            return tuple(values)
        return None

    def number(
        self, element: Element, name: str, default: str | None = None, *, infinite: bool = False
    ) -> float | None:
        """Return the number of an attribute. If there is not one, add a fault and return None."""
        values = self.numbers(element, name, default, infinite=infinite)
        return values[0] if values else None

    def origin(self, element: Element) -> Pose | None:
        """Return the pose of a child ``<origin>``, or the identity without one; None if it has a fault."""
        origin = self.child(element, "origin")
        if origin is None:
            return ORIGIN
        xyz = self.numbers(origin, "xyz", "0 0 0", 3)
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
        """Return the quaternion (w, x, y, z) of an origin, from rpy [rad] or quat_xyzw (URDF 1.1)."""
        if "quat_xyzw" not in origin.attributes:
            rpy = self.numbers(origin, "rpy", "0 0 0", 3)
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
        xyzw = self.numbers(origin, "quat_xyzw", count=4)
        unit = None if xyzw is None else self.direction(origin, "quat_xyzw", xyzw)
        return None if unit is None else (unit[3], *unit[:3])

    def direction(self, element: Element, name: str, values: Numbers) -> Numbers | None:
        """Return numbers scaled to length 1. If all are zero, return None and add a fault."""
        largest = max(abs(value) for value in values)  # divided by this first, no square overflows or vanishes
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
        if macro := element.find_macro():
            self.fault(macro, f"must be expanded by xacro, got the macro <{macro.tag[: OPTIONS.max_text]}>")


def _read_link(name: str, element: Element, whole: _Reader) -> LinkDescription:
    shapes, aside = list[ShapeDescription](), _Reader(f"link {name!r}", whole.version)
    for part in element.shapes:
        if part.tag == "collision" and (shape := _read_shape(name, part, aside)) is not None:
            shapes.append(shape)
    return replace(
        _read_inertial(name, element, whole.part(f"link {name!r}")),
        shapes=tuple(shapes),
        has_visuals=any(part.tag == "visual" for part in element.shapes),
        shape_faults=tuple(aside.faults),
        shape_warnings=tuple(aside.warnings),
    )


def _read_shape(link: str, element: Element, reader: _Reader) -> ShapeDescription | None:
    """Return a collision shape, None if it has a fault."""
    before = len(reader.faults)
    reader.no_macros(element)
    pose, geometry = reader.origin(element), reader.child(element, "geometry")
    parts = geometry.children if geometry else []
    if len(parts) != 1 or parts[0].tag not in SIZES:
        if len(reader.faults) == before:
            got = ", ".join(f"<{part.tag[: OPTIONS.max_text]}>" for part in parts[:3]) or "none"
            reader.fault(geometry or element, f"a collision must have one of {', '.join(SIZES)}, got {got}")
        return None
    (part,) = parts
    sizes, file = list[float](), ""
    scale: Numbers = (1.0, 1.0, 1.0)
    for attribute, count in SIZES[part.tag].items():
        values = reader.numbers(part, attribute, count=count) or ()
        wish = f"{part.tag} {attribute} must be"
        if values and min(values) <= 0:
            reader.fault(part, f"{wish} positive, got {min(values):g} m")
        elif values and max(values) > OPTIONS.largest_shape:
            reader.fault(part, f"{wish} at most {OPTIONS.largest_shape:g} m, got {max(values):g} m")
        sizes += values
    if part.tag == "mesh":
        file = part.attributes.get("filename", "")
        if not file:
            reader.fault(part, "<mesh> must have filename, got none")
        scale = reader.numbers(part, "scale", "1 1 1", 3) or scale
        if not all(1 / OPTIONS.largest_scale <= abs(value) <= OPTIONS.largest_scale for value in scale):
            wish = f"mesh scale must be from {1 / OPTIONS.largest_scale:g} to {OPTIONS.largest_scale:g} in size"
            reader.fault(part, f"{wish}, got {' '.join(f'{value:g}' for value in scale)}")
    if pose is None or len(reader.faults) > before:
        return None
    return ShapeDescription(
        link=link, kind=part.tag, sizes=tuple(sizes), file=file, scale=scale, pose=pose, line=element.line
    )


def _read_inertial(name: str, element: Element, reader: _Reader) -> LinkDescription:
    reader.no_macros(element)
    inertial = reader.child(element, "inertial")
    if inertial is None:
        return LinkDescription(name=name, faults=tuple(reader.faults))
    origin, weight = reader.origin(inertial), reader.child(inertial, "mass")
    mass = None if weight is None else reader.number(weight, "value")
    if weight is None:
        reader.fault(inertial, "its <inertial> must have a <mass>, got none")
    elif mass is not None and mass < 0:
        reader.fault(weight, f"mass must not be negative, got {mass:g} kg")
        mass = None
    # the inertia, possible or not
    inertia, part = np.zeros((3, 3)), reader.child(inertial, "inertia")
    if part is not None:
        values = [reader.number(part, entry) for entry in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")]
        if None not in values:
            xx, xy, xz, yy, yz, zz = values
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=float)
            if mass and not inertia.any():
                reader.warning(part, "has mass but no inertia, taken as a point mass")
            if mass == 0.0 and inertia.any():
                reader.warning(part, "has inertia but no mass")
    elif mass != 0.0:
        reader.fault(inertial, "its <inertial> must have an <inertia>, got none")
    fault = inertia_fault(inertia)
    wrong = ((part or inertial).line, f"{reader.owner}: {fault}") if fault else None
    if origin is None or mass is None or reader.faults:
        return LinkDescription(name=name, inertia_fault=wrong, faults=tuple(reader.faults))
    return LinkDescription(name=name, mass=mass, origin=origin, inertia=inertia, inertia_fault=wrong)


def _read_joint(name: str, element: Element, whole: _Reader) -> JointDescription:
    """Return a joint. A missing parent or child is a fault of the ``whole`` file: there is no tree then."""
    reader = whole.part(f"joint {name!r}")
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
    origin, limits = reader.origin(element), JointLimits()
    axis: Numbers | None = (0.0, 0.0, 1.0)
    mimic: tuple[str, float, float] | None = None
    if joint_type in (*JOINT_TYPES, "planar"):
        axis = (1.0, 0.0, 0.0)  # the URDF format's default
        if part := reader.child(element, "axis"):
            given = reader.numbers(part, "xyz", count=3)
            axis = None if given is None else reader.direction(part, "axis", given)
    if joint_type in JOINT_TYPES:
        limits = _read_limits(joint_type, element, reader)
        if part := reader.child(element, "dynamics"):
            friction = [reader.number(part, each, "0") for each in ("damping", "friction")]
            reader.with_friction.extend([name] * any(friction))
    if part := reader.child(element, "mimic"):
        multiplier, offset = reader.number(part, "multiplier", "1"), reader.number(part, "offset", "0")
        mimic = part.attributes.get("joint", ""), 1.0 if multiplier is None else multiplier, offset or 0.0
    return JointDescription(
        name=name,
        type=joint_type,
        parent=ends["parent"],
        child=ends["child"],
        origin=ORIGIN if origin is None else origin,
        axis=axis or (1.0, 0.0, 0.0),
        limits=limits,
        mimic=mimic,
        line=element.line,
        faults=tuple(reader.faults),
        misplaced=origin is None or axis is None,
    )


def _read_limits(joint_type: str, joint: Element, reader: _Reader) -> JointLimits:
    element, controller = reader.child(joint, "limit"), reader.child(joint, "safety_controller")
    soft: tuple[float, float] | None = None
    names = {"soft_lower_limit": "-inf", "soft_upper_limit": "inf"}
    if controller is not None and any(name in controller.attributes for name in names):
        low, high = (reader.number(controller, name, default, infinite=True) for name, default in names.items())
        soft = None if low is None or high is None else (low, high)
    if element is None:
        if joint_type != "continuous":
            reader.fault(joint, f"a {joint_type} joint must have a <limit>, got none")
        return JointLimits(soft=soft)
    lower, upper = (reader.number(element, name, "0", infinite=True) or 0.0 for name in ("lower", "upper"))
    # URDF 1.2 also has limits of acceleration, deceleration and jerk.
    defaults = {"velocity": None, "effort": None, "acceleration": "inf", "deceleration": "inf", "jerk": "inf"}
    magnitudes = {}
    for name, default in defaults.items():
        magnitudes[name] = reader.number(element, name, default, infinite=True) or 0.0
        if magnitudes[name] < 0:
            reader.fault(element, f"{name} limit must not be negative, got {magnitudes[name]:g}")
    if joint_type == "continuous":
        lower, upper = -np.inf, np.inf
    if lower > upper:
        reader.fault(element, f"limits must not be swapped, got lower {lower:g} and upper {upper:g}")
    elif lower == upper:
        reader.warning(element, f"its limits leave no motion: both are {lower:g}")
    deceleration = magnitudes.pop("deceleration")
    magnitudes["acceleration"] = min(magnitudes["acceleration"], deceleration)
    return JointLimits(lower=lower, upper=upper, soft=soft, **magnitudes)
