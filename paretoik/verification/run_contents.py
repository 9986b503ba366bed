"""The files of a run, as the verifier reads them: every fault becomes a row of the result."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from paretoik.errors import InvalidRun
from paretoik.inputs import first_line
from paretoik.runs.files import MOTIONS, OPTIMA, RUN, TABLE, digest, read_arrays, read_plain_file, read_run, read_table
from paretoik.tables import html_representation

# The result of a verification: a row for every check, and one screen of text.


Verdict = Literal["passed", "failed", "noted", "not checked"]


@dataclass(frozen=True, kw_only=True)
class Worst:
    """The worst value that a check found; "" and NaN stand for parts that the check does not have.

    ``joint`` is a joint, a frame, or a link with its obstacle; ``unit`` is that of ``value`` and ``limit``.
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
    """One check of a point, or of the whole run.

    point: id of the point; None for the whole run
    deviation: largest deviation, in the unit of ``tolerance``; both are NaN if nothing is measured
    verdict: "passed", "failed", "noted" (measured, but the library promises nothing) or "not checked"
    detail: failure, or reason why nothing was checked, in one line
    worst: joint, time, value and limit of the worst value
    """

    subject: str
    point: int | None = None
    deviation: float = math.nan
    tolerance: float = math.nan
    verdict: Verdict
    detail: str = ""
    worst: Worst | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Verification:
    """The results of all checks of a run, as rows.

    ``print`` shows one screen: the headline, a line per subject, then at most 12 failures.
    """

    folder: str
    rows: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """Whether no check failed; see also ``verified``."""
        return not self.failures

    @property
    def verified(self) -> bool:
        """Whether every check was made and passed."""
        return not (self.failures or self.unchecked or self.exceeded)

    @property
    def failures(self) -> tuple[Check, ...]:
        """The rows that failed."""
        return tuple(row for row in self.rows if row.verdict == "failed")

    @property
    def unchecked(self) -> tuple[Check, ...]:
        """The rows of checks that were not made, with their reasons."""
        return tuple(row for row in self.rows if row.verdict == "not checked")

    @property
    def exceeded(self) -> tuple[Check, ...]:
        """The rows of exceeded limits that the library does not guarantee."""
        return tuple(row for row in self.rows if row.verdict == "noted" and row.deviation > row.tolerance)

    @property
    def headline(self) -> str:
        """One line: checks failed or passed, checks not made with their reasons, limits exceeded."""
        made = len(self.rows) - len(self.unchecked)
        text = f"{len(self.failures)} of {made} checks fail" if self.failures else f"{made} checks passed"
        text = f"verified, all {text}" if self.verified else text
        if self.unchecked:
            text += f", {len(self.unchecked)} not made: {_listed(self.unchecked)}"
        if self.exceeded:
            text += f"; limits exceeded without a promise: {_listed(self.exceeded)}"
        return f"{self.folder}: {text}"

    def __repr__(self) -> str:
        most, text, failures = 12, [self.headline], self.failures  # most lines of failures
        width = max((len(row.subject) for row in self.rows), default=0)
        for rows in _by_subject(self.rows):  # the worst of the rows of one subject
            verdicts = {row.verdict for row in rows}
            verdict = next(each for each in ("failed", "not checked", "noted", "passed") if each in verdicts)
            same = [row for row in rows if row.verdict == verdict]
            line = f"  {rows[0].subject:<{width}}  {verdict:<11}"
            if measured := [row for row in same if not math.isnan(row.deviation)]:
                row = max(measured, key=lambda each: each.deviation - (each.tolerance if each.tolerance > 0 else 0.0))
                line += f"  {row.deviation:.1e}"
                line += "" if math.isnan(row.tolerance) else f" (accepted {row.tolerance:.1e})"
                line += "" if row.point is None else f" at point {row.point}"
                line += "" if row.worst is None else f", {row.worst}"
            if verdict in ("failed", "not checked") and len(rows) > 1:
                line += f"  {len(same)} of {len(rows)}"
            if verdict in ("not checked", "noted"):
                line += f"  {same[0].detail}"
            text.append(line.rstrip())
        for row in failures[:most]:
            place = "" if row.point is None else f"point {row.point}, "
            text.append(f"fails: {place}{row.subject}: {row.detail}")
        if len(failures) > most:
            text.append(f"and {len(failures) - most} more, in .failures")
        return "\n".join(text)

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
    """Return the row of a deviation, which fails if it is above the tolerance or NaN."""
    row = demand(subject, deviation <= tolerance, detail, point=point)
    return replace(row, deviation=float(deviation), tolerance=float(tolerance), worst=worst)


def demand(subject: str, holds: object, detail: str, *, point: int | None = None) -> Check:
    """Return the row of a condition without a measured deviation."""
    return Check(subject=subject, point=point, verdict="passed" if holds else "failed", detail="" if holds else detail)


def leave_out(subject: str, reason: str, *, point: int | None = None) -> Check:
    """Return the row of a check that was not made, and why."""
    return Check(subject=subject, point=point, verdict="not checked", detail=reason)


