"""Finite differences and quadrature: the discretisations of a motion.

- "backward" as in Tringali & Cocuzza 2020: v₀ = a₀ = 0, vᵢ = (qᵢ − qᵢ₋₁)/Δt, aᵢ = (vᵢ − vᵢ₋₁)/Δt, integrals by the
  right rectangle rule
- "central": second order, integrals by the trapezoid rule; on a cycle v₀ = v_N
- "spline": derivatives of the cubic spline near the samples (``Spline``), integrals by Simpson's rule with midpoints
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Series

Differences: TypeAlias = Literal["backward", "central", "spline"]
DIFFERENCES: Differences = "spline"  # default of motions and of problems
Samples: TypeAlias = Float[np.ndarray, "*batch time columns"]
Instants: TypeAlias = Float[np.ndarray, "*#batch time"]


def first_derivative(values: Samples, time: Instants, differences: Differences, *, cyclic: bool) -> Samples:
    """Return the first time derivatives of values (*batch, time, columns) at their samples."""
    if differences == "central":
        change, step = _steps(values, time, cyclic=cyclic)
        slope, before, after = change / step, step[..., :-1, :], step[..., 1:, :]
        inner: Samples = (slope[..., :-1, :] * after + slope[..., 1:, :] * before) / (before + after)
        if cyclic:
            return inner
        first = 2 * slope[..., :1, :] - inner[..., :1, :]
        last = 2 * slope[..., -1:, :] - inner[..., -1:, :]
        return np.concatenate([first, inner, last], axis=-2)
    velocity = np.empty_like(values)
    velocity[..., 1:, :] = np.diff(values, axis=-2) / np.diff(time)[..., None]
    velocity[..., 0, :] = velocity[..., -1, :] if cyclic else 0.0
    return velocity


def second_derivative(values: Samples, time: Instants, differences: Differences, *, cyclic: bool) -> Samples:
    """Return the second time derivatives of values (*batch, time, columns) at their samples."""
    if differences == "backward":
        first = first_derivative(values, time, differences, cyclic=cyclic)
        return first_derivative(first, time, differences, cyclic=cyclic)
    change, step = _steps(values, time, cyclic=cyclic)
    inner: Samples = 2 * np.diff(change / step, axis=-2) / (step[..., :-1, :] + step[..., 1:, :])
    if cyclic:
        return inner
    return np.concatenate([inner[..., :1, :], inner, inner[..., -1:, :]], axis=-2)


def quadrature_weights(time: Series, differences: Differences) -> Series:
    """Return the weights (*batch, time) [s] of an integral over the samples."""
    step = np.diff(time)
    zero = np.zeros((*step.shape[:-1], 1))
    left, right = np.concatenate([zero, step], axis=-1), np.concatenate([step, zero], axis=-1)
    return left if differences == "backward" else (left + right) / 2


def simpson_weights(time: Series) -> Series:
    """Return the weights (*batch, time) [s] of Simpson's rule. Odd indices are midpoints."""
    sixth = (time[..., 2::2] - time[..., :-2:2]) / 6
    weights = np.zeros(time.shape)
    weights[..., :-2:2] += sixth
    weights[..., 1::2] += 4 * sixth
    weights[..., 2::2] += sixth
    return weights


def with_midpoints(time: Series) -> Series:
    """Return times (*batch, 2 · time − 1) with intervals' midpoints added."""
    dense = np.empty((*time.shape[:-1], 2 * time.shape[-1] - 1))
    dense[..., ::2] = time
    dense[..., 1::2] = (time[..., 1:] + time[..., :-1]) / 2
    return dense


