"""Tabs with readable names."""

from __future__ import annotations

import pytest
import rerun.blueprint as rrb

from paretoik.review.drawing.layout import fitting_tabs
from paretoik.review.palette import VIEWS

SEARCH = ["parallel coordinates", "hypervolume", "best kinetic_energy [J s]", "best torque_norm [N²m²s]"]
SEARCH += ["best obstacle_clearance [m] ↑", "front points, failures"]


def tabs(names: list[str], width: float) -> rrb.Tabs:
    return fitting_tabs([rrb.Spatial2DView(origin=f"/{number}", name=name) for number, name in enumerate(names)], width)


def leaves(container: rrb.Tabs) -> list[rrb.View]:
    return [view for part in container.contents for view in (leaves(part) if isinstance(part, rrb.Tabs) else [part])]


@pytest.mark.parametrize("width", [900.0, 700.0, 600.0, 450.0])
def test_all_names_fit_and_every_view_is_there_in_its_order(width):
    found = tabs(SEARCH, width)
    names = [str(part.name) for part in found.contents]
    assert VIEWS.tab_controls + sum(VIEWS.tab_margin + VIEWS.tab_character * len(name) for name in names) <= width
    assert [view.origin for view in leaves(found)] == [f"/{number}" for number in range(len(SEARCH))]
