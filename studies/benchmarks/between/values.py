"""Values of motions: the stated ones, and the true ones of the motion's curve.

    python -m studies.benchmarks.between.values [--quick] [--cases N] [--seed N] [--json FILE]

Random arms on lines and circles, without limits on acceleration, ends free; small fronts are searched and 10 points of
each refined. "true" is a value on a grid 200 times finer, by differences of ``at(t)``. "stated" is the largest error of
the refined points' values, a share of the value; "before" is the same for the spline before its projection. "velocity"
is the distance of ``motion.dq`` from ``motion.state`` at samples, a share of its range. "gain" is the least by which
refinement lowers the true value of an objective, in ranges of the front; below 0, a point is worse on the curve.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

import paretoik as pk
from paretoik.errors import ParetoikError
from paretoik.task.differences import evaluate_with_midpoints
from paretoik.task.motion import Motion
from studies.benchmarks.between.cases import STEPS, motion_at, random_path
from studies.reporting import Row, goal_row, report, study_parser, tell

FINER = 200
GOAL, AGREEMENT = 0.1, 1e-6  # % of a value; share of a range
CASES, QUICK_CASES, SAMPLES = 20, 3, (15, 25, 41)
POINTS = 10  # of a front that are refined, at most; with 40, five of twenty cases took an hour
OTHERS = (pk.peak_torque, pk.joint_travel, pk.mechanical_energy)


class Outcome(NamedTuple):
    """A case: errors in % of values, the disagreement of velocities, the least gain, and the statuses."""

    name: str
    stated: float
    before: float
    velocity: float
    gain: float
    statuses: str


def run_case(number: int, rng: np.random.Generator, generations: int) -> Outcome:
    """Return the outcome of a random problem; raises ParetoikError if arm and path do not suit each other."""
    arm, path, cyclic = random_path(rng, spatial=number % 3 == 2, samples=int(rng.choice(SAMPLES)))
    objectives = [pk.kinetic_energy, pk.peak_velocity, OTHERS[number % len(OTHERS)]]
    problem = pk.Tracking(arm, path, objectives=objectives, limits=pk.Limits(velocity=np.inf), cyclic=cyclic)
    searched = pk.solve(problem, generations=generations, population=24, seed=number, refine=False, observe=False)
    refined = pk.refine(searched[searched.ids[:POINTS]], observe=False)
    motions, found, names = refined.motions, searched.motions, [each.name for each in objectives]
    assert isinstance(motions, Motion)
    assert isinstance(found, Motion)
    assert refined.certificates is not None
    true = true_values(motions, objectives)
    time, q, derivatives = evaluate_with_midpoints(motions.spline)  # the state of the spline
    q[..., ::2, :] = motions.q
    derivatives = replace(derivatives, velocity_bounds=derivatives.dq.copy())
    spline = replace(motions, time=time, q=q, derivatives=derivatives)
    before = np.stack([objective(spline) for objective in objectives], axis=1)
    dq, state = motions.dq, motions.state(motions.time[0]).dq
    widths = np.ptp(refined.ranges, axis=1)
    pairs = [(i, searched.ids.tolist().index(k)) for i, k in enumerate(refined.ids.tolist()) if k in searched.ids]
    rows, were = np.array(pairs, dtype=int).reshape(-1, 2).T
    gains = (true_values(found[were], objectives) - true[rows]) / widths
    statuses: Counter[str] = Counter(refined.certificates.status.tolist())
    kind = f"{'spatial' if number % 3 == 2 else 'planar'} {arm.dof}R{', cyclic' if cyclic else ''}"
    return Outcome(
        name=f"{number + 1}: {kind}, {len(path.times)} samples, {names[2]}",
        stated=100 * float(np.max(np.abs(refined.objectives - true) / np.abs(true))),
        before=100 * float(np.max(np.abs(before - true) / np.abs(true))),
        velocity=float(np.max(np.abs(dq - state) / np.ptp(state, axis=1, keepdims=True).max(axis=2, keepdims=True))),
        gain=float(gains.min()) if len(rows) else np.nan,
        statuses=", ".join(f"{count} {status}" for status, count in statuses.most_common()),
    )


def true_values(motions: Motion, objectives: Sequence[Any]) -> Float[np.ndarray, "points n_obj"]:
    """Return objectives (points, n_obj) of curves, from positions only."""
    return np.array([_values_of_curve(motion, objectives) for motion in motions])


def _values_of_curve(motion: Motion, objectives: Sequence[Any]) -> list[float]:
    step = STEPS[0] * float(np.diff(motion.time).min())
    times = (motion.time[:-1, None] + np.diff(motion.time)[:, None] * (np.arange(FINER) + 0.5) / FINER).ravel()
    middle = times < np.repeat((motion.time[:-1] + motion.time[1:]) / 2, FINER)
    values = np.empty((len(objectives), len(times)))
    for chosen, side in ((middle, 1), (~middle, -1)):
        judged = motion_at(motion, times[chosen], side * step)
        values[:, chosen] = [objective.function(judged) for objective in objectives]
    shares = np.repeat(np.diff(motion.time) / FINER, FINER)  # midpoint rule
    return [
        float(row.max() if objective.form == "peak" else row @ shares)
        for objective, row in zip(objectives, values, strict=True)
    ]


def tables(outcomes: Sequence[Outcome]) -> list[Row]:
    """Return the table of outcomes, losses first, and the worst of all."""
    rows, units = list[Row](), {"stated": "%", "before": "%", "velocity": "", "gain": "of ranges"}
    for each in sorted(outcomes, key=lambda each: (each.stated <= GOAL, -each.stated)):
        rows += [
            Row("values", each.name, name, unit, getattr(each, name), note=each.statuses)
            for name, unit in units.items()
        ]
    worst = {name: np.array([getattr(each, name) for each in outcomes]) for name in units}
    return [
        *rows,
        goal_row("all cases", "worst", "stated", "%", worst["stated"].max(), GOAL),
        goal_row("all cases", "worst", "before", "%", worst["before"].max(), GOAL),
        goal_row("all cases", "worst", "velocity", "", worst["velocity"].max(), AGREEMENT),
        goal_row("all cases", "worst", "gain", "of ranges", np.nanmin(worst["gain"]), 0.0, least=True),
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the rows."""
    parser = study_parser(__doc__ or "", quick=f"{QUICK_CASES} cases, 10 generations")
    parser.add_argument("--cases", type=int, default=CASES)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    count = QUICK_CASES if options.quick else options.cases
    rng, outcomes = np.random.default_rng(options.seed), list[Outcome]()
    while len(outcomes) < count:
        try:
            outcomes.append(run_case(len(outcomes), rng, 10 if options.quick else 40))
        except ParetoikError:
            continue
        tell(str(outcomes[-1]))
    report(tables(outcomes), json_file=options.json)


if __name__ == "__main__":
    main()
