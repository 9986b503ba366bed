"""The environment of a run: folder, provenance, signals, clock, recorder, observer."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path, PosixPath
from signal import SIGINT
from typing import Any

import numpy as np

from paretoik.api.result import infeasible_entries, nearest_motion
from paretoik.errors import Infeasible, InvalidInput, SolverFailed, warn_user
from paretoik.formulations.protocol import Timeline, describe
from paretoik.front.front import Front
from paretoik.front.preferences.knee_and_compromise import compromise
from paretoik.front.storage import front_files
from paretoik.inputs import cause_of, check_flag, check_size, check_text, file_path
from paretoik.nlp.program import Solver, check_solver_name
from paretoik.progress import NamedObserver, Observer, RunProgress, is_due, open_observer
from paretoik.review.recording.messages import LeastViolating, PlanEnd, PlannedScene, workcell_of
from paretoik.review.recording.recorder import Generation, Recorder, Scene, SearchedFront, SearchEnd
from paretoik.runs.executor import check_workers, computed, open_executor
from paretoik.runs.file_replacement import only_writer, replace_file, replace_files
from paretoik.runs.files import (
    CERTIFICATES,
    CHECKPOINT,
    FINISHED,
    JOURNAL,
    PICTURE,
    RECORDING,
    RUN,
    STOPPED,
    has_result,
    read_run,
    write_run,
)
from paretoik.runs.fingerprint import fingerprint
from paretoik.runs.folder import ReservedSpace, claim_folder
from paretoik.runs.interruption import Interruption, TimeLimit, check_time_limit, interruptible, time_limit
from paretoik.runs.journal import journalled
from paretoik.runs.machine import single_blas_thread, versions
from paretoik.stop_flag import STOP, Interrupted

# The settings that a user gives.


@dataclass(frozen=True, kw_only=True, eq=False)
class SolveSettings:
    """Arguments of ``solve`` that define the computation; None: the problem's own value, or the default."""

    population: int | None = None
    generations: int | None = None
    seed: int | None = None
    islands: int = 1
    initial: Any = None
    anchors: int | None = None
    algorithm: Any = None
    evaluations: int | None = None
    target: Sequence[float] | None = None
    stagnation: bool = True
    points: int | None = 200
    refine: bool = False
    solver: Solver = "auto"
    evaluation_timeout: float | None = None
    time_limit: float | None = None
    record_steps: Sequence[int] = ()
    workers: int | None = None
    cluster: str | None = None

    def __post_init__(self) -> None:
        """Check the settings that all ways of solving share."""
        check_size("islands", self.islands, 1)
        check_flag("stagnation", self.stagnation)
        check_flag("refine", self.refine)
        check_solver_name(self.solver)


@dataclass(frozen=True, kw_only=True, eq=False)
class RunRequest:
    """A requested run: its ``verb``, ``problem`` (or query) and ``settings``.

    The other settings are those of ``solve``. Raises InvalidInput if a setting that all verbs share cannot be used.

    title: title of the recording, by default the reference or the class of the problem
    reference: name of the problem, ``file.py:name``, if any
    resumable: whether the run writes its computations into its journal
    source: front that the run starts from, with the folder of its run, if any
    isolated: whether one worker computes if neither workers nor a cluster are given
    catch_signals: whether signals end the computation with a result; else they end the body as usual
    """

    verb: str
    problem: Any
    settings: Mapping[str, Any]
    title: str | None = None
    reference: str | None = None
    out: str | Path | None = None
    overwrite: bool = False
    observe: Observer | bool | None = None
    time_limit: float | None = None
    workers: int | None = None
    cluster: str | None = None
    live: bool = False
    resumable: bool = False
    source: Front | None = None
    isolated: bool = False
    catch_signals: bool = True

    def __post_init__(self) -> None:
        """Check the settings."""
        check_flag("overwrite", self.overwrite)
        check_flag("live", self.live)
        check_time_limit(self.time_limit)
        check_workers(self.workers, self.cluster)
        if self.reference is not None:
            check_text("reference", self.reference)
        if self.live and self.out is None:
            raise InvalidInput("live must come with a folder that keeps the recording (out=), got none")


SURROUNDINGS = ("reference", "out", "overwrite", "observe", "time_limit", "workers", "cluster", "live")


