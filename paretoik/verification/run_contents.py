"""The files of a run as the verifier reads them: every fault is a row, and what can be read is read."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.errors import InvalidRun
from paretoik.run_files import MOTIONS, OPTIMA, RUN, TABLE, digest, read_plain_file, read_run
from paretoik.stored_arrays import read_arrays, read_table
from paretoik.verification.report import Check, demand

TEXTS = ("status", "reason", "branch")  # columns of a table that hold no numbers
RESULTS = (TABLE, OPTIMA, MOTIONS, "polygon.npz", "traces.npz", "tool_path.npz")


@dataclass(frozen=True, kw_only=True, eq=False)
class RunContents:
    """Contents of a run folder: entries of `run.json`, columns of its table, and arrays by file, each by name."""

    folder: Path
    entries: Mapping[str, Any]
    table: Mapping[str, np.ndarray]
    arrays: Mapping[str, Mapping[str, np.ndarray]]
    checks: list[Check] = field(default_factory=list)

    @property
    def motions(self) -> Mapping[str, np.ndarray]:
        """The arrays of `motions.npz`; empty if there are none."""
        return self.arrays.get(MOTIONS, {})

    @property
    def objectives(self) -> list[dict[str, Any]]:
        """The objectives' entries; of a plan its only one."""
        if "objective" in self.entries:
            return [dict(self.entries["objective"])]
        listed = self.entries.get("objectives", [])
        return [dict(each) for each in listed] if isinstance(listed, list) else []

    @property
    def ids(self) -> np.ndarray:
        """The id of every row of the table; without a table those of the motions."""
        return np.asarray(self.table["id"] if "id" in self.table else self.motions.get("id", np.arange(0)))

    @property
    def values(self) -> np.ndarray:
        """The objectives of every row of the table (points, n_obj), in their own sign."""
        columns = [self.table.get(str(each["name"]), np.full(len(self.ids), np.nan)) for each in self.objectives]
        return np.stack(columns, axis=1) if columns else np.zeros((len(self.ids), 0))


def read_contents(folder: Path) -> RunContents:
    """Read a run folder; raises InvalidRun if it is not a run with a result."""
    entries = dict(read_run(folder / RUN))
    if not isinstance(entries.get("files"), dict):
        raise InvalidRun(f"{folder}: wanted a run with a result, got one of status {entries.get('status')!r} without")
    written = entries.pop("digest", None)
    checks = [
        demand("digests", written == digest(entries), f"{RUN} does not match its digest: it was edited or cut"),
    ]
    table: dict[str, np.ndarray] = {}
    arrays: dict[str, dict[str, np.ndarray]] = {}
    for name, expected in entries["files"].items():
        if name not in RESULTS:
            checks.append(demand("files", False, f"{RUN} lists {name!r}, which is no file of a result"))
            continue
        try:
            content = read_plain_file(folder / name)
        except InvalidRun as fault:
            checks.append(demand("files", False, str(fault)))
            continue
        same = hashlib.sha256(content).hexdigest() == expected
        checks.append(demand("digests", same, f"{name} does not match its digest in {RUN}: it was edited or cut"))
        try:
            if name.endswith(".npz"):
                arrays[name] = read_arrays(content)
            else:
                table = _read_columns(content)
        except Exception as fault:  # whatever the parser trips over is the file's fault
            line = (str(fault).splitlines() or [type(fault).__name__])[0]
            checks.append(demand("files", False, f"{name} cannot be read: {line}"))
    return RunContents(folder=folder, entries=entries, table=table, arrays=arrays, checks=checks)


def _read_columns(content: bytes) -> dict[str, np.ndarray]:
    import pyarrow as pa

    table = read_table(content)
    columns = {}
    for name in table.column_names:
        column = table.column(name)
        if name not in TEXTS and name != "id":
            columns[name] = np.array([np.nan if value is None else value for value in column.to_pylist()], dtype=float)
        elif name == "id":
            columns[name] = column.cast(pa.int64()).to_numpy()
        else:
            columns[name] = np.array(["" if value is None else str(value) for value in column.to_pylist()])
    return columns
