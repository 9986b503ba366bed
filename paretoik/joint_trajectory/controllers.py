"""A robot's controller: its rate, the limits it enforces on every command, and its conditions at both ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import read_only
from paretoik.errors import InvalidInput
from paretoik.inputs import (
    check_flag,
    check_instance,
    check_text,
    finite_array,
    likely_spelling,
    positive_number,
    read_list,
    shown,
)
from paretoik.robot.arm import Arm, check_arm
from paretoik.robot.arm_arguments import joint_positions, limit_rows, symmetric_limits
from paretoik.tables import html_representation

# Tolerances and sizes of trajectories for controllers.


@dataclass(frozen=True, kw_only=True)
class JointTrajectoryOptions:
    """Settings of sampling, checking and slowing down.

    rounding: share of a limit by which it may be exceeded
    rest_velocity: share of a joint's velocity limit (else the motion's largest velocity) below which it is at rest
    rest_acceleration: same for acceleration; cubic splines leave about as much at an end without acceleration
    slowest: largest factor by which a motion is slowed down; a limit still exceeded then is also exceeded at rest
    ramps: ramps [s] that are tried, from short to long
    usual_ramp: ramp [s] that is advised if none of these is enough
    rate: largest rate [Hz], at which times in whole nanoseconds still differ
    periods: largest number of periods; it needs some gigabytes
    whole: share of a period within which a duration is rounded to whole periods
    """

    rounding: float = 1e-9
    rest_velocity: float = 1e-3
    rest_acceleration: float = 1e-2
    slowest: float = 30.0
    ramps: tuple[float, ...] = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
    usual_ramp: float = 0.2
    rate: float = 1e6
    periods: int = 1_000_000
    whole: float = 1e-9


OPTIONS = JointTrajectoryOptions()


# A controller: its rate, limits and conditions at both ends.


JOINT_LIMITS = ("velocity", "acceleration", "jerk", "torque", "torque_rate")


@dataclass(frozen=True, kw_only=True, eq=False)
class Braking:
    """Velocity limits that shrink towards the ends of ranges, so that joints can brake.

    The upper limit is √(2 d (q⁺ − q)) − offset, at least 0; the lower one is alike towards q⁻. Source: FCI
    documentation, Position-Based Velocity Limits.

    double_deceleration: twice the deceleration, 2 d (dof,) [rad/s²]
    offset: offset (dof,) [rad/s]
    position: ends q⁻ and q⁺ of the ranges (dof, 2) [rad]
    """

    double_deceleration: Float[np.ndarray, " dof"]
    offset: Float[np.ndarray, " dof"]
    position: Float[np.ndarray, "dof 2"]

    def __post_init__(self) -> None:
        for name in ("double_deceleration", "offset", "position"):
            object.__setattr__(self, name, read_only(finite_array(f"braking: {name}", getattr(self, name))))
        dof = self.double_deceleration.shape[:1]
        if self.offset.shape != dof or self.double_deceleration.ndim != 1 or self.position.shape != (*dof, 2):
            shapes = f"{self.double_deceleration.shape}, {self.offset.shape} and {self.position.shape}"
            raise InvalidInput(
                f"braking must have double_deceleration, offset (dof,) and position (dof, 2), got shapes {shapes}"
            )

    def velocity_bounds(self, q: Float[np.ndarray, "time dof"]) -> Float[np.ndarray, "2 time dof"]:
        """Return the lower and upper velocities [rad/s] from which joints at positions q can brake."""
        q = np.atleast_2d(joint_positions(q, len(self.position)))
        room = np.stack([q - self.position[:, 0], self.position[:, 1] - q])
        speed = np.maximum(np.sqrt(np.maximum(self.double_deceleration * room, 0.0)) - self.offset, 0.0)
        return speed * np.array([-1.0, 1.0])[:, None, None]


@dataclass(frozen=True, kw_only=True, eq=False)
class Controller:
    """Properties of a robot's controller: its joints, its rate and its limits.

    name: name of the controller
    source: origin of the figures
    joint_names: names of the joints
    other_joint_names: names of the same joints in other files of the vendor
    rate: number of commands per second [Hz]
    position: limits (lower, upper), symmetric ones, or an array (dof, 2) [rad, m]
    velocity, acceleration, jerk: symmetric limits [rad/s, rad/s², rad/s³], one number or one per joint
    torque, torque_rate: symmetric limits [N m, N m/s], one number or one per joint
    rest_acceleration: whether the acceleration must be 0 at both ends; the velocity always must be
    braking: velocity limits near the ends of the joints' ranges

    None means no limit, or no published one. ``dataclasses.replace`` makes a controller that differs in some fields.

    Raises InvalidInput if a name repeats, or a figure is not positive or not one per joint.

    >>> mine = Controller(name="bench", joint_names=("joint1", "joint2"), rate=250, velocity=[1.5, 2.0])
    >>> mine.velocity
    array([1.5, 2. ])
    """

    name: str
    joint_names: Sequence[str]
    rate: float
    position: Any = None
    velocity: Any = None
    acceleration: Any = None
    jerk: Any = None
    torque: Any = None
    torque_rate: Any = None
    rest_acceleration: bool = False
    braking: Braking | None = None
    source: str = ""
    other_joint_names: Sequence[Sequence[str]] = ()

    def __post_init__(self) -> None:
        assign = object.__setattr__
        check_text("controller: name", self.name)
        check_text("controller: source", self.source)
        if self.braking is not None:
            check_instance("controller: braking", self.braking, Braking, "a Braking or None")
        names, about = check_joint_names("joint_names", self.joint_names), f"controller {self.name}"
        assign(self, "joint_names", names)
        lists = read_list("other_joint_names", self.other_joint_names, list | tuple, "lists of joint names")
        others = [check_joint_names("other_joint_names", each) for each in lists]
        if any(len(each) != len(names) for each in others):
            raise InvalidInput(f"{about}: other_joint_names must have {len(names)} names per list, got {shown(others)}")
        assign(self, "rate", positive_number(f"{about}: rate", self.rate, "Hz"))
        check_flag(f"{about}: rest_acceleration", self.rest_acceleration)
        position = self.position
        if isinstance(position, np.ndarray) and position.shape == (len(names), 2):
            position = tuple(position.T)
        assign(self, "position", limit_rows(f"{about}: position", position, len(names)))
        for kind in JOINT_LIMITS:
            assign(self, kind, symmetric_limits(f"{about}: {kind}", getattr(self, kind), len(names)))

    def __repr__(self) -> str:
        return f"Controller({self.name!r}, {self.rate:g} Hz, {len(self.joint_names)} joints)"

    _repr_html_ = html_representation

    def velocity_bounds(self, q: Float[np.ndarray, "time dof"]) -> Float[np.ndarray, "2 time dof"]:
        """Return the lower and upper velocity limits [rad/s] at joint positions q."""
        q = np.atleast_2d(joint_positions(q, len(self.joint_names)))
        bounds = np.stack(np.broadcast_arrays(-self.velocity, self.velocity))[:, None, :]
        if self.braking is None:
            return np.broadcast_to(bounds, (2, *q.shape))
        lower, upper = self.braking.velocity_bounds(q)
        return np.stack([np.maximum(bounds[0], lower), np.minimum(bounds[1], upper)])

    def moves(self, arm: Arm) -> bool:
        """Return whether an arm has the controller's joints; all names may have one prefix."""
        return self._order(arm) is not None

    def arranged_for(self, arm: Arm) -> Controller:
        """Return the controller with its joints in the order of the arm's. Names may have one prefix.

        Raises InvalidInput if the joints are not the same.
        """
        order = self._order(arm)
        if order is None:
            names = " or ".join(", ".join(each) for each in (self.joint_names, *self.other_joint_names))
            raise InvalidInput(
                f"controller {self.name}: joints must be {names}, with one prefix or none, "
                f"got {', '.join(arm.joint_names)} of {arm.name}"
            )
        if order == list(range(len(order))):
            return self
        braking = self.braking
        if braking is not None:
            braking = Braking(**{each.name: getattr(braking, each.name)[order] for each in fields(Braking)})
        return replace(
            self,
            joint_names=[self.joint_names[i] for i in order],
            other_joint_names=[[names[i] for i in order] for names in self.other_joint_names],
            braking=braking,
            **{kind: getattr(self, kind)[order] for kind in ("position", *JOINT_LIMITS)},
        )

    def _order(self, arm: Arm) -> list[int] | None:
        """Return for each joint of an arm its index in the controller; None if the joints are not the same."""
        check_arm("arm", arm)
        for names in (self.joint_names, *self.other_joint_names):
            first = arm.joint_names[0]
            for prefix in (first.removesuffix(name) for name in names if first.endswith(name)):
                whole = [prefix + name for name in names]
                if sorted(whole) == sorted(arm.joint_names):
                    return [whole.index(joint) for joint in arm.joint_names]
        return None


