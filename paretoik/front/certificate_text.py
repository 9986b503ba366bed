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
    worst = (certificates.kkt_residual, certificates.violation, certificates.violation_between)
    residual, violation, between = (_worst(column) for column in worst)
    lines = [
        f"certified: {statuses or 'no point'}; criticality {residual}, limits violated by {violation} "
        f"at the samples and {between} between them"
    ]
    reasons, counts = np.unique(_kinds_of_reason(certificates), return_counts=True)
    order = np.argsort(-counts, kind="stable")
    lines += [f"undetermined: {counts[i]} of {len(certificates)}, {reasons[i]}" for i in order]
    return "\n".join(lines)


def _worst(values: Values) -> str:
    """Return the worst of the values that are known, in words."""
    if len(values) and np.isnan(values).all():
        return "unknown"
    return f"at most {np.fmax.reduce(values, initial=0.0):.1e}"


def _kinds_of_reason(certificates: Certificates) -> list[str]:
    """Return the reason of every undetermined point, alike where its numbers alone differ."""
    reasons = certificates.reason[certificates.status == "undetermined"].tolist()
    if len(reasons) > 1:
        reasons = [re.sub(r"^(criticality|curvature) \S+?(:?) ", r"\1\2 ", reason) for reason in reasons]
    return [reason for reason in reasons if reason]
