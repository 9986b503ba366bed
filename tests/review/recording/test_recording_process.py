"""The run and its recording process: their ends, or a full disk, cost neither the run nor the recorded data."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import paretoik as pk
from paretoik.front.front import Front
from paretoik.review.recording.recorder import Generation, Recorder, RecorderOptions, SearchedFront, SearchEnd
from paretoik.runs.machine import child_command
from tests.review.children import children, wait_for_end
from tests.review.conftest import sphere
from tests.review.disks import small_disk
from tests.review.reading import read, rows

IMPATIENT = RecorderOptions(silence=2.0)


def recorder(file: Path, *, n_obj: int = 2, options: RecorderOptions | None = None) -> Recorder:
    names = tuple(f"f{axis}" for axis in range(n_obj))
    scene = SearchedFront(names=names, units=("",) * n_obj, maximised=(False,) * n_obj)
    return Recorder(file, title="a: test", scene=scene, options=options or RecorderOptions())


def generation(number: int, *, points: int = 5, n_obj: int = 2) -> Generation:
    F = sphere(points, n_obj, number)
    ids = np.arange(points) + 1000 * number
    return Generation(number=number, population=F + 1.0, front=F, front_ids=ids, reference=np.full(n_obj, 3.0))


def front_of(last: Generation) -> Front:
    n_obj = last.front.shape[1]
    names, units = [f"f{axis}" for axis in range(n_obj)], [""] * n_obj
    return Front(
        ids=last.front_ids, objectives=last.front, names=names, units=units, maximised=[False] * n_obj, problem=print
    )


def fronts(file: Path) -> dict[int, np.ndarray]:
    return rows(read(file)["/search/front"], "generation", "F")


def answered(started: Recorder) -> None:
    """Wait until all sent messages have been answered."""
    process = started._process
    until = time.monotonic() + 60.0
    while process._answered < process._sent and time.monotonic() < until:
        process.pump()
        time.sleep(0.02)
    assert process._answered == process._sent


def child_of(started: Recorder) -> int:
    return started._process._child.pid


@contextmanager
def silence() -> Iterator[None]:
    """Check that there is no warning meanwhile."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def test_sent_messages_are_in_the_file_and_the_last_front_is_the_returned_one(tmp_path):
    started = recorder(tmp_path / "review.rrd", n_obj=3)
    sent = [generation(number, n_obj=3) for number in range(1, 6)]
    for each in sent:
        started.record(each)
    front = front_of(generation(77, points=9, n_obj=3))
    started.finish(SearchEnd(front=front, choice=front.choice(2, "because")))
    started.close()
    F = fronts(tmp_path / "review.rrd")
    assert sorted(F) == [1, 2, 3, 4, 5]
    for each in sent[:-1]:
        np.testing.assert_array_equal(F[each.number], each.front.ravel())
    np.testing.assert_array_equal(F[5], front.objectives.ravel())
    assert [file.name for file in tmp_path.iterdir()] == ["review.rrd"]


def test_a_recording_without_an_end_is_completed_with_what_it_has(tmp_path):
    started = recorder(tmp_path / "review.rrd")
    for number in range(4):
        started.record(generation(number))
    started.close()
    started.close()
    assert sorted(fronts(tmp_path / "review.rrd")) == [0, 1, 2, 3]


IMPORTS = """
import sys
import paretoik.front.storage, paretoik.runs.folder
import paretoik.review.recording.recorder
print(sorted({"rerun", "matplotlib", "pymoo", "pyarrow", "moocore"} & set(sys.modules)))
"""


def test_nothing_heavy_is_imported_before_it_is_used():
    ended = subprocess.run([sys.executable, "-c", IMPORTS], capture_output=True, text=True, check=True)
    assert ended.stdout == "[]\n"


