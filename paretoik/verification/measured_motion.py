"""A motion measured a second time, from joint positions, Pinocchio's model and the rebuilt curve."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, KroghInterpolator, PPoly, lagrange, make_interp_spline

from paretoik.verification.arm_model import ArmModel, rotation_of
from paretoik.verification.path_targets import (
    curve_states,
    frame_errors,
    path_points,
    path_targets,
    task_axes,
    task_errors,
)
from paretoik.verification.tolerances import OPTIONS

# The curve of a motion, rebuilt from its samples with SciPy, and its finite differences.
#
# With differences="spline", the control point of a sample is the blossom, at three knots, of the parabola through
# the sample and its neighbours. At a free end the curve passes through the sample and its acceleration continues the
# polynomial of the next ones; at an end at rest it passes through the sample with velocity 0. These are linear
# equations for the control points, solved here with SciPy's B-splines. With other differences, curves are splines
# through the samples.


def rebuild(time: np.ndarray, q: np.ndarray, *, differences: str, cyclic: bool, ends_at_rest: bool) -> Any:
    """Return SciPy's curve through or near samples (time, dof); it has a method ``derivative``."""
    if differences != "spline":
        degree = min(3, len(time) - 1)
        return make_interp_spline(time, q, k=degree, bc_type="periodic" if cyclic else None)
    if not cyclic and len(time) < 5 - ends_at_rest:
        # the polynomial through a few samples
        times, values = (np.append(time, time[-1]), np.concatenate([q, 0 * q[:1]])) if ends_at_rest else (time, q)
        taylor = KroghInterpolator(times, values).derivatives(time[0], len(times))
        factorials = np.cumprod([1.0, *range(1, len(times))])
        coefficients = (taylor / factorials[:, None])[::-1]
        return PPoly(coefficients[:, None], [time[0], time[-1]])
    # Knots: the times and three more at each end, from the cycle or mirrored.
    step, count = np.diff(time), len(time)
    ahead, behind = (step[-1:-4:-1], step[:3]) if cyclic else (step[:3], step[-1:-4:-1])
    ahead, behind = (np.cumsum(np.resize(each, 3)) for each in (ahead, behind))
    knots = np.concatenate([(time[0] - ahead)[::-1], time, time[-1] + behind])
    if cyclic:
        around = np.concatenate([q[-2:-1], q, q[1:2]])
        inner = [_blossom(knots[k + 2 : k + 5], around[k : k + 3]) for k in range(count)]
        return BSpline(knots, np.array([inner[-2], *inner, inner[1]]), 3)
    # Control points c: those of inner samples, then B(end) c = q(end) and the condition at each end.
    unit = np.eye(count + 2)
    rows = [unit[k + 1] for k in range(1, count - 1)]
    right = [_blossom(knots[k + 2 : k + 5], q[k - 1 : k + 2]) for k in range(1, count - 1)]
    basis = BSpline(knots, unit, 3)
    last = unit[-1] - unit[-3] if ends_at_rest else _free_row(basis, time[::-1])
    rows += [basis(time[0]), _free_row(basis, time), basis(time[-1]), last]
    right += [q[0], np.zeros(q.shape[1]), q[-1], np.zeros(q.shape[1])]
    return BSpline(knots, np.linalg.solve(np.array(rows), np.array(right)), 3)


def instants_of(time: np.ndarray, differences: str) -> np.ndarray:
    """Return the times of limits and objectives: samples, and for splines also midpoints."""
    if differences != "spline":
        return time
    return np.sort(np.concatenate([time, (time[1:] + time[:-1]) / 2]))


