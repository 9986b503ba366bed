"""The run that a new one replaces: set aside, and put back unless the new one comes to a result.

Its files move into `.former-run`, a folder within the run's own. While they move, either way, that is called
`.former-run.part`, and whatever is in it belongs back. So at every moment, should the process be killed, the next one
knows which of both runs is whole. Whoever calls these functions holds the folder's lock.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path

from paretoik.file_replacement import SAVED
from paretoik.run_files import CONTENTS, FORMER, can_resume, has_result

PART = f"{FORMER}.part"


def set_aside(place: Path) -> None:
    """Move the run in a folder into `.former-run` within it; one without a result, and nothing to go on, is removed."""
    if not (has_result(place) or can_resume(place)):
        remove_run(place)
        return
    part = place / PART
    part.mkdir()
    _move_run(place, part, reversed(CONTENTS))  # run.json last: a folder without is no run
    part.rename(place / FORMER)
    remove_run(place)  # what a killed writer left half written


def settle(place: Path) -> bool:
    """Remove the run that was set aside where the new one has a result, else put it back; say whether that was done."""
    former, part = place / FORMER, place / PART
    if _is_folder(former):
        if has_result(place):
            shutil.rmtree(former)
            return False
        remove_run(place)
        former.rename(part)
    if not _is_folder(part):
        return False
    _move_run(part, place, CONTENTS)
    part.rmdir()
    return True


def remove_run(place: Path) -> None:
    """Remove the files of a run from its folder, and nothing else."""
    for name in (*reversed(CONTENTS), SAVED):
        for entry in (place / name, *place.glob(f".{name.lstrip('.')}.*")):
            if _is_folder(entry):
                shutil.rmtree(entry)
            else:
                entry.unlink(missing_ok=True)


def _move_run(source: Path, target: Path, names: Iterable[str]) -> None:
    for name in names:
        if (source / name).exists() or (source / name).is_symlink():
            (source / name).rename(target / name)


def _is_folder(place: Path) -> bool:
    return place.is_dir() and not place.is_symlink()
