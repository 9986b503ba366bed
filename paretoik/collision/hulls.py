"""Convex hulls that cover a mesh: one, or several after cuts by planes, kept in the user's cache folder."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Vector3, read_only
from paretoik.collision.meshes import TriangleMesh, content_digest, enclosed_volume, mesh_from_bytes, read_bytes
from paretoik.errors import InvalidInput
from paretoik.runs.file_replacement import replace_file

Triangles = Float[np.ndarray, "faces 3 3"]


@dataclass(frozen=True, kw_only=True)
class CoverOptions:
    """Limits of a cover by convex hulls, and sizes of the search for planes.

    version: number of the algorithm, which changes when covers are made in another way
    ratio: volume of the hulls over that of the mesh below which no cut is made
    pieces: largest number of hulls
    gain: smallest gain of a cut, as a share of the mesh's volume
    offsets: planes per direction at equal distances
    flats: planes per direction in the largest flat faces across it
    samples: edges of a part with which planes are compared
    best: planes whose cuts are computed exactly
    refinements: halvings of the distance between planes around the best one
    seed: seed of the samples
    """

    version: int = 1
    ratio: float = 1.05
    pieces: int = 4
    gain: float = 0.01
    offsets: int = 11
    flats: int = 3
    samples: int = 2000
    best: int = 5
    refinements: int = 3
    seed: int = 0


OPTIONS = CoverOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Hull:
    """A convex body: its corners (vertices, 3) [m], and its triangles, counter-clockwise when seen from outside."""

    vertices: Float[np.ndarray, "vertices 3"]
    faces: Int[np.ndarray, "faces 3"]

    @property
    def volume(self) -> float:
        """Volume [m³]."""
        return enclosed_volume(self.vertices[self.faces])


def convex_hull(points: Float[np.ndarray, "points 3"]) -> Hull:
    """Return the convex hull of points, by Qhull. Raises InvalidInput if they are in one plane.

    >>> corners = np.array([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)])
    >>> round(convex_hull(np.vstack([corners, [[0.5, 0.5, 0.5]]])).volume, 12)
    1.0
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        found = ConvexHull(points)
    except (QhullError, ValueError):  # too few points, or flat ones
        raise InvalidInput(f"points of a hull must span a volume, got {len(points)} flat ones") from None
    used, corners = np.unique(found.simplices, return_inverse=True)
    vertices, faces = np.array(points[used], dtype=float), corners.reshape(-1, 3)
    triangles = vertices[faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    inward = np.einsum("ij,ij->i", normals, found.equations[:, :3]) < 0
    faces = np.where(inward[:, None], faces[:, ::-1], faces)
    return Hull(vertices=read_only(vertices), faces=read_only(np.ascontiguousarray(faces)))


# A cover of a mesh by hulls.


@dataclass(frozen=True, eq=False)
class _Part:
    """A part of a mesh between planes: its closed surface, its hull, and its volume."""

    triangles: Triangles
    hull: Hull
    volume: float

    @property
    def excess(self) -> float:
        """Volume of the hull outside the part."""
        return self.hull.volume - self.volume


def cover(mesh: TriangleMesh) -> list[Hull]:
    """Return convex hulls that together cover a mesh.

    The hull alone is returned if its volume is at most 1.05 times that of the mesh. Otherwise the part with the largest
    excess of its hull's volume is cut by a plane, again and again, up to four parts. Triangles are cut exactly at the
    plane and both sides are closed in it, so that the hulls cover surface and inside.
    """
    whole = _Part(mesh.triangles, convex_hull(mesh.vertices), mesh.volume)
    parts, finished = [whole], list[_Part]()
    smallest = OPTIONS.gain * whole.volume
    while parts and len(parts) + len(finished) < OPTIONS.pieces:
        total = sum(part.hull.volume for part in (*parts, *finished))
        if total <= OPTIONS.ratio * whole.volume or whole.volume <= 0:
            break
        parts.sort(key=lambda part: part.excess)
        part = parts.pop()
        halves = _best_cut(part) if part.excess > smallest else None
        if halves is None or part.hull.volume - sum(half.hull.volume for half in halves) < smallest:
            finished.append(part)
        else:
            parts += halves
    return [part.hull for part in (*finished, *parts)]


def _best_cut(part: _Part) -> list[_Part] | None:
    """Return the two sides of the plane with the least volume of both hulls, None if no plane cuts.

    The planes are across the axes and the principal axes. They are compared by samples of edges first; the best ones
    are computed exactly, and the very best one is moved.
    """
    triangles = part.triangles
    crosses = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])  # twice areas, × normals
    areas, centres = np.linalg.norm(crosses, axis=1), triangles.mean(axis=1)
    edges = _edge_samples(triangles)
    principal = np.linalg.eigh(np.cov(centres.T, aweights=areas))[1].T
    fractions = np.arange(1, OPTIONS.offsets + 1) / (OPTIONS.offsets + 1)
    planes = list[tuple[float, Vector3, float, float]]()
    for normal in (*np.eye(3), *principal):
        ends, heights = edges @ normal, part.hull.vertices @ normal
        low, high = heights.min(), heights.max()
        flat = np.abs(crosses @ normal) > 0.999 * areas
        levels, group = np.unique(np.round((centres[flat] @ normal - low) / (high - low), 6), return_inverse=True)
        largest = np.argsort(-np.bincount(group.reshape(-1), weights=areas[flat]))
        inner = [level for level in levels[largest] if 0.01 < level < 0.99][: OPTIONS.flats]
        for offset in low + np.append(inner, fractions) * (high - low):
            volume = sum(_hull_volume(_side_points(edges, sign * (ends - offset))) for sign in (1, -1))
            planes.append((volume, normal, float(offset), (high - low) / (OPTIONS.offsets + 1)))
    planes.sort(key=lambda plane: plane[0])

    def cut(normal: Vector3, offset: float) -> tuple[float, float, list[_Part] | None]:
        """Return the volume of both hulls, the offset, and both sides."""
        halves = _cut(part, normal, offset)
        return (np.inf if halves is None else sum(half.hull.volume for half in halves)), offset, halves

    found = [(*cut(normal, offset), normal, step) for _, normal, offset, step in planes[: OPTIONS.best]]
    least, offset, best, normal, step = min(found, key=lambda each: each[0])
    for _ in range(OPTIONS.refinements):
        step /= 2
        moved = min((cut(normal, offset + sign * step) for sign in (1, -1)), key=lambda each: each[0])
        if moved[0] < least:
            least, offset, best = moved
    return best


