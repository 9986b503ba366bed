"""Every tolerance of the verifier: three times of it is caught, a third is not.

The accepted values are written here a second time, so that a tolerance that is widened tenfold fails.
"""

from __future__ import annotations

import copy
import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import paretoik as pk
from paretoik.formulations.protocol import at_samples_of
from paretoik.robot.kinematics import jacobian
from paretoik.verification.run_contents import RunContents, read_contents
from paretoik.verification.tolerances import VerificationTolerances
from paretoik.verification.verify_run import verify_run
from studies.benchmarks.reliability.good_runs import ARM, BOTH

LINE = pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=31)


@pytest.fixture(scope="module")
def certified(tmp_path_factory):
    """Return the contents of a small certified front, one point of it, and its problem."""
    problem = tracking(3.0)
    folder = tmp_path_factory.mktemp("certified") / "run"
    pk.epsilon_front(problem, points=3, starts=2, out=folder, observe=False)
    return second_point(read_contents(folder)), problem


def second_point(run: RunContents) -> RunContents:
    table = {name: values[1:2].copy() for name, values in run.table.items()}
    motions = {name: values if name == "joint_names" else values[1:2] for name, values in run.motions.items()}
    entries = {**run.entries, "points": 1}
    return dataclasses.replace(run, entries=entries, table=table, arrays={"motions.npz": motions})


def tracking(velocity: float) -> pk.Tracking:
    limits = pk.Limits(position=2.5, velocity=velocity)
    return pk.Tracking(ARM, LINE, objectives=BOTH, limits=limits, coefficients=4, bases=2)


def with_upper_position_limit(problem, q: np.ndarray, amount: float):
    """Return a problem that a motion (time, dof) violates by a share of the range of one joint's position limit."""
    joint = int(np.argmax(q.max(axis=0)))
    bounds = np.tile([-np.inf, np.inf], (1, q.shape[1], 1))
    bounds[0, joint] = -2.5, (q.max() - 2.5 * amount) / (1.0 + amount)
    task = dataclasses.replace(problem.task, bounds={"position": bounds})
    return SimpleNamespace(task=task, encoding=problem.encoding)


def deviation(run: RunContents, problem, subject: str) -> float:
    return next(row.deviation for row in verify_run(run, problem).rows if row.subject == subject)


# Each function makes a run wrong by an amount and returns its problem.


def shift_a_time(run, problem, amount):
    run.motions["time"][0, 4] += amount * run.motions["time"][0, -1]
    return problem


def leave_the_path(run, problem, amount):
    q = run.motions["q"][0, 5]
    length = sum(np.linalg.norm(pose.position) for pose in (*ARM.placements[1:], ARM.tool))
    q += np.linalg.pinv(jacobian(ARM, q)[:2]) @ [amount * length, 0.0]
    return problem


def exceed_a_limit(run, problem, amount):
    return with_upper_position_limit(problem, problem.task.motion(run.motions["q"][0]).instants.q, amount)


def exceed_a_limit_between(run, problem, amount):
    dense = np.linspace(0.0, run.motions["time"][0, -1], 2001)
    return with_upper_position_limit(problem, problem.task.motion(run.motions["q"][0]).at(dense), amount)


def admit_less_between(run, problem, amount):
    run.table["violation_between"][:] = 0.0
    return exceed_a_limit_between(run, problem, amount)


def edit_a_value(run, problem, amount):
    low, high = run.entries["objectives"][0]["range"]
    run.table["kinetic_energy"] += amount * max(run.table["kinetic_energy"][0], high - low)
    return problem


def vary_between_instants(run, problem, amount):
    """Return the problem with an objective whose value at the instants is too large by a share of it."""
    instants = problem.task.instants[1]

    @pk.objective(unit="J", form="integral", name="kinetic_energy")
    def varying(motion):
        return 1.0 + amount / (1.0 - amount) * np.cos(2 * np.pi * motion.time / instants)

    task = dataclasses.replace(problem.task, objectives=(varying, *problem.task.objectives[1:]))
    return SimpleNamespace(task=task, encoding=problem.encoding)


def edit_a_discretisation_error(run, problem, amount):
    low, high = run.entries["objectives"][0]["range"]
    size = max(run.table["kinetic_energy"][0], high - low)
    run.table["discretisation error of kinetic_energy"] += amount * size
    return problem


def edit_a_value_of_a_loop(run, problem, amount):
    run.table["joint_displacement"] *= 1 + amount
    return problem


def edit_an_error(run, problem, amount):
    run.entries["largest_error"] += amount
    return problem


def stretch_directions(run, problem, amount):
    run.arrays["polygon.npz"]["directions"] *= 1 + amount
    return problem


