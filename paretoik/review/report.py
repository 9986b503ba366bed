"""The report of a front: one page of HTML that needs nothing else and loads nothing."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache, cached_property
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.arrays import Values
from paretoik.front.choices import Choices
from paretoik.front.compromise import compromise
from paretoik.front.front import Front
from paretoik.front.marked_rows import best_rows
from paretoik.front.provenance import flatten
from paretoik.review.palette import PAPER, objective_label
from paretoik.review.report_motions import ReportMotions, spread_rows
from paretoik.run_files import replace_file

SCRIPTS = ("page.js", "front.js", "curves.js", "arm.js", "start.js")


@dataclass(frozen=True, kw_only=True)
class ReportOptions:
    """The most bytes of a page, and the most points that it lists and draws."""

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
    """What a page is made of: a front, choices kept in its run, sentences about it, steps of a closed loop."""

    front: Front
    title: str
    choices: Choices = field(default_factory=Choices)
    notes: Sequence[str] = ()
    steps: Steps | None = None
    options: ReportOptions = field(default_factory=ReportOptions)

    def write(self, file: Path) -> None:
        """Write the page; raises InvalidInput where that fails."""
        replace_file(file, self.page().encode())

    def page(self) -> str:
        """Return the page; the same report makes the same page."""
        front, rows = self.front, self._rows()
        moving = ReportMotions(front=front) if front.motions is not None and len(front) else None
        data = self._data(rows, moving)
        empty = self._render(rows, data, blocks={})
        if moving is None:
            return empty
        blocks = moving.blocks(rows.tolist(), self.options.size - len(empty.encode()) - 2_000)
        return self._render(rows, data, blocks=blocks)

    def _rows(self) -> np.ndarray:
        """Return the rows of the points of the page, the most telling first, then evenly over the front."""
        if not len(self.front):
            return np.zeros(0, dtype=int)
        return spread_rows(self.front, self._marks)[: self.options.points]

    @cached_property
    def _marks(self) -> dict[int, str]:
        """Return the rows that are marked, and as what: chosen, best of an objective, compromise."""
        front = self.front
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

    def _data(self, rows: np.ndarray, moving: ReportMotions | None) -> dict[str, Any]:
        front, shown, marks = self.front, np.sort(rows), self._marks
        certificates = None if front.certificates is None else front.certificates[shown]
        return {
            "objectives": [
                {"name": name, "unit": unit, "maximised": maximised, "label": objective_label(name, unit, maximised)}
                for name, unit, maximised in zip(front.names, front.units, front.maximised, strict=True)
            ],
            "ids": front.ids[shown].tolist(),
            "values": front.objectives[shown].tolist(),
            "shares": np.round(front.shares[shown], 5).tolist(),
            "ranges": front.ranges.tolist(),
            "marks": {str(front.ids[row]): words for row, words in marks.items()},
            "start": int(front.ids[rows[0]]) if len(rows) else None,
            "status": None if certificates is None else certificates.status.tolist(),
            "rates": None if certificates is None else _significant(certificates.exchange_intervals),
            "branches": self._branches(shown),
            "motions": None if moving is None else moving.description(),
            "steps": None if self.steps is None else {
                part.name: _significant(np.asarray(getattr(self.steps, part.name))) for part in fields(self.steps)
            },
            "colours": {"accents": PAPER.accents, "quiet": PAPER.quiet, "ink": PAPER.ink, "grid": PAPER.grid},
        }  # fmt: skip

    def _branches(self, shown: np.ndarray) -> list[list[int]] | None:
        """Return the ids of each branch of optima of two objectives in order; None where jumps are not known."""
        jumps = self.front.jumps
        if jumps is None:
            return None
        branches: list[list[int]] = [self.front.ids[:1].tolist()]
        for pair in pairwise(self.front.ids.tolist()):
            if pair in jumps:
                branches.append([])
            branches[-1].append(pair[1])
        on_page = set(self.front.ids[shown].tolist())
        return [[number for number in branch if number in on_page] for branch in branches]

    def _render(self, rows: np.ndarray, data: dict[str, Any], *, blocks: Mapping[int, str]) -> str:
        front, shown = self.front, np.sort(rows)
        moving = front.ids[sorted(blocks)].tolist()
        blocks_by_id = {str(front.ids[row]): blocks[row] for row in sorted(blocks)}
        script = "\n".join(_page_file(name) for name in SCRIPTS)
        return str(
            _template().render(
                title=self.title,
                front=front,
                rows=[self._table_row(row) for row in shown.tolist()],
                checks=self._check_heads(),
                columns=[
                    objective_label(*each) for each in zip(front.names, front.units, front.maximised, strict=True)
                ],
                notes=[line for note in self.notes for line in note.splitlines() if line],
                choices=self.choices,
                compromise=compromise(front) if len(front) > 1 else None,
                left_out=len(front) - len(shown),
                without_motion=[number for number in front.ids[shown].tolist() if number not in moving],
                moving=moving,
                provenance=list(flatten(front.provenance).items()),
                has_rates=front.certificates is not None and len(front.names) > 1,
                style=_page_file("page.css"),
                script=script,
                hashes=[_hash(script), _hash(plotly_bundle())],
                bundle=_packed_bundle(),
                data=_embed({**data, "blocks": blocks_by_id}),
            )
        )

    @cached_property
    def _checks(self) -> dict[str, tuple[str, Values]]:
        """Return what is checked of every point, by the head of its column: what that means, and the values."""
        violated = "worst of all limits at the samples, as a share of its range"
        front, certificates = self.front, self.front.certificates
        if certificates is None:
            return {} if front.violation is None else {"violation": (violated, front.violation)}
        between = "worst of all limits between the samples, as a share of its range"
        critical = "improvement that all objectives can still gain at once, as shares of their ranges"
        return {
            "violation": (violated, certificates.violation),
            "between samples": (between, certificates.violation_between),
            "criticality": (critical, certificates.kkt_residual),
        }

    def _check_heads(self) -> list[tuple[str, str]]:
        heads = [(name, meaning) for name, (meaning, _) in self._checks.items()]
        certified = self.front.certificates is not None
        return [*heads, *[("certificate", "what a point is, locally")] * certified]

    def _table_row(self, row: int) -> dict[str, Any]:
        front = self.front
        cells = [f"{value:.6g}" for value in front.objectives[row]]
        cells += [_size(values[row]) for _, values in self._checks.values()]
        status, reason = "", ""
        if front.certificates is not None:
            status, reason = str(front.certificates.status[row]), str(front.certificates.reason[row])
        mark = self._marks.get(row, "")
        return {"id": int(front.ids[row]), "cells": cells, "status": status, "reason": reason, "mark": mark}


@cache
def plotly_bundle() -> str:
    """Return Plotly's JavaScript."""
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs())


@cache
def _packed_bundle() -> str:
    """Return Plotly's JavaScript, gzip and base64: two fifths of its size, so that motions have room."""
    return base64.b64encode(gzip.compress(plotly_bundle().encode(), 9, mtime=0)).decode()


@cache
def _page_file(name: str) -> str:
    return files("paretoik.review").joinpath("page", name).read_text(encoding="utf-8")


@cache
def _template() -> Any:
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(_page_file("page.html"))


def _hash(script: str) -> str:
    """Return what lets a browser run this script and no other (Content Security Policy, level 2)."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def _embed(data: Mapping[str, Any]) -> str:
    """Return JSON that no HTML parser can leave: "<" is written as JSON writes other characters."""
    text = json.dumps(data, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def _size(value: float) -> str:
    return "0" if value == 0 else f"{value:.1e}" if np.isfinite(value) else "unknown"


def _significant(values: np.ndarray) -> Any:
    """Return nested numbers to 5 digits, None where they are not finite."""
    rounded = [float(f"{value:.5g}") if np.isfinite(value) else None for value in values.ravel()]
    return np.array(rounded, dtype=object).reshape(values.shape).tolist()
