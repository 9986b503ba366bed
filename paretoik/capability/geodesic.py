"""The fastest path between two points: the geodesic of a speed model, on a fine grid; and the time of any path.

Where the tool may have the velocities v with ‖R(p) v‖ ≤ 1, a path takes the time ∫ ‖R(p) dp‖: its length, measured by
R. Source: Kim, Choi & Jang 2021, Eq. 6, with one interval in common and the limit in the middle of each piece.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.linalg import LinAlgError, cholesky_banded, eig_banded, solveh_banded

from paretoik.capability.speed_models import SpeedModel
from paretoik.errors import InvalidInput, SolverFailed, check_size
from paretoik.inputs import ArrayLike, finite_array
from paretoik.nlp.interval_program import Pieces

NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)
SAMPLES = 64  # of a path, at least, before its time is believed
FINEST = 2**18  # samples of a path, at most
ITERATIONS = 200
PRECISE = 1e-10  # of a time: what a quadrature may be wrong by
STATIONARY = 1e-14  # of the energy: what a step may still promise at the end
PRESSED = 1e-7  # of the energy: what moving by the distance must cost where a wall is said to hold a point
NEARBY = 1e-5  # of the distance: how far apart slopes of R are compared
BOWS = (0.2, 0.45)  # of the distance: how far starts swing out sideways
PUSHES = 2.0 ** -np.arange(1, 21)  # of the distance: how far a path that stands on a saddle is pushed off
SLACK = 1e-9  # of the box: rounding that may carry a point out of it


@dataclass(frozen=True, kw_only=True, eq=False)
class FastestPath:
    """``points`` (n, task) [m] of a path, the ``times`` (n,) [s] it takes to each, and its ``duration`` [s]."""

    points: Float[np.ndarray, "n task"]
    times: Float[np.ndarray, " n"]

    @property
    def duration(self) -> float:
        """Time of the whole path [s]."""
        return float(self.times[-1])


def path_time(model: SpeedModel, points: ArrayLike, *, tolerance: float = PRECISE) -> float:
    """Return the least time [s] in which the tool can follow a path.

    Parameters
    ----------
    model
        The speeds that are possible.
    points
        Corners (n, task) [m] of the path, which is straight between them.
    tolerance
        Share of the time that it may be wrong by: samples are doubled until no more changes.

    Raises
    ------
    InvalidInput
        For points that are not finite or outside the model's box, a tolerance that is not above zero, and a model that
        is not finite at some point.
    SolverFailed
        Where the time has not settled when the samples are as fine as they get: the model jumps.
    """
    check_model(model)
    task, corners = len(model.lower), finite_array("points", points)
    if corners.ndim != 2 or corners.shape[1] != task or len(corners) == 0:
        raise InvalidInput(f"points: must have shape (n, {task}) with n at least 1, got shape {corners.shape}")
    if not finite_array("tolerance", tolerance, ()) > 0:
        raise InvalidInput(f"tolerance: must be above 0, got {tolerance}")
    outside = int(np.argmax(_outside(model, corners).any(axis=1)))
    check_inside(model, f"points[{outside}]", corners[outside])
    if len(corners) == 1:
        return 0.0
    return float(_piece_times(model, corners, tolerance).sum())


def fastest_path(model: SpeedModel, start: ArrayLike, target: ArrayLike, *, intervals: int = 100) -> FastestPath:
    """Return the fastest path from ``start`` to ``target`` (task,) [m] within the model's box.

    Its pieces take nearly equal times: their limit is that of their middles, and Σ ‖R Δp‖² is least, by Newton's method
    from a straight start and others bowed sideways, of which the best optimum is kept. Times are those of a fine
    quadrature afterwards, since a coarse sum can be below what the path really takes. Second derivatives are looked at
    in the end and saddles are left: where the model is smooth, locally fastest is certain, globally only as far as the
    starts reach.

    Raises
    ------
    InvalidInput
        For ends that are not finite or outside the box, fewer than one interval, a model that is not finite somewhere.
    SolverFailed
        Where no start has come to a minimum.
    """
    check_size("intervals", intervals, 1)
    first, last = check_ends(model, start, target)
    optima = [
        found for points in _starts(model, first, last, intervals) if (found := _relaxed(model, points)) is not None
    ]
    if not optima:
        raise SolverFailed(f"fastest_path: an optimum within {ITERATIONS} iterations wanted, no start has one")
    times = [_piece_times(model, points, PRECISE) for points in optima]
    best = int(np.argmin([pieces.sum() for pieces in times]))
    return FastestPath(points=optima[best], times=np.append(0.0, np.cumsum(times[best])))


def check_model(model: object) -> None:
    """Raise InvalidInput for what is no model of speeds."""
    if not all(hasattr(model, name) for name in ("lower", "upper", "roots")):
        raise InvalidInput(f"model: a model of speeds wanted, such as fit_ellipsoids returns, got {model!r}")


def check_ends(model: SpeedModel, start: ArrayLike, target: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return both as arrays (task,); raise InvalidInput where they are not finite or outside the model's box."""
    check_model(model)
    found = [finite_array(name, end, np.shape(model.lower)) for name, end in (("start", start), ("target", target))]
    check_inside(model, "start", found[0])
    check_inside(model, "target", found[1])
    return found[0], found[1]


