"""A front in a notebook: the Rerun viewer below a cell, and what is selected in it as ids."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

from paretoik.arrays import Ids
from paretoik.inputs import check_function, check_size
from paretoik.run_files import RECORDING

if TYPE_CHECKING:
    from paretoik.front.front import Front

# By name, as this package knows nothing of those that draw.
OPENED_BY = "paretoik.review.drawing.front_view:open_view"
RECORDED_BY = "paretoik.review.drawing.chosen_recording:show_choice_in_recording"


def view(
    front: Front,
    *,
    on_select: Callable[[Ids], object] | None = None,
    width: int | Literal["auto"] = "auto",
    height: int | Literal["auto"] = 720,
) -> Any:
    """Return the front as a ``FrontView``, which a notebook shows as the Rerun viewer: pick a point, get its id.

    Its ``selected`` are the ids of the points that were selected last, in any of its pictures, and ``choice`` is the
    point whose motion the arm shows: the first of them, at first the present choice, or else the compromise.
    ``show(id)`` shows another one, ``on_select(callback)`` has a function called with the ids of every selection.

    On a certified front its ``sliders``, one an objective, move along the front: while one is dragged towards its
    better end, what ``predict`` expects is drawn in grey; on release it is the point that ``navigate`` leads to, which
    is selected. ``view.front`` has all points that were moved to.

    The extra ``notebook`` is wanted (``pip install "paretoik[notebook]"``). The viewer is served by this process to the
    same machine; where the browser is on another one, ``RERUN_NOTEBOOK_ASSET=inline`` in the environment sends it
    along.

    Parameters
    ----------
    on_select
        Called with the ids of every selection; may be none.
    width, height
        In pixels; "auto" is the cell's width, and 9/16 of that.

    Raises
    ------
    InvalidInput
        Where the extra is missing, or a size is none.
    Infeasible
        For an empty front.
    """
    for edge, size in {"width": width, "height": height}.items():
        if not (isinstance(size, str) and size == "auto"):
            check_size(edge, size, 1)
    check_function("on_select", on_select)
    return drawn_by(OPENED_BY)(front, on_select=on_select, width=width, height=height)


def show_choice(front: Front) -> None:
    """Let the recording of a front's run, if there is one, open on the present choice."""
    if front.folder is not None and (front.folder / RECORDING).exists():
        drawn_by(RECORDED_BY)(front)


def drawn_by(reference: str) -> Any:
    """Return the function that "module:name" stands for."""
    module, _, name = reference.partition(":")
    return getattr(import_module(module), name)
