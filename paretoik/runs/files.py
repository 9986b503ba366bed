"""The files of a run folder: their names, and `run.json`, which is made and checked here.

`run.json` is strict JSON: its format, what the run says of itself, and a SHA-256 digest of the rest, so that a cut or
altered file is refused.
"""

from __future__ import annotations

import errno
import hashlib
import io
import json
import math
import os
import stat
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from paretoik.errors import InvalidInput, InvalidRun
from paretoik.paths import missing_file, shell_command
from paretoik.runs.file_replacement import only_writer, replace_file, replace_files

# Arrays and tables in files of unknown origin: the size that a file declares is checked before it is read.
#
# A file of a megabyte can declare gigabytes: a compressed archive, an array whose header declares more than its bytes,
# a table with one value repeated a milliard times. Our own files contain none of these.


@dataclass(frozen=True, kw_only=True)
class StoredArrayOptions:
    """Limits of a table: its rows (``most_rows``), and its bytes after unpacking (``most_bytes``)."""

    most_rows: int = 10_000_000
    most_bytes: int = 2**29


ARRAY_OPTIONS = StoredArrayOptions()
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
    """Return the Arrow table of a Parquet file; columns of earlier runs get today's names.

    Raises ValueError, or what Arrow raises, for other content.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = pq.ParquetFile(pa.BufferReader(content))
    metadata = file.metadata
    size = sum(metadata.row_group(group).total_byte_size for group in range(metadata.num_row_groups))
    if metadata.num_rows > ARRAY_OPTIONS.most_rows or size > ARRAY_OPTIONS.most_bytes:
        raise ValueError(f"a table that declares {metadata.num_rows} rows and {size} bytes in a file of {len(content)}")
    # Without threads: those of read_table may abort the interpreter as it ends (apache/arrow#34314).
    table = file.read(use_threads=False)
    return table.rename_columns([FORMER_NAMES.get(name, name) for name in table.column_names])


def _declared_bytes(stream: Any) -> int:
    """Return how many bytes the header of an array declares."""
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, kind = read(stream)
    return math.prod(shape) * kind.itemsize


# Names of a run's files, and its `run.json`.


FORMAT = 1
RUN = "run.json"
TABLE = "front.parquet"
MOTIONS = "motions.npz"
NEAREST = "least_violating.npz"  # of a run that found nothing feasible
RECORDING = "review.rrd"
PICTURE = "front.png"
CERTIFICATES = "certificates.png"
STEPS = "steps.parquet"
SEARCHES = "searches.npz"
OPTIMA = "optima.parquet"
TRACES = "traces.npz"
POLYGON = "polygon.npz"
TOOL_PATH = "tool_path.npz"
DRAWING = "picture.png"
CHECKPOINT = "checkpoint"  # a folder: what a stopped run resumes from
JOURNAL = "journal"  # in it
FINISHED = "finished"  # in it: the journal of a finished search, which can be continued
CHOICES = "choices.json"
REPORT = "report.html"
FORMER = ".former-run"  # a folder in it: the run that a new one replaces, until the new one has a result
CONTENTS = (
    RUN,
    TABLE,
    MOTIONS,
    NEAREST,
    RECORDING,
    PICTURE,
    CERTIFICATES,
    STEPS,
    SEARCHES,
    OPTIMA,
    TRACES,
    POLYGON,
    TOOL_PATH,
    DRAWING,
    CHECKPOINT,
    CHOICES,
    REPORT,
)


STOPPED = ("time limit", "SIGINT", "SIGTERM", "interrupted")  # statuses of runs that could resume
PAGES = (REPORT, PICTURE, CERTIFICATES, DRAWING)  # to look at; a run is complete without them
PAGE_MARK = b'<meta name="generator" content="paretoik">'
PICTURE_MARK = b"Software\0paretoik"  # a text chunk of PNG


@dataclass(frozen=True, kw_only=True)
class MarkOptions:
    """Range in which the mark of our pages and pictures is searched: metadata come first in HTML and PNG."""

    beginning: int = 4096  # bytes


OPTIONS = MarkOptions()


def check_target(
    name: str, file: Path, *, overwrite: bool = False, mark: bytes | None = None, folder: bool = False
) -> None:
    """Raise InvalidInput, by ``name``, if no file can be written there, so that this is known before any work.

    Refused are a folder, unless one is asked for, a name that the system refuses, a run's own files, and without
    ``overwrite`` any existing file, except one of ours that has the ``mark`` of what is to be written.
    """
    kind = "a folder of its own" if folder else "a file"
    if file.name in ("", ".."):
        raise InvalidInput(f"{name} must be {kind} to write into, got the folder {file}")
    if file.name in set(CONTENTS) - set(PAGES) and is_run(file.parent / RUN):
        raise InvalidInput(f"{name} must not be one of the run's own files, got {file}")
    try:
        file.lstat()
    except FileNotFoundError:
        return
    except OSError as fault:
        raise InvalidInput(f"{file} must be writable, got {fault.strerror}") from fault
    if file.is_dir() and not folder:
        raise InvalidInput(f"{name} must be {kind} to write into, got the folder {file}")
    if not (overwrite or (mark is not None and _has_mark(file, mark))):
        raise InvalidInput(f"{file} must be a new file, got one that exists; use --overwrite to replace it")


def _has_mark(file: Path, mark: bytes) -> bool:
    if file.is_symlink() or not file.is_file():
        return False
    with file.open("rb") as content:
        return mark in content.read(OPTIONS.beginning)


def run_bytes(entries: Mapping[str, Any]) -> bytes:
    """Return the content of a `run.json` or `choices.json`: the format, `entries`, and the digest of both.

    Raises TypeError or ValueError if an entry is no strict JSON.
    """
    run = json.loads(json.dumps({"format": FORMAT, **entries}, allow_nan=False))  # as it will be read
    return json.dumps(run | {"digest": digest(run)}, indent=2).encode() + b"\n"


def result_files(entries: Mapping[str, Any], contents: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return the contents of a result's files by name, and of its `run.json`: ``entries`` and the digests of the files.

    Raises TypeError or ValueError if an entry is no strict JSON.
    """
    digests = {name: hashlib.sha256(content).hexdigest() for name, content in contents.items()}
    return {**contents, RUN: run_bytes({**entries, "files": digests})}


