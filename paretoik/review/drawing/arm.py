"""Views of arms in a recording: flat axes for a planar arm, otherwise the workcell in space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from paretoik.arrays import Vector3
from paretoik.collision.obstacles import Capsule, Circle, HalfSpace, Obstacle, Sphere
from paretoik.review.drawing.axes import flat_lines, labels
from paretoik.review.drawing.label_places import label_area, label_place
from paretoik.review.drawing.space import ArmMeshes, Stage, find_meshes
from paretoik.review.outlines import SLAB, Polyline, feet, hatch, outline, plane_frame, plane_of, plane_polygon
from paretoik.review.palette import MARKS, SCENES, SCREEN, VIEWS
from paretoik.review.recording.messages import Workcell, in_space
from paretoik.robot.pose import matrix_to_quaternion

# Obstacles: hatched outlines in the plane, bodies in space.


def bodies(obstacles: Sequence[Obstacle], low: Vector3, high: Vector3) -> list[Any]:
    """Return obstacles in space as Rerun archetypes.

    Endless cylinders and beams reach beyond ``low`` and ``high``; half-spaces are slabs between these.
    """
    style: dict[str, Any] = {"colors": SCREEN.obstacle_body, "fill_mode": rr.components.FillMode.Solid}
    length, drawn = 1.2 * float(np.linalg.norm(high - low)), list[Any]()
    for each in obstacles:
        if isinstance(each, Sphere):
            drawn.append(rr.Ellipsoids3D(centers=[each.center], half_sizes=[[each.radius] * 3], **style))
        elif isinstance(each, Circle):
            middle, height = [*each.center, (low + high)[2] / 2], float((high - low)[2])
            drawn.append(rr.Cylinders3D(centers=[middle], lengths=[height], radii=[each.radius], **style))
        elif isinstance(each, Capsule):
            axis, radii = each.end - each.start, [each.radius]
            place: dict[str, Any] = {"translations": [each.start], "quaternions": [rr.Quaternion(xyzw=turn_of_z(axis))]}
            drawn.append(rr.Capsules3D(lengths=[float(np.linalg.norm(axis))], radii=radii, **place, **style))
        elif isinstance(each, HalfSpace):
            polygon = plane_polygon(each, (low, high))
            if not len(polygon):
                continue
            _, normal = plane_of(each)
            frame = np.array([*plane_frame(normal), normal])  # axes of the slab by rows
            flat, depth = polygon @ frame.T, 0.5 * SLAB.depth * float(np.linalg.norm(high - low))
            least, most = flat.min(axis=0), flat.max(axis=0)
            half = np.append((most - least)[:2] / 2, depth / 2)
            center = ((least + most) / 2 - [0.0, 0.0, depth / 2]) @ frame
            turns = [rr.Quaternion(xyzw=np.roll(matrix_to_quaternion(frame.T), -1))]
            drawn.append(rr.Boxes3D(centers=[center], half_sizes=[half], quaternions=turns, **style))
        else:
            sizes = each.half_sizes if len(each.half_sizes) == 3 else [*each.half_sizes, length / 2]
            turn = rr.Quaternion(xyzw=np.roll(each.pose.quaternion, -1))
            drawn.append(rr.Boxes3D(centers=[each.pose.position], half_sizes=[sizes], quaternions=[turn], **style))
    return drawn


def extent(obstacle: Obstacle, nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "corners 3"]:
    """Return points [m] that enclose the bounded part of an obstacle, or the part of a plane near ``nodes``."""
    if isinstance(obstacle, HalfSpace):
        return feet(obstacle, nodes)
    if isinstance(obstacle, Circle):
        return np.array([[*(obstacle.center + sign * obstacle.radius), 0.0] for sign in (-1, 1)])
    if isinstance(obstacle, Sphere):
        return np.array([obstacle.center + sign * obstacle.radius for sign in (-1, 1)])
    if isinstance(obstacle, Capsule):
        ends = np.array([obstacle.start, obstacle.end])
        return np.concatenate([ends - obstacle.radius, ends + obstacle.radius])
    sizes = np.pad(obstacle.half_sizes, (0, 3 - len(obstacle.half_sizes)))
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    return np.asarray(obstacle.pose.apply(signs * sizes))


def turn_of_z(axis: Vector3) -> np.ndarray:
    """Return the quaternion (x, y, z, w) of a rotation that takes z to the direction of ``axis``."""
    length = np.linalg.norm(axis)
    if length == 0:
        return np.array([0.0, 0.0, 0.0, 1.0])
    x, y, z = axis / length
    if z < -1 + 1e-12:
        return np.array([1.0, 0.0, 0.0, 0.0])
    quaternion = np.array([-y, x, 0.0, 1.0 + z])
    return quaternion / np.linalg.norm(quaternion)


Links = Float[np.ndarray, "rows nodes 3"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmDrawing:
    """The view of a workcell at ``entity``; its axes contain all ``nodes`` (nodes, 3) [m] of arms."""

    entity: str
    workcell: Workcell
    nodes: Float[np.ndarray, "nodes 3"]

    def view(self, name: str) -> rrb.View:
        """Return the view."""
        return self.stage.view(name, [] if self.meshes is None else [f"+ {self.meshes.root}/**"])

    def log_workcell(self, recording: rr.RecordingStream) -> None:
        """Draw axes, base, obstacles, paths and places, for all times."""
        stage, cell, entity = self.stage, self.workcell, self.entity
        stage.log_axes(recording)
        borders = list[Polyline]()
        if self.planar:
            low, high = (np.append(corner, 0.0) for corner in (stage.canvas.low, stage.canvas.high))
            borders = [line for each in cell.obstacles if (line := outline(each, (low, high))) is not None]
        if borders:
            gap = 9.0 * float(stage.canvas.high[0] - stage.canvas.low[0]) / stage.canvas.width
            lines = [in_space(line) for each in borders for line in hatch(each, gap=gap)]
            hatches = stage.strips(lines, SCREEN.obstacle_body, 0.7, -2.0)
            recording.log(f"{entity}/obstacles/hatch", hatches, static=True)
            outlines = stage.strips([in_space(each) for each in borders], SCREEN.obstacle, 1.3, -2.0)
            recording.log(f"{entity}/obstacles/outlines", outlines, static=True)
        elif not self.planar:
            for number, body in enumerate(bodies(cell.obstacles, stage.ground.low, stage.ground.high), start=1):
                recording.log(f"{entity}/obstacles/{number}", body, static=True)
        recording.log(f"{entity}/base", self.base_mark(), static=True)
        if cell.paths and self.planar:  # wide, below other lines
            recording.log(f"{entity}/target", stage.strips(cell.paths, SCREEN.target, 4.0, 0.0), static=True)
        elif cell.paths:  # beads: in space, coinciding lines would flicker
            gap = SCENES.bead_gap * float(np.ptp(self._extent, axis=0).max())
            places = np.concatenate([beads(path, gap=gap) for path in cell.paths])
            recording.log(f"{entity}/target", stage.points(places, SCREEN.target, 2.6, 0.0), static=True)
        if cell.places:
            places = np.array(list(cell.places.values()))
            recording.log(f"{entity}/places", stage.points(places, SCREEN.target, 4.0, 1.0), static=True)
            recording.log(f"{entity}/places/names", self._names(list(cell.places), places), static=True)
        if len(cell.directions):
            start, ends = next(iter(cell.places.values())), self._arrow_ends
            arrows = stage.strips([np.array([start, end]) for end in ends], SCREEN.target, 1.6, 1.0)
            recording.log(f"{entity}/directions/lines", arrows, static=True)
            recording.log(f"{entity}/directions/heads", stage.points(ends, SCREEN.target, 3.0, 1.0), static=True)
            recording.log(f"{entity}/directions/heads/names", self._names(self._arrow_names, ends), static=True)
        if self.meshes is not None:
            self.meshes.log(recording, entity)

    def log_arm(
        self, recording: rr.RecordingStream, layer: str, links: Float[np.ndarray, "nodes 3"], axis: int | None
    ) -> None:
        """Draw an arm in one posture at the current time, as ``send_arms`` does."""
        for part, kind, fields, _ in self._parts(recording, layer, links[None], axis):
            recording.log(f"{self.entity}/{layer}/{part}", kind.from_fields(**fields))

    def send_arms(
        self,
        recording: rr.RecordingStream,
        layer: str,
        columns: Sequence[rr.TimeColumn],
        links: Links,
        axis: int | None,
    ) -> None:
        """Draw an arm in each posture of ``links``; one row of ``columns`` per posture.

        axis: objective whose best arm it is; None for the chosen arm, which also shows the width of its links

        The chosen arm is drawn above all others, the arm of a later objective above that of an earlier one.
        """
        for part, kind, fields, count in self._parts(recording, layer, links, axis):
            values = kind.columns(**fields).partition([count] * len(links))
            recording.send_columns(f"{self.entity}/{layer}/{part}", columns, values)

    def _parts(
        self, recording: rr.RecordingStream, layer: str, links: Links, axis: int | None
    ) -> list[tuple[str, Any, dict[str, Any], int]]:
        """Log the colours and widths of an arm, for all times.

        Return its parts: entity, archetype, fields (posture after posture), and number per posture.
        """
        entity, stage, cell = f"{self.entity}/{layer}", self.stage, self.workcell
        placed, (rows, nodes, _) = stage.place(links), links.shape
        solid, place = axis is None, 0 if axis is None else axis % len(MARKS.arms)
        widths = (MARKS.solid_arm, MARKS.arms[place]) if self.planar else MARKS.spatial_arms
        colour, width = (SCREEN.arm if axis is None else SCREEN.end(axis)), widths[0 if solid else 1]
        order = 7.0 if solid else 5.0 + 0.1 * place
        strips: dict[str, Any] = {"strips": list(placed)}
        joints: dict[str, Any] = {"positions": placed.reshape(rows * nodes, -1)}
        parts = [("links", stage.line_kind, strips, 1), ("joints", stage.point_kind, joints, nodes)]
        style: dict[str, Any] = {"colors": colour, "radii": rr.Radius.ui_points(width)}
        recording.log(f"{entity}/links", stage.line_kind.from_fields(**style, **stage.order(order)), static=True)
        sizes = rr.Radius.ui_points([1.5 * width] * (nodes - 1) + [1.875 * width])
        style = {"colors": [colour] * (nodes - 1) + [SCREEN.tool if solid else colour], "radii": sizes}
        points = stage.point_kind.from_fields(**style, **stage.order(order + 0.05))
        recording.log(f"{entity}/joints", points, static=True)
        if solid and np.any(cell.link_radius) and self.planar:
            # one line for links of one radius, otherwise a line per link
            scale = stage.canvas.width / float(stage.canvas.high[0] - stage.canvas.low[0])
            style = {"colors": SCREEN.body, "radii": scale * np.asarray(cell.link_radius)}
            recording.log(f"{entity}/body", stage.line_kind.from_fields(**style, **stage.order(2.0)), static=True)
            if isinstance(cell.link_radius, Sequence):
                strips = {"strips": [row[link : link + 2] for row in placed for link in range(nodes - 1)]}
            parts.append(("body", stage.line_kind, strips, nodes - 1 if isinstance(cell.link_radius, Sequence) else 1))
        elif solid and np.any(cell.link_radius):  # translucent capsules, so that lines inside a link stay visible
            axes = np.diff(links, axis=1)
            lengths = np.linalg.norm(axes, axis=2)
            is_link = (lengths > SCENES.shortest * lengths.max()).any(axis=0)
            sizes = np.broadcast_to(cell.link_radius, nodes - 1)[is_link]
            sizes = sizes if isinstance(cell.link_radius, Sequence) else sizes[:1]
            style = {"colors": [SCREEN.hull], "radii": sizes, "fill_mode": rr.components.FillMode.Solid}
            recording.log(f"{entity}/body", rr.Capsules3D.from_fields(**style), static=True)
            capsules = {
                "lengths": lengths[:, is_link].ravel(),
                "translations": links[:, :-1][:, is_link].reshape(-1, 3),
                "quaternions": np.array([turn_of_z(each) for each in axes[:, is_link].reshape(-1, 3)]),
            }
            parts.append(("body", rr.Capsules3D, capsules, int(is_link.sum())))
        return parts

    @property
    def planar(self) -> bool:
        """Whether the arm moves in a plane."""
        return self.workcell.arm.is_planar

    @cached_property
    def meshes(self) -> ArmMeshes | None:
        """The arm's meshes; None if it has none."""
        root = self.entity.replace("/", "_") + "_meshes"
        return None if self.planar else find_meshes(self.workcell.arm, root)

    def base_mark(self) -> Any:
        """Return the mark of the arm's base: the ground sign of mechanics in the plane, a foot in space."""
        base = self.workcell.arm.base
        if not self.planar:
            size = 0.05 * float(np.linalg.norm(self.stage.ground.high - self.stage.ground.low))
            return rr.Cylinders3D(
                centers=[base.position - base.rotation[:, 2] * 0.1 * size],
                lengths=[0.2 * size],
                radii=[size],
                colors=SCREEN.base,
                quaternions=[rr.Quaternion(xyzw=np.roll(base.quaternion, -1))],
                fill_mode="solid",
            )
        # the sign points down, unless first links would cover it: then the quarter turn that is covered least
        first = self.nodes[1:][np.linalg.norm(self.nodes[:-1] - base.position, axis=1) < 1e-9] - base.position
        links = (first[:, :2] / np.maximum(np.linalg.norm(first[:, :2], axis=1), 1e-12)[:, None]) * (1.0, -1.0)
        turns = [np.linalg.matrix_power(np.array([[0.0, 1.0], [-1.0, 0.0]]), number) for number in (0, 1, 3, 2)]
        nearest = [float((links @ turn[1]).max(initial=-1.0)) for turn in turns]  # cosine between sign and nearest link
        turn = turns[0] if nearest[0] < SCENES.covered else turns[int(np.argmin(nearest))]
        foot = [[(0, 0), (-9, 14), (9, 14), (0, 0)], [(-15, 14), (15, 14)]]
        ground = [[(d, 14), (d - 5, 20)] for d in (-8, 0, 8, 15)]
        strips = [self.stage.place(base.position) + np.array(strip) @ turn for strip in [*foot, *ground]]
        return flat_lines(strips, SCREEN.base, 1.1, 0.5)

    def _names(self, names: Sequence[str], places: Float[np.ndarray, "names 3"]) -> Any:
        """Return the names of places [m]; in the plane they avoid arms, arrows and all earlier names."""
        if not self.planar:
            return self.stage.points(places, SCREEN.target, 0.0, 1.0, labels=names, show_labels=True)
        start, *_ = named = list(self.workcell.places.values())
        shares = np.linspace(0.0, 1.0, 12)[:, None, None]
        arrows = (start + shares * (self._arrow_ends - start)).reshape(-1, 3)
        links = self.nodes[:-1] + shares * np.diff(self.nodes, axis=0)  # posture after posture
        others = self.stage.place(np.concatenate([links.reshape(-1, 3), arrows]))
        marks, middles = self.stage.place(np.array([*named, *self._arrow_ends])), dict[str, np.ndarray]()
        for words, mark in zip([*self.workcell.places, *self._arrow_names], marks, strict=True):
            middles[words] = label_place(self.stage.canvas, mark, words, others, is_joined=False)
            others = np.concatenate([others, label_area(middles[words], words)])
        return labels(names, np.array([middles[name] for name in names]), SCREEN.target)

    @property
    def _arrow_ends(self) -> np.ndarray:
        """End points of the arrows along the directions."""
        cell = self.workcell
        start = next(iter(cell.places.values()), np.zeros(3))
        return np.asarray(start + 0.3 * float(np.ptp(self.nodes, axis=0).max()) * cell.directions)

    @property
    def _arrow_names(self) -> list[str]:
        return [f"direction {number + 1}" for number in range(len(self.workcell.directions))]

    @cached_property
    def _extent(self) -> np.ndarray:
        """Points (points, 3) [m] that must be visible."""
        cell = self.workcell
        around = list[np.ndarray]()
        for each in cell.obstacles:
            corners = extent(each, self.nodes)
            if isinstance(each, HalfSpace) or self.planar or np.ptp(corners, axis=0).all():
                around.append(corners)
        seen = [self.nodes, cell.arm.base.position[None], *cell.paths, *(place[None] for place in cell.places.values())]
        return np.concatenate([*seen, *around, self._arrow_ends])

    @cached_property
    def stage(self) -> Stage:
        """The plane or space of the arms."""
        return Stage(entity=self.entity, planar=self.planar, seen=self._extent)


