"""Comparison of fronts with the same objectives: hypervolume, coverage, additive epsilon, attainment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from paretoik.arrays import Objectives, Values
from paretoik.errors import InvalidInput
from paretoik.front.certificates import concatenate
from paretoik.front.front import Front
from paretoik.front.indicators import estimate_hypervolume, non_dominated, ranges_of, widths_of
from paretoik.front.points import differences as differing_entries
from paretoik.inputs import likely_spelling, shown
from paretoik.tables import columns, html_table, html_text

# Merging fronts of one problem into one front.


Rows = Sequence[Int[np.ndarray, " _"]]
PARTS = ("genes", "motions", "violation", "certificates")


def merge(comparison: Comparison) -> Front:
    """Return one front of the points that no point of any front dominates.

    Among equal points only the first front's is kept. Ids count from 0, front by front; ``provenance["merged"]`` has
    the label and the folder of every front (``fronts``), and for every point its id, the place of its front, and its
    id there (``origins``). Genes, motions, violations and certificates are kept if all fronts with merged points have
    them in sizes that agree; ``left_out`` names the others.

    Raises InvalidInput if fronts are of different problems or of closed loops.
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
            raise InvalidInput(f"merge: fronts must not be of a closed loop, got its one motion in {other}")
        if front.provenance.get("fingerprint") != first.provenance.get("fingerprint"):
            raise InvalidInput(f"merge: fronts must be of one problem, got others in {label} and {other}")


def _joined(name: str, fronts: Sequence[Front], rows: Rows) -> Any:
    """Return a part of all fronts, front by front; None if it is missing or does not agree."""
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
    """Return motions of one arm as a batch; None if joints, sizes or kinds differ."""
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


# The comparison of fronts and its numbers.


Pairs = Float[np.ndarray, "fronts fronts"]
ATTAINABLE = (2, 3)  # numbers of objectives for which surfaces are computed


@dataclass(frozen=True, kw_only=True)
class ComparisonOptions:
    """Options of comparisons.

    reference: corner of hypervolumes in every share of the ranges; it is more than 1, so that the ends of fronts count
        and no front's own worst point sets the scale (Ishibuchi et al. 2018)
    """

    reference: float = 1.1


