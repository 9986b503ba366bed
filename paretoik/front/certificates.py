"""Certificates of a front's points: violation, criticality, curvature and exchange rates."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Values
from paretoik.errors import InvalidInput
from paretoik.inputs import shown
from paretoik.tables import fit_screen, html_representation


def certificate_text(certificates: Certificates) -> str:
    """Return text on statuses, worst values and reasons for undetermined points."""
    values, counts = np.unique(certificates.status, return_counts=True)
    statuses = ", ".join(f"{count} {status}" for status, count in zip(values, counts, strict=True)) or "no point"
    samples, between = _worst(certificates.violation), _worst(certificates.violation_between)
    if samples:
        violation = f"limits violated by {samples} at the samples"
        violation += f" and {between} between them" if between else ", violation between them unknown"
    else:
        violation = "violation of limits unknown" + f" at the samples, {between} between them" * bool(between)
    lines = [f"certified: {statuses}; criticality {_worst(certificates.criticality) or 'unknown'}, {violation}"]
    if errors := _worst(certificates.discretisation_error.max(axis=1, initial=0.0)):
        lines.append(f"values differ from those of the curves by {errors} of their units")
    reasons = certificates.reason[certificates.status == "undetermined"].tolist()
    if len(reasons) > 1:  # reasons that differ only in numbers count as one
        reasons = [re.sub(r"^(criticality|curvature) \S+?(:?) ", r"\1\2 ", reason) for reason in reasons]
    kinds, counts = np.unique([reason for reason in reasons if reason], return_counts=True)
    order = np.argsort(-counts, kind="stable")
    lines += [f"undetermined: {counts[i]} of {len(certificates)}, {kinds[i]}" for i in order]
    return "\n".join(lines)


def _worst(values: Values) -> str:
    """Return the worst value that is not NaN, in words; "" if all are NaN."""
    if len(values) and np.isnan(values).all():
        return ""
    worst = float(np.fmax.reduce(values, initial=0.0))
    return f"at most {worst:.1e}" if worst else "at most 0"


WEIGHT_TOLERANCE = 1e-6  # share of all objectives' weight below which a point may be only weakly optimal
STATUSES = ("minimum", "saddle", "undetermined", "under-resolved")


@dataclass(frozen=True, kw_only=True, eq=False)
class Certificates:
    """Certificates of points, arrays with one row per point; "optimal" means locally optimal.

    violation: worst violation of all limits at the samples, as a share of a limit's range
    violation_between: upper bound of the violation at any time
    criticality: criticality χ, the gain that all objectives can still have at once, as a share of the front's ranges
    weights: multipliers (points, n_obj) of the objectives divided by these ranges; their sum is 1
    exchange_rates: derivatives [p, i, j] = ∂f_j/∂f_i at point p with the others fixed, in natural units; NaN if f_i or
        f_j has no weight, the point is not critical or multipliers are not unique
    exchange_intervals: smallest and largest value of each exchange rate [p, i, j], NaN if unknown
    status: "minimum", "saddle", "undetermined", or "under-resolved": critical for its samples, but a value is off by
        more than 0.1 % on the motion's curve
    reason: why a point is no minimum or its intervals are unknown, else ""
    discretisation_error: difference (points, n_obj) of the objectives from their values on the motion's curve, computed
        on a grid 50 times finer, in the objectives' units

    Values that could not be computed are NaN. If motions are splines, a minimum satisfies its limits at any time.
    """

    violation: Values
    violation_between: Values
    criticality: Values
    weights: Float[np.ndarray, "points n_obj"]
    exchange_rates: Float[np.ndarray, "points n_obj n_obj"]
    exchange_intervals: Float[np.ndarray, "points n_obj n_obj 2"]
    status: np.ndarray
    reason: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.str_))
    discretisation_error: Float[np.ndarray, "points n_obj"] = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        """Check numbers of rows and statuses; fill in missing reasons and errors."""
        points = len(self.violation)
        if not len(self.reason):
            object.__setattr__(self, "reason", np.full(points, "", dtype=np.str_))
        if not len(self.discretisation_error):  # missing in earlier runs
            object.__setattr__(self, "discretisation_error", np.full(self.weights.shape, np.nan))
        for part in fields(self):
            if len(getattr(self, part.name)) != points:
                raise InvalidInput(
                    f"certificates: {part.name} must have {points} rows, got {len(getattr(self, part.name))}"
                )
        unknown = set(self.status.tolist()) - set(STATUSES)
        if unknown:
            raise InvalidInput(
                f"certificates: status must be one of {', '.join(STATUSES)}, got {shown(sorted(unknown)[0])}"
            )

    @property
    def weak(self) -> np.ndarray:
        """Mask (points,) of points that may be only weakly optimal: some objective has no weight."""
        return np.asarray(self.weights.min(axis=1) < WEIGHT_TOLERANCE)

    @property
    def kkt_residual(self) -> Values:
        """Former name of ``criticality``."""
        return self.criticality

    def __len__(self) -> int:
        return len(self.violation)

    def __repr__(self) -> str:
        """Return the points per status, the worst values, and the names of the arrays."""
        parts = " ".join(f".{part.name}" for part in fields(self))
        return fit_screen(f"Certificates of {len(self)} points\n{certificate_text(self)}\narrays: {parts}")

    _repr_html_ = html_representation

    def __getitem__(self, rows: Any) -> Certificates:
        return Certificates(**{part.name: getattr(self, part.name)[rows] for part in fields(self)})

    def rescale(self, ranges: Values, others: Values) -> Certificates:
        """Return the certificates converted from ``ranges`` to the ranges ``others`` (n_obj,).

        The criticality becomes an upper bound.
        """
        factors = others / ranges
        weights = self.weights * factors
        weights = weights / weights.sum(axis=1, keepdims=True)
        return replace(self, weights=weights, criticality=self.criticality / factors.min())

    def replace_rows(self, rows: Int[np.ndarray, " rows"], others: Certificates) -> Certificates:
        """Return the certificates with ``rows`` replaced by ``others``."""
        order = np.arange(len(self))
        order[rows] = len(self) + np.arange(len(others))
        return concatenate([self, others])[order]


def concatenate(batches: Sequence[Certificates]) -> Certificates:
    """Return certificates as one batch."""
    parts = {part.name: [getattr(each, part.name) for each in batches] for part in fields(Certificates)}
    return Certificates(**{name: np.concatenate(values) for name, values in parts.items()})
