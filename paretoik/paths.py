"""Messages about a path without a file: the part that is missing, and a similar name that may be meant."""

from __future__ import annotations

import os
import shlex
import sys
from contextlib import suppress
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import islice
from pathlib import Path, PurePath
from string import ascii_letters, digits

from paretoik.inputs import likely_spelling

# Printed commands: a user who pastes one into a shell runs exactly that, even if names have special characters.


PLAIN = f"{ascii_letters}{digits} /._,=:+@"


def shell_command(*words: str | PurePath) -> str:
    r"""Return a command in a line, quoted for POSIX shells; a path is never taken for an option.

    Characters that a line, or this terminal, cannot show are written by `printf` in octal.

    >>> print(shell_command("paretoik", "show", PurePath("-x y")))
    paretoik show './-x y'
    >>> print(shell_command("paretoik", "show", PurePath("two\nlines")))
    paretoik show "$(printf 'two\012lines')"
    """
    return " ".join(_quoted(_path_text(word) if isinstance(word, PurePath) else word) for word in words)


def _path_text(path: PurePath) -> str:
    text = str(path)
    text = f"./{text}" if text.startswith("-") else text
    return f"{text}/" if text.endswith("\n") else text  # a shell drops newlines at the end of substituted output


def _quoted(word: str) -> str:
    return shlex.quote(word) if word.isprintable() and _can_be_printed(word) else f"\"$(printf '{_octal(word)}')\""


def _can_be_printed(word: str) -> bool:
    """Return whether stdout and stderr can both show a word: either may print the command."""
    try:
        for stream in (sys.stdout, sys.stderr):
            word.encode(getattr(stream, "encoding", None) or "utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _octal(word: str) -> str:
    """Return the bytes of a word as the format of `printf`, all but letters, digits and the like in octal."""
    content = word.encode("utf-8", "surrogateescape")
    return "".join(chr(byte) if chr(byte) in PLAIN else f"\\{byte:03o}" for byte in content)


# Messages about a path without a file.


@dataclass(frozen=True, kw_only=True)
class MissingFileOptions:
    """Limits of the search for a missing file.

    entries: most entries of a folder that are compared with the missing name
    longest: most characters of a missing part that a message shows
    """

    entries: int = 1000
    longest: int = 100


OPTIONS = MissingFileOptions()


def missing_file(path: Path) -> str:
    """Return in words why there is no plain file at a path: its first missing part, or what is there instead.

    A relative path is searched in the current folder, whose name is shown. A question suggests a similar name in the
    same folder, similar in more than its ending: a file for a file, a folder for a folder.
    """
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        return _missing_part(path)
    except (OSError, ValueError) as fault:  # too long, not readable, or with characters that no path has
        return f"a path that cannot be followed, {getattr(fault, 'strerror', None) or fault}"
    return _kind(path)


def _kind(path: Path) -> str:
    kind = "a folder" if path.is_dir() else "something else"
    if path.is_symlink():
        return f"a link to {kind}" if path.is_dir() else "a link" if path.exists() else "a link that leads to nothing"
    return kind


def _missing_part(path: Path) -> str:
    missing = path
    while missing.parent != missing and not os.path.lexists(missing.parent):
        missing = missing.parent
    folder = missing.parent
    if not folder.is_dir():
        return f"a path through {folder if _is_short(folder) else 'a part'}, which is no folder"
    what = "no such file" if missing == path else f"no folder {missing}" if _is_short(missing) else "no such folder"
    place = "" if path.is_absolute() else f" in {Path.cwd()}"
    names = _names(folder, folders=missing != path)
    near = [name for name in names if get_close_matches(missing.stem, [Path(name).stem])]
    return f"{what}{place}{likely_spelling(missing.name, near)}"


def _is_short(path: Path) -> bool:
    return len(str(path)) <= OPTIONS.longest


def _names(folder: Path, *, folders: bool) -> list[str]:
    """Return the names of a folder's files, or of its folders; none if it cannot be read."""
    with suppress(OSError), os.scandir(folder) as entries:
        return [each.name for each in islice(entries, OPTIONS.entries) if each.is_dir() == folders]
    return []
