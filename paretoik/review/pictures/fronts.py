"""Pictures of a front and its motions, drawn without a screen."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from paretoik.front.choice import Choice
from paretoik.front.comparison import Comparison
from paretoik.front.front import Front
from paretoik.front.points import StoredMotions
from paretoik.front.preferences.knee_and_compromise import best_rows, compromise
from paretoik.review.outlines import count_covered, freest_place, obstacle_lines, places_beside, places_between
from paretoik.review.palette import PAPER, even_rows, objective_label
from paretoik.review.words import describe_limits_between
from paretoik.runs.file_replacement import replace_file

# Names of points in a picture of a front, which avoid all dots and each other.


@dataclass(frozen=True, kw_only=True)
class NameSizes:
    """Sizes of names [points]."""

    character: float = 6.0  # width of a character
    line: float = 10.0  # height of a line
    distances: tuple[float, ...] = (5.0, 12.0)  # distances of a name from its mark
    gap: float = 2.5  # distance of a name from others
    grid: int = 16  # number of places per direction for names without a free place at their mark
    leader: float = 10.0  # distance from its mark above which a name has a line to it


NAMES = NameSizes()


def name_points(axes: Axes, points: Float[np.ndarray, "points 2"], named: Sequence[tuple[int, str, str]]) -> None:
    """Write names next to ``points``; axes must already have limits.

    named: the row of the point, the words and the colour of each name
    """
    low, high = (np.array(limits) for limits in zip(axes.get_xlim(), axes.get_ylim(), strict=True))
    size = np.array(axes.bbox.size) * 72.0 / axes.figure.dpi  # approximate: the layout is not final yet
    taken = (points - low) / (high - low) * size
    for row, words, colour in named:
        mark, half = taken[row], np.array([0.5 * NAMES.character * len(words), 0.5 * NAMES.line])
        middle = name_place(mark, half, taken, size)
        is_near = np.linalg.norm(np.maximum(np.abs(middle - mark) - half, 0.0)) <= NAMES.leader
        line = {"arrowstyle": "-", "color": colour, "linewidth": 0.7, "shrinkA": 0.0, "shrinkB": 3.0}
        axes.annotate(
            words,
            tuple(points[row]),
            tuple(middle - mark),
            textcoords="offset points",
            ha="center",
            va="center",
            color=colour,
            weight="bold",
            arrowprops=None if is_near else line,
        )
        taken = np.concatenate([taken, places_between(middle - half, middle + half, 5)])


def name_place(
    mark: Float[np.ndarray, " 2"],
    half: Float[np.ndarray, " 2"],
    taken: Float[np.ndarray, "taken 2"],
    size: Float[np.ndarray, " 2"],
) -> Float[np.ndarray, " 2"]:
    """Return the middle of a name that covers the fewest points ``taken``.

    ``half`` is half the size of the name, ``size`` that of the axes. The name is next to its mark if a place there is
    free, otherwise anywhere within the axes. Lengths are in points.
    """
    beside = places_beside(mark, half, NAMES.distances)
    inside = ((beside - half >= 0.0) & (beside + half <= size)).all(axis=1)
    free = inside & (count_covered(beside, half, taken, gap=NAMES.gap) == 0)
    if free.any():
        return np.asarray(beside[int(free.argmax())])
    return freest_place(places_between(half, size - half, NAMES.grid), half, mark, taken, NAMES.gap)[0]


# Pictures of a front and its motions.


WITHOUT_ARM = "To draw the arm, load the front with its problem: load_front(folder, problem)."


@dataclass(frozen=True, kw_only=True)
class Highlight:
    """A point that is marked in the front and whose motion is drawn: its row, colour and reason."""

    index: int
    colour: str
    reason: str


def highlighted(front: Front, choice: Choice | None) -> list[Highlight]:
    """Return the best points of the first three objectives, and the `choice`, by default the compromise."""
    if len(front) == 0:
        return []
    reasons: dict[int, str] = {}
    for row, name in zip(best_rows(front.minimised[:, :3], front.ids), front.names, strict=False):
        reasons.setdefault(row, f"best {name}")
    if choice is not None:
        reasons[choice.index] = "chosen"
    else:
        reasons.setdefault(compromise(front).index, "compromise")
    rows = sorted(reasons)
    return [Highlight(index=row, colour=PAPER.accent(n), reason=reasons[row]) for n, row in enumerate(rows)]


def front_picture(front: Front, file: Path | str, choice: Choice | None = None) -> None:
    """Write a PNG of `front` and, if it has motions, of some of them.

    - Motions: the best in each of the first three objectives, and the `choice`, by default ``front.compromise``. If
      their arm is unknown, they are drawn as joint positions over time. If one exceeds a limit between samples, a text
      says which limit, when, and what helps.
    - Front: values of one objective, scatters of two or three, otherwise parallel coordinates. If there are two, a line
      joins neighbours on one branch of optima, and jumps are dotted (``Front.jumps``).

    Raises InvalidInput if writing fails.
    """
    highlights = highlighted(front, choice)
    many, stored = len(front.names) > 2, front.motions
    size = ((9.6, 3.2) if many else (4.2, 3.4)) if stored is None else ((9.6, 6.0) if many else (11.0, 3.3))
    with picture(file, size) as figure:
        if stored is None or not highlights:
            _draw_front(figure, front, highlights)
            return
        grid: Any = {"nrows": 2} if many else {"ncols": 2, "width_ratios": [1.0, 2.0]}
        trade_off, below = parts(figure, **grid)
        _draw_front(trade_off, front, highlights)
        titles = [(f"point {front.ids[point.index]}, {_text(point.reason)}", point.colour) for point in highlights]
        rows = [point.index for point in highlights]
        motions: list[Any] = [stored[row] for row in rows]
        if not isinstance(stored, StoredMotions):
            draw_motions(below, motions, titles)
            warn_below(figure, describe_limits_between(front, rows))
            return
        panels = np.atleast_1d(below.subplots(1, len(motions), sharex=True, sharey=True))
        for axes, motion, (title, colour) in zip(panels, motions, titles, strict=True):
            for joint, positions in zip(motion.arm.joint_names, np.transpose(motion.q), strict=True):
                axes.plot(motion.time, positions, label=_text(joint))
            axes.set_title(title, color=colour)
            axes.set_xlabel("time [s]")
        panels[0].set_ylabel("joint position [rad or m]")
        panels[-1].legend(frameon=False, fontsize="small")
        warn_below(figure, WITHOUT_ARM)


@contextmanager
def picture(file: Path | str, size: tuple[float, float]) -> Iterator[Figure]:
    """Yield a figure of a size [inches] and write it as a small PNG; raises InvalidInput if that fails.

    A ``matplotlibrc`` is ignored: one in the current folder, which may be anybody's run, could start LaTeX.
    """
    pixels = io.BytesIO()
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(PAPER.style)
        figure = Figure(figsize=size, dpi=125, layout="constrained")
        yield figure
        figure.savefig(pixels, format="png")
    mark, content = PngInfo(), io.BytesIO()
    mark.add_text("Software", "paretoik")  # run_files.PICTURE_MARK
    # A palette takes a third of the space of true colours, without a visible difference.
    Image.open(pixels).convert("RGB").quantize(128).save(content, format="png", optimize=True, pnginfo=mark)
    replace_file(Path(file), content.getvalue())


def parts(figure: Figure, *grid: int, **settings: Any) -> Any:
    """Return parts of a figure side by side, or one above the other."""
    return figure.subfigures(*grid, **settings)


def label(front: Front, axis: int) -> str:
    """Return the label of an objective's axis."""
    return _text(objective_label(front.names[axis], front.units[axis], front.maximised[axis]))


