"""What a verification says: a row for everything that was checked, and one screen of text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from paretoik.tables import html_representation

Verdict = Literal["passed", "failed", "noted", "not checked"]


@dataclass(frozen=True, kw_only=True)
class Check:
    """One thing that was checked of one point, or of the run where ``point`` is None.

    ``deviation`` is the largest that was met, in the unit of ``tolerance``; both are NaN where nothing is measured.
    ``verdict`` is "passed", "failed", "noted" (measured, nothing is promised) or "not checked"; ``detail`` says
    in one line what fails, or why nothing was checked.
    """

    subject: str
    point: int | None
    deviation: float
    tolerance: float
    verdict: Verdict
    detail: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Verification:
    """Everything that was checked of a run, as rows; ``print`` shows it on one screen."""

    folder: str
    rows: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """Whether nothing failed; ``unchecked`` says what nobody looked at."""
        return not self.failures

    @property
    def failures(self) -> tuple[Check, ...]:
        """The rows that failed."""
        return tuple(row for row in self.rows if row.verdict == "failed")

    @property
    def unchecked(self) -> tuple[Check, ...]:
        """The rows that say what was not checked, and why."""
        return tuple(row for row in self.rows if row.verdict == "not checked")

    def __repr__(self) -> str:
        return verification_text(self)

    _repr_html_ = html_representation


def judge(subject: str, deviation: float, tolerance: float, detail: str, *, point: int | None = None) -> Check:
    """Return the row of a deviation, which fails where it is above the tolerance or no number."""
    passed = bool(deviation <= tolerance)
    return Check(
        subject=subject,
        point=point,
        deviation=float(deviation),
        tolerance=float(tolerance),
        verdict="passed" if passed else "failed",
        detail="" if passed else detail,
    )


def demand(subject: str, holds: object, detail: str, *, point: int | None = None) -> Check:
    """Return the row of something that holds or fails, without a measure."""
    verdict: Verdict = "passed" if holds else "failed"
    return Check(
        subject=subject,
        point=point,
        deviation=math.nan,
        tolerance=math.nan,
        verdict=verdict,
        detail="" if holds else detail,
    )


def note(subject: str, deviation: float, detail: str, *, point: int | None = None) -> Check:
    """Return the row of what was measured although nothing is promised of it."""
    return Check(
        subject=subject, point=point, deviation=float(deviation), tolerance=math.nan, verdict="noted", detail=detail
    )


def leave_out(subject: str, reason: str, *, point: int | None = None) -> Check:
    """Return the row of what was not checked, and why."""
    return Check(
        subject=subject, point=point, deviation=math.nan, tolerance=math.nan, verdict="not checked", detail=reason
    )


def verification_text(verification: Verification, *, lines: int = 12) -> str:
    """Return a verification as one screen: a line a subject, then what fails, at most so many ``lines`` of it."""
    subjects = list(dict.fromkeys(row.subject for row in verification.rows))
    groups = [[row for row in verification.rows if row.subject == subject] for subject in subjects]
    width = max((len(subject) for subject in subjects), default=0)
    text = [_verdict_line(verification)]
    text += [_subject_line(group, width) for group in groups]
    failures = verification.failures
    text += [f"fails: {_place(row)}{row.subject}: {row.detail}" for row in failures[:lines]]
    if len(failures) > lines:
        text.append(f"and {len(failures) - lines} more, in .failures")
    return "\n".join(text)


def _verdict_line(verification: Verification) -> str:
    failed, unchecked = len(verification.failures), len(verification.unchecked)
    made = len(verification.rows) - unchecked
    verdict = f"{failed} of {made} checks fail" if failed else f"all {made} checks pass"
    return f"{verification.folder}: {verdict}" + (f", {unchecked} not made" if unchecked else "")


def _subject_line(rows: Sequence[Check], width: int) -> str:
    """Return the worst of the rows of one subject as a line."""
    order = ("failed", "not checked", "noted", "passed")
    worst = min(order.index(row.verdict) for row in rows)
    verdict = order[worst]
    same = [row for row in rows if row.verdict == verdict]
    measured = [row for row in same if not math.isnan(row.deviation)]
    line = f"  {rows[0].subject:<{width}}  {verdict:<11}"
    if measured:
        row = max(measured, key=lambda each: each.deviation - (each.tolerance if each.tolerance > 0 else 0.0))
        line += f"  {row.deviation:.1e}"
        line += "" if math.isnan(row.tolerance) else f" (accepted {row.tolerance:.1e})"
        line += "" if row.point is None else f" at point {row.point}"
    if verdict in ("failed", "not checked") and len(rows) > 1:
        line += f"  {len(same)} of {len(rows)}"
    if verdict in ("not checked", "noted"):
        line += f"  {same[0].detail}"
    return line.rstrip()


def _place(row: Check) -> str:
    return "" if row.point is None else f"point {row.point}, "
