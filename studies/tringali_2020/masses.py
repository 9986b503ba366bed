"""Masses that reproduce the paper's energies and torques: ``python -m studies.tringali_2020.masses [--json FILE]``.

The three masses are fitted, in least squares of relative errors, to the numbers whose motion is determined: minimised
ones, and those of the motion of least energy. ``pk.arms.tringali_3r("fitted")`` has masses of an earlier fit to fewer
numbers. Both are inferences, not in the paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares

import paretoik as pk
from paretoik.robot.arms import TRINGALI_MASSES
from studies.reporting import Row, report, study_parser, tell
from studies.tringali_2020.simulations import as_printed, paper, with_arm
from studies.tringali_2020.validation import PAPERS_OPTIMA

FITTED = (1, 2, 3, 5)  # simulations; with some masses simulation 4 has no motion within its torque limits
STEP = 0.01  # of a mass, for finite differences
NEAR = 0.5  # rad: greatest distance of a joint from the last motion when an optimum is followed
STORED = "tringali_3r(masses='fitted')"
PLACES = [
    *(("Table 4", name, "planner") for name in PAPERS_OPTIMA),
    *(("Table 5", f"simulation {k}", "torque norm") for k in (1, 2, 3)),
    ("Table 5", "simulation 2", "kinetic energy"),
    ("Section 4.2", "simulation 1", "peak torque of joint 1"),
    ("Table 6", "simulation 5", "kinetic energy"),
    ("Table 6", "simulation 5", "torque norm"),
    ("Table 6", "simulation 5", "peak torque"),
    ("Table 6", "simulation 5", "peak power"),
]


@dataclass(eq=False)
class Prototype:
    """The paper's arm with any masses; its optima are followed from those of the last masses."""

    starts: int
    former: dict[str, pk.Motion] = field(default_factory=dict)

    def numbers(self, masses: np.ndarray) -> np.ndarray:
        """Return the numbers of ``PLACES`` for masses [kg]."""
        motions = self._optima(arm_with(masses))
        values = {("Table 4", name, "planner"): float(pk.kinetic_energy(motions[name])) for name in PAPERS_OPTIMA}
        for k in FITTED:
            row, table = f"simulation {k}", "Table 6" if k == 5 else "Table 5"
            values[table, row, "kinetic energy"] = float(pk.kinetic_energy(motions[row]))
            values[table, row, "torque norm"] = float(pk.torque_norm(motions[row]))
        torque = np.abs(motions["simulation 1"].torque[:, 0]).max()
        values["Section 4.2", "simulation 1", "peak torque of joint 1"] = float(torque)
        for column, series in (("torque", motions["simulation 5"].torque), ("power", motions["simulation 5"].power)):
            values["Table 6", "simulation 5", f"peak {column}"] = float(np.abs(series).max())
        return np.array([values[place] for place in PLACES])

    def _optima(self, arm: pk.Arm) -> dict[str, pk.Motion]:
        """Return the motions of the simulations, and of the three optima of Table 4, near those of the last call."""
        motions = {}
        for k in FITTED:
            problem, row = with_arm(as_printed(f"simulation_{k}"), arm), f"simulation {k}"
            names = [row, *PAPERS_OPTIMA] if k == 1 else [row]
            if row not in self.former:
                plan = pk.plan(problem, starts=self.starts, observe=False)
                motions[row] = plan.best.motion
                motions |= {name: plan.optima[at].motion for name, at in _match(plan) if k == 1}
                continue
            for name in names:
                initial = problem.task.motion(self.former[name].q[None])
                plan = pk.plan(problem, starts=1, initial=initial, observe=False)
                distances = [np.abs(one.motion.q - self.former[name].q).max() for one in plan.optima]
                near = int(np.argmin(distances))
                assert distances[near] < NEAR, f"{name} was lost, {distances[near]:.3g} rad away"
                motions[name] = plan.optima[near].motion
        self.former = self.former or motions
        return motions


def _match(plan: pk.Plan) -> list[tuple[str, int]]:
    """Return the paper's three optima with the indices of ours: the best, and the next nearest in energy."""
    energies = np.array([one.objective for one in plan.optima]) / plan.best.objective
    printed = np.array([paper()["Table 4", name, "planner"] for name in PAPERS_OPTIMA])
    return [
        (name, int(np.abs(energies - ratio).argmin()))
        for name, ratio in zip(PAPERS_OPTIMA, printed / printed[0], strict=True)
    ]


def arm_with(masses: np.ndarray) -> pk.Arm:
    """Return the arm of Table 1 with other masses [kg]."""
    bodies = pk.arms.tringali_3r().bodies
    return pk.Arm.planar(
        lengths=[0.176, 0.176, 0.1375],
        masses=masses,
        centers=[float(body.center[0]) for body in bodies],
        inertias=[float(body.inertia[2, 2]) for body in bodies],
    )


def fitted_rows(*, starts: int = 24) -> list[Row]:
    """Return the masses [kg] that fit best with those of the library, and the errors of both for every number."""
    printed = np.array([paper()[place] for place in PLACES])
    prototype = Prototype(starts=starts)
    table = np.array(TRINGALI_MASSES["printed"])
    first = table * printed[0] / Prototype(starts=starts).numbers(table)[0]  # the energy is that of the paper

    def errors(masses: np.ndarray) -> np.ndarray:
        return prototype.numbers(masses) / printed - 1

    fit = least_squares(errors, first, bounds=(0.3 * first, 3 * first), x_scale=first, diff_step=STEP, xtol=1e-4)
    stored, title = TRINGALI_MASSES["fitted"], "masses that fit the paper's numbers best"
    rows = [
        Row(title, f"link {k}", "mass", "kg", float(mass), reference=ours, source=STORED, note=f"Table 1: {theirs} kg")
        for k, (mass, ours, theirs) in enumerate(zip(fit.x, stored, table.tolist(), strict=True), start=1)
    ]
    title, others = "errors that these masses leave of the paper's numbers", errors(np.array(stored))
    for (where, row, column), error, other in zip(PLACES, 100 * fit.fun, 100 * others, strict=True):
        place = title, f"{where}, {row}", column, "%"
        rows.append(Row(*place, float(error), reference=float(other), source=STORED))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Fit the masses and report them."""
    options = study_parser("Masses that reproduce the energies of Tringali & Cocuzza 2020.").parse_args(arguments)
    tell("masses")
    report(fitted_rows(), json_file=options.json)


if __name__ == "__main__":
    main()
