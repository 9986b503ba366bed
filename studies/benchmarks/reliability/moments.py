"""Moments of kills: equally many in every phase, in all runs that have it, spread over all of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from studies.benchmarks.reliability.kills import WholeRun
from studies.benchmarks.reliability.phases import FILE_PHASES, PHASES, Phase

Moment: TypeAlias = tuple[Phase, float]  # a phase, and the amount of it


def spread_kills(runs: Sequence[WholeRun], count: int, *, short: float) -> dict[str, list[Moment]]:
    """Return the moments of ``count`` kills by the names of runs; a phase of no more than ``short`` gets none.

    Every phase has an even share of the kills, and every run that has the phase an even share of these, at even
    distances: a run may have no refinement, and another one nothing else.
    """
    moments: dict[str, list[Moment]] = {run.name: [] for run in runs}
    having = {phase: [run for run in runs if run.amounts.get(phase, 0.0) > short] for phase in PHASES}
    phases = [phase for phase in PHASES if having[phase]]
    for phase, kills in zip(phases, _even(count, len(phases)), strict=True):
        for run, share in zip(having[phase], _even(kills, len(having[phase])), strict=True):
            for number in range(share):
                amount = (number + 0.5) / share * run.amounts[phase]
                moments[run.name].append((phase, 1 + int(amount) if phase in FILE_PHASES else amount))
    return moments


def _even(count: int, parts: int) -> list[int]:
    """Return numbers that sum to ``count`` and differ by at most one."""
    return [count // parts + (part < count % parts) for part in range(parts)]
