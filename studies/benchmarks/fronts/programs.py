"""The nonlinear program of any arm's motion over joint positions, for IPOPT, if the planner's peers have none.

The dynamics are our component kernels fed with CasADi's symbols, which fold zeros away. A sample is one small function,
mapped over all samples; derivatives are CasADi's, compiled if there is a compiler. On a cycle the last posture is the
first. Absolute values are slack variables, one per joint and sample, above both signs; peaks are epigraph variables,
one per motion, above both signs of every joint at all samples.
"""

from __future__ import annotations

import os
import subprocess
import warnings
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from casadi import SX, vertcat

from paretoik.robot import dynamics
from paretoik.robot.kinematics import frame_components, link_frames
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from studies.benchmarks.planner.compiling import COMPILER

CAP, TOLERANCE = 100, 1e-8  # iterations; of stationarity
WARM_PUSH = 1e-4  # off the bounds
SLACK = 1e-3  # W above the power, to start from


@dataclass(frozen=True, eq=False)
class JointProgram:
    """Solvers for cold and warm starts and the bounds of the program."""

    task: MotionTask
    solvers: dict[bool, Any]
    sides: dict[str, np.ndarray]

    def solve(
        self, q: np.ndarray, main: int, ceilings: np.ndarray, ranges: np.ndarray, *, warm: bool
    ) -> tuple[np.ndarray | None, int]:
        """Return the motion (samples, dof) from a start, None if IPOPT does not converge, and the iterations."""
        count = len(ranges)
        weights = np.where(np.arange(count) == main, 1.0, 0.0)
        upper = self.sides["ubg"].copy()
        upper[-count:] = ceilings / ranges
        solver = self.solvers[warm]
        x0, p = np.zeros(len(self.sides["lbx"])), np.concatenate([weights, ranges])
        packed = pack(self.task, q)
        x0[: len(packed)] = packed  # the unknowns after these are multipliers
        end = solver(x0=x0, p=p, **{**self.sides, "ubg": upper})
        stats = solver.stats()
        motion = unpack(self.task, np.asarray(end["x"]).ravel())
        return (motion if stats["success"] else None), int(stats["iter_count"])


def pack(task: MotionTask, q: np.ndarray) -> np.ndarray:
    """Return the unknowns of a motion: its postures, and slack and epigraph variables above their quantities."""
    postures, motion = q[:-1] if task.cyclic else q, task.motion(q)
    tops = [float(objective(motion)) + SLACK for objective in peaks(task)]
    return np.concatenate([postures.ravel(), above_power(task, q)[1:].ravel(), tops])


def unpack(task: MotionTask, x: np.ndarray) -> np.ndarray:
    """Return the motion (samples, dof) of unknowns."""
    postures = x[: task.arm.dof * (len(task.times) - task.cyclic)].reshape(-1, task.arm.dof)
    return np.concatenate([postures, postures[:1]]) if task.cyclic else postures


def above_power(task: MotionTask, q: np.ndarray) -> np.ndarray:
    """Return slack variables (samples, slacks) above a motion's powers."""
    return np.abs(task.motion(q).power[:, : slacks(task)]) + SLACK


def slacks(task: MotionTask) -> int:
    """Return the number of slack variables of a sample."""
    return task.arm.dof if any(objective.name == "mechanical_energy" for objective in task.objectives) else 0


def peaks(task: MotionTask) -> list[Objective]:
    """Return the objectives that are peaks: the last unknowns are their epigraph variables."""
    return [objective for objective in task.objectives if objective.form == "peak"]


def joint_program(task: MotionTask, library: str = "") -> JointProgram:
    """Return the program of a task with backward differences and limits only on joints, compiled if it is."""
    program, sides = state_program(task)
    options = {warm: solver_options(warm=warm) | ({} if library else {"expand": True}) for warm in (False, True)}
    return JointProgram(
        task,
        {warm: casadi.nlpsol("peer", "ipopt", library or program, settings) for warm, settings in options.items()},
        sides,
    )


def compiled_program(task: MotionTask, name: str, folder: Path) -> str:
    """Return the library with a task's compiled program and its derivatives."""
    program, _ = state_program(task)
    return compiled_library(program, casadi.nlpsol("peer", "ipopt", program, solver_options(warm=False)), name, folder)