def check_joint_names(name: str, values: object) -> tuple[str, ...]:
    """Return joint names; raises InvalidInput, by ``name``, unless they are a list of different texts."""
    names = tuple(values) if isinstance(values, Sequence) and not isinstance(values, str) else ()
    if not names or not all(isinstance(value, str) and value for value in names):
        raise InvalidInput(f"{name} must be a list of joint names, got {shown(values)}")
    twice = next((joint for i, joint in enumerate(names) if joint in names[:i]), None)
    if twice is not None:
        raise InvalidInput(f"{name} must have each joint once, got {twice} twice")
    return names


# Controllers of robots on sale, with their published limits; limits that are not published are left out.
#
# - Franka Robotics, PANDA (the Franka Emika Robot, FER) and FR3: Franka Control Interface Documentation, Control
#   Interface Specification and Robot Limits (frankarobotics.github.io/docs/robot_specifications.html): joint positions,
#   velocities, accelerations, jerks, torques and torque rates; velocity and acceleration 0 at both ends; 1 kHz. Those
#   of torque are "recommended", the others "necessary". FR3's velocity limits shrink towards the ends of its joints;
#   their constants are those of libfranka's rate_limiting.h.
# - Universal Robots e-Series, UR3E to UR16E: user manuals, version 5.8 (positions ±360°, joint speeds), and the article
#   Max. joint torques, both as in Universal_Robots_ROS2_Description/config; 500 Hz: RTDE guide. Accelerations and jerks
#   are not published.
# - Kinova, GEN3 (7 joints): user guide EN-UG-014 (positions of joints 2, 4 and 6, accelerations 297.94°/s² and
#   572.95°/s², 1 kHz low-level servoing), and the URDF of Kinovarobotics/ros2_kortex (80°/s, 70°/s and torques). Jerks
#   are not published.