def check_inside(model: SpeedModel, name: str, point: Float[np.ndarray, " task"]) -> None:
    """Raise InvalidInput unless the point is in the model's box."""
    outside = np.flatnonzero(_outside(model, point))
    if len(outside):
        i = int(outside[0])
        box = f"[{model.lower[i]:g}, {model.upper[i]:g}] m"
        raise InvalidInput(f"{name}: coordinate {i} must be in the model's box {box}, got {point[i]:.9g} m")


def _outside(model: SpeedModel, points: Float[np.ndarray, "*batch task"]) -> Bool[np.ndarray, "*batch task"]:
    slack = SLACK * (model.upper - model.lower)
    return ~((points >= model.lower - slack) & (points <= model.upper + slack))


def known_roots(model: SpeedModel, positions: Float[np.ndarray, "*batch task"]) -> tuple[np.ndarray, np.ndarray]:
    """Return what the model does; raise InvalidInput where it is not finite, naming the position."""
    roots, slopes = model.roots(positions)
    if not (np.isfinite(roots).all() and np.isfinite(slopes).all()):
        wrong = ~(np.isfinite(roots).all(axis=(-1, -2)) & np.isfinite(slopes).all(axis=(-1, -2, -3)))
        place = " ".join(f"{number:.6g}" for number in positions[wrong][0])
        raise InvalidInput(f"model: finite R and ∂R/∂p wanted, got others at [{place}] m")
    return roots, slopes


def pieces_of(model: SpeedModel, points: Float[np.ndarray, "points task"], share: float) -> Pieces:
    """Return the times of a path's pieces, R Δp with R taken where that ``share`` of each is done, to first order."""
    change = points[1:] - points[:-1]
    roots, slopes = known_roots(model, points[:-1] + share * change)
    turned = np.einsum("lijk,lj->lik", slopes, change)
    return Pieces(
        values=np.einsum("lij,lj->li", roots, change),
        before=(1 - share) * turned - roots,
        after=share * turned + roots,
    )


