"""Poses: position and orientation of a frame, and functions on arrays of rotations.

Quaternions are (w, x, y, z) of length 1; a quaternion and its negative are the same orientation. A pose maps a point
of its frame to ``position + rotation @ point`` in its parent frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.errors import InvalidInput
from paretoik.inputs import ArrayLike, check_angles, check_magnitude, finite_array, finite_number, shown
from paretoik.tables import represented

UNIT_TOLERANCE = 1e-6  # largest error of a quaternion's length or a matrix's orthogonality that is corrected


@represented
@dataclass(frozen=True, init=False, eq=False)
class Pose:
    """Position and orientation of one frame.

    position: coordinates (3,) [m], read-only
    quaternion: orientation (4,) as (w, x, y, z), read-only; normalised if its length is within 1e-6 of 1

    ``arm.pose`` of many postures returns a batch: position (*batch, 3) and quaternion (*batch, 4). ``poses[i]`` is one
    of its poses. Functions that take one pose refuse a batch. Raises InvalidInput unless there are three finite
    coordinates and a finite unit quaternion.

    >>> tool = Pose.planar(1.0, 0.0, angle=np.pi / 2) @ Pose([0.5, 0.0, 0.0])
    >>> tool.position.round(12)
    array([1. , 0.5, 0. ])
    """

    position: Float[np.ndarray, "*batch 3"]
    quaternion: Float[np.ndarray, "*batch 4"]

    def __init__(self, position: ArrayLike, quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0)) -> None:
        coordinates = finite_array("pose position", position, shape=(3,))
        check_magnitude("pose position", coordinates, "m")
        given = finite_array("pose quaternion", quaternion, shape=(4,))
        with np.errstate(over="ignore"):
            length = np.linalg.norm(given, axis=-1)
        if np.abs(length - 1) > UNIT_TOLERANCE:
            wish = f"pose quaternion: must have length 1 within {UNIT_TOLERANCE:g}"
            raise InvalidInput(f"{wish}, got {given.tolist()} of length {length:.9g}")
        freeze(self, position=coordinates, quaternion=given / length)

    @classmethod
    def from_xyzw(cls, position: ArrayLike, xyzw: ArrayLike) -> Pose:
        """Return a pose from a quaternion (x, y, z, w), as ROS and SciPy write it."""
        return cls(position, np.roll(finite_array("pose xyzw", xyzw, shape=(4,)), 1))

    @classmethod
    def from_matrix(cls, matrix: ArrayLike, position: ArrayLike | None = None) -> Pose:
        """Return a pose from a rotation matrix or a homogeneous matrix.

        matrix: rotation (3, 3), or homogeneous matrix (4, 4), which takes no position
        position: coordinates (3,) [m] for a rotation, None for the origin

        A rotation within 1e-6 of an orthogonal matrix is made orthogonal; others, such as reflections, are refused.
        """
        array = finite_array("pose matrix", matrix)
        if array.shape == (4, 4) and position is None:
            if np.abs(array[3] - (0.0, 0.0, 0.0, 1.0)).max() > UNIT_TOLERANCE:
                raise InvalidInput(f"pose matrix: the last row must be 0 0 0 1, got {array[3].tolist()}")
            array, position = array[:3, :3], array[:3, 3]
        if array.shape != (3, 3):
            raise InvalidInput(
                f"pose matrix: must have shape (3, 3), or (4, 4) if no position is given, got {array.shape}"
            )
        with np.errstate(over="ignore", invalid="ignore"):
            excess = float(np.abs(array.T @ array - np.eye(3)).max())
            determinant = float(np.linalg.det(array))
        if not excess <= 2 * UNIT_TOLERANCE or determinant < 0:
            fact = f"got determinant {determinant:.6g} and RᵀR off the identity by {excess:.3g}"
            raise InvalidInput(f"pose matrix: must be a rotation, {fact}")
        return cls((0.0, 0.0, 0.0) if position is None else position, matrix_to_quaternion(array))

    @classmethod
    def from_rpy(cls, position: ArrayLike, rpy: ArrayLike) -> Pose:
        """Return a pose from roll, pitch and yaw [rad], about fixed x, y, z in this order, as in a URDF."""
        angles = finite_array("pose rpy", rpy, shape=(3,))
        check_angles("pose rpy", rpy)
        return cls(position, rpy_to_quaternion(angles))

    @classmethod
    def planar(cls, x: float, y: float, angle: float = 0.0) -> Pose:
        """Return a pose in the xy-plane at (x, y) [m], rotated by ``angle`` [rad] about +z."""
        half = finite_number("pose angle", angle) / 2
        check_angles("pose angle", angle)
        position = {"pose x": finite_number("pose x", x), "pose y": finite_number("pose y", y)}
        for name, value in position.items():
            check_magnitude(name, value, "m")
        return cls((*position.values(), 0.0), (np.cos(half), 0.0, 0.0, np.sin(half)))

    def __len__(self) -> int:
        """Return the size of the leading batch axis; a single pose has none."""
        if self.position.ndim == 1:
            raise TypeError("a single pose has no length")
        return len(self.position)

    def __getitem__(self, index: int | slice | np.ndarray) -> Pose:
        if self.position.ndim == 1:
            raise TypeError("a single pose cannot be indexed")
        return pose_batch(self.position[index], self.quaternion[index])

    def __iter__(self) -> Iterator[Pose]:
        return (self[i] for i in range(len(self)))

    @property
    def rotation(self) -> Float[np.ndarray, "*batch 3 3"]:
        """The (*batch, 3, 3) rotation matrix; its columns are the frame's axes."""
        return quaternion_to_matrix(self.quaternion)

    @property
    def matrix(self) -> Float[np.ndarray, "*batch 4 4"]:
        """The (*batch, 4, 4) homogeneous matrix."""
        matrix = np.zeros((*self.position.shape[:-1], 4, 4))
        matrix[..., :3, :3], matrix[..., :3, 3], matrix[..., 3, 3] = self.rotation, self.position, 1.0
        return matrix

    def __matmul__(self, other: Pose) -> Pose:
        """Return ``other``, a pose in this frame, in this pose's parent frame."""
        if not isinstance(other, Pose):
            return NotImplemented
        position, quaternion = self.apply(other.position), quaternion_product(self.quaternion, other.quaternion)
        return Pose(position, quaternion) if position.ndim == 1 else pose_batch(position, quaternion)

    def inverse(self) -> Pose:
        """Return the inverse: ``pose @ pose.inverse()`` is the identity."""
        conjugate = self.quaternion * (1.0, -1.0, -1.0, -1.0)
        if self.position.ndim == 1:
            return Pose(-(self.rotation.T @ self.position), conjugate)
        return pose_batch(-np.einsum("...ji,...j->...i", self.rotation, self.position), conjugate)

    def apply(self, points: ArrayLike) -> Float[np.ndarray, "*batch 3"]:
        """Return points of this pose's frame in its parent frame.

        points: coordinates (..., 3) [m]; for a batch of poses one point each, or one (3,) for all
        """
        inside = finite_array("points", points)
        if inside.shape[-1:] != (3,):
            raise InvalidInput(f"points: the last axis must have 3 coordinates, got shape {inside.shape}")
        if self.position.ndim == 1:
            outside: np.ndarray = inside @ self.rotation.T + self.position
            return outside
        batch = self.position.shape[:-1]
        if inside.shape[:-1] not in ((), batch):
            raise InvalidInput(f"points must have shape (3,) or {(*batch, 3)}, one per pose, got {inside.shape}")
        return np.einsum("...ij,...j->...i", self.rotation, inside) + self.position


