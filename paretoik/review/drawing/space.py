"""Views of a plane or of space with their axes, and arms of URDF files as meshes."""

from __future__ import annotations

import os
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float
from rerun.urdf import UrdfTree

from paretoik.arrays import Vector3
from paretoik.review.drawing.axes import Canvas, equal_window, flat_view, nice_ticks, screen_text, tick_text
from paretoik.review.palette import DRAWING, SCENES, SCREEN, VIEWS
from paretoik.robot.arm import Arm
from paretoik.robot.pose import Pose


def fitting_eye(points: Float[np.ndarray, "points 3"]) -> rrb.EyeControls3D:
    """Return the nearest eye from which all points are visible.

    A point at p across and z deep is visible from the distance d if |p - c| <= h (d + z). Here h is half the view and c
    its middle. The points that attain this bound on each side determine the least d.
    """
    half, away = half_view(), -np.array(SCENES.eye) / np.linalg.norm(SCENES.eye)
    right = np.cross(away, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(right, away), away])  # to the right, upwards and away from the eye
    middle = points.mean(axis=0)
    places = (points - middle) @ axes.T
    across, deep = places[:, :2], half * places[:, 2:]
    most, least = (across - deep).max(axis=0), (across + deep).min(axis=0)
    distance = float(((most - least) / (2 * half)).max())
    target = middle + (most + least) / 2 @ axes[:2]
    return rrb.EyeControls3D(position=target - distance * axes[2], look_target=target)


def half_view() -> Float[np.ndarray, " 2"]:
    """Return half the width and height of the view at distance 1, minus margins for labels."""
    width, height = VIEWS.panels[0], VIEWS.panels[1] - VIEWS.title
    whole = np.tan(np.radians(SCENES.field_of_view) / 2) * np.array([width / height, 1.0])
    return np.asarray(whole * (1.0 - 2.0 * np.array(SCENES.label_margin) / (width, height)))


# The axes of a scene in space: a ground with a grid and ticks, and a vertical scale.