def _piece_times(model: SpeedModel, points: np.ndarray, tolerance: float) -> Float[np.ndarray, " pieces"]:
    change = points[1:] - points[:-1]
    panels = max(1, SAMPLES // max(1, len(change) * len(NODES)))
    before = np.full(len(change), np.inf)
    while panels * len(NODES) * len(change) <= FINEST:
        shares = ((np.arange(panels)[:, None] + (NODES + 1) / 2) / panels).ravel()
        roots, _ = known_roots(model, points[:-1, None] + shares[:, None] * change[:, None])
        speeds = np.linalg.norm(np.einsum("lsij,lj->lsi", roots, change), axis=2)
        times: np.ndarray = speeds @ np.tile(WEIGHTS / 2 / panels, panels)
        if np.abs(times - before).sum() <= tolerance * times.sum():
            return times
        panels, before = 2 * panels, times
    raise SolverFailed(f"path_time: a time settled to {tolerance:g} wanted, got none with {FINEST} samples")


def _starts(model: SpeedModel, start: np.ndarray, target: np.ndarray, intervals: int) -> Iterator[np.ndarray]:
    """Yield the straight line, and lines bowed to either side, in space to four, within the box."""
    shares = np.linspace(0.0, 1.0, intervals + 1)[:, None]
    straight = (1 - shares) * start + shares * target
    yield straight
    chord = target - start
    if intervals == 1 or not chord.any():
        return
    sideways = np.linalg.svd(chord[None] / np.abs(chord).max())[2][1:]  # unit vectors across the chord
    for bow in BOWS:
        swing = bow * np.linalg.norm(chord) * np.sin(np.pi * shares)
        for side in (*sideways, *-sideways):
            yield np.clip(straight + swing * side, model.lower, model.upper)


def _relaxed(model: SpeedModel, points: np.ndarray) -> np.ndarray | None:
    """Return the path of least energy near one; None where it has not converged.

    Damped Newton steps, projected onto the box: coordinates that stand against a wall and would go further stay. A path
    on a saddle is pushed off and goes on.
    Source: Bertsekas 1982, Projected Newton methods for optimization problems with simple constraints.
    """
    pieces = pieces_of(model, points, 0.5)
    energy, damping = float(np.sum(pieces.values**2)), 0.0
    if len(points) == 2:
        return points
    slope, bands = _newton(model, points, pieces)
    for _ in range(ITERATIONS):
        inner = points[1:-1]
        held = ((inner <= model.lower) & (slope > 0)) | ((inner >= model.upper) & (slope < 0))
        step, promised = _step(np.where(held, 0.0, slope).ravel(), _freed(bands, held), damping)
        trial = _moved(model, points, step)
        if promised <= STATIONARY * energy:
            if damping > 1.0:
                return None
            pressed = held & (np.abs(slope) * np.abs(points - points[0]).max() > PRESSED * energy)
            pushed = _pushed_off(model, points, _freed(bands, pressed), energy)
            if pushed is None:
                return points
            trial, promised = pushed, 0.0
        found = pieces_of(model, trial, 0.5)
        gained = energy - float(np.sum(found.values**2))
        if gained > 0.1 * promised:
            points, energy, damping = trial, energy - gained, damping / 10 if damping > 1e-3 else 0.0
            slope, bands = _newton(model, points, found)
        else:
            damping = max(10 * damping, 1e-3)
    return None


def _newton(model: SpeedModel, points: np.ndarray, pieces: Pieces) -> tuple[np.ndarray, np.ndarray]:
    """Return slope (between, task) and lower bands (2 task, between · task) of the curvature of Σ ‖R Δp‖² / 2.

    Second derivatives of R are differences of its first.
    """
    values, before, after = pieces.values, pieces.before, pieces.after
    change, middle = points[1:] - points[:-1], (points[1:] + points[:-1]) / 2
    task = points.shape[1]
    away = NEARBY * np.abs(points - points[0]).max() * np.eye(task)[:, None]
    ahead, behind = np.minimum(middle + away, model.upper), np.maximum(middle - away, model.lower)
    _, slopes = known_roots(model, np.concatenate([middle[None], ahead, behind]))
    pulled = np.einsum("li,alijk->aljk", values, slopes)
    bent = np.einsum("aljk,lj->alk", pulled[1 : task + 1] - pulled[task + 1 :], change)
    apart = np.maximum((ahead - behind).max(axis=2), 1e-300)[..., None]  # each is away along its own axis
    bent = np.moveaxis(bent / apart, 0, -1) / 8
    bent, mixed = bent + bent.swapaxes(1, 2), pulled[0].swapaxes(1, 2) / 2
    turned = mixed + mixed.swapaxes(1, 2)
    first = before.swapaxes(1, 2) @ before + bent - turned
    last = after.swapaxes(1, 2) @ after + bent + turned
    cross = before.swapaxes(1, 2) @ after + bent + mixed - mixed.swapaxes(1, 2)
    own, next_ = last[:-1] + first[1:], cross[1:-1]
    bands = np.zeros((2 * task, own.shape[0] * task))
    for i, j in np.ndindex(task, task):
        if i >= j:
            bands[i - j, j::task] = own[:, i, j]
        bands[task + i - j, j::task][: len(next_)] = next_[:, j, i]
    slope = np.einsum("li,lij->lj", values[:-1], after[:-1]) + np.einsum("li,lij->lj", values[1:], before[1:])
    return slope, bands[: slope.size]


def _moved(model: SpeedModel, points: np.ndarray, step: np.ndarray) -> np.ndarray:
    moved = points.copy()
    moved[1:-1] = np.clip(points[1:-1] + step.reshape(-1, points.shape[1]), model.lower, model.upper)
    return moved


def _freed(bands: np.ndarray, held: np.ndarray) -> np.ndarray:
    """Return bands without what is ``held`` (between, task): it has the curvature 1, and none with others."""
    free, freed = ~held.ravel(), bands.copy()
    for below in range(len(bands)):
        freed[below, : len(free) - below] *= free[: len(free) - below] & free[below:]
    freed[0] += ~free
    return freed


def _step(slope: np.ndarray, bands: np.ndarray, damping: float) -> tuple[np.ndarray, float]:
    """Return the damped Newton step, and how much energy it promises to save.

    Where the curvature is not positive it is damped until it is.
    """
    size = np.maximum(np.abs(bands[0]), 1e-300)
    while True:
        damped = bands.copy()
        damped[0] += damping * size
        try:
            step: np.ndarray = -solveh_banded(damped, slope, lower=True)
        except LinAlgError:
            damping = max(4 * damping, 1e-3)
        else:
            return step, float(damping * (size * step) @ step - slope @ step)


def _pushed_off(model: SpeedModel, points: np.ndarray, bands: np.ndarray, energy: float) -> np.ndarray | None:
    """Return the path of least energy, to either side, along the direction of most negative curvature.

    None at a minimum: the curvature is positive, or negative by no more than rounding, so that no push saves energy.
    """
    try:
        cholesky_banded(bands, lower=True)
    except LinAlgError:
        direction = eig_banded(bands, lower=True, select="i", select_range=(0, 0))[1].ravel()
        direction *= np.abs(points - points[0]).max() / np.abs(direction).max()
        pushed = [_moved(model, points, push * direction) for push in (*PUSHES, *-PUSHES)]
        energies = [np.sum(pieces_of(model, path, 0.5).values ** 2) for path in pushed]
        best = int(np.argmin(energies))
        return pushed[best] if energies[best] < (1 - PRECISE) * energy else None
    return None
