"""What every run needs around its computation: folder, provenance, signals, clock, recorder and observer."""

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

# What every verb needs around its computation: observer, clock, time limit, and the signals that may end it.


@dataclass(kw_only=True, eq=False)
class VerbSession:
    """A verb at work: its observer, its clock, and the signals that may end it."""

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
        """What the observer raised, if anything."""
        return self.observe.fault if isinstance(self.observe, NamedObserver) else None

    @property
    def stopped_by(self) -> str | None:
        """What ended the computation early: the name of a signal, or "time limit"."""
        return self.signal or ("time limit" if self.limit.reached else None)

    def _given(self) -> str:
        """Return in words how long was searched: what is reserved of a limit for certificates was not."""
        limit, left = self.limit.seconds, self.limit.remaining
        assert limit is not None
        return f"{limit:g} s" if left <= 0 else f"{limit - left:.2g} s, what {limit:g} s leave beside certificates"

    @contextmanager
    def computing(self, seconds: float | None) -> Iterator[None]:
        """Let the body compute for so many seconds at most; it then returns what it has, as after a signal.

        Raises InvalidInput for what is no time, SolverFailed where the body has nothing by then.
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
    """Return a context that computes as ``VerbSession.computing``, before there is a session."""
    return VerbSession(observe=None, interruption=Interruption()).computing(seconds)


@contextmanager
def verb_session(
    observe: Observer | bool | None, *, time_limit: float | None = None, catch_signals: bool = True
) -> Iterator[VerbSession]:
    """Open a verb: catch signals, show its progress, compute with one BLAS thread. Within another's, signals are its.

    Where the body raises Interrupted, a signal came before there was anything to return: KeyboardInterrupt after
    Ctrl-C, SystemExit(143) after SIGTERM. Without ``catch_signals`` these end the body as without a
    verb. Raises InvalidInput for an observer that cannot be called.
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
    """Return what a signal would have raised, or ended Python with, had nobody caught it."""
    if interruption.signal is None:  # another thread's
        return KeyboardInterrupt()
    return KeyboardInterrupt() if interruption.signal == SIGINT else SystemExit(interruption.exit_code)


# What a user sets of a run, as one record that the ways of solving share.


@dataclass(frozen=True, kw_only=True, eq=False)
class SolveSettings:
    """The keywords of ``solve`` that say what is computed; None leaves a size to the problem or to the defaults."""

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
        """Check what means the same for every way of solving."""
        check_size("islands", self.islands, 1)
        check_flag("stagnation", self.stagnation)
        check_flag("refine", self.refine)
        check_solver_name(self.solver)
        check_workers(self.workers, self.cluster)
        if self.evaluation_timeout is not None:
            positive_number("evaluation_timeout", self.evaluation_timeout, "s")


@dataclass(frozen=True, kw_only=True)
class SearchDefaults:
    """Sizes of a search where a user gives none: individuals, generations at most, and the seed.

    Where the front is refined, too, the search has a share of the time limit, ``search_time``.
    """

    population: int = 200
    generations: int = 500
    seed: int = 0
    search_time: float = 0.5


DEFAULTS = SearchDefaults()


SOURCE = (CHECKPOINT, "source")  # folders, one within the other, in a run's
RESERVE = Path(CHECKPOINT, "reserve")


class StoppedRun(PosixPath):
    """The folder of a run that goes on, where else that of a new one stands."""


