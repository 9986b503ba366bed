"""Tolerances and grids of the verifier."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class VerificationTolerances:
    """Deviations that the verifier accepts, each pinned by a run that exceeds it three times.

    They are what the library claims, or what rounding leaves of the same number computed twice. Derivatives along
    the self-motion are differences: rounding leaves half of their digits to ``criticality``.
    """

    times: float = 1e-9  # share of the duration: sample times against those of the path
    on_path: float = 1e-9  # share of the arm's length, and rad: what the library claims of samples
    limits: float = 1e-8  # share of a limit's range: what certificates claim at the instants of the problem
    between: float = 1e-6  # share of a limit's range, between samples: second derivatives of postures on the path
    stated: float = 1e-6  # share of a limit's range: by how much a stated bound between samples may be too low
    values: float = 1e-9  # share of an objective's size: two ways to sum the same numbers
    resolved: float = 1.1e-3  # share of an objective's size: error of a minimum, 1e-3 as the library measures it
    error: float = 1e-4  # share of an objective's size, a tenth of what counts: jerks are differences in the library
    energies: float = 1e-8  # share of a closed loop's objective, or of a motor's work: sums of many steps
    traces: float = 1e-15  # rad or m: an error copied from one file to another
    directions: float = 1e-12  # length of a unit vector
    maxima: float = 1e-6  # share of a speed: linear programs, and motors at their curve
    criticality: float = 1e-5  # gain of all objectives at once: ten times what a certificate may leave
    weights: float = 1e-2  # share of the steepest gain: weights that others could replace
    rates: float = 1e-6  # share of an exchange rate: the ratio of the weights
    sums: float = 1e-6  # weights: below 0, or their sum off 1
    tightened: float = 1e-2  # share of a limit's range: refinement keeps limits inside by up to this
    rest: float = 1e-6  # s: an interval in which nothing moves; it counts for nothing in a duration


@dataclass(frozen=True, kw_only=True)
class VerificationOptions:
    """Grids and steps of a verification."""

    finer: int = 50  # instants an interval on which limits are checked between samples
    nodes: int = 10  # Chebyshev points a piece of a curve that is projected onto the path
    tail: float = 1e-12  # rad or m: last coefficients of a piece that needs no splitting
    splits: int = 3  # halvings of a piece at most
    step: float = 1e-6  # rad: central differences along the self-motion
    spacing: int = 12  # samples between those that are moved at once: more than any value depends on
    foreseen: float = 1e-3  # share of a slope by which a random direction may differ from what slopes foresee
    kink: float = 1e-3  # share by which slopes on both sides differ at a kink
    rounds: int = 12  # times that slopes on the other side of kinks are added
    trials: tuple[float, ...] = (1e-4, 1e-5, 1e-6)  # rad: steps that show a gain
    probe: float = 1e-4  # rad: step to the other side of kinks
    instants: int = 4  # distances an interval before they are bounded
    bisections: int = 14  # halvings of an interval in which a collision cannot be excluded
    sections: int = 60  # golden sections of a link: below the rounding of its length
    end_accelerations: int = 3  # accelerations that the one at a free end is continued from, at most
    turn: float = 1e-3  # rad, or the arm's length: largest joint motion in differences of normal directions
    newton_steps: int = 30  # steps of a projection onto the path


TOLERANCES = VerificationTolerances()
OPTIONS = VerificationOptions()
