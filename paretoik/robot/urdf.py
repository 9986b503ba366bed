"""An arm from a URDF: validate the file, select the chain, build.

The chain is from base to tip. Joint frames have their axis along z. Fixed links are merged into those that move.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path
from typing import Literal

import numpy as np

from paretoik.arrays import Matrix3
from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.handed_down import HANDED_DOWN
from paretoik.inputs import (
    check_choice,
    check_flag,
    check_mapping,
    check_text,
    file_path,
    finite_number,
    likely_spelling,
    listed,
    shown,
)
from paretoik.robot.arm_arguments import JOINT_TYPES, JointType
from paretoik.robot.body import Body, combine_bodies, inertia_fault, nearest_inertia, transform_body
from paretoik.robot.chain import EARTH_GRAVITY, LinkGeometry, SerialChain, joint_motion
from paretoik.robot.pose import Frame, Pose
from paretoik.robot.urdf_description import (
    ORIGIN,
    OTHER_TYPES,
    Fault,
    JointDescription,
    RobotDescription,
    group_messages,
    list_messages,
    shorten_list,
)
from paretoik.robot.urdf_reading import read_robot
from paretoik.tables import columns, fit_screen, html_representation

# The chain of a URDF that becomes an arm.


@dataclass(frozen=True, kw_only=True)
class Chain:
    """The joints of a robot: moving joints from base to tip, and frozen joints.

    links, moving: links and moving joints from base to tip
    """

    base: str
    tip: str
    links: Sequence[str]
    moving: Sequence[JointDescription]
    joints: Sequence[JointDescription]  # all joints of the file, a parent before its children
    above: Sequence[JointDescription]  # joints between the root and the base, in order from the base
    frozen: Mapping[str, float]  # values [rad, m] of all other joints that could move, by name
    faults: Sequence[Fault]
    notices: Sequence[str]


def select_chain(
    source: str, robot: RobotDescription, base: str | None, tip: str | None, fixed: Mapping[str, float], *, soft: bool
) -> Chain:
    """Return the chain from link ``base`` to link ``tip``.

    base: first link, None for the root
    tip: last link, None for the only leaf below the base

    Joints named in ``fixed`` [rad, m], joints off the chain, and joints that mimic them are frozen. The chain's
    ``faults`` are those of its own parts; its ``notices`` are about parts off the chain. Raises InvalidInput, naming
    ``source``, for links and joints that the robot does not have.
    """
    root, (start, end) = robot.roots[0], _ends(source, robot, base, tip)
    joints = robot.joints_below(root)
    path, above = _path(source, joints, start, end), _path(source, joints, root, start)[::-1]
    known = {joint.name: joint.limits for joint in joints if joint.type in JOINT_TYPES}
    for name, value in fixed.items():
        if name not in known:
            hint = likely_spelling(name, known)
            raise InvalidInput(f"{source}: fixed must name joints among {listed(known)}, got {shown(name)}{hint}")
        lower, upper = known[name].lower, known[name].upper
        if not lower <= finite_number(f"{source}: joint {name!r}", value) <= upper:
            raise InvalidInput(f"{source}: joint {name!r} must be from {lower:g} to {upper:g}, got {value:g}")
    leaders = {joint.name: _leader(robot, joint, fixed) for joint in joints}
    free = {joint.name for joint in path if joint.type != "fixed" and not joint.mimic and joint.name not in fixed}
    moving = [joint for joint in path if joint.type != "fixed" and leaders[joint.name][0] in free]
    links = [start, *(joint.child for joint in path)]
    first = next((row for row, joint in enumerate(path) if joint in moving), len(path))
    faults, notices = _sort_faults(robot, path, above, still=links[: first + 1], moved=links[first + 1 :])
    for joint in moving:
        if joint.mimic or joint.type in OTHER_TYPES:
            wish = "must have one degree of freedom of its own on the chain from base to tip"
            hint = f"fixed= freezes {leaders[joint.name][0]!r}" if joint.mimic else f"base={joint.child!r} is below it"
            got = f"a {'mimic' if joint.mimic else joint.type} joint"
            faults.append((joint.line, f"joint {joint.name!r}: {wish}, got {got}; {hint}"))
    frozen = {}
    for joint in joints:
        if joint.type != "fixed" and joint not in moving:
            leader, multiplier, offset = leaders[joint.name]
            frozen[joint.name] = multiplier * float(fixed.get(leader, 0.0)) + offset
            leads = f", though it mimics {leader!r}" if leader in free else ""
            where, still = "on" if joint in path else "off", joint.frozen_text(frozen[joint.name])
            notices.append(f"joint {joint.name!r}: {where} the chain, {still}{leads}")
    if start != root:
        notices.insert(0, f"base {start!r} is not the root {root!r}: links above it are left out")
    narrowed = [replace(joint, limits=joint.limits.narrowed) for joint in moving]
    if not soft and (unused := [old.name for old, new in zip(moving, narrowed, strict=True) if old != new]):
        notices.append(f"soft limits of {len(unused)} joints (first: {unused[0]!r}) are not used: soft=True uses them")
    if soft:
        moving = narrowed
        empty = [joint for joint in moving if joint.limits.lower > joint.limits.upper]
        wish = "soft limits must overlap its limits"
        faults += [(each.line, f"joint {each.name!r}: {wish}, got {each.limits.soft}") for each in empty]
    if jerky := [joint.name for joint in moving if np.isfinite(joint.limits.jerk)]:
        hint = "pk.Controller(jerk=arm.jerk_limits) applies them to an export"
        notices.append(f"jerk limits of {len(jerky)} joints (first: {jerky[0]!r}) do not limit motions: {hint}")
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
    """Return messages for limits of 0 on the chain: on velocity, effort, acceleration or jerk."""
    return [
        f"joint {joint.name!r}: {name} limit must not be 0, got 0; zero_limits='unlimited' ignores it"
        for joint in chain.moving
        for name in ("velocity", "effort", "acceleration", "jerk")
        if getattr(joint.limits, name) == 0.0
    ]


def _ends(source: str, robot: RobotDescription, base: str | None, tip: str | None) -> tuple[str, str]:
    for name, link in (("base", base), ("tip", tip)):
        if link is not None and (not isinstance(link, str) or link not in robot.links):
            hint = likely_spelling(link, robot.links)
            raise InvalidInput(f"{source}: {name} must be one of {listed(robot.links)}, got {shown(link)}{hint}")
    start = base or robot.roots[0]
    below = {start, *(joint.child for joint in robot.joints_below(start))}
    leaves = [leaf for leaf in robot.leaves if leaf in below]
    if tip is None and len(leaves) > 1:
        raise InvalidInput(f"{source}: tip must be one of the leaves {listed(leaves)}, got none")
    return start, tip or leaves[0]


def _path(source: str, joints: Sequence[JointDescription], base: str, tip: str) -> list[JointDescription]:
    """Return the joints from base to tip."""
    parent_joint = {joint.child: joint for joint in joints}
    path: list[JointDescription] = []
    link = tip
    while link != base:
        if link not in parent_joint:
            raise InvalidInput(f"{source}: base must be an ancestor of the tip {shown(tip)}, got {shown(base)}")
        path.append(parent_joint[link])
        link = parent_joint[link].parent
    return path[::-1]


def _leader(robot: RobotDescription, joint: JointDescription, fixed: Collection[str]) -> tuple[str, float, float]:
    """Return the last joint of a joint's mimic chain (itself if it mimics none), multiplier and offset."""
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
    """Return the faults of the chain's parts, and notices about other parts.

    A misplaced joint above the base is a fault too: the direction of gravity depends on it.
    """
    faults: list[Fault] = []
    notices: list[Fault] = []
    for joint in robot.joints.values():
        is_needed = joint in path or (joint in above and joint.misplaced)
        what = "left out with all that it carries" if joint.misplaced else "frozen"
        consequence = "" if is_needed else f"; off the chain, {what}"
        (faults if is_needed else notices).extend((line, text + consequence) for line, text in joint.faults)
    for link in robot.links.values():
        consequence = "; no joint moves it, left out" if link.name in still else "; off the chain, left out"
        is_needed = link.name in moved
        (faults if is_needed else notices).extend(
            (line, text if is_needed else text + consequence) for line, text in link.faults
        )
    return faults, list(list_messages(notices))


