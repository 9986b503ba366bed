"""The run of a polygon of directional maxima: what is asked for, and what is kept of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from paretoik.api.run_session import Subject
from paretoik.capability.directional import DirectionalQuery, PerformancePolygon
from paretoik.fingerprint.fingerprint import fingerprint
from paretoik.front.storage import array_bytes
from paretoik.run_files import POLYGON, write_result

HOLDS = f"directional maxima, their arrays in {POLYGON}"
ARRAYS = ("position", "directions", "values", "q", "dq", "torque", "motor_speeds", "motor_efforts", "sliders")


def polygon_subject(query: DirectionalQuery) -> Subject:
    """Return what is asked for as the subject of a run."""
    return Subject(title=f"directional maxima of {query.arm.name}", fingerprint=fingerprint(query))


def polygon_counts(polygon: PerformancePolygon, seconds: float) -> dict[str, Any]:
    """Return how many directions there are, and of how many a maximum was found."""
    maxima = int(np.isfinite(polygon.values).sum())
    return {"directions": len(polygon), "found": maxima, "seconds": round(seconds, 3)}


def save_polygon(polygon: PerformancePolygon, provenance: dict[str, Any], folder: Path) -> None:
    """Write a polygon into a folder, all of its files at once or none.

    In `polygon.npz` are joint_names (dof,) and the arrays of the polygon by name.
    """
    arrays = {name: getattr(polygon, name) for name in ARRAYS}
    content = array_bytes(
        {"joint_names": np.array(polygon.arm.joint_names, dtype=np.str_)}
        | {name: np.asarray(values) for name, values in arrays.items() if values is not None}
    )
    unit = "m/s" if polygon.quantity == "velocity" else "N"
    write_result(folder, {**provenance, "holds": HOLDS, "unit": unit}, {POLYGON: content})
