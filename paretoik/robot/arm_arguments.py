"""Types of joints, names of frames, and checks of the arguments that make an arm."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik.errors import InvalidInput
from paretoik.inputs import (
    check_choice,
    check_magnitude,
    check_text,
    finite_array,
    read_list,
    real_array,
    shown,
)
from paretoik.robot.body import Body

JointType: TypeAlias = Literal["revolute", "continuous", "prismatic"]
JOINT_TYPES: tuple[JointType, ...] = ("revolute", "continuous", "prismatic")
TOOL_FRAME, BASE_FRAME = OWN_FRAMES = ("<tool>", "<base>")  # frames of every arm; no joint or link has these names
OTHER_NAMES = ("tool", "base")  # names of the same frames, unless a joint or link has them


def limit_rows(name: str, limits: object, count: int) -> Float[np.ndarray, "dof 2"]:
    """Return limits as rows (count, 2); a tuple is (lower, upper), None is unlimited, other values are symmetric."""
    if limits is None:
        return np.tile([-np.inf, np.inf], (count, 1))
    if isinstance(limits, tuple) and len(limits) == 2:
        lower, upper = (real_array(name, side) for side in limits)
    else:
        upper = real_array(name, limits)
        lower = -upper
    try:
        rows = np.stack([np.broadcast_to(side, (count,)) for side in (lower, upper)], axis=-1)
    except ValueError:
        raise InvalidInput(f"{name} must be one value or {count}, one per joint, got {shown(limits)}") from None
    check_magnitude(name, rows, "")
    if np.isnan(rows).any() or np.any(rows[:, 0] > rows[:, 1]):
        first = int(np.argmax(np.isnan(rows).any(axis=1) | (rows[:, 0] > rows[:, 1])))
        raise InvalidInput(
            f"{name} of joint {first + 1} must be lower ≤ upper, got {rows[first, 0]} and {rows[first, 1]}"
        )
    return rows


def symmetric_limits(name: str, limits: object, count: int) -> Float[np.ndarray, " dof"]:
    """Return symmetric limits (count,); None means unlimited."""
    try:
        values = np.broadcast_to(real_array(name, np.inf if limits is None else limits), (count,)).copy()
    except ValueError as fault:
        if isinstance(fault, InvalidInput):
            raise
        raise InvalidInput(f"{name} must be one value or {count}, one per joint, got {shown(limits)}") from None
    if not np.all(values > 0):
        raise InvalidInput(f"{name} must be positive values, got {shown(limits)}")
    check_magnitude(name, values, "", positive=True)
    return values


def joint_tuple(names: object, count: int) -> tuple[str, ...]:
    """Return ``count`` different names of joints; raises InvalidInput for others and for the arm's own frames."""
    joints = read_list("joint_names", names, str, "a list of names")
    if len(joints) != count or len(set(joints)) != count:
        raise InvalidInput(f"joint_names must be {count} different names, got {shown(names)}")
    for joint in joints:
        check_text("joint_names", joint)
        if joint in (*OWN_FRAMES, *OTHER_NAMES):
            wish = f"must differ from the names of the arm's own frames, {', '.join((*OTHER_NAMES, *OWN_FRAMES))}"
            raise InvalidInput(f"joint_names {wish}, got {shown(joint)}")
    return joints


def type_tuple(types: object, count: int) -> tuple[JointType, ...]:
    """Return ``count`` types of joints; None means revolute. Raises InvalidInput for others."""
    if types is None:
        return tuple[JointType, ...](["revolute"] * count)
    kinds = read_list("types", types, str, "a list of types of joints")
    if len(kinds) != count:
        raise InvalidInput(f"types must be {count} values, one per joint, got {len(kinds)}")
    for kind in kinds:
        check_choice("types", kind, JOINT_TYPES)
    return kinds


def number_array(name: str, values: object, count: int | None, *, positive: bool = False) -> np.ndarray:
    """Return finite numbers, one per joint; raises InvalidInput for others.

    count: number of joints, None for any number from 1 to 1000
    """
    array = real_array(name, values)
    if count is None and array.ndim == 1 and array.size > 1000:  # a mistake; Jacobians would fill the memory
        raise InvalidInput(f"{name} must be at most 1000 values, one per joint, got {array.size}")
    if array.ndim != 1 or (count is not None and len(array) != count) or not np.all(np.isfinite(array)):
        wish = "a list of finite numbers" if count is None else f"{count} finite numbers, one per joint"
        raise InvalidInput(f"{name} must be {wish}, got {shown(values)}")
    if len(array) == 0:
        raise InvalidInput(f"{name} must be at least one value, one per joint, got none")
    if positive and np.any(array <= 0):
        raise InvalidInput(f"{name} must be positive numbers, got {shown(values)}")
    check_magnitude(name, array, "", positive=positive)
    return array


def body_tuple(masses: object, centers: object, inertias: object, count: int) -> tuple[Body, ...]:
    """Return one checked body per link; None means 0 for all."""
    mass = np.zeros(count) if masses is None else number_array("masses", masses, count)
    center = np.zeros((count, 3)) if centers is None else real_array("centers", centers)
    inertia = np.zeros((count, 3, 3)) if inertias is None else real_array("inertias", inertias)
    if center.shape != (count, 3) or inertia.shape != (count, 3, 3):
        raise InvalidInput(
            f"centers and inertias must have shapes {(count, 3)} and {(count, 3, 3)}, got {center.shape} and "
            f"{inertia.shape}"
        )
    return tuple(Body.from_values(f"link {i + 1}", mass[i], center[i], inertia[i]) for i in range(count))


def planar_bodies(masses: object, centers: object, inertias: object, count: int) -> tuple[Body, ...]:
    """Return one body per link of a planar arm: centre on the x axis, inertia about z. None means 0 for all."""
    mass, center, inertia = (
        np.zeros(count) if values is None else number_array(name, values, count)
        for name, values in (("masses", masses), ("centers", centers), ("inertias", inertias))
    )
    if masses is not None and (np.any(mass < 0) or np.any(inertia < 0)):
        lowest = min(mass.min(), inertia.min())
        raise InvalidInput(f"planar arm: masses and inertias must not be negative, got {lowest:g}")
    return tuple(
        Body(mass=float(m), center=np.array([c, 0.0, 0.0]), inertia=np.diag([0.0, j, j]))
        for m, c, j in zip(mass, center, inertia, strict=True)
    )


def joint_positions(q: object, dof: int) -> np.ndarray:
    """Return finite joint positions (*batch, dof) as floats. Raises InvalidInput."""
    positions = finite_array("q", q)
    if positions.shape[-1:] != (dof,):
        raise InvalidInput(f"q: must have shape (..., {dof}), one per joint, got shape {positions.shape}")
    return positions
