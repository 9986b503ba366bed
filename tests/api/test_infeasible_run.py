"""The folder of a run that found nothing feasible is read, or refused in one line, whatever it contains."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
import pytest

import paretoik as pk
from paretoik.api.report import read_infeasible
from paretoik.api.result import ENTRY
from paretoik.errors import InvalidInput, InvalidRun
from paretoik.runs.files import NEAREST, array_bytes, write_run
from tests.api.problems import tracking

ENERGY = {"name": "energy", "unit": "J", "maximised": False, "value": 2.0}
MOTION = {
    "id": np.zeros(1, dtype=int),
    "joint_names": np.array(["shoulder", "elbow"]),
    "time": np.linspace(0.0, 1.0, 5)[None],
    "q": np.zeros((1, 5, 2)),
}


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a run with an entry and arrays of its least-violating motion."""

    def write(entry: Any, **arrays: np.ndarray) -> Any:
        if arrays:
            (tmp_path / NEAREST).write_bytes(content := array_bytes(arrays))
            entry = {**entry, "digest": hashlib.sha256(content).hexdigest()}
        write_run(tmp_path, {"status": "Infeasible", "reason": "too fast", ENTRY: entry})
        return tmp_path

    return write


def test_an_infeasible_run_is_read_as_it_was_written(write):
    folder = write({"broken": ["velocity by 3 % of its range"], "objectives": [ENERGY]}, **MOTION)
    run = read_infeasible(folder)
    assert (run.reason, run.broken) == ("too fast", ("velocity by 3 % of its range",))
    assert run.nearest.objectives.tolist() == [[2.0]]
    assert run.nearest.motions.q.shape == (1, 5, 2)


def test_without_a_motion_the_front_is_empty(write):
    run = read_infeasible(write({"broken": [], "objectives": [{**ENERGY, "value": None}]}))
    assert len(run.nearest) == 0
    assert run.nearest.names == ("energy",)


@pytest.mark.parametrize(
    "entry",
    [
        3,
        {"broken": [], "objectives": [{"name": "energy"}]},
        {"broken": [], "objectives": [{**ENERGY, "value": [1.0, 2.0]}]},
        {"broken": [], "objectives": [ENERGY], "digest": "0" * 64},
    ],
)
def test_an_entry_of_another_kind_is_refused_in_a_line(write, entry):
    with pytest.raises(InvalidInput) as refused:
        read_infeasible(write(entry))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "change",
    [
        {"q": np.zeros((1, 5))},
        {"q": np.full((1, 5, 2), np.nan)},
        {"time": np.zeros((1, 4))},
        {"id": np.zeros(2, dtype=int)},
    ],
)
def test_arrays_that_are_no_motion_are_refused_in_a_line(write, change):
    with pytest.raises(InvalidInput) as refused:
        read_infeasible(write({"broken": [], "objectives": [ENERGY]}, **{**MOTION, **change}))
    assert "\n" not in str(refused.value)


def test_a_motion_that_was_changed_is_refused(write):
    folder = write({"broken": [], "objectives": [ENERGY]}, **MOTION)
    (folder / NEAREST).write_bytes(array_bytes({**MOTION, "q": np.ones((1, 5, 2))}))
    with pytest.raises(InvalidRun, match=r"least_violating\.npz"):
        read_infeasible(folder)


def test_a_link_in_the_motions_place_is_refused(write, tmp_path):
    folder = write({"broken": [], "objectives": [ENERGY]}, **MOTION)
    (folder / NEAREST).rename(tmp_path / "elsewhere.npz")
    (folder / NEAREST).symlink_to(tmp_path / "elsewhere.npz")
    with pytest.raises(InvalidRun, match="link"):
        read_infeasible(folder)


def test_what_a_verb_leaves_is_read_with_the_motion_of_its_error(tmp_path):
    with pytest.raises(pk.Infeasible) as refused:
        pk.plan(tracking(pk.kinetic_energy, velocity=1.0), starts=3, out=tmp_path / "run", observe=False)
    run = read_infeasible(tmp_path / "run")
    assert run.reason == str(refused.value)
    assert np.array_equal(run.nearest.motions.q[0], refused.value.motion.q)
