"""Compare fronts, or the runs that found them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from paretoik.front.comparison import Comparison
from paretoik.front.front import Front
from paretoik.front.points import attach
from paretoik.inputs import file_path, read_list
from paretoik.runs.executor import computed_text


def compare(*fronts: Front | Path | str, labels: Sequence[str] | None = None) -> Comparison:
    """Compare fronts or run folders by hypervolume, coverage, additive epsilon and attainment.

    Parameters
    ----------
    fronts
        Two or more fronts, or folders of runs.
    labels
        One label per front: by default names of folders, or "front 1", "front 2", ... Equal labels: one method.

    Returns
    -------
    Comparison
        Measures of the fronts, printed as tables; ``.merged`` is one front of all points.

    Raises
    ------
    InvalidInput
        If fronts differ in objectives, units or senses, one is empty, or labels do not match.
    InvalidRun
        If a folder contains no run.

    >>> import numpy as np, paretoik as pk
    >>> a, b = (pk.Front(ids=np.arange(2), objectives=np.array(values), names=["energy", "torque"],
    ...                  units=["J", "N m"], maximised=[False, False])
    ...         for values in ([[1.0, 4.0], [3.0, 1.0]], [[1.0, 5.0], [2.0, 2.0]]))
    >>> print(repr(pk.compare(a, b)))
    Comparison of 2 fronts, hypervolume front 1 0.3865, front 2 0.8466 of the merged front's
    """
    named = None if labels is None else list(read_list("labels", labels, str, "a list of labels"))
    loaded = [front if isinstance(front, Front) else Front.load(file_path("fronts", front)) for front in fronts]
    for place, front in enumerate(loaded):  # tables have the entry "computed" in words
        if "computed" in front.provenance:
            words = {**front.provenance, "computed": computed_text(front.provenance["computed"])}
            loaded[place] = attach(replace(front, provenance=words), front.folder)
    if named is None:  # a front is labelled by its number, a folder by the shortest unique end of its path
        paths = [None if isinstance(front, Front) else Path(front).absolute() for front in fronts]
        named = [f"front {place}" if path is None else "" for place, path in enumerate(paths, 1)]
        taken = set(named)
        for place, path in enumerate(paths):
            if path is None:
                continue
            ends = [str(Path(*path.parts[-count:])) for count in range(1, len(path.parts))]
            others = [f"/{each}" for each in set(paths) - {path, None}]
            free = [end for end in ends if end not in taken and not any(each.endswith(f"/{end}") for each in others)]
            named[place] = next(iter(free), str(path))
    return Comparison(fronts=tuple(loaded), labels=tuple(named))
