"""A late failure loses nothing that was found before it, with a folder and without one."""

import signal

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import EvaluationFailed, InvalidInput
from paretoik.runs.files import CHECKPOINT, JOURNAL, RUN, read_run
from tests.api.problems import tracking
from tests.api.resumed_runs import loop
from tests.search.problems import Parabolas

SIZES = {"population": 12, "generations": 9, "seed": 1}


class Ageing(Parabolas):
    """A problem whose evaluations change after a number of ``calls``."""

    def __init__(self, change, calls=5):
        super().__init__()
        self.change, self.last = change, calls

    def _evaluate(self, x, out, *args, **kwargs):
        super()._evaluate(x, out)
        if self.calls > self.last:
            self.change(out)


def refuse(out):
    raise InvalidInput("wrist: metres wanted")


def leave(out):
    raise SystemExit(0)


def test_the_front_found_before_a_late_error_is_in_the_folder_and_on_the_error(tmp_path):
    with pytest.raises(InvalidInput, match="wrist: metres wanted") as failure:
        pk.solve(Ageing(refuse), **SIZES, out=tmp_path / "run")
    stored = pk.load_front(tmp_path / "run")
    assert len(stored) > 0
    np.testing.assert_array_equal(stored.objectives, failure.value.partial.objectives)
    run = read_run(tmp_path / "run" / RUN)
    assert (run["status"], run["reason"]) == ("InvalidInput", "wrist: metres wanted")
    assert run["counts"]["generations"] == 4  # the first row is evaluated twice
    assert failure.value.__notes__ == [f"the front found by then, of {len(stored)} points, is in {tmp_path / 'run'}"]


def quick(verb: str, folder, observe):
    """Run a verb on a small problem."""
    problem = tracking(pk.kinetic_energy) if verb == "plan" else tracking()
    match verb:
        case "solve":
            return pk.solve(problem, **SIZES, refine=True, points=4, out=folder, observe=observe)
        case "plan":
            return pk.plan(problem, starts=4, out=folder, observe=observe)
        case "epsilon_front":
            return pk.epsilon_front(problem, points=3, starts=4, out=folder, observe=observe)
        case "refine":
            return pk.refine(pk.solve(problem, **SIZES, points=3), out=folder, observe=observe)
        case _:
            return pk.solve(loop(), out=folder, observe=observe)


@pytest.mark.parametrize(
    "verb",
    ["loop", *(pytest.param(verb, marks=pytest.mark.slow) for verb in ("solve", "plan", "epsilon_front", "refine"))],
)
def test_an_observer_that_raises_in_any_stage_is_named_and_loses_nothing(verb, tmp_path):
    stages = list[str]()
    quick(verb, tmp_path / "whole", lambda progress: stages.append(progress.stage))
    lasting = None
    for number, stage in enumerate(dict.fromkeys(each for each in stages if each != "compilation")):
        count = stages.count(stage)
        for last in {1, count}:
            seen = list[str]()

            def watch(progress, stage=stage, last=last, seen=seen):
                seen.append(progress.stage)
                if seen.count(stage) == last:
                    raise LookupError("no more")

            folder = tmp_path / f"{number}-{last}"
            with pytest.raises(InvalidInput, match="observe raised LookupError: no more") as failure:
                quick(verb, folder, watch)
            assert isinstance(failure.value.__cause__, LookupError)
            kept = failure.value.partial
            assert (kept is not None) == ("files" in read_run(folder / RUN))
            if kept is not None:
                lasting = stage
                assert str(folder) in failure.value.__notes__[-1]
            if stage == "saving":
                assert kept.provenance["status"] == read_run(folder / RUN)["status"]
                assert not (folder / CHECKPOINT / JOURNAL).exists()  # it is whole
    assert lasting == "recording" or lasting == "saving"


HOPELESS = {
    "solve": (lambda **options: pk.solve(tracking(velocity=1e-3), **SIZES, **options), "generation"),
    "plan": (lambda **options: pk.plan(tracking(pk.kinetic_energy, velocity=1e-3), **options), "sample"),
    "epsilon_front": (lambda **options: pk.epsilon_front(tracking(velocity=1e-3), **options), "optimum"),
}


@pytest.mark.parametrize("verb", HOPELESS)
def test_a_signal_during_a_hopeless_search_keeps_the_diagnosis(verb, tmp_path):
    run_verb, stage = HOPELESS[verb]

    def watch(progress):
        if progress.stage == stage:
            signal.raise_signal(signal.SIGTERM)

    with pytest.raises(SystemExit) as stopped:
        run_verb(out=tmp_path / "run", observe=watch)
    run = read_run(tmp_path / "run" / RUN)
    (note,) = stopped.value.__notes__
    assert "by then: no motion within the limits" in note
    assert "velocity" in note
    assert note in run["reason"]
    assert run["status"] == "SIGTERM"
    assert any("velocity" in words for words in run["least_violating"]["broken"])
    assert "velocity" in pk.report(tmp_path / "run").read_text()


def test_a_failed_runs_folder_can_be_used_again_and_one_with_a_result_cannot(tmp_path):
    for problem, failure in ((tracking(velocity=1e-3), pk.Infeasible), (Ageing(leave, calls=0), EvaluationFailed)):
        for _ in range(2):
            with pytest.raises(failure):
                pk.solve(problem, **SIZES, out=tmp_path / "run")
    front = pk.solve(Parabolas(), **SIZES, out=tmp_path / "run")
    with pytest.raises(InvalidInput, match="--overwrite"):
        pk.solve(Parabolas(), **SIZES, out=tmp_path / "run")
    assert np.array_equal(pk.load_front(tmp_path / "run").objectives, front.objectives)


def test_an_evaluation_that_calls_sys_exit_fails_and_the_search_goes_on():
    front = pk.solve(Ageing(leave), **SIZES, stagnation=False)
    counts = front.provenance["counts"]
    assert counts["generations"] == SIZES["generations"]
    assert counts["failed"] == 12 * (SIZES["generations"] - 4)
    assert counts["first_cause"] == "the problem raised SystemExit: 0"
    with pytest.raises(
        EvaluationFailed, match="got 12 failed evaluations, the first with: the problem raised SystemExit: 0"
    ):
        pk.solve(Ageing(leave, calls=0), **SIZES)


def test_views_that_fail_are_a_warning_and_the_result_is_there(problem, tmp_path):
    """A constraint that raises after the search is evaluated again for the text of the picture."""
    over = False

    @pk.constraint(unit="rad", upper=100.0, form="terminal")
    def tired(motion):
        if over:
            raise ValueError("enough")
        return motion.q[..., -1, 0]

    def watch(progress):
        nonlocal over
        over = over or progress.stage == "saving"

    strained = pk.Tracking(
        problem.task.arm, problem.task.tasks, objectives=[pk.kinetic_energy, pk.torque_norm], constraints=[tired]
    )
    words = "a recording or picture failed, .*: EvaluationFailed: .* tired raised ValueError: enough"
    with pytest.warns(RuntimeWarning, match=words):
        front = pk.solve(strained, **SIZES, out=tmp_path / "run", observe=watch)
    np.testing.assert_array_equal(pk.load_front(tmp_path / "run").objectives, front.objectives)
