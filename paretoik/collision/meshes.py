"""Triangle meshes from STL, DAE and OBJ files: read within bounds, closed, with their faces turned outwards."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import read_only
from paretoik.errors import InvalidInput
from paretoik.file_paths import missing_file
from paretoik.inputs import cause_of, finite_array, shown

ENDINGS = (".stl", ".dae", ".obj")


@dataclass(frozen=True, kw_only=True)
class MeshOptions:
    """Bounds of a mesh file, and tolerances as shares of the mesh's size.

    max_bytes, max_triangles: largest file and number of triangles
    max_size: largest coordinate [m] after scaling
    merged: distance within which two vertices are one when edges are matched
    thinnest: smallest volume, as a share of the cube of the size, of a mesh that encloses anything
    """

    max_bytes: int = 64_000_000
    max_triangles: int = 500_000
    max_size: float = 1e4
    merged: float = 1e-6
    thinnest: float = 1e-9


OPTIONS = MeshOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class TriangleMesh:
    """A closed surface of triangles, counter-clockwise when seen from outside.

    vertices: coordinates (vertices, 3) [m]
    faces: three indices of vertices per triangle
    notes: what was done to the file's mesh
    """

    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]
    notes: tuple[str, ...] = ()

    @property
    def triangles(self) -> Float[np.ndarray, "faces 3 3"]:
        """Corners of each triangle."""
        return self.vertices[self.faces]

    @property
    def volume(self) -> float:
        """Enclosed volume [m³]."""
        return enclosed_volume(self.triangles)


def enclosed_volume(triangles: Float[np.ndarray, "faces 3 3"]) -> float:
    """Return the volume that closed triangles enclose, negative if they are inside out."""
    return float(signed_volumes(triangles).sum())


def signed_volumes(triangles: Float[np.ndarray, "faces 3 3"]) -> Float[np.ndarray, " faces"]:
    """Return the volumes of the tetrahedra from one common point, in the middle, to each triangle."""
    corners = triangles - triangles.reshape(-1, 3).mean(axis=0)
    volumes: np.ndarray = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    return volumes


# Reading of files.


def read_mesh(file: Path, scale: Sequence[float] = (1.0, 1.0, 1.0)) -> TriangleMesh:
    """Return the mesh of a file, closed and with its faces turned outwards.

    file: STL, DAE or OBJ file; materials and textures are not read, and no other file is opened
    scale: factors along the mesh's axes; the mesh is mirrored if their product is negative

    Holes are closed by flat patches. Raises InvalidInput if the file cannot be read, is too large, or encloses nothing.
    """
    return mesh_from_bytes(read_bytes(file), file, scale)


def read_bytes(file: Path) -> bytes:
    """Return the content of a mesh file. Raises InvalidInput if it is missing, empty or too large."""
    if file.suffix.lower() not in ENDINGS:
        raise InvalidInput(f"mesh {file} must end with {', '.join(ENDINGS)}, got {shown(file.suffix)}")
    try:
        if not file.is_file():
            raise InvalidInput(f"mesh {file} must be a plain file, got {missing_file(file)}")
        with file.open("rb") as stream:
            data = stream.read(OPTIONS.max_bytes + 1)
    except OSError as error:
        raise InvalidInput(f"mesh {file} must be readable, got {error.strerror}") from None
    if not data:
        raise InvalidInput(f"mesh {file} must contain triangles, got an empty file")
    if len(data) > OPTIONS.max_bytes:
        raise InvalidInput(f"mesh {file} must have at most {OPTIONS.max_bytes // 1_000_000} MB, got more")
    return data


def content_digest(data: bytes, scale: Sequence[float], options: object) -> str:
    """Return the SHA-256 of a mesh file's content, its scale, and the options that it is treated with."""
    text = repr((tuple(float(each) for each in scale), OPTIONS, options))
    return sha256(sha256(data).digest() + text.encode()).hexdigest()


