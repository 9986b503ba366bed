"""The curve of a motion, rebuilt from its samples with SciPy, and its finite differences.

The curve of differences="spline" has as control point of a sample the blossom, at its three times, of the parabola
through the sample and its neighbours; at a free end it passes through the sample and its acceleration continues the
polynomial of the next ones, at an end at rest it passes through the sample with velocity 0. These are linear equations
for the control points, solved here with SciPy's B-splines. The other curves are splines through the samples.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import BSpline, KroghInterpolator, PPoly, lagrange, make_interp_spline

from paretoik.verification.options import OPTIONS


def rebuild(time: np.ndarray, q: np.ndarray, *, differences: str, cyclic: bool, ends_at_rest: bool) -> Any:
    """Return the curve (time, dof) through or near samples: SciPy's, with ``derivative``."""
    if differences != "spline":
        degree = min(3, len(time) - 1)
        return make_interp_spline(time, q, k=degree, bc_type="periodic" if cyclic else None)
    if not cyclic and len(time) < 5 - ends_at_rest:
        return _polynomial(time, q, ends_at_rest=ends_at_rest)
    knots = _knots(time, cyclic=cyclic)
    rows, right = [], []
    count, samples = len(time) + 2, len(time)
    inner = range(samples) if cyclic else range(1, samples - 1)
    if cyclic:
        around = np.concatenate([q[-2:-1], q, q[1:2]])
        right = [_blossom(knots[k + 2 : k + 5], around[k : k + 3]) for k in inner]
        control = np.array([right[-2], *right, right[1]])
        return BSpline(knots, control, 3)
    unit = np.eye(count)
    for k in inner:
        rows.append(unit[k + 1])
        right.append(_blossom(knots[k + 2 : k + 5], q[k - 1 : k + 2]))
    basis = BSpline(knots, unit, 3)
    for end, sample in ((0, q[0]), (-1, q[-1])):
        rows.append(basis(time[end]))
        right.append(sample)
        rows.append(_rest_row(unit) if end and ends_at_rest else _free_row(basis, time if end == 0 else time[::-1]))
        right.append(np.zeros(q.shape[1]))
    return BSpline(knots, np.linalg.solve(np.array(rows), np.array(right)), 3)


def instants_of(time: np.ndarray, differences: str) -> np.ndarray:
    """Return the times at which limits and objectives hold: samples, of splines the middles between them too."""
    if differences != "spline":
        return time
    return np.sort(np.concatenate([time, (time[1:] + time[:-1]) / 2]))


def rates(
    curve: Any, time: np.ndarray, q: np.ndarray, *, differences: str, cyclic: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return velocity, acceleration and jerk at the instants of a motion, as its differences define them."""
    if differences == "spline":
        t = instants_of(time, differences)
        third = curve.derivative(3)
        after = np.where(t < time[-1], t, time[0] if cyclic else (time[-1] + time[-2]) / 2)
        return curve.derivative(1)(t), curve.derivative(2)(t), third(after)
    if differences == "backward":
        first = _backward(q, time, cyclic=cyclic)
        second = _backward(first, time, cyclic=cyclic)
        return first, second, _backward(second, time, cyclic=cyclic)
    first = _central(q, time, 1, cyclic=cyclic)
    second = _central(q, time, 2, cyclic=cyclic)
    return first, second, _central(second, time, 1, cyclic=cyclic)


def quadrature(time: np.ndarray, differences: str) -> np.ndarray:
    """Return the weights [s] of integrals over the instants: Simpson's, the rectangle's or the trapezoid's."""
    step = np.diff(time)
    if differences == "backward":
        return np.append(0.0, step)
    if differences == "central":
        return (np.append(0.0, step) + np.append(step, 0.0)) / 2
    weights = np.zeros(2 * len(time) - 1)
    for k, h in enumerate(step):
        weights[2 * k : 2 * k + 3] += h / 6 * np.array([1.0, 4.0, 1.0])
    return weights


def _knots(time: np.ndarray, *, cyclic: bool) -> np.ndarray:
    """Return the times with three more at each end: those of the cycle, or mirrored ones."""
    step = np.diff(time)
    ahead, behind = (step[-1:-4:-1], step[:3]) if cyclic else (step[:3], step[-1:-4:-1])
    ahead, behind = (np.resize(each, 3) for each in (ahead, behind))
    return np.concatenate([(time[0] - np.cumsum(ahead))[::-1], time, time[-1] + np.cumsum(behind)])


def _blossom(t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the polar form, at three times, of the parabola through three samples."""
    c, b, a = np.linalg.solve(np.vander(t - t[1], 3, increasing=True), q)
    x, y, z = t - t[1]
    return c + b * (x + y + z) / 3 + a * (x * y + y * z + z * x) / 3


def _free_row(basis: BSpline, time: np.ndarray) -> np.ndarray:
    """Return the equation that the first acceleration continues the polynomial through the next ones."""
    count = min(OPTIONS.end_accelerations, len(time) - 3)
    second = basis.derivative(2)
    others = time[1 : count + 1] - time[0]
    row = second(time[0])
    for k in range(count):
        share = lagrange(others, np.eye(count)[k])(0.0) if count > 1 else 1.0
        row = row - share * second(time[k + 1])
    return np.asarray(row)


def _rest_row(unit: np.ndarray) -> np.ndarray:
    return unit[-1] - unit[-3]


def _polynomial(time: np.ndarray, q: np.ndarray, *, ends_at_rest: bool) -> PPoly:
    """Return the polynomial through a few samples, its end at rest where it has to be."""
    times, values = (np.append(time, time[-1]), np.concatenate([q, 0 * q[:1]])) if ends_at_rest else (time, q)
    polynomial = KroghInterpolator(times, values)
    degree = len(times) - 1
    taylor = polynomial.derivatives(time[0], degree + 1)
    factorials = np.cumprod([1.0, *range(1, degree + 1)])
    coefficients = (taylor / factorials[:, None])[::-1]
    return PPoly(coefficients[:, None], [time[0], time[-1]])


def _backward(values: np.ndarray, time: np.ndarray, *, cyclic: bool) -> np.ndarray:
    slope = (values[1:] - values[:-1]) / (time[1:] - time[:-1])[:, None]
    return np.concatenate([slope[-1:] if cyclic else 0 * slope[:1], slope])


def _central(values: np.ndarray, time: np.ndarray, order: int, *, cyclic: bool) -> np.ndarray:
    """Return derivatives of the parabolas through three samples each; at ends those that belong to a parabola too."""
    if cyclic:
        last = len(time) - 1
        time = np.concatenate([[time[0] - time[last] + time[last - 1]], time, [time[last] + time[1] - time[0]]])
        before, after = values[:1] - values[last:] + values[last - 1 : last], values[last:] + values[1:2] - values[:1]
        values = np.concatenate([before, values, after])
    windows = np.arange(len(time) - 2)[:, None] + np.arange(3)
    t = time[windows] - time[windows[:, 1:2]]
    parabolas = np.linalg.solve(t[..., None] ** np.arange(3), values[windows])
    inner = parabolas[:, 1] if order == 1 else 2 * parabolas[:, 2]
    if cyclic:
        return inner
    if order == 2:
        return np.concatenate([inner[:1], inner, inner[-1:]])
    first = parabolas[0, 1] + 2 * parabolas[0, 2] * t[0, 0]
    last_one = parabolas[-1, 1] + 2 * parabolas[-1, 2] * t[-1, 2]
    return np.concatenate([first[None], inner, last_one[None]])
