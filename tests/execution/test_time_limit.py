from __future__ import annotations

import os
import signal
import threading
import time
from dataclasses import dataclass

import pytest

from paretoik import compilation_notices
from paretoik.compilation_notices import begin_compilation, computing_clock, end_compilation
from paretoik.errors import InvalidInput
from paretoik.runs.interruption import interruptible, reserve_time, time_limit
from paretoik.stop_flag import STOP, Interrupted, check_interruption


@dataclass
class Clock:
    """Stands for the module ``time``: its time [s] is what a test sets."""

    now: float = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch):
    """The clock that time limits go by, and no compilation so far: however slow a machine is, it stands still."""
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


def test_without_a_limit_there_is_no_thread_more():
    before = threading.active_count()
    with time_limit(None) as limit:
        assert threading.active_count() == before
    assert not limit.reached


def test_of_a_limit_time_can_be_reserved_for_what_follows():
    with time_limit(20.0) as limit:
        with reserve_time(0.999, 60.0), pytest.raises(Interrupted):
            wait_for_interruption()
        assert limit.reached
        check_interruption()


def test_no_more_time_is_reserved_than_the_longest():
    with time_limit(60.0) as limit, reserve_time(0.999, 0.5):
        time.sleep(0.2)
        check_interruption()
    assert not limit.reached


def test_a_limit_that_is_reached_leaves_no_time_to_reserve():
    with time_limit(0.05):
        with reserve_time(0.0, 0.0):
            time.sleep(0.1)
        with pytest.raises(Interrupted):
            wait_for_interruption()


def test_without_a_limit_no_time_is_reserved():
    with reserve_time(0.999, 60.0):
        time.sleep(0.05)
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


def test_the_computing_clock_never_counts_a_compilation_that_is_just_ending(clock, monkeypatch):
    started, readings, monotonic = computing_clock(), [], clock.monotonic

    def read_meanwhile() -> float:  # as another thread may
        monkeypatch.setattr(clock, "monotonic", monotonic)
        readings.append(computing_clock())
        return monotonic()

    begin_compilation()
    clock.now += 10.0
    monkeypatch.setattr(clock, "monotonic", read_meanwhile)
    end_compilation()
    assert [*readings, computing_clock()] == [started, started]


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
