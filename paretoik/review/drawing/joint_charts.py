"""Charts of what joints do along a motion, with their limits drawn in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Times, Values
from paretoik.review.drawing.curve_charts import Chart, LimitLine, fit_below_tabs
from paretoik.review.joint_units import has_masses, is_sliding, joint_units
from paretoik.review.palette import SCREEN
from paretoik.review.recording.workcell import Workcell
from paretoik.robot.scales import joint_scales
from paretoik.task.limits import JOINT_UNITS, usual_ranges

CurvedMotion = tuple[np.ndarray, Mapping[str, np.ndarray]]  # times (time,), and (time, dof) by kind
ALWAYS = ("position", "velocity", "torque")
OF_MASSES = ("torque", "power")


def joint_charts(root: str, cell: Workcell, motions: Sequence[CurvedMotion]) -> dict[str, Chart]:
    """Return a chart a kind of quantity at entities below ``root``, wide enough for all ``motions``, times with curves.

    Accelerations and powers are drawn where they are limited, of arms without masses neither torques nor powers.
    """
    charts = {}
    sliding = is_sliding(cell.arm)
    for kind, units in JOINT_UNITS.items():
        if not motions or (kind not in ALWAYS and kind not in cell.bounds):
            continue
        if kind in OF_MASSES and not has_masses(cell.arm):
            continue
        end = max(float(time[-1]) for time, _ in motions)
        duration = max(float(np.ptp(time)) for time, _ in motions) or 1.0
        title = {"torque": "joint torque" if not sliding.all() else "joint force"}.get(kind, f"joint {kind}")
        charts[kind] = Chart(
            entity=f"{root}/{kind}",
            title=title,
            labels=("time [s]", f"{title} [{joint_units(cell.arm, units)}]"),
            shown=np.concatenate([_points(time, curves[kind]) for time, curves in motions]),
            names=cell.arm.joint_names,
            colours=[SCREEN.joint(number) for number in range(cell.arm.dof)],
            limits=limit_lines(cell, kind, end),
            usual=float(usual_ranges(kind, cell.arm, duration).max()),
        )
    return dict(zip(charts, fit_below_tabs(list(charts.values())), strict=True))


def posture_chart(
    cell: Workcell, values: Values, postures: Float[np.ndarray, "points dof"], label: str
) -> tuple[Chart, np.ndarray, np.ndarray]:
    """Return the joint positions of postures (points, dof) over values of an objective, as a chart and its curves."""
    chart = Chart(
        entity="postures",
        dots=True,
        title="joint position over the front",
        labels=(label, f"joint position [{joint_units(cell.arm, JOINT_UNITS['position'])}]"),
        shown=np.stack([np.repeat(values, postures.shape[1]), postures.ravel()], axis=1),
        names=cell.arm.joint_names,
        colours=[SCREEN.joint(number) for number in range(cell.arm.dof)],
        limits=[
            replace(limit, instants=np.array([values.min(), values.max()]))
            for limit in limit_lines(cell, "position", 1.0)
        ],
        usual=float(joint_scales(cell.arm).max()),
    )
    return chart, values, postures.T


def limit_lines(cell: Workcell, kind: str, end: float) -> list[LimitLine]:
    """Return the limits of a kind up to the time ``end`` [s], each once: one that joints share has all their colours.

    What every joint has is drawn in one colour.
    """
    if kind not in cell.bounds:
        return []
    bounds = cell.bounds[kind]
    instants = np.array([0.0, end]) if len(bounds) == 1 else cell.times
    bounds = np.broadcast_to(bounds, (max(len(bounds), 2), *bounds.shape[1:])) if len(bounds) == 1 else bounds
    return [
        LimitLine(
            instants=instants,
            values=values,
            name="" if len(joints) == cell.arm.dof else ", ".join(cell.arm.joint_names[number] for number in joints),
            colours=[SCREEN.limit] if len(joints) == cell.arm.dof else [SCREEN.joint(number) for number in joints],
        )
        for side in (0, 1)
        for values, joints in _shared(bounds[:, :, side])
    ]


def _shared(limits: Float[np.ndarray, "time dof"]) -> list[tuple[Times, list[int]]]:
    """Return the different finite limits among those of joints, each with the numbers of its joints."""
    joints: dict[bytes, list[int]] = {}
    for number, values in enumerate(limits.T):
        if np.isfinite(values).any():
            joints.setdefault((values + 0.0).tobytes(), []).append(number)
    return [(limits[:, numbers[0]].copy(), numbers) for numbers in joints.values()]


def _points(time: Times, values: Float[np.ndarray, "time dof"]) -> np.ndarray:
    return np.stack([np.repeat(time, values.shape[1]), values.ravel()], axis=1)
