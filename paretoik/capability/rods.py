"""Rods between two sliders: what geometry they may have, and which angles they reach. See ``actuation``."""

from __future__ import annotations

import numpy as np

from paretoik.arrays import read_only
from paretoik.errors import InvalidInput
from paretoik.inputs import finite_array


def angle_range(rod: float, front: np.ndarray, back: np.ndarray, least_angle: float) -> tuple[float, float]:
    """Return the least and largest θ that sliders within bounds give, toggles left out; raise InvalidInput for none.

    cos θ = (c² − s² − s_b²) / (2 s s_b) rises along each slider until its square is that of the other less c², and
    falls from there: it is least at a corner, and most at a corner or such a place.
    """
    places = [(s, b) for s in front for b in back]
    for fixed, (low, high), turned in ((front, back, False), (back, front, True)):
        tops = [np.clip(np.sqrt(max(one * one - rod * rod, 0.0)), low, high) for one in fixed]
        places += [(b, s) if turned else (s, b) for s, b in zip(fixed, tops, strict=True)]
    cosines = [(rod * rod - s * s - b * b) / (2 * s * b) for s, b in places]
    ends = np.arccos(np.clip([max(cosines), min(cosines)], -1.0, 1.0))
    fits = min(cosines) <= 1.0 and max(cosines) >= -1.0
    low, high = max(float(ends[0]), least_angle), min(float(ends[1]), np.pi - least_angle)
    if not fits or low > high:
        raise InvalidInput(
            f"distributed actuation: sliders that reach a rod's angle away from its toggles wanted, got front "
            f"{front.tolist()} m and back {back.tolist()} m with a rod of {rod:g} m"
        )
    return low, high


def broadcast(name: str, value: object, shape: tuple[int, ...]) -> np.ndarray:
    """Return numbers broadcast to a shape, not to be written; raise InvalidInput, naming them, where they cannot be."""
    numbers = finite_array(f"distributed actuation: {name}", value)
    try:
        array = np.broadcast_to(numbers, shape).copy()
    except ValueError:
        raise InvalidInput(f"distributed actuation: {name} wants shape {shape}, got {numbers.shape}") from None
    return read_only(array)


LONGEST = np.sqrt(np.finfo(float).max) / 4  # m: squares of lengths are numbers still


def check_geometry(
    *,
    rod: np.ndarray,
    zero: np.ndarray,
    bend: np.ndarray,
    least_angle: np.ndarray,
    front_bounds: np.ndarray,
    back_bounds: np.ndarray,
) -> None:
    """Raise InvalidInput, naming the joint (dof,), for lengths, bounds (dof, 2) and angles that cannot be."""

    def refuse(wrong: np.ndarray, wish: str, fact: np.ndarray) -> None:
        if wrong.any():
            j = int(np.argmax(wrong))
            raise InvalidInput(f"distributed actuation, joint {j + 1}: {wish}, got {fact[j].tolist()}")

    refuse((rod <= 0) | (rod > LONGEST), f"a rod longer than 0 and of at most {LONGEST:g} m wanted", rod)
    refuse(~np.isin(bend, (-1.0, 1.0)), "bend 1 or −1 wanted", bend)
    refuse((least_angle <= 0) | (least_angle >= np.pi), "a least angle between 0 and π wanted", least_angle)
    for name, pairs in (("front", front_bounds), ("back", back_bounds)):
        wrong = (pairs[:, 0] <= 0) | (pairs[:, 0] > pairs[:, 1]) | (pairs[:, 1] > LONGEST)
        refuse(wrong, f"{name} bounds 0 < lower ≤ upper wanted", pairs)
    refuse(front_bounds[:, 1] > rod, "front sliders no farther than the rod is long wanted", front_bounds)
