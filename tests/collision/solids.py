"""Solids as triangles, with volumes that are known, and files of them in all formats."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np


def block(low, high):
    """Return the 12 triangles (12, 3, 3) of a box, counter-clockwise from outside."""
    corners = np.array([[(low, high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)], dtype=float)
    sides = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    return np.array([corners[[a, *pair]] for a, b, c, d in sides for pair in ((b, c), (c, d))])


def prism(outline, height):
    """Return the triangles of a prism over an outline (corners, 2) that is star-shaped about its first corner."""
    low, high = (np.column_stack([outline, np.full(len(outline), z)]) for z in (0.0, height))
    fan = [(0, i, i + 1) for i in range(1, len(outline) - 1)]
    triangles = [high[list(each)] for each in fan] + [low[list(each[::-1])] for each in fan]
    for i, j in zip(range(len(outline)), np.roll(range(len(outline)), -1), strict=True):
        triangles += [np.array([low[i], low[j], high[j]]), np.array([low[i], high[j], high[i]])]
    return np.array(triangles)


def ell(width=3.0, depth=2.0, thickness=1.0, height=1.0):
    """Return an L of two bars; its inner corner comes first."""
    t = thickness
    outline = [(t, t), (t, depth), (0, depth), (0, 0), (width, 0), (width, t)]
    return prism(np.array(outline, dtype=float), height), (width + depth - t) * t * height


def torus(radius=1.0, thickness=0.25, count=32):
    """Return a torus about z; its volume is that of its triangles."""
    around, tube = (np.linspace(0, 2 * np.pi, n, endpoint=False) for n in (count, count // 2))
    ring = radius + thickness * np.cos(tube)
    points = np.stack(
        [
            np.outer(np.cos(around), ring),
            np.outer(np.sin(around), ring),
            np.tile(thickness * np.sin(tube), (count, 1)),
        ],
        axis=-1,
    )
    a, b, c, d = points, np.roll(points, -1, 0), np.roll(points, (-1, -1), (0, 1)), np.roll(points, -1, 1)
    triangles = np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3, 3), np.stack([a, c, d], 2).reshape(-1, 3, 3)])
    return triangles, float(
        np.einsum("ij,ij->i", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])).sum() / 6
    )


def stl(triangles):
    records = b"".join(struct.pack("<12fH", 0, 0, 0, *triangle.ravel(), 0) for triangle in triangles)
    return bytes(80) + struct.pack("<I", len(triangles)) + records


def text_stl(triangles):
    def facet(triangle):
        corners = "".join("vertex " + " ".join(map(str, point)) + "\n" for point in triangle.tolist())
        return f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n"

    return ("solid s\n" + "".join(map(facet, triangles)) + "endsolid s\n").encode()


def obj(triangles):
    points = "".join("v " + " ".join(map(str, point)) + "\n" for point in triangles.reshape(-1, 3).tolist())
    faces = "".join(f"f {3 * i + 1} {3 * i + 2} {3 * i + 3}\n" for i in range(len(triangles)))
    return ("mtllib paint.mtl\nusemtl red\n" + points + faces).encode()


def dae(triangles, unit=1.0, up="Z_UP", place="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"):
    numbers, count = " ".join(map(str, triangles.ravel().tolist())), 3 * len(triangles)
    order = " ".join(map(str, range(count)))
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="{unit}" name="u"/><up_axis>{up}</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="{3 * count}">{numbers}</float_array><technique_common>
<accessor source="#a" count="{count}" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="{len(triangles)}"><input semantic="VERTEX" source="#v" offset="0"/><p>{order}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><matrix>{place}</matrix>
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>""".encode()


FORMATS = {"binary.stl": stl, "text.STL": text_stl, "solid.obj": obj, "solid.dae": dae}


def write(folder: Path, name, triangles):
    """Write triangles to a file in the format of its name; return it."""
    file = folder / name
    file.write_bytes((FORMATS.get(name) or FORMATS["binary.stl"])(triangles))
    return file


def depth_outside(hulls, points):
    """Return how far [m] each point is outside every hull, by the planes of their triangles."""
    depth = np.full(len(points), np.inf)
    for hull in hulls:
        corners = hull.vertices[hull.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        real = lengths > 1e-9 * lengths.max()
        normals, feet = normals[real] / lengths[real, None], corners[real, 0]
        heights = points @ normals.T - np.einsum("ij,ij->i", normals, feet)
        depth = np.minimum(depth, heights.max(axis=1))
    return depth


def points_on(triangles, count, seed=0):
    """Return random points on triangles."""
    rng = np.random.default_rng(seed)
    weights = rng.dirichlet(np.ones(3), count)
    return np.einsum("nc,ncx->nx", weights, triangles[rng.integers(len(triangles), size=count)])
