"""Write the report of a run or front as one self-contained page."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from paretoik.api.load import load_front, named_problem, with_problem
from paretoik.api.result import ENTRY, read_stored_motions
from paretoik.api.result_text import gap_text, status_text
from paretoik.errors import InvalidInput, InvalidRun
from paretoik.file_paths import shell_command
from paretoik.formulations.protocol import describe, is_loop
from paretoik.front.certificates import certificate_text
from paretoik.front.choice import list_words
from paretoik.front.front import Front
from paretoik.front.points import StoredMotions, attach, confirmation_text
from paretoik.inputs import check_flag, file_path, shown
from paretoik.review.palette import objective_label
from paretoik.review.report import Report, Steps
from paretoik.review.words import describe_limits_between
from paretoik.runs.files import (
    NEAREST,
    PAGE_MARK,
    REPORT,
    RUN,
    STEPS,
    check_digest,
    check_target,
    is_run,
    read_plain_file,
    read_run,
    read_table,
)

STEP_PARTS = ("chosen", "best", "worst")  # columns of a closed loop's table of steps


def report(
    front: Front | Path | str, file: Path | str | None = None, *, overwrite: bool = False, problem: Any = None
) -> Path:
    """Write a report of a front or run as one HTML page.

    Parameters
    ----------
    front
        Front, or folder of a run.
    file
        Path of the page; default: report.html in the folder of the run that the front was loaded from or saved into.
    overwrite
        Whether to replace a file that is not a report (default False); a report is always replaced.
    problem
        Problem of a folder's run or its name, as for ``load_front``.

    Returns
    -------
    Path
        Path of the page.

    Raises
    ------
    InvalidInput
        If ``file`` is missing for a front without a folder, ``problem`` comes with a front, or writing fails.
    InvalidRun
        If the folder contains no run with a front, or a damaged one.

    Notes
    -----
    The page has at most 5 MB and needs no network. It shows the front with ids, the motion of every point if there is
    room, certificates, exchange rates, choices, settings and versions, and the steps of a closed loop. For a run
    without a feasible motion it says why, and shows the least-violating motion and what it violates.
    """
    infeasible: InfeasibleRun | None = None
    if not isinstance(front, Front):
        folder, problem = file_path("front", front), named_problem(problem)
        holds = read_run(folder / RUN).get("holds") if is_run(folder / RUN) else None
        if holds is not None:
            command = shell_command("paretoik", "show", folder)
            raise InvalidRun(f"{folder} must be a run with a front, got one that contains {holds}; {command} shows it")
        infeasible = read_infeasible(folder)
        if infeasible is None:
            front = load_front(folder, problem)
        else:
            front = attach(with_problem(infeasible.nearest, folder, problem), folder)
    elif problem is not None:
        raise InvalidInput(f"problem must come with a run folder only, got {shown(problem)} with a front")
    if file is not None:
        place = file_path("file", file)
    elif front.folder is not None:
        place = front.folder / REPORT
    else:
        raise InvalidInput("file must be given for a front without a folder, got none")
    check_flag("overwrite", overwrite)
    check_target("report", place, overwrite=overwrite, mark=PAGE_MARK)
    if infeasible is None:
        names, steps = list_words(front.names), _steps(front, front.folder)
        title = f"The front of {names}" if len(front.names) > 1 else f"The optimum of {names}"
        title = f"A closed loop by {names}" if is_loop(front) else title
        page = Report(
            front=front, title=title, solved=_solved(front), choices=front.choices, notes=_notes(front), steps=steps
        )
    else:
        reason = infeasible.reason[:1].upper() + infeasible.reason[1:]
        notes = [reason, *(f"In the least-violating motion, {words}." for words in infeasible.broken)]
        page = Report(front=front, title="No feasible motion", solved=_solved(front), notes=notes, nearest=True)
    page.write(place)
    return place


# Runs that found nothing feasible.


class InfeasibleRun(NamedTuple):
    """A run that found nothing feasible: its reason, violated constraints and least-violating point, if any."""

    reason: str
    broken: tuple[str, ...]
    nearest: Front


def read_infeasible(folder: Path) -> InfeasibleRun | None:
    """Return a run that found nothing feasible, None for other runs; raises InvalidRun if it is damaged."""
    run = read_run(folder / RUN) if is_run(folder / RUN) else {}
    # A signal may have ended the run before its infeasibility was certain.
    if run.get("status") != "Infeasible" and (ENTRY not in run or "files" in run):
        return None
    check_digest(folder / RUN, run)
    reason, entry = str(run.get("reason", "")), run.pop(ENTRY, {"broken": [], "objectives": []})
    try:
        objectives = list(entry["objectives"]) or [{"name": "objective", "unit": "", "maximised": False, "value": None}]
        values = np.array([each["value"] for each in objectives], dtype=float)  # NaN without a point
        count, motions = int(np.isfinite(values).all()), None
        if "digest" in entry and count:
            motions = read_stored_motions(folder / NEAREST, entry["digest"], np.zeros(1, dtype=int))
        nearest = Front(
            ids=np.arange(count),
            objectives=values[None][:count],
            names=[str(each["name"]) for each in objectives],
            units=[str(each["unit"]) for each in objectives],
            maximised=[bool(each["maximised"]) for each in objectives],
            motions=motions,
            provenance={name: value for name, value in run.items() if name not in ("format", "reason")},
        )
        return InfeasibleRun(reason=reason, broken=tuple(map(str, entry["broken"])), nearest=nearest)
    except InvalidRun:
        raise
    except (KeyError, TypeError, ValueError, AttributeError) as fault:
        raise InvalidRun(f"{folder / RUN} must have a valid entry {ENTRY!r}, got: {fault}") from fault


# Parts of a page.


def _solved(front: Front) -> str:
    """Return what was solved as text: the stored description, else the problem's, else the objectives."""
    if (stored := front.provenance.get("solved")) is not None:
        return str(stored)
    if front.problem is not None:
        return describe(front.problem)
    return "objectives  " + ", ".join(map(objective_label, front.names, front.units, front.maximised))


def _notes(front: Front) -> list[str]:
    """Return the summary sentences about a front."""
    notes = [status_text(front)] if "counts" in front.provenance else []
    if front.certificates is not None:
        notes.append(certificate_text(front.certificates))
    if isinstance(front.motions, StoredMotions):
        notes.append(
            "Motions have joint positions only, because the problem is not given: "
            "pk.report(folder, problem=problem), or --problem FILE.py:NAME, shows the rest."
        )
    return [
        note
        for note in (*notes, confirmation_text(front.provenance), gap_text(front), describe_limits_between(front))
        if note
    ]


def _steps(front: Front, folder: Path | None) -> Steps | None:
    """Return the choices of a closed loop at every step, None for other runs."""
    if folder is None or not is_loop(front) or not (folder / STEPS).is_file():
        return None
    from pyarrow import ArrowException

    try:
        table = read_table(read_plain_file(folder / STEPS))
        parts = [np.stack([table[f"{part} {name}"] for name in front.names], axis=1) for part in STEP_PARTS]
        return Steps(times=np.asarray(table["time"]), chosen=parts[0], best=parts[1], worst=parts[2])
    except (ArrowException, KeyError, ValueError, OSError) as fault:
        raise InvalidRun(f"{folder / STEPS} must contain the steps of a closed loop, got: {fault}") from fault
