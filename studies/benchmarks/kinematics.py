"""Robot kernels and a Python loop over Pinocchio on equal samples: ``python -m studies.benchmarks.kinematics``.

Both sides get contiguous joint arrays and keep every result. The best of several rounds counts; rounds alternate.
Further rows time both objectives of a batch of motions from their samples, differences included.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from paretoik.robot.arm import Arm
from paretoik.robot.arms import tringali_3r
from paretoik.robot.dynamics import inverse_dynamics
from paretoik.task.motion import Motion
from paretoik.task.objectives import kinetic_energy, torque_norm
from problems.panda import panda
from studies.reporting import Row, goal_row, report, study_parser

MOTIONS, SAMPLES = 200, 101
BATCH = f"{MOTIONS} motions × {SAMPLES} samples"


def pinocchio_model(arm: Arm) -> Any:
    """Return the arm as a Pinocchio model with its tool as frame "tool"; joints turn about or slide along z."""
    import pinocchio

    model = pinocchio.Model()
    model.gravity.linear = arm.base.rotation.T @ arm.gravity
    parent = 0
    for name, kind, placement, body in zip(arm.joint_names, arm.joint_types, arm.placements, arm.bodies, strict=True):
        joint = pinocchio.JointModelPZ() if kind == "prismatic" else pinocchio.JointModelRZ()
        parent = model.addJoint(parent, joint, pinocchio.SE3(placement.rotation, placement.position), name)
        inertia = pinocchio.Inertia(body.mass, body.center, body.inertia)
        model.appendBodyToJoint(parent, inertia, pinocchio.SE3.Identity())
    tool = pinocchio.SE3(arm.tool.rotation, arm.tool.position)
    model.addFrame(pinocchio.Frame("tool", parent, 0, tool, pinocchio.FrameType.OP_FRAME))
    return model


def best_times(functions: Sequence[Callable[[], object]], rounds: int) -> list[float]:
    """Return each function's shortest time [s] over rounds in which they alternate."""
    shortest = [float("inf")] * len(functions)
    for _ in range(rounds):
        for i, function in enumerate(functions):
            start = time.perf_counter()
            function()
            shortest[i] = min(shortest[i], time.perf_counter() - start)
    return shortest


def contest_rows(label: str, arm: Arm, goal: float, rounds: int) -> list[Row]:
    """Return our speed of inverse dynamics, the peer's and their ratio, on the same random samples."""
    import pinocchio

    q, dq, ddq = np.random.default_rng(0).normal(size=(3, MOTIONS, SAMPLES, arm.dof))
    model, rnea = pinocchio_model(arm), pinocchio.rnea
    data, rows = model.createData(), [np.ascontiguousarray(array.reshape(-1, arm.dof)) for array in (q, dq, ddq)]
    torques = np.empty_like(rows[0])

    def loop() -> None:
        for i, (x, v, a) in enumerate(zip(*rows, strict=True)):
            torques[i] = rnea(model, data, x, v, a)

    ours, peer = best_times([lambda: inverse_dynamics(arm, q, dq, ddq), loop], rounds)
    table, speed = f"inverse dynamics, {BATCH}", MOTIONS * SAMPLES / 1e6
    return [
        Row(table, label, "ours", "M samples/s", speed / ours),
        Row(table, label, "Pinocchio loop", "M samples/s", speed / peer),
        goal_row(table, label, "ratio", "", peer / ours, goal, least=True),
    ]


def motion_row(label: str, arm: Arm, goal: float, rounds: int) -> Row:
    """Return the time of kinetic energy and torque norm of a batch of motions; the goal is in milliseconds."""
    q = np.random.default_rng(0).normal(size=(MOTIONS, SAMPLES, arm.dof))
    times = np.linspace(0.0, 1.0, SAMPLES)

    def evaluate() -> list[np.ndarray]:
        motion = Motion(arm=arm, time=times, q=q)
        return [kinetic_energy(motion), torque_norm(motion)]

    taken = 1e3 * best_times([evaluate], rounds)[0]
    return goal_row(f"evaluating {BATCH} with both objectives", label, "time", "ms", taken, goal)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print the tables, and write the rows if ``--json`` names a file."""
    parser = study_parser("Robot kernels against a Python loop over Pinocchio.", quick="three rounds")
    parser.add_argument("--rounds", type=int, default=15, help="number of rounds; the best one counts")
    options = parser.parse_args(arguments)
    rounds = 3 if options.quick else options.rounds
    three, seven = tringali_3r(), panda()
    rows = [*contest_rows("planar 3R", three, 8.0, rounds), *contest_rows("Panda", seven, 2.0, rounds)]
    rows += [motion_row("planar 3R", three, 50.0, rounds), motion_row("Panda", seven, 300.0, rounds)]
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