# From a URDF to an arm.


@dataclass(frozen=True, kw_only=True)
class RobotReport:
    """Faults, warnings, summary and collision bodies of a URDF.

    Warnings are about parts that load but may have unexpected effects.
    """

    file: Path
    faults: tuple[str, ...]
    warnings: tuple[str, ...]
    summary: tuple[str, ...]
    collision: tuple[tuple[str, ...], ...] = ()  # table of the convex bodies of each link, its columns' names first

    def __repr__(self) -> str:
        return fit_screen(report_text(self))

    _repr_html_ = html_representation


def report_text(report: RobotReport) -> str:
    """Return the summary, grouped warnings and faults of a URDF, one message per line."""
    lines = [*report.summary, *(columns(report.collision).splitlines() if report.collision else ())]
    lines += [f"warning: {line}" for line in shorten_list(group_messages(report.warnings))]
    lines += [f"fault: {line}" for line in shorten_list(report.faults)] or ["no faults"]
    return "\n".join(lines)


def check_robot(
    file: str | Path,
    base: str | None = None,
    tip: str | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    soft: bool = False,
    repair_inertias: bool = False,
    collision: bool = False,
    packages: Mapping[str, str | Path] | None = None,
) -> RobotReport:
    """Return a report on a URDF: its chain and its faults.

    file, base, tip, fixed, soft, repair_inertias, collision, packages: arguments as for ``Arm.from_urdf``

    The faults are those for which ``Arm.from_urdf`` would refuse the file. Without ``tip``, if the base has several
    leaves, only faults common to all tips are listed. Meshes are opened only with ``collision=True``. Raises
    InvalidInput for a missing file, and for links and joints that the robot does not have.
    """
    file = file_path("file", file)
    fixed = _check_options(fixed, soft, repair_inertias, collision, packages)
    for name, link in (("base", base), ("tip", tip)):
        if link is not None:
            check_text(name, link)
    try:
        robot = read_robot(file)
    except InvalidRobot as error:
        return RobotReport(file=file, faults=error.faults, warnings=(), summary=())
    summary = [f"robot {robot.name}: {len(robot.links)} links, {len(robot.joints)} joints"]
    if robot.faults:
        return RobotReport(file=file, faults=robot.faults, warnings=robot.warnings, summary=tuple(summary))
    summary.append(f"root {robot.roots[0]}, leaves {', '.join(robot.leaves)}")
    trunk = robot.trunk(robot.roots[0] if base is None else base)
    if tip is None and trunk[-1] not in robot.leaves:
        chain = select_chain(str(file), robot, base, trunk[-1], fixed, soft=soft)
        moved = [joint.child for joint in chain.moving]
        last = max((row for row, link in enumerate(chain.links) if link in moved), default=None)
        others = "" if last is None else f", or a link that carries them all: {', '.join(chain.links[last:])}"
        summary.append(f"several leaves: name one as tip to see its chain{others}")
        faults = _build_arm(robot, chain, repair_inertias)[1] if chain.moving else list_messages(chain.faults)
        every = list_messages(robot.part_faults)
        off = [each for each in every if not any(fault.startswith(each) for fault in faults)]
        notices = tuple(f"{each}; it matters only on a chain that contains it" for each in off)
    else:
        chain = select_chain(str(file), robot, base, tip, fixed, soft=soft)
        summary.append(f"chain {chain.base} to {chain.tip}: {len(chain.moving)} moving joints")
        summary += [f"  {joint.text}" for joint in chain.moving]
        _, faults, notices = _build_arm(robot, chain, repair_inertias)
    warnings, table = [*robot.warnings, *notices, *find_zero_limits(chain)], list[tuple[str, ...]]()
    if collision:
        geometry, wrong, said = _read_geometry(robot, chain, file, packages)
        faults, warnings = _in_order((*faults, *wrong)), [*warnings, *said]
        if not wrong:
            table = HANDED_DOWN["body_table"](geometry, [joint.name for joint in chain.moving])
    return RobotReport(
        file=file, faults=faults, warnings=tuple(warnings), summary=tuple(summary), collision=tuple(table)
    )


