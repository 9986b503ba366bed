from __future__ import annotations

import os
import signal
import threading

import numba
import pytest

from paretoik.runs.interruption import interruptible
from paretoik.stop_flag import STOP, Interrupted, check_interruption


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


def test_a_signal_sets_the_flag_while_the_main_thread_runs_no_python():
    with interruptible() as interruption:
        assert not STOP[0]
        timer = threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGTERM))
        timer.start()
        wait_for(STOP, 1e10)  # compiled
        assert STOP[0] == signal.SIGTERM == interruption.signal
        timer.join()
    assert not STOP[0]


@numba.njit(nogil=True)
def wait_for(stop, count):
    """Run until the flag is set, or long."""
    i = 0.0
    while not stop[0] and i < count:
        i += 1.0
    return i


def test_a_former_wakeup_descriptor_learns_of_signals_too_and_is_put_back():
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    before = signal.set_wakeup_fd(writer)
    try:
        with interruptible():
            os.kill(os.getpid(), signal.SIGINT)
        assert os.read(reader, 10) == bytes([signal.SIGINT])
    finally:
        assert signal.set_wakeup_fd(before) == writer
        os.close(reader)
        os.close(writer)


def test_a_forked_process_leaves_its_parents_flag_alone():
    with interruptible() as interruption:
        child = os.fork()
        if not child:
            os.kill(os.getpid(), signal.SIGTERM)
            os._exit(0)
        os.waitpid(child, 0)
        threading.Event().wait(0.05)
        assert not STOP[0]
        assert not interruption
