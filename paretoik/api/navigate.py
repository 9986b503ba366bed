"""Move along the front of a run to a new certified point."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from paretoik.api.load import load_front
from paretoik.api.session import open_verb
from paretoik.front.front import Choice, Front
from paretoik.front.points import NAVIGATIONS
from paretoik.inputs import file_path
from paretoik.runs.files import CERTIFICATES, PICTURE, RECORDING, RUN, STOPPED, can_resume, read_run
from paretoik.runs.folder import check_other_folder, claim_folder, lock_folder


def navigate(
    run: str | Path,
    point: int | None = None,
    *,
    improve: str,
    allow: str | Sequence[str] | None = None,
    hold: str | Sequence[str] = (),
    by: float | None = None,
    to: float | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    problem: Any = None,
) -> tuple[Front, Choice, Path]:
    """Move along a run's front; return front, new point and folder.

    Parameters
    ----------
    run
        Folder of the run.
    point
        Id of the point to move from; default: the present choice of the run.
    improve
        Name of the objective that gets better.
    allow
        Names of objectives that may get worse; default: all that are not in ``hold``.
    hold
        Names of objectives that must not get worse (default: none).
    by
        Amount of the improvement, in the objective's unit; default: that of ``Front.navigate``.
    to
        Value to reach, in the objective's unit, in place of ``by``.
    out
        Folder for the new front; default: the run, or a new folder next to it (see Notes).
    overwrite
        Whether to replace a run in ``out`` (default False).
    problem
        Problem of the run or its name, as for ``load_front``.

    Returns
    -------
    tuple[Front, Choice, Path]
        Front with the new certified point, that point, and the folder that contains them.

    Raises
    ------
    InvalidInput
        If a run or a folder cannot be used, and as ``Front.navigate`` does.

    Notes
    -----
    The run keeps all its points. The new front goes into a new folder next to the run if the new point dominates former
    points, or if the run was stopped and can be resumed: its result would then replace the front.

    If the run has a recording, the one in the folder opens on the new point, next to the present choice if there is
    one.
    """
    folder = file_path("run", run)
    if out is not None:
        check_other_folder("out", file_path("out", out), folder)
    front = load_front(folder, problem)
    locked = lock_folder(folder) if out is None else claim_folder(file_path("out", out), overwrite=overwrite)
    with open_verb(False), locked as place:
        moved = front.navigate(point, improve=improve, allow=allow, hold=hold, by=by, to=to)
        choice = moved.navigated
        assert choice is not None  # a move returns a point or raises
        dominates = bool(moved.provenance[NAVIGATIONS][-1]["dominated"])
        # If a stopped run is resumed, its result replaces the front and drops the new point.
        if out is None and (dominates or (read_run(folder / RUN).get("status") in STOPPED and can_resume(folder))):
            place, count = folder.with_name(f"{folder.name}-point-{choice.id}"), 1
            while place.exists():
                count += 1
                place = folder.with_name(f"{folder.name}-point-{choice.id}-{count}")
        moved.save(place)
        # Draw the pictures of the run again.
        from paretoik.review.pictures.certificates import certificates_picture  # here: matplotlib loads slowly
        from paretoik.review.pictures.fronts import front_picture

        if (folder / PICTURE).exists():
            front_picture(moved, place / PICTURE, choice)
        if (folder / CERTIFICATES).exists():
            certificates_picture(moved, place / CERTIFICATES)
    if (folder / RECORDING).exists():
        from paretoik.review.drawing.choice_layer import show_choice_in_recording  # here: Rerun loads slowly

        show_choice_in_recording(moved, moved=choice, source=folder / RECORDING)
    return moved, choice, place