OPTIONS = ComparisonOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Fronts with the same objectives, measured alike; fronts with the same label are runs of one method.

    All objectives are minimised and given as shares of the ranges of the merged front, which has the points that no
    point of any front dominates: 0 is its best value, 1 its worst. Raises InvalidInput for fewer than two fronts, an
    empty one, labels that do not match, and names, units or senses other than those of the first.
    """

    fronts: tuple[Front, ...]
    labels: tuple[str, ...]

    def __post_init__(self) -> None:
        if len(self.fronts) < 2:
            raise InvalidInput(f"compare: there must be at least two fronts, got {len(self.fronts)}")
        if len(self.labels) != len(self.fronts):
            raise InvalidInput(f"labels must be one for each of {len(self.fronts)} fronts, got {len(self.labels)}")
        for front, label in zip(self.fronts, self.labels, strict=True):
            _check_alike(self.fronts[0], front, self.labels[0], label)

    @property
    def points(self) -> Int[np.ndarray, " fronts"]:
        """Number of points of each front."""
        return np.array([len(front) for front in self.fronts])

    @cached_property
    def merged_rows(self) -> tuple[Int[np.ndarray, " rows"], ...]:
        """Rows of each front that are on the merged front; equal points count only in the first front."""
        on_front = non_dominated(np.concatenate([front.minimised for front in self.fronts]))
        return tuple(np.flatnonzero(part) for part in np.split(on_front, np.cumsum(self.points)[:-1]))

    @cached_property
    def on_merged(self) -> Int[np.ndarray, " fronts"]:
        """Number of points of each front on the merged front; equal points count in each front."""
        merged = self._merged_values
        return np.array([_is_row_of(front.minimised, merged).sum() for front in self.fronts])

    @cached_property
    def ranges(self) -> Float[np.ndarray, "n_obj 2"]:
        """Best and worst value of each objective on the merged front, in the user's own sign."""
        low, high = self._merged_values.min(axis=0), self._merged_values.max(axis=0)
        return np.stack([low, high], axis=1) * np.where(self.fronts[0].maximised, -1.0, 1.0)[:, None]

    @cached_property
    def shares(self) -> tuple[Objectives, ...]:
        """Objectives of each front, minimised, as shares of the merged front's ranges."""
        merged = self._merged_values
        everything = np.concatenate([front.minimised for front in self.fronts])
        width = np.ptp(merged, axis=0)
        width = np.where(width > 0, width, np.ptp(everything, axis=0))  # if the merged front has no extent
        width = np.where(width > 0, width, 1.0)
        return tuple((front.minimised - merged.min(axis=0)) / width for front in self.fronts)

    @cached_property
    def hypervolume(self) -> Values:
        """Hypervolume of each front (fronts,) up to 1.1 in every share, divided by the merged front's.

        It is exact up to four objectives, an estimate for more; see ``estimate_hypervolume``.
        """
        reference = np.full(len(self.fronts[0].names), OPTIONS.reference)
        merged = np.concatenate([shares[rows] for shares, rows in zip(self.shares, self.merged_rows, strict=True)])
        volumes = [
            estimate_hypervolume(shares, reference, np.ones_like(reference)) for shares in (*self.shares, merged)
        ]
        return np.array(volumes[:-1]) / volumes[-1]

    @cached_property
    def coverage(self) -> Pairs:
        """C-metric [i, j]: share of the points of front j that some point of front i weakly dominates.

        Zitzler & Thiele (1999): C(i, j) and C(j, i) need not sum to 1.
        """
        return np.array([[_covered(one.minimised, other.minimised) for other in self.fronts] for one in self.fronts])

    @cached_property
    def epsilon(self) -> Pairs:
        """Additive epsilon [i, j]: least improvement of front i with which it weakly dominates front j.

        It is in shares of the ranges, and at most 0 if front i already does so. Zitzler et al. (2003).
        """
        import moocore

        return np.array(
            [[float(moocore.epsilon_additive(one, ref=other)) for other in self.shares] for one in self.shares]
        )

    @cached_property
    def differences(self) -> Mapping[str, tuple[str, ...]]:
        """Differences in how the fronts were made, by name, with one value per front."""
        return differing_entries([front.provenance for front in self.fronts])

    @cached_property
    def merged(self) -> Front:
        """Front of the points that no point of any front dominates, with ids of its own (see ``origins``).

        Raises InvalidInput if fronts are of different problems or of closed loops.
        """
        return merge(self)

    @property
    def origins(self) -> dict[int, tuple[int, int]]:
        """Source of every id of the merged front: the place of its front, from 0 on, and its id there."""
        return {number: (place, old) for number, place, old in self.merged.provenance["merged"]["origins"]}

    @property
    def groups(self) -> dict[str, list[int]]:
        """Places of the fronts with each label."""
        places: dict[str, list[int]] = {}
        for place, label in enumerate(self.labels):
            places.setdefault(label, []).append(place)
        return places

    def attainment(self, share: float = 0.5, label: str | None = None) -> Objectives:
        """Return points of the surface that at least ``share`` of the runs attain, in the user's own sign.

        Runs are the fronts with ``label``, or all. Share 1 gives the worst surface, 0.5 the median, and the smallest
        share above 0 the best: one run is enough (Fonseca et al. 2011). Raises InvalidInput unless there are two or
        three objectives, and for an unknown label or a share outside (0, 1].
        """
        import moocore

        n_obj = len(self.fronts[0].names)
        if n_obj not in ATTAINABLE:
            raise InvalidInput(f"attainment: objectives must be two or three, got {n_obj}")
        if not 0 < share <= 1:
            raise InvalidInput(f"attainment: share must be above 0 and at most 1, got {share}")
        values = [self.fronts[run].minimised for run in self._runs(label)]
        sets = np.repeat(np.arange(len(values)), [len(each) for each in values])
        surface = moocore.eaf(np.concatenate(values), sets, percentiles=[100.0 * share])[:, :n_obj]
        return surface * np.where(self.fronts[0].maximised, -1.0, 1.0)

    def surfaces(self, label: str | None = None) -> dict[str, Objectives]:
        """Return the ``attainment`` of one run ("best"), of half of them ("median") and of all ("worst")."""
        shares = {"best": 1 / len(self._runs(label)), "median": 0.5, "worst": 1.0}
        return {name: self.attainment(share, label) for name, share in shares.items()}

    def __str__(self) -> str:

        return comparison_text(self)

    def __repr__(self) -> str:
        """Return one line with the label and the hypervolume of each front."""
        volumes = ", ".join(
            f"{label} {volume:.4g}" for label, volume in zip(self.labels, self.hypervolume, strict=True)
        )
        return f"Comparison of {len(self.fronts)} fronts, hypervolume {volumes} of the merged front's"

    def _repr_html_(self) -> str:

        return comparison_html(self)

    def _runs(self, label: str | None) -> Sequence[int]:
        if label is not None and label not in self.labels:
            hint = likely_spelling(label, self.groups)
            raise InvalidInput(f"attainment: label must be one of {', '.join(self.groups)}, got {shown(label)}{hint}")
        return range(len(self.fronts)) if label is None else self.groups[label]

    @cached_property
    def _merged_values(self) -> Objectives:
        parts = [front.minimised[rows] for front, rows in zip(self.fronts, self.merged_rows, strict=True)]
        return np.concatenate(parts)


