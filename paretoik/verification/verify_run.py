"""All checks of a run, chosen by its contents; those of methods, loops and capabilities."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from scipy.interpolate import interp1d
from scipy.optimize import linprog

from paretoik.inputs import first_line
from paretoik.runs.executor import computed_text
from paretoik.stop_flag import check_interruption
from paretoik.verification.arm_model import ArmModel, build_model
from paretoik.verification.front_checks import check_certificate, check_tables
from paretoik.verification.limits import worst_joint
from paretoik.verification.measured_motion import MeasuredMotion, measure, nearest_pair
from paretoik.verification.motion_checks import (
    check_between,
    check_errors,
    check_limits,
    check_objectives,
    check_path,
    check_samples,
    finer_motion,
    least_clearance,
    project_curve,
)
from paretoik.verification.objectives import objective_size, objective_value
from paretoik.verification.path_targets import frame_errors, tracking_errors
from paretoik.verification.run_contents import Check, RunContents, Verification, Worst, demand, judge, leave_out
from paretoik.verification.tolerances import TOLERANCES

# All checks of a run, chosen by its contents.


Show: TypeAlias = Callable[[int, int], object]  # gets the number of checked points and of all points


def verify_run(
    run: RunContents, problem: Any, *, reason: str = "", same: bool | None = None, show: Show | None = None
) -> Verification:
    """Return the rows of all checks of a run, made or not.

    problem: problem that the run solved; None if motions are not checked against it
    reason: reason why they are not
    same: whether its fingerprint is the run's; None if that is unknown
    show: function that gets the progress
    """
    rows = [*run.checks]
    if words := computed_text(run.entries.get("computed")):
        rows.append(Check(subject="computed by", verdict="noted", detail=words))
    if same is not None:
        rows.append(demand("problem", same, "its fingerprint is not that of the problem that the run solved"))
    holds = str(run.entries.get("holds", ""))
    if "polygon.npz" in run.arrays:
        arm = None if problem is None else build_model(getattr(problem, "arm", problem))
        rows += _collect(check_polygon(run, arm, reason))
    elif "tool_path.npz" in run.arrays:
        rows += _collect(check_tool_path(run))
    elif "resolved" in holds:
        task = getattr(problem, "task", None)
        rows += _collect(check_resolution(run, task, None if task is None else build_model(task.arm), reason))
    else:
        rows += _collect(check_tables(run))
        sound = not any(row.verdict == "failed" for row in rows if row.subject in STRUCTURE)
        if not sound:
            rows.append(leave_out("motions", "the files do not match"))
        elif problem is None:
            rows.append(leave_out("motions against the problem", reason or "the problem is not given"))
        else:
            rows += _collect(_count_points(_check_motions(run, problem), len(run.ids), show))
    return Verification(folder=str(run.folder), rows=tuple(rows))


STRUCTURE = ("files", "shapes", "ids", "objectives' names", "finite motions", "times", "problem")


def _collect(checks: Iterator[Check]) -> list[Check]:
    """Return the rows of checks; if contents of files make one raise, the last row has its error."""
    rows = list[Check]()
    try:
        for each in checks:
            rows.append(each)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as fault:
        line = (str(fault).splitlines() or [""])[0]
        rows.append(demand("files", False, f"a check cannot use their contents: {type(fault).__name__}: {line}"))
    return rows


def _count_points(checks: Iterator[Check], total: int, show: Show | None) -> Iterator[Check]:
    """Yield checks, in order of points, and show how many points are done; may raise Interrupted."""
    seen = set[int]()
    for each in checks:
        check_interruption()
        yield each
        if show is not None and each.point is not None and each.point not in seen:
            show(len(seen), total)
            seen.add(each.point)
    if show is not None and seen:
        show(len(seen), total)


def _check_motions(run: RunContents, problem: Any) -> Iterator[Check]:
    task = getattr(problem, "task", None)
    arm = getattr(problem, "arm", None) if task is None else task.arm
    if "q" not in run.motions or arm is None:
        yield leave_out("objectives", "the problem has no arm or the run no motions")
        return
    stored, joints = [str(name) for name in run.motions["joint_names"]], list(arm.joint_names)
    wish = f"joints must be {', '.join(joints)}, got {', '.join(stored)}"
    yield demand("joint names", stored == joints, wish)
    if stored != joints:
        return
    model = build_model(arm)
    if run.entries.get("timeline") == "step":
        yield from check_loop(run, problem, model)
    elif hasattr(problem, "directions") and hasattr(problem, "position"):
        yield from check_standing(run, problem, model)
    elif hasattr(problem, "actuation") and hasattr(problem, "target"):
        yield from check_point_to_point(run, problem, model)
    elif task is not None and hasattr(problem, "judged_starts"):
        yield from check_tuning(run, problem, model)
    elif task is None or getattr(problem, "encoding", None) is None:
        yield leave_out("motions against the problem", f"{type(problem).__name__}: not a kind that the verifier models")
    else:  # motions that follow a path, those of a front or of a plan
        named = {each.name: each for each in task.objectives}
        listed = [(str(each["name"]), str(each["unit"]), bool(each["maximised"])) for each in run.objectives]
        objectives = [(each.name, each.unit, bool(each.maximise)) for each in task.objectives]
        yield demand(
            "objectives' names",
            listed == objectives,
            f"the problem has {_names(objectives)}, but run.json {_names(listed)}",
        )
        yield from check_path(task, model)
        for row, number in enumerate(run.ids.tolist()):
            time, q = (np.asarray(run.motions[name][row], dtype=float) for name in ("time", "q"))
            rows = list(check_samples(task, model, time, q, number))
            yield from rows
            if any(each.subject == "times of the path" and each.verdict == "failed" for each in rows):
                continue
            motion, curve = measure(model, task, time, q), project_curve(task, model, time, q)
            finer = finer_motion(task, model, curve, time)
            yield from check_limits(task, motion, _stated(run, "violation", row), number)
            promised = task.differences == "spline" and run.status(row) in ("minimum", "converged")
            stated = _stated(run, "violation_between", row)
            yield from check_between(motion, finer, curve, stated, number, promised=promised)
            if all(name in named for name, _, _ in listed):
                objectives = [named[name] for name, _, _ in listed]
                yield from check_objectives(run, objectives, motion, run.values[row], number)
                yield from check_errors(run, objectives, motion, finer, row, promised=promised)
                yield from check_certificate(run, task, model, objectives, row, time, q)


def _stated(run: RunContents, column: str, row: int) -> float | None:
    """Return the value of a column in the table; None without one."""
    if column not in run.table:
        return None
    value = float(run.table[column][row])
    return None if np.isnan(value) else value


def _names(listed: list[tuple[str, str, bool]]) -> str:
    return ", ".join(f"{name} [{unit}]{' maximised' if maximised else ''}" for name, unit, maximised in listed)


# Tuned methods: each point has one stored motion, which gives bounds for the values in the table.
#
# The table has the worst, or the mean, of motions from several starts; only the first of them is stored. The method
# is not run a second time, so the stored motion bounds a worst value from one side only.


MEASURES = "paretoik.resolution.measures"  # defines objectives of resolved motions


def check_tuning(run: RunContents, problem: Any, model: ArmModel) -> Iterator[Check]:
    """Check the stored motions of tuned methods: times, starts, tracking, and objectives as bounds."""
    task = problem.task
    listed = [str(each["name"]) for each in run.objectives]
    names = [each.name for each in task.objectives]
    yield demand("objectives' names", listed == names, f"the problem has {names}, but run.json lists {listed}")
    yield from check_path(task, model)
    for row, number in enumerate(run.ids.tolist()):
        time, q = (np.asarray(run.motions[name][row], dtype=float) for name in ("time", "q"))
        if not _has_times(time, task):
            yield leave_out("motions against the path", "the method chooses its own times", point=number)
            continue
        # the motion begins at its own start: the one that its gene chooses, or the first
        possible, names_of_genes = np.asarray(problem.starts), [each.name for each in problem.parameters]
        if "start" not in names_of_genes:
            possible = possible[:1]
        elif "genes" in run.motions:
            share = float(np.asarray(run.motions["genes"])[row, names_of_genes.index("start")])
            possible = possible[[min(int(share * len(possible)), len(possible) - 1)]]
        off = float(np.abs(possible - q[0]).max(axis=1).min())
        yield judge("start", off, TOLERANCES.on_path, "it does not begin at its own start", point=number)
        parts = [part for each in task.tasks for part in frame_errors(model, each, q)]
        errors = np.concatenate(parts, axis=1)
        if problem.tolerance is not None and float(run.table["violation"][row]) <= 0:
            off = float(np.abs(errors).max())
            detail = f"its tool is {off:.3g} off the path, the tolerance is {problem.tolerance:g}"
            yield judge("tracking", off, float(problem.tolerance) * (1 + TOLERANCES.values), detail, point=number)
        if listed == names:
            motion = measure(model, task, time, q)
            yield from _check_objectives(run, problem, motion, errors, row, number)
    # Parts of the objectives that were not computed a second time:
    count = problem.judged_starts
    if count > 1 and problem.judged_by == "worst":
        reason = f"the table has the worst of {count} motions, but one is stored: the worst is no better than it"
        yield leave_out("objectives from the other starts", reason)
    elif count > 1:
        reason = f"the table has the mean of {count} motions, but one is stored: no objective was computed again"
        yield leave_out("objectives from all starts", reason)
    yield leave_out("the method's steps", "the method is not run again from the start of the stored motion")


def _has_times(time: np.ndarray, task: Any) -> bool:
    times = np.asarray(task.times)
    return len(time) == len(times) and np.allclose(time, times, rtol=0.0, atol=TOLERANCES.times * times[-1])


def _check_objectives(
    run: RunContents, problem: Any, motion: MeasuredMotion, errors: np.ndarray, row: int, point: int
) -> Iterator[Check]:
    """Check that the table's objectives equal those of the stored motion, or are no better if others count."""
    alone = problem.judged_starts == 1
    for objective, entry, value in zip(problem.task.objectives, run.objectives, run.values[row], strict=True):
        subject = f"objective {objective.name}"
        if not alone and problem.judged_by != "worst":
            continue
        function, expected = objective.function, np.nan
        of_method = getattr(function, "__module__", None) == MEASURES
        try:
            if not of_method:
                expected = objective_value(objective, motion)
            elif function.__name__ == "distance":
                # the joint distance from another motion, RMS over time, angles modulo whole turns
                difference = motion.q[0] - np.asarray(inspect.getclosurevars(function).nonlocals["reference"].q)
                turns = np.where(motion.arm.periodic, np.round(difference / (2 * np.pi)), 0.0)
                expected = float(np.sqrt(((difference - 2 * np.pi * turns) ** 2).sum(axis=1).mean()))
            elif function.__name__ in DEFINITIONS:
                expected = DEFINITIONS[function.__name__](motion, errors)
        except Exception as fault:  # a user's function may raise anything
            yield leave_out(subject, f"its function fails here: {first_line(fault)}", point=point)
            continue
        if of_method and function.__name__ not in ("distance", *DEFINITIONS):
            yield leave_out(subject, "it depends on the method's steps, which are not in the files", point=point)
            continue
        size = objective_size(entry, expected)
        better = (expected - value) * (-1.0 if objective.maximise else 1.0)
        text = f"the table says {value:.10g} {objective.unit}".rstrip()
        if alone:
            yield judge(
                subject, abs(better) / size, TOLERANCES.values, f"{text}, but it is {expected:.10g}", point=point
            )
        else:
            detail = f"{text}, the worst of {problem.judged_starts}, but one of them has {expected:.10g}"
            yield judge(subject, max(better, 0.0) / size, TOLERANCES.values, detail, point=point)


