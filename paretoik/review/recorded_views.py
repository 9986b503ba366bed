"""The views of a recording that is there already, by the entities it has."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import rerun.blueprint as rrb

from paretoik.review.curve_charts import TOTAL
from paretoik.review.drawn_axes import TEXT
from paretoik.review.legend import Legend
from paretoik.review.legend_entries import search_entries
from paretoik.review.motion_scene import MotionScene
from paretoik.review.palette import SCREEN
from paretoik.review.recording_layout import Layout, text_view
from paretoik.review.search_scene import SearchScene


def recorded_tab(scene: SearchScene, motions: MotionScene | None, entities: Collection[str]) -> rrb.Container:
    """Return the views of a finished search that has these entities, as one tab."""
    scene, motions = replace(scene, root=()), None if motions is None else replace(motions, root="")
    front = any(path.startswith("/front/") for path in entities)
    arm = motions is not None and any(path.startswith("/arm/chosen/") for path in entities)
    return Layout(
        legend=Legend(entity="legend", entries=search_entries(scene, motions)),
        front=scene.view() if front else None,
        charts=_chart_views("parallel", entities) + _chart_views("charts", entities),
        arm=motions.view() if motions is not None and arm else None,
        joints=_chart_views("joint_charts", entities) + _chart_views("postures", entities) if arm else [],
        texts=[text_view("generation")] if "/text" in entities else [],
        timeline="generation",
        name="search",
    ).body()


def _chart_views(root: str, entities: Collection[str]) -> list[rrb.View]:
    """Return a view a chart below an entity, or of the entity itself where it has axes."""
    parts = [path.split("/")[1:] for path in sorted(entities)]
    below = {tuple(each[:2]) for each in parts if each[0] == root and each[-1] == "grid" and len(each) == 3}
    itself = {(root,) for each in parts if each[0] == root and not below}
    bounds = rrb.VisualBounds2D(x_range=[-TEXT.left, TOTAL[0] - TEXT.left], y_range=[-TEXT.top, TOTAL[1] - TEXT.top])
    return [
        rrb.Spatial2DView(
            origin="/".join(entity),
            name=" ".join(entity[-1].split("_")),
            visual_bounds=bounds,
            background=SCREEN.background,
        )
        for entity in sorted(below | itself)
    ]
