"""The recording of a plan: its levels with their starts, then its optima and their motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr

from paretoik.review.drawing.axes import screen_text
from paretoik.review.drawing.charts import Chart, curve_points
from paretoik.review.drawing.layout import Entry, Layout, Legend, log_text, text_view
from paretoik.review.drawing.motion import MotionScene, ReplayClock, motion_views
from paretoik.review.drawing.plan_panel import PlanPanel
from paretoik.review.drawing.point_text import infeasible_text
from paretoik.review.palette import DRAWING, SCREEN, even_rows, screen_label
from paretoik.review.recording.messages import (
    PlanEnd,
    PlannedLevel,
    PlannedOptimum,
    PlannedScene,
    RecordedMotion,
    RecordedPoint,
)
from paretoik.review.words import counted, run_text
from paretoik.task.limits import JOINT_UNITS

# The texts of a plan, in Markdown.


def level_text(panel: PlanPanel, level: PlannedLevel) -> str:
    """Return the text of a level."""
    starts, failed = counted(len(level.starts), "start"), int((~np.isfinite(level.ends)).sum())
    if level.least_violating is not None:
        counts = f"{starts}; none led to a motion that keeps all limits. The arm shows the least-violating one."
    else:
        counts = f"{starts}, {counted(len(level.optima), 'distinct optimum', 'distinct optima')}"
        counts += f"; {failed} of the starts led to none." if failed else "."
    lines = [f"# Level {level.number}: {level.samples} samples", counts]
    if beyond := panel.beyond(level):
        lines.append(f"{counted(beyond, 'start')} too far off for the picture: dashes at its edge.")
    if len(panel.levels) > 1:
        lines.append("Values of different levels are not comparable: a motion of other samples has another value.")
    if level.least_violating is not None:
        lines += [
            "",
            "Constraints broken by the least-violating motion:",
            "",
            *(f"- {each}" for each in level.least_violating.broken),
        ]
        return screen_text("\n".join(lines))
    lines += ["", "## Optima of the level", ""]
    for place, value in enumerate(level.optima[: DRAWING.optima]):
        hits = int((level.motions.optimum == place).sum())
        lines.append(f"- {place}: {_value(panel.scene, value)}, from {counted(hits, 'start')}")
    lines += _further(len(level.optima))
    return screen_text("\n".join(lines))


def start_text(scene: PlannedScene, level: PlannedLevel, row: int) -> str:
    """Return the text of the start of a level at a row."""
    optimum = int(level.motions.optimum[row])
    lines = [
        f"# Start {row + 1} of the {len(level.starts)} of level {level.number}, {level.samples} samples",
        f"- begins with {_value(scene, level.starts[row])}",
    ]
    if np.isfinite(level.ends[row]):
        lines.append(f"- leads to {_value(scene, level.ends[row])}")
    if optimum >= 0:
        lines.append(f"- that is optimum {optimum} of the level's {len(level.optima)}")
    elif np.isfinite(level.ends[row]):
        lines.append("- an optimum that was not kept: there are too many, or perturbed ones lie near")
    else:
        lines.append("- leads to no optimum: the arm shows where its solver stopped")
    return screen_text("\n".join(lines))


def optimum_text(scene: PlannedScene, optima: Sequence[PlannedOptimum], place: int, count: int) -> str:
    """Return the text of a final optimum, of ``count`` in all."""
    optimum, best = optima[place], optima[0]
    value, least = float(optimum.point.objectives[0]), float(best.point.objectives[0])
    lines = [
        f"# Optimum {place} ({place + 1} of {count})" + (", the best" if place == 0 else ""),
        f"- **{scene.name}**{', more is better' if scene.maximised else ''}: {_value(scene, value)}"
        + (f", {100 * abs(value - least) / max(abs(least), 1e-300):.3g}% worse than the best" if place else ""),
        f"- branch {_branch(optimum)}: how each inner joint is bent, `~` before one that passes through straight"
        if optimum.branch
        else "",
        f"- {optimum.status} (local)",
        f"- violation {optimum.violation_between:.2g} of a limit's range on a finer grid"
        if np.isfinite(optimum.violation_between)
        else "- leaves its path between the samples",
        f"- as good and of the same branch: {twin}" if (twin := _twin_words(scene, optima, place)) else "",
    ]
    return screen_text("\n".join(line for line in lines if line))


def plan_end_text(scene: PlannedScene, end: PlanEnd, first: int, starts: int) -> str:
    """Return the text of a plan whose ``first`` level had ``first`` starts; all levels had ``starts``."""
    lines = [optimum_text(scene, end.optima, 0, len(end.optima)), "", "## Optima", ""]
    for place, each in enumerate(end.optima[: DRAWING.optima]):
        branch, twin = _branch(each) if each.branch else "", _twin_words(scene, end.optima, place)
        words = (f"- {place}: {_value(scene, each.point.objectives[0])}", branch, twin)
        lines.append(", ".join(filter(None, words)))
    counts = f"The first level had {counted(first, 'start')}"
    counts += f"; those after it begin from its optima, {starts - first} in all." if starts > first else "."
    lines += [*_further(len(end.optima)), "", counts]
    return screen_text("\n".join([*lines, "", run_text(end.provenance)]))


def _twin_words(scene: PlannedScene, optima: Sequence[PlannedOptimum], place: int) -> str:
    """Return text on the difference of an optimum from its twin; "" without a twin.

    The twin is the first earlier optimum with the same printed value and branch. The text has the largest difference of
    a joint at a sample, with its sign.
    """
    words = [(_value(scene, each.point.objectives[0]), each.branch) for each in optima[: place + 1]]
    twin = words.index(words[place])
    motion, reference = optima[place].point.motion, optima[twin].point.motion
    if twin == place or motion is None or reference is None:
        return ""
    difference = motion.q - reference.q
    row, joint = np.unravel_index(int(np.abs(difference).argmax()), difference.shape)
    arm = scene.workcell.arm
    unit = JOINT_UNITS["position"][arm.joint_types[joint] == "prismatic"]
    return (
        f"{arm.joint_names[joint]} {difference[row, joint]:+.3g} {unit} from optimum {twin} at {motion.time[row]:.3g} s"
    )


def _branch(optimum: PlannedOptimum) -> str:
    return f"`{optimum.branch}`"  # as code: Markdown would strike out text between tildes


def _further(count: int) -> list[str]:
    return [f"- and {count - DRAWING.optima} more"] if count > DRAWING.optima else []


def _value(scene: PlannedScene, value: float) -> str:
    return f"{value:.5g} {scene.unit}".rstrip()


START = "start"  # layer of a start's arm
DISTINCT = "distinct optima of the level so far"


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanDrawing:
    """The levels of a plan and its ``end``, None before the end; ``note``: text on what was left out.

    It has these timelines:

    - ``level``: the levels, then the final optima
    - ``start``: one start after another with its result
    - ``optimum``: one final optimum after another, if there are several
    - ``motion``: the motion of the best optimum
    - ``replay``: the motions of the best optimum of each level, one after another
    """

    scene: PlannedScene
    messages: Sequence[PlannedLevel]
    end: PlanEnd | None
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        motions = self._motions
        self._panel.log(stream)
        if motions is not None:
            motions.log(stream)
        for chart in self._charts:
            chart.log(stream)
        for place, level in enumerate(self.messages):
            stream.reset_time()
            stream.set_time("level", sequence=level.number)
            stream.set_time("replay", duration=float(self._clock.begins[place]))
            if self.end is None and place == len(self.messages) - 1:
                self._at_the_end(stream)
            self._panel.log_until(stream, self._lasts[place])
            log_text(stream, level_text(self._panel, level))
            numbers: dict[str, Any] = {name: getattr(level, name) for name in ("starts", "ends", "optima", "samples")}
            stream.log("search/level", rr.AnyValues(**numbers))
            self._log_cursors(stream, float(place))
            if motions is not None:
                motions.log_whole(stream, self._bests[place])
        if self.end is not None:
            self._log_end(stream, self.end)
        if motions is not None:
            self._log_motions(stream, motions)
        stream.reset_time()
        self._layout.log(stream)

    def _log_cursors(self, stream: rr.RecordingStream, instant: float) -> None:
        for chart in self._charts:
            chart.log_cursor(stream, instant)

    def _log_end(self, stream: rr.RecordingStream, end: PlanEnd) -> None:
        """Draw the optima, which are shown at the end of all timelines."""
        stream.reset_time()
        stream.set_time("level", sequence=self.messages[-1].number + 1 if self.messages else 0)
        self._at_the_end(stream)
        count, scene, nearest = len(self._panel.starts), self.scene, end.least_violating
        self._panel.log_until(stream, count, ended=True)
        if nearest is None:
            words = plan_end_text(scene, end, self._lasts[0] if self._lasts else 0, count)
        else:
            words = infeasible_text((scene.name,), (scene.unit,), nearest, scene.workcell, "No feasible motion")
        log_text(stream, words)
        if end.optima:
            values = [float(each.point.objectives[0]) for each in end.optima]
            stream.log("search/optima", rr.AnyValues(objective=values))
        self._log_cursors(stream, float(len(self.messages) - 1))
        if self._motions is not None:
            self._motions.log_whole(stream, self._best)

    def _at_the_end(self, stream: rr.RecordingStream) -> None:
        """Set the time to the end of ``replay`` and the beginning of ``motion`` and ``optimum``."""
        stream.set_time("replay", duration=self._clock.end)
        stream.set_time("motion", duration=0.0)
        if self._count > 1:
            stream.set_time("optimum", sequence=0)

    def _log_motions(self, stream: rr.RecordingStream, motions: MotionScene) -> None:
        """Move the best arms, then show starts and optima one by one."""
        stream.reset_time()
        for point in self._best:
            motions.send_motion(stream, point)
        slots = [(float(self._clock.begins[place]), points) for place, points in enumerate(self._bests)]
        motions.send_replay(stream, [*slots, (self._clock.end, self._best)])
        for number, level, row, points in self._walk:  # a start, and next to it its result
            stream.reset_time()
            stream.set_time("start", sequence=number)
            self._panel.log_until(stream, number, looked_at=number)
            log_text(stream, start_text(self.scene, level, row))
            self._log_cursors(stream, float(self._instants[number - 1]))
            motions.log_whole(stream, points)
        optima = () if self.end is None or self._count < 2 else self.end.optima[: DRAWING.walk]
        for place, optimum in enumerate(optima):
            stream.reset_time()
            stream.set_time("optimum", sequence=place)
            self._panel.log_optimum(stream, place)
            if place:  # the first one shows the text of all
                log_text(stream, optimum_text(self.scene, optima, place, self._count))
            motions.log_whole(stream, [optimum.point])

    @cached_property
    def _panel(self) -> PlanPanel:
        optima = () if self.end is None else self.end.optima
        return PlanPanel(scene=self.scene, levels=self.messages, optima=optima)

    @cached_property
    def _lasts(self) -> list[int]:
        """The number of each level's last start."""
        return [int(last) for last in np.cumsum([len(level.starts) for level in self.messages])]

    @cached_property
    def _bests(self) -> list[tuple[RecordedPoint, ...]]:
        """The best optimum of each level as a point; empty for a level without optima."""
        return [
            tuple(_point(0, level.optima[0], level.motions.time, q) for q in level.motions.optima[:1])
            for level in self.messages
        ]

    @property
    def _best(self) -> tuple[RecordedPoint, ...]:
        """The best optimum of the plan; otherwise the least-violating motion, or the best of the last level."""
        nearest = None if self.end is None else self.end.least_violating
        if self.end is not None and self.end.optima:
            return (self.end.optima[0].point,)
        if nearest is not None and nearest.point is not None:
            return (nearest.point,)
        return self._bests[-1] if self._bests else ()

    @cached_property
    def _walk(self) -> list[tuple[int, PlannedLevel, int, tuple[RecordedPoint, RecordedPoint]]]:
        """Number, level and row of the starts that are shown one by one, each with its result, as points."""
        rows = [(level, row) for level in self.messages for row in range(len(level.starts))]
        walk = []
        for place in even_rows(len(rows), DRAWING.starts).tolist():
            level, row = rows[place]
            motions = level.motions
            start = _point(row, level.starts[row], motions.time, motions.starts[row], axis=0)
            end = _point(row, level.ends[row], motions.time, motions.ends[row])  # as the chosen one
            walk.append((place + 1, level, row, (start, end)))
        return walk

    @property
    def _count(self) -> int:
        return 0 if self.end is None else len(self.end.optima)

    @cached_property
    def _clock(self) -> ReplayClock:
        return ReplayClock.of(self._bests)

    @cached_property
    def _motions(self) -> MotionScene | None:
        """The arms; None if there is no motion yet."""
        optima = () if self.end is None else [each.point for each in self.end.optima[: DRAWING.walk]]
        points = [*optima, *self._best, *(point for points in self._bests for point in points)]
        if not points:
            return None
        others = [point for _, _, _, pair in self._walk for point in pair]
        return MotionScene(workcell=self.scene.workcell, names=(START,), points=[*points, *others], prefix="")

    @cached_property
    def _charts(self) -> list[Chart]:
        """The best and the number of distinct optima so far, over the starts of each level."""
        if not np.isfinite(self._panel.ends).any():
            return []
        best, distinct = np.full((2, len(self.messages), self._lasts[-1]), np.nan)  # NaN at other levels
        accumulate = np.fmax.accumulate if self.scene.maximised else np.fmin.accumulate
        for place, (level, last) in enumerate(zip(self.messages, self._lasts, strict=True)):
            columns, optimum = slice(last - len(level.starts), last), level.motions.optimum
            best[place, columns] = accumulate(np.where(np.isfinite(level.ends), level.ends, np.nan))
            first = [number >= 0 and number not in optimum[:row] for row, number in enumerate(optimum)]
            distinct[place, columns] = np.cumsum(first)
        label = screen_label(f"best {self.scene.name} of the level so far", self.scene.unit, self.scene.maximised)
        charts = []
        for name, title, words, curves in (
            ("best", "best of the level so far", label, best),
            ("distinct", "distinct optima", DISTINCT, distinct),
        ):
            shown = curve_points(self._instants, curves)
            edges = np.array([[at, np.nanmin(shown[:, 1])] for at in (-0.5, len(self.messages) - 0.5)])
            more = {"title": title, "names": [f"{level.samples} samples" for level in self.messages]}
            colours = [SCREEN.joint(level.number) for level in self.messages]
            shown = np.concatenate([shown, edges])
            charts.append(Chart.over("level", name, words, self._instants, curves, colours, shown=shown, **more))
        return charts

    @property
    def _instants(self) -> np.ndarray:
        """Places of starts in charts: around the number of their level."""
        return self._panel.across - 0.5

    @property
    def _layout(self) -> Layout:
        motions, feasible = self._motions, self.end is None or self.end.least_violating is None
        starts: list[Entry] = [
            ("start", SCREEN.population),
            ("start beyond the axes: a dash at their edge", SCREEN.population),
        ]
        failed: Entry = ("start that led to no optimum", SCREEN.failed)
        entries = [*starts, failed]
        if feasible:
            entries = [*starts, ("what it led to", SCREEN.front), failed]
            entries.append(("best, of a level or in the end", SCREEN.chosen))
            entries += [("optimum looked at", SCREEN.arm)] if self._count > 1 else []  # a single one is the best
            entries.append(("values of the optima", SCREEN.final))
        if motions is not None:
            entries += motions.entries("arm" if feasible else "arm of the least-violating motion")
            entries.append(("arm of the start looked at", SCREEN.end(0)))
        walked, count = len(self._walk), len(self._panel.starts)
        words = f"{walked} of {count} starts are shown one by one." if walked < count else ""
        return Layout(
            legend=Legend(entries=entries),
            front=self._panel.view(),
            charts=[chart.view() for chart in self._charts],
            texts=[text_view("level, start, optimum")],
            timeline="level",
            name="plan",
            frames=DRAWING.slow_frames,
            note=" ".join(filter(None, (self.note, words))),
            **motion_views(motions),
        )


def _point(place: int, value: float, time: np.ndarray, q: np.ndarray, axis: int | None = None) -> RecordedPoint:
    motion = RecordedMotion(time=time, q=q)
    return RecordedPoint(id=place, objectives=np.array([value]), axis=axis, motion=motion)
