"""The layout of a recording in the viewer: a legend above the front, the arm, and words beside each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import rerun.blueprint as rrb

from paretoik.review.drawing.legend import Legend
from paretoik.review.drawing.view_tabs import fitting_tabs
from paretoik.review.drawing_options import DRAWING, VIEWS

TEXT = "text"  # entity of what is said of the point shown
WHY = "notes/why"  # entity of the reason of the choice


@dataclass(frozen=True, kw_only=True)
class Layout:
    """The views of a recording: the ``front`` above its ``charts``, the ``arm`` above its ``joints``, then ``texts``.

    ``timeline`` is the one that plays, from ``start`` on, or from its beginning, so many ``frames`` a second of one
    that counts; ``further`` views are tabs beside all of these.
    """

    legend: Legend
    front: rrb.View | None
    charts: Sequence[rrb.View]
    arm: rrb.View | None
    joints: Sequence[rrb.View]
    texts: Sequence[rrb.View]
    timeline: str
    start: int | None = None
    end: int = 0
    name: str = "search"
    frames: float = DRAWING.frames
    further: Sequence[rrb.Container] = field(default_factory=tuple)

    def blueprint(self) -> rrb.Blueprint:
        """Return the layout as the viewer takes it."""
        body = self.body()
        if self.further:
            body = rrb.Tabs(body, *self.further)
        return rrb.Blueprint(
            body,
            rrb.BlueprintPanel(state="hidden"),
            rrb.SelectionPanel(state="hidden"),
            self._time_panel(),
            auto_views=False,
        )

    def body(self) -> rrb.Container:
        """Return legend and views."""
        front, charts = self.front, list(self.charts)
        if front is None and charts:
            front, charts = charts[0], charts[1:]
        columns = [(_column(front, charts), VIEWS.columns[0]), (_column(self.arm, self.joints), VIEWS.columns[1])]
        columns.append((fitting_tabs(self.texts, VIEWS.columns[2]) if self.texts else None, VIEWS.columns[2]))
        present = [(column, width) for column, width in columns if column is not None]
        views = rrb.Horizontal(*(column for column, _ in present), column_shares=[width for _, width in present])
        shares = [self.legend.height, VIEWS.body - self.legend.height]
        return rrb.Vertical(self.legend.view(), views, row_shares=shares, name=self.name)

    def _time_panel(self) -> rrb.TimePanel:
        if self.start is None:
            return rrb.TimePanel(timeline=self.timeline, state="collapsed", fps=self.frames)
        # A viewer begins at the start of what it loops over.
        selection = rrb.components.AbsoluteTimeRange(min=self.start, max=max(self.end, self.start + 1))
        return rrb.TimePanel(
            timeline=self.timeline,
            state="collapsed",
            fps=self.frames,
            play_state="playing",
            loop_mode="selection",
            time_selection=selection,
        )


def choice_blueprint(
    legend: Legend,
    front: rrb.View | None,
    below: Sequence[rrb.View],
    arms: Sequence[tuple[rrb.View, Sequence[rrb.View]]],
    texts: Sequence[rrb.View],
    *,
    name: str,
    recorded: rrb.Container | None,
    narrow: bool = False,
    timeline: str = "motion",
) -> rrb.Blueprint:
    """Return the layout of a choice, or of two beside each other, on a common time; ``recorded`` may be a second tab.

    Of one, words stand beside the arm; of two, or where the viewer is ``narrow``, below the front.
    """
    if len(texts) == 1 and not narrow:
        arm, joints = arms[0] if arms else (None, ())
        body = Layout(
            legend=legend, front=front, charts=below, arm=arm, joints=joints, texts=texts, timeline=timeline, name=name
        ).body()
    else:
        left = _column(front, [*texts, *below])
        columns = [each for each in (left, *(_column(arm, joints) for arm, joints in arms)) if each is not None]
        shares = [legend.height, VIEWS.body - legend.height]
        body = rrb.Vertical(legend.view(), rrb.Horizontal(*columns), row_shares=shares, name=name)
    return rrb.Blueprint(
        body if recorded is None else rrb.Tabs(body, recorded),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(timeline=timeline, state="collapsed", fps=DRAWING.frames),
        auto_views=False,
    )


def text_view(name: str) -> rrb.View:
    """Return the view of what is said of the point shown."""
    return rrb.TextDocumentView(origin=TEXT, name=name)


def note_view() -> rrb.View:
    """Return the view of what was left out."""
    return rrb.TextDocumentView(origin="notes/left_out", name="left out")


def _column(above: rrb.View | None, below: Sequence[rrb.View]) -> rrb.Container | None:
    views = ([above] if above is not None else []) + ([fitting_tabs(below, VIEWS.panels[0])] if below else [])
    shares = [VIEWS.panels[1] + VIEWS.title, VIEWS.chart[1] + VIEWS.title][: len(views)]
    return rrb.Vertical(*views, row_shares=shares) if views else None
