"""The calculus of variations against the planner: Table 4, from the optima of simulation 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

import paretoik as pk
from paretoik.task.retraction import normal_directions, retract_nearest
from paretoik.trajectory.grid_oracle import grid_oracle
from paretoik.trajectory.plan import Optimum
from studies.reporting import Row
from studies.tringali_2020.extremals import Extremal, integrate_extremal
from studies.tringali_2020.simulations import Simulation, beside, paper

TABLE = "Table 4"
PAPERS_OPTIMA = ("optimum 1", "optimum 2", "optimum 3")
INTEGRATED = 1e-7  # tolerance: finer ones give the same digits
MOVED = np.linspace(-0.02, 0.02, 41)  # rad: of a start along the self-motion


def match_optima(fitted: Simulation) -> dict[str, str]:
    """Return the paper's optima by the bends of ours: each the one of the fitted arm that is nearest in energy."""
    remaining, names = list(fitted.plan.optima), {}
    for row in PAPERS_OPTIMA:
        if remaining:
            energy = paper()[TABLE, row, "planner"]
            nearest = min(remaining, key=lambda o: abs(o.objective - energy))
            remaining.remove(nearest)
            names[nearest.label] = row
    return names


def name_optima(optima: Sequence[Optimum], names: Mapping[str, str]) -> dict[str, Optimum]:
    """Return optima by name: the best with the paper's bends are the paper's, in its order; then the others."""
    remaining = dict(names)
    first: dict[str, Optimum] = {}
    further: dict[str, Optimum] = {}
    for optimum in optima:
        name = remaining.pop(optimum.label, None)
        if name is not None:
            first[name] = optimum
        else:
            further[f"further optimum {len(further) + 1}"] = optimum
    return dict(sorted(first.items())) | further


def table_4(simulation: Simulation, names: Mapping[str, str]) -> list[Row]:
    """Return the rows of one arm: the paper's optima (``names`` by their bends), then others."""
    optima = name_optima(simulation.plan.optima, names)
    starts = np.stack([optimum.motion.q[0] for optimum in optima.values()])
    right, wrong = (
        integrate_extremal(simulation.problem.task, starts, tolerance=INTEGRATED, as_printed=as_printed)
        for as_printed in (False, True)
    )
    rows = []
    for k, (name, optimum) in enumerate(optima.items()):
        rows += _optimum_rows(simulation, name, optimum, right, wrong, k) + _moved_start_rows(simulation, name, optimum)
    return rows


def bound_row(simulation: Simulation, *, resolution: float | None) -> Row:
    """Return a bound on all motions, by the grid oracle, and the best planned value."""
    oracle, best = grid_oracle(simulation.problem.task, resolution=resolution), simulation.plan.best.objective
    note = (
        f"the best planned is within {1 - oracle.lower_bound / best:.1%} of the best of all; nodes "
        f"{oracle.resolution:.2g} rad apart, the best way through them {oracle.best / best - 1:+.2%}"
    )
    return Row(
        f"{TABLE}, {simulation.masses} masses", "all motions", "bound from below", "J s", oracle.lower_bound, note=note
    )


def _optimum_rows(
    simulation: Simulation, name: str, optimum: Optimum, right: Extremal, wrong: Extremal, k: int
) -> list[Row]:
    """Return an optimum's values and those of the motions ``k`` of Eq. 20, corrected and as printed, from its start."""
    energy, other = (float(pk.kinetic_energy(extremal.motion[k])) for extremal in (right, wrong))
    difference = np.abs(optimum.motion.q - right.motion.q[k])
    bends = f"bends {optimum.label}"
    if name.startswith("further"):
        bends += "; not in the paper"
    elif simulation.masses == "fitted":
        bends += "; the paper's that is nearest in energy"
    if "~" in optimum.label:
        bends += "; ~ where links align on the way, as the paper shows of its second"
    sampled = f"summed as the planner's, {100 * (energy / optimum.objective - 1):+.2f} % from it; in continuous time "
    sampled += f"{right.energy[k]:.5f}; it depends on the start"
    sign = f"{other / energy:.2f} times that of the corrected sign"

    def row(column: str, unit: str, ours: float, note: str) -> Row:
        return beside(TABLE, simulation.masses, name, column, unit, ours, note)

    return [
        row("Nedungadi", "J s", energy, sampled),
        row("planner", "J s", optimum.objective, bends),
        row(
            "mean |Δq|", "rad", float(difference.mean()), f"largest {difference.max():.2g} rad; it depends on the start"
        ),
        row("Nedungadi, sign as printed", "J s", other, sign),
    ]


def _moved_start_rows(simulation: Simulation, name: str, optimum: Optimum) -> list[Row]:
    """Return how far a start must be moved along the self-motion for the paper's mean difference."""
    printed = paper().get((TABLE, name, "mean |Δq|"))
    if printed is None:
        return []
    task, start = simulation.problem.task, optimum.motion.q[0]
    across = normal_directions(task.arm, task.tasks, start, task.targets[0])
    along = np.linalg.svd(across.T)[2][-1]
    starts = retract_nearest(task.arm, task.tasks, start + MOVED[:, None] * along, task.targets[0]).q
    extremal = integrate_extremal(task, starts, tolerance=INTEGRATED)
    differences = np.abs(extremal.motion.q - optimum.motion.q).mean(axis=(1, 2))
    crossings = np.flatnonzero(np.diff(np.sign(differences - printed)))
    if not len(crossings):
        return []
    shares = (printed - differences[crossings]) / (differences[crossings + 1] - differences[crossings])
    moved = float(np.min(np.abs(MOVED[crossings] + shares * np.diff(MOVED)[0])))
    note = (
        f"so far along the self-motion the mean |Δq| is the paper's; at {MOVED[differences.argmin()]:+.3f} rad it is "
    )
    note += f"{differences.min():.1e} rad, the least: a planner's start is not exactly the extremal's"
    return [beside(TABLE, simulation.masses, name, "start moved for the paper's mean |Δq|", "rad", moved, note)]
