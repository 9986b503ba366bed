"""Following a closed loop: what ``solve`` does of one, its run folder and its recording."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.errors import ParetoikError
from paretoik.execution.interrupts import interruptible
from paretoik.execution.run_folder import claim_folder
from paretoik.files import replace_file
from paretoik.closed_loop.loop import StepRecord
from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.formulations.closed_loop_result import ClosedLoopRun, explain_choice
from paretoik.front.front import Front
from paretoik.loading import fingerprint
from paretoik.review.generation import Generation
from paretoik.review.recorder import Recorder
from paretoik.run_files import PICTURE, RECORDING, STEPS, write_run
from paretoik.search.archive import Failures
from paretoik.search.progress import Progress

Observer = Callable[[Generation, Progress], object]


def follow(
    loop: ClosedLoop,
    *,
    out: str | Path | None = None,
    time_limit: float | None = None,
    overwrite: bool = False,
    reference: str | None = None,
    observe: Observer | None = None,
) -> Front:
    """Follow a closed loop and return its motion as a front of one point, whose objectives are means over the steps.

    Arguments and what it raises are those of ``solve``. A signal or the time limit leaves the rest of the path: the
    motion is that of the steps that were taken.
    """
    provenance: dict[str, Any] = {
        "problem": reference,
        "fingerprint": fingerprint(loop),
        "settings": {
            "weights": loop.named_weights,
            "population": loop.population,
            "generations": loop.generations,
            "seed": loop.seed,
            "warm_start": loop.warm_start,
            "time_limit": time_limit,
        },
        "versions": versions(),
    }
    with ExitStack() as stack:
        folder = None if out is None else stack.enter_context(claim_folder(out, overwrite=overwrite))
        interruption = stack.enter_context(interruptible())
        if folder is not None:
            write_run(folder, {**provenance, "status": "running"})
        try:
            loop.prepare()
            watch = _Watch(loop, time_limit, observe)
            if folder is not None:
                watch.recorder = _recorder(folder, loop, reference)
                stack.callback(watch.recorder.close)
            run = loop.run(observe=watch, should_stop=lambda: bool(interruption) or watch.late)
        except ParetoikError as error:
            if folder is not None:
                write_run(folder, {**provenance, "status": type(error).__name__, "reason": str(error)})
            raise
        status = "end of the path"
        if len(run.q) < len(loop.task.times):
            status = "time limit" if interruption.signal is None else interruption.signal.name
        counts = {"steps": len(run.q) - 1, "of": len(loop.task.times) - 1, "seconds": round(watch.seconds, 3)}
        front = run.front({**provenance, "status": status, "counts": counts})
        if folder is not None:
            _keep(run, front, folder, watch)
        return front


def versions() -> dict[str, str]:
    """Return the versions of what a result depends on."""
    from importlib.metadata import version

    return {name: version(name) for name in ("paretoik", "pymoo", "numpy")}


class _Watch:
    """Shows each step to the recorder and to whoever looks on."""

    def __init__(self, loop: ClosedLoop, time_limit: float | None, observe: Observer | None) -> None:
        self.loop, self.time_limit, self.observe = loop, time_limit, observe
        self.recorder: Recorder | None = None
        self.began = time.monotonic()

    @property
    def seconds(self) -> float:
        """How long it has taken."""
        return time.monotonic() - self.began

    @property
    def late(self) -> bool:
        """Whether the time limit is reached."""
        return self.time_limit is not None and self.seconds >= self.time_limit

    def __call__(self, record: StepRecord) -> None:
        F = record.front.F * self.loop.signs
        generation = Generation(
            number=record.sample,
            population=F[:0],
            front=F,
            front_ids=np.arange(len(F)),
            chosen=F[record.index],
        )
        if self.recorder is not None:
            self.recorder.record(generation)
        if self.observe is not None:
            progress = Progress(
                generation=record.sample,
                evaluations=record.sample * self.loop.population * (self.loop.generations + 1),
                seconds=self.seconds,
                failed=Failures(),
                population=record.front.F,
                front=record.front.F,
                ids=generation.front_ids,
            )
            self.observe(generation, progress)


def _recorder(folder: Path, loop: ClosedLoop, reference: str | None) -> Recorder:
    return Recorder(
        folder / RECORDING,
        title=reference or "closed loop",
        names=loop.names,
        units=[each.unit for each in loop.objectives],
        maximised=[each.maximise for each in loop.objectives],
        course="step",
    )


def _keep(run: ClosedLoopRun, front: Front, folder: Path, watch: _Watch) -> None:
    from paretoik.review.loop_plots import loop_picture  # here: matplotlib takes its time

    front.save(folder)
    _steps_table(run, folder / STEPS)
    assert watch.recorder is not None
    watch.recorder.finish(None, explain_choice(front))
    loop_picture(run.motion, run.values, _natural(run), front, folder / PICTURE)


def _natural(run: ClosedLoopRun) -> np.ndarray:
    """Return the best and the worst of every objective on each step's front, (steps, n_obj, 2), in their own sign."""
    found: np.ndarray = run.ranges * run.loop.signs[:, None]
    return found


def _steps_table(run: ClosedLoopRun, file: Path) -> None:
    """Write a row a step: sample, time, and of every objective what was chosen, the best and the worst on the front."""
    import pyarrow as pa
    from pyarrow import parquet

    samples, ranges = np.arange(1, len(run.q)), _natural(run)
    columns: dict[str, np.ndarray] = {"sample": samples, "time": run.task.times[samples]}
    for axis, name in enumerate(run.loop.names):
        columns[f"chosen {name}"] = run.values[:, axis]
        columns[f"best {name}"], columns[f"worst {name}"] = ranges[:, axis].T
    content = BytesIO()
    parquet.write_table(pa.table(columns), content)
    replace_file(file, content.getvalue())
