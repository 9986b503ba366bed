"""Tracking: laws of all genes, refusals, and the text of failures."""

from __future__ import annotations

import re

import numpy as np
import pytest
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.optimize import minimize

import paretoik as pk
from paretoik import Limits, Motion, Task, Tracking, circle, kinetic_energy, line
from paretoik.errors import Infeasible, InvalidInput, OutOfReach
from paretoik.formulations.tracking import choose_bases, positions_on_path, sample_rollouts
from paretoik.robot.arms import tringali_3r
from paretoik.task.motion_task import evaluate_motions
from paretoik.task.self_motion import branch_labels
from paretoik.task.starts import MOTION_OPTIONS as OPTIONS
from tests.formulations.problems import OBJECTIVES, PROBLEMS, SMALL, built, paper_3r
from tests.task.tasks import ARM, task

every_problem = pytest.mark.parametrize("name", PROBLEMS)
some_problems = pytest.mark.parametrize("name", ["planar 4R", "Panda, position", "random 8R, pose"])
POSITION = np.deg2rad([90.0, 120.0, 120.0])


def genes_of(problem, count, seed=0):
    return np.random.default_rng(seed).uniform(problem.xl, problem.xu, (count, problem.n_var))


def evaluate(problem, genes):
    return problem.evaluate(genes, return_as_dictionary=True)


