"""Runs in other processes: failing ones, stored ones, interrupted ones, and those of a cluster."""

from __future__ import annotations

import os
import time
from contextlib import closing
from functools import partial

import pytest

from paretoik.runs.processes import WorkerOptions, WorkerProcesses
from studies import processes
from studies.benchmarks.scaling.local_cluster import local_cluster


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


@pytest.mark.usefixtures("here")
def test_results_have_their_keys_and_errors_are_raised():
    with processes.processes() as executor:
        calls = {("a",): partial(divmod, 7, 2), ("b",): partial(divmod, 9, 4)}
        assert (
            processes.run_each(executor, calls) == processes.run_each(None, calls) == {("a",): (3, 1), ("b",): (2, 1)}
        )
        with pytest.raises(ValueError, match="could not convert"):
            processes.run_each(executor, {("a",): partial(float, "x")})


def test_an_address_where_no_scheduler_can_be_is_refused_in_a_line():
    with pytest.raises(SystemExit, match="cluster must be the address of a Dask"), processes.workers_of("localhost"):
        pass


@pytest.mark.filterwarnings("ignore:cluster. no worker at .* waiting for one")
def test_workers_of_a_cluster_run_seeds_as_processes_of_this_machine_do(tmp_path):
    pytest.importorskip("distributed", reason="Dask is not installed: pip install paretoik[cluster]")

    def run(executor):
        return processes.run_seeds(
            executor,
            divmod,
            lambda seed: {(name,): [seed, len(name)] for name in ("a", "bcd")},
            3,
            limit=60.0,
            empty=str,
        )

    with local_cluster(tmp_path, 1) as cluster, processes.processes(cluster.address) as there:
        found = run(there)
    with processes.processes() as here:
        assert found == run(here) == {("a",): [(0, 0), (1, 0), (2, 0)], ("bcd",): [(0, 0), (0, 1), (0, 2)]}