def rates(
    curve: Any, time: np.ndarray, q: np.ndarray, *, differences: str, cyclic: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return velocity, acceleration and jerk at the instants, by the definition of the ``differences``."""
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
    """Return the weights [s] of integrals: Simpson's, the rectangle or the trapezoid rule."""
    step = np.diff(time)
    if differences == "backward":
        return np.append(0.0, step)
    if differences == "central":
        return (np.append(0.0, step) + np.append(step, 0.0)) / 2
    weights = np.zeros(2 * len(time) - 1)
    for k, h in enumerate(step):
        weights[2 * k : 2 * k + 3] += h / 6 * np.array([1.0, 4.0, 1.0])
    return weights


def _blossom(t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the polar form, at three times, of the parabola through three samples."""
    c, b, a = np.linalg.solve(np.vander(t - t[1], 3, increasing=True), q)
    x, y, z = t - t[1]
    return c + b * (x + y + z) / 3 + a * (x * y + y * z + z * x) / 3


def _free_row(basis: BSpline, time: np.ndarray) -> np.ndarray:
    """Return the equation of a free end: the next accelerations, extrapolated, give its own."""
    count = min(OPTIONS.end_accelerations, len(time) - 3)
    second = basis.derivative(2)
    others = time[1 : count + 1] - time[0]
    row = second(time[0])
    for k in range(count):
        share = lagrange(others, np.eye(count)[k])(0.0) if count > 1 else 1.0
        row = row - share * second(time[k + 1])
    return np.asarray(row)


def _backward(values: np.ndarray, time: np.ndarray, *, cyclic: bool) -> np.ndarray:
    slope = (values[1:] - values[:-1]) / (time[1:] - time[:-1])[:, None]
    return np.concatenate([slope[-1:] if cyclic else 0 * slope[:1], slope])


def _central(values: np.ndarray, time: np.ndarray, order: int, *, cyclic: bool) -> np.ndarray:
    """Return derivatives of parabolas through three samples each; an end uses the nearest parabola."""
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


# Distances of links from obstacles: signed distances of points, and a search along each link.
#
# The signed distance of points to a convex body is convex, so that golden-section search along a link finds its
# minimum.


SHAPES = {"Circle": "circle", "Sphere": "sphere", "Capsule": "capsule", "Box": "box", "HalfSpace": "half-space"}


def point_distances(obstacle: Any, points: np.ndarray) -> np.ndarray:
    """Return signed distances [m] of points (..., 3) from an obstacle, negative inside."""
    kind = type(obstacle).__name__
    if kind == "Circle":
        return np.hypot(*np.moveaxis(points[..., :2] - obstacle.center, -1, 0)) - obstacle.radius
    if kind == "Sphere":
        return np.linalg.norm(points - obstacle.center, axis=-1) - obstacle.radius
    if kind == "Capsule":
        axis = obstacle.end - obstacle.start
        size = float(axis @ axis)
        share = np.clip((points - obstacle.start) @ axis / size, 0.0, 1.0) if size else np.zeros(points.shape[:-1])
        return np.linalg.norm(points - obstacle.start - share[..., None] * axis, axis=-1) - obstacle.radius
    if kind == "Box":
        local = (points - obstacle.pose.position) @ rotation_of(obstacle.pose.quaternion)
        excess = np.abs(local[..., : len(obstacle.half_sizes)]) - obstacle.half_sizes
        outside = np.linalg.norm(np.maximum(excess, 0.0), axis=-1)
        return outside + np.minimum(excess.max(axis=-1), 0.0)
    if kind == "HalfSpace":
        offset = float(np.dot(obstacle.normal, obstacle.point))
        return points[..., : len(obstacle.normal)] @ obstacle.normal - offset
    raise TypeError(f"an obstacle of a kind that the verifier does not know: {kind}")


def segment_distances(obstacle: Any, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the least signed distances [m] along segments (..., 3)."""
    low, high = np.zeros(starts.shape[:-1]), np.ones(starts.shape[:-1])

    def at(share: np.ndarray) -> np.ndarray:
        return point_distances(obstacle, starts + share[..., None] * (ends - starts))

    golden = (np.sqrt(5.0) - 1.0) / 2.0
    first, second = high - golden * (high - low), low + golden * (high - low)
    one, two = at(first), at(second)
    best = np.minimum(at(low), at(high))
    for _ in range(OPTIONS.sections):
        left = one < two
        low, high = np.where(left, low, first), np.where(left, second, high)
        first, second = high - golden * (high - low), low + golden * (high - low)
        one, two = at(first), at(second)
        best = np.minimum(best, np.minimum(one, two))
    return best


def pair_distances(obstacles: Sequence[Any], nodes: np.ndarray) -> np.ndarray:
    """Return the least distances (time, links, obstacles) [m] of the center lines of links."""
    return np.stack([segment_distances(each, nodes[:, :-1], nodes[:, 1:]) for each in obstacles], axis=-1)


def nearest_pair(obstacles: Sequence[Any], nodes: np.ndarray, radius: float | tuple[float, ...] = 0.0) -> str:
    """Return in words the link and the obstacle nearest to each other in a posture (nodes, 3)."""
    distances = pair_distances(obstacles, nodes[None])[0] - by_link(radius)
    link, number = np.unravel_index(int(distances.argmin()), distances.shape)
    obstacle = obstacles[int(number)]
    name, shape = getattr(obstacle, "name", ""), SHAPES[type(obstacle).__name__]
    name = f"the obstacle {name}" if name else f"obstacle {number + 1}"
    return f"{f'link {link}' if link else 'the base'} and {name}, a {shape}"


def clearances(obstacles: Sequence[Any], nodes: np.ndarray, radius: float | tuple[float, ...]) -> np.ndarray:
    """Return the least distances (time,) [m] of links (capsules of this radius) from obstacles."""
    return np.asarray((pair_distances(obstacles, nodes) - by_link(radius)).min(axis=(1, 2)))


def by_link(radius: float | tuple[float, ...]) -> np.ndarray:
    """Return radii as a column (1 or links, 1) [m]."""
    return np.asarray(radius, dtype=float).reshape(-1, 1)


# A motion measured a second time.


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredMotion:
    """One motion (1, time, dof) at the instants at which limits and objectives of its problem are evaluated.

    It has the attributes of a ``Motion`` that user functions read, batch first. ``task`` is the problem's.
    """

    model: ArmModel
    task: Any
    time: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    jerk: np.ndarray
    weights: np.ndarray
    coefficients: np.ndarray | None = None
    of_spline: MeasuredMotion | None = None

    @property
    def spline(self) -> MeasuredMotion:
        """The motion of the spline before its projection onto the path, for integrals with kinks."""
        return self if self.of_spline is None else self.of_spline

    @property
    def velocity_bounds(self) -> np.ndarray:
        """Velocities; for a spline Bernstein coefficients at midpoints."""
        return self.dq if self.coefficients is None else self.coefficients

    @property
    def arm(self) -> Any:
        """The arm that moves."""
        return self.model.arm

    @property
    def tasks(self) -> Any:
        """The tasks of the motion."""
        return self.task.tasks

    @property
    def obstacles(self) -> Any:
        """The obstacles of the problem."""
        return self.task.obstacles

    @property
    def link_radius(self) -> float | tuple[float, ...]:
        """Radius of the links [m], or a tuple of one per link."""
        radius = self.task.link_radius
        return tuple(map(float, radius)) if isinstance(radius, tuple) else float(radius)

    @property
    def instants(self) -> MeasuredMotion:
        """The motion itself."""
        return self

    @property
    def duration(self) -> np.ndarray:
        """Time (1,) from the first to the last instant [s]."""
        return np.asarray(self.time[:, -1] - self.time[:, 0])

    def __len__(self) -> int:
        return len(self.q)

    def __iter__(self) -> Iterator[Any]:
        return iter((self,))

    @cached_property
    def torque(self) -> np.ndarray:
        """Joint torques [N m, N]."""
        return self.model.torques(self.q[0], self.dq[0], self.ddq[0])[None]

    @cached_property
    def power(self) -> np.ndarray:
        """Joint powers [W]."""
        return self.torque * self.dq

    @cached_property
    def kinetic_energy(self) -> np.ndarray:
        """Kinetic energies (1, time) [J]."""
        return self.model.kinetic_energies(self.q[0], self.dq[0])[None]

    @cached_property
    def tool(self) -> np.ndarray:
        """Positions of the tool (1, time, 2 or 3) [m]."""
        position = self.model.poses(self.q[0])[1]
        return position[None, :, : 2 if self.arm.is_planar else 3]

    @cached_property
    def tool_rotation(self) -> np.ndarray:
        """Orientations of the tool (1, time, 3, 3)."""
        return self.model.poses(self.q[0])[0][None]

    @cached_property
    def links(self) -> np.ndarray:
        """The arm as a polyline (1, time, dof + 2, 3) [m]."""
        return self.model.nodes(self.q[0])[None]

    @cached_property
    def clearance(self) -> np.ndarray:
        """Distances of links from obstacles (1, time) [m]."""
        return self.pair_clearances.min(axis=(1, 2))[None]

    @cached_property
    def pair_clearances(self) -> np.ndarray:
        """Distances of every link from every obstacle (time, links, obstacles) [m]."""
        return pair_distances(self.obstacles, self.links[0]) - by_link(self.link_radius)

    @cached_property
    def manipulability(self) -> np.ndarray:
        """Yoshikawa's measure of the tasks' Jacobian (1, time), by its singular values."""
        targets = path_targets(self.tasks, np.zeros(1))
        axes = [task_axes(task, self.arm) for task in self.tasks]
        units = np.concatenate([[self.model.length] * size + [1.0] * len(turning) for size, turning in axes])
        jacobians = [task_errors(self.model, targets, q, 0)[1] * units[:, None] for q in self.q[0]]
        return np.array([np.prod(np.linalg.svd(each, compute_uv=False)) for each in jacobians])[None]

    @cached_property
    def position_error(self) -> np.ndarray:
        """Largest distance of a task's frame from its target (1, time) [m]."""
        return self._misses[0]

    @cached_property
    def tracking_error(self) -> np.ndarray:
        """Largest entry of the tasks' errors (1, time) [m or rad]."""
        return self._misses[1]

    def integral(self, series: np.ndarray) -> np.ndarray:
        """Return the time integral (1,) of values at the instants (1, time)."""
        return np.asarray(series @ self.weights)

    @cached_property
    def _misses(self) -> tuple[np.ndarray, np.ndarray]:
        distance, largest = np.zeros(self.time.shape), np.zeros(self.time.shape)
        for task in self.tasks:
            offsets, vectors = frame_errors(self.model, task, self.q[0], path_points(task.path, self.time[0]))
            entries = np.maximum(np.abs(offsets).max(axis=1), np.linalg.norm(vectors, axis=1))
            distance[0] = np.maximum(distance[0], np.linalg.norm(offsets, axis=1))
            largest[0] = np.maximum(largest[0], entries)
        return distance, largest


def measure(model: ArmModel, task: Any, time: np.ndarray, q: np.ndarray) -> MeasuredMotion:
    """Return the measured motion of joint positions (time, dof) at the instants of a task."""
    kind = {"differences": task.differences, "cyclic": task.cyclic}
    curve = rebuild(time, q, **kind, ends_at_rest=task.ends_at_rest)
    dq, ddq, jerk = rates(curve, time, q, **kind)
    t = instants_of(time, task.differences)
    weights = quadrature(time, task.differences)

    def measured(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, **settings: Any) -> MeasuredMotion:
        state: dict[str, Any] = {"q": q[None], "dq": dq[None], "ddq": ddq[None], "jerk": jerk[None], "time": t[None]}
        return MeasuredMotion(model=model, task=task, weights=weights, **state, **settings)

    if task.differences != "spline":
        return measured(q, dq, ddq)
    state = curve(t), dq, ddq
    q, dq, ddq = curve_states(model, task.tasks, state, t)
    bounds = np.array(dq)[None]  # a parabola's coefficient is v + h a / 2 of the sample before
    bounds[0, 1::2] += dq[:-1:2] + np.diff(time)[:, None] / 2 * ddq[:-1:2] - dq[1::2]
    return measured(q, dq, ddq, coefficients=bounds, of_spline=measured(*state))