def write_result(folder: Path, entries: Mapping[str, Any], contents: Mapping[str, bytes]) -> None:
    """Write the files of a result into a folder, all or none; entries as in ``write_run``."""
    files = result_files(to_json(entries), contents)
    with only_writer(folder) as opened:
        replace_files(opened, files)


def write_run(folder: Path, entries: Mapping[str, Any]) -> None:
    """Write `entries` as the folder's `run.json`; infinite numbers become null. Raises as ``to_json``."""
    replace_file(folder / RUN, run_bytes(to_json(entries)))


def read_run(file: Path, *, kind: str = "a run") -> dict[str, Any]:
    """Return the entries of a `run.json` of this format, or of a file of another ``kind``, without checking its digest.

    Raises InvalidRun if the file is missing, a link, no strict JSON, no run, or of another format.
    """
    try:
        content = read_plain_file(file)
    except InvalidRun as fault:
        raise InvalidRun(f"{fault}{unfinished_note(file.parent)}") from None
    try:
        run = json.loads(content, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as fault:
        raise InvalidRun(f"{file} must be strict JSON, got {fault}") from fault
    if not isinstance(run, dict) or "format" not in run:
        raise InvalidRun(f"{file} must be {kind}, got JSON without a format")
    if run["format"] != FORMAT:
        raise InvalidRun(f"{file} must have format {FORMAT}, got {run['format']!r}; use another version of paretoik")
    return run


def check_digest(file: Path, run: dict[str, Any]) -> None:
    """Remove the digest from the entries of a file; raises InvalidRun if it is not the digest of the rest."""
    if run.pop("digest", None) != digest(run):
        raise InvalidRun(f"{file} must be as it was written, got contents that do not match their digest")


def is_run(file: Path) -> bool:
    """Return whether a file is the `run.json` of some version of this format."""
    return _entries(file) is not None


def has_result(folder: Path) -> bool:
    """Return whether a folder has a run with a result; one of another version of this format may have one."""
    run = _entries(folder / RUN)
    return run is not None and ("files" in run or run["format"] != FORMAT)


def can_resume(folder: Path) -> bool:
    """Return whether a folder has a run that was stopped or killed and can resume."""
    checkpoint = folder / CHECKPOINT
    return is_run(folder / RUN) and (checkpoint / JOURNAL).is_file() and not checkpoint.is_symlink()


def problem_words(reference: object) -> tuple[str, ...]:
    """Return the words of a command line that name the problem of a run; none if the run names none."""
    return ("--problem", reference) if isinstance(reference, str) and reference else ()


def was_cut_off(folder: Path) -> bool:
    """Return whether a folder has a run that was stopped or killed after it had something to resume from."""
    run = _entries(folder / RUN) or {}
    is_unfinished = run.get("status") in (*STOPPED, "running", "refining")
    return is_unfinished and can_resume(folder) and (folder / CHECKPOINT / JOURNAL).stat().st_size > 0


def unfinished_note(folder: Path) -> str:
    """Return the words that help after an error: how to resume a run without result, the place of the run it replaces.

    A run that ended because no motion is feasible would end so again: the reason is returned instead.
    """
    former, run = folder / FORMER, _entries(folder / RUN) or {}
    if run.get("status") == "Infeasible":
        return f"; it ended with: {run.get('reason')}"
    command = shell_command("paretoik", "resume", folder, *problem_words(run.get("problem")))
    resumed = f"; {command} resumes it" if can_resume(folder) else ""
    return resumed + (f"; the run that it was to replace is in {former}" if is_run(former / RUN) else "")


def _entries(file: Path) -> dict[str, Any] | None:
    """Return the unchecked entries of a `run.json` of some version of this format; None for other files."""
    try:
        run = json.loads(read_plain_file(file))
    except (InvalidRun, ValueError, RecursionError):
        return None
    return run if isinstance(run, dict) and "format" in run else None


def digest(run: Mapping[str, Any]) -> str:
    """Return the SHA-256 digest of a run's entries without the entry "digest"."""
    entries = {name: value for name, value in run.items() if name != "digest"}
    return hashlib.sha256(json.dumps(entries, sort_keys=True).encode()).hexdigest()


def to_json(value: Any, *, name: str = "run") -> Any:
    """Return `value` as strict JSON: arrays as lists, paths as text, numbers that are not finite as null.

    Raises InvalidInput if an item is neither number, text, truth value, None, list nor mapping.
    """
    match value:
        case None | bool() | int() | str():
            return value
        case float():
            return float(value) if math.isfinite(value) else None
        case np.generic() | np.ndarray():
            return to_json(value.tolist(), name=name)
        case PurePath():
            return str(value)
        case Mapping():
            return {str(key): to_json(item, name=f"{name}.{key}") for key, item in value.items()}
        case list() | tuple():
            return [to_json(item, name=f"{name}[{index}]") for index, item in enumerate(value)]
        case _:
            raise InvalidInput(f"{name} must be what JSON can hold, got {type(value).__name__}")


def read_plain_file(file: Path) -> bytes:
    """Return the content of a plain file; raises InvalidRun for others: a link may lead anywhere, a pipe never end."""
    try:
        descriptor = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise InvalidRun(f"{file} must be a plain file, got {missing_file(file)}")
            with open(descriptor, "rb", closefd=False) as content:
                return content.read()
        finally:
            os.close(descriptor)
    except OSError as fault:
        if fault.errno in (errno.ENOENT, errno.ENOTDIR, errno.ELOOP, errno.ENXIO):
            raise InvalidRun(f"{file} must be a plain file, got {missing_file(file)}") from fault
        raise InvalidRun(f"{file} must be readable, got {fault.strerror}") from fault


def _refuse_constant(constant: str) -> None:
    raise ValueError(f"the number {constant}")
