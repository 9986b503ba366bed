"""How long a verb will still take, once its present stage has come far enough to tell."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class TimeLeftOptions:
    """When a stage has come far enough for an estimate of what is left of it."""

    share: float = 0.1  # of all that is to do, done by then
    seconds: float = 0.5  # passed by then
    tightening: float = 0.5  # of the time of refinement: 0.1 to 0.8, as many limits as are active between samples


OPTIONS = TimeLeftOptions()


def time_left(done: int, total: int, seconds: float, later: float, again: float) -> float | None:
    """Return about how many seconds are left where ``done`` of ``total`` took ``seconds``; None as long as few are.

    Later stages take ``later`` seconds for each of the total, and ``again`` times as long as this one.
    """
    if not done or done < OPTIONS.share * total or seconds < OPTIONS.seconds:
        return None
    return seconds / done * ((1 + again) * total - done) + later * total


def sweep_time_left(done: int, total: int, seconds: float, *, before: int, later: float, again: float) -> float | None:
    """Return about how many seconds an ε-front will still take; None as long as it found few points itself.

    From ``before`` points on it has taken ``seconds``. Later stages take for each point ``again`` times as long as
    finding it took, and ``later`` seconds.
    """
    gained = done - before
    if gained < max(OPTIONS.share * total, 1.0) or seconds < OPTIONS.seconds:
        return None
    each = seconds / gained
    return each * (total - done) + total * (again * each + later)
