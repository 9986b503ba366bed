"""The result of a verification: a row for everything that was checked, and one screen of text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from paretoik.tables import html_representation

Verdict = Literal["passed", "failed", "noted", "not checked"]


@dataclass(frozen=True, kw_only=True)
class Worst:
    """The worst value that a check met: ``value`` of ``what``, in the ``unit`` of its ``limit``.

    ``joint`` is a joint, a frame, or a link with its obstacle; "" and NaN stand for what a check does not have.
    """

    what: str
    joint: str = ""
    time: float = math.nan
    value: float = math.nan
    limit: float = math.nan
    unit: str = ""

    def __str__(self) -> str:
        """Return "velocity of joint2 at 0.45 s: 3.81 rad/s, limit 3.8"."""
        text = self.what + (f" of {self.joint}" if self.joint else "")
        text += "" if math.isnan(self.time) else f" at {self.time:.4g} s"
        text += "" if math.isnan(self.value) else f": {self.value:.7g} {self.unit}".rstrip()
        return text + ("" if math.isnan(self.limit) else f", limit {self.limit:.7g}")


@dataclass(frozen=True, kw_only=True)
class Check:
    """One thing that was checked of one point, or of the whole run (``point`` None).

    ``deviation`` is the largest that was met, in the unit of ``tolerance``; both are NaN if nothing is measured.
    ``verdict`` is "passed", "failed", "noted" (measured, but the library promises nothing) or "not checked". ``detail``
    says in one line what fails, or why nothing was checked. ``worst`` says where: joint, time, value and limit.
    """

    subject: str
    point: int | None
    deviation: float
    tolerance: float
    verdict: Verdict
    detail: str = ""
    worst: Worst | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Verification:
    """Everything that was checked of a run, as rows; ``print`` shows it on one screen."""

    folder: str
    rows: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """Whether no check failed; see also ``verified``."""
        return not self.failures

    @property
    def verified(self) -> bool:
        """Whether every check was made and passed, so that nothing of the run is left to belief."""
        return not (self.failures or self.unchecked or self.exceeded)

    @property
    def failures(self) -> tuple[Check, ...]:
        """The rows that failed."""
        return tuple(row for row in self.rows if row.verdict == "failed")

    @property
    def unchecked(self) -> tuple[Check, ...]:
        """The rows that say what was not checked, and why."""
        return tuple(row for row in self.rows if row.verdict == "not checked")

    @property
    def exceeded(self) -> tuple[Check, ...]:
        """The rows of limits that are exceeded at places where the library promises nothing."""
        return tuple(row for row in self.rows if row.verdict == "noted" and row.deviation > row.tolerance)

    @property
    def headline(self) -> str:
        """One line: the checks that failed or passed, those not made with their reasons, limits exceeded."""
        made = len(self.rows) - len(self.unchecked)
        text = f"{len(self.failures)} of {made} checks fail" if self.failures else f"{made} checks passed"
        text = f"verified, all {text}" if self.verified else text
        if self.unchecked:
            text += f", {len(self.unchecked)} not made: {_listed(self.unchecked)}"
        if self.exceeded:
            text += f"; limits exceeded without a promise: {_listed(self.exceeded)}"
        return f"{self.folder}: {text}"

    def __repr__(self) -> str:
        return verification_text(self)

    _repr_html_ = html_representation


def judge(
    subject: str,
    deviation: float,
    tolerance: float,
    detail: str,
    *,
    point: int | None = None,
    worst: Worst | None = None,
) -> Check:
    """Return the row of a deviation, which fails if it is above the tolerance or not a number."""
    passed = bool(deviation <= tolerance)
    return Check(
        subject=subject,
        point=point,
        deviation=float(deviation),
        tolerance=float(tolerance),
        verdict="passed" if passed else "failed",
        detail="" if passed else detail,
        worst=worst,
    )


def demand(subject: str, holds: object, detail: str, *, point: int | None = None) -> Check:
    """Return the row of something that holds or fails, without a measure."""
    return Check(
        subject=subject,
        point=point,
        deviation=math.nan,
        tolerance=math.nan,
        verdict="passed" if holds else "failed",
        detail="" if holds else detail,
    )


def note(
    subject: str,
    deviation: float,
    detail: str,
    *,
    tolerance: float = math.nan,
    point: int | None = None,
    worst: Worst | None = None,
) -> Check:
    """Return the row of what was measured although the library promises nothing."""
    return Check(
        subject=subject,
        point=point,
        deviation=float(deviation),
        tolerance=tolerance,
        verdict="noted",
        detail=detail,
        worst=worst,
    )


def leave_out(subject: str, reason: str, *, point: int | None = None) -> Check:
    """Return the row of what was not checked, and why."""
    return Check(
        subject=subject, point=point, deviation=math.nan, tolerance=math.nan, verdict="not checked", detail=reason
    )


def verification_text(verification: Verification, *, lines: int = 12) -> str:
    """Return a verification as one screen: the headline, a line per subject, then at most ``lines`` failures."""
    subjects = list(dict.fromkeys(row.subject for row in verification.rows))
    groups = [[row for row in verification.rows if row.subject == subject] for subject in subjects]
    width = max((len(subject) for subject in subjects), default=0)
    text = [verification.headline]
    text += [_subject_line(group, width) for group in groups]
    failures = verification.failures
    text += [f"fails: {_place(row)}{row.subject}: {row.detail}" for row in failures[:lines]]
    if len(failures) > lines:
        text.append(f"and {len(failures) - lines} more, in .failures")
    return "\n".join(text)


def _listed(rows: Sequence[Check]) -> str:
    """Return each subject once, with its number of points and the first reason."""
    subjects = dict.fromkeys(row.subject for row in rows)
    groups = [[row for row in rows if row.subject == subject] for subject in subjects]
    return ", ".join(
        f"{group[0].subject}{f' of {len(group)} points' if len(group) > 1 else ''} "
        f"({group[0].worst or group[0].detail})"
        for group in groups
    )


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
        line += "" if row.worst is None else f", {row.worst}"
    if verdict in ("failed", "not checked") and len(rows) > 1:
        line += f"  {len(same)} of {len(rows)}"
    if verdict in ("not checked", "noted"):
        line += f"  {same[0].detail}"
    return line.rstrip()


def _place(row: Check) -> str:
    return "" if row.point is None else f"point {row.point}, "
