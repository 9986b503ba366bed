"""What every run needs around its computation: folder, provenance, signals, clock, recorder and observer."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path, PosixPath
from typing import Any

from paretoik.api.infeasible_run import InfeasibleFiles
from paretoik.api.progress import Observer, RunProgress
from paretoik.api.verb_session import VerbSession, verb_session
from paretoik.errors import InvalidInput
from paretoik.execution.computation import computed
from paretoik.execution.executor import open_executor
from paretoik.execution.machine import versions
from paretoik.execution.reserved_space import ReservedSpace
from paretoik.execution.run_folder import claim_folder
from paretoik.file_replacement import only_writer, replace_file, replace_files
from paretoik.fingerprint.fingerprint import fingerprint
from paretoik.formulations.protocol import Timeline
from paretoik.front.front import Front
from paretoik.front.storage import front_files
from paretoik.inputs import check_flag, check_text, file_path
from paretoik.journal import journalled
from paretoik.review.recording.recorder import Recorder, Scene, SearchedFront
from paretoik.review.recording.workcell import Workcell
from paretoik.run_files import CHECKPOINT, FINISHED, JOURNAL, RECORDING, RUN, STOPPED, has_result, read_run, write_run
from paretoik.stop_flag import STOP, Interrupted
from paretoik.user_functions import cause_of
from paretoik.user_warnings import warn_user

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
