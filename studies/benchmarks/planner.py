"""The planner beside CasADi + FATROP: ``python -m studies.benchmarks.planner [--quick] [--seed N] [--json FILE]``.

Simulations 1 to 5 of Tringali & Cocuzza 2020 on the printed arm, the same discretisation and the same starts for both.
FATROP gets lean closed-form dynamics in absolute link angles, a state that makes the problem one of optimal control, an
iteration cap, and CasADi's own evaluation. Its time to the best optimum is what is expected of independent starts: the
mean time of one divided by how often one ends there (within 1e-6), on two cores that share nothing. Ours is a whole
``plan`` from nothing but the problem. A first plan, which compiles, is not timed.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi
import numpy as np

import paretoik as pk
from paretoik.refinement.compiled.interior_point import Rules
from paretoik.refinement.multistart import COLD, coarse_starts, sizes
from paretoik.refinement.polish import polish
from paretoik.refinement.program import motion_program
from paretoik.task.motion_task import MotionTask
from problems import tringali_2020
from studies.benchmarks.reference_front import INERTIAS, LENGTHS, PRINTED, coupling
from studies.reporting import Row, report

NAMES = tuple(f"simulation_{i}" for i in range(1, 6))
STARTS, COARSE, CORES = 48, 26, 2
SAME = 1e-6  # relative: optima nearer than this are one
QUIET = {"tolerance": 1e-8, "max_iter": 100, "print_level": 0}


@dataclass(frozen=True)
class Peer:
    """FATROP's program at the samples of a task; ``solve`` takes joint angles and returns (value, solved)."""

    solver: Any
    bounds: dict[str, np.ndarray]
    pack: Callable[[np.ndarray], np.ndarray]

    def solve(self, q: np.ndarray) -> tuple[float, bool]:
        """Return the objective that a start leads to, and whether the solver is content."""
        found = self.solver(x0=self.pack(q), **self.bounds)
        return float(found["f"]), bool(self.solver.stats()["success"])


def peer(task: MotionTask) -> Peer:
    """Return the task as optimal control: state q, (q, v) for torque, (q, first q) on a cycle; control v ahead."""
    assert np.allclose(INERTIAS, [0.001811, 0.003173, 0.002103])
    torque = task.objectives[0].name == "torque_norm"
    samples, dt, inertia = len(task.times), task.times[1], casadi.DM(coupling(PRINTED))
    variables, rows, equality, cost = [], [], [], 0.0
    low, high, row_low, row_high = [], [], [], []
    position = task.bounds.get("position", np.tile([-np.inf, np.inf], (1, 3, 1)))[0]
    velocity = task.bounds.get("velocity", np.tile([-np.inf, np.inf], (1, 3, 1)))[0]

    def add(what: Any, lower: np.ndarray, upper: np.ndarray, *, equal: bool) -> None:
        rows.append(what)
        row_low.append(lower)
        row_high.append(upper)
        equality.extend([equal] * len(lower))

    def state(k: int) -> Any:
        extra = 3 if (torque and k > 0) or task.cyclic else 0
        x = casadi.MX.sym(f"x{k}", 3 + extra)
        variables.append(x)
        free = np.full(extra, np.inf)
        low.append(np.concatenate([position[:, 0], -free]))
        high.append(np.concatenate([position[:, 1], free]))
        return x

    states: list[Any] = []
    controls: list[Any] = []
    for k in range(samples):
        states.append(state(k))
        if k < samples - 1:
            controls.append(casadi.MX.sym(f"u{k}", 3))
            variables.append(controls[k])
            low.append(velocity[:, 0])
            high.append(velocity[:, 1])
    for k in range(samples):
        x = states[k]
        if k < samples - 1:
            u = controls[k]
            ahead = x[:3] + dt * u
            tail = [u] if torque else [x[3:]] if task.cyclic else []
            add(
                states[k + 1] - casadi.vertcat(ahead, *tail),
                np.zeros(3 + 3 * len(tail)),
                np.zeros(3 + 3 * len(tail)),
                equal=True,
            )
            phi, rate, tau = casadi.cumsum(ahead), casadi.cumsum(u), casadi.MX.zeros(3)
            between = casadi.repmat(phi, 1, 3) - casadi.repmat(phi.T, 3, 1)
            if torque:
                change = casadi.cumsum((u - x[3:]) / dt if k else u / dt)
                link = (inertia * casadi.cos(between)) @ change + (inertia * casadi.sin(between)) @ rate**2
                tau = casadi.vertcat(link[0] + link[1] + link[2], link[1] + link[2], link[2])
                cost += dt * casadi.sumsqr(tau)
            else:
                cost += dt * rate.T @ (inertia * casadi.cos(between)) @ rate / 2
        phi = casadi.cumsum(x[:3])
        reach = casadi.vertcat(casadi.dot(LENGTHS, casadi.cos(phi)), casadi.dot(LENGTHS, casadi.sin(phi)))
        if not (task.cyclic and k == samples - 1):
            add(reach - task.targets[k, :2], np.zeros(2), np.zeros(2), equal=True)
        if task.cyclic and k in (0, samples - 1):
            add(x[:3] - x[3:], np.zeros(3), np.zeros(3), equal=True)
        if k < samples - 1:
            for kind, values in (("torque", tau), ("power", tau * u)):
                if kind in task.bounds:
                    add(values, task.bounds[kind][0, :, 0], task.bounds[kind][0, :, 1], equal=False)
    settings: dict[str, Any] = {
        "expand": True,
        "structure_detection": "auto",
        "equality": equality,
        "fatrop": QUIET,
        "print_time": False,
    }
    program = {"x": casadi.vertcat(*variables), "f": cost, "g": casadi.vertcat(*rows)}
    solver = casadi.nlpsol("fatrop", "fatrop", program, {**settings, "error_on_fail": False})

    def pack(q: np.ndarray) -> np.ndarray:
        rates, parts = np.diff(q, axis=0) / dt, []
        for k in range(samples):
            parts.append(q[k])
            if torque and k > 0:
                parts.append(rates[k - 1])
            if task.cyclic:
                parts.append(q[0])
            if k < samples - 1:
                parts.append(rates[k])
        return np.concatenate(parts)

    bounds = {
        "lbx": np.concatenate(low),
        "ubx": np.concatenate(high),
        "lbg": np.concatenate(row_low),
        "ubg": np.concatenate(row_high),
    }
    return Peer(solver, bounds, pack)


