"""Robot kernels beside a Python loop over Pinocchio, on the same samples: ``python -m studies.benchmarks.kinematics``.

Both sides get contiguous joint arrays, keep every result, and are timed as the best of several rounds taken in turn, so
that a busy machine slows both alike. ``--json FILE`` writes the rows.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import inverse_dynamics
from paretoik.robot.kinematics import posed_jacobian
from paretoik.robot.library import tringali_3r

MOTIONS, SAMPLES = 200, 101
PANDA = Path(__file__).parents[2] / "problems" / "robots" / "panda.urdf"


@dataclass(frozen=True, kw_only=True)
class Row:
    """One number of a table, as every study writes it."""

    table: str
    row: str
    column: str
    unit: str
    ours: float
    paper: float | None = None
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class Contest:
    """One kernel on one arm: ours, the peer's, and the ratio of speeds we aim at."""

    arm: str
    kernel: str
    goal: float
    ours: Callable[[], object]
    peer: Callable[[], object]


def pinocchio_model(arm: Arm) -> Any:
    """Return the arm as a Pinocchio model whose frame "tool" is the arm's tool; turning and sliding joints about z."""
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
            ours=lambda: posed_jacobian(arm, q),
            peer=loop_kinematics,
        ),
    ]


def best_times(functions: Sequence[Callable[[], object]], rounds: int) -> list[float]:
    """Return each function's shortest time [s] over rounds in which they take turns."""
    shortest = [float("inf")] * len(functions)
    for _ in range(rounds):
        for i, function in enumerate(functions):
            start = time.perf_counter()
            function()
            shortest[i] = min(shortest[i], time.perf_counter() - start)
    return shortest


def measured(contest: Contest, rounds: int) -> list[Row]:
    """Return the rows of one contest: our speed, the peer's and their ratio."""
    ours, peer = best_times([contest.ours, contest.peer], rounds)
    speed = MOTIONS * SAMPLES / 1e6
    goal = f"goal {contest.goal:g}: {'met' if peer / ours >= contest.goal else 'missed'}"
    cells = [
        ("ours", "M samples/s", speed / ours, ""),
        ("Pinocchio loop", "M samples/s", speed / peer, ""),
        ("ratio", "1", peer / ours, goal),
    ]
    table = f"{contest.kernel}, {MOTIONS} motions of {SAMPLES} samples"
    return [
        Row(table=table, row=contest.arm, column=column, unit=unit, ours=value, note=note)
        for column, unit, value, note in cells
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print the table, and write the rows where ``--json`` says."""
    parser = argparse.ArgumentParser(description="Robot kernels beside a Python loop over Pinocchio.")
    parser.add_argument("--rounds", type=int, default=15, help="rounds of which the best counts")
    parser.add_argument("--quick", action="store_true", help="three rounds")
    parser.add_argument("--json", type=Path, help="file to write the rows to")
    given = parser.parse_args(arguments)
    panda = Arm.from_urdf(PANDA, base="panda_link0", tip="panda_hand_tcp")
    entries = [*contests("planar 3R", tringali_3r(), 8.0), *contests("Panda", panda, 2.0)]
    rows = []
    print(f"{'arm':<10} {'kernel':<21} {'ours':>8} {'Pinocchio':>10}  M samples/s   ratio")
    for contest in entries:
        found = measured(contest, 3 if given.quick else given.rounds)
        ours, peer, ratio = (row.ours for row in found)
        print(f"{contest.arm:<10} {contest.kernel:<21} {ours:8.2f} {peer:10.2f} {ratio:18.1f}   {found[-1].note}")
        rows += found
    if given.json:
        given.json.write_text(json.dumps([asdict(row) for row in rows], indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
