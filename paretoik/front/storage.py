"""A front on disk: `run.json`, `front.parquet` and `motions.npz`, a versioned format without pickle.

`run.json` (``runs.files``) has the front's provenance, its objectives, and the SHA-256 digests of the other files, so
that a truncated, altered or foreign file is refused before any parser sees it. `front.parquet` has one row per point:
id, one column per objective, violation, violation_between, criticality, status, reason; unknown values are null.
`motions.npz` has id, genes, joint_names (dof,), time (points, time), q (points, time, dof), and for certified points
weights (points, n_obj), exchange_rates (points, n_obj, n_obj) and exchange_intervals (points, n_obj, n_obj, 2).
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.errors import InvalidInput, InvalidRun
from paretoik.front.certificates import Certificates
from paretoik.front.points import Front, FrontData, JointMotions, MotionBuilder, StoredJoints, StoredMotions, attach
from paretoik.inputs import first_line, shown
from paretoik.runs.file_replacement import only_writer, replace_files, without_writers
from paretoik.runs.files import (
    CHOICES,
    MOTIONS,
    RUN,
    TABLE,
    array_bytes,
    check_digest,
    is_run,
    read_arrays,
    read_plain_file,
    read_run,
    read_table,
    result_files,
    run_bytes,
    table_bytes,
    unfinished_note,
)

RESERVED_ENTRIES = ("format", "objectives", "points", "files", "digest")
CERTIFICATE_COLUMNS = ("violation_between", "criticality")
CERTIFICATE_TEXTS = ("status", "reason")
CERTIFICATE_ARRAYS = ("weights", "exchange_rates", "exchange_intervals")
LATER_ARRAYS = ("discretisation_error",)  # earlier runs have none
ERROR_COLUMN = "discretisation error of {}"


def save(front: FrontData, folder: Path, *, overwrite: bool = False) -> None:
    """Write the front's files into `folder`, all of them at once or none.

    An existing run is replaced only if this front is of the same problem and has all its points, or if ``overwrite``.
    Its choices are kept if all its points are. Raises InvalidInput if the run must not be replaced, if writing fails,
    or if the provenance is not strict JSON or has one of ``RESERVED_ENTRIES``.
    """
    files = front_files(front)
    with only_writer(folder):
        if is_run(folder / RUN):
            keeps = False  # whether the front has the problem and all points of the folder's run
            with suppress(InvalidRun):
                run, points = _read_front_entries(folder / RUN), stored_points(folder)
                values = dict(zip(front.ids.tolist(), map(tuple, front.objectives.tolist()), strict=True))
                keeps = (
                    run.get("fingerprint") == front.provenance.get("fingerprint")
                    and [entry["name"] for entry in run["objectives"]] == list(front.names)
                    and all(values.get(number) == stored for number, stored in points.items())
                )
            if not keeps and not overwrite:
                raise InvalidInput(
                    f"{folder} must be a new folder or this front's own, got one with another run or with points "
                    "that this front does not have; overwrite=True replaces it"
                )
            if not keeps and (folder / CHOICES).exists():
                files[CHOICES] = run_bytes({"entries": [], "current": None})
        replace_files(folder, files)
    attach(front, folder)


def front_files(front: FrontData) -> dict[str, bytes]:
    """Return the contents of a front's files by name; raises InvalidInput if ``save`` refuses its provenance."""
    import pyarrow as pa

    clashes = [name for name in RESERVED_ENTRIES if name in front.provenance]
    if clashes:
        raise InvalidInput(f"front provenance must not have any of {', '.join(RESERVED_ENTRIES)}, got {clashes[0]!r}")
    objectives = [
        {"name": name, "unit": unit, "maximised": maximised, "range": [float(low), float(high)]}
        for name, unit, maximised, (low, high) in zip(
            front.names, front.units, front.maximised, front.ranges, strict=True
        )
    ]
    arrays = {"id": front.ids}
    if front.genes is not None:
        arrays["genes"] = front.genes
    if front.motions is not None:
        arrays |= motion_arrays(front.motions)
    # One row per point; unknown values are null.
    missing, certificates = pa.nulls(len(front), pa.float64()), front.certificates
    columns, units = {"id": pa.array(front.ids)}, dict(zip(front.names, front.units, strict=True))
    columns |= {name: pa.array(values) for name, values in zip(front.names, front.objectives.T, strict=True)}
    violation = certificates.violation if front.violation is None and certificates is not None else front.violation
    columns["violation"] = missing if violation is None else pa.array(violation)
    if certificates is None:
        columns |= dict.fromkeys(CERTIFICATE_COLUMNS, missing)
        columns |= dict.fromkeys(CERTIFICATE_TEXTS, pa.nulls(len(front), pa.string()))
    else:
        columns |= {name: pa.array(getattr(certificates, name)) for name in CERTIFICATE_COLUMNS}
        columns |= {name: pa.array(getattr(certificates, name).tolist(), pa.string()) for name in CERTIFICATE_TEXTS}
        errors = zip(front.names, certificates.discretisation_error.T, strict=True)
        columns |= {ERROR_COLUMN.format(name): pa.array(values) for name, values in errors}
        arrays |= {name: getattr(certificates, name) for name in (*CERTIFICATE_ARRAYS, *LATER_ARRAYS)}
    units |= {ERROR_COLUMN.format(name): unit for name, unit in units.items()}
    kinds = [pa.field(name, values.type, metadata={"unit": units.get(name, "")}) for name, values in columns.items()]
    files = {TABLE: table_bytes(pa.table(columns, schema=pa.schema(kinds)))}
    if len(arrays) > 1:
        files[MOTIONS] = array_bytes(arrays)
    try:
        return result_files({**front.provenance, "objectives": objectives, "points": len(front)}, files)
    except (TypeError, ValueError) as fault:
        raise InvalidInput(f"front provenance must be strict JSON, got: {fault}") from fault


