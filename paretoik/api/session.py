"""The surroundings of every run: folder, provenance, signals, clock, recorder and observer."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path, PosixPath
from signal import SIGINT
from typing import Any

from paretoik.api.infeasible_run import InfeasibleFiles
from paretoik.api.progress import NamedObserver, Observer, RunProgress, open_observer
from paretoik.errors import InvalidInput, SolverFailed, warn_user
from paretoik.formulations.protocol import Timeline
from paretoik.front.front import Front
from paretoik.front.preferences.compromise import compromise
from paretoik.front.storage import front_files
from paretoik.inputs import cause_of, check_flag, check_size, check_text, file_path, positive_number
from paretoik.nlp.program import Solver, check_solver_name
from paretoik.review.recording.messages import Workcell
from paretoik.review.recording.recorder import Recorder, Scene, SearchedFront, SearchEnd
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
from paretoik.runs.interruption import Interruption, TimeLimit, interruptible, time_limit
from paretoik.runs.journal import journalled
from paretoik.runs.machine import single_blas_thread, versions
from paretoik.stop_flag import STOP, Interrupted

# The surroundings of every verb: observer, clock, time limit, and the signals that may end it.


@dataclass(kw_only=True, eq=False)
class VerbSession:
    """A running verb: its observer, its clock, and the signals that may end it."""

    observe: Observer | None
    interruption: Interruption
    started: float = field(default_factory=time.monotonic)
    limit: TimeLimit = field(default_factory=lambda: TimeLimit(seconds=None))

    @property
    def seconds(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self.started

    @property
    def signal(self) -> str | None:
        """Name of the signal that came, "interrupted" if the observer raised, None otherwise."""
        if self.interruption.signal is None:
            return None if self.observer_fault is None else "interrupted"
        return self.interruption.signal.name

    @property
    def observer_fault(self) -> InvalidInput | None:
        """Error that the observer raised, if any."""
        return self.observe.fault if isinstance(self.observe, NamedObserver) else None

    @property
    def stopped_by(self) -> str | None:
        """Cause that ended the computation early: the name of a signal, or "time limit"."""
        return self.signal or ("time limit" if self.limit.reached else None)

    def _given(self) -> str:
        """Return in words the time of the search, without the time reserved for certificates."""
        limit, left = self.limit.seconds, self.limit.remaining
        assert limit is not None
        return f"{limit:g} s" if left <= 0 else f"{limit - left:.2g} s, the part of {limit:g} s that certificates leave"

    @contextmanager
    def computing(self, seconds: float | None) -> Iterator[None]:
        """Limit the body to ``seconds`` of computing; then it returns its results so far, as after a signal.

        Raises InvalidInput for an invalid time, SolverFailed if the body has no result by then.
        """
        with time_limit(seconds) as self.limit:
            try:
                yield
            except Interrupted as stop:
                if self.signal is None and self.limit.reached:
                    late = f"{self.limit.late} took longer than that" if self.limit.late else ""
                    reason = late or stop.reason or "a longer one may help"
                    raise SolverFailed(f"time_limit: nothing was found within {self._given()}; {reason}") from None
                raise


def computing(seconds: float | None) -> AbstractContextManager[None]:
    """Return the context of ``VerbSession.computing`` before there is a session."""
    return VerbSession(observe=None, interruption=Interruption()).computing(seconds)


@contextmanager
def verb_session(
    observe: Observer | bool | None, *, time_limit: float | None = None, catch_signals: bool = True
) -> Iterator[VerbSession]:
    """Open a verb: catch signals, show its progress, and compute with one BLAS thread.

    Inside another verb, that one gets the signals. If the body raises Interrupted, a signal came before there was a
    result: this raises KeyboardInterrupt after Ctrl-C, SystemExit(143) after SIGTERM. Without ``catch_signals`` they
    end the body as without a verb. Raises InvalidInput for an observer that cannot be called.
    """
    signals = interruptible() if catch_signals else nullcontext(Interruption())
    with open_observer(observe, time_limit=time_limit) as observer, signals as interruption, single_blas_thread():
        try:
            yield VerbSession(observe=observer, interruption=interruption)
        except Interrupted as stop:
            end = _exit_of(interruption)
            for note in getattr(stop, "__notes__", ()):
                end.add_note(note)
            raise end from None


def _exit_of(interruption: Interruption) -> BaseException:
    """Return the exception that a signal would have raised if nobody had caught it."""
    if interruption.signal is None:  # another thread's
        return KeyboardInterrupt()
    return KeyboardInterrupt() if interruption.signal == SIGINT else SystemExit(128 + interruption.signal)


# The settings of a run that a user gives, shared by all ways of solving.


@dataclass(frozen=True, kw_only=True, eq=False)
class SolveSettings:
    """The arguments of ``solve`` that say what is computed; None means the problem's or the default size."""

    population: int | None = None
    generations: int | None = None
    seed: int | None = None
    islands: int = 1
    initial: Any = None
    time_limit: float | None = None
    evaluations: int | None = None
    target: Sequence[float] | None = None
    stagnation: bool = True
    anchors: int | None = None
    algorithm: Any = None
    points: int | None = 200
    refine: bool = False
    solver: Solver = "auto"
    record_steps: Sequence[int] = ()
    workers: int | None = None
    cluster: str | None = None
    evaluation_timeout: float | None = None

    def __post_init__(self) -> None:
        """Check the settings that mean the same for every way of solving."""
        check_size("islands", self.islands, 1)
        check_flag("stagnation", self.stagnation)
        check_flag("refine", self.refine)
        check_solver_name(self.solver)
        check_workers(self.workers, self.cluster)
        if self.evaluation_timeout is not None:
            positive_number("evaluation_timeout", self.evaluation_timeout, "s")