DEFINITIONS: dict[str, Callable[[MeasuredMotion, np.ndarray], float]] = {
    "tracking_error": lambda motion, errors: float(np.abs(errors).max()),
    "limit_margin": lambda motion, errors: min(
        (
            min(float(joint.min() - low), float(high - joint.max())) / (high - low)
            for joint, (low, high) in zip(motion.q[0].T, motion.arm.position_limits, strict=True)
            if np.isfinite(high - low)
        ),
        default=0.0,
    ),
    "speed_ratio": lambda motion, errors: max(
        float(np.abs(speed).max()) / (limit if np.isfinite(limit) else 1.0)
        for speed, limit in zip(motion.dq[0].T, motion.arm.velocity_limits, strict=True)
    ),
    "duration": lambda motion, errors: float(motion.duration[0]),
}


# Resolved motions: what the files state about the motion, and, if the problem is known, about the path.


def check_resolution(run: RunContents, task: Any, model: ArmModel | None, reason: str = "") -> Iterator[Check]:
    """Check the errors that a resolved motion states; ``task`` has its path, None if unknown."""
    traces = run.arrays.get("traces.npz", {})
    errors = np.asarray(traces.get("errors", np.empty(0)))
    stated = float(run.entries.get("largest_error", np.nan))
    largest = float(np.abs(errors).max(initial=0.0))
    yield judge(
        "largest error",
        abs(stated - largest),
        TOLERANCES.traces,
        f"run.json says {stated:.8g}, but traces say {largest:.8g}",
    )
    counts = run.entries.get("counts", {}).get("steps", {})
    statuses = np.asarray(traces.get("status", np.empty(0))).ravel().tolist()
    yield demand("steps", sum(counts.values()) == len(statuses), "run.json counts other steps than the traces have")
    if task is None or model is None:
        missing = "arm and path are not in the files; verify(folder, problem) names them"
        yield leave_out("tracking", reason or missing)
        return
    for row, (time, q) in enumerate(zip(run.motions["time"], run.motions["q"], strict=True)):
        point = int(run.ids[row])
        same = _has_times(time, task)
        yield demand("times of the path", same, "its times are not those of the path", point=point)
        if not same:
            continue
        parts = [tracking_errors(model, each, q) for each in task.tasks]
        miss = max(float(max(distance.max(), angle.max())) for distance, angle in parts)
        admitted = float(np.linalg.norm(errors[row], axis=-1).max()) if errors.ndim > 2 else largest
        detail = f"the tool is {miss:.3g} off its path, but its traces say {admitted:.3g}"
        yield judge("tracking", miss, admitted + TOLERANCES.on_path, detail, point=point)
    yield leave_out("limits and the method's steps", "a method may exceed limits if its traces say so")