def _edge_samples(triangles: Triangles) -> Float[np.ndarray, "edges 2 3"]:
    """Return the edges of closed triangles, each once; random ones if there are many."""
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2, 3)
    one_way = (edges @ np.array([1.0, np.e, np.pi])) @ np.array([1.0, -1.0]) < 0
    edges = edges[one_way]
    if len(edges) > OPTIONS.samples:
        edges = np.random.default_rng(OPTIONS.seed).choice(edges, OPTIONS.samples, replace=False)
    return edges


def _side_points(
    edges: Float[np.ndarray, "edges 2 3"], heights: Float[np.ndarray, "edges 2"]
) -> Float[np.ndarray, "points 3"]:
    """Return the ends of the parts of edges that are below a plane; edges in the plane have none."""
    below = heights.min(axis=1) < -1e-9 * np.abs(heights).max()
    edges, heights = edges[below], heights[below]
    rising, falling = heights[:, 1] > 0, heights[:, 0] > 0
    share = np.divide(heights[:, 0], heights[:, 0] - heights[:, 1], out=np.zeros(len(edges)), where=rising | falling)
    middle = edges[:, 0] + share[:, None] * (edges[:, 1] - edges[:, 0])
    points = np.concatenate(
        [np.where(falling[:, None], middle, edges[:, 0]), np.where(rising[:, None], middle, edges[:, 1])]
    )
    return np.unique(points, axis=0)


def surface_samples(triangles: Triangles, count: int) -> Float[np.ndarray, "samples 3"]:
    """Return random points on triangles, uniform by area."""
    rng = np.random.default_rng(OPTIONS.seed)
    edges = triangles[:, 1:] - triangles[:, :1]
    areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    chosen = rng.choice(len(triangles), count, p=areas / areas.sum())
    u, v = np.sort(rng.random((2, count)), axis=0)
    points: np.ndarray = triangles[chosen, 0] + u[:, None] * edges[chosen, 0] + (v - u)[:, None] * edges[chosen, 1]
    return points


