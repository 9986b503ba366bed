"""Several fronts of one problem as one front, and where each of its points comes from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Int

from paretoik.errors import InvalidInput
from paretoik.front.certificates import concatenate
from paretoik.front.front import Front
from paretoik.front.indicators import ranges_of, widths_of

if TYPE_CHECKING:  # a comparison merges its fronts with this
    from paretoik.front.comparison import Comparison

Rows = Sequence[Int[np.ndarray, " _"]]
PARTS = ("genes", "motions", "violation", "certificates")


def merge(comparison: Comparison) -> Front:
    """Return what no point of any front dominates as one front; of equal points the first front's.

    Ids count from 0, front by front; ``provenance["merged"]`` holds the label and the folder of every front
    (``fronts``), and of every point its id, the place of its front there, and its id in it (``origins``). Genes,
    motions, violations and certificates stay where every front that has points there has them and they agree in size;
    which do not is told under ``left_out``.

    Raises InvalidInput where fronts are of different problems, or of closed loops.
    """
    _check_one_problem(comparison)
    of_each = zip(range(len(comparison.fronts)), comparison.fronts, comparison.merged_rows, strict=True)
    places, fronts, rows = zip(*(each for each in of_each if len(each[2])), strict=True)
    parts = {name: _joined(name, fronts, rows) for name in PARTS}
    ids = np.arange(sum(len(part) for part in rows))
    old = [
        [place, int(number)]
        for place, front, part in zip(places, fronts, rows, strict=True)
        for number in front.ids[part]
    ]
    left_out = [
        name for name in PARTS if parts[name] is None and any(getattr(front, name) is not None for front in fronts)
    ]
    first = fronts[0]
    provenance = {
        name: first.provenance[name] for name in ("problem", "fingerprint", "versions") if name in first.provenance
    }
    sources = [
        {"label": label, "folder": None if front.folder is None else str(front.folder.absolute())}
        for front, label in zip(comparison.fronts, comparison.labels, strict=True)
    ]
    merged = {"fronts": sources, "origins": [[i, *origin] for i, origin in enumerate(old)]}
    return Front(
        ids=ids,
        objectives=np.concatenate([front.objectives[part] for front, part in zip(fronts, rows, strict=True)]),
        names=first.names,
        units=first.units,
        maximised=first.maximised,
        provenance={**provenance, "status": "merged", "merged": {**merged, "left_out": left_out}},
        problem=next((front.problem for front in fronts if front.problem is not None), None),
        **parts,
    )


def _check_one_problem(comparison: Comparison) -> None:
    first, label = comparison.fronts[0], comparison.labels[0]
    for front, other in zip(comparison.fronts, comparison.labels, strict=True):
        if front.provenance.get("timeline") == "step":
            raise InvalidInput(f"merge: wanted fronts, got the one motion of a closed loop in {other}")
        if front.provenance.get("fingerprint") != first.provenance.get("fingerprint"):
            raise InvalidInput(f"merge: wanted fronts of one problem, got others in {label} and {other}")


def _joined(name: str, fronts: Sequence[Front], rows: Rows) -> Any:
    """Return a part of all fronts, its rows one after the other; None where it is missing or does not agree."""
    parts = [getattr(front, name) for front in fronts]
    if any(part is None for part in parts):
        return None
    picked = [part[each] for part, each in zip(parts, rows, strict=True)]
    if name == "motions":
        return _joined_motions(picked)
    if name == "certificates":
        merged = ranges_of(np.concatenate([front.minimised[each] for front, each in zip(fronts, rows, strict=True)]))
        return concatenate([part.rescale(widths_of(front), merged) for front, part in zip(fronts, picked, strict=True)])
    agree = len({each.shape[1:] for each in picked}) == 1
    return np.concatenate(picked) if agree else None


def _joined_motions(motions: Sequence[Any]) -> Any:
    """Return motions of one arm as a batch; None where joints, sizes or kinds differ."""
    first = motions[0]
    alike = all(
        type(each) is type(first)
        and each.arm.joint_names == first.arm.joint_names
        and each.q.shape[1:] == first.q.shape[1:]
        and getattr(each, "derivatives", None) is None
        for each in motions
    )
    if not alike:
        return None
    return replace(
        first, q=np.concatenate([each.q for each in motions]), time=np.concatenate([each.time for each in motions])
    )
