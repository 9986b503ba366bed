"""Workers that refine points or minimise levels of ε ahead do not change the results."""

from __future__ import annotations

from contextlib import closing

import numpy as np
import pytest

from paretoik.pareto.refine import refine
from paretoik.pareto.sweep import Level, Sweep
from paretoik.runs.distribution import distributing
from paretoik.runs.processes import WorkerProcesses
from tests.pareto.sketches import ellipses, placed, scaled, sketched

PROGRAM = scaled(sketched(2, ellipses), [2.0, 25.0])
POINTS = placed(ellipses, np.random.default_rng(4).normal(scale=0.5, size=(9, 2)))

pytestmark = pytest.mark.filterwarnings("ignore:workers save no time")


@pytest.fixture(scope="module")
def executor():
    with closing(WorkerProcesses(2)) as opened:
        yield opened


def test_workers_refine_points_to_the_same_bit_for_bit(executor):
    alone, converged = refine(PROGRAM, POINTS, 2)
    with distributing(executor):
        points, also_converged = refine(PROGRAM, POINTS, 2)
    assert np.array_equal(points, alone)
    assert np.array_equal(also_converged, converged)
    assert not np.array_equal(alone, POINTS)


def sweep() -> Sweep:
    none = np.zeros((0, 2))
    points = {"x": np.zeros((0, *POINTS.shape[1:])), "objectives": none, "weights": none, "points": 5}
    return Sweep(program=PROGRAM, n_obj=2, **points, solver="auto", observe=None, ranges=np.ones(2))


def levels() -> list[Level]:
    F = POINTS @ PROGRAM.costs.T
    return [Level(POINTS[i], i % 2, np.where(np.arange(2) == i % 2, np.inf, F[i])) for i in range(5)]


def test_levels_that_workers_minimised_ahead_come_to_the_same_bit_for_bit(executor):
    alone = sweep()
    ahead = sweep()
    with distributing(executor):
        ahead.look_ahead(levels())
    assert len(ahead.ahead) == 5
    for level in levels():
        one, other = alone.solve([level]), ahead.solve([level])
        assert one.converged.all()
        for name, values in vars(one).items():
            assert np.array_equal(values, getattr(other, name), equal_nan=True), name
    assert not alone.ahead


def test_nothing_is_done_ahead_without_workers_nor_before_the_first_level_is_due(executor):
    ahead = sweep()
    ahead.look_ahead(levels())
    assert not ahead.ahead
    with distributing(executor):
        ahead.look_ahead(levels()[:2])
        ahead.look_ahead(levels())
    assert len(ahead.ahead) == 2
