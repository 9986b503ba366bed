"""Workers on this machine compute their items, even when they are killed, stopped or replaced."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import closing
from pathlib import Path

import pytest

from paretoik.errors import InvalidInput
from paretoik.runs.distribution import Done, Lost, Raised
from paretoik.runs.processes import WorkerProcesses
from paretoik.stop_flag import STOP, Interrupted
from tests.runs import work

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def workers():
    with closing(WorkerProcesses(2)) as opened:
        yield opened


def values(replies) -> dict[int, object]:
    return {place: reply.value for place, reply in replies}


def is_alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def wait_until(condition, seconds: float) -> bool:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return bool(condition())


def check_that_a_signal_ends(replies) -> None:
    """The process that waits for replies, which take minutes, learns of a signal within a second."""

    def stop() -> None:
        stopped.append(time.monotonic())
        STOP[0] = signal.SIGTERM

    stopped: list[float] = []
    timer = threading.Timer(1.0, stop)
    timer.start()
    try:
        with pytest.raises(Interrupted):
            list(replies)
        assert time.monotonic() - stopped[0] < 1.0
    finally:
        timer.join()
        STOP[0] = 0


def test_every_item_has_its_reply_whichever_worker_it_comes_from(workers):
    assert values(workers.replies(work.scaled, 0.1, range(40))) == {i: 0.1 * i for i in range(40)}
    assert len(set(values(workers.replies(work.process, None, range(20))).values())) == 2


def test_what_is_shared_goes_to_every_worker_once(workers):
    shared = list(range(1000))
    seen = [values(workers.replies(work.shared_identity, shared, range(20))) for _ in range(2)]
    assert len({pair for each in seen for pair in each.values()}) <= 2


def test_what_a_function_raises_comes_back_and_the_others_go_on(workers):
    replies = dict(workers.replies(work.refuse, None, range(6)))
    assert [type(replies[i]) for i in range(6)] == [Done, Raised] * 3
    assert str(replies[3].error) == "item 3"


def test_a_result_that_cannot_be_sent_is_an_error_not_a_wait(workers):
    ((_, reply),) = workers.replies(work.unpicklable, None, [0])
    assert isinstance(reply.error, InvalidInput)


def test_what_cannot_be_sent_is_refused_by_name(workers):
    with pytest.raises(InvalidInput, match="workers: a problem cannot be pickled: TypeError"):
        list(workers.replies(work.scaled, threading.Lock(), [1.0]))


def test_what_a_killed_worker_had_is_computed_by_another(workers, tmp_path):
    assert values(workers.replies(work.die_once, str(tmp_path), range(12))) == {i: i * i for i in range(12)}
    assert (tmp_path / "died-3").exists()


def test_an_item_that_ends_four_workers_is_lost_with_its_cause_and_no_other_is(workers, tmp_path):
    replies = dict(workers.replies(work.die_always, str(tmp_path), range(8)))
    assert replies.pop(3) == Lost(cause="4 workers ended on it, the last by signal 9")
    assert {i: reply.value for i, reply in replies.items()} == {i: i * i for i in range(8) if i != 3}
    assert (tmp_path / "deaths").read_text() == "xxxx"


@pytest.mark.parametrize("function", [work.loop_for_ever, work.hold_the_lock])
def test_an_item_that_takes_too_long_is_ended_and_lost(workers, function):
    list(workers.replies(function, None, [0, 2, 4]))  # no worker is new
    begin = time.monotonic()
    replies = dict(workers.replies(function, None, range(5), seconds=0.5))
    assert replies.pop(1) == Lost(cause="it took more than 0.5 s")
    assert {i: reply.value for i, reply in replies.items()} == {0: 0, 2: 2, 3: 3, 4: 4}
    assert time.monotonic() - begin < 20.0


def test_a_signal_ends_what_workers_compute_within_a_second(workers):
    check_that_a_signal_ends(workers.replies(work.hold_the_lock, None, [1, 1]))
    assert values(workers.replies(work.scaled, 2.0, [1.0])) == {0: 2.0}


def test_workers_end_when_they_are_closed():
    with closing(WorkerProcesses(2)) as ended:
        processes = set(values(ended.replies(work.process, None, range(20))).values())
    assert processes
    assert not any(map(is_alive, processes))


def test_workers_end_with_a_process_that_is_killed(tmp_path):
    client = subprocess.Popen([sys.executable, "-m", "tests.runs.work", str(tmp_path)], cwd=ROOT)
    try:
        assert wait_until(lambda: len(list(tmp_path.iterdir())) == 2, 60.0)
        processes = [int(entry.name) for entry in tmp_path.iterdir()]
        assert all(map(is_alive, processes))
    finally:
        os.kill(client.pid, signal.SIGKILL)
        client.wait()
    assert wait_until(lambda: not any(map(is_alive, processes)), 1.0)


def test_workers_have_one_thread_each_and_ignore_an_interruption_from_the_keyboard(workers):
    facts = values(workers.replies(work.surroundings, None, [0]))[0]
    assert facts == {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "threads": 1, "ignores": True}


PLANTED = "secrets", "queue", "random", "numpy", "json", "socket", "rerun", "cloudpickle", "dataclasses"
PROBLEM = """
import helpers
from pymoo.core.problem import ElementwiseProblem

class Bowl(ElementwiseProblem):
    def __init__(self):
        super().__init__(n_var=2, n_obj=2, xl=0.0, xu=1.0)

    def _evaluate(self, x, out):
        out["F"] = helpers.values(x)
"""


@pytest.mark.parametrize("options", [("--workers=2",), ("--evaluation-timeout=60",), ()])
def test_files_beside_a_problem_never_run_in_place_of_modules_of_python_or_libraries(tmp_path, options):
    mark, place = tmp_path / "mark", tmp_path / "project"
    place.mkdir()
    for name in PLANTED:
        (place / f"{name}.py").write_text(f"open({str(mark)!r}, 'a').write({name!r})")
    (place / "helpers.py").write_text("def values(x):\n    return [x[0], (1 - x[0]) ** 2 + x[1]]\n")
    (place / "mine.py").write_text(PROBLEM)
    words = ["solve", "mine.py:Bowl", "--out=run", "--population=8", "--generations=2", *options]
    command = [sys.executable, "-P", "-m", "paretoik", *words]
    ended = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    assert not mark.exists(), mark.read_text()
    assert (place / "run" / "review.rrd").stat().st_size > 0