def beads(path: Float[np.ndarray, "samples 3"], *, gap: float) -> Float[np.ndarray, "beads 3"]:
    """Return points evenly along a path, about a ``gap`` apart, including its two ends.

    >>> beads(np.array([[0.0, 0, 0], [1, 0, 0]]), gap=0.5)[:, 0].tolist()
    [0.0, 0.5, 1.0]
    """
    lengths = np.append(0.0, np.linalg.norm(np.diff(path, axis=0), axis=1).cumsum())
    places = np.linspace(0.0, lengths[-1], 1 + max(1, round(float(lengths[-1]) / gap)))
    return np.stack([np.interp(places, lengths, path[:, axis]) for axis in range(3)], axis=1)


def target_mark(drawing: ArmDrawing, place: Float[np.ndarray, " 3"]) -> Any:
    """Return the mark of a target [m] that the tool does not cover: a ring in the plane, a cross in space."""
    if drawing.planar:
        turn = np.linspace(0.0, 2 * np.pi, 49)
        ring = drawing.stage.place(place) + MARKS.target_ring * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        return flat_lines([ring], SCREEN.path, 1.2, 9.0)
    reach = SCENES.cross * np.ptp(drawing.nodes, axis=0).max() * np.eye(3)
    return drawing.stage.strips([np.stack([place - each, place + each]) for each in reach], SCREEN.path, 1.2, 9.0)


def is_seen_beside(drawing: ArmDrawing, distance: float) -> bool:
    """Return whether a thin arm at a ``distance`` [m] from a solid one is visible."""
    if drawing.planar:
        origin, unit = drawing.stage.place(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
        return bool(distance * np.linalg.norm(unit - origin) > MARKS.solid_arm)
    scale = VIEWS.panels[0] / np.ptp(drawing.nodes, axis=0).max()
    return bool(distance * scale > MARKS.spatial_arms[0])
