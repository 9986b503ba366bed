"""The page of a report: what its script is told, its table, and the frame around them."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache, cached_property
from importlib.resources import files
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Int

from paretoik.arrays import Values
from paretoik.execution.computation import computed_text
from paretoik.front.compromise import compromise
from paretoik.front.front import Front
from paretoik.front.provenance import flatten
from paretoik.front.subset import take
from paretoik.review.palette import PAPER, objective_label
from paretoik.review.report.report_motions import ReportMotions

if TYPE_CHECKING:  # a report asks this file for its page
    from paretoik.review.report.report import Report

SCRIPTS = ("page.js", "front.js", "curves.js", "arm.js", "start.js")


@dataclass(frozen=True, kw_only=True, eq=False)
class ReportPage:
    """Some points of a report's front as a page: their ``rows`` in the order in which motions get room."""

    report: Report
    rows: Int[np.ndarray, " points"]

    @property
    def size_without_motions(self) -> int:
        """The bytes of the page if no motion has room."""
        return len(self._render({}).encode())

    def render(self, room: int) -> str:
        """Return the page with as many motions as fit into so many bytes."""
        return self._render({} if self._motions is None else self._motions.blocks(self._order.tolist(), room))

    @cached_property
    def front(self) -> Front:
        """The points of the page in the order of the front."""
        return take(self.report.front, np.sort(self.rows))

    @property
    def _order(self) -> Int[np.ndarray, " points"]:
        """The rows in the page's front."""
        return np.searchsorted(np.sort(self.rows), self.rows)

    @cached_property
    def _marks(self) -> dict[int, str]:
        """What the points of the page are marked as, by their id."""
        ids, marks = self.report.front.ids, self.report.marks
        return {int(ids[row]): marks[row] for row in self.rows.tolist() if row in marks}

    @cached_property
    def _motions(self) -> ReportMotions | None:
        front = self.front
        return ReportMotions(front=front) if front.motions is not None and len(front) else None

    @cached_property
    def _data(self) -> dict[str, Any]:
        """What the script is told, except the motions themselves."""
        front, steps, certificates = self.front, self.report.steps, self.front.certificates
        return {
            "objectives": [
                {"name": name, "unit": unit, "maximised": maximised, "label": objective_label(name, unit, maximised)}
                for name, unit, maximised in zip(front.names, front.units, front.maximised, strict=True)
            ],
            "ids": front.ids.tolist(),
            "values": front.objectives.tolist(),
            "shares": np.round(front.shares, 5).tolist(),
            "ranges": front.ranges.tolist(),
            "marks": {str(number): words for number, words in self._marks.items()},
            "start": int(self.report.front.ids[self.rows[0]]) if len(self.rows) else None,
            "status": None if certificates is None else certificates.status.tolist(),
            "rates": None if certificates is None else _significant(certificates.exchange_intervals),
            "branches": self._branches(),
            "nearest": self.report.nearest,
            "motions": None if self._motions is None else self._motions.description(),
            "steps": None if steps is None else {
                part.name: _significant(np.asarray(getattr(steps, part.name))) for part in fields(steps)
            },
            "colours": {"accents": PAPER.accents, "quiet": PAPER.quiet, "ink": PAPER.ink, "grid": PAPER.grid},
        }  # fmt: skip

    def _branches(self) -> list[list[int]] | None:
        """Return the ids of each branch of optima of two objectives in order; None where jumps are not known."""
        whole = self.report.front
        jumps = whole.jumps
        if jumps is None:
            return None
        branches: list[list[int]] = [whole.ids[:1].tolist()]
        for pair in pairwise(whole.ids.tolist()):
            if pair in jumps:
                branches.append([])
            branches[-1].append(pair[1])
        on_page = set(self.front.ids.tolist())
        return [[number for number in branch if number in on_page] for branch in branches]

    def _render(self, blocks: Mapping[int, str]) -> str:
        """Return the page with the motions of some points, by their id."""
        front, whole = self.front, self.report.front
        script = "\n".join(_page_file(name) for name in SCRIPTS)
        return str(
            _template().render(
                title=self.report.title,
                front=whole,
                nearest=self.report.nearest,
                rows=[self._table_row(row) for row in range(len(front))],
                checks=self._check_heads(),
                columns=[
                    objective_label(*each) for each in zip(front.names, front.units, front.maximised, strict=True)
                ],
                notes=[line for note in self.report.notes for line in note.splitlines() if line],
                choices=self.report.choices,
                compromise=compromise(whole) if len(whole) > 1 else None,
                left_out=len(whole) - len(front),
                without_motion=[]
                if self._motions is None
                else [number for number in front.ids.tolist() if number not in blocks],
                provenance=list(flatten({**whole.provenance, **_computed_by(whole.provenance)}).items()),
                has_rates=front.certificates is not None and len(front.names) > 1,
                style=_page_file("page.css"),
                script=script,
                hashes=[_hash(script), _hash(plotly_bundle())],
                bundle=_packed_bundle(),
                data=_embed({**self._data, "blocks": {str(number): block for number, block in blocks.items()}}),
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
            "criticality": (critical, certificates.criticality),
        } | {
            f"error of {name}": (f"how far {name} is off its value on the motion's curve", errors)
            for name, errors in zip(front.names, certificates.discretisation_error.T, strict=True)
            if np.isfinite(errors).any()
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
        number = int(front.ids[row])
        return {"id": number, "cells": cells, "status": status, "reason": reason, "mark": self._marks.get(number, "")}


def _computed_by(provenance: Mapping[str, Any]) -> dict[str, str]:
    """Return who computed a run in words, by the name of that entry; nothing where it has none."""
    return {"computed": computed_text(provenance["computed"])} if "computed" in provenance else {}


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
    return files("paretoik.review.report").joinpath("page", name).read_text(encoding="utf-8")


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
