"""A motion's nonlinear programs in CasADi: over joint positions and of splines, for IPOPT, and in stages, for FATROP.

The dynamics are our component kernels fed with symbols, which fold zeros away; those of a planar arm are in lean closed
form: in absolute link angles the inertia is A_ij cos(φ_i - φ_j), which needs few sines and cosines. Absolute values are
slack variables, one per joint and sample; peaks are epigraph variables, one per motion, above both signs of every
joint.

Over joint positions, a stage is a sample with those before it that count; the last posture of a cycle is the first. In
stages the state is the posture, the rate before if accelerations count, the first posture on a cycle, and the sums of
objectives that may have ceilings; the control is the rate ahead, with the slack variables there. CasADi finds the
stages by itself if the variables and rows of each are together, its gap first.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import casadi
import numpy as np
from casadi import MX, SX, vertcat

from paretoik.robot import dynamics
from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import frame_components, joint_scales, link_frames
from paretoik.task.differences import evaluate_with_midpoints, fit_spline
from paretoik.task.joint_curve import target_rates
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from studies.benchmarks.peers.solvers import Peer, Run

SLACK = 1e-3  # W above the power, to start from


def slacks(task: MotionTask) -> int:
    """Return the number of slack variables of a sample."""
    return task.arm.dof if any(objective.name == "mechanical_energy" for objective in task.objectives) else 0


def above_power(task: MotionTask, q: np.ndarray) -> np.ndarray:
    """Return slack variables (samples, slacks) above a motion's powers."""
    return np.abs(task.motion(q).power[:, : slacks(task)]) + SLACK


def peaks(task: MotionTask) -> list[Objective]:
    """Return the objectives that are peaks."""
    return [objective for objective in task.objectives if objective.form == "peak"]


def is_rated(task: MotionTask) -> bool:
    """Return whether torques, and so accelerations, count."""
    names = {objective.name for objective in task.objectives}
    return bool(
        {"torque_norm", "mechanical_energy", "peak_torque", "peak_power"} & names
        | {"torque", "power"} & set(task.bounds)
    )


def check(task: MotionTask, differences: str) -> None:
    """Refuse a task that peers' programs cannot state."""
    assert task.differences == differences, f"differences must be {differences!r}, got {task.differences!r}"
    assert task.start is None, "start must be free, got a given one"
    others = [*task.obstacles, *task.constraints, *(["a stop"] if task.ends_at_rest else [])]
    assert not others, f"limits must be on joints only, got {others}"
    assert set(task.bounds) <= {"position", "velocity", "torque", "power"}, f"got limits {', '.join(task.bounds)}"


def planar_coupling(arm: Arm) -> np.ndarray | None:
    """Return the symmetric A with M_ij = A_ij cos(φ_i - φ_j) [kg m²] of a planar arm without gravity, or None."""
    lengths = np.array([place.position[0] for place in (*arm.placements[1:], arm.tool)])
    masses = np.array([body.mass for body in arm.bodies])
    centers = np.array([body.center[0] for body in arm.bodies])
    outer = np.append(np.cumsum(masses[::-1])[::-1][1:], 0.0)
    upper = np.triu(np.outer(lengths, masses * centers + outer * lengths), 1)
    own = np.array([body.inertia[2, 2] for body in arm.bodies]) + masses * centers**2 + outer * lengths**2
    A = upper + upper.T + np.diag(own)
    q, dq, ddq = np.random.default_rng(0).normal(size=(3, 8, arm.dof))  # does it compute this arm's torques?
    phi, rate, change = (np.cumsum(each, axis=1) for each in (q, dq, ddq))
    angle = phi[:, :, None] - phi[:, None]
    force = np.einsum("ij,nij,nj->ni", A, np.cos(angle), change) + np.einsum("ij,nij,nj->ni", A, np.sin(angle), rate**2)
    torque = np.cumsum(force[:, ::-1], axis=1)[:, ::-1]
    return A if np.allclose(torque, dynamics.inverse_dynamics(arm, q, dq, ddq), rtol=1e-10) else None


