"""The files of a run folder: their names, and `run.json`.

`run.json` is strict JSON: its format, the entries of the run, and a SHA-256 digest of both, so that a truncated or
changed file is refused.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
from collections.abc import Mapping
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from paretoik.errors import InvalidInput, InvalidRun
from paretoik.file_paths import missing_file, shell_command
from paretoik.runs.file_replacement import only_writer, replace_file, replace_files

# Arrays and tables in files of unknown origin: nothing in them is executed.


FORMER_NAMES = {"kkt_residual": "criticality"}  # former names of columns


def read_arrays(content: bytes) -> dict[str, np.ndarray]:
    """Return the arrays of an NPZ without pickle. Raises what NumPy raises for other content."""
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def read_table(content: bytes) -> Any:
    """Return the Arrow table of a Parquet file, with current column names; raises what Arrow raises."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    # No threads: those of read_table may abort the interpreter at its exit (apache/arrow#34314).
    table = pq.ParquetFile(pa.BufferReader(content)).read(use_threads=False)
    return table.rename_columns([FORMER_NAMES.get(name, name) for name in table.column_names])


def array_bytes(arrays: Mapping[str, np.ndarray]) -> bytes:
    """Return arrays, by name, as the content of an NPZ without pickle."""
    sink = io.BytesIO()
    np.savez(sink, allow_pickle=False, **arrays)
    return sink.getvalue()


def table_bytes(table: Any) -> bytes:
    """Return an Arrow table as the content of a Parquet file."""
    import pyarrow.parquet as pq

    sink = io.BytesIO()
    pq.write_table(table, sink)
    return sink.getvalue()


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
CHECKPOINT = "checkpoint"  # folder of the data from which a stopped run resumes
JOURNAL = "journal"  # file in the checkpoint
FINISHED = "finished"  # file in the checkpoint: journal of a finished search that can be continued
CHOICES = "choices.json"
REPORT = "report.html"
FORMER = ".former-run"  # folder in the run's folder: the run that a new one replaces, until the new one has a result
CONTENTS = (
    *(RUN, TABLE, MOTIONS, NEAREST, RECORDING, PICTURE, CERTIFICATES, STEPS, SEARCHES, OPTIMA, TRACES, POLYGON),
    *(TOOL_PATH, DRAWING, CHECKPOINT, CHOICES, REPORT),
)
STOPPED = ("time limit", "SIGINT", "SIGTERM", "interrupted")  # statuses of runs that could resume
PAGES = (REPORT, PICTURE, CERTIFICATES, DRAWING)  # files for people; a run is complete without them
PAGE_MARK = b'<meta name="generator" content="paretoik">'
PICTURE_MARK = b"Software\0paretoik"  # a text chunk of PNG


def check_target(
    name: str, file: Path, *, overwrite: bool = False, mark: bytes | None = None, folder: bool = False
) -> None:
    """Raise InvalidInput, with ``name``, if no file can be written there.

    The check comes before any computation. It refuses folders unless ``folder``, names that the system refuses, and a
    run's own files. Without ``overwrite`` it also refuses existing files, except files of paretoik with this ``mark``.
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
    # The marks are near the beginning of HTML and PNG files.
    is_ours = mark is not None and file.is_file() and mark in file.read_bytes()[:4096]
    if not (overwrite or is_ours):
        raise InvalidInput(f"{file} must be a new file, got one that exists; use --overwrite to replace it")


def run_bytes(entries: Mapping[str, Any]) -> bytes:
    """Return the content of a `run.json` or `choices.json`: the format, the `entries`, and the digest of both.

    Raises TypeError or ValueError if an entry is not strict JSON.
    """
    run = json.loads(json.dumps({"format": FORMAT, **entries}, allow_nan=False))  # as it will be read
    return json.dumps(run | {"digest": digest(run)}, indent=2).encode() + b"\n"


def result_files(entries: Mapping[str, Any], contents: Mapping[str, bytes]) -> dict[str, bytes]:
    """Return a result's files by name, including `run.json` with ``entries`` and the digests of the files.

    Raises TypeError or ValueError if an entry is not strict JSON.
    """
    digests = {name: hashlib.sha256(content).hexdigest() for name, content in contents.items()}
    return {**contents, RUN: run_bytes({**entries, "files": digests})}


def write_result(folder: Path, entries: Mapping[str, Any], contents: Mapping[str, bytes]) -> None:
    """Write a result's files into a folder, all or none. ``entries`` are as in ``write_run``."""
    files = result_files(to_json(entries), contents)
    with only_writer(folder):
        replace_files(folder, files)


