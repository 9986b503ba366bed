"""A URDF of any bytes: its faults are listed, or it is built and has poses."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from paretoik.errors import InvalidRobot
from paretoik.robot.arm import Arm
from paretoik.robot.urdf import check_robot
from paretoik.robot.urdf_reading import read_robot
from studies.benchmarks.reliability.fuzzing.defect import Defect, check_message, refusals
from studies.benchmarks.reliability.fuzzing.options import OPTIONS


class UrdfFiles:
    """Reads bytes as a URDF, in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "robot.urdf"

    def __call__(self, data: bytes) -> None:
        """Check bytes, and build every chain from the root to one of the first leaves; raise Defect."""
        self._file.write_bytes(data)
        with refusals(self._file.name):
            report = check_robot(self._file)
            _check_faults(report.faults)  # the report names the file
            tips = [None] if report.faults else read_robot(self._file).leaves[: OPTIONS.tips]
            for tip in tips:
                with refusals(self._file.name):
                    self._build(tip)

    def _build(self, tip: str | None) -> None:
        try:
            arm = Arm.from_urdf(self._file, tip=tip, zero_limits="unlimited")
        except InvalidRobot as refusal:  # lists all faults, however many
            _check_faults(refusal.faults)
            return
        for q in (np.zeros(arm.dof), np.ones(arm.dof)):
            if not (np.isfinite(arm.pose(q).position).all() and np.isfinite(arm.jacobian(q)).all()):
                raise Defect("an arm whose poses are not finite")


def _check_faults(faults: Iterable[str]) -> None:
    for fault in faults:
        check_message(fault, "")
