"""First-order models of compiled kernels agree with linearisations in any basis."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.nlp.parametric_qp.local_model import first_order
from paretoik.trajectory.plan_starts import sample_starts
from paretoik.trajectory.transcription import motion_program
from tests.pareto.sketches import ellipses, placed, sketched

LINE = pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=21)
CIRCLE = pk.circle((0.3, 0.05), 0.05, duration=1.0, samples=21)


def tracking(path=LINE, **settings):
    limits = pk.Limits(position=np.deg2rad([90, 120, 120]), velocity=3.8, torque=0.5)
    objectives = [pk.kinetic_energy, pk.torque_norm]
    return pk.Tracking(pk.arms.tringali_3r(), path, objectives=objectives, limits=limits, bases=1, **settings).task


TASKS = {
    "differences": {"differences": "backward"},
    "spline": {"differences": "spline"},
    "at rest": {"differences": "backward", "end_velocity": 0},
    "cycle": {"path": CIRCLE, "cyclic": True, "differences": "backward"},
}


def assert_same(program, x):
    objectives, gradients, slacks, columns, entries, regular = first_order(program.kernel, x, len(program.upper))
    at, rows = program.linearise(x), np.zeros((len(slacks), gradients.shape[1]))
    np.add.at(rows, (np.arange(len(slacks))[:, None], columns), entries)
    assert regular
    assert objectives == pytest.approx(at.objectives, rel=1e-12)
    assert slacks == pytest.approx(at.inequalities, abs=1e-12)
    ours, theirs = np.concatenate([gradients, rows]), np.concatenate([at.gradients, at.jacobian.toarray()])
    assert ours @ ours.T == pytest.approx(theirs @ theirs.T, rel=1e-9, abs=1e-9 * float(np.abs(theirs).max()) ** 2)


@pytest.mark.parametrize("name", TASKS)
def test_a_motion_has_the_derivatives_of_its_linearisation(name):
    task = tracking(**TASKS[name])
    program = motion_program(task, np.ones(2))
    assert_same(program, sample_starts(task, 1, np.random.default_rng(0))[0].copy())


def test_a_dense_program_has_the_derivatives_of_its_linearisation():
    program = sketched(3, ellipses, within=lambda x: ([x[0] + x[1] * x[2] - 1.0], [1.0 - x[0] ** 2, x[2]]))
    assert_same(program, placed(ellipses, [0.5, 1.0, 0.5])[0])
