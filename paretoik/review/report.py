"""The report of a front: one self-contained page of HTML that loads nothing."""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cache, cached_property
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Values
from paretoik.formulations.protocol import task_of
from paretoik.front.choice_tree import Choices
from paretoik.front.comparison import flatten
from paretoik.front.front import Front
from paretoik.front.points import take
from paretoik.front.preferences.knee_and_compromise import best_rows, compromise
from paretoik.review.outlines import obstacle_lines
from paretoik.review.palette import PAPER, objective_label
from paretoik.runs.executor import computed_text
from paretoik.runs.file_replacement import replace_file
from paretoik.search.maximin import greedy_order
from paretoik.task.limits import JOINT_UNITS, LIMITED, is_sliding
from paretoik.task.motion import Motion

# Motions in a report: curves and arms in small blocks, one per point, as many as fit.


@dataclass(frozen=True, kw_only=True, eq=False)
class ReportMotions:
    """Motions of a front for a page: ``channels`` (points, channels, time), and the scene around them.

    A channel is the time [s], a joint's position, velocity, acceleration, torque or power, or a coordinate of a node of
    the arm. Motions of an unknown arm have only time and positions.
    """

    front: Front

    @property
    def motions(self) -> Any:
        """The motions of the front."""
        return self.front.motions

    @property
    def has_arm(self) -> bool:
        """Whether the arm is known; otherwise there are only positions."""
        return isinstance(self.motions, Motion)

    @cached_property
    def channels(self) -> Float[np.ndarray, "points channels time"]:
        """All quantities that change with time."""
        motions = self.motions
        parts = [np.asarray(motions.time)[..., None], motions.q]
        if self.has_arm:
            parts += [getattr(motions, LIMITED[kind]) for kind in self.kinds[1:]]
            parts.append(self._nodes.reshape(*self._nodes.shape[:2], -1))
        return np.moveaxis(np.concatenate(parts, axis=-1), -1, 1)

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """The drawn joint quantities; torques and powers are left out if they are all 0."""
        massless = not np.any(self.motions.torque)
        return tuple(kind for kind in JOINT_UNITS if not (massless and kind in ("torque", "power")))

    @cached_property
    def _nodes(self) -> Float[np.ndarray, "points time nodes axes"]:
        return np.asarray(self.motions.links[..., : 2 if self.motions.arm.is_planar else 3], dtype=float)

    @cached_property
    def _ranges(self) -> tuple[Float[np.ndarray, " channels"], Float[np.ndarray, " channels"]]:
        low, high = self.channels.min(axis=(0, 2)), self.channels.max(axis=(0, 2))
        return low, np.where(high > low, high - low, 1.0) / 65535  # values are integers of 16 bits

    def block(self, row: int) -> str:
        """Return the channels of a point as text.

        It encodes the differences between samples (16 bits each, all low bytes first) by gzip and base64.
        """
        low, step = self._ranges
        whole = np.round((self.channels[row] - low[:, None]) / step[:, None]).astype(np.uint16)
        changes = np.diff(whole, axis=1, prepend=np.uint16(0))  # modulo 2¹⁶, small where curves are smooth
        planes = np.concatenate([(changes & 255).ravel(), (changes >> 8).ravel()]).astype(np.uint8)
        return base64.b64encode(gzip.compress(planes.tobytes(), 9, mtime=0)).decode()

    def blocks(self, rows: Sequence[int], room: int) -> dict[int, str]:
        """Return blocks by point id: those of the first ``rows``, as many as fit into ``room`` bytes."""
        blocks: dict[int, str] = {}
        for row in rows:
            number, block = int(self.front.ids[row]), self.block(row)
            room -= len(f'"{number}":"{block}",')
            if room < 0:
                break
            blocks[number] = block
        return {number: blocks[number] for number in self.front.ids.tolist() if number in blocks}

    def description(self) -> dict[str, Any]:
        """Return what the page needs to draw blocks: joints, quantities, limits, arm, path and obstacles."""
        (low, step), motions, task = self._ranges, self.motions, task_of(self.front.problem)
        names = motions.arm.joint_names
        described: dict[str, Any] = {
            "joints": list(names),
            "samples": self.channels.shape[2],
            "low": _digits(low, 9),
            "step": _digits(step, 9),
            "standing": bool((np.ptp(motions.q, axis=1) == 0).all()),
            "quantities": [{"name": "position", "units": ["rad or m"] * len(names)}],
        }
        if not self.has_arm:
            return described
        described["quantities"] = [
            {"name": kind, "units": [JOINT_UNITS[kind][int(slides)] for slides in is_sliding(motions.arm)]}
            for kind in self.kinds
        ]
        described["limits"] = {
            kind: {
                "times": _digits(task.times) if task is not None and len(each) > 1 else None,
                "lower": _digits(each[..., 0].T),
                "upper": _digits(each[..., 1].T),
            }
            for kind, each in ({} if task is None else task.bounds).items()
        }
        nodes, directions = self._nodes, getattr(self.front.problem, "directions", None)
        planar, flat = motions.arm.is_planar, nodes.reshape(-1, nodes.shape[-1])
        height = None if planar else (float(flat[:, -1].min()), float(flat[:, -1].max()))
        lines = obstacle_lines(motions.obstacles, height, flat)
        paths = [np.asarray(each.path.positions)[:, : nodes.shape[-1]] for each in motions.tasks]
        shown = np.concatenate([flat, *lines, *paths])
        described["arm"] = {
            "planar": planar,
            "nodes": nodes.shape[2],
            "radius": motions.link_radius,
            "low": _digits(shown.min(axis=0)),
            "high": _digits(shown.max(axis=0)),
            "paths": [_digits(path, 5) for path in paths if np.ptp(path, axis=0).any()],
            "obstacles": [_digits(line, 5) for line in lines],
            "arrows": [
                {"axis": axis, "along": _digits(vector)}
                for axis, vector in enumerate([] if directions is None else directions)
            ],
        }
        return described


