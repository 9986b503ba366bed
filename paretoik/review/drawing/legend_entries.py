"""What the legend of a recording says."""

from __future__ import annotations

from collections.abc import Sequence

from paretoik.review.drawing.motion_scene import MotionScene
from paretoik.review.drawing.search_scene import SearchScene
from paretoik.review.palette import SCREEN, Colour
from paretoik.review.recording.workcell import Workcell

Entry = tuple[str, Colour]
RESOLUTION_ENTRIES: tuple[Entry, ...] = (
    ("step damped, shortened, held, limited or missed", SCREEN.event),
    ("error from which the path counts as lost: dashed", SCREEN.limit),
)


def search_entries(
    scene: SearchScene,
    motions: MotionScene | None,
    *,
    chosen: str = "compromise",
    walked: bool = False,
    postures: str = "",
) -> list[Entry]:
    """Return what is drawn of a search in which colour, with the points that are ``walked`` along if there are some.

    ``postures`` says which are drawn behind arms that stand still, "" where none are.
    """
    loop = scene.timeline == "step"
    behind = {"level": "dominated", "refinement": "before"}.get(scene.timeline, "population")
    entries: list[Entry] = [("front of the step" if loop else "front", SCREEN.front), (chosen, SCREEN.chosen)]
    if not loop:
        entries = [(behind, SCREEN.population), *entries, ("final front", SCREEN.final)]
        entries += [("ε: bound of this level", SCREEN.epsilon)] if scene.timeline == "level" else []
        entries += [("from before to after", SCREEN.moves)] if scene.timeline == "refinement" else []
        if len(scene.names) > 1:
            entries += [(f"best {name}", SCREEN.end(axis)) for axis, name in enumerate(scene.names)]
        entries += [("point looked at", SCREEN.arm)] if walked else []
    if motions is None:
        return entries
    arm = f"arm of the {chosen}" if chosen == "compromise" else "arm"
    arm = f"{arm}, or of the point looked at" if walked else arm
    return entries + motion_entries(motions, arm, postures=postures)


def plan_entries(motions: MotionScene | None, *, optima: int = 2, feasible: bool = True) -> list[Entry]:
    """Return what is drawn of a plan in which colour, also of one without a feasible motion.

    Of several ``optima`` one is looked at; a single one is the best.
    """
    entries: list[Entry] = [
        ("start", SCREEN.population),
        ("start beyond the axes: a dash at their edge", SCREEN.population),
        ("what it led to", SCREEN.front),
        ("start that led to no optimum", SCREEN.failed),
        ("best, of a level or in the end", SCREEN.chosen),
        *([("optimum looked at", SCREEN.arm)] if optima > 1 else []),
        ("values of the optima", SCREEN.final),
    ]
    if not feasible:
        entries = [entries[0], entries[1], entries[3]]  # nothing led anywhere
    arm = "arm" if feasible else "arm of the least-violating motion"
    arms = [] if motions is None else [*motion_entries(motions, arm), ("arm of the start looked at", SCREEN.end(0))]
    return entries + arms


def resolution_entries(motions: MotionScene, first: str, others: Sequence[str]) -> list[Entry]:
    """Return what is drawn of resolved motions in which colour; the ``first`` is drawn solid."""
    named: list[Entry] = [(first, SCREEN.arm)] if others else []
    named += [(name, SCREEN.end(axis)) for axis, name in enumerate(others)]
    arm = f"arm of {first}, or of the motion looked at" if others else "arm"
    return [*named, *RESOLUTION_ENTRIES, *motion_entries(motions, arm)]


def maxima_entries(cell: Workcell, word: str) -> list[Entry]:
    """Return what is drawn of directional maxima in which colour."""
    entries: list[Entry] = [
        (f"highest {word}s so far", SCREEN.front),
        ("this direction", SCREEN.chosen),
        ("all directions", SCREEN.final),
        ("arm in the posture of this direction", SCREEN.arm),
        ("postures of those before", SCREEN.ghost),
        ("position of the tool", SCREEN.target),
        ("what motors allow: dashed", SCREEN.text),
    ]
    entries += [("limits: dashed", SCREEN.text)] if "position" in cell.bounds else []
    return entries + ([("obstacle", SCREEN.obstacle)] if cell.obstacles else [])


def motion_entries(motions: MotionScene, arm: str = "arm", *, postures: str = "") -> list[Entry]:
    """Return what is drawn of motions in which colour; ``arm`` says whose is drawn solid.

    ``postures`` says which are drawn behind arms that stand still, "" where none are.
    """
    cell = motions.workcell
    entries: list[Entry] = [(arm, SCREEN.arm)]
    if cell.link_radius:
        entries.append(("its links", SCREEN.body if cell.arm.is_planar else (*SCREEN.hull[:3], 255)))
    if any(point.motion is not None and not point.motion.is_standing for point in motions.points):
        entries += [("its postures over time", SCREEN.ghost), ("path of its tool", SCREEN.path)]
    elif postures:
        entries.append((postures, SCREEN.ghost))
    if cell.paths:
        entries.append(("path to follow", SCREEN.target))
    if cell.places:
        entries.append(("places that count" if len(cell.places) > 1 else next(iter(cell.places)), SCREEN.target))
    if len(cell.directions):
        entries.append(("directions", SCREEN.target))
    if cell.obstacles:
        entries.append(("obstacle", SCREEN.obstacle))
    if any(chart.limits for chart in motions.charts.values()):
        entries.append(("limits: dashed", SCREEN.text))
    return entries


def choice_entries(names: Sequence[str], motions: MotionScene | None, *, predicts: bool = False) -> list[Entry]:
    """Return what is drawn of one or two choices in which colour, and of predictions where there are some."""
    colours = (SCREEN.chosen, SCREEN.compared)
    marked: list[Entry] = [(name, colour) for name, colour in zip(names, colours, strict=False)]
    marked += [("predicted, not certified", SCREEN.predicted)] if predicts else []
    return [("front", SCREEN.front), *marked, *([] if motions is None else motion_entries(motions))]