@dataclass(frozen=True, kw_only=True)
class SearchDefaults:
    """Default sizes of a search.

    population: number of individuals
    generations: most generations
    seed: seed of all random numbers
    search_time: share of the time limit for the search if the front is refined too
    """

    population: int = 200
    generations: int = 500
    seed: int = 0
    search_time: float = 0.5


DEFAULTS = SearchDefaults()


# The surroundings of a run: folder, provenance, signals, recorder.


SOURCE = (CHECKPOINT, "source")  # folders in the folder of a run, one in the other
RESERVE = Path(CHECKPOINT, "reserve")


class StoppedRun(PosixPath):
    """The folder of a run to resume, in place of that of a new run."""


@dataclass(kw_only=True, eq=False)
class RunSession(VerbSession):
    """A run in progress: its provenance, folder, recorder and observer, and the signals that may end it.

    ``entries`` are known from the beginning; ``former`` is who computed before the run was stopped.
    """

    entries: Mapping[str, Any]
    former: object
    folder: Path | None
    title: str
    live: bool = False
    recorder: Recorder | None = None
    draft: Front | None = None
    room: ReservedSpace | None = None  # reserved on the disk for the result
    infeasible: InfeasibleFiles | None = None  # least-violating motion if nothing is feasible
    continues: bool = False  # whether the journal of a finished run stays, to be continued
    finished: bool = False
    result: object = None  # final result, when it is kept

    @property
    def provenance(self) -> dict[str, Any]:
        """Entries of the run, with who has computed until now."""
        return {**self.entries, "computed": computed(self.former)}

    def start(
        self,
        *,
        names: Sequence[str],
        units: Sequence[str],
        maximised: Sequence[bool],
        timeline: Timeline,
        workcell: Workcell | None = None,
    ) -> None:
        """Start the recording of objectives along generations or steps, if the run has a folder."""
        scene = SearchedFront(
            names=tuple(names),
            units=tuple(units),
            maximised=tuple(maximised),
            timeline=timeline,
            workcell=workcell,
        )
        self.start_recording(scene)

    def start_recording(self, scene: Scene) -> None:
        """Start the recording of a scene, if the run has a folder."""
        if self.folder is not None:
            self.recorder = Recorder(self.folder / RECORDING, title=self.title, scene=scene, live=self.live)

    def record(self, message: Any) -> None:
        """Add a message to the recording, if there is one."""
        if self.recorder is not None:
            self.recorder.record(message)

    @property
    def is_watched(self) -> bool:
        """Whether there is a recorder, or an observer that is due."""
        return self.recorder is not None or self.is_observed

    @property
    def is_observed(self) -> bool:
        """Whether there is an observer and it is due; one that is not due costs nothing."""
        return self.observe is not None and getattr(self.observe, "is_due", True)

    def show(self, progress: RunProgress) -> None:
        """Show the recorder and the observer how far the run has come."""
        if self.recorder is not None and progress.generation is not None:
            self.recorder.record(progress.generation)
        if self.observe is not None and self.is_observed:
            self.observe(progress)

    def finish_recording(self, end: Any) -> None:
        """Complete the recording with the end of the run, which may take some seconds."""
        if self.recorder is not None:
            self.show(RunProgress(stage="recording", summary="completing the recording"))
            self.recorder.finish(end)

    @contextmanager
    def reviewing(self) -> Iterator[None]:
        """Warn if the body, which completes the recording and draws pictures, fails."""
        try:
            yield
        except (Exception, Interrupted) as fault:  # a view may fail in any way, also in a user's function
            text = f"{self.folder}: not all views of this run could be made, which changes no result: {cause_of(fault)}"
            warn_user(text)

    def save_draft(self, front: Front) -> None:
        """Save a front in case a later stage fails."""
        if self.folder is not None:
            with self._using_room():
                replace(front, provenance={**front.provenance, "status": "refining"}).save(self.folder, overwrite=True)
            self.draft = front

    def keep_found(self, front: Front, error: Exception) -> None:
        """Save the front found before an error; the error has it as ``partial`` and notes its folder."""
        error.partial = front  # type: ignore[attr-defined]
        place = "the error's .partial"
        with suppress(OSError, InvalidInput):  # a full disk
            self.save_draft(front)
            place = place if self.folder is None else str(self.folder)
        error.add_note(f"the front found by then, of {len(front)} points, is in {place}")

    def finish(self, front: Front) -> None:
        """Save the final front."""
        self.keep(front, lambda folder: front.save(folder, overwrite=True), status=front.provenance.get("status"))

    def keep(self, result: object, save: Callable[[Path], object], *, status: object) -> None:
        """Save the final result; keep the checkpoint of a stopped run and the journal of a search.

        A stop that a signal requested is done by then: it does not apply to the pictures that follow.
        """
        self.result, self.finished, STOP[0] = result, True, 0
        if self.folder is not None:
            self.show(RunProgress(stage="saving"))
            self._leave_room()
            save(self.folder)
            checkpoint = self.folder / CHECKPOINT
            if status in STOPPED:
                return
            if self.continues:
                (checkpoint / JOURNAL).replace(checkpoint / FINISHED)
            else:
                shutil.rmtree(checkpoint, ignore_errors=True)

    def raise_observer_fault(self) -> None:
        """Raise the error of the observer, if any, with the result that was kept."""
        fault = self.observer_fault
        if fault is None:
            return
        if self.result is not None and fault.partial is None:
            fault.partial = self.result
            size = f", of {len(self.result)} points," if isinstance(self.result, Front) else ""
            kind = "front" if isinstance(self.result, Front) else "result"
            place = "the error's .partial" if self.folder is None else self.folder
            fault.add_note(f"the {kind} found by then{size} is in {place}")
        raise fault

    def fail(self, error: BaseException) -> None:
        """Save why the run failed, with the draft of its front if there is one."""
        notes = getattr(error, "__notes__", ()) if isinstance(error, Interrupted) else ()
        reason = "; ".join([str(error), *notes])
        failure = {"status": self.signal or type(error).__name__, "reason": reason}
        if self.folder is None or self.finished:
            return
        self._leave_room()
        if self.draft is None and not has_result(self.folder):  # a resumed run may have a result from before
            self._write_failure(self.folder, {**self.provenance, **failure})
        elif self.draft is not None:
            replace(self.draft, provenance={**self.draft.provenance, **failure}).save(self.folder, overwrite=True)

    def _write_failure(self, folder: Path, entries: Mapping[str, Any]) -> None:
        """Write why a run without a result failed, and its least-violating motion if nothing is feasible."""
        nearest = self.infeasible
        if nearest is not None:
            entries = {**entries, **nearest.entries}
            for name, content in nearest.contents.items():
                replace_file(folder / name, content)
        write_run(folder, entries)

    def _leave_room(self) -> None:
        if self.room is not None:
            self.room.release()

    @contextmanager
    def _using_room(self) -> Iterator[None]:
        """Release the space reserved for the result while the body writes, then reserve it again."""
        self._leave_room()
        yield
        if self.room is not None:
            with suppress(OSError):  # the space that is left may have to be enough
                self.room.take()


