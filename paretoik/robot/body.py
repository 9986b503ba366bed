"""A rigid body: mass, centre of gravity and inertia in some frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Matrix3, Vector3
from paretoik.errors import InvalidInput
from paretoik.inputs import (
    check_magnitude,
    finite_number,
    real_array,
    shown,
)
from paretoik.robot.pose import Pose


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """Mass [kg], centre of gravity [m] and inertia about this centre [kg m²], in one frame."""

    mass: float
    center: Vector3
    inertia: Matrix3

    @classmethod
    def from_values(cls, name: str, mass: float, center: object, inertia: object) -> Body:
        """Return a body of checked values; ``inertia`` None means a point mass.

        Raises InvalidInput, with ``name``, for a negative mass, infinite numbers, or an inertia that no real body has.
        """
        mass = finite_number(f"{name}: mass", mass)
        position = real_array(f"{name}: centre of gravity", center)
        tensor = np.zeros((3, 3)) if inertia is None else real_array(f"{name}: inertia", inertia)
        if mass < 0:
            raise InvalidInput(f"{name}: mass must be a finite number, not negative, got {mass}")
        if position.shape != (3,) or not np.all(np.isfinite(position)):
            raise InvalidInput(f"{name}: centre of gravity must be three finite numbers, got {shown(center)}")
        if tensor.shape != (3, 3) or not np.all(np.isfinite(tensor)):
            raise InvalidInput(f"{name}: inertia must be 3 × 3 finite numbers, got {shown(inertia)}")
        check_magnitude(f"{name}: mass", mass, "kg")
        check_magnitude(f"{name}: centre of gravity", position, "m")
        check_magnitude(f"{name}: inertia", tensor, "kg m²")
        if fault := inertia_fault(tensor):
            raise InvalidInput(f"{name}: {fault}")
        return cls(mass=mass, center=position, inertia=tensor)

    @property
    def first_moment(self) -> Vector3:
        """First moment of mass, mass · center [kg m]."""
        return self.mass * self.center

    @property
    def inertia_about_origin(self) -> Matrix3:
        """Inertia about the origin of the frame [kg m²]."""
        c = self.center
        about: Matrix3 = self.inertia + self.mass * (c @ c * np.eye(3) - np.outer(c, c))
        return about

    @property
    def pseudo_inertia(self) -> Float[np.ndarray, "4 4"]:
        """∫ (r, 1)(r, 1)ᵀ dm about the origin of the frame.

        The entries are second moments [kg m²], first moments [kg m] and mass [kg].

        Source: Wensing, Kim & Slotine 2018.
        """
        inertia = self.inertia_about_origin
        second = np.trace(inertia) / 2 * np.eye(3) - inertia
        return np.block([[second, self.first_moment[:, None]], [self.first_moment[None, :], np.array([[self.mass]])]])


def inertia_fault(inertia: Matrix3) -> str | None:
    """Return why a tensor is no real body's inertia, or None."""
    size = float(np.abs(inertia).max())
    if size < 1e-15:  # kg m²: below the inertia of a grain of sand and the rounding errors of real files
        return None
    if np.abs(inertia - inertia.T).max() > 1e-9 * size:
        return f"inertia must be symmetric, got {shown(inertia.tolist())}"
    principal = np.linalg.eigvalsh(inertia)
    if principal[0] < -1e-9 * size:
        return f"inertia must be positive, got smallest principal moment {principal[0]:.3g} kg m²"
    if principal[0] + principal[1] < principal[2] * (1 - 1e-6):
        return (
            f"inertia must satisfy the triangle inequality, got principal moments {principal[0]:.4g}, "
            f"{principal[1]:.4g} and {principal[2]:.4g} kg m²"
        )
    return None


def nearest_inertia(inertia: Matrix3) -> Matrix3:
    """Return the nearest inertia of a real body.

    No eigenvalue of a real body's second moments ∫ r rᵀ dm = ½ tr(I) 1 − I is negative: negative ones become 0. Source:
    Wensing, Kim & Slotine 2018.
    """
    moments, axes = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
    moments = np.maximum(moments, 0.0)
    nearest: Matrix3 = (axes * (moments.sum() - moments)) @ axes.T
    return nearest


def transform_body(body: Body, pose: Pose) -> Body:
    """Return a body in the parent frame of ``pose``. The given body is in the frame at ``pose``."""
    rotation = pose.rotation
    return Body(mass=body.mass, center=pose.apply(body.center), inertia=rotation @ body.inertia @ rotation.T)


def combine_bodies(first: Body, second: Body) -> Body:
    """Return the two bodies as one."""
    mass = first.mass + second.mass
    if mass == 0.0:
        return Body(mass=0.0, center=first.center, inertia=first.inertia + second.inertia)
    center = (first.first_moment + second.first_moment) / mass
    about = Body(mass=mass, center=center, inertia=np.zeros((3, 3))).inertia_about_origin
    return Body(mass=mass, center=center, inertia=first.inertia_about_origin + second.inertia_about_origin - about)
