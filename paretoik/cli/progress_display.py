"""Progress on stderr: a bar on a terminal, else a line now and then."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console

from paretoik.compilation_notices import observe_compilation

if TYPE_CHECKING:
    from paretoik.api.progress import Observer, RunProgress


@contextmanager
def show_progress(time_limit: float | None, quiet: bool) -> Iterator[Observer | None]:
    """Yield an observer that draws a bar on stderr, or, where that is no terminal, prints a line now and then."""
    console = Console(stderr=True)
    if quiet:
        with observe_compilation(lambda notice: None):
            yield None
    elif console.is_terminal:
        from rich import progress as rich

        bar = rich.Progress(rich.BarColumn(), rich.TextColumn("{task.description}"), console=console, transient=True)
        job = bar.add_task("loading", total=None)
        with bar, observe_compilation(lambda notice: bar.update(job, description=str(notice))):
            yield lambda progress: bar.update(
                job,
                completed=progress.done,
                total=progress.total or None,
                description=progress_text(progress, time_limit),
            )
    else:
        yield _LinePrinter(time_limit)


class _LinePrinter:
    """Prints a line of progress on stderr, at most one in ``interval`` [s]."""

    def __init__(self, time_limit: float | None, interval: float = 5.0) -> None:
        self.time_limit, self.interval, self.due = time_limit, interval, 0.0

    def __call__(self, progress: RunProgress) -> None:
        now = time.monotonic()
        if now >= self.due or progress.stage == "compilation":
            self.due = now + self.interval
            print(progress_text(progress, self.time_limit), file=sys.stderr, flush=True)


def progress_text(progress: RunProgress, time_limit: float | None = None) -> str:
    """Return progress in a line: what is done of what, what there is so far, and the time left at most.

    >>> from paretoik.api.progress import RunProgress
    >>> progress_text(RunProgress(stage="step", done=3, total=12, seconds=60.0, summary="front 9"))
    'step 3/12, front 9, at most 3:00 left'
    """
    if progress.total == 0:
        return progress.summary or progress.stage
    remaining = progress.seconds / max(progress.done, 1) * (progress.total - progress.done)
    if time_limit is not None:
        remaining = min(remaining, max(time_limit - progress.seconds, 0.0))
    minutes, seconds = divmod(round(remaining), 60)
    parts = [f"{progress.stage} {progress.done}/{progress.total}", progress.summary]
    return ", ".join([*filter(None, parts), f"at most {minutes}:{seconds:02} left"])
