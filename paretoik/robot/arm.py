"""The arm: a serial chain of revolute, continuous and prismatic joints, as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Jacobians, Vector3, read_only
from paretoik.errors import InvalidInput
from paretoik.inputs import (
    ArrayLike,
    check_call,
    check_choice,
    check_instance,
    check_mapping,
    check_text,
    file_path,
    finite_array,
    finite_number,
    likely_spelling,
    shown,
)
from paretoik.robot.body import (
    BASE_FRAME,
    OTHER_NAMES,
    TOOL_FRAME,
    Body,
    JointType,
    body_tuple,
    check_joints,
    combine_bodies,
    joint_positions,
    joint_tuple,
    limit_rows,
    number_array,
    planar_bodies,
    symmetric_limits,
    transform_body,
    type_tuple,
)
from paretoik.robot.denavit_hartenberg import joint_placements
from paretoik.robot.pose import Frame, Pose, check_pose, matrix_to_quaternion, pose_batch
from paretoik.tables import fit_screen, html_representation

EARTH_GRAVITY = (0.0, 0.0, -9.81)  # m/s²


@check_call
@dataclass(frozen=True, kw_only=True, eq=False)
class Arm:
    """A serial arm, frozen; make one with ``planar``, ``from_dh`` or ``from_urdf``.

    Joint i moves link i about (or along) the z axis of its own frame; ``placements[i]`` is that frame in the previous
    one (the base for the first) at q = 0. Units are SI and radians. Limits are (lower, upper) rows, infinite where
    there is none; limits of acceleration and jerk come from a URDF of version 1.2. ``source`` is the URDF it comes
    from, ``source_digest`` that file's SHA-256, ``notices`` say what it had that the arm has not, such as frozen
    joints. Every constructor and every method that returns an arm raises
    InvalidInput for values that no arm can have.
    """

    name: str
    joint_names: tuple[str, ...]
    joint_types: tuple[JointType, ...]
    placements: tuple[Pose, ...]
    bodies: tuple[Body, ...]
    tool: Pose
    base: Pose
    gravity: Vector3
    position_limits: Float[np.ndarray, "dof 2"]
    velocity_limits: Float[np.ndarray, " dof"]
    torque_limits: Float[np.ndarray, " dof"]
    acceleration_limits: Float[np.ndarray, " dof"] | None = None
    jerk_limits: Float[np.ndarray, " dof"] | None = None
    is_planar: bool = False
    frames: Mapping[str, Frame] = field(default_factory=dict)
    source: Path | None = None
    source_digest: str | None = None
    notices: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check names, types and limits; make the arrays read-only."""
        check_joints(self.name, self.joint_names, self.joint_types, self.position_limits)
        limits = self.position_limits, self.velocity_limits, self.torque_limits
        for array in (self.gravity, *limits, self.acceleration_limits, self.jerk_limits):
            if array is not None:
                array.setflags(write=False)

    @property
    def dof(self) -> int:
        """Number of joints that move."""
        return len(self.joint_names)

    @cached_property
    def periodic(self) -> np.ndarray:
        """Whether each joint is rotational, its angle equivalent modulo 2π; shape (dof,), read-only."""
        return read_only(np.array([joint_type != "prismatic" for joint_type in self.joint_types]))

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
        """Return an arm of revolute joints in the x-y plane, angles relative, without gravity.

        ``lengths`` [m], ``masses`` [kg], ``centers`` of gravity from the proximal joint [m] and barycentric
        ``inertias`` about z [kg m²] have one value a link; without masses the links are massless (kinematics only).
        Limits as in ``from_dh``. Source of the convention: Tringali & Cocuzza 2020, section 3.2.

        Raises InvalidInput where a length is not positive or the lists differ in length.

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
            base=Pose(np.zeros(3)),
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
        """Return an arm from a table of Denavit–Hartenberg parameters, one value a joint.

        ``a``, ``d`` in m, ``alpha``, ``theta`` in rad; ``theta`` (``d`` for a prismatic joint) is the offset that the
        joint coordinate is added to. "modified" (Craig): row i holds a and alpha of link i − 1, and link frames sit on
        their own joint. "standard": link frames sit on the next joint; the last one is the tool. ``centers`` (dof, 3)
        and barycentric ``inertias`` (dof, 3, 3) are given in the link frames of the convention. ``position_limits``:
        None, or as (lower, upper), or a symmetric number or array. Gravity is (0, 0, −9.81).

        Raises InvalidInput where the table is not rectangular, or an entry is not finite.
        """
        check_choice("convention", convention, ("modified", "standard"))
        check_text("name", name)
        count = len(number_array("a", a, None))
        table = {k: number_array(k, v, count) for k, v in (("a", a), ("alpha", alpha), ("d", d), ("theta", theta))}
        kinds = type_tuple(types, count)
        bodies = body_tuple(masses, centers, inertias, count)
        placements, link_frames, tool = joint_placements(**table, convention=convention)
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
            base=Pose(np.zeros(3)),
            gravity=np.array(EARTH_GRAVITY),
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
    ) -> Arm:
        """Return the chain from link ``base`` (default: the root) to ``tip`` (default: the only leaf below) of a URDF.

        Positions and poses are those in the base link; gravity points down in the world of the file's root. Links are
        merged with what is fixed to them; joints off the chain are frozen at 0, those named in ``fixed`` at given
        values, and joints that mimic a frozen one where it puts them. The file is validated first: ``check_robot`` with
        the same arguments lists its faults. Its meshes are never opened.

        ``zero_limits``: "unlimited" takes limits of 0 on velocity, effort, acceleration or jerk as none.
        ``soft``: True narrows position limits to those of the file's safety controllers.
        ``repair_inertias``: True puts the nearest inertia of a real body in the place of an impossible one, and says so
        in ``notices``.

        Raises InvalidRobot listing every fault, InvalidInput for unknown names or zero limits.
        """
        from paretoik.robot.urdf import from_urdf  # here, because reading a URDF builds on this class

        return from_urdf(
            file_path("file", file),
            base=base,
            tip=tip,
            fixed=fixed,
            zero_limits=zero_limits,
            soft=soft,
            repair_inertias=repair_inertias,
        )

    def with_tool(
        self, pose: Pose, *, mass: float = 0.0, center: object = (0.0, 0.0, 0.0), inertia: object = None
    ) -> Arm:
        """Return the arm with a tool whose working point is ``pose`` in the present tool frame.

        ``mass`` [kg], ``center`` (3,) [m] and barycentric ``inertia`` (3, 3) [kg m²] are given in the present tool
        frame.
        """
        check_pose("pose", pose)
        return replace(self.with_payload(mass, center=center, inertia=inertia), tool=self.tool @ pose)

    def with_payload(self, mass: float, *, center: object = (0.0, 0.0, 0.0), inertia: object = None) -> Arm:
        """Return the arm carrying a body in the tool frame.

        ``mass`` [kg], ``center`` (3,) [m], barycentric ``inertia`` (3, 3) [kg m²], None for a point mass.
        """
        payload = Body.from_values("payload", mass, center, inertia)
        last = combine_bodies(self.bodies[-1], transform_body(payload, self.tool))
        return replace(self, bodies=(*self.bodies[:-1], last))

    def mounted(self, *, base: Pose | None = None, gravity: object = None) -> Arm:
        """Return the arm mounted at ``base`` in the world, under ``gravity`` (3,) [m/s²], both given in world axes.

        None keeps the present one, gravity with its components in world axes.
        """
        vector = self.gravity.copy() if gravity is None else finite_array("gravity", gravity, (3,))
        if base is not None:
            check_pose("base", base)
        return replace(self, base=self.base if base is None else base, gravity=vector)

    def fixed(self, positions: Mapping[str, float] | None = None, /, **joints: float) -> Arm:
        """Return the arm with joints frozen at values [rad or m], by name: ``arm.fixed(joint2=0.3)``.

        Raises InvalidInput for an unknown joint, a value that is not finite, or for the last moving joint.
        """
        arm = self
        if positions is not None:
            check_mapping("fixed", positions, "values by joint", example="{'joint1': 0.3}")
        for joint, value in {**(positions or {}), **joints}.items():
            arm = fix_joint(arm, joint, value)
        return arm

    def pose(self, q: ArrayLike, *, frame: str = TOOL_FRAME) -> Pose:
        """Return the pose of a frame in the world at joint positions q (*batch, dof) [rad, m], or a batch of poses.

        One pose goes wherever one is wanted: ``pk.line(arm.pose(q), ...)``. Raises InvalidInput for a wrong number of
        joints, a value that is not finite, or an unknown frame.
        """
        from paretoik.robot.kinematics import forward_kinematics  # here, because it builds on this class

        rotation, position = forward_kinematics(self, joint_positions(q, self.dof), frame)
        return pose_batch(position, matrix_to_quaternion(rotation))

    def jacobian(self, q: ArrayLike, *, frame: str = TOOL_FRAME) -> Jacobians:
        """Return the geometric Jacobian (*batch, 6, dof) of a frame at joint positions q (*batch, dof) [rad, m].

        J q̇ is the linear velocity of the frame's origin [m/s], then its angular velocity [rad/s], in world axes; a
        planar arm moves in rows 0, 1 and 5. Raises as ``pose`` does. Siciliano et al., section 3.1.
        """
        from paretoik.robot.kinematics import jacobian  # here, because it builds on this class

        return jacobian(self, joint_positions(q, self.dof), frame)

    def frame(self, name: str) -> Frame:
        """Return the frame called ``name``: a link of the URDF, or a joint, which stands for the link that it moves.

        ``"tool"`` and ``"base"`` are the arm's tool and base, unless a link or joint has this name; ``"<tool>"`` and
        ``"<base>"`` always are. Raises InvalidInput listing the valid names.
        """
        origin = Pose(np.zeros(3))
        tool, base = Frame(link=self.dof - 1, pose=self.tool), Frame(link=-1, pose=origin)
        frames = {
            **dict(zip(OTHER_NAMES, (tool, base), strict=True)),
            **{joint: Frame(link=i, pose=origin) for i, joint in enumerate(self.joint_names)},
            **self.frames,
            TOOL_FRAME: tool,
            BASE_FRAME: base,
        }
        if not isinstance(name, str) or name not in frames:
            hint = likely_spelling(name, frames)
            wish = f"one of {', '.join(frames)} wanted, which {self.name} has"
            raise InvalidInput(f"frame: {wish}, got {shown(name)}{hint}")
        return frames[name]


def check_arm(name: str, arm: object) -> None:
    """Raise InvalidInput, by ``name``, unless this is an Arm."""
    check_instance(name, arm, Arm, "an Arm", example="pk.arms.tringali_3r() or Arm.from_urdf(...)")


# Joints frozen at a value: the arm with one joint less, and the motion of a joint.


def fix_joint(arm: Arm, joint: str, value: float) -> Arm:
    """Return the arm with one joint frozen at ``value`` [rad, m], its link part of the one before.

    Raises InvalidInput for an unknown joint, a value that is not finite, or the last joint of an arm.
    """
    if joint not in arm.joint_names:
        hint = likely_spelling(joint, arm.joint_names)
        raise InvalidInput(f"fixed: joints among {', '.join(arm.joint_names)} wanted, got {shown(joint)}{hint}")
    value = finite_number(f"joint {joint}", value)
    if arm.dof == 1:
        raise InvalidInput(f"joint {joint}: wanted one of several that move, got the last of {arm.name}")
    i = arm.joint_names.index(joint)
    lower, upper = arm.position_limits[i]
    if not lower <= value <= upper:
        raise InvalidInput(f"joint {joint}: a value from {lower:g} to {upper:g} wanted, got {value:g}")
    fixed = arm.placements[i] @ joint_motion(arm.joint_types[i], value)
    placements, bodies, tool = list(arm.placements), list(arm.bodies), arm.tool
    if i + 1 < arm.dof:
        placements[i + 1] = fixed @ placements[i + 1]
    else:
        tool = fixed @ tool
    if i > 0:
        bodies[i - 1] = combine_bodies(bodies[i - 1], transform_body(bodies[i], fixed))
    del placements[i], bodies[i]
    others = np.arange(arm.dof) != i
    return replace(
        arm,
        joint_names=arm.joint_names[:i] + arm.joint_names[i + 1 :],
        joint_types=arm.joint_types[:i] + arm.joint_types[i + 1 :],
        placements=tuple(placements),
        bodies=tuple(bodies),
        tool=tool,
        position_limits=arm.position_limits[others],
        velocity_limits=arm.velocity_limits[others],
        torque_limits=arm.torque_limits[others],
        acceleration_limits=None if arm.acceleration_limits is None else arm.acceleration_limits[others],
        jerk_limits=None if arm.jerk_limits is None else arm.jerk_limits[others],
        frames={name: _without_joint(frame, i, fixed) for name, frame in arm.frames.items()},
    )


def joint_motion(joint_type: str, value: float, axis: Sequence[float] = (0.0, 0.0, 1.0)) -> Pose:
    """Return the pose that a joint at ``value`` [rad or m] adds after its placement; none for those of other types."""
    if joint_type == "prismatic":
        return Pose(value * np.array(axis))
    if joint_type in ("revolute", "continuous"):
        return Pose(np.zeros(3), np.array([np.cos(value / 2), *(np.sin(value / 2) * np.array(axis))]))
    return Pose(np.zeros(3))


def _without_joint(frame: Frame, joint: int, fixed: Pose) -> Frame:
    """Return a frame of the arm after a joint is fixed at the pose ``fixed`` on the link before."""
    if frame.link < joint:
        return frame
    return Frame(link=frame.link - 1, pose=fixed @ frame.pose if frame.link == joint else frame.pose)