def compiled_library(program: dict[str, Any], solver: Any, name: str, folder: Path) -> str:
    """Return the library with a program and everything that its solver derives from it."""
    assert COMPILER is not None
    generator = casadi.CodeGenerator(f"{name}.c")
    generator.add(
        casadi.Function("nlp", [program["x"], program["p"]], [program["f"], program["g"]], ["x", "p"], ["f", "g"])
    )
    for part in solver.get_function():
        generator.add(solver.get_function(part))
    source, library = generator.generate(f"{folder}{os.sep}"), folder / f"{name}.so"
    subprocess.run([COMPILER, "-O1", "-fPIC", "-shared", source, "-o", library], check=True)
    return str(library)


def check(task: MotionTask) -> None:
    """Refuse a task that peers' programs cannot state."""
    assert task.differences == "backward", f"differences must be 'backward', got {task.differences!r}"
    assert task.start is None, "start must be free, got a given one"
    others = [*task.obstacles, *task.constraints, *(["a stop"] if task.ends_at_rest else [])]
    assert not others, f"limits must be on joints only, got {others}"


def state_program(task: MotionTask) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return CasADi's expressions of the unknowns x, of p (weights, ranges), f and g, and the bounds of x and g."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # our kernels call NumPy's cosine for symbols too
        return _written(task)


def _written(task: MotionTask) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    check(task)
    samples, dof, dt = len(task.times), task.arm.dof, float(task.times[1] - task.times[0])
    unknown, count = samples - task.cyclic, len(task.objectives)
    extra, tops = slacks(task), len(peaks(task))
    sizes = np.cumsum([0, dof * unknown, extra * (samples - 1), tops])
    unrolled, p = casadi.MX.sym("x", int(sizes[-1])), casadi.MX.sym("p", 2 * count)
    postures, powers, top = (unrolled[int(a) : int(b)] for a, b in pairwise(sizes))
    x, slack = casadi.reshape(postures, dof, unknown), casadi.reshape(powers, extra, samples - 1)
    rows, lower, upper = [], [], []
    epigraph = iter(casadi.vertsplit(top) if tops else ())
    totals = vertcat(*(next(epigraph) if each.form == "peak" else casadi.MX(0) for each in task.objectives))
    # samples that count: all but the first, which is at rest; on a cycle the last one replaces the first
    stages = ((1, samples, 2),) if task.cyclic else ((1, 2, 1), (2, samples, 2))
    for first, last, reach in (*stages, *(((0, 1, 0),) if tops and not task.cyclic else ())):  # at rest there are peaks
        stage, low, high = _stage(task, reach, dt)
        looked = [x[:, [(k - back) % unknown for k in range(first, last)]] for back in range(reach, -1, -1)]
        before, width = max(first - 1, 0), last - first
        worth, limits = stage.map(width)(*looked, slack[:, before : before + width], casadi.repmat(top, 1, width))
        totals += casadi.sum2(worth) if reach else 0
        rows.append(casadi.vec(limits))
        lower.append(np.tile(low, last - first))
        upper.append(np.tile(high, last - first))
    at_path = pose_function(task).map(unknown)(x, task.targets[:unknown].T)
    rows += [casadi.vec(at_path), totals / p[count:]]
    off = np.zeros(at_path.numel())
    position = task.bounds["position"][0] if "position" in task.bounds else np.tile([-np.inf, np.inf], (dof, 1))
    sides = {
        "lbx": np.concatenate([np.tile(position[:, 0], unknown), np.zeros(extra * (samples - 1) + tops)]),
        "ubx": np.concatenate([np.tile(position[:, 1], unknown), np.full(extra * (samples - 1) + tops, np.inf)]),
        "lbg": np.concatenate([*lower, off, np.full(count, -np.inf)]),
        "ubg": np.concatenate([*upper, off, np.full(count, np.inf)]),
    }
    f = casadi.dot(p[:count], totals / p[count:])
    return {"x": unrolled, "p": p, "f": f, "g": vertcat(*rows)}, sides


def solver_options(*, warm: bool) -> dict[str, Any]:
    """Return IPOPT's settings for a nearby start, ``warm``, or for any."""
    settings = {"print_level": 0, "sb": "yes", "tol": TOLERANCE, "constr_viol_tol": 1e-9, "max_iter": CAP}
    settings |= {"bound_relax_factor": 0.0, "mu_init": 1e-4 if warm else 1e-2}
    if warm:
        settings |= dict.fromkeys(("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac"), WARM_PUSH)
    return {"print_time": False, "error_on_fail": False, "ipopt": settings}


