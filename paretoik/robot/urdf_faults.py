"""What a URDF says, and every fault of it: our own reading, before anything else opens the file."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from paretoik.arrays import Matrix3
from paretoik.robot.body import inertia_fault
from paretoik.robot.urdf_xml import Element, read_elements

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?inf(inity)?|[+-]?nan", re.ASCII | re.IGNORECASE)
MOVING = ("revolute", "continuous", "prismatic")
KINDS = (*MOVING, "fixed", "planar", "floating")
MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
MAX_LINKS = 1000
MAX_NAME = 200
MAX_LISTED = 100
UNIT_AXIS = 1e-3  # an axis whose length is off by more was hardly meant as a direction
Numbers = tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class LinkFacts:
    """A link as its file gives it: mass [kg], and centre [m], axes (roll, pitch, yaw) and moments of its inertia."""

    name: str
    mass: float = 0.0
    xyz: Numbers = (0.0, 0.0, 0.0)
    rpy: Numbers = (0.0, 0.0, 0.0)
    moments: Numbers = (0.0,) * 6


@dataclass(frozen=True, kw_only=True)
class JointFacts:
    """A joint as its file gives it; ``axis`` has length 1, limits are infinite where there is none."""

    name: str
    kind: str
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
class RobotFacts:
    """A robot as its file gives it, with the faults found in it."""

    name: str
    links: Mapping[str, LinkFacts]
    joints: Mapping[str, JointFacts]
    faults: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    def roots(self) -> list[str]:
        """Links that no joint moves or holds."""
        children = {joint.child for joint in self.joints.values()}
        return [link for link in self.links if link not in children]

    @property
    def leaves(self) -> list[str]:
        """Links that carry no other."""
        parents = {joint.parent for joint in self.joints.values()}
        return [link for link in self.links if link not in parents]

    def below(self, link: str) -> list[JointFacts]:
        """Return every joint below a link, a parent before its children; of a robot without faults."""
        found: list[JointFacts] = []
        carried: dict[str, list[JointFacts]] = {}
        for joint in self.joints.values():
            carried.setdefault(joint.parent, []).append(joint)
        waiting = [link]
        while waiting:
            joints = carried.get(waiting.pop(), [])
            found += joints
            waiting += [joint.child for joint in joints]
        return found


def read_facts(file: Path) -> RobotFacts:
    """Return what a URDF says, with every fault of it in ``faults``.

    Raises InvalidInput where there is no such file, InvalidRobot where it is not the XML of a robot.
    """
    robot = read_elements(file)
    notes = _Notes()
    elements = {tag: _named(robot, tag, notes) for tag in ("link", "joint")}
    if not elements["link"]:
        notes.faults.append((robot.line, "the robot has no link"))
    elif len(elements["link"]) > MAX_LINKS:
        notes.faults.append((robot.line, f"the robot has {len(elements['link'])} links, at most {MAX_LINKS} are read"))
    links = {name: _link(name, element, notes) for name, element in elements["link"].items()}
    joints = {name: _joint(name, element, notes) for name, element in elements["joint"].items()}
    lines = {name: element.line for name, element in elements["joint"].items()}
    _check_tree(links, joints, lines, notes)
    if notes.rubbing:
        text = f"damping or friction of {len(notes.rubbing)} joints, from {notes.rubbing[0]!r} on, is not modelled"
        notes.warnings.append((lines[notes.rubbing[0]], text))
    return RobotFacts(
        name=robot.attributes.get("name") or file.stem,
        links=links,
        joints=joints,
        faults=notes.listed(notes.faults),
        warnings=notes.listed(notes.warnings),
    )


@dataclass
class _Notes:
    """Faults and warnings as they are found, each with its line."""

    faults: list[tuple[int, str]] = field(default_factory=list)
    warnings: list[tuple[int, str]] = field(default_factory=list)
    rubbing: list[str] = field(default_factory=list)

    def listed(self, notes: Iterable[tuple[int, str]]) -> tuple[str, ...]:
        """Return notes by line, as text; of very many the first hundred."""
        ordered = sorted(notes, key=lambda note: note[0])
        more = [f"and {len(ordered) - MAX_LISTED} more"] if len(ordered) > MAX_LISTED else []
        return (*(f"line {line}: {text}" for line, text in ordered[:MAX_LISTED]), *more)

    def numbers(self, what: str, element: Element, name: str, default: str | None, count: int = 1) -> Numbers | None:
        """Return ``count`` numbers of an attribute, not NaN; note a fault and return None where they are not there."""
        text = element.attributes.get(name, default)
        if text is None:
            self.faults.append((element.line, f"{what}: <{element.tag}> lacks {name}"))
            return None
        words = text.split()
        values = [float(word) for word in words if NUMBER.fullmatch(word)]
        if len(words) != count or len(values) != count or np.isnan(values).any():
            wish = "a number" if count == 1 else f"{count} numbers"
            self.faults.append((element.line, f"{what}: {element.tag} {name} must be {wish}, got {text[:80]!r}"))
            return None
        return tuple(values)

    def finite(self, what: str, element: Element, name: str, default: str | None, count: int = 1) -> Numbers | None:
        """Return ``numbers``, and note infinite ones as a fault too."""
        values = self.numbers(what, element, name, default, count)
        if values is not None and np.isinf(values).any():
            text = element.attributes[name]
            self.faults.append((element.line, f"{what}: {element.tag} {name} must be finite, got {text[:80]!r}"))
            return None
        return values

    def only(self, what: str, element: Element, tag: str) -> Element | None:
        """Return the one child of a tag, or None; note a fault where there are several."""
        found = element.all(tag)
        if len(found) > 1:
            self.faults.append((found[1].line, f"{what}: wants one <{tag}>, has {len(found)}"))
        return found[0] if found else None

    def origin(self, what: str, element: Element) -> tuple[Numbers, Numbers]:
        """Return xyz and rpy of a child ``<origin>``; zeros where there is none."""
        zeros = (0.0, 0.0, 0.0)
        origin = self.only(what, element, "origin")
        if origin is None:
            return zeros, zeros
        xyz, rpy = (self.finite(what, origin, name, "0 0 0", 3) for name in ("xyz", "rpy"))
        return xyz or zeros, rpy or zeros


def _named(robot: Element, tag: str, notes: _Notes) -> dict[str, Element]:
    found: dict[str, Element] = {}
    for element in robot.all(tag):
        name = element.attributes.get("name", "")
        if not name:
            notes.faults.append((element.line, f"a <{tag}> has no name"))
        elif len(name) > MAX_NAME:
            notes.faults.append((element.line, f"{tag} {name[:80]!r}...: name is {len(name)} characters long"))
        elif name in found:
            notes.faults.append((element.line, f"{tag} {name!r}: name already used on line {found[name].line}"))
        else:
            found[name] = element
    return found


def _link(name: str, element: Element, notes: _Notes) -> LinkFacts:
    what = f"link {name!r}"
    inertial = notes.only(what, element, "inertial")
    if inertial is None:
        return LinkFacts(name=name)
    xyz, rpy = notes.origin(what, inertial)
    mass = _mass(what, inertial, notes)
    moments = _moments(what, inertial, mass, notes)
    return LinkFacts(name=name, mass=mass or 0.0, xyz=xyz, rpy=rpy, moments=moments)


def _mass(what: str, inertial: Element, notes: _Notes) -> float | None:
    element = notes.only(what, inertial, "mass")
    if element is None:
        notes.faults.append((inertial.line, f"{what}: its <inertial> has no <mass>"))
        return None
    found = notes.finite(what, element, "value", None)
    if found is not None and found[0] < 0:
        notes.faults.append((element.line, f"{what}: mass must not be negative, got {found[0]:g} kg"))
        return None
    return found[0] if found else None


def _moments(what: str, inertial: Element, mass: float | None, notes: _Notes) -> Numbers:
    none = (0.0,) * 6
    element = notes.only(what, inertial, "inertia")
    if element is None:
        if mass != 0.0:
            notes.faults.append((inertial.line, f"{what}: its <inertial> has no <inertia>"))
        return none
    found = [notes.finite(what, element, name, None) for name in MOMENTS]
    given = tuple(values[0] for values in found if values)
    if len(given) < len(MOMENTS):
        return none
    if fault := inertia_fault(_tensor(given)):
        notes.faults.append((element.line, f"{what}: {fault}"))
    if mass and not any(given):
        notes.warnings.append((element.line, f"{what}: has mass but no inertia, taken as a point mass"))
    if mass == 0.0 and any(given):
        notes.warnings.append((element.line, f"{what}: has inertia but no mass"))
    return given


def _tensor(moments: Sequence[float]) -> Matrix3:
    xx, xy, xz, yy, yz, zz = moments
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _joint(name: str, element: Element, notes: _Notes) -> JointFacts:
    what = f"joint {name!r}"
    kind = element.attributes.get("type", "")
    if kind not in KINDS:
        notes.faults.append((element.line, f"{what}: type must be one of {', '.join(KINDS)}, got {kind[:80]!r}"))
    xyz, rpy = notes.origin(what, element)
    parent, child = (_end(what, element, tag, notes) for tag in ("parent", "child"))
    axis = _axis(what, element, notes) if kind in (*MOVING, "planar") else (0.0, 0.0, 1.0)
    lower, upper, velocity, effort = _limits(what, kind, element, notes)
    if kind in MOVING and _has_friction(what, element, notes):
        notes.rubbing.append(name)
    return JointFacts(
        name=name,
        kind=kind,
        parent=parent,
        child=child,
        xyz=xyz,
        rpy=rpy,
        axis=axis,
        lower=lower,
        upper=upper,
        velocity=velocity,
        effort=effort,
        mimic=_mimic(what, element, notes),
    )


def _end(what: str, joint: Element, tag: str, notes: _Notes) -> str:
    element = notes.only(what, joint, tag)
    link = element.attributes.get("link", "") if element else ""
    if not link:
        notes.faults.append((joint.line, f"{what}: names no {tag} link"))
    return link


def _axis(what: str, joint: Element, notes: _Notes) -> Numbers:
    default = (1.0, 0.0, 0.0)  # the URDF format's
    element = notes.only(what, joint, "axis")
    given = notes.finite(what, element, "xyz", None, 3) if element else default
    if element is None or given is None:
        return default
    size = max(abs(value) for value in given)  # scaled first, so that no square overflows or vanishes
    if size == 0.0:
        notes.faults.append((element.line, f"{what}: axis must not be zero"))
        return default
    length = float(np.linalg.norm(np.array(given) / size)) * size
    if abs(length - 1) > UNIT_AXIS:
        notes.warnings.append((element.line, f"{what}: axis has length {length:.6g}, taken as a direction"))
    unit = np.array(given) / size
    return tuple(float(value) for value in unit / np.linalg.norm(unit))


def _limits(what: str, kind: str, joint: Element, notes: _Notes) -> tuple[float, float, float, float]:
    """Return lower, upper, velocity and effort limit; only joints of one degree of freedom have any."""
    free = (-np.inf, np.inf, np.inf, np.inf)
    if kind not in MOVING:
        return free
    element = notes.only(what, joint, "limit")
    if element is None:
        if kind != "continuous":
            notes.faults.append((joint.line, f"{what}: a {kind} joint wants a <limit>, has none"))
        return free
    ends = [notes.numbers(what, element, name, "0") for name in ("lower", "upper")]
    sizes = [notes.numbers(what, element, name, None) for name in ("velocity", "effort")]
    for name, size in zip(("velocity", "effort"), sizes, strict=True):
        if size is not None and size[0] < 0:
            notes.faults.append((element.line, f"{what}: {name} limit must not be negative, got {size[0]:g}"))
    lower, upper = (end[0] if end else 0.0 for end in ends)
    velocity, effort = (size[0] if size else 0.0 for size in sizes)
    if kind == "continuous":
        return -np.inf, np.inf, velocity, effort
    if lower > upper:
        notes.faults.append((element.line, f"{what}: limits are swapped, lower {lower:g} and upper {upper:g}"))
    elif lower == upper:
        notes.warnings.append((element.line, f"{what}: its limits leave it no way to move, both are {lower:g}"))
    return lower, upper, velocity, effort


def _has_friction(what: str, joint: Element, notes: _Notes) -> bool:
    element = notes.only(what, joint, "dynamics")
    if element is None:
        return False
    found = [notes.finite(what, element, name, "0") for name in ("damping", "friction")]
    return any(value is not None and value[0] != 0.0 for value in found)


def _mimic(what: str, joint: Element, notes: _Notes) -> tuple[str, float, float] | None:
    element = notes.only(what, joint, "mimic")
    if element is None:
        return None
    factor = notes.finite(what, element, "multiplier", "1")
    offset = notes.finite(what, element, "offset", "0")
    return element.attributes.get("joint", ""), factor[0] if factor else 1.0, offset[0] if offset else 0.0


def _check_tree(
    links: Mapping[str, LinkFacts], joints: Mapping[str, JointFacts], lines: Mapping[str, int], notes: _Notes
) -> None:
    """Note what keeps links and joints from being one tree, and mimics that follow nothing."""
    holder: dict[str, str] = {}
    for name, joint in joints.items():
        for tag, link in (("parent", joint.parent), ("child", joint.child)):
            if link and link not in links:
                notes.faults.append((lines[name], f"joint {name!r}: {tag} link {link[:MAX_NAME]!r} does not exist"))
        if joint.child in holder:
            two = f"{holder[joint.child]!r} and {name!r}"
            notes.faults.append((lines[name], f"link {joint.child!r}: is the child of two joints, {two}"))
        elif joint.child in links:
            holder[joint.child] = name
        if joint.mimic and joint.mimic[0] not in joints:
            leader = joint.mimic[0][:MAX_NAME]
            notes.faults.append((lines[name], f"joint {name!r}: mimics joint {leader!r}, which does not exist"))
    for loop in _loops(joints, lambda joint: holder.get(joint.parent)):
        named = ", ".join(repr(name) for name in loop)
        notes.faults.append((lines[loop[0]], f"joints form a loop: {named}"))
    for loop in _loops(joints, lambda joint: joint.mimic[0] if joint.mimic else None):
        notes.faults.append((lines[loop[0]], f"joint {loop[0]!r}: mimics itself"))
    roots = [link for link in links if link not in holder]
    if len(roots) > 1:
        named = ", ".join(repr(root) for root in roots[:10]) + (", ..." if len(roots) > 10 else "")
        notes.faults.append((1, f"the robot must have one root link, has {len(roots)}: {named}"))


def _loops(joints: Mapping[str, JointFacts], step: Callable[[JointFacts], str | None]) -> list[list[str]]:
    """Return each closed round of joints that ``step`` leads along, once."""
    seen: set[str] = set()
    found = []
    for name in joints:
        trail: list[str] = []
        at: str | None = name
        while at is not None and at in joints and at not in seen:
            seen.add(at)
            trail.append(at)
            at = step(joints[at])
        if at in trail:
            found.append(trail[trail.index(at) :])
    return found
