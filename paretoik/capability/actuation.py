"""What drives an arm: motors at the joints, or sliders along the links, and how fast they let each joint turn.

Source: Kim, Choi & Jang 2021, section 2.1. Their printed motor curves (Eqs. 3, 4) cannot be met by any motion; read as
diamonds they can. The geometry of rods and sliders is not in the paper: it follows from the rod's length.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Joints
from paretoik.capability.compiled import actuators as compiled
from paretoik.capability.rods import check_geometry, reached, spread
from paretoik.errors import Infeasible, InvalidInput
from paretoik.robot.arm import Arm

MotorShape = Literal["diamond", "strip", "box"]
TOGGLE = float(np.deg2rad(10.0))  # rad: nearer to 0 than this, sliders hardly turn the joint and it hardly bears a load
SHAPES: tuple[MotorShape, ...] = get_args(MotorShape)


@dataclass(frozen=True, init=False, eq=False)
class MotorCurve:
    """How fast motors may run at an effort, one motor a joint.

    ``stall`` (dof,) is the effort they can bear at most [N m, N], inf for any, ``fastest`` (dof,) their highest speed
    [rad/s, m/s].
    With t = effort / stall and u = speed / fastest, ``shape`` says where they may be: "diamond" (Eqs. 3 and 4, their
    signs put right), where the sizes of t and u sum to no more than 1; "strip", where t, u and t + u are between −1
    and 1, so that a motor which its load drives loses no speed; "box", where t and u are.

    Raises InvalidInput for what no motor can be.

    >>> MotorCurve(stall=[2.0], fastest=[3.0]).speeds(np.array([1.0]))
    (array([-1.5]), array([1.5]))
    """

    stall: Float[np.ndarray, " dof"]
    fastest: Float[np.ndarray, " dof"]
    shape: MotorShape = "diamond"

    def __init__(self, *, stall: object, fastest: object, shape: MotorShape = "diamond") -> None:
        if shape not in SHAPES:
            raise InvalidInput(f"motor curve: shape must be one of {', '.join(SHAPES)}, got {shape!r}")
        efforts, speeds = (_positive(what, each) for what, each in (("stall", stall), ("fastest", fastest)))
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
            raise InvalidInput(f"motor curve: efforts (..., {len(self.stall)}) wanted, got {effort!r}") from None
        high, low = (
            np.maximum(0.0, 1.0 - np.abs(turned))
            if self.shape == "diamond"
            else np.clip(1.0 - turned, 0.0, 1.0)
            if self.shape == "strip"
            else np.ones_like(turned)
            for turned in (share, -share)
        )
        bearable = np.abs(share) <= 1.0 + compiled.OPTIONS.overload
        return np.where(bearable, -low * self.fastest, np.nan), np.where(bearable, high * self.fastest, np.nan)

    def room(self, effort: Any, travel: Any, duration: Any = 1.0) -> Any:
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


@dataclass(frozen=True, kw_only=True, eq=False)
class JointSpeeds:
    """The lowest and highest speed of every joint, all (*batch, dof) [rad/s, m/s]; NaN where a joint cannot hold.

    ``front_low`` and ``front_high`` are the front sliders' positions [m] that attain them; 0 without sliders.
    """

    low: Joints
    high: Joints
    front_low: Joints
    front_high: Joints


@dataclass(frozen=True, kw_only=True, eq=False)
class JointActuation:
    """A motor at every joint, its curve in ``motors``. Source: Kim, Choi & Jang 2021, Eq. 4 and Table 3.

    Raises InvalidInput where ``motors`` is no ``MotorCurve``.
    """

    motors: MotorCurve

    def __post_init__(self) -> None:
        if not isinstance(self.motors, MotorCurve):
            raise InvalidInput(f"joint actuation: motors wants a MotorCurve, got {self.motors!r}")

    @classmethod
    def of(cls, arm: Arm, *, shape: MotorShape = "box") -> JointActuation:
        """Return motors with an arm's own torque and velocity limits.

        Raises InvalidInput for what is no arm, and, naming the joint, where it has no velocity limit.
        """
        check_arm(arm)
        for name, fastest in zip(arm.joint_names, arm.velocity_limits, strict=True):
            if not np.isfinite(fastest):
                raise InvalidInput(f"actuation of {arm.name}: {name} wants a velocity limit, has none")
        return cls(motors=MotorCurve(stall=arm.torque_limits, fastest=arm.velocity_limits, shape=shape))

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.motors.stall)

    @property
    def curves(self) -> tuple[MotorCurve, ...]:
        """The motors of every joint: one."""
        return (self.motors,)

    @cached_property
    def table(self) -> Float[np.ndarray, "dof columns"]:
        """What ``motors`` reads: a row a joint."""
        rows = np.zeros((self.dof, compiled.COLUMNS))
        rows[:, compiled.SHAPE] = SHAPES.index(self.motors.shape)
        rows[:, compiled.STALL], rows[:, compiled.FASTEST] = self.motors.stall, self.motors.fastest
        return rows


@dataclass(frozen=True, init=False, eq=False)
class DistributedActuation:
    """Two sliders a joint: a rod of length c joins one at s on the link to one at s_b on the link before.

    c² = s² + s_b² + 2 s s_b cos θ, so that θ̇ = A ṡ + B ṡ_b with A = (s + s_b cos θ)/(s s_b sin θ) and
    B = (s_b + s cos θ)/(s s_b sin θ), and a torque τ asks for the forces A τ and B τ. Both sliders may be anywhere
    within their bounds: they are gears to choose.

    Parameters
    ----------
    front, back
        Motors of the sliders on the link and on the link before [N, m/s], of one shape; ``back`` is ``front``
        where it is not given.
    rod
        c (dof,) [m].
    front_bounds, back_bounds
        Where sliders may be, (lower, upper) or (dof, 2) [m]; ``back_bounds`` are ``front_bounds`` where not given.
        Front sliders stay within the rod's length.
    zero, bend
        Joint positions [rad] at which θ is 0, and the way (1 or −1) in which θ grows: θ = bend (q − zero).
    least_angle
        How far θ stays from 0 and π at least [rad], 10° by default: these are toggles, where the rod comes to lie along
        both links.

    Raises InvalidInput naming what cannot be. Source: Kim, Choi & Jang 2021, section 2.1 and Table 2, for what it
    prints; the formulae are derived, and ``zero``, ``bend``, ``least_angle`` and ``back_bounds`` are not in the paper.
    """

    front: MotorCurve
    rod: Float[np.ndarray, " dof"]
    front_bounds: Float[np.ndarray, "dof 2"]
    back: MotorCurve
    back_bounds: Float[np.ndarray, "dof 2"]
    zero: Float[np.ndarray, " dof"]
    bend: Float[np.ndarray, " dof"]
    least_angle: Float[np.ndarray, " dof"]

    def __init__(
        self,
        *,
        front: MotorCurve,
        rod: object,
        front_bounds: object,
        back: MotorCurve | None = None,
        back_bounds: object = None,
        zero: object = 0.0,
        bend: object = 1.0,
        least_angle: object = TOGGLE,
    ) -> None:
        back = front if back is None else back
        for what, curve in (("front", front), ("back", back)):
            if not isinstance(curve, MotorCurve):
                raise InvalidInput(f"distributed actuation: {what} wants a MotorCurve, got {curve!r}")
        dof = len(front.stall)
        if len(back.stall) != dof or back.shape != front.shape:
            raise InvalidInput(
                f"distributed actuation: back wants {dof} motors of shape {front.shape}, "
                f"got {len(back.stall)} of shape {back.shape}"
            )
        numbers = {"rod": rod, "zero": zero, "bend": bend, "least_angle": least_angle}
        settled = {name: spread(name, value, (dof,)) for name, value in numbers.items()}
        pairs = {"front_bounds": front_bounds, "back_bounds": front_bounds if back_bounds is None else back_bounds}
        settled |= {name: spread(name, value, (dof, 2)) for name, value in pairs.items()}
        check_geometry(**settled)
        for name, value in {"front": front, "back": back, **settled}.items():
            object.__setattr__(self, name, value)
        _ = self.angle_bounds  # it refuses sliders that reach none

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.rod)

    @property
    def curves(self) -> tuple[MotorCurve, ...]:
        """The motors of every joint: those of the front and of the back slider."""
        return (self.front, self.back)

    @cached_property
    def table(self) -> Float[np.ndarray, "dof columns"]:
        """What ``motors`` reads: a row a joint."""
        rows = np.zeros((self.dof, compiled.COLUMNS))
        rows[:, compiled.SHAPE] = SHAPES.index(self.front.shape)
        rows[:, compiled.STALL], rows[:, compiled.FASTEST] = self.front.stall, self.front.fastest
        rows[:, compiled.BACK_STALL], rows[:, compiled.BACK_FASTEST] = self.back.stall, self.back.fastest
        rows[:, compiled.ROD], rows[:, compiled.ZERO], rows[:, compiled.BEND] = self.rod, self.zero, self.bend
        rows[:, compiled.ANGLE : compiled.ANGLE + 2] = self.angle_bounds
        rows[:, compiled.FRONT : compiled.FRONT + 2] = self.front_bounds
        rows[:, compiled.BACK : compiled.BACK + 2] = self.back_bounds
        return rows

    @cached_property
    def angle_bounds(self) -> Float[np.ndarray, "dof 2"]:
        """The least and the largest rod's angle θ [rad] that sliders within their bounds can give."""
        return np.array(
            [
                reached(*each)
                for each in zip(self.rod, self.front_bounds, self.back_bounds, self.least_angle, strict=True)
            ]
        )

    def angles(self, q: Joints) -> Joints:
        """Return the rods' angles θ (*batch, dof) [rad] at joint positions, as they are: not brought to one turn."""
        return self.bend * (q - self.zero)

    def gears(self, q: Joints, front: Joints) -> tuple[Joints, Joints, Joints]:
        """Return s_b [m], A and B [rad/m], all (*batch, dof), at joint positions and front sliders [m].

        A and B are per unit of the joint's own angle, ``bend`` in them. They run on complex numbers too, so that their
        derivatives can be had exactly.
        """
        angle = self.angles(q)
        back, a, b = compiled.gears.py_func(np.sin(angle), np.cos(angle), front, self.rod)
        return back, self.bend * a, self.bend * b


