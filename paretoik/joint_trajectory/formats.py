"""The formats of trajectory files: by name, or by the ending of the file."""

from __future__ import annotations

import csv
import io
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, TypeAlias, cast, get_args

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.inputs import check_choice
from paretoik.joint_trajectory.trajectory import JointTrajectory
from paretoik.runs.file_replacement import replace_file
from paretoik.runs.files import array_bytes, check_target, table_bytes, to_json

# Trajectories as tables and arrays: CSV, Parquet and NPZ, every number to the last bit.
#
# A table has a column ``time`` [s], and for every joint ``position.NAME``, ``velocity.NAME`` and
# ``acceleration.NAME``.


def csv_bytes(trajectory: JointTrajectory) -> bytes:
    """Return a CSV: lines of metadata after ``# ``, the names of the columns, then one line per sample.

    ``numpy.genfromtxt(file, delimiter=",")[1:]`` reads the numbers; for other readers ``#`` begins a comment.
    """
    text = io.StringIO(comment_lines(trajectory))
    text.seek(0, io.SEEK_END)
    writer = csv.writer(text, lineterminator="\n")
    table = columns(trajectory)
    writer.writerow(table)
    writer.writerows(np.stack(list(table.values()), axis=1).tolist())  # floats by their shortest exact text
    return text.getvalue().encode()


def parquet_bytes(trajectory: JointTrajectory) -> bytes:
    """Return a Parquet table; its schema has the trajectory's metadata as JSON under ``paretoik``."""
    import pyarrow as pa

    table = pa.table(columns(trajectory))
    return table_bytes(table.replace_schema_metadata({"paretoik": metadata_json(trajectory)}))


def npz_bytes(trajectory: JointTrajectory) -> bytes:
    """Return an NPZ of ``joint_names``, ``time``, ``q``, ``dq``, ``ddq`` and ``metadata`` (JSON), without pickle."""
    arrays = {"joint_names": np.array(trajectory.joint_names, dtype=np.str_)}
    arrays |= {name: getattr(trajectory, name) for name in ("time", "q", "dq", "ddq")}
    return array_bytes(arrays | {"metadata": np.array(metadata_json(trajectory), dtype=np.str_)})


def columns(trajectory: JointTrajectory) -> dict[str, np.ndarray]:
    """Return the columns of a table, by name."""
    table = {"time": trajectory.time}
    quantities = {"position": trajectory.q, "velocity": trajectory.dq, "acceleration": trajectory.ddq}
    for quantity, values in quantities.items():
        table |= {f"{quantity}.{joint}": values[:, i] for i, joint in enumerate(trajectory.joint_names)}
    return table


def comment_lines(trajectory: JointTrajectory) -> str:
    """Return the metadata as comments, one line each: ``# NAME: JSON``, with unprintable characters escaped."""
    text = ""
    for name, value in trajectory.metadata.items():
        entry = f"{name}: {json.dumps(to_json(value), ensure_ascii=False)}"
        text += f"# {''.join(each if each.isprintable() else json.dumps(each)[1:-1] for each in entry)}\n"
    return text


def metadata_json(trajectory: JointTrajectory) -> str:
    """Return the metadata as strict JSON."""
    return json.dumps(to_json(trajectory.metadata), allow_nan=False)


# Trajectories for ROS 2: trajectory_msgs/msg/JointTrajectory as YAML, or in a bag.
#
# The YAML goes to ``ros2 topic pub --once TOPIC trajectory_msgs/msg/JointTrajectory "$(cat FILE)"``; a bag, with the
# one message on the topic that a ``joint_trajectory_controller`` listens to, to ``ros2 bag play FOLDER``.


MESSAGE = "trajectory_msgs/msg/JointTrajectory"
TOPIC = "/joint_trajectory_controller/joint_trajectory"  # with the default name of that controller in ros2_control


