"""Fitting a motion to a controller: as it is, or slowed down; where it does not fit, what would help."""

from __future__ import annotations

import math
from dataclasses import replace

from paretoik.errors import Infeasible
from paretoik.joint_trajectory.controller import Controller
from paretoik.joint_trajectory.limit_check import LimitUse, limit_uses, unrest
from paretoik.joint_trajectory.options import OPTIONS
from paretoik.joint_trajectory.slow_down import ORDERS, slow_down, slowing
from paretoik.joint_trajectory.time_scaling import TimeScaling, time_scaling
from paretoik.joint_trajectory.trajectory import JointTrajectory, sample_motion
from paretoik.task.motion import Motion


def fit_motion(
    motion: Motion, scaling: TimeScaling, controller: Controller, *, slower: bool = False
) -> tuple[JointTrajectory, TimeScaling, list[LimitUse]]:
    """Return the samples of a motion for a controller, in what scaling, and how much of each limit the motion uses.

    The samples are at the scaling's rate; limits and rest are looked at at the controller's own. With ``slower`` the
    scaling may get more periods, as few as the limits ask for.

    Raises Infeasible where the controller would refuse: not at rest at an end, or a limit exceeded, by joint, time,
    value and limit, with what would help.
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
    if moving is not None:  # as little as a spline leaves of an end at rest is gone once it is slow enough
        moving_slowed = _measure(motion, _guess_slower(scaling, uses), controller)[1]
        if moving_slowed is not None:
            raise _unrest(motion, controller, moving, _ramp_advice(motion, scaling, controller))
    slowed = slow_down(scaling, lambda each: _measure(motion, each, controller)[0])
    if slowed is None:
        raise _refusal(motion, controller, uses[0], "no slowing down helps: at rest it is as much")
    if slower:
        return sample_motion(motion, slowed), slowed, _measure(motion, slowed, controller)[0]
    factor = f"{slowed.factor * (1 + 5e-5):.4f}"  # rounded up
    advice = f"slowed down {factor} times it keeps every limit: time_scale={factor} or slow_down=True (--slow-down)"
    if moving is not None:
        raise _unrest(motion, controller, moving, advice)
    raise _refusal(motion, controller, uses[0], advice)


def _refusal(motion: Motion, controller: Controller, use: LimitUse, advice: str) -> Infeasible:
    message = f"controller {controller.name}: {use}; {advice}"
    return Infeasible(message, motion=motion, limit=use.quantity, violation=use.use - 1)


def _unrest(motion: Motion, controller: Controller, moving: str, advice: str) -> Infeasible:
    return Infeasible(f"controller {controller.name}: {moving}; {advice}", motion=motion, limit="rest")


def _guess_slower(scaling: TimeScaling, uses: list[LimitUse]) -> TimeScaling:
    """Return a scaling that is about as slow as limits ask for, and no slower than they do."""
    factor = max((slowing(use) for use in uses if use.quantity in ORDERS), default=1.0)
    return replace(scaling, periods=math.ceil(scaling.periods * max(factor, 1.0)))


def _measure(motion: Motion, scaling: TimeScaling, controller: Controller) -> tuple[list[LimitUse], str | None]:
    """Return the uses of limits at the controller's own rate, and what does not rest at an end."""
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