def read_chain(
    file: Path,
    *,
    base: str | None,
    tip: str | None,
    fixed: Mapping[str, float] | None,
    zero_limits: Literal["unlimited"] | None = None,
    soft: bool = False,
    repair_inertias: bool = False,
    collision: bool = False,
    packages: Mapping[str, str | Path] | None = None,
) -> SerialChain:
    """Return the data of the arm between two links of a URDF; see ``Arm.from_urdf``.

    Raises InvalidRobot listing every fault, InvalidInput for unknown names or zero limits.
    """
    check_choice("zero_limits", zero_limits, (None, "unlimited"))
    fixed = _check_options(fixed, soft, repair_inertias, collision, packages)
    robot = read_robot(file)
    if robot.faults:
        raise InvalidRobot(str(file), robot.faults)
    chain = select_chain(str(file), robot, base, tip, fixed, soft=soft)
    arm, faults, notices = _build_arm(robot, chain, repair_inertias)
    geometry, wrong, said = _read_geometry(robot, chain, file, packages) if collision else (None, [], [])
    if arm is None or wrong:
        raise InvalidRobot(str(file), _in_order((*faults, *wrong)))
    if zero_limits is None and (zeros := find_zero_limits(chain)):
        raise InvalidInput(f"{file}: {'; '.join(zeros)}")
    notices = (*robot.warnings, *notices, *said)
    return replace(arm, source=file, source_digest=robot.digest, notices=notices, geometry=geometry)


