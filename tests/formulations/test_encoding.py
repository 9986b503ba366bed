"""Genes and motions: encoding and decoding, one gene's support, starts, stops and cycles."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik import Tracking, circle, line
from paretoik.robot.arms import tringali_3r
from tests.formulations.problems import PROBLEMS, SMALL, built

every_problem = pytest.mark.parametrize("name", PROBLEMS)


def genes_of(problem, count, seed=0):
    return np.random.default_rng(seed).uniform(problem.xl, problem.xu, (count, problem.n_var))


def around_a_circle(samples=41, timing="raised-cosine", **settings):
    path = circle([0.4178, 0.0], 0.05, duration=1.0, samples=samples, timing=timing)
    chosen = {**SMALL, "coefficients": 6, "differences": "central", **settings}
    return Tracking(tringali_3r(), path, cyclic=True, **chosen)


def along_a_line(samples=41, **settings):
    path = line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=samples)
    return Tracking(tringali_3r(), path, **{**SMALL, **settings})


@every_problem
def test_encoding_a_decoded_motion_gives_its_genes_back(name):
    problem = built(name)
    genes = genes_of(problem, 30)
    on_path = problem.encoding.decode(problem.task, genes)[1].all(axis=1)
    encoded, residual = problem.encode(problem.decode(genes[on_path]))
    assert on_path.sum() > 15
    np.testing.assert_allclose(encoded[:, 1:], genes[on_path, 1:], atol=1e-9)
    np.testing.assert_array_equal(problem.species(encoded), problem.species(genes[on_path]))
    assert residual.max() < 1e-9
    np.testing.assert_allclose(problem.decode(encoded).q, problem.decode(genes[on_path]).q, atol=1e-9)


@pytest.mark.parametrize("settings", [{}, {"start": True}, {"end_velocity": 0}], ids=["free", "start", "stop"])
def test_a_gene_moves_only_the_support_of_its_spline(settings):
    problem = along_a_line(samples=81, coefficients=12, bases=2)
    if settings.get("start"):
        settings = {"start": problem.decode(genes_of(problem, 1)).q[0, 0]}
    problem = along_a_line(samples=81, coefficients=12, bases=2, **settings)
    end_conditions = len(settings)
    knots = np.linspace(0, 1, 12 + end_conditions - 2)
    genes = genes_of(problem, 1, seed=4) * np.r_[1, np.full(12, 0.5)]
    before = problem.decode(genes).q[0]
    for gene in range(12):
        changed = genes.copy()
        changed[0, 1 + gene] += 0.2
        moved = np.flatnonzero((problem.decode(changed).q[0] != before).any(axis=1))
        first = gene + ("start" in settings) - 3
        last = 12 + end_conditions - 1 if "end_velocity" in settings and gene == 11 else first + 4
        low, high = knots[max(first, 0)], knots[min(last, len(knots) - 1)]
        times = problem.task.times[moved]
        assert len(moved) > 3
        assert low - 1e-12 <= times[0]
        assert times[-1] <= high + 1e-12


@pytest.mark.parametrize("settings", [{}, {"end_velocity": 0}, {"cyclic": True}], ids=["free", "stop", "cycle"])
def test_coordinates_are_a_c2_cubic_of_time(settings):
    problem = around_a_circle(161) if "cyclic" in settings else along_a_line(161, coefficients=6, **settings)
    basis = problem.encoding.spline
    t = problem.task.times
    assert basis.shape == (161, problem.encoding.coefficients)
    assert np.linalg.matrix_rank(basis) == basis.shape[1]
    third = np.diff(basis, n=3, axis=0) / (t[1] - t[0]) ** 3
    second = np.diff(basis, n=2, axis=0) / (t[1] - t[0]) ** 2
    assert np.abs(np.diff(second, axis=0)).max() <= 1.001 * np.abs(third).max() * (t[1] - t[0])
    assert np.abs(second).max() < 20 * basis.shape[1] ** 2


def test_genes_within_bounds_are_a_partition_of_the_radius():
    for problem in (along_a_line(), around_a_circle()):
        np.testing.assert_allclose(problem.encoding.spline.sum(axis=1), 1.0, atol=1e-12)
        assert problem.encoding.spline.min() >= -1e-15


def test_a_given_start_is_kept_to_the_bit():
    start = built("planar 3R").decode(genes_of(built("planar 3R"), 1)).q[0, 0]
    problem = along_a_line(start=start)
    genes = genes_of(problem, 50)
    np.testing.assert_array_equal(problem.decode(genes).q[:, 0], np.tile(start, (50, 1)))
    assert np.ptp(problem.decode(genes).q[:, -1], axis=0).max() > 0.1


def test_a_stop_brings_the_arm_to_rest_as_the_samples_grow_finer():
    speeds = []
    for samples in (26, 101):
        problem = along_a_line(samples, end_velocity=0, coefficients=6)
        speeds.append(np.abs(problem.decode(genes_of(problem, 100)).dq[:, -1]).max())
    moving = along_a_line(101, coefficients=6)
    assert speeds[1] < 0.35 * speeds[0]
    assert speeds[1] < 0.2 * np.abs(moving.decode(genes_of(moving, 100)).dq[:, -1]).max()


@pytest.mark.parametrize("timing", ["raised-cosine", "uniform"])
def test_cycles_close_to_the_bit_without_a_kink(timing):
    seams = []
    for samples in (41, 161):
        problem = around_a_circle(samples, timing)
        genes = genes_of(problem, 100)
        q, on_path = problem.encoding.decode(problem.task, genes)
        motions = problem.task.motion(q[on_path.all(axis=1)])
        np.testing.assert_array_equal(motions.q[:, 0], motions.q[:, -1])
        np.testing.assert_array_equal(motions.dq[:, 0], motions.dq[:, -1])
        seams.append(np.abs(motions.ddq[:, 0]).max())
        assert len(motions) > 50
        assert seams[-1] < 3 * np.abs(motions.ddq[:, 1:-1]).max()
    assert seams[1] < 1.5 * seams[0]  # a kink would grow with the number of samples
