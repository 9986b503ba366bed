"""The arm: a serial chain of revolute, continuous and prismatic joints, as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Literal

import numpy as np

from paretoik.arrays import Jacobians, Matrix3
from paretoik.errors import InvalidInput
from paretoik.inputs import (
    ArrayLike,
    check_choice,
    check_instance,
    check_mapping,
    check_text,
    file_path,
    finite_array,
)
from paretoik.robot.arm_arguments import (
    TOOL_FRAME,
    JointType,
    body_tuple,
    joint_positions,
    joint_tuple,
    limit_rows,
    number_array,
    planar_bodies,
    symmetric_limits,
    type_tuple,
)
from paretoik.robot.body import Body, combine_bodies, transform_body
from paretoik.robot.chain import SerialChain, fix_joint
from paretoik.robot.kinematics import forward_kinematics
from paretoik.robot.kinematics import jacobian as geometric_jacobian
from paretoik.robot.pose import Pose, check_pose, matrix_to_quaternion, pose_batch
from paretoik.robot.urdf import read_chain
from paretoik.tables import fit_screen, html_representation


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Arm(SerialChain):
    """A serial arm, frozen; make one with ``planar``, ``from_dh`` or ``from_urdf``.

    Joint i moves link i about (or along) the z axis of its own frame. A missing limit is infinite.

    joint_types: "revolute", "continuous" or "prismatic", one per joint
    placements: pose of each joint's frame in the previous one at q = 0 (in the base for the first)
    bodies: mass, centre and inertia of each link
    tool: pose of the tool in the last link
    base: pose of the base in the world
    gravity: acceleration (3,) [m/s²], in world axes
    position_limits: rows (lower, upper) [rad, m]
    velocity_limits, torque_limits: symmetric limits (dof,) [rad/s, m/s; N m, N]
    acceleration_limits, jerk_limits: symmetric limits (dof,), only from a URDF of version 1.2
    is_planar: whether the arm moves in the x-y plane of its base
    frames: named frames on the arm
    source, source_digest: URDF that the arm comes from, and the SHA-256 of that file
    notices: parts of the URDF that the arm lacks, such as frozen joints
    geometry: convex bodies of all links, None unless it is read from a URDF with ``collision=True``

    Every constructor, and every method that returns an arm, raises InvalidInput for impossible values.
    """

    def __repr__(self) -> str:
        return fit_screen(f"Arm({self.name!r}, {self.dof} joints: {', '.join(self.joint_names)})")

    _repr_html_ = html_representation

    @classmethod
    def planar(
        cls,
        *,
        lengths: ArrayLike,
        masses: ArrayLike | None = None,
        centers: ArrayLike | None = None,
        inertias: ArrayLike | None = None,
        position_limits: object = None,
        velocity_limits: object = None,
        torque_limits: object = None,
        name: str = "planar arm",
    ) -> Arm:
        """Return an arm of revolute joints in the x-y plane, without gravity.

        lengths: length of each link [m]
        masses: mass of each link [kg]; None for massless links (kinematics only)
        centers: distance of each centre of gravity from the proximal joint [m]
        inertias: inertia of each link about z through its centre [kg m²]
        position_limits, velocity_limits, torque_limits: limits as in ``from_dh``
        name: name of the arm

        Joint angles are relative: Tringali & Cocuzza 2020, section 3.2. Raises InvalidInput if a length is not
        positive or the lists differ in length.

        >>> Arm.planar(lengths=[1.0, 1.0, 1.0]).dof
        3
        """
        check_text("name", name)
        length = number_array("lengths", lengths, None, positive=True)
        count = len(length)
        return cls(
            name=name,
            joint_names=tuple(f"joint{i + 1}" for i in range(count)),
            joint_types=type_tuple(None, count),
            placements=tuple(Pose(np.array([x, 0.0, 0.0])) for x in (0.0, *length[:-1])),
            bodies=planar_bodies(masses, centers, inertias, count),
            tool=Pose(np.array([length[-1], 0.0, 0.0])),
            gravity=np.zeros(3),
            position_limits=limit_rows("position_limits", position_limits, count),
            velocity_limits=symmetric_limits("velocity_limits", velocity_limits, count),
            torque_limits=symmetric_limits("torque_limits", torque_limits, count),
            is_planar=True,
        )

    @classmethod
    def from_dh(
        cls,
        *,
        a: ArrayLike,
        alpha: ArrayLike,
        d: ArrayLike,
        theta: ArrayLike,
        convention: Literal["modified", "standard"],
        types: Sequence[JointType] | None = None,
        masses: ArrayLike | None = None,
        centers: object = None,
        inertias: object = None,
        joint_names: Sequence[str] | None = None,
        position_limits: object = None,
        velocity_limits: object = None,
        torque_limits: object = None,
        name: str = "DH arm",
    ) -> Arm:
        """Return an arm from Denavit–Hartenberg parameters, one value per joint.

        a, d: lengths (dof,) [m]; ``d`` of a prismatic joint is the offset of its position
        alpha, theta: angles (dof,) [rad]; ``theta`` of a rotational joint is the offset of its position
        convention: "modified" (Craig: row i has a and alpha of link i − 1, link frames are on their own joint) or
            "standard" (link frames are on the next joint, the last one is the tool)
        types: joint types, None for revolute
        joint_names, name: names of the joints (joint1, joint2, ... by default) and of the arm
        masses: mass of each link [kg]
        centers: centres of gravity (dof, 3) [m], in the link frames of the convention
        inertias: inertias (dof, 3, 3) about those centres [kg m²], in the same frames
        position_limits: None for no limits, a tuple (lower, upper), or a symmetric number or array
        velocity_limits, torque_limits: symmetric numbers or arrays (dof,), None for no limits

        Gravity is (0, 0, −9.81). Raises InvalidInput if the table is not rectangular or an entry is not finite.
        """
        check_choice("convention", convention, ("modified", "standard"))
        check_text("name", name)
        table = {k: number_array(k, v, None) for k, v in (("a", a), ("alpha", alpha), ("d", d), ("theta", theta))}
        counts = [len(values) for values in table.values()]
        count = counts[0]
        if counts != [count] * 4:
            found = ", ".join(map(str, counts))
            raise InvalidInput(f"a, alpha, d and theta must have one value per joint, got {found} values")
        kinds = type_tuple(types, count)
        bodies = body_tuple(masses, centers, inertias, count)
        placements, link_frames, tool = _joint_placements(**table, convention=convention)
        if convention == "standard":
            bodies = tuple(transform_body(body, frame) for body, frame in zip(bodies, link_frames, strict=True))
        names = tuple(f"joint{i + 1}" for i in range(count)) if joint_names is None else joint_tuple(joint_names, count)
        return cls(
            name=name,
            joint_names=names,
            joint_types=kinds,
            placements=placements,
            bodies=bodies,
            tool=tool,
            position_limits=limit_rows("position_limits", position_limits, count),
            velocity_limits=symmetric_limits("velocity_limits", velocity_limits, count),
            torque_limits=symmetric_limits("torque_limits", torque_limits, count),
        )

    @classmethod
    def from_urdf(
        cls,
        file: str | Path,
        *,
        base: str | None = None,
        tip: str | None = None,
        fixed: Mapping[str, float] | None = None,
        zero_limits: Literal["unlimited"] | None = None,
        soft: bool = False,
        repair_inertias: bool = False,
        collision: bool = False,
        packages: Mapping[str, str | Path] | None = None,
    ) -> Arm:
        """Return the arm between two links of a URDF.

        file: path of the URDF; its meshes are opened only with ``collision=True``
        base: first link of the chain, None for the root
        tip: last link of the chain, None for the only leaf below the base
        fixed: values [rad, m] of joints that are frozen, by name; joints off the chain are frozen at 0
        zero_limits: "unlimited" to ignore limits of 0 on velocity, effort, acceleration or jerk
        soft: True to narrow position limits to those of the file's safety controllers
        repair_inertias: True to replace an impossible inertia by the nearest one of a real body (see ``notices``)
        collision: True to read the collision shapes of all links into ``geometry``; meshes become convex hulls
        packages: folders by package, for meshes named ``package://NAME/...``

        Meshes in other folders than the URDF's and those of ``packages`` are never opened. The whole robot counts, the
        links off the chain at the values of their frozen joints.

        Positions and poses are given in the base link; gravity points down in the world of the file's root. Links are
        merged with the bodies that are fixed to them, and joints that mimic a frozen one are frozen too. The file is
        validated first: ``check_robot`` with the same arguments lists its faults.

        Raises InvalidRobot listing every fault, InvalidInput for unknown names or zero limits.
        """
        chain = read_chain(
            file_path("file", file),
            base=base,
            tip=tip,
            fixed=fixed,
            zero_limits=zero_limits,
            soft=soft,
            repair_inertias=repair_inertias,
            collision=collision,
            packages=packages,
        )
        return cls(**{each.name: getattr(chain, each.name) for each in fields(chain)})

    def with_tool(
        self, pose: Pose, *, mass: float = 0.0, center: object = (0.0, 0.0, 0.0), inertia: object = None
    ) -> Arm:
        """Return the arm with a tool on its present tool frame.

        pose: pose of the new working point in the present tool frame
        mass: mass of the tool [kg]
        center: centre of gravity (3,) [m] in the present tool frame
        inertia: inertia (3, 3) [kg m²] about that centre, None for a point mass
        """
        check_pose("pose", pose)
        return replace(self.with_payload(mass, center=center, inertia=inertia), tool=self.tool @ pose)

    def with_payload(self, mass: float, *, center: object = (0.0, 0.0, 0.0), inertia: object = None) -> Arm:
        """Return the arm carrying a body in the tool frame.

        mass: mass of the body [kg]
        center: centre of gravity (3,) [m] in the tool frame
        inertia: inertia (3, 3) [kg m²] about that centre, None for a point mass
        """
        payload = Body.from_values("payload", mass, center, inertia)
        last = combine_bodies(self.bodies[-1], transform_body(payload, self.tool))
        return replace(self, bodies=(*self.bodies[:-1], last))

    def mounted(self, *, base: Pose | None = None, gravity: object = None) -> Arm:
        """Return the arm mounted elsewhere in the world.

        base: pose of the base in the world, None for the present one
        gravity: acceleration (3,) [m/s²] in world axes, None for the present one
        """
        vector = self.gravity.copy() if gravity is None else finite_array("gravity", gravity, (3,))
        if base is not None:
            check_pose("base", base)
        return replace(self, base=self.base if base is None else base, gravity=vector)

    def fixed(self, positions: Mapping[str, float] | None = None, /, **joints: float) -> Arm:
        """Return the arm with joints frozen at values [rad or m], by name.

        Example: ``arm.fixed(joint2=0.3)``.

        positions: values by joint name; ``joints`` are the same as keywords

        Raises InvalidInput for an unknown joint, a value that is not finite, or the last moving joint.
        """
        arm = self
        if positions is not None:
            check_mapping("fixed", positions, "values by joint", example="{'joint1': 0.3}")
        for joint, value in {**(positions or {}), **joints}.items():
            arm = fix_joint(arm, joint, value)
        return arm

    def pose(self, q: ArrayLike, *, frame: str = TOOL_FRAME) -> Pose:
        """Return the pose of a frame in the world, or a batch of poses.

        q: joint positions (*batch, dof) [rad, m]
        frame: name of a link or joint, or "tool" or "base"

        Functions that take a pose take this one: ``pk.line(arm.pose(q), ...)``. Raises InvalidInput for a wrong number
        of joints, a value that is not finite, or an unknown frame.
        """
        rotation, position = forward_kinematics(self, joint_positions(q, self.dof), frame)
        return pose_batch(position, matrix_to_quaternion(rotation))

    def jacobian(self, q: ArrayLike, *, frame: str = TOOL_FRAME) -> Jacobians:
        """Return the geometric Jacobian (*batch, 6, dof) of a frame.

        q: joint positions (*batch, dof) [rad, m]
        frame: name of a link or joint, or "tool" or "base"

        J q̇ is the linear velocity of the frame's origin [m/s], then its angular velocity [rad/s], in world axes; a
        planar arm moves in rows 0, 1 and 5. Raises as ``pose`` does. Siciliano et al., section 3.1.
        """
        return geometric_jacobian(self, joint_positions(q, self.dof), frame)


def check_arm(name: str, arm: object) -> None:
    """Raise InvalidInput, with ``name``, unless ``arm`` is an Arm."""
    check_instance(name, arm, Arm, "an Arm", example="pk.arms.tringali_3r() or Arm.from_urdf(...)")


# Joint frames from Denavit–Hartenberg parameters, in both conventions.


def _joint_placements(
    *, a: np.ndarray, alpha: np.ndarray, d: np.ndarray, theta: np.ndarray, convention: Literal["modified", "standard"]
) -> tuple[tuple[Pose, ...], tuple[Pose, ...], Pose]:
    """Return the placements of joints, of link frames, and of the tool.

    A joint's placement is relative to the previous joint, a link frame's to its joint, the tool's to the last joint.

    a, d: lengths [m], one per joint
    alpha, theta: angles [rad], one per joint
    convention: convention of the parameters and link frames

    A joint's frame has the joint's axis along z in both conventions. The joint moves along or about z, so that its
    offsets d and theta commute with its motion. Source: Craig, Introduction to Robotics, chapter 3 (modified);
    Siciliano et al., chapter 2 (standard).
    """
    count, origin = len(a), Pose(np.zeros(3))
    along_z = [_transform(0.0, 0.0, d[i], theta[i]) for i in range(count)]
    along_x = [_transform(a[i], alpha[i], 0.0, 0.0) for i in range(count)]
    if convention == "modified":
        return tuple(x @ z for x, z in zip(along_x, along_z, strict=True)), (origin,) * count, origin
    previous = [origin, *along_x[:-1]]
    return tuple(x @ z for x, z in zip(previous, along_z, strict=True)), tuple(along_x), along_x[-1]


def _transform(a: float, alpha: float, d: float, theta: float) -> Pose:
    """Return a translation by a and rotation by alpha about x, then d and theta along and about z."""
    rotation: Matrix3 = np.array(
        [
            [np.cos(theta), -np.sin(theta), 0.0],
            [np.cos(alpha) * np.sin(theta), np.cos(alpha) * np.cos(theta), -np.sin(alpha)],
            [np.sin(alpha) * np.sin(theta), np.sin(alpha) * np.cos(theta), np.cos(alpha)],
        ]
    )
    return Pose.from_matrix(rotation, np.array([a, -np.sin(alpha) * d, np.cos(alpha) * d]))
