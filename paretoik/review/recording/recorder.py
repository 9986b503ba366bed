"""The messages of a run's recording, and its recorder, whose failure never stops the run.

A run is recorded in three lines, and none of them loads Rerun::

    recorder = Recorder(file, title=title, scene=SearchedFront(names=names, units=units, maximised=maximised))
    recorder.record(generation)  # for every new state to show
    recorder.finish(SearchEnd(front=front, choice=choice))

The scene, the messages and the end go to a child process, which draws them (``recording_child``). They are frozen
dataclasses of this library with numbers, arms, motions or fronts, but nothing of the user's own, such as functions or
problems. Messages with a ``number`` are a series: if it grows long, evenly spread ones are kept,
including the first and the last. All other messages are kept.
"""

from __future__ import annotations

import copyreg
import fcntl
import json
import os
import pickle
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, NoReturn, TypeAlias

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Ids, Objectives, Values
from paretoik.errors import warn_user
from paretoik.formulations.protocol import Timeline
from paretoik.front.choice import Choice
from paretoik.front.front import Front
from paretoik.inputs import first_line
from paretoik.review.palette import screen_label
from paretoik.review.recording.messages import (
    LeastViolating,
    MaximaScene,
    PathScene,
    PlannedScene,
    RecordedPoint,
    ResolvedScene,
    Workcell,
)
from paretoik.robot.arm import Arm
from paretoik.runs.machine import child_command

# The recording process, as seen by its parent: messages go through a pipe, answers come back.
#
# The parent never waits: messages that do not fit into the pipe stay in a queue. The pipe is private to parent and
# child, so its messages may be pickled; nothing is unpickled from files, and the child answers in JSON.


Kind = Literal["open", "record", "end"]
HEADER = 8  # length of a message before its bytes, big-endian


@dataclass(frozen=True, kw_only=True)
class RecorderOptions:
    """Waiting times for the child process, and bounds on queue and file."""

    start: float = 60.0  # longest time for the child to start and load Rerun [s]
    silence: float = 120.0  # longest time without an answer; no drawing takes that long [s]
    queue: int = 64_000_000  # largest size of the messages that wait for the child [bytes]
    pipe: int = 1_000_000  # size of the pipe in the kernel [bytes]
    size: int = 40_000_000  # size of the file above which every second message of a series is dropped [bytes]
    points: int = 400  # largest number of drawn points of a front
    share: float = 0.1  # largest share of the child's time for drawing an unfinished run
    batch: int = 300_000  # size of a chunk of recorded data: small chunks make large files [bytes]
    tick: float = 0.25  # time between the child's checks of its parent and the viewer [s]
    niceness: int = 5  # niceness of the child, so that the run has priority


OPTIONS = RecorderOptions()


@dataclass(frozen=True, kw_only=True)
class Opening:
    """The first message: the file to write, its title and scene, and whether a viewer shows it live."""

    file: str
    title: str
    scene: Any
    live: bool
    options: RecorderOptions
    run: int  # id of the process that sends the messages


class RecordingStoppedError(Exception):
    """The child cannot continue; the text says why."""


