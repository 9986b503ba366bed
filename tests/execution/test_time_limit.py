from __future__ import annotations

import os
import signal
import threading
import time

import pytest

from paretoik.errors import InvalidInput
from paretoik.execution.interrupts import interruptible
from paretoik.execution.time_limit import time_limit
from paretoik.stop_flag import STOP, Interrupted, check_interruption


def wait_for_interruption() -> None:
    ends = time.monotonic() + 10.0
    while time.monotonic() < ends:
        check_interruption()
        time.sleep(0.001)


def test_past_the_limit_what_runs_is_interrupted_and_nothing_after_it():
    started = time.monotonic()
    with time_limit(0.05) as limit, pytest.raises(Interrupted):
        wait_for_interruption()
    assert limit.reached
    assert time.monotonic() - started < 5.0
    check_interruption()


def test_within_the_limit_nothing_happens_then_or_later():
    with time_limit(0.05) as limit:
        pass
    time.sleep(0.1)
    assert not limit.reached
    check_interruption()


def test_without_a_limit_there_is_no_thread_more():
    before = threading.active_count()
    with time_limit(None) as limit:
        assert threading.active_count() == before
    assert not limit.reached


def test_a_signal_before_the_limit_stays_the_signal():
    with interruptible() as interruption, time_limit(0.05):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.1)
        assert STOP[0] == signal.SIGTERM
    assert interruption.signal == signal.SIGTERM


@pytest.mark.parametrize("seconds", [0, -1.0, float("nan"), float("inf")])
def test_a_limit_that_is_no_positive_number_is_refused(seconds):
    with pytest.raises(InvalidInput, match="time_limit: must"), time_limit(seconds):
        pass


def test_another_thread_is_refused():
    errors: list[InvalidInput] = []

    def work() -> None:
        try:
            with time_limit(1.0):
                pass
        except InvalidInput as error:
            errors.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert "time_limit: wants the main thread" in str(errors[0])