def warn_below(figure: Figure, words: str) -> None:
    """Write words, if any, below the drawing, in lines that fit its width."""
    if words:
        lines = textwrap.fill(_text(words), int(12 * figure.get_figwidth()))
        figure.supxlabel(lines, fontsize="medium", color=PAPER.accents[0])


def draw_jumps(axes: Axes, front: Front) -> None:
    """Join neighbours of a front by a dotted line if they are on different branches of optima."""
    for i, pair in enumerate(pairwise(front.ids.tolist())):
        if pair in (front.jumps or ()):
            first = pair == (front.jumps or ())[0]
            x, y = front.objectives[i : i + 2].T
            axes.plot(x, y, color=PAPER.accents[0], linestyle=":", zorder=1, label="jump" if first else None)


def stroboscopic(axes: Axes, motion: Any, *, colour: str = PAPER.accents[1]) -> None:
    """Draw a single `motion`: obstacles, tool path, and some postures, later ones darker."""
    size = 2 if motion.arm.is_planar else 3
    seen = motion.links[..., :size].reshape(-1, size)
    if size == 2:
        for line in obstacle_lines(motion.obstacles, None, seen):
            axes.fill(*line.T, facecolor=PAPER.quiet, alpha=0.5, linewidth=0.0)
    else:  # unbounded obstacles have the arm's height
        height = (min(0.0, float(motion.links[..., 2].min())), float(motion.links[..., 2].max()))
        for wire in obstacle_lines(motion.obstacles, height, seen):
            axes.plot(*wire.T, color=PAPER.quiet, linewidth=0.6, alpha=0.8)
    links, tool = motion.links[..., :size], motion.tool[..., :size]
    picked = even_rows(len(links), PAPER.postures)
    for place, sample in enumerate(picked):
        strength = 0.18 + 0.62 * (place / max(len(picked) - 1, 1)) ** 2
        axes.plot(*links[sample].T, color=PAPER.ink, alpha=strength, linewidth=1.3, solid_capstyle="round")
    last = links[picked[-1]]
    axes.plot(*last.T, color=PAPER.ink, linestyle="none", marker="o", markersize=3.2, markerfacecolor="white")
    axes.plot(*tool.T, color=colour, linewidth=1.8)
    axes.plot(*tool[-1:].T, color=colour, marker="o", markersize=4.5)


