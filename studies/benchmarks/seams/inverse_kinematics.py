"""All postures of two kinds of arm at tool frames, in closed form: the nodes of a ladder graph.

Six joints with a parallel base and a spherical wrist by ``py_opw_kinematics`` (Brandstötter, Angerer & Hofbaur 2014);
seven joints with a spherical shoulder, an elbow and a spherical wrist over the swivel angle (Shimizu et al. 2008).
"""

from __future__ import annotations

import numpy as np
from py_opw_kinematics import KinematicModel, Robot
from scipy.spatial.transform import RigidTransform

# ABB IRB 2400/16: lengths [m] of the data sheet, in the convention of Brandstötter et al.
IRB_2400 = KinematicModel(
    a1=0.1,
    a2=-0.135,
    b=0.0,
    c1=0.615,
    c2=0.705,
    c3=0.755,
    c4=0.085,
    offsets=(0.0, 0.0, -np.pi / 2, 0.0, 0.0, 0.0),
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
        turned = _frames_along(reach) @ _about_z(swivel) @ _frames_along(local).swapaxes(1, 2)
        wrist = (turned @ _about_y(elbow)).swapaxes(1, 2) @ rotation
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


def _about_y(angle: np.ndarray) -> np.ndarray:
    zero, one, cosine, sine = 0 * angle, 0 * angle + 1, np.cos(angle), np.sin(angle)
    rows = [[cosine, zero, sine], [zero, one, zero], [-sine, zero, cosine]]
    return np.moveaxis(np.array(rows), 2, 0)


def _about_z(angle: float) -> np.ndarray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