def surroundings(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments that a verb passes unchanged to its request."""
    return {name: value for name, value in arguments.items() if name in SURROUNDINGS}


# The environment of a verb: observer, signals, time limit, one BLAS thread.


@contextmanager
def open_verb(
    observe: Observer | bool | None, *, time_limit: float | None = None, catch_signals: bool = True
) -> Iterator[tuple[Observer | None, Interruption]]:
    """Yield a verb's observer and the signal that may end it; compute with one BLAS thread.

    If the body raises Interrupted, because a signal came before there was a result, this becomes KeyboardInterrupt
    after Ctrl-C, and SystemExit(143) after SIGTERM. Without ``catch_signals`` signals end the body as usual. Raises
    InvalidInput for an observer that cannot be called.
    """
    signals = interruptible() if catch_signals else nullcontext(Interruption())
    with open_observer(observe, time_limit=time_limit) as observer, signals as interruption, single_blas_thread():
        try:
            yield observer, interruption
        except Interrupted as stop:
            came = interruption.signal  # None if the signal was caught by a verb in another thread
            end = KeyboardInterrupt() if came is None or came == SIGINT else SystemExit(128 + came)
            for note in getattr(stop, "__notes__", ()):
                end.add_note(note)
            raise end from None


@contextmanager
def computing(seconds: float | None, session: Session | None = None) -> Iterator[None]:
    """Limit the body's computing time [s]; after it the body is asked to return its results so far.

    Raises InvalidInput for an invalid time, SolverFailed if the body has no result by then.
    """
    with time_limit(seconds) as limit:
        if session is not None:
            session.limit = limit
        try:
            yield
        except Interrupted as stop:
            if not limit.reached or (session is not None and session.signal is not None):
                raise
            assert limit.seconds is not None
            given = f"{limit.seconds:g} s"
            if limit.remaining > 0:  # the rest is reserved for certificates
                given = f"{limit.seconds - limit.remaining:.2g} s, the part of {given} not reserved for certificates"
            late = f"{limit.late} took longer than that" if limit.late else ""
            reason = late or stop.reason or "a longer one may help"
            raise SolverFailed(f"time_limit: nothing was found within {given}; {reason}") from stop


# The session of a run.


SOURCE = (CHECKPOINT, "source")  # nested folders in the folder of a run
RESERVE = Path(CHECKPOINT, "reserve")
PARTIAL = "the error's .partial"


class StoppedRun(PosixPath):
    """The folder of a stopped run that is resumed."""


@dataclass(kw_only=True, eq=False)
class Session:
    """A run in progress.

    entries: entries of its `run.json` that are known from the beginning
    former: entry "computed" of the run before it was stopped
    scene: scene of its recording, once it is known
    room: disk space that is reserved for the result
    draft: front of an earlier stage that is saved in the folder
    nearest: least-violating point of a search without feasible points; None: taken from the error
    continues: whether the journal of a finished run is kept, to continue it
    result: final result, once it is saved
    """

    request: RunRequest
    entries: Mapping[str, Any]
    former: object
    folder: Path | None
    observe: Observer | None
    interruption: Interruption
    started: float = field(default_factory=time.monotonic)
    limit: TimeLimit = field(default_factory=lambda: TimeLimit(seconds=None))
    scene: Scene | None = None
    recorder: Recorder | None = None
    room: ReservedSpace | None = None
    draft: Front | None = None
    nearest: LeastViolating | None = None
    continues: bool = False
    result: object = None

    @property
    def seconds(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self.started

    @property
    def signal(self) -> str | None:
        """Name of the signal, "interrupted" if the observer raised, None otherwise."""
        if self.interruption.signal is None:
            return None if self.observer_fault is None else "interrupted"
        return self.interruption.signal.name

    @property
    def stopped_by(self) -> str | None:
        """Cause of an early end: the signal's name, "time limit", or None."""
        return self.signal or ("time limit" if self.limit.reached else None)

    @property
    def observer_fault(self) -> InvalidInput | None:
        """Error that the observer raised, if any."""
        return self.observe.fault if isinstance(self.observe, NamedObserver) else None

    @property
    def provenance(self) -> dict[str, Any]:
        """Entries of the run, with its entry "computed" so far."""
        return {**self.entries, "computed": computed(self.former)}

    def ended(self, status: str, **counts: object) -> dict[str, Any]:
        """Return the entries of the run with its status, counts and duration."""
        return {**self.provenance, "status": status, "counts": {**counts, "seconds": round(self.seconds, 3)}}

    # Progress and recording.

    @property
    def is_watched(self) -> bool:
        """Whether there is a recorder, or an observer that is due."""
        return self.recorder is not None or is_due(self.observe)

    def start_recording(self, scene: Scene) -> None:
        """Start recording a scene, if the run has a folder."""
        self.scene, request = scene, self.request
        if self.folder is not None:
            title = request.title or request.reference or type(request.problem).__name__
            self.recorder = Recorder(self.folder / RECORDING, title=title, scene=scene, live=request.live)

    def record_search(self, objectives: Any, timeline: Timeline) -> None:
        """Start recording objectives (names, units, maximised) along a timeline."""
        scene = SearchedFront(
            names=tuple(objectives.names),
            units=tuple(objectives.units),
            maximised=tuple(objectives.maximised),
            timeline=timeline,
            workcell=workcell_of(self.request.problem),
        )
        self.start_recording(scene)

    def record(self, message: Any) -> None:
        """Add a message to the recording, if there is one."""
        if self.recorder is not None:
            self.recorder.record(message)

    def show(self, progress: RunProgress) -> bool:
        """Show progress to recorder and observer; return whether the run must stop."""
        if progress.generation is not None:
            self.record(progress.generation)
        if self.observe is not None and is_due(self.observe):
            self.observe(progress)
        return self.stopped_by is not None

    def finish_recording(self, end: Any) -> None:
        """Complete the recording, which may take some seconds."""
        if self.recorder is not None:
            self.show(RunProgress(stage="recording", summary="completing the recording"))
            self.recorder.finish(end)

    @contextmanager
    def reviewing(self) -> Iterator[None]:
        """Warn if the body fails to complete the recording or to draw pictures."""
        try:
            yield
        except (Exception, Interrupted) as fault:  # a view may fail in any way, also in a user's function
            text = f"{self.folder}: a recording or picture failed, which does not change the result: {cause_of(fault)}"
            warn_user(text)

    # Drafts and the result.

    def save_draft(self, front: Front) -> None:
        """Save a front in case a later stage fails."""
        if self.folder is None:
            return
        self._leave_room()
        replace(front, provenance={**front.provenance, "status": "refining"}).save(self.folder, overwrite=True)
        if self.room is not None:
            with suppress(OSError):  # the remaining space may be sufficient
                self.room.take()
        self.draft = front

    def keep_found(self, front: Front, error: Exception) -> None:
        """Save the front found before an error, and attach it as ``error.partial``; a note names the folder."""
        error.partial = front  # type: ignore[attr-defined]
        place: Path | str = PARTIAL
        with suppress(OSError, InvalidInput):  # the disk may be full
            self.save_draft(front)
            place = self.folder or PARTIAL
        error.add_note(f"the front found by then, of {len(front)} points, is in {place}")

    def finish(
        self,
        result: object,
        save: Callable[[Path], object],
        *,
        status: object,
        end: Callable[[], object],
        draw: Callable[[Path], object],
    ) -> None:
        """Save the final result; complete the recording by ``end()``, the pictures by ``draw``.

        The checkpoint of a stopped run and the journal of a search are kept. After a signal, or if ``end()`` returns
        None, no pictures are drawn.
        """
        self.result, STOP[0] = result, 0
        if self.folder is None:
            return
        self.show(RunProgress(stage="saving"))
        self._leave_room()
        save(self.folder)
        checkpoint = self.folder / CHECKPOINT
        if status not in STOPPED and self.continues:
            (checkpoint / JOURNAL).replace(checkpoint / FINISHED)
        elif status not in STOPPED:
            shutil.rmtree(checkpoint, ignore_errors=True)
        with self.reviewing():
            last = end()
            if last is not None:
                self.finish_recording(last)
                if self.signal is None:
                    draw(self.folder)

    def finish_front(self, front: Front, record: Callable[[], object] = bool) -> None:
        """Save and draw the final front; ``record()`` adds it to the recording, which ends with the compromise."""

        def end() -> SearchEnd | None:
            record()
            return SearchEnd(front=front, choice=compromise(front)) if len(front) else None

        def draw(folder: Path) -> None:
            from paretoik.review.pictures.certificates import certificates_picture  # here: matplotlib loads slowly
            from paretoik.review.pictures.fronts import front_picture

            front_picture(front, folder / PICTURE)
            if front.certificates is not None:
                certificates_picture(front, folder / CERTIFICATES)

        save, status = partial(front.save, overwrite=True), front.provenance.get("status")
        self.finish(front, save, status=status, end=end, draw=draw)

    def complete_observer_fault(self) -> None:
        """Attach the saved result to the observer's error, if there is one."""
        fault, result = self.observer_fault, self.result
        if fault is None or result is None or fault.partial is not None:
            return
        fault.partial = result
        found = (
            f"front found by then, of {len(result)} points," if isinstance(result, Front) else "result found by then"
        )
        fault.add_note(f"the {found} is in {self.folder or PARTIAL}")

    def fail(self, error: BaseException) -> None:
        """Save the reason of a failure, with the draft of the front or the least-violating motion, if any."""
        if self.result is not None:
            return
        entries, files = self._finish_infeasible(error)
        notes = getattr(error, "__notes__", ()) if isinstance(error, Interrupted) else ()
        failure = {"status": self.signal or type(error).__name__, "reason": "; ".join([str(error), *notes])}
        if self.folder is None:
            return
        self._leave_room()
        if self.draft is not None:
            replace(self.draft, provenance={**self.draft.provenance, **failure}).save(self.folder, overwrite=True)
        elif not has_result(self.folder):  # a resumed run may have an earlier result
            for name, content in files.items():
                replace_file(self.folder / name, content)
            write_run(self.folder, {**self.provenance, **failure, **entries})

    def _finish_infeasible(self, error: BaseException) -> tuple[dict[str, Any], dict[str, bytes]]:
        """Complete the recording of an infeasible run; return its entries and files.

        A signal or the time limit may have ended the run before its infeasibility was certain.
        """
        failure = error.__cause__ if isinstance(error, Interrupted | SolverFailed) and error.__cause__ else error
        if isinstance(failure, Interrupted) and failure.motion is not None:
            failure = Infeasible(failure.reason, motion=failure.motion)
        scene = self.scene
        is_loop = isinstance(scene, SearchedFront) and scene.timeline == "step"
        if is_loop or not (isinstance(failure, Infeasible) and isinstance(scene, PlannedScene | SearchedFront)):
            return {}, {}
        if isinstance(error, Interrupted):
            error.add_note(f"by then: {failure}")
        nearest = self.nearest or nearest_motion(self.request.problem, failure)
        with self.reviewing():
            if isinstance(scene, PlannedScene):
                self.finish_recording(PlanEnd(least_violating=nearest))
            else:
                if scene.timeline == "level" and nearest.point is not None:
                    values, none = nearest.point.objectives[None], np.empty(0, dtype=int)
                    level = Generation(number=0, population=values, front=values[none], front_ids=none)
                    self.record(replace(level, least_violating=nearest))
                self.finish_recording(SearchEnd(front=None, least_violating=nearest))
        return infeasible_entries(scene, nearest, failure.motion)

    def _leave_room(self) -> None:
        if self.room is not None:
            self.room.release()


@contextmanager
def open_session(request: RunRequest) -> Iterator[Session]:
    """Open a run: lock its folder, catch signals, save a failure's reason.

    Raises InvalidInput if the folder cannot be used, a setting cannot be JSON, or the workers do not exist.
    """
    mark = fingerprint(request.problem)
    with ExitStack() as stack:
        opened = open_verb(request.observe, time_limit=request.time_limit, catch_signals=request.catch_signals)
        observer, interruption = stack.enter_context(opened)
        folder: Path | None = None
        stored: dict[str, Any] = {}
        if isinstance(request.out, StoppedRun):  # the process that resumes the run holds the lock
            folder, stored = request.out, read_run(request.out / RUN)
        elif request.out is not None:
            folder = stack.enter_context(claim_folder(file_path("out", request.out), overwrite=request.overwrite))
        stack.enter_context(open_executor(request.workers, request.cluster, isolated=request.isolated))
        given = {name: value for name, value in stored.get("settings", {}).items() if name == "initial"}
        session = Session(
            request=request,
            entries={
                "verb": request.verb,
                "problem": request.reference,
                "solved": describe(request.problem),
                "fingerprint": mark,
                "settings": {**request.settings, **given},  # the journal of a resumed run has its initial solutions
                "versions": versions(),
            },
            former=stored.get("computed"),
            folder=folder,
            observe=observer,
            interruption=interruption,
        )
        if folder is not None:
            if request.resumable:
                session.room = ReservedSpace(folder / RESERVE)
            if not has_result(folder):
                write_run(folder, {**session.provenance, "status": "running"})
            elif stored:  # if this process is killed, the results are in the journal
                write_run(folder, {**stored, **{name: session.provenance[name] for name in ("settings", "computed")}})
            if request.source is not None and not stored:
                # The front that a stopped run starts from is saved first, since a run with a journal can be resumed.
                source = folder.joinpath(*SOURCE)
                with only_writer(source):
                    replace_files(source, front_files(request.source))
            if request.resumable:
                stack.enter_context(journalled(folder / CHECKPOINT / JOURNAL))
        try:
            yield session
        except (Exception, KeyboardInterrupt) as error:  # includes Interrupted
            session.fail(session.observer_fault or error)
            raise
        finally:
            session.complete_observer_fault()
            if session.recorder is not None:
                session.recorder.close()
