"""Three welding cells and two seams; the postures at tool frames are in closed form.

An industrial arm of six joints and the same on a rail: by ``py_opw_kinematics`` (Brandstötter, Angerer & Hofbaur 2014).
Seven joints with a spherical shoulder, an elbow and a spherical wrist: over the swivel angle (Shimizu et al. 2008). The
seams are a wavy one of 1 m, and a fillet around a pipe; the tool axis is given, not its angle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from py_opw_kinematics import KinematicModel, Robot
from scipy.spatial.transform import RigidTransform, Rotation

import paretoik as pk
from paretoik.robot.arm_arguments import JointType

# ABB IRB 2400/16: lengths [m] of the data sheet, in the convention of Brandstötter et al.
IRB_2400 = KinematicModel(
    a1=0.1, a2=-0.135, b=0.0, c1=0.615, c2=0.705, c3=0.755, c4=0.085, offsets=(0.0, 0.0, -np.pi / 2, 0.0, 0.0, 0.0)
)
# KUKA LBR iiwa 14: base to shoulder, shoulder to elbow, elbow to wrist, wrist to flange [m].
IIWA_LENGTHS = (0.36, 0.42, 0.4, 0.126)


def six_joint_postures(frames: np.ndarray) -> np.ndarray:
    """Return the eight postures of the IRB 2400 at frames (frames, 4, 4): (frames, 8, 6), NaN for missing ones."""
    return Robot(IRB_2400, degrees=False).reach(RigidTransform.from_matrix(frames)).joints


def seven_joint_postures(frames: np.ndarray, swivel: float) -> np.ndarray:
    """Return the eight postures of the iiwa at frames (frames, 4, 4) with its elbow at a swivel angle [rad].

    (frames, 8, 7), NaN if the wrist is out of reach: shoulder, elbow and wrist are bent one way or the other.
    """
    base, upper, fore, flange = IIWA_LENGTHS
    rotation = frames[:, :3, :3]
    reach = frames[:, :3, 3] - flange * rotation[:, :, 2] - np.array([0.0, 0.0, base])
    with np.errstate(invalid="ignore"):
        bend = np.arccos((np.sum(reach**2, axis=1) - upper**2 - fore**2) / (2 * upper * fore))
    branches = []
    for elbow in (bend, -bend):
        # Both frames have z along the wrist from the shoulder: that of the arm with its shoulder at rest, the world's.
        local = np.stack([fore * np.sin(elbow), 0 * elbow, upper + fore * np.cos(elbow)], axis=1)
        turned = (
            _frames_along(reach) @ Rotation.from_euler("z", swivel).as_matrix() @ _frames_along(local).swapaxes(1, 2)
        )
        wrist = (turned @ Rotation.from_euler("y", elbow[:, None]).as_matrix()).swapaxes(1, 2) @ rotation
        for shoulder in _spherical_angles(turned):
            for hand in _spherical_angles(wrist):
                branches.append(np.concatenate([shoulder, -elbow[:, None], hand], axis=1))
    return np.stack(branches, axis=1)


def _spherical_angles(rotation: np.ndarray) -> list[np.ndarray]:
    """Return both triples of angles about z, y and z whose product is a rotation."""
    middle = np.arccos(np.clip(rotation[:, 2, 2], -1.0, 1.0))
    triples = []
    for sign in (1.0, -1.0):
        first = np.arctan2(sign * rotation[:, 1, 2], sign * rotation[:, 0, 2])
        last = np.arctan2(sign * rotation[:, 2, 1], -sign * rotation[:, 2, 0])
        triples.append(np.stack([first, sign * middle, last], axis=1))
    return triples


def _frames_along(vectors: np.ndarray) -> np.ndarray:
    """Return rotations whose z axis lies along vectors, their x axis in a vertical plane."""
    z = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    y = np.cross(z, [0.0, 0.0, 1.0])
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    return np.stack([np.cross(y, z), y, z], axis=2)


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
        position_limits=(np.append([-RAIL_TRAVEL] * first, limit[0]), np.append([RAIL_TRAVEL] * first, limit[1])),
        velocity_limits=np.append([RAIL_SPEED] * first, speed),
        name="IRB 2400 on a rail" if rail else "IRB 2400",
    )
    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # z of the rail along y
    return arm.mounted(base=pk.Pose.from_matrix(upright)) if rail else arm


CELLS = {"6R": industrial_arm, "rail": arm_on_a_rail, "7R": seven_joint_arm}


def wavy(samples: int, cell: str) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and frames (samples, 4, 4) of a seam along y, the tool's axis into the surface; 10 s."""
    share = np.linspace(0.0, 1.0, samples)
    wave = 6 * np.pi * share
    position = np.stack(
        [(0.4 if cell == "7R" else 1.0) + 0.05 * np.sin(wave / 1.5), share - 0.5, 0.6 + 0.03 * np.sin(wave)], axis=1
    )
    into = np.stack([0 * share, 0.03 * 6 * np.pi * np.cos(wave), np.full(samples, -1.0)], axis=1)
    return 10 * share, _frames(position, into)


def fillet(samples: int, cell: str) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and frames (samples, 4, 4) of a fillet all around, the axis at 45° inwards; 20 s."""
    share = np.linspace(0.0, 1.0, samples)
    angle = 2 * np.pi * share
    outwards = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    center, radius = ([0.5, 0.0, 0.0], 0.1) if cell == "7R" else ([1.0, 0.0, 0.4], 0.15)
    position = np.array(center) + radius * outwards
    return 20 * share, _frames(position, -outwards - np.array([0.0, 0.0, 1.0]))


SEAMS = {"wavy": wavy, "fillet": fillet}


def path(times: np.ndarray, frames: np.ndarray) -> pk.Path:
    """Return the path through the frames."""
    return pk.poses(times, [pk.Pose.from_matrix(frame[:3, :3], frame[:3, 3]) for frame in frames])


def _frames(position: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return frames at positions with z along an axis; x is carried along and turns as little as possible."""
    frames = np.tile(np.eye(4), (len(position), 1, 1))
    frames[:, :3, 3] = position
    x = np.array([1.0, 0.0, 0.0])
    for frame, z in zip(frames, axis / np.linalg.norm(axis, axis=1, keepdims=True), strict=True):
        x = x - z * (x @ z)
        x /= np.linalg.norm(x)
        frame[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    return frames
