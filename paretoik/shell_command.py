"""Commands as they are printed: whoever pastes one into a shell runs just that, whatever its files are called."""

from __future__ import annotations

import shlex
import sys
from pathlib import PurePath
from string import ascii_letters, digits

PLAIN = f"{ascii_letters}{digits} /._,=:+@"


def shell_command(*words: str | PurePath) -> str:
    r"""Return a command in a line, quoted for POSIX shells; a path is never taken for an option.

    What no line, or not this terminal, can hold is written by `printf` in octal.

    >>> print(shell_command("paretoik", "show", PurePath("-x y")))
    paretoik show './-x y'
    >>> print(shell_command("paretoik", "show", PurePath("two\nlines")))
    paretoik show "$(printf 'two\012lines')"
    """
    return " ".join(_quoted(_path_text(word) if isinstance(word, PurePath) else word) for word in words)


def _path_text(path: PurePath) -> str:
    text = str(path)
    text = f"./{text}" if text.startswith("-") else text
    return f"{text}/" if text.endswith("\n") else text  # substituted output loses the newlines at its end


def _quoted(word: str) -> str:
    return shlex.quote(word) if word.isprintable() and _can_be_printed(word) else f"\"$(printf '{_octal(word)}')\""


def _can_be_printed(word: str) -> bool:
    """Say whether both stdout and stderr have the letters of a word: where a command goes is not known here."""
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
