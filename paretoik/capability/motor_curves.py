"""Motor curves: how fast a motor may run at an effort.

Source: Kim, Choi & Jang 2021, Eqs. 3 and 4. As printed no motion can keep them; read as diamonds they can be kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Joints, read_only
from paretoik.call_arguments import check_call
from paretoik.capability.compiled import actuators
from paretoik.errors import InvalidInput
from paretoik.inputs import check_choice, real_array, shown
from paretoik.tables import field_representation, html_representation

MotorShape = Literal["diamond", "strip", "box"]
SHAPES: tuple[MotorShape, ...] = get_args(MotorShape)


@check_call
@dataclass(frozen=True, init=False, eq=False)
class MotorCurve:
    """How fast motors may run at an effort, one motor a joint.

    ``stall`` (dof,) is the effort they can bear at most [N m, N], inf for any, ``fastest`` (dof,) their highest speed
    [rad/s, m/s]. With t = effort / stall and u = speed / fastest, ``shape`` says where they may be: "diamond" (Eqs. 3
    and 4, their signs put right), where |t| + |u| ≤ 1; "strip", where t, u and t + u are between −1 and 1, so that a
    motor which its load drives loses no speed; "box", where t and u are.

    Raises InvalidInput for what no motor can be.

    >>> MotorCurve(stall=[2.0], fastest=[3.0]).speeds(np.array([1.0]))
    (array([-1.5]), array([1.5]))
    """

    stall: Float[np.ndarray, " dof"]
    fastest: Float[np.ndarray, " dof"]
    shape: MotorShape = "diamond"

    __repr__ = field_representation
    _repr_html_ = html_representation

    def __init__(self, *, stall: object, fastest: object, shape: MotorShape = "diamond") -> None:
        check_choice("motor curve: shape", shape, SHAPES)
        efforts, speeds = (_positive(name, each) for name, each in (("stall", stall), ("fastest", fastest)))
        if len(speeds) != len(efforts):
            raise InvalidInput(f"motor curve: {len(efforts)} fastest wanted, one for each stall, got {len(speeds)}")
        if not np.isfinite(speeds).all():
            raise InvalidInput(f"motor curve: fastest wants finite speeds, got {speeds.tolist()}")
        for name, value in (("stall", efforts), ("fastest", speeds), ("shape", shape)):
            object.__setattr__(self, name, value)

    def speeds(self, effort: Joints) -> tuple[Joints, Joints]:
        """Return the lowest and highest speed at efforts (*batch, dof); NaN where they are more than ``stall``.

        Raises InvalidInput for what is not of that shape.
        """
        try:
            share = np.asarray(effort, dtype=float) / self.stall
        except (TypeError, ValueError):
            raise InvalidInput(f"motor curve: efforts (..., {len(self.stall)}) wanted, got {shown(effort)}") from None
        high, low = (
            np.maximum(0.0, 1.0 - np.abs(turned))
            if self.shape == "diamond"
            else np.clip(1.0 - turned, 0.0, 1.0)
            if self.shape == "strip"
            else np.ones_like(turned)
            for turned in (share, -share)
        )
        bearable = np.abs(share) <= 1.0 + actuators.OPTIONS.overload
        return np.where(bearable, -low * self.fastest, np.nan), np.where(bearable, high * self.fastest, np.nan)

    def slacks(self, effort: Any, travel: Any, duration: Any = 1.0) -> Any:
        """Return smooth numbers (*batch, dof, rows), four or six a motor, none negative where effort and travel fit.

        Travel [rad, m] in the duration [s], a speed where that is 1. All may be complex numbers or expressions, so that
        derivatives can be had exactly.
        """
        d, t, u = duration, effort / self.stall, travel / self.fastest
        rows: tuple[Any, ...]
        if self.shape == "diamond":
            rows = (d * (1 - t) - u, d * (1 - t) + u, d * (1 + t) - u, d * (1 + t) + u)
        elif self.shape == "strip":
            rows = (d * (1 - t) - u, d * (1 + t) + u, d - u, d + u, 1 - t, 1 + t)
        else:
            rows = (d - u, d + u, 1 - t, 1 + t)
        return np.stack(rows, axis=-1)


def _positive(name: str, value: object) -> Float[np.ndarray, " dof"]:
    """Return positive numbers, one a joint, inf among them; raise InvalidInput for what is none."""
    numbers = np.atleast_1d(real_array(f"motor curve: {name} wants positive numbers, one a joint", value))
    if numbers.ndim != 1 or not len(numbers) or not np.all(numbers > 0):
        raise InvalidInput(f"motor curve: {name} wants positive numbers, one a joint, got {shown(value)}")
    return read_only(numbers)