def compared(name: str, *, starts: int, seed: int) -> list[Row]:
    """Return the rows of one simulation."""
    problem = getattr(tringali_2020, name)()
    task = problem.task
    pk.plan(problem, starts=2)
    plan, seconds = _timed(lambda: pk.plan(problem, starts=starts, seed=seed))
    coarse = task.subsampled(COARSE)
    q = coarse_starts(task, starts=starts, seed=seed)
    program, factors = motion_program(coarse, sizes(task, q)), np.ones((1, 1))
    ours, ours_cold = _timed(lambda: polish(program, q, factors, rules=[COLD[i % 2] for i in range(len(q))]))
    theirs = peer(coarse)
    coarse_results, cold = _timed(lambda: [theirs.solve(start) for start in q])
    fine, building = _timed(lambda: peer(task))
    start_at = coarse.motion(q).at(task.times)
    results, fine_seconds = _timed(lambda: [fine.solve(start) for start in start_at])
    values = np.array([value for value, solved in results if solved])
    best = min([plan.best.objective, *values.tolist()])
    hits = int(np.sum(values <= best * (1 + SAME)))
    expected = fine_seconds / CORES / hits if hits else np.inf
    rough = task.motion(task.subsampled(51).motion(plan.best.motion.q[::2]).at(task.times))
    whole = motion_program(task, np.array([plan.best.objective]))
    warm_rules = Rules(barrier=1e-4)
    _, ours_warm = _timed(lambda: [polish(whole, rough.q[None], factors, rules=warm_rules) for _ in range(10)])
    (again, _), their_warm = _timed(lambda: [fine.solve(rough.q) for _ in range(10)][-1])
    converged = sum(solved for _, solved in coarse_results)
    return [
        Row(
            table="best optimum",
            row=name,
            column="objective",
            unit="",
            ours=plan.best.objective,
            paper=float(values.min()) if len(values) else None,
            note=f"relative gap {plan.best.objective / best - 1:.1e}; {len(plan.optima)} optima",
        ),
        Row(
            table="time",
            row=name,
            column="to the best optimum",
            unit="s",
            ours=seconds,
            paper=expected,
            note=f"ratio {seconds / expected:.3f}, goal 0.5; hit {hits} of {len(q)} times, built in {building:.2g} s",
        ),
        Row(
            table="time",
            row=name,
            column=f"{len(q)} starts at {COARSE} samples",
            unit="s",
            ours=ours_cold,
            paper=cold / CORES,
            note=f"ratio {ours_cold / cold * CORES:.3f}, goal 1; converged {int(ours.converged.sum())} and {converged}",
        ),
        Row(
            table="time",
            row=name,
            column="one warm solve",
            unit="s",
            ours=ours_warm / 10,
            paper=their_warm / 10,
            note=f"ratio {ours_warm / their_warm:.3f}, goal 2; theirs ends at {again:.9f}",
        ),
    ]


def _timed(work: Callable[[], Any]) -> tuple[Any, float]:
    started = time.perf_counter()
    found = work()
    return found, time.perf_counter() - started


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="12 starts")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args(arguments)
    starts = 12 if given.quick else STARTS
    report([row for name in NAMES for row in compared(name, starts=starts, seed=given.seed)], json_file=given.json)


if __name__ == "__main__":
    main()