def stored_points(folder: Path) -> dict[int, tuple[float, ...]]:
    """Return the objectives of every point in a run folder, by id; raises InvalidRun as ``load`` does."""
    run = _read_front_entries(folder / RUN)
    names = [entry["name"] for entry in run["objectives"]]
    table = _read_table(folder / TABLE, read_verified(folder / TABLE, run["files"][TABLE]), names)
    rows = zip(*(table[name].tolist() for name in names), strict=True)
    return dict(zip(table["id"].tolist(), rows, strict=True))


def load(folder: Path, *, make: Callable[..., Front], build_motions: MotionBuilder | None = None) -> Front:
    """Return the front that `save` wrote, checked; its motions are `StoredMotions` unless `build_motions` is given."""
    with without_writers(folder):
        run = _read_front_entries(folder / RUN)
        contents = {name: read_verified(folder / name, expected) for name, expected in run["files"].items()}
    names, units, maximised, ranges = (
        [entry[part] for entry in run["objectives"]] for part in ("name", "unit", "maximised", "range")
    )
    table = _read_table(folder / TABLE, contents[TABLE], names)
    arrays = read_motions(folder / MOTIONS, contents[MOTIONS], table["id"]) if MOTIONS in contents else {}
    motions: JointMotions | None = None
    if "q" in arrays:
        joint_names = tuple(str(name) for name in arrays["joint_names"])
        if build_motions is None:
            motions = StoredMotions(arm=StoredJoints(joint_names=joint_names), time=arrays["time"], q=arrays["q"])
        else:
            motions = build_motions(arrays["time"], arrays["q"], joint_names)
    try:
        certificates = None
        if "criticality" in table and all(name in arrays for name in CERTIFICATE_ARRAYS):
            columns = ("violation", *CERTIFICATE_COLUMNS, *CERTIFICATE_TEXTS)
            parts = {name: table[name] for name in columns if name in table}
            parts |= {name: arrays[name] for name in (*CERTIFICATE_ARRAYS, *LATER_ARRAYS) if name in arrays}
            certificates = Certificates(**parts)
        front = make(
            ids=table["id"],
            objectives=np.stack([table[name] for name in names], axis=1),
            names=names,
            units=units,
            maximised=maximised,
            genes=arrays.get("genes"),
            motions=motions,
            violation=table["violation"],
            certificates=certificates,
            ranges=np.array(ranges, dtype=float),
            provenance={key: value for key, value in run.items() if key not in RESERVED_ENTRIES},
        )
    except (InvalidInput, TypeError, ValueError) as fault:
        raise InvalidRun(f"{folder} must be a valid front, got: {fault}") from fault
    return attach(front, folder)


