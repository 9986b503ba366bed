"""How long a verb will still take, once its present stage has come far enough to tell."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class TimeLeftOptions:
    """Settings of estimates of the time left.

    share: share of a stage that is done before an estimate
    seconds: seconds of a stage before an estimate
    """

    share: float = 0.1
    seconds: float = 0.5


OPTIONS = TimeLeftOptions()


def time_left(done: float, left: float, seconds: float, later: float = 0.0) -> float | None:
    """Return about how many seconds are left: of the stage, whose work ``done`` took ``seconds``, and ``later``.

    It is None if too little is done to tell.
    """
    if done <= 0 or done < OPTIONS.share * (done + left) or seconds < OPTIONS.seconds:
        return None
    return seconds / done * left + later
