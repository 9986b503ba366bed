"""The progress of a verb: the record that every verb shows its observer."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from signal import SIGUSR1
from typing import TypeAlias

from paretoik.compilation_notices import computing_clock, observe_compilation, print_line
from paretoik.errors import InvalidInput
from paretoik.inputs import attribute_of, check_function, user_function
from paretoik.review.recording.recorder import Generation
from paretoik.runs.interruption import time_left
from paretoik.stop_flag import STOP


@dataclass(frozen=True, kw_only=True, eq=False)
class RunProgress:
    """The progress of a verb in its current stage.

        stage: name of what is counted, or of a stage without counts (see below)
        done: number of items done
        total: most items to do, 0 for a stage without counts
        seconds: time since the stage began [s], without compilation
        remaining: estimated time until the verb ends [s], None if unknown
        summary: state so far in words; the objective in the stage "optimum"
        generation: points of a generation or step, None in other stages
        then: name of the next stage if ``remaining`` does not count it, "" in the last stage
        following: names of the next stages if ``remaining`` counts them, "" in the last stage

    Counted are each "generation" of a search, "step" of a closed loop, "sample" that the levels of a plan have reached,
    "optimum" (start or sample of an objective's own plan), "point" of an ε-front, and in "refinement", "tightening" (of
    limits between samples), "certification" and "verification" the points of a front. A search with ``refine`` counts
    "optimum" and "point" after its points are refined. Stages without counts are "beginning", "compilation", "saving"
    and "recording".
    """

    stage: str
    done: int = 0
    total: int = 0
    seconds: float = 0.0
    remaining: float | None = None
    summary: str = ""
    generation: Generation | None = None
    then: str = ""
    following: str = ""


Observer: TypeAlias = Callable[[RunProgress], object]


def count_observer(
    observe: Observer | None,
    stage: str,
    *,
    later: Callable[[], float] | None = None,
    uniform: bool = False,
    then: str = "",
    following: str = "",
) -> Callable[..., object] | None:
    """Return a function (done, total, summary="") that shows counts to an observer; None without one.

    If all items of the stage take about the same time (``uniform``), the observer also learns how long the verb will
    take: this stage, and the stages ``following``, which take ``later()`` seconds for each of ``total``.
    """
    if observe is None:
        return None
    started = computing_clock()

    def show(done: int, total: int, summary: str = "") -> object:
        seconds = computing_clock() - started
        after = later() * total if later is not None else 0.0
        return observe(
            RunProgress(
                stage=stage,
                done=done,
                total=total,
                seconds=seconds,
                remaining=time_left(done, total - done, seconds, after) if uniform else None,
                summary=summary,
                then=then,
                following=following,
            )
        )

    return show


def show_compilation(observe: Observer) -> AbstractContextManager[None]:
    """Return a context that shows an observer what is compiled in its body, instead of a line on stderr."""
    return observe_compilation(lambda notice: observe(RunProgress(stage="compilation", summary=str(notice))))


# Progress on stderr: a bar on a terminal, else lines.


@contextmanager
def open_observer(observe: Observer | bool | None, *, time_limit: float | None = None) -> Iterator[Observer | None]:
    """Yield the observer of a verb, which also learns what is compiled.

    By default this is a bar if stderr is a terminal, else one line per minute, from the first minute on. With True this
    is that bar, or else lines at once; with False nothing. An observer that raises asks the verb to stop, as a
    signal does, so that what was found is kept; at the end of the body InvalidInput names the observer. Raises
    InvalidInput for an observer that cannot be called.
    """
    if observe is None or observe is True:
        if sys.stderr is not None and sys.stderr.isatty():
            with _bar(time_limit) as bar, show_compilation(bar):
                yield bar
            return
        observe = _LinePrinter(time_limit) if observe else _LinePrinter(time_limit, interval=60.0, patient=True)
    elif observe is False:
        with observe_compilation(lambda notice: None):
            yield None
        return
    check_function("observe", observe)
    named = NamedObserver(observe)
    try:
        with show_compilation(named):
            yield named
    finally:
        if named.fault is not None:
            STOP[0] = 0
            raise named.fault


class NamedObserver:
    """A user's observer; ``fault`` is the named error that it raised, which ends it."""

    def __init__(self, observe: Observer) -> None:
        self._observe = observe
        self.fault: InvalidInput | None = None

    @property
    def is_due(self) -> bool:
        """Whether the observer would report something now."""
        return self.fault is None and bool(attribute_of(self._observe, "is_due", True))

    def __call__(self, progress: RunProgress) -> object:
        """Call the observer; if it raises, ask the verb to stop."""
        if self.fault is not None:
            return None
        try:
            with user_function("observe", InvalidInput):
                return self._observe(progress)
        except InvalidInput as fault:
            self.fault, STOP[0] = fault, STOP[0] or SIGUSR1
            return None