def _read_geometry(
    robot: RobotDescription, chain: Chain, file: Path, packages: Mapping[str, str | Path] | None
) -> tuple[LinkGeometry, list[str], list[str]]:
    """Return the collision geometry of a robot, the faults of its shapes, and notices."""
    try:
        frames, _ = _place_links(chain)
    except InvalidInput:  # an offset that is too large, which is a fault of the arm
        frames = {}
    geometry, faults = HANDED_DOWN["link_bodies"](robot, frames, file, packages)
    notices = list(geometry.notes)
    if geometry.silent:
        notices.append(f"links with visuals only collide with nothing: {listed(geometry.silent)}")
    return geometry, list(list_messages(faults)), notices


def _in_order(messages: Collection[str]) -> tuple[str, ...]:
    """Return messages that begin with their line in the order of lines."""
    return tuple(sorted(messages, key=lambda message: int(message.partition(":")[0].removeprefix("line "))))


def _check_options(
    fixed: Mapping[str, float] | None,
    soft: bool,
    repair_inertias: bool,
    collision: bool,
    packages: Mapping[str, str | Path] | None,
) -> dict[str, float]:
    if fixed is not None:
        check_mapping("fixed", fixed, "values by joint", example="{'joint1': 0.3}")
    check_flag("soft", soft)
    check_flag("repair_inertias", repair_inertias)
    check_flag("collision", collision)
    if packages is not None and not collision:
        raise InvalidInput("collision must be True if packages are given, got False")
    return dict(fixed or {})


def _build_arm(
    robot: RobotDescription, chain: Chain, repair: bool
) -> tuple[SerialChain | None, tuple[str, ...], tuple[str, ...]]:
    """Return the arm of a chain (None if it has faults), its faults, and notices of missing parts."""
    moving, faults, notices = chain.moving, list(chain.faults), list(chain.notices)
    if not moving:
        faults.append((1, f"a joint between {chain.base!r} and {chain.tip!r} must move, got none"))
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            frames, placements = _place_links(chain)
            merged = [_merge_links(robot, chain, frames, number, repair) for number in range(len(moving))]
    except InvalidInput as error:  # an offset that is too large
        return None, list_messages([*faults, (1, f"the robot: {error}")]), tuple(notices)
    unmoved = [link for link in robot.links.values() if link.name not in frames or frames[link.name].link < 0]
    unused = [link.inertia_fault for link in unmoved if link.inertia_fault]
    notices += list_messages((line, f"{said}; no joint moves it, left out") for line, said in unused)
    for joint, (body, wrong, said) in zip(moving, merged, strict=True):
        faults += wrong
        notices += list_messages(said)
        if not np.isfinite([body.mass, *body.center, *body.inertia.flat]).all():
            wish = "masses and inertias of its links must have finite sums, got too large ones"
            faults.append((joint.line, f"joint {shown(joint.name)}: {wish}"))
        elif body.mass == 0.0:
            use = "" if joint is moving[-1] else ", though other joints follow: torques and energies are refused"
            notices.append(f"joint {joint.name!r}: its link has no mass{use}")
    if faults:
        return None, list_messages(faults), tuple(notices)
    gravity = frames[robot.roots[0]].pose.rotation @ np.array(EARTH_GRAVITY)
    if np.abs(gravity - EARTH_GRAVITY).max() > 1e-9:  # m/s²: rounding error of a level base
        axes = ", ".join(f"{value:.4g}" for value in gravity)
        text = f"gravity is ({axes}) m/s² in its axes; mounted(base=...) keeps that unless gravity= is given too"
        notices.append(f"base {chain.base!r} is tilted relative to the root {robot.roots[0]!r}: {text}")
    limits = [joint.limits for joint in moving]
    types: tuple[JointType, ...] = tuple(joint.type for joint in moving)  # type: ignore[misc]  # of JOINT_TYPES
    arm = SerialChain(
        name=robot.name,
        joint_names=tuple(joint.name for joint in moving),
        joint_types=types,
        placements=placements,
        bodies=tuple(body for body, _, _ in merged),
        tool=frames[chain.tip].pose,
        gravity=gravity,
        position_limits=np.array([[each.lower, each.upper] for each in limits]),
        velocity_limits=np.array([each.velocity or np.inf for each in limits]),
        torque_limits=np.array([each.effort or np.inf for each in limits]),
        acceleration_limits=np.array([each.acceleration or np.inf for each in limits]),
        jerk_limits=np.array([each.jerk or np.inf for each in limits]),
        frames={
            **{joint.name: frames[joint.child] for joint in moving},  # a joint's frame is that of its child
            **{link: frames[link] for link in robot.links if link in frames},
        },
        notices=tuple(notices),
    )
    return arm, (), tuple(notices)


