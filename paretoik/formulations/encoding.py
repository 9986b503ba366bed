"""Genes of a motion: its base, and a spline of self-motion coordinates around the base."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.interpolate import BSpline

from paretoik.arrays import Genes, JointPaths
from paretoik.errors import InvalidInput
from paretoik.inputs import check_size
from paretoik.robot.kinematics import joint_scales
from paretoik.task.motion_task import MotionTask
from paretoik.task.self_motion import Charts, build_charts


@dataclass(frozen=True, kw_only=True)
class EncodingOptions:
    """Settings of the splines and of their charts.

    radii: radii that are tried as a chart's reach [rad, arm's lengths], ascending
    """

    degree: int = 3  # degree of the splines
    coefficients: tuple[int, int] = (4, 12)  # least number of coefficients, and default on long paths
    radii: tuple[float, ...] = (0.03, 0.06, 0.12, 0.2, 0.3, 0.45, 0.65, 0.9, 1.2, 1.6)
    deviation: float = 0.3  # approximate size of the coefficients of sampled motions, as a share of the charts' reach


OPTIONS = EncodingOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Encoding:
    """Map between genes and motions.

    The first gene, rounded down, is the index of the base. The others, in [−1, 1], are spline coefficients c_k.
    Self-motion coordinates around the base are y(t) = radius(t) · Σ_k c_k B_k(t).

    radius: reach of the chart around each base
    spline: C² cubic basis B_k, clamped, or periodic if the motion is cyclic. If the start is given, one function is
        left out. If the motion ends at rest, the last two functions are summed: their coefficients are equal.
    """

    charts: Charts
    radius: Float[np.ndarray, "bases time"]
    spline: Float[np.ndarray, "time coefficients"]

    @property
    def bases(self) -> int:
        """Number of base motions."""
        return len(self.radius)

    @property
    def coefficients(self) -> int:
        """Number of spline coefficients per direction of redundancy."""
        return self.spline.shape[1]

    @property
    def redundancy(self) -> int:
        """Number of directions of redundancy."""
        return self.charts.null_space.shape[-1]

    @property
    def bounds(self) -> tuple[Float[np.ndarray, " genes"], Float[np.ndarray, " genes"]]:
        """Lowest and highest values of the genes."""
        size = self.redundancy * self.coefficients
        return np.concatenate([[0.0], -np.ones(size)]), np.concatenate([[float(self.bases)], np.ones(size)])

    def species(self, genes: Genes) -> Int[np.ndarray, " points"]:
        """Return the index of each individual's base motion."""
        return np.clip(np.floor(genes[:, 0]), 0, self.bases - 1).astype(int)

    def decode(self, task: MotionTask, genes: Genes) -> tuple[JointPaths, Bool[np.ndarray, "points time"]]:
        """Return the motions, and a mask of their samples on the path."""
        which = self.species(genes)
        weights = genes[:, 1:].reshape(len(genes), self.redundancy, self.coefficients)
        y = np.einsum("tk,prk->ptr", self.spline, weights) * self.radius[which][..., None]
        q, on_path = self.charts.at(task, which, y)
        if task.cyclic:
            q[:, -1] = q[:, 0]
        return q, on_path

    def encode(self, task: MotionTask, which: Int[np.ndarray, " motions"], q: JointPaths) -> Genes:
        """Return the genes nearest to motions around bases ``which``, by least squares."""
        y = self.charts.coordinates(task, which, q) / self.radius[which][..., None]
        fitted = np.einsum("kt,ptr->prk", np.linalg.pinv(self.spline), y)
        return np.concatenate([which[:, None] + 0.5, fitted.reshape(len(q), -1)], axis=1)

    def encode_nearest(self, task: MotionTask, q: JointPaths) -> tuple[Genes, Float[np.ndarray, " motions"]]:
        """Return genes, clipped to their bounds, and their motions' distances from ``q`` [rad, arm's lengths].

        A distance is the largest over joints and samples. A motion's base is the one with the smallest distance.
        """
        genes, deviation = np.zeros((len(q), len(self.bounds[0]))), np.full(len(q), np.inf)
        for base in range(self.bases):
            encoded = np.clip(self.encode(task, np.full(len(q), base), q), *self.bounds)
            decoded, _ = self.decode(task, encoded)
            distance = np.abs((decoded - q) / joint_scales(task.arm)).max(axis=(1, 2))
            nearer = distance < deviation
            genes[nearer], deviation[nearer] = encoded[nearer], distance[nearer]
        return genes, deviation

    def sample(self, count: int, rng: np.random.Generator) -> Genes:
        """Return genes of ``count`` smooth motions near the bases; the first ones are the bases."""
        which = np.arange(count) % self.bases
        shape = (count, self.redundancy, 1)
        tilt = rng.normal(size=shape) + rng.normal(size=shape) * np.linspace(-1, 1, self.coefficients)
        wave = OPTIONS.deviation * np.where(np.arange(count) < self.bases, 0.0, 1.0)[:, None] * tilt.reshape(count, -1)
        return np.concatenate([which[:, None] + 0.5, np.clip(wave, -1, 1)], axis=1)