@contextmanager
def _bar(time_limit: float | None) -> Iterator[Observer]:
    """Yield an observer that draws a bar on stderr while the body runs."""
    from rich import progress as rich  # here: it takes a while, and only terminals need it
    from rich.console import Console

    bar = rich.Progress(
        rich.BarColumn(), rich.TextColumn("{task.description}"), console=Console(stderr=True), transient=True
    )
    job = bar.add_task("beginning", total=None)

    def show(progress: RunProgress) -> None:
        text = progress_text(progress, time_limit)
        bar.update(job, completed=progress.done, total=progress.total or None, description=text)

    with bar:
        yield show


class _LinePrinter:
    """Prints progress on stderr: of counted stages at most one line per ``interval`` [s].

    A patient printer also waits for this time before its first line, and prints only compilation of other stages.
    """

    def __init__(self, time_limit: float | None, interval: float = 5.0, *, patient: bool = False) -> None:
        self.time_limit, self.interval, self.patient = time_limit, interval, patient
        self.due = time.monotonic() + interval if patient else 0.0

    @property
    def is_due(self) -> bool:
        """Whether a counted stage would be printed now; always True if not patient."""
        return not self.patient or time.monotonic() >= self.due

    def __call__(self, progress: RunProgress) -> None:
        now = time.monotonic()
        uncounted = progress.stage == "compilation" or (not progress.total and not self.patient)
        if uncounted or now >= self.due:
            self.due = now + self.interval if progress.total else self.due
            print_line(progress_text(progress, self.time_limit))


def progress_text(progress: RunProgress, time_limit: float | None = None) -> str:
    """Return progress as one line: counts, the state so far, and the time left.

    For a search or loop the time left is an upper bound from the part that is done. Otherwise it is the estimate of the
    verb, or the time so far without an estimate. When a stage is done, the time left is that of the following stages.

    >>> from paretoik.api.progress import RunProgress
    >>> progress_text(RunProgress(stage="step", done=3, total=12, seconds=60.0, summary="front 9"))
    'step 3/12, front 9, at most 3:00 left'
    >>> progress_text(RunProgress(stage="refinement", done=3, total=12, seconds=60.0, remaining=200.0))
    'refinement 3/12, about 3:20 left'
    >>> progress_text(RunProgress(stage="point", done=12, total=12, remaining=62.0, following="certification"))
    'point 12/12, 0:00 so far, then certification, about 1:02'
    """
    if progress.total == 0:
        return progress.summary or progress.stage
    parts = [f"{progress.stage} {progress.done}/{progress.total}", progress.summary, _duration(progress, time_limit)]
    is_done = progress.done >= progress.total
    after = progress.then or (progress.following if is_done else "")
    if after and not progress.then and progress.remaining is not None:
        after += f", about {_minutes(progress.remaining)}"
    return ", ".join([*filter(None, parts), *([f"then {after}"] if after else [])])


def _duration(progress: RunProgress, time_limit: float | None) -> str:
    """Return the time left of a stage, or its time so far if nothing is left or the time left is unknown."""
    if progress.done >= progress.total:
        return f"{_minutes(progress.seconds)} so far"
    if progress.stage in ("generation", "step"):
        remaining = progress.seconds / max(progress.done, 1) * (progress.total - progress.done)
        if time_limit is not None:
            remaining = min(remaining, max(time_limit - progress.seconds, 0.0))
        return f"at most {_minutes(remaining)} left"
    if progress.remaining is None:
        return f"{_minutes(progress.seconds)} so far"
    return f"about {_minutes(progress.remaining)} left"


def _minutes(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    return f"{minutes}:{seconds:02}"
