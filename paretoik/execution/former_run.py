"""The run that a new one replaces: set aside, and put back unless the new one comes to a result.

Its files move into `.former-run`, a folder within the run's own. While they move, either way, that is called
`.former-run.part`, and whatever is in it belongs back. So at every moment, should the process be killed, the next one
knows which of both runs is whole. Whoever calls these functions holds the folder's lock.
All of it goes by descriptors of folders: a link that takes the place of one meanwhile is not followed.
"""

from __future__ import annotations

import os
from fnmatch import fnmatchcase

from paretoik.file_replacement import SAVED, OpenFolder, is_plain_folder, move_files, plain_folder, remove
from paretoik.run_files import CONTENTS, FORMER, can_resume, has_result

PART = f"{FORMER}.part"


def set_aside(folder: OpenFolder) -> None:
    """Move the run in a folder into `.former-run` within it; one without a result, and nothing to go on, is removed."""
    if has_result(folder.path) or can_resume(folder.path):
        place = folder.descriptor
        os.mkdir(PART, dir_fd=place)
        with plain_folder(PART, within=place) as part:
            move_files(reversed(CONTENTS), place, part)  # run.json last: a folder without is no run
        os.rename(PART, FORMER, src_dir_fd=place, dst_dir_fd=place)
    remove_run(folder)  # what a killed writer left half written


def settle(folder: OpenFolder) -> bool:
    """Remove the run that was set aside where the new one has a result, else put it back; say whether that was done."""
    place = folder.descriptor
    if is_plain_folder(FORMER, place):
        if has_result(folder.path):
            remove(FORMER, place)
            return False
        remove_run(folder)
        os.rename(FORMER, PART, src_dir_fd=place, dst_dir_fd=place)
    if not is_plain_folder(PART, place):
        return False
    with plain_folder(PART, within=place) as part:
        move_files(CONTENTS, part, place)
    os.rmdir(PART, dir_fd=place)
    return True


def remove_run(folder: OpenFolder) -> None:
    """Remove the files of a run from its folder, and nothing else."""
    with os.scandir(folder.descriptor) as listing:
        entries = [each.name for each in listing]
    for name in (*reversed(CONTENTS), SAVED):
        for entry in (name, *(each for each in entries if fnmatchcase(each, f".{name.lstrip('.')}.*"))):
            remove(entry, folder.descriptor)
