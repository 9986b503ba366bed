"""Two seams: a wavy one of 1 m, and a fillet around a pipe on a plate; the tool's axis is given, not its angle.

The arm of seven joints is smaller: its seams are nearer, its pipe is thinner.
"""

from __future__ import annotations

import numpy as np

import paretoik as pk


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
