"""Fitting a motion to a controller: as it is, or slowed down; where it does not fit, what would help."""

from __future__ import annotations

from paretoik.errors import Infeasible
from paretoik.joint_trajectory.controller import Controller
from paretoik.joint_trajectory.limit_check import LimitUse, limit_uses, unrest
from paretoik.joint_trajectory.options import OPTIONS
from paretoik.joint_trajectory.slow_down import ORDERS, slow_down
from paretoik.joint_trajectory.time_scaling import TimeScaling, time_scaling
from paretoik.joint_trajectory.trajectory import JointTrajectory, sample_motion
from paretoik.task.motion import Motion


def fit_motion(
    motion: Motion, scaling: TimeScaling, controller: Controller, *, slower: bool = False
) -> tuple[JointTrajectory, TimeScaling, list[LimitUse]]:
    """Return the samples of a motion that a controller takes, in what scaling, and how much of each limit they use.

    With ``slower`` the scaling may get more periods, as few as the limits ask for.

    Raises Infeasible where the controller would refuse: not at rest at an end, or a limit exceeded, by joint, time,
    value and limit, with what would help.
    """
    trajectory = sample_motion(motion, scaling)
    uses = limit_uses(trajectory, controller, motion.arm)
    for use in uses:
        if use.exceeded and use.quantity not in ORDERS:
            advice = "no slowing down helps: plan with pk.Limits(position=...) inside the controller's"
            raise _refusal(motion, controller, use, advice)
    moving = unrest(trajectory, controller, motion.arm)
    if moving is not None:
        advice = _ramp_advice(motion, scaling, controller)
        raise Infeasible(f"controller {controller.name}: {moving}; {advice}", motion=motion, limit="rest")
    if not (uses and uses[0].exceeded):
        return trajectory, scaling, uses
    slowed = slow_down(scaling, lambda each: _uses(motion, each, controller))
    if slowed is None:
        raise _refusal(motion, controller, uses[0], "no slowing down helps: at rest it is as much")
    if not slower:
        factor = f"{slowed.factor * (1 + 5e-5):.4f}"  # rounded up
        advice = f"slowed down {factor} times it keeps every limit: time_scale={factor} or slow_down=True (--slow-down)"
        raise _refusal(motion, controller, uses[0], advice)
    trajectory = sample_motion(motion, slowed)
    return trajectory, slowed, limit_uses(trajectory, controller, motion.arm)


def _refusal(motion: Motion, controller: Controller, use: LimitUse, advice: str) -> Infeasible:
    message = f"controller {controller.name}: {use}; {advice}"
    return Infeasible(message, motion=motion, limit=use.quantity, violation=use.use - 1)


def _uses(motion: Motion, scaling: TimeScaling, controller: Controller) -> list[LimitUse]:
    return limit_uses(sample_motion(motion, scaling), controller, motion.arm)


def _ramp_advice(motion: Motion, scaling: TimeScaling, controller: Controller) -> str:
    for ramp in (ramp for ramp in OPTIONS.ramps if scaling.ramp < ramp <= scaling.duration):
        ramped = time_scaling(scaling.duration, scaling.rate, time_scale=max(scaling.factor, 1.0), ramp=ramp)
        if not any(use.exceeded for use in _uses(motion, ramped, controller) if use.quantity in ORDERS):
            return f"ramp={ramp:g} (--ramp {ramp:g}) starts and stops it on the same curve, within the limits"
    ramp = min(OPTIONS.usual_ramp, scaling.duration / 2)
    return f"ramp={ramp:g} with slow_down=True (--ramp {ramp:g} --slow-down) starts and stops it on the same curve"
