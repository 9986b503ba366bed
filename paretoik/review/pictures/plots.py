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
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from paretoik.file_replacement import replace_file
from paretoik.front.compromise import compromise
from paretoik.front.front import Choice, Front
from paretoik.front.joint_motions import StoredMotions
from paretoik.front.marked_rows import best_rows
from paretoik.review.even_rows import even_rows
from paretoik.review.limits_between import describe_limits_between
from paretoik.review.palette import PAPER, objective_label
from paretoik.review.pictures.drawn_obstacles import draw_obstacles
from paretoik.review.pictures.point_names import NamedPoint, name_points

WITHOUT_ARM = "The run's problem is not at hand: its arm is drawn after load_front(folder, problem)."


@dataclass(frozen=True, kw_only=True)
class Highlight:
    """A point that is marked in the front and whose motion is drawn: its row, its colour and the reason."""

    index: int
    colour: str
    reason: str


def front_picture(front: Front, file: Path | str, choice: Choice | None = None) -> None:
    """Write a PNG of `front` and, where it has motions, of some of them: the best in each of the first objectives.

    To these comes `choice`, or without one the compromise (``front.compromise``). Where one of these motions exceeds a
    limit between samples, the words say which, when, and what helps; motions without their arm are drawn as joint
    positions over time. One objective is shown as values, two and three as scatters, more as parallel coordinates; of
    two, neighbours on one branch of optima are joined by a line, jumps dotted (``Front.jumps``). Raises InvalidInput
    where writing fails.
    """
    highlights = _highlights(front, choice)
    many, moving = len(front.names) > 2, front.motions is not None
    size = ((9.6, 6.0) if moving else (9.6, 3.2)) if many else ((11.0, 3.3) if moving else (4.2, 3.4))
    with picture(file, size) as figure:
        if not moving or not highlights:
            _draw_front(figure, front, highlights)
        else:
            grid: Any = {"nrows": 2} if many else {"ncols": 2, "width_ratios": [1.0, 2.0]}
            trade_off, motions = np.ravel(figure.subfigures(**grid))
            _draw_front(trade_off, front, highlights)
            if isinstance(front.motions, StoredMotions):
                _draw_joints(motions, front, highlights)
                warn_below(figure, WITHOUT_ARM)
            else:
                _draw_motions(motions, front, highlights)
                warn_below(figure, describe_limits_between(front, [point.index for point in highlights]))


@contextmanager
def picture(file: Path | str, size: tuple[float, float]) -> Iterator[Figure]:
    """Yield a figure of a size [inches] and write it as a small PNG of ours; raises InvalidInput where that fails.

    A ``matplotlibrc`` has no say: one in the current folder, which may be a run from anybody, could start LaTeX.
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
    # A palette takes a third of the space of true colours, and the eye sees no difference.
    Image.open(pixels).convert("RGB").quantize(128).save(content, format="png", optimize=True, pnginfo=mark)
    replace_file(Path(file), content.getvalue())


def label(front: Front, axis: int) -> str:
    """Return the label of an objective's axis."""
    return _text(objective_label(front.names[axis], front.units[axis], front.maximised[axis]))


def warn_below(figure: Figure, words: str) -> None:
    """Write words, if any, below what is drawn, in lines that fit its width."""
    if words:
        lines = textwrap.fill(_text(words), int(12 * figure.get_figwidth()))
        figure.supxlabel(lines, fontsize="medium", color=PAPER.accents[0])


def draw_jumps(axes: Axes, front: Front) -> None:
    """Join neighbours of a front by dots where it jumps from one branch of optima to another."""
    for i, pair in enumerate(pairwise(front.ids.tolist())):
        if pair in (front.jumps or ()):
            first = pair == (front.jumps or ())[0]
            x, y = front.objectives[i : i + 2].T
            axes.plot(x, y, color=PAPER.accents[0], linestyle=":", zorder=1, label="jump" if first else None)