def hold(name, count):
    """Check the law of genes on random genes; return the shares on the path and within all limits."""
    problem, on_path, feasible = built(name), 0, 0
    for seed in range(count // 500):
        genes = genes_of(problem, 500, seed)
        out = evaluate(problem, genes)
        motions = problem.decode(genes)
        arrived = out["G"][:, 0] <= 0
        fine = (out["G"] <= 0).all(axis=1)
        explained = [bool(reason) for reason in problem.explain(genes[:60])]
        assert np.isfinite(out["F"]).all()
        assert np.isfinite(out["G"]).all()
        assert (motions.tracking_error[arrived] < 1e-9).all()
        assert (np.abs(np.diff(motions.q[arrived], axis=1)) < 2.5).all()
        assert explained == (~fine[:60]).tolist()
        on_path, feasible = on_path + arrived.sum(), feasible + fine.sum()
    return on_path / count, feasible / count


@every_problem
def test_a_thousand_random_genes_are_on_the_path_or_infeasible_with_a_reason(name, unchecked):
    on_path, feasible = hold(name, 1000)
    print(f"{name}: {100 * on_path:.1f} % of random genes on the path, {100 * feasible:.1f} % within limits too")
    assert on_path >= 0.5


@pytest.mark.slow
@every_problem
def test_ten_thousand_random_genes_are_on_the_path_or_infeasible_with_a_reason(name, unchecked):
    on_path, feasible = hold(name, 10_000)
    print(f"{name}: {100 * on_path:.1f} % of random genes on the path, {100 * feasible:.1f} % within limits too")
    assert on_path >= 0.5


@some_problems
def test_corners_of_the_bounds_are_on_the_path_or_infeasible_with_a_reason(name):
    problem = built(name)
    rng = np.random.default_rng(7)
    genes = np.where(rng.random((100, problem.n_var)) < 0.5, problem.xl, problem.xu)
    out = evaluate(problem, genes)
    arrived = out["G"][:, 0] <= 0
    assert np.isfinite(out["F"]).all()
    assert (problem.decode(genes).tracking_error[arrived] < 1e-9).all()
    assert all(
        bool(reason) != ok for reason, ok in zip(problem.explain(genes), (out["G"] <= 0).all(axis=1), strict=True)
    )


@every_problem
def test_motions_on_the_path_stay_on_it_between_their_samples(name):
    problem = built(name)
    genes = genes_of(problem, 40)
    genes[:, 1:] *= 0.3
    motions = problem.decode(genes[evaluate(problem, genes)["G"][:, 0] <= 0])
    instants = np.linspace(0, problem.task.times[-1], 77)
    between = motions.at(instants)
    dense = Motion(arm=problem.task.arm, time=instants, q=between, tasks=problem.task.tasks)
    assert dense.tracking_error.max() < 1e-9
    assert len(motions) > 20


@some_problems
def test_the_same_seed_gives_the_same_problem_to_the_bit(name):
    first, second = built(name), PROBLEMS[name]()
    genes = genes_of(first, 20)
    np.testing.assert_array_equal(first.encoding.charts.base, second.encoding.charts.base)
    np.testing.assert_array_equal(first.encoding.radius, second.encoding.radius)
    np.testing.assert_array_equal(evaluate(first, genes)["F"], evaluate(second, genes)["F"])


def test_another_seed_gives_other_bases():
    assert np.abs(paper_3r(seed=1).encoding.charts.base - built("planar 3R").encoding.charts.base).max() > 0.1


@some_problems
def test_scores_of_a_batch_are_those_of_its_members(name):
    problem = built(name)
    genes = genes_of(problem, 12, seed=3)
    together = evaluate(problem, genes)
    for i in range(12):
        alone = evaluate(problem, genes[i : i + 1])
        np.testing.assert_allclose(alone["F"][0], together["F"][i], rtol=1e-12)
        np.testing.assert_allclose(alone["G"][0], together["G"][i], rtol=1e-9, atol=1e-12)


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
    genes = genes_of(problem, 300)
    G = evaluate(problem, genes)["G"]
    motions, reasons = problem.decode(genes), problem.explain(genes)
    names = problem.constraint_names
    assert len(names) == G.shape[1]
    assert names[:2] == ("tracking", "evaluation")
    column = names.index("velocity of joint3")
    np.testing.assert_allclose(G[:, column], (np.abs(motions.dq[..., 2]).max(axis=1) - 3.8) / 7.6, rtol=1e-9)
    broken = np.flatnonzero((G > 0).any(axis=1))
    assert 0 < len(broken) < 300
    for i in broken:
        worst = names[int(np.argmax(G[i]))]
        how = "(below its lower|above its upper) limit" if worst.startswith("position") else "exceeded"
        assert re.match(rf"{worst} is {how} by {100 * G[i].max():.3g} % of its range at sample ", reasons[i])


def test_pymoos_own_minimize_solves_tracking():
    problem = paper_3r(limits=Limits(position=POSITION, velocity=3.8))
    result = minimize(problem, NSGA2(pop_size=24), ("n_gen", 6), seed=1)
    assert result.F.shape[1] == 2
    assert np.isfinite(result.F).all()
    assert (problem.decode(np.atleast_2d(result.X)).tracking_error < 1e-9).all()
    assert (result.G <= 0).all()


def test_obstacles_become_a_constraint_that_motions_really_satisfy():
    post = pk.obstacles.Circle([0.25, 0.22], 0.05)
    problem = paper_3r(obstacles=[post], link_radius=0.02, limits=Limits(clearance=0.01), bases=8)
    genes = genes_of(problem, 300)
    out = evaluate(problem, genes)
    clear = (out["G"] <= 0).all(axis=1)
    assert problem.constraint_names[-1] == "clearance"
    assert 10 < clear.sum() < 290
    motions = problem.decode(genes)
    gaps = np.full(300, np.inf)
    for share in np.linspace(0, 1, 51):  # every link, densely, by hand
        points = motions.links[..., :-1, :] + share * np.diff(motions.links, axis=-2)
        apart = np.linalg.norm(points[..., :2] - [0.25, 0.22], axis=-1) - 0.05 - 0.02
        gaps = np.minimum(gaps, apart.min(axis=(1, 2)))
    assert (gaps[clear] >= 0.01).all()
    assert (gaps[~clear] < 0.01 + 0.002).all()
    assert all("clearance" in reason for reason, ok in zip(problem.explain(genes), clear, strict=True) if not ok)


def test_candidates_offer_the_best_roll_outs_within_bounds():
    problem = built("planar 3R")
    genes = problem.sample_starts(50, np.random.default_rng(0))
    assert genes.shape == (50, problem.n_var)
    assert ((genes >= problem.xl) & (genes <= problem.xu)).all()
    assert (evaluate(problem, genes)["G"][:, 0] <= 0).mean() > 0.8


@some_problems
def test_self_motion_samples_are_within_bounds_and_mostly_on_the_path(name):
    problem = built(name)
    genes = problem.self_motion_samples(60, np.random.default_rng(0))
    assert ((genes >= problem.xl) & (genes <= problem.xu)).all()
    assert (evaluate(problem, genes)["G"][:, 0] <= 0).mean() > 0.8
    np.testing.assert_array_equal(problem.decode(genes[: problem.n_species]).q, problem.encoding.charts.base)


def test_a_cycle_is_solved_closed():
    path = circle([0.4178, 0.0], 0.05, duration=1.0, samples=31)
    problem = Tracking(tringali_3r(), path, cyclic=True, **SMALL)
    motions = problem.decode(genes_of(problem, 40))
    np.testing.assert_array_equal(motions.q[:, 0], motions.q[:, -1])
    np.testing.assert_array_equal(motions.dq[:, 0], motions.dq[:, -1])


LINE = line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=21)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"coefficients": 3}, "coefficients"),
        ({"bases": 0}, "base"),
        ({"objectives": []}, "objectives must be at least one, got none"),
        ({"objectives": [kinetic_energy, kinetic_energy]}, "names must differ, got kinetic_energy, kinetic_energy"),
        ({"differences": "forward"}, "differences must be one of backward, central, spline, got 'forward'"),
        ({"cyclic": True}, "path must be closed if cyclic=True"),
        ({"end_velocity": 1.0}, "end_velocity must be None .* got 1.0"),
        ({"start": [np.nan, 0.0, 0.0]}, "start must be 'free' or 3 finite joint positions"),
        ({"start": [0.1, 0.2, 0.3]}, r"start must be at most .* m off the path's first sample, got 0\.\d+ m"),
    ],
    ids=["coefficients", "bases", "none", "twice", "differences", "open", "speed", "NaN", "off"],
)
def test_what_cannot_be_solved_is_refused_in_one_line(settings, words, unchecked):
    with pytest.raises(InvalidInput, match=words) as refused:
        Tracking(tringali_3r(), LINE, **{"objectives": OBJECTIVES, **settings})
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("beyond", [1e-9, 1e-3, 1.0])
@pytest.mark.parametrize("backwards", [False, True])
def test_a_path_that_leaves_reach_is_refused_with_its_sample(beyond, backwards):
    ends = [[0.4895 + beyond, 0.0], [0.3, 0.1]]
    path = line(*(ends[::-1] if backwards else ends), duration=1.0, samples=21)
    with pytest.raises(OutOfReach, match=r"m from the nearest point found, \[0\.\d+, ") as refused:
        Tracking(tringali_3r(), path, objectives=OBJECTIVES, differences="backward")
    first = int(np.argmax(np.linalg.norm(path.positions, axis=1) > 0.4895))
    assert refused.value.sample == first


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