def energy_and_torque(arm: Arm) -> Callable[[Any, Any, Any], tuple[Any, Any]]:
    """Return a function of SX vectors q, rate and acceleration: kinetic energy, and torques of the joints."""
    A = planar_coupling(arm)

    def spatial(q: Any, rate: Any, acceleration: Any) -> tuple[Any, Any]:
        here, v, a = (casadi.vertsplit(one) for one in (q, rate, acceleration))
        return dynamics.energy_components(arm, here, v)[0], vertcat(*dynamics.torque_components(arm, here, v, a))

    def planar(q: Any, rate: Any, acceleration: Any) -> tuple[Any, Any]:
        assert A is not None
        w, change, n = casadi.cumsum(rate), casadi.cumsum(acceleration), arm.dof
        energy, force = casadi.dot(np.diag(A), w**2) / 2, [A[i, i] * change[i] for i in range(n)]
        for i in range(n):
            angle = SX(0)
            for j in range(i + 1, n):
                angle += q[j]  # φ_j - φ_i
                cosine, sine = A[i, j] * casadi.cos(angle), A[i, j] * casadi.sin(angle)
                energy += cosine * w[i] * w[j]
                force[i] += cosine * change[j] - sine * w[j] ** 2
                force[j] += cosine * change[i] + sine * w[i] ** 2
        return energy, vertcat(*(sum(force[i:]) for i in range(n)))

    return spatial if A is None else planar


def at_sample(
    task: MotionTask, q: Any, rate: Any, acceleration: Any, slack: Any, top: Any = None, *, bounded_rates: bool = False
) -> tuple[Any, Any]:
    """Return a sample's shares of objectives and limited values, from SX vectors (dof,), (slacks,), (peaks,).

    Velocities are no limited values if they have bounds of their own.
    """
    arm = task.arm
    energy, torque = energy_and_torque(arm)(q, rate, acceleration)
    lower, upper = arm.position_limits.T
    limited = np.isfinite(upper - lower) & (upper > lower)
    ratio: Any = vertcat(*(q[int(i)] - (lower[i] + upper[i]) / 2 for i in np.flatnonzero(limited)))
    worth: dict[str, Any] = {
        "kinetic_energy": lambda: energy,
        "torque_norm": lambda: casadi.sumsqr(torque),
        "mechanical_energy": lambda: casadi.sum1(slack),
        "joint_limit_distance": lambda: (
            casadi.sumsqr(ratio / (upper - lower)[limited]) / (2 * arm.dof) / float(task.times[-1] - task.times[0])
        ),
    }
    quantities = {"velocity": rate, "torque": torque, "power": torque * rate}
    shares: Any = vertcat(*(SX(0) if each.form == "peak" else worth[each.name]() for each in task.objectives))
    rows = [quantities[kind] for kind in limited_kinds(task, bounded_rates=bounded_rates)]
    if slacks(task):
        rows += [slack - quantities["power"], slack + quantities["power"]]
    for i, objective in enumerate(peaks(task)):
        below = quantities[objective.name.removeprefix("peak_")]
        rows += [top[i] - below, top[i] + below]
    return shares, vertcat(*rows) if rows else SX(0, 1)


def limited_kinds(task: MotionTask, *, bounded_rates: bool) -> list[str]:
    """Return the kinds of limits that are rows of a sample."""
    return [kind for kind in ("velocity", "torque", "power")[bounded_rates:] if kind in task.bounds]


