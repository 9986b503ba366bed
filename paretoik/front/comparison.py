"""Comparison of fronts with the same objectives: hypervolume, coverage, additive epsilon, attainment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Objectives, Values
from paretoik.errors import InvalidInput
from paretoik.front.certificates import concatenate
from paretoik.front.front import Front
from paretoik.front.hypervolume import estimate_hypervolume, non_dominated, ranges_of
from paretoik.front.points import PARTS, widths_of
from paretoik.inputs import likely_spelling, shown
from paretoik.tables import columns, html_table, html_text


def _joined(name: str, fronts: Sequence[Front], rows: Sequence[Int[np.ndarray, " _"]]) -> Any:
    """Return one part of all fronts, concatenated; None if a front has none or the parts are inconsistent."""
    parts = [getattr(front, name) for front in fronts]
    if any(part is None for part in parts):
        return None
    picked = [part[each] for part, each in zip(parts, rows, strict=True)]
    if name == "certificates":
        merged = ranges_of(np.concatenate([front.minimised[each] for front, each in zip(fronts, rows, strict=True)]))
        return concatenate([part.rescale(widths_of(front), merged) for front, part in zip(fronts, picked, strict=True)])
    if name != "motions":
        return np.concatenate(picked) if len({each.shape[1:] for each in picked}) == 1 else None
    # Motions agree if their types, joints and numbers of samples agree, and none has its own derivatives.
    kinds = {(type(each), tuple(each.arm.joint_names), each.q.shape[1:]) for each in picked}
    if len(kinds) > 1 or any(getattr(each, "derivatives", None) is not None for each in picked):
        return None
    q, time = (np.concatenate([getattr(each, field) for each in picked]) for field in ("q", "time"))
    return replace(picked[0], q=q, time=time)


# The comparison of fronts and its numbers.


# entries whose differences are reported; counts and seconds always differ
COMPARED = ("problem", "fingerprint", "settings", "versions", "computed", "status")
KEPT = ("problem", "solved", "fingerprint", "versions")  # entries that the merged front takes from the first front
Pairs = Float[np.ndarray, "fronts fronts"]
ATTAINABLE = (2, 3)  # numbers of objectives for which surfaces are computed


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


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """Comparison of fronts with the same objectives; fronts with the same label are runs of one method.

    The merged front has the points that no point of any front dominates. All objectives are minimised and given as
    shares of its ranges: 0 is its best value, 1 its worst. Raises InvalidInput for fewer than two fronts, an empty one,
    a wrong number of labels, and objectives with other names, units or directions than those of the first front.
    """

    fronts: tuple[Front, ...]
    labels: tuple[str, ...]

    def __post_init__(self) -> None:
        if len(self.fronts) < 2:
            raise InvalidInput(f"compare: there must be at least two fronts, got {len(self.fronts)}")
        if len(self.labels) != len(self.fronts):
            raise InvalidInput(f"labels must be one for each of {len(self.fronts)} fronts, got {len(self.labels)}")
        first, first_label = self.fronts[0], self.labels[0]
        for front, label in zip(self.fronts, self.labels, strict=True):
            if len(front) == 0:
                raise InvalidInput(f"compare: fronts must have at least one point, got none in {label}")
            for name in ("names", "units", "maximised"):
                expected, actual = (", ".join(str(each) or "none" for each in getattr(f, name)) for f in (first, front))
                if getattr(first, name) != getattr(front, name):
                    raise InvalidInput(
                        f"compare: {name} must be the same in all fronts, got {expected} in "
                        f"{first_label} and {actual} in {label}"
                    )

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
        merged = {row.tobytes() for row in self._merged_values + 0.0}  # so that −0 is 0
        return np.array([sum(row.tobytes() in merged for row in front.minimised + 0.0) for front in self.fronts])

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
        """Hypervolume of each front (fronts,), divided by that of the merged front.

        The reference point is 1.1 in every share. Values are exact up to four objectives, estimates for more; see
        ``estimate_hypervolume``.
        """
        # The reference point is more than 1 in every share, so that the ends of fronts count and no front's own worst
        # point sets the scale (Ishibuchi et al. 2018).
        reference = np.full(len(self.fronts[0].names), 1.1)
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
        values = [front.minimised for front in self.fronts]
        return np.array([[np.mean([(i <= point).all(axis=1).any() for point in j]) for j in values] for i in values])

    @cached_property
    def epsilon(self) -> Pairs:
        """Additive epsilon [i, j]: least amount by which front i must improve to weakly dominate front j.

        It is in shares of the ranges, and at most 0 if front i already weakly dominates front j. Zitzler et al. (2003).
        """
        import moocore

        return np.array(
            [[float(moocore.epsilon_additive(one, ref=other)) for other in self.shares] for one in self.shares]
        )

    @cached_property
    def differences(self) -> Mapping[str, tuple[str, ...]]:
        """Provenance entries that differ, by name, with one value per front.

        A missing value is "–". Only the entries in ``COMPARED`` count, such as problem, settings, versions and status.
        """
        known = [
            {name: front.provenance[name] for name in COMPARED if name in front.provenance} for front in self.fronts
        ]
        flat = [flatten(entries) for entries in known]
        values = {name: tuple(each.get(name, "–") for each in flat) for entries in flat for name in entries}
        return {name: each for name, each in values.items() if len(set(each)) > 1}

    @cached_property
    def merged(self) -> Front:
        """Front of the points that no point of any front dominates.

        Among equal points only the first front's is kept. Ids count from 0, front by front; ``provenance["merged"]``
        has the label and the folder of every front (``fronts``), and for every point its id, the index of its front,
        and its id in that front (``origins``). Genes, motions, violations and certificates are kept if all fronts with
        merged points have them in consistent sizes; ``left_out`` names the others.

        Raises InvalidInput if the fronts are of different problems or of a closed loop.
        """
        for front, label in zip(self.fronts, self.labels, strict=True):
            if front.provenance.get("timeline") == "step":
                raise InvalidInput(f"merge: fronts must not be of a closed loop, got one in {label}")
            if front.provenance.get("fingerprint") != self.fronts[0].provenance.get("fingerprint"):
                raise InvalidInput(f"merge: fronts must be of one problem, got two: {self.labels[0]}, {label}")
        merged = [each for each in zip(self.fronts, self.merged_rows, strict=True) if len(each[1])]
        fronts, rows = [front for front, _ in merged], [part for _, part in merged]
        points = [
            [place, int(number)]
            for place, (front, part) in enumerate(zip(self.fronts, self.merged_rows, strict=True))
            for number in front.ids[part]
        ]
        parts = {name: _joined(name, fronts, rows) for name in PARTS}
        first = fronts[0]
        provenance = {name: first.provenance[name] for name in KEPT if name in first.provenance} | {
            "status": "merged",
            "merged": {
                "fronts": [
                    {"label": label, "folder": None if front.folder is None else str(front.folder.absolute())}
                    for front, label in zip(self.fronts, self.labels, strict=True)
                ],
                "origins": [[number, *origin] for number, origin in enumerate(points)],
                "left_out": [
                    name
                    for name, part in parts.items()
                    if part is None and any(getattr(front, name) is not None for front in fronts)
                ],
            },
        }
        return Front(
            ids=np.arange(len(points)),
            objectives=np.concatenate([front.objectives[part] for front, part in merged]),
            names=first.names,
            units=first.units,
            maximised=first.maximised,
            provenance=provenance,
            problem=next((front.problem for front in fronts if front.problem is not None), None),
            **parts,
        )

    @property
    def origins(self) -> dict[int, tuple[int, int]]:
        """For each merged id, the index of its front, from 0, and its id there."""
        return {number: (place, old) for number, place, old in self.merged.provenance["merged"]["origins"]}

    @property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the fronts with each label."""
        places: dict[str, list[int]] = {}
        for place, label in enumerate(self.labels):
            places.setdefault(label, []).append(place)
        return places

    @property
    def runs(self) -> dict[str, list[int]]:
        """Indices of the fronts with each label that several fronts have."""
        return {label: places for label, places in self.groups.items() if len(places) > 1}

    def attainment(self, share: float = 0.5, label: str | None = None) -> Objectives:
        """Return points of the surface that at least ``share`` of the runs attain, in the user's own sign.

        Runs are the fronts with ``label``, or all. Share 1 gives the worst surface, 0.5 the median, and the smallest
        share above 0 the best: one run is enough (Fonseca et al. 2011). Raises InvalidInput unless there are two or
        three objectives, and for an unknown label or a share outside (0, 1].
        """
        import moocore

        n_obj = len(self.fronts[0].names)
        if n_obj not in ATTAINABLE:
            raise InvalidInput(f"attainment: there must be two or three objectives, got {n_obj}")
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
        """Return the normalisation and aligned tables, for a terminal."""
        tables = [(f"{title}\n" if title else "") + columns(rows) for title, rows in _tables(self)]
        return "\n\n".join([_normalisation(self), *tables])

    def __repr__(self) -> str:
        """Return one line with the label and the hypervolume of each front."""
        volumes = ", ".join(
            f"{label} {volume:.4g}" for label, volume in zip(self.labels, self.hypervolume, strict=True)
        )
        return f"Comparison of {len(self.fronts)} fronts, hypervolume {volumes} of the merged front's"

    def _repr_html_(self) -> str:
        """Return the normalisation and the tables as HTML without scripts, for a notebook."""
        tables = "".join(html_table(rows, caption=title) for title, rows in _tables(self))
        return f"<div>{html_text(_normalisation(self))}{tables}</div>"

    def _runs(self, label: str | None) -> Sequence[int]:
        if label is not None and label not in self.labels:
            hint = likely_spelling(label, self.groups)
            raise InvalidInput(f"attainment: label must be one of {', '.join(self.groups)}, got {shown(label)}{hint}")
        return range(len(self.fronts)) if label is None else self.groups[label]

    @cached_property
    def _merged_values(self) -> Objectives:
        parts = [front.minimised[rows] for front, rows in zip(self.fronts, self.merged_rows, strict=True)]
        return np.concatenate(parts)