def _place_links(chain: Chain) -> tuple[dict[str, Frame], tuple[Pose, ...]]:
    """Return the frames of all links, and the placements of moving joints.

    A link's frame is relative to the moving link that carries it. A moving link's frame is its joint's, turned so that
    z is the axis. Links on a misplaced joint have no frame.
    """

    def at_rest(joint: JointDescription) -> Pose:
        return joint.origin @ joint_motion(joint.type, chain.frozen.get(joint.name, 0.0), joint.axis)

    numbers = {joint.name: number for number, joint in enumerate(chain.moving)}
    frames = {chain.base: Frame(link=-1, pose=ORIGIN)}
    for joint in chain.above:
        frames[joint.parent] = Frame(link=-1, pose=frames[joint.child].pose @ at_rest(joint).inverse())
    placements = []
    for joint in chain.joints:
        parent = frames.get(joint.parent)
        if joint.child in frames or parent is None:
            continue
        if joint.name in numbers:
            # a rotation from z to the unit vector ``axis``; exact for coordinate axes
            axis = np.array(joint.axis)
            smallest = int(np.argmin(np.abs(axis)))
            x = np.eye(3)[smallest] - axis[smallest] * axis
            x /= np.linalg.norm(x)
            turn = Pose.from_matrix(np.column_stack([x, np.cross(axis, x), axis]))
            placements.append(parent.pose @ joint.origin @ turn)
            frames[joint.child] = Frame(link=numbers[joint.name], pose=turn.inverse())
        elif not joint.misplaced or joint.child in chain.links:
            frames[joint.child] = Frame(link=parent.link, pose=parent.pose @ at_rest(joint))
    return frames, tuple(placements)


def _merge_links(
    robot: RobotDescription, chain: Chain, frames: Mapping[str, Frame], number: int, repair: bool
) -> tuple[Body, list[Fault], list[Fault]]:
    """Return the body of a joint's link and all that is fixed to it, its faults, and notices.

    The inertia of the whole must be possible; those of single links need not be.
    """
    links = [robot.links[name] for name, frame in frames.items() if frame.link == number]
    wrong = {link.name: link.inertia_fault for link in links if link.inertia_fault is not None}

    def merge(others: Mapping[str, Matrix3]) -> Body:
        bodies = [
            Body(mass=link.mass, center=np.zeros(3), inertia=others.get(link.name, link.inertia)) for link in links
        ]
        placed = [
            transform_body(transform_body(body, link.origin), frames[link.name].pose)
            for body, link in zip(bodies, links, strict=True)
        ]
        return reduce(combine_bodies, placed)

    def tell(names: Sequence[str], text: str) -> list[Fault]:
        return [(line, f"{said}; {text.format(moments[name])}") for name in names for line, said in [wrong[name]]]

    body, suspects = merge({}), list(wrong)
    nearest = {name: nearest_inertia(robot.links[name].inertia) for name in wrong}
    moments = {name: "{:.4g}, {:.4g} and {:.4g} kg m²".format(*np.linalg.eigvalsh(nearest[name])) for name in wrong}
    notices: list[Fault] = []
    if wrong and inertia_fault(body.inertia):
        if repair:
            return merge(nearest), [], tell(suspects, "repaired, its principal moments are now {}")
        aside = [name for name in wrong if name not in chain.links]
        body, suspects = merge(dict.fromkeys(aside, np.zeros((3, 3)))), [name for name in wrong if name not in aside]
        notices = tell(aside, "off the chain, taken as a point mass")
    if suspects and inertia_fault(body.inertia):
        hint = "repair_inertias=True (--repair-inertias) sets its principal moments to {}"
        return body, tell(suspects, hint), notices
    return body, [], [*notices, *tell(suspects, "the body that contains it has a possible inertia")]
