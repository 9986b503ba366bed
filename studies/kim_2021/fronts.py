"""Time against energy from p4 to p6, postures and sliders free but without jumps: fronts with certificates.

The paper gives two points, whose energy it does not define; here energy is the work of all motors, given or taken.
Sliders need time to reach their places, which maxima of an instant do not count.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

import paretoik as pk
from paretoik.capability.point_to_point_program import minimum_timing
from paretoik.nlp.minimise import minimise
from paretoik.pareto.scalarisation import COLD_OPTIONS as COLD
from problems.kim_2021 import START, TARGET
from studies.kim_2021.ipopt_programs import motion_program
from studies.kim_2021.maxima import paper as printed
from studies.reporting import Row

MECHANISMS: dict[str, Callable[[], pk.capability.JointActuation | pk.capability.DistributedActuation]] = {
    "JAM": pk.capability.kim_joint_motors,
    "DAM": pk.capability.kim_sliders,
    "DAM, base −150°": lambda: pk.capability.kim_sliders(float(np.deg2rad(-150.0))),
}
TABLE = "time against energy from p4 to p6, without jumps"
RACED = "time against energy beside CasADi + IPOPT, one program from the same starts"
AGAIN = 16  # times the samples: grid on which motions are timed again
CRITICAL = 1e-6
ENDS = ((1.0, 1e-2), (1e-3, 10.0))  # weights of seconds and joules for the races to the ends
SAME = 1e-5  # relative difference within which optima are the same: IPOPT relaxes limits by 1e-8


class TimeEnergy(NamedTuple):
    """A mechanism's certified front.

    Timed on a fine grid, motions take longer by ``again`` (points,), NaN if motors cannot hold the arm somewhere;
    ``overload`` (points,) says by how much, negative if they can.
    """

    name: str
    front: pk.Front
    again: Float[np.ndarray, " points"]
    overload: Float[np.ndarray, " points"]


class Race(NamedTuple):
    """The results of starts at both ends, ours and IPOPT's: weighted sums and seconds (ends, starts).

    Sums are NaN if a search failed; ``gained`` (points,) is IPOPT's gain from the points of our front.
    """

    name: str
    ours: Float[np.ndarray, "ends starts"]
    theirs: Float[np.ndarray, "ends starts"]
    seconds: Float[np.ndarray, "2 ends starts"]
    gained: Float[np.ndarray, " points"]


def problem_of(name: str, samples: int) -> pk.PointToPoint:
    """Return the problem of a mechanism."""
    return pk.PointToPoint(pk.arms.kim_3r(), MECHANISMS[name](), START, TARGET, samples=samples)


def time_energy(name: str, *, points: int, starts: int, samples: int) -> TimeEnergy:
    """Return the certified front of one mechanism."""
    problem = problem_of(name, samples)
    front = pk.epsilon_front(problem, points=points, starts=starts)
    genes = np.array(front.genes)
    q, sliders, _ = problem.profiles(genes)
    fine = problem.initial_paths.finer(AGAIN)
    again = minimum_timing(problem.arm, problem.actuation, fine @ q, fine @ sliders)
    return TimeEnergy(
        name=name,
        front=front,
        again=again.duration / front.objectives[:, 0] - 1.0,
        overload=again.overload,
    )


def race_fronts(one: TimeEnergy, *, starts: int, samples: int) -> Race:
    """Return results of interior points from equal starts, ours and IPOPT's, and IPOPT's gains from our front."""
    problem = problem_of(one.name, samples)
    own_program, program = problem.program(), motion_program(problem)
    genes = problem.sample_starts(4 * starts, np.random.default_rng(1))
    genes = genes[np.isfinite(problem.points(genes)).all(axis=1)][:starts]
    starts = len(genes)
    sums, seconds = np.full((2, 2, starts), np.nan), np.zeros((2, 2, starts))
    for e, weights in enumerate(ENDS):
        for k, z in enumerate(problem.points(genes)):
            started = perf_counter()
            end = minimise(own_program, z[None], np.array([weights]), options=COLD.barrier)
            middle = perf_counter()
            _, values, success = program.solved(program.start(genes[k]), weights)
            seconds[:, e, k] = middle - started, perf_counter() - middle
            sums[0, e, k] = end.objectives[0] @ weights if end.converged[0] else np.nan
            sums[1, e, k] = np.dot(weights, values) if success else np.nan
    gained = []
    for row, value in zip(np.array(one.front.genes), one.front.objectives, strict=True):
        _, values, success = program.solved(program.start(row), ENDS[1], value[0])
        gained.append(max(0.0, 1.0 - values[1] / value[1]) if success else 0.0)
    return Race(one.name, sums[0], sums[1], seconds, np.array(gained))


def race_rows(one: Race) -> list[Row]:
    """Return the costs and results of both searches."""
    row, rows = partial(Row, RACED, one.name, source="CasADi + IPOPT"), []
    for e, what in enumerate(("soonest", "least work")):
        ours, theirs = one.ours[e], one.theirs[e]
        best = np.nanmin(np.concatenate([ours, theirs]))
        worse = float(np.nanmin(ours) / best - 1.0)
        ended = f"of {len(ours)} starts {np.isfinite(ours).sum()} end, IPOPT's {np.isfinite(theirs).sum()}; the best "
        reached = f"of all is reached by {np.sum(ours <= best * (1 + SAME))} and {np.sum(theirs <= best * (1 + SAME))}"
        prefix = "LOSS: " if worse > SAME else ""
        rows.append(row(f"{what}: our best above the best of both", "", worse, note=prefix + ended + reached))
        mine, other = 1e3 * np.median(one.seconds[:, e], axis=1)
        note = f"{mine / other:.2f} times CasADi + IPOPT"
        rows.append(row(f"{what}: one search", "ms", float(mine), reference=float(other), note=note))
    largest = float(one.gained.max())
    note = f"{'LOSS: ' if largest > SAME else ''}{len(one.gained)} points"
    return [*rows, row("what IPOPT gains in work from our front, at most", "", largest, note=note)]


def time_energy_rows(one: TimeEnergy) -> list[Row]:
    """Return a front's ends and its certificates."""
    certificates, values, row = one.front.certificates, one.front.objectives, partial(Row, TABLE, one.name)
    assert certificates is not None
    counts = Counter(certificates.status.tolist())
    statuses = ", ".join(f"{count} {status}" for status, count in sorted(counts.items()))
    arrival = printed()["Figure 8", one.name[:3], "arrival"]
    critical, late = float(np.sum(certificates.criticality <= CRITICAL)), one.again[np.isfinite(one.again)]
    residuals = f"criticality at most {certificates.criticality.max():.1e}, limits violated by "
    residuals += f"{certificates.violation.max():.1e} at samples"
    slower = f"in the median {100 * np.median(late) if len(late) else np.nan:.2g} %; in {len(values) - len(late)} of "
    slower += f"{len(values)} motors are overloaded between samples, by {max(0.0, one.overload.max()):.2%} at most"
    instants = f"with {1e3 * values[0, 1]:.4g} mJ; the paper's is of instants"
    again = f"timed anew, {AGAIN} times finer: longer by, at most"
    return [
        row("soonest", "s", float(values[0, 0]), reference=arrival, note=instants),
        row("least work", "mJ", 1e3 * float(values[-1, 1]), note=f"in {values[-1, 0]:.4g} s"),
        row("critical points", f"of {len(values)}", critical, note=f"{statuses}; {residuals}"),
        row(again, "%", 100 * float(late.max(initial=0.0)), note=slower),
    ]
