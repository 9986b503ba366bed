"""Robot kernels and a Python loop over Pinocchio on equal samples: ``python -m studies.benchmarks.kinematics``.

Both sides get contiguous joint arrays and keep every result. The best of several rounds counts; rounds alternate, so
that a busy machine slows both alike. Further rows time the work of a generation of the search: both objectives of a
batch of motions from their samples, differences included, and whole problems from their genes, decoding included.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from paretoik.formulations.tracking import Tracking
from paretoik.robot.arm import Arm
from paretoik.robot.arms import tringali_3r
from paretoik.robot.body import TOOL_FRAME
from paretoik.robot.components import Component, evaluate_in_blocks
from paretoik.robot.dynamics import inverse_dynamics
from paretoik.robot.kinematics import frame_components, jacobian_components, link_frames
from paretoik.search.genes import seeded_population
from paretoik.task.motion import Motion
from paretoik.task.objectives import kinetic_energy, torque_norm
from problems.panda import across_the_table, panda
from problems.tringali_2020 import energy_torque
from studies.reporting import Row, report, study_parser

MOTIONS, SAMPLES = 200, 101
BATCH = f"{MOTIONS} motions × {SAMPLES} samples"


@dataclass(frozen=True, kw_only=True)
class Contest:
    """One kernel on one arm: ours, the peer's, and the goal for the ratio of speeds."""

    arm: str
    kernel: str
    goal: float
    ours: Callable[[], object]
    peer: Callable[[], object]


def pose_and_jacobian(arm: Arm, q: np.ndarray) -> np.ndarray:
    """Return rotation, position and Jacobian of the tool, (*batch, 12 + 6 dof), from one pass over the chain."""
    tool = arm.frame(TOOL_FRAME)

    def kernel(q: Sequence[Component]) -> list[Component]:
        links = link_frames(arm, q)
        rotation, position = frame_components(arm, links, tool)
        columns = jacobian_components(arm, links, tool, position)
        slopes = [column[part][axis] for part in (0, 1) for axis in range(3) for column in columns]
        return [*rotation[0], *rotation[1], *rotation[2], *position, *slopes]

    return evaluate_in_blocks(kernel, arm, (12 + 6 * arm.dof,), q)


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


def contests(label: str, arm: Arm, goal: float) -> list[Contest]:
    """Return both contests on an arm, all on the same random samples."""
    import pinocchio

    q, dq, ddq = np.random.default_rng(0).normal(size=(3, MOTIONS, SAMPLES, arm.dof))
    model = pinocchio_model(arm)
    data, tool, world = model.createData(), model.getFrameId("tool"), pinocchio.LOCAL_WORLD_ALIGNED
    rows = [np.ascontiguousarray(array.reshape(-1, arm.dof)) for array in (q, dq, ddq)]
    count = len(rows[0])
    torques, jacobians = np.empty((count, arm.dof)), np.empty((count, 6, arm.dof))
    rotations, positions = np.empty((count, 3, 3)), np.empty((count, 3))

    def loop_dynamics() -> None:
        rnea = pinocchio.rnea
        for i, (x, v, a) in enumerate(zip(*rows, strict=True)):
            torques[i] = rnea(model, data, x, v, a)

    def loop_kinematics() -> None:
        jacobian, place = pinocchio.computeFrameJacobian, pinocchio.updateFramePlacement
        for i, x in enumerate(rows[0]):
            jacobians[i] = jacobian(model, data, x, tool, world)
            pose = place(model, data, tool)
            rotations[i], positions[i] = pose.rotation, pose.translation

    return [
        Contest(
            arm=label,
            kernel="inverse dynamics",
            goal=goal,
            ours=lambda: inverse_dynamics(arm, q, dq, ddq),
            peer=loop_dynamics,
        ),
        Contest(
            arm=label,
            kernel="tool pose + Jacobian",
            goal=goal,
            ours=lambda: pose_and_jacobian(arm, q),
            peer=loop_kinematics,
        ),
    ]


def best_times(functions: Sequence[Callable[[], object]], rounds: int) -> list[float]:
    """Return each function's shortest time [s] over rounds in which they alternate."""
    shortest = [float("inf")] * len(functions)
    for _ in range(rounds):
        for i, function in enumerate(functions):
            start = time.perf_counter()
            function()
            shortest[i] = min(shortest[i], time.perf_counter() - start)
    return shortest


def measure_contest(contest: Contest, rounds: int) -> list[Row]:
    """Return the rows of one contest: our speed, the peer's and their ratio."""
    ours, peer = best_times([contest.ours, contest.peer], rounds)
    table, speed = f"{contest.kernel}, {BATCH}", MOTIONS * SAMPLES / 1e6
    return [
        Row(table=table, row=contest.arm, column="ours", unit="M samples/s", ours=speed / ours),
        Row(table=table, row=contest.arm, column="Pinocchio loop", unit="M samples/s", ours=speed / peer),
        Row(
            table=table,
            row=contest.arm,
            column="ratio",
            unit="",
            ours=peer / ours,
            reference=contest.goal,
            source="goal",
            note="goal met" if peer / ours >= contest.goal else "goal missed",
        ),
    ]


def motion_row(label: str, arm: Arm, goal: float, rounds: int) -> Row:
    """Return the time of kinetic energy and torque norm of a batch of motions; the goal is in milliseconds."""
    q = np.random.default_rng(0).normal(size=(MOTIONS, SAMPLES, arm.dof))
    times = np.linspace(0.0, 1.0, SAMPLES)

    def evaluate() -> list[np.ndarray]:
        motion = Motion(arm=arm, time=times, q=q)
        return [kinetic_energy(motion), torque_norm(motion)]

    taken = 1e3 * best_times([evaluate], rounds)[0]
    return Row(
        table=f"evaluating {BATCH} with both objectives",
        row=label,
        column="time",
        unit="ms",
        ours=taken,
        reference=goal,
        source="goal",
        note="goal met" if taken <= goal else "goal missed",
    )


def gene_row(label: str, problem: Tracking, rounds: int) -> Row:
    """Return a problem's time from genes to objectives and limits, for one first population."""
    genes = seeded_population(problem, MOTIONS, rng=np.random.default_rng(0))
    taken = best_times([lambda: problem.evaluate(genes)], rounds)[0]
    table, names = f"evaluating {BATCH} from genes", ", ".join(problem.names)
    return Row(table=table, row=label, column="time", unit="ms", ours=1e3 * taken, note=names)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print the tables, and write the rows if ``--json`` names a file."""
    parser = study_parser("Robot kernels against a Python loop over Pinocchio.", quick="three rounds")
    parser.add_argument("--rounds", type=int, default=15, help="number of rounds; the best one counts")
    options = parser.parse_args(arguments)
    rounds = 3 if options.quick else options.rounds
    three, seven = tringali_3r(), panda()
    entries = [*contests("planar 3R", three, 8.0), *contests("Panda", seven, 2.0)]
    rows = [row for contest in entries for row in measure_contest(contest, rounds)]
    rows += [
        motion_row("planar 3R", three, 50.0, rounds),
        motion_row("Panda", seven, 300.0, rounds),
        gene_row("energy_torque", energy_torque(), rounds),
        gene_row("across_the_table", across_the_table(), rounds),
    ]
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
