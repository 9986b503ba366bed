"""Tracking: laws of all genes, refusals, and the text of failures."""

from __future__ import annotations

import re

import numpy as np
import pytest

import paretoik as pk
from paretoik import Limits, Task, Tracking, line
from paretoik.errors import InvalidInput
from paretoik.formulations.tracking import choose_bases, sample_rollouts
from paretoik.robot.arms import tringali_3r
from paretoik.task.self_motion import branch_labels
from tests.formulations.problems import OBJECTIVES, PROBLEMS, SMALL, built, paper_3r
from tests.task.tasks import task

every_problem = pytest.mark.parametrize("name", PROBLEMS)
some_problems = pytest.mark.parametrize("name", ["planar 4R", "Panda, position", "random 8R, pose"])
POSITION = np.deg2rad([90.0, 120.0, 120.0])


def genes_of(problem, count, seed=0):
    return np.random.default_rng(seed).uniform(problem.xl, problem.xu, (count, problem.n_var))


def evaluate(problem, genes):
    return problem.evaluate(genes, return_as_dictionary=True)


@every_problem
def test_random_genes_and_corners_of_the_bounds_are_on_the_path_or_infeasible_with_a_reason(name, unchecked):
    problem, rng = built(name), np.random.default_rng(7)
    corners = np.where(rng.random((30, problem.n_var)) < 0.5, problem.xl, problem.xu)
    genes = np.concatenate([corners, genes_of(problem, 300)])
    out, motions = evaluate(problem, genes), problem.decode(genes)
    arrived, fine = out["G"][:, 0] <= 0, (out["G"] <= 0).all(axis=1)
    assert np.isfinite(out["F"]).all()
    assert np.isfinite(out["G"]).all()
    assert (motions.tracking_error[arrived] < 1e-9).all()
    assert (np.abs(np.diff(motions.q[arrived], axis=1)) < 2.5).all()
    assert [bool(reason) for reason in problem.explain(genes[:60])] == (~fine[:60]).tolist()
    assert arrived[30:].mean() >= 0.5


def test_objectives_are_those_of_the_decoded_motions():
    problem = paper_3r(objectives=[pk.kinetic_energy, pk.manipulability])
    genes = genes_of(problem, 30)
    motions = problem.decode(genes)
    F = evaluate(problem, genes)["F"]
    assert problem.names == ("kinetic_energy", "manipulability")
    assert problem.units == ("J s", "")
    assert problem.maximised == (False, True)
    np.testing.assert_allclose(F[:, 0], pk.kinetic_energy(motions), rtol=1e-12)
    np.testing.assert_allclose(-F[:, 1], pk.manipulability(motions), rtol=1e-12)


def test_constraint_columns_are_named_and_explained():
    problem = paper_3r(limits=Limits(position=POSITION, velocity=3.8))
    genes = genes_of(problem, 100)
    G = evaluate(problem, genes)["G"]
    motions, reasons = problem.decode(genes), problem.explain(genes)
    names = problem.constraint_names
    assert len(names) == G.shape[1]
    assert names[:2] == ("tracking", "evaluation")
    column = names.index("velocity of joint3")
    np.testing.assert_allclose(G[:, column], (np.abs(motions.dq[..., 2]).max(axis=1) - 3.8) / 7.6, rtol=1e-9)
    broken = np.flatnonzero((G > 0).any(axis=1))
    assert 0 < len(broken) < 100
    for i in broken:
        worst = names[int(np.argmax(G[i]))]
        how = "(below its lower|above its upper) limit" if worst.startswith("position") else "exceeded"
        assert re.match(rf"{worst} is {how} by {100 * G[i].max():.3g} % of its range at sample ", reasons[i])


