"""Find the highest speed or force of a tool in each direction."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from paretoik.api.session import RunRequest, open_session
from paretoik.capability.actuation import Actuation
from paretoik.capability.directional import PerformancePolygon, directional_query, performance_polygon
from paretoik.capability.joint_capability import Quantity
from paretoik.inputs import check_flag
from paretoik.progress import Observer
from paretoik.review.recording.messages import MaximaScene, maxima_end, workcell_of
from paretoik.robot.arm import Arm
from paretoik.runs.files import DRAWING, POLYGON, array_bytes, write_result

HOLDS = f"directional maxima, their arrays in {POLYGON}"
# Arrays of `polygon.npz`, next to joint_names (dof,), by their names in the polygon.
ARRAYS = ("position", "directions", "values", "q", "dq", "torque", "motor_speeds", "motor_efforts", "sliders")


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
    """Return the highest speeds or forces of a tool per direction.

    Speeds are those at which the motors can also hold the arm against gravity (quasi-static). Forces are those that the
    tool can exert at rest, in postures that the motors can hold without the force.

    Parameters
    ----------
    arm
        Arm, whose gravity must point as the arm is mounted.
    actuation
        Motors of the arm.
    position
        Position of the tool [m]: (2,) for planar arms, else (3,).
    directions
        Number (default 16), evenly spaced from the x axis (Eq. 2) or over the sphere; or vectors (directions, task).
    quantity
        Quantity to maximise: "velocity" (default) or "force".
    starts
        Number of start postures (default 20 000), more if few can be held; unused for planar arms with three joints.
    seed
        Seed of the start postures (default 0).
    out
        Folder for the run (default: none): run.json, polygon.npz, review.rrd and picture.png.
    overwrite
        Whether to replace a run in ``out`` (default False).
    observe
        Observer of compilation and saving, as for ``plan``.

    Returns
    -------
    PerformancePolygon
        Maximum of each direction, with its posture, torques, motors and slider positions.

    Raises
    ------
    InvalidInput
        If an argument cannot be used.
    OutOfReach
        If no posture reaches the position.
    SolverFailed
        If no posture was found that reaches the position.
    Infeasible
        If no posture found can be held; names the best one's joint, torque and motor limit, or the rod's angle.

    Notes
    -----
    For one posture with its slider positions both maxima are exact: a closed form, the facet of a zonotope (a linear
    program gives the same). Slider positions are searched in the intervals that can bear the load: in 12 pieces each,
    then by golden sections.

    Planar arms with three joints are evaluated on every branch of postures, at 360 postures and at each one at which a
    limit becomes active or inactive. Golden sections search from there: one of two maxima within a degree may be
    missed. For other arms an interior-point method maximises over posture, slider positions and speeds, from several of
    the ``starts``, until the best value was reached often: this proves nothing.

    A speed is possible for an instant: the next posture may not allow it. A slider near a toggle turns its joint fast,
    but only a short way, and each direction has its own posture and slider positions. ``PointToPoint`` also includes
    the motion to get there.

    In review.rrd the polygon grows direction by direction, with the arm in each maximising posture.

    Source: Kim, Choi & Jang 2021, Eq. 1.
    """
    query = directional_query(arm, actuation, position, directions, quantity=quantity, starts=starts, seed=seed)
    check_flag("overwrite", overwrite)
    if out is None and observe is None:  # no session: thousands of polygons may be computed one after the other
        return performance_polygon(query)
    request = RunRequest(
        verb="directional_maxima",
        problem=query,
        title=f"directional maxima of {query.arm.name}",
        settings={"quantity": quantity, "directions": len(query.directions), "starts": starts, "seed": seed},
        out=out,
        overwrite=overwrite,
        observe=observe,
    )
    with open_session(request) as session:
        cell = workcell_of(query)
        assert cell is not None
        alone = replace(cell, directions=np.zeros((0, 3)))  # directions are added one after the other
        session.start_recording(MaximaScene(workcell=alone, quantity=query.quantity))
        polygon = performance_polygon(query)
        found = int(np.isfinite(polygon.values).sum())
        provenance = session.ended("maxima", directions=len(polygon), found=found)
        unit = "m/s" if polygon.quantity == "velocity" else "N"
        arrays = {name: getattr(polygon, name) for name in ARRAYS}
        content = array_bytes(
            {"joint_names": np.array(polygon.arm.joint_names, dtype=np.str_)}
            | {name: np.asarray(values) for name, values in arrays.items() if values is not None}
        )

        def draw(folder: Path) -> None:
            from paretoik.review.pictures.motions import polygon_picture  # here: matplotlib loads slowly

            polygon_picture(polygon, folder / DRAWING)

        session.finish(
            polygon,
            partial(write_result, entries={**provenance, "holds": HOLDS, "unit": unit}, contents={POLYGON: content}),
            status=provenance["status"],
            end=partial(maxima_end, polygon, provenance),
            draw=draw,
        )
    return polygon
