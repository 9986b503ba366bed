"""How far hulls reach outside the mesh that they cover, by samples and exact distances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.collision.hulls import Hull, surface_samples
from paretoik.collision.meshes import TriangleMesh
from paretoik.errors import InvalidInput


@dataclass(frozen=True, kw_only=True)
class InflationOptions:
    """Sizes of the samples.

    samples: points on the surface of each hull, next to its corners
    chunk: points whose winding numbers are computed together
    pairs: most pairs of a point and a triangle in memory
    """

    samples: int = 1500
    chunk: int = 32
    pairs: int = 2_000_000


OPTIONS = InflationOptions()


def inflation(hulls: Sequence[Hull], mesh: TriangleMesh) -> float:
    """Return the largest distance [m] of points of the hulls outside the mesh, 0 if there are none.

    It is a lower bound that samples of the hulls' surfaces give. Raises InvalidInput if coal is not installed.
    """
    points = np.concatenate(
        [hull.vertices for hull in hulls]
        + [surface_samples(hull.vertices[hull.faces], OPTIONS.samples) for hull in hulls]
    )
    distances = surface_distances(mesh, points)
    triangles, order = mesh.triangles, np.argsort(-distances)
    chunk = max(1, min(OPTIONS.chunk, OPTIONS.pairs // len(triangles)))
    for first in range(0, len(order), chunk):
        some = order[first : first + chunk]
        if distances[some[0]] <= 1e-9 * np.abs(points).max():
            break
        outside = np.abs(winding_numbers(triangles, points[some])) < 0.5
        if outside.any():
            return float(distances[some[outside][0]])
    return 0.0


def surface_distances(mesh: TriangleMesh, points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, " points"]:
    """Return the distance [m] of each point to the nearest triangle of a mesh, by coal."""
    coal = load_coal()
    surface = coal.BVHModelOBBRSS()
    surface.beginModel(len(mesh.faces), len(mesh.vertices))
    surface.addVertices(np.array(mesh.vertices))
    surface.addTriangles(np.array(mesh.faces, dtype=np.int64))
    surface.endModel()
    request, result, point = coal.DistanceRequest(), coal.DistanceResult(), coal.Sphere(0.0)
    at_rest, place, distances = coal.Transform3s.Identity(), coal.Transform3s.Identity(), np.empty(len(points))
    for row, position in enumerate(points):
        place.setTranslation(position)
        result.clear()
        distances[row] = coal.distance(point, place, surface, at_rest, request, result)
    return np.maximum(distances, 0.0)


def winding_numbers(
    triangles: Float[np.ndarray, "faces 3 3"], points: Float[np.ndarray, "points 3"]
) -> Float[np.ndarray, " points"]:
    """Return how often closed triangles surround each point: about 1 inside, 0 outside.

    Van Oosterom & Strackee 1983: the solid angle of a triangle.
    """
    a, b, c = (triangles[None, :, corner] - points[:, None] for corner in range(3))
    lengths = [np.linalg.norm(side, axis=-1) for side in (a, b, c)]
    volume = np.einsum("pfi,pfi->pf", a, np.cross(b, c))
    products = [np.einsum("pfi,pfi->pf", left, right) for left, right in ((a, b), (b, c), (c, a))]
    divisor = lengths[0] * lengths[1] * lengths[2] + sum(
        product * length for product, length in zip(products, (lengths[2], lengths[0], lengths[1]), strict=True)
    )
    numbers: np.ndarray = np.arctan2(volume, divisor).sum(axis=-1) / (2 * np.pi)
    return numbers


def load_coal() -> Any:
    """Return the library of distances between bodies, which is optional."""
    try:
        import coal
    except ImportError:
        raise InvalidInput(
            'distances must be computed by coal, got none; pip install ".[collision]" installs it'
        ) from None
    return coal
