"""From a URDF to an arm: validate the whole file, select the chain from base to tip, then build.

Joint frames have their axis along z; fixed links are merged into those that move.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path
from typing import Literal

import numpy as np

from paretoik.arrays import Matrix3, Vector3
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.inputs import check_choice, check_flag, check_mapping, check_text, file_path, shown
from paretoik.robot.arm import EARTH_GRAVITY, Arm
from paretoik.robot.arm_inputs import JointType
from paretoik.robot.body import Body, combine_bodies, inertia_fault, nearest_inertia, transform_body
from paretoik.robot.fixed_joints import joint_motion
from paretoik.robot.frame import Frame
from paretoik.robot.pose import Pose
from paretoik.robot.urdf_chain import Chain, find_zero_limits, select_chain
from paretoik.robot.urdf_description import ORIGIN, Fault, JointDescription, RobotDescription
from paretoik.robot.urdf_faults import group_messages, list_messages, shorten_list
from paretoik.robot.urdf_reading import read_robot
from paretoik.tables import fit_screen, html_representation

TILT_TOLERANCE = 1e-9  # m/s² of gravity: what rounding makes of a base that is level


@dataclass(frozen=True, kw_only=True)
class RobotReport:
    """Faults of a URDF, warnings about what loads but may surprise, and a summary in a few lines."""

    file: Path
    faults: tuple[str, ...]
    warnings: tuple[str, ...]
    summary: tuple[str, ...]

    def __repr__(self) -> str:
        return fit_screen(report_text(self))

    _repr_html_ = html_representation


def report_text(report: RobotReport) -> str:
    """Return the summary of a URDF, then warnings, those alike as one, and faults, each a line; the first of many."""
    lines = [*report.summary, *(f"warning: {line}" for line in shorten_list(group_messages(report.warnings)))]
    lines += [f"fault: {line}" for line in shorten_list(report.faults)] or ["no faults"]
    return "\n".join(lines)


@check_call
def check_robot(
    file: str | Path,
    base: str | None = None,
    tip: str | None = None,
    *,
    fixed: Mapping[str, float] | None = None,
    soft: bool = False,
    repair_inertias: bool = False,
) -> RobotReport:
    """Return what ``Arm.from_urdf`` makes of a URDF with the same arguments, and every fault that it would refuse.

    If ``tip`` is not given and the base carries several leaves, faults are those that every tip has. Never opens a
    mesh. Raises InvalidInput for a missing file, and for links and joints that it has not.
    """
    file = file_path("file", file)
    fixed = _check_options(fixed, soft, repair_inertias)
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
        summary.append(f"several leaves: name one as tip to see its chain{_trunk_text(chain)}")
        faults = _build_arm(robot, chain, repair_inertias)[1] if chain.moving else list_messages(chain.faults)
        every = list_messages(robot.part_faults)
        others = [each for each in every if not any(fault.startswith(each) for fault in faults)]
        notices = tuple(f"{each}; it matters on a chain that it is on" for each in others)
    else:
        chain = select_chain(str(file), robot, base, tip, fixed, soft=soft)
        summary.append(f"chain {chain.base} to {chain.tip}: {len(chain.moving)} moving joints")
        summary += [_summarise(joint) for joint in chain.moving]
        _, faults, notices = _build_arm(robot, chain, repair_inertias)
    warnings = (*robot.warnings, *notices, *find_zero_limits(chain))
    return RobotReport(file=file, faults=faults, warnings=warnings, summary=tuple(summary))


def from_urdf(
    file: Path,
    *,
    base: str | None,
    tip: str | None,
    fixed: Mapping[str, float] | None,
    zero_limits: Literal["unlimited"] | None = None,
    soft: bool = False,
    repair_inertias: bool = False,
) -> Arm:
    """Return the arm between two links of a URDF; see ``Arm.from_urdf``.

    Raises InvalidRobot listing every fault, InvalidInput for unknown names or zero limits.
    """
    check_choice("zero_limits", zero_limits, (None, "unlimited"))
    fixed = _check_options(fixed, soft, repair_inertias)
    robot = read_robot(file)
    if robot.faults:
        raise InvalidRobot(str(file), robot.faults)
    chain = select_chain(str(file), robot, base, tip, fixed, soft=soft)
    arm, faults, notices = _build_arm(robot, chain, repair_inertias)
    if arm is None:
        raise InvalidRobot(str(file), faults)
    if zero_limits is None and (zeros := find_zero_limits(chain)):
        raise InvalidInput(f"{file}: {'; '.join(zeros)}")
    return replace(arm, source=file, source_digest=robot.digest, notices=(*robot.warnings, *notices))


def _check_options(fixed: Mapping[str, float] | None, soft: bool, repair_inertias: bool) -> dict[str, float]:
    if fixed is not None:
        check_mapping("fixed", fixed, "values by joint", example="{'joint1': 0.3}")
    check_flag("soft", soft)
    check_flag("repair_inertias", repair_inertias)
    return dict(fixed or {})


def _trunk_text(chain: Chain) -> str:
    """Return which links, from the last moving joint on, carry all leaves: one may be the tip; "" if there are none."""
    moved = [joint.child for joint in chain.moving]
    last = max((row for row, link in enumerate(chain.links) if link in moved), default=None)
    return "" if last is None else f", or a link that all of them hang from: {', '.join(chain.links[last:])}"


def _summarise(joint: JointDescription) -> str:
    length, force = ("m", "N") if joint.type == "prismatic" else ("rad", "N m")
    limits = joint.limits
    positions = f"{limits.lower:g} to {limits.upper:g} {length}"
    parts = [positions if np.isfinite(limits.upper - limits.lower) else "no end"]
    parts += [f"{limits.velocity:g} {length}/s", f"{limits.effort:g} {force}"]
    parts += [f"{limits.acceleration:g} {length}/s²"] * bool(np.isfinite(limits.acceleration))
    return f"  {joint.name}: {joint.type}, {', '.join(parts)}"


def _build_arm(
    robot: RobotDescription, chain: Chain, repair: bool
) -> tuple[Arm | None, tuple[str, ...], tuple[str, ...]]:
    """Return the arm of a chain, None if there are faults; these faults; and notices of what the arm has not.

    Gravity is (0, 0, −9.81) m/s² in the world of the file's root.
    """
    moving, faults, notices = chain.moving, list(chain.faults), list(chain.notices)
    if not moving:
        faults.append((1, f"a joint that moves wanted between {chain.base!r} and {chain.tip!r}, got none"))
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
            wish = "masses that can be added up wanted, got too large ones"
            faults.append((joint.line, f"joint {shown(joint.name)}: {wish}"))
        elif body.mass == 0.0:
            use = "" if joint is moving[-1] else ", though other joints follow it: no torques and energies of this arm"
            notices.append(f"joint {joint.name!r}: moves no mass{use}")
    if faults:
        return None, list_messages(faults), tuple(notices)
    gravity = frames[robot.roots[0]].pose.rotation @ np.array(EARTH_GRAVITY)
    if np.abs(gravity - EARTH_GRAVITY).max() > TILT_TOLERANCE:
        axes = ", ".join(f"{value:.4g}" for value in gravity)
        text = f"gravity is ({axes}) m/s² in its axes; mounted(base=...) keeps that unless it gets gravity, too"
        notices.append(f"base {chain.base!r} is tilted against the root {robot.roots[0]!r}: {text}")
    limits = [joint.limits for joint in moving]
    types: tuple[JointType, ...] = tuple(joint.type for joint in moving)  # type: ignore[misc]  # of JOINT_TYPES
    arm = Arm(
        name=robot.name,
        joint_names=tuple(joint.name for joint in moving),
        joint_types=types,
        placements=placements,
        bodies=tuple(body for body, _, _ in merged),
        tool=frames[chain.tip].pose,
        base=ORIGIN,
        gravity=gravity,
        position_limits=np.array([[each.lower, each.upper] for each in limits]),
        velocity_limits=np.array([each.velocity or np.inf for each in limits]),
        torque_limits=np.array([each.effort or np.inf for each in limits]),
        acceleration_limits=np.array([each.acceleration or np.inf for each in limits]),
        jerk_limits=np.array([each.jerk or np.inf for each in limits]),
        frames={
            **{joint.name: frames[joint.child] for joint in moving},  # the frame of a joint is that of its child
            **{link: frames[link] for link in robot.links if link in frames},
        },
        notices=tuple(notices),
    )
    return arm, (), tuple(notices)


def _place_links(chain: Chain) -> tuple[dict[str, Frame], tuple[Pose, ...]]:
    """Return every link's frame on the moving link that carries it, and the placements of the moving joints.

    The frame of a moving link is that of its joint, turned so that z is the joint's axis. Links that a misplaced joint
    carries have none.
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
            turn = _rotation_of_z(np.array(joint.axis))
            placements.append(parent.pose @ joint.origin @ turn)
            frames[joint.child] = Frame(link=numbers[joint.name], pose=turn.inverse())
        elif not joint.misplaced or joint.child in chain.links:
            frames[joint.child] = Frame(link=parent.link, pose=parent.pose @ at_rest(joint))
    return frames, tuple(placements)


def _merge_links(
    robot: RobotDescription, chain: Chain, frames: Mapping[str, Frame], number: int, repair: bool
) -> tuple[Body, list[Fault], list[Fault]]:
    """Return the body that a moving joint moves, its link with all that is fixed to it; its faults; and notices.

    The inertia of this body must be that of a real one, whatever those of its links are.
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
        return body, tell(suspects, "repair_inertias=True (--repair-inertias) makes its principal moments {}"), notices
    return body, [], [*notices, *tell(suspects, "the body that it is a part of has a real one")]


def _rotation_of_z(axis: Vector3) -> Pose:
    """Return a rotation that takes z to ``axis``, of length 1; exact if that is a coordinate axis."""
    smallest = int(np.argmin(np.abs(axis)))
    x = np.eye(3)[smallest] - axis[smallest] * axis
    x /= np.linalg.norm(x)
    rotation: Matrix3 = np.column_stack([x, np.cross(axis, x), axis])
    return Pose.from_matrix(rotation)