__all__ = ["FR3", "GEN3", "PANDA", "UR3E", "UR5E", "UR10E", "UR16E", "Controller"]


def __dir__() -> list[str]:
    return __all__


FCI = "Franka Control Interface Documentation, Control Interface Specification and Robot Limits"
UR_MANUAL = "Universal Robots e-Series user manual 5.8; Max. joint torques; no accelerations or jerks published"
UR_LINKS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")

PANDA = Controller(
    name="panda",
    joint_names=[f"panda_joint{i}" for i in range(1, 8)],
    rate=1000.0,
    position=(
        [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973],
        [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973],
    ),
    velocity=[2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61],
    acceleration=[15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0],
    jerk=[7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0],
    torque=[87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0],
    torque_rate=1000.0,
    rest_acceleration=True,
    source=FCI,
    other_joint_names=([f"fer_joint{i}" for i in range(1, 8)],),  # the names in franka_description
)
FR3 = Controller(
    name="fr3",
    joint_names=[f"fr3_joint{i}" for i in range(1, 8)],
    rate=1000.0,
    position=(
        [-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159],
        [2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159],
    ),
    velocity=[2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26],
    acceleration=10.0,
    jerk=5000.0,
    torque=[87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0],
    torque_rate=1000.0,
    rest_acceleration=True,
    braking=Braking(
        double_deceleration=np.array([12.0, 5.17, 7.0, 8.0, 34.0, 11.0, 34.0]),
        offset=np.array([0.3, 0.2, 0.2, 0.3, 0.35, 0.35, 0.35]),
        position=np.array(
            [
                [-2.7501, 2.7501],
                [-1.7918, 1.7918],
                [-2.9065, 2.9065],
                [-3.0481, -0.1458],
                [-2.8101, 2.8101],
                [0.54092, 4.5205],
                [-3.0196, 3.0196],
            ]
        ),
    ),
    source=f"{FCI}; libfranka, rate_limiting.h",
)


