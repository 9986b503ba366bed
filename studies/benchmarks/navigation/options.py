"""How far the moves of the benchmark go, and what counts as right."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class MoveOptions:
    """How far random moves go, and what counts; all but ``critical`` and ``violation`` are shares of a range.

    A move goes from ``shortest`` to ``longest``; so many points, ``around``, are asked for around one. A move is
    certified up to a residual ``critical`` and a ``violation``, the same as another one within ``same``. Its exchange
    rate is right within the share ``rate`` of what a further move by ``rate_step`` measures, where every objective has
    a ``weight``. That step is as small as the residuals of both ends allow: fronts of sliders are so curved that over
    1e-3 the mean rate is 1.65 times the certificate's, 1.04 over 1e-4 and 1.0001 over 1e-5.
    """

    shortest: float = 0.01
    longest: float = 0.2
    around: int = 4
    critical: float = 1e-6
    violation: float = 1e-8
    same: float = 1e-5
    rate: float = 0.05
    rate_step: float = 1e-5
    weight: float = 1e-3


OPTIONS = MoveOptions()
