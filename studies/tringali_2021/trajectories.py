"""The four trajectories, by looking ahead, by least-squares velocities, and globally; reasons for differences."""

from __future__ import annotations

import timeit
from dataclasses import dataclass
from functools import partial

import numpy as np

import paretoik as pk
from paretoik.robot.dynamics import inertia_matrix
from paretoik.trajectory.grid_oracle import grid_oracle
from problems import tringali_2021
from problems.tringali_2021 import START
from studies.reporting import Row, paper_numbers

AGREES = 0.01  # of a number: smaller errors are due to fitted masses and printed digits
EXPONENT = (
    "printed with e-3, read as e-4: else it would take as much as trajectory 3, a line four times as long in the same "
    "time"
)
PRINTED = "the masses of Table 1 as printed: the paper cannot have used them"
UNKNOWN = "no reason is known"
OTHERWISE = f"{UNKNOWN}: its greatest speeds agree, and no other reading of the paper that is tried below gives it"
OTHER_MINIMUM = (
    "the window at 5 s has several minima: from the posture held SLSQP ends in another, and then this agrees (other "
    "readings, below)"
)
REASONS = {
    ("trajectory 1", "joint 1 PMKE"): "half of its last printed digit is 2.9 %",
    ("trajectory 2", "PMKE"): OTHERWISE,
    ("trajectory 2", "joint 1 PMKE"): f"{UNKNOWN}; half of it with the tracking error fed back (other readings, below)",
    ("trajectory 2", "joint 1 LSV"): f"{UNKNOWN}, and no mass enters it: joint 3 and the energy agree, and no other "
    "circle gives all three (below)",
    ("trajectory 3", "PMKE"): OTHERWISE,
    ("trajectory 3", "LSV"): "at the singularity it depends on the time steps",
    ("trajectory 4", "joint 1 PMKE"): OTHER_MINIMUM,
    ("trajectory 4", "least spectral radius PMKE"): OTHER_MINIMUM,
    ("trajectory 4", "its time PMKE"): OTHER_MINIMUM,
    ("trajectory 4", "global"): "the paper's is a local optimum; a bound on all motions is near ours",
}


def reason(row: str, column: str, masses: str, difference: float) -> str:
    """Return why the number of a row and column differs from the paper's by a share."""
    method, energy = column.split()[-1], " " not in column
    notes = [EXPONENT] if energy and row == "trajectory 1" else []
    if abs(difference) <= AGREES:
        notes.append("the same within 1 %")
    else:
        weighed = energy or method != "LSV" or "radius" in column  # speeds of least squares do not depend on masses
        notes += [PRINTED] if masses == "printed" and weighed else []
        explained = (row, column) in REASONS and not (method == "PMKE" and masses == "printed")
        notes += [REASONS[row, column]] if explained else []
        if not notes or notes == [EXPONENT]:
            notes.append(UNKNOWN)
    return "; ".join(notes)


MASSES = ("fitted", "printed")
NUMBERS = (1, 2, 3, 4)
NEAR = 0.02  # of an energy: the paper's optimum and ours are the same
FAST = 2.0  # rad/s: a motion this slow that has a faster joint has met a singularity
FORWARD = ("trajectory 2", "trajectory 3")
REPEATS = 3  # the quickest counts: a machine may be busy
METHODS = ("PMKE", "LSV", "global")
paper = partial(paper_numbers, "tringali_2021")


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """A trajectory of Table 4 and the arm of these masses: the motion of every method, and all ``optima`` [J s].

    ``seconds`` are those of looking ahead, the whole motion.
    """

    number: int
    masses: str
    motions: dict[str, pk.Motion]
    optima: tuple[float, ...]
    seconds: float

    @property
    def name(self) -> str:
        """Name in the rows."""
        return f"trajectory {self.number}"


def arm_of(masses: str) -> pk.Arm:
    """Return the arm with "printed" or "fitted" masses."""
    return pk.arms.tringali_3r(masses="fitted" if masses == "fitted" else "printed")


