"""Trajectories for ROS 2: trajectory_msgs/msg/JointTrajectory as YAML, or in a bag.

The YAML goes to ``ros2 topic pub --once TOPIC trajectory_msgs/msg/JointTrajectory "$(cat FILE)"``; a bag, with the one
message on the topic that a ``joint_trajectory_controller`` listens to, to ``ros2 bag play FOLDER``.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any, Literal

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.joint_trajectory.tables import comment_lines, metadata_json
from paretoik.joint_trajectory.trajectory import JointTrajectory
from paretoik.run_files import check_target

MESSAGE = "trajectory_msgs/msg/JointTrajectory"
TOPIC = "/joint_trajectory_controller/joint_trajectory"  # of ros2_control's default name of that controller
BAG_VERSION: Literal[8] = (
    8  # of rosbag2: the earlier of the two that rosbags writes, so that more releases of ROS 2 read it
)


def yaml_bytes(trajectory: JointTrajectory) -> bytes:
    """Return the message as YAML, after the metadata as comments."""
    import yaml

    points = [
        {"positions": q, "velocities": dq, "accelerations": ddq, "effort": [], "time_from_start": _duration(moment)}
        for q, dq, ddq, moment in zip(
            trajectory.q.tolist(),
            trajectory.dq.tolist(),
            trajectory.ddq.tolist(),
            _nanoseconds(trajectory),
            strict=True,
        )
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
    """Raise InvalidInput where a folder may not be written as a bag: only a bag is replaced, and only where told."""
    check_target("bag", folder, overwrite=overwrite, folder=True)
    if os.path.lexists(folder) and not _is_bag(folder):
        raise InvalidInput(f"{folder}: wanted a bag to replace, or nothing, got something else")


def write_bag(trajectory: JointTrajectory, folder: Path) -> None:
    """Write a bag, a folder, whole or not at all; one that is there already is replaced.

    Raises InvalidInput where ``check_bag`` does, or the system refuses.
    """
    check_bag(folder, overwrite=True)
    work = folder.with_name(f".{folder.name}.{os.getpid()}")
    part, former = work / folder.name, work / "former"  # files of a bag bear its own name
    try:
        work.mkdir(parents=True)
        try:
            _fill_bag(trajectory, part)
            if folder.exists():
                folder.rename(former)
            part.rename(folder)
        finally:
            if former.exists() and not folder.exists():
                former.rename(folder)
            shutil.rmtree(work, ignore_errors=True)
    except OSError as fault:
        raise InvalidInput(f"{folder}: wanted to write it, got {fault.strerror}") from fault


def _fill_bag(trajectory: JointTrajectory, folder: Path) -> None:
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds: dict[str, Any] = store.types
    time, duration = kinds["builtin_interfaces/msg/Time"], kinds["builtin_interfaces/msg/Duration"]
    point = kinds["trajectory_msgs/msg/JointTrajectoryPoint"]
    message = kinds[MESSAGE](
        header=kinds["std_msgs/msg/Header"](stamp=time(sec=0, nanosec=0), frame_id=""),
        joint_names=list(trajectory.joint_names),
        points=[
            point(
                positions=q,
                velocities=dq,
                accelerations=ddq,
                effort=np.zeros(0),
                time_from_start=duration(**_duration(moment)),
            )
            for q, dq, ddq, moment in zip(
                trajectory.q, trajectory.dq, trajectory.ddq, _nanoseconds(trajectory), strict=True
            )
        ],
    )
    with Writer(folder, version=BAG_VERSION) as writer:
        writer.set_custom_data("paretoik", metadata_json(trajectory))
        connection = writer.add_connection(TOPIC, MESSAGE, typestore=store)
        writer.write(connection, 0, store.serialize_cdr(message, MESSAGE))


def _is_bag(folder: Path) -> bool:
    file = folder / "metadata.yaml"
    return not folder.is_symlink() and file.is_file() and file.read_bytes().startswith(b"rosbag2_bagfile_information")


def _nanoseconds(trajectory: JointTrajectory) -> list[int]:
    return np.rint(trajectory.time * 1e9).astype(np.int64).tolist()


def _duration(nanoseconds: int) -> dict[str, int]:
    seconds, remainder = divmod(nanoseconds, 10**9)
    return {"sec": seconds, "nanosec": remainder}
