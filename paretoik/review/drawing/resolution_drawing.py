"""The recording of resolved motions: arms along their path, and the traces of their method over time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import rerun as rr

from paretoik.review.drawing.axes import flat_dots, screen_text
from paretoik.review.drawing.charts import Chart, LimitLine, curve_points
from paretoik.review.drawing.layout import Entry, Layout, Legend, log_text, set_times, text_view
from paretoik.review.drawing.motion import MotionScene, motion_views
from paretoik.review.drawing.point_text import broken_limits
from paretoik.review.palette import DRAWING, SCREEN, VIEWS, even_rows
from paretoik.review.recording.messages import RecordedPoint, RecordedTraces, ResolutionEnd, ResolvedScene
from paretoik.review.words import run_text

STATUSES = {
    "done": "done, neither damped nor cut short",
    "damped": "damped, near a singularity",
    "shortened": "shortened: the full step would move a joint by more than 1 rad or 1 m",
    "held": "held: no joint velocities achieve the task",
    "limited": "limited: the task gives way to limits",
    "missed": "missed: the step does not end on the path",
}


def motion_text(scene: ResolvedScene, traces: RecordedTraces, end: ResolutionEnd) -> str:
    """Return the text of a motion: its errors, the limits it breaks, its steps, and its method."""
    worst = int(traces.error.argmax())
    lines = [
        f"# {scene.method}" + (f", {traces.name} ({traces.point.id + 1} of {end.count})" if end.count > 1 else ""),
        f"- largest error {traces.error[worst]:.3g} {scene.error_unit} at {traces.time[worst]:.3g} s; "
        f"the path counts as lost from {scene.tolerance:.3g} {scene.error_unit} on",
        f"- greatest joint speed, all joints together: {traces.speed.max():.4g} {scene.speed_unit} at "
        f"{traces.time[int(traces.speed.argmax()) + 1]:.3g} s",
    ]
    if traces.clearance is not None:
        nearest = int(traces.clearance.argmin())
        lines.append(f"- least clearance {traces.clearance[nearest]:.3g} m at {traces.time[nearest]:.3g} s")
    if reason := end.provenance.get("reason"):
        lines += ["", "## Why it ended", "", str(reason)]
    if scene.workcell.bounds and traces.point.motion is not None:
        broken = broken_limits(scene.workcell, traces.point.motion)
        lines += ["", "## Limits broken", "", *broken] if broken else ["", "Limits of joints are kept at all samples."]
    lines += ["", "## Steps", ""]
    steps = Counter(traces.status.tolist())
    lines += [f"- {count} {STATUSES.get(status, status)}" for status, count in steps.most_common()]
    # the method's numbers with their units; numbers that vary between motions are this motion's
    units = {
        "damping": scene.damping_unit,
        "region": scene.damping_unit,
        "repulsion": scene.speed_unit,
        "buffer": "of a joint's range",
        "band": "of a criterion's range",
    }
    numbers = list[str]()
    for name, value in ((end.provenance.get("settings") or {}).get("method") or {}).items():
        if name == "name" or value in (None, []):
            continue
        by_motion = np.array(value if isinstance(value, list) else [], dtype=object).ravel()
        if end.count > 1 and len(by_motion) == end.count and all(isinstance(each, int | float) for each in by_motion):
            value = float(by_motion[traces.point.id])
        numbers.append(f"- {name.replace('_', ' ')}: {_value(value)} {units.get(name, '')}".rstrip())
    lines += ["", "## Method", "", *numbers] if numbers else []
    return screen_text("\n".join([*lines, "", run_text(end.provenance)]))


def _value(value: object) -> str:
    """Return a setting in words; a criterion with its objective and gain."""
    if isinstance(value, dict):
        return ", ".join(f"{name} {_value(each)}" for name, each in value.items())
    if isinstance(value, list):
        return ", ".join(_value(each) for each in value[:6]) + (", …" if len(value) > 6 else "")
    return f"{value:.5g}" if isinstance(value, float) and np.isfinite(value) else str(value)


@dataclass(frozen=True, kw_only=True, eq=False)
class ResolutionDrawing:
    """Resolved motions: the first one is solid, with some of the others next to it.

    On the timeline ``motion`` all of them move. If there are several, the timeline ``solution`` shows one after
    another.

    note: text about omitted parts
    """

    scene: ResolvedScene
    messages: Sequence[object]
    end: ResolutionEnd
    note: str = ""

    def log(self, stream: rr.RecordingStream) -> None:
        """Draw everything."""
        first = self.end.motions[0]
        self._motions.log(stream)
        for chart in self._charts:
            chart.log(stream)
        set_times(stream, motion=0.0, **({"solution": 0} if len(self.end.motions) > 1 else {}))
        self._log_whole(stream, first, self._points)
        stream.reset_time()
        for point in self._points:
            self._motions.send_motion(stream, point, charts=self._all_charts)
        # each step whose status differs from that of the previous step, while the arm moves
        words = motion_text(self.scene, first, self.end)
        changes = np.flatnonzero(first.status[1:] != first.status[:-1]) + 1
        for step in [*([0] if first.status[0] != "done" else []), *changes[: DRAWING.walk]]:
            set_times(stream, motion=float(first.time[step + 1] - first.time[0]))
            status = STATUSES.get(str(first.status[step]), str(first.status[step]))
            log_text(stream, screen_text(f"**From {first.time[step]:.4g} s on: {status}**") + f"\n\n{words}")
        for number, traces in enumerate(self.end.motions[1:], start=1):
            set_times(stream, solution=number)
            self._log_whole(stream, traces, [traces.point])
        motions, first = self._motions, self.end.motions[0].name
        named: list[Entry] = [(each.name, SCREEN.end(axis)) for axis, each in enumerate(self._thin_motions)]
        arm = f"arm of {first}, or of the motion looked at" if named else "arm"
        entries: list[Entry] = [
            *([(first, SCREEN.arm), *named] if named else []),
            ("step damped, shortened, held, limited or missed", SCREEN.event),
            ("error at which the path counts as lost: dashed", SCREEN.limit),
            *motions.entries(arm),
        ]
        recorded, count = len(self.end.motions), self.end.count
        words = f"{recorded} of {count} motions are shown." if recorded < count else ""
        Layout(
            legend=Legend(entries=entries),
            front=self._all_charts[0].view(),
            charts=[chart.view() for chart in self._all_charts[1:]],
            texts=[text_view("method")],
            timeline="motion",
            name=self.scene.method,
            frames=DRAWING.slow_frames,
            note=" ".join(filter(None, (self.note, words))),
            **motion_views(motions),
        ).log(stream)

    def _log_whole(self, stream: rr.RecordingStream, traces: RecordedTraces, points: Sequence[RecordedPoint]) -> None:
        """Draw a motion as the chosen one at the current time, with its own text and criteria."""
        self._motions.log_whole(stream, points)
        log_text(stream, motion_text(self.scene, traces, self.end))
        if (chart := self._criteria_chart) is not None:
            chart.log(stream)
            chart.draw(stream, traces.time, np.stack([_steps(curve) for curve in traces.criteria.T]))
        chart, rows = self._charts[0], np.flatnonzero(traces.status != "done") + 1  # ends of steps that are not done
        places = np.stack([traces.time[rows], _logarithm(traces.error)[rows]], axis=1)
        stream.log(f"{chart.entity}/marks", flat_dots(chart.canvas.place(places), SCREEN.event, 3.0, 3.0))
        for chart in self._all_charts:
            chart.log_cursor(stream, float(traces.time[len(traces.time) // 2]))

    @cached_property
    def _thin_motions(self) -> list[RecordedTraces]:
        """Other motions than the first: evenly spread ones, at most one per colour."""
        others = list(self.end.motions[1:])
        return [others[place] for place in even_rows(len(others), len(SCREEN.ends))]

    @cached_property
    def _points(self) -> list[RecordedPoint]:
        """The first motion and the thin ones, as points whose ``axis`` gives their colour."""
        thin = [replace(each.point, axis=axis) for axis, each in enumerate(self._thin_motions)]
        return [self.end.motions[0].point, *thin]

    @cached_property
    def _motions(self) -> MotionScene:
        points = [*self._points, *(each.point for each in self.end.motions[1:])]
        names = tuple(each.name for each in self._thin_motions)
        return MotionScene(workcell=self.scene.workcell, names=names, points=points, prefix="")

    @cached_property
    def _charts(self) -> list[Chart]:
        """Charts with one curve per drawn motion; the task error is first."""
        scene, shown = self.scene, [self.end.motions[0], *self._thin_motions]
        time, several = shown[0].time, len(shown) > 1
        errors = f"log10 of the task error [{scene.error_unit}]", [_logarithm(each.error) for each in shown]
        curves: dict[str, tuple[str, list[np.ndarray]]] = {"error": errors}
        for name, label in (
            ("speed", f"commanded joint speed, all joints [{scene.speed_unit}]"),
            ("damping", f"damping [{scene.damping_unit}]"),
            ("repulsion", f"joint speed away from limits [{scene.speed_unit}]"),
        ):
            values = [_steps(getattr(each, name)) for each in shown]
            if name == "speed" or any(np.nanmax(np.abs(each), initial=0.0) > 0 for each in values):
                curves[name] = label, values
        if shown[0].clearance is not None:
            curves["clearance"] = "clearance [m]", [each.clearance for each in shown if each.clearance is not None]
        tolerance = float(np.log10(max(scene.tolerance, DRAWING.least_error)))
        limits = {"error": (tolerance, "tolerance" if several else ""), "clearance": (scene.min_clearance, "")}
        moving = np.stack([np.append(each[1:2], each[1:]) for each in curves["error"][1]])
        special = {"error": {"total": VIEWS.panels, "shown": curve_points(time, moving)}}  # no error at the start
        charts = []
        for name, (label, values) in curves.items():
            limit = [
                LimitLine(instants=time[[0, -1]], values=np.full(2, value), name=words, colours=[SCREEN.limit])
                for value, words in ([limits[name]] if name in limits else [])
            ]
            colours = [SCREEN.arm, *(SCREEN.end(axis) for axis in range(len(self._thin_motions)))]
            more = {"names": [each.name for each in shown], "limits": limit, **special.get(name, {})}
            charts.append(Chart.over("time [s]", name, label, time, np.stack(values), colours, **more))
        return charts

    @cached_property
    def _criteria_chart(self) -> Chart | None:
        """The chart of speeds due to each criterion, whose curves are those of one motion."""
        names, none = self.scene.criteria, np.zeros((0, 0))
        if not names:
            return None
        curves = [(each.time, _steps(curve)) for each in self.end.motions for curve in each.criteria.T]
        shown = np.concatenate([np.stack(each, axis=1) for each in curves])
        label, colours = f"speed from criteria [{self.scene.speed_unit}]", [SCREEN.joint(k) for k in range(len(names))]
        return Chart.over("time [s]", "criteria", label, np.zeros(0), none, colours, names=names, shown=shown)

    @property
    def _all_charts(self) -> list[Chart]:
        return self._charts if self._criteria_chart is None else [*self._charts, self._criteria_chart]


def _logarithm(errors: np.ndarray) -> np.ndarray:
    return np.asarray(np.log10(np.maximum(np.nan_to_num(errors, nan=0.0, posinf=1e16), DRAWING.least_error)))


def _steps(values: np.ndarray) -> np.ndarray:
    """Return step values at samples: each at the end of its step, the first also at the beginning."""
    return np.concatenate([values[:1], values])