def stroboscopic(axes: Axes, motion: Any, *, colour: str = PAPER.accents[1]) -> None:
    """Draw a single `motion`: its obstacles, some of its postures, the later the darker, and the path of its tool.

    The axes must be three-dimensional for an arm that is not planar.
    """
    draw_obstacles(axes, motion)
    size = 2 if motion.arm.is_planar else 3
    links, tool = motion.links[..., :size], motion.tool[..., :size]
    picked = even_rows(len(links), PAPER.postures)
    for place, sample in enumerate(picked):
        strength = 0.18 + 0.62 * (place / max(len(picked) - 1, 1)) ** 2
        axes.plot(*links[sample].T, color=PAPER.ink, alpha=strength, linewidth=1.3, solid_capstyle="round")
    last = links[picked[-1]]
    axes.plot(*last.T, color=PAPER.ink, linestyle="none", marker="o", markersize=3.2, markerfacecolor="white")
    axes.plot(*tool.T, color=colour, linewidth=1.8)
    axes.plot(*tool[-1:].T, color=colour, marker="o", markersize=4.5)


def label_arm(axes: Any, *, planar: bool) -> None:
    """Name the axes of an arm; in space they have one scale, and room for their names."""
    axes.set(xlabel="x [m]", ylabel="y [m]")
    if planar:
        return
    axes.set_zlabel("z [m]")
    axes.tick_params(pad=-2)
    for axis, pad in ((axes.xaxis, -2.0), (axes.yaxis, -2.0), (axes.zaxis, -1.0)):  # words stand off the ticks
        axis.labelpad = pad
    axes.set_aspect("equal")
    axes.set_box_aspect(None, zoom=0.76)


def _highlights(front: Front, choice: Choice | None) -> list[Highlight]:
    if len(front) == 0:
        return []
    reasons: dict[int, str] = {}
    for row, name in zip(best_rows(front.minimised[:, :3], front.ids), front.names, strict=False):
        reasons.setdefault(row, f"best {name}")
    if choice is not None:
        reasons[choice.index] = "chosen"
    else:
        reasons.setdefault(compromise(front).index, "compromise")
    ordered = sorted(reasons.items())
    return [
        Highlight(index=index, colour=PAPER.accents[n % 4], reason=reason) for n, (index, reason) in enumerate(ordered)
    ]


def _draw_front(figure: Figure | SubFigure, front: Front, highlights: Sequence[Highlight]) -> None:
    if len(front) == 0:
        figure.text(0.5, 0.5, "no feasible point", ha="center", color=PAPER.quiet)
    elif len(front.names) == 1:
        _draw_values(figure.subplots(), front, highlights)
    elif len(front.names) <= 3:
        pairs = list(combinations(range(len(front.names)), 2))
        for axes, pair in zip(np.atleast_1d(figure.subplots(1, len(pairs))), pairs, strict=True):
            _draw_pair(axes, front, pair, highlights)
    else:
        _draw_parallel(figure.subplots(), front, highlights)


def _draw_values(axes: Axes, front: Front, highlights: Sequence[Highlight]) -> None:
    places = np.arange(len(front))
    axes.plot(front.objectives[:, 0], places, color=PAPER.quiet, linestyle="none", marker="o", markersize=4)
    for point in highlights:
        value = front.objectives[point.index, 0]
        axes.plot(value, point.index, color=point.colour, marker="o", markersize=8)
        axes.annotate(f"{value:.4g}", (value, point.index), (0, 9), textcoords="offset points", ha="center")
    axes.set(xlabel=label(front, 0), ylabel="point", yticks=places, yticklabels=[str(number) for number in front.ids])
    axes.margins(0.2)


