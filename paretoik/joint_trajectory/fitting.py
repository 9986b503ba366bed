"""Fits a motion to a controller: as it is, or slowed down; if it does not fit, the error says what helps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from paretoik.errors import Infeasible
from paretoik.joint_trajectory.controllers import OPTIONS, Controller
from paretoik.joint_trajectory.trajectory import JointTrajectory, TimeScaling, sample_motion, time_scaling
from paretoik.robot import dynamics
from paretoik.robot.arm import Arm
from paretoik.task.motion import Motion

# Comparison of a trajectory with a controller's limits at every sample, by differences and by derivatives.
#
# A controller knows only positions: it takes their differences over one period, and the robot rests before the first
# and after the last. Velocities, accelerations and jerks are compared with their limits both as these differences and
# as derivatives of the curve itself; its jerk is the change of its acceleration over a period.


UNITS = {
    "position": "rad",
    "velocity": "rad/s",
    "acceleration": "rad/s²",
    "jerk": "rad/s³",
    "torque": "N m",
    "torque rate": "N m/s",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class LimitedSeries:
    """Values (samples, dof) of a ``quantity`` with their bounds; value i is that of sample i + ``shift``.

    ``center`` (dof,) is the value that uses nothing of a limit: 0, or for positions the middle of their range.
    """

    quantity: str
    values: Float[np.ndarray, "samples dof"]
    lower: Float[np.ndarray, "#samples dof"]
    upper: Float[np.ndarray, "#samples dof"]
    shift: int = 0
    center: Float[np.ndarray, "*dof"] | float = 0.0

    @property
    def use(self) -> Float[np.ndarray, "samples dof"]:
        """Share of its limit that each value uses: 1 at the limit, 0 at the center."""
        distance = self.values - self.center
        room = np.where(distance < 0, self.center - self.lower, self.upper - self.center)
        return np.where(distance == 0, 0.0, np.abs(distance) / np.maximum(room, np.finfo(float).tiny))


@dataclass(frozen=True, kw_only=True)
class LimitUse:
    """The largest use of a kind of limit: a joint's ``value`` at ``time`` [s]; ``use`` 1 is all of ``limit``."""

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
    largest: dict[str, LimitUse] = {}
    for series in _limited_series(trajectory, controller, arm):
        use = series.use
        sample, joint = (int(i) for i in np.unravel_index(int(np.argmax(use)), use.shape))
        value = float(series.values[sample, joint])
        bounds = series.lower if value < np.broadcast_to(series.center, arm.dof)[joint] else series.upper
        limit = float(np.broadcast_to(bounds, use.shape)[sample, joint])
        before = largest.get(series.quantity)
        if np.isfinite(limit) and (before is None or use[sample, joint] > before.use):
            largest[series.quantity] = LimitUse(
                quantity=series.quantity,
                joint=trajectory.joint_names[joint],
                prismatic=arm.joint_types[joint] == "prismatic",
                time=float(trajectory.time[np.clip(sample + series.shift, 0, len(trajectory.time) - 1)]),
                value=value,
                limit=limit,
                use=float(use[sample, joint]),
            )
    return sorted(largest.values(), key=lambda each: -each.use)


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
    unit = UNITS[quantity]
    if prismatic:
        unit = unit.replace("rad", "m", 1) if unit.startswith("rad") else unit.replace("N m", "N", 1)
    return f"{value:.6g} {unit}"


def _limited_series(trajectory: JointTrajectory, controller: Controller, arm: Arm) -> Iterator[LimitedSeries]:
    q, rate = trajectory.q, (len(trajectory.time) - 1) / trajectory.time[-1]
    lower, upper = controller.position.T
    # A range with one end counts as 2 rad, or m, wide: it has no middle, and is not used far from its end.
    low = np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper - 2.0, -1.0))
    high = np.where(np.isfinite(upper), upper, np.where(np.isfinite(lower), lower + 2.0, 1.0))
    middle = (low + high) / 2
    yield LimitedSeries(quantity="position", values=q, lower=lower[None], upper=upper[None], center=middle)

    # Derivatives as the controller computes them; before the first and after the last command the robot rests.
    commands = np.concatenate([q[:1]] * 3 + [q] + [q[-1:]] * 3)
    velocity = np.diff(commands, axis=0) * rate
    low, high = controller.velocity_bounds(commands[1:])
    yield LimitedSeries(quantity="velocity", values=velocity, lower=low, upper=high, shift=-2)
    acceleration = np.diff(velocity, axis=0) * rate
    yield _symmetric("acceleration", acceleration, controller.acceleration, shift=-1)
    yield _symmetric("jerk", np.diff(acceleration, axis=0) * rate, controller.jerk)

    low, high = controller.velocity_bounds(q)
    yield LimitedSeries(quantity="velocity", values=trajectory.dq, lower=low, upper=high)
    yield _symmetric("acceleration", trajectory.ddq, controller.acceleration)
    yield _symmetric("jerk", np.diff(np.pad(trajectory.ddq, ((1, 1), (0, 0))), axis=0) * rate, controller.jerk)

    if any(body.mass > 0 for body in arm.bodies):
        torque = dynamics.inverse_dynamics(arm, q, trajectory.dq, trajectory.ddq)
        yield _symmetric("torque", torque, controller.torque)
        still = np.zeros((2, arm.dof))
        static_torque = dynamics.inverse_dynamics(arm, q[[0, -1]], still, still)
        steps = np.diff(np.concatenate([static_torque[:1], torque, static_torque[1:]]), axis=0)
        yield _symmetric("torque rate", steps * rate, controller.torque_rate)


