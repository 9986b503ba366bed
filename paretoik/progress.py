"""The progress of a verb: its record, and its display on stderr."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from signal import SIGUSR1
from typing import Any, TypeAlias

from paretoik.compilation_notices import CompilationNotice, computing_clock, observe_compilation, print_line
from paretoik.errors import InvalidInput
from paretoik.inputs import attribute_of, check_function, user_function
from paretoik.stop_flag import STOP


@dataclass(frozen=True, kw_only=True, eq=False)
class RunProgress:
    """The progress of a verb in its current stage.

        stage: name of the counted items, or of a stage without counts (see below)
        done: number of items done
        total: maximum number of items, 0 for a stage without counts
        seconds: time since the stage began [s], without compilation
        remaining: estimated time until the verb ends [s], None if unknown
        summary: state so far in words; the objective in the stage "optimum"
        generation: points of a generation or step (``review.recording.recorder.Generation``), None in other stages
        then: name of the next stage if ``remaining`` excludes its time, "" in the last stage
        following: names of the next stages if ``remaining`` includes their times, "" in the last stage

    Stages with counts:

    - "generation": generations of a search
    - "step": steps of a closed loop
    - "sample": samples that the levels of a plan have reached
    - "optimum": starts or samples of the plan for one objective's optimum
    - "point": points of an ε-front
    - "refinement", "tightening" (of limits between samples), "certification", "verification": points of a front

    A search with ``refine`` counts "optimum" and "point" after the refinement of its points. Stages without counts are
    "beginning", "compilation", "saving" and "recording".
    """

    stage: str
    done: int = 0
    total: int = 0
    seconds: float = 0.0
    remaining: float | None = None
    summary: str = ""
    generation: Any = None
    then: str = ""
    following: str = ""


Observer: TypeAlias = Callable[[RunProgress], object]


def is_due(observe: Observer | None) -> bool:
    """Return whether an observer exists and would report something now.

    If not, the caller need not compute anything for it.
    """
    return observe is not None and bool(attribute_of(observe, "is_due", True))


# Estimates of a verb's remaining time, made once enough of its stage is done.


@dataclass(frozen=True, kw_only=True)
class TimeLeftOptions:
    """Least progress of a stage before its time is estimated.

    share: share of the stage that is done
    seconds: time since the stage began [s]
    """

    share: float = 0.1
    seconds: float = 0.5


OPTIONS = TimeLeftOptions()


def time_left(done: float, left: float, seconds: float, later: float = 0.0) -> float | None:
    """Return the remaining time [s], None if too little is done.

    done: work done in the stage
    left: work left in the stage
    seconds: time that the work done took
    later: time of the following stages [s]
    """
    if done <= 0 or done < OPTIONS.share * (done + left) or seconds < OPTIONS.seconds:
        return None
    return seconds / done * left + later


def count_observer(
    observe: Observer | None,
    stage: str,
    *,
    later: Callable[[], float] | None = None,
    uniform: bool = False,
    then: str = "",
    following: str = "",
) -> Callable[..., object] | None:
    """Return a function (done, total, summary="") that shows counts to an observer, or None without one.

    later: function that returns the seconds of the following stages per item
    uniform: whether items take about the same time; then the remaining time is estimated
    then, following: next stages, as in ``RunProgress``
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


# Progress on stderr: a bar on a terminal, else lines.


@contextmanager
def open_observer(observe: Observer | bool | None, *, time_limit: float | None = None) -> Iterator[Observer | None]:
    """Yield the observer of a verb; it is also told of compilations.

    - None: a bar if stderr is a terminal, else one line per minute after the first minute
    - True: a bar if stderr is a terminal, else lines at once
    - False: no observer

    If an observer raises an error, the verb stops as after a signal and keeps its result; the body then ends with
    InvalidInput, which names the observer. Raises InvalidInput for an observer that cannot be called.
    """
    shown: Observer | None
    with ExitStack() as stack:
        if observe is False:
            shown = None
        elif observe is not None and observe is not True:
            check_function("observe", observe)
            shown = stack.enter_context(NamedObserver(observe))
        elif sys.stderr is not None and sys.stderr.isatty():
            shown = stack.enter_context(_bar(time_limit))
        else:
            shown = _LinePrinter(time_limit, patient=observe is None)
        if not isinstance(shown, _LinePrinter):  # other observers show compilations, so stderr gets no lines about them

            def show_compilation(notice: CompilationNotice) -> None:
                if shown is not None:
                    shown(RunProgress(stage="compilation", summary=str(notice)))

            stack.enter_context(observe_compilation(show_compilation))
        yield shown


