from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import paretoik as pk
from paretoik.api.solve import solve
from paretoik.errors import InvalidInput, InvalidRun
from paretoik.runs.executor import computed_text
from paretoik.task.motion_task import evaluate_motions
from tests.api.problems import QUICK


def test_fronts_and_folders_are_compared_and_merged_with_their_motions(run, problem, tmp_path):
    folder, front = run
    other = solve(problem, **QUICK, seed=2)
    comparison = pk.compare(folder, other)
    assert comparison.labels == ("run", "front 2")
    assert {"settings.seed"} <= set(comparison.differences) <= {"settings.seed", "status"}
    merged = pk.compare(front, other).merged
    assert merged.motions.arm == problem.task.arm
    violation = np.maximum(problem.task.violations(merged.motions).max(axis=1), 0.0)
    np.testing.assert_allclose(violation, merged.violation, atol=1e-9)
    values = evaluate_motions(problem.task, merged.motions)[0]
    np.testing.assert_allclose(values, merged.objectives, rtol=1e-9)
    merged.save(tmp_path)
    again = pk.load_front(tmp_path, problem)
    np.testing.assert_allclose(again.motions.torque, merged.motions.torque, rtol=1e-9, atol=1e-12)


def test_labels_are_long_enough_to_tell_folders_apart(run, tmp_path):
    _, front = run
    names = ("x/energy/seed", "y/energy/seed", "y/other/seed", "front 1", "alone")
    folders = [tmp_path / name for name in names]
    for folder in folders:
        replace(front, problem=None).save(folder)
    labels = pk.compare(front, *folders, folders[0]).labels
    expected = ("front 1", "x/energy/seed", "y/energy/seed", "other/seed", f"{tmp_path.name}/front 1", "alone")
    assert labels == (*expected, "x/energy/seed")
    assert set(pk.compare(*folders[:2]).groups) == {"x/energy/seed", "y/energy/seed"}


@pytest.mark.usefixtures("unchecked")
def test_invalid_fronts_and_labels_are_refused(run, tmp_path):
    folder, front = run
    with pytest.raises(InvalidRun, match="must be a plain file, got no such file"):
        pk.compare(folder, tmp_path)
    with pytest.raises(InvalidInput, match="labels must be a list of labels, got 'ab'"):
        pk.compare(front, front, labels="ab")
    with pytest.raises(InvalidInput, match="labels must be a list of labels, got 3"):
        pk.compare(front, front, labels=[3, 4])
    with pytest.raises(InvalidInput, match="there must be at least two fronts, got 0"):
        pk.compare()


def test_a_comparison_tells_who_computed_runs_if_it_differs(run, tmp_path):
    _, front = run
    cluster = {"by": [{"by": "a Dask cluster", "machines": [{"machines": 2, "workers": 4, "processor": "x"}]}]}
    other = replace(front, problem=None, provenance={**front.provenance, "computed": cluster})
    other.save(tmp_path / "cluster")
    comparison = pk.compare(front, tmp_path / "cluster")
    here, there = comparison.differences["computed"]
    assert here == computed_text(front.provenance["computed"])
    assert there == computed_text(cluster)
    assert "4 workers on 2 machines" in there
    assert there in str(comparison)
    assert comparison.fronts[1].folder == tmp_path / "cluster"
    assert "computed" not in pk.compare(front, front).differences
