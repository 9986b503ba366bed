"""The completed front of a search has the planner's end points and points in gaps; no refined point is lost."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import paretoik as pk
from paretoik.api.refine import refine_front
from paretoik.api.session import RunRequest, open_session
from paretoik.errors import Infeasible, SolverFailed
from paretoik.front.hypervolume import hypervolume, ranges_of
from paretoik.pareto.refined_front import Completion
from paretoik.stop_flag import STOP
from tests.api.problems import tracking

SEARCH = {"population": 24, "generations": 10, "seed": 1, "points": 8, "observe": False}
FIRST_ID = 10_000
MORE, STARTS = 12, 8  # points of a front with room for new ones; starts per objective
TOLERANCE = 2e-6  # of a range: end points may lose 1e-6 of it in favour of other objectives


def three():
    return tracking(pk.kinetic_energy, pk.torque_norm, pk.joint_limit_distance, position=3.0)


def walk():
    """A program in which one objective leaves the other unbounded."""
    arm, motors = pk.arms.kim_3r(), pk.capability.kim_joint_motors()
    return pk.PointToPoint(arm, motors, (0.1, -0.15), (0.2, -0.15), samples=9, coefficients=5, bases=4)


def directions():
    arm, motors = pk.arms.kim_3r(), pk.capability.kim_joint_motors()
    return pk.DirectionalMaxima(arm, motors, (0.1, -0.15), [[1, 0], [0, 1]], power=False)


MADE = [tracking, three, walk, directions]


@cache
def searched(made):
    return pk.solve(made(), **SEARCH)


@cache
def refined(made):
    return pk.refine(searched(made), observe=False)


@cache
def completed(made, points):
    """Return the completed front, and the stages that its progress showed, each with those that follow."""
    stages = list[tuple[str, str]]()
    front = complete(searched(made), points, lambda progress: stages.append((progress.stage, progress.then)))
    return front, stages


def complete(front, points, observe=None):
    completion = Completion(points=points, seed=0, first_id=FIRST_ID, starts=STARTS)
    request = RunRequest(verb="solve", problem=front.problem, settings={}, observe=observe)
    with open_session(request) as session:
        done = refine_front(front, front.problem, solver="auto", observe=session.observe, completion=completion)
        return replace(done, provenance={**done.provenance, "status": session.stopped_by})


def lost(before, after):
    """Return the ids of former points that are missing and that no new point is at least as good as."""
    shares = (after.minimised[None] - before.minimised[:, None]) / ranges_of(before.minimised)
    return before.ids[~(shares <= TOLERANCE).all(axis=2).any(axis=1)].tolist()


def assert_ids(before, after):
    """Points that stay keep their id, others have new ones, all distinct; of two equal points one is left."""
    assert len(set(after.ids.tolist())) == len(after)
    tolerance = TOLERANCE * ranges_of(before.minimised)
    stays = (np.abs(after.minimised[:, None] - before.minimised) <= tolerance).all(axis=2).any(axis=1)
    assert np.array_equal(stays, after.ids < FIRST_ID)
    for value, number in zip(before.minimised, before.ids, strict=True):
        assert (np.abs(after.minimised[after.ids == number] - value) <= tolerance).all()


@pytest.mark.parametrize("made", [tracking, three])
def test_the_best_of_every_objective_is_no_worse_than_the_planners(made):
    front = completed(made, 8)[0]
    ranges = ranges_of(front.minimised)
    objectives = (pk.kinetic_energy, pk.torque_norm)
    limits = {} if made is tracking else {"position": 3.0}
    for k, objective in enumerate(objectives):
        best = pk.plan(tracking(objective, **limits), starts=STARTS, seed=0, observe=False).best.objective
        assert front.minimised[:, k].min() <= best + TOLERANCE * ranges[k]


@pytest.mark.parametrize("made", [walk, directions])
def test_the_end_points_are_those_of_an_epsilon_front(made):
    ends = pk.epsilon_front(made(), points=2, starts=STARTS, observe=False).minimised
    front = completed(made, 8)[0].minimised
    assert ((front.min(axis=0) - ends.min(axis=0)) / np.ptp(ends, axis=0) <= TOLERANCE).all()
    assert np.ptp(front, axis=0) == pytest.approx(np.ptp(ends, axis=0), rel=1e-2)


@pytest.mark.parametrize("made", MADE)
def test_a_refined_point_is_lost_only_if_there_are_more_than_asked_for(made):
    front = completed(made, MORE)[0]
    assert lost(refined(made), front) == [] or len(front) == MORE
    assert_ids(refined(made), front)
    assert set(refined(made).ids) & set(front.ids)
    assert (front.ids >= FIRST_ID).any()


@pytest.mark.parametrize("made", MADE)
def test_there_are_no_more_points_than_asked_for_and_all_are_certified(made):
    front = completed(made, 8)[0]
    assert len(front) == 8
    assert_ids(refined(made), front)
    assert (front.certificates.status == "minimum").all()


@pytest.mark.parametrize("made", [tracking, walk, directions])
def test_at_equal_numbers_of_points_the_front_gains_hypervolume(made):
    one = refined(made).minimised
    for points in (len(one), MORE):
        other = completed(made, points)[0].minimised
        corner = np.maximum(one.max(axis=0), other.max(axis=0)) + 0.1 * np.ptp(other, axis=0)
        assert len(other) <= points
        assert hypervolume(other, corner) > hypervolume(one, corner)


@pytest.mark.parametrize("stage", ["refinement", "optimum", "point"])
@pytest.mark.parametrize("made", MADE)
def test_a_signal_keeps_all_that_was_refined(made, stage):
    stages = list[str]()

    def interrupt(progress):
        stages.append(progress.stage)
        if progress.stage == stage and not STOP[0]:
            os.kill(os.getpid(), signal.SIGINT)

    front = complete(searched(made), MORE, interrupt)
    assert front.provenance["status"] == "SIGINT"
    assert stage in stages
    assert lost(searched(made) if stage == "refinement" else refined(made), front) == []
    assert len(set(front.ids.tolist())) == len(front)
    if stage == "refinement":
        assert "optimum" not in stages
        assert set(front.ids) <= set(searched(made).ids)


@pytest.mark.parametrize("fault", [Infeasible("none"), SolverFailed("none")])
def test_the_refined_points_stay_if_the_planner_finds_nothing(fault, monkeypatch):
    def fail(*_, **__):
        raise fault

    monkeypatch.setattr(pk.Tracking, "cold_search", fail)
    assert np.array_equal(complete(searched(tracking), MORE).objectives, refined(tracking).objectives)


def test_one_objective_is_refined_and_no_more():
    front = pk.solve(tracking(pk.kinetic_energy), **SEARCH)
    again = complete(front, MORE)
    assert np.array_equal(again.objectives, pk.refine(front, observe=False).objectives)
    assert np.array_equal(again.ids, front.ids)


def test_an_initial_end_leaves_the_other_objectives_finite():
    cold = pk.epsilon_front(walk(), points=3, starts=4, observe=False).minimised
    warm = pk.epsilon_front(walk(), points=3, starts=4, initial=searched(walk), observe=False).minimised
    assert len(warm) == 3
    assert warm.max(axis=0) == pytest.approx(cold.max(axis=0), rel=1e-2)


def test_the_planner_comes_after_refining():
    stages = completed(tracking, 8)[1]
    order = list(dict.fromkeys(stage for stage, _ in stages if stage != "compilation"))
    assert order[:3] == ["refinement", "optimum", "point"]
    assert order[-1] == "certification"
    assert {then for stage, then in stages if stage == "refinement"} == {"optimum"}


def test_a_time_limit_is_that_of_search_and_refinement_together():
    """An endless search leaves half of its time; refinement returns its results so far, as after a signal."""
    endless = {**SEARCH, "generations": 10**6, "stagnation": False, "points": None}
    front = pk.solve(tracking(), **endless, refine=True, time_limit=4.0)
    assert front.provenance["status"] == "time limit"
    assert front.certificates is not None
    assert front.provenance["counts"]["seconds"] < 60.0  # far more than the limit, and than a loaded machine adds


def test_part_of_a_time_limit_is_left_for_certificates():
    pk.epsilon_front(tracking(), points=2, observe=False)  # compiles, which takes longer than the limit
    front = pk.epsilon_front(tracking(), points=10**4, time_limit=5.0, observe=False)
    assert front.provenance["status"] == "time limit"
    assert "minimum" in front.certificates.status
