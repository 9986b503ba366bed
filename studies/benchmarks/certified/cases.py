"""The problems, their certified fronts, and the certificates' statements; objectives recomputed by Pinocchio."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

import paretoik as pk
from paretoik.front.certificates import Certificates
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.transcription import MotionProgram, motion_program
from problems import panda, tringali_2020
from studies.benchmarks.kinematics import pinocchio_model
from studies.benchmarks.peers.programs import joint_program, spline_program, staged_program
from studies.benchmarks.peers.solvers import Peer, compiled
from studies.reporting import Row, goal_row, tell, timed

WITH_DYNAMICS = ("kinetic_energy", "torque_norm", "peak_torque")


def recomputed_difference(task: MotionTask, q: np.ndarray, values: np.ndarray, ranges: np.ndarray) -> float:
    """Return the largest difference of values (points, n_obj) from Pinocchio's, as a share of the ranges.

    Objectives that need no dynamics are left out.
    """
    import pinocchio

    columns = [k for k, objective in enumerate(task.objectives) if objective.name in WITH_DYNAMICS]
    model, worst = pinocchio_model(task.arm), 0.0
    data = model.createData()
    for one, stated in zip(q, values, strict=True):
        at = task.motion(one).instants
        energy = [pinocchio.computeKineticEnergy(model, data, *each) for each in zip(at.q, at.dq, strict=True)]
        torque = np.array([pinocchio.rnea(model, data, *each) for each in zip(at.q, at.dq, at.ddq, strict=True)])
        by_name = {
            "kinetic_energy": float(energy @ at.weights),
            "torque_norm": float(np.sum(torque**2, axis=1) @ at.weights),
            "peak_torque": float(np.abs(torque).max()),
        }
        theirs = np.array([by_name[task.objectives[k].name] for k in columns])
        worst = max(worst, float((np.abs(theirs - stated[columns]) / ranges[columns]).max()))
    return worst


HOLDS = 1e-8  # of limits' ranges
TRACKED = 1e-9  # m and rad
CRITICAL = 1e-6
RECOMPUTED = 1e-9  # of the ranges
FIRST_POINTS, FIRST_STARTS = 3, 8  # of the call that compiles


@dataclass(frozen=True, kw_only=True)
class Case:
    """A problem, the number of its front's points, and whether its seconds are compared with peers'."""

    name: str
    make: Callable[[], pk.Tracking]
    points: int
    raced: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class Subject:
    """A certified front that is tested.

    ``ranges`` (n_obj,) are the objectives' ranges on the whole front, ``peer`` is IPOPT's program of its task,
    ``staged`` FATROP's if seconds are compared; ``seconds`` and ``cpu`` (processor) are those of the front.
    """

    name: str
    front: pk.Front
    task: MotionTask
    ranges: np.ndarray
    peer: Peer
    seconds: float
    cpu: float
    staged: Peer | None = None

    @property
    def q(self) -> np.ndarray:
        """Motions (points, time, dof)."""
        assert self.front.motions is not None
        return np.asarray(self.front.motions.q)

    @property
    def values(self) -> np.ndarray:
        """Objectives (points, n_obj), minimised."""
        return np.asarray(self.front.minimised)

    @property
    def certificates(self) -> Certificates:
        """The front's certificates of its points."""
        assert self.front.certificates is not None
        return self.front.certificates

    @cached_property
    def program(self) -> MotionProgram:
        """Our own program, objectives divided by their ranges."""
        return motion_program(self.task, self.ranges)


def five_joints() -> pk.Tracking:
    """Return kinetic energy against torque norm of a planar 5R arm that also turns its tool."""
    lengths = [0.25, 0.22, 0.20, 0.15, 0.10]
    masses = [1.0, 0.8, 0.6, 0.4, 0.2]
    arm = pk.Arm.planar(
        lengths=lengths,
        masses=masses,
        centers=[length / 2 for length in lengths],
        inertias=[mass * length**2 / 12 for mass, length in zip(masses, lengths, strict=True)],
    )
    start, end = pk.Pose.from_rpy((0.55, -0.15, 0.0), (0, 0, 0)), pk.Pose.from_rpy((0.35, 0.35, 0.0), (0, 0, 0.6))
    return pk.Tracking(
        arm,
        pk.line(start, end, duration=1.0, samples=101),
        objectives=[pk.kinetic_energy, pk.torque_norm],
        limits=pk.Limits(position=np.deg2rad(150.0), velocity=4.0),
        differences="backward",
    )


