"""What is recorded of a run, and its recorder, whose failure never stops the run.

A verb records in three lines, and none of them loads Rerun::

    recorder = Recorder(file, title=title, scene=SearchedFront(names=names, units=units, maximised=maximised))
    recorder.record(generation)  # whenever there is something to show
    recorder.finish(SearchEnd(front=front, choice=choice))

What is sent (scene, messages, end) are frozen dataclasses of this library that hold numbers, arms, motions or fronts,
and nothing of the user's own, such as functions or problems: they go to a child process, which draws them. Which class
draws them the scene says in ``drawn_by``, as "module:Class"; see ``recording_file.Drawing``. Messages that have a
``number`` are a series, of which evenly spread ones are kept where it grows long, the first and the last among them;
all others are kept.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeAlias, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Ids, Objectives, Values
from paretoik.formulations.protocol import Timeline
from paretoik.front.front import Choice, Front
from paretoik.review.recording.least_violating import LeastViolating
from paretoik.review.recording.recorded_point import RecordedPoint
from paretoik.review.recording.recording_process import (
    OPTIONS,
    Opening,
    RecorderOptions,
    RecordingProcess,
    cause_of,
    part_of,
)
from paretoik.review.recording.workcell import Workcell
from paretoik.robot.arm import Arm
from paretoik.user_warnings import warn_user

Population: TypeAlias = Float[np.ndarray, "individuals n_obj"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Generation:
    """One generation of a search: the objectives of its population and front in the user's own sign, the front's ids.

    ``hypervolume`` is in the product of the objectives' units; where it is None and there is a ``reference`` (n_obj,),
    the recording computes it, now and then where that takes long, and approximately above four objectives. ``failed``
    counts evaluations that gave no number. ``size`` is that of the whole front where ``front`` has but some of its
    points; ``points`` are the best of every objective and the compromise, now and then with their motions. A step of a
    closed loop has no hypervolume, but a point of its front, ``chosen``, that was taken. A step of an ε-sweep has all
    points so far for a population, and ``epsilon`` (n_obj,), the bounds under which it minimised, infinite for what was
    minimised; its ids are those of the sweep alone. A refined front has the front before it for a population, and
    ``origins`` (points, n_obj), where its points were there. Where there is no front, ``least_violating`` says
    what is broken.
    """

    number: int
    population: Population
    front: Objectives
    front_ids: Ids
    hypervolume: float | None = None
    reference: Values | None = None
    failed: int = 0
    size: int | None = None
    chosen: Values | None = None
    epsilon: Values | None = None
    origins: Objectives | None = None
    points: tuple[RecordedPoint, ...] = ()
    least_violating: LeastViolating | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchedStep:
    """The search for the step of a closed loop to a ``sample``, from the generation that it began with.

    ``objectives`` (generations, individuals, n_obj) are in the user's own sign and ``q`` (generations, individuals,
    dof) joint positions, NaN where a step failed; ``fronts`` are the individuals of each generation that none
    dominates, by their first objective, ``chosen`` (generations,) the one of it that the weights choose, −1 where there
    is none. ``target`` (3,) [m] is where the tool is to be.
    """

    sample: int
    arm: Arm
    objectives: Float[np.ndarray, "generations individuals n_obj"]
    q: Float[np.ndarray, "generations individuals dof"]
    fronts: Sequence[Int[np.ndarray, " _"]]
    chosen: Int[np.ndarray, " generations"]
    target: Float[np.ndarray, " 3"]


@runtime_checkable
class Scene(Protocol):
    """What a recording shows, and the class that draws it in the child process."""

    drawn_by: ClassVar[str]


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchedFront:
    """The scene of a search: names and units of the objectives, which are maximised, and what its generations are.

    ``workcell`` is where its motions are drawn, None where a problem has none.
    """

    drawn_by: ClassVar[str] = "paretoik.review.drawing.recording:Recording"
    names: tuple[str, ...]
    units: tuple[str, ...]
    maximised: tuple[bool, ...]
    timeline: Timeline = "generation"
    workcell: Workcell | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchEnd:
    """The end of a search: its ``front``, the ``choice`` and its motion.

    Without a front the generations are the steps of a closed loop, one to each sample of the motion, and some of them
    may be ``searched``; or nothing feasible was found, and ``least_violating`` is what comes nearest to it.
    """

    front: Front | None
    choice: Choice | None = None
    searched: Sequence[SearchedStep] = ()
    least_violating: LeastViolating | None = None

    def __post_init__(self) -> None:
        """Leave the problem behind: it may be the user's own."""
        if self.front is not None:
            object.__setattr__(self, "front", replace(self.front, problem=None))


class Recorder:
    """Lets a child process write ``file`` while a run goes on, a message at a time, and once more at its end.

    The run waits for nothing before ``finish``. What was recorded survives the death of the run, SIGKILL included: the
    child then finishes the file. A recording is a view of the run and not its archive: an error of it, Rerun missing,
    a full disk or a killed child included, gives one warning and ends the recording, never the run. With ``live`` a
    viewer shows it meanwhile; ``notify`` is told in a line how to attach one where there is no screen.
    """

    def __init__(
        self,
        file: Path | str,
        *,
        title: str,
        scene: Scene,
        live: bool = False,
        notify: Callable[[str], object] | None = None,
        options: RecorderOptions = OPTIONS,
    ) -> None:
        self._file = Path(file)
        self._notify = _print_notice if notify is None else notify
        self._process: RecordingProcess | None = None
        self._failed = False
        self._latest: Any = None  # of a thinned series, not sent
        opening = Opening(file=str(self._file.absolute()), title=title, scene=scene, live=live, options=options)

        def start() -> None:
            self._process = RecordingProcess(options, self._notify)
            self._process.send("open", opening)

        self._attempt(start)

    def record(self, message: Any) -> None:
        """Add a message to the recording, or keep it back where the series is thinned."""
        process, number = self._process, getattr(message, "number", None)
        if process is None or self._failed:
            return
        if number is None:
            self._attempt(lambda: process.send("record", message))
        elif process.wants(number):
            self._latest = None
            self._attempt(lambda: process.send("record", message, number))
        else:
            self._latest = message
            self._attempt(process.pump)

    def finish(self, end: Any) -> None:
        """Complete the file with the `end` of the run, and wait until that is done."""
        process = self._process
        if process is None or self._failed:
            return
        if self._latest is not None:
            self._attempt(lambda: process.send("record", self._latest))
            self._latest = None
        self._attempt(lambda: process.complete(end))

    def close(self) -> None:
        """Complete the file with what it has, unless it is finished, and end the child."""
        process = self._process
        if process is None:
            return
        try:
            if not process.finished:
                self.finish(None)
            if not process.finished and not process.stopped:  # what failed here is no reason to lose what is there
                self._attempt(lambda: process.complete(None))
        finally:
            process.stop()
            part_of(self._file, os.getpid()).unlink(missing_ok=True)
            self._process = None

    def _attempt(self, step: Callable[[], None]) -> None:
        try:
            step()
        except Exception as fault:  # a view may fail in any way; the run that it looks at must not
            if not self._failed:
                self._failed = True
                text = f"{self._file}: recording stopped, the run goes on: {cause_of(fault)}"
                warn_user(text)


def _print_notice(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
