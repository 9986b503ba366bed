"""Changes of a run's files that make it wrong."""

from __future__ import annotations

import numpy as np

import paretoik as pk
from paretoik.formulations.protocol import at_samples_of
from paretoik.robot.kinematics import jacobian
from studies.benchmarks.reliability.verifier.editing import Edited
from studies.benchmarks.reliability.verifier.good_runs import tracking


def shift_joint(run: Edited) -> None:
    run.motions["q"][0, 5, 1] += 1e-6


def slide_along_the_self_motion(run: Edited) -> None:
    arm, q = pk.arms.tringali_3r(), run.motions["q"][0, 5]
    rows = jacobian(arm, q)[:2]
    free = np.linalg.svd(rows)[2][-1]
    moved = q + 1e-6 * free  # the path is missed by only 1e-12
    run.motions["q"][0, 5] = moved


def swap_columns(run: Edited) -> None:
    run.motions["q"] = run.motions["q"][..., [1, 0, 2]]


def swap_names(run: Edited) -> None:
    run.motions["joint_names"] = run.motions["joint_names"][[1, 0, 2]]


def rename_joint(run: Edited) -> None:
    run.motions["joint_names"] = np.array(["joint1", "joint2", "wrist"])


def turn_times_back(run: Edited) -> None:
    run.motions["time"][0, [4, 5]] = run.motions["time"][0, [5, 4]]


def stretch_times(run: Edited) -> None:
    run.motions["time"] *= 1.001


def shift_one_time(run: Edited) -> None:
    run.motions["time"][0, 4] += 1e-4


def reverse_motion(run: Edited) -> None:
    run.motions["q"][0] = run.motions["q"][0, ::-1]


def not_a_number(run: Edited) -> None:
    run.motions["q"][0, 3, 0] = np.nan


def exchange_motions(run: Edited) -> None:
    run.motions["q"][[0, -1]] = run.motions["q"][[-1, 0]]


def leave_out_a_motion(run: Edited) -> None:
    for name in ("id", "q", "time", *(["genes"] if "genes" in run.motions else [])):
        run.motions[name] = run.motions[name][1:]


def edit_objective(run: Edited) -> None:
    run.table["kinetic_energy"][0] *= 1 - 1e-6


def improve_all_objectives(run: Edited) -> None:
    for name in ("kinetic_energy", "torque_norm"):
        run.table[name] = [0.9 * value for value in run.table[name]]


def swap_objectives(run: Edited) -> None:
    run.table["kinetic_energy"], run.table["torque_norm"] = run.table["torque_norm"], run.table["kinetic_energy"]


def edit_users_objective(run: Edited) -> None:
    run.table["wrist_effort"][-1] *= 1 + 1e-6


def edit_maximised_objective(run: Edited) -> None:
    run.table["obstacle_clearance"][-1] += 1e-6


def repeat_id(run: Edited) -> None:
    run.table["id"][1] = run.table["id"][0]
    run.motions["id"][1] = run.motions["id"][0]


def add_dominated_point(run: Edited) -> None:
    for name, values in run.table.items():
        values.append(values[0] if name != "id" else max(values) + 1)
    run.table["kinetic_energy"][-1] *= 1.01
    for name, array in run.motions.items():
        if name != "joint_names":
            run.motions[name] = np.concatenate([array, array[:1]])
    run.motions["id"][-1] = run.table["id"][-1]
    run.entries["points"] += 1


def count_other_points(run: Edited) -> None:
    run.entries["points"] += 1


def rename_unit(run: Edited) -> None:
    run.entries["objectives"][0]["unit"] = "J"


def turn_maximised(run: Edited) -> None:
    run.entries["objectives"][1]["maximised"] = True


def rename_objective(run: Edited) -> None:
    run.entries["objectives"][0]["name"] = "energy"
    run.table["energy"] = run.table.pop("kinetic_energy")


def turn_range(run: Edited) -> None:
    run.entries["objectives"][0]["range"].reverse()


def another_problem(run: Edited) -> None:
    run.entries["fingerprint"] = "0" * 64


def admit_violation(run: Edited) -> None:
    run.table["violation"][0] = 0.25