def panda_by_position() -> pk.Tracking:
    """Return the Panda across its table, its hand free to turn."""
    whole = panda.across_the_table().task
    (only,) = whole.tasks
    start, end = only.path.positions[[0, -1]]
    path = pk.line(start, end, duration=float(whole.times[-1]), samples=len(whole.times))
    return pk.Tracking(panda.panda(), path, objectives=whole.objectives, differences="backward")


def three_joints_by_splines() -> pk.Tracking:
    """Return kinetic energy, torque norm and peak torque of the planar 3R arm, by splines."""
    return pk.Tracking(
        pk.arms.tringali_3r(),
        tringali_2020.straight(51),
        objectives=[pk.kinetic_energy, pk.torque_norm, pk.peak_torque],
        limits=pk.Limits(position=tringali_2020.POSITION, velocity=tringali_2020.VELOCITY),
    )


CASES = (
    Case(name="energy_torque", make=tringali_2020.energy_torque, points=20),
    Case(name="planar 5R", make=five_joints, points=10),
    Case(name="Panda", make=panda.across_the_table, points=20, raced=True),
    Case(name="Panda by position", make=panda_by_position, points=10, raced=True),
    Case(name="3R, a peak, splines", make=three_joints_by_splines, points=10),
)


def subject_of(case: Case, *, points: int, seed: int, folder: Path) -> Subject:
    """Return a case's certified front and IPOPT's program, compiled into a folder if there is a compiler."""
    tell(f"{case.name}: first front")
    problem = case.make()
    pk.epsilon_front(problem, points=FIRST_POINTS, starts=FIRST_STARTS, seed=seed)
    tell(f"{case.name}: {points} points")
    front, seconds, cpu = timed(lambda: pk.epsilon_front(problem, points=points, seed=seed))
    task = front.problem.task  # with the samples that refinement added, if any
    tell(f"{case.name}: the peers' programs")
    begun, named = time.perf_counter(), case.name.replace(" ", "_")
    peer = spline_program(task) if task.differences == "spline" else compiled(joint_program(task), named, folder)
    staged = compiled(staged_program(task), f"{named}_staged", folder) if case.raced else None
    tell(f"{case.name}: that took {time.perf_counter() - begun:.0f} s")
    return Subject(
        name=case.name,
        front=front,
        task=task,
        ranges=np.ptp(front.minimised, axis=0),
        peer=peer,
        seconds=seconds,
        cpu=cpu,
        staged=staged,
    )


def certificate_rows(subject: Subject) -> list[Row]:
    """Return the certificates' statements, the worst of all points."""
    certificates, task, points = subject.certificates, subject.task, len(subject.q)
    table, row, share = subject.name, "certificates", "share of range"
    counts = Counter(certificates.status.tolist())
    off = float(task.motion(subject.q).tracking_error.max())
    at, worst = int(certificates.violation_between.argmax()), float(certificates.violation_between.max())
    fine = task.resample(4 * (len(task.times) - 1) + 1)
    between = fine.motion(task.motion(subject.q[at]).at(fine.times))
    recomputed = recomputed_difference(task, subject.q, subject.values, subject.ranges)
    weak = f"{np.count_nonzero(certificates.weak)} weak: an objective without weight"
    statuses = ", ".join(f"{count} {status}" for status, count in counts.most_common())
    return [
        Row(table, row, "points", "", points, note=weak),
        goal_row(table, row, "worst violation at samples", share, float(certificates.violation.max()), HOLDS),
        Row(table, row, "worst violation between", share, worst, note=fine.describe_violation(between)),
        goal_row(table, row, "values recomputed by Pinocchio", share, recomputed, RECOMPUTED),
        goal_row(table, row, "worst tracking error", "m, rad", off, TRACKED),
        goal_row(table, row, "worst criticality", share, float(certificates.criticality.max()), CRITICAL),
        goal_row(table, row, "not a minimum", "points", points - counts["minimum"], 0, statuses),
    ]
