"""Pictures of tool paths, resolved motions, directional maxima, closed loops and plans."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from paretoik.capability.directional import PerformancePolygon
from paretoik.front.front import Front
from paretoik.resolution.protocol import ResolvedMotion
from paretoik.review.palette import PAPER
from paretoik.review.pictures.fronts import arm_axes, draw_motions, label, label_arm, parts, picture, stroboscopic
from paretoik.review.recording.messages import PathEnd, PlannedLevel
from paretoik.robot.kinematics import link_nodes
from paretoik.task.limits import JOINT_UNITS, joint_units
from paretoik.task.task import error_unit
from paretoik.trajectory.plan import Plan


def path_picture(path: PathEnd, file: Path | str) -> None:
    """Write a PNG of a tool path; raises InvalidInput if the file cannot be written."""
    planar = path.tool.shape[1] == 2
    with picture(file, (10.0, 3.6)) as figure:
        place, curves = parts(figure, 1, 2, width_ratios=[1.2, 1.0])
        axes = place.subplots(subplot_kw=arm_axes(planar=planar))
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


def resolution_picture(motion: ResolvedMotion, criteria: list[str], file: Path | str) -> None:
    """Write a PNG of a single motion; raises InvalidInput if the file cannot be written."""
    planar, traces = motion.arm.is_planar, motion.traces
    with picture(file, (11.0, 3.6)) as figure:
        arm, joints, steps = parts(figure, 1, 3, width_ratios=[1.2, 1.0, 1.0])
        axes = arm.subplots(subplot_kw=arm_axes(planar=planar))
        stroboscopic(axes, motion)
        for task in motion.tasks:
            path = task.path.positions[:, : 2 if planar else 3]
            axes.plot(*path.T, color=PAPER.accents[0], linewidth=1.0, linestyle="--", label="wanted")
        label_arm(axes, planar=planar)
        axes.legend(frameon=False, loc="upper right")
        _draw_joints(joints.subplots(), motion)
        # the largest task error of every sample, with marks at steps whose status is not "done"
        above, below = steps.subplots(2, 1, sharex=True)
        shown = np.maximum(np.abs(traces.errors).max(axis=-1), 1e-16)
        above.semilogy(motion.time, shown, color=PAPER.accents[1], linewidth=1.2)
        for number, status in enumerate(sorted(set(traces.status.tolist()) - {"done"})):
            at, style = np.flatnonzero(traces.status == status) + 1, {"linestyle": "none", "marker": "."}
            above.semilogy(motion.time[at], shown[at], color=PAPER.accent(number + 2), label=status, **style)
            above.legend(frameon=False)
        above.set_ylabel(f"error [{error_unit(motion.tasks)}]")
        # joint speeds due to each criterion; the damping if there are no criteria
        for number, name in enumerate(criteria):
            speed = np.linalg.norm(traces.projected[:, number], axis=-1)
            below.plot(motion.time[1:], speed, color=PAPER.accent(number), linewidth=1.2, label=name)
            below.legend(frameon=False)
        if not criteria:
            below.plot(motion.time[1:], traces.damping, color=PAPER.accents[1], linewidth=1.2)
        below.set(xlabel="time [s]", ylabel="joint speed from\ncriteria [rad/s]" if criteria else "damping")


def _draw_joints(axes: Axes, motion: Any) -> None:
    """Draw the joint positions of a single motion over time."""
    for j, (joint, name) in enumerate(zip(motion.q.T, motion.arm.joint_names, strict=True)):
        axes.plot(motion.time, joint, color=PAPER.accent(j), linewidth=1.2, label=name)
    axes.set(xlabel="time [s]", ylabel=f"joint position [{joint_units(motion.arm, JOINT_UNITS['position'])}]")
    axes.legend(frameon=False)


def polygon_picture(polygon: PerformancePolygon, file: Path | str) -> None:
    """Write a PNG of a polygon; raises InvalidInput if the file cannot be written."""
    planar = polygon.arm.is_planar
    names, solved = "xyz"[: 2 if planar else 3], np.flatnonzero(np.isfinite(polygon.values))
    kind, unit = ("speed", "m/s") if polygon.quantity == "velocity" else ("force", "N")
    with picture(file, (9.0, 4.0)) as figure:
        maxima, postures = figure.subplots(1, 2, subplot_kw=arm_axes(planar=planar))
        ends = polygon.vertices[solved]
        for end in ends:
            maxima.plot(*np.stack([np.zeros(len(names)), end]).T, color=PAPER.quiet, linewidth=0.7)
        outline = np.concatenate([ends, ends[:1]]) if planar and len(solved) > 2 else ends
        maxima.plot(*outline.T, color=PAPER.accents[0], marker="o", markersize=3.5, linestyle="-" if planar else "none")
        maxima.set(**{f"{name}label": f"{kind} along {name} [{unit}]" for name in names})
        links = link_nodes(polygon.arm, polygon.q[solved])[..., : len(names)]
        for line in links:
            postures.plot(*line.T, color=PAPER.ink, alpha=0.25, linewidth=1.3)
        if len(solved):
            best = int(np.argmax(polygon.values[solved]))
            postures.plot(*links[best].T, color=PAPER.accents[1], linewidth=2.0)
            postures.set_title("posture of the greatest maximum", color=PAPER.accents[1])
        postures.plot(*polygon.position[:, None], color=PAPER.accents[0], marker="o")
        postures.set(**{f"{name}label": f"{name} [m]" for name in names})


def loop_picture(motion: Any, values: np.ndarray, ranges: np.ndarray, front: Front, file: Path | str) -> None:
    """Write a PNG of a closed loop's ``motion``, and of each step's chosen, best and worst values.

    ``values`` (steps, n_obj) and ``ranges`` (steps, n_obj, 2: best, worst) are in the objectives' own signs; ``front``
    has their names and units. Raises InvalidInput if the file cannot be written.
    """
    with picture(file, (11.0, 3.6)) as figure:
        arm, joints, chosen = parts(figure, 1, 3, width_ratios=[1.2, 1.0, 1.2])
        planar = motion.arm.is_planar
        axes = arm.subplots(subplot_kw=arm_axes(planar=planar))
        stroboscopic(axes, motion)
        label_arm(axes, planar=planar)
        _draw_joints(joints.subplots(), motion)
        rows = np.atleast_1d(chosen.subplots(values.shape[1], 1, sharex=True))
        for axis, axes in enumerate(rows):
            low, high = np.sort(ranges[:, axis], axis=1).T
            axes.fill_between(motion.time[1:], low, high, color=PAPER.quiet, alpha=0.3, linewidth=0)
            axes.plot(motion.time[1:], values[:, axis], color=PAPER.accents[1], linewidth=1.2)
            if low.min() > 0:
                axes.set_yscale("log")
            axes.set_ylabel(label(front, axis), fontsize=8)
        rows[0].set_title("chosen, within the front of each step")
        rows[-1].set_xlabel("time [s]")


def plan_picture(plan: Plan, levels: Sequence[PlannedLevel], label: str, unit: str, file: Path | str) -> None:
    """Write a PNG of a plan whose objective has a ``label`` and a ``unit``.

    Raises InvalidInput if the file cannot be written.
    """
    optima, samples = plan.optima[: PAPER.motions], len(plan.best.motion.time)
    with picture(file, (11.0, 3.4)) as figure:
        values, motions = parts(figure, 1, 2, width_ratios=[1.0, 2.0])
        axes, dots = values.subplots(), {"linestyle": "none", "marker": "o"}
        for level in levels:
            of_starts, of_optima = (
                {"color": PAPER.grid, "markersize": 2.5, "zorder": 1},
                {"color": PAPER.quiet, "markersize": 4},
            )
            if level is levels[-1]:
                of_starts, of_optima = of_starts | {"label": "starts"}, of_optima | {"label": "distinct optima"}
            axes.plot(np.full(len(level.starts), level.samples), level.starts, **dots, **of_starts)
            axes.plot(np.full(len(level.optima), level.samples), level.optima, **dots, **of_optima)
        for rank, optimum in enumerate(optima):
            size, edge = (
                7 + 4 * (len(optima) - 1 - rank),
                {"marker": "o", "markeredgecolor": "w"},
            )  # rings if they coincide
            axes.plot(samples, optimum.objective, color=PAPER.accent(rank), markersize=size, **edge)
        # the axes show the optima, and starts that are near them
        shown = np.concatenate([[each.objective for each in plan.optima], *(level.optima for level in levels)])
        low, high = float(shown.min()), float(shown.max())
        margin = 0.15 * (high - low) or 0.05 * abs(high) or 1.0
        axes.set(xlabel="samples of the level", ylabel=label, ylim=(low - margin, high + margin))
        axes.set_xticks(sorted({samples, *(level.samples for level in levels)}))
        if levels:
            axes.legend(frameon=False)
        titles = [
            (f"{f'optimum {rank}' if rank else 'best'}: {optimum.objective:.4g} {unit}".rstrip(), PAPER.accent(rank))
            for rank, optimum in enumerate(optima)
        ]
        draw_motions(motions, [optimum.motion for optimum in optima], titles)
