"""Tighten limits by their excess between samples, and solve again.

A program bounds a motion at its instants. If the curve exceeds a limit a little between instants, the limit is lowered
there by the excess and a small margin, so that the curve is strictly within its limits.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float
from numpy.lib.stride_tricks import sliding_window_view

from paretoik.errors import warn_user
from paretoik.nlp.minimise import compile_method, minimise
from paretoik.nlp.program import FEASIBLE, InteriorPointOptions, Solver, program_key
from paretoik.pareto.certificates import weights_at
from paretoik.pareto.refine import refine
from paretoik.robot.kinematics import joint_scales
from paretoik.runs.distribution import Lost, compute_each, workers
from paretoik.runs.journal import Values
from paretoik.stop_flag import Interrupted, check_interruption
from paretoik.task.limits import LIMIT_TOLERANCE, LIMITED
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask, finer_motion
from paretoik.task.objectives import evaluate_function
from paretoik.trajectory.transcription import MotionProgram


@dataclass(frozen=True, kw_only=True)
class TighteningOptions:
    """Settings of tightening; shares are of a limit's range."""

    margin: float = 2.5e-5  # share by which a tightened motion is to stay within its limits
    rounds: int = 5  # largest number of rounds of tightening
    largest: float = 0.4  # largest share by which a limit moves in a round
    steps: int = 16  # number of steps per interval at which a motion's curve is evaluated
    shares: tuple[float, ...] = (1.0, 0.5, 0.25)  # shares of a limit's move, tried in order until one leads to a motion
    # weight of all objectives but the first, at a point without weights, as in refinement of fronts
    weight: float = 0.1
    least_weight: float = 1e-3  # least weight of an objective, as a share of a point's weights
    warm: InteriorPointOptions = InteriorPointOptions(barrier=1e-6, radius=0.02)  # solver settings of the first attempt
    # solver settings of the second attempt, if the first does not converge
    holding: InteriorPointOptions = InteriorPointOptions(barrier=1e-4, penalty=100.0, radius=0.02, iterations=400)


OPTIONS = TighteningOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldMotion:
    """An optimal motion for ``bounds``, and its violation between samples."""

    x: Float[np.ndarray, "time dof"]
    bounds: Float[np.ndarray, " limits"]
    violation: float

    def program(self, natural: MotionProgram) -> MotionProgram:
        """Return the task's program (``natural``) for which the motion is optimal."""
        return replace(natural, bounds=self.bounds)


def hold_between(
    program: MotionProgram,
    x: Float[np.ndarray, "time dof"],
    n_obj: int,
    *,
    solver: Solver = "auto",
    margin: float = OPTIONS.margin,
) -> HeldMotion:
    """Return an optimal motion with limits satisfied between samples.

    A few rounds lower the violation as far as they can. Several objectives get worse by the same amount (Pascoletti &
    Serafini 1984). Motions of finite differences, motions that satisfy their limits, and motions that no round improves
    are returned unchanged.
    """
    best = _held(program, x)
    if program.task.differences != "spline":
        return best
    current, weights = best, np.zeros(n_obj)
    for _ in range(OPTIONS.rounds):
        if current.violation <= LIMIT_TOLERANCE or not np.isfinite(current.violation):
            break
        if not weights.any():  # weights of the objectives at the motion; those of refinement if it is not critical
            (found,) = weights_at(program, best.x[None], n_obj)
            weights = OPTIONS.weight + np.eye(n_obj)[0]
            if np.isfinite(found).all():
                weights = np.maximum(found / found.sum(), OPTIONS.least_weight)
        # bounds moved inwards by excess + margin, or by a share of it if there is no such motion
        before = current.bounds
        bounds = _tightened_bounds(program, current.x, before, margin)
        for share in OPTIONS.shares:
            tighter = replace(program, bounds=before + share * (bounds - before))
            solved = _solve_again(tighter, current.x, weights, solver)
            if solved is not None:
                break
        else:
            break
        current = _held(tighter, solved)
        best = min(best, current, key=lambda held: held.violation)
    return best


def hold_all(
    program: MotionProgram,
    x: Float[np.ndarray, "motions time dof"],
    n_obj: int,
    solver: Solver = "auto",
    observe: Callable[[int, int], object] | None = None,
) -> list[HeldMotion]:
    """Return motions as ``hold_between`` does; after a signal, the others unchanged.

    ``observe`` is called with the number of finished motions and of all motions.
    """
    results = dict[int, HeldMotion]()
    unseen = partial(HeldMotion, bounds=program.bounds, violation=np.nan)
    with suppress(Interrupted):
        check_interruption()
        keys = [program_key("held motion", program, one, n_obj, solver) for one in x]
        if len(x) > 1 and workers() > 1:
            compile_method(program, x[0], np.eye(1, len(program.upper)), OPTIONS.warm, solver=solver)
        for i, values in compute_each(_hold_values, program, [(one, n_obj, solver) for one in x], keys):
            if isinstance(values, Lost):
                warn_user(f"motion {i}: {values.cause}; it is not tightened")
                results[i] = unseen(x=x[i])
            else:
                results[i] = HeldMotion(x=values["x"], bounds=values["bounds"], violation=float(values["violation"]))
            if observe is not None:
                observe(len(results), len(x))
    return [results[i] if i in results else unseen(x=one) for i, one in enumerate(x)]


def _hold_values(program: MotionProgram, item: tuple[np.ndarray, int, Solver]) -> Values:
    """Return the result of ``hold_between`` as plain arrays; workers call this."""
    x, n_obj, solver = item
    held = hold_between(program, x, n_obj, solver=solver)
    return {"x": held.x, "bounds": held.bounds, "violation": np.asarray(held.violation)}


