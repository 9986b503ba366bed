"""How far a verb has come: the one record that every verb shows its observer."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeAlias

from paretoik.api.time_left import time_left
from paretoik.compilation_notices import computing_clock, observe_compilation
from paretoik.inputs import check_function
from paretoik.review.recording.recorder import Generation


@dataclass(frozen=True, kw_only=True, eq=False)
class RunProgress:
    """What has been done of a verb's present stage.

    ``stage`` says what is counted: "generation" of a search, "step" of a closed loop, "sample" to which the levels of a
    plan have come, "optimum" of the starts (or samples) of each objective's own plan, which ``summary`` names, "point"
    of an ε-front (or, both, of a search with ``refine`` once its points are refined), "refinement", "tightening" (of
    limits between samples),
    "certification" of a front's points and their "verification". ``done`` of at most ``total`` are done; a stage
    without counts ("beginning", "compilation", "saving", "recording") has a total of 0. ``seconds`` have passed since
    the stage began, those of compilation not counted, about ``remaining`` will until the verb ends; None where that
    cannot be told. ``summary`` says in words what there is so far; ``generation`` has the points of a generation or
    step, None in other stages. What comes after the stage is named by ``then`` where ``remaining`` does not count it,
    and by ``following`` where it does; both are "" before the end.
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
    """Return what tells an observer of counts (done, total, summary=""); None without one.

    If everything in the stage takes about as long (``uniform``), the observer learns about how long the verb will take:
    this stage, and what the stages ``following`` take for each of its ``total``, ``later()`` seconds.
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


@contextmanager
def show_compilation(observe: Observer | None) -> Iterator[None]:
    """Show an observer what is compiled while the body runs, in place of a line on stderr."""
    check_function("observe", observe)
    if observe is None:
        yield
        return

    with observe_compilation(lambda notice: observe(RunProgress(stage="compilation", summary=str(notice)))):
        yield
