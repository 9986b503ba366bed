"""Arrays and tables in files that may come from anybody: what they declare is held against what is there, then read.

A file of a megabyte can declare gigabytes: an archive that is compressed, an array whose header is larger than its
bytes, a table of one value a milliard times. Ours are none of these.
"""

from __future__ import annotations

import io
import math
import zipfile
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, kw_only=True)
class StoredArrayOptions:
    """A table has at most so many rows (``most_rows``), and at most so many bytes once it is unpacked."""

    most_rows: int = 10_000_000
    most_bytes: int = 2**29


OPTIONS = StoredArrayOptions()
FORMER_NAMES = {"kkt_residual": "criticality"}  # of columns


def read_arrays(content: bytes) -> dict[str, np.ndarray]:
    """Return the arrays of an NPZ without pickle; raises ValueError, or what NumPy raises, for other content."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        for entry in archive.infolist():
            if entry.compress_type != zipfile.ZIP_STORED or entry.file_size > len(content):
                raise ValueError(f"{entry.filename} that declares {entry.file_size} bytes in a file of {len(content)}")
            with archive.open(entry) as stream:
                declared = _declared_bytes(stream) + stream.tell()
            if declared > entry.file_size:
                raise ValueError(f"{entry.filename} that declares {declared} bytes and has {entry.file_size}")
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def read_table(content: bytes) -> Any:
    """Return the Arrow table of a Parquet file, columns of earlier runs by today's names.

    Raises ValueError, or what Arrow raises, for other content.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = pq.ParquetFile(pa.BufferReader(content))
    metadata = file.metadata
    size = sum(metadata.row_group(group).total_byte_size for group in range(metadata.num_row_groups))
    if metadata.num_rows > OPTIONS.most_rows or size > OPTIONS.most_bytes:
        raise ValueError(f"a table that declares {metadata.num_rows} rows and {size} bytes in a file of {len(content)}")
    # Without a thread: those of read_table may abort the interpreter as it ends (apache/arrow#34314).
    table = file.read(use_threads=False)
    return table.rename_columns([FORMER_NAMES.get(name, name) for name in table.column_names])


def _declared_bytes(stream: Any) -> int:
    """Return how many bytes the header of an array declares."""
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, kind = read(stream)
    return math.prod(shape) * kind.itemsize
