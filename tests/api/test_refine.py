"""Gradients inside a search and at its end."""

import os
import signal
from importlib import import_module

import numpy as np
import pytest

import paretoik as pk
from problems import tringali_2020
from tests.api.problems import tracking

SMALL = {"population": 20, "generations": 12, "seed": 1, "points": 6, "refine": True}


def problem_of():
    limits = pk.Limits(position=tringali_2020.POSITION, velocity=tringali_2020.VELOCITY)
    goals = [pk.kinetic_energy, pk.torque_norm]
    return pk.Tracking(
        pk.arms.tringali_3r(), tringali_2020.straight(51), objectives=goals, limits=limits, differences="backward"
    )


@pytest.fixture(scope="module")
def front():
    return pk.solve(problem_of(), **SMALL)


def test_a_search_with_gradients_ends_with_certified_points(front):
    assert front.certificates.criticality.max() <= 1e-6
    assert front.certificates.violation.max() <= 1e-8
    assert front.motions.tracking_error.max() <= 1e-9
    assert front.provenance["counts"]["iterations"] > 0


def tuned():
    return pk.Tuning(
        pk.arms.tringali_3r(), tringali_2020.straight(21), pk.methods.DampedLeastSquares(), judged_starts=1
    )


@pk.objective(unit="rad", form="general")
def spread(motion):
    return motion.q[..., -1, 0] - motion.q[..., 0, 0]


def relating():
    return pk.Tracking(
        pk.arms.tringali_3r(),
        tringali_2020.straight(21),
        objectives=[pk.kinetic_energy, spread],
        differences="backward",
    )


@pytest.mark.parametrize(
    ("made", "settings", "words"),
    [
        (tuned, {"refine": True, "solver": "sqp"}, "refine: the problem must have gradients, .* got Tuning"),
        (tuned, {"solver": "sqp"}, "solver must come with refine=True, got 'sqp' without it"),
        (relating, {"refine": True, "solver": "interior-point"}, r"functions that relate samples \(spread\)"),
    ],
)
def test_a_solver_that_cannot_serve_is_refused_before_any_work(made, settings, words, monkeypatch, tmp_path):
    problem = made()
    monkeypatch.setattr(type(problem), "_evaluate", None)
    with pytest.raises(pk.InvalidInput, match=words) as refused:
        pk.solve(problem, **settings, out=tmp_path / "run")
    assert "\n" not in str(refused.value)
    assert not (tmp_path / "run").exists()


def walk():
    return pk.PointToPoint(
        pk.arms.kim_3r(),
        pk.capability.kim_joint_motors(),
        (0.1, -0.15),
        (0.2, -0.15),
        samples=9,
        coefficients=5,
        bases=4,
    )


@pytest.mark.parametrize("made", [problem_of, walk])
def test_a_signal_ends_refinement_and_nothing_is_lost(made, tmp_path):
    counts = []

    def interrupt(progress):
        if progress.stage != "refinement":
            return
        done, total = progress.done, progress.total
        counts.append((done, total))
        assert pk.load_front(tmp_path / "run").objectives.shape == (total, 2)  # kept before it is refined
        os.kill(os.getpid(), signal.SIGINT)

    settings = {**SMALL, "generations": 6, "points": 40}
    front = pk.solve(made(), **settings, out=tmp_path / "run", observe=interrupt)
    assert front.provenance["status"] == "SIGINT"
    assert len(counts) == 1
    assert len(front.certificates) == len(front)
    assert 0 < front.provenance["refined"]["converged"] <= counts[0][0]
    assert np.array_equal(pk.load_front(tmp_path / "run").objectives, front.objectives)


def directions():
    return pk.DirectionalMaxima(
        pk.arms.kim_3r(), pk.capability.kim_joint_motors(), (0.1, -0.15), [[1, 0], [0, 1]], power=False
    )


@pytest.mark.parametrize("solver", ["sqp", "interior-point"])
@pytest.mark.parametrize("made", [tracking, directions])
def test_the_solver_that_is_named_helps_the_search_and_refines(made, solver, monkeypatch):
    minimise = import_module("paretoik.nlp.minimise")
    search = minimise._search

    def named(program, kernel, item):
        assert (kernel is None) == (solver == "sqp"), "the other solver was called"
        return search(program, kernel, item)

    monkeypatch.setattr(minimise, "_search", named)
    front = pk.solve(made(), population=12, generations=12, points=2, seed=1, refine=True, solver=solver)
    assert front.provenance["counts"]["iterations"] > 0
    assert front.provenance["refined"]["converged"] > 0
    assert front.provenance["settings"]["solver"] == solver


