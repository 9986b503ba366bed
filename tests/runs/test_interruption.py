from __future__ import annotations

import os
import signal
import threading
import time
from dataclasses import dataclass

import numba
import pytest

from paretoik import compilation_notices
from paretoik.compilation_notices import begin_compilation, computing_clock, end_compilation
from paretoik.errors import InvalidInput
from paretoik.runs.interruption import interruptible, reserve_time, time_limit
from paretoik.stop_flag import STOP, Interrupted, check_interruption


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_is_noted_and_the_run_goes_on(number):
    with interruptible() as interruption:
        assert interruption.signal is None
        os.kill(os.getpid(), number)
        assert interruption.signal == number


def test_a_second_ctrl_c_raises():
    # SIGINT is ignored in a job that runs in the background
    previous_handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with interruptible() as interruption:
            os.kill(os.getpid(), signal.SIGINT)
            assert interruption.signal
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
    """Run until the flag is set, or for a long time."""
    i = 0.0
    while not stop[0] and i < count:
        i += 1.0
    return i


def test_a_forked_process_leaves_its_parents_flag_alone():
    with interruptible() as interruption:
        child = os.fork()
        if not child:
            os.kill(os.getpid(), signal.SIGTERM)
            os._exit(0)
        os.waitpid(child, 0)
        threading.Event().wait(0.05)
        assert not STOP[0]
        assert interruption.signal is None


@dataclass
class Clock:
    """Replaces the module ``time``: its time [s] is set by a test."""

    now: float = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch):
    """The clock of time limits, before any compilation: it stands still, even on a slow machine."""
    monkeypatch.setattr(compilation_notices, "_TIME", [(0.0, None)])
    monkeypatch.setattr(compilation_notices, "time", Clock())
    return compilation_notices.time


def wait_until_reached(limit) -> None:
    ends = time.monotonic() + 10.0
    while not limit.reached and time.monotonic() < ends:
        time.sleep(0.001)


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


def test_within_the_limit_nothing_happens_then_or_later(clock):
    with time_limit(0.05) as limit:
        time.sleep(0.1)
        check_interruption()
    clock.now += 1.0
    time.sleep(0.1)
    assert not limit.reached
    check_interruption()


def test_a_signal_before_the_limit_stays_the_signal(clock):
    with interruptible() as interruption, time_limit(0.05) as limit:
        os.kill(os.getpid(), signal.SIGTERM)
        clock.now += 1.0
        wait_until_reached(limit)
        assert limit.reached
        assert STOP[0] == signal.SIGTERM
    assert interruption.signal == signal.SIGTERM


@pytest.mark.parametrize("seconds", [0, -1.0, float("nan"), float("inf")])
def test_a_limit_that_is_no_positive_number_is_refused(seconds):
    with pytest.raises(InvalidInput, match="time_limit: must"), time_limit(seconds):
        pass


def test_a_time_limit_in_another_thread_is_refused():
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
    assert "time_limit must be set in the main thread" in str(errors[0])


def test_the_computing_clock_stands_still_while_code_is_compiled(clock):
    started = computing_clock()
    for computed in (1.0, 2.0):
        clock.now += 1.0
        begin_compilation()
        clock.now += 10.0
        begin_compilation()  # a function within that function: one compilation
        clock.now += 5.0
        assert computing_clock() - started == computed
        end_compilation()
        assert computing_clock() - started == computed


def test_compiling_code_is_not_counted(clock):
    with time_limit(0.2) as limit:
        begin_compilation()
        clock.now += 10.0
        time.sleep(0.3)  # past the limit by any other clock
        assert limit.remaining == pytest.approx(0.2)
        end_compilation()
        assert limit.remaining == pytest.approx(0.2)
        check_interruption()
        clock.now += 0.3
        with pytest.raises(Interrupted):
            wait_for_interruption()
    assert limit.reached


def test_what_is_reserved_can_be_shared_by_two_stages():
    with time_limit(20.0):
        with reserve_time(0.999, 60.0), pytest.raises(Interrupted):
            wait_for_interruption()
        with reserve_time(0.5, 60.0):
            check_interruption()
            time.sleep(0.05)
            check_interruption()
        check_interruption()