def deny_criticality(run: Edited) -> None:
    """Bend motions along the self-motion and compute their objectives again; certificates stay as they were."""
    problem = at_samples_of(tracking(), run.motions["q"])
    for row in range(len(run.motions["q"])):
        q = run.motions["q"][row]
        bumped = q + 0.05 * np.sin(np.linspace(0.0, np.pi, len(q)))[:, None] * np.array([1.0, -1.0, 0.5])
        motion = problem.task.motion(problem.task.motion(bumped).at(problem.task.times))
        run.motions["q"][row] = motion.q
        for objective in problem.task.objectives:
            run.table[objective.name][row] = float(objective(motion))
        for column in ("violation", "violation_between"):
            run.table[column][row] = max(float(problem.task.violations(motion).max()), 0.0)


def swap_weights(run: Edited) -> None:
    run.motions["weights"] = run.motions["weights"][:, ::-1].copy()
    rates = run.motions["exchange_rates"]
    weights = run.motions["weights"]
    for row in range(len(weights)):
        ratio = weights[row, 0] / weights[row, 1]
        former = weights[row, 1] / weights[row, 0]
        rates[row, 0, 1] *= ratio / former
        rates[row, 1, 0] *= former / ratio
        run.motions["exchange_intervals"][row, 0, 1] *= ratio / former
        run.motions["exchange_intervals"][row, 1, 0] *= former / ratio


def edit_rate(run: Edited) -> None:
    run.motions["exchange_rates"][1, 0, 1] *= 1.2
    run.motions["exchange_intervals"][1, 0, 1] *= 1.2


def leave_interval(run: Edited) -> None:
    run.motions["exchange_intervals"][1, 0, 1] *= 1.2


def make_weights_negative(run: Edited) -> None:
    run.motions["weights"][1] = [1.5, -0.5]


def invent_status(run: Edited) -> None:
    run.table["status"][0] = "global minimum"


def open_the_cycle(run: Edited) -> None:
    run.motions["q"][0, -1] += 2 * np.pi * np.array([1.0, 0.0, 0.0])


def edit_optimum(run: Edited) -> None:
    run.table["kinetic_energy"][0] *= 1 - 1e-6


def add_a_better_optimum_last(run: Edited) -> None:
    for values in run.table.values():
        values.append(values[-1])
    run.table["id"][-1] += 1
    run.table["kinetic_energy"][-1] = 0.9 * run.table["kinetic_energy"][0]
    for name, array in run.motions.items():
        if name != "joint_names":
            run.motions[name] = np.concatenate([array, array[-1:]])
    run.motions["id"][-1] = run.table["id"][-1]


def edit_loop_error(run: Edited) -> None:
    run.entries["position_error"] *= 0.5


def edit_loop_drift(run: Edited) -> None:
    run.entries["drift"] = 0.0


def jump_in_a_loop(run: Edited) -> None:
    run.motions["q"][0, 8] += 0.3


def boast_of_speed(run: Edited) -> None:
    run.table["speed_1"] = [1.1 * value for value in run.table["speed_1"]]


def move_a_posture(run: Edited) -> None:
    run.motions["q"][0] += 1e-6


def hurry(run: Edited) -> None:
    run.motions["time"] *= 0.9
    run.table["duration"] = [0.9 * value for value in run.table["duration"]]


def shorten_duration(run: Edited) -> None:
    run.table["duration"] = [0.99 * value for value in run.table["duration"]]


def save_energy(run: Edited) -> None:
    run.table["energy"] = [0.99 * value for value in run.table["energy"]]


def miss_the_target(run: Edited) -> None:
    run.motions["q"][0, -1, 0] += 1e-6


def boast_of_a_maximum(run: Edited) -> None:
    run.arrays["polygon.npz"]["values"] = 1.1 * run.arrays["polygon.npz"]["values"]


def hide_the_error(run: Edited) -> None:
    run.entries["largest_error"] = 0.0


def leave_the_path(run: Edited) -> None:
    run.motions["q"][0, 6, 0] += 0.1


def take_maxima_away(run: Edited) -> None:
    del run.arrays["polygon.npz"]["values"]


def boast_of_a_tuned_speed(run: Edited) -> None:
    run.table["speed_ratio"][0] *= 0.01


def boast_of_a_tuned_margin(run: Edited) -> None:
    run.table["limit_margin"][-1] += 0.6


def leave_the_path_tuned(run: Edited) -> None:
    run.motions["q"][0, 6, 0] += 0.3


def slow_down_on_paper(run: Edited) -> None:
    run.table["speed_ratio"][0] *= 1 + 1e-6


def begin_elsewhere(run: Edited) -> None:
    run.motions["q"][0, 0] += 1e-6
