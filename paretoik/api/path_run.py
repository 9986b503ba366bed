"""The run of a tool path: a fastest path or time-optimal control."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from paretoik.api.session import RunRequest, open_session
from paretoik.capability.geodesic import FastestPath, PathQuery
from paretoik.capability.time_optimal import TimeOptimalRun
from paretoik.progress import Observer
from paretoik.review.recording.messages import PathEnd, PathScene
from paretoik.runs.files import DRAWING, TOOL_PATH, array_bytes, write_result

HOLDS = f"a tool path, its arrays in {TOOL_PATH}"
Result = TypeVar("Result", FastestPath, TimeOptimalRun)


def keep_path(
    query: PathQuery,
    compute: Callable[[], Result],
    *,
    out: str | Path | None,
    overwrite: bool,
    observe: Observer | bool | None,
) -> Result:
    """Return a tool path; save run.json, tool_path.npz, review.rrd and picture.png in the folder ``out``.

    `tool_path.npz` has the result's arrays and numbers by name, ``start``, ``target``, and the corners ``lower`` and
    ``upper`` of the model's box.
    """
    title = query.verb.replace("_", " ")
    request = RunRequest(
        verb=query.verb,
        problem=query,
        settings=query.settings,
        title=title,
        out=out,
        overwrite=overwrite,
        observe=observe,
        catch_signals=False,  # a path is computed completely or not at all
    )
    with open_session(request) as session:
        session.start_recording(PathScene(title=title, start=query.start, target=query.target))
        path = compute()
        provenance = session.ended("path", samples=len(path.times)) | {"duration": float(path.times[-1])}
        tool, reference = (path.points, None) if isinstance(path, FastestPath) else (path.positions, path.references)
        end = PathEnd(times=path.times, tool=tool, reference=reference, target=query.target, provenance=provenance)
        arrays = {each.name: np.asarray(getattr(path, each.name)) for each in fields(path)}
        box = {"lower": query.model.lower, "upper": query.model.upper, "start": query.start, "target": query.target}
        content = array_bytes(arrays | {name: np.asarray(each, dtype=float) for name, each in box.items()})

        def draw(folder: Path) -> None:
            from paretoik.review.pictures.motions import path_picture  # here: matplotlib loads slowly

            path_picture(end, folder / DRAWING)

        session.finish(
            path,
            partial(write_result, entries={**provenance, "holds": HOLDS}, contents={TOOL_PATH: content}),
            status=provenance["status"],
            end=lambda: end,
            draw=draw,
        )
    return path
