"""What every run needs around its computation: folder, provenance, signals, clock, recorder and observer."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from paretoik.api.progress import Observer, RunProgress, show_compilation
from paretoik.execution.interrupts import Interruption, interruptible
from paretoik.execution.run_folder import claim_folder
from paretoik.formulations.protocol import Timeline
from paretoik.front.front import Front
from paretoik.inputs import file_path
from paretoik.loading import fingerprint
from paretoik.review.recorder import Recorder
from paretoik.run_files import RECORDING, write_run

PACKAGES = ("paretoik", "pymoo", "numpy")  # whose versions a result depends on


@dataclass(frozen=True, kw_only=True)
class Display:
    """What a recording shows: names, units and senses of the objectives, along generations or steps."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    maximised: tuple[bool, ...]
    timeline: Timeline


class RunSession:
    """A run under way: what it says of itself, where it is kept, who watches it and what may end it."""

    def __init__(
        self,
        *,
        provenance: Mapping[str, Any],
        folder: Path | None,
        interruption: Interruption,
        observe: Observer | None,
        title: str,
    ) -> None:
        self.provenance, self.folder, self.interruption = provenance, folder, interruption
        self.recorder: Recorder | None = None
        self._observe, self._title = observe, title
        self._started = time.monotonic()
        self._draft: Front | None = None
        self._finished = False

    def start(self, display: Display) -> None:
        """Start the clock, and the recording where the run has a folder."""
        self._started = time.monotonic()
        if self.folder is not None:
            self.recorder = Recorder(
                self.folder / RECORDING,
                title=self._title,
                names=display.names,
                units=display.units,
                maximised=display.maximised,
                timeline=display.timeline,
            )

    @property
    def seconds(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self._started

    @property
    def signal(self) -> str | None:
        """Name of the signal that came, if any."""
        return None if self.interruption.signal is None else self.interruption.signal.name

    @property
    def is_watched(self) -> bool:
        """Whether a recorder or an observer looks on."""
        return self.recorder is not None or self._observe is not None

    def show(self, progress: RunProgress) -> None:
        """Show the recorder and the observer how far the run has come."""
        if self.recorder is not None and progress.generation is not None:
            self.recorder.record(progress.generation)
        if self._observe is not None:
            self._observe(progress)

    def show_stage(self, stage: str) -> None:
        """Show the observer that a stage without counts begins."""
        self.show(RunProgress(stage=stage, done=0, total=0, seconds=0.0))

    def save_draft(self, front: Front) -> None:
        """Keep a front that is worth having should what follows fail."""
        if self.folder is not None:
            front.save(self.folder)
            self._draft = front

    def finish(self, front: Front) -> None:
        """Keep the final front."""
        self._finished = True
        if self.folder is not None:
            self.show_stage("saving")
            front.save(self.folder)

    def fail(self, error: Exception) -> None:
        """Keep why the run failed, beside the draft of its front if there is one."""
        failure = {"status": type(error).__name__, "reason": str(error)}
        if self.folder is None or self._finished:
            return
        if self._draft is None:
            write_run(self.folder, {**self.provenance, **failure})
        else:
            replace(self._draft, provenance={**self._draft.provenance, **failure}).save(self.folder)

    def close(self) -> None:
        """Close the recording."""
        if self.recorder is not None:
            self.recorder.close()


@contextmanager
def run_session(
    problem: Any,
    *,
    settings: Mapping[str, Any],
    out: str | Path | None,
    overwrite: bool,
    reference: str | None,
    observe: Observer | None,
) -> Iterator[RunSession]:
    """Open a run of a problem: claim its folder, catch signals, and keep why it failed if it does.

    Raises
    ------
    InvalidInput
        The folder cannot be used, or a setting cannot be JSON.
    """
    provenance = {
        "problem": reference,
        "fingerprint": fingerprint(problem),
        "settings": dict(settings),
        "versions": {name: version(name) for name in PACKAGES},
    }
    with ExitStack() as stack:
        stack.enter_context(show_compilation(observe))
        folder = None if out is None else stack.enter_context(claim_folder(file_path("out", out), overwrite=overwrite))
        session = RunSession(
            provenance=provenance,
            folder=folder,
            interruption=stack.enter_context(interruptible()),
            observe=observe,
            title=reference or type(problem).__name__,
        )
        stack.callback(session.close)
        if folder is not None:
            write_run(folder, {**provenance, "status": "running"})
        try:
            yield session
        except Exception as error:
            session.fail(error)
            raise
