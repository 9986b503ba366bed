"""Fastest paths between two points, and the time of any path.

A fastest path is the geodesic of a speed model, in many pieces. If the tool may have the velocities v with ‖R(p) v‖ ≤
1, a path takes the time ∫ ‖R(p) dp‖: its length in the metric of R. Source: Kim, Choi & Jang 2021, Eq. 6, with one
common interval and the limit at the midpoint of each piece.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Bool, Float
from scipy.linalg import LinAlgError, cholesky_banded, eig_banded, solveh_banded

from paretoik.capability.speed_models import SpeedModel, check_model
from paretoik.errors import InvalidInput, SolverFailed
from paretoik.handed_down import HANDED_DOWN
from paretoik.inputs import ArrayLike, check_flag, check_size, finite_array
from paretoik.nlp.convex_programs import Pieces
from paretoik.tables import represented

# Tool paths saved in run folders. The function that saves them belongs to a higher layer; ``paretoik`` registers it.

Result = TypeVar("Result")


@dataclass(frozen=True, kw_only=True, eq=False)
class PathQuery:
    """A requested path: the ``verb``, ``start`` and ``target`` [m], and the ``settings``."""

    verb: str
    model: SpeedModel
    start: Float[np.ndarray, " task"]
    target: Float[np.ndarray, " task"]
    settings: Mapping[str, object]


def run_path(
    query: PathQuery,
    compute: Callable[[], Result],
    *,
    out: str | Path | None,
    overwrite: bool,
    observe: Callable[[Any], object] | bool | None,
) -> Result:
    """Return the result of ``compute``, saved in the folder ``out`` if there is one."""
    check_flag("overwrite", overwrite)
    if out is None and observe is None:  # no overhead for callers that compute thousands of paths
        return compute()
    result: Result = HANDED_DOWN["keep_path"](query, compute, out=out, overwrite=overwrite, observe=observe)
    return result


# A speed model along paths: checked roots, times of pieces, and points outside the model's box.


def check_ends(model: SpeedModel, start: ArrayLike, target: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Return both ends as arrays (task,); raises InvalidInput unless they are in the model's box."""
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


def is_outside(model: SpeedModel, points: Float[np.ndarray, "*batch task"]) -> Bool[np.ndarray, "*batch task"]:
    """Return which coordinates are outside the model's box by more than 1e-9 of it."""
    slack = 1e-9 * (model.upper - model.lower)
    return ~((points >= model.lower - slack) & (points <= model.upper + slack))


def evaluate_roots(model: SpeedModel, positions: Float[np.ndarray, "*batch task"]) -> tuple[np.ndarray, np.ndarray]:
    """Return R and ∂R/∂p; raises InvalidInput, naming the position, if they are not finite."""
    roots, slopes = model.roots(positions)
    if not (np.isfinite(roots).all() and np.isfinite(slopes).all()):
        wrong = ~(np.isfinite(roots).all(axis=(-1, -2)) & np.isfinite(slopes).all(axis=(-1, -2, -3)))
        place = " ".join(f"{number:.6g}" for number in positions[wrong][0])
        raise InvalidInput(f"model must give finite R and ∂R/∂p, got inf or nan at [{place}] m")
    return roots, slopes


def linearise_pieces(model: SpeedModel, points: Float[np.ndarray, "points task"], share: float) -> Pieces:
    """Return R Δp of each piece and its derivatives by the points, with R at a ``share`` of the piece."""
    change = points[1:] - points[:-1]
    roots, slopes = evaluate_roots(model, points[:-1] + share * change)
    derivative = np.einsum("lijk,lj->lik", slopes, change)
    return Pieces(
        values=np.einsum("lij,lj->li", roots, change),
        before=(1 - share) * derivative - roots,
        after=share * derivative + roots,
    )


# The fastest path, and the time of any path.


