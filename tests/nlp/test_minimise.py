"""The common entry to the solvers: settings reach the banded and the dense one."""

from __future__ import annotations

import signal
import threading
import time
from functools import cache

import numpy as np
import pytest

import paretoik as pk
from paretoik.nlp.dense.dense_program import DenseProgram
from paretoik.nlp.dense.traced_rows import trace_rows
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import CONVERGED, INTERRUPTED, ITERATION_LIMIT, NOT_FINITE, InteriorPointOptions
from paretoik.stop_flag import STOP, Interrupted
from paretoik.trajectory.transcription import motion_program
from problems.tringali_2020 import simulation_4


def dense():
    """Return the program: minimise x + y² above a parabola, x and y at most 2."""

    def rows(z, parameters):
        return [], [z[2] - z[0] - z[1] * z[1], z[0] - z[1] * z[1] + 1.0, 2.0 - z[0], 2.0 - z[1]]

    return DenseProgram(rows=trace_rows(3, 0, rows).at(), costs=np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]))


def motion():
    return motion_program(simulation_4().task.subsample(11))


def starts(program):
    if isinstance(program, DenseProgram):
        return np.array([[0.5, 0.5, 3.0], [1.0, -1.0, 5.0]])
    return optimum()


@cache
def optimum():
    return pk.plan(simulation_4(), starts=2, seed=0).best.motion.q[None, ::10]


@pytest.mark.parametrize("kind", [dense, motion])
def test_iterations_end_where_they_are_told(kind):
    program = kind()
    x, weights = starts(program), np.ones((1, len(program.upper)))
    few = minimise(program, x, weights, options=InteriorPointOptions(iterations=2))
    assert (few.iterations == 2).all()
    assert (few.status == ITERATION_LIMIT).all()
    assert (minimise(program, x, weights).status == CONVERGED).all()


@pytest.mark.parametrize("kind", [dense, motion])
def test_the_last_barrier_decides_how_near_limits_a_point_ends(kind):
    program = kind()
    x, weights = starts(program)[:1], np.eye(len(program.upper))[:1]
    high, low = (
        minimise(program, x, weights, options=InteriorPointOptions(barrier=1e-2, last_barrier=last, tolerance=1e-6))
        for last in (1e-3, 1e-9)
    )
    assert high.iterations[0] < low.iterations[0]
    assert high.objectives[0, 0] > low.objectives[0, 0]


def test_bounds_on_dense_objectives_hold_and_raise_the_other():
    program = dense()
    weights = np.array([[1.0, 0.0]])
    free = minimise(program, starts(program)[:1], weights)
    upper = np.array([[np.inf, -0.5]])
    bounded = minimise(program, starts(program)[:1], weights, upper)
    assert bounded.status.tolist() == [CONVERGED]
    assert free.objectives[0, 0] == pytest.approx(-1.0, abs=1e-7)
    assert bounded.objectives[0] == pytest.approx([-0.5, -0.5], abs=1e-7)  # x = y² − 1, so that z = 2y² − 1


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_status_tells_why_a_point_failed_and_others_are_solved():
    rows = trace_rows(2, 0, lambda z, parameters: ([z[0] - z[1]], [np.log(z[0])])).at()
    ends = minimise(DenseProgram(rows=rows, costs=np.eye(2)[:1]), np.array([[-1.0, -1.0], [3.0, 3.0]]), np.ones((1, 1)))
    assert ends.status.tolist() == [NOT_FINITE, CONVERGED]
    assert ends.violation[0] == np.inf


def test_unsolvable_equalities_are_reported_with_their_violation():
    rows = trace_rows(2, 0, lambda z, parameters: ([z[0] * z[0] + 1.0], [z[1]])).at()
    end = minimise(DenseProgram(rows=rows, costs=np.eye(2)[1:]), np.array([[0.5, 1.0]]), np.ones((1, 1)))
    assert not end.converged.any()
    assert end.violation[0] == pytest.approx(1.0, abs=1e-6)


@pytest.fixture
def stop():
    """Set the number of a signal; clear it at the end."""
    yield STOP
    STOP[0] = 0


@pytest.mark.parametrize("kind", [dense, motion])
def test_after_a_signal_no_solver_takes_another_step(kind, stop):
    program = kind()
    x, weights = starts(program), np.ones((1, len(program.upper)))
    stop[0] = signal.SIGINT
    with pytest.raises(Interrupted):
        minimise(program, x, weights)


def test_signal_ends_iterations_and_keeps_their_results(stop):
    program = motion()
    x, weights = np.repeat(starts(program), 400, axis=0), np.ones((1, len(program.upper)))
    minimise(program, x[:1], weights)  # compiles first: compilation is no iteration
    begin = time.monotonic()
    minimise(program, x, weights)
    timer = threading.Timer(0.4 * (time.monotonic() - begin), stop.__setitem__, (0, int(signal.SIGINT)))
    timer.start()
    with pytest.raises(Interrupted) as interrupted:
        minimise(program, x, weights)
    solutions = interrupted.value.partial
    assert set(solutions.status) == {CONVERGED, INTERRUPTED}
    assert (solutions.iterations[solutions.status == INTERRUPTED] < 150).all()
