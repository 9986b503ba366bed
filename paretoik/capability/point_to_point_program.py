"""The nonlinear program of a motion from point to point.

The unknowns are the spline coefficients of joints and sliders, the time of every interval, and the work of every motor
in every interval. The costs are the sums of times and of work. Ends are fixed. Motors are within their curves in every
interval; at every sample they can hold the arm, and positions are within bounds. So the same few rows are repeated.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import JointPaths
from paretoik.capability.actuation import Actuation, DistributedActuation
from paretoik.capability.directional_program import consecutive_slices, gear_ratios, ratios_and_slacks, stall_slacks
from paretoik.capability.user_functions import Lanes, SmoothTerm
from paretoik.errors import InvalidInput
from paretoik.nlp.dense.traced_rows import AssembledRows, Part, TracedRows, trace_rows
from paretoik.robot import dynamics, kinematics
from paretoik.robot.arm import Arm
from paretoik.robot.arm_arguments import TOOL_FRAME
from paretoik.robot.dynamics import gravity_torques

# Least time and work of a motion in closed form: the slowest motor determines each interval, under gravity at its
# midpoint. Quasi-static, as in Kim, Choi & Jang 2021: torques of inertia are not counted.


@dataclass(frozen=True, kw_only=True, eq=False)
class Timing:
    """Least times of the intervals between samples, and the travel and effort of motors.

    intervals: times (*batch, intervals) [s]; NaN if a motor cannot bear its effort
    travel: travel of motors (*batch, intervals, motors, dof) [rad or m]
    effort: effort of motors (*batch, intervals, motors, dof) [N m or N]
    overload: largest effort, in intervals or at samples, as a share of its motor's capacity, minus 1 (*batch,)
    """

    intervals: Float[np.ndarray, "*batch intervals"]
    travel: Float[np.ndarray, "*batch intervals motors dof"]
    effort: Float[np.ndarray, "*batch intervals motors dof"]
    overload: Float[np.ndarray, "*batch"]

    @property
    def work(self) -> Float[np.ndarray, "*batch intervals motors dof"]:
        """Work that each motor does or absorbs [J]: |effort · travel|."""
        return np.abs(self.effort * self.travel)

    @property
    def duration(self) -> Float[np.ndarray, "*batch"]:
        """Least time of the whole motion [s]."""
        return np.asarray(self.intervals.sum(axis=-1))

    @property
    def energy(self) -> Float[np.ndarray, "*batch"]:
        """Work that all motors do or absorb [J]: braking costs as much as driving."""
        return np.asarray(self.work.sum(axis=(-1, -2, -3)))

    def lateness(self, allowed: Float[np.ndarray, "*batch coarse"]) -> Float[np.ndarray, "*batch"]:
        """Return the largest amount by which coarser intervals are too short, as a share of their mean.

        Each coarse interval has equally many fine intervals; one with a motor that cannot bear its effort does not
        count.
        """
        shortest = self.intervals.reshape(*allowed.shape, -1).sum(axis=-1)
        late = np.nan_to_num(shortest - allowed, nan=0.0).max(axis=-1) / allowed.mean(axis=-1)
        return np.asarray(late)


def minimum_timing(arm: Arm, actuation: Actuation, q: JointPaths, front: JointPaths) -> Timing:
    """Return the timing of joint positions and front sliders at samples (*batch, time, dof).

    A motor that travels no more than 1e-9 rad or m between samples rests, even under its largest load.
    """
    middle = (q[..., 1:, :] + q[..., :-1, :]) / 2
    middle_front = (front[..., 1:, :] + front[..., :-1, :]) / 2
    effort = actuation.ratios(middle, middle_front) * gravity_torques(arm, middle)[..., None, :]
    static_effort = actuation.ratios(q, front) * gravity_torques(arm, q)[..., None, :]
    if isinstance(actuation, DistributedActuation):
        back = actuation.gears(q, front)[0]
        travel = np.stack([np.diff(front, axis=-2), np.diff(back, axis=-2)], axis=-2)
    else:
        travel = np.diff(q, axis=-2)[..., None, :]
    shares, times = list[np.ndarray](), list[np.ndarray]()
    for m, curve in enumerate(actuation.curves):
        low, high = curve.speeds(effort[..., m, :])
        change = travel[..., m, :]
        with np.errstate(divide="ignore", invalid="ignore"):
            times.append(np.where(np.abs(change) <= 1e-9, 0.0, change / np.where(change > 0, high, low)))
        times[-1] = np.where(np.isnan(high), np.nan, times[-1])
        shares += [np.abs(each[..., m, :]).max(axis=-2) / curve.stall for each in (effort, static_effort)]
    return Timing(
        intervals=np.stack(times, axis=-1).max(axis=(-1, -2)),
        travel=travel,
        effort=effort,
        overload=np.stack(shares, axis=-1).max(axis=(-1, -2)) - 1.0,
    )


def require_weight(arm: Arm) -> None:
    """Raise InvalidInput if motors work against no weight in any posture."""
    if not gravity_torques(arm, np.random.default_rng(0).normal(size=(4, arm.dof))).any():
        raise InvalidInput(
            f"energy must be False if motors work against no weight, got True for {arm.name}, which has no masses or "
            "no gravity along its motions"
        )


# The nonlinear program of a motion from point to point.


@dataclass(frozen=True, kw_only=True, eq=False)
class PointToPointProgram:
    """The program of a motion from ``start`` to ``target`` (task,) [m], along a ``spline`` (time, coefficients).

    Units: ``pace`` [s] for intervals, ``work_unit`` [J] for work, rad (m) for joints, rods' lengths for sliders.
    """

    arm: Arm
    actuation: Actuation
    start: Float[np.ndarray, " task"]
    target: Float[np.ndarray, " task"]
    spline: Float[np.ndarray, "time coefficients"]
    pace: float
    work_unit: float

    @property
    def motors(self) -> int:
        """Number of motors per joint."""
        return len(self.actuation.curves)

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Slice of every part of the unknowns."""
        intervals, size = len(self.spline) - 1, self.spline.shape[1] * self.arm.dof
        sizes = {"q": size, "front": size * (self.motors - 1), "times": intervals}
        sizes["work"] = intervals * self.motors * self.arm.dof
        return consecutive_slices(sizes)

    @property
    def count(self) -> int:
        """Number of unknowns."""
        return int(self.slices["work"].stop)

    @cached_property
    def costs(self) -> Float[np.ndarray, "2 unknowns"]:
        """Gradients of duration [s] and energy [J]."""
        costs = np.zeros((2, self.count))
        costs[0, self.slices["times"]] = self.pace
        costs[1, self.slices["work"]] = self.work_unit
        return costs

    def unknowns(
        self, q: np.ndarray, front: np.ndarray, intervals: np.ndarray, work: np.ndarray
    ) -> Float[np.ndarray, "points unknowns"]:
        """Return the unknowns of coefficients (points, coefficients, dof), intervals [s] and work [J]."""
        rod = getattr(self.actuation, "rod", 1.0)
        sliders = (front / rod)[..., : self.arm.dof * (self.motors - 1)]
        parts = [q, sliders, intervals / self.pace, work / self.work_unit]
        return np.concatenate([part.reshape(len(q), -1) for part in parts], axis=1)

    def coefficients(self, z: Float[np.ndarray, "points unknowns"]) -> tuple[np.ndarray, np.ndarray]:
        """Return the coefficients of joints and front sliders (points, coefficients, dof)."""
        shape = (len(z), self.spline.shape[1], self.arm.dof)
        q = z[:, self.slices["q"]].reshape(shape)
        if not isinstance(self.actuation, DistributedActuation):
            return q, np.zeros_like(q)
        return q, z[:, self.slices["front"]].reshape(shape) * self.actuation.rod

    @cached_property
    def program(self) -> AssembledRows:
        """The whole program."""
        steps, samples = len(self.spline) - 1, len(self.spline)
        reach = min(5, self.spline.shape[1])  # coefficients of a cubic spline that determine two neighbouring samples
        first = np.array([np.flatnonzero(self.spline[i] > 0)[0] for i in range(samples)])
        first = np.minimum(first, self.spline.shape[1] - reach)
        near = first[:, None] + np.arange(reach)
        weights = np.take_along_axis(self.spline, near, axis=1)
        after = np.take_along_axis(self.spline[1:], near[:-1], axis=1)
        times = self.slices["times"].start + np.arange(steps)[:, None]
        work = self.slices["work"].start + np.arange(steps * self.motors * self.arm.dof).reshape(steps, -1)
        moving = Part(
            program=_interval(self.arm, self.actuation, reach, self.pace, self.work_unit),
            where=np.concatenate([self._where(near[:-1]), times, work], axis=1),
            parameters=np.concatenate([weights[:-1], after], axis=1),
        )
        end_points = Part(
            program=_end(self.arm, len(self.start)),
            where=np.array([[0], [self.spline.shape[1] - 1]]) * self.arm.dof + np.arange(self.arm.dof),
            parameters=np.stack([self.start, self.target]),
        )
        parts = [end_points, moving]
        bounded = _sample(self.arm, self.actuation, reach)
        if bounded.inequalities:
            parts.append(Part(program=bounded, where=self._where(near), parameters=weights))
        return AssembledRows(unknowns=self.count, parts=tuple(parts))

    def with_longest(self, longest: float) -> AssembledRows:
        """Return the program with an upper bound on intervals, in units of the pace."""
        times = np.arange(self.count)[self.slices["times"], None]
        rows = trace_rows(1, 0, lambda z, _: ([], [1.0 - z[0] * (1 / longest)]))
        part = Part(program=rows, where=times, parameters=np.zeros((len(times), 0)))
        return AssembledRows(unknowns=self.count, parts=(*self.program.parts, part))

    def lanes(self, term: SmoothTerm, samples: list[int]) -> list[Lanes]:
        """Return how a user's function depends on the unknowns: the first sample, the others, or the whole motion.

        Rates are backward differences, 0 at the first sample, as in the motions of the front.
        """
        if not term.local:
            intervals = np.arange(self.slices["times"].start, self.slices["times"].stop)
            count, dof = self.spline.shape[1], self.arm.dof

            def whole(z: list[Any], _: list[Any]) -> tuple[list[Any], Any]:
                table = np.array(z[: count * dof], dtype=object).reshape(count, dof)
                q = [_combine(row.tolist(), table) for row in self.spline]
                steps = [step * self.pace for step in z[count * dof :]]
                return [x for order in backward_rates(q, steps) for row in order for x in row] + steps, 1.0

            where = np.concatenate([np.arange(count * dof), intervals])[None]
            return [Lanes(where=where, parameters=np.zeros((1, 0)), inputs=whole)]
        first = [self._sample_lanes([0], 0)] if samples[0] == 0 else []
        return [*first, self._sample_lanes(samples[len(first) :], term.orders)]

    def _sample_lanes(self, samples: list[int], orders: int) -> Lanes:
        """Return the lanes of functions of rates up to an order; these also depend on previous samples."""
        window = np.maximum(np.array(samples)[:, None] - np.arange(orders + 1), 0)
        weights = self.spline[window]  # (lanes, window, coefficients)
        nonzero = np.any(weights > 0, axis=1)
        first, last = nonzero.argmax(axis=1), nonzero.shape[1] - nonzero[:, ::-1].argmax(axis=1)
        reach, dof = int((last - first).max()), self.arm.dof
        near = np.minimum(first, nonzero.shape[1] - reach)[:, None] + np.arange(reach)
        weights = np.take_along_axis(weights, near[:, None], axis=2)
        before = window[:, :1] - 1 - np.arange(max(orders, 1))
        intervals = before % (len(self.spline) - 1)  # wrapped if there is no interval before

        def inputs(z: list[Any], p: list[Any]) -> tuple[list[Any], Any]:
            table = np.array(z[: reach * dof], dtype=object).reshape(reach, dof)
            rows = np.array(p, dtype=object).reshape(-1, reach)
            q = [_combine(row, table) for row in rows]
            steps = [step * self.pace for step in z[reach * dof :]]
            rates = backward_rates(q[::-1], steps[: len(q) - 1][::-1])
            return [x for order in rates for x in order[-1]], steps[0]

        joints = (near[:, :, None] * dof + np.arange(dof)).reshape(len(near), -1)
        where = np.concatenate([joints, self.slices["times"].start + intervals], axis=1)
        return Lanes(where=where, parameters=weights.reshape(len(near), -1), inputs=inputs)

    def _where(self, near: np.ndarray) -> np.ndarray:
        """Return the indices of unknowns, for coefficients ``near`` (batch, reach) of all joints and sliders."""
        dof = self.arm.dof
        joints = (near[:, :, None] * dof + np.arange(dof)).reshape(len(near), -1)
        return np.concatenate([joints + self.slices["front"].start * k for k in range(self.motors)], axis=1)


