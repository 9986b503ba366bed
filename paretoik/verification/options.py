"""What the verifier accepts as rounding, and how finely it looks."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class VerificationOptions:
    """Tolerances and grids of a verification; shares are of the arm's length, of a limit's or an objective's range.

    Multipliers of a program whose value is next to 0 are known to half the digits, hence ``weights`` and ``rates``.
    Refinement holds limits a little tighter than asked, so that they hold between samples too: ``tightened``.
    """

    on_path: float = 1e-9  # share of the arm's length, and rad: what the library claims of samples
    limits: float = 1e-8  # share of a limit's range: what certificates claim at the instants of the problem
    between: float = 1e-5  # share of a limit's range: of rates taken by differences between samples
    values: float = 1e-9  # share of an objective's size: of two ways to sum the same numbers
    criticality: float = 1e-5  # gain that all objectives can have at once: tenfold what a certificate may leave
    near: float = 0.1  # share of a limit's range that it counts as near from
    held: float = 1e-3  # gain likewise where limits are near: rows that hold them between samples are not restated
    weights: float = 1e-2  # share of the steepest gain
    rates: float = 1e-2  # share of an exchange rate
    tightened: float = 1e-2  # share of a limit's range
    step: float = 1e-6  # rad: of central differences along the self-motion
    kink: float = 1e-3  # share by which slopes on both sides differ at a kink
    directions: int = 160  # of the self-motion that a certificate is differentiated along: more are thinned out
    instants: int = 4  # between samples, in each interval, before distances are bounded
    bisections: int = 14  # of an interval in which a collision cannot be excluded
    sections: int = 60  # golden sections of a link: below the rounding of its length
    reach: float = 1 / 40  # of an interval: the step of differences between samples
    rest: float = 1e-6  # s: what an interval in which nothing moves is stored as; it counts for nothing in a duration
    maxima: float = 1e-6  # share of a speed by which it may exceed a linear program's
    end_accelerations: int = 3  # that the acceleration at a free end is continued from, at most
    newton_steps: int = 30  # of a projection onto the path


OPTIONS = VerificationOptions()
