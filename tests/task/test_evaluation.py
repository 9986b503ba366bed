"""What fails in the evaluation of motions, and objectives that say nothing."""

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import EvaluationFailed
from paretoik.task.motion_task import evaluate_motions, examine_functions, require_values
from paretoik.task.starts import rollout_starts
from tests.task.tasks import task

CHANCE = np.random.default_rng(0)


@pytest.fixture(scope="module")
def rollouts():
    return rollout_starts(task(), 40, np.random.default_rng(0))


def test_a_function_that_fails_for_one_motion_fails_it_alone(rollouts):
    @pk.objective(unit="rad", form="terminal")
    def picky(motion):
        if np.any(motion.q[..., -1, 0] > 0.3):
            raise ZeroDivisionError("over 0.3")
        return motion.q[..., -1, 0]

    fussy = task(objectives=[pk.kinetic_energy, picky])
    F, _, causes = evaluate_motions(fussy, fussy.motion(rollouts))
    failing = rollouts[:, -1, 0] > 0.3
    assert 0 < failing.sum() < len(rollouts)
    np.testing.assert_array_equal(np.isnan(F[:, 1]), failing)
    assert np.isfinite(F[:, 0]).all()
    assert [cause == "objective picky raised ZeroDivisionError: over 0.3" for cause in causes] == failing.tolist()
    require_values(fussy, fussy.motion(rollouts))
    with pytest.raises(EvaluationFailed, match="every evaluation failed, the first with: objective picky raised"):
        require_values(fussy, fussy.motion(rollouts[failing]))


def test_a_limit_that_fails_is_named_and_its_motion_has_none(rollouts):
    @pk.constraint(unit="rad", upper=1.0, form="terminal")
    def edge(motion):
        with np.errstate(invalid="ignore"):
            return np.sqrt(0.3 - motion.q[..., -1, 0])

    edged = task(objectives=[pk.kinetic_energy], constraints=[edge])
    _, limits, causes = evaluate_motions(edged, edged.motion(rollouts))
    failing = rollouts[:, -1, 0] > 0.3
    assert 0 < failing.sum() < len(rollouts)
    np.testing.assert_array_equal(np.isnan(limits[:, edged.limit_names.index("edge")]), failing)
    assert [cause == "edge is nan" for cause in causes] == failing.tolist()
    assert edged.describe_violation(edged.motion(rollouts[failing][0])) == "edge is nan"


def objective_of(function):
    return pk.objective(unit="rad", form="terminal", name="odd", maximise=True)(function)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (
            lambda motion: np.full(len(motion.q), 3.0),
            "objective odd: different values wanted, got 3 for each of the first 40: it may be",
        ),
        (
            lambda motion: CHANCE.random(len(motion.q)),
            r"objective odd: one value for one argument wanted, got 0\.6369\d* and then 0\.",
        ),
    ],
)
def test_objectives_that_are_constant_or_a_matter_of_chance_are_noticed(rollouts, function, words):
    odd = task(objectives=[pk.kinetic_energy, objective_of(function)])
    with pytest.warns(RuntimeWarning, match=words) as warned:
        examine_functions(odd, odd.motion(rollouts))
    assert len(warned) == 1
