"""Controllers of robots on sale, with their published limits; a limit that is not published is not there.

- Franka Robotics, PANDA (the Franka Emika Robot, FER) and FR3: Franka Control Interface Documentation, Control
  Interface Specification and Robot Limits (frankarobotics.github.io/docs/robot_specifications.html): joint positions,
  velocities, accelerations, jerks, torques and torque rates; velocity and acceleration 0 at both ends; 1 kHz. Those of
  torque are "recommended", the others "necessary". FR3's velocity limits shrink towards the ends of its joints; their
  constants are those of libfranka's rate_limiting.h.
- Universal Robots e-Series, UR3E to UR16E: user manuals, version 5.8 (positions ±360°, joint speeds), and the article
  Max. joint torques, both as in Universal_Robots_ROS2_Description/config; 500 Hz: RTDE guide. Accelerations and jerks
  are not published.
- Kinova, GEN3 (7 joints): user guide EN-UG-014 (positions of joints 2, 4 and 6, accelerations 297.94°/s² and
  572.95°/s², 1 kHz low-level servoing), and the URDF of Kinovarobotics/ros2_kortex (80°/s, 70°/s and torques). Jerks
  are not published.
"""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.inputs import likely_spelling, shown
from paretoik.joint_trajectory.controller import Braking, Controller
from paretoik.robot.arm import Arm, check_arm

__all__ = ["FR3", "GEN3", "PANDA", "UR3E", "UR5E", "UR10E", "UR16E", "Controller"]

FCI = "Franka Control Interface Documentation, Control Interface Specification and Robot Limits"
UR_MANUAL = "Universal Robots e-Series user manual 5.8; Max. joint torques; no accelerations or jerks published"
UR_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)

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
    other_joint_names=([f"fer_joint{i}" for i in range(1, 8)],),  # as franka_description calls them
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
        joint_names=UR_JOINTS,
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


@check_call
def find_controller(controller: str | Controller, arm: Arm) -> Controller:
    """Return a controller for an arm: itself, one by its name, or of a family the one that names the arm's joints.

    Its joints come in the order of the arm's. Where joints of a family are all named alike, the arm's own name decides.

    Raises InvalidInput for an unknown name, joints that are not the controller's, or a family that leaves a choice.
    """
    check_arm("arm", arm)
    if not isinstance(controller, Controller):
        if not isinstance(controller, str) or (controller not in FAMILIES and controller not in CONTROLLERS):
            names = (*FAMILIES, *CONTROLLERS)
            raise InvalidInput(
                f"controller: one of {', '.join(names)}, or a pk.controllers.Controller wanted, got "
                f"{shown(controller)}{likely_spelling(controller, names)}"
            )
        controller = CONTROLLERS.get(controller) or _of_family(controller, arm)
    return controller.arranged_for(arm)


def _of_family(name: str, arm: Arm) -> Controller:
    family = FAMILIES[name]
    matching = [each for each in family if each.moves(arm)] or [family[0]]
    named = [each for each in matching if each.name in arm.name.lower()]
    if len(matching) > 1 and len(named) != 1:
        models = ", ".join(each.name for each in matching)
        raise InvalidInput(
            f"controller {shown(name)}: say which of {models}, as the joints and the name of {arm.name} do not"
        )
    return (named if len(named) == 1 else matching)[0]
