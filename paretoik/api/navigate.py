"""Move along the front of a run: the run gains the new certified point."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from paretoik.api.load import load_front
from paretoik.api.session import verb_session
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
    """Return the front of a run with a new certified point, that point, and the folder that holds them now.

    That is the run itself, which loses nothing: where former points are dominated by the new one, they stay there and
    the new front goes into a folder beside it; so it does where the run was stopped and can be resumed, since what
    it comes to then replaces its front. ``out`` names another folder, ``overwrite`` replaces a run there;
    ``problem`` is as for ``load_front``, the other arguments are those of ``Front.navigate``.

    It moves from a ``point``, by default from the present choice of the run. Where the run has a recording, that of
    the folder opens on the present choice and the new point beside each other, or on the new point alone.

    Raises InvalidInput for a run or a folder that cannot be used, and as ``Front.navigate`` does.
    """
    folder = file_path("run", run)
    if out is not None:
        check_other_folder("out", file_path("out", out), folder)
    front = load_front(folder, problem)
    with verb_session(False), _place(folder, out, overwrite) as place:
        moved = front.navigate(point, improve=improve, allow=allow, hold=hold, by=by, to=to)
        choice = moved.navigated
        assert choice is not None  # a move leads somewhere or raises
        place = place if out is not None or not (_dominated(moved) or _goes_on(folder)) else _beside(folder, choice.id)
        moved.save(place)
        _draw(moved, folder, place)
    if (folder / RECORDING).exists():
        from paretoik.review.drawing.choice_layer import show_choice_in_recording  # here: Rerun takes its time

        show_choice_in_recording(moved, moved=choice, source=folder / RECORDING)
    return moved, choice, place


@contextmanager
def _place(folder: Path, out: str | Path | None, overwrite: bool) -> Iterator[Path]:
    """Lock the folder that the front is to be saved in."""
    if out is None:
        with lock_folder(folder):
            yield folder
        return
    with claim_folder(file_path("out", out), overwrite=overwrite) as place:
        yield place


def _dominated(front: Front) -> list[Any]:
    """Return the ids of points that the last move has dominated."""
    return list(front.provenance[NAVIGATIONS][-1]["dominated"])


def _goes_on(folder: Path) -> bool:
    """Return whether a run was stopped and can be resumed, which would drop a point that joined it."""
    return read_run(folder / RUN).get("status") in STOPPED and can_resume(folder)


def _beside(folder: Path, id: int) -> Path:
    """Return a folder beside a run that is not there yet."""
    place, count = folder.with_name(f"{folder.name}-point-{id}"), 1
    while place.exists():
        count += 1
        place = folder.with_name(f"{folder.name}-point-{id}-{count}")
    return place


def _draw(front: Front, folder: Path, place: Path) -> None:
    """Draw the pictures that the run had anew."""
    if (folder / PICTURE).exists():
        from paretoik.review.pictures.fronts import front_picture  # here: matplotlib takes its time

        front_picture(front, place / PICTURE, front.navigated)
    if (folder / CERTIFICATES).exists():
        from paretoik.review.pictures.certificates import certificates_picture

        certificates_picture(front, place / CERTIFICATES)
