"""A speed model along paths: its roots, checked; the times of a path's pieces; whether points are in its box."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from paretoik.capability.speed_models import SpeedModel, check_model
from paretoik.errors import InvalidInput
from paretoik.inputs import ArrayLike, finite_array
from paretoik.nlp.interval_program import Pieces


def check_ends(model: SpeedModel, start: ArrayLike, target: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return both as arrays (task,); raise InvalidInput where they are not finite or outside the model's box."""
    check_model(model)
    ends = [finite_array(name, end, np.shape(model.lower)) for name, end in (("start", start), ("target", target))]
    check_inside(model, "start", ends[0])
    check_inside(model, "target", ends[1])
    return ends[0], ends[1]


def check_inside(model: SpeedModel, name: str, point: Float[np.ndarray, " task"]) -> None:
    """Raise InvalidInput unless the point is in the model's box."""
    outside = np.flatnonzero(is_outside(model, point))
    if len(outside):
        i = int(outside[0])
        box = f"[{model.lower[i]:g}, {model.upper[i]:g}] m"
        raise InvalidInput(f"{name}: coordinate {i} must be in the model's box {box}, got {point[i]:.9g} m")


def is_outside(
    model: SpeedModel, points: Float[np.ndarray, "*batch task"], *, tolerance: float = 1e-9
) -> Bool[np.ndarray, "*batch task"]:
    """Return which coordinates are beyond the model's box by more than rounding, a share of it."""
    slack = tolerance * (model.upper - model.lower)
    return ~((points >= model.lower - slack) & (points <= model.upper + slack))


def evaluate_roots(model: SpeedModel, positions: Float[np.ndarray, "*batch task"]) -> tuple[np.ndarray, np.ndarray]:
    """Return what the model does; raise InvalidInput where it is not finite, naming the position."""
    roots, slopes = model.roots(positions)
    if not (np.isfinite(roots).all() and np.isfinite(slopes).all()):
        wrong = ~(np.isfinite(roots).all(axis=(-1, -2)) & np.isfinite(slopes).all(axis=(-1, -2, -3)))
        place = " ".join(f"{number:.6g}" for number in positions[wrong][0])
        raise InvalidInput(f"model: finite R and ∂R/∂p wanted, got others at [{place}] m")
    return roots, slopes


def linearise_pieces(model: SpeedModel, points: Float[np.ndarray, "points task"], share: float) -> Pieces:
    """Return the times of a path's pieces, R Δp with R taken where that ``share`` of each is done, to first order."""
    change = points[1:] - points[:-1]
    roots, slopes = evaluate_roots(model, points[:-1] + share * change)
    derivative = np.einsum("lijk,lj->lik", slopes, change)
    return Pieces(
        values=np.einsum("lij,lj->li", roots, change),
        before=(1 - share) * derivative - roots,
        after=share * derivative + roots,
    )