def pose_batch(position: Float[np.ndarray, "*batch 3"], quaternion: Float[np.ndarray, "*batch 4"]) -> Pose:
    """Return a batch of poses from finite positions and unit quaternions, whose rounding errors are removed."""
    poses = object.__new__(Pose)
    unit = quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
    freeze(poses, position=np.array(position), quaternion=unit)
    return poses


def freeze(instance: object, **fields: object) -> None:
    """Set the fields of a frozen object; arrays become read-only."""
    for name, value in fields.items():
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
        object.__setattr__(instance, name, value)


def quaternion_product(
    left: Float[np.ndarray, "*#batch 4"], right: Float[np.ndarray, "*#batch 4"]
) -> Float[np.ndarray, "*batch 4"]:
    """Return Hamilton's product: a rotation by ``right``, then by ``left``."""
    a, b, c, d = np.moveaxis(left, -1, 0)
    w, x, y, z = np.moveaxis(right, -1, 0)
    return np.stack(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ],
        axis=-1,
    )


def rpy_to_quaternion(rpy: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 4"]:
    """Return the quaternion (w, x, y, z) of roll, pitch, yaw [rad] about fixed x, y, z in order."""
    roll, pitch, yaw = rpy / 2
    about_x = np.array([np.cos(roll), np.sin(roll), 0.0, 0.0])
    about_y = np.array([np.cos(pitch), 0.0, np.sin(pitch), 0.0])
    about_z = np.array([np.cos(yaw), 0.0, 0.0, np.sin(yaw)])
    return quaternion_product(about_z, quaternion_product(about_y, about_x))


def quaternion_to_matrix(quaternions: Float[np.ndarray, "*batch 4"]) -> Float[np.ndarray, "*batch 3 3"]:
    """Return the rotation matrices of unit quaternions (w, x, y, z)."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    matrices = np.empty((*w.shape, 3, 3))
    matrices[..., 0, 0] = 1 - 2 * (y * y + z * z)
    matrices[..., 1, 1] = 1 - 2 * (x * x + z * z)
    matrices[..., 2, 2] = 1 - 2 * (x * x + y * y)
    matrices[..., 0, 1], matrices[..., 1, 0] = 2 * (x * y - w * z), 2 * (x * y + w * z)
    matrices[..., 0, 2], matrices[..., 2, 0] = 2 * (x * z + w * y), 2 * (x * z - w * y)
    matrices[..., 1, 2], matrices[..., 2, 1] = 2 * (y * z - w * x), 2 * (y * z + w * x)
    return matrices


def matrix_to_quaternion(matrices: Float[np.ndarray, "*batch 3 3"]) -> Float[np.ndarray, "*batch 4"]:
    """Return the unit quaternions (w, x, y, z), w ≥ 0, of rotation matrices.

    Shepperd's method: the matrix gives 4 q qᵀ; its row with the largest diagonal entry, normalised, is q without
    cancellation.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = np.moveaxis(matrices, (-2, -1), (0, 1))
    trace = np.asarray(xx + yy + zz)
    quaternions = np.stack([1 + trace, zy - yz, xz - zx, yx - xy], axis=-1)
    far = ~(trace > 0)  # rotations by more than 120 degrees: w may be too small to divide by
    if far.any():
        products = np.empty((4, 4, int(far.sum())))
        xx, xy, xz, yx, yy, yz, zx, zy, zz = np.moveaxis(matrices[far].reshape(-1, 9), -1, 0)
        products[0] = 1 + xx + yy + zz, zy - yz, xz - zx, yx - xy
        products[1] = zy - yz, 1 + xx - yy - zz, xy + yx, xz + zx
        products[2] = xz - zx, xy + yx, 1 - xx + yy - zz, yz + zy
        products[3] = yx - xy, xz + zx, yz + zy, 1 - xx - yy + zz
        largest = np.argmax(np.einsum("iin->in", products), axis=0)
        quaternions[far] = products[largest, :, np.arange(len(largest))]
    lengths = np.sqrt((quaternions * quaternions).sum(axis=-1, keepdims=True))
    unit: np.ndarray = quaternions / np.where(quaternions[..., :1] < 0, -lengths, lengths)
    return unit


def rotation_vector(matrices: Float[np.ndarray, "*batch 3 3"]) -> Float[np.ndarray, "*batch 3"]:
    """Return the rotation vectors (axis · angle [rad]) of rotation matrices: their logarithm.

    The angle is in [0, π], and accurate near 0 and near π. At π both signs of the axis are correct; one of them is
    returned.

    >>> rotation_vector(Pose.from_rpy([0, 0, 0], [0, 0, 1e-9]).rotation)
    array([0.e+00, 0.e+00, 1.e-09])
    """
    quaternions = matrix_to_quaternion(matrices)
    vector_part = quaternions[..., 1:]
    sines = np.sqrt((vector_part * vector_part).sum(axis=-1))  # sines of half the angle
    nonzero = sines > 0
    factors = 2 * np.arctan2(sines, quaternions[..., 0]) / np.where(nonzero, sines, 1.0)
    vectors: np.ndarray = np.where(nonzero, factors, 2.0)[..., None] * vector_part
    return vectors


def vector_to_quaternion(vectors: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 4"]:
    """Return the quaternions (w, x, y, z) of rotation vectors [rad]: the exponential map."""
    half_angles = np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True)) / 2
    return np.concatenate([np.cos(half_angles), 0.5 * np.sinc(half_angles / np.pi) * vectors], axis=-1)


def check_pose(name: str, pose: object) -> None:
    """Raise InvalidInput unless ``pose`` is one Pose."""
    if not isinstance(pose, Pose):
        raise InvalidInput(f"{name} must be a Pose, got {shown(pose)}")
    if pose.position.ndim > 1:
        raise InvalidInput(f"{name} must be one pose, got a batch of {pose.position.shape[:-1]}; pick one: poses[0]")


# A frame on an arm.


@dataclass(frozen=True, kw_only=True)
class Frame:
    """A named frame on the arm: a pose in the frame of a link. The ``link`` −1 is the base."""

    link: int
    pose: Pose
