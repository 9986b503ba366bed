"""Problems without a motion: seconds until they are refused.

    python -m studies.benchmarks.infeasible [--quick] [--json FILE]

Eleven problems are given to ``plan``, ``epsilon_front``, ``solve`` and ``refine`` (which gets motions of the problem
without limits). Each has a proof that shares no code with the refusal, named in its row. Seconds are of this process
(all threads) after everything is compiled; building the problem counts.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import paretoik as pk
from problems import panda, tringali_2020
from studies.reporting import Row, goal_row, report, study_parser, tell

GOAL = 2.0  # s of processor
OBJECTIVES = [pk.kinetic_energy, pk.joint_travel]
VERBS = ("plan", "epsilon_front", "solve", "refine")


@dataclass(frozen=True, eq=False)
class Case:
    """A problem by the settings of ``Tracking``, and the proof in words that it is infeasible."""

    name: str
    proof: str
    settings: dict[str, Any]
    arm: pk.Arm = field(default_factory=pk.arms.tringali_3r)
    path: pk.Path = field(default_factory=tringali_2020.straight)


def cases() -> list[Case]:
    """Return the problems."""
    circle, limits = pk.obstacles.Circle, pk.Limits
    quick = pk.circle([0.25, 0.1], 0.08, duration=0.15)
    hanging = pk.arms.tringali_3r().mounted(gravity=(0.0, -9.81, 0.0))
    across = panda.across_the_table().task.tasks[0].path
    four = pk.Arm.planar(lengths=[0.2] * 4, masses=[0.5] * 4, centers=[0.1] * 4, inertias=[0.002] * 4)
    fastest = "the tool's speed at half time is at most Σ rᵢ q̇ᵢ"
    ball = pk.obstacles.Sphere([0.45, 0.05, 0.3], 0.05)
    return [
        Case(
            "3R, position 60°",
            "every posture at sample 95, law of cosines",
            {"limits": limits(position=np.deg2rad([60.0] * 3))},
        ),
        Case("3R, velocity 2 rad/s", "linear programs of every posture at sample 34", {"limits": limits(velocity=2.0)}),
        Case(
            "3R, circle in 0.15 s, velocity 8 rad/s",
            "linear programs of every posture at sample 50",
            {"limits": limits(velocity=8.0)},
            path=quick,
        ),
        Case(
            "3R, acceleration 0.5 rad/s², backward",
            "from rest the tool comes Σ rᵢ a t² / 2 far",
            {"limits": limits(acceleration=0.5), "differences": "backward"},
        ),
        Case(
            "3R under gravity, torque 1.5 N m",
            "angular momentum about the base over 8 s",
            {"limits": limits(torque=1.5, velocity=0.5)},
            hanging,
            pk.line([0.4, 0.05], [0.44, 0.05], duration=8.0),
        ),
        Case(
            "3R, an obstacle on the path",
            "distance of the tool from its center",
            {"obstacles": [circle([0.3, 0.07], 0.03)]},
        ),
        Case(
            "3R, an obstacle in the way of links",
            "every posture at sample 64, law of cosines",
            {"obstacles": [circle([0.2, 0.15], 0.08)], "limits": limits(position=tringali_2020.POSITION)},
        ),
        Case(
            "3R, clearance 0.5 m",
            "distance of the base",
            {"obstacles": [circle([0.12, 0.12], 0.05)], "limits": limits(clearance=0.5)},
        ),
        Case(
            "4R, velocity 0.35 rad/s",
            fastest,
            {"limits": limits(velocity=0.35)},
            four,
            pk.line([0.5, 0.0], [0.1, 0.3], duration=1.0),
        ),
        Case(
            "Panda, velocity 0.05 rad/s",
            f"{fastest}, rᵢ ≤ 1.3 m",
            {"limits": limits(velocity=0.05)},
            panda.panda(),
            across,
        ),
        Case(
            "Panda, a ball on the path",
            "the tool passes the center at less than 0.01 m",
            {"obstacles": [ball], "link_radius": 0.05},
            panda.panda(),
            across,
        ),
    ]


def refusal(case: Case, verb: str) -> tuple[float, float, str]:
    """Return the processor and clock seconds until a verb refuses a problem, and its reason."""
    objectives = OBJECTIVES[:1] if verb == "plan" else OBJECTIVES
    free = pk.Tracking(case.arm, case.path, objectives=objectives, limits=pk.Limits(position=np.inf, velocity=np.inf))
    motions = free.decode(free.sample_starts(4, np.random.default_rng(0)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about obstacles on the path
        clock, processor = time.perf_counter(), time.process_time()
        try:
            problem = pk.Tracking(case.arm, case.path, objectives=objectives, **case.settings)
            if verb == "refine":
                stray = problem.task.motion(motions.q)
                values = np.stack([objective(stray) for objective in objectives], axis=1)
                told = {name: getattr(problem, name) for name in ("names", "units", "maximised")}
                front = pk.Front(ids=np.arange(len(values)), objectives=values, motions=stray, **told)
                pk.refine(front, problem, observe=False)
            else:
                getattr(pk, verb)(problem, observe=False)
            reason = "not refused"
        except pk.ParetoikError as error:
            reason = f"{type(error).__name__}: {error}"
        return time.process_time() - processor, time.perf_counter() - clock, reason


def case_rows(case: Case, verbs: Sequence[str]) -> list[Row]:
    """Return the seconds of each verb and the ratio of the proof."""
    rows = []
    for verb in verbs:
        tell(f"{case.name}: {verb}")
        processor, clock, reason = refusal(case, verb)
        note = f"{clock:.2f} s of the clock" + (f"; {reason}; {case.proof}" if verb == verbs[0] else "")
        rows.append(goal_row("Seconds to refusal", case.name, verb, "s of processor", processor, GOAL, note))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Report how long each problem takes to be refused."""
    options = study_parser("Problems without a motion, and seconds to refusal.", quick="plan only").parse_args(
        arguments
    )
    problems = cases()
    for case in (problems[1], problems[-1]):
        for verb in VERBS[: 1 if options.quick else None]:
            refusal(case, verb)  # compiles
    verbs = VERBS[:1] if options.quick else VERBS
    report([row for case in problems for row in case_rows(case, verbs)], json_file=options.json)


if __name__ == "__main__":
    main()
