"""The formats that trajectories are written in: by name, or by the ending of the file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal, TypeAlias, cast, get_args

from paretoik.errors import InvalidInput
from paretoik.file_replacement import replace_file
from paretoik.inputs import check_choice
from paretoik.joint_trajectory.ros import write_bag, yaml_bytes
from paretoik.joint_trajectory.tables import csv_bytes, npz_bytes, parquet_bytes
from paretoik.joint_trajectory.trajectory import JointTrajectory

Format: TypeAlias = Literal["csv", "parquet", "npz", "joint-trajectory", "ros2-bag"]
FORMATS: tuple[Format, ...] = get_args(Format)
ENDINGS: dict[str, Format] = {
    ".csv": "csv",
    ".parquet": "parquet",
    ".npz": "npz",
    ".yaml": "joint-trajectory",
    ".yml": "joint-trajectory",
}
CONTENTS: dict[str, Callable[[JointTrajectory], bytes]] = {
    "csv": csv_bytes,
    "parquet": parquet_bytes,
    "npz": npz_bytes,
    "joint-trajectory": yaml_bytes,
}


def find_format(file: Path, name: str | None) -> Format:
    """Return the format that is named, or that the file's ending means.

    Raises InvalidInput for an unknown name or ending.
    """
    names = ", ".join(FORMATS)
    if name is None:
        if file.suffix not in ENDINGS:
            raise InvalidInput(f"{file}: a format of {names}, or an ending of {', '.join(ENDINGS)} wanted, got neither")
        return ENDINGS[file.suffix]
    check_choice("format", name, FORMATS)
    return cast(Format, name)


def write_trajectory(trajectory: JointTrajectory, file: Path, kind: Format) -> None:
    """Write a trajectory into a file, or of a bag a folder, whole or not at all.

    Raises InvalidInput where the system refuses.
    """
    if kind == "ros2-bag":
        write_bag(trajectory, file)
    else:
        replace_file(file, CONTENTS[kind](trajectory))
