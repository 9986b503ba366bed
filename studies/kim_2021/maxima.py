"""The paper's data, its directional maxima (Figures 5 and 6), and ellipses fitted to them (Equation 5)."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

import paretoik as pk
from paretoik.capability.directional import unit_directions
from paretoik.capability.speed_fit import ellipsoids_at, fit_axes, fit_ellipsoids, fit_errors
from paretoik.capability.speed_models import AxesEllipses, PolynomialEllipsoids
from paretoik.errors import ParetoikError
from studies.reporting import Row, paper_numbers

# The text names p4, p5 and p6; that the nine are a grid of x and y, row by row, is a reading of Figure 6.
POSITIONS = {
    f"p{1 + 3 * row + column}": np.array([x, y])
    for row, y in enumerate((-0.10, -0.15, -0.20))
    for column, x in enumerate((0.10, 0.15, 0.20))
}
DIRECTIONS = 16
MECHANISMS = ("JAM", "DAM")
paper = partial(paper_numbers, "kim_2021")
UNPRINTED = "depends on masses and the base's angle, which the paper does not print"
ENERGY_UNPRINTED = "the paper prints no masses, no postures on the way, and no formula of its energy"


def actuation_of(mechanism: str) -> pk.capability.JointActuation | pk.capability.DistributedActuation:
    """Return motors at the joints ("JAM") or sliders along the links ("DAM"), as the library has them by default."""
    return pk.capability.kim_joint_motors() if mechanism == "JAM" else pk.capability.kim_sliders()


def speeds(mechanism: str, position: Float[np.ndarray, " 2"], directions: object = DIRECTIONS) -> np.ndarray:
    """Return the directional maxima [m/s] of the arm as the library has it by default, 0.5 kg a link."""
    return pk.directional_maxima(pk.arms.kim_3r(), actuation_of(mechanism), position, directions).values


def beside_paper(place: tuple[str, str, str], unit: str, ours: float, note: str = "") -> Row:
    """Return a row at its place (table, row, column), with the paper's number if it prints one."""
    table, row, column = place
    return Row(table, row, column, unit, float(ours), reference=paper().get(place), note=note)


FIGURES = "Figures 5 and 6"
FITTED = "Equation 5: ellipses beside directional maxima that they were not fitted to"
AS_PAPER = "(a, b, c), nine positions as in the paper"
WAYS = 32  # twice the paper's: a safe fit needs many
EQUAL = 1e-9  # share of a speed: smaller gains do not count


class Polygons(NamedTuple):
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
    return [
        Polygons(
            name, *(pk.directional_maxima(pk.arms.kim_3r(), actuation_of(each), at, directions) for each in MECHANISMS)
        )
        for name, at in POSITIONS.items()
    ]


def polygon_rows(pairs: list[Polygons]) -> list[Row]:
    """Return each position's gains and the directions in which DAM is faster, then those of all nine."""

    def gains(name: str, gain: np.ndarray, note: str) -> list[Row]:
        better = int(np.count_nonzero(gain > EQUAL))
        parts = {"least": gain.min(), "mean": gain.mean(), "largest": gain.max()}
        rows = [beside_paper((FIGURES, name, f"gain {what}"), "%", 100 * one, UNPRINTED) for what, one in parts.items()]
        prefix = "LOSS: " if name == "p6" and better < len(gain) else ""
        place = (FIGURES, name, "directions in which DAM is faster")
        return [*rows, beside_paper(place, f"of {len(gain)}", better, prefix + note)]

    rows = []
    for one in pairs:
        (x, y), failing = 1e3 * one.jam.position, np.flatnonzero(one.gain < -EQUAL)
        angles = np.rad2deg(np.arctan2(*one.jam.directions[failing].T[::-1])) % 360
        slower = [f"{angle:g}° {100 * one.gain[k]:+.1f} %" for angle, k in zip(angles, failing, strict=True)]
        words = f"DAM is slower at {', '.join(slower)}" if slower else "DAM is faster in all"
        rows += gains(one.name, one.gain, f"({x:.0f}, {y:.0f}) mm; {words}")
    whole = np.concatenate([one.gain for one in pairs])
    note = "; ".join(f"{one.name}: {np.count_nonzero(one.gain < -EQUAL)}" for one in pairs if np.any(one.gain < -EQUAL))
    return rows + gains("all nine", whole, f"directions in which DAM is not faster: {note or 'none'}")


