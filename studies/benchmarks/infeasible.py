"""Problems without a motion: seconds until they are refused, and proofs.

    python -m studies.benchmarks.infeasible [--quick] [--json FILE]

Eleven problems that no motion solves are given to ``plan``, ``epsilon_front``, ``solve`` and ``refine`` (which gets
motions of the problem without limits). Each has its own proof that it is infeasible, which shares no code with the
refusal: all postures of a planar arm by the law of cosines, linear programs of its speeds (SciPy), distances, lengths
of links, angular momentum. The proof's ratio is what a motion needs divided by what it is allowed: above 1 no motion
exists. Seconds are of this process (all threads) after everything is compiled; building the problem counts.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import linprog

import paretoik as pk
from problems import panda, tringali_2020
from studies.reporting import Row, report, study_parser, tell

GOAL = 2.0  # s of processor
ANGLES = np.linspace(-np.pi, np.pi, 4001)[:-1]
LENGTHS = np.array([0.176, 0.176, 0.1375])  # Tringali & Cocuzza 2020, Table 1
OBJECTIVES = [pk.kinetic_energy, pk.joint_travel]
VERBS = ("plan", "epsilon_front", "solve", "refine")


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """A problem by the settings of ``Tracking``, and its proof: the ratio of needed to allowed, and words."""

    name: str
    settings: dict[str, Any]
    needed: Callable[[], float]
    argument: str
    arm: pk.Arm = field(default_factory=pk.arms.tringali_3r)
    path: pk.Path = field(default_factory=tringali_2020.straight)


def postures(point: np.ndarray) -> np.ndarray:
    """Return all postures (count, 3) of the 3R arm whose tool is at a point, by the law of cosines."""
    first, second, third = LENGTHS
    wrist = point - third * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
    cosine = ((wrist**2).sum(axis=1) - first**2 - second**2) / (2 * first * second)
    found = []
    for side in (-1.0, 1.0):
        elbow = side * np.arccos(np.clip(cosine, -1, 1))
        shoulder = np.arctan2(wrist[:, 1], wrist[:, 0]) - np.arctan2(
            second * np.sin(elbow), first + second * np.cos(elbow)
        )
        q = np.stack([shoulder, elbow, ANGLES - shoulder - elbow], axis=1)[np.abs(cosine) <= 1]
        found.append((q + np.pi) % (2 * np.pi) - np.pi)
    return np.concatenate(found)


def nodes(q: np.ndarray) -> np.ndarray:
    """Return the base, the joints and the tool (count, 4, 2) of the 3R arm."""
    angles = np.cumsum(q, axis=1)
    links = LENGTHS[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=2)
    return np.concatenate([np.zeros((len(q), 1, 2)), np.cumsum(links, axis=1)], axis=1)


def depths(q: np.ndarray, center: Sequence[float], radius: float) -> np.ndarray:
    """Return the least distance (count,) of the links of the 3R arm from a circle, negative inside."""
    ends = nodes(q)
    step, offset = np.diff(ends, axis=1), np.asarray(center) - ends[:, :-1]
    share = np.clip((offset * step).sum(axis=2) / (step**2).sum(axis=2), 0, 1)
    return np.asarray(np.linalg.norm(offset - share[..., None] * step, axis=2).min(axis=1) - radius)


def least_turn(sample: int, limits: np.ndarray) -> float:
    """Return the factor by which position limits must be wider for a posture at a sample."""
    return float((np.abs(postures(tringali_2020.straight().positions[sample])) / limits).max(axis=1).min())


def least_speed(path: pk.Path, sample: int, limit: float) -> float:
    """Return the factor by which a velocity limit must be higher in the best posture at a sample."""
    velocity, least = path.rates(path.times[[sample]]).velocity[0], np.inf
    for q in postures(path.positions[sample])[::16]:
        arms = nodes(q[None])[0, -1] - nodes(q[None])[0, :-1]
        jacobian = np.stack([-arms[:, 1], arms[:, 0]])
        sides = np.block([[np.eye(3), -np.ones((3, 1))], [-np.eye(3), -np.ones((3, 1))]])
        solved = linprog([0, 0, 0, 1], sides, np.zeros(6), np.pad(jacobian, ((0, 0), (0, 1))), velocity, (None, None))
        least = min(least, solved.fun if solved.status == 0 else np.inf)
    return float(least) / limit


def farthest_depth(sample: int, center: Sequence[float], radius: float, limits: float = np.pi) -> float:
    """Return 1 plus the depth of links in a circle, in its radii, in the best posture within limits."""
    q = postures(tringali_2020.straight().positions[sample])
    return 1 - float(depths(q[(np.abs(q) <= limits).all(axis=1)], center, radius).max()) / radius


def weight(arm: pk.Arm, path: pk.Path, torque: float, speed: float) -> float:
    """Return the least mean torque that the first joint needs, divided by its limit.

    The angular momentum H about the base changes by ∫ (τ₁ − Σ m g x) dt. |H| ≤ Σ m r² ω + I ω, with r the largest
    distance of a link's center and ω the sum of the joints' speeds.
    """
    masses = np.array([body.mass for body in arm.bodies])
    centers = np.array([body.center[0] for body in arm.bodies])
    inertias = np.array([body.inertia[2, 2] for body in arm.bodies])
    moments = []
    for point in path.positions:
        q = postures(point)
        angles = np.cumsum(q, axis=1)
        x = nodes(q)[:, :-1, 0] + centers * np.cos(angles)
        moments.append(9.81 * (x @ masses).min())
    reach = np.cumsum(LENGTHS) - LENGTHS + centers
    momentum = float((masses * reach**2 + inertias) @ (speed * np.arange(1, 4)))
    return (float(min(moments)) - 2 * momentum / path.duration) / torque


def cases() -> list[Case]:
    """Return the problems."""
    line, circle = tringali_2020.straight(), pk.obstacles.Circle
    quick_circle = pk.circle([0.25, 0.1], 0.08, duration=0.15)
    hanging, near = (
        pk.arms.tringali_3r().mounted(gravity=(0.0, -9.81, 0.0)),
        pk.line([0.4, 0.05], [0.44, 0.05], duration=8.0),
    )
    across = panda.across_the_table().task.tasks[0].path
    four = pk.Arm.planar(lengths=[0.2] * 4, masses=[0.5] * 4, centers=[0.1] * 4, inertias=[0.002] * 4)
    return [
        Case(
            name="3R, position 60°",
            settings={"limits": pk.Limits(position=np.deg2rad([60.0] * 3))},
            needed=lambda: least_turn(95, np.deg2rad([60.0] * 3)),
            argument="every posture at sample 95, law of cosines",
        ),
        Case(
            name="3R, velocity 2 rad/s",
            settings={"limits": pk.Limits(velocity=2.0)},
            needed=lambda: least_speed(line, 34, 2.0),
            argument="linear programs of every posture at sample 34",
        ),
        Case(
            name="3R, circle in 0.15 s, velocity 8 rad/s",
            path=quick_circle,
            settings={"limits": pk.Limits(velocity=8.0)},
            needed=lambda: least_speed(quick_circle, 50, 8.0),
            argument="linear programs of every posture at sample 50",
        ),
        Case(
            name="3R, acceleration 0.5 rad/s², backward",
            settings={"limits": pk.Limits(acceleration=0.5), "differences": "backward"},
            needed=lambda: 0.39977 / (0.5 / 2 * float(np.cumsum(LENGTHS[::-1]).sum())),
            argument="from rest the tool comes Σ rᵢ a t² / 2 far",
        ),
        Case(
            name="3R under gravity, torque 1.5 N m",
            arm=hanging,
            path=near,
            settings={"limits": pk.Limits(torque=1.5, velocity=0.5)},
            needed=lambda: weight(hanging, near, 1.5, 0.5),
            argument="angular momentum about the base over 8 s",
        ),
        Case(
            name="3R, an obstacle on the path",
            settings={"obstacles": [circle([0.3, 0.07], 0.03)]},
            needed=lambda: 0.03 / float(np.linalg.norm(line.positions - [0.3, 0.07], axis=1).min()),
            argument="distance of the tool from its center",
        ),
        Case(
            name="3R, an obstacle in the way of links",
            settings={"obstacles": [circle([0.2, 0.15], 0.08)], "limits": pk.Limits(position=tringali_2020.POSITION)},
            needed=lambda: farthest_depth(64, [0.2, 0.15], 0.08),
            argument="every posture at sample 64, law of cosines",
        ),
        Case(
            name="3R, clearance 0.5 m",
            settings={"obstacles": [circle([0.12, 0.12], 0.05)], "limits": pk.Limits(clearance=0.5)},
            needed=lambda: 0.5 / (float(np.hypot(0.12, 0.12)) - 0.05),
            argument="distance of the base",
        ),
        Case(
            name="4R, velocity 0.35 rad/s",
            arm=four,
            path=pk.line([0.5, 0.0], [0.1, 0.3], duration=1.0),
            settings={"limits": pk.Limits(velocity=0.35)},
            needed=lambda: 0.5 * np.pi / 2 / (0.35 * 0.2 * (1 + 2 + 3 + 4)),
            argument="the tool's speed at half time is at most Σ rᵢ q̇ᵢ",
        ),
        Case(
            name="Panda, velocity 0.05 rad/s",
            arm=panda.panda(),
            path=across,
            settings={"limits": pk.Limits(velocity=0.05)},
            needed=lambda: 0.5 / 1.5 * np.pi / 2 / (0.05 * 7 * 1.3),
            argument="the tool's speed at half time is at most Σ rᵢ q̇ᵢ, rᵢ ≤ 1.3 m",
        ),
        Case(
            name="Panda, a ball on the path",
            arm=panda.panda(),
            path=across,
            settings={"obstacles": [pk.obstacles.Sphere([0.45, 0.05, 0.3], 0.05)], "link_radius": 0.05},
            needed=lambda: 0.1 / 0.01,
            argument="the tool passes the center at less than 0.01 m",
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
                front = pk.Front(
                    ids=np.arange(len(values)),
                    objectives=values,
                    names=problem.names,
                    units=problem.units,
                    maximised=problem.maximised,
                    motions=stray,
                )
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
        rows.append(
            Row(
                table="Seconds to refusal",
                row=case.name,
                column=verb,
                unit="s of processor",
                ours=processor,
                reference=GOAL,
                source="goal",
                note=f"{clock:.2f} s of the clock" + (f"; {reason}" if verb == verbs[0] else ""),
            )
        )
    return [
        *rows,
        Row(
            table="Seconds to refusal",
            row=case.name,
            column="argument",
            unit="needed / allowed",
            ours=case.needed(),
            reference=1.0,
            source="feasible",
            note=case.argument,
        ),
    ]


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