Actuation: TypeAlias = JointActuation | DistributedActuation


def joint_speeds(actuation: Actuation, q: Joints, torque: Joints) -> JointSpeeds:
    """Return how fast each joint may turn while it holds a torque, sliders at their best; all (*batch, dof).

    Raises InvalidInput where the arrays don't fit.
    """
    high, low = (_best(actuation, q, turned, compiled.SPEED) for turned in (torque, -torque))
    return JointSpeeds(low=-low[..., 0], high=high[..., 0], front_low=low[..., 1], front_high=high[..., 1])


def speeds_with(actuation: Actuation, q: Joints, torque: Joints, front: Joints) -> tuple[Joints, Joints]:
    """Return the lowest and highest joint speeds with front sliders where they are, all (*batch, dof).

    NaN where a motor cannot bear the torque. Without sliders ``front`` is not looked at.
    """
    if isinstance(actuation, JointActuation):
        return actuation.motors.speeds(torque)
    ratios = actuation.gears(q, front)[1:]
    ends = [
        np.sort([ratio * speed for speed in curve.speeds(ratio * torque)], axis=0)
        for ratio, curve in zip(ratios, actuation.curves, strict=True)
    ]
    return ends[0][0] + ends[1][0], ends[0][1] + ends[1][1]


def holding(actuation: Actuation, q: Joints) -> tuple[Joints, Joints]:
    """Return the torque [N m, N] that each joint can hold at rest, and the front sliders for it; both (*batch, dof).

    NaN where no slider fits. Raises InvalidInput where the arrays don't fit.
    """
    found = _best(actuation, q, np.zeros_like(q), compiled.HOLD)
    return found[..., 0], found[..., 1]


