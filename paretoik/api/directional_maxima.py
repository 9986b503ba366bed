"""Find how fast a tool can go, or how hard it can push, in every direction from a position."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.api.progress import Observer
from paretoik.api.session import RunSession, Subject, run_session
from paretoik.capability.actuation import Actuation
from paretoik.capability.directional import DirectionalQuery, PerformancePolygon, directional_query, performance_polygon
from paretoik.capability.joint_capability import Quantity
from paretoik.front.storage import array_bytes
from paretoik.inputs import check_call, check_flag
from paretoik.review.recording.messages import MaximaScene, maxima_end, workcell_of
from paretoik.robot.arm import Arm
from paretoik.runs.files import DRAWING, POLYGON, write_result
from paretoik.runs.fingerprint import fingerprint

# The run of a polygon of directional maxima: what is asked for, and what is kept of it.


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


# What the folder of directional maxima shows: a recording, and a picture.


def start_recording(query: DirectionalQuery, session: RunSession) -> None:
    """Start the recording of what is asked for."""
    cell = workcell_of(query)
    assert cell is not None
    alone = replace(cell, directions=np.zeros((0, 3)))  # one after the other
    session.start_recording(MaximaScene(workcell=alone, quantity=query.quantity))


def review_polygon(polygon: PerformancePolygon, provenance: Mapping[str, Any], session: RunSession) -> None:
    """Complete the recording, and, unless a signal came, draw the polygon."""
    if session.folder is None:
        return
    session.finish_recording(maxima_end(polygon, provenance))
    if session.signal is not None:
        return
    from paretoik.review.pictures.motions import polygon_picture  # here: matplotlib takes its time

    polygon_picture(polygon, session.folder / DRAWING)


@check_call
def directional_maxima(
    arm: Arm,
    actuation: Actuation,
    position: object,
    directions: object = 16,
    *,
    quantity: Quantity = "velocity",
    starts: int = 20_000,
    seed: int = 0,
    out: str | Path | None = None,
    overwrite: bool = False,
    observe: Observer | bool | None = None,
) -> PerformancePolygon:
    """Return the highest speeds or forces of an arm along each direction while its tool is at a position.

    Speeds are those with which motors can hold the arm against gravity meanwhile (quasi-static); forces are those the
    tool can exert at rest, in postures that can be held without them. In a posture with its sliders both are exact: a
    closed form, the facet of a zonotope (a linear program gives the same). Sliders are searched where they can bear
    their load, in 12 pieces of each stretch and by golden sections.

    Postures of planar arms with three joints are evaluated on every branch, all around, at 360 places on each curve and
    wherever limits begin or end to hold, and searched by golden sections from there: one of two maxima within a degree
    may be missed. Other arms ascend from several of ``starts`` postures, over posture, sliders and speeds at once, by
    interior points, until the best value was reached often: no proof.

    These are speeds of an instant: the next may have left the posture that allows them. Sliders near a toggle turn
    joints fast for a short way, and each direction has a posture and gears of its own. ``PointToPoint`` counts the way
    there.

    Parameters
    ----------
    arm, actuation
        The arm, its gravity as it is mounted, and its motors.
    position
        Of the tool, (2,) for planar arms, else (3,) [m].
    directions
        How many, evenly around from the x axis (Eq. 2) or over the sphere; or vectors (directions, task), however long.
    quantity
        "velocity" or "force".
    starts, seed
        Postures to start from (more are drawn where few can be held), and the seed of their chance; planar arms with
        three joints need none.
    out
        Folder to keep the run in: run.json, polygon.npz with every array of the result, review.rrd, in which the
        polygon grows direction by direction with the arm in each maximising posture, and picture.png. ``overwrite``
        allows it to replace a run that is there.
    observe
        Called with a ``RunProgress`` while something is compiled or saved; as for ``plan``.

    Raises InvalidInput naming what cannot be used; OutOfReach where no posture reaches the position, SolverFailed where
    none was found that does; Infeasible where none was found that can be held, naming the joint, its torque and what
    its motor can hold, or the rod's angle, of the best one. Source: Kim, Choi & Jang 2021, Eq. 1.
    """
    query = directional_query(arm, actuation, position, directions, quantity=quantity, starts=starts, seed=seed)
    check_flag("overwrite", overwrite)
    if out is None and observe is None:  # as where thousands are asked for in turn
        return performance_polygon(query)
    with run_session(
        polygon_subject(query),
        verb="directional_maxima",
        settings={"quantity": quantity, "directions": len(query.directions), "starts": starts, "seed": seed},
        out=out,
        overwrite=overwrite,
        observe=observe,
    ) as session:
        start_recording(query, session)
        polygon = performance_polygon(query)
        provenance = {**session.provenance, "status": "maxima", "counts": polygon_counts(polygon, session.seconds)}
        session.keep(polygon, lambda folder: save_polygon(polygon, provenance, folder), status=provenance["status"])
        with session.reviewing():
            review_polygon(polygon, provenance, session)
    return polygon
