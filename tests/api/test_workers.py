"""Verbs that compute in workers return the same results, bit for bit."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import InvalidInput
from paretoik.runs.distribution import distributing
from paretoik.runs.executor import open_executor
from paretoik.runs.files import CHECKPOINT, JOURNAL, RUN
from paretoik.runs.machine import processor
from paretoik.runs.processes import WorkerProcesses
from studies.benchmarks.scaling.local_cluster import local_cluster
from tests.api.problems import QUICK, tracking
from tests.api.resumed_runs import PROBLEMS, Deadly, Hanging, Slow, run
from tests.api.test_resume import ENTRIES, check_same, killed

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def executor():
    with closing(WorkerProcesses(2)) as opened:
        yield opened


@pytest.mark.filterwarnings("ignore:workers save no time")
@pytest.mark.parametrize(
    "verb",
    [
        "solve",
        "plan",
        "refine",
        *(
            pytest.param(verb, marks=pytest.mark.slow)
            for verb in PROBLEMS
            if verb not in ("solve", "plan", "refine", "loop")
        ),
    ],
)
def test_workers_give_the_same_result_bit_for_bit(verb, executor, tmp_path):
    alone = run(verb, tmp_path / "alone")
    with distributing(executor):
        distributed = run(verb, tmp_path / "workers")
    check_same(distributed, alone)
    assert told(tmp_path / "alone") == ["this process"]
    assert told(tmp_path / "workers") == ["worker processes"]
    assert distributed.provenance["computed"]["by"][0]["workers"] == 2


def told(folder: Path) -> list[str]:
    """Return who computed a run; all of them give the same bits on this machine."""
    computed = json.loads((folder / RUN).read_text())["computed"]
    assert computed["reproducible"] == "bit for bit"
    return [each["by"] for each in computed["by"]]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    pytest.importorskip("distributed", reason="Dask is not installed: pip install paretoik[cluster]")
    with local_cluster(tmp_path_factory.mktemp("dask"), 2) as started:
        yield started


@pytest.mark.filterwarnings("ignore:(workers save no time|cluster. no worker at)")
@pytest.mark.parametrize(
    "verb",
    ["solve", *(pytest.param(verb, marks=pytest.mark.slow) for verb in ("plan", "epsilon_front", "refine", "islands"))],
)
def test_a_cluster_gives_the_same_result_bit_for_bit(verb, cluster, tmp_path):
    alone = run(verb, tmp_path / "alone")
    with open_executor(None, cluster.address):
        distributed = run(verb, tmp_path / "cluster")
    check_same(distributed, alone)
    assert told(tmp_path / "cluster") == ["Dask cluster"]
    (make,) = distributed.provenance["computed"]["by"][0]["machines"]
    assert (make["processor"], make["machines"]) == (" ".join(processor()), 1)
    assert make["workers"] in (1, 2)


@pytest.mark.filterwarnings("ignore:workers save no time")
@pytest.mark.parametrize("verb", ["refine", pytest.param("solve", marks=pytest.mark.slow)])
def test_a_killed_run_resumes_with_another_number_of_workers(verb, executor, tmp_path):
    whole = run(verb, tmp_path / "whole")
    killed(verb, tmp_path / "killed", ENTRIES[verb])
    with distributing(executor):
        check_same(pk.resume(tmp_path / "killed", PROBLEMS[verb]()), whole)
    assert told(tmp_path / "killed") == ["this process", "worker processes"]


def test_rows_that_workers_evaluated_are_there_for_a_run_resumed_without_workers(tmp_path):
    counted, folder = tmp_path / "rows", tmp_path / "killed"
    script = (
        "import sys; from pathlib import Path; import paretoik as pk; "
        "from tests.api.resumed_runs import Slow, kill_after; kill_after(2); "
        "pk.solve(Slow(Path(sys.argv[1]), seconds=0.3), population=12, generations=2, out=sys.argv[2], workers=2)"
    )
    command = [sys.executable, "-c", script, str(counted), str(folder)]
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert process.returncode == -signal.SIGKILL, process.stderr
    before = len(counted.read_text())
    assert 0 < before < 12
    resumed = pk.resume(folder, Slow(counted, seconds=0.3))
    whole = pk.solve(Slow(tmp_path / "whole"), population=12, generations=2)
    assert np.array_equal(resumed.objectives, whole.objectives)
    anew = len(counted.read_text()) - before
    assert anew < 2 * 12 + 1  # the first row is evaluated once more, known ones of the others are not


def test_a_row_that_takes_too_long_has_failed_and_the_search_goes_on():
    front = pk.solve(Hanging(), population=10, generations=2, seed=1, evaluation_timeout=0.3)
    counts = front.provenance["counts"]
    assert counts["failed"] == 1
    assert counts["first_cause"] == "it took more than 0.3 s"
    assert counts["evaluations"] == 20
    assert front.provenance["settings"]["evaluation_timeout"] == 0.3


@pytest.mark.filterwarnings("ignore:workers save no time")
def test_a_row_that_ends_every_worker_has_failed_and_the_search_goes_on():
    front = pk.solve(Deadly(), population=10, generations=2, seed=1, workers=2)
    assert front.provenance["counts"]["failed"] == 1
    assert front.provenance["counts"]["first_cause"] == "4 workers ended on it, the last by signal 11"


def test_ctrl_c_ends_a_search_in_workers_within_a_second_and_leaves_no_process(tmp_path):
    counted, folder = tmp_path / "rows", tmp_path / "run"
    script = (
        "import sys; from pathlib import Path; import paretoik as pk; from tests.api.resumed_runs import Slow; "
        "pk.solve(Slow(Path(sys.argv[1]), seconds=5.0), population=12, generations=2, out=sys.argv[2], workers=2)"
    )
    command = [sys.executable, "-c", script, str(counted), str(folder)]
    process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.DEVNULL, start_new_session=True)
    while not counted.exists():
        assert process.poll() is None
        time.sleep(0.05)
    begin = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    process.wait(10.0)
    assert time.monotonic() - begin < 2.0
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)
    assert (folder / CHECKPOINT / JOURNAL).exists()
    assert json.loads((folder / RUN).read_text())["status"] == "SIGINT"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"workers": 0}, "workers must be an integer of at least 1, got 0"),
        ({"workers": 2, "cluster": "tcp://localhost:8786"}, "workers must be None with a cluster"),
        ({"cluster": "localhost"}, "cluster must be the address of a Dask scheduler, as tcp://HOST:PORT, got"),
        ({"evaluation_timeout": 0.0}, "evaluation_timeout: "),
    ],
)
def test_invalid_workers_addresses_and_times_are_refused(arguments, words, tmp_path):
    with pytest.raises(InvalidInput, match=words):
        pk.solve(tracking(), **QUICK, **arguments, out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_warning_says_that_workers_do_not_pay_for_quick_evaluations(monkeypatch, tmp_path):
    monkeypatch.setattr("paretoik.runs.distribution.TRIAL", 0.2)
    with pytest.warns(RuntimeWarning, match="workers save no time: a task takes"):
        pk.solve(Slow(tmp_path / "rows", seconds=0.0), population=12, generations=90, stagnation=False, workers=2)


PROBLEM = """
from pymoo.core.problem import ElementwiseProblem