def backward_rates(q: list[list[Any]], steps: list[Any]) -> list[list[list[Any]]]:
    """Return positions and three backward differences at samples, ``steps`` apart; 0 at the first sample.

    Source: Tringali & Cocuzza 2020, as ``Motion``.
    """
    orders = [q]
    for _ in range(3):
        values = orders[-1]
        differences = [
            [(b - a) / step for a, b in zip(*pair, strict=True)]
            for pair, step in zip(pairwise(values), steps, strict=True)
        ]
        orders.append([[0.0] * len(q[0]), *differences])
    return orders


@lru_cache(maxsize=32)
def _end(arm: Arm, task: int) -> TracedRows:
    def rows(z: list[Any], position: list[Any]) -> tuple[list[Any], list[Any]]:
        place = kinematics.frame_components(arm, kinematics.link_frames(arm, z), arm.frame(TOOL_FRAME))[1]
        return [place[a] - position[a] for a in range(task)], []

    return trace_rows(arm.dof, task, rows)


@lru_cache(maxsize=32)
def _sample(arm: Arm, actuation: Actuation, reach: int) -> TracedRows:
    """Return the program of bounds, and of motors that hold the arm, at one sample."""

    def rows(z: list[Any], weights: list[Any]) -> tuple[list[Any], list[Any]]:
        q, front = _at(arm, actuation, z, weights)
        load = dynamics.torque_components(arm, q, [0.0] * arm.dof, [0.0] * arm.dof)
        ratios, slacks = ratios_and_slacks(arm, actuation, q, front)
        return [], slacks + stall_slacks(actuation, ratios, load)

    return trace_rows(reach * arm.dof * len(actuation.curves), reach, rows)


