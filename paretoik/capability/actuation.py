"""Actuations of an arm: motors at the joints, or sliders along the links.

Source: Kim, Choi & Jang 2021, section 2.1. The geometry of rods and sliders is not in the paper: it follows from the
rod's length.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Joints
from paretoik.capability import actuator_kernels as actuators
from paretoik.errors import InvalidInput
from paretoik.inputs import check_choice, check_instance, finite_array, finite_number, real_array, shown
from paretoik.robot.arm import Arm
from paretoik.robot.pose import freeze
from paretoik.tables import represented

# Motor curves: the highest speed of a motor at an effort. Source: Kim, Choi & Jang 2021, Eqs. 3 and 4.
# No motion satisfies the curves as printed; they are read as diamonds here, which motions can satisfy.

MotorShape = Literal["diamond", "strip", "box"]
SHAPES: tuple[MotorShape, ...] = get_args(MotorShape)


@represented
@dataclass(frozen=True, init=False, eq=False)
class MotorCurve:
    """Highest speeds of motors at an effort, one motor per joint.

    stall: largest efforts (dof,) that motors can bear [N m, N]; inf: any effort
    fastest: highest speeds (dof,) [rad/s, m/s]
    shape: region of t = effort / stall and u = speed / fastest: "diamond" (Eqs. 3 and 4, their signs corrected) is
        |t| + |u| ≤ 1; "strip" is t, u and t + u in [−1, 1]: a motor driven by its load loses no speed; "box" is t and u
        in [−1, 1]

    Raises InvalidInput for numbers that no motor can have.

    >>> MotorCurve(stall=[2.0], fastest=[3.0]).speeds(np.array([1.0]))
    (array([-1.5]), array([1.5]))
    """

    stall: Float[np.ndarray, " dof"]
    fastest: Float[np.ndarray, " dof"]
    shape: MotorShape = "diamond"

    def __init__(self, *, stall: object, fastest: object, shape: MotorShape = "diamond") -> None:
        check_choice("motor curve: shape", shape, SHAPES)
        freeze(self, shape=shape)
        for name, value in (("stall", stall), ("fastest", fastest)):
            wish = f"motor curve: {name} must be positive numbers, one per joint"
            numbers = np.atleast_1d(real_array(wish, value))
            if numbers.ndim != 1 or not len(numbers) or not np.all(numbers > 0):
                raise InvalidInput(f"{wish}, got {shown(value)}")
            freeze(self, **{name: numbers})
        count, speeds = len(self.stall), self.fastest
        if len(speeds) != count:
            raise InvalidInput(f"motor curve: fastest must be {count} numbers, one per stall, got {len(speeds)}")
        if not np.isfinite(speeds).all():
            raise InvalidInput(f"motor curve: fastest must be finite speeds, got {speeds.tolist()}")

    def speeds(self, effort: Joints) -> tuple[Joints, Joints]:
        """Return the lowest and highest speeds at efforts (*batch, dof).

        Speeds are NaN beyond ``stall``. Raises InvalidInput for another shape.
        """
        try:
            share = np.asarray(effort, dtype=float) / self.stall
        except (TypeError, ValueError):
            raise InvalidInput(f"motor curve: efforts must be (..., {len(self.stall)}), got {shown(effort)}") from None
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
        """Return smooth slacks (*batch, dof, rows) of efforts and travels; none is negative if they are possible.

        A motor makes the travel [rad, m] in the duration [s]. Arguments may be complex numbers or expressions, for
        exact derivatives.
        """
        d, t, u = duration, effort / self.stall, travel / self.fastest
        if self.shape == "diamond":
            return np.stack([d * (1 - t) - u, d * (1 - t) + u, d * (1 + t) - u, d * (1 + t) + u], axis=-1)
        if self.shape == "strip":
            return np.stack([d * (1 - t) - u, d * (1 + t) + u, d - u, d + u, 1 - t, 1 + t], axis=-1)
        return np.stack([d - u, d + u, 1 - t, 1 + t], axis=-1)


# Rods between two sliders: their geometry, and the angles that they reach.


def angle_range(rod: float, front: np.ndarray, back: np.ndarray, least_angle: float) -> tuple[float, float]:
    """Return the least and largest θ [rad] of sliders within bounds; raises InvalidInput if no θ is possible.

    cos θ = (c² − s² − s_b²) / (2 s s_b) rises with s until s² = s_b² − c², then falls; it depends on s_b in the same
    way. So its minimum is at a corner of the bounds, its maximum at a corner or at such a turning point.
    """
    places = [(s, b) for s in front for b in back]
    for fixed, (low, high), turned in ((front, back, False), (back, front, True)):
        turning = [np.clip(np.sqrt(max(one * one - rod * rod, 0.0)), low, high) for one in fixed]
        places += [(b, s) if turned else (s, b) for s, b in zip(fixed, turning, strict=True)]
    cosines = [(rod * rod - s * s - b * b) / (2 * s * b) for s, b in places]
    ends = np.arccos(np.clip([max(cosines), min(cosines)], -1.0, 1.0))
    fits = min(cosines) <= 1.0 and max(cosines) >= -1.0
    low, high = max(float(ends[0]), least_angle), min(float(ends[1]), np.pi - least_angle)
    if not fits or low > high:
        raise InvalidInput(
            f"distributed actuation: sliders must reach a rod's angle away from its toggles, got front "
            f"{front.tolist()} m and back {back.tolist()} m with a rod of {rod:g} m"
        )
    return low, high


# Actuations of an arm, and those of the paper.


@represented
@dataclass(frozen=True, kw_only=True, eq=False)
class JointActuation:
    """A motor at every joint. Source: Kim, Choi & Jang 2021, Eq. 4 and Table 3.

    motors: curve of the motors, one motor per joint

    Raises InvalidInput if ``motors`` is not a ``MotorCurve``.
    """

    motors: MotorCurve

    def __post_init__(self) -> None:
        if not isinstance(self.motors, MotorCurve):
            raise InvalidInput(f"joint actuation: motors must be a MotorCurve, got {shown(self.motors)}")

    @classmethod
    def of(cls, arm: Arm, *, shape: MotorShape = "box") -> JointActuation:
        """Return motors with an arm's own torque and velocity limits.

        Raises InvalidInput if ``arm`` is not an Arm, or if a joint, which it names, has no velocity limit.
        """
        check_instance("arm", arm, Arm, "an Arm")
        for name, fastest in zip(arm.joint_names, arm.velocity_limits, strict=True):
            if not np.isfinite(fastest):
                raise InvalidInput(f"actuation of {arm.name}: {name} must have a velocity limit, got none")
        return cls(motors=MotorCurve(stall=arm.torque_limits, fastest=arm.velocity_limits, shape=shape))

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.motors.stall)

    @property
    def curves(self) -> tuple[MotorCurve, ...]:
        """Motors of every joint: one curve."""
        return (self.motors,)

    def ratios(self, q: Joints, front: Joints) -> Float[np.ndarray, "*batch 1 dof"]:
        """Return the speeds of joints per speed of their motors: 1."""
        return np.ones((*q.shape[:-1], 1, q.shape[-1]))

    @cached_property
    def table(self) -> Float[np.ndarray, "dof columns"]:
        """Table for ``actuator_kernels``, one row per joint."""
        rows = np.zeros((self.dof, actuators.COLUMNS))
        rows[:, actuators.SHAPE] = SHAPES.index(self.motors.shape)
        rows[:, actuators.STALL], rows[:, actuators.FASTEST] = self.motors.stall, self.motors.fastest
        return rows


@represented
@dataclass(frozen=True, init=False, eq=False)
class DistributedActuation:
    """Two sliders per joint, joined by a rod.

    A rod of length c joins a slider at s on the link to one at s_b on the previous link:
    c² = s² + s_b² + 2 s s_b cos θ, so that θ̇ = A ṡ + B ṡ_b with A = (s + s_b cos θ)/(s s_b sin θ) and
    B = (s_b + s cos θ)/(s s_b sin θ), and a torque τ needs the forces A τ and B τ. Both sliders may be anywhere
    within their bounds, like gears that can be chosen.

    front: motors of the sliders on the link [N, m/s]
    back: motors of the sliders on the previous link [N, m/s], of the same shape; default: ``front``
    rod: lengths c (dof,) of the rods [m]
    front_bounds: bounds of the front sliders, (lower, upper) or (dof, 2) [m], at most the rod's length
    back_bounds: bounds of the back sliders, (lower, upper) or (dof, 2) [m]; default: ``front_bounds``
    zero: joint positions [rad] at which θ is 0
    bend: sign (1 or −1) of θ: θ = bend (q − zero)
    least_angle: least distance of θ from 0 and π [rad], 10° by default

    0 and π are toggles: the rod is along both links. Near them, sliders turn a joint faster, but less far, so that
    ``least_angle`` excludes fast postures. With the paper's sliders, at its nine positions, 10° costs 7 % of the speed
    on average and 46 % at most compared with 5°, and 9 % and 91 % compared with no bound (``studies.kim_2021`` prints
    these).

    Raises InvalidInput, naming the argument that is impossible. Source: Kim, Choi & Jang 2021, section 2.1 and Table 2.
    The formulae are derived; ``zero``, ``bend``, ``least_angle`` and ``back_bounds`` are not in the paper.
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
        least_angle: object = float(np.deg2rad(10.0)),
    ) -> None:
        back = front if back is None else back
        for name, curve in (("front", front), ("back", back)):
            if not isinstance(curve, MotorCurve):
                raise InvalidInput(f"distributed actuation: {name} must be a MotorCurve, got {shown(curve)}")
        dof = len(front.stall)
        if len(back.stall) != dof or back.shape != front.shape:
            raise InvalidInput(
                f"distributed actuation: back must be {dof} motors of shape {front.shape}, "
                f"got {len(back.stall)} of shape {back.shape}"
            )
        freeze(self, front=front, back=back)
        numbers = {"rod": rod, "zero": zero, "bend": bend, "least_angle": least_angle}
        pairs = {"front_bounds": front_bounds, "back_bounds": front_bounds if back_bounds is None else back_bounds}
        for name, given in {**numbers, **pairs}.items():
            values, shape = finite_array(f"distributed actuation: {name}", given), (dof, 2) if name in pairs else (dof,)
            try:
                values = np.broadcast_to(values, shape).copy()
            except ValueError:
                wish = f"distributed actuation: {name} must have shape {shape}"
                raise InvalidInput(f"{wish}, got {values.shape}") from None
            freeze(self, **{name: values})

        # errors of impossible lengths, bounds and angles name the joint
        def refuse(wrong: np.ndarray, wish: str, fact: np.ndarray) -> None:
            if wrong.any():
                j = int(np.argmax(wrong))
                raise InvalidInput(f"distributed actuation, joint {j + 1}: {wish}, got {fact[j].tolist()}")

        length, least = self.rod, self.least_angle
        longest = np.sqrt(np.finfo(float).max) / 4  # m: squares of longer lengths may overflow
        refuse((length <= 0) | (length > longest), f"rod must be longer than 0 and at most {longest:g} m", length)
        refuse(~np.isin(self.bend, (-1.0, 1.0)), "bend must be 1 or −1", self.bend)
        refuse((least <= 0) | (least >= np.pi), "least_angle must be between 0 and π", least)
        for name, couples in (("front", self.front_bounds), ("back", self.back_bounds)):
            wrong = (couples[:, 0] <= 0) | (couples[:, 0] > couples[:, 1]) | (couples[:, 1] > longest)
            refuse(wrong, f"{name} bounds must be 0 < lower ≤ upper", couples)
        refuse(self.front_bounds[:, 1] > length, "front bounds must be at most the rod's length", self.front_bounds)
        _ = self.angle_bounds  # raises if sliders reach no angle

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.rod)

    @property
    def curves(self) -> tuple[MotorCurve, ...]:
        """Motors of every joint: the curves of the front and of the back slider."""
        return (self.front, self.back)

    @cached_property
    def table(self) -> Float[np.ndarray, "dof columns"]:
        """Table for ``actuator_kernels``, one row per joint."""
        rows = np.zeros((self.dof, actuators.COLUMNS))
        rows[:, actuators.SHAPE] = SHAPES.index(self.front.shape)
        rows[:, actuators.STALL], rows[:, actuators.FASTEST] = self.front.stall, self.front.fastest
        rows[:, actuators.BACK_STALL], rows[:, actuators.BACK_FASTEST] = self.back.stall, self.back.fastest
        rows[:, actuators.ROD], rows[:, actuators.ZERO], rows[:, actuators.BEND] = self.rod, self.zero, self.bend
        rows[:, actuators.ANGLE : actuators.ANGLE + 2] = self.angle_bounds
        rows[:, actuators.FRONT : actuators.FRONT + 2] = self.front_bounds
        rows[:, actuators.BACK : actuators.BACK + 2] = self.back_bounds
        return rows

    @cached_property
    def angle_bounds(self) -> Float[np.ndarray, "dof 2"]:
        """Least and largest rod angle θ [rad] within the sliders' bounds."""
        joints = zip(self.rod, self.front_bounds, self.back_bounds, self.least_angle, strict=True)
        return np.array([angle_range(*each) for each in joints])

    def angles(self, q: Joints) -> Joints:
        """Return the rods' angles θ (*batch, dof) [rad] at joint positions. They are not reduced to one turn."""
        return self.bend * (q - self.zero)

    def gears(self, q: Joints, front: Joints) -> tuple[Joints, Joints, Joints]:
        """Return s_b [m], A and B [rad/m], all (*batch, dof), at positions s [m]; A and B include ``bend``.

        Arguments may be complex numbers, for exact derivatives.
        """
        angle = self.angles(q)
        back, a, b = actuators.gears.py_func(np.sin(angle), np.cos(angle), front, self.rod)
        return back, self.bend * a, self.bend * b

    def ratios(self, q: Joints, front: Joints) -> Float[np.ndarray, "*batch 2 dof"]:
        """Return the ratios A and B of joints' speeds to sliders' speeds [rad/m]."""
        return np.stack(self.gears(q, front)[1:], axis=-2)


