"""Where arms are drawn in a recording: on axes of their own where they are planar, else in space, in their workcell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.review.drawing.arm_meshes import ArmMeshes, find_meshes
from paretoik.review.drawing.drawn_axes import Canvas, equal_window, labels
from paretoik.review.drawing.ground import Ground
from paretoik.review.drawing.label_places import separate_label_places
from paretoik.review.drawing.link_hulls import LinkHulls
from paretoik.review.drawing.obstacle_drawing import bodies, extent, hatch
from paretoik.review.drawing.screen_text import screen_text
from paretoik.review.drawing_options import MARKS, SCENES
from paretoik.review.obstacle_outlines import outline
from paretoik.review.palette import SCREEN, Colour
from paretoik.review.recording.workcell import Workcell

Links = Float[np.ndarray, "rows nodes 3"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmDrawing:
    """The view at ``entity`` of a workcell; it holds all ``nodes`` (nodes, 3) [m] of arms."""

    entity: str
    workcell: Workcell
    nodes: Float[np.ndarray, "nodes 3"]

    def view(self, name: str) -> rrb.View:
        """Return the view."""
        name = screen_text(name)
        if self.planar:
            bounds = self._canvas.bounds()
            return rrb.Spatial2DView(origin=self.entity, name=name, visual_bounds=bounds, background=SCREEN.background)
        meshes = [f"+ {self._mesh_root}/**"] if self.meshes is not None else []
        return rrb.Spatial3DView(
            origin=self.entity,
            contents=["+ $origin/**", *meshes],
            name=name,
            background=SCREEN.background,
            line_grid=False,
            eye_controls=self._ground.eye(),
        )

    def log_workcell(self, recording: rr.RecordingStream) -> None:
        """Draw axes, base, obstacles, paths and places, for all times."""
        if self.planar:
            self._canvas.log(recording, f"{self.entity}/axes", static=True)
        else:
            recording.log(self.entity, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            self._ground.log(recording, f"{self.entity}/axes")
        self._log_obstacles(recording)
        self._log_base(recording)
        self._log_places(recording)
        if self.meshes is not None:
            self.meshes.log(recording, self.entity)

    def strips(self, lines: Sequence[np.ndarray], colour: Any, radius: float, order: float, **more: Any) -> Any:
        """Return lines (points, 3) [m] as they are drawn, ``radius`` in pixels, above what has a lower ``order``."""
        placed = [self.place(line) for line in lines]
        return self._kinds[0](placed, colors=colour, radii=rr.Radius.ui_points(radius), **self._order(order), **more)

    def points(self, places: np.ndarray, colour: Any, radius: float, order: float, **more: Any) -> Any:
        """Return points (points, 3) [m] as they are drawn, ``radius`` in pixels."""
        radii = rr.Radius.ui_points(radius)
        return self._kinds[1](self.place(places), colors=colour, radii=radii, **self._order(order), **more)

    def send_arms(
        self,
        recording: rr.RecordingStream,
        layer: str,
        columns: Sequence[rr.TimeColumn],
        links: Links,
        axis: int | None,
    ) -> None:
        """Draw an arm in each posture of ``links``, a row of ``columns`` each.

        The chosen one, without an ``axis``, has its links' width too and is drawn on those of axes, each of which is
        drawn on those before.
        """
        placed, (rows, nodes, _) = self.place(links), links.shape
        kind, dots = self._kinds
        for part in self._log_style(recording, layer, nodes, axis):
            recording.send_columns(f"{self.entity}/{layer}/{part}", columns, kind.columns(strips=list(placed)))
        if axis is None and self._hulls is not None:
            self._hulls.send(recording, f"{self.entity}/{layer}/body", columns, links)
        positions = dots.columns(positions=placed.reshape(rows * nodes, -1)).partition([nodes] * rows)
        recording.send_columns(f"{self.entity}/{layer}/joints", columns, positions)

    def log_arm(
        self,
        recording: rr.RecordingStream,
        layer: str,
        links: Float[np.ndarray, "nodes 3"],
        axis: int | None,
    ) -> None:
        """Draw an arm in a posture at the current time, as ``send_arms`` does."""
        placed = self.place(links)
        kind, dots = self._kinds
        for part in self._log_style(recording, layer, len(links), axis):
            recording.log(f"{self.entity}/{layer}/{part}", kind.from_fields(strips=[placed]))
        if axis is None and self._hulls is not None:
            self._hulls.log_posture(recording, f"{self.entity}/{layer}/body", links)
        recording.log(f"{self.entity}/{layer}/joints", dots.from_fields(positions=placed))

    def _log_style(self, recording: rr.RecordingStream, layer: str, nodes: int, axis: int | None) -> list[str]:
        """Log the colours and widths of an arm, for all times; return the entities of its lines."""
        entity, (kind, dots) = f"{self.entity}/{layer}", self._kinds
        solid, place = axis is None, 0 if axis is None else axis % len(MARKS.arms)
        widths = (MARKS.solid_arm, MARKS.arms[place]) if self.planar else MARKS.spatial_arms
        colour, width = (SCREEN.arm if axis is None else SCREEN.end(axis)), widths[0 if solid else 1]
        order = 7.0 if solid else 5.0 + 0.1 * place
        parts: dict[str, tuple[Any, Colour, float]] = {"links": (rr.Radius.ui_points(width), colour, order)}
        if solid and self._width and self.planar:
            parts["body"] = (self._width, SCREEN.body, 2.0)
        for part, (radius, tint, above) in parts.items():
            style = kind.from_fields(colors=tint, radii=radius, **self._order(above))
            recording.log(f"{entity}/{part}", style, static=True)
        sizes = rr.Radius.ui_points([1.5 * width] * (nodes - 1) + [1.875 * width])
        tints = [colour] * (nodes - 1) + [SCREEN.tool if solid else colour]
        style = dots.from_fields(colors=tints, radii=sizes, **self._order(order + 0.05))
        recording.log(f"{entity}/joints", style, static=True)
        return list(parts)

    @property
    def _kinds(self) -> tuple[Any, Any]:
        """The kinds of strips and points, in the plane or in space."""
        return (rr.LineStrips2D, rr.Points2D) if self.planar else (rr.LineStrips3D, rr.Points3D)

    def place(self, points: np.ndarray) -> np.ndarray:
        """Return where points (..., 3) [m] lie on the view."""
        return self._canvas.place(points[..., :2]) if self.planar else points

    @property
    def planar(self) -> bool:
        """Whether the arm moves in a plane."""
        return self.workcell.arm.is_planar

    @cached_property
    def meshes(self) -> ArmMeshes | None:
        """The arm's meshes, where it has any."""
        return None if self.planar else find_meshes(self.workcell.arm, self._mesh_root)

    @property
    def _mesh_root(self) -> str:
        return self.entity.replace("/", "_") + "_meshes"

    @property
    def _hulls(self) -> LinkHulls | None:
        """The surfaces of links in space, where they have any width; in the plane a wide line is enough."""
        return LinkHulls(radius=self.workcell.link_radius) if self._width and not self.planar else None

    @property
    def _width(self) -> float:
        """Half the width of links as drawn; 0 where they have none."""
        scale = self._canvas.width / float(self._canvas.high[0] - self._canvas.low[0]) if self.planar else 1.0
        return scale * self.workcell.link_radius

    def _order(self, order: float) -> dict[str, float]:
        """Return what is drawn above what, which only the plane knows."""
        return {"draw_order": order} if self.planar else {}

    def _log_obstacles(self, recording: rr.RecordingStream) -> None:
        obstacles, entity = self.workcell.obstacles, f"{self.entity}/obstacles"
        if not self.planar:
            for name, body in bodies(obstacles, self._ground.low, self._ground.high):
                recording.log(f"{entity}/{name}", body, static=True)
            return
        borders = [each for each in map(outline, obstacles) if each is not None]
        if borders:
            gap = 9.0 * float(self._canvas.high[0] - self._canvas.low[0]) / self._canvas.width
            lines = [line for each in borders for line in hatch(each, gap=gap)]
            for part, strips, colour, radius in (
                ("hatch", lines, SCREEN.obstacle_body, 0.7),
                ("outlines", borders, SCREEN.obstacle, 1.3),
            ):
                in_space = [np.pad(strip, ((0, 0), (0, 1))) for strip in strips]
                recording.log(f"{entity}/{part}", self.strips(in_space, colour, radius, -2.0), static=True)

    def _log_base(self, recording: rr.RecordingStream) -> None:
        """Mark where the arm is mounted: the ground sign of mechanics, or in space a foot."""
        base = self.workcell.arm.base
        if self.planar:
            foot = [[(0, 0), (-9, 14), (9, 14), (0, 0)], [(-15, 14), (15, 14)]]
            ground = [[(d, 14), (d - 5, 20)] for d in (-8, 0, 8, 15)]
            strips = [
                self._canvas.place(base.position[:2]) + np.array(strip) @ self._foot_turn for strip in [*foot, *ground]
            ]
            sign = rr.LineStrips2D(strips, colors=SCREEN.base, radii=rr.Radius.ui_points(1.1), draw_order=0.5)
            recording.log(f"{self.entity}/base", sign, static=True)
            return
        size = 0.05 * float(np.linalg.norm(self._ground.high - self._ground.low))
        pedestal = rr.Cylinders3D(
            centers=[base.position - base.rotation[:, 2] * 0.1 * size],
            lengths=[0.2 * size],
            radii=[size],
            colors=SCREEN.base,
            quaternions=[rr.Quaternion(xyzw=np.roll(base.quaternion, -1))],
            fill_mode="solid",
        )
        recording.log(f"{self.entity}/base", pedestal, static=True)

    @property
    def _foot_turn(self) -> Float[np.ndarray, "2 2"]:
        """Return the quarter turns of the ground sign: it stands downwards, unless first links would cover it."""
        base = self.workcell.arm.base.position
        first = self.nodes[1:][np.linalg.norm(self.nodes[:-1] - base, axis=1) < 1e-9] - base
        links = (first[:, :2] / np.maximum(np.linalg.norm(first[:, :2], axis=1), 1e-12)[:, None]) * (1.0, -1.0)
        turns = [np.linalg.matrix_power(np.array([[0.0, 1.0], [-1.0, 0.0]]), number) for number in (0, 1, 3, 2)]
        nearest = [float((links @ turn[1]).max(initial=-1.0)) for turn in turns]  # the cosine to where it stands
        return turns[0] if nearest[0] < SCENES.covered else turns[int(np.argmin(nearest))]

    def _log_places(self, recording: rr.RecordingStream) -> None:
        cell = self.workcell
        if cell.paths:
            recording.log(f"{self.entity}/target", self._targets(), static=True)
        if cell.places:
            places = np.array(list(cell.places.values()))
            recording.log(f"{self.entity}/places", self.points(places, SCREEN.target, 4.0, 1.0), static=True)
            recording.log(f"{self.entity}/places/names", self._names(list(cell.places), places), static=True)
        if len(cell.directions):
            start, ends = next(iter(cell.places.values())), self._arrow_ends
            arrows = self.strips([np.array([start, end]) for end in ends], SCREEN.target, 1.6, 1.0)
            recording.log(f"{self.entity}/directions/lines", arrows, static=True)
            heads = self.points(ends, SCREEN.target, 3.0, 1.0)
            recording.log(f"{self.entity}/directions/heads", heads, static=True)
            recording.log(f"{self.entity}/directions/heads/names", self._names(self._arrow_names, ends), static=True)

    def _names(self, names: Sequence[str], places: Float[np.ndarray, "names 3"]) -> Any:
        """Return the names of places [m], in the plane off the arms, the arrows and all names before them."""
        if not self.planar:
            return self.points(places, SCREEN.target, 0.0, 1.0, labels=names, show_labels=True)
        start, *_ = named = list(self.workcell.places.values())
        shares = np.linspace(0.0, 1.0, 12)[:, None, None]
        arrows = (start + shares * (self._arrow_ends - start)).reshape(-1, 3)
        links = self.nodes[:-1] + shares * np.diff(self.nodes, axis=0)  # of one posture after the other
        others = self.place(np.concatenate([links.reshape(-1, 3), arrows]))
        words, marks = [*self.workcell.places, *self._arrow_names], self.place(np.array([*named, *self._arrow_ends]))
        middles = separate_label_places(self._canvas, marks, words, others)
        return labels(names, middles[[words.index(name) for name in names]], SCREEN.target)

    def _targets(self) -> Any:
        """Return the paths to follow: below what the tool does a wide line, in space beads on its string.

        There two lines in one place would flicker through each other, whatever their widths.
        """
        paths = self.workcell.paths
        if self.planar:
            return self.strips(paths, SCREEN.target, 4.0, 0.0)
        gap = SCENES.bead_gap * float(np.ptp(self._extent, axis=0).max())
        return self.points(np.concatenate([beads(path, gap=gap) for path in paths]), SCREEN.target, 2.6, 0.0)

    @property
    def _arrow_ends(self) -> np.ndarray:
        """Where arrows along the directions end."""
        cell = self.workcell
        start = next(iter(cell.places.values()), np.zeros(3))
        return np.asarray(start + 0.3 * float(np.ptp(self.nodes, axis=0).max()) * cell.directions)

    @property
    def _arrow_names(self) -> list[str]:
        return [f"direction {number + 1}" for number in range(len(self.workcell.directions))]

    @cached_property
    def _extent(self) -> np.ndarray:
        """Points (points, 3) [m] that are to be seen."""
        cell = self.workcell
        around = [each for each in map(extent, cell.obstacles) if self.planar or np.ptp(each, axis=0).all()]
        seen = [self.nodes, cell.arm.base.position[None], *cell.paths, *(place[None] for place in cell.places.values())]
        return np.concatenate([*seen, *around, self._arrow_ends])

    @cached_property
    def _canvas(self) -> Canvas:
        flat = Canvas(low=np.zeros(2), high=np.ones(2), labels=("x [m]", "y [m]"))
        low, high = equal_window(self._extent[:, :2], width=flat.width, height=flat.height)
        return Canvas(low=low, high=high, labels=flat.labels)

    @cached_property
    def _ground(self) -> Ground:
        return Ground.around(self._extent)


def beads(path: Float[np.ndarray, "samples 3"], *, gap: float) -> Float[np.ndarray, "beads 3"]:
    """Return points along a path, its two ends among them, evenly and about a ``gap`` apart.

    >>> beads(np.array([[0.0, 0, 0], [1, 0, 0]]), gap=0.5)[:, 0].tolist()
    [0.0, 0.5, 1.0]
    """
    lengths = np.append(0.0, np.linalg.norm(np.diff(path, axis=0), axis=1).cumsum())
    places = np.linspace(0.0, lengths[-1], 1 + max(1, round(float(lengths[-1]) / gap)))
    return np.stack([np.interp(places, lengths, path[:, axis]) for axis in range(3)], axis=1)