# Closed loops: the statements of a run.


LIBRARY = "paretoik.closed_loop.objectives"


def check_loop(run: RunContents, loop: Any, model: ArmModel) -> Iterator[Check]:
    """Check that the motion of a closed loop follows its path, and what the run states of it."""
    point, q, time = int(run.ids[0]), run.motions["q"][0], run.motions["time"][0]
    task = loop.task.truncate(len(q))
    times, step = np.asarray(task.times), float(loop.task.times[1] - loop.task.times[0])
    off = float(np.abs(time - times).max() / times[-1])
    yield judge("times of the path", off, TOLERANCES.times, "its times are not those of the path", point=point)
    distances, angles = (
        np.max(parts, axis=0) for parts in zip(*(tracking_errors(model, each, q) for each in task.tasks), strict=True)
    )
    mean, drift = float(distances[1:].mean()), float(np.linalg.norm(q[-1] - q[0]) / q.shape[1])
    for name, value in (("position_error", mean), ("drift", drift)):
        stated = float(run.entries.get(name, np.nan))
        detail = f"run.json says {stated:.10g}, but it is {value:.10g}"
        yield judge(
            f"{name} of the loop", abs(stated - value), TOLERANCES.values * max(value, 1.0), detail, point=point
        )
    steps = np.abs(np.diff(q, axis=0))
    k, j = np.unravel_index(int(steps.argmax()), steps.shape)
    place = Worst(
        what="step", joint=model.arm.joint_names[j], time=float(time[k]), value=float(steps[k, j]), limit=loop.longest
    )
    too_far = max(float(steps[k, j]) - loop.longest, 0.0)
    yield judge("length of steps", too_far, TOLERANCES.on_path, str(place), point=point, worst=place)
    violation = float(run.table["violation"][0]) if "violation" in run.table else None
    motion = measure(model, task, time, q)
    limited = replace(
        task, bounds={kind: each for kind, each in task.bounds.items() if kind in ("position", "velocity")}
    )
    yield from check_limits(limited, motion, None, point)
    yield from (row for row in check_limits(task, motion, violation, point) if row.subject == "violation in the table")
    if task.obstacles and np.isfinite(loop.longest):
        # During steps, which are straight in joints:
        straight = interp1d(time, q, axis=0)
        smallest, at, proven = least_clearance(motion, straight, time)
        limit, tolerance = float(task.min_clearance), TOLERANCES.limits * model.length
        pair = nearest_pair(task.obstacles, model.nodes(straight(np.array([at])))[0], motion.link_radius)
        detail = f"{pair} are {smallest:.4g} m apart at {at:.4g} s, the limit is {task.min_clearance:g} m"
        yield judge("clearance between samples", max(limit - smallest, 0.0), tolerance, detail, point=point)
        if not proven:
            yield leave_out("clearance between samples", "a step is too near to an obstacle to be sure", point=point)
    elif task.obstacles:
        yield leave_out("clearance between samples", "steps may be long: it is known only at their ends", point=point)
    velocity = np.diff(q, axis=0) / step
    series = {
        "joint_displacement": (velocity**2).sum(axis=1) + (((q[1:] - q[0]) / step) ** 2).sum(axis=1),
        "position_error": distances[1:],
        "rotation_error": angles[1:],
    }
    for objective, value in zip(loop.objectives, run.values[0], strict=True):
        subject = f"objective {objective.name}"
        function = objective.function
        if getattr(function, "__module__", "") != LIBRARY or objective.name not in series or len(task.tasks) > 1:
            yield leave_out(subject, "only the step objectives of the paper are modelled", point=point)
            continue
        expected = float(series[objective.name].mean())
        detail = f"the table says {value:.10g} {objective.unit}, but it is {expected:.10g}"
        yield judge(subject, abs(value - expected) / max(abs(expected), 1e-9), TOLERANCES.energies, detail, point=point)


