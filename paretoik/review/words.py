"""Texts about a run: its problem and settings, why it ended, and its counts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from paretoik.formulations.protocol import is_loop, task_of
from paretoik.front.front import Front
from paretoik.runs.executor import computed_text
from paretoik.task.motion import Motion


def describe_limits_between(front: Front, rows: Sequence[int] | None = None) -> str:
    """Return text on the worst violation of a limit between samples, with a remedy.

    The text is "" if no motion violates a limit, or if that is unknown.
    rows: points to check, by default all
    """
    motions, task = front.motions, task_of(front.problem)
    if task is None or not isinstance(motions, Motion) or is_loop(front):
        return ""
    message = task.describe_between(motions if rows is None else motions[np.asarray(rows, dtype=int)])
    return f"{message}, or refine" if message and front.certificates is None else message


SETTINGS = ("population", "generations", "seed", "points", "starts", "refine", "solver", "weights", "warm_start")
COUNTS = {  # counts of a run, in singular and plural
    "generations": ("generation", "generations"),
    "evaluations": ("evaluation", "evaluations"),
    "steps": ("step", "steps"),
    "levels": ("bound ε", "bounds ε"),  # not "levels": recordings also have one for each new point
    "starts": ("start", "starts"),
    "optima": ("optimum", "optima"),
}
ENDINGS = {  # meanings of statuses; others are shown unchanged
    "epsilon": "the sweep is complete",
    "optima": "all starts were tried",
    "refined": "all points were refined",
    "resolved": "all steps were taken",
    "maxima": "all directions were searched",
    "path": "the path is complete",
    "generations": "all generations were run",
    "evaluations": "the evaluation limit was reached",
    "time limit": "the time limit was reached",
    "stagnation": "the hypervolume almost stopped growing",
    "target": "a point reached the target",
    "end of the path": "the path was followed to its end",
}


def ending_words(status: str) -> str:
    """Return why a run ended.

    >>> ending_words("time limit"), ending_words("SIGINT")
    ('the time limit was reached', 'ended by SIGINT')
    """
    return ENDINGS.get(status, f"ended by {status}")


def run_text(provenance: Mapping[str, Any]) -> str:
    """Return text on a run's problem, settings and duration; "" without entries."""
    counts, status = provenance.get("counts") or {}, provenance.get("status")
    lines = [f"- problem: {provenance['problem']}"] if provenance.get("problem") else []
    lines += [f"- computed by {words}"] if (words := computed_text(provenance.get("computed"))) else []
    lines += [f"- ended: {ENDINGS.get(str(status), status)}"] if status else []
    settings = {name: value for name, value in (provenance.get("settings") or {}).items() if value is not None}
    if settings.get("refine") is False:  # then no solver was used
        settings.pop("solver", None)
    searched = "population" in settings  # points: the upper limit of an archive, but the goal of a sweep
    words_of = {
        "points": "points of the front, at most" if searched else "points of the front",
        "starts": "starts per redundant degree" if "optima" in counts else "starts",
        "warm_start": "warm start",
    }
    for name in (name for name in SETTINGS if name in settings):
        value = settings[name]
        lines.append(f"- {words_of.get(name, name)}: {('no', 'yes')[value] if isinstance(value, bool) else value}")
    took = [counted(counts[name], *words) for name, words in COUNTS.items() if isinstance(counts.get(name), int)]
    took += [f"{counts['seconds']:.4g} s"] if "seconds" in counts else []
    if counts.get("failed"):
        took.append(f"{counted(counts['failed'], 'evaluation')} failed, the first with: {counts['first_cause']}")
    lines += [f"- took {', '.join(took)}"] if took else []
    lines += [f"- {counted(counts[name], 'point')} {name}" for name in ("converged", "improved") if name in counts]
    return "## Run\n\n" + "\n".join(lines) if lines else ""


def counted(number: int, one: str, many: str = "") -> str:
    """Return a number with its noun."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def named_unit(name: str, unit: str) -> str:
    """Return the name of an objective, with [1] if its values have no unit."""
    return name if unit else f"{name} [1]"


def value_text(value: float, unit: str, *, digits: int = 4, sign: str = "-") -> str:
    """Return a value with its unit, in ``digits`` digits; if ``sign`` is "+", positive values have a sign too.

    >>> value_text(2.0, "J s", sign="+"), value_text(-0.5, "")
    ('+2 J s', '-0.5')
    """
    return f"{value:{sign}.{digits}g} {unit}".rstrip()
