"""Motions to start from: better ones first, every branch, and what a user's functions cannot value."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import InvalidInput
from paretoik.formulations.tracking import choose_bases, positions_on_path, sample_rollouts
from paretoik.task.motion_task import evaluate_motions
from paretoik.task.self_motion import branch_labels
from tests.task.tasks import ARM, task

LIMITED = task(limits=pk.Limits(velocity=2.0), objectives=[pk.kinetic_energy, pk.joint_travel])


@pytest.fixture(scope="module")
def rollouts():
    return sample_rollouts(LIMITED, np.random.default_rng(0))


def test_those_that_violate_limits_less_come_first_then_those_that_fewer_are_as_good_as(rollouts):
    F, limits, causes = evaluate_motions(LIMITED, LIMITED.motion(rollouts))
    violation = np.maximum(limits, 0.0).sum(axis=1).round(6)
    assert (np.diff(violation) >= 0).all()
    assert violation[0] < violation[-1]
    rank = (F[None] <= F[:, None]).all(axis=2).sum(axis=1)
    assert (np.diff(rank)[np.diff(violation) == 0] >= 0).all()
    assert not any(causes)


@pytest.mark.parametrize("count", [1, 3, 12])
def test_the_first_of_every_branch_is_chosen_and_none_twice(rollouts, count):
    bases = choose_bases(LIMITED, rollouts, count)
    assert len(bases) == count
    labels, chosen = (np.array(branch_labels(LIMITED.motion(q))) for q in (rollouts, bases))
    firsts = [int(np.flatnonzero(labels == name)[0]) for name in dict.fromkeys(labels)]
    for base, first in zip(bases, firsts, strict=False):
        np.testing.assert_array_equal(base, rollouts[first])
    assert len(np.unique(bases.reshape(count, -1), axis=0)) == count
    assert set(chosen) == set(list(dict.fromkeys(labels))[:count])


def test_further_ones_are_the_farthest_of_the_better_halves(rollouts):
    labels = np.array(branch_labels(LIMITED.motion(rollouts)))
    branches = len(set(labels))
    bases = choose_bases(LIMITED, rollouts, branches + 1)
    better = [q for name in set(labels) for q in rollouts[labels == name][: (np.sum(labels == name) + 1) // 2]]

    def distance(q):
        change = (q - bases[:branches] + np.pi) % (2 * np.pi) - np.pi
        return np.sqrt(np.mean(np.sum(change**2, axis=-1), axis=-1)).min()

    assert distance(bases[-1]) == pytest.approx(max(distance(q) for q in better), rel=1e-12)


@pytest.mark.usefixtures("unchecked")
def test_motions_of_a_user_must_be_of_this_arm_and_path(rollouts):
    motions = LIMITED.motion(rollouts[:2])
    np.testing.assert_array_equal(positions_on_path(LIMITED, motions), rollouts[:2])
    np.testing.assert_array_equal(positions_on_path(LIMITED, motions[0]), rollouts[:1])
    with pytest.raises(InvalidInput, match="initial: motions wanted, got list"):
        positions_on_path(LIMITED, [motions])
    with pytest.raises(InvalidInput, match=r"with 21 samples wanted, got .* with 11"):
        positions_on_path(LIMITED, task().subsample(11).motion(rollouts[:1, ::2]))
    off = pk.Motion(arm=ARM, time=LIMITED.times, q=rollouts[0] + 0.01)
    with pytest.raises(InvalidInput, match="initial: motions on the path wanted"):
        positions_on_path(LIMITED, off)
