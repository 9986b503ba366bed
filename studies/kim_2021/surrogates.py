"""Equation 5: ellipses fitted to directional maxima, and their errors at maxima left out of the fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.capability.directional import unit_directions
from paretoik.capability.speed_fit import FitErrors, ellipsoids_at, fit_axes, fit_ellipsoids, fit_errors
from paretoik.capability.speed_models import AxesEllipses, PolynomialEllipsoids
from paretoik.errors import ParetoikError
from studies.kim_2021.setting import MECHANISMS, POSITIONS, beside_paper, speeds
from studies.reporting import Row

TABLE = "Equation 5: ellipses beside directional maxima that they were not fitted to"
AS_PAPER = "(a, b, c), nine positions as in the paper"
WAYS = 32  # twice the paper's: a safe fit needs many


@dataclass(frozen=True, kw_only=True, eq=False)
class SampledMaxima:
    """Directional maxima (positions, directions) [m/s] of a mechanism over a grid of the nine positions' box."""

    positions: Float[np.ndarray, "positions 2"]
    directions: Float[np.ndarray, "directions 2"]
    values: Float[np.ndarray, "positions directions"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Surrogates:
    """A mechanism's models by name, and the maxima that judge them.

    ``seen`` is the grid that "ellipsoids" was fitted to.
    """

    mechanism: str
    models: dict[str, PolynomialEllipsoids | AxesEllipses]
    seen: SampledMaxima
    unseen: SampledMaxima


def sample_maxima(
    mechanism: str, positions: Float[np.ndarray, "positions 2"], *, turned: bool = False
) -> SampledMaxima:
    """Return maxima in 32 directions, or in those between them."""
    shift = np.pi / WAYS if turned else 0.0
    directions = unit_directions(WAYS, 2) @ np.array([[np.cos(shift), np.sin(shift)], [-np.sin(shift), np.cos(shift)]])
    values = np.stack([speeds(mechanism, position, directions) for position in positions])
    return SampledMaxima(positions=positions, directions=directions, values=values)


def grid(count: int, *, between: bool = False) -> Float[np.ndarray, "positions 2"]:
    """Return a square grid over the box of the nine positions, ``count`` per side, or the middles of its cells."""
    corners = np.array(list(POSITIONS.values()))
    sides = [np.linspace(low, high, count) for low, high in zip(corners.min(axis=0), corners.max(axis=0), strict=True)]
    if between:
        sides = [(side[1:] + side[:-1]) / 2 for side in sides]
    return np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)


def surrogates(mechanism: str, *, count: int) -> Surrogates:
    """Return all models: on a grid of count × count positions, and the paper's on its nine."""
    seen, nine = sample_maxima(mechanism, grid(count)), sample_maxima(mechanism, np.array(list(POSITIONS.values())))
    fitted, few = ((each.positions, each.directions, each.values) for each in (seen, nine))
    models: dict[str, PolynomialEllipsoids | AxesEllipses] = {
        "ellipsoids": fit_ellipsoids(*fitted),
        "ellipsoids, safe": fit_ellipsoids(*fitted, safe=True),
        "ellipsoids, degree 4": fit_ellipsoids(*fitted, degree=4),
        "ellipsoids, nine positions": fit_ellipsoids(*few),
        "(a, b, c), grid": fit_axes(*fitted),
        AS_PAPER: fit_axes(*few),
    }
    return Surrogates(
        mechanism=mechanism,
        models=models,
        seen=seen,
        unseen=sample_maxima(mechanism, grid(count, between=True), turned=True),
    )


def surrogate_rows(surrogates: Surrogates) -> list[Row]:
    """Return the held-out errors of every model, and those of a separate ellipse at every position."""
    rows = []
    unseen = surrogates.unseen.positions, surrogates.unseen.directions, surrogates.unseen.values
    for name, model in surrogates.models.items():
        try:
            errors = fit_errors(model, *unseen)
        except ParetoikError as fault:
            rows.append(beside_paper((TABLE, f"{surrogates.mechanism}: {name}", "rms"), "%", np.nan, str(fault)))
            continue
        x, y = 1e3 * errors.position
        note = (
            f"at ({x:.0f}, {y:.0f}) mm along {_degrees(errors):.0f}°; at most {100 * errors.underestimate:.1f} % below"
        )
        rows.append(beside_paper((TABLE, f"{surrogates.mechanism}: {name}", "rms"), "%", 100 * errors.rms))
        largest = (TABLE, f"{surrogates.mechanism}: {name}", "largest overestimate")
        rows.append(beside_paper(largest, "%", 100 * errors.overestimate, note))
    alone = _errors_at(surrogates.unseen)
    note = f"no model: what ellipses miss whatever their fit; largest overestimate {100 * alone.max():.1f} %"
    place = (TABLE, f"{surrogates.mechanism}: an ellipse fitted at each position", "rms")
    return [*rows, beside_paper(place, "%", 100 * float(np.sqrt(np.mean(alone**2))), note)]


def all_surrogates(*, count: int) -> dict[str, Surrogates]:
    """Return the models of both mechanisms."""
    return {mechanism: surrogates(mechanism, count=count) for mechanism in MECHANISMS}


def _errors_at(samples: SampledMaxima) -> Float[np.ndarray, "positions directions"]:
    """Return the relative errors of ellipses, each fitted to the maxima of one position."""
    matrices = ellipsoids_at(samples.directions, samples.values)
    slowness = np.sqrt(np.einsum("ki,nij,kj->nk", samples.directions, matrices, samples.directions))
    errors: np.ndarray = 1.0 / (slowness * samples.values) - 1.0
    return errors


def _degrees(errors: FitErrors) -> float:
    return float(np.rad2deg(np.arctan2(errors.direction[1], errors.direction[0])) % 360)
