"""How work is shared out over a cluster, and how long its scheduler and workers are waited for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ClusterOptions:
    """How tasks are made, and how long a silence is waited for [s].

    A task has items for so many seconds (``portion``), and so many more for every thread (``overhead``), as each task
    passes through one scheduler and one client, but no more than an even share of those that are left, ``shares`` of
    them a thread; ``ahead`` tasks a thread are with the scheduler. A signal is looked for every
    ``interval``, the workers every ``watch``. Somebody has ``connection`` to listen at the address; a scheduler that is
    longer silent is told of. It has ``patience`` to answer, to come back, and to have a worker; a worker that was not
    heard of for ``frozen`` is left out.
    """

    portion: float = 0.5
    overhead: float = 0.002
    shares: int = 2
    ahead: int = 2
    interval: float = 0.1
    watch: float = 2.0
    connection: float = 5.0
    patience: float = 60.0
    frozen: float = 30.0


OPTIONS = ClusterOptions()
