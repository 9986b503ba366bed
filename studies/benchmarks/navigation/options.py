"""The lengths of the benchmark's moves, and the tolerances of its checks."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class MoveOptions:
    """The lengths of random moves, and tolerances; all but ``critical`` and ``violation`` are shares of a range.

    A move goes from ``shortest`` to ``longest``; ``around`` is the number of points asked for around one. A move is
    certified up to a residual ``critical`` and a ``violation``, and equals another one within ``same``. If every
    objective has a ``weight``, the exchange rate must agree within the share ``rate`` with a further move by
    ``rate_step``. That step is as small as the residuals of both ends allow: fronts of sliders are so curved that the
    mean rate over 1e-3 is 1.65 times the certificate's, 1.04 over 1e-4 and 1.0001 over 1e-5.
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
