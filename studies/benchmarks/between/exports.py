"""Exports of certified points: each passes a controller with the limits of its problem.

    python -m studies.benchmarks.between.exports [--quick] [--points N] [--json FILE]

Every point of a small front of six problems is exported at 100, 250 and 1,000 Hz to a controller with the same limits,
with a ramp at both ends. "above a limit" counts the motions whose curve exceeds a limit at an instant of the
controller, without the ramp, at their own speed. "refused" counts those that ``pk.export`` refuses; it may slow them
down, because the ramp needs accelerations and torques of its own. "price" is the cost of the margin: each point is
tightened from its optimum at the samples with the margin and without, and the largest rise of every objective is
printed.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

import paretoik as pk
from paretoik.errors import Infeasible
from paretoik.pareto.refine import refine
from paretoik.robot.dynamics import inverse_dynamics
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.tightening import OPTIONS, hold_between
from problems import panda
from studies.reporting import Row, goal_row, report, study_parser, tell

TABLE = "exports"
RATES = (100.0, 250.0, 1000.0)  # Hz
PRICE = 0.05  # % of an objective: the goal
POINTS, QUICK_POINTS, STARTS = 5, 3, 4
TWO = (pk.kinetic_energy, pk.torque_norm)
PLANAR_LINE = ([0.4678, 0.0], [0.0983, 0.1526])


@dataclass(frozen=True, kw_only=True, eq=False)
class Example:
    """A problem by name; its ``limits`` follow from the best motion without any, so that they are active."""

    name: str
    arm: pk.Arm
    path: pk.Path
    limits: Callable[[Motion], pk.Limits]
    settings: dict[str, Any] = field(default_factory=dict)
    from_best: Callable[[Motion], dict[str, Any]] = lambda best: {}

    def problem(self) -> pk.Tracking:
        """Return the problem with limits that its best motion exceeds."""
        boundless = pk.Limits(velocity=np.inf, torque=np.inf)
        free = pk.Tracking(self.arm, self.path, objectives=[TWO[0]], limits=boundless, **self.settings)
        best = free.task.motion(pk.plan(free, starts=STARTS).best.motion.at(free.task.times))
        settings = self.settings | self.from_best(best)
        return pk.Tracking(self.arm, self.path, objectives=list(TWO), limits=self.limits(best), **settings)


def size(best: Motion, kind: str, share: float) -> Float[np.ndarray, " dof"]:
    """Return a symmetric limit: a share of the largest value, at least a twentieth of all joints' largest."""
    largest = np.abs(getattr(best, kind)).max(axis=0)
    return np.asarray(share * np.maximum(largest, 0.05 * largest.max()))


def examples() -> Iterator[Example]:
    """Yield the six problems."""
    arm, lengths, masses = pk.arms.tringali_3r(), np.full(4, 0.125), np.linspace(1.0, 0.4, 4)
    four = pk.Arm.planar(lengths=lengths, masses=masses, centers=lengths / 2, inertias=masses * lengths**2 / 12)
    line = pk.line(*PLANAR_LINE, duration=1.0, samples=31)
    varying = np.linspace(1.1, 1.3, 31)[:, None]
    yield Example(
        name="paper's 3R, position and velocity",
        arm=arm,
        path=line,
        limits=lambda best: pk.Limits(
            position={"joint3": (float(best.q[:, 2].min()), float(best.q[:, 2].max() - 0.03 * np.ptp(best.q[:, 2])))},
            velocity=size(best, "dq", 0.97),
        ),
    )
    yield Example(
        name="planar 4R, acceleration",
        arm=four,
        path=pk.line([0.3, -0.1], [0.25, 0.15], duration=1.0, samples=31),
        limits=lambda best: pk.Limits(acceleration=size(best, "ddq", 0.92)),
    )
    yield Example(
        name="Panda, velocity and torque",
        arm=panda.panda(),
        path=pk.line([0.45, -0.2, 0.4], [0.45, 0.2, 0.5], duration=1.5, samples=26),
        limits=lambda best: pk.Limits(
            velocity=size(best, "dq", 0.98), torque={"panda_joint1": 0.99 * float(np.abs(best.torque[:, 0]).max())}
        ),
    )
    yield Example(
        name="cyclic 3R, velocity and acceleration",
        arm=arm,
        path=pk.circle([0.25, 0.1], 0.05, duration=1.0, samples=31),
        limits=lambda best: pk.Limits(velocity=size(best, "dq", 0.95), acceleration=size(best, "ddq", 0.95)),
        settings={"cyclic": True},
    )
    yield Example(
        name="3R by an obstacle, velocity",
        arm=arm,
        path=line,
        limits=lambda best: pk.Limits(velocity=size(best, "dq", 1.5), clearance=0.005),
        from_best=lambda best: {
            "obstacles": [pk.obstacles.Circle(best.links[15, 2, :2] + np.array([0.0, 0.041]), 0.03)],
            "link_radius": 0.01,
        },
    )
    yield Example(
        name="3R from a start to rest, varying velocity and torque",
        arm=arm,
        path=line,
        limits=lambda best: pk.Limits(velocity=varying * size(best, "dq", 0.9), torque=size(best, "torque", 1.1)),
        from_best=lambda best: {"start": best.q[0]},
        settings={"end_velocity": 0},
    )


