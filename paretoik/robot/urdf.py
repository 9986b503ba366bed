"""From a URDF to an arm: validate the whole file, select the chain from base to tip, then build.

Joint frames have their axis along z; fixed links are merged into those that move.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from paretoik.arrays import Matrix3, Vector3
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.inputs import check_choice, check_mapping, file_path, shown
from paretoik.robot.arm import EARTH_GRAVITY, Arm
from paretoik.robot.arm_inputs import JointType
from paretoik.robot.body import Body, combine_bodies, transform_body
from paretoik.robot.fixed_joints import joint_motion
from paretoik.robot.frame import Frame
from paretoik.robot.pose import Pose
from paretoik.robot.urdf_chain import Chain, find_zero_limits, select_chain
from paretoik.robot.urdf_description import OTHER_TYPES, JointDescription, RobotDescription
from paretoik.robot.urdf_faults import group_messages, inertia_faults, list_messages, shorten_list
from paretoik.robot.urdf_reading import read_robot
from paretoik.tables import fit_screen, html_representation


@dataclass(frozen=True, kw_only=True)
class RobotReport:
    """What a URDF holds: its faults, warnings about what loads but may surprise, and a summary in a few lines."""

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
def check_robot(file: str | Path, base: str | None = None, tip: str | None = None) -> RobotReport:
    """Return what a URDF holds, between links ``base`` (default: the root) and ``tip`` (default: the only leaf).

    Never opens a mesh. Raises InvalidInput where there is no such file, or for links that it has not.
    """
    file = file_path("file", file)
    try:
        robot = read_robot(file)
    except InvalidRobot as error:
        return RobotReport(file=file, faults=error.faults, warnings=(), summary=())
    faults, warnings = robot.faults, robot.warnings
    summary = [f"robot {robot.name}: {len(robot.links)} links, {len(robot.joints)} joints"]
    if not faults:
        summary.append(f"root {robot.roots[0]}, leaves {', '.join(robot.leaves)}")
        if tip is None and len(robot.leaves) > 1:
            summary.append(f"several leaves: name one as tip to see its chain{_trunk_text(robot)}")
            faults = list_messages(inertia_faults(robot.links.values()))
        else:
            chain = select_chain(str(file), robot, base, tip, {})
            summary.append(f"chain {chain.base} to {chain.tip}: {len(chain.moving)} moving joints")
            summary += [_summarise(joint) for joint in chain.moving]
            faults, warnings = chain.faults, (*warnings, *chain.notices, *find_zero_limits(chain))
    return RobotReport(file=file, faults=faults, warnings=warnings, summary=tuple(summary))


def from_urdf(
    file: Path,
    *,
    base: str | None,
    tip: str | None,
    fixed: Mapping[str, float] | None,
    zero_limits: Literal["unlimited"] | None = None,
) -> Arm:
    """Return the arm between two links of a URDF; see ``Arm.from_urdf``.

    Raises InvalidRobot listing every fault, InvalidInput for unknown names or zero limits.
    """
    check_choice("zero_limits", zero_limits, (None, "unlimited"))
    if fixed is not None:
        check_mapping("fixed", fixed, "values by joint", example="{'joint1': 0.3}")
    robot = read_robot(file)
    if robot.faults:
        raise InvalidRobot(str(file), robot.faults)
    chain = select_chain(str(file), robot, base, tip, dict(fixed or {}))
    if chain.faults:
        raise InvalidRobot(str(file), chain.faults)
    if zero_limits is None and (zeros := find_zero_limits(chain)):
        raise InvalidInput(f"{file}: {'; '.join(zeros)}")
    return replace(_build_arm(str(file), robot, chain), source=file, source_digest=robot.digest)


def _trunk_text(robot: RobotDescription) -> str:
    """Return which links, from the last moving joint on, all leaves hang from: one may be the tip; "" for none."""
    moving = [joint.child for joint in robot.joints.values() if joint.type not in OTHER_TYPES]
    trunk = robot.trunk
    last = max((row for row, link in enumerate(trunk) if link in moving), default=None)
    return "" if last is None else f", or a link that all of them hang from: {', '.join(trunk[last:])}"


def _summarise(joint: JointDescription) -> str:
    length, force = ("m", "N") if joint.type == "prismatic" else ("rad", "N m")
    limits = f"{joint.lower:g} to {joint.upper:g} {length}" if np.isfinite(joint.upper - joint.lower) else "no end"
    return f"  {joint.name}: {joint.type}, {limits}, {joint.velocity:g} {length}/s, {joint.effort:g} {force}"


def _build_arm(source: str, robot: RobotDescription, chain: Chain) -> Arm:
    """Return the arm of a chain without faults, under gravity (0, 0, −9.81) m/s².

    Raises InvalidRobot, naming ``source``, where offsets or masses are too large to add up.
    """
    moving = chain.moving
    types: tuple[JointType, ...] = tuple(joint.type for joint in moving)  # type: ignore[misc]  # of JOINT_TYPES
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            frames, placements = _place_links(chain)
            bodies = _merge_links(robot, frames, len(moving))
    except InvalidInput as error:  # an offset that is not finite
        raise InvalidRobot(source, [f"the robot: {error}"]) from None
    for joint, body in zip(moving, bodies, strict=True):
        if not np.isfinite([body.mass, *body.center, *body.inertia.flat]).all():
            raise InvalidRobot(
                source, [f"joint {shown(joint.name)}: masses that can be added up wanted, got too large ones"]
            )
    return Arm(
        name=robot.name,
        joint_names=tuple(joint.name for joint in moving),
        joint_types=types,
        placements=placements,
        bodies=bodies,
        tool=frames[chain.tip].pose,
        base=Pose(np.zeros(3)),
        gravity=np.array(EARTH_GRAVITY),
        position_limits=np.array([[joint.lower, joint.upper] for joint in moving]),
        velocity_limits=np.array([joint.velocity or np.inf for joint in moving]),
        torque_limits=np.array([joint.effort or np.inf for joint in moving]),
        frames={link: frames[link] for link in robot.links if link in frames},
        notices=(*robot.warnings, *chain.notices),
    )


def _place_links(chain: Chain) -> tuple[dict[str, Frame], tuple[Pose, ...]]:
    """Return every link's frame on the moving link that carries it, and the placements of the moving joints.

    The frame of a moving link is that of its joint, turned so that z is the joint's axis.
    """
    numbers = {joint.name: number for number, joint in enumerate(chain.moving)}
    frames = {chain.base: Frame(link=-1, pose=Pose(np.zeros(3)))}
    placements: dict[int, Pose] = {}
    for joint in chain.below:
        parent = frames[joint.parent]
        origin = parent.pose @ Pose.from_rpy(joint.xyz, joint.rpy)
        if joint.name in numbers:
            turn = _rotation_of_z(np.array(joint.axis))
            placements[numbers[joint.name]] = origin @ turn
            frames[joint.child] = Frame(link=numbers[joint.name], pose=turn.inverse())
        else:
            frozen = joint_motion(joint.type, chain.frozen.get(joint.name, 0.0), joint.axis)
            frames[joint.child] = Frame(link=parent.link, pose=origin @ frozen)
    return frames, tuple(placements[number] for number in range(len(placements)))


def _merge_links(robot: RobotDescription, frames: dict[str, Frame], count: int) -> tuple[Body, ...]:
    """Return the body of each moving link with all links that are fixed to it; those of the base are left out."""
    bodies: list[Body | None] = [None] * count
    for name, frame in frames.items():
        if frame.link >= 0:
            link = robot.links[name]
            inertial = Body(mass=link.mass, center=np.zeros(3), inertia=link.inertia)
            body = transform_body(transform_body(inertial, Pose.from_rpy(link.xyz, link.rpy)), frame.pose)
            before = bodies[frame.link]
            bodies[frame.link] = body if before is None else combine_bodies(before, body)
    return tuple(body for body in bodies if body is not None)


def _rotation_of_z(axis: Vector3) -> Pose:
    """Return a rotation that takes z to ``axis``, of length 1; exact where that is a coordinate axis."""
    smallest = int(np.argmin(np.abs(axis)))
    x = np.eye(3)[smallest] - axis[smallest] * axis
    x /= np.linalg.norm(x)
    rotation: Matrix3 = np.column_stack([x, np.cross(axis, x), axis])
    return Pose.from_matrix(rotation)