# Capability runs: postures, point-to-point motions, tool paths and polygons.


def check_standing(run: RunContents, problem: Any, model: ArmModel) -> Iterator[Check]:
    """Check that tools of directional maxima are at their position, and that motors reach the speeds."""
    size = len(problem.position)
    bare = not hasattr(problem.actuation, "rod")
    for row, q in enumerate(run.motions["q"]):
        point = int(run.ids[row])
        yield demand("standing still", np.ptp(q, axis=0).max() == 0, "the arm moves", point=point)
        off = float(np.linalg.norm(model.poses(q[:1])[1][0, :size] - problem.position)) / model.length
        yield judge(
            "position of the tool", off, TOLERANCES.on_path, f"the tool is {off:.3g} arm lengths off", point=point
        )
        yield _position_limits(model, run.motions["time"][row], q, point)
        for k, direction in enumerate(problem.directions):
            name, subject = run.objectives[k]["name"], f"objective {run.objectives[k]['name']}"
            if not bare or not str(name).startswith("speed"):
                yield leave_out(subject, "the verifier does not model rods, sliders and forces", point=point)
                continue
            # the highest speed that motors at the joints allow, by a linear program
            columns = model.jacobian(q[0])[2][: len(direction)]
            speeds = _motor_speeds(problem.actuation.motors, model.torques(q[:1], 0 * q[:1], 0 * q[:1])[0])
            result = linprog(
                np.append(np.zeros(model.dof), -1.0),
                A_eq=np.column_stack([columns, -np.asarray(direction)]),
                b_eq=np.zeros(len(columns)),
                bounds=[*speeds, (0.0, None)],
                method="highs",
            )
            value, highest = float(run.values[row, k]), -result.fun if result.status == 0 else np.nan
            detail = f"the table says {value:.8g} m/s, but motors allow {highest:.8g}"
            yield judge(subject, max(value / highest - 1.0, 0.0), TOLERANCES.maxima, detail, point=point)
        if len(run.objectives) > len(problem.directions):
            yield leave_out("other objectives", "they depend on joint speeds, which are not stored", point=point)