def _draw_pair(axes: Axes, front: Front, pair: tuple[int, int], highlights: Sequence[Highlight]) -> None:
    x, y = front.objectives[:, pair[0]], front.objectives[:, pair[1]]
    axes.plot(x, y, color=PAPER.quiet, linestyle="none", marker="o", markersize=3.6, markeredgewidth=0)
    if front.jumps is not None:
        first_rows = [i + 1 for i, each in enumerate(pairwise(front.ids.tolist())) if each in front.jumps]
        for rows in np.split(np.arange(len(front)), first_rows):
            axes.plot(x[rows], y[rows], color=PAPER.quiet, linewidth=0.8, zorder=1)
    if front.jumps:
        draw_jumps(axes, front)
        axes.legend(frameon=False, loc="upper right")
    for point in highlights:
        spot = (x[point.index], y[point.index])
        axes.plot(*spot, color=point.colour, marker="o", markersize=7.5, markeredgecolor="white")
    axes.set(xlabel=label(front, pair[0]), ylabel=label(front, pair[1]))
    axes.locator_params(nbins=5)
    axes.margins(0.09)
    named = [NamedPoint(row=each.index, name=str(front.ids[each.index]), colour=each.colour) for each in highlights]
    name_points(axes, np.stack([x, y], axis=1), named)


def _draw_parallel(axes: Axes, front: Front, highlights: Sequence[Highlight]) -> None:
    """Draw a line a point across an axis an objective, the best value of each at the bottom."""
    places = np.arange(len(front.names))
    axes.plot(places, front.shares.T, color=PAPER.quiet, alpha=0.35, linewidth=0.8)
    for point in highlights:
        shares = front.shares[point.index]
        axes.plot(
            places, shares, color=point.colour, linewidth=2.2, label=f"point {front.ids[point.index]}, {point.reason}"
        )
    low, high = np.where(front.maximised, front.ranges.T[::-1], front.ranges.T)
    for place, best, worst in zip(places, low, high, strict=True):
        axes.annotate(f"{best:.3g}", (place, 0.0), (0, -11), textcoords="offset points", ha="center", color=PAPER.quiet)
        axes.annotate(f"{worst:.3g}", (place, 1.0), (0, 5), textcoords="offset points", ha="center", color=PAPER.quiet)
    axes.set_xticks(places, [label(front, axis) for axis in range(len(places))])
    axes.set(ylabel="worst above, best below", yticks=[], ylim=(-0.02, 1.02))
    axes.spines[["bottom", "left"]].set_visible(False)
    axes.tick_params(axis="x", pad=14, length=0)
    axes.grid(axis="y", visible=False)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)


def _draw_motions(figure: Figure | SubFigure, front: Front, highlights: Sequence[Highlight]) -> None:
    assert front.motions is not None
    motions = [front.motions[point.index] for point in highlights]
    planar = motions[0].arm.is_planar
    kind: Any = {"aspect": "equal"} if planar else {"projection": "3d"}
    panels = figure.subplots(1, len(highlights), sharex=planar, sharey=planar, subplot_kw=kind)
    for axes, point, motion in zip(np.atleast_1d(panels), highlights, motions, strict=True):
        stroboscopic(axes, motion, colour=point.colour)
        axes.set_title(f"point {front.ids[point.index]}, {_text(point.reason)}", color=point.colour)
        axes.locator_params(nbins=4)
        axes.set_xlabel("x [m]")
        if not planar:
            label_arm(axes, planar=False)
    if planar:
        np.atleast_1d(panels)[0].set_ylabel("y [m]")


def _draw_joints(figure: Figure | SubFigure, front: Front, highlights: Sequence[Highlight]) -> None:
    """Draw the joint positions of motions whose arm is not known."""
    assert front.motions is not None
    panels = np.atleast_1d(figure.subplots(1, len(highlights), sharex=True, sharey=True))
    for axes, point in zip(panels, highlights, strict=True):
        motion = front.motions[point.index]
        for joint, positions in zip(motion.arm.joint_names, np.transpose(motion.q), strict=True):
            axes.plot(motion.time, positions, label=_text(joint))
        axes.set_title(f"point {front.ids[point.index]}, {_text(point.reason)}", color=point.colour)
        axes.set_xlabel("time [s]")
    panels[0].set_ylabel("joint position [rad or m]")
    panels[-1].legend(frameon=False, fontsize="small")


def _text(words: str) -> str:
    """Escape dollar signs, which Matplotlib reads as mathematics."""
    return words.replace("$", r"\$")
