"""Random problems with active limits, which the best motion without limits exceeds; how far motions exceed limits.

Motions are judged by positions ``at(t)`` on a finer grid. Velocities and accelerations are differences of positions at
distances of ``STEPS`` of a sample's interval, all on one side of the instant, towards the middle of the interval: the
acceleration may have kinks at samples.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

import paretoik as pk
from paretoik.collision.obstacles import Obstacle
from paretoik.errors import Infeasible, InvalidInput, OutOfReach, SolverFailed
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import InteriorPointOptions
from paretoik.task.differences import Derivatives
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from paretoik.trajectory.plan_starts import sample_starts
from paretoik.trajectory.transcription import motion_program
from problems import panda

FINER = 50
STEPS = 1 / 40, 1 / 160  # of an interval: five of the longer ones fit into half of it
FORWARD = {  # weights of six neighbours for the first and second derivative (Fornberg 1988, table 3)
    1: (-137 / 60, 5.0, -5.0, 10 / 3, -5 / 4, 1 / 5),
    2: (15 / 4, -77 / 6, 107 / 6, -13.0, 61 / 12, -5 / 6),
}


def worst_violation(task: MotionTask, motion: Motion, finer: int = FINER) -> tuple[float, str]:
    """Return a motion's largest violation of a limit, a share of its range, and its place in words.

    At each instant the smaller violation of two steps of differences counts: the longer one fails next to a jump of the
    jerk, the shorter one shows the error of Newton's method.
    """
    shortest = float(np.diff(task.times).min())
    share = np.arange(finer + 1) / finer
    times = task.times[:-1, None] + np.diff(task.times)[:, None] * share
    halves = times[:, share < 0.5].ravel(), times[:, share >= 0.5].ravel()
    found = list[tuple[float, str]]()
    for half, side in zip(halves, (1, -1), strict=True):
        judged = [motion_at(motion, half, side * step * shortest) for step in STEPS]
        violations = [task.violations(each) for each in judged]
        value = float(np.minimum(*violations).max(initial=0.0))
        nearest = judged[int(np.argmin([each.max(initial=0.0) for each in violations]))]
        found.append((value, task.describe_violation(nearest) if value > 0 else ""))
    return max(found)


def motion_at(motion: Motion, times: np.ndarray, step: float) -> Motion:
    """Return a motion's positions at times, and velocities and accelerations by differences of positions."""
    ahead = (times[:, None] + step * np.arange(6)).ravel()
    places = motion.at(np.clip(ahead, motion.time[0], motion.time[-1])).reshape(len(times), 6, -1)
    dq, ddq = (np.einsum("k,tkj->tj", FORWARD[order], places) / step**order for order in (1, 2))
    rates = Derivatives(dq=dq, ddq=ddq, jerk=np.zeros_like(dq), velocity_bounds=dq.copy())
    return replace(motion, time=times, q=places[:, 0], cyclic=False, derivatives=rates)


KINDS = ("velocity", "acceleration", "torque", "clearance", "position")


@dataclass(frozen=True, kw_only=True)
class CaseOptions:
    """How problems are made.

    A limit is ``share`` of what the best motion without it needs, less for every joint at random. An obstacle reaches
    ``depth`` [m] into the clearance of that motion, the best from ``starts``. ``barriers`` are tried one after the
    other. Problems whose best motion stays more than a share ``active`` of a range away from every limit are left out.
    """

    share: tuple[float, float] = (0.88, 0.97)
    depth: float = 0.004
    starts: int = 3
    attempts: int = 40
    active: float = 1e-3
    barriers: tuple[InteriorPointOptions, ...] = (
        InteriorPointOptions(barrier=1e-3, radius=0.05),
        InteriorPointOptions(barrier=0.1, radius=0.4),
    )


OPTIONS = CaseOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """A problem by name: the arguments of ``pk.Tracking``, except its discretisation.

    ``q`` is the best motion (time, dof) without limits, ``scale`` the objective there.
    """

    name: str
    arm: pk.Arm
    path: pk.Path
    objective: Objective
    cyclic: bool
    limits: pk.Limits
    q: Float[np.ndarray, "time dof"]
    scale: float
    obstacles: tuple[Obstacle, ...] = ()

    def problem(self, differences: str) -> pk.Tracking:
        """Return the problem with a discretisation."""
        return pk.Tracking(
            self.arm,
            self.path,
            objectives=[self.objective],
            limits=self.limits,
            obstacles=list(self.obstacles),
            link_radius=0.01 if self.obstacles else 0.0,
            cyclic=self.cyclic,
            differences=differences,  # type: ignore[arg-type]
        )