def check_point_to_point(run: RunContents, problem: Any, model: ArmModel) -> Iterator[Check]:
    """Check ends, limits, motors, durations and work of motions between two points."""
    size, names = len(problem.start), [str(each["name"]) for each in run.objectives]
    for row, (time, q) in enumerate(zip(run.motions["time"], run.motions["q"], strict=True)):
        point = int(run.ids[row])
        places = model.poses(q[[0, -1]])[1][:, :size]
        off = float(np.linalg.norm(places - [problem.start, problem.target], axis=1).max()) / model.length
        yield judge("ends", off, TOLERANCES.on_path, f"an end is {off:.3g} arm lengths off", point=point)
        yield _position_limits(model, time, q, point)
        value, duration = float(run.values[row, names.index("duration")]), float(time[-1] - time[0])
        detail = f"the table says {value:.10g} s, but the motion takes {duration:.10g} s"
        steps = np.diff(time)
        moving = float(steps[steps > TOLERANCES.rest * (1.0 + 1e-6)].sum())
        off = max(value / duration - 1.0, moving / value - 1.0, 0.0)
        yield judge("objective duration", off, TOLERANCES.values, detail, point=point)
        middle = (q[1:] + q[:-1]) / 2
        effort = model.torques(middle, 0 * middle, 0 * middle)  # against gravity
        bare = not hasattr(problem.actuation, "rod")
        if bare:  # each motor must be within its curve
            motors, halfway = problem.actuation.motors, (time[1:] + time[:-1]) / 2
            speed, allowed = np.diff(q, axis=0) / steps[:, None], _motor_speeds(motors, effort)
            excess, place = worst_joint(model, "speed", halfway, speed, allowed, np.asarray(motors.fastest))
            detail = f"{place}: faster than its motor by {excess:.3g} of its speed"
            shown = max(excess, 0.0) if np.isfinite(excess) else excess
            yield judge("motors", shown, TOLERANCES.maxima, detail, point=point, worst=place)
        else:
            yield leave_out("motors", "the verifier does not model rods and sliders", point=point)
        for k, name in enumerate(names):
            if name == "energy" and bare:  # work of the motors, given or taken
                work, value = float(np.abs(effort * np.diff(q, axis=0)).sum()), float(run.values[row, k])
                detail, off = (
                    f"the table says {value:.10g} J, but it is {work:.10g}",
                    abs(value - work) / max(work, 1e-12),
                )
                yield judge("objective energy", off, TOLERANCES.energies, detail, point=point)
            elif name != "duration":
                yield leave_out(f"objective {name}", "the verifier does not compute it for these motors", point=point)


