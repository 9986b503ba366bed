"""The report of a front: one page of HTML that needs nothing else and loads nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Int

from paretoik.arrays import Values
from paretoik.file_replacement import replace_file
from paretoik.front.choices import Choices
from paretoik.front.compromise import compromise
from paretoik.front.front import Front
from paretoik.front.marked_rows import best_rows
from paretoik.review.report.report_page import ReportPage
from paretoik.search.insertion import greedy_order


@dataclass(frozen=True, kw_only=True)
class ReportOptions:
    """The most bytes of a page, and the most points that it lists and draws.

    Where there is no room for so many, there are fewer; at least one point and the script are on every page.
    """

    size: int = 5_000_000
    points: int = 2_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Steps:
    """What a closed loop chose at every step: times (steps,), and (steps, n_obj) the chosen, best and worst values."""

    times: Values
    chosen: np.ndarray
    best: np.ndarray
    worst: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Report:
    """What a page is made of: a front, choices kept in its run, sentences about it, steps of a closed loop.

    ``nearest`` says that the only point of the front is none: it comes nearest to being feasible where nothing is.
    """

    front: Front
    title: str
    choices: Choices = field(default_factory=Choices)
    notes: Sequence[str] = ()
    steps: Steps | None = None
    nearest: bool = False
    options: ReportOptions = field(default_factory=ReportOptions)

    def write(self, file: Path) -> None:
        """Write the page; raises InvalidInput where that fails."""
        replace_file(file, self.page().encode())

    def page(self) -> str:
        """Return the page; the same report makes the same page."""
        count = min(self.options.points, len(self.front))
        while True:
            page = ReportPage(report=self, rows=self._rows(count))
            room = self.options.size - page.size_without_motions
            if room >= 0 or count <= 1:
                return page.render(room)
            count //= 2

    def _rows(self, count: int) -> Int[np.ndarray, " points"]:
        """Return the rows of so many points: those marked first, then each next one far from all before (MaxiMin)."""
        front, first = self.front, (list(self.marks) or [0])[:count]
        return greedy_order(front.shares, count, np.full(len(front), np.inf), first)[0]

    @cached_property
    def marks(self) -> dict[int, str]:
        """Return the rows that are marked, and as what: chosen, best of an objective, compromise."""
        front = self.front
        if self.nearest:
            return dict.fromkeys(range(len(front)), "least-violating, not feasible")
        marks: dict[int, list[str]] = {}
        rows = {number: row for row, number in enumerate(front.ids.tolist())}
        chosen = self.choices.chosen
        others = [entry for entry in reversed(self.choices.entries) if entry is not chosen]
        for entry, words in ((chosen, "chosen"), *((each, "chosen once") for each in others)):
            if entry is not None and entry.point in rows:
                marks.setdefault(rows[entry.point], []).append(words)
        if len(front) > 1:
            marks.setdefault(compromise(front).index, []).append("compromise")
            for row, name in zip(best_rows(front.minimised, front.ids), front.names, strict=True):
                marks.setdefault(row, []).append(f"best {name}")
        return {row: ", ".join(dict.fromkeys(words)) for row, words in marks.items()}