def _stage(task: MotionTask, reach: int, dt: float) -> tuple[Any, np.ndarray, np.ndarray]:
    """Return a function of ``reach`` + 1 postures: objectives' shares and limited values, and its bounds."""
    q: list[Any] = [SX.sym(f"q{back}", task.arm.dof) for back in range(reach, -1, -1)]
    rate: Any = (q[-1] - q[-2]) / dt if reach else SX.zeros(task.arm.dof)
    before = (q[-2] - q[-3]) / dt if reach > 1 else SX.zeros(task.arm.dof)
    slack: Any = SX.sym("slack", slacks(task))
    top: Any = SX.sym("top", len(peaks(task)))
    worth, limited = at_sample(task, q[-1], rate, (rate - before) / dt, slack, top)
    return casadi.Function("stage", [*q, slack, top], [dt * worth, limited]), *limited_sides(task)


def at_sample(task: MotionTask, q: Any, rate: Any, acceleration: Any, slack: Any, top: Any = None) -> tuple[Any, Any]:
    """Return a sample's shares of objectives and limited values, from SX vectors (dof,), (slacks,), (peaks,)."""
    arm = task.arm
    here, v, a = (casadi.vertsplit(one) for one in (q, rate, acceleration))
    torque: Any = vertcat(*dynamics.torque_components(arm, here, v, a))
    lower, upper = arm.position_limits.T
    limited = np.isfinite(upper - lower) & (upper > lower)
    ratio: Any = (
        vertcat(*(here[i] - (lower[i] + upper[i]) / 2 for i in np.flatnonzero(limited))) / (upper - lower)[limited]
    )
    worth: dict[str, Any] = {
        "kinetic_energy": lambda: dynamics.energy_components(arm, here, v)[0],
        "torque_norm": lambda: casadi.sumsqr(torque),
        "mechanical_energy": lambda: casadi.sum1(slack),
        "joint_limit_distance": lambda: casadi.sumsqr(ratio) / (2 * arm.dof) / float(task.times[-1] - task.times[0]),
    }
    quantities = {"velocity": rate, "torque": torque, "power": torque * rate}
    kinds = _limited_kinds(task)
    shares: Any = vertcat(*(SX(0) if each.form == "peak" else worth[each.name]() for each in task.objectives))
    rows = [quantities[kind] for kind in kinds]
    if slacks(task):
        rows += [slack - quantities["power"], slack + quantities["power"]]
    for i, objective in enumerate(peaks(task)):
        below = quantities[objective.name.removeprefix("peak_")]
        rows += [top[i] - below, top[i] + below]
    return shares, vertcat(*rows) if rows else SX(0, 1)


def limited_sides(task: MotionTask) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of the limited values of ``at_sample``."""
    kinds = _limited_kinds(task)
    lower, upper = (
        np.concatenate([np.empty(0), *(task.bounds[kind][0][:, side] for kind in kinds)]) for side in (0, 1)
    )
    both = 2 * (slacks(task) + task.arm.dof * len(peaks(task)))
    return np.concatenate([lower, np.zeros(both)]), np.concatenate([upper, np.full(both, np.inf)])


def _limited_kinds(task: MotionTask) -> list[str]:
    kinds = ("velocity", "torque", "power")
    assert set(task.bounds) <= {"position", *kinds}, f"limits must be on joints, got {', '.join(task.bounds)}"
    return [kind for kind in kinds if kind in task.bounds]


def pose_function(task: MotionTask) -> Any:
    """Return a function of a posture and its target: the error of the tool."""
    (only,) = task.tasks
    q: Any = SX.sym("q", task.arm.dof)
    target: Any = SX.sym("target", task.targets.shape[1])
    joints: Any = casadi.vertsplit(q)
    rotation, position = frame_components(task.arm, link_frames(task.arm, joints), task.arm.frame(only.frame))
    size = only.position_rows
    off: Any = vertcat(*position[:size]) - target[:size]
    if target.numel() > size:
        turned: Any = casadi.reshape(target[size:], 3, 3) @ vertcat(*(casadi.horzcat(*row) for row in rotation))
        if only.axes == "xyz+z-axis":
            off = vertcat(off, turned[0, 2], turned[1, 2])
        else:
            off = vertcat(off, turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1])
    return casadi.Function("pose", [q, target], [off])