def check_arm(arm: object) -> None:
    """Raise InvalidInput for what is no arm."""
    if not isinstance(arm, Arm):
        raise InvalidInput(f"arm: an Arm wanted, got {arm!r}")


def check_actuation(actuation: object, arm: Arm) -> None:
    """Raise InvalidInput unless ``arm`` is one, and ``actuation`` drives as many joints as it has."""
    check_arm(arm)
    if not isinstance(actuation, JointActuation | DistributedActuation):
        raise InvalidInput(f"actuation: a JointActuation or DistributedActuation wanted, got {actuation!r}")
    if actuation.dof != arm.dof:
        raise InvalidInput(f"actuation: {arm.dof} joints of {arm.name} wanted, got {actuation.dof}")
    if isinstance(actuation, DistributedActuation) and not arm.periodic.all():
        sliding = arm.joint_names[int(np.argmin(arm.periodic))]
        raise InvalidInput(f"actuation: rods turn joints, but {sliding} of {arm.name} slides")


def overloaded(actuation: Actuation, arm: Arm, q: Joints, torque: Joints) -> Infeasible:
    """Return the error that says which joint of one posture (dof,) cannot hold what, or has no slider that fits."""
    can, _ = holding(actuation, q)
    share = np.where(np.isnan(can), np.inf, np.abs(torque) / np.where(can > 0, can, 1e-300))
    worst = int(np.argmax(share))
    name = arm.joint_names[worst]
    if np.isnan(can[worst]):
        assert isinstance(actuation, DistributedActuation)
        angle = np.rad2deg(np.mod(actuation.angles(q)[worst] + np.pi, 2 * np.pi) - np.pi)
        least, most = np.rad2deg(actuation.angle_bounds[worst])
        return Infeasible(
            f"{name}: a rod's angle that its sliders can reach wanted, {least:.4g}° to {most:.4g}° (0 and 180° are "
            f"toggles), got {angle:.4g}°",
            limit=f"angle of {name}",
        )
    return Infeasible(
        f"{name}: a torque of at most {can[worst]:.4g} N m wanted, what its motor can hold there, "
        f"got {abs(torque[worst]):.4g} N m",
        limit=f"torque of {name}",
        violation=float(share[worst] - 1.0),
    )


def _best(actuation: Actuation, q: Joints, torque: Joints, what: int) -> np.ndarray:
    q, torque = (np.ascontiguousarray(each, dtype=float) for each in (q, torque))
    if q.shape != torque.shape or not q.ndim or q.shape[-1] != actuation.dof:
        raise InvalidInput(f"actuation: arrays (..., {actuation.dof}) wanted, got {q.shape} and {torque.shape}")
    found = np.empty((q.size // actuation.dof, actuation.dof, 2))
    compiled.joint_maxima(actuation.table, *(each.reshape(-1, actuation.dof) for each in (q, torque)), what, found)
    return found.reshape(*q.shape, 2)


def _positive(what: str, value: object) -> Float[np.ndarray, " dof"]:
    """Return positive numbers, one a joint, inf among them; raise InvalidInput for what is none."""
    try:
        found = np.atleast_1d(np.array(value, dtype=float))
    except (TypeError, ValueError):
        found = np.empty(0)
    if found.ndim != 1 or not len(found) or not np.all(found > 0) or np.iscomplexobj(np.asarray(value)):
        raise InvalidInput(f"motor curve: {what} wants positive numbers, one a joint, got {value!r}")
    found.setflags(write=False)
    return found
