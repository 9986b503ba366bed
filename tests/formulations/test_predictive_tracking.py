"""Laws of searching the rhythm of looking ahead."""

from __future__ import annotations

import re

import numpy as np
import pytest

import paretoik as pk
from paretoik import line
from paretoik.errors import InvalidInput
from paretoik.robot import kinematics
from paretoik.robot.arms import tringali_3r

pytestmark = pytest.mark.usefixtures("unchecked")
START = np.array([0.0, 0.327, -0.754])
FIRST = kinematics.forward_kinematics(tringali_3r(), START)[1][:2]
PATH = line(FIRST, FIRST + np.array([-0.27, 0.11]), duration=5.0, samples=101)


@pytest.fixture(scope="module")
def asked():
    return pk.PredictiveTracking(tringali_3r(), PATH, start=START, starts=8)


def test_what_is_evaluated_is_what_the_motion_is_worth(asked):
    genes = np.random.default_rng(0).uniform(asked.xl, asked.xu, (5, 4))
    F, G = asked.evaluate(genes, return_values_of=["F", "G"])
    methods = asked.method(genes)
    for i in range(5):
        one = pk.methods.PredictiveKineticEnergy(
            horizon=int(methods.horizon[i]),
            prediction_step=float(methods.prediction_step[i]),
            update_interval=float(methods.update_interval[i]),
            terminal=float(methods.terminal[i]),
        )
        motion = pk.resolve(tringali_3r(), PATH, one, start=START, unreachable="track")
        apart = np.sqrt(np.mean(np.sum((motion.q - asked.optimum.q) ** 2, axis=-1)))
        looked = one.horizon * (motion.traces.iterations + 1).mean()
        np.testing.assert_allclose(F[i], [float(pk.kinetic_energy(motion)), looked, apart], rtol=1e-9)
        assert (G[i, 0] <= 0) == (np.abs(motion.traces.errors).max() <= 0.05)


def test_genes_stand_for_whole_samples_within_the_window(asked):
    methods = asked.method(np.random.default_rng(1).uniform(asked.xl, asked.xu, (200, 4)))
    for values in (methods.prediction_step, methods.update_interval):
        np.testing.assert_allclose(values / 0.05, np.round(values / 0.05), atol=1e-9)
    assert set(methods.horizon) == {1, 2, 3, 4, 5, 6}
    assert (methods.horizon * methods.prediction_step <= 2.5 + 1e-9).all()


def test_an_individual_is_worth_the_same_whoever_is_evaluated_with_it(asked):
    genes = np.random.default_rng(3).uniform(asked.xl, asked.xu, (40, 4))
    together = asked.evaluate(genes, return_values_of=["F"])
    alone = np.concatenate([asked.evaluate(one[None], return_values_of=["F"]) for one in genes])
    np.testing.assert_array_equal(together, alone)


def test_no_motion_beats_the_optimum_and_a_front_trades_work_for_energy(asked):
    front = pk.solve(asked, population=12, generations=5, seed=0)
    assert front.names == ("kinetic_energy", "evaluations", "distance")
    least = float(pk.kinetic_energy(asked.optimum))
    assert (front.objectives[:, 0] > 0.999 * least).all()
    assert front.objectives[0, 0] < 1.2 * least
    assert len(front) > 1
    assert front.motions.q.shape[1:] == (101, 3)


def test_what_cannot_be_used_is_refused_by_name(asked):
    with pytest.raises(InvalidInput, match=re.escape("optimum: one motion of shape (101, 3) wanted, got (2, 101, 3)")):
        pk.PredictiveTracking(
            tringali_3r(), PATH, start=START, optimum=asked.task.motion(np.tile(asked.optimum.q, (2, 1, 1)))
        )
    with pytest.raises(InvalidInput, match="objective peak_torque: form 'integral' wanted"):
        pk.PredictiveTracking(tringali_3r(), PATH, start=START, objective=pk.peak_torque)
    short = line(FIRST, FIRST + np.array([-0.02, 0.01]), duration=1.0, samples=5)
    few = pk.PredictiveTracking(tringali_3r(), short, start=START, starts=2)
    assert np.isfinite(few.evaluate(few.xu[None])[0]).all()
    with pytest.raises(InvalidInput, match=r"start is .* off the path"):
        pk.PredictiveTracking(tringali_3r(), PATH, start=START + 0.1)
    for changed, said in (
        ({"start": "free"}, "start: 3 joint positions wanted, got 'free'"),
        ({"optimum": 5}, "optimum: a Motion wanted, got 5"),
        ({"starts": 0}, "starts: an integer of at least 1 wanted, got 0"),
        ({"seed": "x"}, "seed: an integer of at least 0 wanted, got 'x'"),
    ):
        with pytest.raises(InvalidInput, match=re.escape(said)):
            pk.PredictiveTracking(tringali_3r(), PATH, **{"start": START, "starts": 2, **changed})
