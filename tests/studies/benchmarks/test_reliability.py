"""Moments at which the benchmark of reliability kills runs."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import pytest

from studies.benchmarks.reliability.kills import COMMANDS, WholeRun
from studies.benchmarks.reliability.moments import spread_kills
from studies.benchmarks.reliability.phases import FILE_PHASES

FILES = {"else": 0.5, "write": 40, "rename": 8, "fsync": 12}
SEARCH = {"ask": 0.4, "evaluate": 1.5, "refine": 0.001, **FILES}
REFINEMENT = {"ask": 0.0, "refine": 2.0, **FILES}
PHASES_OF = {"search": SEARCH, "closed": SEARCH, "search and": SEARCH | REFINEMENT | {"ask": 0.3}}


def whole_runs():
    """Return runs of all names with their phases."""
    amounts = {
        name: PHASES_OF[next((key for key in reversed(PHASES_OF) if name.startswith(key)), "")]
        if name.startswith(tuple(PHASES_OF))
        else REFINEMENT
        for name in COMMANDS
    }
    return [
        WholeRun(name=name, command=(), workers=(), result="", amounts=each, seconds=3.0, entries={})
        for name, each in amounts.items()
    ]


@pytest.mark.parametrize("count", [200, 283])
def test_every_phase_has_its_share_of_kills_although_few_runs_have_it(count):
    runs = whole_runs()
    moments = spread_kills(runs, count, short=0.02)
    phases = Counter(phase for each in moments.values() for phase, _ in each)
    assert sum(phases.values()) == count
    assert max(phases.values()) - min(phases.values()) <= 1
    assert min(phases.values()) >= 20
    for run in runs:
        own = Counter(phase for phase, _ in moments[run.name])
        assert set(own) == {phase for phase, amount in run.amounts.items() if amount > 0.02}


def test_kills_of_a_phase_lie_within_it_at_even_distances():
    (run, *_) = whole_runs()
    moments = spread_kills([run], 60, short=0.02)[run.name]
    for phase in dict.fromkeys(phase for phase, _ in moments):
        amounts = [amount for each, amount in moments if each == phase]
        assert amounts == sorted(amounts)
        assert 0 < amounts[0] < amounts[-1] <= run.amounts[phase]
        if phase in FILE_PHASES:
            assert all(amount == int(amount) for amount in amounts)
        else:
            gaps = {round(later - earlier, 9) for earlier, later in pairwise(amounts)}
            assert len(gaps) == 1