@dataclass(frozen=True, kw_only=True)
class GeodesicOptions:
    """Settings of the search for the fastest path, and of quadrature; no paper has them."""

    iterations: int = 200
    energy_tolerance: float = 1e-14  # share of the energy: the predicted decrease at which the search ends
    time_tolerance: float = 1e-10  # share of a time: largest error of its quadrature
    quadrature_nodes: int = 5  # Gauss-Legendre nodes per panel
    fewest_samples: int = 64  # least number of samples of a path before its time is accepted
    most_samples: int = 2**18
    start_amplitudes: tuple[float, ...] = (0.2, 0.45)  # shares of the distance: sideways amplitudes of start paths
    difference_step: float = 1e-5  # share of the distance, for second derivatives of R
    active_multiplier: float = 1e-7  # share of the energy per distance: strongly active bounds have a larger multiplier
    perturbations: int = 20  # number of perturbations of a path on a saddle: 1/2, 1/4, ... of the distance


OPTIONS = GeodesicOptions()


@represented
@dataclass(frozen=True, kw_only=True, eq=False)
class FastestPath:
    """A path: its points (n, task) [m] and the times (n,) at them [s]."""

    points: Float[np.ndarray, "n task"]
    times: Float[np.ndarray, " n"]

    @property
    def duration(self) -> float:
        """Time of the whole path [s]."""
        return float(self.times[-1])


def path_time(model: SpeedModel, points: ArrayLike, *, tolerance: float = OPTIONS.time_tolerance) -> float:
    """Return the least time [s] in which the tool can follow a path.

    model: model of the tool's speed
    points: corners (n, task) of the path [m], with straight lines between them
    tolerance: largest relative error of the time; samples are doubled until it is reached

    Raises InvalidInput for points that are not finite or outside the model's box, a tolerance that is not above zero,
    and a model that is not finite at some point; SolverFailed if the finest samples do not reach the tolerance, because
    the model jumps.
    """
    check_model(model)
    task, corners = len(model.lower), finite_array("points", points)
    if corners.ndim != 2 or corners.shape[1] != task or len(corners) == 0:
        raise InvalidInput(f"points: must have shape (n, {task}) with n at least 1, got shape {corners.shape}")
    if not finite_array("tolerance", tolerance, ()) > 0:
        raise InvalidInput(f"tolerance: must be above 0, got {tolerance}")
    outside = int(np.argmax(is_outside(model, corners).any(axis=1)))
    check_inside(model, f"points[{outside}]", corners[outside])
    if len(corners) == 1:
        return 0.0
    return float(_integrate_times(model, corners, tolerance).sum())


def fastest_path(
    model: SpeedModel,
    start: ArrayLike,
    target: ArrayLike,
    *,
    intervals: int = 100,
    out: str | Path | None = None,
    overwrite: bool = False,
    observe: Callable[[Any], object] | bool | None = None,
) -> FastestPath:
    """Return the fastest path from ``start`` to ``target`` (task,) [m] within the model's box.

    Its pieces take nearly equal times. The limit of a piece is that of its midpoint. Newton's method minimises Σ ‖R
    Δp‖², from a straight line and from curves bowed sideways, and leaves saddles; the best optimum is returned. Times
    are those of a fine quadrature, since a coarse sum can be below the true time. If the model is smooth, the path is a
    local optimum, but not certainly the global one.

    model: model of the tool's speed
    start: first position (task,) of the tool [m]
    target: last position (task,) of the tool [m]
    intervals: number of pieces of the path, at least one
    out: folder for the run: run.json, tool_path.npz with every array of the result, review.rrd, in which the tool moves
        along the path, and picture.png
    overwrite: whether to replace a run in ``out``
    observe: function that is called with a ``RunProgress`` while something is compiled or saved, as for ``plan``

    Raises InvalidInput for ends that are not finite or outside the box, fewer than one interval, and a model that is
    not finite somewhere; SolverFailed if no start leads to a minimum.
    """
    check_size("intervals", intervals, 1)
    first, last = check_ends(model, start, target)

    def find() -> FastestPath:
        # the straight line, and lines within the box bowed to either side: two in the plane, four in space
        shares = np.linspace(0.0, 1.0, intervals + 1)[:, None]
        straight, chord = (1 - shares) * first + shares * last, last - first
        starts = [straight]
        if intervals > 1 and chord.any():
            sideways = np.linalg.svd(chord[None] / np.abs(chord).max())[2][1:]  # unit vectors across the chord
            for amplitude in OPTIONS.start_amplitudes:
                swing = amplitude * np.linalg.norm(chord) * np.sin(np.pi * shares)
                for side in (*sideways, *-sideways):
                    starts.append(np.clip(straight + swing * side, model.lower, model.upper))
        paths = [_minimise_energy(model, points) for points in starts]
        optima = [path for path in paths if path is not None]
        if not optima:
            wish = f"fastest_path must reach an optimum within {OPTIONS.iterations} iterations"
            raise SolverFailed(f"{wish}, got none from any start")
        times = [_integrate_times(model, points, OPTIONS.time_tolerance) for points in optima]
        best = int(np.argmin([pieces.sum() for pieces in times]))
        return FastestPath(points=optima[best], times=np.append(0.0, np.cumsum(times[best])))

    settings = {"intervals": int(intervals)}
    query = PathQuery(verb="fastest_path", model=model, start=first, target=last, settings=settings)
    return run_path(query, find, out=out, overwrite=overwrite, observe=observe)


