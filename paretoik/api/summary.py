"""What came out, in words for people and as entries for machines."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import fields
from itertools import permutations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from paretoik.front.certificates import Certificates
    from paretoik.front.front import Choice, Front

UNIQUE = 1e-3  # relative: an interval of exchange rates no wider is one rate


def result_text(front: Front, out: Path) -> str:
    """Return what a search found, or a closed loop did, what is known of it, and what to do with it next."""
    lines = _loop_lines(front) if "drift" in front.provenance else _front_lines(front)
    weights = ",".join(f"{name}={1 / len(front.names):.2g}" for name in front.names)
    lines.append(f"choose:  {shlex.join(['paretoik', 'select', str(out), '--weights', weights])}")
    lines.append(f"replay:  {shlex.join(['paretoik', 'show', str(out)])}")
    return "\n".join(lines)


def _loop_lines(front: Front) -> list[str]:
    told = front.provenance
    counts, weights = told["counts"], told["settings"]["weights"]
    lines = [
        f"{counts['steps']} of {counts['of']} steps in {counts['seconds']:.1f} s (ended by {told['status']})",
        f"position error {told['position_error']:.6g} m (mean over the steps), drift {told['drift']:.6g} rad",
    ]
    rows = [("objective", "unit", "weight", "mean over the steps")]
    for name, unit, value in zip(front.names, front.units, front.objectives[0], strict=True):
        rows.append((name, unit, f"{weights[name]:.3g}", f"{value:.6g}"))
    lines.append(columns(rows))
    assert front.violation is not None
    if front.violation[0] > 0:
        lines.append(f"limits of the arm are violated by {100 * front.violation[0]:.3g} % of their range")
    return lines


def _front_lines(front: Front) -> list[str]:
    counts = front.provenance["counts"]
    lines = [
        f"{len(front)} points after {counts['generations']} generations, {counts['evaluations']} evaluations and "
        f"{counts['seconds']:.1f} s (ended by {front.provenance['status']})"
    ]
    rows = [("objective", "unit", "best", "worst on the front")]
    for name, unit, maximised, values in zip(
        front.names, front.units, front.maximised, front.objectives.T, strict=True
    ):
        best, worst = (values.max(), values.min()) if maximised else (values.min(), values.max())
        rows.append((name, unit, f"{best:.6g}", f"{worst:.6g}"))
    lines.append(columns(rows))
    if front.certificates is not None:
        lines.append(certified_text(front.certificates))
    if counts["failed"]:
        lines.append(f"{counts['failed']} evaluations failed, the first with: {counts['first_cause']}")
    return lines


def choice_text(front: Front, choice: Choice) -> str:
    """Return a chosen point, why it was chosen, what is certified of it and how its objectives trade there."""
    rows = [
        (f"  {name}", f"{value:.6g} {unit}")
        for name, unit, value in zip(front.names, front.units, choice.objectives, strict=True)
    ]
    lines = [f"point {choice.id}", columns(rows), choice.reason]
    if front.certificates is not None:
        certificate = front.certificates[[choice.index]]
        lines += [certified_text(certificate), *_prices(front, certificate)]
    return "\n".join(lines)


def certified_text(certificates: Certificates) -> str:
    """Return in a line how many points have which status, and the worst residual and violations."""
    found, counts = np.unique(certificates.status, return_counts=True)
    statuses = ", ".join(f"{count} {status}" for status, count in zip(found, counts, strict=True))
    worst = (certificates.kkt_residual, certificates.violation, certificates.violation_between)
    residual, violation, between = (f"{values.max(initial=0.0):.1e}" for values in worst)
    return (
        f"certified: {statuses or 'no point'}; criticality at most {residual}, limits violated by at most {violation} "
        f"at the samples and {between} between them"
    )


def entries(front: Front) -> list[dict[str, Any]]:
    """Return all points as data: id, objectives by name, certificate by name."""
    found: list[dict[str, Any]] = [
        {"id": int(number), "objectives": dict(zip(front.names, values, strict=True))}
        for number, values in zip(front.ids, front.objectives, strict=True)
    ]
    known = front.certificates
    if known is not None:
        for row, entry in enumerate(found):
            entry["certificate"] = {part.name: getattr(known, part.name)[row] for part in fields(known)}
    return found


def columns(rows: Sequence[tuple[str, ...]]) -> str:
    """Return rows of cells as lines with aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def _prices(front: Front, certificate: Certificates) -> list[str]:
    """Return what one unit of each objective costs of every other, where that is known."""
    lines = []
    for i, j in permutations(range(len(front.names)), 2):
        low, high = np.sort(np.abs(certificate.exchange_intervals[0, i, j]))
        if np.isfinite(high):
            price = f"{low:.4g}" if np.isclose(low, high, rtol=UNIQUE) else f"{low:.4g} to {high:.4g}"
            gain, cost = ("more" if front.maximised[i] else "less"), ("less" if front.maximised[j] else "more")
            lines.append(
                f"  1 {front.units[i]} {gain} of {front.names[i]} costs {price} {front.units[j]} {cost} of "
                f"{front.names[j]}"
            )
    return lines
