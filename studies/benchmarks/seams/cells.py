"""Three welding cells: an industrial arm of six joints, the same on a rail, and an arm of seven joints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import paretoik as pk
from paretoik.robot.body import JointType
from studies.benchmarks.seams.inverse_kinematics import (
    IIWA_LENGTHS,
    IRB_2400,
    seven_joint_postures,
    six_joint_postures,
)

RAIL_TRAVEL = 0.6  # m to either side
RAIL_SPEED = 1.0  # m/s


@dataclass(frozen=True, kw_only=True)
class Cell:
    """An arm, and the closed form of its postures.

    ``grid(resolution)`` gives the values of the freedom besides the tool's angle (a dummy value without one);
    ``postures(frames, value)`` gives all postures (frames, branches, dof), NaN for missing ones.
    """

    name: str
    arm: pk.Arm
    grid: Callable[[float], np.ndarray]
    postures: Callable[[np.ndarray, float], np.ndarray]

    @property
    def revolute(self) -> np.ndarray:
        """Which joints turn (dof,)."""
        return np.array([kind == "revolute" for kind in self.arm.joint_types])


def industrial_arm() -> Cell:
    """Return the cell of an ABB IRB 2400/16, limits and speeds of its data sheet."""
    return Cell(
        name="6R",
        arm=_irb_2400(rail=False),
        grid=lambda resolution: np.zeros(1),
        postures=lambda frames, value: six_joint_postures(frames),
    )


def arm_on_a_rail() -> Cell:
    """Return the same on a rail along y, its first joint."""

    def postures(frames: np.ndarray, place: float) -> np.ndarray:
        moved = frames.copy()
        moved[:, 1, 3] -= place
        q = six_joint_postures(moved)
        return np.concatenate([np.full((*q.shape[:2], 1), place), q], axis=2)

    def grid(resolution: float) -> np.ndarray:
        return np.linspace(-RAIL_TRAVEL, RAIL_TRAVEL, round(2 * RAIL_TRAVEL / resolution) + 1)

    return Cell(name="rail", arm=_irb_2400(rail=True), grid=grid, postures=postures)


def seven_joint_arm() -> Cell:
    """Return the cell of a KUKA LBR iiwa 14."""
    base, upper, fore, flange = IIWA_LENGTHS
    arm = pk.Arm.from_dh(
        a=np.zeros(7),
        alpha=np.deg2rad([-90, 90, 90, -90, -90, 90, 0]),
        d=[base, 0, upper, 0, fore, 0, flange],
        theta=np.zeros(7),
        convention="standard",
        position_limits=np.deg2rad([170, 120, 170, 120, 170, 120, 175]),
        velocity_limits=np.deg2rad([85, 85, 100, 75, 130, 135, 135]),
        name="LBR iiwa 14",
    )

    def grid(resolution: float) -> np.ndarray:
        return np.linspace(-np.pi, np.pi, round(2 * np.pi / resolution), endpoint=False)

    return Cell(name="7R", arm=arm, grid=grid, postures=seven_joint_postures)


_REVOLUTE: tuple[JointType, ...] = ("revolute",) * 6


def _irb_2400(*, rail: bool) -> pk.Arm:
    model, first = IRB_2400, 1 if rail else 0
    limit = np.deg2rad([[-180, -100, -60, -200, -120, -400], [180, 110, 65, 200, 120, 400]])
    speed = np.deg2rad([150, 150, 150, 360, 360, 450])
    arm = pk.Arm.from_dh(
        a=[0, model.a1, model.c2, -model.a2, 0, 0, 0][1 - first :],
        alpha=np.deg2rad([90, -90, 0, -90, 90, -90, 0])[1 - first :],
        d=[0, model.c1, 0, 0, model.c3, 0, model.c4][1 - first :],
        theta=np.deg2rad([0, 0, -90, 0, 0, 0, 180])[1 - first :],
        convention="standard",
        types=("prismatic", *_REVOLUTE)[1 - first :],
        position_limits=(
            np.append([-RAIL_TRAVEL] * first, limit[0]),
            np.append([RAIL_TRAVEL] * first, limit[1]),
        ),
        velocity_limits=np.append([RAIL_SPEED] * first, speed),
        name="IRB 2400 on a rail" if rail else "IRB 2400",
    )
    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # z of the rail along y
    return arm.mounted(base=pk.Pose.from_matrix(upright)) if rail else arm


CELLS = {"6R": industrial_arm, "rail": arm_on_a_rail, "7R": seven_joint_arm}
