"""Follow a closed loop; save its motion as a one-point front."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from paretoik.api.session import Session, SolveSettings
from paretoik.closed_loop.loop import StepRecord, choose, nondominated_rows
from paretoik.closed_loop.step_evolution import Generations
from paretoik.compilation_notices import computing_clock
from paretoik.errors import InvalidInput
from paretoik.formulations.closed_loop import ClosedLoop, ClosedLoopRun, explain_choice
from paretoik.formulations.control_step import check_steps
from paretoik.front.front import Front
from paretoik.progress import RunProgress
from paretoik.review.recording.messages import workcell_of
from paretoik.review.recording.recorder import Generation, SearchedFront, SearchedStep, SearchEnd
from paretoik.runs.file_replacement import replace_file
from paretoik.runs.files import PICTURE, SEARCHES, STEPS, array_bytes, table_bytes

SEARCH_SETTINGS = (
    *("initial", "evaluations", "target", "anchors", "algorithm", "refine", "solver"),
    *("islands", "workers", "cluster", "evaluation_timeout"),
)  # settings that a closed loop does not have


class LoopRun:
    """The run of a closed loop, whose front has one point.

    The point is the motion, with the mean of each objective over the steps.

    If a signal or the time limit ends the run early, the motion has the steps so far. Raises InvalidInput, naming the
    setting, for a setting of a search.
    """

    def __init__(self, problem: ClosedLoop, settings: SolveSettings) -> None:
        for name in SEARCH_SETTINGS:
            value, default = getattr(settings, name), getattr(SolveSettings, name)
            if value is not default and not (isinstance(value, str | int | np.integer) and value == default):
                raise InvalidInput(
                    f"{name} must be used with a search for a front, got a closed loop, which is followed step by step"
                )
        self.problem = problem.changed(
            population=settings.population, generations=settings.generations, seed=settings.seed
        )
        self.time_limit = settings.time_limit
        self.record_steps = sorted(check_steps(settings.record_steps, len(self.problem.task.times) - 1))
        self.settings = {
            "weights": self.problem.named_weights,
            "population": self.problem.population,
            "generations": self.problem.generations,
            "seed": self.problem.seed,
            "warm_start": self.problem.warm_start,
            "time_limit": settings.time_limit,
            "record_steps": self.record_steps,
        }

    def run(self, session: Session) -> Front:
        """Follow the loop; return, save and draw a front of one point."""
        loop = self.problem
        steps = len(loop.task.times) - 1
        session.show(RunProgress(stage="beginning"))  # the search for a start may take a while
        loop.prepare()
        units, maximised = zip(*((each.unit, each.maximise) for each in loop.objectives), strict=True)
        session.start_recording(
            SearchedFront(
                names=loop.names, units=units, maximised=maximised, timeline="step", workcell=workcell_of(loop)
            )
        )
        started = computing_clock()

        def show(step: StepRecord) -> None:
            F = step.front.F * loop.signs
            generation = Generation(
                number=step.sample, population=F[:0], front=F, front_ids=np.arange(len(F)), chosen=F[step.index]
            )
            seconds = computing_clock() - started
            progress = RunProgress(stage="step", done=step.sample, total=steps, seconds=seconds)
            session.show(replace(progress, summary=f"front {len(F)}", generation=generation))

        def is_over() -> bool:
            late = self.time_limit is not None and computing_clock() - started >= self.time_limit
            return late or session.signal is not None

        run = loop.run(record_steps=self.record_steps, observe=show, should_stop=is_over)
        status, done = "end of the path", len(run.q) - 1
        if done < steps:
            status = session.signal or "time limit"
        front = run.front(session.ended(status, steps=done, of=steps))
        ranges = run.ranges * loop.signs[:, None]  # best and worst values in the user's own sign

        def end() -> SearchEnd:
            assert session.folder is not None
            recorded = [(one.sample, one.generations) for one in run.fronts.values() if one.generations is not None]
            searched = [_searched_step(run, sample, generations) for sample, generations in recorded]
            _save_steps(run, ranges, searched, session.folder)
            return SearchEnd(front=None, choice=explain_choice(front), searched=searched)

        def draw(folder: Path) -> None:
            from paretoik.review.pictures.motions import loop_picture  # here: matplotlib loads slowly

            loop_picture(run.motion, run.values, ranges, front, folder / PICTURE)

        session.finish(front, partial(front.save, overwrite=True), status=status, end=end, draw=draw)
        return front


def _searched_step(run: ClosedLoopRun, sample: int, generations: Generations) -> SearchedStep:
    """Return the search of a step, with each generation's front and choice, in the user's own sign."""
    loop = run.loop
    fronts = [nondominated_rows(F) for F in generations.F]
    chosen = [
        front[choose(F[front], loop.weights)] if len(front) else -1
        for F, front in zip(generations.F, fronts, strict=True)
    ]
    position = loop.task.tasks[0].path.positions[sample]
    return SearchedStep(
        sample=sample,
        arm=loop.task.arm,
        objectives=generations.F * loop.signs,
        q=generations.q,
        fronts=fronts,
        chosen=np.array(chosen),
        target=np.pad(position, (0, 3 - len(position))),
    )


def _save_steps(run: ClosedLoopRun, ranges: np.ndarray, searched: Sequence[SearchedStep], folder: Path) -> None:
    """Write a table of the steps, and the recorded searches as plain arrays, all in the user's own sign.

    `steps.parquet` has one row per step: sample, time, and per objective the chosen, best and worst value on the front.
    `searches.npz`, one row per recorded step: ``steps`` (steps,), ``names`` and ``units`` (n_obj,), ``objectives``
    (steps, generations, individuals, n_obj), ``q`` (steps, generations, individuals, dof), ``on_front`` (steps,
    generations, individuals), and ``chosen`` (steps, generations): index of an individual, −1 if all failed.
    """
    import pyarrow as pa

    samples = np.arange(1, len(run.q))
    columns: dict[str, np.ndarray] = {"sample": samples, "time": run.task.times[samples]}
    for axis, name in enumerate(run.loop.names):
        columns[f"chosen {name}"] = run.values[:, axis]
        columns[f"best {name}"], columns[f"worst {name}"] = ranges[:, axis].T
    replace_file(folder / STEPS, table_bytes(pa.table(columns)))
    if not searched:
        return
    on_front = np.zeros((len(searched), *searched[0].q.shape[:2]), dtype=bool)
    for i, each in enumerate(searched):
        for number, front in enumerate(each.fronts):
            on_front[i, number, front] = True
    arrays = {
        "steps": np.array([each.sample for each in searched]),
        "names": np.array(run.loop.names, dtype=np.str_),
        "units": np.array([each.unit for each in run.loop.objectives], dtype=np.str_),
        "objectives": np.array([each.objectives for each in searched]),
        "q": np.array([each.q for each in searched]),
        "on_front": on_front,
        "chosen": np.array([each.chosen for each in searched]),
    }
    replace_file(folder / SEARCHES, array_bytes(arrays))
