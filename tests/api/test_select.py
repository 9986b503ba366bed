from __future__ import annotations

import pytest

import paretoik as pk
from paretoik.api.select import select


def test_a_front_answers_itself(front):
    weights = pk.Weights(torque_norm=1.0)
    selected, choice = select(front, weights)
    assert selected is front
    assert (choice.id, choice.reason) == (front.select(weights).id, front.select(weights).reason)


def test_without_a_new_run_there_is_nothing_to_keep(front, tmp_path):
    with pytest.raises(pk.InvalidInput, match="out: wants a closed loop and other weights than its own"):
        select(front, pk.Weights(torque_norm=1.0), out=tmp_path / "run")
    assert not (tmp_path / "run").exists()