@dataclass(frozen=True, kw_only=True)
class Subject:
    """The subject of a run: a ``title``, a ``fingerprint``, and the ``reference`` of its problem, if any."""

    title: str
    fingerprint: str
    reference: str | None = None

    @classmethod
    def of(cls, problem: Any, reference: str | None) -> Subject:
        """Return a problem as a subject."""
        if reference is not None:
            check_text("reference", reference)
        return cls(title=reference or type(problem).__name__, fingerprint=fingerprint(problem), reference=reference)


@contextmanager
def run_session(
    subject: Subject,
    *,
    verb: str,
    settings: Mapping[str, Any],
    out: str | Path | None,
    overwrite: bool,
    observe: Observer | bool | None,
    time_limit: float | None = None,
    catch_signals: bool = True,
    live: bool = False,
    resumable: bool = False,
    source: Front | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    isolated: bool = False,
) -> Iterator[RunSession]:
    """Open a run: claim its folder, catch signals, and save why it failed if it does.

    Without ``catch_signals`` a signal ends the body as without a run. A ``resumable`` run writes its computations into
    its journal; ``source`` is the front that it begins with, if any. ``workers``, ``cluster`` and ``isolated`` are
    those of ``open_executor``. Raises InvalidInput if the folder cannot be used, a setting cannot be JSON, ``live`` is
    given without a folder, or there are no such workers.
    """
    check_flag("live", live)
    if live and out is None:
        raise InvalidInput("live must come with a folder that keeps the recording (out=), got none")
    with ExitStack() as stack:
        opened = stack.enter_context(verb_session(observe, time_limit=time_limit, catch_signals=catch_signals))
        folder = stack.enter_context(_folder(out, overwrite=overwrite))
        stack.enter_context(open_executor(workers, cluster, isolated=isolated))
        stored = read_run(folder / RUN) if folder is not None and isinstance(out, StoppedRun) else {}
        given = {name: value for name, value in stored.get("settings", {}).items() if name == "initial"}
        entries = {
            "verb": verb,
            "problem": subject.reference,
            "fingerprint": subject.fingerprint,
            "settings": {**settings, **given},  # the journal of a resumed run has what it started from
            "versions": versions(),
        }
        session = RunSession(
            entries=entries,
            former=stored.get("computed"),
            folder=folder,
            interruption=opened.interruption,
            observe=opened.observe,
            title=subject.title,
            live=live,
        )
        if folder is not None and resumable:
            session.room = ReservedSpace(folder / RESERVE)
        if folder is not None and not has_result(folder):
            write_run(folder, {**session.provenance, "status": "running"})
        elif folder is not None and stored:  # if this process is killed, its results are in the journal
            now = {name: session.provenance[name] for name in ("settings", "computed")}
            write_run(folder, {**stored, **now})
        if folder is not None and resumable:
            if source is not None and not isinstance(out, StoppedRun):
                _save_source(source, folder)  # before there is a journal: a run with one can be resumed
            stack.enter_context(journalled(folder / CHECKPOINT / JOURNAL))
        try:
            yield session
            session.raise_observer_fault()
        except (Exception, KeyboardInterrupt) as error:  # Interrupted among them
            session.fail(session.observer_fault or error)
            session.raise_observer_fault()
            raise
        finally:
            if session.recorder is not None:
                session.recorder.close()


