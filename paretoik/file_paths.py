"""Paths and commands in messages."""

from __future__ import annotations

import os
import shlex
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path, PurePath

from paretoik.inputs import likely_spelling


def shell_command(*words: str | PurePath) -> str:
    """Return a command in one line, quoted for POSIX shells.

    A path is never read as an option. Control characters are escaped, so a shell does not find a path that has them.

    >>> print(shell_command("paretoik", "show", PurePath("-x y")))
    paretoik show './-x y'
    """
    options = [isinstance(word, PurePath) and str(word).startswith("-") for word in words]
    command = shlex.join(
        f"./{word}" if is_option else str(word) for word, is_option in zip(words, options, strict=True)
    )
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in command)


def missing_file(path: Path) -> str:
    """Return the reason why there is no plain file at a path.

    It is the first missing part of the path, or the kind of thing that is there instead. A relative path is relative to
    the current folder, whose name is shown. If a similar name exists in the same folder, the reason ends with a
    question that suggests it. Only names of the same kind, file or folder, are compared, without their endings.
    """
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        missing = path
        while missing.parent != missing and not os.path.lexists(missing.parent):
            missing = missing.parent
        folder, is_folder = missing.parent, missing != path
        if not folder.is_dir():
            return f"a path through {folder}, which is not a folder"
        names = list[str]()
        with suppress(OSError):  # it cannot be read
            names += [each.name for each in folder.iterdir() if each.is_dir() == is_folder]
        what = f"no folder {missing}" if is_folder else "no such file"
        place = "" if path.is_absolute() else f" in {Path.cwd()}"
        near = [name for name in names if get_close_matches(missing.stem, [Path(name).stem])]
        return f"{what}{place}{likely_spelling(missing.name, near)}"
    except (OSError, ValueError) as fault:  # the path is too long, not readable, or has invalid characters
        return f"a path that cannot be followed: {getattr(fault, 'strerror', None) or fault}"
    kind = "a folder" if path.is_dir() else "something else"
    if path.is_symlink():
        return f"a link to {kind}" if path.is_dir() else "a link" if path.exists() else "a link that leads to nothing"
    return kind
