"""Peaks and kinks in the interior point: its result is a minimum of the exact functions."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import InteriorPointOptions
from paretoik.pareto.certificates import criticality_at
from paretoik.trajectory.levels import objective_scales
from paretoik.trajectory.plan_starts import sample_starts
from paretoik.trajectory.transcription import motion_program
from problems import tringali_2020
from tests.pareto.motions import certify_motions

WARM = InteriorPointOptions(barrier=1e-4, radius=0.02)


@pk.objective(unit="", form="integral")
def nested(motion):
    first, second, third = (motion.dq[..., joint] for joint in range(3))
    return np.maximum(np.abs(first), np.abs(second + third)) ** 2 - np.minimum(first, third) + motion.kinetic_energy


@pk.objective(unit="", form="peak")
def jolt(motion):
    return np.abs(motion.dq[..., 0]) * (1.0 + np.abs(motion.q[..., 1])) + np.max(np.abs(motion.dq[..., 1:]), axis=-1)


@pk.objective(unit="", form="peak", maximise=True)
def nearest_limit(motion):
    return np.min(np.pi - np.abs(motion.q), axis=-1)


OBJECTIVES = [pk.joint_travel, pk.peak_torque, nested, jolt, nearest_limit]


def task_of(*objectives, samples=26, **settings):
    limits = pk.Limits(position=tringali_2020.POSITION, velocity=tringali_2020.VELOCITY)
    path = tringali_2020.straight(samples)
    settings = {"differences": "backward", **settings}
    return pk.Tracking(pk.arms.tringali_3r(), path, objectives=objectives, limits=limits, bases=1, **settings).task


def solve(task, starts, **settings):
    program = motion_program(task, objective_scales(task, starts))
    count = len(program.totals)
    return program, minimise(program, starts, np.ones((1, count)), **settings)


@pytest.mark.parametrize("objective", OBJECTIVES, ids=lambda objective: objective.name)
def test_an_interior_point_ends_where_nothing_can_be_gained_exactly(objective):
    task = task_of(objective)
    program, solutions = solve(task, sample_starts(task, 6, np.random.default_rng(1)))
    assert program.kernel is not None
    assert solutions.converged.any()
    for x, values in zip(solutions.x[solutions.converged], solutions.objectives[solutions.converged], strict=True):
        assert criticality_at(program, program.linearise(x), np.ones(1)) <= 1e-7
        assert values[0] == program.evaluate(x)[0][0]


@pytest.mark.parametrize("objective", [pk.joint_travel, jolt], ids=lambda objective: objective.name)
def test_both_solvers_end_as_low_from_the_same_optimum(objective):
    task = task_of(objective)
    _, solutions = solve(task, sample_starts(task, 4, np.random.default_rng(1)))
    best = solutions.x[[np.argmin(np.where(solutions.converged, solutions.objectives[:, 0], np.inf))]]
    ours, theirs = (
        solve(task, best, options=WARM._replace(radius=0.01), solver=solver)[1] for solver in ("interior-point", "sqp")
    )
    assert ours.converged.all()
    assert ours.objectives == pytest.approx(theirs.objectives, rel=1e-7)


def test_a_bound_on_what_has_kinks_or_peaks_holds_exactly_and_is_used_up():
    task = task_of(pk.kinetic_energy, pk.joint_travel, pk.peak_torque)
    starts = sample_starts(task, 4, np.random.default_rng(1))
    program, free = solve(task, starts, options=InteriorPointOptions())
    x = free.x[free.converged][:1]
    values = program.evaluate(x[0])[0]
    upper = np.array([[np.inf, values[1], values[2]]])
    bounded = minimise(program, x, np.array([[1.0, 0.0, 0.0]]), upper, WARM)
    assert bounded.converged.all()
    assert (bounded.objectives[0, 1:] <= upper[0, 1:] + 1e-8).all()
    assert bounded.objectives[0, 0] <= values[0] + 1e-9
    assert np.abs(bounded.objectives[0, 1:] - upper[0, 1:]).min() <= 1e-7


def test_kinks_within_kinks_are_minima_with_certificates():
    task = task_of(nested)
    best = solve(task, sample_starts(task, 6, np.random.default_rng(1)))[1]
    best = best[[np.argmin(np.where(best.converged, best.objectives[:, 0], np.inf))]]
    certificate = certify_motions(task, best.x, np.ones(1))
    assert certificate.criticality[0] <= 1e-6
    assert certificate.status[0] == "minimum"


def test_what_has_kinks_is_named():
    program = motion_program(task_of(pk.kinetic_energy, pk.joint_travel, pk.peak_torque, pk.torque_norm))
    assert program.kinked == ("joint_travel", "peak_torque")
    assert motion_program(task_of(pk.kinetic_energy)).kinked == ()
