"""What a run came to, in a line; and the optima of a plan as text for people and entries for machines."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paretoik.formulations.protocol import is_loop
from paretoik.front.provenance import confirmation_text
from paretoik.review.run_words import ending_words
from paretoik.run_files import DRAWING, RUN, STOPPED, can_resume, problem_words, read_run
from paretoik.shell_command import shell_command
from paretoik.tables import columns

if TYPE_CHECKING:
    from paretoik.front.front import Front
    from paretoik.trajectory.plan import Plan


def status_text(front: Front) -> str:
    """Return what a verb came to in what time, and what ended it if that came early."""
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
            return (
                f"{points} after {counts['generations']} generations, {counts['evaluations']} evaluations{failed} and "
                f"{duration} ({_ending(front, status)})"
            )


def _ending(front: Front, status: str) -> str:
    """Return why a search ended; of a time limit that left some time, for what."""
    settings, seconds = front.provenance.get("settings", {}), front.provenance["counts"]["seconds"]
    limit = settings.get("time_limit")
    if status != "time limit" or not settings.get("refine") or limit is None or seconds >= limit:
        return ending_words(status)
    return f"the time limit of {limit:g} s was reached, less what certificates might have taken"


def plan_text(plan: Plan, name: str, unit: str, out: Path) -> str:
    """Return the optima of a plan, and where they are pictured."""
    counts, status = plan.provenance["counts"], plan.provenance["status"]
    count = len(plan.optima)
    lines = [
        f"{count} distinct {'optimum' if count == 1 else 'optima'} from {counts['starts']} starts in "
        f"{counts['seconds']:.1f} s{_stopped(status, 'optima')}"
    ]
    rows = [
        (
            "optimum",
            f"{name} [{unit}]" if unit else name,
            "branch",
            "status",
            "limits between samples",
            "off the curve by",
        )
    ]
    for rank, each in enumerate(plan.optima):
        rows.append(
            (
                str(rank),
                f"{each.objective:.6g}",
                each.label,
                each.status,
                _kept(each.violation_between),
                f"{each.discretisation_error:.1e}",
            )
        )
    lines.append(columns(rows))
    lines += filter(None, [confirmation_text(plan.provenance)])
    if (out / DRAWING).exists():  # not after a signal
        lines.append(f"pictured in {out / DRAWING}")
    if (command := resume_command(out, status)) is not None:
        lines.append(f"go on:   {command}")
    named = problem_words(plan.provenance.get("problem"))
    lines.append(f"export:  {shell_command('paretoik', 'export', out, '--point', '0', *named)}")
    return "\n".join(lines)


def resume_command(folder: Path, status: object = "interrupted") -> str | None:
    """Return the command by which a run goes on that has a ``status``; None where it was not stopped, or cannot."""
    if status not in STOPPED or not can_resume(folder):
        return None
    return shell_command("paretoik", "resume", folder, *problem_words(read_run(folder / RUN).get("problem")))


def optima_entries(plan: Plan) -> list[dict[str, Any]]:
    """Return the optima of a plan as data, best first."""
    return [
        {
            "id": rank,
            "objective": each.objective,
            "branch": each.label,
            "status": each.status,
            "violation_between": each.violation_between,
            "criticality": each.criticality,
            "discretisation_error": each.discretisation_error,
        }
        for rank, each in enumerate(plan.optima)
    ]


def _kept(violation: float) -> str:
    """Return whether limits are kept between samples; a stopped plan did not look."""
    if math.isnan(violation):
        return "unknown"
    return "kept" if violation <= 0 else f"violated by {violation:.1e} of a range"


def _stopped(status: str, usual: str) -> str:
    """Return in brackets what ended a verb early, "" where it came to its own end."""
    return "" if status == usual else f" (stopped by {status})"