# Text and tables of a comparison, for a terminal and for a notebook.


COVERAGE = "coverage: the share of a column's points that some point of the row weakly dominates"
EPSILON = "additive epsilon: by how much the row must improve to weakly dominate the column, in shares of the ranges"
DIFFERENT = "settings that differ"


def comparison_entries(comparison: Comparison) -> dict[str, Any]:
    """Return the comparison as data that can be written as JSON."""
    front, attainment = comparison.fronts[0], None
    if len(front.names) in ATTAINABLE:  # surfaces of all runs, and of each label with several runs
        labels = {label: comparison.surfaces(label) for label in comparison.runs}
        attainment = {"all": comparison.surfaces(), "labels": labels}
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
        "attainment": attainment,
        "differences": comparison.differences,
    }


def _normalisation(comparison: Comparison) -> str:
    front = comparison.fronts[0]
    ranges = ", ".join(
        f"{front.quantity(axis, best)} to {front.quantity(axis, worst).removeprefix(front.names[axis]).lstrip()}"
        for axis, (best, worst) in enumerate(comparison.ranges)
    )
    return (
        f"Shares are of the ranges of the merged front, best to worst: {ranges}.\n"
        "Hypervolumes have their reference point at 1.1 of each range, and are divided by the merged front's."
    )


