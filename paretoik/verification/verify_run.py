"""All checks of a run, chosen by its contents."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, TypeAlias

import numpy as np

from paretoik.runs.executor import computed_text
from paretoik.stop_flag import check_interruption
from paretoik.verification.arm_model import build_model
from paretoik.verification.capability_checks import check_point_to_point, check_polygon, check_standing, check_tool_path
from paretoik.verification.front_checks import check_certificate, check_tables
from paretoik.verification.measured_motion import measure
from paretoik.verification.method_checks import check_loop, check_resolution, check_tuning
from paretoik.verification.motion_checks import (
    check_between,
    check_errors,
    check_limits,
    check_objectives,
    check_path,
    check_samples,
    finer_motion,
    project_curve,
)
from paretoik.verification.run_contents import Check, RunContents, Verification, demand, leave_out

Show: TypeAlias = Callable[[int, int], object]  # gets the number of checked points and of all points


def verify_run(
    run: RunContents, problem: Any, *, reason: str = "", same: bool | None = None, show: Show | None = None
) -> Verification:
    """Return the rows of all checks of a run, made or not.

    problem: what the run solved; None, for a ``reason``, if motions are not checked against it
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
            rows.append(leave_out("motions", "the files do not belong together"))
        elif problem is None:
            rows.append(leave_out("motions against the problem", reason or "the problem is not at hand"))
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
        yield leave_out("objectives", "the problem has no arm and no motions: its values are its own")
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
        yield leave_out("motions against the problem", f"{type(problem).__name__}: not a kind that is modelled twice")
    else:  # motions that follow a path, those of a front or of a plan
        named = {each.name: each for each in task.objectives}
        listed = [(str(each["name"]), str(each["unit"]), bool(each["maximised"])) for each in run.objectives]
        objectives = [(each.name, each.unit, bool(each.maximise)) for each in task.objectives]
        yield demand(
            "objectives' names",
            listed == objectives,
            f"the problem has {_names(objectives)}, run.json {_names(listed)}",
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
