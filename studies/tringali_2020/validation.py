"""The calculus of variations beside the planner: Table 4, from the optima of simulation 1."""

from __future__ import annotations

import numpy as np

import paretoik as pk
from paretoik.redundancy.variational import variational
from paretoik.refinement.multistart import Optimum
from studies.reporting import Row
from studies.tringali_2020.reported import beside, paper
from studies.tringali_2020.simulations import Simulation, best_of_label

TABLE = "Table 4"


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


def table_4(simulation: Simulation, names: dict[str, str], finer: Simulation | None = None) -> list[Row]:
    """Return the rows of one arm: the optima that the paper has (``names`` by their bends), then those it has not.

    With the same simulation at more samples, also how near the two methods come there.
    """
    ordered = sorted(simulation.plan.optima, key=lambda o: (names.get(o.label, "~"), o.objective))
    rows, named, more = [], dict(names), 0
    integrated, signed = ([_nedungadi(simulation, o, as_printed=s) for o in ordered] for s in (False, True))
    for optimum, (motion, whole), (wrong, _) in zip(ordered, integrated, signed, strict=True):
        name = named.pop(optimum.label, None)
        if name is None:
            more += 1
            name = f"further optimum {more}"
        rows += _optimum_rows(simulation, name, optimum, motion, whole)
        note = f"{float(pk.kinetic_energy(wrong) / pk.kinetic_energy(motion)):.2f} times the energy: no optimum"
        rows.append(_row(simulation, name, "Nedungadi, sign as printed", "J s", float(pk.kinetic_energy(wrong)), note))
        same = best_of_label(finer, optimum.label) if finer is not None else None
        if finer is not None and same is not None:
            samples = len(finer.problem.task.times)
            apart = float(np.abs(same.motion.q - _nedungadi(finer, same)[0].q).mean())
            column, note = f"mean |Δq|, {samples} samples", "falls with the step: the difference is discretisation"
            rows.append(_row(simulation, name, column, "rad", apart, note))
    return rows


def _optimum_rows(simulation: Simulation, name: str, optimum: Optimum, motion: pk.Motion, whole: float) -> list[Row]:
    apart = np.abs(optimum.motion.q - motion.q)
    bends = f"bends {optimum.label}" if name.startswith("optimum") else f"bends {optimum.label}; not in the paper"
    matched_by = "; matched by nearest energy" if name.startswith("optimum") and simulation.masses == "fitted" else ""
    sampled = f"same sum as the planner's; {whole:.5f} in continuous time"
    return [
        _row(simulation, name, "Nedungadi", "J s", float(pk.kinetic_energy(motion)), sampled),
        _row(simulation, name, "planner", "J s", optimum.objective, bends + matched_by),
        _row(simulation, name, "mean |Δq|", "rad", float(apart.mean()), f"largest {apart.max():.2g} rad"),
    ]


def _row(simulation: Simulation, name: str, column: str, unit: str, ours: float, note: str) -> Row:
    return beside(TABLE, simulation.masses, name, column, unit, ours, note)


def _nedungadi(simulation: Simulation, optimum: Optimum, *, as_printed: bool = False) -> tuple[pk.Motion, float]:
    """Return the motion of Eq. 20 from where an optimum starts, and its energy in continuous time."""
    found = variational(simulation.problem.task, optimum.motion.q[0], as_printed=as_printed)
    return found.motion, float(found.energy)