KILLED = """
import sys, os, signal, time
import numpy as np
from paretoik.review.recording.recorder import Generation, Recorder, SearchedFront
scene = SearchedFront(names=("a", "b"), units=("", ""), maximised=(False, False))
recorder = Recorder(sys.argv[1], title="killed", scene=scene)
for number in range(50):
    F = np.array([[1.0, 2.0 - 0.01 * number], [2.0 - 0.01 * number, 1.0]])
    recorder.record(Generation(number=number, population=F, front=F, front_ids=np.arange(2)))
process = recorder._process
while process._answered < 20:
    process.pump()
if "fork" in sys.argv and os.fork() == 0:  # holds the run's end of the pipe
    time.sleep(100)
assert not {"rerun", "matplotlib", "pymoo", "pyarrow"} & set(sys.modules)  # only the other process loads them
print(process._answered - 1, process._child.pid, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("how", ["alone", "fork"])
def test_after_the_run_was_killed_the_recording_is_completed_with_all_that_was_answered(how, tmp_path):
    file = tmp_path / "review.rrd"
    run = subprocess.Popen(
        [sys.executable, "-c", KILLED, file, how], stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    count, child = map(int, run.stdout.readline().split())
    assert run.wait() == -signal.SIGKILL
    try:
        wait_for_end(child)
    finally:
        if how == "fork":
            os.killpg(run.pid, signal.SIGKILL)
        run.stdout.close()
    assert count >= 19
    assert set(range(count)) <= set(fronts(file))  # strict: a missing footer would be a warning, which is an error
    assert [left.name for left in tmp_path.iterdir()] == ["review.rrd"]


def test_signals_that_end_the_run_leave_the_process_that_records_at_work(tmp_path):
    started = recorder(tmp_path / "review.rrd")
    answered(started)
    assert os.getpgid(child_of(started)) != os.getpgid(0)  # so that Ctrl-C in the terminal does not reach it
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        os.kill(child_of(started), number)
    started.record(generation(1))
    started.close()
    assert sorted(fronts(tmp_path / "review.rrd")) == [1]


def test_a_killed_child_gives_one_warning_and_the_run_continues(tmp_path):
    started = recorder(tmp_path / "review.rrd")
    started.record(generation(1))
    os.kill(child_of(started), signal.SIGKILL)
    with pytest.warns(RuntimeWarning, match=r"review\.rrd: recording stopped, the run continues: .* SIGKILL"):
        started.finish(SearchEnd(front=front_of(generation(1))))
    with silence():
        started.record(generation(2))
        started.close()


def test_a_child_that_hangs_is_given_up_after_some_seconds_without_the_run_waiting(tmp_path):
    started = recorder(tmp_path / "review.rrd", options=IMPATIENT)
    answered(started)
    child = child_of(started)
    os.kill(child, signal.SIGSTOP)
    longest = 0.0

    def run() -> None:
        nonlocal longest
        until = time.monotonic() + 20.0
        while child in children(os.getpid()) and time.monotonic() < until:
            before = time.process_time()
            started.record(generation(1, points=500))
            longest = max(longest, time.process_time() - before)
            time.sleep(0.05)

    with pytest.warns(RuntimeWarning, match="the run continues: the recording process gave no answer within 2 s"):
        run()
    assert child not in children(os.getpid())
    assert longest < 0.1
    with silence():
        started.close()


def test_a_queue_that_grows_too_long_keeps_spread_generations_and_says_so(tmp_path):
    started = recorder(tmp_path / "review.rrd", options=RecorderOptions(queue=100_000, pipe=4096, points=2000))
    answered(started)
    os.kill(child_of(started), signal.SIGSTOP)
    for number in range(1, 301):
        started.record(generation(number, points=50))
        assert sum(len(content) for content, _ in started._process._queue) < 110_000
    os.kill(child_of(started), signal.SIGCONT)
    started.finish(SearchEnd(front=front_of(generation(300, points=50))))
    started.close()
    kept = sorted(fronts(tmp_path / "review.rrd"))
    assert 10 < len(kept) < 300
    assert (kept[0], kept[-1]) == (1, 300)
    (note,) = read(tmp_path / "review.rrd")["/notes/left_out"]
    assert f"{len(kept)} of its 300 generations are kept here" in str(note.to_pydict())


def test_a_missing_rerun_gives_a_warning_and_the_run_continues(tmp_path, monkeypatch):
    def without_rerun(module):
        *command, code = child_command(module)
        return [*command, f"import sys; sys.modules['rerun'] = None; {code}"]

    monkeypatch.setattr("paretoik.review.recording.recorder.child_command", without_rerun)
    started = recorder(tmp_path / "review.rrd")
    started.record(generation(1))
    with pytest.warns(RuntimeWarning, match="the run continues: import of rerun halted"):
        started.close()
    assert not (tmp_path / "review.rrd").exists()


def test_a_missing_folder_gives_one_warning(tmp_path):
    started = recorder(tmp_path / "missing" / "review.rrd")
    with pytest.warns(RuntimeWarning, match=r"missing/review\.rrd: recording stopped, the run continues: No such file"):
        started.finish(SearchEnd(front=None))
    with silence():
        started.close()


def test_an_unsendable_message_gives_a_warning_and_recorded_data_stay(tmp_path):
    started = recorder(tmp_path / "review.rrd")
    started.record(generation(1))
    with pytest.warns(RuntimeWarning, match="the run continues: .*lambda"):
        started.record(lambda: None)
    with silence():
        started.record(generation(2))
        started.close()
    assert sorted(fronts(tmp_path / "review.rrd")) == [1]


def test_an_undrawable_message_gives_a_warning_and_recorded_data_stay(tmp_path):
    started = recorder(tmp_path / "review.rrd")
    for number in range(3):
        started.record(generation(number))
    started.record(generation(3, n_obj=3))
    with pytest.warns(RuntimeWarning, match="the run continues: ") as warned:
        started.close()
    assert len(warned) == 1
    assert 0 in fronts(tmp_path / "review.rrd")  # the last drawing without it


def test_a_plan_whose_recording_fails_is_complete(tmp_path):
    path = pk.line([0.6, -0.1], [0.4, 0.4], duration=1.0, samples=11)
    problem = pk.Tracking(pk.Arm.planar(lengths=[0.3, 0.3, 0.25]), path, objectives=[pk.joint_travel])

    def kill(progress) -> None:
        if progress.stage == "sample":
            for child in children(os.getpid()):
                os.kill(child, signal.SIGKILL)

    with pytest.warns(RuntimeWarning, match="recording stopped, the run continues"):
        found = pk.plan(problem, starts=2, out=tmp_path, observe=kill)
    again, alone = pk.load_plan(tmp_path, problem), pk.plan(problem, starts=2, observe=False)
    for other in (again, alone):
        assert [each.objective for each in other.optima] == [each.objective for each in found.optima]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only the superuser mounts a disk")
def test_a_full_disk_ends_the_recording_with_its_cause_and_leaves_it_complete(tmp_path):
    with small_disk(tmp_path / "disk", "2m") as disk:
        started = recorder(disk / "review.rrd", n_obj=4)
        started.record(generation(0, points=400, n_obj=4))
        answered(started)
        started.record(generation(1, points=400, n_obj=4))
        answered(started)  # the first one is drawn
        (disk / "other").write_bytes(b"0" * (shutil.disk_usage(disk).free - 20_000))
        with pytest.warns(RuntimeWarning, match="the run continues: No space left on device") as warned:
            started.finish(SearchEnd(front=front_of(generation(1, n_obj=4))))
        started.close()
        assert len(warned) == 1
        assert sorted(file.name for file in disk.iterdir()) == ["other", "review.rrd"]
        assert 0 in fronts(disk / "review.rrd")


@pytest.mark.skipif(not hasattr(resource, "prlimit"), reason="the system limits no files of other processes")
def test_a_disk_that_is_full_although_it_says_otherwise_ends_the_recording_too(tmp_path):
    started = recorder(tmp_path / "review.rrd", options=IMPATIENT)
    for number in range(3):
        started.record(generation(number))
    answered(started)
    child = child_of(started)
    resource.prlimit(child, resource.RLIMIT_FSIZE, (20_000, 20_000))

    def run() -> None:
        for number in range(3, 60):
            started.record(generation(number, points=300))
        started.finish(SearchEnd(front=front_of(generation(1))))
        started.close()

    with pytest.warns(RuntimeWarning, match="recording stopped, the run continues") as warned:
        run()
    assert len(warned) == 1
    assert child not in children(os.getpid())