def mesh_from_bytes(data: bytes, file: Path, scale: Sequence[float]) -> TriangleMesh:
    """Return the mesh of a file's content, as ``read_mesh`` does."""
    name, factors = f"mesh {file}", finite_array("mesh scale", scale, (3,))
    if not factors.all():
        raise InvalidInput(f"mesh scale must not be zero, got {shown(list(scale))}")
    _check_content(name, data, file.suffix.lower())
    vertices, faces = _parse(name, data, file.suffix.lower()[1:])
    if len(faces) > OPTIONS.max_triangles:
        raise InvalidInput(f"{name} must have at most {OPTIONS.max_triangles:,} triangles, got {len(faces):,}")
    if len(faces) and not -1 < faces.min() <= faces.max() < len(vertices):
        raise InvalidInput(f"{name} must have faces among its {len(vertices)} vertices, got another one")
    used, corners = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used] * factors, corners.reshape(-1, 3)
    if not np.isfinite(vertices).all():
        raise InvalidInput(f"{name} must have finite vertices, got infinite ones or NaN")
    if np.abs(vertices).max(initial=0.0) > OPTIONS.max_size:
        fact = f"got {np.abs(vertices).max():g} m; scale= converts millimetres"
        raise InvalidInput(f"{name} must have coordinates of at most {OPTIONS.max_size:g} m, {fact}")
    vertices, corners = np.unique(vertices + 0.0, axis=0, return_inverse=True)  # + 0.0: no negative zeros
    faces = corners.reshape(-1)[faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    if not len(faces):
        raise InvalidInput(f"{name} must contain triangles, got none")
    return close_surface(vertices, faces[:, ::-1] if factors.prod() < 0 else faces, name)


def _check_content(name: str, data: bytes, ending: str) -> None:
    """Refuse contents that would expand without bounds when they are read."""
    triangles = 0
    if ending == ".obj":
        triangles = data.count(b"\nf ") + data.count(b"\nf\t")
    elif ending == ".stl" and b"facet" in data:
        triangles = data.count(b"endfacet")
    elif ending == ".stl":
        triangles = int.from_bytes(data[80:84], "little")
        if len(data) != 84 + 50 * triangles:
            wish = f"{84 + 50 * triangles:,} bytes, as its header has {triangles:,} triangles"
            raise InvalidInput(f"{name} must be an STL file with facets or with {wish}, got {len(data):,} bytes")
    elif ending == ".dae":
        head = data[:200].lstrip(b"\xef\xbb\xbf \t\r\n")
        encoding = re.search(rb"""<\?xml[^>]*encoding\s*=\s*["']([\w.-]+)["']""", head)
        if not head.startswith(b"<") or (encoding and encoding[1].lower() not in (b"utf-8", b"us-ascii", b"ascii")):
            raise InvalidInput(f"{name} must be XML in UTF-8, got another content")
        if found := re.search(rb"<!DOCTYPE|<!ENTITY|<(?:\w+:)?instance_node", data, re.IGNORECASE):
            raise InvalidInput(f"{name} must have no entities or repeated nodes, got {found[0].decode()}")
    if triangles > OPTIONS.max_triangles:
        raise InvalidInput(f"{name} must have at most {OPTIONS.max_triangles:,} triangles, got {triangles:,}")


def _parse(name: str, data: bytes, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Return all vertices and faces of a file, in its own frame and in metres."""
    trimesh = _trimesh()
    try:
        scene: Any = trimesh.load_scene(BytesIO(data), file_type=kind, process=False, resolver=None)
        parts = [
            (scene.graph[node], scene.geometry[scene.graph[node][1]])
            for node in scene.graph.nodes_geometry
            if hasattr(scene.geometry[scene.graph[node][1]], "faces")
        ]
        count = sum(len(part.faces) for _, part in parts)
        if count > OPTIONS.max_triangles:
            raise InvalidInput(f"{name} must have at most {OPTIONS.max_triangles:,} triangles, got {count:,}")
        vertices, faces, first = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
        for (matrix, _), part in parts:
            points, corners = np.asarray(part.vertices, dtype=float), np.asarray(part.faces, dtype=np.int64)
            with np.errstate(over="ignore", invalid="ignore"):
                vertices.append(points @ matrix[:3, :3].T + matrix[:3, 3])
            mirrored = np.linalg.det(matrix[:3, :3]) < 0
            faces.append(first + (corners[:, ::-1] if mirrored else corners))
            first += len(points)
    except InvalidInput:
        raise
    except Exception as error:  # the libraries that read files raise many kinds
        raise InvalidInput(f"{name} must be a readable {kind.upper()} file, got {cause_of(error)[:200]}") from None
    return np.concatenate(vertices), np.concatenate(faces)


def _trimesh() -> Any:
    """Return the library that reads meshes, which is optional."""
    try:
        import collada  # noqa: F401  trimesh reads DAE files with it
        import trimesh
    except ImportError as error:
        hint = 'pip install ".[collision]" installs it'
        raise InvalidInput(f"meshes must be read by trimesh and pycollada, got no {error.name}; {hint}") from None
    return trimesh


# Closing of surfaces.


def close_surface(
    vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "faces 3"], name: str = "mesh"
) -> TriangleMesh:
    """Return a mesh whose surface is closed and turned outwards, with notes of what was done.

    A cavity inside another part counts as solid. Raises InvalidInput, with ``name``, if all vertices are in one plane.
    """
    extent = float(np.ptp(vertices, axis=0).max())
    centred = vertices - vertices.mean(axis=0)
    spread = np.linalg.svd(centred.T @ centred, compute_uv=False)
    if not spread[2] > (OPTIONS.merged * OPTIONS.merged) * spread[0]:
        raise InvalidInput(f"{name} must enclose a volume, got a flat one")
    notes = list[str]()
    corners = _merged_corners(vertices, faces, extent)
    # neighbours that disagree are turned if that closes the surface better
    turned, hole = np.zeros(len(faces), dtype=bool), _open_edges(corners)
    if len(hole):
        other = _disagreeing_faces(corners)
        better = _open_edges(np.where(other[:, None], corners[:, ::-1], corners))
        if len(better) < len(hole):
            turned, hole = other, better
    faces = np.where(turned[:, None], faces[:, ::-1], faces)
    # holes: the cycles of edges that no other face has in the opposite direction
    parts = _edge_connected_parts(corners)
    if len(hole):
        patches, centres, of_part = _patches(vertices, hole, corners, parts)
        vertices, faces = np.concatenate([vertices, centres]), np.concatenate([faces, patches])
        parts, turned = np.append(parts, of_part), np.append(turned, np.zeros(len(patches), dtype=bool))
        notes.append(f"open at {len(hole)} edges, closed by flat patches")
    # every part is turned outwards
    volumes = np.bincount(parts, weights=signed_volumes(vertices[faces]))
    inverted = (volumes < 0)[parts]
    faces = np.where(inverted[:, None], faces[:, ::-1], faces)
    turned ^= inverted
    if turned.all():
        notes.insert(0, "inside out, turned")
    elif turned.any():
        notes.insert(0, f"{int(turned.sum())} of {len(turned)} faces turned outwards")
    if enclosed_volume(vertices[faces]) < OPTIONS.thinnest * extent**3:
        notes.append("encloses no volume, its convex hull is taken")
    return TriangleMesh(vertices=read_only(vertices), faces=read_only(faces), notes=tuple(notes))


def _merged_corners(vertices: np.ndarray, faces: np.ndarray, extent: float) -> np.ndarray:
    """Return the faces with the same vertex for all vertices of one place."""
    keys = np.round((vertices - vertices.min(axis=0)) / (OPTIONS.merged * extent)).astype(np.int64)
    _, first, same = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    merged: np.ndarray = first[same.reshape(-1)][faces]
    return merged


def _directed_edges(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the undirected edges of all faces, each edge's direction (±1), and its face; sorted by edges."""
    starts, ends = corners.T.reshape(-1), np.roll(corners, -1, axis=1).T.reshape(-1)
    owners, real = np.tile(np.arange(len(corners)), 3), starts != ends
    starts, ends, owners = starts[real], ends[real], owners[real]
    edges = np.stack([np.minimum(starts, ends), np.maximum(starts, ends)], axis=1)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    return edges[order], np.where(starts < ends, 1, -1)[order], owners[order]


def _disagreeing_faces(corners: np.ndarray) -> np.ndarray:
    """Return the faces to turn so that neighbours agree.

    Each face is two nodes of a graph: as it is, and turned. Neighbours that agree link equal nodes, others link
    opposite ones. Faces that can agree are two components of this graph, one for each of their orientations.
    """
    edges, directions, owners = _directed_edges(corners)
    count, new = len(corners), np.append(True, (edges[1:] != edges[:-1]).any(axis=1))
    sizes = np.diff(np.append(np.flatnonzero(new), len(edges)))
    first = np.flatnonzero(new)[sizes == 2]  # edges of more faces do not tell which of them are neighbours
    left, right, agree = owners[first], owners[first + 1], directions[first] != directions[first + 1]
    other = np.where(agree, right, right + count)
    rows, columns = np.concatenate([left, left + count]), np.concatenate([other, (other + count) % (2 * count)])
    labels = _components(rows, columns, 2 * count)
    disagreeing: np.ndarray = labels[:count] > labels[count:]
    return disagreeing


def _edge_connected_parts(corners: np.ndarray) -> np.ndarray:
    """Return the number of the part to which each face belongs; parts share no edge."""
    edges, _, owners = _directed_edges(corners)
    same = (edges[1:] == edges[:-1]).all(axis=1)
    return _components(owners[:-1][same], owners[1:][same], len(corners))


def _components(rows: np.ndarray, columns: np.ndarray, count: int) -> np.ndarray:
    """Return the number of the component to which each of ``count`` nodes of a graph belongs."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    labels: np.ndarray = connected_components(graph, directed=False)[1]
    return labels


def _open_edges(corners: np.ndarray) -> np.ndarray:
    """Return the directed edges (start, end) that no face has in the opposite direction."""
    edges, directions, _ = _directed_edges(corners)
    unique, numbers = np.unique(edges, axis=0, return_inverse=True)
    excess = np.bincount(numbers.reshape(-1), weights=directions).astype(np.int64)
    some = np.flatnonzero(excess)
    pairs = np.where((excess[some] > 0)[:, None], unique[some], unique[some][:, ::-1])
    return np.repeat(pairs, np.abs(excess[some]), axis=0)


def _patches(
    vertices: np.ndarray, hole: np.ndarray, corners: np.ndarray, parts: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return triangles that close holes, their new vertices, and the part of each triangle.

    Each hole gets one new vertex in its middle, from which a triangle goes to each of its edges.
    """
    edges, _, owners = _directed_edges(corners)
    part_of = dict(zip(map(tuple, edges.tolist()), parts[owners].tolist(), strict=True))
    of_part = np.array([part_of[min(edge), max(edge)] for edge in hole.tolist()], dtype=parts.dtype)
    ends, place = np.unique(hole, return_inverse=True)
    place = place.reshape(-1, 2)
    loops = _components(place[:, 0], place[:, 1], len(ends))
    sums = np.stack([np.bincount(loops, weights=axis) for axis in vertices[ends].T], axis=1)
    centres = sums / np.bincount(loops)[:, None]
    middle = len(vertices) + loops[place[:, 0]]
    return np.stack([middle, hole[:, 1], hole[:, 0]], axis=1), centres, of_part
