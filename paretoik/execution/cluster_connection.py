"""Connecting to a Dask scheduler: where nobody listens that is said soon, one that is slow to answer is waited for."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from typing import Any

from paretoik.errors import InvalidInput
from paretoik.execution.cluster_options import ClusterOptions
from paretoik.stop_flag import STOP, Interrupted


class _Attempt(threading.Thread):
    """An attempt to connect, in a thread of its own: Dask waits without looking for signals.

    ``client`` is connected, or ``error`` says why there is none, when ``ended`` is set.
    """

    def __init__(self, address: str, options: ClusterOptions) -> None:
        super().__init__(daemon=True)
        self.address, self.options = address, options
        self.client: Any = None
        self.error: Exception | None = None
        self.ended, self.abandoned = threading.Event(), threading.Event()

    def run(self) -> None:
        from distributed import Client

        try:
            self._find_listener()
            # The timeout is also that of reconnecting: a client that gave up never comes back.
            self.client = Client(self.address, timeout=self.options.patience, set_as_default=False, name="paretoik")
        except Exception as error:  # whatever an address or who listens there makes Dask raise
            self.error = error
        self.ended.set()
        if self.abandoned.is_set() and self.client is not None:
            self.client.close(timeout=1.0)

    def _find_listener(self) -> None:
        """Return when somebody listens at the address; raises OSError where nobody does for a while."""
        from distributed.comm import get_address_host_port

        place = get_address_host_port(self.address)
        deadline = time.monotonic() + self.options.connection
        while True:
            try:
                socket.create_connection(place, timeout=self.options.connection).close()
                return
            except OSError:
                if self.abandoned.is_set() or time.monotonic() + self.options.interval > deadline:
                    raise
            time.sleep(self.options.interval)


def connect(address: str, options: ClusterOptions, tell: Callable[[str], None]) -> Any:
    """Return Dask's client of the scheduler at an address.

    Somebody has ``connection`` seconds to listen there. A scheduler that listens has ``patience`` to answer, as a busy
    machine may keep it from that; after ``connection`` it is told that it is waited for. Raises InvalidInput where
    nobody listens or none answers, Interrupted soon after a signal.
    """
    attempt, begin, has_warned = _Attempt(address, options), time.monotonic(), False
    attempt.start()
    try:
        while not attempt.ended.wait(options.interval):
            waited = time.monotonic() - begin
            if STOP[0]:
                raise Interrupted
            if waited > options.connection + options.patience:
                raise _refusal(address, f"no answer within {options.patience:g} s from what listens there")
            if waited > 2 * options.connection and not has_warned:
                has_warned = True
                tell(f"{slow(address, waited)}; it is waited for, {options.patience:g} s at most")
    except BaseException:
        attempt.abandoned.set()
        raise
    if attempt.error is not None:
        raise _refusal(address, _fact(attempt.error)) from attempt.error
    return attempt.client


def slow(address: str, seconds: float) -> str:
    """Return in words that a scheduler is slow to answer."""
    return f"the scheduler at {address} has not answered for {seconds:.0f} s, as where its machine is busy"


def _fact(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"nobody who listens there ({error.strerror})"
    return " ".join(str(error).split()) or type(error).__name__


def _refusal(address: str, fact: str) -> InvalidInput:
    return InvalidInput(f"cluster: a Dask scheduler at {address} wanted, got {fact}")