def _digits(values: np.ndarray, digits: int = 6) -> Any:
    """Return nested numbers with ``digits`` significant digits; None if they are not finite."""
    values = np.asarray(values, dtype=float)
    rounded = [float(f"{value:.{digits}g}") if np.isfinite(value) else None for value in values.ravel()]
    return np.array(rounded, dtype=object).reshape(values.shape).tolist()


SCRIPTS = ("page.js", "front.js", "curves.js", "arm.js", "start.js")


@dataclass(frozen=True, kw_only=True, eq=False)
class ReportPage:
    """The page for the points ``rows`` of a front, whose motions get space in this order."""

    report: Report
    rows: Int[np.ndarray, " points"]

    @cached_property
    def front(self) -> Front:
        """The points of the page in the order of the front."""
        return take(self.report.front, np.sort(self.rows))

    @cached_property
    def _marks(self) -> dict[int, str]:
        """The marks of the points of the page, by their id."""
        ids, marks = self.report.front.ids, self.report.marks
        return {int(ids[row]): marks[row] for row in self.rows.tolist() if row in marks}

    @cached_property
    def _motions(self) -> ReportMotions | None:
        front = self.front
        return ReportMotions(front=front) if front.motions is not None and len(front) else None

    @cached_property
    def _data(self) -> dict[str, Any]:
        """The data of the script, except the motions."""
        front, certificates, whole = self.front, self.front.certificates, self.report.front
        steps = self.report.steps
        branches: list[list[int]] | None = None  # ids of each branch of optima, in order; None if unknown
        if (jumps := whole.jumps) is not None:
            branches, on_page = [whole.ids[:1].tolist()], set(front.ids.tolist())
            for pair in pairwise(whole.ids.tolist()):
                branches += [[]] if pair in jumps else []
                branches[-1].append(pair[1])
            branches = [[number for number in branch if number in on_page] for branch in branches]
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
            "start": int(whole.ids[self.rows[0]]) if len(self.rows) else None,
            "status": None if certificates is None else certificates.status.tolist(),
            "rates": None if certificates is None else _digits(certificates.exchange_intervals, 5),
            "branches": branches,
            "nearest": self.report.nearest,
            "motions": None if self._motions is None else self._motions.description(),
            "steps": steps and {part.name: _digits(getattr(steps, part.name), 5) for part in fields(steps)},
            "colours": {"accents": PAPER.accents, "quiet": PAPER.quiet, "ink": PAPER.ink, "grid": PAPER.grid},
        }

    def render(self, room: int) -> str:
        """Return the page with as many motions as fit into ``room`` bytes."""
        from jinja2 import Environment, StrictUndefined

        order = np.searchsorted(np.sort(self.rows), self.rows)  # rows in the page's front
        blocks = {} if self._motions is None else self._motions.blocks(order.tolist(), room)
        front, whole, certificates = self.front, self.report.front, self.front.certificates
        (bundle, packed), rows = plotly_bundle(), list[dict[str, Any]]()
        script = "\n".join(_page_file(name) for name in SCRIPTS)
        provenance = {name: value for name, value in whole.provenance.items() if name != "solved"}
        if "computed" in provenance:
            provenance["computed"] = computed_text(provenance["computed"])
        checks = [(name, meaning) for name, (meaning, _) in self._checks.items()]
        checks += [("certificate", "local type of the point")] * (certificates is not None)
        for row, number in enumerate(front.ids.tolist()):
            cells = [f"{value:.6g}" for value in front.objectives[row]]
            for value in (values[row] for _, values in self._checks.values()):
                cells.append("0" if value == 0 else f"{value:.1e}" if np.isfinite(value) else "unknown")
            texts = {
                name: "" if certificates is None else str(getattr(certificates, name)[row])
                for name in ("status", "reason")
            }
            rows.append({"id": number, "cells": cells, "mark": self._marks.get(number, ""), **texts})
        # JSON, with all characters escaped that could end the script in HTML
        data = {**self._data, "blocks": {str(number): block for number, block in blocks.items()}}
        text = json.dumps(data, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
        for character in "<\u2028\u2029":
            text = text.replace(character, f"\\u{ord(character):04x}")
        environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
        moving = set(blocks) if self._motions is not None else set(front.ids.tolist())
        return environment.from_string(_page_file("page.html")).render(
            title=self.report.title,
            solved=self.report.solved,
            front=whole,
            nearest=self.report.nearest,
            rows=rows,
            checks=checks,
            columns=[objective_label(*each) for each in zip(front.names, front.units, front.maximised, strict=True)],
            notes=[line for note in self.report.notes for line in note.splitlines() if line],
            choices=self.report.choices,
            compromise=compromise(whole) if len(whole) > 1 else None,
            left_out=len(whole) - len(front),
            without_motion=[number for number in front.ids.tolist() if number not in moving],
            provenance=list(flatten(provenance).items()),
            has_rates=certificates is not None and len(front.names) > 1,
            style=_page_file("page.css"),
            script=script,
            hashes=[  # a browser runs only scripts with these hashes (Content Security Policy, level 2)
                "sha256-" + base64.b64encode(hashlib.sha256(each.encode()).digest()).decode()
                for each in (script, bundle)
            ],
            bundle=packed,
            data=text,
        )

    @cached_property
    def _checks(self) -> dict[str, tuple[str, Values]]:
        """Return the meaning and values of every check, by column head."""
        violated = "largest violation of a limit at the samples, as a share of its range"
        front, certificates = self.front, self.front.certificates
        if certificates is None:
            return {} if front.violation is None else {"violation": (violated, front.violation)}
        between = "largest violation of a limit between the samples, as a share of its range"
        critical = "improvement still possible in all objectives at once, as shares of their ranges"
        return {
            "violation": (violated, certificates.violation),
            "between samples": (between, certificates.violation_between),
            "criticality": (critical, certificates.criticality),
        } | {
            f"error of {name}": (f"difference between {name} and its value on the motion's curve", errors)
            for name, errors in zip(front.names, certificates.discretisation_error.T, strict=True)
            if np.isfinite(errors).any()
        }


@cache
def plotly_bundle() -> tuple[str, str]:
    """Return Plotly's JavaScript, plain and compressed (gzip and base64) to two fifths of its size."""
    from plotly.offline import get_plotlyjs

    source = str(get_plotlyjs())
    return source, base64.b64encode(gzip.compress(source.encode(), 9, mtime=0)).decode()


@cache
def _page_file(name: str) -> str:
    return files("paretoik.review").joinpath("page", name).read_text(encoding="utf-8")


@dataclass(frozen=True, kw_only=True)
class ReportOptions:
    """Largest size of a page [bytes], and largest number of its points.

    If the points do not fit, there are fewer, at least one.
    """

    size: int = 5_000_000
    points: int = 2_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Steps:
    """The choices of a closed loop: times (steps,), and chosen, best and worst values (steps, n_obj)."""

    times: Values
    chosen: np.ndarray
    best: np.ndarray
    worst: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Report:
    """The content of a page: what was solved, a front, its run's choices, notes, and steps of a closed loop.

    nearest: whether the front's only point is the least-violating one, not a feasible one
    """

    front: Front
    title: str
    solved: str = ""
    choices: Choices = field(default_factory=Choices)
    notes: Sequence[str] = ()
    steps: Steps | None = None
    nearest: bool = False
    options: ReportOptions = field(default_factory=ReportOptions)

    def write(self, file: Path) -> None:
        """Write the page; raises InvalidInput if that fails."""
        replace_file(file, self.page().encode())

    def page(self) -> str:
        """Return the page; the same report makes the same page."""
        count, first = min(self.options.points, len(self.front)), list(self.marks) or [0]
        while True:  # the marked points, then one by one the point farthest from all earlier ones (MaxiMin)
            distances = np.full(len(self.front), np.inf)
            rows = greedy_order(self.front.shares, count, distances, first[:count])[0]
            page = ReportPage(report=self, rows=rows)
            room = self.options.size - len(page.render(0).encode())  # for motions
            if room >= 0 or count <= 1:
                return page.render(room)
            count //= 2

    @cached_property
    def marks(self) -> dict[int, str]:
        """Return the marked rows with their marks: chosen, best of an objective, compromise."""
        front = self.front
        if self.nearest:
            return dict.fromkeys(range(len(front)), "least-violating, not feasible")
        marks: dict[int, list[str]] = {}
        rows = {number: row for row, number in enumerate(front.ids.tolist())}
        chosen = self.choices.chosen
        others = [entry for entry in reversed(self.choices.entries) if entry is not chosen]
        for entry, words in ((chosen, "chosen"), *((each, "chosen before") for each in others)):
            if entry is not None and entry.point in rows:
                marks.setdefault(rows[entry.point], []).append(words)
        if len(front) > 1:
            marks.setdefault(compromise(front).index, []).append("compromise")
            for row, name in zip(best_rows(front.minimised, front.ids), front.names, strict=True):
                marks.setdefault(row, []).append(f"best {name}")
        return {row: ", ".join(dict.fromkeys(words)) for row, words in marks.items()}
