"""An arm as Pinocchio's model, built only from its numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from paretoik.errors import InvalidInput

TOOL_FRAME = "<tool>"  # the arm's own name for it


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmModel:
    """Pinocchio's model of an arm, with the arm's joint coordinates. Angles are not reduced modulo whole turns."""

    arm: Any
    pin: Any
    model: Any
    data: Any
    frames: dict[str, int] = field(default_factory=dict)

    @property
    def dof(self) -> int:
        """Number of joints."""
        return int(self.model.nv)

    @cached_property
    def length(self) -> float:
        """Length [m] of the stretched arm, prismatic joints at 0; it is the unit of positions."""
        offsets = [*self.arm.placements[1:], self.arm.tool]
        length = float(sum(np.linalg.norm(pose.position) for pose in offsets))
        prismatic = [limits for limits, each in zip(self.arm.position_limits, self.turning, strict=True) if not each]
        ranges = [high - low for low, high in prismatic if np.isfinite(high - low)]
        return length or max(ranges, default=0.0) or 1.0

    @cached_property
    def turning(self) -> np.ndarray:
        """Whether each joint is revolute (dof,); others are prismatic."""
        return np.array([kind != "prismatic" for kind in self.arm.joint_types])

    @cached_property
    def scales(self) -> np.ndarray:
        """Units of joints (dof,): 1 rad, or the arm's length [m] if prismatic."""
        return np.where(self.turning, 1.0, self.length)

    def torques(self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
        """Return joint torques (time, dof) [N m, N], by the recursive Newton-Euler algorithm."""
        rows = zip(q, dq, ddq, strict=True)
        return np.array([self.pin.rnea(self.model, self.data, *row) for row in rows]).reshape(q.shape)

    def kinetic_energies(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        """Return kinetic energies (time,) [J]."""
        rows = zip(q, dq, strict=True)
        return np.array([self.pin.computeKineticEnergy(self.model, self.data, *row) for row in rows])

    def frame_number(self, name: str) -> int:
        """Return the number of one of the arm's frames."""
        if name not in self.frames:
            frame = self.arm.frame(name)
            place = self.pin.SE3(rotation_of(frame.pose.quaternion), np.array(frame.pose.position))
            if frame.link < 0:
                place = _place(self.pin, self.arm.base) * place
            self.frames[name] = self.model.addFrame(
                self.pin.Frame(f"verified {name}", frame.link + 1, 0, place, self.pin.FrameType.OP_FRAME)
            )
            object.__setattr__(self, "data", self.model.createData())
        return self.frames[name]

    def poses(self, q: np.ndarray, frame: str = TOOL_FRAME) -> tuple[np.ndarray, np.ndarray]:
        """Return rotations (time, 3, 3) and positions (time, 3) [m] of a frame."""
        number = self.frame_number(frame)
        rotations, positions = np.empty((len(q), 3, 3)), np.empty((len(q), 3))
        for row, one in enumerate(q):
            self.pin.forwardKinematics(self.model, self.data, one)
            place = self.pin.updateFramePlacement(self.model, self.data, number)
            rotations[row], positions[row] = place.rotation, place.translation
        return rotations, positions

    def jacobian(self, q: np.ndarray, frame: str = TOOL_FRAME) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rotation (3, 3), position (3,) and Jacobian (6, dof) of a frame in one posture, in world axes."""
        number = self.frame_number(frame)
        world = self.pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = self.pin.computeFrameJacobian(self.model, self.data, q, number, world)
        place = self.pin.updateFramePlacement(self.model, self.data, number)
        return place.rotation.copy(), place.translation.copy(), jacobian

    def drift(self, q: np.ndarray, dq: np.ndarray, frame: str) -> np.ndarray:
        """Return a frame's acceleration (6,) in world axes at zero joint accelerations."""
        number, world = self.frame_number(frame), self.pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        self.pin.forwardKinematics(self.model, self.data, q, dq, np.zeros_like(q))
        motion = self.pin.getFrameClassicalAcceleration(self.model, self.data, number, world)
        return np.concatenate([motion.linear, motion.angular])

    def nodes(self, q: np.ndarray) -> np.ndarray:
        """Return the arm as polylines (time, dof + 2, 3) [m]: base, every joint, tool."""
        number = self.frame_number(TOOL_FRAME)
        nodes = np.empty((len(q), self.dof + 2, 3))
        nodes[:, 0] = self.arm.base.position
        for row, one in enumerate(q):
            self.pin.forwardKinematics(self.model, self.data, one)
            for joint in range(self.dof):
                nodes[row, joint + 1] = self.data.oMi[joint + 1].translation
            nodes[row, -1] = self.pin.updateFramePlacement(self.model, self.data, number).translation
        return nodes

    def reaches(self, q: np.ndarray) -> np.ndarray:
        """Return the largest displacement (dof,) [m] of a node per rad or m of each joint, in any posture of ``q``."""
        lengths = np.array([np.linalg.norm(pose.position) for pose in (*self.arm.placements[1:], self.arm.tool)])
        travel = np.where(self.turning, 0.0, np.abs(q).max(axis=0))
        after = np.cumsum((lengths + np.append(travel[1:], 0.0))[::-1])[::-1]
        return np.where(self.turning, after, 1.0)


def build_model(arm: Any) -> ArmModel:
    """Return the model of an arm's numbers; raises InvalidInput if Pinocchio is not installed."""
    pin = import_pinocchio()
    model = pin.Model()
    model.gravity.linear = np.array(arm.gravity, dtype=float)
    parent = 0
    for i, (kind, placement, body) in enumerate(zip(arm.joint_types, arm.placements, arm.bodies, strict=True)):
        joint = pin.JointModelPZ() if kind == "prismatic" else pin.JointModelRZ()
        place = _place(pin, placement)
        parent = model.addJoint(parent, joint, place if i else _place(pin, arm.base) * place, arm.joint_names[i])
        inertia = pin.Inertia(float(body.mass), np.array(body.center), np.array(body.inertia))
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    return ArmModel(arm=arm, pin=pin, model=model, data=model.createData())


def import_pinocchio() -> Any:
    """Return Pinocchio; raises InvalidInput, with how to install it, if it is missing."""
    try:
        import pinocchio
    except ImportError as fault:
        raise InvalidInput(
            'Pinocchio, which computes dynamics a second time, is not installed: pip install "paretoik[verify]"'
        ) from fault
    return pinocchio


def rotation_of(quaternion: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of a quaternion (w, x, y, z)."""
    return np.asarray(Rotation.from_quat(np.roll(quaternion, -1, axis=-1)).as_matrix())


def _place(pin: Any, pose: Any) -> Any:
    return pin.SE3(rotation_of(pose.quaternion), np.array(pose.position))