def resolve_trajectory(number: int, masses: str, *, starts: int, samples: int = tringali_2021.SAMPLES) -> Trajectory:
    """Resolve a trajectory by all methods; ``starts`` are those of the global one."""
    arm, path = arm_of(masses), tringali_2021.trajectory(number, samples)
    plan = pk.plan(tringali_2021.problem(number, arm, samples), starts=starts)
    look_ahead = partial(pk.resolve, arm, path, pk.methods.PredictiveKineticEnergy(), start=START, unreachable="track")
    motions: dict[str, pk.Motion] = {
        "PMKE": look_ahead(),  # compiles
        "LSV": pk.resolve(arm, path, pk.methods.LeastSquaresVelocity(), start=START, unreachable="track"),
        "global": plan.best.motion,
    }
    optima = tuple(optimum.objective for optimum in plan.optima)
    seconds = min(timeit.repeat(look_ahead, number=1, repeat=REPEATS))
    return Trajectory(number=number, masses=masses, motions=motions, optima=optima, seconds=seconds)


def table_5(trajectory: Trajectory) -> list[Row]:
    """Return kinetic energy integrals with relative differences from the paper and looking ahead, and its time."""
    energies = {name: float(pk.kinetic_energy(motion)) for name, motion in trajectory.motions.items()}
    rows = []
    for name in METHODS:
        energy, printed = energies[name], paper()["Table 5", trajectory.name, name]
        notes = [f"{100 * (energy / printed - 1):+.2f} %"]
        notes.append(reason(trajectory.name, name, trajectory.masses, energy / printed - 1))
        if name != "PMKE":
            theirs = printed / paper()["Table 5", trajectory.name, "PMKE"]
            notes.append(
                f"against PMKE {100 * (energy / energies['PMKE'] - 1):+.1f} %, the paper {100 * (theirs - 1):+.1f} %"
            )
        nearest = min(trajectory.optima, key=lambda other: abs(other - printed))
        if name == "global" and nearest > trajectory.optima[0] and abs(nearest / printed - 1) < NEAR:
            notes.append(
                f"of our {len(trajectory.optima)} optima one of {nearest:.4g} is nearest to the paper's, "
                f"{100 * (nearest / printed - 1):+.2f} %: not the best"
            )
        fastest = float(np.abs(trajectory.motions[name].dq).max())
        if name == "LSV" and fastest > FAST:
            notes.append(f"meets a singularity: a joint at {fastest:.2g} rad/s")
        title = f"Table 5, {trajectory.masses} masses"
        rows.append(Row(title, trajectory.name, name, "J s", energy, reference=printed, note="; ".join(notes)))
    note = f"the whole motion, quickest of {REPEATS}; theirs: C and Matlab, Intel i7 of the ninth generation"
    reference = paper()["Table 5", trajectory.name, "PMKE time"]
    table = f"Table 5, {trajectory.masses} masses"
    rows.append(Row(table, trajectory.name, "PMKE time", "s", trajectory.seconds, reference=reference, note=note))
    return rows


def lower_bound_row(number: int, masses: str, *, samples: int = 201) -> Row:
    """Return a bound on all motions, by the grid oracle, and the best planned value."""
    problem = tringali_2021.problem(number, arm_of(masses), samples)
    oracle, best = grid_oracle(problem.task), pk.plan(problem).best.objective
    note = f"{samples} samples; the best planned, {best:.4g}, is within {1 - oracle.lower_bound / best:.1%} of it"
    reference = paper()["Table 5", f"trajectory {number}", "global"]
    table = f"Table 5, {masses} masses"
    return Row(
        table, f"trajectory {number}", "bound from below", "J s", oracle.lower_bound, reference=reference, note=note
    )


