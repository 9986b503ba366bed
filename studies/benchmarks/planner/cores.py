"""Both cores: two processes solve the peers' questions, half each."""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from studies.benchmarks.planner.compiling import compiled
from studies.benchmarks.planner.peers import Question, Settings, Solved, solved

CORES = 2


class Cores:
    """Both cores: two processes, each with solvers of its own that stay built."""

    def __enter__(self) -> Cores:
        self._workers = [ProcessPoolExecutor(1, mp_context=get_context("spawn")) for _ in range(CORES)]
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self._workers:
            worker.shutdown()

    def built(self, question: Question, settings: Settings, starts: np.ndarray, masses: str = "printed") -> float:
        """Build the question's solvers on both, and try one start; return the seconds."""
        begin = time.perf_counter()
        self._all(question, settings, masses, [starts[:1]] * CORES, [None] * CORES)
        return time.perf_counter() - begin

    def compiled(self, questions: Sequence[Question], folder: Path) -> list[tuple[Question, float]]:
        """Return questions compiled into libraries, and the seconds of each."""
        futures = [self._workers[i % CORES].submit(compiled, one, folder) for i, one in enumerate(questions)]
        return [future.result() for future in futures]

    def solve(
        self,
        question: Question,
        settings: Settings,
        masses: str,
        starts: np.ndarray,
        caps: np.ndarray | None = None,
    ) -> list[Solved]:
        """Return the solutions from starts, each core its half."""
        shares = [slice(w, None, CORES) for w in range(CORES)]
        parts = self._all(
            question,
            settings,
            masses,
            [starts[share] for share in shares],
            [None if caps is None else caps[share] for share in shares],
        )
        return [parts[i % CORES][i // CORES] for i in range(len(starts))]

    def _all(
        self,
        question: Question,
        settings: Settings,
        masses: str,
        starts: Sequence[np.ndarray],
        caps: Sequence[np.ndarray | None],
    ) -> list[list[Solved]]:
        futures = [
            worker.submit(solved, question, settings, masses, q, cap)
            for worker, q, cap in zip(self._workers, starts, caps, strict=True)
        ]
        return [future.result() for future in futures]