def yaml_bytes(trajectory: JointTrajectory) -> bytes:
    """Return the message as YAML, after the metadata as comments."""
    import yaml

    series = (values.tolist() for values in (trajectory.q, trajectory.dq, trajectory.ddq))
    points = [
        {"positions": q, "velocities": dq, "accelerations": ddq, "effort": [], "time_from_start": since}
        for q, dq, ddq, since in zip(*series, _durations(trajectory), strict=True)
    ]
    message = {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": list(trajectory.joint_names),
        "points": points,
    }
    dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)  # the C one is ten times as fast
    body: str = yaml.dump(message, Dumper=dumper, sort_keys=False, default_flow_style=None, width=10**6)
    return (comment_lines(trajectory) + body).encode()


def check_bag(folder: Path, *, overwrite: bool) -> None:
    """Raise InvalidInput if no bag may be written to a folder.

    An existing bag may be replaced, but only with ``overwrite``.
    """
    check_target("bag", folder, overwrite=overwrite, folder=True)
    file = folder / "metadata.yaml"
    is_bag = not folder.is_symlink() and file.is_file()
    is_bag = is_bag and file.read_bytes().startswith(b"rosbag2_bagfile_information")
    if os.path.lexists(folder) and not is_bag:
        raise InvalidInput(f"{folder} must be a bag or not exist, got something else")


def write_bag(trajectory: JointTrajectory, folder: Path) -> None:
    """Write a bag (a folder) completely or not at all; an existing one is replaced.

    Raises InvalidInput if ``check_bag`` does, or the system refuses.
    """
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    check_bag(folder, overwrite=True)
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds: dict[str, Any] = store.types
    time, duration = kinds["builtin_interfaces/msg/Time"], kinds["builtin_interfaces/msg/Duration"]
    point = kinds["trajectory_msgs/msg/JointTrajectoryPoint"]
    samples = zip(trajectory.q, trajectory.dq, trajectory.ddq, _durations(trajectory), strict=True)
    message = kinds[MESSAGE](
        header=kinds["std_msgs/msg/Header"](stamp=time(sec=0, nanosec=0), frame_id=""),
        joint_names=list(trajectory.joint_names),
        points=[
            point(positions=q, velocities=dq, accelerations=ddq, effort=np.zeros(0), time_from_start=duration(**since))
            for q, dq, ddq, since in samples
        ],
    )
    work = folder.with_name(f".{folder.name}.{os.getpid()}")
    part, former = work / folder.name, work / "former"  # the files of a bag have the bag's name
    try:
        work.mkdir(parents=True)
        try:
            with Writer(part, version=8) as writer:  # the earlier of two formats: more releases of ROS 2 read it
                writer.set_custom_data("paretoik", metadata_json(trajectory))
                connection = writer.add_connection(TOPIC, MESSAGE, typestore=store)
                writer.write(connection, 0, store.serialize_cdr(message, MESSAGE))
            if folder.exists():
                folder.rename(former)
            part.rename(folder)
        finally:
            if former.exists() and not folder.exists():
                former.rename(folder)
            shutil.rmtree(work, ignore_errors=True)
    except OSError as fault:
        raise InvalidInput(f"{folder} must be writable, got {fault.strerror}") from fault


def _durations(trajectory: JointTrajectory) -> list[dict[str, int]]:
    """Return the times of samples as ROS writes them."""
    moments = np.rint(trajectory.time * 1e9).astype(np.int64).tolist()
    return [{"sec": moment // 10**9, "nanosec": moment % 10**9} for moment in moments]


# Formats of trajectory files, by name or by ending.


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
    """Return the format of a name, or of the file's ending.

    Raises InvalidInput for an unknown name or ending.
    """
    names = ", ".join(FORMATS)
    if name is None:
        if file.suffix not in ENDINGS:
            raise InvalidInput(f"{file} must end in {', '.join(ENDINGS)}, or have a format of {names}, got neither")
        return ENDINGS[file.suffix]
    check_choice("format", name, FORMATS)
    return cast(Format, name)


def write_trajectory(trajectory: JointTrajectory, file: Path, kind: Format) -> None:
    """Write a trajectory into a file, or for a bag a folder, completely or not at all.

    Raises InvalidInput if the system refuses.
    """
    if kind == "ros2-bag":
        write_bag(trajectory, file)
    else:
        replace_file(file, CONTENTS[kind](trajectory))
