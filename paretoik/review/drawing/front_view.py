"""A front in a notebook: the Rerun viewer, and sliders of the objectives."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import anywidget
import numpy as np
import rerun as rr
import traitlets

from paretoik.arrays import Ids
from paretoik.errors import InvalidInput, ParetoikError
from paretoik.front.choice import Prediction
from paretoik.front.choice_tree import pick_point
from paretoik.front.front import Choice, Front
from paretoik.front.points import NAVIGATIONS
from paretoik.front.preferences.knee_and_compromise import compromise
from paretoik.inputs import shown
from paretoik.review.drawing.choice_layer import ROOTS, ChoiceLayer
from paretoik.review.drawing.motion import motion_frames
from paretoik.review.palette import DRAWING, VIEWS, even_rows
from paretoik.review.recording.messages import front_point

ASSET = "RERUN_NOTEBOOK_ASSET"  # source of the viewer for the browser; by default the Rerun company's server
Kind = Literal["idle", "predicted", "certified", "jump", "known", "refused"]


class PreferenceSliders(anywidget.AnyWidget):
    """One slider per objective of a front, from its worst to its best value, at the values of a choice.

    follow: called when a slider moves, with the objective to ``improve``, the value ``to`` reach, the objectives on
        ``hold``, and whether it is a ``release``
    cancel: called when a slider is back at its start
    """

    _esm = Path(__file__).with_name("preference_sliders.js")
    _css = Path(__file__).with_name("preference_sliders.css")
    state = traitlets.Dict().tag(sync=True)

    def __init__(
        self, front: Front, choice: Choice, *, follow: Callable[..., None], cancel: Callable[[], None]
    ) -> None:
        self._answered = 0
        super().__init__(state=self._state(front, choice, "idle", "", None))

        def receive(_: Any, message: dict[str, Any], __: Any) -> None:
            """Handle a message of the browser, and confirm it."""
            names, self._answered = self._front.names, int(message["number"])
            improve, hold = names[message["axis"]], tuple(names[axis] for axis in message["hold"])
            try:
                if message["kind"] == "cancel":
                    cancel()
                else:
                    follow(improve=improve, to=float(message["to"]), hold=hold, release=message["kind"] == "release")
            except BaseException as error:  # a browser without an answer would keep waiting
                self.show(self._front, self._choice, "refused", str(error) or type(error).__name__)
                raise

        self.on_msg(receive)

    def show(self, front: Front, choice: Choice, kind: Kind, words: str, prediction: Prediction | None = None) -> None:
        """Show a choice of a front, a message, and predicted values, if any."""
        self.state = self._state(front, choice, kind, words, prediction)

    def _state(
        self, front: Front, choice: Choice, kind: Kind, words: str, prediction: Prediction | None
    ) -> dict[str, Any]:
        self._front, self._choice = front, choice
        low, high = front.objectives.min(axis=0), front.objectives.max(axis=0)
        objectives = [
            {
                "name": name,
                "unit": front.units[k],
                "worst": float((low if front.maximised[k] else high)[k]),
                "best": float((high if front.maximised[k] else low)[k]),
                "value": float(choice.objectives[k]),
                "predicted": None if prediction is None else float(prediction.objectives[k]),
            }
            for k, name in enumerate(front.names)
        ]
        movable = len(front.names) > 1 and front.certificates is not None and hasattr(front.problem, "navigate")
        words = words if movable else "These sliders need a certified front with its problem, such as refine(front)."
        state = {"objectives": objectives, "kind": kind, "words": words, "movable": movable}
        return state | {"answered": self._answered}


class FrontView:
    """A front in a notebook: ``viewer`` is the ``rerun.notebook.Viewer`` that shows it, ``sliders`` move along it."""

    def __init__(self, front: Front, viewer: Callable[[rr.RecordingStream], Any]) -> None:
        self._front = front
        self._choice = pick_point(front, None, name="view", otherwise=compromise)
        self._selected: Ids = np.zeros(0, dtype=np.int64)
        self._callbacks = list[Callable[[Ids], object]]()
        self._times = np.zeros(0)  # times of all motions shown so far
        around = tuple(front_point(front, row) for row in even_rows(len(front), DRAWING.walk).tolist())
        settings: Any = {"names": ("selected point",), "width": VIEWS.cell, "predicts": True}
        self._layer = ChoiceLayer(front=front, choices=(self._choice,), around=around, **settings)
        self._stream = rr.RecordingStream("paretoik-front", send_properties=False)
        self.viewer = viewer(self._stream)
        self._layer.log_front(self._stream)
        self._log_choice()
        self._stream.send_blueprint(self._layer.blueprint(), make_active=True, make_default=True)
        self._stream.flush()
        self.viewer.on_event(self._receive)
        self.sliders = PreferenceSliders(front, self._choice, follow=self._follow, cancel=self._cancel)
        self._cancel()

    @property
    def front(self) -> Front:
        """The front with all points that were moved to."""
        return self._front

    @property
    def selected(self) -> Ids:
        """The ids of the points of the last selection; empty if something else was selected."""
        return self._selected

    @property
    def choice(self) -> Choice:
        """The point whose motion is shown."""
        return self._choice

    def on_select(self, callback: Callable[[Ids], object]) -> None:
        """Register a function that is called with the ids of every later selection.

        Raises InvalidInput if it is not callable.
        """
        if not callable(callback):
            raise InvalidInput(f"on_select must be a function, got {shown(callback)}")
        self._callbacks.append(callback)

    def show(self, point: int | Choice) -> None:
        """Show the motion of a point, by its id or as a choice; raises InvalidInput for points of other fronts."""
        self._choice = self._front[int(point.id if isinstance(point, Choice) else point)]
        self._layer = replace(self._layer, choices=(self._choice,))
        self._log_choice()
        self._cancel()

    def _cancel(self) -> None:
        self._draw(None, "idle", f"point {self._choice.id}: drag the slider of an objective to improve it")

    def _follow(self, *, improve: str, to: float, hold: tuple[str, ...], release: bool) -> None:
        """Draw the predicted result of a move; on ``release``, move to the certified point and select it."""
        try:
            if not release:
                prediction = self._front.predict(self._choice, improve=improve, to=to, hold=hold)
                self._draw(prediction, "predicted", "predicted, not certified: release to move there")
                return
            moved = self._front.navigate(self._choice, improve=improve, to=to, hold=hold)
        except ParetoikError as error:
            self._draw(None, "refused", str(error))
            return
        note = moved.provenance[NAVIGATIONS][-1]
        self._front, self._choice = moved, moved[note["to"]]
        self._layer = replace(self._layer, front=moved, choices=(self._choice,))
        self._layer.log_front(self._stream)
        self._log_choice()
        kind: Kind = "jump" if note["jump"] else "certified" if note["new"] else "known"
        self._draw(None, kind, note["reason"])
        self._select(np.array([self._choice.id]))

    def _draw(self, prediction: Prediction | None, kind: Kind, words: str) -> None:
        self._layer.log_prediction(self._stream, prediction)
        self._stream.flush()
        self.sliders.show(self._front, self._choice, kind, words, prediction)

    def __repr__(self) -> str:
        """Return a line with the shown and the selected points."""
        return f"FrontView of {len(self._front)} points: shows {self._choice.id}, selected {self._selected.tolist()}"

    def _ipython_display_(self) -> None:
        from IPython.display import display

        display(self.sliders)  # type: ignore[no-untyped-call]  # IPython has no types for it
        self.viewer.display()

    def _log_choice(self) -> None:
        """Draw the choice, also at all times of earlier drawings, to replace these."""
        motion = self._choice.motion
        if getattr(motion, "time", None) is not None:
            self._times = np.union1d(self._times, motion_frames(np.asarray(motion.time) - motion.time[0]))
        self._layer.log_choices(self._stream, self._times)

    def _receive(self, event: Any) -> None:
        """Handle an event of the viewer: take the ids of selected points, and show the first one."""
        if event.type != "selection_change":
            return
        ids, all_ids, root = list[int](), self._front.ids.tolist(), ROOTS[0]
        for item in (item for item in event.items if item.type == "entity"):
            first, *_, last = parts = item.entity_path.strip("/").split("/")
            if not first.startswith(root) or "predicted" in parts:  # a prediction is not a point
                continue
            is_choice = first != root or last == root or parts[-2:] == [root, "name"]
            if last == "front":
                number = item.instance_id
                ids += all_ids if number is None else all_ids[number : number + 1]
            elif is_choice or parts[1:2] in (["arm"], ["joint_charts"]):
                ids.append(self._choice.id)
        ids = list(dict.fromkeys(ids))
        if ids and ids[0] != self._choice.id:
            self.show(ids[0])
        self._select(np.array(ids, dtype=np.int64))

    def _select(self, ids: Ids) -> None:
        self._selected = ids
        for callback in self._callbacks:
            callback(self._selected)


def open_view(
    front: Front,
    *,
    on_select: Callable[[Ids], object] | None,
    width: int | Literal["auto"],
    height: int | Literal["auto"],
) -> FrontView:
    """Return the view that ``front.view`` documents."""
    os.environ.setdefault(ASSET, "serve-local")  # before the package is loaded
    with redirect_stdout(io.StringIO()):  # the server prints that it serves
        from rerun.notebook import Viewer

    def viewer(stream: rr.RecordingStream) -> Viewer:
        return Viewer(recording=stream, width=width, height=height, theme="dark")

    view = FrontView(front, viewer)
    if on_select is not None:
        view.on_select(on_select)
    return view
