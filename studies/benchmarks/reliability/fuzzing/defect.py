"""A wrong outcome of an input."""

from __future__ import annotations

import re
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from paretoik.errors import ParetoikError
from paretoik.inputs import cause_of
from studies.benchmarks.reliability.inputs.messages import message_faults


class Defect(Exception):  # noqa: N818  the name says what it is
    """An error that is not ours, a warning, or a bad message; its text is one line."""


@contextmanager
def refusals(*names: str) -> Iterator[None]:
    """Run the body: an error of ours that has one of the ``names`` is a refusal; raise Defect for others."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            yield
        except ParetoikError as refusal:
            check_message(str(refusal), *names)
        except Defect:
            raise
        except Exception as error:
            raise Defect(f"{cause_of(error)} in {_place(error)}") from error


def check_message(message: str, *names: str) -> None:
    """Raise Defect unless a message is one line with one of the ``names``, a wish and a fact."""
    faults = message_faults(message, is_named=any(name in message for name in names))
    if faults:
        raise Defect(f"{', '.join(faults)}: {' '.join(message.split())[:300]}")


def kind_of(defect: Defect) -> str:
    """Return a defect without its numbers and quotes: equal for inputs with the same defect."""
    return re.sub(r"'[^']*'|\"[^\"]*\"|/\S*|[\d.e+-]+", "~", str(defect))


def _place(error: BaseException) -> str:
    """Return the innermost line of ours that led to an error."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "paretoik" in Path(frame.filename).parts]
    return f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "no file of ours"
