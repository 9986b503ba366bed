"""Predictive minimisation: an objective's least over a few samples ahead, and velocities that lead there.

Every now and then the positions ahead are found at which the objective's integral is least (``horizon``), a spline of
fourth degree is laid through them, and the steps until the next time use what the task leaves free to keep to it.

Source: Tringali & Cocuzza 2021, Table 1.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.errors import InvalidInput
from paretoik.resolution.batch import engine
from paretoik.resolution.horizon import Found, horizon
from paretoik.resolution.methods import PredictiveKineticEnergy
from paretoik.resolution.step_program import step_program
from paretoik.resolution.traces import ResolvedMotion, Traces, resolved
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from paretoik.task.retraction import retract, row_space_basis, task_errors

DEGREE = 4


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictiveTraces(Traces):
    """What was predicted, besides what was done: padded with −1 and NaN where motions have fewer updates.

    ``updates`` are the samples at which was looked ahead, ``predictions`` (updates, ahead, dof) [rad, m] the positions
    found, ``values`` the objective over the horizon, minimised, its last sample as often as it counts, ``converged``
    whether that is a minimum on the path, ``iterations`` and ``seconds`` what it took, the spline included.
    """

    updates: Int[np.ndarray, "*batch updates"]
    predictions: Float[np.ndarray, "*batch updates ahead dof"]
    values: Float[np.ndarray, "*batch updates"]
    converged: Bool[np.ndarray, "*batch updates"]
    iterations: Int[np.ndarray, "*batch updates"]
    seconds: Float[np.ndarray, "*batch updates"]


@runtime_checkable
class Ahead(Protocol):
    """What finds the positions ahead: ``Horizon``, or another solver beside it."""

    def solved(self, q: np.ndarray, posture: np.ndarray, velocity: np.ndarray, targets: np.ndarray) -> Found:
        """Return the minimum that positions (ahead, dof) lead to, from a posture and its velocity."""
        ...


@dataclass(frozen=True, kw_only=True)
class Rhythm:
    """How a motion looks ahead, in samples: so many times ``stride``, again after ``interval``.

    The last of them counts ``terminal`` times more.
    """

    ahead: int
    stride: int
    interval: int
    terminal: float

    def updates(self, samples: int) -> list[int]:
        """Return the samples at which all of the horizon lies before the end, at least the first."""
        last = max(samples - 1 - self.ahead * self.stride, 0)
        return list(range(0, last + 1, self.interval))


def rhythms(method: PredictiveKineticEnergy, times: np.ndarray, batch: tuple[int, ...]) -> list[Rhythm]:
    """Return how each motion looks ahead; raise InvalidInput for times that are not whole numbers of samples."""
    dt, duration = float(times[1] - times[0]), float(times[-1] - times[0])
    if np.ptp(np.diff(times)) > 1e-9 * dt:
        raise InvalidInput("PredictiveKineticEnergy: a path with samples evenly spaced in time wanted")
    ahead = np.broadcast_to(method.horizon, batch)
    stride = (
        0.2 * duration / ahead if method.prediction_step is None else np.broadcast_to(method.prediction_step, batch)
    )
    interval = stride / 2 if method.update_interval is None else np.broadcast_to(method.update_interval, batch)
    terminal = np.broadcast_to(np.asarray(method.terminal, dtype=float), batch)
    found = []
    columns = (each.ravel().tolist() for each in (ahead, stride, interval, terminal))
    for h, far, again, more in zip(*columns, strict=True):
        own = Rhythm(ahead=h, stride=max(round(far / dt), 1), interval=max(round(again / dt), 1), terminal=more)
        for name, given, samples in (("prediction_step", far, own.stride), ("update_interval", again, own.interval)):
            if getattr(method, name) is not None and abs(given / dt - samples) > 1e-6 * samples:
                raise InvalidInput(
                    f"PredictiveKineticEnergy: {name} of whole samples of {dt:g} s wanted, got {given:g} s"
                )
        if own.ahead * own.stride > len(times) - 1:
            raise InvalidInput(
                f"PredictiveKineticEnergy: a horizon within the path's {duration:g} s wanted, got {h} times "
                f"{own.stride * dt:g} s"
            )
        found.append(own)
    return found


def predicted(
    task: MotionTask,
    method: PredictiveKineticEnergy,
    start: Float[np.ndarray, "*starts dof"],
    *,
    tolerance: float,
    program: Callable[[MotionTask, Objective, int, float, float], Ahead] = horizon,
) -> ResolvedMotion:
    """Return the motions that look ahead, one for each start and the method's numbers; ``program`` makes what looks.

    Farther than ``tolerance`` [m, rad] off the path they do not, but make for the path.
    """
    numbers = (method.horizon, method.prediction_step, method.update_interval, method.terminal)
    try:
        batch = np.broadcast_shapes(start.shape[:-1], *(np.shape(each) for each in numbers if each is not None))
    except ValueError:
        raise InvalidInput(
            f"PredictiveKineticEnergy: starts of shape {start.shape[:-1]} and its numbers do not fit each other"
        ) from None
    if 0 in batch:
        raise InvalidInput("PredictiveKineticEnergy: numbers wanted, got an empty array")
    n, times, count = task.arm.dof, task.times, int(np.prod(batch))
    own, dt = rhythms(method, times, batch), float(times[1] - times[0])
    if method.feedback * dt > 1 + 1e-12:
        raise InvalidInput(
            f"PredictiveKineticEnergy: feedback from 0 to {1 / dt:.4g} 1/s wanted, got {method.feedback}"
        )
    programs = {each: program(task, method.objective, each.ahead, each.stride * dt, each.terminal) for each in set(own)}
    looks = [Lookout(task=task, program=programs[each], rhythm=each) for each in own]
    q = np.empty((count, len(times), n))
    q[:, 0] = np.broadcast_to(start, (*batch, n)).reshape(count, n)
    found = resolved(count, len(times), n, task.rows, 1)
    step = step_program(task, [])
    given = np.zeros((4 * n + step.table.shape[1], count))
    for k in range(len(times)):
        given[:n], given[4 * n :] = q[:, k].T, step.table[k][:, None]
        error, travel, slopes = np.split(step.written(given), [task.rows, 2 * task.rows])
        found["errors"][:, k] = error.T
        if k == len(times) - 1:
            break
        wanted = (travel / dt + method.feedback * error).T
        before = found["velocities"][:, k - 1] if k else np.zeros((count, n))
        pace = (before - (found["velocities"][:, k - 2] if k > 1 else 0.0)) / dt if k else np.zeros((count, n))
        lost = np.abs(error).max(axis=0) > tolerance
        aims = [one.aimed(k, q[i, k], before[i], pace[i], lost=bool(lost[i])) for i, one in enumerate(looks)]
        free = (np.stack(aims) - q[:, k]) / dt
        parts = (found[name] for name in ("velocities", "repulsion", "projected", "status"))
        engine().stepped(k, dt, np.ascontiguousarray(slopes.T), wanted, free, q, *parts)
    return _told(task, batch, q, found, looks)


class Lookout:
    """What one motion sees ahead, from update to update."""

    def __init__(self, *, task: MotionTask, program: Ahead, rhythm: Rhythm) -> None:
        self.task, self.program, self.rhythm = task, program, rhythm
        self.left = rhythm.updates(len(task.times))
        self.updates: list[tuple[int, np.ndarray, float, bool, int, float]] = []
        self._since, self._pieces = 0, np.zeros((0, DEGREE + 1, task.arm.dof))

    def aimed(self, k: int, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, *, lost: bool) -> np.ndarray:
        """Return where the joints should be at the sample after k; look ahead first where it is time to.

        Off the path, or past what was last seen ahead, they have no aim.
        """
        if lost:
            self._pieces = self._pieces[:0]
        elif self.left and self.left[0] <= k:
            last, self.left = self.left[-1], [update for update in self.left if update > k]
            if k <= last:
                self._look(k, q, dq, ddq)
        place = (k + 1 - self._since) / self.rhythm.stride
        return self._at(place) if place <= len(self._pieces) else q

    def _look(self, k: int, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> None:
        begun = time.perf_counter()
        ahead, stride = self.rhythm.ahead, self.rhythm.stride
        targets = self.task.targets[k + stride * np.arange(1, ahead + 1)]
        if len(self._pieces):
            places = (k - self._since) / stride + np.arange(1, ahead + 1)
            guess = np.stack([self._at(place) for place in places.tolist()])
        else:
            guess = self._along(q, targets)
        found = self.program.solved(guess, q, dq, targets)
        if not found.converged and len(self._pieces):
            found = self.program.solved(self._along(q, targets), q, dq, targets)
        if found.converged or not len(self._pieces):
            pace = stride * float(self.task.times[1] - self.task.times[0])
            self._since, self._pieces = k, quartics(np.concatenate([q[None], found.q]), pace * dq, pace**2 * ddq)
        seconds = time.perf_counter() - begun
        self.updates.append((k, found.q, found.value, found.converged, found.iterations, seconds))

    def _along(self, q: np.ndarray, targets: np.ndarray) -> np.ndarray:
        """Return positions that lead along the path the shortest way, from one to the next."""
        guess, here = np.empty((len(targets), len(q))), q
        for j, target in enumerate(targets):
            slopes = task_errors(self.task.arm, self.task.tasks, here[None], target[None])[1]
            led = retract(self.task.arm, self.task.tasks, here[None], target[None], row_space_basis(slopes))
            guess[j] = here = led.q[0] if led.on_path[0] else here
        return guess

    def _at(self, place: float) -> np.ndarray:
        """Return the spline at a time in strides since it was laid; it ends at rest."""
        piece = min(int(place), len(self._pieces) - 1)
        u = min(place - piece, 1.0)
        found: np.ndarray = u ** np.arange(DEGREE + 1) @ self._pieces[piece]
        return found


def quartics(
    points: Float[np.ndarray, "points dof"], rate: Float[np.ndarray, " dof"], second: Float[np.ndarray, " dof"]
) -> Float[np.ndarray, "pieces 5 dof"]:
    """Return the coefficients of a quartic spline through points one unit of time apart, C² at all of them.

    ``rate`` and ``second`` are its derivatives at the first; at the last both are 0 (with one piece only the first).
    With two pieces, as in the paper, that is all there is to choose; with more it has the least jerk.
    """
    pieces, dof = len(points) - 1, points.shape[1]
    right = np.concatenate([points[:-1], points[1:], rate[None], second[None]])
    return (_spline(pieces) @ right).reshape(pieces, DEGREE + 1, dof)


@lru_cache(maxsize=32)
def _spline(pieces: int) -> np.ndarray:
    """Return what makes coefficients of the values at all beginnings, all ends, and the derivatives at the first."""
    width, powers = DEGREE + 1, np.arange(DEGREE + 1)

    def derivative(order: int, u: float) -> np.ndarray:
        factors = np.prod([powers - i for i in range(order)], axis=0) if order else np.ones(width)
        return np.asarray(np.where(powers >= order, factors * float(u) ** np.maximum(powers - order, 0), 0.0))

    def condition(*parts: tuple[int, np.ndarray]) -> np.ndarray:
        row = np.zeros((pieces, width))
        for piece, values in parts:
            row[piece] = values
        return row.ravel()

    rows = [condition((i, derivative(0, u))) for u in (0, 1) for i in range(pieces)]
    rows += [condition((0, derivative(order, 0))) for order in (1, 2)]
    known = len(rows)
    rows += [condition((pieces - 1, derivative(order, 1))) for order in ((1, 2) if pieces > 1 else (1,))]
    for i in range(1, pieces):
        rows += [condition((i - 1, derivative(order, 1)), (i, -derivative(order, 0))) for order in (1, 2)]
    jerk = np.zeros((width, width))
    jerk[3:, 3:] = [[36.0, 72.0], [72.0, 192.0]]  # ∫ (6 c₃ + 24 c₄ u)² du
    size, held = pieces * width, np.array(rows)
    saddle = np.block([[np.kron(np.eye(pieces), jerk), held.T], [held, np.zeros((len(rows), len(rows)))]])
    return np.linalg.inv(saddle)[:size, size : size + known]


def _told(
    task: MotionTask, batch: tuple[int, ...], q: np.ndarray, found: dict[str, np.ndarray], looks: list[Lookout]
) -> ResolvedMotion:
    """Return motions with their traces."""
    most, ahead = max(len(one.updates) for one in looks), max(one.rhythm.ahead for one in looks)
    shape, n = (len(looks), most), task.arm.dof
    extra = {
        "updates": np.full(shape, -1),
        "predictions": np.full((*shape, ahead, n), np.nan),
        "values": np.full(shape, np.nan),
        "converged": np.zeros(shape, dtype=bool),
        "iterations": np.full(shape, -1),
        "seconds": np.full(shape, np.nan),
    }
    for i, one in enumerate(looks):
        for u, update in enumerate(one.updates):
            extra["updates"][i, u], extra["predictions"][i, u, : len(update[1])] = update[0], update[1]
            for name, value in zip(("values", "converged", "iterations", "seconds"), update[2:], strict=True):
                extra[name][i, u] = value
    return ResolvedMotion.of(task, batch, q, {**found, **extra}, PredictiveTraces)