def _check_alike(first: Front, front: Front, first_label: str, label: str) -> None:
    if len(front) == 0:
        raise InvalidInput(f"compare: fronts must have at least one point, got none in {label}")
    for name in ("names", "units", "maximised"):
        expected, actual = getattr(first, name), getattr(front, name)
        if expected != actual:
            raise InvalidInput(
                f"compare: {name} of objectives must be the same in all fronts, got {_listed(expected)} in "
                f"{first_label} and {_listed(actual)} in {label}"
            )


def _listed(values: Sequence[object]) -> str:
    return ", ".join(str(value) or "none" for value in values)


def _is_row_of(values: Objectives, others: Float[np.ndarray, "others n_obj"]) -> Bool[np.ndarray, " points"]:
    rows = {row.tobytes() for row in others + 0.0}  # so that −0 is 0
    return np.array([row.tobytes() in rows for row in values + 0.0], dtype=bool)


def _covered(one: Float[np.ndarray, "points n_obj"], other: Float[np.ndarray, "others n_obj"]) -> float:
    """Return the share of the points of ``other`` that some point of ``one`` weakly dominates."""
    covered = [bool((one <= point).all(axis=1).any()) for point in other]
    return float(np.mean(covered))


# Text and tables of a comparison, for a terminal and for a notebook.


COVERAGE = "coverage: the share of a column's points that some point of the row weakly dominates"
EPSILON = "additive epsilon: by how much the row must improve to weakly dominate the column, in shares of the ranges"
DIFFERENT = "what differs in how they were made"


def comparison_text(comparison: Comparison) -> str:
    """Return the comparison as text: its normalisation, and aligned tables."""
    parts = [_normalisation(comparison)]
    for title, rows in _tables(comparison):
        parts.append("\n".join([title, columns(rows)] if title else [columns(rows)]))
    return "\n\n".join(parts)


def comparison_html(comparison: Comparison) -> str:
    """Return the comparison as HTML without scripts."""
    tables = "".join(html_table(rows, caption=title) for title, rows in _tables(comparison))
    return f"<div>{html_text(_normalisation(comparison))}{tables}</div>"