def controller(task: MotionTask, rate: float) -> pk.controllers.Controller:
    """Return a controller with the limits of a task, the widest if they vary."""
    widest = {kind: np.abs(bounds).max(axis=(0, 2)) for kind, bounds in task.bounds.items()}
    if "position" in task.bounds:
        widest["position"] = task.bounds["position"][0]
    names = task.arm.joint_names
    return pk.controllers.Controller(name="same limits", joint_names=names, rate=rate, **widest)


def excess(task: MotionTask, motion: Motion, rate: float) -> float:
    """Return by how much the motion's curve exceeds a limit at the controller's instants, as a share of the limit."""
    q, dq, ddq = motion.state(np.arange(int(motion.time[-1] * rate) + 1) / rate)
    torque = inverse_dynamics(task.arm, q, dq, ddq)
    values = {"position": q, "velocity": dq, "acceleration": ddq, "torque": torque, "power": torque * dq}
    largest = -np.inf
    for kind, bounds in task.bounds.items():
        low, high = bounds[..., 0].min(axis=0), bounds[..., 1].max(axis=0)
        beyond = np.maximum(values[kind] - high, low - values[kind]) / np.maximum(np.abs(low), np.abs(high))
        largest = max(largest, float(np.nanmax(beyond)))
    return largest


def export(task: MotionTask, motion: Motion, rate: float, folder: Path) -> float:
    """Return how much a motion is slowed down for its ramps; NaN if it is refused."""
    file, same = folder / "motion.npz", controller(task, rate)
    try:
        sent = pk.export(motion, file, controller=same, ramp=0.2, slow_down=True, overwrite=True)
    except Infeasible as error:
        tell(f"refused: {error}")
        return np.nan
    return float(sent.metadata["time_scale"])


def prices(problem: pk.Tracking, q: Float[np.ndarray, "points time dof"], ranges: np.ndarray) -> np.ndarray:
    """Return by how much the margin raises every objective of points [%], each from its optimum at samples."""
    program = problem.program(ranges)
    optimal, critical = refine(program, q, len(TWO))
    rises = []
    for x in optimal[critical]:
        within, without = (hold_between(program, x, len(TWO), margin=margin) for margin in (OPTIONS.margin, 0.0))
        costs = [program.evaluate(held.x)[0] for held in (within, without)]
        rises.append(100 * (costs[0] / costs[1] - 1))
    return np.array(rises).reshape(-1, len(TWO))


def example_rows(example: Example, points: int) -> list[Row]:
    """Return the rows of one problem."""
    problem = example.problem()
    front = pk.epsilon_front(problem, points=points, starts=STARTS, seed=1)
    certificates, motions = front.certificates, front.motions
    assert certificates is not None
    assert isinstance(motions, Motion)
    certified = np.flatnonzero(certificates.status == "minimum")
    rows = [Row(TABLE, example.name, "certified", "points", len(certified), reference=len(front), source="points")]
    with tempfile.TemporaryDirectory() as folder:
        for rate in RATES:
            above = np.array([excess(front.problem.task, motions[int(i)], rate) for i in certified])
            note = f"the nearest comes within {-above.max(initial=-np.inf):.1e} of its limit"
            count = int((above > 0).sum())
            rows.append(goal_row(TABLE, example.name, f"above a limit, {rate:g} Hz", "points", count, 0, note))
            slower = np.array([export(front.problem.task, motions[int(i)], rate, Path(folder)) for i in certified])
            note = f"slowed down {np.nanmax(slower):.3f} times at most, with the ramp"
            refused = int(np.isnan(slower).sum())
            rows.append(goal_row(TABLE, example.name, f"refused, {rate:g} Hz", "points", refused, 0, note))
    rises = prices(front.problem, motions.q[certified], np.ptp(front.ranges, axis=1))
    for objective, rise in zip(TWO, rises.T, strict=True):
        price = float(rise.max(initial=0.0))
        rows.append(goal_row(TABLE, example.name, f"price, {objective.name}", "%", price, PRICE))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the rows."""
    parser = study_parser(__doc__ or "", quick=f"{QUICK_POINTS} points a front")
    parser.add_argument("--points", type=int, default=POINTS)
    options = parser.parse_args(arguments)
    rows = list[Row]()
    for example in examples():
        rows += example_rows(example, QUICK_POINTS if options.quick else options.points)
        tell(example.name)
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