def test_obstacles_become_a_constraint_that_motions_really_satisfy():
    post = pk.obstacles.Circle([0.25, 0.22], 0.05)
    problem = paper_3r(obstacles=[post], link_radius=0.02, limits=Limits(clearance=0.01), bases=8)
    genes = genes_of(problem, 100)
    out = evaluate(problem, genes)
    clear = (out["G"] <= 0).all(axis=1)
    assert problem.constraint_names[-1] == "clearance"
    assert 10 < clear.sum() < 90
    motions = problem.decode(genes)
    gaps = np.full(100, np.inf)
    for share in np.linspace(0, 1, 51):  # every link, densely, by hand
        points = motions.links[..., :-1, :] + share * np.diff(motions.links, axis=-2)
        apart = np.linalg.norm(points[..., :2] - [0.25, 0.22], axis=-1) - 0.05 - 0.02
        gaps = np.minimum(gaps, apart.min(axis=(1, 2)))
    assert (gaps[clear] >= 0.01).all()
    assert (gaps[~clear] < 0.01 + 0.002).all()
    assert all("clearance" in reason for reason, ok in zip(problem.explain(genes), clear, strict=True) if not ok)


@some_problems
def test_self_motion_samples_are_within_bounds_and_mostly_on_the_path(name):
    problem = built(name)
    genes = problem.self_motion_samples(60, np.random.default_rng(0))
    assert ((genes >= problem.xl) & (genes <= problem.xu)).all()
    assert (evaluate(problem, genes)["G"][:, 0] <= 0).mean() > 0.8
    np.testing.assert_array_equal(problem.decode(genes[: problem.n_species]).q, problem.encoding.charts.base)


LINE = line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=21)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"coefficients": 3}, "coefficients"),
        ({"bases": 0}, "base"),
        ({"differences": "forward"}, "differences must be one of backward, central, spline, got 'forward'"),
    ],
    ids=["coefficients", "bases", "differences"],
)
def test_what_cannot_be_solved_is_refused_in_one_line(settings, words, unchecked):
    with pytest.raises(InvalidInput, match=words) as refused:
        Tracking(tringali_3r(), LINE, **{"objectives": OBJECTIVES, **settings})
    assert "\n" not in str(refused.value)


def test_several_tasks_are_followed_at_once():
    arm = pk.Arm.planar(lengths=[0.5] * 6)
    elbow = Task(line([0.4, 0.8], [0.6, 0.9], duration=1.0, samples=21), frame="joint4")
    tool = Task(line([1.2, 0.5], [1.5, 0.9], duration=1.0, samples=21))
    problem = Tracking(arm, [elbow, tool], **{**SMALL, "objectives": [pk.joint_travel]})
    motions = problem.decode(genes_of(problem, 40) * np.r_[1, np.full(problem.n_var - 1, 0.3)])
    arrived = (motions.tracking_error < 1e-9).all(axis=1)
    assert problem.task.redundancy == 2
    assert arrived.mean() > 0.5
    assert np.abs(motions.links[arrived, :, 4, :2] - elbow.path.positions).max() < 1e-9
    assert np.abs(motions.tool[arrived] - tool.path.positions).max() < 1e-9


# Initial motions: their order, every branch, and motions without values of a user's functions.


LIMITED = task(limits=pk.Limits(velocity=2.0), objectives=[pk.kinetic_energy, pk.joint_travel])


@pytest.fixture(scope="module")
def rollouts():
    return sample_rollouts(LIMITED, np.random.default_rng(0))[0]


@pytest.mark.parametrize("count", [1, 3, 12])
def test_the_first_rollout_of_every_branch_is_chosen_and_none_twice(rollouts, count):
    bases = choose_bases(LIMITED, rollouts, count)
    assert len(bases) == count
    labels, chosen = (np.array(branch_labels(LIMITED.motion(q))) for q in (rollouts, bases))
    firsts = [int(np.flatnonzero(labels == name)[0]) for name in dict.fromkeys(labels)]
    for base, first in zip(bases, firsts, strict=False):
        np.testing.assert_array_equal(base, rollouts[first])
    assert len(np.unique(bases.reshape(count, -1), axis=0)) == count
    assert set(chosen) == set(list(dict.fromkeys(labels))[:count])
