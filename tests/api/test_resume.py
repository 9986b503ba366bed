"""A stopped or killed run resumes, and has the result that it would have had."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pymoo.algorithms.moo.nsga2 import NSGA2

import paretoik as pk
from paretoik.errors import InvalidInput, InvalidRun
from paretoik.runs.files import CHECKPOINT, FORMER, JOURNAL, RUN
from paretoik.runs.journal import HEAD
from tests.api.problems import tracking
from tests.api.resumed_runs import PROBLEMS, Slow, run
from tests.search.problems import Parabolas

ROOT = Path(__file__).parents[2]
ENTRIES = {  # of the journal when the process is killed
    "search": 7,
    "solve": 30,
    "solve from motions": 3,
    "islands": 18,
    "loop": 9,
    "plan": 8,
    "epsilon_front": 14,
    "refine": 5,
}


SEARCHES = ("search", "solve", "solve from motions", "islands")


def killed(verb: str, folder: Path, entries: int) -> None:
    """Run a verb into a folder in a process that is killed before its end."""
    command = [sys.executable, "-m", "tests.api.resumed_runs", verb, str(folder), str(entries)]
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert process.returncode == -signal.SIGKILL, process.stderr


def check_same_front(resumed: pk.Front, whole: pk.Front) -> None:
    for name in ("ids", "objectives", "genes", "violation", "ranges"):
        assert np.array_equal(getattr(resumed, name), getattr(whole, name)), name
    assert np.array_equal(resumed.motions.q, whole.motions.q)
    assert (resumed.certificates is None) == (whole.certificates is None)
    for name in () if whole.certificates is None else ("status", "reason"):
        assert np.array_equal(getattr(resumed.certificates, name), getattr(whole.certificates, name)), name
    for name in () if whole.certificates is None else ("criticality", "weights", "exchange_rates"):
        values = (getattr(front.certificates, name) for front in (resumed, whole))
        assert np.array_equal(*values, equal_nan=True), name


def check_same(resumed: pk.Front | pk.Plan, whole: pk.Front | pk.Plan) -> None:
    if isinstance(whole, pk.Front):
        check_same_front(resumed, whole)
    else:
        assert len(resumed.optima) == len(whole.optima)
        for one, other in zip(resumed.optima, whole.optima, strict=True):
            assert (one.objective, one.label, one.status) == (other.objective, other.label, other.status)
            assert np.array_equal(one.motion.q, other.motion.q)
    differ = {"counts", "refined", "parent", "computed"}
    former, now = (
        {key: value for key, value in each.provenance.items() if key not in differ} for each in (whole, resumed)
    )
    assert now == former


def flip_a_bit(folder: Path, frame: int) -> None:
    """Flip a bit in the middle of a frame of a run's journal; the last frames are counted from the end."""
    journal, places = folder / CHECKPOINT / JOURNAL, [0]
    content = bytearray(journal.read_bytes())
    while places[-1] < len(content):
        places.append(places[-1] + HEAD.size + HEAD.unpack_from(content, places[-1])[2])
    begin, end = places[:-1][frame], places[1:][frame]
    content[(begin + end) // 2] ^= 1
    journal.write_bytes(content)


@pytest.mark.parametrize("verb", PROBLEMS)
def test_a_killed_run_whose_journal_is_damaged_resumes_bit_for_bit(verb, tmp_path):
    whole = run(verb, tmp_path / "whole")
    killed(verb, tmp_path / "killed", ENTRIES[verb])
    assert json.loads((tmp_path / "killed" / RUN).read_text())["status"] in ("running", "refining")
    assert not (tmp_path / "whole" / CHECKPOINT / JOURNAL).exists()
    flip_a_bit(tmp_path / "killed", ENTRIES[verb] // 2)
    with pytest.warns(RuntimeWarning, match=r"\d+ of \d+ bytes are damaged; their content is computed again"):
        resumed = pk.resume(tmp_path / "killed", PROBLEMS[verb]())
    check_same(resumed, whole)
    assert not (tmp_path / "killed" / CHECKPOINT / JOURNAL).exists()
    how = "--generations, continues it" if verb in SEARCHES else "that cannot be resumed"
    with pytest.raises(InvalidInput, match=f"must be a stopped run of solve, .*, got one of status .*{how}"):
        pk.resume(tmp_path / "killed", PROBLEMS[verb]())


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """The folder of a search that its observer interrupted after five generations."""
    folder = tmp_path_factory.mktemp("stopped") / "run"

    def interrupt(progress):
        if progress.stage == "generation" and progress.done == 5:
            signal.raise_signal(signal.SIGINT)

    front = pk.solve(tracking(), population=12, generations=12, seed=2, out=folder, observe=interrupt)
    assert (front.provenance["status"], front.provenance["counts"]["generations"]) == ("SIGINT", 5)
    return folder


@pytest.fixture
def copy(stopped, tmp_path):
    """A copy of the stopped run."""
    return Path(shutil.copytree(stopped, tmp_path / "copy"))


def test_a_run_that_a_signal_stopped_has_its_result_and_resumes(copy):
    assert len(pk.load_front(copy, tracking())) > 0
    seen = []
    resumed = pk.resume(copy, tracking(), observe=lambda progress: seen.append(progress.done))
    assert resumed.provenance["status"] == "generations"
    check_same_front(resumed, pk.solve(tracking(), population=12, generations=12, seed=2))


CONTINUED = {
    "refined": {"refine": True, "points": 4},
    "islands": {"islands": 2, "stagnation": False},
    "another algorithm": {"algorithm": NSGA2(pop_size=12), "anchors": None},
}


@pytest.mark.parametrize(
    "name", ["another algorithm", *(pytest.param(name, marks=pytest.mark.slow) for name in ("refined", "islands"))]
)
def test_a_finished_search_and_more_generations_are_one_run_bit_for_bit(name, tmp_path):
    settings = {"population": 12, "seed": 2, "anchors": 1, **CONTINUED[name]}
    algorithm = settings.get("algorithm")
    pk.solve(tracking(), generations=5, out=tmp_path / "run", **settings)
    for more in (1, 4):
        front = pk.resume(tmp_path / "run", tracking(), generations=more, algorithm=algorithm)
    check_same(front, pk.solve(tracking(), generations=10, **settings))
    assert np.array_equal(pk.load_front(tmp_path / "run", tracking()).objectives, front.objectives)


def test_a_search_that_is_stopped_while_it_is_continued_resumes(tmp_path):
    settings = {"population": 12, "seed": 2, "anchors": 1}
    pk.solve(tracking(), generations=5, out=tmp_path / "run", **settings)

    def interrupt(progress):
        if progress.stage == "generation" and progress.done == 8:
            signal.raise_signal(signal.SIGTERM)

    pk.resume(tmp_path / "run", tracking(), generations=7, observe=interrupt)
    check_same_front(pk.resume(tmp_path / "run", tracking()), pk.solve(tracking(), generations=12, **settings))


def test_a_target_that_a_search_reached_does_not_end_it_again(tmp_path):
    target = [np.inf, np.inf]
    front = pk.solve(Parabolas(), population=8, generations=5, seed=1, target=target, out=tmp_path / "run")
    assert (front.provenance["status"], front.provenance["counts"]["generations"]) == ("target", 1)
    continued = pk.resume(tmp_path / "run", Parabolas(), generations=3)
    assert (continued.provenance["status"], continued.provenance["counts"]["generations"]) == ("generations", 4)


def test_another_problem_is_refused_and_the_run_stays(copy):
    with pytest.raises(InvalidInput, match=r"the run in .* solves, got one with another fingerprint"):
        pk.resume(copy, tracking(velocity=1.0))
    with pytest.raises(InvalidInput, match=r"problem must be the one that the run in .* solves, got none"):
        pk.resume(copy)
    assert (copy / CHECKPOINT / JOURNAL).exists()


def test_other_versions_of_libraries_are_refused_by_name(copy, monkeypatch):
    monkeypatch.setattr("paretoik.runs.machine.version", lambda name: "0.0.1")
    with pytest.raises(InvalidInput, match=r"paretoik must be \S+, as in the run .*, got 0\.0\.1"):
        pk.resume(copy, tracking())


@pytest.mark.parametrize("verb", ["solve from motions", "plan"])
@pytest.mark.filterwarnings("ignore:.*are damaged")
def test_a_journal_without_what_the_run_started_from_is_refused(verb, tmp_path):
    killed(verb, tmp_path / "run", 2)
    flip_a_bit(tmp_path / "run", 0)
    with pytest.raises(InvalidRun, match="must have the initial solutions in its journal, got none"):
        pk.resume(tmp_path / "run", PROBLEMS[verb]())


def test_another_file_in_place_of_the_journal_is_refused_and_the_result_stays(copy):
    (copy / CHECKPOINT / JOURNAL).write_bytes(b"something else altogether")
    with pytest.raises(InvalidRun, match="must be the journal of a run, got something else"):
        pk.resume(copy, tracking())
    assert len(pk.load_front(copy, tracking())) > 0


def test_genes_that_the_search_does_not_ask_for_again_are_refused(copy):
    from paretoik.runs.journal import Journal, key_of

    (copy / CHECKPOINT / JOURNAL).unlink()
    journal = Journal(copy / CHECKPOINT / JOURNAL)
    names = ("kinetic_energy", "torque_norm")
    foreign = {"genes": np.zeros(32, np.uint8), "F": np.zeros((12, 2)), "G": np.zeros((12, 0)), "H": np.zeros((12, 0))}
    causes = {"failed": np.zeros(0, int), "causes": np.zeros(0, "U1")}
    journal.append(key_of("generation", names, 2, 0), foreign | causes)
    journal.close()
    with pytest.raises(InvalidRun, match="generation 1 must have the genes in the run's journal, got other genes"):
        pk.resume(copy, tracking())
    assert len(pk.load_front(copy, tracking())) > 0


def test_a_killed_run_that_was_to_replace_another_resumes_and_replaces_it(stopped, tmp_path):
    folder = tmp_path / "run"
    first = pk.solve(tracking(), population=12, generations=2, seed=5, out=folder)
    script = (
        "import sys; import paretoik as pk; from tests.api.problems import tracking; "
        "from tests.api.resumed_runs import kill_after; kill_after(7); "
        "pk.solve(tracking(), population=12, generations=12, seed=2, out=sys.argv[1], overwrite=True)"
    )
    process = subprocess.run([sys.executable, "-c", script, str(folder)], cwd=ROOT, capture_output=True, check=False)
    assert process.returncode == -signal.SIGKILL
    assert np.array_equal(pk.load_front(folder / FORMER, tracking()).objectives, first.objectives)
    check_same_front(pk.resume(folder, tracking()), pk.solve(tracking(), population=12, generations=12, seed=2))
    assert not (folder / FORMER).exists()


def test_an_algorithm_of_the_users_own_is_asked_for_again(tmp_path):
    def interrupt(progress):
        if progress.stage == "generation" and progress.done == 3:
            signal.raise_signal(signal.SIGINT)

    problem = tracking()
    pk.solve(problem, algorithm=NSGA2(pop_size=12), generations=6, seed=2, out=tmp_path, observe=interrupt)
    with pytest.raises(InvalidInput, match="algorithm must be NSGA2, as in the run, got none"):
        pk.resume(tmp_path, problem)
    resumed = pk.resume(tmp_path, problem, algorithm=NSGA2(pop_size=12))
    check_same_front(resumed, pk.solve(problem, algorithm=NSGA2(pop_size=12), generations=6, seed=2))


def test_rows_evaluated_one_by_one_are_not_lost_within_a_generation(tmp_path):
    counted, folder = tmp_path / "counted", tmp_path / "run"
    script = (
        "import sys; from pathlib import Path; import paretoik as pk; "
        "from tests.api.resumed_runs import Slow, kill_after; kill_after(2); "
        "pk.solve(Slow(Path(sys.argv[1])), population=12, generations=2, seed=2, out=sys.argv[2])"
    )
    command = [sys.executable, "-c", script, str(counted), str(folder)]
    assert subprocess.run(command, cwd=ROOT, capture_output=True, check=False).returncode == -signal.SIGKILL
    before = counted.stat().st_size
    resumed = pk.resume(folder, Slow(counted))
    whole = pk.solve(Slow(tmp_path / "whole"), population=12, generations=2, seed=2)
    assert np.array_equal(resumed.objectives, whole.objectives)
    assert 12 > before > 0
    assert counted.stat().st_size == (tmp_path / "whole").stat().st_size == 25  # 2 × 12, and the first once more


@pytest.mark.parametrize(
    "change",
    [
        {"verb": "resolve"},
        {"verb": ["solve"]},
        {"settings": None},
        {"settings": {"nothing of ours": 1}},
        {"versions": "new"},
    ],
)
def test_a_run_file_that_someone_made_up_is_refused_in_a_line(copy, change):
    from paretoik.runs.files import check_digest, read_run, run_bytes

    run = read_run(copy / RUN)
    check_digest(copy / RUN, run)
    del run["format"]
    (copy / RUN).write_bytes(run_bytes(run | change))
    with pytest.raises(InvalidRun, match=r"must .+, got .+") as refused:
        pk.resume(copy, tracking())
    assert "\n" not in str(refused.value)
