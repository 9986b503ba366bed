"""A resolver within limits against pink: ``python -m studies.benchmarks.limits_kept [--quick] [--json FILE]``.

The Panda moves its hand straight across a table, from random postures. Limits on velocities and accelerations are
shares of what the same motion has without limits: of its fastest joint only, or of all. Both solve one quadratic
program for a step of 10 ms, pink by Clarabel with a frame task of cost 1 and gain 1, a damping of 1e-8, and its limits
of configuration (gain 1), velocity and acceleration. Pink takes the task as a cost, and its steps are not corrected.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Sequence
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

import paretoik as pk
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.random_starts import sample_postures
from paretoik.task.validation import motion_task
from problems import panda
from studies.reporting import Row, report, study_parser

SHARES = {"the fastest joint": (0.92, 1.3, 4.0), "all joints": (0.7, 0.7, 1.5)}  # fastest, others, accelerations
UNCORRECTED = "pink's steps are not corrected: its error is that of first-order steps, ours of steps solved again"


class Case(NamedTuple):
    """Our motion from a start and pink's, None if left out or ended early, and seconds."""

    ours: Motion
    is_done: bool
    theirs: Motion | None
    seconds: tuple[float, float]


def start_postures(task: MotionTask, count: int) -> np.ndarray:
    """Return postures (count, 7) of the first pose, 0.1 rad within their limits."""
    candidates = sample_postures(task, 40 * count, np.random.default_rng(0))
    turned = (candidates + np.pi) % (2 * np.pi) - np.pi
    lower, upper = task.arm.position_limits.T
    return np.asarray(turned[((turned > lower + 0.1) & (turned < upper - 0.1)).all(axis=1)][:count])


def solve_case(task: MotionTask, start: np.ndarray, shares: tuple[float, float, float]) -> Case:
    """Return the motions of both from a start."""
    path, method, free = task.tasks[0].path, pk.methods.ConstrainedQP(), pk.Limits(position=12.0, velocity=np.inf)
    unlimited = pk.resolve(task.arm, path, method, start=start, limits=free, unreachable="track")
    speeds, accelerations = (np.abs(each).max(axis=0) for each in (unlimited.dq, unlimited.ddq))
    share = np.where(speeds == speeds.max(), shares[0], shares[1])
    limits = pk.Limits(
        velocity=np.maximum(share * speeds, 0.05), acceleration=np.maximum(shares[2] * accelerations, 0.5)
    )
    clock = time.perf_counter()
    ours = pk.resolve(task.arm, path, method, start=start, limits=limits, unreachable="track")
    seconds = time.perf_counter() - clock
    clock = time.perf_counter()
    q = resolve_by_pink(task, start, limits) if find_spec("pink") else None
    return Case(
        ours=ours,
        is_done=bool((ours.traces.status == "done").all()),
        theirs=None if q is None else task.motion(q),
        seconds=(seconds, time.perf_counter() - clock),
    )


def resolve_by_pink(task: MotionTask, start: np.ndarray, limits: pk.Limits) -> np.ndarray | None:
    """Return the positions (time, 7) of pink's motion; None if its solver ended without a solution."""
    import pink
    import pinocchio
    from pink.exceptions import NoSolutionFound
    from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit
    from pink.tasks import FrameTask

    whole = pinocchio.buildModelFromUrdf(str(panda.URDF))
    fingers = [whole.getJointId(name) for name in whole.names if "finger" in name]
    model = pinocchio.buildReducedModel(whole, fingers, pinocchio.neutral(whole))
    model.velocityLimit[:] = limits.velocity
    frame = FrameTask("panda_hand_tcp", position_cost=1.0, orientation_cost=1.0, lm_damping=0.0, gain=1.0)
    accelerations = AccelerationLimit(model, np.array(limits.acceleration))
    others = [ConfigurationLimit(model, config_limit_gain=1.0), VelocityLimit(model)]
    configuration = pink.Configuration(model, model.createData(), start.copy())
    q, rates = [start], np.zeros(7)
    for target, dt in zip(task.targets[1:], np.diff(task.times), strict=True):
        frame.set_target(pinocchio.SE3(target[3:].reshape(3, 3), target[:3]))
        accelerations.set_last_integration(rates, dt)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # it warns that its matrices are dense
                rates = pink.solve_ik(
                    configuration, [frame], dt, solver="clarabel", damping=1e-8, limits=[*others, accelerations]
                )
        except NoSolutionFound:
            return None
        configuration.integrate_inplace(rates, dt)
        q.append(configuration.q.copy())
    return np.array(q)


def greatest_error(motion: Motion) -> float:
    """Return the largest error of a motion [m, rad]."""
    return float(motion.tracking_error[1:].max())


def case_rows(name: str, cases: Sequence[Case]) -> list[Row]:
    """Return the results of both under one kind of limits: where both end, and where the path stays possible."""
    title, has_peer = f"limits on {name}, {len(cases)} starts", bool(find_spec("pink"))
    ended = [one for one in cases if one.theirs is not None or not has_peer]
    done = [one for one in ended if one.is_done]
    seconds = 1e3 * np.median([one.seconds for one in cases], axis=0) / len(cases[0].ours.time)

    def row(what: str, unit: str, one: float, other: float, note: str) -> Row:
        reference = float(other) if has_peer else None
        return Row(title, "ConstrainedQP", what, unit, float(one), reference=reference, source="pink", note=note)

    rows = [
        row("motions that end", "share", 1.0, len(ended) / len(cases), "others end in NoSolutionFound"),
        row("time of a step", "ms", seconds[0], seconds[1], "median"),
    ]
    if done:
        note = f"median of {len(done)}, motions with all steps by ours; {UNCORRECTED}"
        mine = np.median([greatest_error(one.ours) for one in done])
        other = np.median([greatest_error(one.ours if one.theirs is None else one.theirs) for one in done])
        rows.append(row("greatest error, with a way on", "m, rad", mine, other, note))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Report the results of both under either kind of limits."""
    options = study_parser("A resolver within limits, against pink.", quick="3 starts instead of 20").parse_args(
        arguments
    )
    if not find_spec("pink"):
        print("left out: pink, which is not installed")
    ends = (pk.Pose.from_rpy((0.45, y, 0.3), panda.DOWN) for y in (-0.25, 0.25))
    path = pk.line(*ends, duration=1.5, samples=151)
    task = motion_task(panda.panda(), path, objectives=[pk.joint_travel], differences="backward")
    starts, rows = start_postures(task, 3 if options.quick else 20), []
    for name, shares in SHARES.items():
        cases = []
        for number, start in enumerate(starts, start=1):
            print(f"\rlimits on {name}: {number} of {len(starts)} starts", end="", file=sys.stderr, flush=True)
            cases.append(solve_case(task, start, shares))
        print(file=sys.stderr)
        rows += case_rows(name, cases)
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
