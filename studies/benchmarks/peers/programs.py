"""A motion's nonlinear program: over joint positions, for IPOPT, and in stages, for FATROP.

Over joint positions, a stage is a sample with those before it that count; the last posture of a cycle is the first. In
stages the state is the posture, the rate before if accelerations count, the first posture on a cycle, and the sums of
objectives that may have ceilings; the control is the rate ahead, with the slack variables there. CasADi finds the
stages by itself if the variables and rows of each are together, its gap first.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import casadi
import numpy as np
from casadi import SX, vertcat

from paretoik.task.motion_task import MotionTask
from studies.benchmarks.peers.quantities import (
    SLACK,
    above_power,
    at_sample,
    check,
    is_rated,
    limited_sides,
    peaks,
    pose_function,
    sides_of,
    slacks,
)
from studies.benchmarks.peers.solvers import Peer, Run


@contextmanager
def symbols() -> Iterator[None]:
    """Compute with CasADi's symbols: our kernels call NumPy's cosine for them too, of which NumPy warns."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        yield


def joint_program(task: MotionTask) -> Peer:
    """Return the program over joint positions of a task with backward differences and limits only on joints.

    Unknowns: postures, slack variables, epigraph variables.
    """
    check(task, "backward")
    samples, dof, dt = len(task.times), task.arm.dof, float(task.times[1] - task.times[0])
    unknown, extra, tops = samples - task.cyclic, slacks(task), len(peaks(task))
    ends = np.cumsum([0, dof * unknown, extra * (samples - 1), tops])
    # number of samples before one that it needs: none for the first, one after rest, two if accelerations count
    reaches = [([0], 0), ([1], 1), (list(range(2, unknown)), 1 + is_rated(task))]
    if task.cyclic:  # nobody is at rest, and the last sample replaces the first
        reaches = [([0], 0), (list(range(1, unknown)), 1 + is_rated(task)), ([unknown], 1 + is_rated(task))]

    def run(of: list[int], reach: int) -> Run:
        """Return samples that depend on a number of samples before them."""
        q: list[Any] = [SX.sym(f"q{back}", dof) for back in range(reach, -1, -1)]
        slack, top, c = SX.sym("slack", extra * bool(reach)), SX.sym("top", tops), SX.sym("c", task.targets.shape[1])
        shares, limited, (low, high) = SX.zeros(len(task.objectives)), SX(0, 1), limited_sides(task)
        if reach or (tops and not task.cyclic):  # at rest there are peaks
            rate: Any = (q[-1] - q[-2]) / dt if reach else SX.zeros(dof)
            before = (q[-2] - q[-3]) / dt if reach > 1 else SX.zeros(dof)
            shares, limited = at_sample(task, q[-1], rate, (rate - before) / dt, slack, top)
            shares = dt * shares if reach else SX.zeros(len(task.objectives))
        off = SX(0, 1) if of == [unknown] else pose_function(task)(q[-1], c)
        low, high = (side[: limited.numel()] for side in (low, high))
        looked = (np.arange(-reach, 1)[:, None] + np.array(of)) % unknown
        places = [
            (dof * looked[:, None] + np.arange(dof)[:, None]).reshape(-1, len(of)),
            ends[1] + extra * (np.array(of) - 1) + np.arange(extra * bool(reach))[:, None],
            np.repeat(ends[2] + np.arange(tops)[:, None], len(of), axis=1),
        ]
        p = SX.sym("p", 2 * len(task.objectives))
        return Run(
            stage=casadi.Function("stage", [vertcat(*q, slack, top), p, c], [shares, vertcat(off, limited)]),
            places=np.concatenate(places),
            constants=task.targets[of].T,
            lower=np.tile(np.append(np.zeros(off.numel()), low)[:, None], len(of)),
            upper=np.tile(np.append(np.zeros(off.numel()), high)[:, None], len(of)),
            equality=[True] * off.numel() + [False] * len(low),
        )

    def pack(q: np.ndarray, _: np.ndarray) -> np.ndarray:
        motion = task.motion(q)
        top = [float(objective(motion)) + SLACK for objective in peaks(task)]
        return np.concatenate([q[:unknown].ravel(), above_power(task, q)[1:].ravel(), top])

    def unpack(x: np.ndarray) -> np.ndarray:
        postures = x[: ends[1]].reshape(-1, dof)
        return np.concatenate([postures, postures[:1]]) if task.cyclic else postures

    low, high = sides_of(task, "position", unknown)
    others = np.zeros(ends[3] - ends[1])
    with symbols():
        return Peer(
            solver="ipopt",
            task=task,
            bounds=np.stack([np.append(low, others), np.append(high, others + np.inf)]),
            pack=pack,
            unpack=unpack,
            runs=tuple(run(of, reach) for of, reach in reaches if of),
            tops={task.objectives.index(each): int(ends[2]) + i for i, each in enumerate(peaks(task))},
        )


