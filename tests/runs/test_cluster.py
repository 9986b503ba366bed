"""Workers of a real Dask cluster compute their items, even when they are killed, stopped or replaced."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import closing, contextmanager
from dataclasses import replace

import pytest

from paretoik.errors import InvalidInput, SolverFailed
from paretoik.runs.cluster import OPTIONS, Cluster
from paretoik.runs.distribution import Done, Lost, Raised
from paretoik.runs.machine import processor
from studies.benchmarks.scaling.local_cluster import local_cluster
from tests.runs import work
from tests.runs.test_processes import check_that_a_signal_ends, values, wait_until

pytest.importorskip("distributed", reason="Dask is not installed: pip install paretoik[cluster]")
pytestmark = pytest.mark.filterwarnings("ignore:cluster. no worker at .* waiting for one")


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with local_cluster(tmp_path_factory.mktemp("dask"), 2) as cluster:
        yield cluster.address


@pytest.fixture
def cluster(address):
    with closing(Cluster(address)) as opened:
        yield opened


def test_every_item_has_its_reply_whichever_worker_it_comes_from(cluster):
    assert values(cluster.replies(work.scaled, 0.1, range(40))) == {i: 0.1 * i for i in range(40)}
    assert wait_until(lambda: len(cluster.client.nthreads()) == 2, 30.0)
    assert len(set(values(cluster.replies(work.process, None, range(40))).values())) == 2


def test_all_workers_begin_at_once_whatever_tasks_took_before(tmp_path):
    with local_cluster(tmp_path, 5) as running, closing(Cluster(running.address)) as cluster:
        assert wait_until(lambda: len(cluster.client.nthreads()) == 5, 60.0)
        cluster.options = replace(OPTIONS, portion=0.0, overhead=0.0)  # one item per task
        assert len(values(cluster.replies(work.scaled, 0.1, range(50)))) == 50  # too short to be moved to others
        assert values(cluster.replies(work.meet, str(tmp_path), [5] * 5)) == dict.fromkeys(range(5), 5)


def test_what_a_function_raises_comes_back_and_the_others_go_on(cluster):
    replies = dict(cluster.replies(work.refuse, None, range(6)))
    assert [type(replies[i]) for i in range(6)] == [Done, Raised] * 3
    assert str(replies[3].error) == "item 3"


def test_what_a_killed_worker_had_is_computed_by_another(cluster, tmp_path):
    assert values(cluster.replies(work.die_once, str(tmp_path), range(12))) == {i: i * i for i in range(12)}
    assert (tmp_path / "died-3").exists()


@pytest.mark.slow
def test_an_item_that_ends_every_worker_is_lost_and_no_other_is(cluster, tmp_path):
    replies = dict(cluster.replies(work.die_always, str(tmp_path), range(8)))
    assert replies.pop(3) == Lost(cause="4 workers ended on it")
    assert {i: reply.value for i, reply in replies.items()} == {i: i * i for i in range(8) if i != 3}


@pytest.mark.parametrize("function", [work.loop_for_ever, work.hold_the_lock])
def test_an_item_that_takes_too_long_is_ended_and_lost_and_its_worker_lives(cluster, function):
    replies = dict(cluster.replies(function, None, range(5), seconds=0.5))
    assert replies.pop(1) == Lost(cause="it took more than 0.5 s")
    assert {i: reply.value for i, reply in replies.items()} == {0: 0, 2: 2, 3: 3, 4: 4}


def test_a_signal_ends_the_wait_within_a_second(cluster):
    check_that_a_signal_ends(cluster.replies(work.sleep, 1.0, range(40)))
    assert values(cluster.replies(work.scaled, 2.0, [1.0])) == {0: 2.0}


def test_workers_with_another_version_are_refused_by_name(cluster, monkeypatch):
    monkeypatch.setattr("paretoik.runs.cluster.software", lambda: {"numpy": "1.0"})
    with pytest.raises(InvalidInput, match=r"cluster: on every worker numpy must be 1.0, got \d"):
        list(cluster.replies(work.scaled, 1.0, [1.0]))


def test_another_make_of_processor_is_said_once(cluster, monkeypatch):
    monkeypatch.setattr("paretoik.runs.cluster.processor", lambda: ("riscv64",))
    with pytest.warns(RuntimeWarning, match="another make of processor: the run is reproducible only within") as told:
        assert values(cluster.replies(work.scaled, 1.0, [1.0, 2.0])) == {0: 1.0, 1: 2.0}
    assert sum("another make" in str(each.message) for each in told) == 1
    (make,) = cluster.description()["machines"]
    assert (make["machines"], make["processor"]) == (1, " ".join(processor()))


def test_where_no_scheduler_answers_that_is_said_at_once():
    with pytest.raises(InvalidInput, match=r"cluster must be the address of a Dask scheduler, got tcp://127.0.0.1:9"):
        Cluster("tcp://127.0.0.1:9", replace(OPTIONS, connection=1.0))


@pytest.mark.slow
def test_workers_that_never_come_are_waited_for_a_while(tmp_path):
    options = replace(OPTIONS, watch=0.2, patience=1.0)
    with local_cluster(tmp_path, 0) as empty, closing(Cluster(empty.address, options)) as cluster:
        with pytest.raises(SolverFailed, match=r"cluster: no worker at tcp://.* for 1 s; resume continues the run"):
            list(cluster.replies(work.scaled, 1.0, [1.0]))
        empty.start_workers(1)
        with closing(Cluster(empty.address)) as later:
            assert values(later.replies(work.scaled, 2.0, [1.0])) == {0: 2.0}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "told", "reason"),
    [
        (signal.SIGKILL, r"no scheduler at tcp://.*; waiting for one", r"no scheduler at tcp://.* for 3 s"),
        (
            signal.SIGSTOP,
            r"the scheduler at tcp://.* has not answered for 1 s, .*; waiting for it, 3 s at most",
            r"no answer from the scheduler at tcp://.* for 3 s",
        ),
    ],
)
def test_a_scheduler_that_dies_or_freezes_is_noticed(tmp_path, number, told, reason):
    options = replace(OPTIONS, watch=0.2, connection=1.0, patience=3.0)
    with local_cluster(tmp_path, 1) as fragile, closing(Cluster(fragile.address, options)) as cluster:
        assert wait_until(cluster.client.nthreads, 60.0)
        replies = cluster.replies(work.sleep, 0.2, range(100))
        next(replies)
        begin = time.monotonic()
        os.kill(fragile.scheduler.pid, number)
        with pytest.warns(RuntimeWarning, match=told), pytest.raises(SolverFailed, match=reason):
            list(replies)
        assert time.monotonic() - begin < 15.0


@contextmanager
def frozen(process, seconds):
    """Keep a process from running for some seconds, as others do on a busy machine."""
    os.kill(process, signal.SIGSTOP)
    timer = threading.Timer(seconds, os.kill, (process, signal.SIGCONT))
    timer.start()
    try:
        yield
    finally:
        timer.join()


@pytest.mark.slow
def test_a_scheduler_that_is_slow_to_answer_is_waited_for(tmp_path):
    options = replace(OPTIONS, watch=0.2, connection=1.0)
    slow = r"cluster: the scheduler at tcp://.* has not answered for \d s, .*; waiting for it, 60 s at most"
    with local_cluster(tmp_path, 1) as busy:
        with frozen(busy.scheduler.pid, 4.0), pytest.warns(RuntimeWarning, match=slow):
            cluster = Cluster(busy.address, options)
        with closing(cluster):
            assert values(cluster.replies(work.scaled, 2.0, [1.0])) == {0: 2.0}
        with closing(Cluster(busy.address, options)) as cluster:
            replies = cluster.replies(work.sleep, 0.2, range(20))
            next(replies)
            with frozen(busy.scheduler.pid, 4.0), pytest.warns(RuntimeWarning, match=slow):
                assert len(list(replies)) == 19


@pytest.mark.slow
def test_a_signal_ends_the_wait_for_a_scheduler_that_does_not_answer(tmp_path):
    with local_cluster(tmp_path, 0) as busy, frozen(busy.scheduler.pid, 4.0):
        check_that_a_signal_ends(Cluster(busy.address) for _ in range(1))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:cluster. no (scheduler|worker) at")  # a short absence may pass unseen
def test_a_scheduler_that_comes_back_is_given_what_is_left(tmp_path):
    with local_cluster(tmp_path, 1) as fragile, closing(Cluster(fragile.address)) as cluster:
        assert wait_until(cluster.client.nthreads, 60.0)
        replies = cluster.replies(work.slow_process, "shared", range(30))
        _, first = next(replies)
        fragile.restart_scheduler()
        fragile.start_workers(1)
        rest = values(replies)
        assert len(rest) == 29
        assert first.value not in set(rest.values())
