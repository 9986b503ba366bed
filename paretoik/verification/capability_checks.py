"""Checks of capability runs: postures, point-to-point motions, polygons."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.optimize import linprog

from paretoik.verification.arm_model import ArmModel
from paretoik.verification.limits import worst_joint
from paretoik.verification.run_contents import Check, RunContents, demand, judge, leave_out
from paretoik.verification.tolerances import TOLERANCES


def check_standing(run: RunContents, problem: Any, model: ArmModel) -> Iterator[Check]:
    """Check that postures of directional maxima are at their position, and motors reach the speeds."""
    size = len(problem.position)
    bare = not hasattr(problem.actuation, "rod")
    for row, q in enumerate(run.motions["q"]):
        point = int(run.ids[row])
        yield demand("standing still", np.ptp(q, axis=0).max() == 0, "the motion moves", point=point)
        off = float(np.linalg.norm(model.poses(q[:1])[1][0, :size] - problem.position)) / model.length
        yield judge("position of the tool", off, TOLERANCES.on_path, f"the tool is {off:.3g} lengths off", point=point)
        yield _position_limits(model, run.motions["time"][row], q, point)
        for k, direction in enumerate(problem.directions):
            name, subject = run.objectives[k]["name"], f"objective {run.objectives[k]['name']}"
            if not bare or not str(name).startswith("speed"):
                yield leave_out(subject, "rods, sliders and forces are not modelled a second time", point=point)
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
            detail = f"the table says {value:.8g} m/s, motors allow {highest:.8g}"
            yield judge(subject, max(value / highest - 1.0, 0.0), TOLERANCES.maxima, detail, point=point)
        if len(run.objectives) > len(problem.directions):
            yield leave_out("other objectives", "the speeds of joints that they depend on are not stored", point=point)


def check_point_to_point(run: RunContents, problem: Any, model: ArmModel) -> Iterator[Check]:
    """Check ends, limits, motors, durations and work of motions between two points."""
    size, names = len(problem.start), [str(each["name"]) for each in run.objectives]
    for row, (time, q) in enumerate(zip(run.motions["time"], run.motions["q"], strict=True)):
        point = int(run.ids[row])
        places = model.poses(q[[0, -1]])[1][:, :size]
        off = float(np.linalg.norm(places - [problem.start, problem.target], axis=1).max()) / model.length
        yield judge("ends", off, TOLERANCES.on_path, f"an end is {off:.3g} lengths of the arm off", point=point)
        yield _position_limits(model, time, q, point)
        value, duration = float(run.values[row, names.index("duration")]), float(time[-1] - time[0])
        detail = f"the table says {value:.10g} s, the motion takes {duration:.10g} s"
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
            yield leave_out("motors", "rods and sliders are not modelled a second time", point=point)
        for k, name in enumerate(names):
            if name == "energy" and bare:  # work of the motors, given or taken
                work, value = float(np.abs(effort * np.diff(q, axis=0)).sum()), float(run.values[row, k])
                detail, off = f"the table says {value:.10g} J, it is {work:.10g}", abs(value - work) / max(work, 1e-12)
                yield judge("objective energy", off, TOLERANCES.energies, detail, point=point)
            elif name != "duration":
                yield leave_out(f"objective {name}", "it is not computed a second time for these motors", point=point)


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
    yield demand("times", bool((np.diff(arrays["times"]) >= 0).all()), "they do not grow")
    yield leave_out("speeds", "the speed model is not stored")


def check_polygon(run: RunContents, model: ArmModel | None, reason: str = "") -> Iterator[Check]:
    """Check the postures and speeds of a polygon, with its arm."""
    arrays = run.arrays.get("polygon.npz", {})
    values, directions = arrays["values"], arrays["directions"]
    lengths = np.linalg.norm(directions, axis=1)
    yield judge(
        "directions", float(np.abs(lengths - 1.0).max()), TOLERANCES.directions, "a direction has not the length 1"
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
        yield judge("position of the tool", off, TOLERANCES.on_path, f"the tool is {off:.3g} lengths off", point=k)
        if run.entries.get("unit") == "m/s":
            off = float(np.abs(jacobian[:size] @ arrays["dq"][k] - values[k] * directions[k]).max() / abs(values[k]))
            yield judge("values", off, TOLERANCES.maxima, "J dq is not the speed along the direction", point=k)
        else:
            yield leave_out("values", "torques hold the arm and the force: not separated a second time", point=k)


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
