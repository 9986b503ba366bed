"""The chain of a URDF that becomes an arm: joints that move between base and tip, and frozen ones."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.inputs import finite_number, likely_spelling, listed, shown
from paretoik.robot.arm_inputs import JOINT_TYPES
from paretoik.robot.urdf_description import OTHER_TYPES, Fault, JointDescription, RobotDescription
from paretoik.robot.urdf_faults import list_messages


@dataclass(frozen=True, kw_only=True)
class Chain:
    """The joints of a robot, split into those that move the ``tip`` against the ``base`` and those that are frozen.

    ``joints`` are all of the file, a parent before its children; ``links`` and ``moving`` go from base to tip;
    ``above`` are the joints between the root and the base, the nearest to the base first; ``frozen`` maps the name of
    every other joint that could move to its value [rad, m].
    """

    base: str
    tip: str
    links: Sequence[str]
    moving: Sequence[JointDescription]
    joints: Sequence[JointDescription]
    above: Sequence[JointDescription]
    frozen: Mapping[str, float]
    faults: Sequence[Fault]
    notices: Sequence[str]


def select_chain(
    source: str, robot: RobotDescription, base: str | None, tip: str | None, fixed: Mapping[str, float], *, soft: bool
) -> Chain:
    """Return the chain from link ``base`` (default: the root) to ``tip`` (default: the only leaf below the base).

    Joints named in ``fixed`` [rad, m] and joints off the chain are frozen, and so are the joints that mimic them.
    Faults of the chain are in its ``faults``, those off it in its ``notices``. Raises InvalidInput, naming ``source``,
    for links and joints that the robot has not.
    """
    root, (start, end) = robot.roots[0], _ends(source, robot, base, tip)
    joints = robot.joints_below(root)
    path, above = _path(source, joints, start, end), _path(source, joints, root, start)[::-1]
    _check_fixed(source, joints, fixed)
    leaders = {joint.name: _leader(robot, joint, fixed) for joint in joints}
    free = {joint.name for joint in path if joint.type != "fixed" and not joint.mimic and joint.name not in fixed}
    moving = [joint for joint in path if joint.type != "fixed" and leaders[joint.name][0] in free]
    links = [start, *(joint.child for joint in path)]
    first = next((row for row, joint in enumerate(path) if joint in moving), len(path))
    faults, notices = _sort_faults(robot, path, above, still=links[: first + 1], moved=links[first + 1 :])
    for joint in moving:
        if joint.mimic or joint.type in OTHER_TYPES:
            wish = "joints of one freedom of their own wanted on the chain from base to tip"
            hint = f"fixed= freezes {leaders[joint.name][0]!r}" if joint.mimic else f"base={joint.child!r} is below it"
            got = f"a {'mimic' if joint.mimic else joint.type} one"
            faults.append((joint.line, f"joint {joint.name!r}: {wish}, got {got}; {hint}"))
    frozen = {}
    for joint in joints:
        if joint.type != "fixed" and joint not in moving:
            leader, multiplier, offset = leaders[joint.name]
            frozen[joint.name] = multiplier * float(fixed.get(leader, 0.0)) + offset
            leads = f", though it mimics {leader!r}" if leader in free else ""
            notices.append(_frozen_notice(joint, frozen[joint.name], joint in path) + leads)
    if start != root:
        notices.insert(0, f"base {start!r} is not the root {root!r}: what is above it is left out")
    narrowed = [_take_soft_limits(joint) for joint in moving]
    if not soft and (unused := [old.name for old, new in zip(moving, narrowed, strict=True) if old != new]):
        notices.append(f"soft limits of {len(unused)} joints, from {unused[0]!r} on, are not used: soft=True uses them")
    if soft:
        moving = narrowed
        empty = [joint for joint in moving if joint.limits.lower > joint.limits.upper]
        wish = "soft limits must overlap its limits"
        faults += [(each.line, f"joint {each.name!r}: {wish}, got {each.limits.soft}") for each in empty]
    if jerky := [joint.name for joint in moving if np.isfinite(joint.limits.jerk)]:
        hint = "pk.Controller(jerk=arm.jerk_limits) holds an export to them"
        notices.append(f"jerk limits of {len(jerky)} joints, from {jerky[0]!r} on, do not bind motions: {hint}")
    return Chain(
        base=start,
        tip=end,
        links=links,
        moving=moving,
        joints=joints,
        above=above,
        frozen=frozen,
        faults=faults,
        notices=notices,
    )


def find_zero_limits(chain: Chain) -> list[str]:
    """Return a message for every limit of 0 on velocity, effort, acceleration or jerk on the chain."""
    return [
        f"joint {joint.name!r}: {name} limit must not be 0, got 0; zero_limits='unlimited' says that it means none"
        for joint in chain.moving
        for name in ("velocity", "effort", "acceleration", "jerk")
        if getattr(joint.limits, name) == 0.0
    ]


def _ends(source: str, robot: RobotDescription, base: str | None, tip: str | None) -> tuple[str, str]:
    for name, link in (("base", base), ("tip", tip)):
        if link is not None and (not isinstance(link, str) or link not in robot.links):
            hint = likely_spelling(link, robot.links)
            raise InvalidInput(f"{source}: {name}: one of {listed(robot.links)} wanted, got {shown(link)}{hint}")
    start = base or robot.roots[0]
    leaves = robot.leaves_below(start)
    if tip is None and len(leaves) > 1:
        raise InvalidInput(f"{source}: tip: one of the leaves {listed(leaves)} wanted, got none")
    return start, tip or leaves[0]


def _path(source: str, joints: Sequence[JointDescription], base: str, tip: str) -> list[JointDescription]:
    """Return the joints from base to tip."""
    parent_joint = {joint.child: joint for joint in joints}
    path: list[JointDescription] = []
    link = tip
    while link != base:
        if link not in parent_joint:
            raise InvalidInput(f"{source}: base: a link wanted that carries the tip {shown(tip)}, got {shown(base)}")
        path.append(parent_joint[link])
        link = parent_joint[link].parent
    return path[::-1]


def _check_fixed(source: str, joints: Sequence[JointDescription], fixed: Mapping[str, float]) -> None:
    known = {joint.name: joint.limits for joint in joints if joint.type in JOINT_TYPES}
    for name, value in fixed.items():
        if name not in known:
            hint = likely_spelling(name, known)
            raise InvalidInput(f"{source}: fixed: joints among {listed(known)} wanted, got {shown(name)}{hint}")
        lower, upper = known[name].lower, known[name].upper
        if not lower <= finite_number(f"{source}: joint {name!r}", value) <= upper:
            raise InvalidInput(f"{source}: joint {name!r}: a value from {lower:g} to {upper:g} wanted, got {value:g}")


def _leader(robot: RobotDescription, joint: JointDescription, fixed: Collection[str]) -> tuple[str, float, float]:
    """Return the joint that a joint follows in the end, itself if it mimics none, with multiplier and offset."""
    name, multiplier, offset = joint.name, 1.0, 0.0
    passed = set[str]()
    while name in robot.joints and name not in fixed and name not in passed and (mimic := robot.joints[name].mimic):
        passed.add(name)
        name, multiplier, offset = mimic[0], multiplier * mimic[1], offset + multiplier * mimic[2]
    return name, multiplier, offset


def _sort_faults(
    robot: RobotDescription,
    path: Sequence[JointDescription],
    above: Sequence[JointDescription],
    *,
    still: Collection[str],
    moved: Collection[str],
) -> tuple[list[Fault], list[str]]:
    """Return the faults of the chain's parts, and those of others as notices that say what becomes of them.

    A joint above the base must be readable as far as it says where gravity points.
    """
    faults: list[Fault] = []
    notices: list[Fault] = []
    for joint in robot.joints.values():
        is_needed = joint in path or (joint in above and joint.misplaced)
        what = "with all that it carries, left out" if joint.misplaced else "frozen"
        consequence = "" if is_needed else f"; off the chain, {what}"
        (faults if is_needed else notices).extend((line, text + consequence) for line, text in joint.faults)
    for link in robot.links.values():
        consequence = "; no joint moves it, left out" if link.name in still else "; off the chain, left out"
        is_needed = link.name in moved
        (faults if is_needed else notices).extend(
            (line, text if is_needed else text + consequence) for line, text in link.faults
        )
    return faults, list(list_messages(notices))


def _take_soft_limits(joint: JointDescription) -> JointDescription:
    """Return a joint whose limits are within those of its safety controller, if it has any."""
    if joint.limits.soft is None:
        return joint
    lower, upper = max(joint.limits.lower, joint.limits.soft[0]), min(joint.limits.upper, joint.limits.soft[1])
    return replace(joint, limits=replace(joint.limits, lower=lower, upper=upper))


def _frozen_notice(joint: JointDescription, value: float, on_chain: bool) -> str:
    where = "on" if on_chain else "off"
    if joint.type not in JOINT_TYPES:
        return f"joint {joint.name!r}: {where} the chain, frozen where its {joint.type} motion is zero"
    unit = "m" if joint.type == "prismatic" else "rad"
    outside = "" if joint.limits.lower <= value <= joint.limits.upper else ", outside its limits"
    return f"joint {joint.name!r}: {where} the chain, frozen at {value:g} {unit}{outside}"
