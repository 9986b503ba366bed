"""The chain of a URDF that becomes an arm: joints that move between base and tip, and frozen ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from paretoik.errors import InvalidInput
from paretoik.inputs import finite_number, likely_spelling, listed, shown
from paretoik.robot.arm_inputs import JOINT_TYPES
from paretoik.robot.urdf_description import JointDescription, RobotDescription
from paretoik.robot.urdf_faults import inertia_faults, list_messages


@dataclass(frozen=True, kw_only=True)
class Chain:
    """The joints below ``base``, split into those that move the ``tip`` and those that are frozen.

    ``below`` lists all of them, a parent before its children; ``moving`` goes from base to tip; ``frozen`` maps the
    name of every other joint that could move to its value [rad, m].
    """

    base: str
    tip: str
    moving: list[JointDescription]
    below: list[JointDescription]
    frozen: dict[str, float]
    faults: tuple[str, ...]
    notices: tuple[str, ...]


def select_chain(
    source: str, robot: RobotDescription, base: str | None, tip: str | None, fixed: Mapping[str, float]
) -> Chain:
    """Return the chain from link ``base`` (default: the root) to ``tip`` (default: the only leaf).

    Joints named in ``fixed`` [rad, m] and joints off the chain are frozen. Faults of the chain are listed in it; raises
    InvalidInput, naming ``source``, for links and joints that the robot has not.
    """
    start, end = _ends(source, robot, base, tip)
    below = robot.joints_below(start)
    path = _path(source, below, start, end)
    _check_fixed(source, below, fixed)
    moving = [joint for joint in path if joint.type != "fixed" and joint.name not in fixed]
    others = {joint.name: joint for joint in below if joint.type != "fixed" and joint not in moving}
    frozen = {name: _frozen_value(name, others, fixed) for name in others}
    faults = [
        f"joint {joint.name!r}: joints of one freedom of their own wanted on the chain from base to tip, got a "
        f"{'mimic' if joint.mimic else joint.type} one"
        for joint in moving
        if joint.mimic or joint.type not in JOINT_TYPES
    ]
    links = [start, *(joint.child for joint in path)]
    first_moved = next((row + 1 for row, joint in enumerate(path) if joint in moving), len(links))
    still, moved = links[:first_moved], links[first_moved:]
    aside = [joint.child for joint in below if joint.child not in links]
    faults += list_messages(inertia_faults(robot.links[link] for link in moved))
    if not moving:
        faults.append(f"a joint that moves wanted between {start!r} and {end!r}, got none")
    leaders = {joint.name for joint in moving}
    notices = [_frozen_notice(joint, frozen[name], path, leaders) for name, joint in others.items()]
    for names, consequence in ((still, "no joint moves it, left out"), (aside, "off the chain, taken as a point mass")):
        wrong = inertia_faults(robot.links[link] for link in names)
        notices += [f"{fault}; {consequence}" for fault in list_messages(wrong)]
    if start != robot.roots[0]:
        notices.insert(0, f"base {start!r} is not the root {robot.roots[0]!r}: what is above it is left out")
    for name in _massless_joints(robot, start, below, moving):
        follow = (
            "" if name == moving[-1].name else ", though other joints follow it: no torques and energies of this arm"
        )
        notices.append(f"joint {name!r}: moves no mass{follow}")
    return Chain(
        base=start, tip=end, moving=moving, below=below, frozen=frozen, faults=tuple(faults), notices=tuple(notices)
    )


def find_zero_limits(chain: Chain) -> list[str]:
    """Return a message for every velocity or effort limit of 0 on the chain."""
    return [
        f"joint {joint.name!r}: {name} limit must not be 0, got 0; zero_limits='unlimited' says that it means none"
        for joint in chain.moving
        for name, limit in (("velocity", joint.velocity), ("effort", joint.effort))
        if limit == 0.0
    ]


def _ends(source: str, robot: RobotDescription, base: str | None, tip: str | None) -> tuple[str, str]:
    for name, link in (("base", base), ("tip", tip)):
        if link is not None and (not isinstance(link, str) or link not in robot.links):
            hint = likely_spelling(link, robot.links)
            raise InvalidInput(f"{source}: {name}: one of {listed(robot.links)} wanted, got {shown(link)}{hint}")
    if tip is None and len(robot.leaves) > 1:
        raise InvalidInput(f"{source}: tip: one of the leaves {listed(robot.leaves)} wanted, got none")
    return base or robot.roots[0], tip or robot.leaves[0]


def _path(source: str, below: list[JointDescription], base: str, tip: str) -> list[JointDescription]:
    """Return the joints from base to tip."""
    parent_joint = {joint.child: joint for joint in below}
    path: list[JointDescription] = []
    link = tip
    while link != base:
        if link not in parent_joint:
            raise InvalidInput(f"{source}: base: a link wanted that carries the tip {shown(tip)}, got {shown(base)}")
        path.append(parent_joint[link])
        link = parent_joint[link].parent
    return path[::-1]


def _check_fixed(source: str, below: list[JointDescription], fixed: Mapping[str, float]) -> None:
    joints = {joint.name: joint for joint in below if joint.type in JOINT_TYPES}
    for name, value in fixed.items():
        if name not in joints:
            hint = likely_spelling(name, joints)
            raise InvalidInput(f"{source}: fixed: joints among {listed(joints)} wanted, got {shown(name)}{hint}")
        lower, upper = joints[name].lower, joints[name].upper
        if not lower <= finite_number(f"{source}: joint {name!r}", value) <= upper:
            raise InvalidInput(f"{source}: joint {name!r}: a value from {lower:g} to {upper:g} wanted, got {value:g}")


def _frozen_value(name: str, others: Mapping[str, JointDescription], fixed: Mapping[str, float]) -> float:
    """Return where a joint is frozen: at its value in ``fixed``, by the frozen joint it mimics, or at 0."""
    multiplier, offset = 1.0, 0.0
    while name in others and name not in fixed and (mimic := others[name].mimic):
        name, next_multiplier, next_offset = mimic
        multiplier, offset = multiplier * next_multiplier, offset + multiplier * next_offset
    return multiplier * float(fixed.get(name, 0.0)) + offset


def _frozen_notice(joint: JointDescription, value: float, path: list[JointDescription], leaders: set[str]) -> str:
    where = "on" if joint in path else "off"
    if joint.type not in JOINT_TYPES:
        return f"joint {joint.name!r}: {where} the chain, frozen where its {joint.type} motion is zero"
    unit = "m" if joint.type == "prismatic" else "rad"
    outside = "" if joint.lower <= value <= joint.upper else ", outside its limits"
    leader = f", though it mimics {joint.mimic[0]!r}" if joint.mimic and joint.mimic[0] in leaders else ""
    return f"joint {joint.name!r}: {where} the chain, frozen at {value:g} {unit}{outside}{leader}"


def _massless_joints(
    robot: RobotDescription, base: str, below: list[JointDescription], moving: list[JointDescription]
) -> list[str]:
    """Return the moving joints whose link, with all that is fixed to it, has no mass; base to tip."""
    masses = dict.fromkeys((joint.name for joint in moving), 0.0)
    moved_by: dict[str, str | None] = {base: None}
    for joint in below:
        mover = joint.name if joint.name in masses else moved_by[joint.parent]
        moved_by[joint.child] = mover
        if mover is not None:
            masses[mover] += robot.links[joint.child].mass
    return [name for name, mass in masses.items() if mass == 0.0]
