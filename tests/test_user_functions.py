"""Whatever a user's function raises is one line, but Ctrl-C and our own errors."""

import pytest

from paretoik.errors import EvaluationFailed, InvalidInput
from paretoik.stop_flag import Interrupted
from paretoik.user_functions import user_function


class SpeechlessError(Exception):
    def __str__(self):
        raise RuntimeError("no text")


class Foreign(BaseException):
    pass


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ValueError("over\n  0.3"), "ValueError: over 0.3"),
        (SpeechlessError(), "SpeechlessError"),
        (SystemExit(0), "SystemExit: 0"),
        (GeneratorExit(), "GeneratorExit"),
        (StopIteration(), "StopIteration"),
        (Foreign("elsewhere"), "Foreign: elsewhere"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_what_is_raised_is_a_failure_with_its_name_and_cause(error, words):
    with pytest.raises(EvaluationFailed) as failure, user_function("objective mine"):
        raise error
    assert str(failure.value) == f"objective mine raised {words}"
    assert failure.value.__cause__ is error


@pytest.mark.parametrize("error", [KeyboardInterrupt(), Interrupted(), InvalidInput("shape (3,) wanted, got (4,)")])
def test_control_c_and_our_own_errors_pass(error):
    with pytest.raises(type(error)) as failure, user_function("objective mine"):
        raise error
    assert failure.value is error


def test_another_kind_of_failure_can_be_asked_for():
    with (
        pytest.raises(InvalidInput, match="select: Mine raised KeyError: 'wrist'"),
        user_function("select: Mine", InvalidInput),
    ):
        raise KeyError("wrist")