# Directional maxima of a mechanism: positions (n, 2), directions (m, 2) and values (n, m) [m/s].
Maxima = tuple[np.ndarray, np.ndarray, np.ndarray]


class Surrogates(NamedTuple):
    """A mechanism's models by name, and the maxima that judge them."""

    mechanism: str
    models: dict[str, PolynomialEllipsoids | AxesEllipses]
    unseen: Maxima


def sample_maxima(mechanism: str, positions: Float[np.ndarray, "positions 2"], *, turned: bool = False) -> Maxima:
    """Return maxima in 32 directions, or in those between them."""
    shift = np.pi / WAYS if turned else 0.0
    directions = unit_directions(WAYS, 2) @ np.array([[np.cos(shift), np.sin(shift)], [-np.sin(shift), np.cos(shift)]])
    return positions, directions, np.stack([speeds(mechanism, position, directions) for position in positions])


def grid(count: int, *, between: bool = False) -> Float[np.ndarray, "positions 2"]:
    """Return a square grid over the box of the nine positions, ``count`` per side, or the middles of its cells."""
    corners = np.array(list(POSITIONS.values()))
    sides = [np.linspace(low, high, count) for low, high in zip(corners.min(axis=0), corners.max(axis=0), strict=True)]
    if between:
        sides = [(side[1:] + side[:-1]) / 2 for side in sides]
    return np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)


def all_surrogates(*, count: int) -> dict[str, Surrogates]:
    """Return the models of both mechanisms: on a grid of count × count positions, and the paper's on its nine."""
    surrogates = {}
    for mechanism in MECHANISMS:
        seen, nine = sample_maxima(mechanism, grid(count)), sample_maxima(mechanism, np.array(list(POSITIONS.values())))
        models: dict[str, PolynomialEllipsoids | AxesEllipses] = {
            "ellipsoids": fit_ellipsoids(*seen),
            "ellipsoids, safe": fit_ellipsoids(*seen, safe=True),
            AS_PAPER: fit_axes(*nine),
        }
        unseen = sample_maxima(mechanism, grid(count, between=True), turned=True)
        surrogates[mechanism] = Surrogates(mechanism=mechanism, models=models, unseen=unseen)
    return surrogates


def surrogate_rows(surrogates: Surrogates) -> list[Row]:
    """Return the held-out errors of every model, and those of a separate ellipse at every position."""
    rows, mechanism = [], surrogates.mechanism
    for name, model in surrogates.models.items():
        row = f"{mechanism}: {name}"
        try:
            errors = fit_errors(model, *surrogates.unseen)
        except ParetoikError as fault:
            rows.append(beside_paper((FITTED, row, "rms"), "%", np.nan, str(fault)))
            continue
        (x, y), (across, up) = 1e3 * errors.position, errors.direction
        note = f"at ({x:.0f}, {y:.0f}) mm along {np.rad2deg(np.arctan2(up, across)) % 360:.0f}°"
        note += f"; at most {100 * errors.underestimate:.1f} % below"
        rows.append(beside_paper((FITTED, row, "rms"), "%", 100 * errors.rms))
        rows.append(beside_paper((FITTED, row, "largest overestimate"), "%", 100 * errors.overestimate, note))
    _, directions, values = surrogates.unseen
    slowness = np.sqrt(np.einsum("ki,nij,kj->nk", directions, ellipsoids_at(directions, values), directions))
    alone = 1.0 / (slowness * values) - 1.0
    note = f"no model: what ellipses miss whatever their fit; largest overestimate {100 * alone.max():.1f} %"
    place = (FITTED, f"{mechanism}: an ellipse fitted at each position", "rms")
    return [*rows, beside_paper(place, "%", 100 * float(np.sqrt(np.mean(alone**2))), note)]
