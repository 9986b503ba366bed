from __future__ import annotations

import pytest

import paretoik as pk
from paretoik.api.select import select
from paretoik.api.solve import solve
from problems import marcos_2012
from tests.closed_loop.postures import posture


def test_a_front_selects_from_itself(front):
    weights = pk.Weights(torque_norm=1.0)
    selected, choice = select(front, weights)
    assert selected is front
    assert (choice.id, choice.reason) == (front.select(weights).id, front.select(weights).reason)


def test_out_without_a_new_run_is_refused(front, tmp_path):
    with pytest.raises(pk.InvalidInput, match="out must be None unless a closed loop gets other weights than its own"):
        select(front, pk.Weights(torque_norm=1.0), out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_loop_is_not_followed_again_into_its_own_run(tmp_path):
    loop = marcos_2012.loop(3, 0.7, start=posture(3), steps=4, population=12, generations=3)
    front = solve(loop, out=tmp_path)
    before = (tmp_path / "run.json").read_bytes()
    with pytest.raises(pk.InvalidInput, match="out must not be the folder of the source run"):
        select(front, pk.Weights({front.names[0]: 1.0}), out=tmp_path, overwrite=True)
    assert (tmp_path / "run.json").read_bytes() == before
