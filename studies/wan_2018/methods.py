"""The methods of sections 3.1 and 3.2, from one population of starts: errors, joint 4, and the time they take."""

from __future__ import annotations

import time
from functools import partial
from typing import Literal

import numpy as np

import paretoik as pk
from paretoik.resolution.traces import ResolvedMotion
from paretoik.self_motion.start_postures import sample_postures
from paretoik.task.motion_task_validation import motion_task
from problems import wan_2018
from problems.wan_2018 import (
    BAND,
    BUFFER,
    DAMPING,
    FEEDBACK,
    GAIN_POSITIONS,
    GAIN_VELOCITIES,
    REGION,
    REPULSION,
)
from studies.reporting import Row, paper_numbers

AXES = {"x": "m", "y": "m", "z": "m", "α": "rad", "β": "rad", "γ": "rad"}
FOURTH = 3  # joint 4, counted from 0
AT_LIMIT = 0.02  # share of its range: a joint nearer to a limit than this is at it
SETS, GOAL = 200, 0.3  # parameter sets, and seconds for all of them
VARIANTS: dict[str, Literal["paper", "consistent"]] = {"WGPM, as printed": "paper", "WGPM, consistent": "consistent"}
paper = partial(paper_numbers, "wan_2018")


def paper_methods(table: str) -> dict[str, pk.methods.DampedLeastSquares]:
    """Return the methods of Table 2 (limits on positions alone) or Table 3 (and on velocities)."""
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


def start_postures(path: pk.Path, count: int, *, seed: int = 0) -> np.ndarray:
    """Return postures (postures, 7) of the first pose, within the limits, from so many random ones."""
    arm = pk.arms.wan_7r()
    task = motion_task(
        arm,
        path,
        objectives=[pk.joint_travel],
    )
    candidates = sample_postures(task, count, np.random.default_rng(seed))
    turned = (candidates + np.pi) % (2 * np.pi) - np.pi
    lower, upper = arm.position_limits.T
    return np.asarray(turned[((turned >= lower) & (turned <= upper)).all(axis=1)])


def worst_errors(motion: ResolvedMotion) -> np.ndarray:
    """Return the greatest error (motions, 6) on every axis: position, and half the sum of Eq. 33, in world axes."""
    errors = motion.traces.errors
    turn = motion.tool_rotation @ errors[..., 3:, None]
    angle = np.linalg.norm(turn[..., 0], axis=-1, keepdims=True)
    world = turn[..., 0] * np.sinc(angle / np.pi)
    return np.asarray(np.abs(np.concatenate([errors[..., :3], world], axis=-1)).max(axis=-2))


def table_rows(table: str, *, population: int) -> list[Row]:
    """Return medians over starts of the greatest errors, what becomes of joint 4, and how often steps fall short."""
    arm, path = pk.arms.wan_7r(), wan_2018.simulation() if table == "Table 2" else wan_2018.experiment()
    starts = start_postures(path, population)
    lower, upper = arm.position_limits[FOURTH]
    rows = []
    errors = {}
    for name, method in paper_methods(table).items():
        clock = time.perf_counter()
        motion = pk.resolve(arm, path, method, start=starts, unreachable="track")
        seconds = (time.perf_counter() - clock) / len(starts)
        errors[name] = worst_errors(motion)
        for k, (axis, unit) in enumerate(AXES.items()):
            low, middle, high = np.quantile(errors[name][:, k], [0.25, 0.5, 0.75])
            rows.append(
                Row(
                    table=f"{table}: greatest errors, medians over {len(starts)} starts",
                    row=axis,
                    column=name,
                    unit=unit,
                    ours=float(middle),
                    reference=paper()[table, axis, "WGPM" if name in VARIANTS else name],
                    note=f"quartiles {low:.2g} and {high:.2g}",
                )
            )
        margin = np.minimum(motion.q[..., FOURTH] - lower, upper - motion.q[..., FOURTH]) / (upper - lower)
        reached, ended = margin.min(axis=1) < AT_LIMIT, margin[:, -1] < AT_LIMIT
        broken = np.isin(motion.traces.status, ["shortened", "held"]).any(axis=1)
        rows += [
            Row(
                table=f"{table}: what becomes of joint 4, and of steps",
                row=name,
                column=column,
                unit="share of starts",
                ours=float(share),
                note=note,
            )
            for column, share, note in (
                ("joint 4 comes to a limit", reached.mean(), f"within {AT_LIMIT:.0%} of its range"),
                ("joint 4 ends there", ended.mean(), "those that came there and do not end there were freed"),
                ("some step cut short", broken.mean(), "a joint were to turn by more than 1 rad, or posture singular"),
            )
        ]
        rows.append(
            Row(
                table=f"{table}: what becomes of joint 4, and of steps",
                row=name,
                column="time of a motion",
                unit="ms",
                ours=1e3 * seconds,
                note=f"all starts at once, {len(path.times)} samples; the paper's times are not those of one machine",
            )
        )
    first = next(iter(errors))
    for name in list(errors)[1:]:
        less = (errors[name].max(axis=1) < errors[first].max(axis=1)).mean()
        rows.append(
            Row(
                table=f"{table}: which errs less, from the same start",
                row=f"{name} beside {first}",
                column="less on its worst axis",
                unit="share of starts",
                ours=float(less),
                note="; ".join(
                    f"{axis} {(errors[name][:, k] < errors[first][:, k]).mean():.0%}" for k, axis in enumerate(AXES)
                ),
            )
        )
    return rows


def speed_row(*, rounds: int) -> Row:
    """Return the seconds that so many parameter sets take along the path of section 3.2."""
    arm, path, rng = pk.arms.wan_7r(), wan_2018.experiment(), np.random.default_rng(0)
    start = start_postures(path, 40)[0]
    method = pk.methods.WeightedGradientProjection(
        criteria=[
            pk.methods.Criterion(
                objective=pk.velocity_limit_nearness, gain=10.0 ** rng.uniform(-4, -1, SETS), reference=7.0
            )
        ],
        feedback=rng.uniform(20.0, 150.0, SETS),
        buffer=rng.uniform(0.05, 0.45, SETS),
        repulsion=rng.uniform(0.1, 6.0, SETS),
        band=rng.uniform(0.05, 0.45, SETS),
        variant="paper",
    )
    elapsed = []
    for _ in range(rounds + 1):
        clock = time.perf_counter()
        motion = pk.resolve(arm, path, method, start=start, unreachable="track")
        elapsed.append(time.perf_counter() - clock)
    middle = float(np.median(elapsed[1:]))
    damped = float((motion.traces.status != "done").mean())
    return Row(
        table="parameter sets at once",
        row=f"{SETS} sets, {len(path.times)} samples",
        column="WGPM, as printed",
        unit="s",
        ours=middle,
        reference=GOAL,
        source="goal",
        note=f"{'LOSS: ' if middle > GOAL else ''}goal; median of {rounds}, from {min(elapsed[1:]):.3f} to "
        f"{max(elapsed[1:]):.3f} s; {damped:.0%} of steps damped or cut short",
    )
