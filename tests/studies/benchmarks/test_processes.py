"""Runs in other processes: those that fail, and those that are interrupted."""

from __future__ import annotations

import os
import time
from multiprocessing import get_context

import pytest
from pebble import ProcessPool

from studies.benchmarks import processes


@pytest.mark.parametrize(
    ("work", "words", "reason"),
    [
        (time.sleep, [60], "did not end within 1 s"),
        (os.abort, [], "crashed"),
        (float, ["x"], "raised ValueError: could not convert string to float: 'x'"),
    ],
)
def test_a_run_that_hangs_or_crashes_is_counted_as_empty(capsys, work, words, reason):
    with ProcessPool(1, context=get_context("spawn")) as pool:
        results = processes.run_seeds(
            pool, work, lambda seed: {("a peer",): words}, 1, limit=1.0, empty=lambda key: [key]
        )
    assert results == {("a peer",): [[("a peer",)]]}
    assert f"a peer, seed 0 {reason}: counted as empty" in capsys.readouterr().err


@pytest.mark.usefixtures("here")
def test_interrupted_runs_leave_the_seeds_that_are_done(capsys):
    def square(seed):
        if seed == 3:
            raise KeyboardInterrupt
        return seed**2

    with processes.processes() as pool:
        results = processes.run_seeds(pool, square, lambda seed: {("key",): [seed]}, 9, limit=1.0, empty=lambda key: 0)
    assert results == {("key",): [0, 1, 4]}
    assert "interrupted in seed 4 of 9" in capsys.readouterr().err


def test_every_method_comes_first_in_its_turn():
    orders = [processes.rotated("abc", turn) for turn in range(4)]
    assert ["".join(order) for order in orders] == ["abc", "bca", "cab", "abc"]
