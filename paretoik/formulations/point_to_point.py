"""From point to point with no path given, time against energy, as a pymoo problem.

An individual is a path in joint space, and of the sliders along the links: a spline, whose ends are retracted to
where the tool must begin and end. Path and posture are one thing then, and nothing is tracked. How long it takes at
least, and what work its motors do, follow in closed form.

Source: Kim, Choi & Jang 2021, section 3, which minimises time alone along a model of the tool's speed; that time is
weighed against energy is new.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Genes, JointPaths
from paretoik.capability.actuation import Actuation, DistributedActuation, check_actuation
from paretoik.capability.point_to_point_program import PointToPointProgram
from paretoik.capability.posture_samples import stationary_task
from paretoik.capability.timing import Timing, minimum_timing
from paretoik.errors import InvalidInput, check_size
from paretoik.formulations.dense_formulation import DenseFormulation, front_sliders, slider_shares
from paretoik.formulations.initial_paths import InitialPaths, find_initial_paths
from paretoik.inputs import finite_array
from paretoik.nlp.dense import DenseProgram
from paretoik.robot.arm import Arm
from paretoik.task.limits import LIMIT_TOLERANCE
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import ON_PATH_TOLERANCE, retract


@dataclass(frozen=True, kw_only=True)
class PointToPointOptions:
    """Settings of genes and of what is checked between samples."""

    coefficient_range: float = 1.5  # rad or m: of a coefficient from its base
    slider_overshoot: float = 0.5  # share of a slider's range that a coefficient may be past it, samples being within
    shortest_interval: float = 1e-6  # s: in which nothing moves
    refinement: int = 8  # times that the check between samples is finer than these


OPTIONS = PointToPointOptions()


class PointToPoint(DenseFormulation):
    """Bring the tool from ``start`` to ``target``, quickly and with little work: a vectorised pymoo problem.

    Objectives: ``duration`` [s], the least time in which motors can follow, each within its curve under the load of
    gravity; ``energy`` [J], the work of all motors, given or taken. Inertia is not counted (quasi-static). Every
    motion of the front has its own times. ``pk.refine`` refines them by exact gradients.

    Parameters
    ----------
    arm, actuation
        The arm, its gravity as it is mounted, and what drives it.
    start, target
        Positions of the tool, (2,) for planar arms, else (3,) [m], any posture at either.
    samples, coefficients
        Of a motion, and of its spline for each joint and slider.
    bases, seed
        The most initial paths, straight (or bowed, where that is out of reach) in different postures, and the seed of
        their chance; part of the problem.

    Genes: place among the bases, how far each coefficient of each joint is from the base's, and those of the front
    sliders as shares of their way.

    Raises
    ------
    InvalidInput
        Naming what cannot be used; OutOfReach where start or target, or what lies between them, cannot be reached.
    Infeasible
        Where motors can hold the arm along no path, naming joint, torque and limit.
    """

    names = ("duration", "energy")
    units = ("s", "J")
    maximised = (False, False)
    constraint_names = ("ends", "joint limits", "motors", "sliders")
    constraint_units = ("times what is accepted", "rad or m", "of what they can bear", "of the rod")

    def __init__(
        self,
        arm: Arm,
        actuation: Actuation,
        start: object,
        target: object,
        *,
        samples: int = 17,
        coefficients: int = 6,
        bases: int = 12,
        seed: int = 0,
    ) -> None:
        check_actuation(actuation, arm)
        check_size("samples", samples, 5)
        check_size("coefficients", coefficients, 4)
        check_size("bases", bases, 1)
        check_size("seed", seed, 0)
        if coefficients > samples:
            raise InvalidInput(f"coefficients: at most {samples} wanted, one a sample, got {coefficients}")
        task = 2 if arm.is_planar else 3
        if arm.dof <= task:
            raise InvalidInput(
                f"{arm.name}: more than {task} joints wanted, so that there are paths to choose, got {arm.dof}"
            )
        ends = [finite_array(name, place, (task,)) for name, place in (("start", start), ("target", target))]
        if np.linalg.norm(ends[1] - ends[0]) < 1e-9:
            raise InvalidInput(f"target: another place than the start wanted, got {ends[1].tolist()} m twice")
        self.arm, self.actuation, self.start, self.target = arm, actuation, *ends
        self.initial_paths: InitialPaths = find_initial_paths(
            arm, actuation, *ends, samples=samples, coefficients=coefficients, bases=bases, seed=seed
        )
        self.base_count = len(self.initial_paths.q)
        size, overshoot = self.initial_paths.size, OPTIONS.slider_overshoot
        slides = size * isinstance(actuation, DistributedActuation)
        low = np.concatenate([[0.0], np.full(size, -OPTIONS.coefficient_range), np.full(slides, -overshoot)])
        high = np.concatenate([[1.0], np.full(size, OPTIONS.coefficient_range), np.full(slides, 1.0 + overshoot)])
        super().__init__(n_var=len(low), n_obj=2, n_ieq_constr=len(self.constraint_names), xl=low, xu=high)

    def profiles(self, genes: Genes) -> tuple[JointPaths, JointPaths, Float[np.ndarray, " points"]]:
        """Return coefficients of joints and front sliders (points, coefficients, dof), and how far ends are off."""
        paths, count = self.initial_paths, len(genes)
        which = self.base_indices(genes)
        q = paths.q[which] + genes[:, 1 : 1 + paths.size].reshape(count, *paths.q.shape[1:])
        error = np.zeros(count)
        for end, stationary in zip((0, -1), self._ends, strict=True):
            retracted = retract(self.arm, stationary.tasks, q[:, end], stationary.targets[0], paths.across[which, end])
            q[:, end] = retracted.q
            error = np.maximum(error, retracted.error)
        if not isinstance(self.actuation, DistributedActuation):
            return q, np.zeros_like(q), error
        return q, front_sliders(self.actuation, genes[:, 1 + paths.size :].reshape(q.shape)), error

    def timing(self, genes: Genes) -> Timing:
        """Return the least times and the work of genes (points, n_var)."""
        return minimum_timing(self.arm, self.actuation, *self._samples(genes)[:2])

    def _samples(self, genes: Genes) -> tuple[JointPaths, JointPaths, Float[np.ndarray, " points"]]:
        """Return positions and front sliders (points, time, dof) at the samples, and how far ends are off."""
        q, front, error = self.profiles(genes)
        return self.initial_paths.spline @ q, self.initial_paths.spline @ front, error

    def sliders(self, genes: Genes) -> Float[np.ndarray, "points time 2 dof"] | None:
        """Return front and back sliders at the samples [m]; None without any."""
        if not isinstance(self.actuation, DistributedActuation):
            return None
        q, front, _ = self._samples(genes)
        return np.stack([front, self.actuation.gears(q, front)[0]], axis=2)

    def decode(self, genes: Genes) -> Motion:
        """Return the motions (points, time, dof) of genes, each with its own times."""
        q, front, _ = self._samples(genes)
        steps = np.nan_to_num(minimum_timing(self.arm, self.actuation, q, front).intervals, nan=1.0)
        ends = np.cumsum(np.maximum(steps, OPTIONS.shortest_interval), axis=1)
        return Motion(arm=self.arm, time=np.concatenate([np.zeros((len(q), 1)), ends], axis=1), q=q)

    def program(self, scales: Float[np.ndarray, " n_obj"] | None = None) -> DenseProgram:
        """Return the nonlinear program of coefficients, intervals and work, its objectives divided by ``scales``."""
        divisors = np.ones(self.n_obj) if scales is None else scales
        costs = self._unscaled.costs / divisors[:, None]
        return DenseProgram(rows=self._unscaled.program, costs=costs, objective_names=tuple(self.names))

    def points(self, genes: Genes) -> Float[np.ndarray, "points unknowns"]:
        """Return the unknowns of the smooth program at genes."""
        paths = self.initial_paths
        q, front, _ = self.profiles(genes)
        timing = minimum_timing(self.arm, self.actuation, paths.spline @ q, paths.spline @ front)
        return self._unscaled.unknowns(q, front, timing.intervals, timing.work)

    def genes(self, x: Float[np.ndarray, "points unknowns"]) -> Genes:
        """Return the genes of unknowns, or the nearest within their bounds."""
        paths = self.initial_paths
        q, front = self._unscaled.coefficients(x)
        difference = q[:, None] - paths.q
        which = np.abs(difference).max(axis=(2, 3)).argmin(axis=1)
        genes = [((which + 0.5) / len(paths.q))[:, None], difference[np.arange(len(q)), which].reshape(len(q), -1)]
        if isinstance(self.actuation, DistributedActuation):
            genes.append(slider_shares(self.actuation, front).reshape(len(q), -1))
        clipped: Genes = np.clip(np.concatenate(genes, axis=1), self.xl, self.xu)
        return clipped

    def violation_between(self, genes: Genes) -> Float[np.ndarray, " points"]:
        """Return how much longer than an interval motors need for it, over the mean one, or how overloaded they are.

        The most of both, intervals cut in eight and timed anew; 0 (points,) where motors can do it all.
        """
        q, front, _ = self.profiles(genes)
        spline = self.initial_paths.finer(OPTIONS.refinement)
        intervals = self.timing(genes).intervals
        retimed = minimum_timing(self.arm, self.actuation, spline @ q, spline @ front)
        shortest = retimed.intervals.reshape(*intervals.shape, OPTIONS.refinement).sum(axis=2)
        late = np.nan_to_num(shortest - intervals, nan=0.0).max(axis=1) / intervals.mean(axis=1)
        violation: np.ndarray = np.maximum(np.maximum(late, retimed.overload), 0.0)
        return violation

    def sample_starts(self, count: int, rng: np.random.Generator) -> Genes:
        """Return genes of the bases, as they are and at a small distance."""
        paths = self.initial_paths
        rows = np.zeros((count, self.n_var))
        which = np.arange(count) % len(paths.q)
        rows[:, 0] = (which + 0.5) / len(paths.q)
        distance = np.where(np.arange(count) < len(paths.q), 0.0, 0.1)[:, None]
        rows[:, 1 : 1 + paths.size] = distance * rng.normal(size=(count, paths.size))
        if isinstance(self.actuation, DistributedActuation):
            shares = paths.shares[which].reshape(count, -1)
            rows[:, 1 + paths.size :] = np.clip(shares + distance * rng.normal(size=shares.shape), 0.0, 1.0)
        return np.clip(rows, self.xl, self.xu)

    def fingerprint_parts(self) -> list[object]:
        """Return what makes genes mean what they mean: arm, motors, ends and bases."""
        parts = [self.actuation.table, self.start, self.target, self.initial_paths.q, self.initial_paths.spline]
        return [*parts, *self.arm_fingerprint()]

    @cached_property
    def _ends(self) -> tuple[MotionTask, MotionTask]:
        return stationary_task(self.arm, self.start), stationary_task(self.arm, self.target)

    @cached_property
    def _unscaled(self) -> PointToPointProgram:
        paths = self.initial_paths
        return PointToPointProgram(
            arm=self.arm,
            actuation=self.actuation,
            start=self.start,
            target=self.target,
            spline=paths.spline,
            pace=paths.pace,
            work_unit=paths.work_unit,
        )

    def _evaluate(self, X: Genes, out: dict[str, Any], *args: object, **kwargs: object) -> None:
        q, front, error = self._samples(X)
        with np.errstate(invalid="ignore"):
            timing = minimum_timing(self.arm, self.actuation, q, front)
            excess = self.initial_paths.range_excess(q, front)
        F = np.stack([timing.duration, timing.energy], axis=1)
        G = np.stack(
            [error / ON_PATH_TOLERANCE - 1.0, *(np.stack([excess[0], timing.overload, excess[1]]) - LIMIT_TOLERANCE)],
            axis=1,
        )
        invalid = ~np.isfinite(F).all(axis=1)
        out["F"] = np.where(invalid[:, None], 1e6, F)
        out["G"] = np.where(np.isnan(G), 1.0, np.where(invalid[:, None], np.maximum(G, 1e-3), G))
