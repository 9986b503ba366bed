from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.api.load import load_front
from paretoik.api.solve import solve
from paretoik.errors import InvalidInput
from tests.api.problems import QUICK, tracking


def test_a_saved_run_comes_back_with_its_motions_whole(problem, run):
    folder, front = run
    loaded = load_front(folder, problem)
    np.testing.assert_array_equal(loaded.objectives, front.objectives)
    np.testing.assert_array_equal(loaded.ids, front.ids)
    np.testing.assert_array_equal(loaded.motions.torque, front.motions.torque)
    assert loaded.provenance == front.provenance
    assert loaded.select(pk.Weights(torque_norm=1.0)).id == front.select(pk.Weights(torque_norm=1.0)).id


def test_a_run_that_names_no_problem_still_has_its_joint_positions(run):
    folder, front = run
    np.testing.assert_array_equal(load_front(folder).motions.q, front.motions.q)


def test_another_problem_is_refused_by_its_fingerprint(run):
    with pytest.raises(InvalidInput, match="the problem that the run solved, got one whose fingerprint is another"):
        load_front(run[0], tracking(velocity=6.5))


def test_a_run_whose_problem_is_not_given_comes_without_its_arm_and_a_warning(problem, tmp_path):
    solve(problem, **QUICK, out=tmp_path / "run", reference="gone.py:problem")
    with pytest.warns(RuntimeWarning, match=r"without their arm, .*only if you name it: .* --problem gone\.py:problem"):
        front = load_front(tmp_path / "run")
    assert len(front.motions) == len(front)
