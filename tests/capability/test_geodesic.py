"""Fastest paths against closed forms, a lattice and their neighbours, and the time of any path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from paretoik.capability import geodesic as module
from paretoik.capability.geodesic import fastest_path, linearise_pieces, path_time
from paretoik.errors import InvalidInput, SolverFailed
from tests.capability.fields import field


@dataclass(frozen=True)
class Even:
    """A model with the same speeds everywhere."""

    root: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def roots(self, positions):
        shape = (*positions.shape[:-1], *self.root.shape)
        return np.broadcast_to(self.root, shape), np.zeros((*shape, len(self.root)))


@dataclass(frozen=True)
class HalfPlane:
    """A model with R = I / height: its fastest paths are those of the hyperbolic plane, circles around height 0."""

    task: int = 2
    top: float = 20.0
    slowness: float = 1.0

    @property
    def lower(self):
        return np.append(np.full(self.task - 1, -10.0), 0.05)

    @property
    def upper(self):
        return np.append(np.full(self.task - 1, 10.0), self.top)

    def roots(self, positions):
        height = positions[..., -1, None, None]
        slopes = np.zeros((*positions.shape, self.task, self.task))
        slopes[..., -1] = -self.slowness * np.eye(self.task) / height**2
        return self.slowness * np.eye(self.task) / height, slopes

    def time(self, start, target):
        return self.slowness * np.arccosh(1 + np.sum((start - target) ** 2) / (2 * start[-1] * target[-1]))


class Waves:
    """A smooth random model in the unit box: R = I + Σ symmetric matrices · sin, at most ``strength``."""

    def __init__(self, seed, task=2, strength=0.8):
        rng = np.random.default_rng(seed)
        self.lower, self.upper = np.zeros(task), np.ones(task)
        self.rates, self.phases = 3 * rng.normal(size=(5, task)), rng.uniform(0, 2 * np.pi, 5)
        matrices = rng.normal(size=(5, task, task))
        matrices += matrices.swapaxes(1, 2)
        self.matrices = strength * matrices / np.linalg.norm(matrices, ord=2, axis=(1, 2)).sum()

    def roots(self, positions):
        angles = positions @ self.rates.T + self.phases
        roots = np.eye(len(self.lower)) + np.einsum("...f,fij->...ij", np.sin(angles), self.matrices)
        return roots, np.einsum("...f,fij,fk->...ijk", np.cos(angles), self.matrices, self.rates)


@dataclass(frozen=True)
class Ridge:
    """A model with a valley between the straight way and far slower places: the fastest way is in the valley."""

    lowest: float = -0.5

    @property
    def lower(self):
        return np.array([0.0, self.lowest])

    @property
    def upper(self):
        return np.array([1.0, 0.5])

    def roots(self, positions):
        height, center, width = np.transpose([[0.3, 0.0, 0.01], [4.0, 0.1, 0.03], [4.0, -0.1, 0.03]])
        away = (positions[..., 1, None] - center) / width
        hills = height * np.exp(-(away**2) / 2)
        slopes = np.zeros((*positions.shape, 2, 2))
        slopes[..., 1] = -np.sum(hills * away / width, axis=-1)[..., None, None] * np.eye(2)
        return (1 + hills.sum(axis=-1))[..., None, None] * np.eye(2), slopes


def ends(seed, task=2):
    return np.random.default_rng(seed).uniform(0.05, 0.95, size=(2, task))


PAIRS = {"upward": ([-1.0, 0.2], [1.0, 3.0]), "in space": ([-1.0, 0.5, 0.4], [1.0, -0.5, 1.0])}


@pytest.mark.parametrize("pair", ["upward", "in space"])
def test_fastest_paths_of_the_half_plane_are_known_and_met_with_order_two(pair):
    start, target = np.array(PAIRS[pair])
    model = HalfPlane(task=len(start))
    exact = model.time(start, target)
    wrong = [fastest_path(model, start, target, intervals=count).duration / exact - 1 for count in (50, 100, 200)]
    assert 0 <= wrong[2] < wrong[1] < 1e-4
    assert wrong[0] / wrong[1] == pytest.approx(4, rel=0.02)
    assert wrong[1] / wrong[2] == pytest.approx(4, rel=0.02)


def test_the_fastest_path_follows_and_leaves_a_wall():
    """Below a ceiling: a circle up to it, the ceiling, and a circle down."""
    top = 1.2
    model, across = HalfPlane(top=top), -1 + np.sqrt(top**2 - 1)
    start, target, touch = np.array([-1.0, 1.0]), np.array([1.0, 1.0]), np.array([across, top])
    path = fastest_path(model, start, target, intervals=200)
    assert path.points[:, 1].max() <= top
    assert path.duration == pytest.approx(2 * model.time(start, touch) - 2 * across / top, rel=2e-5)


@pytest.mark.parametrize("task", [2, 3])
def test_the_curvature_that_newton_uses_is_that_of_the_energy(task):
    model, rng = Waves(2, task), np.random.default_rng(2)
    points = np.linspace(*ends(2, task), 5) + rng.uniform(-0.05, 0.05, size=(5, task))

    def slope(shift):
        moved = points + np.pad(np.reshape(shift, (3, task)), ((1, 1), (0, 0)))
        return module._newton_system(model, moved, module.linearise_pieces(model, moved, 0.5))

    bands = slope(np.zeros(3 * task))[1]
    curvature = sum(np.diag(band[: 3 * task - below], -below) for below, band in enumerate(bands))
    curvature += np.tril(curvature, -1).T
    units = 1e-5 * np.eye(3 * task)
    numeric = np.stack([slope(unit)[0].ravel() - slope(-unit)[0].ravel() for unit in units]) / 2e-5
    assert curvature == pytest.approx(numeric, abs=1e-6)


@pytest.mark.parametrize("task", [2, 3])
def test_at_even_speed_the_way_is_straight(task):
    root, (start, target) = np.random.default_rng(task).normal(size=(task, task)), ends(task, task)
    path = fastest_path(Even(root, np.zeros(task), np.ones(task)), start, target)
    assert path.duration == pytest.approx(np.linalg.norm(root @ (target - start)), rel=1e-9)
    assert path.points == pytest.approx(np.linspace(start, target, 101), abs=1e-9)


@pytest.mark.parametrize(("seed", "task"), [(0, 2), (1, 3)])
def test_no_path_nearby_is_faster(seed, task):
    model, (start, target) = Waves(seed, task), ends(seed, task)
    path, rng = fastest_path(model, start, target), np.random.default_rng(seed)
    waves = np.sin(np.pi * np.outer(np.linspace(0, 1, 101), np.arange(1, 6)))
    for size in np.geomspace(1e-4, 0.1, 12):
        other = np.clip(path.points + size * waves @ rng.normal(size=(5, task)), model.lower, model.upper)
        other[[0, -1]] = start, target
        assert path_time(model, other) >= path.duration * (1 - 1e-6)


def lattice_time(model, start, target, rows, columns):
    """Return the least time along a lattice in the model's box, with steps of up to three; ends are (row, column)."""
    places = [np.linspace(model.lower[i], model.upper[i], count) for i, count in enumerate((rows, columns))]
    grid = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1).reshape(-1, 2)
    row, column = np.divmod(np.arange(len(grid)), columns)
    edges = []
    for i, j in [(i, j) for i in range(4) for j in range(-3, 4) if np.gcd(i, j) == 1]:
        inside = np.flatnonzero((row + i < rows) & (column + j < columns) & (column + j >= 0))
        edges.append(np.stack([inside, inside + columns * i + j]))
    one, two = np.concatenate(edges, axis=1)
    nodes, weights = np.polynomial.legendre.leggauss(5)
    change = grid[two] - grid[one]
    roots, _ = model.roots(grid[one, None] + (nodes[:, None] + 1) / 2 * change[:, None])
    times = np.linalg.norm(roots @ change[:, None, :, None], axis=(-2, -1)) @ weights / 2
    ways = csr_array((times, (one, two)), shape=(len(grid), len(grid)))
    here, there = np.ravel_multi_index(np.transpose([start, target]), (rows, columns))
    return dijkstra(ways, directed=False, indices=here)[there]


