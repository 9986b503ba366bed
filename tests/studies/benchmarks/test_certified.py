"""Tests of certified fronts: an honest front passes, one that was tampered with is detected."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import jaxtyping
import numpy as np
import pytest

import paretoik as pk
from paretoik.task.motion_task import SAMPLES
from problems import tringali_2020
from studies.benchmarks.certified.attacks import (
    DOMINATED,
    exchange_rows,
    ipopt_rows,
    objectives,
    perturbation_rows,
    random_step,
    within,
)
from studies.benchmarks.certified.cases import Case, recomputed_difference, subject_of
from studies.benchmarks.peers import solvers
from studies.benchmarks.peers.programs import spline_program
from studies.reporting import LOSS
from tests.pareto.motions import certify_motions


def small():
    limits = pk.Limits(position=tringali_2020.POSITION, velocity=tringali_2020.VELOCITY)
    both = [pk.kinetic_energy, pk.torque_norm]
    return pk.Tracking(
        pk.arms.tringali_3r(), tringali_2020.straight(26), objectives=both, limits=limits, differences="backward"
    )


SMALL = Case(name="small", make=small, points=4, raced=True)


@pytest.fixture(scope="module")
def subject(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(solvers, "COMPILER", None)
        patch.setattr(jaxtyping.config, "jaxtyping_disable", True)
        return subject_of(SMALL, points=SMALL.points, seed=0, folder=tmp_path_factory.mktemp("none"))


def point_of(subject, q):
    """Return a subject with only this motion on its front, certified; ranges are those of the whole front."""
    F = np.array([[float(one(subject.task.motion(q))) for one in subject.task.objectives]])
    said = certify_motions(subject.task, q[None], subject.ranges)
    front = pk.Front(
        ids=np.zeros(1, dtype=int),
        objectives=F,
        names=subject.front.names,
        units=subject.front.units,
        maximised=subject.front.maximised,
        motions=subject.task.motion(q[None]),
        certificates=said,
    )
    return replace(subject, front=front)


@pytest.fixture(scope="module")
def middle(subject):
    return len(subject.q) // 2


@pytest.fixture(scope="module")
def honest(subject, middle):
    return point_of(subject, subject.q[middle])


@pytest.fixture(scope="module")
def spoiled(subject, middle):
    """Return the same point, moved along the self-motion by a hundredth of a radian."""
    at = subject.program.linearise(subject.q[middle])
    steps = within(at, random_step(at, 1e-2, np.random.default_rng(1)), level=False)
    assert steps is not None
    return point_of(subject, steps)


def test_an_honest_point_is_dominated_neither_by_ipopt_nor_by_random_steps(honest):
    for row in (*ipopt_rows(honest, barriers=("low", "high")), *perturbation_rows(honest, steps=100, seed=0)):
        assert row.ours <= DOMINATED
        assert not row.note.startswith(LOSS)


def test_a_point_that_was_moved_along_the_self_motion_is_dominated_by_both(spoiled):
    for row in (*ipopt_rows(spoiled, barriers=("low",)), *perturbation_rows(spoiled, steps=100, seed=0)):
        assert row.ours > 100 * DOMINATED
        assert row.note.startswith(LOSS)
        assert "1 points beaten, most: point 0" in row.note


def test_exchange_rates_agree_with_differences_and_wrong_ones_are_lost(subject):
    (row,) = exchange_rows(subject)
    assert row.ours < 1e-5
    assert not row.note.startswith(LOSS)
    certificates = subject.certificates
    wrong = replace(
        certificates,
        exchange_rates=1.01 * certificates.exchange_rates,
        exchange_intervals=1.01 * certificates.exchange_intervals,
    )
    (row,) = exchange_rows(replace(subject, front=replace(subject.front, certificates=wrong)))
    assert row.ours == pytest.approx(0.01, rel=0.05)
    assert row.note.startswith(LOSS)


def test_ipopts_program_by_splines_ends_where_ours_does_below_a_peak_too(monkeypatch):
    monkeypatch.setattr(import_module("paretoik.trajectory.levels"), "SAMPLES", replace(SAMPLES, doublings=0))
    limits = pk.Limits(position=tringali_2020.POSITION, velocity=tringali_2020.VELOCITY)
    both = [pk.kinetic_energy, pk.peak_torque]
    problem = pk.Tracking(pk.arms.tringali_3r(), tringali_2020.straight(26), objectives=both, limits=limits)
    front = pk.epsilon_front(problem, points=3, starts=6, seed=0)
    ranges = np.ptp(front.minimised, axis=0)
    peer = spline_program(problem.task)
    for q, values in zip(front.motions.q[:2], front.minimised[:2], strict=True):  # the last one is an end, and flat
        end = peer.solve(q, 0, np.array([np.inf, values[1]]), ranges, solvers.WARM).motion
        assert end is not None
        rise = (objectives(problem.task, end) - values) / ranges
        assert -2e-4 <= rise[0] <= 2e-6  # ours stay 2.5e-5 of a range within limits, IPOPT's reach them
        assert rise[1] <= 1e-6


def test_pinocchio_recomputes_values_and_sees_those_that_are_wrong(subject):
    task, q, values, ranges = subject.task, subject.q, subject.values, subject.ranges
    assert recomputed_difference(task, q, values, ranges) <= 1e-9
    assert recomputed_difference(task, q, values * 1.001, ranges) > 1e-4