def boast_of_a_maximum(run, problem, amount):
    run.arrays["polygon.npz"]["values"] *= 1 + amount
    return problem


def bend_along_the_self_motion(run, problem, amount):
    """Move a motion along its self-motion until all objectives could gain by an amount."""
    good, time, task = run.motions["q"][0].copy(), run.motions["time"][0], problem.task

    def bend(size):
        moved = good + size * np.sin(np.pi * time / time[-1])[:, None] ** 2 * [1.0, -1.0, 0.5]
        run.motions["q"][0] = [onto_path(q, target) for q, target in zip(moved, task.targets, strict=True)]

    bend(1e-6)
    bend(1e-6 * amount / deviation(run, problem, "criticality by differences"))
    return problem


def onto_path(q: np.ndarray, target: np.ndarray) -> np.ndarray:
    for _ in range(8):
        q = q + np.linalg.pinv(jacobian(ARM, q)[:2]) @ (target[:2] - ARM.pose(q).position[:2])
    return q


def shift_weights(run, problem, amount):
    """Shift weights until the steepest objective's gain, times the amount, is that of the weighted sum."""
    subject = "weights by differences"
    good = run.motions["weights"].copy()
    run.motions["weights"] = good + np.array([[0.1, -0.1]])
    row = next(each for each in verify_run(run, problem).rows if each.subject == subject)
    steepest = row.tolerance / VerificationTolerances().weights
    run.motions["weights"] = good + np.array([[0.1, -0.1]]) * amount * steepest / row.deviation
    return problem


def edit_a_rate(run, problem, amount):
    run.motions["exchange_rates"][0, 0, 1] *= 1 + amount
    return problem


def scale_weights(run, problem, amount):
    run.motions["weights"] *= 1 + amount
    return problem


def loosen_the_active_limit(run, problem, amount):
    """Return the problem whose velocity limit is farther away by a share of its range."""
    return tracking(3.0 / (1 - 2 * amount))


def leave_out_a_short_step(run, problem, amount):
    """Make one step of a motion short, and leave it out of the duration."""
    time = run.motions["time"][0]
    time[6:] -= time[6] - time[5] - amount
    run.table["duration"][0] = time[-1] - time[0] - amount
    return problem


CASES = {
    "times": (1e-9, "certified", shift_a_time, "times of the path"),
    "on_path": (1e-9, "certified", leave_the_path, "tracking at samples"),
    "limits": (1e-8, "certified", exceed_a_limit, "position limits"),
    "between": (1e-6, "certified", exceed_a_limit_between, "limits between samples"),
    "stated": (1e-6, "certified", admit_less_between, "violation_between in the table"),
    "values": (1e-9, "certified", edit_a_value, "objective kinetic_energy"),
    "resolved": (1.1e-3, "certified", vary_between_instants, "error of kinetic_energy"),
    "error": (1e-4, "certified", edit_a_discretisation_error, "error of kinetic_energy in the table"),
    "energies": (1e-8, "closed loop", edit_a_value_of_a_loop, "objective joint_displacement"),
    "traces": (1e-15, "resolved", edit_an_error, "largest error"),
    "directions": (1e-12, "polygon", stretch_directions, "directions"),
    "maxima": (1e-6, "polygon", boast_of_a_maximum, "values"),
    "criticality": (1e-5, "certified cyclic", bend_along_the_self_motion, "criticality by differences"),
    "weights": (1e-2, "certified", shift_weights, "weights by differences"),
    "rates": (1e-6, "certified", edit_a_rate, "exchange rates"),
    "sums": (1e-6, "certified", scale_weights, "weights"),
    "tightened": (1e-2, "certified", loosen_the_active_limit, "criticality by differences"),
    "rest": (1e-6, "point to point", leave_out_a_short_step, "objective duration"),
}
"""By tolerance: its value, the kind of run, the function that makes it wrong by an amount, and the failing check."""


@pytest.mark.parametrize("name", [each.name for each in dataclasses.fields(VerificationTolerances)])
def test_three_times_a_tolerance_is_caught_and_a_third_of_it_is_not(request, good_run, name):
    value, kind, falsify, subject = CASES[name]
    if kind == "certified":
        good, problem = request.getfixturevalue("certified")  # made only if needed
    else:
        folder, _, problem = good_run(kind)
        good = read_contents(folder)
        good = second_point(good) if kind == "certified cyclic" else good
        problem = at_samples_of(problem, good.motions.get("q"))
    for factor in (0.0, 0.3, 3.0):
        run = copy.deepcopy(good)
        other = falsify(run, problem, factor * value) if factor else problem
        failed = {row.subject for row in verify_run(run, other).failures}
        assert (subject in failed) == (factor > 1), f"{factor:g} times {name}"
        assert factor or not failed
