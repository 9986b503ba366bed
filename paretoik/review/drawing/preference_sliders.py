"""Sliders of a front's objectives in a notebook: dragging predicts a move, release makes it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import anywidget
import traitlets

from paretoik.front.choice import Prediction
from paretoik.front.front import Choice, Front

Kind = Literal["idle", "predicted", "certified", "jump", "known", "refused"]
HERE = Path(__file__).parent


@dataclass(frozen=True, kw_only=True)
class SliderWish:
    """Objective ``improve`` at ``to`` in its own unit; those on ``hold`` must not get worse."""

    improve: str
    to: float
    hold: tuple[str, ...]


class PreferenceSliders(anywidget.AnyWidget):
    """One slider per objective of a front, from its worst to its best value, at the values of a choice.

    ``follow`` is called with a ``SliderWish``, and with ``release`` when the slider is let go; ``cancel`` when a slider
    is back at its start.
    """

    _esm = HERE / "preference_sliders.js"
    _css = HERE / "preference_sliders.css"
    state = traitlets.Dict().tag(sync=True)

    def __init__(
        self,
        front: Front,
        choice: Choice,
        *,
        follow: Callable[..., None],
        cancel: Callable[[], None],
    ) -> None:
        self._front, self._choice, self._answered = front, choice, 0
        self._follow, self._cancel = follow, cancel
        super().__init__(state=self._state(choice, "idle", "", None))
        self.on_msg(self._receive)

    def show(self, front: Front, choice: Choice, kind: Kind, words: str, prediction: Prediction | None = None) -> None:
        """Show a choice of a front and a message; values of a prediction are shown as such."""
        self._front, self._choice = front, choice
        self.state = self._state(choice, kind, words, prediction)

    def _receive(self, _: Any, message: dict[str, Any], __: Any) -> None:
        """Handle a message of the browser, and confirm it."""
        names = self._front.names
        improve, hold = names[message["axis"]], tuple(names[axis] for axis in message["hold"])
        wish = SliderWish(improve=improve, to=float(message["to"]), hold=hold)
        self._answered = int(message["number"])
        try:
            if message["kind"] == "cancel":
                self._cancel()
            else:
                self._follow(wish, release=message["kind"] == "release")
        except BaseException as error:  # a browser without an answer would keep waiting
            self.show(self._front, self._choice, "refused", str(error) or type(error).__name__)
            raise

    def _state(self, choice: Choice, kind: Kind, words: str, prediction: Prediction | None) -> dict[str, Any]:
        front = self._front
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
        if not movable:
            words = "These sliders need a certified front with its problem, such as refine(front)."
        return {
            "objectives": objectives,
            "kind": kind,
            "words": words,
            "movable": bool(movable),
            "answered": self._answered,
        }
