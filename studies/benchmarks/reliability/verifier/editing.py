"""Edits of a run by someone with bad intent: digests are made new."""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from paretoik.front.storage import array_bytes
from paretoik.runs.files import RUN, result_files


@dataclass
class Edited:
    """The contents of a run, to be changed in place."""

    entries: dict[str, Any]
    table: dict[str, list[Any]]
    arrays: dict[str, dict[str, np.ndarray]]

    @property
    def motions(self) -> dict[str, np.ndarray]:
        """The arrays of the run's motions."""
        return self.arrays["motions.npz"]


def edit(source: Path, folder: Path, change: Callable[[Edited], None]) -> Path:
    """Copy a run, change it, and make new digests."""
    shutil.copytree(source, folder)
    entries = json.loads((folder / RUN).read_text())
    names = [name for name in entries.pop("files") if not name.endswith(".npz")]
    table_name = names[0] if names else None
    table = pq.ParquetFile(folder / table_name).read(use_threads=False) if table_name else None
    arrays = {file.name: dict(np.load(file)) for file in folder.glob("*.npz")}
    run = Edited(
        entries={name: value for name, value in entries.items() if name not in ("format", "digest")},
        table={} if table is None else table.to_pydict(),
        arrays=arrays,
    )
    change(run)
    contents = {name: array_bytes(values) for name, values in run.arrays.items()}
    if table_name:
        sink = io.BytesIO()
        pq.write_table(pa.table(run.table), sink)
        contents[table_name] = sink.getvalue()
    for name, content in result_files(run.entries, contents).items():
        (folder / name).write_bytes(content)
    return folder
