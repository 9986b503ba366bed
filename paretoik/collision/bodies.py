"""Convex bodies of a robot's links: shapes of its URDF, placed on the joints that move them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from paretoik.collision.hulls import Cover, Hull, cover_file
from paretoik.collision.inflation import inflation
from paretoik.collision.meshes import read_mesh
from paretoik.errors import InvalidInput
from paretoik.file_paths import missing_file
from paretoik.inputs import check_mapping, file_path, likely_spelling, listed, shown
from paretoik.robot.pose import Frame, Pose
from paretoik.robot.urdf_description import Fault, Numbers, RobotDescription, ShapeDescription


@dataclass(frozen=True, kw_only=True)
class BodyOptions:
    """Largest number of shapes of a robot."""

    max_shapes: int = 5000


OPTIONS = BodyOptions()


@dataclass(frozen=True, kw_only=True)
class Primitive:
    """A simple body in the middle of its own frame; cylinders and capsules are along z.

    kind: "box", "sphere", "cylinder" or "capsule"
    sizes: lengths [m]: the sides of a box; otherwise the radius, then the length, for a capsule without its caps
    """

    kind: Literal["box", "sphere", "cylinder", "capsule"]
    sizes: Numbers

    @property
    def volume(self) -> float:
        """Volume [m³]."""
        if self.kind == "box":
            return float(np.prod(self.sizes))
        radius, length = (*self.sizes, 0.0)[:2]
        ball = 4 / 3 * np.pi * radius**3 if self.kind in ("sphere", "capsule") else 0.0
        return float(ball + np.pi * radius**2 * length)


Shape: TypeAlias = Primitive | Hull


@dataclass(frozen=True, kw_only=True)
class Source:
    """The collision element of a URDF that a piece comes from.

    kind: "box", "sphere", "cylinder", "capsule" or "mesh"
    line: line of the element
    file, scale: file of a mesh and its factors
    digest: SHA-256 of the mesh's content, its scale and the options of its cover, "" for other shapes
    ratio: volume of all hulls of the mesh over its own
    """

    kind: str
    line: int
    file: Path | None = None
    scale: Numbers = (1.0, 1.0, 1.0)
    digest: str = ""
    ratio: float = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Piece:
    """A convex body of a link.

    link: name of the link
    joint: index of the arm's joint that moves the piece, −1 if it is fixed to the base
    pose: pose of the shape in the frame of that joint (in the base for −1)
    shape: the body in its own frame
    source: where it comes from
    """

    link: str
    joint: int
    pose: Pose
    shape: Shape
    source: Source


@dataclass(frozen=True, kw_only=True, eq=False)
class Bodies:
    """The convex bodies of a whole robot, also of links off the chain, at the values of its frozen joints.

    pieces: bodies in the order of the file
    silent: links that have visuals only, and so no body
    notes: what was done to meshes, and links that were left out
    """

    pieces: tuple[Piece, ...]
    silent: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        links = len({piece.link for piece in self.pieces})
        return f"Bodies({len(self.pieces)} pieces of {links} links, {len(self.silent)} links with visuals only)"

    def with_fixed_joint(self, joint: int, motion: Pose) -> Bodies:
        """Return the bodies of the arm whose joint with this index is frozen.

        motion: pose of the joint's frame, at its frozen value, in the frame before it
        """
        pieces = []
        for piece in self.pieces:
            pose = motion @ piece.pose if piece.joint == joint else piece.pose
            pieces.append(replace(piece, joint=piece.joint - (piece.joint >= joint), pose=pose))
        return replace(self, pieces=tuple(pieces))


# Bodies from the shapes of a URDF.


def link_bodies(
    robot: RobotDescription, frames: Mapping[str, Frame], file: Path, packages: Mapping[str, str | Path] | None
) -> tuple[Bodies, list[Fault]]:
    """Return the bodies of a robot, and the faults of its shapes and meshes with their lines.

    frames: frame of each link on the joint that moves it; other links are left out
    file: the URDF; relative files are relative to its folder
    packages: folders by the names of packages

    Files outside these folders are never opened. Raises InvalidInput unless ``packages`` maps names to folders.
    """
    folders = _package_folders(packages)
    shapes = [shape for link in robot.links.values() for shape in link.shapes]
    faults = [fault for link in robot.links.values() for fault in link.shape_faults]
    notes = [f"line {line}: {text}" for link in robot.links.values() for line, text in link.shape_warnings]
    if len(shapes) > OPTIONS.max_shapes:
        wish = f"the robot must have at most {OPTIONS.max_shapes:,} collision shapes"
        return Bodies(pieces=()), [*faults, (1, f"{wish}, got {len(shapes):,}")]
    covers, pieces = dict[tuple[Path, Numbers], Cover | str](), list[Piece]()
    for shape in shapes:
        frame = frames.get(shape.link)
        if frame is None:
            notes.append(f"line {shape.line}: link {shape.link!r}: its place is unknown, its {shape.kind} is left out")
            continue
        try:
            made, said = _shape_pieces(shape, frame, file, folders, covers)
        except InvalidInput as error:
            faults.append((shape.line, f"link {shape.link!r}: {error}"))
            continue
        pieces += made
        notes += [f"line {shape.line}: link {shape.link!r}: mesh {each}" for each in said]
    silent = [link.name for link in robot.links.values() if link.has_visuals and not (link.shapes or link.shape_faults)]
    return Bodies(pieces=tuple(pieces), silent=tuple(silent), notes=tuple(notes)), faults


def _shape_pieces(
    shape: ShapeDescription,
    frame: Frame,
    file: Path,
    folders: Mapping[str, Path],
    covers: dict[tuple[Path, Numbers], Cover | str],
) -> tuple[list[Piece], list[str]]:
    """Return the pieces of a shape, and what was done to its mesh. Each file is covered once."""
    pose = frame.pose @ shape.pose
    if shape.kind != "mesh":
        body = Primitive(kind=shape.kind, sizes=shape.sizes)  # type: ignore[arg-type]  # one of the kinds that are read
        source = Source(kind=shape.kind, line=shape.line)
        return [Piece(link=shape.link, joint=frame.link, pose=pose, shape=body, source=source)], []
    place = find_mesh(shape.file, file, folders)
    if (place, shape.scale) not in covers:
        try:
            covers[place, shape.scale] = cover_file(place, shape.scale)
        except InvalidInput as error:
            covers[place, shape.scale] = str(error)
    cover = covers[place, shape.scale]
    if isinstance(cover, str):
        raise InvalidInput(cover)
    source = Source(kind="mesh", line=shape.line, file=place, scale=shape.scale, digest=cover.digest, ratio=cover.ratio)
    pieces = [Piece(link=shape.link, joint=frame.link, pose=pose, shape=hull, source=source) for hull in cover.hulls]
    return pieces, [f"{place.name} {note}" for note in cover.notes]


def _package_folders(packages: Mapping[str, str | Path] | None) -> dict[str, Path]:
    """Return the folders of packages. Raises InvalidInput unless they are folders by name."""
    if packages is not None:
        check_mapping("packages", packages, "folders by package", example="{'panda_description': 'robots/panda'}")
    folders = {}
    for name, given in (packages or {}).items():
        folder = file_path(f"packages[{shown(name)}]", given)
        if not folder.is_dir():
            fact = "a file" if folder.is_file() else missing_file(folder)
            raise InvalidInput(f"packages[{shown(name)}] must be a folder, got {fact}")
        folders[name] = folder
    return folders


def find_mesh(name: str, urdf: Path, packages: Mapping[str, Path]) -> Path:
    """Return the file of a mesh that a URDF names.

    name: ``package://NAME/...``, ``file://...`` or a path relative to the URDF's folder
    packages: folders by the names of packages

    Raises InvalidInput for other names, and for files outside the folders of the URDF and packages, after links and
    ``..`` are followed.
    """
    scheme, separator, rest = name.partition("://")
    if not separator:
        path = urdf.parent / file_path("mesh filename", name)
    elif scheme == "file":
        path = file_path("mesh filename", rest)
    elif scheme == "package":
        package, _, inside = rest.partition("/")
        if package not in packages:
            known = listed(packages) if packages else "none"
            hint = likely_spelling(package, packages) or f"; packages={{{shown(package)}: folder}} names its folder"
            raise InvalidInput(f"mesh {shown(name)} must be in one of the packages {known}, got {shown(package)}{hint}")
        path = packages[package] / file_path("mesh filename", inside.lstrip("/"))
    else:
        wish = "must be package://NAME/..., file://... or a relative path"
        raise InvalidInput(f"mesh filename {wish}, got {shown(name)}")
    try:
        place = path.resolve()
        roots = [urdf.parent.resolve(), *(folder.resolve() for folder in packages.values())]
    except (OSError, RuntimeError) as error:  # a circle of links
        raise InvalidInput(f"mesh {shown(name)} must be a file, got {error}") from None
    if not any(place.is_relative_to(root) for root in roots):
        wish = "must be in the folder of the URDF or of one of the packages"
        raise InvalidInput(f"mesh {shown(name)} {wish}, got {place}; packages= can add a folder")
    return place


# A table of the bodies of each link.


COLUMNS = ("link", "moved by", "pieces", "kinds", "outside [mm]", "volume [×]")


def body_table(bodies: Bodies, joints: Sequence[str]) -> list[tuple[str, ...]]:
    """Return a table of bodies, one row per link, with the column names first.

    joints: names of the arm's joints

    The last columns are the largest distance of the hulls outside the meshes, by samples, and the volume of all bodies
    over that of the shapes. Raises InvalidInput if a mesh cannot be read again, or if coal is not installed.
    """
    rows: list[tuple[str, ...]] = [COLUMNS]
    for link in dict.fromkeys(piece.link for piece in bodies.pieces):
        pieces = [piece for piece in bodies.pieces if piece.link == link]
        volume = sum(piece.shape.volume for piece in pieces)
        of_source = dict[Source, list[Piece]]()
        for piece in pieces:
            of_source.setdefault(piece.source, []).append(piece)
        exact = sum(sum(piece.shape.volume for piece in some) / each.ratio for each, some in of_source.items())
        outside = max(map(_outside, of_source.values()))
        kinds = ["hull" if isinstance(piece.shape, Hull) else piece.shape.kind for piece in pieces]
        counts = {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)}
        names = ", ".join(f"{kind} × {count}" if count > 1 else kind for kind, count in counts.items())
        joint = pieces[0].joint
        moved = joints[joint] if 0 <= joint < len(joints) else "none"
        ratio = f"{volume / exact:.3f}" if exact > 0 else "unknown"
        rows.append((link, moved, str(len(pieces)), names, f"{1e3 * outside:.1f}", ratio))
    return rows


def _outside(pieces: Sequence[Piece]) -> float:
    """Return how far [m] the pieces of one source are outside it."""
    source, hulls = pieces[0].source, [piece.shape for piece in pieces if isinstance(piece.shape, Hull)]
    return inflation(hulls, read_mesh(source.file, source.scale)) if source.file is not None else 0.0
