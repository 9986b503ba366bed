"""The calculus of variations beside the planner: Table 4, from the optima of simulation 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

import paretoik as pk
from paretoik.self_motion.branches import branch_labels
from paretoik.trajectory.grid_oracle import grid_oracle
from paretoik.trajectory.plan import Optimum
from studies.reporting import Row
from studies.tringali_2020.extremals import Extremal, integrate_extremal
from studies.tringali_2020.reported import beside, paper
from studies.tringali_2020.shooting import shoot_extremals
from studies.tringali_2020.simulations import Simulation

TABLE = "Table 4"
INTEGRATED, FREED = 1e-7, 1e-8  # tolerances: finer ones give the same digits


def matched(fitted: Simulation) -> dict[str, str]:
    """Return the paper's optima by the bends of ours: each the one of the fitted arm that is nearest in energy."""
    left, found = list(fitted.plan.optima), {}
    for row in ("optimum 1", "optimum 2", "optimum 3"):
        if left:
            energy = paper()[TABLE, row, "planner"]
            nearest = min(left, key=lambda o: abs(o.objective - energy))
            left.remove(nearest)
            found[nearest.label] = row
    return found


def named(optima: Sequence[Optimum], names: Mapping[str, str]) -> dict[str, Optimum]:
    """Return optima by name: the best with the paper's bends are the paper's, in its order; then the others."""
    left = dict(names)
    first: dict[str, Optimum] = {}
    further: dict[str, Optimum] = {}
    for optimum in optima:
        name = left.pop(optimum.label, None)
        if name is not None:
            first[name] = optimum
        else:
            further[f"further optimum {len(further) + 1}"] = optimum
    return dict(sorted(first.items())) | further


def table_4(simulation: Simulation, names: Mapping[str, str], finer: Simulation | None = None) -> list[Row]:
    """Return the rows of one arm: the optima that the paper has (``names`` by their bends), then those it has not.

    With ``finer``, the same simulation at more samples, also what becomes of the difference there, and the motions of
    Eq. 20 whose start is sought too.
    """
    optima = named(simulation.plan.optima, names)
    starts = _starts(list(optima.values()))
    right = integrate_extremal(simulation.problem.task, starts, tolerance=INTEGRATED)
    wrong = integrate_extremal(simulation.problem.task, starts, tolerance=INTEGRATED, as_printed=True)
    rows: dict[str, list[Row]] = {}
    for k, (name, optimum) in enumerate(optima.items()):
        rows[name] = _compared(simulation, name, optimum, right, wrong, k)
    if finer is not None:
        for row in _repeated(simulation.masses, finer, names) + _freed(simulation, optima, starts):
            rows.setdefault(row.row, []).append(row)
    return [row for several in rows.values() for row in several]


def bounded(simulation: Simulation, *, resolution: float | None) -> Row:
    """Return what no motion at all can be better than, by the grid oracle, beside the best that was planned."""
    found, best = grid_oracle(simulation.problem.task, resolution=resolution), simulation.plan.best.objective
    return Row(
        table=f"{TABLE}, {simulation.masses} masses",
        row="all motions",
        column="bound from below",
        unit="J s",
        ours=found.lower_bound,
        note=f"the best planned is within {1 - found.lower_bound / best:.1%} of the best of all; nodes "
        f"{found.resolution:.2g} rad apart, the best way through them {found.best / best - 1:+.2%}",
    )


def _starts(optima: Sequence[Optimum]) -> np.ndarray:
    return np.stack([optimum.motion.q[0] for optimum in optima])


def _compared(
    simulation: Simulation, name: str, optimum: Optimum, right: Extremal, wrong: Extremal, k: int
) -> list[Row]:
    """Return what an optimum has beside the motions ``k`` of Eq. 20 corrected and as printed, from the same start."""
    energy, other = (float(pk.kinetic_energy(found.motion[k])) for found in (right, wrong))
    apart = np.abs(optimum.motion.q - right.motion.q[k])
    bends = f"bends {optimum.label}"
    if name.startswith("further"):
        bends += "; not in the paper"
    elif simulation.masses == "fitted":
        bends += "; the paper's that is nearest in energy"
    if "~" in optimum.label:
        bends += "; ~ where links align on the way, as the paper shows of its second"
    sampled = f"summed as the planner's; in continuous time {right.energy[k]:.5f}"
    sign = f"{other / energy:.2f} times that of the corrected sign"

    def row(column: str, unit: str, ours: float, note: str) -> Row:
        return beside(TABLE, simulation.masses, name, column, unit, ours, note)

    return [
        row("Nedungadi", "J s", energy, sampled),
        row("planner", "J s", optimum.objective, bends),
        row(
            "mean |Δq|",
            "rad",
            float(apart.mean()),
            f"largest {apart.max():.2g} rad; the paper does not say how it integrates",
        ),
        row("Nedungadi, sign as printed", "J s", other, sign),
    ]


def _repeated(masses: str, finer: Simulation, names: Mapping[str, str]) -> list[Row]:
    """Return the mean difference at more samples."""
    optima, samples = named(finer.plan.optima, names), len(finer.problem.task.times)
    found = integrate_extremal(finer.problem.task, _starts(list(optima.values())), tolerance=INTEGRATED)
    column, note = f"mean |Δq|, {samples} samples", "falls with the step: what differs is the discretisation"
    rows = []
    for k, (name, optimum) in enumerate(optima.items()):
        apart = float(np.abs(optimum.motion.q - found.motion.q[k]).mean())
        rows.append(beside(TABLE, masses, name, column, "rad", apart, note))
    return rows


def _freed(simulation: Simulation, optima: Mapping[str, Optimum], starts: np.ndarray) -> list[Row]:
    """Return the energies of the motions of Eq. 20 that leave no self-motion at their end."""
    found, column, rows = (
        shoot_extremals(simulation.problem.task, starts, tolerance=FREED),
        "Nedungadi, start sought",
        list[Row](),
    )
    bends = branch_labels(found.motion)
    assert found.minimum is not None
    for name, optimum in optima.items():
        if optimum.label in bends:
            k = bends.index(optimum.label)
            energy = float(pk.kinetic_energy(found.motion[k]))
            kind = "a minimum" if found.minimum[k] else "no minimum"
            note = f"{100 * (energy / optimum.objective - 1):+.3f} % beside the planner; {kind} by Jacobi's condition"
            rows.append(beside(TABLE, simulation.masses, name, column, "J s", energy, note))
    return rows
