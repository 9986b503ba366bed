"""Faults of a URDF's links and joints that are not one tree, and of mimic joints that follow nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from paretoik.inputs import shown
from paretoik.robot.urdf_description import Fault, JointDescription, LinkDescription


def find_tree_faults(
    links: Mapping[str, LinkDescription], joints: Mapping[str, JointDescription], lines: Mapping[str, int]
) -> list[Fault]:
    """Return why links and joints are not one tree, each fault with its line; ``lines`` are those of the joints."""
    faults: list[Fault] = []
    parent_joint: dict[str, str] = {}
    for name, joint in joints.items():
        for tag, link in (("parent", joint.parent), ("child", joint.child)):
            if link and link not in links:
                faults.append(
                    (lines[name], f"joint {shown(name)}: {tag} must be a link of the robot, got {shown(link)}")
                )
        if joint.child in parent_joint:
            two = f"{shown(parent_joint[joint.child])} and {shown(name)}"
            faults.append((lines[name], f"link {shown(joint.child)}: must be the child of one joint, got {two}"))
        elif joint.child in links:
            parent_joint[joint.child] = name
    for loop in _find_loops(joints, lambda joint: parent_joint.get(joint.parent)):
        names = ", ".join(repr(name) for name in loop)
        faults.append((lines[loop[0]], f"joints must form a tree, got the loop {names}"))
    roots = [link for link in links if link not in parent_joint]
    if len(roots) > 1:
        names = ", ".join(repr(root) for root in roots[:10]) + (", ..." if len(roots) > 10 else "")
        faults.append((1, f"the robot must have one root link, got {len(roots)}: {names}"))
    return faults


def find_mimic_faults(joints: Mapping[str, JointDescription], lines: Mapping[str, int]) -> list[tuple[str, Fault]]:
    """Return, with the joint's name, the fault of each mimic joint that in the end follows no joint but itself."""
    faults = []
    for name, joint in joints.items():
        if joint.mimic and joint.mimic[0] not in joints:
            leader = shown(joint.mimic[0][:200])
            faults.append((name, (lines[name], f"joint {shown(name)}: must mimic a joint of the robot, got {leader}")))
    for loop in _find_loops(joints, lambda joint: joint.mimic[0] if joint.mimic else None):
        faults += [(name, (lines[name], f"joint {name!r}: must mimic another joint, got itself")) for name in loop]
    return faults


def _find_loops(
    joints: Mapping[str, JointDescription], successor: Callable[[JointDescription], str | None]
) -> list[list[str]]:
    """Return each cycle of the graph in which every joint points to its ``successor``, once."""
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