def _by_subject(rows: Sequence[Check]) -> list[list[Check]]:
    return [[row for row in rows if row.subject == subject] for subject in dict.fromkeys(row.subject for row in rows)]


def _listed(rows: Sequence[Check]) -> str:
    """Return each subject once, with its number of points and the first reason."""
    return ", ".join(
        f"{group[0].subject}{f' of {len(group)} points' if len(group) > 1 else ''} "
        f"({group[0].worst or group[0].detail})"
        for group in _by_subject(rows)
    )


# The files of a run, as the verifier reads them.


TEXTS = ("status", "reason", "branch")  # columns of text in a table
RESULTS = (TABLE, OPTIMA, MOTIONS, "polygon.npz", "traces.npz", "tool_path.npz")


@dataclass(frozen=True, kw_only=True, eq=False)
class RunContents:
    """Entries of `run.json`, columns of its table, and arrays by file, each by name; and checks of the files."""

    folder: Path
    entries: Mapping[str, Any]
    table: Mapping[str, np.ndarray]
    arrays: Mapping[str, Mapping[str, np.ndarray]]
    checks: list[Check] = field(default_factory=list)

    @property
    def motions(self) -> Mapping[str, np.ndarray]:
        """The arrays of `motions.npz`; empty if there are none."""
        return self.arrays.get(MOTIONS, {})

    @property
    def objectives(self) -> list[dict[str, Any]]:
        """The objectives' entries; a plan has only one."""
        if self.is_plan:
            return [dict(self.entries["objective"])]
        listed = self.entries.get("objectives", [])
        return [dict(each) for each in listed] if isinstance(listed, list) else []

    @property
    def is_plan(self) -> bool:
        """Whether the run is a plan, which has one objective and no front."""
        return "objective" in self.entries

    @property
    def signs(self) -> np.ndarray:
        """−1 for maximised objectives, 1 for the others (n_obj,)."""
        return np.array([-1.0 if each.get("maximised") else 1.0 for each in self.objectives])

    @property
    def ranges(self) -> np.ndarray:
        """The ranges (n_obj,) that the weights of a run refer to."""
        return np.array([float(each["range"][1]) - float(each["range"][0]) for each in self.objectives])

    @property
    def ids(self) -> np.ndarray:
        """The ids of the table's rows, without a table those of the motions."""
        return np.asarray(self.table["id"] if "id" in self.table else self.motions.get("id", np.arange(0)))

    @property
    def values(self) -> np.ndarray:
        """The objectives (points, n_obj) of the table's rows, maximised ones not negated."""
        columns = [self.table.get(str(each["name"]), np.full(len(self.ids), np.nan)) for each in self.objectives]
        return np.stack(columns, axis=1) if columns else np.zeros((len(self.ids), 0))

    def status(self, row: int) -> str:
        """Return the status of a point in the table, "" if it has none."""
        return str(self.table["status"][row]) if "status" in self.table else ""


def read_contents(folder: Path) -> RunContents:
    """Return the contents of a run folder; raises InvalidRun if it is not a run with a result."""
    entries = dict(read_run(folder / RUN))
    if not isinstance(entries.get("files"), dict):
        raise InvalidRun(f"{folder} must be a run with a result, got status {entries.get('status')!r} and no result")
    written = entries.pop("digest", None)
    checks = [demand("digests", written == digest(entries), f"{RUN} does not match its digest: it was edited or cut")]
    table, arrays = dict[str, np.ndarray](), dict[str, dict[str, np.ndarray]]()
    for name, expected in entries["files"].items():
        if name not in RESULTS:
            checks.append(demand("files", False, f"{RUN} lists {name!r}, which is not a file of a result"))
            continue
        try:
            content = read_plain_file(folder / name)
        except InvalidRun as fault:
            checks.append(demand("files", False, str(fault)))
            continue
        same = hashlib.sha256(content).hexdigest() == expected
        checks.append(demand("digests", same, f"{name} does not match its digest in {RUN}: it was edited or cut"))
        try:
            if name.endswith(".npz"):
                arrays[name] = read_arrays(content)
            else:
                stored = read_table(content)
                read = dict[str, np.ndarray]()  # integer ids, texts, or numbers, NaN if missing
                for column in stored.column_names:
                    values = stored.column(column)
                    if column == "id":
                        read[column] = np.asarray(values.cast("int64").to_numpy())
                    elif column in TEXTS:
                        read[column] = np.array(["" if each is None else str(each) for each in values.to_pylist()])
                    else:
                        numbers = [np.nan if each is None else each for each in values.to_pylist()]
                        read[column] = np.array(numbers, dtype=float)
                table = read
        except Exception as fault:  # the parser may raise any error; the file is the cause
            checks.append(demand("files", False, f"{name} cannot be read: {first_line(fault)}"))
    return RunContents(folder=folder, entries=entries, table=table, arrays=arrays, checks=checks)