def motion_arrays(motions: JointMotions) -> dict[str, np.ndarray]:
    """Return motions as the arrays of `motions.npz`: joint_names (dof,), time (points, time), q (points, time, dof)."""
    q = np.asarray(motions.q, dtype=float)
    time = np.broadcast_to(np.asarray(motions.time, dtype=float), q.shape[:-1])
    return {"joint_names": np.array(motions.arm.joint_names, dtype=np.str_), "time": time, "q": q}


def _read_front_entries(file: Path) -> dict[str, Any]:
    run = read_run(file)
    if "files" not in run:
        note = unfinished_note(file.parent)
        raise InvalidRun(
            f"{file} must be a run with a front, got one of status {run.get('status')!r} without a front{note}"
        )
    check_digest(file, run)
    if "holds" in run:
        raise InvalidRun(f"{file} must be a run with a front, got one that contains {run['holds']}")
    files, objectives = run["files"], run.get("objectives")
    is_complete = (
        isinstance(files, dict)
        and TABLE in files
        and not files.keys() - {TABLE, MOTIONS}
        and isinstance(objectives, list)
        and len(objectives) > 0
        and all(isinstance(entry, dict) for entry in objectives)
        and all(entry.keys() == {"name", "unit", "maximised", "range"} for entry in objectives)
        and all(isinstance(entry["name"], str) and isinstance(entry["unit"], str) for entry in objectives)
    )
    if not is_complete:
        raise InvalidRun(
            f"{file} must have objectives and the digests of {TABLE} and, if present, {MOTIONS}, "
            f"got objectives {shown(objectives)} and files {shown(files)}"
        )
    return run


def _read_table(file: Path, content: bytes, names: list[str]) -> dict[str, Any]:
    import pyarrow as pa

    try:
        table = read_table(content)
        columns = {"id": table.column("id").cast(pa.int64()).to_numpy()}
        columns |= {name: table.column(name).cast(pa.float64()).to_numpy() for name in names}
        violation = table.column("violation")
        columns["violation"] = None if violation.null_count else violation.cast(pa.float64()).to_numpy()
        if not any(table.column(name).null_count for name in (*CERTIFICATE_COLUMNS, "status")):
            columns |= {name: table.column(name).cast(pa.float64()).to_numpy() for name in CERTIFICATE_COLUMNS}
            texts = [name for name in CERTIFICATE_TEXTS if name in table.column_names]  # earlier runs had no reasons
            columns |= {name: np.array(table.column(name).to_pylist(), dtype=np.str_) for name in texts}
    except Exception as fault:  # any error of the parser is the file's fault
        wish = f"{file} must have columns id, {', '.join(names)} and violation"
        raise InvalidRun(f"{wish}, got: {first_line(fault)}") from fault
    return columns


def read_motions(file: Path, content: bytes, ids: np.ndarray) -> dict[str, np.ndarray]:
    """Return the arrays of a `motions.npz`; raises InvalidRun unless they are of the points with these ids."""
    try:
        arrays = read_arrays(content)
    except Exception as fault:  # any error of the parser is the file's fault
        raise InvalidRun(f"{file} must be plain arrays, got: {first_line(fault)}") from fault
    if "id" not in arrays or not np.array_equal(arrays["id"], ids):
        raise InvalidRun(f"{file} must have the ids of {TABLE}, got {shown(arrays.get('id'))}")
    q, time, joints = (arrays.get(name, np.empty(0)) for name in ("q", "time", "joint_names"))
    kinds = "".join(array.dtype.kind for array in (q, time, joints))
    fits = q.ndim == 3 and len(q) == len(ids) and time.shape == q.shape[:2] and joints.shape == q.shape[2:]
    if "q" in arrays and not (kinds == "ffU" and fits and np.isfinite(q).all() and np.isfinite(time).all()):
        raise InvalidRun(
            f"{file} must have finite q (points, time, dof) with time and joint_names to match, got q {q.shape}, "
            f"time {time.shape}, joint_names {joints.shape}"
        )
    return arrays


def read_verified(file: Path, expected: object) -> bytes:
    """Return the content of a file; raises InvalidRun unless its digest is as expected."""
    content = read_plain_file(file)
    if hashlib.sha256(content).hexdigest() != expected:
        raise InvalidRun(f"{file} must be the file that {RUN} belongs to, got one replaced or damaged since")
    return content