def test_a_gap_between_branches_is_a_refusal_not_a_jump():
    arm = pk.Arm.planar(lengths=[1.0, 0.3, 0.3])
    path = line([0.4, 0.0], [0.9, 0.0], duration=1.0, samples=21)
    with pytest.raises(Infeasible, match="condition number"):
        Tracking(arm, path, objectives=[pk.joint_travel], differences="backward")


def test_feasible_motions_never_jump_from_sample_to_sample():
    problem = built("Panda, position")
    genes = genes_of(problem, 1000, seed=11)
    q, on_path = problem.encoding.decode(problem.task, genes)
    start = problem.encoding.charts.base[problem.species(genes)]
    way = np.abs(np.diff(q - start, axis=1)).max(axis=2)
    whole = on_path.all(axis=1)
    assert whole.sum() > 500
    assert way[whole].max() < 2.0
    assert np.abs(np.diff(problem.encoding.charts.base, axis=1)).max() <= OPTIONS.longest_jump


# Initial motions: their order, every branch, and motions without values of a user's functions.


LIMITED = task(limits=pk.Limits(velocity=2.0), objectives=[pk.kinetic_energy, pk.joint_travel])


@pytest.fixture(scope="module")
def rollouts():
    return sample_rollouts(LIMITED, np.random.default_rng(0))[0]


def test_rollouts_are_sorted_by_violation_then_by_domination(rollouts):
    F, limits, causes = evaluate_motions(LIMITED, LIMITED.motion(rollouts))
    for known, value in zip(sample_rollouts(LIMITED, np.random.default_rng(0))[1:], (F, causes), strict=True):
        np.testing.assert_array_equal(known, value)
    violation = np.maximum(limits, 0.0).sum(axis=1).round(6)
    assert (np.diff(violation) >= 0).all()
    assert violation[0] < violation[-1]
    rank = (F[None] <= F[:, None]).all(axis=2).sum(axis=1)
    assert (np.diff(rank)[np.diff(violation) == 0] >= 0).all()
    assert not any(causes)


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


def test_further_bases_are_the_farthest_of_the_better_halves(rollouts):
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
    with pytest.raises(InvalidInput, match="initial must be motions, got list"):
        positions_on_path(LIMITED, [motions])
    with pytest.raises(InvalidInput, match=r"with 21 samples, got .* with 11"):
        positions_on_path(LIMITED, task().subsample(11).motion(rollouts[:1, ::2]))
    off = pk.Motion(arm=ARM, time=LIMITED.times, q=rollouts[0] + 0.01)
    with pytest.raises(InvalidInput, match="initial must be motions on the path"):
        positions_on_path(LIMITED, off)