def _symmetric(quantity: str, values: np.ndarray, limit: np.ndarray, shift: int = 0) -> LimitedSeries:
    return LimitedSeries(quantity=quantity, values=values, lower=-limit[None], upper=limit[None], shift=shift)


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
                "no slowing down helps: plan with pk.Limits(position=...) inside the controller's, and refine: "
                "certified motions keep them between samples too"
            )
            raise _refusal(motion, controller, use, advice)
    if moving is None and not (uses and uses[0].exceeded):
        return sample_motion(motion, scaling), scaling, uses
    if moving is not None:  # a spline may leave a little motion at an end that should rest; it vanishes if slow enough
        factor = max((slowing(use) for use in uses if use.quantity in ORDERS), default=1.0)
        guess = replace(scaling, periods=math.ceil(scaling.periods * max(factor, 1.0)))
        if _measure(motion, guess, controller)[1] is not None:
            raise _unrest(motion, controller, moving, _ramp_advice(motion, scaling, controller))
    slowed = slow_down(scaling, lambda each: _measure(motion, each, controller)[0])
    if slowed is None:
        raise _refusal(motion, controller, uses[0], "no slowing down helps: at rest it is as much")
    if slower:
        return sample_motion(motion, slowed), slowed, _measure(motion, slowed, controller)[0]
    scale = f"{slowed.factor * (1 + 5e-5):.4f}"  # rounded up
    advice = f"slowed down {scale} times it keeps every limit: time_scale={scale} or slow_down=True (--slow-down)"
    if moving is not None:
        raise _unrest(motion, controller, moving, advice)
    raise _refusal(motion, controller, uses[0], advice)


def _refusal(motion: Motion, controller: Controller, use: LimitUse, advice: str) -> Infeasible:
    message = f"controller {controller.name}: {use}; {advice}"
    return Infeasible(message, motion=motion, limit=use.quantity, violation=use.use - 1)


def _unrest(motion: Motion, controller: Controller, moving: str, advice: str) -> Infeasible:
    return Infeasible(f"controller {controller.name}: {moving}; {advice}", motion=motion, limit="rest")


def _measure(motion: Motion, scaling: TimeScaling, controller: Controller) -> tuple[list[LimitUse], str | None]:
    """Return the uses of limits at the controller's rate, and ``unrest``'s text."""
    trajectory = sample_motion(motion, scaling, controller.rate)
    return limit_uses(trajectory, controller, motion.arm), unrest(trajectory, controller, motion.arm)


def _ramp_advice(motion: Motion, scaling: TimeScaling, controller: Controller) -> str:
    shortest = max(scaling.ramp, 1 / scaling.rate)
    for ramp in (ramp for ramp in OPTIONS.ramps if shortest <= ramp <= scaling.duration and ramp > scaling.ramp):
        ramped = time_scaling(scaling.duration, scaling.rate, time_scale=max(scaling.factor, 1.0), ramp=ramp)
        uses, _ = _measure(motion, ramped, controller)
        if not any(use.exceeded for use in uses if use.quantity in ORDERS):
            return f"ramp={ramp:g} (--ramp {ramp:g}) starts and stops it on the same curve, within the limits"
    ramp = max(min(OPTIONS.usual_ramp, scaling.duration / 2), 1 / scaling.rate)
    return f"ramp={ramp:g} with slow_down=True (--ramp {ramp:g} --slow-down) starts and stops it on the same curve"
