"""The five simulations with either arm, planned: Tables 5 and 6, the statements of section 4.2, the paper's numbers."""

from __future__ import annotations

import os
import platform
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np

import paretoik as pk
from problems import tringali_2020
from studies.reporting import Row, paper_numbers

paper = partial(paper_numbers, "tringali_2020")

AGREES = 0.01  # of a number: smaller errors are due to fitted masses, printed digits and time steps
LOW = "with the masses as printed, which the paper cannot have used"


def beside(table: str, masses: str, row: str, column: str, unit: str, ours: float, note: str = "") -> Row:
    """Return one number of the arm with these masses and the paper's; the note starts with the difference."""
    theirs, notes = paper().get((table, row, column)), [note]
    if theirs is not None and unit in ("J s", "N²m²s", "N m", "W", "rad/s", "m"):
        difference = ours / theirs - 1
        low = LOW if masses == "printed" and unit != "m" else ""
        notes = [f"{100 * difference:+.2f} %", "the same within 1 %" if abs(difference) < AGREES else low, note]
    return Row(
        f"{table}, {masses} masses", row, column, unit, ours, reference=theirs, note="; ".join(filter(None, notes))
    )


MASSES = ("fitted", "printed")
NUMBERS = (1, 2, 3, 4, 5)
AT_LIMIT = 1e-4  # share of a limit: a nearer value is at it
FREE = "not what is minimised: near that optimum it changes much for little, see Figure 14"
LENGTH = 0.40  # m, of the line in the text
THEIRS = "theirs: Intel i7 of the ninth generation, 6 cores, Matlab 2019b"


@dataclass(frozen=True, kw_only=True, eq=False)
class Simulation:
    """A simulation of Table 3 with the arm of these masses, its plan, and its seconds."""

    number: int
    masses: str
    problem: pk.Tracking
    plan: pk.Plan
    seconds: float

    @property
    def name(self) -> str:
        """Name in the rows."""
        return f"simulation {self.number}"

    @property
    def motion(self) -> pk.Motion:
        """The best motion found."""
        return self.plan.best.motion


def with_arm(
    problem: pk.Tracking, masses: str | pk.Arm, samples: int | None = None, path: pk.Path | None = None
) -> pk.Tracking:
    """Return the same problem for another arm, or "printed" or "fitted" masses, at other samples or along a path."""
    if masses == "printed" and samples is None and path is None:
        return problem
    if isinstance(masses, str):
        masses = pk.arms.tringali_3r(masses="fitted" if masses == "fitted" else "printed")
    task = problem.task if samples is None else problem.task.resample(samples)
    limits: dict[str, Any] = {kind: (bounds[0, :, 0], bounds[0, :, 1]) for kind, bounds in task.bounds.items()}
    return pk.Tracking(
        masses,
        path or task.tasks,
        objectives=task.objectives,
        limits=pk.Limits(**limits),
        cyclic=task.cyclic,
        coefficients=4,  # the least: plans and ε-constraints use no genes
        bases=1,
        differences="backward",
    )


@cache
def as_printed(name: str) -> pk.Tracking:
    """Return a problem of ``problems/tringali_2020.py`` by its name; its arm is that of Table 1."""
    problem: pk.Tracking = getattr(tringali_2020, name)()
    return problem


def simulate(
    number: int, masses: str, *, starts: int, samples: int | None = None, rehearsed: bool = True
) -> Simulation:
    """Return one simulation, planned; ``rehearsed``: a plan that compiles comes first, untimed."""
    problem = with_arm(as_printed(f"simulation_{number}"), masses, samples)
    if rehearsed:
        with suppress(pk.ParetoikError):  # a few starts may find nothing
            pk.plan(problem, starts=2)
    started = time.perf_counter()
    plan = pk.plan(problem, starts=starts)
    seconds = time.perf_counter() - started
    return Simulation(number=number, masses=masses, problem=problem, plan=plan, seconds=seconds)


def machine() -> str:
    """Return the computing machine in words."""
    return f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"


def tables(simulation: Simulation) -> list[Row]:
    """Return the rows of a simulation in Table 5 or 6: those of the paper, then its optima and limits."""
    table = "Table 6" if simulation.number == 5 else "Table 5"
    motion, plan, masses, name = simulation.motion, simulation.plan, simulation.masses, simulation.name
    goal = simulation.problem.task.objectives[0].name
    energy_note, torque_note = ("", FREE) if goal == "kinetic_energy" else (FREE, "")
    rows = [
        beside(table, masses, name, "kinetic energy", "J s", float(pk.kinetic_energy(motion)), energy_note),
        beside(table, masses, name, "torque norm", "N²m²s", float(pk.torque_norm(motion)), torque_note),
        beside(table, masses, name, "time", "s", simulation.seconds, f"ours: {machine()}; {THEIRS}"),
    ]
    if simulation.number == 5:
        torque, power = (float(np.abs(series).max()) for series in (motion.torque, motion.power))
        rows.append(beside(table, masses, name, "peak torque", "N m", torque))
        rows.append(beside(table, masses, name, "peak power", "W", power, "of one joint"))
    labels = ", ".join(f"{o.label} {o.objective:.5f}" for o in plan.optima)
    theirs = "; the paper shows three in its Table 4 and Figure 3" if simulation.number == 1 else ""
    note = f"bends and {goal}: {labels}{theirs}"
    rows.append(beside(table, masses, name, "distinct optima", "", len(plan.optima), note))
    if names := simulation.problem.task.limit_names:
        uses = 1 + 2 * simulation.problem.task.violations(motion)  # shares of each limit, which are all ±
        use = float(uses.max())
        which = ", ".join(limit for limit, each in zip(names, uses, strict=True) if each > use - AT_LIMIT)
        rows.append(beside(table, masses, name, "worst limit use", "", use, f"1 is all of it: {which}"))
    return rows