def feasible_motions(program: MotionProgram, x: Float[np.ndarray, "motions time dof"]) -> list[HeldMotion]:
    """Return the motions that satisfy their limits at samples and between them."""
    at_samples = [one for one in x if program.evaluate(one)[2].min(initial=0.0) >= -FEASIBLE]
    return [each for each in (_held(program, one) for one in at_samples) if each.violation <= LIMIT_TOLERANCE]


def _held(program: MotionProgram, x: np.ndarray) -> HeldMotion:
    return HeldMotion(x=x, bounds=program.bounds, violation=violation_between(program.task, x))


def violation_between(task: MotionTask, x: Float[np.ndarray, "time dof"]) -> float:
    """Return a motion's worst violation between samples; inf if it leaves the path."""
    return float(task.violation_between(task.motion(x[None]))[0])


def _solve_again(
    program: MotionProgram, x: np.ndarray, weights: Float[np.ndarray, " n_obj"], solver: Solver
) -> np.ndarray | None:
    """Return the optimal motion of a tighter program, or None.

        minimise    weights · F(x)
        subject to  Fⱼ(x) − F_main(x) ≤ Fⱼ(x₀) − F_main(x₀) for the other objectives j, and the tighter limits

    The ``weights`` are those of the motion x₀ before, so that x does not move along the front. Refinement then takes
    the gain that an objective may still have.
    """
    n_obj = len(weights)
    main = int(np.argmax(weights))
    factors = np.pad(weights, (0, len(program.upper) - n_obj))[None]
    rows = np.eye(n_obj, len(program.upper))
    rows[np.arange(n_obj) != main, main] = -1.0  # F_j − F_main
    upper = (rows @ program.evaluate(x)[0])[None]
    upper[0, main] = np.inf
    for options in (OPTIONS.warm, OPTIONS.holding):
        solutions = minimise(program, x[None], factors, upper, options, rows=rows, solver=solver)
        if not solutions.converged[0]:
            continue
        if n_obj == 1:
            return np.asarray(solutions.x[0])
        optimal, critical = refine(program, solutions.x, n_obj, solver=solver)
        if critical[0]:
            return np.asarray(optimal[0])
    return None


def _tightened_bounds(
    program: MotionProgram, x: Float[np.ndarray, "time dof"], before: Float[np.ndarray, " limits"], margin: float
) -> Float[np.ndarray, " limits"]:
    """Return a program's bounds, moved inwards by excess and margin.

    The excess is the largest within half an interval of each bounded instant. If a limit is not active, its bound moves
    inwards from the value there, not from the old bound. If the value exceeds the limit itself, the bound moves by that
    much less.
    """
    task, bounds, elastic = program.task, before.copy(), program.elastic
    curve = finer_motion(task.motion(x), OPTIONS.steps)
    half = OPTIONS.steps // task.stride
    pieces = np.arange(len(curve.time) - 1)[:: OPTIONS.steps, None] + np.arange(OPTIONS.steps + 1)
    row, instant = program.limited[:elastic].T
    rates = row < program.rates  # prismatic joints are in arm lengths in these rows
    units = np.where(rates, joint_scales(task.arm)[row % task.arm.dof], 1.0)
    sides, ranges, names = program.sides[:elastic], program.ranges[:elastic], np.array(program.inequality_names)
    slack = program.values(x).inequalities * ranges + sides * (program.bounds - before)[:elastic]
    after = np.char.startswith(names, "velocity of ") & (row >= len(program.variables))  # rows of the next interval
    for name in dict.fromkeys(names.tolist()):
        for side, excess in zip((1.0, -1.0), _excess(task, name, curve), strict=True):
            chosen = np.flatnonzero((names == name) & (sides == side))
            # values, each replaced by the peak of the parabola through it and its neighbours if this is between them;
            # no parabola goes over a sample, at which the curve's derivatives may jump
            part = excess[pieces]
            with np.errstate(invalid="ignore"):  # −inf is no limit
                rise, bend = part[:, 2:] - part[:, :-2], np.diff(part, 2, axis=1)
            top = (bend < 0) & (np.abs(rise) <= -2.0 * bend)
            peaks = excess.copy()
            peaks[pieces[:, 1:-1][top]] -= rise[top] ** 2 / (8.0 * bend[top])
            padded = np.pad(peaks, (half, 2 * half), constant_values=-np.inf)
            windows = sliding_window_view(padded, 2 * half + 1)[::half][instant[chosen] + after[chosen]]
            around, near = (
                each.max(axis=1) / units[chosen] + margin * ranges[chosen]
                for each in (windows, windows[:, half // 2 : -(half // 2)])
            )
            shift = np.where(around > 0, np.maximum(around + np.minimum(slack[chosen], 0.0), 0.0), 0.0)
            shift = np.where(near > 0, np.maximum(shift, near + slack[chosen]), shift)
            bounds[chosen] += side * np.minimum(shift, OPTIONS.largest * ranges[chosen])
    return bounds


def _excess(
    task: MotionTask, name: str, curve: Motion
) -> tuple[Float[np.ndarray, " time"], Float[np.ndarray, " time"]]:
    """Return the excess over a limit over time, below and above."""
    if name == "clearance":
        return task.min_clearance - curve.clearance, np.full(curve.time.shape, -np.inf)
    for constraint in task.constraints:
        if constraint.name == name:
            values = evaluate_function(f"constraint {name}", constraint.function, curve, constraint.form)
            return constraint.lower - values, values - constraint.upper
    kind, _, joint = name.partition(" of ")
    j = task.arm.joint_names.index(joint)
    bounds, values = task.bounds_at(kind, curve.time)[..., j, :], getattr(curve, LIMITED[kind])[..., j]
    return bounds[..., 0] - values, values - bounds[..., 1]
