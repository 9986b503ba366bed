"""Time against energy from p4 to p6, postures and sliders free but without jumps: fronts, and their certificates.

What the paper gives are two points, whose energy it does not define; here energy is the work of all motors, given or
taken. Sliders have to travel to where they are wanted, which maxima of an instant do not count.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from moocore import is_nondominated

import paretoik as pk
from paretoik.convex.sequential import Caps, minimised
from paretoik.refinement.smooth_front import Sketch
from paretoik.review.plots import ACCENTS, QUIET
from paretoik.robot import kinematics
from problems.kim_2021 import START, TARGET
from studies.kim_2021.pictures import drawing
from studies.kim_2021.setting import paper as printed
from studies.reporting import Row

MECHANISMS: dict[str, Callable[[], pk.JointActuation | pk.DistributedActuation]] = {
    "JAM": pk.kim_joint_motors,
    "DAM": pk.kim_sliders,
    "DAM, base −150°": lambda: pk.kim_sliders(float(np.deg2rad(-150.0))),
}
TABLE = "time against energy from p4 to p6, without jumps"
FINER = 4  # than the samples: where tool paths are timed by directional maxima
LITTLE = 1e-3  # of the other objective, where one is least
CRITICAL, HELD = 1e-6, 1e-8
COARSE = 2e-3  # what few samples of a path may be mistaken by


@dataclass(frozen=True, kw_only=True, eq=False)
class TimeEnergy:
    """A mechanism's certified front, and the least time of its soonest tool path by maxima of an instant [s]."""

    name: str
    front: pk.Front
    bound: float


def time_energy(name: str, *, points: int, generations: int, iterations: int, samples: int) -> TimeEnergy:
    """Return the front of one mechanism: its ends by gradients from what a search finds, and times between them."""
    problem = pk.PointToPoint(pk.kim_3r(), MECHANISMS[name](), START, TARGET, samples=samples)
    found = pk.solve(problem, population=100, generations=generations, seed=1, points=points)
    sketch, starts = problem.sketch(), problem.unknowns(np.array(found.genes))
    ends = [_least(sketch, weights, starts[[0, -1]], None, iterations) for weights in ((1.0, LITTLE), (LITTLE, 1.0))]
    soonest, latest = (float((sketch.costs @ end)[0]) for end in ends)
    every = [ends[0]]
    for level in np.linspace(soonest, latest, points)[1:-1]:
        caps = Caps(rows=sketch.costs[:1], most=np.array([level]))
        every.append(_least(sketch, (LITTLE, 1.0), np.array([every[-1]]), caps, iterations))
    z = np.array([*every, ends[1]])
    best = is_nondominated(np.round(z @ sketch.costs.T, 9))
    genes = problem.genes_of(z[best])
    front = pk.refine(replace(found, ids=np.arange(len(genes)), genes=genes, **_worth(problem, genes)))
    assert front.genes is not None
    return TimeEnergy(name=name, front=front, bound=_instant(problem, np.array(front.genes[:1])))


def _least(
    sketch: Sketch, weights: tuple[float, float], starts: np.ndarray, caps: Caps | None, iterations: int
) -> np.ndarray:
    """Return the unknowns of the least weighted sum of seconds and tenths of a joule that starts lead to."""
    cost = np.array(weights) * (1.0, 10.0) @ sketch.costs
    ends = [minimised(sketch.program, cost, start, caps=caps, iterations=iterations) for start in starts]
    kept = [end for end in ends if end.violation <= HELD]
    return min(kept, key=lambda end: float(cost @ end.z)).z if kept else starts[0]


def _worth(problem: pk.PointToPoint, genes: np.ndarray) -> dict[str, Any]:
    return {
        "objectives": problem.evaluate(genes, return_values_of=["F"]),
        "motions": None,
        "violation": None,
        "ranges": np.empty((0, 2)),
    }


def time_energy_rows(one: TimeEnergy) -> list[Row]:
    """Return a front's ends, its certificates, and the paper's point beside it."""
    known, values = one.front.certificates, one.front.objectives
    assert known is not None
    statuses = ", ".join(f"{np.sum(known.status == status)} {status}" for status in np.unique(known.status))
    mechanism = one.name[:3]
    paper = printed()["Figure 8", mechanism, "arrival"], printed()["Table 4", mechanism, "total"]
    late = paper[0] < values[0, 0]
    beside = np.nan if late else 1e3 * float(np.interp(paper[0], values[:, 0], values[:, 1]))
    fits = one.bound <= values[0, 0] * (1 + COARSE)
    rows = [
        ("soonest", "s", values[0, 0], paper[0], f"with {1e3 * values[0, 1]:.4g} mJ; the paper's is of instants"),
        (
            "its path by maxima of an instant",
            "s",
            one.bound,
            None,
            "no more" if fits else "LOSS: more than the soonest",
        ),
        ("least work", "mJ", 1e3 * values[-1, 1], None, f"in {values[-1, 0]:.4g} s"),
        ("work in the paper's time", "mJ", beside, paper[1], "LOSS: no motion is as soon" if late else ""),
        (
            "critical points",
            f"of {len(values)}",
            float(np.sum(known.kkt_residual <= CRITICAL)),
            None,
            f"{statuses}; criticality at most {known.kkt_residual.max():.1e}, limits violated by "
            f"{known.violation.max():.1e} at samples, motors too slow between them by "
            f"{known.violation_between.max():.1%}",
        ),
    ]
    return [
        Row(table=TABLE, row=one.name, column=column, unit=unit, ours=float(ours), paper=beside_it, note=note)
        for column, unit, ours, beside_it, note in rows
    ]


def _instant(problem: pk.PointToPoint, genes: np.ndarray) -> float:
    """Return the least time of a tool path if every instant had its own best posture and gears [s]."""
    q = problem.ways.finer(FINER) @ problem.profiles(genes)[0]
    tool = kinematics.tool_pose(problem.arm, q[0])[1][:, : len(START)]
    steps, middle = np.diff(tool, axis=0), (tool[1:] + tool[:-1]) / 2
    return float(
        sum(
            np.linalg.norm(step) / pk.directional_maxima(problem.arm, problem.actuation, place, step[None]).values[0]
            for place, step in zip(middle, steps, strict=True)
            if np.linalg.norm(step) > 0
        )
    )


def drawn_fronts(folder: Path, fronts: Sequence[TimeEnergy]) -> Path:
    """Draw all fronts into one picture, the paper's two points beside them, and return the file."""
    file = folder / "time_energy.png"
    with drawing(file, (6.4, 4.2)) as figure:
        axes = figure.subplots()
        for one, colour in zip(fronts, (ACCENTS[1], ACCENTS[0], QUIET), strict=True):
            rows = one.front.objectives
            axes.plot(rows[:, 0], 1e3 * rows[:, 1], ".-", color=colour, linewidth=1.2, label=one.name)
        for mechanism, colour in (("JAM", ACCENTS[1]), ("DAM", ACCENTS[0])):
            known = printed()
            place = known["Figure 8", mechanism, "arrival"], known["Table 4", mechanism, "total"]
            axes.plot(*place, "x", color=colour, markersize=8, label=f"{mechanism}, the paper")
        axes.set_xlabel("duration [s]")
        axes.set_ylabel("work of all motors [mJ]")
        axes.legend(frameon=False)
    return file
