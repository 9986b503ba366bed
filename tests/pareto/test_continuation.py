"""Optima followed along the known front of two ellipses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

import paretoik as pk
from paretoik.nlp.minimise import minimise
from paretoik.pareto import continuation
from paretoik.pareto.continuation import follow, guess_optimum, predict
from paretoik.pareto.navigation import Aim, Wish
from paretoik.trajectory.plan_starts import sample_starts
from paretoik.trajectory.transcription import motion_program
from tests.pareto.sketches import ellipses, ellipses_best, placed, sketched

PROGRAM = sketched(2, ellipses)
RANGES = np.array([1.75, 22.5])


def start(share):
    return placed(ellipses, ellipses_best(share))[0]


def aim(share, by, *, improve=0, ranges=RANGES):
    """Return the aim from the point with ``share`` of the first ellipse's weight."""
    weights = np.array([share, 1 - share]) * ranges
    return Aim(
        wish=Wish(improve=improve, payers=(1 - improve,), by=by),
        ranges=ranges,
        start=np.array(ellipses(ellipses_best(share))),
        weights=weights / weights.sum(),
        objectives=2,
    )


def followed(program, share, wish):
    optimum = guess_optimum(program, start(share), wish.at_share(0.0))
    return optimum, follow(program, optimum, wish.at_share)


@pytest.mark.parametrize("share", [0.3, 0.9])
@pytest.mark.parametrize("improve", [0, 1])
def test_a_point_of_the_front_is_the_optimum_of_its_own_goal(share, improve):
    wish = aim(share, 0.1, improve=improve)
    goal = wish.at_share(0.0)
    optimum = guess_optimum(PROGRAM, start(share), goal)
    at, (limits, bounds) = PROGRAM.linearise(optimum.x), np.split(optimum.multipliers, [-len(goal.rows)])
    gradient = (goal.weights + bounds @ goal.rows) @ at.gradients - at.jacobian.T @ limits
    assert gradient == pytest.approx(np.zeros(at.columns), abs=1e-8)
    assert optimum.multipliers.min() >= 0.0


@pytest.mark.parametrize(("improve", "by"), [(0, 0.02), (1, 0.1)])
def test_followed_optimum_stays_on_the_front_and_gains_the_wish(improve, by):
    wish = aim(0.95, by, improve=improve)
    _, way = followed(PROGRAM, 0.95, wish)
    values = PROGRAM.evaluate(way.optimum.x)[0]
    assert way.share == 1.0
    assert values[improve] == pytest.approx(wish.start[improve] - by * RANGES[improve], abs=1e-9)
    place = brentq(lambda share: ellipses(ellipses_best(share))[improve] - values[improve], 1e-6, 1 - 1e-6, xtol=1e-14)
    assert values / RANGES == pytest.approx(ellipses(ellipses_best(place)) / RANGES, abs=1e-7)


def test_following_there_and_back_returns_to_the_start():
    wish = aim(0.7, 0.2)
    way = followed(PROGRAM, 0.7, wish)[1]
    back = follow(PROGRAM, way.optimum, lambda share: wish.at_share(1.0 - share))
    assert back.share == 1.0
    assert back.optimum.x == pytest.approx(start(0.7), abs=1e-7)


def test_a_branch_that_ends_is_followed_no_further():
    wish = aim(0.95, 2.0)  # the first ellipse is at 0 at best
    _, way = followed(PROGRAM, 0.95, wish)
    assert way.share < 1.0
    assert 0.0 < PROGRAM.evaluate(way.optimum.x)[0][0] <= wish.start[0]


def papers_arm(**limits):
    """Return a program of the papers' arm, its optimum, and the aim to lower energy by a share of a tenth."""
    path = pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=11)
    objectives = [pk.kinetic_energy, pk.torque_norm]
    task = pk.Tracking(
        pk.arms.tringali_3r(), path, objectives=objectives, limits=pk.Limits(**limits), differences="backward", bases=1
    ).task
    program = motion_program(task, np.ones(2))
    solutions = minimise(program, sample_starts(task, 1, np.random.default_rng(0)), np.array([[1.0, 0.2]]))
    assert solutions.converged.all()
    values, weights = solutions.objectives[0], np.array([1.0, 0.2]) * solutions.objectives[0]

    def move(by):
        return Aim(
            wish=Wish(improve=0, payers=(1,), by=by),
            ranges=values / 10,
            start=values,
            weights=weights / weights.sum(),
            objectives=2,
        )

    return program, solutions.x[0], move


def test_objectives_of_a_prediction_err_by_the_fourth_power_of_the_step():
    program, x, move = papers_arm(velocity=2.8)
    errors = []
    for by in (0.08, 0.04, 0.02):
        begin = guess_optimum(program, x, move(by).at_share(0.0))
        predicted, way = predict(program, begin, move(by).at_share), follow(program, begin, move(by).at_share)
        assert way.share == 1.0
        errors.append(float(np.abs(program.evaluate(predicted)[0] - program.evaluate(way.optimum.x)[0]).max()))
    assert np.log2(errors[0] / errors[1]) >= 3.6
    assert np.log2(errors[1] / errors[2]) >= 3.6


def test_prediction_makes_new_models_on_the_way(monkeypatch):
    wish = aim(0.3, 0.5)
    optimum, way = followed(PROGRAM, 0.3, wish)
    predicted = PROGRAM.evaluate(predict(PROGRAM, optimum, wish.at_share))[0][:2]
    assert way.share == 1.0
    assert predicted == pytest.approx(PROGRAM.evaluate(way.optimum.x)[0][:2], rel=0.01)
    monkeypatch.setattr(continuation, "OPTIONS", replace(continuation.OPTIONS, attempts=1))
    assert predict(PROGRAM, optimum, wish.at_share) is None