def check_tool_path(run: RunContents) -> Iterator[Check]:
    """Check the ends, the box and the times of a tool path. The path must stay in the box, and times must increase."""
    arrays = run.arrays["tool_path.npz"]
    tool = np.asarray(arrays["positions" if "positions" in arrays else "points"], dtype=float)
    settings = dict(run.entries.get("settings", {}))
    size = max(float(np.ptp(tool, axis=0).max()), float(np.abs(tool).max()))
    for name, place, at in (("start", settings.get("initial") or arrays["start"], 0), ("target", arrays["target"], -1)):
        off = float(np.linalg.norm(tool[at] - np.asarray(place, dtype=float)))
        allowed = TOLERANCES.on_path * size + float(settings.get("tolerance", 0.0))
        yield demand(name, off <= allowed, f"the tool is {off:.3g} m off")
    outside = np.maximum(tool - arrays["upper"], arrays["lower"] - tool).max()
    yield demand("box of the model", outside <= TOLERANCES.on_path * size, f"the tool is {outside:.3g} m outside")
    yield demand("times", bool((np.diff(arrays["times"]) >= 0).all()), "times do not increase")
    yield leave_out("speeds", "the speed model is not stored")


def check_polygon(run: RunContents, model: ArmModel | None, reason: str = "") -> Iterator[Check]:
    """Check the postures and speeds of a polygon, with its arm."""
    arrays = run.arrays.get("polygon.npz", {})
    values, directions = arrays["values"], arrays["directions"]
    lengths = np.linalg.norm(directions, axis=1)
    yield judge(
        "directions", float(np.abs(lengths - 1.0).max()), TOLERANCES.directions, "a direction is not a unit vector"
    )
    if model is None:
        yield leave_out("postures", reason or "the arm is not in the files; verify(folder, arm) names it")
        return
    joints = [str(name) for name in arrays["joint_names"]]
    yield demand("joint names", joints == list(model.arm.joint_names), "its joints are not those of the arm, in order")
    if joints != list(model.arm.joint_names):
        return
    size = directions.shape[1]
    for k in np.flatnonzero(np.isfinite(values)).tolist():
        _, place, jacobian = model.jacobian(arrays["q"][k])
        off = float(np.linalg.norm(place[:size] - arrays["position"])) / model.length
        yield judge("position of the tool", off, TOLERANCES.on_path, f"the tool is {off:.3g} arm lengths off", point=k)
        if run.entries.get("unit") == "m/s":
            off = float(np.abs(jacobian[:size] @ arrays["dq"][k] - values[k] * directions[k]).max() / abs(values[k]))
            yield judge("values", off, TOLERANCES.maxima, "J dq is not the speed along the direction", point=k)
        else:
            yield leave_out("values", "torques hold arm and force together: they are not separated", point=k)


