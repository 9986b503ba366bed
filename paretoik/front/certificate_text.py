"""Certificates in a few lines of text."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from paretoik.arrays import Values

if TYPE_CHECKING:  # they write themselves with this
    from paretoik.front.certificates import Certificates


def certificate_text(certificates: Certificates) -> str:
    """Return how many points have which status, the worst residual and violations, and why some are undetermined."""
    values, counts = np.unique(certificates.status, return_counts=True)
    statuses = ", ".join(f"{count} {status}" for status, count in zip(values, counts, strict=True))
    lines = [
        f"certified: {statuses or 'no point'}; criticality {_worst(certificates.criticality) or 'unknown'}, "
        f"{_violation_text(certificates)}"
    ]
    if errors := _worst(certificates.discretisation_error.max(axis=1, initial=0.0)):
        lines.append(f"values off those of the curves by {errors} of their units")
    reasons, counts = np.unique(_kinds_of_reason(certificates), return_counts=True)
    order = np.argsort(-counts, kind="stable")
    lines += [f"undetermined: {counts[i]} of {len(certificates)}, {reasons[i]}" for i in order]
    return "\n".join(lines)


def _violation_text(certificates: Certificates) -> str:
    """Return the worst violations of limits, at the samples and between them, in words."""
    samples, between = _worst(certificates.violation), _worst(certificates.violation_between)
    if samples and between:
        return f"limits violated by {samples} at the samples and {between} between them"
    if samples:
        return f"limits violated by {samples} at the samples, violation between them unknown"
    return f"violation of limits unknown{between and f' at the samples, {between} between them'}"


def _worst(values: Values) -> str:
    """Return the worst of the values that are not NaN, in words; "" where all are."""
    if len(values) and np.isnan(values).all():
        return ""
    worst = float(np.fmax.reduce(values, initial=0.0))
    return f"at most {worst:.1e}" if worst else "at most 0"


def _kinds_of_reason(certificates: Certificates) -> list[str]:
    """Return the reason of every undetermined point, alike where its numbers alone differ."""
    reasons = certificates.reason[certificates.status == "undetermined"].tolist()
    if len(reasons) > 1:
        reasons = [re.sub(r"^(criticality|curvature) \S+?(:?) ", r"\1\2 ", reason) for reason in reasons]
    return [reason for reason in reasons if reason]