def _tables(comparison: Comparison) -> list[tuple[str, list[list[str]]]]:
    """Return the tables with their titles: points and hypervolume, coverage, epsilon, settings that differ."""
    labels = comparison.labels
    counted = [f"{label} {labels[: place + 1].count(label)}" for place, label in enumerate(labels)]
    names = [number if labels.count(label) > 1 else label for number, label in zip(counted, labels, strict=True)]
    rows = [["front", "points", "on the merged front", "hypervolume"]]
    for name, points, shared, volume in zip(
        names, comparison.points, comparison.on_merged, comparison.hypervolume, strict=True
    ):
        rows.append([name, str(points), str(shared), f"{volume:.4f}"])
    merged = str(sum(len(part) for part in comparison.merged_rows))
    tables = [("", [*rows, ["merged", merged, merged, "1.0000"]])]
    for title, values in ((COVERAGE, comparison.coverage), (EPSILON, comparison.epsilon)):
        rows = [["", *names]]
        for i, name in enumerate(names):
            rows.append([name, *("–" if i == j else f"{value:.4f}" for j, value in enumerate(values[i]))])
        tables.append((title, rows))
    if comparison.runs:
        rows = [["label", "runs", "hypervolume: median", "worst", "best"]]
        for label, places in comparison.runs.items():
            volumes = comparison.hypervolume[places]
            numbers = (np.median(volumes), volumes.min(), volumes.max())
            rows.append([label, str(len(places)), *(f"{number:.4f}" for number in numbers)])
        tables.append(("runs per label", rows))
    if comparison.differences:
        tables.append((DIFFERENT, [["", *names], *([name, *each] for name, each in comparison.differences.items())]))
    return tables
