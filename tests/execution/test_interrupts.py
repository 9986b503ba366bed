from __future__ import annotations

import os
import signal
import threading

import pytest

from paretoik.execution.interrupts import interruptible
from paretoik.stop_flag import Interrupted, check_interruption


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_the_first_signal_is_noted_and_the_run_goes_on(number, code):
    with interruptible() as interruption:
        assert not interruption
        assert interruption.exit_code == 0
        os.kill(os.getpid(), number)
        assert interruption
        assert interruption.signal == number
        assert interruption.exit_code == code


def test_a_second_ctrl_c_raises():
    # SIGINT is ignored in a job that runs in the background
    previous_handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with interruptible() as interruption:
            os.kill(os.getpid(), signal.SIGINT)
            assert interruption
            with pytest.raises(KeyboardInterrupt):
                os.kill(os.getpid(), signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, previous_handler)


def test_the_handlers_found_are_put_back():
    mine = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
        with interruptible():
            assert signal.getsignal(signal.SIGTERM) != signal.SIG_IGN
        assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
        with pytest.raises(ZeroDivisionError), interruptible():
            raise ZeroDivisionError
        assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
    finally:
        signal.signal(signal.SIGTERM, mine)


def test_what_runs_meanwhile_learns_of_the_signal_until_the_end():
    check_interruption()
    with interruptible() as outer:
        with interruptible() as inner:
            assert inner is outer
            os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(Interrupted):
            check_interruption()
    check_interruption()


def test_another_thread_catches_nothing():
    handlers = []

    def work():
        with interruptible() as interruption:
            handlers.append((signal.getsignal(signal.SIGINT), bool(interruption)))

    before = signal.getsignal(signal.SIGINT)
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert handlers == [(before, False)]