@lru_cache(maxsize=32)
def _interval(arm: Arm, actuation: Actuation, reach: int, pace: float, work_unit: float) -> TracedRows:
    """Return the program of the motors between two samples."""
    curves = actuation.curves
    size, dof = reach * arm.dof * len(actuation.curves), arm.dof

    def rows(z: list[Any], weights: list[Any]) -> tuple[list[Any], list[Any]]:
        duration, work = z[size] * pace, np.array(z[size + 1 :], dtype=object).reshape(-1, dof)
        ends = [_at(arm, actuation, z[:size], each) for each in (weights[:reach], weights[reach:])]
        middle, front = ([(a + b) * 0.5 for a, b in zip(*pair, strict=True)] for pair in zip(*ends, strict=True))
        load = dynamics.torque_components(arm, middle, [0.0] * dof, [0.0] * dof)
        ratios, _ = ratios_and_slacks(arm, actuation, middle, front)
        travels = [[b - a for a, b in zip(ends[0][0], ends[1][0], strict=True)]]
        if isinstance(actuation, DistributedActuation):
            backs = [[back for back, _, _ in gear_ratios(actuation, *end)] for end in ends]
            sliders = [end[1] for end in ends], backs
            travels = [[b - a for a, b in zip(*places, strict=True)] for places in sliders]
        slacks = [duration]
        for m, (curve, change) in enumerate(zip(curves, travels, strict=True)):
            effort = np.array([ratios[j][m] * load[j] for j in range(dof)], dtype=object)
            travel = np.array(change, dtype=object)
            slacks += list(curve.slacks(effort, travel, duration).ravel() / pace)
            done = effort * travel / work_unit
            slacks += [w + sign * one for w, one in zip(work[m], done, strict=True) for sign in (-1.0, 1.0)]
        return [], slacks

    return trace_rows(size + 1 + len(curves) * dof, 2 * reach, rows)


def _at(arm: Arm, actuation: Actuation, z: list[Any], weights: list[Any]) -> tuple[list[Any], list[Any]]:
    """Return joints and front sliders [m] at a sample, from coefficients and their weights."""
    q, *front = [_combine(weights, part) for part in np.array(z, dtype=object).reshape(-1, len(weights), arm.dof)]
    if not isinstance(actuation, DistributedActuation):
        return q, [0.0] * arm.dof
    return q, [share * rod for share, rod in zip(front[0], actuation.rod, strict=True)]


def _combine(weights: Iterable[Any], coefficients: np.ndarray) -> list[Any]:
    """Return the weighted sum of coefficients (reach, dof) of each joint."""
    return [sum(w * c for w, c in zip(weights, column, strict=True)) for column in coefficients.T]
