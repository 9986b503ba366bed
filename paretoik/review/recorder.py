"""What is recorded of a run, and its recorder, whose failure never stops the run."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Ids, Objectives, Values
from paretoik.formulations.protocol import Timeline
from paretoik.front.front import Choice, Front
from paretoik.robot.arm import Arm

Population: TypeAlias = Float[np.ndarray, "individuals n_obj"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Generation:
    """One generation of a search: the objectives of its population and front in the user's own sign, the front's ids.

    ``hypervolume`` is in the product of the objectives' units, ``failed`` counts evaluations that gave no number. A
    step of a closed loop has no hypervolume, but a point of its front, ``chosen``, that was taken. A step of an ε-sweep
    has all points so far for a population, and ``epsilon`` (n_obj,), the bounds under which it minimised, infinite for
    what was minimised; its ids are those of the sweep alone. A refined front has the front before it for a population,
    and ``origins`` (points, n_obj), where its points were there.
    """

    number: int
    population: Population
    front: Objectives
    front_ids: Ids
    hypervolume: float | None = None
    failed: int = 0
    chosen: Values | None = None
    epsilon: Values | None = None
    origins: Objectives | None = None


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


class Recorder:
    """Writes ``file`` while a run goes on, a generation at a time, and once more at its end.

    Finished generations survive a killed process. A recording is a view of the run and not its archive: an error of
    it, Rerun missing included, gives one warning and ends the recording, never the run.
    """

    def __init__(
        self,
        file: Path | str,
        *,
        title: str,
        names: Sequence[str],
        units: Sequence[str],
        maximised: Sequence[bool],
        timeline: Timeline = "generation",
    ) -> None:
        self._file = Path(file)
        self._recording: Any = None
        self._working = True

        def start() -> None:
            from paretoik.review.recording import Recording
            from paretoik.review.search_scene import SearchScene

            scene = SearchScene(names=tuple(names), units=tuple(units), maximised=tuple(maximised), timeline=timeline)
            self._recording = Recording(self._file, title=title, scene=scene)

        self._attempt(start)

    def record(self, generation: Generation) -> None:
        """Append `generation` to the file."""
        self._attempt(lambda: self._recording.record(generation))

    def finish(self, front: Front | None, choice: Choice | None = None, searched: Sequence[SearchedStep] = ()) -> None:
        """Write the file anew: all generations on one set of axes, `front` at their end, `choice` and its motion.

        Without a front the generations are the steps of a closed loop, one to each sample of the motion, and some of
        them may be ``searched``.
        """
        self._attempt(lambda: self._recording.finish(front, choice, searched))

    def close(self) -> None:
        """Close the file."""
        self._attempt(lambda: self._recording.close())

    def _attempt(self, step: Callable[[], None]) -> None:
        if not self._working:
            return
        try:
            step()
        except Exception as fault:  # a view may fail in any way; the run that it looks at must not
            self._working = False
            with suppress(Exception):
                self._recording.close()
            cause = (str(fault).splitlines() or [type(fault).__name__])[0]
            warnings.warn(f"{self._file}: recording stopped, the run goes on: {cause}", RuntimeWarning, stacklevel=3)
