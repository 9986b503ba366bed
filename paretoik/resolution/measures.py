"""Objectives of resolved motions; some depend on the method's steps."""

from __future__ import annotations

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.inputs import shown
from paretoik.resolution.protocol import ResolvedMotion
from paretoik.task.limits import position_ranges
from paretoik.task.motion import Motion
from paretoik.task.objectives import Objective, objective
from paretoik.task.random_starts import wrap_difference

__all__ = ["distance_to", "duration", "evaluations", "limit_margin", "speed_ratio", "tracking_error"]


def __dir__() -> list[str]:
    return __all__


@objective(unit="m, rad", form="general")
def tracking_error(motion: Motion) -> np.ndarray:
    """Largest error of any task equation at any sample."""
    return np.asarray(np.abs(_resolved("tracking_error", motion).traces.errors).max(axis=(-2, -1)))


@objective(unit="", form="general", maximise=True)
def limit_margin(motion: Motion) -> np.ndarray:
    """Smallest distance from position limits, as a share of the range; negative beyond them, 0 without; maximised."""
    lower, upper = motion.arm.position_limits.T
    span = position_ranges(motion.arm, motion.arm.position_limits)
    limited = np.isfinite(span)
    if not limited.any():
        return np.zeros(motion.q.shape[:-2])
    margin = np.minimum(motion.q - lower, upper - motion.q) / np.where(limited, span, 1.0)
    return np.asarray(np.where(limited, margin, np.inf).min(axis=(-2, -1)))


@objective(unit="", form="general")
def speed_ratio(motion: Motion) -> np.ndarray:
    """Largest ratio of joint speed to its limit, or to 1 rad/s or 1 m/s if unlimited."""
    highest = np.where(np.isfinite(motion.arm.velocity_limits), motion.arm.velocity_limits, 1.0)
    return np.asarray((np.abs(motion.dq) / highest).max(axis=(-2, -1)))


@objective(unit="", form="general")
def evaluations(motion: Motion) -> np.ndarray:
    """Mean number of samples evaluated per prediction, or of cone programs per plan.

    Raises InvalidInput for methods that do not look ahead.
    """
    count = getattr(_resolved("evaluations", motion).traces, "evaluations", None)
    if count is None:
        raise InvalidInput("evaluations: method must look ahead, got one that does not; use PredictiveKineticEnergy")
    return np.asarray(count)


@objective(unit="s", form="general")
def duration(motion: Motion) -> np.ndarray:
    """Time from the first to the last sample."""
    return motion.duration


def distance_to(reference: Motion) -> Objective:
    """Return the objective ``distance``: the joint distance from a motion, RMS over time, with angles modulo 2π.

    reference: one motion

    Raises InvalidInput unless ``reference`` is one motion. The objective raises InvalidInput for motions with other
    samples.
    """
    if not isinstance(reference, Motion):
        raise InvalidInput(f"reference must be a Motion, got {shown(reference)}")
    if reference.q.ndim != 2:
        raise InvalidInput(f"reference must be one motion, got a batch of shape {reference.q.shape[:-2]}")

    @objective(unit="rad, m", form="general")
    def distance(motion: Motion) -> np.ndarray:
        if motion.q.shape[-2:] != reference.q.shape:
            raise InvalidInput(f"reference must be one motion of shape {motion.q.shape[-2:]}, got {reference.q.shape}")
        difference = wrap_difference(motion.q - reference.q, motion.arm.periodic)
        return np.asarray(np.sqrt(np.mean(np.sum(difference**2, axis=-1), axis=-1)))

    return distance


def _resolved(name: str, motion: Motion) -> ResolvedMotion:
    if not isinstance(motion, ResolvedMotion):
        raise InvalidInput(f"{name}: motion must be a result of pk.resolve, got a {type(motion).__name__}")
    return motion