def text_rows(trajectory: Trajectory) -> list[Row]:
    """Return the greatest joint speeds and the least spectral radii of the text."""
    rows = []
    for (table, row, column), printed in paper().items():
        if row != trajectory.name or table == "Table 5":
            continue
        ours = text_number(trajectory.motions[column.split()[-1]], table, row, column)
        difference = ours / printed - 1
        note = f"{100 * difference:+.1f} %; {reason(row, column, trajectory.masses, difference)}"
        unit = {"Figure 8": "s" if column.startswith("its") else "kg m²"}.get(table, "rad/s")
        rows.append(Row(f"{table}, {trajectory.masses} masses", row, column, unit, ours, reference=printed, note=note))
    if any(table == "Figure 8" and row == trajectory.name for table, row, _ in paper()):
        # the paper: PMKE's spectral radius is "always lower" than LSV's
        ahead, local = (spectral_radius(trajectory.motions[name]) for name in ("PMKE", "LSV"))
        above = ahead[1:] >= local[1:]  # both start from the same posture
        times = trajectory.motions["PMKE"].time[1:][above]
        note = f"of {len(above)}; " + (f"from {times[0]:.2f} to {times[-1]:.2f} s" if len(times) else "as in the paper")
        place = f"Figure 8, {trajectory.masses} masses", trajectory.name, "samples at which PMKE is not below LSV", ""
        rows.append(Row(*place, int(above.sum()), reference=0, note=note))
    return rows


def text_number(motion: pk.Motion, table: str, row: str, column: str) -> float:
    """Return the text's number of a motion: a joint's greatest speed [rad/s], or a minimum of Figure 8 or its time.

    Speeds are read as those before a singularity, along ``FORWARD`` trajectories as the forward ones. Only with this
    reading does joint 2 along trajectory 3 agree, which runs backward at many times the printed speed.
    """
    if table == "Figure 8":
        radii = spectral_radius(motion)
        return float(motion.time[np.argmin(radii)] if column.startswith("its time") else radii.min())
    slow = np.logical_and.accumulate((np.abs(motion.dq) <= FAST).all(axis=1))
    speeds = motion.dq[slow, int(column.split()[1]) - 1]
    return float((speeds if row in FORWARD else np.abs(speeds)).max())


def spectral_radius(motion: pk.Motion) -> np.ndarray:
    """Return the largest eigenvalue of the inertia matrix (time,) (Eq. 6)."""
    return np.asarray(np.linalg.eigvalsh(inertia_matrix(motion.arm, motion.q))[..., -1])


def schedule_rows(number: int, masses: str, *, starts: int, generations: int, samples: int = 201) -> list[Row]:
    """Return the result of a search for the schedule of predictions, the paper's schedule, and the global optimum."""
    arm, path = arm_of(masses), tringali_2021.trajectory(number, samples)
    optimum = pk.plan(tringali_2021.problem(number, arm, samples), starts=starts).best.motion
    problem = tringali_2021.schedule_along(number, optimum=optimum, arm=arm, samples=samples)
    front = pk.solve(problem, population=40, generations=generations, seed=0)
    lowest = float(pk.kinetic_energy(optimum))
    looking_ahead = pk.resolve(arm, path, pk.methods.PredictiveKineticEnergy(), start=START, unreachable="track")
    paper_schedule = float(pk.kinetic_energy(looking_ahead))
    assert front.genes is not None
    best = problem.method(front.genes[:1])
    assert isinstance(best, pk.methods.PredictiveKineticEnergy)
    step, again = (np.atleast_1d(np.asarray(each))[0] for each in (best.prediction_step, best.update_interval))
    least, looked = front.objectives[0, :2]
    note = f"reference: the paper's schedule; {100 * (least / lowest - 1):+.1f} % and "
    note += (
        f"{100 * (paper_schedule / lowest - 1):+.1f} % from the global optimum; h = {np.atleast_1d(best.horizon)[0]}, "
    )
    note += f"ΔT = {step:.2g} s, every {again:.2g} s, terminal {np.atleast_1d(best.terminal)[0]:.2g}; "
    note += f"{looked:.0f} samples looked at an update; {len(front)} points"
    table, row = f"the schedule searched for, {samples} samples, {masses} masses", f"trajectory {number}"
    source, column = "the paper's schedule, ours", "least kinetic energy"
    return [Row(table, row, column, "J s", float(least), reference=paper_schedule, source=source, note=note)]
