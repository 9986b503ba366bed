"""Tolerances and grids of the verifier."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class VerificationTolerances:
    """Deviations that the verifier accepts.

    A test confirms each deviation by a run that exceeds it threefold. They are the library's claims, or the rounding
    between two computations of the same number. Derivatives along the self-motion are differences: rounding leaves half
    of their digits to ``criticality``.
    """

    times: float = 1e-9  # share of the duration: sample times compared with those of the path
    on_path: float = 1e-9  # share of the arm's length, and rad: the library's claim for samples
    limits: float = 1e-8  # share of a limit's range: the claim of certificates at the instants of the problem
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
    sums: float = 1e-6  # weights below 0, or a sum that differs from 1
    tightened: float = 1e-2  # share of a limit's range by which refinement tightens limits at most
    rest: float = 1e-6  # s: duration of an interval without motion, which is not counted


@dataclass(frozen=True, kw_only=True)
class VerificationOptions:
    """Grids and steps of a verification."""

    finer: int = 50  # instants per interval at which limits are checked between samples
    nodes: int = 10  # Chebyshev points per piece of a curve that is projected onto the path
    tail: float = 1e-12  # rad or m: a piece with smaller last coefficients is not split
    splits: int = 3  # most halvings of a piece
    step: float = 1e-6  # rad: central differences along the self-motion
    spacing: int = 12  # samples between those moved together: each value depends on fewer
    foreseen: float = 1e-3  # share of a slope: largest difference from the predicted change in a random direction
    kink: float = 1e-3  # share by which slopes on both sides differ at a kink
    rounds: int = 12  # number of times that slopes on the other side of kinks are added
    trials: tuple[float, ...] = (1e-4, 1e-5, 1e-6)  # rad: steps that show a gain
    probe: float = 1e-4  # rad: step to the other side of kinks
    instants: int = 4  # distances computed per interval before they are bounded
    bisections: int = 14  # halvings of an interval in which a collision cannot be excluded
    sections: int = 60  # golden sections of a link: below the rounding of its length
    end_accelerations: int = 3  # number of accelerations from which a free end's is extrapolated
    turn: float = 1e-3  # rad, or the arm's length: largest joint motion in differences of normal directions
    newton_steps: int = 30  # steps of a projection onto the path


TOLERANCES = VerificationTolerances()
OPTIONS = VerificationOptions()