METRES = ("x [m]", "y [m]", "z [m]")


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """The box from ``low`` to ``high`` (3,) [m] around a scene, with a grid of ``step`` [m] below it.

    seen: points (points, 3) that its view must show
    labels: labels of its axes, also with other units than metres
    """

    low: Vector3
    high: Vector3
    step: float
    seen: Float[np.ndarray, "points 3"]
    labels: tuple[str, str, str] = METRES

    @staticmethod
    def around(points: np.ndarray, *, labels: tuple[str, str, str] = METRES) -> Ground:
        """Return the ground of points (points, 3), its corners at round lengths.

        The ground is at 0 if everything, or nearly everything, is above 0: parts less than half a step below the ground
        are visible through it.
        """
        low, high = points.min(axis=0), points.max(axis=0)
        width = max(float((high - low).max()), 1e-6)
        step = float(np.diff(nice_ticks(0.0, width, count=SCENES.grid))[0])
        middle, half = (low + high) / 2, np.maximum((high - low) / 2, 0.2 * width)
        low, high = np.minimum(low, middle - half), np.maximum(high, middle + half)
        lowest = float(points[:, 2].min())
        low[2] = min(lowest, 0.0) if lowest < width else low[2]
        low[2] = 0.0 if -0.5 * step < lowest < width else low[2]
        low, high = np.floor(low / step + 1e-6) * step, np.ceil(high / step - 1e-6) * step
        return Ground(low=low, high=high, step=step, seen=points, labels=labels)

    def log(self, recording: rr.RecordingStream, entity: str) -> None:
        """Draw grid, ticks and labels, for all times."""
        (x0, y0, z0), (x1, y1, z1) = self.low, self.high
        x, y, z = (self._ticks(axis) for axis in range(3))
        lines = [[(a, y0, z0), (a, y1, z0)] for a in x] + [[(x0, b, z0), (x1, b, z0)] for b in y]
        upright = [[(x0, y0, z0), (x0, y0, z1)]]
        marks = [[(x0, y0, c), (x0 + 0.15 * self.step, y0, c)] for c in z]
        colours = [SCREEN.grid] * len(lines) + [SCREEN.frame] * (1 + len(marks))
        strips = rr.LineStrips3D([*lines, *upright, *marks], colors=colours, radii=rr.Radius.ui_points(0.7))
        recording.log(f"{entity}/grid", strips, static=True)
        places, words = self._labels
        colours, none = [SCREEN.frame] * (len(words) - 3) + [SCREEN.text] * 3, rr.Radius.ui_points(0.0)
        text = rr.Points3D(places, labels=words, show_labels=True, colors=colours, radii=none)
        recording.log(f"{entity}/labels", text, static=True)

    def eye(self) -> rrb.EyeControls3D:
        """Return an eye in front, to the right and above, from which everything is visible."""
        (x0, y0, z0), (x1, y1, _) = self.low, self.high
        corners = np.array([(x0, y0, z0), (x0, y1, z0), (x1, y0, z0), (x1, y1, z0)])
        return fitting_eye(np.concatenate([self.seen, corners, self._labels[0]]))

    @cached_property
    def _labels(self) -> tuple[Float[np.ndarray, "labels 3"], list[str]]:
        """The places and words of ticks; the names of the three axes are last."""
        (x0, y0, z0), (x1, y1, z1) = self.low, self.high
        inner = (self._ticks(axis)[1:-1] for axis in range(2))
        x, y = (ticks[:: 2 if len(ticks) > SCENES.ground_ticks else 1] for ticks in inner)
        z = self._ticks(2)[1:]
        gap = 0.07 * float((self.high - self.low).max())
        places = [(a, y0 - gap, z0) for a in x] + [(x1 + gap, b, z0) for b in y]
        places += [(x0 - gap, y0 - 0.3 * gap, c) for c in z]
        places += [((x0 + x1) / 2, y0 - 2.6 * gap, z0), (x1 + 2.6 * gap, (y0 + y1) / 2, z0), (x0, y0, z1 + gap)]
        return np.array(places), [*map(tick_text, (*x, *y, *z)), *self.labels]

    def _ticks(self, axis: int) -> np.ndarray:
        count = round((self.high[axis] - self.low[axis]) / self.step)
        return np.round(self.low[axis] + self.step * np.arange(count + 1), 9) + 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Stage:
    """A view at ``entity`` that shows all of ``seen`` (points, 3): a plane with axes, or a space above a ground.

    labels: labels of its axes
    margin: margin of the plane, as a share of the range
    """

    entity: str
    planar: bool
    seen: Float[np.ndarray, "points 3"]
    labels: tuple[str, str, str] = METRES
    margin: float = 0.08

    def view(self, name: str, contents: Sequence[str] = ()) -> rrb.View:
        """Return the view, with further ``contents`` in space."""
        if self.planar:
            return flat_view(self.entity, screen_text(name), self.canvas.bounds())
        settings: Any = {"name": screen_text(name), "background": SCREEN.background, "line_grid": False}
        shown = ["+ $origin/**", *contents]
        return rrb.Spatial3DView(origin=self.entity, contents=shown, eye_controls=self.ground.eye(), **settings)

    def log_axes(self, recording: rr.RecordingStream) -> None:
        """Draw the axes, for all times."""
        if self.planar:
            self.canvas.log(recording, f"{self.entity}/axes")
        else:
            recording.log(self.entity, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            self.ground.log(recording, f"{self.entity}/axes")

    def strips(self, lines: Sequence[np.ndarray], colour: Any, radius: float, order: float, **more: Any) -> Any:
        """Return the drawing of lines (points, 3), above everything of a lower ``order``; ``radius`` [pixels]."""
        placed, radii = [self.place(line) for line in lines], rr.Radius.ui_points(radius)
        return self.line_kind(placed, colors=colour, radii=radii, **self.order(order), **more)

    def points(self, places: np.ndarray, colour: Any, radius: float, order: float, **more: Any) -> Any:
        """Return the drawing of points (points, 3); ``radius`` [pixels]."""
        radii = rr.Radius.ui_points(radius)
        return self.point_kind(self.place(places), colors=colour, radii=radii, **self.order(order), **more)

    def place(self, points: np.ndarray) -> np.ndarray:
        """Return the positions on the view of points (..., 3)."""
        return self.canvas.place(points[..., :2]) if self.planar else points

    def order(self, order: float) -> dict[str, float]:
        """Return the drawing order, which only exists in the plane."""
        return {"draw_order": order} if self.planar else {}

    @property
    def line_kind(self) -> Any:
        """The archetype of lines."""
        return rr.LineStrips2D if self.planar else rr.LineStrips3D

    @property
    def point_kind(self) -> Any:
        """The archetype of points."""
        return rr.Points2D if self.planar else rr.Points3D

    @cached_property
    def canvas(self) -> Canvas:
        """The axes of the plane, with equal scales."""
        flat = Canvas(low=np.zeros(2), high=np.ones(2), labels=self.labels[:2])
        low, high = equal_window(self.seen[:, :2], width=flat.width, height=flat.height, margin=self.margin)
        return replace(flat, low=low, high=high)

    @cached_property
    def ground(self) -> Ground:
        """The ground of the space."""
        return Ground.around(self.seen, labels=self.labels)


PACKAGE_PATHS = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
PACKAGE = "package://"


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmMeshes:
    """The meshes of an arm, at entities ``root`` and ``root``_joints; frame names also begin with ``root``."""

    arm: Arm
    tree: UrdfTree
    root: str

    def log(self, recording: rr.RecordingStream, scene: str) -> None:
        """Log the meshes, and their frame in the view at entity ``scene``."""
        self.tree.log_urdf_to_recording(recording=recording)
        joints = self.tree.joints()
        (root,) = {joint.parent_link for joint in joints} - {joint.child_link for joint in joints}
        mount = self.arm.base @ self.arm.frames[root].pose
        transform = _transform(mount, f"tf#/{scene}", self.root + root)
        recording.log(f"{self.root}_joints/mount", transform, static=True)
        for joint in self.tree.joints():
            frames = [self.arm.frames.get(link) for link in (joint.parent_link, joint.child_link)]
            if joint.name in self.arm.joint_names or joint.joint_type == "fixed" or None in frames:
                continue
            parent, child = (frame.pose for frame in frames if frame is not None)  # of a fixed joint
            transform = _transform(
                parent.inverse() @ child, self.root + joint.parent_link, self.root + joint.child_link
            )
            recording.log(f"{self.root}_joints/{joint.name}", transform, static=True)

    def log_posture(self, recording: rr.RecordingStream, q: Float[np.ndarray, " dof"]) -> None:
        """Log the poses of links at a posture, at the current time."""
        for entity, joint, values in self._moving(q[None]):
            recording.log(entity, joint.compute_transform(values[0], clamp=False))

    def send(
        self, recording: rr.RecordingStream, columns: Sequence[rr.TimeColumn], q: Float[np.ndarray, "rows dof"]
    ) -> None:
        """Log the poses of links at joint positions, one row of ``columns`` each."""
        for entity, joint, values in self._moving(q):
            recording.send_columns(entity, columns, joint.compute_transform_columns(values, clamp=False))

    def _moving(self, q: Float[np.ndarray, "rows dof"]) -> Iterator[tuple[str, Any, list[float]]]:
        """Yield entity and values of every joint that moves."""
        names = self.arm.joint_names
        for joint in self.tree.joints():
            if joint.name in names:
                yield f"{self.root}_joints/{joint.name}", joint, q[:, names.index(joint.name)].tolist()


def find_meshes(arm: Arm, root: str) -> ArmMeshes | None:
    """Return the meshes of an arm's URDF; None if it has none, one is missing, or they are too large together."""
    if arm.source is None or not arm.source.is_file() or not arm.frames:
        return None
    try:
        description = ElementTree.parse(arm.source)
    except (OSError, ElementTree.ParseError):
        return None
    for link in description.getroot().iter("link"):
        for collision in link.findall("collision"):  # only visual meshes are drawn
            link.remove(collision)
    meshes, size = list(description.getroot().iter("mesh")), 0
    around = arm.source.resolve().parents
    folders = [Path(folder) for name in PACKAGE_PATHS for folder in os.environ.get(name, "").split(os.pathsep)]
    for mesh in meshes:  # next to the URDF, in a package around it, or on the search paths
        name = mesh.get("filename", "")
        candidates = [arm.source.parent / name.removeprefix("file://")]
        if name.startswith(PACKAGE):
            package, _, inside = name.removeprefix(PACKAGE).partition("/")
            places = [*around, *folders, *(folder / "share" for folder in folders)]
            candidates = [parent / inside for parent in around if parent.name == package]
            candidates += [place / package / inside for place in places]
        file = next((file.resolve() for file in candidates if file.is_file()), None)
        if file is None:
            return None
        size += file.stat().st_size
        mesh.set("filename", str(file))
    if not meshes or size > DRAWING.mesh_bytes:
        return None
    with tempfile.TemporaryDirectory() as folder:  # Rerun only finds packages through the environment
        resolved = Path(folder) / arm.source.name
        description.write(resolved)
        entities = {"entity_path_prefix": root, "static_transform_entity_path": f"{root}_joints/fixed"}
        try:
            tree = UrdfTree.from_file_path(resolved, frame_prefix=root, **entities)
        except Exception:  # meshes that Rerun cannot read are drawn as lines
            return None
    return ArmMeshes(arm=arm, tree=tree, root=root)


def _transform(pose: Pose, parent: str, child: str) -> rr.Transform3D:
    quaternion = rr.Quaternion(xyzw=np.roll(pose.quaternion, -1))
    return rr.Transform3D(translation=pose.position, quaternion=quaternion, parent_frame=parent, child_frame=child)