@dataclass(kw_only=True, eq=False)
class RunSession(VerbSession):
    """A run under way: its provenance, its folder, its recorder and observer, and the signals that may end it.

    ``entries`` are what is known of it from the beginning, ``former`` is who computed before it was stopped.
    """

    entries: Mapping[str, Any]
    former: object
    folder: Path | None
    title: str
    live: bool = False
    recorder: Recorder | None = None
    draft: Front | None = None
    room: ReservedSpace | None = None  # on the disk, for the result
    infeasible: InfeasibleFiles | None = None  # what comes nearest, where nothing is feasible
    continues: bool = False  # whether the journal stays once the run has finished, to be continued
    finished: bool = False
    result: object = None  # the final one, once it is kept

    @property
    def provenance(self) -> dict[str, Any]:
        """What is known of the run, with who has computed until now."""
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
        """Start, where the run has a folder, the recording of objectives along generations or steps."""
        scene = SearchedFront(
            names=tuple(names),
            units=tuple(units),
            maximised=tuple(maximised),
            timeline=timeline,
            workcell=workcell,
        )
        self.start_recording(scene)

    def start_recording(self, scene: Scene) -> None:
        """Start, where the run has a folder, the recording of a scene."""
        if self.folder is not None:
            self.recorder = Recorder(self.folder / RECORDING, title=self.title, scene=scene, live=self.live)

    def record(self, message: Any) -> None:
        """Add a message to the recording, if there is one."""
        if self.recorder is not None:
            self.recorder.record(message)

    @property
    def is_watched(self) -> bool:
        """Whether a recorder or an observer looks on."""
        return self.recorder is not None or self.is_observed

    @property
    def is_observed(self) -> bool:
        """Whether there is an observer, and it is due: one that seldom says anything costs nothing meanwhile."""
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
        """Let the body complete the recording and draw pictures of what a run found; warn where it fails."""
        try:
            yield
        except (Exception, Interrupted) as fault:  # a view may fail in any way, also by a function of a user's
            text = f"{self.folder}: not all views of this run could be made, which changes no result: {cause_of(fault)}"
            warn_user(text)

    def save_draft(self, front: Front) -> None:
        """Save a front, should what follows fail."""
        if self.folder is not None:
            with self._using_room():
                replace(front, provenance={**front.provenance, "status": "refining"}).save(self.folder, overwrite=True)
            self.draft = front

    def keep_found(self, front: Front, error: Exception) -> None:
        """Save the front found before an error, which has it as its ``partial`` and says in a note where it is."""
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
        """Save the final result into the run's folder; keep the checkpoint of a stopped run, the journal of a search.

        What a signal asked to stop has stopped by then: it does not hold for the pictures that follow.
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
        """Raise what the observer raised, if anything, with the result that was kept."""
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
        """Save why the run failed, beside the draft of its front if there is one."""
        notes = getattr(error, "__notes__", ()) if isinstance(error, Interrupted) else ()
        reason = "; ".join([str(error), *notes])
        failure = {"status": self.signal or type(error).__name__, "reason": reason}
        if self.folder is None or self.finished:
            return
        self._leave_room()
        if self.draft is None and not has_result(self.folder):  # one that goes on may have one from before
            self._write_failure(self.folder, {**self.provenance, **failure})
        elif self.draft is not None:
            replace(self.draft, provenance={**self.draft.provenance, **failure}).save(self.folder, overwrite=True)

    def _write_failure(self, folder: Path, entries: Mapping[str, Any]) -> None:
        """Write why a run without a result failed, and what comes nearest where nothing is feasible."""
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
        """Let the body write where room is held for the result, and hold it again."""
        self._leave_room()
        yield
        if self.room is not None:
            with suppress(OSError):  # what is there now may have to do
                self.room.take()


@dataclass(frozen=True, kw_only=True)
class Subject:
    """What a run is about: a ``title``, a ``fingerprint``, and the ``reference`` of its problem, if it has one."""

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

    Without ``catch_signals`` a signal ends the body as it would have without a run. What one that is ``resumable``
    computes goes into its journal; ``source`` is the front that it begins with, if any. ``workers``, ``cluster`` and
    ``isolated`` say who computes, as ``open_executor`` has them. Raises InvalidInput where the folder cannot be used, a
    setting cannot be JSON, what is to be seen live has no folder to be recorded in, or there are no such workers.
    """
    check_flag("live", live)
    if live and out is None:
        raise InvalidInput("live: a folder wanted that keeps the recording (out=), got none")
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
            "settings": {**settings, **given},  # a resumed run has what it started from in its journal
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
        elif folder is not None and stored:  # should this process be killed: what it computes stays in the journal
            now = {name: session.provenance[name] for name in ("settings", "computed")}
            write_run(folder, {**stored, **now})
        if folder is not None and resumable:
            if source is not None and not isinstance(out, StoppedRun):
                _save_source(source, folder)  # before there is a journal: what has one can go on
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
    """Claim the folder of a run, or that of one that goes on; None where there is none."""
    if out is None:
        yield None
    elif isinstance(out, StoppedRun):  # whoever lets it go on has its lock
        yield out
    else:
        with claim_folder(file_path("out", out), overwrite=overwrite) as folder:
            yield folder


def _save_source(front: Front, folder: Path) -> None:
    """Save the front that a run begins with, and where it is from, should the run be stopped: it goes on from there."""
    run = {} if front.folder is None else {"run": str(front.folder)}
    files = front_files(replace(front, provenance={**front.provenance, **run}))
    with only_writer(folder, *SOURCE) as source:
        replace_files(source, files)


# What a run's folder shows of its front: the end of the recording, and pictures.


def review_front(front: Front, session: RunSession) -> None:
    """Finish the recording with the compromise and its motion, and, unless a signal came, draw the front."""
    if session.folder is None or not len(front):
        return
    session.finish_recording(SearchEnd(front=front, choice=compromise(front)))
    if session.signal is not None:
        return
    from paretoik.review.pictures.fronts import front_picture  # here: matplotlib takes its time

    front_picture(front, session.folder / PICTURE)
    if front.certificates is not None:
        from paretoik.review.pictures.certificates import certificates_picture

        certificates_picture(front, session.folder / CERTIFICATES)