class RecordingProcess:
    """A child process that makes one recording; methods raise RecordingStoppedError if it cannot continue."""

    def __init__(self, options: RecorderOptions, notify: Callable[[str], object]) -> None:
        self._options, self._notify = options, notify
        self._queue: deque[tuple[memoryview, bool]] = deque()  # messages, and whether they may be dropped
        self._offset, self._part = 0, b""  # sent bytes of the first message, received part of a line
        self._sent, self._answered, self._dropped, self.finished, self.stopped = 0, 0, 0, False, False
        self._full = False  # whether the pipe was full at the last write
        self._log = tempfile.TemporaryFile()  # noqa: SIM115  stderr of the child, read if it dies
        self._child = subprocess.Popen(
            child_command("paretoik.review.recording_child"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            bufsize=0,
            start_new_session=True,  # Ctrl-C in the terminal is for the run only
        )
        assert self._child.stdin is not None
        assert self._child.stdout is not None
        self._input, self._output = self._child.stdin, self._child.stdout
        for pipe in (self._input, self._output):
            os.set_blocking(pipe.fileno(), False)
        with suppress(AttributeError, OSError):  # not every system lets a pipe grow
            fcntl.fcntl(self._input, fcntl.F_SETPIPE_SZ, self._options.pipe)
        self._patience, self._silent_since = self._options.start, time.monotonic()

    def send(self, kind: Kind, message: Any) -> None:
        """Queue a message and fill the pipe; if the queue is too long, drop every second message of a series."""
        content = pickle_message((kind, message, self._dropped))
        if self._answered == self._sent:
            self._silent_since = time.monotonic()  # nothing needed an answer until now
        self._queue.append((content, hasattr(message, "number")))
        self._sent += 1
        if sum(len(each) for each, _ in self._queue) > self._options.queue:
            droppable = [place for place, (_, in_series) in enumerate(self._queue) if in_series and place]
            dropped = set(droppable[:-1:2])  # the first may be partly sent, the newest stays
            self._queue = deque(each for place, each in enumerate(self._queue) if place not in dropped)
            self._sent, self._dropped = self._sent - len(dropped), self._dropped + len(dropped)
        self.pump()

    def pump(self) -> None:
        """Write what fits into the pipe and read the child's answers, without waiting."""
        is_gone = False
        while self._queue:
            message, _ = self._queue[0]
            try:
                self._offset += os.write(self._input.fileno(), message[self._offset :])
            except BlockingIOError:
                self._full = True
                break
            except OSError:  # the child cannot read any more
                is_gone = True
                break
            if self._full:  # the child has read since then; it answers complete messages only
                self._full, self._silent_since = False, time.monotonic()
            if self._offset == len(message):
                self._queue.popleft()
                self._offset = 0
        with suppress(BlockingIOError):
            while content := os.read(self._output.fileno(), 65_536):
                self._part += content
        *lines, self._part = self._part.split(b"\n")
        for answer in map(json.loads, lines):
            self._silent_since, self._patience = time.monotonic(), self._options.silence
            self._answered += answer.get("done", 0)
            if "notice" in answer:
                self._notify(answer["notice"])
            if "failed" in answer:
                self._fail(answer["failed"])
            self.finished = self.finished or "finished" in answer
        if self.finished:
            return
        if is_gone or self._child.poll() is not None:  # the cause is the last line on stderr, or how the child ended
            with suppress(subprocess.TimeoutExpired):
                self._child.wait(1.0)
            self._log.seek(0)
            lines_of_log = self._log.read().decode(errors="replace").strip().splitlines()
            cause = lines_of_log[-1] if lines_of_log else "the recording process ended"
            if self._child.returncode is not None and self._child.returncode < 0:
                cause = f"the recording process was ended by {signal.Signals(-self._child.returncode).name}"
            self._fail(cause.removeprefix("ModuleNotFoundError: "))
        if self._answered < self._sent and time.monotonic() - self._silent_since > self._patience:
            self._fail(f"the recording process gave no answer within {self._patience:g} s")

    def complete(self, end: Any) -> None:
        """Send all waiting messages and the ``end``, if any, and wait until the child has completed the file."""
        self.send("end", end)
        while not self.finished:
            select.select([self._output], [self._input] if self._queue else [], [], 0.2)
            self.pump()

    def stop(self) -> None:
        """End the child: immediately, unless it has completed the file."""
        if self.stopped:
            return
        self.stopped = True
        try:
            if not self.finished:
                self._child.kill()
            self._child.wait(self._options.silence if self.finished else 1.0)
        except subprocess.TimeoutExpired:  # the child cannot end yet, for example because a disk hangs
            self._child.kill()
        finally:
            self._input.close()
            self._output.close()
            self._log.close()

    def _fail(self, cause: str) -> NoReturn:
        self.stop()
        raise RecordingStoppedError(cause)


def read_only(mapping: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    """Return a mapping that cannot be changed."""
    return MappingProxyType(mapping)


def pickle_message(message: Any) -> memoryview:
    """Return a message's length (``HEADER`` bytes), followed by its pickle."""
    content = BytesIO(bytes(HEADER))
    content.seek(HEADER)
    pickler = pickle.Pickler(content, protocol=5)
    of_mapping: dict[Any, Any] = {MappingProxyType: lambda mapping: (read_only, (dict(mapping),))}
    pickler.dispatch_table = copyreg.dispatch_table | of_mapping
    pickler.dump(message)
    frame = content.getbuffer()
    frame[:HEADER] = (len(frame) - HEADER).to_bytes(HEADER)
    return frame


def cause_of(fault: BaseException) -> str:
    """Return the cause of an error in one line."""
    if isinstance(fault, OSError) and fault.strerror:
        return fault.strerror
    return first_line(fault)


Population: TypeAlias = Float[np.ndarray, "individuals n_obj"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Generation:
    """One generation of a search, in the user's own sign.

    - Step of a closed loop: it has no hypervolume, but a ``chosen`` point of its front.
    - Level of an ε-sweep: its population is all points so far; its ids are valid in the sweep only.
    - Refinement: its population is the front before refinement.

    The recording computes a missing hypervolume if there is a ``reference``: in some generations only if that is slow,
    and approximately for more than four objectives.
    """

    number: int
    population: Population
    front: Objectives
    front_ids: Ids
    hypervolume: float | None = None  # unit: the product of the objectives' units
    reference: Values | None = None  # (n_obj,)
    failed: int = 0  # number of failed evaluations so far
    size: int | None = None  # number of points if ``front`` has only some of them
    chosen: Values | None = None  # point chosen in a step of a closed loop
    epsilon: Values | None = None  # (n_obj,): bounds of a sweep's step, infinite for the minimised objective
    origins: Objectives | None = None  # (points, n_obj): the front's points before refinement
    points: tuple[RecordedPoint, ...] = ()  # the best of every objective and the compromise, sometimes with motions
    least_violating: LeastViolating | None = None  # what is broken if there is no front

    @property
    def count(self) -> int:
        """Number of all points of the front, also of those that are not drawn."""
        return len(self.front) if self.size is None else self.size


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchedStep:
    """The search for one step of a closed loop, from its first generation on.

    sample: sample of the motion that the step leads to
    objectives: values (generations, individuals, n_obj) in the user's own sign
    q: joint positions (generations, individuals, dof), NaN if a step failed
    fronts: non-dominated individuals of each generation, sorted by their first objective
    chosen: individuals (generations,) that the weights choose, −1 in generations without one
    target: target of the tool (3,) [m]
    """

    sample: int
    arm: Arm
    objectives: Float[np.ndarray, "generations individuals n_obj"]
    q: Float[np.ndarray, "generations individuals dof"]
    fronts: Sequence[Int[np.ndarray, " _"]]
    chosen: Int[np.ndarray, " generations"]
    target: Float[np.ndarray, " 3"]


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchedFront:
    """The scene of a search: names, units and senses of the objectives.

    timeline: what the messages are: generations, levels of an ε-sweep, a front before and after refinement, or steps
        of a closed loop
    workcell: surroundings of its motions; None if the problem has no arm

    Steps have no hypervolume. Each is drawn as shares of the ranges of its own front, because objectives can change by
    orders of magnitude between steps.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    maximised: tuple[bool, ...]
    timeline: Timeline = "generation"
    workcell: Workcell | None = None

    def label(self, axis: int) -> str:
        """Return the label of an objective."""
        return screen_label(self.names[axis], self.units[axis] or "1", self.maximised[axis])

    @property
    def volume_unit(self) -> str:
        """Unit of the hypervolume: the product of the objectives' units."""
        return " · ".join(unit for unit in self.units if unit) or "1"

    def best(self, front: Objectives) -> Values:
        """Return the best value of each objective on a front of at least one point."""
        return np.asarray(np.where(self.maximised, front.max(axis=0), front.min(axis=0)))


Scene: TypeAlias = SearchedFront | PlannedScene | ResolvedScene | MaximaScene | PathScene


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchEnd:
    """The end of a search: its ``front``, the ``choice`` and its motion.

    There is no front in two cases:

    - Closed loop: one generation is recorded per step to a sample; ``searched`` has the searches of recorded steps.
    - Nothing feasible was found: ``least_violating`` is the point that violates least.
    """

    front: Front | None
    choice: Choice | None = None
    searched: Sequence[SearchedStep] = ()
    least_violating: LeastViolating | None = None

    def __post_init__(self) -> None:
        """Drop the problem: it may be the user's own."""
        if self.front is not None:
            object.__setattr__(self, "front", replace(self.front, problem=None))


class Recorder:
    """Records a run: a child process writes ``file`` during it and at its end.

    The run waits for nothing before ``finish``. The recorded data survive the death of the run, including SIGKILL: the
    child then finishes the file. A recording is a view of the run and not its archive: an error, such as a missing
    Rerun, a full disk or a killed child, gives one warning and ends the recording, never the run. With ``live`` a
    viewer shows the run; without a screen, ``notify`` gets a line on how to attach one.
    """

    def __init__(
        self,
        file: Path | str,
        *,
        title: str,
        scene: Scene,
        live: bool = False,
        notify: Callable[[str], object] = lambda text: print(text, file=sys.stderr, flush=True),
        options: RecorderOptions = OPTIONS,
    ) -> None:
        self._file = Path(file)
        self._process: RecordingProcess | None = None
        self._failed = False
        place = str(self._file.absolute())
        opening = Opening(file=place, title=title, scene=scene, live=live, options=options, run=os.getpid())

        with self._survived():
            self._process = RecordingProcess(options, notify)
            self._process.send("open", opening)

    def record(self, message: Any) -> None:
        """Add a message to the recording."""
        if self._process is not None and not self._failed:
            with self._survived():
                self._process.send("record", message)

    def finish(self, end: Any) -> None:
        """Complete the file with the `end` of the run; return after it is complete."""
        if self._process is not None and not self._failed:
            with self._survived():
                self._process.complete(end)

    def close(self) -> None:
        """Complete the file with the recorded data, unless it is finished, and end the child."""
        process, self._process = self._process, None
        if process is not None:
            try:
                if not process.finished and not process.stopped:  # an earlier fault must not lose the recorded data
                    with self._survived():
                        process.complete(None)
            finally:
                process.stop()

    @contextmanager
    def _survived(self) -> Iterator[None]:
        """Turn the first error into a warning: a view may fail in any way, but must not stop its run."""
        try:
            yield
        except Exception as fault:
            if not self._failed:
                self._failed = True
                warn_user(f"{self._file}: recording stopped, the run continues: {cause_of(fault)}")
