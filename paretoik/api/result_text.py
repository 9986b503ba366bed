"""Summaries of fronts and choices: text for people, entries for machines."""

from __future__ import annotations

import math
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paretoik.file_paths import shell_command
from paretoik.formulations.protocol import is_loop
from paretoik.front.certificates import certificate_text
from paretoik.front.choice_tree import preference_data
from paretoik.front.points import confirmation_text
from paretoik.review.words import describe_limits_between, ending_words
from paretoik.runs.files import DRAWING, RUN, STOPPED, can_resume, problem_words, read_run
from paretoik.tables import columns, wrap_text

if TYPE_CHECKING:
    from paretoik.front.choice import Choice
    from paretoik.front.front import Front
    from paretoik.trajectory.plan import Plan

# The result of a run in one line; the optima of a plan as text and as data.


def status_text(front: Front) -> str:
    """Return a verb's result, time, and the cause of an early end."""
    provenance = front.provenance
    counts, status = provenance["counts"], provenance["status"]
    duration = f"{counts['seconds']:.1f} s"
    if is_loop(front):
        return f"{counts['steps']} of {counts['of']} steps in {duration} ({ending_words(status)})"
    points = "1 point" if len(front) == 1 else f"{len(front)} points"
    match provenance.get("verb", "solve"):
        case "epsilon_front":
            return f"{points} after {counts['levels']} levels of ε and {duration}{_stopped(status, 'epsilon')}"
        case "refine":
            return (
                f"{len(front)} of {counts['points']} points, {counts['converged']} converged and {counts['improved']} "
                f"improved, after {duration}{_stopped(status, 'refined')}"
            )
        case _:
            failed = f" ({counts['failed']} failed)" if counts.get("failed") else ""
            settings, ending = provenance.get("settings", {}), ending_words(status)
            limit = settings.get("time_limit")
            if status == "time limit" and settings.get("refine") and limit is not None and counts["seconds"] < limit:
                ending = f"the time limit of {limit:g} s was reached, less the time reserved for certificates"
            return (
                f"{points} after {counts['generations']} generations, {counts['evaluations']} evaluations{failed} and "
                f"{duration} ({ending})"
            )


def plan_text(plan: Plan, name: str, unit: str, out: Path) -> str:
    """Return a plan's optima, the path of their picture, and next commands."""
    counts, status = plan.provenance["counts"], plan.provenance["status"]
    count = len(plan.optima)
    lines = [
        f"{count} distinct {'optimum' if count == 1 else 'optima'} from {counts['starts']} starts in "
        f"{counts['seconds']:.1f} s{_stopped(status, 'optima')}"
    ]
    named = f"{name} [{unit}]" if unit else name
    rows = [("optimum", named, "branch", "status", "limits between samples", "discretisation error")]
    for rank, each in enumerate(plan.optima):
        kept = "satisfied" if each.violation_between <= 0 else f"violated by {each.violation_between:.1e} of a range"
        if math.isnan(each.violation_between):  # a stopped plan has no value
            kept = "unknown"
        value, error = f"{each.objective:.6g}", f"{each.discretisation_error:.1e}"
        rows.append((str(rank), value, each.label, each.status, kept, error))
    lines.append(columns(rows))
    lines += filter(None, [confirmation_text(plan.provenance)])
    if (out / DRAWING).exists():  # a stopped run has no picture
        lines.append(f"pictured in {out / DRAWING}")
    if (command := resume_command(out, status)) is not None:
        lines.append(f"resume:  {command}")
    words = problem_words(plan.provenance.get("problem"))
    lines.append(f"export:  {shell_command('paretoik', 'export', out, '--point', '0', *words)}")
    return "\n".join(lines)


def resume_command(folder: Path, status: object = "interrupted") -> str | None:
    """Return the command that resumes a run of this status, None if that is impossible."""
    if status not in STOPPED or not can_resume(folder):
        return None
    return shell_command("paretoik", "resume", folder, *problem_words(read_run(folder / RUN).get("problem")))


def optima_entries(plan: Plan) -> list[dict[str, Any]]:
    """Return the optima of a plan as data, best first."""
    names = ("status", "violation_between", "criticality", "discretisation_error")
    return [
        {"id": rank, "objective": each.objective, "branch": each.label} | {name: getattr(each, name) for name in names}
        for rank, each in enumerate(plan.optima)
    ]


def _stopped(status: str, usual: str) -> str:
    """Return in brackets the cause of an early end, "" for ``usual``."""
    return "" if status == usual else f" (stopped by {status})"


