"""Fits a motion to a controller: as it is, or slowed down; if it does not fit, the error says what helps."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.errors import Infeasible
from paretoik.joint_trajectory.controllers import OPTIONS, Controller
from paretoik.joint_trajectory.trajectory import JointTrajectory, TimeScaling, sample_motion, time_scaling
from paretoik.robot import dynamics
from paretoik.robot.arm import Arm
from paretoik.task.limits import JOINT_UNITS
from paretoik.task.motion import Motion

# Comparison of a trajectory with a controller's limits at every sample, by differences and by derivatives.
#
# A controller knows only positions: it takes their differences over one period, and the robot rests before the first
# and after the last. Velocities, accelerations and jerks are compared with their limits both as these differences and
# as derivatives of the curve itself; its jerk is the change of its acceleration over a period.


UNITS = JOINT_UNITS | {"jerk": ("rad/s³", "m/s³"), "torque rate": ("N m/s", "N/s")}  # of revolute and prismatic joints


@dataclass(frozen=True, kw_only=True)
class LimitUse:
    """The largest use of a kind of limit.

    quantity: kind of limit
    joint: name of the joint
    prismatic: whether the joint is prismatic
    time: time [s] of the value
    value: value of the quantity
    limit: limit of the quantity
    use: share of the limit that is used; 1 at the limit
    """

    quantity: str
    joint: str
    prismatic: bool
    time: float
    value: float
    limit: float
    use: float

    @property
    def exceeded(self) -> bool:
        """Whether the value is beyond its limit by more than rounding."""
        return self.use > 1 + OPTIONS.rounding

    def __str__(self) -> str:
        value, limit = (with_unit(number, self.quantity, self.prismatic) for number in (self.value, self.limit))
        beyond = with_unit(abs(self.value - self.limit), self.quantity, self.prismatic)
        by = f", beyond it by {beyond}" if value == limit and self.exceeded else ""
        return f"{self.quantity} of {self.joint} is {value} at {self.time:g} s, its limit {limit}{by}"


def limit_uses(trajectory: JointTrajectory, controller: Controller, arm: Arm) -> list[LimitUse]:
    """Return the largest use of each kind of limit, the largest first; joints are in the arm's order.

    Torques are the arm's own, with gravity, if it has masses.
    """
    q, rate = trajectory.q, (len(trajectory.time) - 1) / trajectory.time[-1]
    lower, upper = controller.position.T
    # A range with one end counts as 2 rad, or m, wide: it has no midpoint, and is not used far from its end.
    low = np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper - 2.0, -1.0))
    high = np.where(np.isfinite(upper), upper, np.where(np.isfinite(lower), lower + 2.0, 1.0))
    middle = (low + high) / 2

    # Derivatives as the controller computes them; before the first and after the last command the robot rests.
    commands = np.concatenate([q[:1]] * 3 + [q] + [q[-1:]] * 3)
    velocity = np.diff(commands, axis=0) * rate
    acceleration = np.diff(velocity, axis=0) * rate
    changes = np.diff(np.pad(trajectory.ddq, ((1, 1), (0, 0))), axis=0) * rate
    # Quantity, values (samples, dof), bounds (2, #samples, dof), and the sample of the first value.
    compared = [
        ("position", q, controller.position.T[:, None], 0),
        ("velocity", velocity, controller.velocity_bounds(commands[1:]), -2),
        ("acceleration", acceleration, _both_sides(controller.acceleration), -1),
        ("jerk", np.diff(acceleration, axis=0) * rate, _both_sides(controller.jerk), 0),
        ("velocity", trajectory.dq, controller.velocity_bounds(q), 0),
        ("acceleration", trajectory.ddq, _both_sides(controller.acceleration), 0),
        ("jerk", changes, _both_sides(controller.jerk), 0),
    ]
    if any(body.mass > 0 for body in arm.bodies):
        torque = dynamics.inverse_dynamics(arm, q, trajectory.dq, trajectory.ddq)
        still = np.zeros((2, arm.dof))
        static_torque = dynamics.inverse_dynamics(arm, q[[0, -1]], still, still)
        steps = np.diff(np.concatenate([static_torque[:1], torque, static_torque[1:]]), axis=0)
        compared.append(("torque", torque, _both_sides(controller.torque), 0))
        compared.append(("torque rate", steps * rate, _both_sides(controller.torque_rate), 0))

    largest: dict[str, LimitUse] = {}
    for quantity, values, (low, high), first in compared:
        # the share of its limit that each value uses: 1 at the limit, 0 at 0 or at the midpoint of a range
        center = middle if quantity == "position" else np.zeros(arm.dof)
        distance = values - center
        room = np.where(distance < 0, center - low, high - center)
        shares = np.where(distance == 0, 0.0, np.abs(distance) / np.maximum(room, np.finfo(float).tiny))
        sample, joint = (int(i) for i in np.unravel_index(int(np.argmax(shares)), shares.shape))
        bounds, use = low if distance[sample, joint] < 0 else high, float(shares[sample, joint])
        limit = float(np.broadcast_to(bounds, shares.shape)[sample, joint])
        if np.isfinite(limit) and (quantity not in largest or use > largest[quantity].use):
            largest[quantity] = LimitUse(
                quantity=quantity,
                joint=trajectory.joint_names[joint],
                prismatic=arm.joint_types[joint] == "prismatic",
                time=float(trajectory.time[np.clip(sample + first, 0, len(trajectory.time) - 1)]),
                value=float(values[sample, joint]),
                limit=limit,
                use=use,
            )
    return sorted(largest.values(), key=lambda each: -each.use)


def _both_sides(limit: Float[np.ndarray, " dof"]) -> Float[np.ndarray, "2 1 dof"]:
    """Return a symmetric limit as its lower and its upper bound."""
    return np.stack([-limit, limit])[:, None]


def unrest(trajectory: JointTrajectory, controller: Controller, arm: Arm) -> str | None:
    """Return text on a joint that is not at rest at an end, or None."""
    kinds = [("velocity", trajectory.dq, controller.velocity, OPTIONS.rest_velocity)]
    if controller.rest_acceleration:
        kinds.append(("acceleration", trajectory.ddq, controller.acceleration, OPTIONS.rest_acceleration))
    for quantity, values, limit, share in kinds:
        tolerance = share * np.where(np.isfinite(limit), limit, np.abs(values).max())
        for end, verb in ((0, "start"), (-1, "end")):
            excess = np.abs(values[end]) / np.maximum(tolerance, np.finfo(float).tiny)
            joint = int(np.argmax(excess))
            if excess[joint] > 1:
                value = with_unit(values[end, joint], quantity, arm.joint_types[joint] == "prismatic")
                planned = " (end_velocity=0 plans it so)" if end and not controller.rest_acceleration else ""
                return f"it must {verb} at rest{planned}, but {trajectory.joint_names[joint]} {verb}s with {value}"
    return None


def with_unit(value: float, quantity: str, prismatic: bool) -> str:
    """Return a value of a quantity with its unit; a prismatic joint has metres and newtons."""
    return f"{value:.6g} {UNITS[quantity][prismatic]}"


# Slowing down: the fewest periods of a controller in which a motion satisfies its limits.
#
# A motion slowed down by k has 1/k of the velocities, 1/k² of the accelerations and 1/k³ of the jerks, exactly on the
# curve, nearly for differences of samples: so the answer is guessed, then found by bisection among whole periods.


ORDERS = {"velocity": 1, "acceleration": 2, "jerk": 3, "torque": 2, "torque rate": 3}


def slowing(use: LimitUse) -> float:
    """Return the approximate slowing factor at which a motion just satisfies a limit."""
    return use.use ** (1 / ORDERS[use.quantity])


def slow_down(scaling: TimeScaling, measure: Callable[[TimeScaling], list[LimitUse]]) -> TimeScaling | None:
    """Return the scaling of the fewest periods that satisfies limits, or None.

    It has at least as many periods as ``scaling``. ``measure`` returns the uses of limits. Positions do not depend on
    time, so their limits are ignored.
    """
    fails, passes, smallest = scaling.periods - 1, scaling.periods, 1.0
    while True:
        exceeded = [use for use in measure(replace(scaling, periods=passes)) if use.quantity in ORDERS and use.exceeded]
        if not exceeded:
            break
        fails = passes
        factor = max(map(slowing, exceeded))
        passes = max(passes + 1, math.ceil(passes * min(max(factor, smallest), 2.0)))
        smallest += 0.1  # guesses with small steps are no better than a search
        if passes > OPTIONS.slowest * scaling.periods:
            return None
    while passes - fails > 1:
        middle = (passes + fails) // 2
        if any(use.exceeded for use in measure(replace(scaling, periods=middle)) if use.quantity in ORDERS):
            fails = middle
        else:
            passes = middle
    return replace(scaling, periods=passes)


# Fitting a motion to a controller.


def fit_motion(
    motion: Motion, scaling: TimeScaling, controller: Controller, *, slower: bool = False
) -> tuple[JointTrajectory, TimeScaling, list[LimitUse]]:
    """Return samples of a motion, their scaling, and the uses of limits.

    The samples are at the scaling's rate; limits and rest are checked at the controller's own. With ``slower`` the
    scaling may get more periods, as few as the limits need.

    Raises Infeasible if the motion is not at rest at an end or exceeds a limit; the message has joint, time, value,
    limit and a remedy.
    """
    uses, moving = _measure(motion, scaling, controller)
    for use in uses:
        if use.exceeded and use.quantity not in ORDERS:
            advice = (
                "slowing down does not help: plan with pk.Limits(position=...) inside the controller's, and refine: "
                "certified motions with differences='spline' satisfy them between samples too"
            )
            raise _refusal(motion, controller, use, advice)
    if moving is None and not (uses and uses[0].exceeded):
        return sample_motion(motion, scaling), scaling, uses
    if moving is not None:  # a spline may leave a little motion at an end that should rest; it vanishes if slow enough
        factor = max((slowing(use) for use in uses if use.quantity in ORDERS), default=1.0)
        guess = replace(scaling, periods=math.ceil(scaling.periods * max(factor, 1.0)))
        if _measure(motion, guess, controller)[1] is not None:
            shortest, advice = max(scaling.ramp, 1 / scaling.rate), ""
            longer = [each for each in OPTIONS.ramps if shortest <= each <= scaling.duration and each > scaling.ramp]
            for ramp in longer:
                ramped = time_scaling(scaling.duration, scaling.rate, time_scale=max(scaling.factor, 1.0), ramp=ramp)
                if not any(use.exceeded for use in _measure(motion, ramped, controller)[0] if use.quantity in ORDERS):
                    advice = f"ramp={ramp:g} (--ramp {ramp:g}) starts and stops it on the same curve, within the limits"
                    break
            if not advice:
                ramp = max(min(OPTIONS.usual_ramp, scaling.duration / 2), 1 / scaling.rate)
                advice = f"ramp={ramp:g} with slow_down=True (--ramp {ramp:g} --slow-down) starts and stops it on the "
                advice += "same curve"
            raise _refusal(motion, controller, moving, advice)
    slowed = slow_down(scaling, lambda each: _measure(motion, each, controller)[0])
    if slowed is None:
        raise _refusal(motion, controller, uses[0], "slowing down does not help: at rest it is as large")
    if slower:
        return sample_motion(motion, slowed), slowed, _measure(motion, slowed, controller)[0]
    scale = f"{slowed.factor * (1 + 5e-5):.4f}"  # rounded up
    advice = f"slowed down {scale} times it satisfies every limit: time_scale={scale} or slow_down=True (--slow-down)"
    raise _refusal(motion, controller, moving or uses[0], advice)


def _refusal(motion: Motion, controller: Controller, cause: LimitUse | str, advice: str) -> Infeasible:
    """Return the error of a motion that exceeds a limit, or is not at rest."""
    about: Any = {"limit": "rest"}
    if isinstance(cause, LimitUse):
        about = {"limit": cause.quantity, "violation": cause.use - 1}
    return Infeasible(f"controller {controller.name}: {cause}; {advice}", motion=motion, **about)


def _measure(motion: Motion, scaling: TimeScaling, controller: Controller) -> tuple[list[LimitUse], str | None]:
    """Return the uses of limits at the controller's rate, and ``unrest``'s text."""
    trajectory = sample_motion(motion, scaling, controller.rate)
    return limit_uses(trajectory, controller, motion.arm), unrest(trajectory, controller, motion.arm)
