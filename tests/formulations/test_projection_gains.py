"""Laws of searching the numbers of projection methods."""

from __future__ import annotations

import re

import numpy as np
import pytest
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.optimize import minimize

import paretoik as pk
from paretoik import line
from paretoik.errors import InvalidInput, OutOfReach
from paretoik.robot.arms import tringali_3r
from tests.resolution.test_resolve import BENT, begun

pytestmark = pytest.mark.usefixtures("unchecked")
PATH = line([0.4, 0.05], [0.3, 0.15], duration=1.0, samples=41)
BOTH = [pk.joint_limit_nearness, pk.manipulability]
ARM = pk.Arm.planar(
    lengths=[0.176, 0.176, 0.1375],
    position_limits=([-1.5, -2.0, -2.0], [1.5, 2.0, 2.0]),
    velocity_limits=[3.0, 3.0, np.inf],
)


def problem(**settings):
    return pk.ProjectionGains(ARM, PATH, **{"criteria": BOTH, "several": 3, **settings})


def some(of, count=6, seed=0):
    return np.random.default_rng(seed).uniform(of.xl, of.xu, (count, of.n_var))


@pytest.mark.parametrize("family", ["weighted", "plain"])
def test_what_is_evaluated_is_the_worst_of_its_motions(family):
    asked = problem(family=family)
    genes = some(asked)
    F = asked.evaluate(genes)
    span = ARM.position_limits[:, 1] - ARM.position_limits[:, 0]
    for i, one in enumerate(genes):
        motions = []
        for start in asked.starts[asked.begun(genes)[i]]:
            method = asked.method(one[None])
            motions.append(pk.resolve(ARM, PATH, method, start=start, unreachable="track")[0, 0])
        margins = [np.minimum(m.q - ARM.position_limits[:, 0], ARM.position_limits[:, 1] - m.q) / span for m in motions]
        wanted = [
            max(np.abs(m.traces.errors).max() for m in motions),
            -min(margin.min() for margin in margins),
            max((np.abs(m.dq) / [3.0, 3.0, 1.0]).max() for m in motions),
            max(pk.jerk(m) for m in motions),
        ]
        np.testing.assert_allclose(F[i], wanted, rtol=1e-9)


def test_genes_decode_to_the_motion_from_their_place():
    asked = problem()
    genes = some(asked)
    motions = asked.decode(genes)
    assert motions.q.shape == (6, 41, 3)
    np.testing.assert_array_equal(motions.q[:, 0], asked.starts[asked.begun(genes)[:, 0]])
    alone = asked.decode(genes[2:3])
    np.testing.assert_array_equal(alone.q[0], motions.q[2])


def test_starts_are_within_limits_each_beside_the_next():
    asked = problem()
    assert ((asked.starts >= ARM.position_limits[:, 0]) & (asked.starts <= ARM.position_limits[:, 1])).all()
    motion = pk.resolve(ARM, PATH, pk.methods.DampedLeastSquares(), start=asked.starts, unreachable="track")
    assert np.abs(motion.traces.errors[:, 0]).max() < 1e-9
    steps = np.linalg.norm(np.diff(asked.starts, axis=0), axis=1)
    assert np.median(steps) < 0.2
    np.testing.assert_array_equal(problem().starts, asked.starts)
    np.testing.assert_array_equal(np.sort(asked.begun(np.zeros((1, asked.n_var)))[0]), [0, 1, len(asked.starts) - 1])


def test_keys_say_which_criterion_comes_first():
    asked = problem()
    genes = some(asked, 2)
    genes[:, -2:] = [[0.1, 0.9], [0.9, 0.1]]
    assert asked.method(genes).priorities.tolist() == [[[0.1, 0.9]], [[0.9, 0.1]]]


def test_solve_gives_a_front_of_motions_and_pymoo_takes_the_problem():
    asked = problem()
    front = pk.solve(asked, population=12, generations=4, seed=1)
    assert front.names == ("tracking_error", "limit_margin", "speed_ratio", "roughness")
    assert front.motions.q.shape[1:] == (41, 3)
    assert (front.objectives[:, 1] <= 0.5).all()
    found = minimize(asked, NSGA2(pop_size=8), ("n_gen", 2), seed=1)
    assert np.isfinite(found.F).all()


def test_spatial_arms_without_criteria():
    asked = pk.ProjectionGains(pk.arms.wan_7r(), begun(pk.arms.wan_7r(), BENT), several=2, starts=np.tile(BENT, (4, 1)))
    assert asked.n_var == 6
    assert np.isfinite(asked.evaluate(some(asked, 3))).all()


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"family": "heavy"}, "family must be one of weighted, plain, got 'heavy'"),
        ({"several": 0}, "several: an integer of at least 1 wanted, got 0"),
        ({"several": 2.5}, "several: an integer of at least 1 wanted, got 2.5"),
        ({"variant": "ours"}, "variant must be one of paper, consistent, got 'ours'"),
        ({"starts": np.full((4, 3), np.nan)}, "starts: must be finite, got nan at index (0, 0)"),
        (
            {"criteria": [pk.methods.Criterion(objective=pk.manipulability, gain=np.ones(2))]},
            "manipulability: one gain wanted",
        ),
        ({"starts": np.zeros((2, 2))}, "starts: postures (starts, 3) wanted, got shape (2, 2)"),
        ({"criteria": [pk.joint_drift]}, "criteria: wants objectives of form integral or peak"),
        ({"criteria": [pk.jerk]}, "criterion jerk: wants a function of positions, velocities or both"),
        ({"criteria": 5}, "criteria: wants objectives of form integral or peak, got 5"),
        ({"starts": "x"}, "starts: must hold real numbers"),
        ({"several": 10_000}, "several: 1 to "),
        ({"seed": -1}, "seed: an integer of at least 0 wanted, got -1"),
        ({"obstacles": 5}, "obstacles: a list of obstacles wanted, got 5"),
    ],
)
def test_what_cannot_be_used_is_refused_by_name(changed, said):
    with pytest.raises(InvalidInput, match=re.escape(said)):
        problem(**changed)


def test_a_path_out_of_reach_is_refused():
    with pytest.raises(OutOfReach):
        pk.ProjectionGains(tringali_3r(), line([0.6, 0.0], [0.5, 0.0], duration=1.0, samples=11))