def _position_limits(model: ArmModel, time: np.ndarray, q: np.ndarray, point: int) -> Check:
    """Return the check of the arm's own position limits. An excess is a share of a joint's range, or of 1 rad or m."""
    limits = np.array(model.arm.position_limits, dtype=float)
    width = limits[:, 1] - limits[:, 0]
    size = np.where(np.isfinite(width) & (width > 0), width, 1.0)
    excess, place = worst_joint(model, "position", time, q, limits, size)
    return judge("position limits", max(excess, 0.0), TOLERANCES.limits, str(place), point=point, worst=place)


def _motor_speeds(motors: Any, effort: np.ndarray) -> np.ndarray:
    """Return the lowest and highest speeds (..., 2) of motors under efforts, NaN past stall."""
    share = effort / np.asarray(motors.stall)
    if motors.shape == "diamond":
        ahead = back = 1.0 - np.abs(share)
    elif motors.shape == "strip":
        ahead, back = np.minimum(1.0 - share, 1.0), np.minimum(1.0 + share, 1.0)
    else:
        ahead = back = np.ones_like(share)
    bearable = np.abs(share) <= 1.0 + 1e-8
    ahead, back = (np.where(bearable, np.maximum(each, 0.0), np.nan) for each in (ahead, back))
    return np.stack([-back * np.asarray(motors.fastest), ahead * np.asarray(motors.fastest)], axis=-1)
