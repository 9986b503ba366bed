"""How speed models are fitted to directional maxima: by least squares of relative errors, or from below."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from jaxtyping import Float
from scipy import sparse
from scipy.optimize import least_squares
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from paretoik.capability.speed_models import (
    SMALLEST,
    AxesEllipses,
    LogEllipsoids,
    Polynomials,
    SpeedModel,
    check_spanning,
    checked,
    divided,
    factors,
    rank,
    speeds_along,
    symmetric,
)
from paretoik.errors import InvalidInput, SolverFailed, check_size
from paretoik.nlp.conic import Constraints
from paretoik.nlp.subproblem import step
from paretoik.robot.pose import finite_array

Places: TypeAlias = Float[np.ndarray, "samples task"]
Ways: TypeAlias = Float[np.ndarray, "directions task"]
Speeds: TypeAlias = Float[np.ndarray, "samples directions"]
Numbers: TypeAlias = Float[np.ndarray, "terms parts"]

CONVERGED, SAFE_CONVERGED = 1e-14, 1e-9  # shares of the sum of squares
ITERATIONS = 200
TIGHT = 1e-6  # share of the largest multiplier: limits with smaller ones are loose
CAUTION, FLAT = 1e-3, 1e-8  # damping, at first and at least, as shares of the largest curvature
LONGEST = 1e3  # steps of unknowns: damping holds them, which knows no axes, and a box would
STARTS, FURTHEST = 3.0, 100.0  # times the largest speed given: what starts and fits may reach
NEARBY = 1e-5  # of the differences in log S that curvatures are taken from
CLEARANCE = 1e-12  # of log speeds: what a safe fit stays below its limit by, so that rounding does not matter
AXES_DEGREE = 2  # Kim, Choi & Jang 2021, section 3.1


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


def fit_errors(model: SpeedModel, positions: Places, directions: Ways, speeds: Speeds) -> FitErrors:
    """Return how far a model is from directional maxima [m/s], best of positions that it was not fitted to.

    Raises InvalidInput where the arrays do not fit together, or hold speeds that are not positive.
    """
    positions, directions, speeds = checked(positions, directions, speeds)
    if positions.shape[1] != len(model.lower):
        raise InvalidInput(f"positions: {len(model.lower)} coordinates wanted, got {positions.shape[1]}")
    errors = speeds_along(model.roots(positions)[0], directions) / speeds - 1.0
    place, way = np.unravel_index(np.argmax(errors), errors.shape)
    return FitErrors(
        rms=float(np.sqrt(np.mean(errors**2))),
        overestimate=float(errors.max()),
        underestimate=float(-errors.min()),
        position=positions[place],
        direction=directions[way],
    )


def fit_ellipsoids(
    positions: Places, directions: Ways, speeds: Speeds, *, degree: int = 2, safe: bool = False, margin: float = 0.0
) -> LogEllipsoids:
    """Return the model of least Σ r², r = log(fitted speed / true speed), which are relative errors to first order.

    Parameters
    ----------
    positions
        Where the speeds were found (samples, task) [m], task 2 or 3.
    directions
        Along which (directions, task), unit vectors; opposite ones tell nothing new. Safe fits want many (32, planar).
    speeds
        Directional maxima (samples, directions) [m/s].
    degree
        Total degree of the polynomials for the entries of log S.
    safe
        Whether no sample may be overestimated: r ≤ −margin then holds at every one, and nowhere else for sure.
    margin
        What safe fits stay below the samples by, in log speed: 0.02 for about 2 %.

    Raises InvalidInput for arrays that do not fit together, speeds that are not positive, positions or directions
    that do not determine the model; SolverFailed where no least squares are found.
    Source: Kim, Choi & Jang 2021, Eq. 5, with the logarithm of S in place of radii and an angle.
    """
    if not finite_array("margin", margin, ()) >= 0.0 or (margin > 0.0 and not safe):
        raise InvalidInput(f"margin: a finite number from 0 on wanted, and 0 unless safe, got {margin!r}")
    positions, directions, speeds = checked(positions, directions, speeds)
    blank = _blank(positions, degree)
    basis, mixing = _orthonormal(blank, positions)
    errors = LogErrors(basis=basis, directions=directions, logs=np.log(speeds))
    numbers = errors.least(basis.T @ starts(directions, errors.logs))
    if safe:
        numbers = errors.least_below(numbers, margin)
    entries = np.linalg.solve(mixing, numbers) @ errors.parts.reshape(len(errors.parts), -1)
    logs, lower, upper = replace(blank, coefficients=entries), positions.min(axis=0), positions.max(axis=0)
    model = LogEllipsoids(logs=logs, lower=lower, upper=upper)
    if safe:
        excess = float(np.log(model.speeds(positions, directions) / speeds).max())
        model = model.scaled(np.exp(-margin - CLEARANCE - excess))
    return model


def fit_axes(positions: Places, directions: Ways, speeds: Speeds) -> AxesEllipses:
    """Return the paper's model, fitted in two stages as there: the ellipse of each position, then polynomials.

    Arguments are those of ``fit_ellipsoids``, in the plane alone. Raises InvalidInput as that does, and where the
    positions are not in the plane. The radii a ≥ b and the angle c of each
    ellipse are those of least relative errors; c is continued from each position to its nearest neighbours.
    Source: Kim, Choi & Jang 2021, Eq. 5 and section 3.1.
    """
    positions, directions, speeds = checked(positions, directions, speeds)
    if positions.shape[1] != 2:
        raise InvalidInput(f"positions: two coordinates wanted for ellipses, got {positions.shape[1]}")
    blank = _blank(positions, AXES_DEGREE)
    basis, mixing = _orthonormal(blank, positions)
    logs = np.log(speeds)
    fits = [LogErrors(basis=np.ones((1, 1)), directions=directions, logs=row[None]) for row in logs]
    alone = [fit.least(start[None])[0] for fit, start in zip(fits, starts(directions, logs), strict=True)]
    squares, vectors = np.linalg.eigh(np.tensordot(np.stack(alone), symmetric(2), 1))
    minor, major = np.exp(squares / 2).T
    angles = _continued(positions, np.arctan2(vectors[:, 1, 1], vectors[:, 0, 1]))
    for _ in angles:  # every time the squares are less, or the same from here on
        angles = angles + np.pi * np.round((basis @ (basis.T @ angles) - angles) / np.pi)
    numbers = np.linalg.solve(mixing, basis.T @ np.stack([major, minor, angles], axis=1))
    axes = replace(blank, coefficients=numbers)
    return AxesEllipses(axes=axes, lower=positions.min(axis=0), upper=positions.max(axis=0))


@dataclass(frozen=True, kw_only=True, eq=False)
class LogErrors:
    """Errors log(fitted speed / true speed) of ellipsoids whose log S is a sum of ``basis`` functions.

    ``basis`` are the values of orthonormal functions at the samples, ``logs`` the logarithms of the true speeds. The
    unknowns are the ``parts`` of each function's symmetric matrix.
    """

    basis: Float[np.ndarray, "samples terms"]
    directions: Float[np.ndarray, "directions task"]
    logs: Float[np.ndarray, "samples directions"]

    @property
    def parts(self) -> Float[np.ndarray, "parts task task"]:
        """Return the symmetric matrices that unknowns are multiples of."""
        return symmetric(self.directions.shape[1])

    def __call__(self, numbers: Numbers) -> tuple[Float[np.ndarray, " errors"], Float[np.ndarray, "errors unknowns"]]:
        """Return the errors, sample by sample, and their derivatives by the unknowns."""
        found, slopes = self.each(self.basis @ numbers)
        whole = self.basis[:, None, :, None] * slopes[:, :, None, :]
        return found.ravel(), whole.reshape(found.size, numbers.size)

    def each(
        self, numbers: Float[np.ndarray, "samples parts"]
    ) -> tuple[Float[np.ndarray, "samples directions"], Float[np.ndarray, "samples directions parts"]]:
        """Return the errors, and their derivatives, of ellipsoids that are given one by one."""
        values, vectors = np.linalg.eigh(-np.tensordot(numbers, self.parts, 1))
        largest = values[:, -1:]  # taken out, so that nothing overflows on the way to a fit
        values = values - largest
        turned = self.directions @ vectors
        squares = np.maximum(np.einsum("nki,ni->nk", turned**2, np.exp(values)), SMALLEST)
        inner = np.einsum("nia,pij,njb->npab", vectors, self.parts, vectors) * divided(values)[:, None]
        slopes = 0.5 * np.einsum("nka,npab,nkb->nkp", turned, inner, turned) / squares[..., None]
        return -0.5 * (largest + np.log(squares)) - self.logs, slopes

    def curvature(
        self, numbers: Numbers, weights: Float[np.ndarray, " errors"]
    ) -> Float[np.ndarray, "unknowns unknowns"]:
        """Return second derivatives of weights · errors, by differences: as many as an ellipsoid has parts."""
        own, shares = self.basis @ numbers, weights.reshape(self.logs.shape)
        sides = [(self.each(own + side)[1], self.each(own - side)[1]) for side in NEARBY * np.eye(own.shape[1])]
        blocks = np.stack([np.einsum("nk,nkp->np", shares, (up - down) / (2 * NEARBY)) for up, down in sides], axis=-1)
        blocks = (blocks + np.swapaxes(blocks, 1, 2)) / 2
        return np.einsum("nt,ns,npq->tpsq", self.basis, self.basis, blocks).reshape(numbers.size, numbers.size)

    def least(self, start: Numbers) -> Numbers:
        """Return the unknowns of least squares. Raises SolverFailed where there are none, or none in time."""
        values, slopes = (lambda x, part=part: self(x.reshape(start.shape))[part] for part in (0, 1))
        ends = {"ftol": CONVERGED, "xtol": CONVERGED, "gtol": CONVERGED, "max_nfev": ITERATIONS}
        found = least_squares(values, start.ravel(), slopes, method="lm", **ends)
        return self.held(found.x.reshape(start.shape), ended=found.success)

    def held(self, numbers: Numbers, *, ended: bool) -> Numbers:
        """Return the unknowns. Raises SolverFailed if they are no end, or grow into needles between directions."""
        logs = np.linalg.eigvalsh(np.tensordot(self.basis @ numbers, self.parts, 1))[:, -1] / 2
        reach = np.exp(np.minimum(logs - self.logs.max(axis=1), 99.0))
        if ended and reach.max() <= FURTHEST:
            return numbers
        raise SolverFailed(
            f"speeds: ellipsoids of least squares wanted, got none in {ITERATIONS} steps and within {FURTHEST:g} times "
            f"the speeds given; at position {np.argmax(reach)} one grew to {reach.max():.3g}: give more directions"
        )

    def lowered(self, numbers: Numbers, margin: float) -> Numbers:
        """Return the unknowns with all speeds times the one factor that makes the largest error −margin."""
        excess = self(numbers)[0].max() + margin
        return numbers - 2 * excess * np.outer(self.basis.sum(axis=0), np.einsum("pii->p", self.parts))

    def least_below(self, numbers: Numbers, margin: float) -> Numbers:
        """Return the unknowns of least squares among those whose errors are at most −margin.

        By sequential quadratic programming, with the Lagrangian's curvature as far as it is convex. Every iterate is
        lowered into what is allowed, so that squares alone judge it, and none is worse than the lowered start.
        """
        numbers = self.lowered(numbers, margin)
        found, slopes = self(numbers)
        multipliers, damping = -found, CAUTION  # the curvature's weights are 0 at first: Gauss and Newton's step
        for _ in range(ITERATIONS):
            curvatures, axes = np.linalg.eigh(slopes.T @ slopes + self.curvature(numbers, found + multipliers))
            hessian = sparse.csr_array(axes * (np.maximum(curvatures, 0.0) + damping * curvatures[-1]) @ axes.T)
            within = Constraints(unknowns=numbers.size, values=-margin - found, jacobian=sparse.csr_array(-slopes))
            try:
                best = step(slopes.T @ found, hessian, within, yielding=0, radius=LONGEST, price=1.0)
            except SolverFailed:
                break
            promised = -(2 * found @ slopes @ best.step + best.step @ (hessian @ best.step))
            if promised <= SAFE_CONVERGED * (found @ found):
                return self.held(numbers, ended=True)
            moved, tight = numbers + best.step.reshape(numbers.shape), best.limits > TIGHT * best.limits.max()
            back = np.linalg.lstsq(slopes[tight], self(moved)[0][tight] + margin)[0]  # second-order correction
            lowered = self.lowered(moved - back.reshape(numbers.shape), margin)
            tried, changes = self(lowered)
            gained = found @ found - tried @ tried
            if gained < 0.1 * promised:
                damping *= 10.0
            elif gained > 0.5 * promised:
                damping = max(damping / 10.0, FLAT)
            if gained > 0:
                numbers, found, slopes, multipliers = lowered, tried, changes, best.limits
        return self.held(numbers, ended=False)


def starts(directions: Ways, logs: Speeds) -> Float[np.ndarray, "samples parts"]:
    """Return the parts of log S of an ellipsoid near each position's samples, no longer or flatter than they allow.

    That of least Σ (v² dᵀ S⁻¹ d − 1)², linear in S⁻¹, which is then made definite. As a start it is surer than the
    ellipsoid of least squares, which may be a needle between two directions. Raises InvalidInput unless the directions
    determine an ellipsoid.
    """
    check_spanning(directions)
    parts, squares = symmetric(directions.shape[1]), np.exp(2 * logs)
    rows = np.einsum("ki,pij,kj->kp", directions, parts, directions)
    inverses = np.stack([np.linalg.lstsq(rows * row[:, None], np.ones(len(row)))[0] for row in squares])
    values, vectors = np.linalg.eigh(np.tensordot(inverses, parts, 1))
    least, most = 1 / (STARTS**2 * squares.max(axis=1)), STARTS**2 / squares.min(axis=1)
    values = np.clip(values, least[:, None], most[:, None])
    return np.einsum("nia,na,nja,pij->np", vectors, -np.log(values), vectors, parts)


def _continued(positions: Places, angles: Float[np.ndarray, " samples"]) -> Float[np.ndarray, " samples"]:
    """Return angles plus multiples of π, each the nearest to that of a neighbour, along a shortest spanning tree."""
    apart = 1.0 + np.linalg.norm(positions[:, None] - positions, axis=-1)  # the same tree; 0 would mean no way at all
    order, parents = breadth_first_order(minimum_spanning_tree(apart), 0, directed=False)
    found = angles.copy()
    for index in order[1:]:
        found[index] -= np.pi * np.round((found[index] - found[parents[index]]) / np.pi)
    return found


def _blank(positions: Places, degree: int) -> Polynomials:
    """Return polynomials yet to be fitted: one scale for all coordinates, so that turned samples are fitted as well."""
    check_size("degree", degree, 0)
    center = positions.mean(axis=0)
    scale = float(np.linalg.norm(positions - center, axis=1).max()) or 1.0
    terms = len(factors(positions.shape[1], degree))
    return Polynomials(degree=degree, center=center, scale=scale, coefficients=np.zeros((terms, 0)))


def _orthonormal(blank: Polynomials, positions: Places) -> tuple[np.ndarray, np.ndarray]:
    """Return Q and R of the products' values at the samples. Raises InvalidInput where those do not tell them apart."""
    products, (size, task) = blank.products(positions), positions.shape
    terms = products.shape[1]
    wish = f"positions: at least {terms} wanted for polynomials of degree {blank.degree} in {task} coordinates"
    if size < terms:
        raise InvalidInput(f"{wish}, got {size}")
    told = rank(products)
    if told < terms:
        raise InvalidInput(f"{wish}, in general position, got {size} that tell only {told} of {terms} terms apart")
    basis, mixing = np.linalg.qr(products)
    return basis, mixing
