"""Random fronts: few and many objectives, some maximised, with ties, duplicates and zero ranges; certificates."""

from __future__ import annotations

import numpy as np

from paretoik.front.certificates import Certificates
from paretoik.front.front import Front
from paretoik.front.hypervolume import non_dominated


def random_front(seed: int, *, n_obj: int | None = None, points: int | None = None) -> Front:
    """Return a front of at least one point; every second one has values on a coarse grid, with many ties."""
    rng = np.random.default_rng(seed)
    n_obj = int(rng.integers(1, 6)) if n_obj is None else n_obj
    points = int(rng.integers(1, 60)) if points is None else points
    values = rng.random((points, n_obj))
    if seed % 2:
        values = np.round(5 * values)
    if n_obj > 2 and rng.random() < 0.2:
        values[:, int(rng.integers(n_obj))] = 1.0
    values = values[non_dominated(values)]
    values = values[rng.integers(0, len(values), len(values) + 2)] if rng.random() < 0.5 else values  # duplicates
    maximised = rng.random(n_obj) < 0.3
    low, high = values.min(axis=0), values.max(axis=0)
    wider = rng.random() < 0.5  # the ranges of a run that had more points
    ranges = np.stack([low - 0.3 * wider * (high - low), high + 0.2 * wider * (high - low)], axis=1)
    flipped = np.where(maximised[:, None], -ranges[:, ::-1], ranges)
    return Front(
        ids=rng.permutation(10 * len(values))[: len(values)],
        objectives=np.where(maximised, -values, values),
        names=[f"f{axis}" for axis in range(n_obj)],
        units=["J", "", "m", "rad", "s"][:n_obj],
        maximised=maximised.tolist(),
        ranges=flipped,
    )


def minima(weights: np.ndarray, rates: np.ndarray, criticality: float | np.ndarray = 0.0) -> Certificates:
    """Return the certificates of minima with these weights (points, n_obj) and exchange rates."""
    zeros = np.zeros(len(weights))
    return Certificates(
        violation=zeros,
        violation_between=zeros,
        criticality=zeros + criticality,
        weights=weights,
        exchange_rates=rates,
        exchange_intervals=np.stack([rates, rates], axis=-1),
        status=np.full(len(weights), "minimum"),
    )