def arm_axes(*, planar: bool) -> Any:
    """Return the kind of axes on which an arm is drawn."""
    return {"aspect": "equal"} if planar else {"projection": "3d"}


def label_arm(axes: Any, *, planar: bool) -> None:
    """Label the axes of an arm; in space, set equal scales and make space for the labels."""
    axes.set(xlabel="x [m]", ylabel="y [m]")
    if planar:
        return
    axes.set_zlabel("z [m]")
    axes.tick_params(pad=-2)
    for axis, pad in ((axes.xaxis, -2.0), (axes.yaxis, -2.0), (axes.zaxis, -1.0)):  # keep words off the ticks
        axis.labelpad = pad
    axes.set_aspect("equal")
    axes.set_box_aspect(None, zoom=0.76)


def _draw_front(figure: Figure | SubFigure, front: Front, highlights: Sequence[Highlight]) -> None:
    n_obj, ids = len(front.names), front.ids
    if len(front) == 0:
        figure.text(0.5, 0.5, "no feasible point", ha="center", color=PAPER.quiet)
    elif n_obj == 1:
        axes, places = figure.subplots(), np.arange(len(front))
        axes.plot(front.objectives[:, 0], places, color=PAPER.quiet, linestyle="none", marker="o", markersize=4)
        for point in highlights:
            value = front.objectives[point.index, 0]
            axes.plot(value, point.index, color=point.colour, marker="o", markersize=8)
            axes.annotate(f"{value:.4g}", (value, point.index), (0, 9), textcoords="offset points", ha="center")
        axes.set(xlabel=label(front, 0), ylabel="point", yticks=places, yticklabels=[str(number) for number in ids])
        axes.margins(0.2)
    elif n_obj <= 3:
        pairs = list(combinations(range(n_obj), 2))
        for axes, (i, j) in zip(np.atleast_1d(figure.subplots(1, len(pairs))), pairs, strict=True):
            x, y = front.objectives[:, [i, j]].T
            axes.plot(x, y, color=PAPER.quiet, linestyle="none", marker="o", markersize=3.6, markeredgewidth=0)
            if front.jumps is not None:
                first_rows = [i + 1 for i, each in enumerate(pairwise(ids.tolist())) if each in front.jumps]
                for rows in np.split(np.arange(len(front)), first_rows):
                    axes.plot(x[rows], y[rows], color=PAPER.quiet, linewidth=0.8, zorder=1)
            if front.jumps:
                draw_jumps(axes, front)
                axes.legend(frameon=False, loc="upper right")
            for point in highlights:
                spot = (x[point.index], y[point.index])
                axes.plot(*spot, color=point.colour, marker="o", markersize=7.5, markeredgecolor="white")
            axes.set(xlabel=label(front, i), ylabel=label(front, j))
            axes.locator_params(nbins=5)
            axes.margins(0.09)
            named = [(each.index, str(ids[each.index]), each.colour) for each in highlights]
            name_points(axes, np.stack([x, y], axis=1), named)
    else:  # parallel coordinates: one line per point, one axis per objective, its best value at the bottom
        axes, places = figure.subplots(), np.arange(n_obj)
        axes.plot(places, front.shares.T, color=PAPER.quiet, alpha=0.35, linewidth=0.8)
        for point in highlights:
            words = f"point {ids[point.index]}, {point.reason}"
            axes.plot(places, front.shares[point.index], color=point.colour, linewidth=2.2, label=words)
        low, high = np.where(front.maximised, front.ranges.T[::-1], front.ranges.T)
        style: Any = {"textcoords": "offset points", "ha": "center", "color": PAPER.quiet}
        for place, best, worst in zip(places, low, high, strict=True):
            axes.annotate(f"{best:.3g}", (place, 0.0), (0, -11), **style)
            axes.annotate(f"{worst:.3g}", (place, 1.0), (0, 5), **style)
        axes.set_xticks(places, [label(front, axis) for axis in range(n_obj)])
        axes.set(ylabel="worst above, best below", yticks=[], ylim=(-0.02, 1.02))
        axes.spines[["bottom", "left"]].set_visible(False)
        axes.tick_params(axis="x", pad=14, length=0)
        axes.grid(axis="y", visible=False)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)