@contextmanager
def _folder(out: str | Path | None, *, overwrite: bool) -> Iterator[Path | None]:
    """Claim the folder of a run, or that of a run to resume; yield None without a folder."""
    if out is None:
        yield None
    elif isinstance(out, StoppedRun):  # the process that resumes it has its lock
        yield out
    else:
        with claim_folder(file_path("out", out), overwrite=overwrite) as folder:
            yield folder


def _save_source(front: Front, folder: Path) -> None:
    """Save the front that a run begins with, and its folder, from which a stopped run is resumed."""
    run = {} if front.folder is None else {"run": str(front.folder)}
    files = front_files(replace(front, provenance={**front.provenance, **run}))
    source = folder.joinpath(*SOURCE)
    with only_writer(source):
        replace_files(source, files)


# The end of the recording and the pictures of a front.


def review_front(front: Front, session: RunSession) -> None:
    """Complete the recording with the compromise and its motion; draw the front unless a signal came."""
    if session.folder is None or not len(front):
        return
    session.finish_recording(SearchEnd(front=front, choice=compromise(front)))
    if session.signal is not None:
        return
    from paretoik.review.pictures.fronts import front_picture  # here: matplotlib loads slowly

    front_picture(front, session.folder / PICTURE)
    if front.certificates is not None:
        from paretoik.review.pictures.certificates import certificates_picture

        certificates_picture(front, session.folder / CERTIFICATES)
