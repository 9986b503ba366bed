"""Runs in other processes: failing ones, stored ones, interrupted ones, and those of a cluster."""

from __future__ import annotations

import os
import time
from contextlib import closing

import pytest

from paretoik.runs.processes import WorkerOptions, WorkerProcesses
from studies import processes


def square(seed):
    """Return a square, or stop at the third."""
    if seed == 3:
        raise KeyboardInterrupt
    return seed**2


@pytest.mark.parametrize(
    ("work", "words", "reason"),
    [
        (time.sleep, [60], "more than 1 s"),
        (os.abort, [], "the last by signal 6"),
        (float, ["x"], "raised ValueError: could not convert string to float: 'x'"),
    ],
)
def test_a_run_that_hangs_or_crashes_is_counted_as_empty(monkeypatch, capsys, work, words, reason):
    monkeypatch.setattr("paretoik.runs.processes.OPTIONS", WorkerOptions(allowed_failures=0, loading=0.0))
    with closing(WorkerProcesses(1)) as executor:
        results = processes.run_seeds(
            executor, work, lambda seed: {("a peer",): words}, 1, limit=1.0, empty=lambda key: [key]
        )
    assert results == {("a peer",): [[("a peer",)]]}
    told = capsys.readouterr().err
    assert "a peer, seed 0: " in told
    assert f"{reason}: counted as empty" in told


@pytest.mark.usefixtures("here")
def test_interrupted_runs_leave_the_seeds_that_are_done(capsys):
    with processes.processes() as executor:
        results = processes.run_seeds(
            executor, square, lambda seed: {("key",): [seed]}, 9, limit=1.0, empty=lambda key: 0
        )
    assert results == {("key",): [0, 1, 4]}
    assert "interrupted: 3 of 9 seeds are done" in capsys.readouterr().err


@pytest.mark.usefixtures("here")
def test_stored_runs_are_not_repeated_and_new_runs_are_stored_at_once():
    stored = {("key", 1): -1}
    with processes.processes() as executor:
        results = processes.run_seeds(
            executor,
            square,
            lambda seed: {("key",): [seed]},
            5,
            limit=1.0,
            empty=lambda key: 0,
            load=lambda key, seed: stored.get((*key, seed)),
            save=lambda key, seed, result: stored.update({(*key, seed): result}),
        )
    assert results == {("key",): [0, -1, 4]}
    assert stored == {("key", 0): 0, ("key", 1): -1, ("key", 2): 4}
