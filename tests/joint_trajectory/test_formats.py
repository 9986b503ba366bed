"""Every format read back by another reader than ours: the same samples to the last bit, with names and metadata."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
import pyarrow.parquet
import pytest
import yaml
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from paretoik.errors import InvalidInput
from paretoik.joint_trajectory.formats import FORMATS, MESSAGE, TOPIC, find_format, write_trajectory
from paretoik.joint_trajectory.trajectory import JointTrajectory
from tests.joint_trajectory.motions import sampled

ABOUT = {
    "point": 7,
    "reason": 'least N²m²s,\n"of" all',
    "objectives": {"kinetic_energy": "0.5 J s"},
    "controller": None,
}
every_format = pytest.mark.parametrize("kind", FORMATS)


def read_csv(file):
    lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
    comments = [line for line in lines if line.startswith("# ")]
    metadata = dict(line[2:].split(": ", 1) for line in comments)
    names, *rows = csv.reader(io.StringIO("".join(lines[len(comments) :])))
    return from_columns(names, np.array(rows, dtype=float).T), {k: json.loads(v) for k, v in metadata.items()}


def read_parquet(file):
    table = pyarrow.parquet.ParquetFile(file).read(use_threads=False)
    columns = np.array([table.column(name).to_numpy() for name in table.column_names])
    return from_columns(table.column_names, columns), json.loads(table.schema.metadata[b"paretoik"])


def from_columns(names, columns):
    joints = tuple(name.removeprefix("position.") for name in names if name.startswith("position."))
    assert names == [
        "time",
        *(f"{kind}.{joint}" for kind in ("position", "velocity", "acceleration") for joint in joints),
    ]
    q, dq, ddq = (columns[1 + i * len(joints) : 1 + (i + 1) * len(joints)].T for i in range(3))
    return joints, columns[0], q, dq, ddq


def read_npz(file):
    with np.load(file, allow_pickle=False) as stored:
        names = tuple(str(name) for name in stored["joint_names"])
        return (names, *(stored[name] for name in ("time", "q", "dq", "ddq"))), json.loads(str(stored["metadata"]))


def read_yaml(file):
    text = file.read_text(encoding="utf-8")
    metadata = dict(line[2:].split(": ", 1) for line in text.splitlines() if line.startswith("# "))
    message = yaml.safe_load(text)  # YAML 1.1, as ROS reads it: 1e-05 would be text
    assert message["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    points = message["points"]
    assert all(point["effort"] == [] for point in points)
    time = [point["time_from_start"]["sec"] * 10**9 + point["time_from_start"]["nanosec"] for point in points]
    values = [np.array([point[kind] for point in points]) for kind in ("positions", "velocities", "accelerations")]
    return (tuple(message["joint_names"]), np.array(time) / 1e9, *values), {
        k: json.loads(v) for k, v in metadata.items()
    }


def read_bag(folder):
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Reader(folder) as bag:
        ((connection, moment, raw),) = bag.messages()
        assert (connection.topic, connection.msgtype, moment) == (TOPIC, MESSAGE, 0)
        message = store.deserialize_cdr(raw, connection.msgtype)
    metadata = yaml.safe_load((folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]["custom_data"]
    time = [p.time_from_start.sec * 10**9 + p.time_from_start.nanosec for p in message.points]
    values = [
        np.array([getattr(p, kind) for p in message.points]) for kind in ("positions", "velocities", "accelerations")
    ]
    return (tuple(message.joint_names), np.array(time) / 1e9, *values), json.loads(metadata["paretoik"])


READERS = dict(zip(FORMATS, (read_csv, read_parquet, read_npz, read_yaml, read_bag), strict=True))


def same(trajectory, read):
    names, time, q, dq, ddq = read
    assert names == trajectory.joint_names
    for values, name in ((time, "time"), (q, "q"), (dq, "dq"), (ddq, "ddq")):
        np.testing.assert_array_equal(values, getattr(trajectory, name))


def with_odd_names():
    """Return a trajectory of large and small numbers, whose joints have names of any kind."""
    names = ("=HYPERLINK()", "wrist, left\nof two", "ἀγκών #3")
    q, dq, ddq = np.random.default_rng(0).normal(size=(3, 4, 3)) * 10.0 ** np.arange(-300, 301, 300)[:, None, None]
    return JointTrajectory(joint_names=names, time=np.arange(4) * 0.25, q=q, dq=dq, ddq=ddq)


TRAJECTORIES = {
    "plain names": lambda: sampled("Panda, a pose on a line", rate=30.0, **ABOUT),
    "odd names of joints": with_odd_names,
    "odd names of metadata": lambda: sampled(
        "planar", **{"a\nb,c": 1, "of\u2028two\x85": "li\u2028nes", "bell\x07\x9f": {"x\n": "é ∫"}}
    ),
}


@pytest.mark.parametrize("name", TRAJECTORIES)
@every_format
def test_what_is_read_back_is_what_was_written_to_the_last_bit(tmp_path, kind, name):
    trajectory = TRAJECTORIES[name]()
    write_trajectory(trajectory, tmp_path / "out", kind)
    read, metadata = READERS[kind](tmp_path / "out")
    same(trajectory, read)
    assert list(metadata.values()) == list(trajectory.metadata.values())
    if name == "plain names":
        assert metadata == ABOUT


@every_format
def test_what_was_there_is_replaced_whole(tmp_path, kind):
    for rate in (20.0, 30.0):
        trajectory = sampled("planar", rate=rate)
        write_trajectory(trajectory, tmp_path / "new" / "out", kind)
        same(trajectory, READERS[kind](tmp_path / "new" / "out")[0])
    assert list((tmp_path / "new").iterdir()) == [tmp_path / "new" / "out"]


def test_a_bag_replaces_nothing_but_a_bag(tmp_path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "one.png").write_bytes(b"mine")
    (tmp_path / "link").symlink_to(tmp_path / "photos")
    (tmp_path / "file").write_bytes(b"mine")
    for name in ("photos", "link", "file"):
        with pytest.raises(InvalidInput, match=f"{name} must be a bag or not exist, got something else"):
            write_trajectory(sampled("planar"), tmp_path / name, "ros2-bag")
    assert (tmp_path / "photos" / "one.png").read_bytes() == (tmp_path / "file").read_bytes() == b"mine"


@every_format
def test_where_the_system_refuses_a_line_says_so(tmp_path, kind):
    (tmp_path / "taken").write_bytes(b"mine")
    with pytest.raises(InvalidInput, match=r"out must be writable, got (Not a directory|File exists)"):
        write_trajectory(sampled("planar"), tmp_path / "taken" / "out", kind)


@pytest.mark.parametrize(("file", "kind"), [("a.csv", "csv"), ("a.yml", "joint-trajectory")])
def test_the_ending_says_the_format_where_nothing_else_does(tmp_path, file, kind):
    assert find_format(tmp_path / file, None) == kind
    assert find_format(tmp_path / file, "ros2-bag") == "ros2-bag"


def test_an_unknown_ending_or_format_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match=r"a must end in \.csv, .*, or have a format of csv, .*, got neither"):
        find_format(tmp_path / "a", None)
    with pytest.raises(InvalidInput, match=r"format must be one of csv, parquet, .*, got 'xml'"):
        find_format(tmp_path / "a.csv", "xml")
