"""Motions as a report holds them: curves and arms in small blocks, one a point, as many as there is room for."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.formulations.protocol import task_of
from paretoik.front.front import Front
from paretoik.review.obstacle_outlines import outline, wires
from paretoik.task.limits import JOINT_UNITS, LIMITED
from paretoik.task.motion import Motion

STEPS = 65535  # of a channel's range: values are whole numbers of 16 bits


@dataclass(frozen=True, kw_only=True, eq=False)
class ReportMotions:
    """Motions of a front for a page: ``channels`` (points, channels, time), and what is drawn around them.

    A channel is the time [s], a joint's position, velocity, acceleration, torque or power, or a coordinate of a node of
    the arm. Motions whose arm is unknown have time and positions alone.
    """

    front: Front

    @cached_property
    def motions(self) -> Any:
        """The motions of the front."""
        return self.front.motions

    @property
    def has_arm(self) -> bool:
        """Whether the arm is known, so that there are more than positions."""
        return isinstance(self.motions, Motion)

    @cached_property
    def channels(self) -> Float[np.ndarray, "points channels time"]:
        """Everything that changes with time."""
        motions = self.motions
        parts = [np.asarray(motions.time)[..., None], motions.q]
        if self.has_arm:
            parts += [getattr(motions, LIMITED[kind]) for kind in self.kinds[1:]]
            parts.append(self._nodes.reshape(*self._nodes.shape[:2], -1))
        return np.moveaxis(np.concatenate(parts, axis=-1), -1, 1)

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """What is drawn of joints: torques and powers of an arm without masses are not, as they are 0."""
        massless = not np.any(self.motions.torque)
        return tuple(kind for kind in JOINT_UNITS if not (massless and kind in ("torque", "power")))

    @cached_property
    def _nodes(self) -> Float[np.ndarray, "points time nodes axes"]:
        return np.asarray(self.motions.links[..., : 2 if self.motions.arm.is_planar else 3], dtype=float)

    @cached_property
    def _ranges(self) -> tuple[Float[np.ndarray, " channels"], Float[np.ndarray, " channels"]]:
        low, high = self.channels.min(axis=(0, 2)), self.channels.max(axis=(0, 2))
        return low, np.where(high > low, high - low, 1.0) / STEPS

    def block(self, row: int) -> str:
        """Return the channels of a point: steps of 16 bits from sample to sample, low bytes first, gzip, base64."""
        low, step = self._ranges
        whole = np.round((self.channels[row] - low[:, None]) / step[:, None]).astype(np.uint16)
        changes = np.diff(whole, axis=1, prepend=np.uint16(0))  # modulo 2¹⁶, small where curves are smooth
        planes = np.concatenate([(changes & 255).ravel(), (changes >> 8).ravel()]).astype(np.uint8)
        return base64.b64encode(gzip.compress(planes.tobytes(), 9, mtime=0)).decode()

    def blocks(self, rows: Sequence[int], room: int) -> dict[int, str]:
        """Return the blocks of as many ``rows``, in turn, as fit in so many bytes, by the id of the point, in order."""
        blocks: dict[int, str] = {}
        for row in rows:
            number, block = int(self.front.ids[row]), self.block(row)
            room -= len(f'"{number}":"{block}",')
            if room < 0:
                break
            blocks[number] = block
        return {number: blocks[number] for number in self.front.ids.tolist() if number in blocks}

    def description(self) -> dict[str, Any]:
        """Return what the page must know to draw blocks: joints, quantities, limits, arm, path and obstacles."""
        low, step = self._ranges
        names = self.motions.arm.joint_names
        described: dict[str, Any] = {
            "joints": list(names),
            "samples": self.channels.shape[2],
            "low": _digits(low, 9),
            "step": _digits(step, 9),
            "standing": bool((np.ptp(self.motions.q, axis=1) == 0).all()),
            "quantities": [{"name": "position", "units": ["rad or m"] * len(names)}],
        }
        if self.has_arm:
            sliding = [kind == "prismatic" for kind in self.motions.arm.joint_types]
            described["quantities"] = [
                {"name": kind, "units": [JOINT_UNITS[kind][slides] for slides in sliding]} for kind in self.kinds
            ]
            described["limits"] = self._limits()
            described["arm"] = self._arm()
        return described

    def _limits(self) -> dict[str, Any]:
        """Return the limits of each kind: at what times, and of each joint the lower and the upper ones there."""
        task = task_of(self.front.problem)
        if task is None:
            return {}
        return {
            kind: {
                "times": _digits(task.times) if len(each) > 1 else None,
                "lower": [_digits(joint) for joint in each[..., 0].T],
                "upper": [_digits(joint) for joint in each[..., 1].T],
            }
            for kind, each in task.bounds.items()
        }

    def _arm(self) -> dict[str, Any]:
        """Return the window, the paths and the obstacles of the arm's picture."""
        motions, nodes = self.motions, self._nodes
        planar, flat = motions.arm.is_planar, nodes.reshape(-1, nodes.shape[-1])
        height = (float(flat[:, -1].min()), float(flat[:, -1].max()))
        lines = [
            line
            for obstacle in motions.obstacles
            for line in ([outline(obstacle)] if planar else wires(obstacle, height))
            if line is not None
        ]
        paths = [np.asarray(task.path.positions)[:, : nodes.shape[-1]] for task in motions.tasks]
        shown = np.concatenate([flat, *lines, *paths])
        return {
            "planar": planar,
            "nodes": nodes.shape[2],
            "radius": float(motions.link_radius),
            "low": _digits(shown.min(axis=0)),
            "high": _digits(shown.max(axis=0)),
            "paths": [_lines(path) for path in paths if np.ptp(path, axis=0).any()],
            "obstacles": [_lines(line) for line in lines],
            "arrows": self._arrows(),
        }

    def _arrows(self) -> list[dict[str, Any]]:
        """Return the directions along which objectives say how fast or strong a posture is."""
        directions = getattr(self.front.problem, "directions", None)
        if directions is None:
            return []
        return [{"axis": axis, "along": _digits(vector)} for axis, vector in enumerate(directions)]


def _lines(points: np.ndarray) -> list[Any]:
    return [_digits(point, 5) for point in points]


def _digits(values: np.ndarray, digits: int = 6) -> list[float | None]:
    """Return numbers to so many digits; None where they are not finite."""
    return [float(f"{value:.{digits}g}") if np.isfinite(value) else None for value in np.asarray(values, dtype=float)]