def comparison_entries(comparison: Comparison) -> dict[str, Any]:
    """Return the comparison as data that JSON can hold."""
    front = comparison.fronts[0]
    return {
        "objectives": [
            {"name": name, "unit": unit, "maximised": maximised, "best": best, "worst": worst}
            for name, unit, maximised, (best, worst) in zip(
                front.names, front.units, front.maximised, comparison.ranges, strict=True
            )
        ],
        "labels": comparison.labels,
        "points": comparison.points,
        "on_merged": comparison.on_merged,
        "hypervolume": comparison.hypervolume,
        "coverage": comparison.coverage,
        "epsilon": comparison.epsilon,
        "attainment": _attainment(comparison),
        "differences": comparison.differences,
    }


def _attainment(comparison: Comparison) -> dict[str, Any] | None:
    """Return the surfaces of all runs, and of each label with several; None for other numbers of objectives."""
    if len(comparison.fronts[0].names) not in ATTAINABLE:
        return None
    several = [label for label, places in comparison.groups.items() if len(places) > 1]
    return {"all": comparison.surfaces(), "labels": {label: comparison.surfaces(label) for label in several}}


def _normalisation(comparison: Comparison) -> str:
    front = comparison.fronts[0]
    ranges = ", ".join(
        f"{front.quantity(axis, best)} to {front.quantity(axis, worst).removeprefix(front.names[axis]).lstrip()}"
        for axis, (best, worst) in enumerate(comparison.ranges)
    )
    return (
        f"Shares are of the ranges of the merged front, best to worst: {ranges}.\n"
        "Hypervolume is that up to 1.1 of each range, over that of the merged front."
    )


def _tables(comparison: Comparison) -> list[tuple[str, list[list[str]]]]:
    """Return the tables with their titles: points and hypervolume, coverage, epsilon, settings that differ."""
    names = _distinct(comparison.labels)
    rows = [["front", "points", "on the merged front", "hypervolume"]]
    for name, points, shared, volume in zip(
        names, comparison.points, comparison.on_merged, comparison.hypervolume, strict=True
    ):
        rows.append([name, str(points), str(shared), f"{volume:.4f}"])
    merged = sum(len(part) for part in comparison.merged_rows)
    rows.append(["merged", str(merged), str(merged), "1.0000"])
    tables = [("", rows), (COVERAGE, _pairs(names, comparison.coverage)), (EPSILON, _pairs(names, comparison.epsilon))]
    runs = {label: places for label, places in comparison.groups.items() if len(places) > 1}
    if runs:
        tables.append(("runs with one label", _runs(comparison, runs)))
    if comparison.differences:
        tables.append((DIFFERENT, [["", *names], *([name, *each] for name, each in comparison.differences.items())]))
    return tables


def _runs(comparison: Comparison, runs: dict[str, list[int]]) -> list[list[str]]:
    rows = [["label", "runs", "hypervolume: median", "worst", "best"]]
    for label, places in runs.items():
        volumes = comparison.hypervolume[places]
        numbers = (np.median(volumes), volumes.min(), volumes.max())
        rows.append([label, str(len(places)), *(f"{number:.4f}" for number in numbers)])
    return rows


def _pairs(names: list[str], values: np.ndarray) -> list[list[str]]:
    rows = [["", *names]]
    for i, name in enumerate(names):
        rows.append([name, *("–" if i == j else f"{value:.4f}" for j, value in enumerate(values[i]))])
    return rows


def _distinct(labels: tuple[str, ...]) -> list[str]:
    """Return different labels: equal ones are numbered."""
    counted = [f"{label} {labels[: place + 1].count(label)}" for place, label in enumerate(labels)]
    return [number if labels.count(label) > 1 else label for number, label in zip(counted, labels, strict=True)]
