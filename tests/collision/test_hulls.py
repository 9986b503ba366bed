"""Covers by convex hulls: nothing of a mesh is outside them, and little else is inside."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import paretoik.collision.hulls as hulls_module
from paretoik.collision.hulls import OPTIONS, clip, convex_hull, cover, cover_file, surface_samples
from paretoik.collision.inflation import inflation, surface_distances, winding_numbers
from paretoik.collision.meshes import TriangleMesh, enclosed_volume, read_mesh
from paretoik.errors import InvalidInput
from tests.collision.solids import block, depth_outside, ell, points_on, torus, write


def mesh_of(triangles):
    vertices, faces = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    return TriangleMesh(vertices=vertices, faces=faces.reshape(-1, 3))


def cross():
    """Return a body of seven cubes, which no two planes cut into convex parts."""
    steps = [np.zeros(3, dtype=int), *np.eye(3, dtype=int), *-np.eye(3, dtype=int)]
    return np.concatenate([block(step, step + 1) for step in steps])


SOLIDS = {
    "cube": block((0, 0, 0), (1, 2, 3)),
    "L": ell()[0],
    "torus": torus()[0],
    "far cubes": np.concatenate([block((0, 0, 0), (1, 1, 1)), block((5, 1, 0), (6, 2, 1))]),
    "cross": cross(),
}


@pytest.fixture(scope="module", params=SOLIDS)
def covered(request):
    mesh = mesh_of(SOLIDS[request.param])
    return request.param, mesh, cover(mesh)


def test_no_point_on_or_in_a_mesh_is_outside_its_cover(covered):
    _, mesh, hulls = covered
    surface = points_on(mesh.triangles, 3000)
    rng = np.random.default_rng(0)
    inside = rng.uniform(mesh.vertices.min(axis=0), mesh.vertices.max(axis=0), (3000, 3))
    inside = inside[winding_numbers(mesh.triangles, inside) > 0.5]
    assert len(inside) > 100
    assert depth_outside(hulls, np.concatenate([surface, inside, mesh.vertices])).max() <= 1e-12


def test_a_cover_has_few_hulls_each_convex_and_turned_outwards(covered):
    name, mesh, hulls = covered
    assert 1 <= len(hulls) <= OPTIONS.pieces
    assert len(hulls) == {"cube": 1, "L": 2, "far cubes": 2}.get(name, len(hulls))
    for hull in hulls:
        assert hull.volume > 0
        assert depth_outside([hull], hull.vertices).max() <= 1e-12
    whole = convex_hull(mesh.vertices).volume
    total = sum(hull.volume for hull in hulls)
    assert mesh.volume * (1 - 1e-9) <= total <= whole * (1 + 1e-9)
    if name in ("cube", "L", "far cubes"):
        assert total <= OPTIONS.ratio * mesh.volume


@settings(max_examples=15)
@given(seed=st.integers(0, 10**6))
def test_covers_of_random_turned_unions_cover_them(seed):
    rng = np.random.default_rng(seed)
    parts = []
    for _ in range(rng.integers(1, 4)):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn *= np.sign(np.linalg.det(turn))
        parts.append(block(np.zeros(3), rng.uniform(0.1, 1.0, 3)) @ turn.T + rng.normal(size=3))
    mesh = mesh_of(np.concatenate(parts))
    assert depth_outside(cover(mesh), points_on(mesh.triangles, 500, seed)).max() <= 1e-10


@settings(max_examples=20)
@given(seed=st.integers(0, 10**6), name=st.sampled_from(["L", "torus", "cross"]))
def test_both_sides_of_a_plane_have_the_volume_of_the_whole(seed, name):
    rng = np.random.default_rng(seed)
    triangles, normal = SOLIDS[name], rng.normal(size=3)
    if seed % 3 == 0:
        normal = np.eye(3)[seed % 9 // 3]  # along faces and edges
    offset = float(rng.choice(triangles.reshape(-1, 3) @ normal)) + (seed % 2) * rng.uniform(-0.3, 0.3)
    sides = [clip(triangles, sign * normal, sign * offset) for sign in (1.0, -1.0)]
    for sign, side in zip((1.0, -1.0), sides, strict=True):
        assert (sign * (side @ normal - offset)).max(initial=-np.inf) <= 1e-12
    volumes = [enclosed_volume(side) if len(side) else 0.0 for side in sides]
    assert min(volumes) >= -1e-12
    assert sum(volumes) == pytest.approx(enclosed_volume(triangles), rel=1e-9)


def test_a_hull_of_flat_or_few_points_is_refused():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    for points in (square, square[:2]):
        with pytest.raises(InvalidInput, match="points of a hull must span a volume, got"):
            convex_hull(points)


def test_samples_of_a_surface_are_on_it_and_spread_by_area():
    triangles = block((0, 0, 0), (1, 1, 8))
    samples = surface_samples(triangles, 4000)
    on_side = np.abs(samples[:, None] - [[0, 0, 0], [1, 1, 8]]).min(axis=(1, 2))
    assert on_side.max() <= 1e-12
    on_ends = np.isin(np.round(samples[:, 2], 12), (0, 8)).mean()
    assert on_ends == pytest.approx(2 / 34, abs=0.02)


# How far a cover is outside


def test_the_inflation_of_the_hull_of_an_l_is_the_distance_of_its_inner_corner():
    pytest.importorskip("coal")
    mesh = mesh_of(ell(width=2.0, depth=2.0, thickness=1.0)[0])
    hull = convex_hull(mesh.vertices)
    assert inflation([hull], mesh) == pytest.approx(0.5, rel=0.05)  # the middle of its slanted face to either side
    assert inflation([hull], mesh) <= 0.5 + 1e-9
    assert inflation(cover(mesh), mesh) <= 1e-6


def test_distances_from_a_box_are_those_of_the_formula():
    pytest.importorskip("coal")
    mesh, rng = mesh_of(block((-1, -1, -1), (1, 1, 1))), np.random.default_rng(3)
    points = rng.uniform(-3, 3, (200, 3))
    outside = np.abs(points).max(axis=1) > 1
    exact = np.linalg.norm(np.maximum(np.abs(points) - 1, 0), axis=1)
    assert surface_distances(mesh, points)[outside] == pytest.approx(exact[outside], abs=1e-6)
    assert (np.abs(winding_numbers(mesh.triangles, points)) < 0.5).tolist() == outside.tolist()


# The cache


@pytest.fixture
def cache(tmp_path, monkeypatch):
    pytest.importorskip("trimesh")
    pytest.importorskip("collada")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "paretoik" / "hulls"


def same(one, other):
    return all(
        left.vertices.tobytes() == right.vertices.tobytes() and left.faces.tobytes() == right.faces.tobytes()
        for left, right in zip(one.hulls, other.hulls, strict=True)
    ) and (one.ratio, one.notes, one.digest) == (other.ratio, other.notes, other.digest)


def test_a_cover_is_computed_once_and_again_if_its_file_or_scale_changes(tmp_path, cache, monkeypatch):
    calls, compute = [], hulls_module.cover
    monkeypatch.setattr(hulls_module, "cover", lambda mesh: calls.append(1) or compute(mesh))
    file = write(tmp_path, "ell.stl", ell()[0][1:])
    first = cover_file(file)
    assert same(first, cover_file(file))
    assert first.notes
    assert len(calls) == 1
    assert cover_file(file, (1, 1, -1)).digest != first.digest
    write(tmp_path, "ell.stl", ell(width=4.0)[0])
    assert cover_file(file).ratio == pytest.approx(1.0, abs=0.05)
    assert len(calls) == 3
    assert len(list(cache.iterdir())) == 3


def test_a_damaged_or_read_only_cache_is_not_used(tmp_path, cache):
    file = write(tmp_path, "ell.stl", ell()[0])
    first = cover_file(file)
    (entry,) = cache.iterdir()
    for content in (b"", b"PK", entry.read_bytes()[:-100], np.random.default_rng(0).bytes(500)):
        entry.write_bytes(content)
        assert same(first, cover_file(file))
    entry.unlink()
    cache.rmdir()
    cache.write_text("in the way")
    assert same(first, cover_file(file))


def test_a_cover_does_not_depend_on_the_process(tmp_path):
    mesh = mesh_of(torus()[0])
    assert [hull.vertices.tobytes() for hull in cover(mesh)] == [hull.vertices.tobytes() for hull in cover(mesh)]


def test_a_mesh_that_encloses_nothing_has_its_hull(tmp_path):
    pytest.importorskip("trimesh")
    pytest.importorskip("collada")
    half = ell()[0][:7]
    mesh = read_mesh(write(tmp_path, "sheet.stl", np.concatenate([half, half[:, ::-1]])))
    assert mesh.notes[-1] == "encloses no volume, its convex hull is taken"
    assert len(cover(mesh)) == 1