def random_cases(count: int, seed: int, samples: tuple[int, ...]) -> Iterator[Case]:
    """Return ``count`` problems, kinds of limits in rotation, every other arm spatial."""
    rng, made = np.random.default_rng(seed), 0
    for _ in range(OPTIONS.attempts * count):
        if made == count:
            return
        case = _random_case(f"{made + 1}", KINDS[made % len(KINDS)], made // len(KINDS) % 2 == 1, rng, samples)
        if case is not None:
            made += 1
            yield case


def _random_case(
    number: str, kind: str, spatial: bool, rng: np.random.Generator, samples: tuple[int, ...]
) -> Case | None:
    """Return a problem with active limits of a kind; None if arm and path do not suit each other."""
    arm, path, cyclic = random_path(rng, spatial=spatial, samples=int(rng.choice(samples)))
    objective = pk.kinetic_energy if rng.random() < 0.5 else pk.torque_norm
    try:
        free = pk.Tracking(arm, path, objectives=[objective], cyclic=cyclic).task
        q = minimise_from(free, sample_starts(free, OPTIONS.starts, rng))
        if q is None:
            return None
        best = free.motion(q)
        limits, obstacles = _active(kind, best, rng)
        name = f"{number}: {kind}, {'spatial' if spatial else 'planar'} {arm.dof}R, {len(path.times)} samples"
        case = Case(
            name=f"{name}, {objective.name}" + (", cyclic" if cyclic else ""),
            arm=arm,
            path=path,
            objective=objective,
            cyclic=cyclic,
            limits=limits,
            q=q,
            scale=float(objective(best)),
            obstacles=obstacles,
        )
        task = case.problem("spline").task
        optimum = minimise_from(task, q[None])
    except (Infeasible, OutOfReach, InvalidInput, SolverFailed):
        return None
    return case if optimum is not None and task.violations(task.motion(optimum)).max() > -OPTIONS.active else None


def minimise_from(task: MotionTask, q: Float[np.ndarray, "starts time dof"]) -> Float[np.ndarray, "time dof"] | None:
    """Return the best optimum from motions on the path; None without one."""
    values = task.objectives[0](task.motion(q))
    program = motion_program(task, [float(values.min())])
    for options in OPTIONS.barriers:
        solutions = minimise(program, q, np.ones((1, 1)), options=options)
        if solutions.converged.any():
            best = np.argmin(np.where(solutions.converged, solutions.objectives[:, 0], np.inf))
            return np.asarray(solutions.x[best])
    return None


def random_path(rng: np.random.Generator, *, spatial: bool, samples: int) -> tuple[pk.Arm, pk.Path, bool]:
    """Return a planar arm or the Panda, a path for it, and whether it is a cycle."""
    if spatial:
        middle = np.array([rng.uniform(0.4, 0.5), 0.0, rng.uniform(0.3, 0.5)])
        across = np.array([rng.uniform(-0.1, 0.1), rng.uniform(0.15, 0.25), rng.uniform(-0.1, 0.1)])
        ends = [middle - across, middle + across]
        if rng.random() < 0.5:
            first, last = (pk.Pose.from_rpy(tuple(end), panda.DOWN) for end in ends)
            return panda.panda(), pk.line(first, last, duration=1.5, samples=samples), False
        return panda.panda(), pk.line(*ends, duration=1.5, samples=samples), False
    dof = int(rng.integers(3, 6))
    lengths = rng.uniform(0.15, 0.35, dof)
    masses = rng.uniform(0.3, 1.5, dof)
    arm = pk.Arm.planar(lengths=lengths, masses=masses, centers=lengths / 2, inertias=masses * lengths**2 / 12)
    reach, angle = lengths.sum(), rng.uniform(-np.pi, np.pi)
    radial = np.array([np.cos(angle), np.sin(angle)])
    middle = rng.uniform(0.45, 0.65) * reach * radial
    if rng.random() < 0.3:
        return arm, pk.circle(middle, 0.12 * reach, duration=1.0, samples=samples), True
    across = rng.uniform(0.15, 0.25) * reach * np.array([-radial[1], radial[0]])
    return arm, pk.line(middle - across, middle + across, duration=1.0, samples=samples), False


def _active(kind: str, best: Motion, rng: np.random.Generator) -> tuple[pk.Limits, tuple[Obstacle, ...]]:
    """Return limits of a kind that a motion exceeds, and obstacles."""
    share = rng.uniform(*OPTIONS.share, size=best.arm.dof)
    if kind == "clearance":
        # an obstacle near the elbow at a random time, a little too near
        nodes = best.links[int(rng.integers(len(best.time) // 4, 3 * len(best.time) // 4))]
        elbow, radius = nodes[len(nodes) // 2], 0.03
        away = np.append(rng.normal(size=2), 0.0) if best.arm.is_planar else rng.normal(size=3)
        centre = elbow + (radius + 0.015 - OPTIONS.depth) * away / np.linalg.norm(away)
        near = pk.obstacles.Circle(centre[:2], radius) if best.arm.is_planar else pk.obstacles.Sphere(centre, radius)
        return pk.Limits(clearance=0.005), (near,)
    if kind in ("torque", "position"):
        values = best.torque if kind == "torque" else best.q
        middle, half = (values.max(axis=0) + values.min(axis=0)) / 2, share * np.ptp(values, axis=0) / 2
        half = np.maximum(half, 0.05 * half.max())
        both = (middle - half, middle + half)
        return (pk.Limits(torque=both) if kind == "torque" else pk.Limits(position=both)), ()
    largest = np.abs(best.dq if kind == "velocity" else best.ddq).max(axis=0)
    bound = share * np.maximum(largest, 0.05 * largest.max())
    return (pk.Limits(velocity=bound) if kind == "velocity" else pk.Limits(acceleration=bound)), ()
