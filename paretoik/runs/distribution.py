"""Computes pure functions of many items, in this process or in workers.

An executor of ``runs.executor`` sends items to workers; a verb sets one while it runs, like the journal. Results are
the same for every executor: each depends only on the function, the shared object and the item. Results are stored at
the places of their items. Only this process reads and writes the journal.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from types import ModuleType
from typing import Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import cloudpickle

from paretoik.errors import InvalidInput, warn_user
from paretoik.inputs import cause_of
from paretoik.runs.journal import Values, recalled, remembered
from paretoik.runs.user_code import is_library
from paretoik.stop_flag import check_interruption

# Messages to workers, as bytes: library objects are sent by name, users' code by content.


def pickled(what: str, value: Any) -> bytes:
    """Return a value as bytes that load without the user's files.

    Raises InvalidInput, with ``what``, if the value cannot be pickled.
    """
    by_value = cloudpickle.list_registry_pickle_by_value()
    modules = [module for name, module in sys.modules.copy().items() if _is_users_module(name)]
    added = [module for module in modules if module.__name__ not in by_value]
    for module in added:
        cloudpickle.register_pickle_by_value(module)
    try:
        return bytes(cloudpickle.dumps(value))
    except Exception as error:  # users' code may raise any error
        raise InvalidInput(f"workers: {what} cannot be pickled: {cause_of(error)}") from error
    finally:
        for module in added:
            cloudpickle.unregister_pickle_by_value(module)


@cache
def _is_users_module(name: str) -> bool:
    """Return whether a module is a user's; the first answer is kept."""
    module = sys.modules[name]
    is_named = isinstance(module, ModuleType) and getattr(module, "__name__", None) == name
    return is_named and not is_library(name)


# Computation in this process, or by an executor.


TRIAL = 5.0  # s: waiting time after which it is checked whether workers save time


class Done(NamedTuple):
    """The value that a function returned, and how long it took [s]."""

    value: Any
    seconds: float


class Raised(NamedTuple):
    """The error that a function raised."""

    error: Exception


class Lost(NamedTuple):
    """An item without a result, and the cause. Either every worker that tried it ended, or it took too long."""

    cause: str


Reply: TypeAlias = Done | Raised | Lost
Function: TypeAlias = Callable[[Any, Any], Any]
"""Takes the shared object and an item. It is defined at the top level of a module, and depends on nothing else."""


@runtime_checkable
class Executor(Protocol):
    """Computes a function of many items in workers. Each worker gets the shared object once."""

    @property
    def workers(self) -> int:
        """Number of items that are computed at a time."""

    def replies(
        self, function: Function, shared: Any, items: Sequence[Any], *, seconds: float | None
    ) -> Iterator[tuple[int, Reply]]:
        """Yield the place and reply of each item as they arrive; an item is lost if it takes longer than ``seconds``.

        Raises Interrupted soon after a signal, SolverFailed if no worker is left.
        """

    def description(self) -> dict[str, Any]:
        """Return the processes used so far, as strict JSON. Its entry ``by`` names the kind of executor."""


@dataclass(kw_only=True, eq=False)
class _Account:
    """Seconds waited for workers, and seconds that they computed; they save no time if the second is less."""

    executor: Executor
    waited: float = 0.0
    computed: float = 0.0
    items: int = 0
    starting: bool = True  # True until the first reply, which takes longer as workers start
    told: bool = False  # whether it was checked that workers save time


_ACTIVE: list[_Account] = []  # at most one, like the journal
_IN_WORKER = [False]


@contextmanager
def distributing(active: Executor | None) -> Iterator[None]:
    """Compute what the body distributes by an executor; None, or a nested call, changes nothing."""
    if active is None or _ACTIVE:
        yield
        return
    _ACTIVE.append(_Account(executor=active))
    try:
        yield
    finally:
        _ACTIVE.pop()


def workers() -> int:
    """Return the number of items computed at a time, 0 without workers."""
    return _ACTIVE[0].executor.workers if _ACTIVE else 0


def executor() -> Executor | None:
    """Return the executor in use, None if this process computes."""
    return _ACTIVE[0].executor if _ACTIVE else None


def threads() -> int:
    """Return the number of threads that compiled code may use. One per core, but only one in a worker."""
    return 1 if _IN_WORKER[0] else os.cpu_count() or 1


def become_worker() -> None:
    """Mark this process as a worker, which shares cores with others."""
    _IN_WORKER[0] = True


def distribute(
    function: Function, shared: Any, items: Sequence[Any], *, seconds: float | None = None
) -> Iterator[tuple[int, Any | Lost]]:
    """Yield the place and result, or ``Lost``, of each item, in order of arrival.

    If the function raises, the other items are computed first; then the error of the first such item is raised. Raises
    as the executor does.
    """
    account, errors = _ACTIVE[0], dict[int, Exception]()
    begin = None if account.starting else time.monotonic()
    for place, reply in account.executor.replies(function, shared, items, seconds=seconds):
        if begin is not None:
            account.waited += time.monotonic() - begin
        if isinstance(reply, Raised):
            errors[place] = reply.error
        elif isinstance(reply, Lost):
            yield place, reply
        else:
            account.computed += reply.seconds if begin is not None else 0.0
            account.items += begin is not None
            yield place, reply.value
        account.starting, begin = False, time.monotonic()
    if account.waited >= TRIAL and not account.told:
        account.told = True
        if account.computed < account.waited:
            computed, waited = (1000 * each / max(account.items, 1) for each in (account.computed, account.waited))
            text = f"workers save no time: a task takes {computed:.2g} ms to compute, but {waited:.2g} ms with workers"
            warn_user(f"{text}; the run is faster without")
    if errors:
        raise errors[min(errors)]


def distribute_remembered(
    function: Function, shared: Any, items: Sequence[Any], keys: Sequence[bytes | None]
) -> Iterator[tuple[int, Values | Lost]]:
    """Yield as ``distribute`` does, but dicts of arrays, read from the journal if it has the item's key."""
    remaining = list[int]()
    for place, key in enumerate(keys):
        stored = None if key is None else recalled(key)
        if stored is None:
            remaining.append(place)
        else:
            yield place, stored
    for i, values in distribute(function, shared, [items[place] for place in remaining]):
        place = remaining[i]
        yield place, values if isinstance(values, Lost) else remembered(keys[place], partial(dict, values))


def compute_each(
    function: Function, shared: Any, items: Sequence[Any], keys: Sequence[bytes | None]
) -> Iterator[tuple[int, Values | Lost]]:
    """Yield as ``distribute_remembered`` does; without workers or for one item, this process computes in order.

    Raises Interrupted after a signal.
    """
    check_interruption()
    if len(items) > 1 and workers() > 1:
        yield from distribute_remembered(function, shared, items, keys)
        return
    for place, (item, key) in enumerate(zip(items, keys, strict=True)):
        check_interruption()
        yield place, remembered(key, partial(function, shared, item))
