"""A picture of a tool path: where it leads, how fast the tool is, how far from its target."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from paretoik.review.palette import PAPER
from paretoik.review.pictures.plots import picture
from paretoik.review.recording.recorded_path import PathEnd


def path_picture(path: PathEnd, file: Path | str) -> None:
    """Write a PNG of a tool path; raises InvalidInput if the file cannot be written."""
    planar = path.tool.shape[1] == 2
    kind: Any = {"aspect": "equal"} if planar else {"projection": "3d"}
    with picture(file, (10.0, 3.6)) as figure:
        parts: Any = figure.subfigures(1, 2, width_ratios=[1.2, 1.0])
        place, curves = parts
        axes = place.subplots(subplot_kw=kind)
        if path.reference is not None:
            axes.plot(*path.reference.T, color=PAPER.quiet, linewidth=1.0, linestyle="--", label="reference")
        axes.plot(*path.tool.T, color=PAPER.accents[0], linewidth=1.5, label="tool")
        axes.plot(*path.tool[0][:, None], color=PAPER.ink, marker="o", linestyle="none", label="start")
        axes.plot(*path.target[:, None], color=PAPER.accents[1], marker="s", linestyle="none", label="target")
        axes.set(**{f"{name}label": f"{name} [m]" for name in "xyz"[: len(path.target)]})
        axes.legend(frameon=False)
        above, below = curves.subplots(2, 1, sharex=True)
        above.plot(path.middles, path.speed, color=PAPER.accents[0], linewidth=1.2)
        above.set_ylabel("tool speed [m/s]")
        below.plot(path.times, path.distance, color=PAPER.accents[1], linewidth=1.2)
        below.set(xlabel="time [s]", ylabel="distance to the target [m]")
