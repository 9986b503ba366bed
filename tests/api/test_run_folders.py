"""Every verb with out= keeps a folder with its settings and its result, which can be opened again."""

from __future__ import annotations

import json
from dataclasses import fields, replace

import numpy as np
import pytest

import paretoik as pk
from paretoik.runs.files import DRAWING, POLYGON, RECORDING, TOOL_PATH, TRACES
from tests.api.problems import PATH, tracking
from tests.capability.test_geodesic import Even
from tests.runs.test_folder import holder


def entries(folder) -> dict:
    return json.loads((folder / "run.json").read_text())


def test_a_plan_is_opened_as_it_was_and_is_no_front(tmp_path):
    problem = tracking(pk.kinetic_energy)
    plan = pk.plan(problem, starts=6, out=tmp_path)
    again = pk.load_plan(tmp_path, problem)
    assert [each.objective for each in again.optima] == [each.objective for each in plan.optima]
    assert [each.label for each in again.optima] == [each.label for each in plan.optima]
    assert all(np.array_equal(a.motion.q, b.motion.q) for a, b in zip(again.optima, plan.optima, strict=True))
    assert (again.levels, dict(again.provenance)) == (plan.levels, dict(plan.provenance))
    assert (tmp_path / DRAWING).stat().st_size > 0
    with pytest.raises(pk.InvalidInput, match="got one that contains the optima of a plan, which load_plan opens"):
        pk.load_front(tmp_path)
    with pytest.raises(pk.InvalidInput, match="got one with another fingerprint"):
        pk.load_plan(tmp_path, tracking(pk.kinetic_energy, velocity=9.0))
    with pytest.raises(pk.InvalidInput, match=r"problem must be the one that was planned in .*, got none"):
        pk.load_plan(tmp_path)
    with pytest.raises(pk.InvalidInput, match="use --overwrite"):
        pk.plan(problem, starts=6, out=tmp_path)


def test_a_damaged_plan_is_refused(tmp_path):
    problem = tracking(pk.kinetic_energy)
    pk.plan(problem, starts=4, out=tmp_path)
    table = tmp_path / "optima.parquet"
    table.write_bytes(table.read_bytes()[:-1])
    with pytest.raises(pk.InvalidInput, match=r"must be the file that run\.json belongs to"):
        pk.load_plan(tmp_path, problem)


def test_a_front_that_a_killed_process_was_to_replace_is_named_and_can_be_opened(front, tmp_path):
    replace(front, problem=None).save(tmp_path)
    process = holder(tmp_path)
    process.kill()
    process.communicate()
    former = tmp_path / ".former-run"
    with pytest.raises(pk.InvalidInput, match=f"of status 'running' without a front; the run that it .* {former}$"):
        pk.load_front(tmp_path)
    assert np.array_equal(pk.Front.load(former).objectives, front.objectives)


def test_an_epsilon_front_and_its_refinement_are_runs_with_recordings(problem, tmp_path):
    front = pk.epsilon_front(problem, points=4, starts=4, out=tmp_path / "front")
    stored = pk.load_front(tmp_path / "front", problem)
    assert np.array_equal(stored.objectives, front.objectives)
    refined = pk.refine(stored, out=tmp_path / "refined")
    said = entries(tmp_path / "refined")
    with pytest.raises(pk.InvalidInput, match="out must not be the folder of the source run"):
        pk.refine(stored, out=tmp_path / "front", overwrite=True)
    assert (said["verb"], said["status"], said["parent"]["verb"]) == ("refine", "refined", "epsilon_front")
    assert said["parent"]["run"] == str(tmp_path / "front")
    assert np.array_equal(pk.load_front(tmp_path / "refined").objectives, refined.objectives)
    assert all((tmp_path / name / RECORDING).stat().st_size > 0 for name in ("front", "refined"))


def test_a_resolved_motion_keeps_its_traces(tmp_path):
    arm, method = pk.arms.tringali_3r(), pk.methods.DampedLeastSquares()
    motion = pk.resolve(arm, PATH, method, start=[0.0, 0.327, -0.754], unreachable="track", out=tmp_path)
    alone = pk.resolve(arm, PATH, method, start=[0.0, 0.327, -0.754], unreachable="track")
    with np.load(tmp_path / "motions.npz") as stored:
        assert np.array_equal(stored["q"][0], motion.q)
    with np.load(tmp_path / TRACES) as traces:
        assert np.array_equal(traces["errors"][0], alone.traces.errors)
    assert entries(tmp_path)["settings"]["method"]["name"] == "DampedLeastSquares"
    assert sum(entries(tmp_path)["counts"]["steps"].values()) == len(PATH.times) - 1


def test_directional_maxima_keep_their_polygon(tmp_path):
    arm, motors = pk.arms.kim_3r(), pk.capability.kim_joint_motors()
    polygon = pk.directional_maxima(arm, motors, (0.1, -0.15), 4, out=tmp_path)
    with np.load(tmp_path / POLYGON) as stored:
        assert np.array_equal(stored["values"], polygon.values)
        assert np.array_equal(stored["q"], polygon.q)
    assert entries(tmp_path)["counts"]["found"] == 4


SPEEDS = {2: Even(np.diag([1.0, 2.0]), np.full(2, -1.0), np.ones(2)), 3: Even(np.eye(3), np.full(3, -1.0), np.ones(3))}


@pytest.mark.parametrize("axes", SPEEDS)
@pytest.mark.parametrize("verb", ["fastest_path", "time_optimal_control"])
def test_tool_paths_are_kept_and_verified_and_are_the_same_without_a_folder(tmp_path, axes, verb):
    find, ends = getattr(pk.capability, verb), (np.full(axes, -0.5), np.linspace(0.4, 0.6, axes))
    settings = {"intervals": 20} if verb == "fastest_path" else {"period": 0.02, "gain": 20.0}
    path, alone = find(SPEEDS[axes], *ends, **settings, out=tmp_path), find(SPEEDS[axes], *ends, **settings)
    with np.load(tmp_path / TOOL_PATH) as stored:
        for each in fields(path):
            assert np.array_equal(stored[each.name], getattr(path, each.name))
            assert each.name == "seconds" or np.array_equal(getattr(alone, each.name), getattr(path, each.name))
        assert np.array_equal(stored["target"], ends[1])
    said = entries(tmp_path)
    assert (said["verb"], said["status"], said["duration"]) == (verb, "path", path.times[-1])
    assert said["settings"].items() >= settings.items()
    assert all((tmp_path / name).stat().st_size > 1000 for name in (RECORDING, DRAWING))
    checks = {each.subject: each.verdict for each in pk.verify(tmp_path).rows}
    assert {checks[name] for name in ("start", "target", "box of the model", "times")} == {"passed"}
    with pytest.raises(pk.InvalidInput, match="use --overwrite"):
        find(SPEEDS[axes], *ends, **settings, out=tmp_path)
    again = find(SPEEDS[axes], *ends, **settings, out=tmp_path, overwrite=True)
    assert np.array_equal(again.times, path.times)
