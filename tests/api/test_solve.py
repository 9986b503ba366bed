from __future__ import annotations

import json

import numpy as np
import pytest

import paretoik as pk
from paretoik.api.solve import solve
from paretoik.errors import EvaluationFailed, Infeasible, InvalidInput
from paretoik.front.hypervolume import non_dominated
from paretoik.runs.files import RECORDING
from tests.api.problems import QUICK, tracking
from tests.review.reading import read, rows
from tests.search.problems import Constant


def test_a_front_is_feasible_and_non_dominated_and_its_motions_give_its_objectives(problem, front):
    own = [objective(front.motions) for objective in (pk.kinetic_energy, pk.torque_norm)]
    assert np.array_equal(np.stack(own, axis=1), front.objectives)
    assert non_dominated(front.objectives).all()
    assert (problem.task.violations(front.motions) <= 0).all()
    assert (np.diff(front.objectives[:, 0]) > 0).all()


def test_the_same_seed_gives_the_same_bits_and_another_seed_another_front(problem, front, tmp_path):
    again = solve(tracking(velocity=6.0), **QUICK, seed=1, out=tmp_path / "run")
    for name in ("ids", "objectives", "genes"):
        assert getattr(again, name).tobytes() == getattr(front, name).tobytes()
    assert again.motions.q.tobytes() == front.motions.q.tobytes()
    assert not np.array_equal(solve(problem, **QUICK, seed=2).objectives, front.objectives)


def test_failures_are_counted_and_named_and_stay_out_of_the_front():
    @pk.objective(unit="rad", form="terminal")
    def touchy(motion):
        last = motion.q[..., -1, 0]
        return np.where(last > -1.05, np.nan, last)

    valid_front = solve(tracking(pk.kinetic_energy, touchy), **QUICK, seed=1)
    counts = valid_front.provenance["counts"]
    assert 0 < counts["failed"] < counts["evaluations"] == 72
    assert counts["first_cause"] == "objective touchy is nan"
    assert (valid_front.motions.q[:, -1, 0] <= -1.05).all()


def test_when_every_evaluation_fails_the_first_cause_is_named():
    @pk.objective(unit="", form="general")
    def worn(motion):
        raise RuntimeError("the bearing is worn")

    with pytest.raises(EvaluationFailed, match="RuntimeError: the bearing is worn"):
        solve(tracking(pk.kinetic_energy, worn), **QUICK)


def test_nothing_feasible_comes_with_the_least_violating_motion_the_limit_and_by_how_much(tmp_path):
    narrow = tracking(velocity=1.0)
    with pytest.raises(
        Infeasible, match=r"least-violating one, velocity.*; it may help: a longer duration$"
    ) as refused:
        solve(narrow, **QUICK, out=tmp_path / "run")
    assert "velocity" in refused.value.limit
    worst = narrow.task.violations(refused.value.motion)
    assert refused.value.violation == pytest.approx(worst.max())
    said = json.loads((tmp_path / "run" / "run.json").read_text())
    assert (said["status"], said["reason"]) == ("Infeasible", str(refused.value))


def test_observe_sees_every_generation_as_the_user_knows_it(problem):
    @pk.objective(unit="", form="general", maximise=True)
    def height(motion):
        return motion.q[..., -1, 0]

    seen = []
    front = solve(tracking(pk.kinetic_energy, height), **QUICK, observe=seen.append)
    seen = [progress for progress in seen if progress.stage != "compilation"]  # code that no earlier test compiled
    assert [(progress.stage, progress.done, progress.total) for progress in seen] == [
        ("generation", number, 6) for number in range(1, 7)
    ]
    assert [progress.generation.number for progress in seen] == [1, 2, 3, 4, 5, 6]
    volumes = [progress.generation.hypervolume or 0.0 for progress in seen]  # None while nothing is feasible
    assert volumes == sorted(volumes)
    assert volumes[-1] > 0
    last = seen[-1].generation
    assert seen[-1].summary == f"front {len(last.front)}, hypervolume {volumes[-1]:.4g}"
    assert set(front.ids) <= set(last.front_ids)
    shown = dict(zip(last.front_ids.tolist(), last.front.tolist(), strict=True))
    assert [shown[number] for number in front.ids.tolist()] == front.objectives.tolist()


@pytest.mark.parametrize(
    ("ending", "status"),
    [
        ({"generations": 3}, "generations"),
        ({"time_limit": 1e-9}, "time limit"),
        ({"evaluations": 20}, "evaluations"),
        ({"target": (1e3, 1e3)}, "target"),
    ],
)
def test_a_run_says_what_ended_it_and_keeps_its_front(problem, ending, status):
    front = solve(problem, population=12, **{"generations": 50} | ending)
    assert front.provenance["status"] == status
    assert front.provenance["counts"]["generations"] <= 3
    assert len(front)


@pytest.mark.filterwarnings("ignore:objective .* must vary:RuntimeWarning")
def test_stagnation_ends_a_run_unless_told_otherwise():
    ended = solve(Constant(2), population=12, generations=30)
    assert ended.provenance["status"] == "stagnation"
    assert solve(Constant(2), population=12, generations=30, stagnation=False).provenance["status"] == "generations"


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"target": (1.0,)}, r"target must be 2 numbers, one per objective, got \(1.0,\)"),
        ({"population": 3}, "population must be an integer of at least 4, got 3"),
        ({"generations": 0}, "generations must be an integer of at least 1, got 0"),
        ({"points": 0}, "points must be an integer of at least 1, got 0"),
        ({"time_limit": 0.0}, "time limit must be more than 0 seconds, got 0"),
    ],
)
def test_settings_that_make_no_sense_are_refused_before_a_folder_is_made(problem, tmp_path, settings, words):
    with pytest.raises(InvalidInput, match=words):
        solve(problem, **QUICK | settings, out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_front_has_no_more_points_than_asked_for_and_keeps_its_ends(problem, front):
    few = solve(problem, **QUICK, seed=1, points=3)
    assert len(few) == 3
    np.testing.assert_array_equal(few.objectives[[0, -1]], front.objectives[[0, -1]])
    assert set(few.ids) <= set(front.ids)


def test_recording_changes_no_bit_of_the_front_and_its_last_front_is_the_one_that_is_returned(problem, tmp_path):
    front, recorded = solve(problem, **QUICK), solve(problem, **QUICK, out=tmp_path / "run")
    np.testing.assert_array_equal(recorded.objectives, front.objectives)
    np.testing.assert_array_equal(recorded.motions.q, front.motions.q)
    last = rows(read(tmp_path / "run" / RECORDING)["/search/front"], "generation", "F")[6]
    np.testing.assert_array_equal(last, front.objectives.ravel())
