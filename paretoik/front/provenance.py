"""What is known of how fronts were made, as names and values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

NAVIGATIONS, LARGEST_ID = "navigations", "largest_id"  # entries: moves that were made; the largest id of the whole
COMPARED = ("problem", "fingerprint", "settings", "versions", "computed", "status")  # counts and seconds always differ


ADDED_SAMPLES = "samples"  # entry: samples of the user's path, and of the motions if refinement added some
SOLVERS = "solvers"  # entry: who refined points, and how many of them a convex program confirmed
REFINED_BY = {"interior-point": "the interior-point method", "sqp": "SQP (cvxpy, Clarabel)"}


def confirmation(solver: str, confirmed: int, points: int) -> dict[str, dict[str, Any]]:
    """Return the entry of who refined points, and how many of all are confirmed to be critical."""
    by = {"refinement": solver, "criticality": "cvxpy, Clarabel"}
    return {SOLVERS: {**by, "confirmed": confirmed, "points": points}}


def confirmation_text(provenance: Mapping[str, Any]) -> str:
    """Return who refined and who confirmed points, and if samples were added, a line each; "" if nothing is known."""
    lines = list[str]()
    match provenance.get(SOLVERS):
        case {"refinement": solver, "confirmed": int(confirmed), "points": int(points)}:
            confirmed_by = "a convex subproblem, stated in cvxpy and solved by Clarabel"
            by = REFINED_BY.get(solver, solver)
            lines.append(f"refined by {by}; {confirmed} of {points} points confirmed as critical by {confirmed_by}")
    match provenance.get(ADDED_SAMPLES):
        case {"path": int(given), "used": int(used)}:
            lines.append(f"on {used} samples: the path's {given} left values more than 0.1 % off those of the curves")
    return "\n".join(lines)


def flatten(entries: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    """Return nested entries as text by name.

    >>> flatten({"settings": {"seed": 1, "refine": None}})
    {'settings.seed': '1', 'settings.refine': '–'}
    """
    flat: dict[str, str] = {}
    for name, value in entries.items():
        if isinstance(value, Mapping):
            flat |= flatten(value, f"{prefix}{name}.")
        else:
            flat[f"{prefix}{name}"] = "–" if value is None or value == "" else str(value)
    return flat


def differences(provenances: Sequence[Mapping[str, Any]]) -> dict[str, tuple[str, ...]]:
    """Return the entries that are not the same of all, by name: the value of each, "–" where it has none.

    Problems, settings, versions, who computed a run and what ended it are looked at.
    """
    flat = [flatten({name: each[name] for name in COMPARED if name in each}) for each in provenances]
    names = dict.fromkeys(name for each in flat for name in each)
    values = {name: tuple(each.get(name, "–") for each in flat) for name in names}
    return {name: each for name, each in values.items() if len(set(each)) > 1}
