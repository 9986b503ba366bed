"""The arm of a URDF's chain: joint frames with their axis along z, and fixed links merged into those that move."""

from __future__ import annotations

import numpy as np

from paretoik.arrays import Matrix3, Vector3
from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.robot.arm import EARTH_GRAVITY, Arm, Frame, JointType
from paretoik.robot.body import Body, combine_bodies, transform_body
from paretoik.robot.pose import Pose
from paretoik.robot.urdf_chain import Chain
from paretoik.robot.urdf_description import JointDescription, LinkDescription, RobotDescription


def build_arm(source: str, robot: RobotDescription, chain: Chain) -> Arm:
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
        raise InvalidRobot(source, [f"the robot is too large, {error}"]) from None
    for joint, body in zip(moving, bodies, strict=True):
        if not np.isfinite([body.mass, *body.center, *body.inertia.flat]).all():
            raise InvalidRobot(source, [f"joint {joint.name!r}: the masses that it moves are too large to add up"])
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
            frozen = _frozen_motion(joint, chain.frozen.get(joint.name, 0.0))
            frames[joint.child] = Frame(link=parent.link, pose=origin @ frozen)
    return frames, tuple(placements[number] for number in range(len(placements)))


def _merge_links(robot: RobotDescription, frames: dict[str, Frame], count: int) -> tuple[Body, ...]:
    """Return the body of each moving link with all links that are fixed to it; those of the base are left out."""
    bodies: list[Body | None] = [None] * count
    for name, frame in frames.items():
        if frame.link >= 0:
            body = transform_body(_body(robot.links[name]), frame.pose)
            before = bodies[frame.link]
            bodies[frame.link] = body if before is None else combine_bodies(before, body)
    return tuple(body for body in bodies if body is not None)


def _body(link: LinkDescription) -> Body:
    """Return a link's body in its own frame."""
    inertial = Body(mass=link.mass, center=np.zeros(3), inertia=link.inertia)
    return transform_body(inertial, Pose.from_rpy(link.xyz, link.rpy))


def _frozen_motion(joint: JointDescription, value: float) -> Pose:
    """Return the pose that a joint adds to its origin at a value [rad, m]; none for fixed, planar and floating ones."""
    axis = np.array(joint.axis)
    if joint.type == "prismatic":
        return Pose(value * axis)
    if joint.type in ("revolute", "continuous"):
        return Pose(np.zeros(3), np.concatenate([[np.cos(value / 2)], np.sin(value / 2) * axis]))
    return Pose(np.zeros(3))


def _rotation_of_z(axis: Vector3) -> Pose:
    """Return a rotation that takes z to ``axis``, of length 1; exact where that is a coordinate axis."""
    smallest = int(np.argmin(np.abs(axis)))
    x = np.eye(3)[smallest] - axis[smallest] * axis
    x /= np.linalg.norm(x)
    rotation: Matrix3 = np.column_stack([x, np.cross(axis, x), axis])
    return Pose.from_matrix(rotation)
