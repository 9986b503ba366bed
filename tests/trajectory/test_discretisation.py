"""Stencils give the rates of a motion's differences, also on cycles, and number the unknowns."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.task.sampling import first_derivative, second_derivative
from paretoik.trajectory.discretisation import stencil
from tests.task.tasks import POSTURE, from_posture, task

ROUND = pk.circle([0.4178, 0.0], 0.05, duration=1.0, samples=31)


@pytest.mark.parametrize("differences", ["backward", "central"])
@pytest.mark.parametrize("cyclic", [False, True])
def test_rates_are_the_differences_of_the_motion(differences, cyclic):
    along = task(ROUND, cyclic=cyclic, differences=differences)
    made = stencil(along, 4)
    q = np.random.default_rng(0).normal(size=(31, 3))
    if cyclic:
        q[-1] = q[0]
    arguments = along.times, differences
    rates = [q, first_derivative(q, *arguments, cyclic=cyclic), second_derivative(q, *arguments, cyclic=cyclic)]
    rates.append(first_derivative(rates[2], *arguments, cyclic=cyclic))
    ours = np.einsum("oik,ikj->oij", made.coefficients, q[made.neighbours])
    for one, other in zip(ours, rates, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9 * np.abs(other).max())


def test_a_start_cannot_move_and_every_other_sample_has_its_unknowns():
    free, fixed = stencil(task(), 3), stencil(task(from_posture(), start=POSTURE), 3)
    np.testing.assert_array_equal(free.first_unknown, np.arange(21))
    np.testing.assert_array_equal(fixed.first_unknown, np.arange(21) - 1)
    assert (free.unknowns, fixed.unknowns) == (21, 20)
    assert free.border == fixed.border == 0


def test_the_last_sample_moves_with_the_first_on_a_cycle_and_with_the_one_before_where_the_motion_stops():
    around, stopping = stencil(task(ROUND, cyclic=True), 3), stencil(task(end_velocity=0.0), 3)
    assert around.first_unknown[-1] == around.first_unknown[0]
    assert around.border == 2 * (around.neighbours.shape[1] - 1)
    assert stopping.first_unknown[-1] == stopping.first_unknown[-2]
    assert (around.unknowns, stopping.unknowns) == (30, 20)
