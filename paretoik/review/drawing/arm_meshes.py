"""Arms of URDF files as their meshes, where all of these are at hand."""

from __future__ import annotations

import os
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
from jaxtyping import Float
from rerun.urdf import UrdfTree

from paretoik.review.drawing_options import DRAWING
from paretoik.robot.arm import Arm
from paretoik.robot.pose import Pose

PACKAGE_PATHS = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")
PACKAGE = "package://"


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmMeshes:
    """The meshes of an arm, at the entities ``root`` and ``root``_joints; its frames' names begin with ``root`` too."""

    arm: Arm
    tree: UrdfTree
    root: str

    def log(self, recording: rr.RecordingStream, scene: str) -> None:
        """Log the meshes, and where they stand in the view at entity ``scene``."""
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
            parent, child = (frame.pose for frame in frames if frame is not None)  # of a joint that does not move
            transform = _transform(
                parent.inverse() @ child, self.root + joint.parent_link, self.root + joint.child_link
            )
            recording.log(f"{self.root}_joints/{joint.name}", transform, static=True)

    def log_posture(self, recording: rr.RecordingStream, q: Float[np.ndarray, " dof"]) -> None:
        """Log where links are at a posture, at the current time."""
        for joint in self.tree.joints():
            if joint.name in self.arm.joint_names:
                value = float(q[self.arm.joint_names.index(joint.name)])
                recording.log(f"{self.root}_joints/{joint.name}", joint.compute_transform(value, clamp=False))

    def send(
        self, recording: rr.RecordingStream, columns: Sequence[rr.TimeColumn], q: Float[np.ndarray, "rows dof"]
    ) -> None:
        """Log where links are at joint positions, a row of ``columns`` each."""
        for joint in self.tree.joints():
            if joint.name in self.arm.joint_names:
                values = q[:, self.arm.joint_names.index(joint.name)].tolist()
                transforms = joint.compute_transform_columns(values, clamp=False)
                recording.send_columns(f"{self.root}_joints/{joint.name}", columns, transforms)


def find_meshes(arm: Arm, root: str) -> ArmMeshes | None:
    """Return the meshes of an arm's URDF; None where it has none, one is missing, or they are too large together."""
    if arm.source is None or not arm.source.is_file() or not arm.frames:
        return None
    try:
        description = ElementTree.parse(arm.source)
    except (OSError, ElementTree.ParseError):
        return None
    for link in description.getroot().iter("link"):
        for collision in link.findall("collision"):  # what is for looking at is drawn
            link.remove(collision)
    size = 0
    meshes = list(description.getroot().iter("mesh"))
    for mesh in meshes:
        file = _find(mesh.get("filename", ""), arm.source)
        if file is None:
            return None
        size += file.stat().st_size
        mesh.set("filename", str(file))
    if not meshes or size > DRAWING.mesh_bytes:
        return None
    with tempfile.TemporaryDirectory() as folder:  # Rerun finds packages by the environment alone
        resolved = Path(folder) / arm.source.name
        description.write(resolved)
        try:
            tree = UrdfTree.from_file_path(
                resolved,
                entity_path_prefix=root,
                frame_prefix=root,
                static_transform_entity_path=f"{root}_joints/fixed",
            )
        except Exception:  # what Rerun's reader refuses is drawn as lines
            return None
    return ArmMeshes(arm=arm, tree=tree, root=root)


def _find(name: str, source: Path) -> Path | None:
    """Return the file of a mesh: beside the URDF, or in a package around it or on the search paths."""
    if not name.startswith(PACKAGE):
        candidates = [source.parent / name.removeprefix("file://")]
    else:
        package, _, inside = name.removeprefix(PACKAGE).partition("/")
        around = [parent for parent in source.resolve().parents if parent.name == package]
        folders = [Path(folder) for name in PACKAGE_PATHS for folder in os.environ.get(name, "").split(os.pathsep)]
        places = [*source.resolve().parents, *folders, *(folder / "share" for folder in folders)]
        candidates = [parent / inside for parent in around] + [place / package / inside for place in places]
    return next((file.resolve() for file in candidates if file.is_file()), None)


def _transform(pose: Pose, parent: str, child: str) -> rr.Transform3D:
    quaternion = rr.Quaternion(xyzw=np.roll(pose.quaternion, -1))
    return rr.Transform3D(translation=pose.position, quaternion=quaternion, parent_frame=parent, child_frame=child)