def write_run(folder: Path, entries: Mapping[str, Any]) -> None:
    """Write `entries` as the folder's `run.json`. Infinite numbers become null. Raises as ``to_json`` does."""
    replace_file(folder / RUN, run_bytes(to_json(entries)))


def read_run(file: Path, *, kind: str = "a run") -> dict[str, Any]:
    """Return the entries of a `run.json`, or of another ``kind`` of file of its format; its digest is not checked.

    Raises InvalidRun if the file is missing, a link, not strict JSON, not a run, or of another format.
    """
    try:
        content = read_plain_file(file)
    except InvalidRun as fault:
        raise InvalidRun(f"{fault}{unfinished_note(file.parent)}") from None
    try:
        run = json.loads(content, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as fault:
        raise InvalidRun(f"{file} must be strict JSON, got: {fault}") from fault
    if not isinstance(run, dict) or "format" not in run:
        raise InvalidRun(f"{file} must be {kind}, got JSON without a format")
    if run["format"] != FORMAT:
        raise InvalidRun(f"{file} must have format {FORMAT}, got {run['format']!r}; use another version of paretoik")
    return run


def check_digest(file: Path, run: dict[str, Any]) -> None:
    """Remove the digest of a file's entries; raises InvalidRun if it is not that of the other entries."""
    if run.pop("digest", None) != digest(run):
        raise InvalidRun(f"{file} must be as it was written, got contents that do not match their digest")


def is_run(file: Path) -> bool:
    """Return whether a file is a `run.json` of any version."""
    return _entries(file) is not None


def has_result(folder: Path) -> bool:
    """Return whether a folder has a run with a result; a run of another version counts, as it may have one."""
    run = _entries(folder / RUN)
    return run is not None and ("files" in run or run["format"] != FORMAT)


def can_resume(folder: Path) -> bool:
    """Return whether a folder has an unfinished run that can resume."""
    checkpoint = folder / CHECKPOINT
    return is_run(folder / RUN) and (checkpoint / JOURNAL).is_file() and not checkpoint.is_symlink()


def problem_words(reference: object) -> tuple[str, ...]:
    """Return the command-line words that name a run's problem, empty if it names none."""
    return ("--problem", reference) if isinstance(reference, str) and reference else ()


def was_cut_off(folder: Path) -> bool:
    """Return whether a folder has an unfinished run with a non-empty journal."""
    run = _entries(folder / RUN) or {}
    is_unfinished = run.get("status") in (*STOPPED, "running", "refining")
    return is_unfinished and can_resume(folder) and (folder / CHECKPOINT / JOURNAL).stat().st_size > 0


def unfinished_note(folder: Path) -> str:
    """Return the text to add to an error: how to resume the run.

    It also names the folder of the run to be replaced. If the run found no feasible motion, it would end in the same
    way again: then the text is its reason.
    """
    former, run = folder / FORMER, _entries(folder / RUN) or {}
    if run.get("status") == "Infeasible":
        return f"; it ended with: {run.get('reason')}"
    command = shell_command("paretoik", "resume", folder, *problem_words(run.get("problem")))
    resumed = f"; {command} resumes it" if can_resume(folder) else ""
    return resumed + (f"; the run that it was to replace is in {former}" if is_run(former / RUN) else "")


def _entries(file: Path) -> dict[str, Any] | None:
    """Return the unchecked entries of a `run.json` of any version, None for other files."""
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
    """Return `value` as strict JSON: arrays become lists, paths text, and infinite or NaN numbers null.

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
            raise InvalidInput(f"{name} must be JSON data, got {type(value).__name__}")


def read_plain_file(file: Path) -> bytes:
    """Return the content of a plain file; raises InvalidRun for links, which may lead anywhere, and pipes."""
    try:
        if file.is_symlink() or not file.is_file():
            raise InvalidRun(f"{file} must be a plain file, got {missing_file(file)}")
        return file.read_bytes()
    except OSError as fault:
        raise InvalidRun(f"{file} must be readable, got {fault.strerror}") from fault


def _refuse_constant(constant: str) -> None:
    raise ValueError(f"the number {constant}")