def choose_coefficients(coefficients: int | None, samples: int) -> int:
    """Return the number of spline coefficients; None: the default. Raises InvalidInput."""
    if coefficients is None:
        return int(np.clip(samples - 2, *OPTIONS.coefficients))
    check_size("coefficients", coefficients, OPTIONS.coefficients[0])
    if coefficients > samples - 2:
        raise InvalidInput(
            f"coefficients must be at most {samples - 2} on a path of {samples} samples, got {coefficients}"
        )
    return coefficients


def encoding(task: MotionTask, base: Float[np.ndarray, "bases time dof"], coefficients: int) -> Encoding:
    """Return the encoding around base motions, after measuring the reach of their charts."""
    # the C² cubic basis of the task's coordinates
    t, degree = task.times / task.times[-1], OPTIONS.degree
    has_start = task.start is not None
    count = coefficients + has_start
    if task.cyclic:  # functions beyond the end continue at the beginning
        knots = np.arange(-degree, count + degree + 1) / count
        wide = BSpline.design_matrix(np.minimum(t, 1 - 1e-15), knots, degree).toarray()
        basis = wide[:, :count].copy()
        basis[:, : wide.shape[1] - count] += wide[:, count:]
        basis[-1] = basis[0]
    else:
        basis = clamped_spline(t, count + task.ends_at_rest)
        if task.ends_at_rest:
            basis = np.concatenate([basis[:, :-2], basis[:, -2:].sum(axis=1, keepdims=True)], axis=1)
    if has_start:  # leave out one function, so that the others are zero at the first sample and stay local
        pivot = int(np.argmax(basis[0]))
        remainder = basis - np.outer(basis[:, pivot], basis[0] / basis[0, pivot])
        remainder[0] = 0.0
        basis = np.delete(remainder, pivot, axis=1)
    charts = build_charts(task, base)
    return Encoding(charts=charts, radius=_reach(task, charts), spline=basis)


def clamped_spline(t: Float[np.ndarray, " time"], coefficients: int) -> Float[np.ndarray, "time coefficients"]:
    """Return the basis of a clamped cubic B-spline at times in [0, 1]."""
    inner = np.linspace(0, 1, coefficients - OPTIONS.degree + 1)
    knots = np.concatenate([np.zeros(OPTIONS.degree), inner, np.ones(OPTIONS.degree)])
    basis: np.ndarray = BSpline.design_matrix(t, knots, OPTIONS.degree).toarray()
    return basis


def _reach(task: MotionTask, charts: Charts) -> Float[np.ndarray, "bases time"]:
    """Return each chart's reach: the largest radius that is on the path everywhere, smoothed in time."""
    from scipy.ndimage import gaussian_filter1d, minimum_filter1d  # imported here: needed at start-up only

    bases, times, _, redundancy = charts.null_space.shape
    rays = np.concatenate([np.eye(redundancy), -np.eye(redundancy)])
    if redundancy > 1:  # the corners of the box of genes are farther out than its axes
        corners = np.random.default_rng(0).choice([-1.0, 1.0], size=(2 * redundancy, redundancy))
        rays = np.concatenate([rays, corners])
    reached = np.ones((bases, times), dtype=bool)
    reach = np.full((bases, times), OPTIONS.radii[0])
    which = np.repeat(np.arange(bases), len(rays))
    for radius in OPTIONS.radii:
        y = np.tile((radius * rays)[:, None, :], (bases, times, 1))
        on_path = charts.at(task, which, y)[1].reshape(bases, len(rays), times)
        reached &= on_path.all(axis=1)
        reach[reached] = radius
        if not reached.any():
            break
    ends, width = "wrap" if task.cyclic else "nearest", max(3, times // 10)
    least = minimum_filter1d(np.log(reach), width, axis=1, mode=ends)
    smooth: np.ndarray = gaussian_filter1d(least, width / 2, axis=1, mode=ends)
    if task.cyclic:
        smooth[:, -1] = smooth[:, 0]
    return np.exp(smooth)