def staged_program(task: MotionTask, *, capped: Sequence[int] | None = None) -> Peer:
    """Return the program in stages of a task with backward differences, limits only on joints and a free end.

    ``capped`` are the objectives that may have ceilings, by default all if there are several.
    """
    check(task, "backward")
    assert not peaks(task), "objectives must be sums, got a peak: it would be one more state of every stage"
    samples, dof, dt = len(task.times), task.arm.dof, float(task.times[1] - task.times[0])
    count, extra, rated = len(task.objectives), slacks(task), is_rated(task)
    assert not (rated and task.cyclic), "a cycle must have objectives and limits without torques"
    sums = list(capped) if capped is not None else list(range(count)) if count > 1 else []
    parts = {"q": dof, "before": dof * rated, "first": dof * task.cyclic, "sums": len(sums)}
    control = {"rate": dof, "slack": extra}
    at, size = list[dict[str, np.ndarray]](), 0  # places of a stage's state and control
    for k in range(samples):
        sizes = parts if k else {"q": dof, "first": parts["first"]}
        sizes = sizes | (control if k < samples - 1 else {})
        ends = size + np.cumsum([0, *sizes.values()])
        at.append({name: np.arange(a, b) for name, (a, b) in zip(sizes, pairwise(ends), strict=True)})
        size = int(ends[-1])
    with symbols():
        step, pose = _step(task, parts, sums, dt), pose_function(task)

    def run(of: range) -> Run:
        """Return stages in a row, the last of all without a next."""
        here = {name: SX.sym(name, len(place)) for name, place in at[of[0]].items()}
        p, c, rows = SX.sym("p", 2 * count), SX.sym("c", task.targets.shape[1]), list[Any]()
        ahead, last, shares = SX(0, 1), of[-1] == samples - 1, SX.zeros(count)
        limited: Any = SX(0, 1)
        if not last:
            full = [here.get(name, SX.zeros(width)) for name, width in parts.items()]
            ahead = SX.sym("ahead", sum(parts.values()))
            made, limited, shares = step(vertcat(*full), vertcat(here["rate"], here["slack"]), p[count:])
            rows.append(ahead - made)
        if not (last and task.cyclic):
            rows.append(pose(here["q"], c))
        if task.cyclic and (last or of[0] == 0):
            rows.append(here["q"] - here["first"])
        tied = sum(row.numel() for row in rows)
        low, high = (side[: limited.numel()] for side in limited_sides(task, bounded_rates=True))
        places = [np.concatenate([*at[k].values(), *(at[k + 1][name] for name in parts if not last)]) for k in of]
        # shares of objectives are divided by their ranges in a sum, and by the program
        return Run(
            stage=casadi.Function("stage", [vertcat(*here.values(), ahead), p, c], [shares, vertcat(*rows, limited)]),
            places=np.stack(places, axis=1).astype(int),
            constants=task.targets[of[0] : of[-1] + 1].T,
            lower=np.tile(np.append(np.zeros(tied), low)[:, None], len(of)),
            upper=np.tile(np.append(np.zeros(tied), high)[:, None], len(of)),
            equality=[True] * tied + [False] * len(low),
        )

    def pack(q: np.ndarray, ranges: np.ndarray) -> np.ndarray:
        x, controls = np.empty(size), np.concatenate([np.diff(q, axis=0) / dt, above_power(task, q)[1:]], axis=1)
        first = q[0][: parts["first"]]
        x[at[0]["q"]], x[at[0]["first"]] = q[0], first
        full = np.concatenate([q[0], np.zeros(parts["before"]), first, np.zeros(len(sums))])
        for k, each in enumerate(controls):
            x[np.concatenate([at[k]["rate"], at[k]["slack"]])] = each
            full = np.asarray(step(full, each, ranges)[0]).ravel()
            x[np.concatenate([at[k + 1][name] for name in parts])] = full
        return x

    bounds = np.stack([np.full(size, -np.inf), np.full(size, np.inf)])
    for kind, name in (("position", "q"), ("velocity", "rate")):
        places = np.concatenate([each[name] for each in at if name in each])
        bounds[:, places] = sides_of(task, kind, len(places) // dof)
    return Peer(
        solver="fatrop",
        task=task,
        bounds=bounds,
        pack=pack,
        unpack=lambda x: x[np.stack([each["q"] for each in at])],
        runs=tuple(run(of) for of in (range(1), range(1, samples - 1), range(samples - 1, samples))),
        sums=dict(zip(sums, at[-1]["sums"].tolist(), strict=True)),
    )


def _step(task: MotionTask, parts: dict[str, int], sums: Sequence[int], dt: float) -> Any:
    """Return a function of a state, the control and the ranges: the next state, limited values, objectives' shares."""
    state = {name: SX.sym(name, width) for name, width in parts.items()}
    rate, slack = SX.sym("rate", task.arm.dof), SX.sym("slack", slacks(task))
    ranges = SX.sym("ranges", len(task.objectives))
    q = state["q"] + dt * rate
    before = state["before"] if parts["before"] else rate
    worth, limited = at_sample(task, q, rate, (rate - before) / dt, slack, bounded_rates=True)
    shares = dt * worth
    then = {
        "q": q,
        "before": rate[: parts["before"]],
        "first": state["first"],
        "sums": state["sums"] + vertcat(*(shares[k] / ranges[k] for k in sums)),
    }
    inputs = [vertcat(*state.values()), vertcat(rate, slack), ranges]
    return casadi.Function("step", inputs, [vertcat(*then.values()), limited, shares])