def _steps(values: Samples, time: Instants, *, cyclic: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the steps of values and of time between samples. A cycle continues by one step at each end."""
    change, step = np.diff(values, axis=-2), np.diff(time)[..., None]
    if not cyclic:
        return change, step
    change, step = (np.concatenate([part[..., -1:, :], part, part[..., :1, :]], axis=-2) for part in (change, step))
    return change, step


# Cubic splines near samples: local quasi-interpolants of motions
#
# The control point of a sample is that of the parabola through this sample and its neighbours. So the spline reproduces
# parabolas at any times, and cubics at evenly spaced times, with cᵢ = qᵢ − (qᵢ₊₁ − 2qᵢ + qᵢ₋₁)/6. It misses inner
# samples by about δ⁴q/36, and passes through the first and the last. At a free end the acceleration continues the
# parabola of the next three samples, so that it is as accurate as elsewhere; an end at rest is mirrored; a cycle is
# wrapped. Every value depends only on the few samples around it. Source: de Boor, A Practical Guide to Splines,
# chapter XII.


@dataclass(frozen=True, kw_only=True, eq=False)
class Spline:
    """A cubic spline with knots at the samples.

    position, velocity, acceleration: values at the knots
    inner_velocity: middle Bernstein coefficient of each interval's velocity, a parabola (*batch, time − 1, columns)

    In an interval, the velocity is between the smallest and largest of this coefficient and the velocities at both
    ends. The acceleration is between the accelerations at both ends.
    """

    time: Instants
    position: Samples
    velocity: Samples
    acceleration: Samples
    inner_velocity: Float[np.ndarray, "*batch intervals columns"]
    cyclic: bool = False

    @property
    def jerk(self) -> Float[np.ndarray, "*batch intervals columns"]:
        """Third derivatives, constant on each interval."""
        slope: np.ndarray = np.diff(self.acceleration, axis=-2) / np.diff(self.time)[..., None]
        return slope

    def at(self, t: Float[np.ndarray, "*#batch instants"]) -> tuple[Float[np.ndarray, "*batch instants columns"], ...]:
        """Return position, velocity, acceleration and jerk at increasing times within the motion."""
        if self.time.ndim == t.ndim == 1:
            before = np.searchsorted(self.time, t, side="right")
        else:
            before = np.sum(self.time[..., :, None] <= t[..., None, :], axis=-2)
        interval = np.clip(before - 1, 0, self.time.shape[-1] - 2)
        time = np.broadcast_to(self.time, (*interval.shape[:-1], self.time.shape[-1]))
        s = t - np.take_along_axis(time, interval, axis=-1)
        shape = np.broadcast_shapes(self.position.shape[:-2], interval.shape[:-1])
        index = np.broadcast_to(interval, (*shape, interval.shape[-1]))[..., None]
        parts = self.position, self.velocity, self.acceleration, self.jerk
        q, dq, ddq, jerk = (
            np.take_along_axis(np.broadcast_to(part, (*shape, *part.shape[-2:])), index, axis=-2) for part in parts
        )
        s = s[..., None]
        return (
            q + s * (dq + s * (ddq / 2 + s * jerk / 6)),
            dq + s * (ddq + s * jerk / 2),
            ddq + s * jerk,
            jerk,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Derivatives:
    """Known derivatives of a motion at its samples, which replace differences."""

    dq: Samples
    ddq: Samples
    jerk: Samples
    velocity_bounds: Samples  # velocities, or Bernstein coefficients that bound them
    spline: tuple[Samples, ...] | None = None  # state (q, dq, ddq) of the spline, if the motion is its projection

    def __post_init__(self) -> None:
        for values in (self.dq, self.ddq, self.jerk, self.velocity_bounds):
            values.setflags(write=False)

    def __getitem__(self, index: int | slice | np.ndarray) -> Derivatives:
        rates = {name: getattr(self, name)[index] for name in ("dq", "ddq", "jerk", "velocity_bounds")}
        return Derivatives(**rates, spline=self.spline and tuple(part[index] for part in self.spline))


def evaluate_with_midpoints(spline: Spline) -> tuple[Instants, Samples, Derivatives]:
    """Return times, positions and derivatives at the samples and midpoints."""
    x, v, a, inner = spline.position, spline.velocity, spline.acceleration, spline.inner_velocity
    step = np.diff(spline.time)[..., None]
    middle = (x[..., :-1, :] + x[..., 1:, :]) / 2 + step * (v[..., :-1, :] - v[..., 1:, :]) / 8
    jerk = spline.jerk
    derivatives = Derivatives(
        dq=_interleave(v, (v[..., :-1, :] + 2 * inner + v[..., 1:, :]) / 4),
        ddq=_interleave(a, (a[..., :-1, :] + a[..., 1:, :]) / 2),
        jerk=_interleave(np.concatenate([jerk, jerk[..., :1, :] if spline.cyclic else jerk[..., -1:, :]], -2), jerk),
        velocity_bounds=_interleave(v, inner),
    )
    return with_midpoints(spline.time), _interleave(x, middle), derivatives


def fit_spline(q: Samples, time: Instants, *, cyclic: bool, ends_at_rest: bool) -> Spline:
    """Return the cubic spline near the samples, as described above."""
    # two more knots at each end, wrapped from the cycle or mirrored
    step = np.diff(time)
    before, after = (step[..., -2:], step[..., :2]) if cyclic else (step[..., 1::-1], step[..., :-3:-1])
    first = time[..., :1] - np.cumsum(before[..., ::-1], axis=-1)[..., ::-1]
    knots = np.concatenate([first, time, time[..., -1:] + np.cumsum(after, axis=-1)], axis=-1)
    # control points (*batch, time + 2, columns), one beyond each end
    if cyclic:
        control = _inner_control_points(np.concatenate([q[..., -3:-1, :], q, q[..., 1:3, :]], axis=-2), knots)
    elif q.shape[-2] < 5 - ends_at_rest:
        # the polynomial through three or four samples, whose polar form at three knots is a control point
        samples, unit = q.shape[-2], knots[..., -3:-2] - knots[..., 2:3]
        t = (knots - knots[..., 2:3]) / unit
        powers = np.arange(samples + ends_at_rest)
        matrix, values = t[..., 2:-2, None] ** powers, q
        if ends_at_rest:
            slopes = np.broadcast_to(powers.astype(float), (*t.shape[:-1], 1, len(powers)))
            matrix, values = (
                np.concatenate([matrix, slopes], -2),
                np.concatenate([q, np.zeros_like(q[..., :1, :])], axis=-2),
            )
        rows = np.stack([polar_form(t[..., k : k + 3]) for k in range(samples + 2)], axis=-2)[..., : len(powers)]
        factors = np.linalg.solve(np.swapaxes(matrix, -1, -2), np.swapaxes(rows, -1, -2))
        control = np.swapaxes(factors, -1, -2) @ values
    else:
        inner = _inner_control_points(q, knots[..., 2:-2])
        near = min(4, inner.shape[-2])
        if ends_at_rest:
            rest = np.diff(knots)
            share = (rest[..., -3] / (2 * rest[..., -3] + rest[..., -4]))[..., None, None]
            last = (q[..., -1:, :] - share * inner[..., -1:, :]) / (1 - share)
            inner = np.concatenate([inner, last, inner[..., -1:, :]], axis=-2)
        else:
            end = _free_end(q[..., -1:, :], inner[..., : -near - 1 : -1, :], -knots[..., : -near - 5 : -1])
            inner = np.concatenate([inner, end[..., ::-1, :]], axis=-2)
        start = _free_end(q[..., :1, :], inner[..., :near, :], knots[..., : near + 4])
        control = np.concatenate([start, inner], axis=-2)
    position, velocity, acceleration, slopes = _values_at_knots(control, knots)
    return Spline(
        time=time,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        inner_velocity=slopes[..., 1:-1, :],
        cyclic=cyclic,
    )


def _values_at_knots(control: np.ndarray, knots: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return position, velocity, acceleration at knots, and the velocity's control points.

    The two outer knots at each end are left out.

    Source: de Boor 1978, X (12).
    """
    slopes = 3 * np.diff(control, axis=-2) / (knots[..., 3:] - knots[..., :-3])[..., None]
    before, after = np.diff(knots)[..., 1:-2, None], np.diff(knots)[..., 2:-1, None]
    acceleration = 2 * np.diff(slopes, axis=-2) / (before + after)
    velocity = (after * slopes[..., :-1, :] + before * slopes[..., 1:, :]) / (before + after)
    position = control[..., 1:-1, :] - velocity * (after - before) / 3 + acceleration * before * after / 6
    return position, velocity, acceleration, slopes


def _interleave(samples: np.ndarray, midpoints: np.ndarray) -> np.ndarray:
    dense = np.empty((*samples.shape[:-2], 2 * samples.shape[-2] - 1, samples.shape[-1]))
    dense[..., ::2, :], dense[..., 1::2, :] = samples, midpoints
    return dense


def _inner_control_points(q: Samples, time: Instants) -> np.ndarray:
    """Return the control points of all samples except the two ends."""
    before, after = np.diff(time)[..., :-1, None], np.diff(time)[..., 1:, None]
    slope = np.diff(q, axis=-2) / np.diff(time)[..., None]
    curvature = np.diff(slope, axis=-2) / (before + after)
    middle = (slope[..., :-1, :] * after + slope[..., 1:, :] * before) / (before + after)
    control: np.ndarray = q[..., 1:-1, :] + middle * (after - before) / 3 - curvature * before * after / 3
    return control


def _free_end(q: np.ndarray, control: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Return the first two control points of a free end.

    The spline passes through the first sample. Its first acceleration continues the parabola (or line) through the next
    three (or two) accelerations. ``control`` has the next three or four control points, ``knots`` the first seven or
    eight knots, two of them before the first sample.
    """
    count = control.shape[-2] + 2
    units = np.broadcast_to(np.eye(count), (*knots.shape[:-1], count, count))
    position, _, acceleration, _ = _values_at_knots(units, knots)
    time = knots[..., 2:count]
    factors = list[np.ndarray]()  # Lagrange's factors of an extrapolation to the first time
    for k in range(1, count - 2):
        others = [j for j in range(1, time.shape[-1]) if j != k]
        shares = [(time[..., 0] - time[..., j]) / (time[..., k] - time[..., j]) for j in others]
        factors.append(np.prod(np.broadcast_arrays(np.ones(time.shape[:-1]), *shares), axis=0))
    ahead = np.stack(factors, axis=-1)[..., None, :]
    bend = acceleration[..., :1, :] - ahead @ acceleration[..., 1:, :]
    rows = np.concatenate([position[..., :1, :], bend], axis=-2)
    right = np.concatenate([q, np.zeros_like(q)], axis=-2) - rows[..., 2:] @ control
    end: np.ndarray = np.linalg.solve(rows[..., :2], right)
    return end


def polar_form(t: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 4"]:
    """Return the polar forms of 1, t, t² and t³ at three times. The polar forms give a cubic's control point."""
    x, y, z = t[..., 0], t[..., 1], t[..., 2]
    return np.stack([np.ones_like(x), (x + y + z) / 3, (x * y + y * z + z * x) / 3, x * y * z], axis=-1)
