"""Planted faults by name: the kind of run, what is changed in it, and the subject of the check that must fail."""

from __future__ import annotations

from collections.abc import Callable

from studies.benchmarks.reliability.verifier import changes
from studies.benchmarks.reliability.verifier.editing import Edited

FAULTS: dict[str, tuple[str, Callable[[Edited], None], str]] = {
    "a joint off by 1e-6": ("search", changes.shift_joint, "tracking at samples"),
    "a posture moved along the self-motion by 1e-6": (
        "search",
        changes.slide_along_the_self_motion,
        "objective torque_norm",
    ),
    "columns swapped": ("search", changes.swap_columns, "tracking at samples"),
    "names of joints swapped": ("search", changes.swap_names, "joint names"),
    "a joint of another name": ("search", changes.rename_joint, "joint names"),
    "times that go back": ("search", changes.turn_times_back, "times"),
    "times stretched": ("search", changes.stretch_times, "times of the path"),
    "a time shifted": ("search", changes.shift_one_time, "times of the path"),
    "a motion reversed": ("search", changes.reverse_motion, "tracking at samples"),
    "not a number": ("search", changes.not_a_number, "finite motions"),
    "motions exchanged": ("search", changes.exchange_motions, "objective kinetic_energy"),
    "a motion missing": ("search", changes.leave_out_a_motion, "ids"),
    "an objective edited": ("search", changes.edit_objective, "objective kinetic_energy"),
    "objectives improved": ("search", changes.improve_all_objectives, "objective torque_norm"),
    "objectives swapped": ("search", changes.swap_objectives, "objective kinetic_energy"),
    "a user's objective edited": ("obstacles", changes.edit_users_objective, "objective wrist_effort"),
    "a maximised objective edited": ("obstacles", changes.edit_maximised_objective, "objective obstacle_clearance"),
    "an id twice": ("search", changes.repeat_id, "ids"),
    "a dominated point": ("search", changes.add_dominated_point, "non-domination"),
    "another number of points": ("search", changes.count_other_points, "ids"),
    "another unit": ("search", changes.rename_unit, "objectives' names"),
    "another sense": ("search", changes.turn_maximised, "objectives' names"),
    "another name": ("search", changes.rename_objective, "objectives' names"),
    "a range turned": ("search", changes.turn_range, "ranges"),
    "another fingerprint": ("search", changes.another_problem, "problem"),
    "another violation": ("search", changes.admit_violation, "violation in the table"),
    "a certificate of another motion": ("certified", changes.deny_criticality, "criticality by differences"),
    "weights swapped": ("certified", changes.swap_weights, "weights by differences"),
    "an exchange rate edited": ("certified", changes.edit_rate, "exchange rates"),
    "an interval without its rate": ("certified", changes.leave_interval, "exchange intervals"),
    "a negative weight": ("certified", changes.make_weights_negative, "weights"),
    "a status that is none": ("certified", changes.invent_status, "certificates"),
    "a cycle opened": ("certified cyclic", changes.open_the_cycle, "closure"),
    "an optimum edited": ("plan", changes.edit_optimum, "objective kinetic_energy"),
    "the best optimum last": ("plan", changes.add_a_better_optimum_last, "order of optima"),
    "an error of a loop edited": ("closed loop", changes.edit_loop_error, "position_error of the loop"),
    "a drift of a loop edited": ("closed loop", changes.edit_loop_drift, "drift of the loop"),
    "a jump in a loop": ("closed loop", changes.jump_in_a_loop, "length of steps"),
    "a speed that no motor has": ("directional maxima", changes.boast_of_speed, "objective speed_1"),
    "a posture off its position": ("directional maxima", changes.move_a_posture, "position of the tool"),
    "a motion too fast for its motors": ("point to point", changes.hurry, "motors"),
    "a duration edited": ("point to point", changes.shorten_duration, "objective duration"),
    "an energy edited": ("point to point", changes.save_energy, "objective energy"),
    "a target missed": ("point to point", changes.miss_the_target, "ends"),
    "a maximum edited": ("polygon", changes.boast_of_a_maximum, "values"),
    "maxima missing": ("polygon", changes.take_maxima_away, "files"),
    "an error hidden": ("resolved", changes.hide_the_error, "largest error"),
    "a resolved motion off its path": ("resolved", changes.leave_the_path, "tracking"),
}