def limited_sides(task: MotionTask, *, bounded_rates: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of the limited values of ``at_sample``."""
    kinds = limited_kinds(task, bounded_rates=bounded_rates)
    lower, upper = (
        np.concatenate([np.empty(0), *(task.bounds[kind][0][:, side] for kind in kinds)]) for side in (0, 1)
    )
    both = 2 * (slacks(task) + task.arm.dof * len(peaks(task)))
    return np.concatenate([lower, np.zeros(both)]), np.concatenate([upper, np.full(both, np.inf)])


def sides_of(task: MotionTask, kind: str, times: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of a quantity of all joints at a number of times; infinite if the task has none."""
    bounds = task.bounds[kind][0] if kind in task.bounds else np.tile([-np.inf, np.inf], (task.arm.dof, 1))
    return np.tile(bounds[:, 0], times), np.tile(bounds[:, 1], times)


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


def spline_program(task: MotionTask) -> Peer:
    """Return the program of a task. Unknowns: samples, epigraph variables, multipliers of the projection."""
    check(task, "spline")
    assert not task.cyclic, "the path must be open, got a cycle"
    assert all(objective.name != "mechanical_energy" for objective in task.objectives), "no absolute values"
    samples, dof, count, instants = len(task.times), task.arm.dof, len(task.objectives), len(task.instants)
    tops, first = len(peaks(task)), dof * samples
    size = first + tops + 3 * task.rows * instants

    def pack(q: np.ndarray, _: np.ndarray) -> np.ndarray:
        motion = task.motion(q)
        top = [float(objective(motion)) + SLACK for objective in peaks(task)]
        return np.concatenate([q.ravel(), top, np.zeros(size - first - tops)])

    with symbols():
        unknowns, p = MX.sym("x", size), MX.sym("p", 2 * count)
        x, top = casadi.reshape(unknowns[:first], dof, samples), unknowns[first : first + tops]
        # position, velocity and acceleration at the instants, of unit samples
        _, q, rates = evaluate_with_midpoints(fit_spline(np.eye(samples), task.times, cyclic=False, ends_at_rest=False))
        spline = [x @ MX(casadi.sparsify(casadi.DM(matrix.T))) for matrix in (q, rates.dq, rates.ddq)]
        multipliers = casadi.reshape(unknowns[first + tops :], 3 * task.rows, instants)
        wanted = np.concatenate([part.T for part in target_rates(task.tasks, task.instants)])
        worth, limited, off, q, rate, acceleration = _at_instant(task).map(instants)(
            vertcat(*spline), multipliers, casadi.DM(wanted), casadi.repmat(top, 1, instants)
        )
        epigraph = iter(casadi.vertsplit(top) if tops else ())
        integrals = casadi.vertsplit(worth @ MX(task.weights))
        totals: Any = vertcat(
            *(next(epigraph) if each.form == "peak" else integrals[k] for k, each in enumerate(task.objectives))
        )
        # de Boor's control point of the velocity between two samples, v + h a / 2
        inner = rate[:, :-1:2] + acceleration[:, :-1:2] @ MX(np.diag(np.diff(task.times) / 2))
        at_path = pose_function(task).map(samples)(x, task.targets.T)
        low, high = limited_sides(task)
        parts = [
            (limited, np.tile(low, instants), np.tile(high, instants)),
            (inner, *sides_of(task, "velocity", samples - 1)),
            (q[:, 1::2], *sides_of(task, "position", samples - 1)),
            *((each, np.zeros(each.numel()), np.zeros(each.numel())) for each in (at_path, off)),
            (totals / p[count:], np.full(count, -np.inf), np.full(count, np.inf)),
        ]
        f, g = casadi.dot(p[:count], totals / p[count:]), vertcat(*(casadi.vec(each[0]) for each in parts))
        lower, upper = sides_of(task, "position", samples)
        free = np.full(tops + multipliers.numel(), np.inf)
        return Peer(
            solver="ipopt",
            task=task,
            bounds=np.stack([np.concatenate([lower, np.zeros(tops), -free[tops:]]), np.append(upper, free)]),
            pack=pack,
            unpack=lambda x: x[:first].reshape(-1, dof),
            statement={"x": unknowns, "p": p, "f": f, "g": g},
            rows=np.stack([np.concatenate([each[k] for each in parts]) for k in (1, 2)]),
        )


def _at_instant(task: MotionTask) -> Any:
    """Return a function of an instant: of spline, multipliers, targets, each with two rates, and peaks.

    Its values are shares of integrals, limited quantities, the curve's distance from its path, and the curve's state.
    """
    dof, rows, numbers = task.arm.dof, task.rows, task.targets.shape[1]
    spline, factors, wanted = SX.sym("s", 3 * dof), SX.sym("l", 3 * rows), SX.sym("x", 3 * numbers)
    top, pose = SX.sym("top", len(peaks(task))), pose_function(task)
    known: Any = vertcat(*(each[: 2 * size] for each, size in ((spline, dof), (factors, rows), (wanted, numbers))))
    rates: Any = vertcat(*(each[size:] for each, size in ((spline, dof), (factors, rows), (wanted, numbers))))

    def with_rates(value: Any) -> list[Any]:
        first = casadi.jtimes(value, known, rates)
        return [value, first, casadi.jtimes(first, known, rates)]

    jacobian: Any = casadi.jacobian(pose(spline[:dof], wanted[:numbers]), spline[:dof])
    weights = casadi.DM(np.diag(joint_scales(task.arm) ** 2))
    curve: Any = with_rates(spline[:dof] + weights @ jacobian.T @ factors[:rows])
    off: Any = with_rates(pose(curve[0], wanted[:numbers]))
    q, rate, acceleration = curve
    shares, limited = at_sample(task, q, rate, acceleration, SX(0, 1), top)
    return casadi.Function("instant", [spline, factors, wanted, top], [shares, limited, vertcat(*off), *curve])
