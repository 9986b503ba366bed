"""What users give to make an arm, checked: numbers a joint, limits and bodies."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from paretoik.errors import InvalidInput
from paretoik.inputs import real_array
from paretoik.robot.body import Body


def limit_rows(name: str, limits: object, count: int) -> Float[np.ndarray, "dof 2"]:
    """Return limits as rows (lower, upper), (count, 2); None is unlimited, a tuple (lower, upper), else symmetric."""
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
        raise InvalidInput(f"{name} wants one value or {count}, one a joint, got {limits!r}") from None
    if np.isnan(rows).any() or np.any(rows[:, 0] > rows[:, 1]):
        first = int(np.argmax(np.isnan(rows).any(axis=1) | (rows[:, 0] > rows[:, 1])))
        raise InvalidInput(
            f"{name} of joint {first + 1}: wants lower ≤ upper, got {rows[first, 0]} and {rows[first, 1]}"
        )
    return rows


def symmetric_limits(name: str, limits: object, count: int) -> Float[np.ndarray, " dof"]:
    """Return symmetric limits (count,); None means unlimited."""
    try:
        values = np.broadcast_to(real_array(name, np.inf if limits is None else limits), (count,)).copy()
    except ValueError:
        raise InvalidInput(f"{name} wants one value or {count}, one a joint, got {limits!r}") from None
    if not np.all(values > 0):
        raise InvalidInput(f"{name} wants positive values, got {limits!r}")
    return values


def number_array(name: str, values: object, count: int | None, *, positive: bool = False) -> np.ndarray:
    """Return finite numbers (count,); ``count`` None takes any length but 0. Raises InvalidInput by ``name``."""
    array = real_array(name, values)
    if array.ndim != 1 or (count is not None and len(array) != count) or not np.all(np.isfinite(array)):
        wish = "a list of finite numbers" if count is None else f"{count} finite numbers, one a joint"
        raise InvalidInput(f"{name} wants {wish}, got {values!r}")
    if len(array) == 0:
        raise InvalidInput(f"{name} wants at least one moving joint's value, got none")
    if positive and np.any(array <= 0):
        raise InvalidInput(f"{name} wants positive numbers, got {values!r}")
    return array


def body_tuple(masses: object, centers: object, inertias: object, count: int) -> tuple[Body, ...]:
    """Return one checked body a link; None is 0 for all."""
    mass = np.zeros(count) if masses is None else number_array("masses", masses, count)
    center = np.zeros((count, 3)) if centers is None else real_array("centers", centers)
    inertia = np.zeros((count, 3, 3)) if inertias is None else real_array("inertias", inertias)
    if center.shape != (count, 3) or inertia.shape != (count, 3, 3):
        raise InvalidInput(
            f"centers and inertias want shapes {(count, 3)} and {(count, 3, 3)}, got {center.shape} and {inertia.shape}"
        )
    return tuple(Body.from_values(f"link {i + 1}", mass[i], center[i], inertia[i]) for i in range(count))