def draw_motions(figure: Figure | SubFigure, motions: Sequence[Any], titles: Sequence[tuple[str, str]]) -> None:
    """Draw motions of one arm side by side, each with its title and colour."""
    planar = motions[0].arm.is_planar
    settings: Any = {"sharex": planar, "sharey": planar, "subplot_kw": arm_axes(planar=planar)}
    panels = np.atleast_1d(figure.subplots(1, len(motions), **settings))
    for axes, motion, (title, colour) in zip(panels, motions, titles, strict=True):
        stroboscopic(axes, motion, colour=colour)
        axes.set_title(title, color=colour)
        axes.locator_params(nbins=4)
        axes.set_xlabel("x [m]")
        if not planar:
            label_arm(axes, planar=False)
    if planar:
        panels[0].set_ylabel("y [m]")


def _text(words: str) -> str:
    """Escape dollar signs, which Matplotlib reads as mathematics."""
    return words.replace("$", r"\$")


# A picture of fronts, and of the surfaces that the runs of one method attain.


MARKERS = "osD^vP*X"


def comparison_picture(comparison: Comparison, file: Path | str) -> None:
    """Write a PNG of fronts in one picture, one colour per label, with the hypervolume of each.

    Two objectives: labels with several runs have the surfaces that one run, half of the runs, and all runs attain.
    More than three: parallel coordinates, with the best of the merged front at the bottom. Raises InvalidInput if
    writing fails.
    """
    first, fronts, order, styles = comparison.fronts[0], comparison.fronts, list(comparison.groups), []
    n_obj = len(first.names)
    for place, (name, volume) in enumerate(zip(comparison.labels, comparison.hypervolume, strict=True)):
        group, number = comparison.groups[name], order.index(name)
        words = f"{name}: hypervolume {volume:.4f}"
        if len(group) > 1:
            words = f"{name}: {len(group)} runs, median hypervolume {np.median(comparison.hypervolume[group]):.4f}"
        style: dict[str, Any] = {"color": PAPER.accent(number), "marker": MARKERS[number % len(MARKERS)]}
        styles.append(style | {"label": words if place == group[0] else None})
    with picture(file, (9.6 if n_obj > 2 else 6.6, 4.2)) as figure:
        if n_obj == 1:
            axes = figure.subplots()
            for place, (front, style) in enumerate(zip(fronts, styles, strict=True)):
                level = np.full(len(front), place)
                axes.plot(front.objectives[:, 0], level, linestyle="none", markersize=6, **style)
            axes.set(xlabel=label(first, 0), yticks=range(len(comparison.labels)))
            axes.set_yticklabels(list(map(_text, comparison.labels)))
            axes.margins(0.2)
        elif n_obj > 3:
            axes, places = figure.subplots(), np.arange(n_obj)
            for shares, style in zip(comparison.shares, styles, strict=True):
                axes.plot(places, shares.T, color=style["color"], alpha=0.35, linewidth=0.8)
                axes.plot([], [], color=style["color"], label=style["label"])
            axes.set_xticks(places, [label(first, axis) for axis in places.tolist()])
            axes.set(ylabel="share of the merged front's range, best below")
        else:
            pairs = list(combinations(range(n_obj), 2))
            for axes, (i, j) in zip(np.atleast_1d(figure.subplots(1, len(pairs))), pairs, strict=True):
                for front, style in zip(fronts, styles, strict=True):
                    x, y = front.objectives[:, [i, j]].T
                    axes.plot(x, y, linestyle="none", markersize=4, markeredgewidth=0, alpha=0.75, **style)
                # The surfaces that one, half and all runs of a label attain: borders of the dominated region.
                sign, every = np.where(first.maximised, -1.0, 1.0), np.concatenate([each.objectives for each in fronts])
                window = np.array([np.ptp(each) * 0.06 for each in every.T])
                edges = np.concatenate([each.minimised for each in fronts]).max(axis=0) + window
                for name in comparison.runs if n_obj == 2 else ():
                    style = {"color": PAPER.accent(order.index(name)), "linewidth": 1.1, "zorder": 1}
                    for (words, surface), line in zip(comparison.surfaces(name).items(), (":", "-", "--"), strict=True):
                        points = (surface * sign)[np.argsort((surface * sign)[:, 0], kind="stable")]
                        x = np.repeat([*points[:, 0], edges[0]], 2)[:-1]
                        y = np.repeat([edges[1], *points[:, 1]], 2)[1:]
                        said = f"{name}: {words} attainment"
                        axes.plot(x * sign[0], y * sign[1], label=said, linestyle=line, **style)
                axes.set(xlabel=label(first, i), ylabel=label(first, j))
                axes.locator_params(nbins=5)
                axes.margins(0.06)
        handles, names = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=2, frameon=False, fontsize=8)