class NamedObserver:
    """A user's observer; ``fault`` is the error that it raised.

    It is not called again after a fault. The fault is raised at the end, with the observer's name.
    """

    def __init__(self, observe: Observer) -> None:
        self._observe = observe
        self.fault: InvalidInput | None = None

    @property
    def is_due(self) -> bool:
        """Whether the observer would report something now."""
        return self.fault is None and is_due(self._observe)

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

    def __enter__(self) -> NamedObserver:
        return self

    def __exit__(self, *error: object) -> None:
        if self.fault is not None:
            STOP[0] = 0
            raise self.fault


@contextmanager
def _bar(time_limit: float | None) -> Iterator[Observer]:
    """Yield an observer that draws a bar on stderr."""
    from rich import progress as rich  # here: it loads slowly, and only terminals need it
    from rich.console import Console

    columns = rich.BarColumn(), rich.TextColumn("{task.description}")
    with rich.Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        job = bar.add_task("beginning", total=None)

        def show(progress: RunProgress) -> None:
            text = progress_text(progress, time_limit)
            bar.update(job, completed=progress.done, total=progress.total or None, description=text)

        yield show


class _LinePrinter:
    """Prints progress on stderr, at most every few seconds for counted stages.

    If ``patient``, it prints one line a minute, the first after a minute, and no stages without counts.
    """

    def __init__(self, time_limit: float | None, *, patient: bool) -> None:
        self.time_limit, self.patient, self.interval = time_limit, patient, 60.0 if patient else 5.0
        self.due = time.monotonic() + self.interval if patient else 0.0

    @property
    def is_due(self) -> bool:
        """Whether a counted stage is printed now; always True if not patient."""
        return not self.patient or time.monotonic() >= self.due

    def __call__(self, progress: RunProgress) -> None:
        now = time.monotonic()
        if now >= self.due or not (progress.total or self.patient):
            self.due = now + self.interval if progress.total else self.due
            print_line(progress_text(progress, self.time_limit))


def progress_text(progress: RunProgress, time_limit: float | None = None) -> str:
    """Return progress as one line: counts, state, and remaining time.

    For a search or loop the time left is an upper bound. Otherwise it is the verb's estimate; without an estimate, the
    time so far is shown. When a stage is done, the time of the following stages is shown.

    >>> from paretoik.progress import RunProgress
    >>> progress_text(RunProgress(stage="step", done=3, total=12, seconds=60.0, summary="front 9"))
    'step 3/12, front 9, at most 3:00 left'
    >>> progress_text(RunProgress(stage="refinement", done=3, total=12, seconds=60.0, remaining=200.0))
    'refinement 3/12, about 3:20 left'
    >>> progress_text(RunProgress(stage="point", done=12, total=12, remaining=62.0, following="certification"))
    'point 12/12, 0:00 so far, then certification, about 1:02'
    """
    if progress.total == 0:
        return progress.summary or progress.stage
    done, left, seconds = progress.done, progress.total - progress.done, progress.seconds
    time_words = f"{_minutes(seconds)} so far"
    if left > 0 and progress.stage in ("generation", "step"):
        remaining = seconds / max(done, 1) * left
        if time_limit is not None:
            remaining = min(remaining, max(time_limit - seconds, 0.0))
        time_words = f"at most {_minutes(remaining)} left"
    elif left > 0 and progress.remaining is not None:
        time_words = f"about {_minutes(progress.remaining)} left"
    after = progress.then or (progress.following if left <= 0 else "")
    if after and not progress.then and progress.remaining is not None:
        after += f", about {_minutes(progress.remaining)}"
    parts = (f"{progress.stage} {done}/{progress.total}", progress.summary, time_words, after and f"then {after}")
    return ", ".join(filter(None, parts))


def _minutes(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    return f"{minutes}:{seconds:02}"
