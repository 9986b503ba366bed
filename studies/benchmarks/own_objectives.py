"""A user's own objectives on arms of a public package: seconds to a certified front.

    python -m studies.benchmarks.own_objectives [--quick] [--json FILE]

The arms are the xArm 7, the Panda and the UR10 of ``example-robot-data``; three objectives are unknown to the library.
Limits are the arms' own, satisfied between samples. ``pk.epsilon_front`` at default settings is asked for ten points,
after a first one of three that compiles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import files
from pathlib import Path

import numpy as np

import paretoik as pk
from problems import panda
from studies.reporting import Row, goal_row, losses_first, report, study_parser, tell, timed

PACKAGE = "example-robot-data"
GOAL = 60.0  # s
POINTS, QUICK_POINTS, SAMPLES = 10, 4, 51


@pk.objective(unit="rad²/s", form="integral")
def wrist_motion(motion):  # type: ignore[no-untyped-def]
    """Return the squared velocities of the last two joints."""
    return np.sum(motion.dq[..., -2:] ** 2, axis=-1)


@pk.objective(unit="rad", form="integral")
def shoulder_travel(motion):  # type: ignore[no-untyped-def]
    """Return the speed of the first two joints, in absolute values."""
    return np.abs(motion.dq[..., 0]) + np.abs(motion.dq[..., 1])


@pk.objective(unit="rad/s²", form="peak")
def hardest_start(motion):  # type: ignore[no-untyped-def]
    """Return the largest acceleration of any joint."""
    return np.max(np.abs(motion.ddq), axis=-1)


OBJECTIVES = (wrist_motion, shoulder_travel, hardest_start)


@dataclass(frozen=True)
class Walk:
    """An arm of the package by its file, and the line that its hand follows in 2 s, pointing down."""

    name: str
    file: str
    base: str
    tip: str
    axes: str
    first: tuple[float, float, float]
    last: tuple[float, float, float]

    def problem(self) -> pk.Tracking:
        """Return the problem. Raises PackageNotFoundError without the package."""
        arm = pk.Arm.from_urdf(robot_file(self.file), base=self.base, tip=self.tip)
        ends = (pk.Pose.from_rpy(end, panda.DOWN) for end in (self.first, self.last))
        task = pk.Task(pk.line(*ends, duration=2.0, samples=SAMPLES), axes=self.axes)  # type: ignore[arg-type]
        return pk.Tracking(arm, task, objectives=list(OBJECTIVES))


XARM, PANDA, UR10 = (
    "xarm_description/urdf/xarm7.urdf",
    "panda_description/urdf/panda.urdf",
    "ur_description/urdf/ur10_robot.urdf",
)
WALKS = (
    Walk("xArm 7, pose", XARM, "link_base", "link_eef", "pose", (0.35, -0.2, 0.25), (0.4, 0.2, 0.3)),
    Walk(
        *("Panda, position and axis", PANDA, "panda_link0", "panda_hand_tcp", "xyz+z-axis"),
        *((0.45, -0.2, 0.3), (0.45, 0.2, 0.4)),
    ),
    Walk("UR10, position", UR10, "base_link", "tool0", "xyz", (0.6, -0.3, 0.4), (0.6, 0.3, 0.5)),
)


def robot_file(name: str) -> Path:
    """Return a file of the package's robots. Raises PackageNotFoundError if it is not installed."""
    (file,) = (each for each in files(PACKAGE) or () if str(each).endswith(name))
    return Path(str(file.locate()))


def walk_rows(walk: Walk, points: int) -> list[Row]:
    """Return the rows of an arm."""
    tell(f"{walk.name}: first front")
    pk.epsilon_front(walk.problem(), points=3, starts=4, seed=0, observe=False)
    tell(f"{walk.name}: {points} points")
    front, seconds, cpu = timed(lambda: pk.epsilon_front(walk.problem(), points=points, observe=False))
    assert front.certificates is not None
    missed = int(np.sum(front.certificates.status != "minimum"))
    between = float(front.certificates.violation_between.max())
    place, statuses = (walk.name, "front"), ", ".join(sorted(set(front.certificates.reason.tolist())))
    return [
        goal_row(*place, "time", "s", seconds, GOAL, f"{len(front)} points; processor {cpu:.1f} s"),
        goal_row(*place, "not a minimum", "points", missed, 0, statuses),
        goal_row(*place, "worst violation between samples", "share of range", between, 1e-4),
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the rows."""
    parser = study_parser(__doc__ or "", quick="the first arm, few points")
    options = parser.parse_args(arguments)
    walks, points = (WALKS[:1], QUICK_POINTS) if options.quick else (WALKS, POINTS)
    rows = [row for walk in walks for row in walk_rows(walk, points)]
    report(losses_first(rows), json_file=options.json)


if __name__ == "__main__":
    main()
