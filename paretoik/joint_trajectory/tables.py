"""Trajectories as tables and arrays: CSV, Parquet and NPZ, every number to the last bit.

A table has a column ``time`` [s], and for every joint ``position.NAME``, ``velocity.NAME`` and ``acceleration.NAME``.
"""

from __future__ import annotations

import csv
import io
import json

import numpy as np

from paretoik.joint_trajectory.trajectory import JointTrajectory
from paretoik.run_files import to_json


def csv_bytes(trajectory: JointTrajectory) -> bytes:
    """Return a CSV: lines of metadata after ``# ``, then the names of the columns, then a line a sample.

    ``numpy.genfromtxt(file, delimiter=",")[1:]`` reads the numbers; to readers of tables ``#`` begins a comment.
    """
    text = io.StringIO(comment_lines(trajectory))
    text.seek(0, io.SEEK_END)
    writer = csv.writer(text, lineterminator="\n")
    table = columns(trajectory)
    writer.writerow(table)
    writer.writerows(np.stack(list(table.values()), axis=1).tolist())  # floats by their shortest exact text
    return text.getvalue().encode()


def parquet_bytes(trajectory: JointTrajectory) -> bytes:
    """Return a Parquet table; its schema's metadata holds that of the trajectory as JSON under ``paretoik``."""
    import pyarrow as pa
    from pyarrow import parquet

    table = pa.table(columns(trajectory))
    table = table.replace_schema_metadata({"paretoik": metadata_json(trajectory)})
    sink = io.BytesIO()
    parquet.write_table(table, sink)
    return sink.getvalue()


def npz_bytes(trajectory: JointTrajectory) -> bytes:
    """Return an NPZ of ``joint_names``, ``time``, ``q``, ``dq``, ``ddq`` and ``metadata``, JSON; without pickle."""
    sink = io.BytesIO()
    np.savez(
        sink,
        allow_pickle=False,
        joint_names=np.array(trajectory.joint_names, dtype=np.str_),
        time=trajectory.time,
        q=trajectory.q,
        dq=trajectory.dq,
        ddq=trajectory.ddq,
        metadata=np.array(metadata_json(trajectory), dtype=np.str_),
    )
    return sink.getvalue()


def columns(trajectory: JointTrajectory) -> dict[str, np.ndarray]:
    """Return the columns of a table, by name."""
    table = {"time": trajectory.time}
    for quantity, values in (
        ("position", trajectory.q),
        ("velocity", trajectory.dq),
        ("acceleration", trajectory.ddq),
    ):
        table |= {f"{quantity}.{joint}": values[:, i] for i, joint in enumerate(trajectory.joint_names)}
    return table


def comment_lines(trajectory: JointTrajectory) -> str:
    """Return the metadata as comments, a line each: ``# NAME: JSON``, escaped where a reader sees the end of a line."""
    entries = [
        f"{name}: {json.dumps(to_json(value), ensure_ascii=False)}" for name, value in trajectory.metadata.items()
    ]
    return "".join(f"# {''.join(map(_printable, entry))}\n" for entry in entries)


def _printable(letter: str) -> str:
    return letter if letter.isprintable() else json.dumps(letter)[1:-1]


def metadata_json(trajectory: JointTrajectory) -> str:
    """Return the metadata as strict JSON."""
    return json.dumps(to_json(trajectory.metadata), allow_nan=False)
