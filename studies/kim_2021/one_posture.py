"""The share of two polygons' maxima that one posture reaches: speeds and forces, as certified fronts.

The paper's polygons have another posture for every direction. Here the tool stays in one, with its gears: fast ahead
and upwards, strong ahead and upwards, fast and strong upwards. Fronts by ``DirectionalMaxima``: MaxiMin, then
gradients.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

import paretoik as pk
from paretoik.capability.joint_capability import Quantity
from paretoik.runs.distribution import Executor
from problems.kim_2021 import PLACE, WAYS
from studies.kim_2021.ipopt_programs import posture_program
from studies.kim_2021.maxima import MECHANISMS, actuation_of
from studies.kim_2021.racing import SAME
from studies.processes import run_each
from studies.reporting import Row

TABLE = "one posture for two directions, at p6"
CASES: dict[str, tuple[tuple[tuple[float, float], ...], tuple[Quantity, ...]]] = {
    "fast ahead and upwards": (WAYS, ("velocity", "velocity")),
    "strong ahead and upwards": (WAYS, ("force", "force")),
    "fast and strong upwards": ((WAYS[1], WAYS[1]), ("velocity", "force")),
}
POPULATION, GENERATIONS = 60, 30
NEAR = 1e-9  # IPOPT's tolerance


class OnePosture(NamedTuple):
    """The certified front of a mechanism and case, its directional maxima (2,), and IPOPT's gains (points,).

    ``gained`` is a share of the second objective, with no less of the first, NaN if IPOPT ends at no optimum.
    """

    name: str
    front: pk.Front
    maxima: Float[np.ndarray, " 2"]
    gained: Float[np.ndarray, " points"]


def one_posture(mechanism: str, case: str, *, points: int) -> OnePosture:
    """Return the front of a number of points at most, and IPOPT's gains from them."""
    ways, quantities = CASES[case]
    problem = pk.DirectionalMaxima(
        pk.arms.kim_3r(), actuation_of(mechanism), PLACE, ways, quantity=quantities, power=False
    )
    front = pk.refine(
        pk.solve(problem, population=POPULATION, generations=GENERATIONS, seed=0, points=points, observe=False),
        observe=False,
    )
    each = [
        pk.directional_maxima(problem.arm, problem.actuation, PLACE, [way], quantity=quantity).values
        for way, quantity in zip(ways, quantities, strict=True)
    ]
    program, gained = posture_program(mechanism, quantities, NEAR, bound_relax_factor=0.0, mu_init=1e-4), []
    for genes, (first, second) in zip(np.array(front.genes), front.objectives, strict=True):
        value, success = program.solved(program.start_at(problem, genes), PLACE, ways, first)
        gained.append(value / second - 1.0 if success else np.nan)
    return OnePosture(f"{mechanism}, {case}", front, np.concatenate(each), np.array(gained))


def one_posture_rows(one: OnePosture) -> list[Row]:
    """Return the shares of both maxima that the best posture reaches, and whether points are optimal by IPOPT too."""
    shares, certificates = one.front.objectives / one.maxima, one.front.certificates
    assert certificates is not None
    over = "LOSS: above the maxima; " if shares.max() > 1 + SAME else ""
    reached = zip(shares.max(axis=0), one.maxima, strict=True)
    ends = ", ".join(f"{100 * share:.2f} % of {maximum:.4g}" for share, maximum in reached)
    ended = one.gained[np.isfinite(one.gained)]
    largest = float(ended.max(initial=0.0))
    prefix = "LOSS: " if largest > SAME else ""
    row, minima = partial(Row, TABLE, one.name), float(np.sum(certificates.status == "minimum"))
    residuals = f"stationary within {certificates.criticality.max():.1e}, limits kept within "
    residuals += f"{certificates.violation.max():.1e}"
    best, outcome = 100 * float(shares.min(axis=1).max()), f"{prefix}it ended at {len(ended)} optima of {len(shares)}"
    return [
        row("both at once: of either's maximum at least", "%", best, note=f"{over}ends {ends}"),
        row("certified minima", f"of {len(shares)}", minima, note=residuals),
        row("IPOPT's gain from them, at most", "", largest, note=outcome),
    ]


def all_cases(points: int, *, executor: Executor | None = None) -> list[OnePosture]:
    """Return all cases of both mechanisms."""
    front = partial(one_posture, points=points)
    return list(run_each(executor, {(m, case): partial(front, m, case) for m in MECHANISMS for case in CASES}).values())