@pytest.mark.parametrize("seed", range(2))
def test_no_path_along_a_lattice_is_faster(seed):
    model = Waves(seed)
    shortest_time = lattice_time(model, (4, 6), (35, 30), 41, 41)
    path = fastest_path(model, [4 / 40, 6 / 40], [35 / 40, 30 / 40])
    assert 0.95 * shortest_time < path.duration < shortest_time * (1 + 1e-6)


@pytest.mark.parametrize(("lowest", "level"), [(-0.5, 100), (0.0, 0)])
def test_the_fastest_path_leaves_a_ridge_for_the_valley_next_to_it(lowest, level):
    """On the ridge, which may be a wall too, the straight way is stationary, and slower than its neighbours."""
    model, ends = Ridge(lowest), ([0.1, 0.0], [0.9, 0.0])
    shortest_time = lattice_time(model, (4, level), (36, level), 41, 101 + level)
    path = fastest_path(model, *ends)
    assert shortest_time < 0.9 * path_time(model, ends)
    assert 0.98 * shortest_time < path.duration < shortest_time
    cuts = np.linspace(0, 100, 100_001)
    fine = np.stack([np.interp(cuts, np.arange(101), column) for column in path.points.T], axis=1)
    roots, _ = model.roots((fine[1:] + fine[:-1]) / 2)
    alone = np.linalg.norm(np.einsum("nij,nj->ni", roots, np.diff(fine, axis=0)), axis=1).sum()
    assert path.duration == pytest.approx(alone, rel=1e-7)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[0.0, 1.0, 2.0]], "points: must have shape"),
        ([[0.0, 1.0], [1.0, 1.0], [0.0, 0.01]], r"points\[2\]: coordinate 1 must be in the model's box"),
    ],
)
def test_a_path_that_cannot_be_timed_is_refused_by_name(points, message):
    with pytest.raises(InvalidInput, match=message):
        path_time(HalfPlane(), points)