def _ur(name: str, *, degrees: list[float], torque: list[float]) -> Controller:
    return Controller(
        name=name,
        joint_names=[f"{link}_joint" for link in UR_LINKS],
        rate=500.0,
        position=2 * np.pi,
        velocity=np.deg2rad(degrees),
        torque=torque,
        source=UR_MANUAL,
    )


UR3E = _ur("ur3e", degrees=[180, 180, 180, 360, 360, 360], torque=[56, 56, 28, 12, 12, 12])
UR5E = _ur("ur5e", degrees=[180] * 6, torque=[150, 150, 150, 28, 28, 28])
UR10E = _ur("ur10e", degrees=[120, 120, 180, 180, 180, 180], torque=[330, 330, 150, 56, 56, 56])
UR16E = _ur("ur16e", degrees=[120, 120, 180, 180, 180, 180], torque=[330, 330, 150, 54, 54, 54])
GEN3 = Controller(
    name="gen3",
    joint_names=[f"joint_{i}" for i in range(1, 8)],
    rate=1000.0,
    position=np.deg2rad([np.inf, 128.9, np.inf, 147.8, np.inf, 120.3, np.inf]),
    velocity=np.deg2rad([80.0, 80.0, 80.0, 80.0, 70.0, 70.0, 70.0]),
    acceleration=np.deg2rad([297.94, 297.94, 297.94, 297.94, 572.95, 572.95, 572.95]),
    torque=[39.0, 39.0, 39.0, 39.0, 9.0, 9.0, 9.0],
    source="Kinova Gen3 user guide EN-UG-014; URDF of ros2_kortex; no jerks published",
)

FAMILIES = MappingProxyType({"franka": (PANDA, FR3), "ur": (UR3E, UR5E, UR10E, UR16E), "kinova": (GEN3,)})
CONTROLLERS = MappingProxyType({each.name: each for family in FAMILIES.values() for each in family})


def find_controller(controller: str | Controller, arm: Arm) -> Controller:
    """Return a controller for an arm: as given, by its name, or by its family.

    From a family the controller with the arm's joints is returned.

    Its joints come in the order of the arm's. If joints of a family have the same names, the arm's own name decides.

    Raises InvalidInput for an unknown name, joints that are not the controller's, or a family with several matching
    controllers.
    """
    check_arm("arm", arm)
    if not isinstance(controller, Controller):
        if not isinstance(controller, str) or (controller not in FAMILIES and controller not in CONTROLLERS):
            names = (*FAMILIES, *CONTROLLERS)
            raise InvalidInput(
                f"controller must be one of {', '.join(names)}, or a pk.controllers.Controller, got "
                f"{shown(controller)}{likely_spelling(controller, names)}"
            )
        if controller in FAMILIES:
            family = FAMILIES[controller]
            matching = [each for each in family if each.moves(arm)] or [family[0]]
            named = [each for each in matching if each.name in arm.name.lower()]
            if len(matching) > 1 and len(named) != 1:
                models = ", ".join(each.name for each in matching)
                raise InvalidInput(
                    f"controller must be one of {models}, got {shown(controller)}: "
                    f"joints and name of {arm.name} do not say which"
                )
            controller = (named if len(named) == 1 else matching)[0]
        else:
            controller = CONTROLLERS[controller]
    return controller.arranged_for(arm)