def test_a_front_is_refined_with_its_own_problem_only():
    front = pk.solve(walk(), population=20, generations=4, seed=1, points=3)
    other = pk.PointToPoint(
        pk.arms.kim_3r(), pk.capability.kim_joint_motors(), (0.1, -0.15), (0.21, -0.15), samples=9, coefficients=5
    )
    with pytest.raises(pk.InvalidInput, match="problem must be the one that the front solves"):
        pk.refine(front, other)


@pk.objective(unit="rad", form="peak")
def angle(motion):
    """Return the distance of the first joint from an angle."""
    return np.abs(motion.q[..., 0] - 0.2)


@pk.objective(unit="rad²s", form="integral")
def way(motion):
    """Return the distance of the first joint from another angle, plus how much all joints move."""
    return np.abs(motion.dq).sum(axis=-1) * 1e-3 + (motion.q[..., 0] - 0.3) ** 2


def test_points_are_critical_over_the_ranges_of_the_front_that_they_become():
    path = pk.line((0.2, 0.1), (0.2, 0.2), duration=1.0, samples=17)

    def offset(to):
        return pk.objective(unit="", form="integral", name="offset")(
            lambda motion: (motion.q[..., 0] - to) ** 2 + 1e-3 * motion.dq[..., 0] ** 2
        )

    arm = pk.arms.tringali_3r()
    problem = pk.Tracking(arm, path, objectives=[angle, way])
    plans = [pk.plan(pk.Tracking(arm, path, objectives=[offset(to)]), starts=4) for to in (-0.5, 0.925)]
    # Many optima have the first joint there; which of them is best is rounding.
    far = [min((each.motion for each in plan.optima), key=problem.task.objectives[1]) for plan in plans]
    motions = problem.task.motion(np.stack([motion.at(path.times) for motion in far]))
    coarse = pk.Front(
        ids=np.arange(2),
        objectives=problem.evaluate(problem.encode(motions)[0], return_values_of=["F"]),
        names=problem.names,
        units=problem.units,
        maximised=problem.maximised,
        motions=motions,
        problem=problem,
    )
    refined = pk.refine(coarse, observe=False)
    assert (np.ptp(refined.objectives, axis=0) < 0.2 * np.ptp(coarse.objectives, axis=0)).all()
    assert refined.certificates.status.tolist() == ["minimum", "minimum"]
    assert refined.certificates.criticality.max() <= 1e-6


@pk.objective(unit="rad²s", form="integral")
def beyond(motion):
    """Return how far the first joint is beyond an angle; before it 0, without a gradient."""
    return np.maximum(motion.q[..., 0] - 1.0, 0.0) ** 2


def test_gains_that_cost_no_objective_are_made():
    path = pk.line((0.4, 0.1), (0.2, 0.3), duration=1.0, samples=7)
    arm = pk.arms.tringali_3r()
    best = pk.plan(pk.Tracking(arm, path, objectives=[pk.kinetic_energy]), starts=6).best
    assert best.motion.q[:, 0].max() < 1.0
    problem = pk.Tracking(arm, path, objectives=[beyond, pk.kinetic_energy])
    front = pk.solve(problem, population=12, generations=3, seed=0)
    assert front.objectives[0, 1] > 1.001 * best.objective  # fully critical: the other objective is at its minimum
    refined = pk.refine(front)
    assert refined.objectives[0] == pytest.approx([0.0, best.objective], rel=1e-6, abs=1e-9)


def test_objectives_without_a_value_for_some_motions_lose_no_front():
    @pk.objective(unit="rad", form="integral")
    def root(motion):
        with np.errstate(invalid="ignore"):
            return np.sqrt(motion.q[..., 1] + 0.3)  # NaN for many

    goals = [pk.kinetic_energy, root]
    problem = pk.Tracking(pk.arms.tringali_3r(), tringali_2020.straight(26), objectives=goals)
    front = pk.solve(problem, population=20, generations=10, seed=1, refine=True)
    assert front.provenance["counts"]["failed"] > 0
    assert np.isfinite(front.objectives).all()
    assert len(front) > 5
