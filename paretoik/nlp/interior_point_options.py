"""Settings of the interior-point method (``interior_point``)."""

from __future__ import annotations

from typing import NamedTuple


class InteriorPointOptions(NamedTuple):
    """Settings of the interior-point method; none has a unit except ``radius``. Its kernels have further ones."""

    barrier: float = 0.1  # μ of the first subproblem
    last_barrier: float = 1e-13  # μ of the last
    penalty: float = 1.0  # of one unit of violation, to begin with, times what is usual for the kernel
    tolerance: float = 1e-8  # of stationarity, and of violations
    iterations: int = 150  # at most
    kink_iterations: int = 3  # times as many where functions have kinks
    regularisation: float = 1e-9  # of the largest entry: what is added first to a matrix that is not definite
    kink_regularisation: float = 1e-13  # the same where functions have kinks: their entries are large
    radius: float = 0.3  # [rad or arm lengths] of the first step, where sequential quadratic programming takes over
    barrier_factor: float = 0.2  # μ₊ = min(factor · μ, μ^power): Wächter & Biegler 2006, Eq. 7
    barrier_power: float = 1.5
    barrier_tolerance: float = 10.0  # times μ: the error up to which a subproblem counts as solved; ibid., Eq. 5
    penalty_factor: float = 10.0  # by which the penalty grows
    penalty_barrier: float = 3e-3  # μ from which on violations make the penalty grow
    soft_violation: float = 100.0  # times μ over penalty: a violation that the barrier alone explains
    helpless_growth: float = 100.0  # of the penalty without halving the violation: the constraints cannot all hold
    armijo: float = 1e-4  # Nocedal & Wright, Eq. 3.4
    halvings: int = 40  # of a step at most
    boundary_fraction: float = 0.995  # of the way to where a slack or multiplier is 0; Nocedal & Wright, Eq. 19.9
    multiplier_range: float = 1e8  # by which a multiplier may differ from μ over its slack; Wächter & Biegler, Eq. 16
    flat_decrease: float = 1e-15  # predicted decrease over merit below which there is nothing to gain
    flat_barrier: float = 1e-6  # times μ: a predicted decrease below which a subproblem has nothing to gain
    kink_flat_barrier: float = 1e-2  # the same where functions have kinks: steps along flat valleys end at each
    merit_rounding: float = 1e-14  # of the merit function, relative
    stalled_decrease: float = 1e-12  # of the merit function, relative: less is as good as none
    stalled_steps: int = 5  # that decrease it by less, after which a subproblem counts as solved
    least_slack: float = 1e-2  # that unknown slacks begin with, or √μ where that is less
    residual_tolerance: float = 1e-10  # of the sum of residuals
    filter_margin: float = 1e-5  # γ of the filter; ibid., Eq. 18
    filter_infeasible: float = 1e-4  # of the first residual, up to which the merit alone may decide; ibid., Eq. 21
    restorations: int = 12  # without half the residuals: the filter is cleared, or slacks follow c again