# Summaries of fronts and choices: text and entries.


def result_text(front: Front, out: Path) -> str:
    """Return a summary of a result, and the commands that resume the run, choose a point and replay it."""
    provenance, lines = front.provenance, [status_text(front)]
    if is_loop(front):
        error, drift = provenance["position_error"], provenance["drift"]
        lines.append(f"position error {error:.6g} m (mean over the steps), drift {drift:.6g} rad")
        rows = [("objective", "unit", "weight", "mean over the steps")]
        weights = provenance["settings"]["weights"]
        for name, unit, value in zip(front.names, front.units, front.objectives[0], strict=True):
            rows.append((name, unit, f"{weights[name]:.3g}", f"{value:.6g}"))
        lines.append(columns(rows))
        assert front.violation is not None
        if front.violation[0] > 0:
            lines.append(f"limits of the arm are violated by {100 * front.violation[0]:.3g} % of their range")
    else:
        rows = [("objective", "unit", "best", "worst on the front")]
        for name, unit, more, values in zip(front.names, front.units, front.maximised, front.objectives.T, strict=True):
            best, worst = (values.max(), values.min()) if more else (values.min(), values.max())
            rows.append((name, unit, f"{best:.6g}", f"{worst:.6g}"))
        lines.append(columns(rows))
        if front.certificates is not None:
            lines.append(certificate_text(front.certificates))
        lines += filter(None, [confirmation_text(provenance), gap_text(front), describe_limits_between(front)])
        counts = provenance["counts"]
        if counts.get("failed"):
            lines.append(f"{counts['failed']} evaluations failed, the first with: {counts['first_cause']}")
    if (command := resume_command(out, provenance["status"])) is not None:
        lines.append(f"resume:  {command}")
    named = problem_words(provenance.get("problem"))
    equal = ",".join(f"{name}={1 / len(front.names):.2g}" for name in front.names)
    fits = not any(sign in name for name in front.names for sign in ",=")
    preference = ["--weights", equal] if fits else ["--compromise"]
    lines.append(f"choose:  {shell_command('paretoik', 'select', out, *preference, *named)}")
    lines.append(f"replay:  {shell_command('paretoik', 'show', out, *named)}")
    return "\n".join(lines)


def choice_text(front: Front, choice: Choice) -> str:
    """Return a chosen point, the reason of the choice, and its certificate."""
    rows = [
        (f"  {name}", f"{value:.6g} {unit}")
        for name, unit, value in zip(front.names, front.units, choice.objectives, strict=True)
    ]
    lines = [f"point {choice.id}", columns(rows), wrap_text(choice.reason, 100)]
    if front.certificates is not None:
        lines.append(certificate_text(front.certificates[[choice.index]]))
    lines += filter(None, [describe_limits_between(front, [choice.index])])
    return "\n".join(lines)


def choice_entry(front: Front, choice: Choice) -> dict[str, Any]:
    """Return a chosen point as data: its entry, reason and facts."""
    facts = {name: getattr(choice, name) for name in ("reason", "verdict", "score", "details", "jumps")}
    lists = {name: [asdict(each) for each in getattr(choice, name)] for name in ("ends", "neighbours", "rates")}
    preference = None if choice.preference is None else preference_data(choice.preference)
    shares = dict(zip(front.names, choice.shares, strict=True))
    return entries(front)[choice.index] | facts | {"preference": preference, "shares": shares} | lists


def gap_text(front: Front) -> str:
    """Return a front's jumps, and the hypervolume that more points could add; "" if unknown."""
    lines = []
    if front.jumps:
        pairs = ", ".join(f"{one} and {other}" for one, other in front.jumps)
        lines.append(f"jump{'s' * (len(front.jumps) > 1)} to another branch of optima between points {pairs}")
    if front.missing_hypervolume is not None:
        lines.append(f"further points could add about {100 * front.missing_hypervolume:.2g} % of the hypervolume")
    return "\n".join(lines)


def entries(front: Front) -> list[dict[str, Any]]:
    """Return all points as data: id, objectives by name, certificate by name."""
    rows: list[dict[str, Any]] = [
        {"id": int(number), "objectives": dict(zip(front.names, values, strict=True))}
        for number, values in zip(front.ids, front.objectives, strict=True)
    ]
    certificates = front.certificates
    if certificates is not None:
        for index, entry in enumerate(rows):
            entry["certificate"] = {part.name: getattr(certificates, part.name)[index] for part in fields(certificates)}
    return rows
