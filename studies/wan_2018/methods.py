"""The methods of sections 3.1 and 3.2, and one within limits, from one population of starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Literal

import numpy as np

import paretoik as pk
from paretoik.resolution.protocol import ResolvedMotion
from paretoik.runs.distribution import Executor
from paretoik.task.random_starts import sample_postures
from paretoik.task.validation import motion_task
from problems import wan_2018
from problems.wan_2018 import BAND, BUFFER, DAMPING, FEEDBACK, GAIN_POSITIONS, GAIN_VELOCITIES, REGION, REPULSION
from studies.processes import run_each
from studies.reporting import paper_numbers, tell

AXES = {"x": "m", "y": "m", "z": "m", "α": "rad", "β": "rad", "γ": "rad"}
VARIANTS: dict[str, Literal["paper", "consistent"]] = {"WGPM, as printed": "paper", "WGPM, consistent": "consistent"}
LIMITED = {
    "Table 2": {"QP, positions": pk.Limits(velocity=np.inf), "QP, velocities too": pk.Limits()},
    "Table 3": {"QP, velocities too": pk.Limits()},
}
paper = partial(paper_numbers, "wan_2018")


@dataclass(frozen=True, kw_only=True, eq=False)
class Resolved:
    """The motions of a table's methods, by name, from the same starts."""

    table: str
    motions: dict[str, ResolvedMotion]

    @property
    def baseline(self) -> str:
        """The method that the paper compares with."""
        return next(iter(self.motions))

    def nearest_start(self) -> int:
        """Return the start with the baseline's errors nearest to print, in logarithms.

        Motions whose steps were cut short do not count; the paper prints no start.
        """
        return int(error_distances(self.table, self.baseline, self.motions[self.baseline]).argmin())


def paper_name(name: str) -> str:
    """Return the paper's name of a method."""
    return "WGPM" if name in VARIANTS else name


def paper_methods(table: str) -> dict[str, pk.methods.DampedLeastSquares]:
    """Return the methods of Table 2 (limits on positions only) or Table 3 (and on velocities)."""
    positions = pk.methods.Criterion(objective=pk.joint_limit_nearness, gain=GAIN_POSITIONS, reference=7.0)
    velocities = pk.methods.Criterion(objective=pk.velocity_limit_nearness, gain=GAIN_VELOCITIES, reference=7.0)
    methods: dict[str, pk.methods.DampedLeastSquares] = (
        {"WLN": pk.methods.WeightedLeastNorm(feedback=FEEDBACK, region=REGION, damping=DAMPING)}
        if table == "Table 2"
        else {
            "GPM": pk.methods.GradientProjection(
                criteria=[positions, velocities], feedback=FEEDBACK, region=REGION, damping=DAMPING
            )
        }
    )
    for name, variant in VARIANTS.items():
        methods[name] = pk.methods.WeightedGradientProjection(
            criteria=[] if table == "Table 2" else [velocities],
            variant=variant,
            feedback=FEEDBACK,
            region=REGION,
            damping=DAMPING,
            buffer=BUFFER,
            repulsion=REPULSION,
            band=BAND,
        )
    return methods


def all_methods(table: str) -> dict[str, tuple[pk.methods.Method, pk.Limits]]:
    """Return the paper's methods and the quadratic program, with the limits of each."""
    methods: dict[str, tuple[pk.methods.Method, pk.Limits]] = {
        name: (method, pk.Limits()) for name, method in paper_methods(table).items()
    }
    program = pk.methods.ConstrainedQP(feedback=FEEDBACK, region=REGION, damping=DAMPING)
    return methods | {name: (program, limits) for name, limits in LIMITED[table].items()}


def path_of(table: str, euler: str = wan_2018.EULER) -> pk.Path:
    """Return the path of a table's motions; ``euler`` names the axes of its angles."""
    return wan_2018.simulation(euler=euler) if table == "Table 2" else wan_2018.experiment(euler=euler)


def start_postures(path: pk.Path, count: int, *, seed: int = 0) -> np.ndarray:
    """Return postures (postures, 7) of the first pose, within the limits, from a number of random ones."""
    arm = pk.arms.wan_7r()
    task = motion_task(arm, path, objectives=[pk.joint_travel])
    candidates = sample_postures(task, count, np.random.default_rng(seed))
    turned = (candidates + np.pi) % (2 * np.pi) - np.pi
    lower, upper = arm.position_limits.T
    return np.asarray(turned[((turned >= lower) & (turned <= upper)).all(axis=1)])


def resolve_table(table: str, *, population: int, executor: Executor | None = None, chunk: int = 20) -> Resolved:
    """Return the motions of the paper's methods and of the quadratic program, with equal task parameters.

    The program is a hundred times slower than the others: one task is a ``chunk`` of starts.
    """
    starts = start_postures(path_of(table), population)
    tell(f"{table}: {', '.join(paper_methods(table))} from {len(starts)} starts")
    motions = {name: resolve_from(table, name, starts) for name in paper_methods(table)}
    programs = {
        (name, f"starts from {first}"): partial(resolve_from, table, name, starts[first : first + chunk])
        for name in LIMITED[table]
        for first in range(0, len(starts), chunk)
    }
    tell(f"{table}: {', '.join(LIMITED[table])} from {len(starts)} starts")
    parts = run_each(executor, programs)
    for name in LIMITED[table]:
        motions[name] = join([part for (which, _), part in parts.items() if which == name])
    return Resolved(table=table, motions=motions)


def resolve_from(table: str, name: str, starts: np.ndarray, euler: str = wan_2018.EULER) -> ResolvedMotion:
    """Return the motions of a method from starts; by names so that it can run in another process."""
    method, limits = all_methods(table)[name]
    path = path_of(table, euler)
    return pk.resolve(pk.arms.wan_7r(), path, method, start=starts, limits=limits, unreachable="track")


def join(parts: Sequence[ResolvedMotion]) -> ResolvedMotion:
    """Return motions of one task, in batches (motions, time, dof), as one batch."""
    first = parts[0]
    traces = {
        each.name: np.concatenate([getattr(part.traces, each.name) for part in parts]) for each in fields(first.traces)
    }
    time, q = (np.concatenate([getattr(part, name) for part in parts]) for name in ("time", "q"))
    return replace(first, time=time, q=q, traces=type(first.traces)(**traces))


def worst_errors(motion: ResolvedMotion) -> np.ndarray:
    """Return the greatest error (motions, 6) on every axis: position, and half the sum of Eq. 33, in world axes."""
    return np.asarray(np.abs(axis_errors(motion)).max(axis=-2))


def error_distances(table: str, method: str, motion: ResolvedMotion) -> np.ndarray:
    """Return the distance of errors (motions,) from print, in logarithms; inf if steps were cut short."""
    printed = [paper()[table, axis, method] for axis in AXES]
    distance = np.linalg.norm(np.log(worst_errors(motion) / printed), axis=1)
    return np.where(cut_short(motion), np.inf, distance)


def axis_errors(motion: ResolvedMotion) -> np.ndarray:
    """Return the errors (*motions, time, 6): positions, and half the sum of Eq. 33, in world axes."""
    errors = motion.traces.errors
    turn = (motion.tool_rotation @ errors[..., 3:, None])[..., 0]
    world = turn * np.sinc(np.linalg.norm(turn, axis=-1, keepdims=True) / np.pi)
    return np.concatenate([errors[..., :3], world], axis=-1)


def cut_short(motion: ResolvedMotion) -> np.ndarray:
    """Return the motions (motions,) with some step shortened, or the task given up."""
    return np.asarray(np.isin(motion.traces.status, ["shortened", "held"]).any(axis=-1))