def _hull_volume(points: Float[np.ndarray, "points 3"]) -> float:
    """Return the volume of the hull of points, 0 if they are flat."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return float(ConvexHull(points).volume) if len(points) > 3 else 0.0
    except QhullError:
        return 0.0


def _cut(part: _Part, normal: Vector3, offset: float) -> list[_Part] | None:
    """Return both sides of a plane, None if one of them has no volume."""
    sides = []
    for sign in (1.0, -1.0):
        triangles = clip(part.triangles, sign * normal, sign * offset)
        if not len(triangles):
            return None
        try:
            hull = convex_hull(triangles.reshape(-1, 3))
        except InvalidInput:
            return None
        sides.append(_Part(triangles, hull, enclosed_volume(triangles)))
    return sides


def clip(triangles: Triangles, normal: Vector3, offset: float) -> Float[np.ndarray, "clipped 3 3"]:
    """Return the part of a closed surface on the side x · normal ≤ offset of a plane, closed in the plane."""
    heights = triangles @ normal - offset
    heights[np.abs(heights) <= 1e-12 * np.abs(triangles).max()] = 0.0
    inside = (heights <= 0).all(axis=1) & (heights < 0).any(axis=1)
    crossing = (heights < 0).any(axis=1) & (heights > 0).any(axis=1)
    kept = triangles[inside]
    edges = list[np.ndarray]()  # directed edges of the surface in the plane
    flat = heights[inside] == 0
    for first, second in ((0, 1), (1, 2), (2, 0)):
        edges.append(kept[flat[:, first] & flat[:, second]][:, [first, second]])
    # a triangle that crosses: its corners inside and the points where its edges cross, in order
    corners, above = triangles[crossing], heights[crossing]
    points, valid = np.empty((len(corners), 6, 3)), np.zeros((len(corners), 6), dtype=bool)
    in_plane = np.zeros((len(corners), 6), dtype=bool)
    for first in range(3):
        second = (first + 1) % 3
        here, there = above[:, first], above[:, second]
        points[:, 2 * first], valid[:, 2 * first], in_plane[:, 2 * first] = corners[:, first], here <= 0, here == 0
        crosses = here * there < 0
        # the same bits from both ends of an edge, so that neighbouring triangles meet
        swap = here > there
        low, high = np.where(swap, there, here), np.where(swap, here, there)
        start = np.where(swap[:, None], corners[:, second], corners[:, first])
        end = np.where(swap[:, None], corners[:, first], corners[:, second])
        share = np.divide(-low, high - low, out=np.zeros_like(low), where=crosses)
        points[:, 2 * first + 1] = start + share[:, None] * (end - start)
        valid[:, 2 * first + 1] = in_plane[:, 2 * first + 1] = crosses
    order = np.argsort(~valid, axis=1, kind="stable")[:, :4]
    rows = np.arange(len(corners))[:, None]
    points, in_plane, count = points[rows, order], (in_plane & valid)[rows, order], valid.sum(axis=1)
    pieces = [points[:, :3], points[count == 4][:, [0, 2, 3]]]
    for place in range(4):
        following = np.where(place + 1 < count, place + 1, 0)
        both = in_plane[:, place] & in_plane[rows[:, 0], following] & (place < count)
        edges.append(np.stack([points[both, place], points[both, following[both]]], axis=1))
    border = np.concatenate(edges)
    if len(border):
        middle = np.broadcast_to(border.reshape(-1, 3).mean(axis=0), (len(border), 3))
        pieces.append(np.stack([middle, border[:, 1], border[:, 0]], axis=1))
    return np.concatenate([kept, *pieces])


# Covers of files, which are computed once.


@dataclass(frozen=True, kw_only=True, eq=False)
class Cover:
    """Hulls that cover the mesh of a file.

    hulls: the convex bodies
    ratio: volume of all hulls over the volume of the mesh
    notes: what was done to the file's mesh
    digest: SHA-256 of the file's content, its scale and all options
    """

    hulls: tuple[Hull, ...]
    ratio: float
    notes: tuple[str, ...]
    digest: str


def cover_file(file: Path, scale: Sequence[float] = (1.0, 1.0, 1.0)) -> Cover:
    """Return the cover of a mesh file, from the user's cache folder if it is there.

    Raises InvalidInput as ``read_mesh`` does. A cache that cannot be read or written is not used.
    """
    data = read_bytes(file)
    digest = content_digest(data, scale, OPTIONS)
    place = cache_folder() / f"{digest}.npz"
    known = _read_cover(place, digest)
    if known is not None:
        return known
    mesh = mesh_from_bytes(data, file, scale)
    hulls = cover(mesh)
    volume = sum(hull.volume for hull in hulls)
    made = Cover(
        hulls=tuple(hulls), ratio=volume / mesh.volume if mesh.volume > 0 else np.inf, notes=mesh.notes, digest=digest
    )
    with suppress(InvalidInput):  # a read-only home or a full disk
        replace_file(place, _cover_bytes(made))
    return made


def cache_folder() -> Path:
    """Return the folder of covers: ``paretoik/hulls`` in ``$XDG_CACHE_HOME``, or in ``~/.cache``."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    folder = Path(base) if base.startswith("/") else Path(os.path.expanduser("~")) / ".cache"  # noqa: PTH111  never raises
    return folder / "paretoik" / "hulls"


def _cover_bytes(made: Cover) -> bytes:
    stream = BytesIO()
    arrays = {f"vertices{number}": hull.vertices for number, hull in enumerate(made.hulls)}
    arrays |= {f"faces{number}": hull.faces for number, hull in enumerate(made.hulls)}
    text = json.dumps({"hulls": len(made.hulls), "ratio": made.ratio, "notes": made.notes, "digest": made.digest})
    np.savez_compressed(stream, text=np.array(text), **arrays)  # type: ignore[arg-type]
    return stream.getvalue()


def _read_cover(place: Path, digest: str) -> Cover | None:
    """Return a cover from the cache, None if there is no complete one."""
    try:
        with np.load(BytesIO(place.read_bytes()), allow_pickle=False) as stored:
            about = json.loads(str(stored["text"]))
            hulls = tuple(
                Hull(vertices=read_only(stored[f"vertices{number}"]), faces=read_only(stored[f"faces{number}"]))
                for number in range(about["hulls"])
            )
            cover = Cover(hulls=hulls, ratio=float(about["ratio"]), notes=tuple(about["notes"]), digest=about["digest"])
            return cover if about["digest"] == digest and hulls else None
    except Exception:  # missing, damaged, or of another program
        return None