def _integrate_times(model: SpeedModel, points: np.ndarray, tolerance: float) -> Float[np.ndarray, " pieces"]:
    change = points[1:] - points[:-1]
    nodes, weights = np.polynomial.legendre.leggauss(OPTIONS.quadrature_nodes)
    panels = max(1, OPTIONS.fewest_samples // max(1, len(change) * len(nodes)))
    before = np.full(len(change), np.inf)
    while panels * len(nodes) * len(change) <= OPTIONS.most_samples:
        shares = ((np.arange(panels)[:, None] + (nodes + 1) / 2) / panels).ravel()
        roots, _ = evaluate_roots(model, points[:-1, None] + shares[:, None] * change[:, None])
        speeds = np.linalg.norm(np.einsum("lsij,lj->lsi", roots, change), axis=2)
        times: np.ndarray = speeds @ np.tile(weights / 2 / panels, panels)
        if np.abs(times - before).sum() <= tolerance * times.sum():
            return times
        panels, before = 2 * panels, times
    raise SolverFailed(
        f"path_time must reach an error of {tolerance:g}, got a larger one with {OPTIONS.most_samples} samples: the "
        "model may jump"
    )


def _minimise_energy(model: SpeedModel, points: np.ndarray) -> np.ndarray | None:
    """Return the path of least energy near a path, None if the search has not converged.

    Damped Newton steps are projected onto the box: coordinates at a bound that they would exceed stay there. A path on
    a saddle is perturbed and the search continues. Source: Bertsekas 1982, Projected Newton methods for optimization
    problems with simple constraints.
    """
    pieces = linearise_pieces(model, points, 0.5)
    energy, damping = float(np.sum(pieces.values**2)), 0.0
    if len(points) == 2:
        return points
    gradient, hessian = _newton_system(model, points, pieces)
    for _ in range(OPTIONS.iterations):
        inner = points[1:-1]
        active = ((inner <= model.lower) & (gradient > 0)) | ((inner >= model.upper) & (gradient < 0))
        step, predicted = _damped_step(
            np.where(active, 0.0, gradient).ravel(), _fix_coordinates(hessian, active), damping
        )
        trial = _apply_step(model, points, step)
        if predicted <= OPTIONS.energy_tolerance * energy:
            if damping > 1.0:
                return None
            distance = np.abs(points - points[0]).max()
            strongly_active = active & (np.abs(gradient) * distance > OPTIONS.active_multiplier * energy)
            perturbed = _leave_saddle(model, points, _fix_coordinates(hessian, strongly_active), energy)
            if perturbed is None:
                return points
            trial, predicted = perturbed, 0.0
        trial_pieces = linearise_pieces(model, trial, 0.5)
        decrease = energy - float(np.sum(trial_pieces.values**2))
        if decrease > 0.1 * predicted:
            points, energy, damping = trial, energy - decrease, damping / 10 if damping > 1e-3 else 0.0
            gradient, hessian = _newton_system(model, points, trial_pieces)
        else:
            damping = max(10 * damping, 1e-3)
    return None


def _newton_system(model: SpeedModel, points: np.ndarray, pieces: Pieces) -> tuple[np.ndarray, np.ndarray]:
    """Return gradient (between, task) and lower Hessian bands (2 task, between · task) of Σ ‖R Δp‖² / 2.

    Second derivatives of R are differences of first ones.
    """
    values, before, after = pieces.values, pieces.before, pieces.after
    change, middle = points[1:] - points[:-1], (points[1:] + points[:-1]) / 2
    task = points.shape[1]
    offset = OPTIONS.difference_step * np.abs(points - points[0]).max() * np.eye(task)[:, None]
    ahead, behind = np.minimum(middle + offset, model.upper), np.maximum(middle - offset, model.lower)
    _, slopes = evaluate_roots(model, np.concatenate([middle[None], ahead, behind]))
    weighted = np.einsum("li,alijk->aljk", values, slopes)
    second = np.einsum("aljk,lj->alk", weighted[1 : task + 1] - weighted[task + 1 :], change)
    width = np.maximum((ahead - behind).max(axis=2), 1e-300)[..., None]  # each offset is along one axis
    second = np.moveaxis(second / width, 0, -1) / 8
    second, mixed = second + second.swapaxes(1, 2), weighted[0].swapaxes(1, 2) / 2
    symmetric = mixed + mixed.swapaxes(1, 2)
    first = before.swapaxes(1, 2) @ before + second - symmetric
    last = after.swapaxes(1, 2) @ after + second + symmetric
    cross = before.swapaxes(1, 2) @ after + second + mixed - mixed.swapaxes(1, 2)
    diagonal, off_diagonal = last[:-1] + first[1:], cross[1:-1]
    bands = np.zeros((2 * task, diagonal.shape[0] * task))
    for i, j in np.ndindex(task, task):
        if i >= j:
            bands[i - j, j::task] = diagonal[:, i, j]
        bands[task + i - j, j::task][: len(off_diagonal)] = off_diagonal[:, j, i]
    gradient = np.einsum("li,lij->lj", values[:-1], after[:-1]) + np.einsum("li,lij->lj", values[1:], before[1:])
    return gradient, bands[: gradient.size]


def _apply_step(model: SpeedModel, points: np.ndarray, step: np.ndarray) -> np.ndarray:
    moved = points.copy()
    moved[1:-1] = np.clip(points[1:-1] + step.reshape(-1, points.shape[1]), model.lower, model.upper)
    return moved


def _fix_coordinates(bands: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """Return bands with rows and columns of ``fixed`` coordinates (between, task) replaced by the identity."""
    free, result = ~fixed.ravel(), bands.copy()
    for below in range(len(bands)):
        result[below, : len(free) - below] *= free[: len(free) - below] & free[below:]
    result[0] += ~free
    return result


def _damped_step(gradient: np.ndarray, bands: np.ndarray, damping: float) -> tuple[np.ndarray, float]:
    """Return the Newton step, damped until the Hessian is positive definite, and the predicted decrease."""
    size = np.maximum(np.abs(bands[0]), 1e-300)
    while True:
        damped = bands.copy()
        damped[0] += damping * size
        try:
            step: np.ndarray = -solveh_banded(damped, gradient, lower=True)
        except LinAlgError:
            damping = max(4 * damping, 1e-3)
        else:
            return step, float(damping * (size * step) @ step - gradient @ step)


def _leave_saddle(model: SpeedModel, points: np.ndarray, bands: np.ndarray, energy: float) -> np.ndarray | None:
    """Return the path of least energy on either side of a saddle, along the most negative curvature.

    Return None at a minimum: the curvature is positive, or no perturbation has less energy.
    """
    try:
        cholesky_banded(bands, lower=True)
    except LinAlgError:
        direction = eig_banded(bands, lower=True, select="i", select_range=(0, 0))[1].ravel()
        direction *= np.abs(points - points[0]).max() / np.abs(direction).max()
        lengths = 2.0 ** -np.arange(1, OPTIONS.perturbations + 1)
        perturbed = [_apply_step(model, points, length * direction) for length in (*lengths, *-lengths)]
        energies = [np.sum(linearise_pieces(model, path, 0.5).values ** 2) for path in perturbed]
        best = int(np.argmin(energies))
        return perturbed[best] if energies[best] < (1 - OPTIONS.time_tolerance) * energy else None
    return None
