"""A step of time-optimal control as a nonlinear program, for CasADi and IPOPT: Eq. 6 with the interval in common."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from jaxtyping import Float

from paretoik.capability.polynomials import Polynomials
from paretoik.capability.speed_models import PolynomialEllipsoids
from studies.kim_2021.full_program import QUIET, solver_options

LENGTH = 0.1  # m: what points are counted in
WARM: dict[str, Any] = {
    **QUIET,
    **solver_options(1e-8),
    "ipopt.warm_start_init_point": "yes",
    "ipopt.mu_init": 1e-7,
    "ipopt.warm_start_bound_push": 1e-9,
    "ipopt.warm_start_mult_bound_push": 1e-9,
    "ipopt.warm_start_slack_bound_push": 1e-9,
}


@dataclass(kw_only=True, eq=False)
class LookingAhead:
    """The program, with the multipliers of the last solution to start from. Unknowns: points between, then the time."""

    solver: Any
    pieces: int
    lower: Float[np.ndarray, " unknowns"]
    upper: Float[np.ndarray, " unknowns"]
    multipliers: tuple[Any, Any] | None = None

    def solved(self, points: Float[np.ndarray, "points 2"], time: float) -> tuple[float, bool]:
        """Return the time [s] from the first point to the last, and whether IPOPT ended at an optimum."""
        start = np.append(points[1:-1].ravel() / LENGTH, time)
        known = {} if self.multipliers is None else dict(zip(("lam_x0", "lam_g0"), self.multipliers, strict=True))
        ends = np.concatenate([points[0], points[-1]]) / LENGTH
        found = self.solver(x0=start, p=ends, lbx=self.lower, ubx=self.upper, lbg=0.0, ubg=np.inf, **known)
        self.multipliers = found["lam_x"], found["lam_g"]
        return float(found["x"][-1]), self.solver.stats()["return_status"] == "Solve_Succeeded"


def looking_ahead(model: PolynomialEllipsoids, pieces: int) -> LookingAhead:
    """Return the program of so many pieces, built once."""
    inner, ends, time = ca.SX.sym("inner", 2, pieces - 1), ca.SX.sym("ends", 4), ca.SX.sym("time")
    points = ca.horzcat(ends[:2], inner, ends[2:])
    rows = []
    for k in range(pieces):
        change = LENGTH * (points[:, k + 1] - points[:, k])
        took = root(model.polynomials, LENGTH * (points[:, k + 1] + points[:, k]) / 2) @ change
        rows.append((time / pieces) ** 2 - ca.sumsqr(took))
    program = {"x": ca.vertcat(ca.vec(inner), time), "p": ends, "f": time, "g": ca.vertcat(*rows)}
    return LookingAhead(
        solver=ca.nlpsol("ahead", "ipopt", program, WARM),
        pieces=pieces,
        lower=np.append(np.tile(model.lower / LENGTH, pieces - 1), 1e-6),
        upper=np.append(np.tile(model.upper / LENGTH, pieces - 1), np.inf),
    )


def root(polynomials: Polynomials, position: Any) -> Any:
    """Return R = Q^(1/2) / s in closed form, log s and Q's entries polynomials of degree 2 of the position."""
    x = [1.0, *[(position[a] - polynomials.center[a]) / polynomials.scale for a in range(2)]]
    products = [x[i] * x[j] for i in range(3) for j in range(i, 3)]
    log_scale, first, mixed, last = (
        sum(float(c) * product for c, product in zip(column, products, strict=True))
        for column in polynomials.coefficients.T
    )
    delta = ca.sqrt(first * last - mixed**2)
    over = 1 / (ca.exp(log_scale) * ca.sqrt(first + last + 2 * delta))
    return over * ca.vertcat(ca.horzcat(first + delta, mixed), ca.horzcat(mixed, last + delta))
