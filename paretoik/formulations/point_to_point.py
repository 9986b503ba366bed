"""From point to point with no path given, time against energy, as a pymoo problem.

An individual is a path in joint space, and of the sliders along the links: a spline, whose ends are retracted to
where the tool must begin and end. Path and posture are one thing then, and nothing is tracked. How long it takes at
least, and what work its motors do, follow in closed form.

Source: Kim, Choi & Jang 2021, section 3, which minimises time alone along a model of the tool's speed; that time is
weighed against energy is new.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float
from pymoo.core.problem import Problem

from paretoik.arrays import Genes, JointPaths
from paretoik.capability.actuation import Actuation, DistributedActuation, check_actuation
from paretoik.capability.point_to_point_program import PointToPointProgram
from paretoik.capability.posture_samples import stationary_task
from paretoik.capability.timing import Timing, minimum_timing
from paretoik.errors import InvalidInput, check_size
from paretoik.formulations.dense_points import dense_front_points, dense_individuals
from paretoik.formulations.initial_paths import InitialPaths, find_initial_paths
from paretoik.formulations.protocol import Individuals
from paretoik.formulations.violations import explain_worst
from paretoik.front.front import Front
from paretoik.inputs import finite_array
from paretoik.nlp.dense import DenseProgram
from paretoik.nlp.program import Solver
from paretoik.pareto.cold_search import StartSearch
from paretoik.robot.arm import Arm
from paretoik.task.limits import LIMIT_TOLERANCE
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import ON_PATH_TOLERANCE, retract

COEFFICIENT_RANGE = 1.5  # rad or m: how far from its base a coefficient may be
SLIDER_OVERSHOOT = 0.5  # of a slider's way: how far a coefficient may be past it, where samples are within
SHORTEST_INTERVAL = 1e-6  # s: an interval in which nothing moves
REFINEMENT = 8  # times finer than the samples


class PointToPoint(Problem):  # type: ignore[misc]  # pymoo is not typed
    """Bring the tool from ``start`` to ``target``, quickly and with little work: a vectorised pymoo problem.

    Objectives: ``duration`` [s], the least time in which motors can follow, each within its curve under the load of
    gravity; ``energy`` [J], the work of all motors, given or taken. Inertia is not counted (quasi-static). Every
    motion of the front has its own times. ``pk.refine`` polishes them by the convex subproblem and exact gradients.

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

    names: Sequence[str] = ("duration", "energy")
    units: Sequence[str] = ("s", "J")
    maximised: Sequence[bool] = (False, False)
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
        given: dict[str, Any] = {"start": start, "target": target}
        ends = [finite_array(name, place, (task,)) for name, place in given.items()]
        if np.linalg.norm(ends[1] - ends[0]) < 1e-9:
            raise InvalidInput(f"target: another place than the start wanted, got {ends[1].tolist()} m twice")
        self.arm, self.actuation, self.start, self.target = arm, actuation, *ends
        self.ways: InitialPaths = find_initial_paths(
            arm, actuation, *ends, samples=samples, coefficients=coefficients, bases=bases, seed=seed
        )
        slides = self.ways.size * isinstance(actuation, DistributedActuation)
        low = np.concatenate([[0.0], np.full(self.ways.size, -COEFFICIENT_RANGE), np.full(slides, -SLIDER_OVERSHOOT)])
        high = np.concatenate(
            [[1.0], np.full(self.ways.size, COEFFICIENT_RANGE), np.full(slides, 1.0 + SLIDER_OVERSHOOT)]
        )
        super().__init__(n_var=len(low), n_obj=2, n_ieq_constr=len(self.constraint_names), xl=low, xu=high)

    def profiles(self, genes: Genes) -> tuple[JointPaths, JointPaths, Float[np.ndarray, " points"]]:
        """Return coefficients of joints and front sliders (points, coefficients, dof), and how far ends are off [m]."""
        known, count = self.ways, len(genes)
        which = np.minimum((genes[:, 0] * len(known.q)).astype(int), len(known.q) - 1)
        q = known.q[which] + genes[:, 1 : 1 + known.size].reshape(count, *known.q.shape[1:])
        missed = np.zeros(count)
        for end, still in zip((0, -1), self._ends, strict=True):
            across = known.across[which, end]
            targets = np.repeat(still.targets[:1], count, axis=0)
            led = retract(self.arm, still.tasks, np.ascontiguousarray(q[:, end]), targets, across)
            q[:, end] = led.q
            missed = np.maximum(missed, led.error)
        front = np.zeros_like(q)
        if isinstance(self.actuation, DistributedActuation):
            low, high = self.actuation.front_bounds.T
            front = low + genes[:, 1 + known.size :].reshape(q.shape) * (high - low)
        return q, front, missed

    def timing(self, genes: Genes) -> Timing:
        """Return the least times and the work of genes (points, n_var)."""
        q, front, _ = self.profiles(genes)
        return minimum_timing(self.arm, self.actuation, self.ways.spline @ q, self.ways.spline @ front)

    def sliders(self, genes: Genes) -> Float[np.ndarray, "points time 2 dof"] | None:
        """Return front and back sliders at the samples [m]; None without any."""
        if not isinstance(self.actuation, DistributedActuation):
            return None
        q, front, _ = self.profiles(genes)
        places = self.ways.spline @ front
        return np.stack([places, self.actuation.gears(self.ways.spline @ q, places)[0]], axis=2)

    def decode(self, genes: Genes) -> Motion:
        """Return the motions (points, time, dof) of genes, each with its own times."""
        q, front, _ = self.profiles(genes)
        q, front = self.ways.spline @ q, self.ways.spline @ front
        steps = np.nan_to_num(minimum_timing(self.arm, self.actuation, q, front).intervals, nan=1.0)
        time = np.concatenate([np.zeros((len(q), 1)), np.cumsum(np.maximum(steps, SHORTEST_INTERVAL), axis=1)], axis=1)
        return Motion(arm=self.arm, time=time, q=q)

    def program(self, scales: Float[np.ndarray, " n_obj"] | None = None) -> DenseProgram:
        """Return the nonlinear program of coefficients, intervals and work, its objectives divided by ``scales``."""
        divisors = np.ones(self.n_obj) if scales is None else scales
        costs = self._journey.costs / divisors[:, None]
        return DenseProgram(rows=self._journey.program, costs=costs, objective_names=tuple(self.names))

    def front_points(self, front: Front) -> Float[np.ndarray, "points unknowns"]:
        """Return the points of a front's genes."""
        return dense_front_points(self, front)

    def individuals(self, x: Float[np.ndarray, "points unknowns"], genes: Genes | None = None) -> Individuals:
        """Return points as individuals, with genes that stand for them."""
        return dense_individuals(self, x, genes)

    def branches(self, x: Float[np.ndarray, "points unknowns"]) -> list[str]:
        """Return the number of the base that each point is nearest to."""
        return [str(int(place * len(self.ways.q))) for place in self.genes(x)[:, 0]]

    def cold_search(
        self, *, starts: int, seed: int, solver: Solver = "auto", observe: Callable[[int, int], object] | None = None
    ) -> StartSearch:
        """Return how optima are found from nothing: from so many starts, each by itself."""
        x = self.points(self.sample_starts(starts, np.random.default_rng(seed)))
        return StartSearch(program_of=self.program, starts=x, n_obj=self.n_obj, solver=solver, observe=observe)

    def points(self, genes: Genes) -> Float[np.ndarray, "points unknowns"]:
        """Return the unknowns of the smooth program at genes."""
        q, front, _ = self.profiles(genes)
        timing = minimum_timing(self.arm, self.actuation, self.ways.spline @ q, self.ways.spline @ front)
        return self._journey.unknowns(q, front, timing.intervals, timing.work)

    def genes(self, x: Float[np.ndarray, "points unknowns"]) -> Genes:
        """Return the genes of unknowns, or the nearest within their bounds."""
        q, front = self._journey.coefficients(x)
        away = q[:, None] - self.ways.q
        which = np.abs(away).max(axis=(2, 3)).argmin(axis=1)
        genes = [((which + 0.5) / len(self.ways.q))[:, None], away[np.arange(len(q)), which].reshape(len(q), -1)]
        if isinstance(self.actuation, DistributedActuation):
            low, high = self.actuation.front_bounds.T
            share = (front - low) / np.where(high > low, high - low, 1.0)
            genes.append(share.reshape(len(q), -1))
        found: Genes = np.clip(np.concatenate(genes, axis=1), self.xl, self.xu)
        return found

    def violation_between(self, genes: Genes) -> Float[np.ndarray, " points"]:
        """Return how much longer than an interval motors need for it, over the mean one, or how overloaded they are.

        The most of both, intervals cut in eight and timed anew; 0 (points,) where motors can do it all.
        """
        q, front, _ = self.profiles(genes)
        fine = self.ways.finer(REFINEMENT)
        given = self.timing(genes).intervals
        again = minimum_timing(self.arm, self.actuation, fine @ q, fine @ front)
        least = again.intervals.reshape(*given.shape, REFINEMENT).sum(axis=2)
        late = np.nan_to_num(least - given, nan=0.0).max(axis=1) / given.mean(axis=1)
        found: np.ndarray = np.maximum(np.maximum(late, again.overload), 0.0)
        return found

    def sample_starts(self, count: int, rng: np.random.Generator) -> Genes:
        """Return genes of the bases, as they are and a little away."""
        rows = np.zeros((count, self.n_var))
        which = np.arange(count) % len(self.ways.q)
        rows[:, 0] = (which + 0.5) / len(self.ways.q)
        away = np.where(np.arange(count) < len(self.ways.q), 0.0, 0.1)[:, None]
        rows[:, 1 : 1 + self.ways.size] = away * rng.normal(size=(count, self.ways.size))
        if isinstance(self.actuation, DistributedActuation):
            own = self.ways.shares[which].reshape(count, -1)
            rows[:, 1 + self.ways.size :] = np.clip(own + away * rng.normal(size=own.shape), 0.0, 1.0)
        return np.clip(rows, self.xl, self.xu)

    def fingerprint_parts(self) -> list[object]:
        """Return what makes genes mean what they mean: arm, motors, ends and bases."""
        arm = self.arm
        bodies = [np.concatenate([[body.mass], body.center]) for body in arm.bodies]
        known = [self.actuation.table, self.start, self.target, self.ways.q, self.ways.spline, arm.position_limits]
        return [*known, arm.joint_names, arm.gravity, arm.tool.position, *bodies]

    def explain(self, genes: Genes) -> list[str]:
        """Return for each individual which limit is violated most, in words; "" where none is."""
        return explain_worst(self.constraint_names, self.constraint_units, self.evaluate(genes, return_values_of=["G"]))

    @cached_property
    def _ends(self) -> tuple[MotionTask, MotionTask]:
        return stationary_task(self.arm, self.start), stationary_task(self.arm, self.target)

    @cached_property
    def _journey(self) -> PointToPointProgram:
        known = self.ways
        return PointToPointProgram(
            arm=self.arm,
            actuation=self.actuation,
            start=self.start,
            target=self.target,
            spline=known.spline,
            pace=known.pace,
            work_unit=known.work_unit,
        )

    def _evaluate(self, X: Genes, out: dict[str, Any], *args: object, **kwargs: object) -> None:
        q, front, missed = self.profiles(X)
        q, front = self.ways.spline @ q, self.ways.spline @ front
        with np.errstate(invalid="ignore"):
            timing = minimum_timing(self.arm, self.actuation, q, front)
            past = self.ways.past(q, front)
        F = np.stack([timing.duration, timing.energy], axis=1)
        G = np.stack(
            [missed / ON_PATH_TOLERANCE - 1.0, *(np.stack([past[0], timing.overload, past[1]]) - LIMIT_TOLERANCE)],
            axis=1,
        )
        bad = ~np.isfinite(F).all(axis=1)
        out["F"] = np.where(bad[:, None], 1e6, F)
        out["G"] = np.where(np.isnan(G), 1.0, np.where(bad[:, None], np.maximum(G, 1e-3), G))
