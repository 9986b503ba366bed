"""A step of time-optimal control as a nonlinear program: Eq. 6 with a common interval, for IPOPT and FATROP."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca
import numpy as np
from jaxtyping import Float

from paretoik.capability.speed_models import PolynomialEllipsoids, Polynomials
from studies.kim_2021.full_program import QUIET, solver_options

LENGTH = 0.1  # m: unit of points
WARM: dict[str, Any] = {
    **QUIET,
    **solver_options(1e-8),
    "ipopt.warm_start_init_point": "yes",
    "ipopt.mu_init": 1e-7,
    "ipopt.warm_start_bound_push": 1e-9,
    "ipopt.warm_start_mult_bound_push": 1e-9,
    "ipopt.warm_start_slack_bound_push": 1e-9,
}


Peer = Literal["IPOPT, warm", "FATROP"]


@dataclass(kw_only=True, eq=False)
class LookingAhead:
    """The program, with the multipliers of the last solution to start from.

    Unknowns: points between, then the time; for FATROP stage by stage the point, the time, and the step to the next.
    """

    solver: Any
    staged: bool
    lower: Float[np.ndarray, " unknowns"]
    upper: Float[np.ndarray, " unknowns"]
    highest: Float[np.ndarray, " rows"]
    multipliers: tuple[Any, Any] | None = None

    def solved(self, points: Float[np.ndarray, "points 2"], time: float) -> tuple[float, bool]:
        """Return the time [s] from the first point to the last, and whether the solver ended at an optimum."""
        scaled = points / LENGTH
        start = np.append(scaled[1:-1].ravel(), time)
        if self.staged:
            steps = np.vstack([np.diff(scaled, axis=0), np.zeros((1, 2))])
            start = np.hstack([scaled, np.full((len(points), 1), time), steps]).ravel()[:-2]
        ends = np.concatenate([scaled[0], scaled[-1]])
        known = {} if self.multipliers is None else dict(zip(("lam_x0", "lam_g0"), self.multipliers, strict=True))
        bounds = {"lbx": self.lower, "ubx": self.upper, "lbg": 0.0, "ubg": self.highest}
        solution = self.solver(x0=start, p=ends, **bounds, **known)
        if not self.staged:
            self.multipliers = solution["lam_x"], solution["lam_g"]
        return float(solution["f"]), bool(self.solver.stats()["success"])


def looking_ahead(model: PolynomialEllipsoids, pieces: int, peer: Peer = "IPOPT, warm") -> LookingAhead:
    """Return the program of a number of pieces for a peer, built once."""
    if peer == "FATROP":
        return _staged(model, pieces)
    inner, ends, time = ca.SX.sym("inner", 2, pieces - 1), ca.SX.sym("ends", 4), ca.SX.sym("time")
    points = ca.horzcat(ends[:2], inner, ends[2:])
    rows = [_slack(model, points[:, k], points[:, k + 1] - points[:, k], time / pieces) for k in range(pieces)]
    program = {"x": ca.vertcat(ca.vec(inner), time), "p": ends, "f": time, "g": ca.vertcat(*rows)}
    return LookingAhead(
        solver=ca.nlpsol("ahead", "ipopt", program, WARM),
        staged=False,
        lower=np.append(np.tile(model.lower / LENGTH, pieces - 1), 1e-6),
        upper=np.append(np.tile(model.upper / LENGTH, pieces - 1), np.inf),
        highest=np.full(pieces, np.inf),
    )


def _staged(model: PolynomialEllipsoids, pieces: int) -> LookingAhead:
    """Return the program in the stages that FATROP detects: each with its gap to the next, then its own rows."""
    ends, unknowns, rows = ca.SX.sym("ends", 4), [], []
    equality, states = list[bool](), [ca.SX.sym(f"state_{k}", 3) for k in range(pieces + 1)]
    for k, state in enumerate(states):
        unknowns.append(state)
        if k < pieces:
            step = ca.SX.sym(f"step_{k}", 2)
            unknowns.append(step)
            rows.append(states[k + 1] - ca.vertcat(state[:2] + step, state[2]))
            equality += [True] * 3
        if k in (0, pieces):
            rows.append(state[:2] - (ends[:2] if k == 0 else ends[2:]))
            equality += [True] * 2
        if k < pieces:
            rows.append(_slack(model, state[:2], step, state[2] / pieces))
            equality.append(False)
    program = {"x": ca.vertcat(*unknowns), "p": ends, "f": states[-1][2], "g": ca.vertcat(*rows)}
    options: dict[str, Any] = {
        "structure_detection": "auto",
        "equality": equality,
        "print_time": False,
        "error_on_fail": False,
    }
    settings = {"print_level": 0, "tolerance": 1e-8, "mu_init": 1e-2, "max_iter": 200}
    stage_low, stage_high = np.append(model.lower / LENGTH, 1e-6), np.append(model.upper / LENGTH, np.inf)
    free, ends_free = np.full(2, np.inf), np.full(3, np.inf)  # given ends are rows
    lower = [np.concatenate([stage_low if 0 < k < pieces else -ends_free, -free]) for k in range(pieces + 1)]
    upper = [np.concatenate([stage_high if 0 < k < pieces else ends_free, free]) for k in range(pieces + 1)]
    return LookingAhead(
        solver=ca.nlpsol("ahead", "fatrop", program, {**options, "fatrop": settings}),
        staged=True,
        lower=np.concatenate(lower)[:-2],
        upper=np.concatenate(upper)[:-2],
        highest=np.where(equality, 0.0, np.inf),
    )


def _slack(model: PolynomialEllipsoids, point: Any, step: Any, interval: Any) -> Any:
    """Return interval² − ‖R dp‖² of a step from a point, both in ``LENGTH``."""
    took = root(model.polynomials, LENGTH * (point + step / 2)) @ (LENGTH * step)
    return interval**2 - ca.sumsqr(took)


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