@pytest.mark.parametrize(("model", "ends"), [(HalfPlane(), ([-1.0, 1.0], [1.0, 1.0])), (Ridge(), ([0.1, 0], [0.9, 0]))])
def test_what_does_not_converge_says_so(monkeypatch, model, ends):
    monkeypatch.setattr(module, "OPTIONS", module.GeodesicOptions(iterations=1))
    with pytest.raises(SolverFailed, match="fastest_path must reach an optimum within 1 iterations, got none"):
        fastest_path(model, *ends)


# Models of speeds along paths: times of pieces to first order, boxes, and refusals.


def path_in(model, count, seed=0):
    rng = np.random.default_rng(seed)
    return model.lower + rng.uniform(0.2, 0.8, size=(count, len(model.lower))) * (model.upper - model.lower)


@pytest.mark.parametrize(("size", "share"), [(2, 0.8), (3, 0.0)])
def test_pieces_are_the_models_and_their_derivatives_those_of_differences(size, share):
    model = field(size)
    points = path_in(model, 6)
    pieces = linearise_pieces(model, points, share)
    change = np.diff(points, axis=0)
    roots = model.roots(points[:-1] + share * change)[0]
    np.testing.assert_allclose(pieces.values, np.einsum("lij,lj->li", roots, change), rtol=1e-13)
    step = 1e-6
    for axis in range(size):
        ahead, behind = (linearise_pieces(model, points + sign * step * np.eye(size)[axis], share) for sign in (1, -1))
        together = (ahead.values - behind.values) / (2 * step)  # all points move: the sum of both derivatives
        np.testing.assert_allclose((pieces.before + pieces.after)[..., axis], together, atol=1e-6)
        for k in range(len(points)):
            moved = points.copy()
            moved[k, axis] += step
            slope = (linearise_pieces(model, moved, share).values - pieces.values) / step
            expected = np.zeros_like(slope)
            if k < len(slope):
                expected[k] = pieces.before[k, :, axis]
            if k:
                expected[k - 1] = pieces.after[k - 1, :, axis]
            np.testing.assert_allclose(slope, expected, atol=1e-3)
