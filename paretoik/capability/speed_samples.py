"""Samples of directional maxima, checked, and how far a model is from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float

from paretoik.call_arguments import check_call
from paretoik.capability.polynomials import numerical_rank
from paretoik.capability.speed_models import SpeedModel, check_model, speeds_along
from paretoik.errors import InvalidInput
from paretoik.inputs import real_array
from paretoik.tables import field_representation, html_representation

Positions: TypeAlias = Float[np.ndarray, "samples task"]
Directions: TypeAlias = Float[np.ndarray, "directions task"]
Speeds: TypeAlias = Float[np.ndarray, "samples directions"]


class Samples(NamedTuple):
    """Speeds [m/s] at positions [m] along unit vectors."""

    positions: Positions
    directions: Directions
    speeds: Speeds


@check_call
@dataclass(frozen=True, kw_only=True, eq=False)
class FitErrors:
    """Errors of a model's speeds as shares of the true ones: 0.1 stands for 10 %.

    ``overestimate`` is the largest, met at ``position`` [m] along ``direction``, and below zero where the model is
    below everywhere; likewise ``underestimate``.
    """

    rms: float
    overestimate: float
    underestimate: float
    position: Float[np.ndarray, " task"]
    direction: Float[np.ndarray, " task"]

    __repr__ = field_representation
    _repr_html_ = html_representation


@check_call
def fit_errors(model: SpeedModel, positions: Positions, directions: Directions, speeds: Speeds) -> FitErrors:
    """Return how far a model is from directional maxima [m/s], best of positions that it was not fitted to.

    Raises InvalidInput where the arrays do not fit together, or hold speeds that are not positive.
    """
    check_model(model)
    positions, directions, speeds = checked_samples(positions, directions, speeds)
    if positions.shape[1] != len(model.lower):
        raise InvalidInput(f"positions: {len(model.lower)} coordinates wanted, got {positions.shape[1]}")
    errors = speeds_along(model.roots(positions)[0], directions) / speeds - 1.0
    sample, k = np.unravel_index(np.argmax(errors), errors.shape)
    return FitErrors(
        rms=float(np.sqrt(np.mean(errors**2))),
        overestimate=float(errors.max()),
        underestimate=float(-errors.min()),
        position=positions[sample],
        direction=directions[k],
    )


def checked_samples(positions: object, directions: object, speeds: object) -> Samples:
    """Return the arrays as numbers. Raises InvalidInput unless they are speeds at positions along unit vectors."""
    places, vectors = _matrix("positions", positions), _matrix("directions", directions)
    task = places.shape[1]
    if task not in (2, 3):
        raise InvalidInput(f"positions: two or three coordinates wanted, got {task}")
    if vectors.shape[1] != task:
        raise InvalidInput(f"directions: {task} coordinates wanted, as positions have, got {vectors.shape[1]}")
    lengths = np.linalg.norm(vectors, axis=1)
    if np.any(np.abs(lengths - 1.0) > 1e-6):  # more than rounding
        worst = int(np.argmax(np.abs(lengths - 1.0)))
        raise InvalidInput(f"directions: unit vectors wanted, got length {lengths[worst]:.6g} at direction {worst}")
    values = _matrix("speeds", speeds, finite=False)
    if values.shape != (len(places), len(vectors)):
        raise InvalidInput(f"speeds: shape {(len(places), len(vectors))} wanted, got {values.shape}")
    wrong = np.argwhere(~(np.isfinite(values) & (values > 0)))
    if len(wrong):
        sample, k = wrong[0]
        raise InvalidInput(
            f"speeds: positive numbers wanted, got {values[sample, k]} at position {sample}, direction {k}"
        )
    return Samples(places, vectors, values)


def check_determined(directions: Directions) -> None:
    """Raise InvalidInput unless the directions determine an ellipsoid."""
    rows, columns = np.triu_indices(directions.shape[1])
    rank = numerical_rank(directions[:, rows] * directions[:, columns])
    if rank < len(rows):
        raise InvalidInput(
            f"directions: at least {len(rows)} wanted that determine an ellipsoid, opposite ones counted once, got "
            f"{len(directions)} that determine {rank} of its {len(rows)} numbers"
        )


def _matrix(name: str, numbers: object, *, finite: bool = True) -> np.ndarray:
    matrix = real_array(name, numbers)
    if matrix.ndim != 2 or not matrix.size:
        raise InvalidInput(f"{name}: a table of rows and columns wanted, got shape {matrix.shape}")
    if finite and not np.all(np.isfinite(matrix)):
        row, column = np.argwhere(~np.isfinite(matrix))[0]
        raise InvalidInput(f"{name}: finite numbers wanted, got {matrix[row, column]} in row {row}, column {column}")
    return matrix
