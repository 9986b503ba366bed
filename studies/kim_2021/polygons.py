"""Figures 5 and 6: the tool's speed in 16 directions at nine positions, by sliders and by joint motors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

import paretoik as pk
from studies.kim_2021.setting import DIRECTIONS, MECHANISMS, POSITIONS, UNPRINTED, actuation_of, beside_paper
from studies.reporting import Row

TABLE = "Figures 5 and 6"
EQUAL = 1e-9  # share of a speed: smaller gains do not count


@dataclass(frozen=True, kw_only=True, eq=False)
class Polygons:
    """The speeds of both mechanisms from one position."""

    name: str
    jam: pk.capability.PerformancePolygon
    dam: pk.capability.PerformancePolygon

    @property
    def gain(self) -> Float[np.ndarray, " directions"]:
        """The gain in speed of DAM in each direction, as a share of JAM."""
        shares: np.ndarray = self.dam.values / self.jam.values - 1.0
        return shares


def polygons(directions: int = DIRECTIONS) -> list[Polygons]:
    """Return both polygons at the nine positions."""
    arm = pk.arms.kim_3r()
    pairs = []
    for name, position in POSITIONS.items():
        jam, dam = (pk.directional_maxima(arm, actuation_of(each), position, directions) for each in MECHANISMS)
        pairs.append(Polygons(name=name, jam=jam, dam=dam))
    return pairs


def polygon_rows(pairs: list[Polygons]) -> list[Row]:
    """Return each position's gains and the directions in which DAM is faster, then those of all nine."""
    rows = []
    for one in pairs:
        x, y = 1e3 * one.jam.position
        rows += _gains(one.name, one.gain, f"({x:.0f}, {y:.0f}) mm; {_failing(one)}")
    whole = np.concatenate([one.gain for one in pairs])
    note = "; ".join(f"{one.name}: {np.count_nonzero(one.gain < -EQUAL)}" for one in pairs if np.any(one.gain < -EQUAL))
    return rows + _gains("all nine", whole, f"directions in which DAM is not faster: {note or 'none'}")


def _gains(name: str, gain: np.ndarray, note: str) -> list[Row]:
    better = int(np.count_nonzero(gain > EQUAL))
    gains = {"least": gain.min(), "mean": gain.mean(), "largest": gain.max()}
    rows = [beside_paper((TABLE, name, f"gain {what}"), "%", 100 * share, UNPRINTED) for what, share in gains.items()]
    prefix = "LOSS: " if name == "p6" and better < len(gain) else ""
    column = "directions in which DAM is faster"
    return [*rows, beside_paper((TABLE, name, column), f"of {len(gain)}", better, prefix + note)]


def _failing(one: Polygons) -> str:
    """Return the directions in which DAM is not faster, opposite ones once if both fail alike."""
    failing = np.flatnonzero(one.gain < -EQUAL)
    if not len(failing):
        return "DAM is faster in all"
    angles = np.rad2deg(np.arctan2(*one.jam.directions[failing].T[::-1])) % 360
    places = ", ".join(f"{angle:g}° {100 * one.gain[k]:+.1f} %" for angle, k in zip(angles, failing, strict=True))
    return f"DAM is slower at {places}"
