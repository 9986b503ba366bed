"""Looking ahead as a pymoo problem: how far, how finely and how often, against what that costs and what it brings.

An individual is the rhythm of a predictive method: horizon, prediction step, update interval, and how much more the
last sample ahead counts. All individuals are followed side by side.

Source: Tringali & Cocuzza 2021, section 2.2, which chooses these by hand; that they are searched for is new.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pymoo.core.problem import Problem

from paretoik.arrays import Genes
from paretoik.errors import InvalidInput, check_size
from paretoik.resolution.horizon import horizon
from paretoik.resolution.methods import PredictiveKineticEnergy
from paretoik.resolution.predictive import PredictiveTraces, rhythms
from paretoik.resolution.resolve import resolve
from paretoik.resolution.traces import ResolvedMotion
from paretoik.robot.arm import Arm
from paretoik.self_motion.postures import wrap_difference
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.motion_task_validation import motion_task
from paretoik.task.objectives import Objective, kinetic_energy
from paretoik.task.path import Path
from paretoik.task.task import Task
from paretoik.trajectory.plan import find_optima

FARTHEST = 6  # samples ahead, at most
WINDOW = 0.5  # share of the duration that is looked at, at most
TERMINAL = 4.0  # times more that the last sample counts, at most
LOST = 0.05  # m or rad: a motion farther off its path has not followed it


class PredictiveTracking(Problem):  # type: ignore[misc]  # pymoo is not typed
    """Find the rhythm by which looking ahead follows ``path``: a vectorised pymoo problem.

    Objectives: that of the motion, by its own name; ``evaluations``, the samples that an update looks at, all its
    iterations together, in the mean; ``distance``, how far the motion is from the global optimum's (RMS over time of
    the joint distance [rad, m]). A motion that loses its path is infeasible.

    Parameters
    ----------
    arm, path
        The arm, and a Path, a Task or several of them, samples evenly spaced in time.
    start
        Joint positions (dof,) on the path's first sample.
    objective
        An integral one of positions, velocities and accelerations.
    optimum
        The motion that distances are taken from; by default the best that ``plan`` finds from the same start.
    starts, seed
        Of that plan.

    Genes: horizon (1 to 6 samples, or as many as half the path has), prediction step and update interval as shares of
    what is possible, terminal weight.

    Raises
    ------
    InvalidInput
        Naming what cannot be used; and what ``plan`` raises where it finds no optimum.
    """

    def __init__(
        self,
        arm: Arm,
        path: Path | Task | Sequence[Path | Task],
        *,
        start: Sequence[float] | np.ndarray,
        objective: Objective = kinetic_energy,
        optimum: Motion | None = None,
        starts: int = 48,
        seed: int = 0,
    ) -> None:
        check_size("starts", starts, 1)
        check_size("seed", seed, 0)
        if np.shape(start) != (arm.dof,):
            raise InvalidInput(f"start: {arm.dof} joint positions wanted, got {start!r}")
        self.path, self.objective = path, objective
        self.task: MotionTask = motion_task(
            arm,
            path,
            objectives=[objective],
            start=start,
        )
        samples = len(self.task.times)
        ahead = min(FARTHEST, (samples - 1) // 2)
        if ahead < 1:
            raise InvalidInput(f"path: at least 3 samples wanted, got {samples}")
        horizon(self.task, objective, 1, 1.0)  # refuses what cannot be looked ahead with
        rhythms(PredictiveKineticEnergy(prediction_step=float(self.task.times[1])), self.task.times, ())
        self.optimum = find_optima(self.task, starts=starts, seed=seed).best.motion if optimum is None else optimum
        if not isinstance(self.optimum, Motion):
            raise InvalidInput(f"optimum: a Motion wanted, got {self.optimum!r}")
        if self.optimum.q.shape != (len(self.task.times), arm.dof):
            raise InvalidInput(
                f"optimum: one motion of shape ({len(self.task.times)}, {arm.dof}) wanted, got {self.optimum.q.shape}"
            )
        low, high = [1.0, 0.0, 0.0, 0.0], [ahead + 1 - 1e-9, 1.0, 1.0, TERMINAL]
        super().__init__(n_var=4, n_obj=3, n_ieq_constr=1, xl=np.array(low), xu=np.array(high))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the objectives."""
        return (self.objective.name, "evaluations", "distance")

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the objectives."""
        return (self.objective.unit, "", "rad, m")

    @property
    def maximised(self) -> tuple[bool, ...]:
        """Which objectives are maximised."""
        return (self.objective.maximise, False, False)

    @property
    def constraint_names(self) -> tuple[str, ...]:
        """A name for the column of G."""
        return ("tracking",)

    def method(self, genes: Genes) -> PredictiveKineticEnergy:
        """Return the method of genes (points, n_var), its numbers (points,) in whole samples."""
        dt, most = float(self.task.times[1]), WINDOW * (len(self.task.times) - 1)
        ahead = genes[:, 0].astype(int)
        stride = np.maximum(np.floor(genes[:, 1] * most / ahead), 1)
        interval = np.maximum(np.round(genes[:, 2] * stride * ahead), 1)
        return PredictiveKineticEnergy(
            objective=self.objective,
            horizon=ahead,
            prediction_step=stride * dt,
            update_interval=interval * dt,
            terminal=genes[:, 3],
        )

    def decode(self, genes: Genes) -> ResolvedMotion:
        """Return the motions (points, time, dof) of genes."""
        start = self.task.start
        return resolve(self.task.arm, self.path, self.method(genes), start=start, unreachable="track", tolerance=LOST)

    def explain(self, genes: Genes) -> list[str]:
        """Return for each individual why it is infeasible, in words; "" where it is feasible."""
        errors = np.abs(self.decode(genes).traces.errors).max(axis=(-2, -1))
        return [f"{error:.3g} m or rad off the path" if error > LOST else "" for error in errors]

    def fingerprint_parts(self) -> list[object]:
        """Return what makes genes mean what they mean: the start, the task, the objective and the optimum."""
        task = self.task
        return [task.start, task.targets, task.times, task.arm.joint_names, self.names, self.maximised, self.optimum.q]

    def _evaluate(self, X: Genes, out: dict[str, object], *args: object, **kwargs: object) -> None:
        motion = self.decode(X)
        traces = motion.traces
        assert isinstance(traces, PredictiveTraces)
        known = traces.updates >= 0
        looked = np.where(known, traces.iterations + 1, 0).sum(axis=1) / known.sum(axis=1) * X[:, 0].astype(int)
        apart = wrap_difference(motion.q - self.optimum.q, self.task.arm.periodic)
        distance = np.sqrt(np.mean(np.sum(apart**2, axis=-1), axis=-1))
        out["F"] = np.stack([self.objective.sign * self.objective(motion), looked, distance], axis=1)
        out["G"] = (np.abs(traces.errors).max(axis=(-2, -1)) / LOST - 1.0)[:, None]