Actuation: TypeAlias = JointActuation | DistributedActuation


def check_actuation(actuation: object, arm: Arm) -> None:
    """Raise InvalidInput unless ``actuation`` fits ``arm``. The actuation must drive as many joints as the arm has."""
    check_instance("arm", arm, Arm, "an Arm")
    if not isinstance(actuation, JointActuation | DistributedActuation):
        raise InvalidInput(f"actuation must be a JointActuation or DistributedActuation, got {shown(actuation)}")
    if actuation.dof != arm.dof:
        raise InvalidInput(f"actuation must drive the {arm.dof} joints of {arm.name}, got {actuation.dof}")
    if isinstance(actuation, DistributedActuation) and not arm.periodic.all():
        sliding = arm.joint_names[int(np.argmin(arm.periodic))]
        raise InvalidInput(f"arm must have no prismatic joints if sliders drive it, got {sliding} of {arm.name}")


def kim_joint_motors() -> JointActuation:
    """Return the motors at the joints (JAM-3R) of Kim, Choi & Jang 2021, Table 3.

    >>> kim_joint_motors().motors.stall
    array([12.3,  3.5,  3.5])
    """
    return JointActuation(motors=MotorCurve(stall=[12.3, 3.5, 3.5], fastest=np.deg2rad([3.3, 13.2, 13.2])))


def kim_sliders(base_angle: float = float(np.deg2rad(-120.0)), bend: Literal[-1, 1] = 1) -> DistributedActuation:
    """Return the sliders (DAM-3R) of Kim, Choi & Jang 2021, Table 2; those of joint 1 run at up to 1.8 mm/s.

    Back sliders equal the front ones. Rods stay 10° from their toggles; this is not in the paper and costs speed
    (``DistributedActuation``).

    base_angle: direction [rad] of the link before the first joint. The paper does not state it: with the default, most
        directions at the paper's nine positions are faster than with motors at the joints, as the paper says
    bend: sign (1 or −1) of the angles of all rods; the paper does not state it

    >>> kim_sliders().front_bounds[0].tolist()
    [0.037, 0.077]
    """
    return DistributedActuation(
        front=MotorCurve(stall=[195.9, 55.8, 55.8], fastest=[1.8e-3, 7.1e-3, 7.1e-3]),
        rod=0.080,
        front_bounds=(0.037, 0.077),
        zero=[finite_number("base_angle", base_angle), 0.0, 0.0],
        bend=bend,
    )
