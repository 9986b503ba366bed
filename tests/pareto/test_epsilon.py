"""Known fronts of small smooth programs, and fronts of ways and postures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import paretoik as pk
from paretoik.pareto import epsilon
from paretoik.pareto.scalarisation import minimise_weighted
from tests.pareto.sketches import scaled, sketched, swept


def apart(x, place):
    return (x[0] - place[0]) ** 2 + (x[1] - place[1]) ** 2


def two_places(limit):
    """Return squared distances to (0, 0) and (1, 0); the second coordinate is at least a limit."""
    return sketched(2, lambda x: [apart(x, (0.0, 0.0)), apart(x, (1.0, 0.0))], lambda x: ([], [x[1] - limit]))


def starts(program, count, seed=0, size=2.0):
    return size * np.random.default_rng(seed).normal(size=(count, program.costs.shape[1]))


@pytest.mark.parametrize("limit", [-1.0, 0.3])
def test_between_two_places_the_front_is_the_line_that_joins_them(limit):
    program, seen = two_places(limit), []
    z, ranges = swept(program, starts(program, 3), points=9, observe=seen.append)
    values, height = z @ program.costs.T, max(limit, 0.0)
    along = np.sqrt(values[:, 0] - height**2)
    assert values[:, 1] == pytest.approx((1 - along) ** 2 + height**2, abs=1e-6)
    assert ranges == pytest.approx([1.0, 1.0], abs=2e-2)
    assert len(z) == 9
    assert values.min(axis=0) == pytest.approx([height**2] * 2, abs=1e-5)  # an end gives way by 1e-6 of the ranges
    assert z[:, 1] == pytest.approx(np.full(9, height), abs=1e-3)
    assert np.linalg.norm(np.diff(values[np.argsort(values[:, 0])], axis=0), axis=1).max() <= 0.4
    done = [progress.done for progress in seen]
    assert done == sorted(done)
    assert done[-1] >= 9
    assert {progress.total for progress in seen} == {9}


def test_a_sweep_shows_its_levels_and_what_lies_below_them_in_the_objectives_own_size():
    program, seen = two_places(0.3), []
    z, _ = swept(program, starts(program, 3), points=9, observe=seen.append)
    values, last = z @ program.costs.T, seen[-1]
    front = last.objectives[last.front]
    assert all((np.abs(front - value).max(axis=1) < 1e-12).any() for value in values)
    levels = [progress for progress in seen if progress.epsilon is not None]
    assert len({progress.epsilon.tobytes() for progress in levels}) >= 7
    for progress in levels:
        (bounded,) = np.flatnonzero(np.isfinite(progress.epsilon))
        bound = progress.epsilon[bounded]
        assert values[:, bounded].min() <= bound <= values[:, bounded].max()
        assert np.abs(front[:, bounded] - bound).min() < 0.2


def test_a_front_that_is_bent_in_is_found_whole():
    """Fonseca & Fleming 1995: both coordinates are equal, between −1/√2 and 1/√2; sums of weights find the ends."""
    size = 1e3

    def both(x):
        ahead = sum((one - 1 / np.sqrt(2)) ** 2 for one in x)
        behind = sum((one + 1 / np.sqrt(2)) ** 2 for one in x)
        return [size * (1 - np.exp(-ahead)), 1 - np.exp(-behind)]

    program = sketched(2, both, lambda x: ([], [*(4 - one for one in x), *(4 + one for one in x)]))
    begun = np.random.default_rng(1).uniform(-0.9, 0.9, (4, 4))
    z, _ = swept(program, begun, points=11)
    values = z @ program.costs.T / [size, 1.0]
    root = np.sqrt(-np.log1p(-values[:, 0]))
    assert values[:, 1] == pytest.approx(1 - np.exp(-((2 - root) ** 2)), abs=1e-6)
    assert len(z) == 11
    assert values.min(axis=0) == pytest.approx([0.0, 0.0], abs=5e-6)
    assert values.max(axis=0) == pytest.approx([1 - np.exp(-4.0)] * 2, abs=5e-3)
    assert np.linalg.norm(np.diff(values[np.argsort(values[:, 0])], axis=0), axis=1).max() <= 0.35


def test_of_three_objectives_the_front_is_the_triangle_between_their_places():
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.3, 0.8]])
    program = sketched(2, lambda x: [apart(x, one) for one in corners])
    z, ranges = swept(program, starts(program, 1), points=14)
    x, values = z[:, :2], z @ program.costs.T
    assert len(z) == 14
    assert values == pytest.approx(np.sum((x[:, None] - corners) ** 2, axis=2), abs=1e-7)
    share = np.linalg.solve(np.vstack([corners.T, np.ones(3)]), np.vstack([x.T, np.ones(len(x))]))
    assert share.min() >= -2e-3  # inside, or near an edge with the same values within 1e-6
    assert values.min(axis=0) == pytest.approx(np.zeros(3), abs=1e-5)
    assert (share > 0.05).all(axis=0).any()
    gap = np.linalg.norm((values[:, None] - values[None]) / ranges, axis=2) + 9 * np.eye(len(z))
    assert gap.min() > 0.1


def test_a_front_in_pieces_has_points_on_all_of_them_and_on_nothing_else():
    """A falling wave: non-dominated only below all earlier values, from 0 to 0.2 and from 0.64 to 0.87."""

    def wave(x):
        return 1.2 - x - 0.35 * np.sin(3 * np.pi * x)

    program = sketched(1, lambda x: [x[0], wave(x[0])], lambda x: ([], [x[0], 1.0 - x[0]]))
    z, _ = swept(program, np.random.default_rng(0).uniform(0.0, 1.0, (8, 3)), points=12)
    values = z @ program.costs.T
    place = np.linspace(0.0, 1.0, 20001)
    best = np.minimum.accumulate(wave(place))
    assert values[:, 1] == pytest.approx(wave(values[:, 0]), abs=1e-6)
    assert (values[:, 1] <= np.interp(values[:, 0], place, best) + 1e-5).all()
    assert (values[:, 0] < 0.21).sum() >= 4
    assert (values[:, 0] > 0.63).sum() >= 4
    assert values.min(axis=0) == pytest.approx([0.0, best.min()], abs=1e-5)


@pytest.mark.parametrize("factor", [1e-9, 1e9])
def test_one_point_that_is_the_best_of_all_is_a_front_in_any_unit(factor):
    program = sketched(2, lambda x: [apart(x, (0.2, 0.1)), 3.0 + 2.0 * apart(x, (0.2, 0.1))])
    program = scaled(program, (1.0 / factor, 1.0))
    z, _ = swept(program, starts(program, 2), points=5)
    assert z[:, :2] == pytest.approx(np.tile([0.2, 0.1], (len(z), 1)), abs=1e-3)
    assert len(z) == 1


@pytest.mark.parametrize(  # the second: a range of 4e-7 next to 3
    ("distance", "accuracy", "factor"), [(0.5, 1e-6, 1e-9), (6e-4, 1e-2, 1e9)]
)
def test_a_front_is_the_same_in_any_unit(distance, accuracy, factor):
    program = sketched(2, lambda x: [apart(x, (0.0, 0.1)), 3.0 + apart(x, (distance, 0.1))])
    plain, ranges = swept(program, starts(program, 2), points=5)
    z, other = swept(scaled(program, (1.0 / factor, 1.0 / factor)), starts(program, 2), points=5)
    assert len(plain) == 5
    np.testing.assert_allclose(z, plain, rtol=0, atol=accuracy * distance)
    assert other / factor == pytest.approx(ranges, rel=accuracy)


def test_an_end_that_does_not_converge_is_the_objectives_own_optimum(monkeypatch):
    def fails_at_the_first_end(program, x, weights, upper, *rest, **settings):
        solutions = minimise_weighted(program, x, weights, upper, *rest, **settings)
        if upper is None:
            solutions = replace(solutions, status=np.where(np.arange(len(x)) == 0, 1, solutions.status))
        return solutions

    monkeypatch.setattr(epsilon, "minimise_weighted", fails_at_the_first_end)
    program = two_places(-1.0)
    z, _ = swept(program, starts(program, 3), points=5)
    values = z @ program.costs.T
    assert len(z) == 5
    assert values.min(axis=0) == pytest.approx([0.0, 0.0], abs=1e-4)  # the own optimum, in a flat valley


DRIVES = {"motors": (pk.capability.kim_joint_motors, 9, 4), "sliders": (pk.capability.kim_sliders, 7, 3)}


@pytest.fixture(scope="module", params=["motors", pytest.param("sliders", marks=pytest.mark.slow)])
def way(request):
    actuation, samples, points = DRIVES[request.param]
    ends = (0.1, -0.15), (0.2, -0.15)
    problem = pk.PointToPoint(pk.arms.kim_3r(), actuation(), *ends, samples=samples, coefficients=5)
    return problem, points, pk.epsilon_front(problem, points=points, starts=4)


def test_ways_of_the_front_are_certified_minima(way):
    problem, points, front = way
    certificates = front.certificates
    assert 2 <= len(front) <= points
    assert certificates.criticality.max() <= 1e-6
    assert certificates.violation.max() <= 1e-8
    for status, reason in zip(certificates.status, certificates.reason, strict=True):
        assert (
            status == "minimum" or "which has no weight" in reason
        )  # an end's curvature is rounding: the valley is flat
    assert problem.timing(np.array(front.genes)).duration == pytest.approx(front.objectives[:, 0], rel=1e-6)
    better = np.all(front.minimised[:, None] <= front.minimised[None], axis=2) & ~np.eye(len(front), dtype=bool)
    assert not better.any()


def test_ends_of_a_way_front_are_no_worse_than_search_with_refinement(way):
    problem, _, front = way
    polished = pk.refine(pk.solve(problem, population=24, generations=12, seed=0, points=3))
    assert (front.minimised.min(axis=0) <= polished.minimised.min(axis=0) * (1 + 1e-5)).all()