def line_rows(simulations: list[Simulation], *, starts: int) -> list[Row]:
    """Return the length of the line between its printed ends, and simulations 1 to 4 along exactly 0.40 m."""
    path = tringali_2020.straight(length=LENGTH)
    masses, printed = simulations[0].masses, float(np.linalg.norm(np.subtract(tringali_2020.END, tringali_2020.START)))
    rows = [beside("Section 3.2", masses, "line", "length", "m", printed, "between the printed ends, taken elsewhere")]
    for simulation in simulations[:4]:
        plan = pk.plan(with_arm(simulation.problem, masses, path=path), starts=starts)
        name = simulation.problem.task.objectives[0].name.replace("_", " ")
        longer = 100 * (plan.best.objective / simulation.plan.best.objective - 1)
        note = f"{longer:+.2f} % relative to the line between the printed ends"
        unit = simulation.problem.task.objectives[0].unit
        row = beside("Table 5", masses, simulation.name, name, unit, plan.best.objective, note)
        rows.append(replace(row, row=f"{simulation.name}, {LENGTH:.2f} m"))
    return rows


def motion_rows(simulations: list[Simulation]) -> list[Row]:
    """Return section 4.2's statements on the motions of the five simulations of one arm, in their order."""
    first, second, third, fourth, fifth = simulations
    masses, table = first.masses, "Section 4.2"
    speeds, torque = np.abs(first.motion.dq).max(axis=0), float(np.abs(first.motion.torque[:, 0]).max())
    rows = [
        beside(table, masses, first.name, f"peak speed of joint {j + 1}", "rad/s", float(speeds[j])) for j in range(3)
    ]
    rows.append(beside(table, masses, first.name, "peak torque of joint 1", "N m", torque))
    span = second.motion.time[at_limit(second, "velocity")[:, 2]]
    if len(span):
        column, note = "joint 3 at its velocity limit", "to a sample: a backward difference counts at its later one"
        rows.append(beside(table, masses, second.name, f"{column} from", "s", float(span[0]), note))
        rows.append(beside(table, masses, second.name, f"{column} until", "s", float(span[-1]), note))
    for what, objective in (("torque norm", pk.torque_norm), ("kinetic energy", pk.kinetic_energy)):
        more = 100 * float(objective(fourth.motion) / objective(third.motion) - 1)
        note = "the paper: a difference around 1 %; by its Table 5 0.4 % in torque norm, 1.6 % in energy"
        rows.append(beside(table, masses, fourth.name, f"{what} above simulation 3", "%", more, note))
    rows += _torque_and_power(fourth)
    together = int(at_limit(fifth, "velocity").sum(axis=1).max())
    rows.append(beside(table, masses, fifth.name, "joints at their velocity limit at once", "", together))
    return rows


def at_limit(simulation: Simulation, kind: str) -> np.ndarray:
    """Return whether each joint (time, dof) of the best motion is at its limit of a kind."""
    values = {"velocity": "dq", "torque": "torque", "power": "power"}[kind]
    upper = simulation.problem.task.bounds[kind][..., 1]
    return np.asarray(np.abs(getattr(simulation.motion, values)) >= (1 - AT_LIMIT) * upper)


def _torque_and_power(simulation: Simulation) -> list[Row]:
    rows, (table, masses, name) = [], ("Section 4.2", simulation.masses, simulation.name)
    torque, power = (at_limit(simulation, kind).any(axis=1) for kind in ("torque", "power"))
    for kind, reached in (("torque", torque), ("power", power)):
        values = np.abs(getattr(simulation.motion, kind))
        use = float((values / simulation.problem.task.bounds[kind][..., 1]).max())
        times = simulation.motion.time[reached]
        note = f"reached from {times[0]:.2f} s to {times[-1]:.2f} s" if len(times) else "never reached"
        rows.append(beside(table, masses, name, f"use of the {kind} limit", "", use, note))
    if torque.any() and power.any():
        first, last = float(simulation.motion.time[torque][0]), float(simulation.motion.time[power][-1])
        note = f"the paper: both are reached at once at 0.42 s; a sample is {simulation.motion.time[1]:.2g} s"
        rows.append(beside(table, masses, name, "torque at its limit from", "s", first, note))
        rows.append(beside(table, masses, name, "power at its limit until", "s", last, note))
    return rows