from helping import bend


class Bent(ElementwiseProblem):
    def __init__(self):
        super().__init__(n_var=2, n_obj=2, xl=0.0, xu=1.0)

    def _evaluate(self, x, out):
        out["F"] = [x[0], bend(x)]


def bent() -> Bent:
    return Bent()
"""


@pytest.mark.parametrize("where", ["workers", "cluster"])
def test_a_problem_of_a_users_files_reaches_the_workers_as_it_was_loaded(where, request, tmp_path):
    (tmp_path / "mine.py").write_text(PROBLEM)
    (tmp_path / "helping.py").write_text("SHIFT = 1.0\n\n\ndef bend(x):\n    return (SHIFT - x[0]) ** 2 + x[1]\n")
    sizes = ["--population", "8", "--generations", "2", "--quiet"]
    option = ["--workers", "2"] if where == "workers" else ["--cluster", request.getfixturevalue("cluster").address]
    for out, more in (("alone", []), (where, option)):
        command = [sys.executable, "-m", "paretoik", "solve", "mine.py:bent", "--out", out, *sizes, *more]
        process = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert process.returncode == 0, process.stderr
    alone, distributed = (pk.Front.load(tmp_path / out) for out in ("alone", where))
    assert np.array_equal(distributed.objectives, alone.objectives)
    assert distributed.provenance["counts"]["failed"] == 0
