"""Problems drawn from seeds: arms, paths and objectives of many kinds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

import paretoik as pk
from paretoik.errors import ParetoikError
from paretoik.robot.kinematics import forward_kinematics
from paretoik.task.objectives import Objective
from problems.panda import panda

SAMPLES = 51
DRAWS = 200  # of a path, at most: the arm cannot reach many of them
INTEGRALS: tuple[Objective, ...] = (pk.kinetic_energy, pk.torque_norm)
PEAKS: tuple[Objective, ...] = (pk.peak_velocity, pk.peak_torque)
NONE = pk.Limits(velocity=np.inf, torque=np.inf)  # only the joints' ranges


@dataclass(frozen=True, kw_only=True)
class Case:
    """A problem drawn from a seed: an arm, the axes of its task, whether it is a cycle, and its objective."""

    arm: str
    axes: str  # "position", "axis" or "pose"
    cyclic: bool
    objective: Objective
    seed: int

    @property
    def name(self) -> str:
        """Name of the problem, unique."""
        kind = "cycle" if self.cyclic else "line"
        return f"{self.arm} {self.axes} {kind} {self.objective.name} {self.seed}"

    def problem(self) -> pk.Tracking:
        """Return the problem: the first draw that the arm can follow."""
        return _draw(self)


def planar(joints: int, rng: np.random.Generator) -> pk.Arm:
    """Return a planar arm with a total length of 1 m, random links, tapered masses."""
    lengths = rng.uniform(0.6, 1.4, joints)
    lengths /= lengths.sum()
    masses = 2.0 * np.linspace(1.0, 0.4, joints) * rng.uniform(0.7, 1.3, joints)
    return pk.Arm.planar(
        lengths=lengths,
        masses=masses,
        centers=lengths / 2,
        inertias=masses * lengths**2 / 12,
        position_limits=np.deg2rad(160.0),
        name=f"planar {joints}R",
    )


def rail(rng: np.random.Generator) -> pk.Arm:
    """Return a planar 3R arm on a rail along x."""
    lengths, masses = rng.uniform(0.2, 0.4, 3), rng.uniform(0.5, 1.5, 3)
    centers = np.stack([np.append(lengths / 2, 0.0)[[3, 0, 1, 2]], np.zeros(4), np.zeros(4)], axis=1)
    inertias = [
        np.zeros((3, 3)),
        *(np.diag([0.0, m * a**2 / 12, m * a**2 / 12]) for m, a in zip(masses, lengths, strict=True)),
    ]
    arm = pk.Arm.from_dh(
        a=[0.0, 0.0, lengths[0], lengths[1]],
        alpha=[0.0, np.pi / 2, 0.0, 0.0],
        d=np.zeros(4),
        theta=[-np.pi / 2, 0.0, 0.0, 0.0],
        types=["prismatic", "revolute", "revolute", "revolute"],
        masses=[rng.uniform(1.0, 4.0), *masses],
        centers=centers,
        inertias=inertias,
        convention="modified",
        position_limits=[0.8, *[np.deg2rad(160.0)] * 3],
        name="rail",
    )
    tool = pk.Pose(np.array([lengths[2], 0.0, 0.0]))
    return arm.with_tool(tool).mounted(base=pk.Pose.from_rpy((0, 0, 0), (0, np.pi / 2, 0)))


def _rods(a: np.ndarray, d: np.ndarray, masses: np.ndarray) -> dict[str, object]:
    """Return masses, centres and inertias of links as rods, in the frames at their far ends."""
    lengths = np.maximum(np.hypot(a, d), 0.05)
    centers = -0.5 * np.stack([a, np.zeros_like(a), np.zeros_like(a)], axis=1)
    return {
        "masses": masses,
        "centers": centers,
        "inertias": [np.eye(3) * m * (length**2 / 12 + 0.001) for m, length in zip(masses, lengths, strict=True)],
    }


def ur10(rng: np.random.Generator) -> pk.Arm:
    """Return Universal Robots' UR10: published DH table and masses, links as rods."""
    a, d = np.array([0, -0.612, -0.5723, 0, 0, 0]), np.array([0.1273, 0, 0, 0.163941, 0.1157, 0.0922])
    return pk.Arm.from_dh(
        a=a,
        alpha=[np.pi / 2, 0, 0, np.pi / 2, -np.pi / 2, 0],
        d=d,
        theta=np.zeros(6),
        convention="standard",
        position_limits=np.deg2rad(180.0),
        name="UR10",
        **_rods(a, d, np.array([7.778, 12.93, 3.87, 1.96, 1.96, 0.202])),  # type: ignore[arg-type]
    )


def iiwa(rng: np.random.Generator) -> pk.Arm:
    """Return KUKA's LBR iiwa 14: published DH table, limits and masses, links as rods."""
    a, d = np.zeros(7), np.array([0.36, 0, 0.42, 0, 0.4, 0, 0.126])
    quarter = np.pi / 2
    return pk.Arm.from_dh(
        a=a,
        alpha=[-quarter, quarter, quarter, -quarter, -quarter, quarter, 0],
        d=d,
        theta=np.zeros(7),
        convention="standard",
        position_limits=np.deg2rad([170, 120, 170, 120, 170, 120, 175]),
        name="iiwa",
        **_rods(a, d, np.array([3.95, 4.50, 2.45, 2.61, 3.41, 3.39, 0.35])),  # type: ignore[arg-type]
    )


def random_arm(rng: np.random.Generator) -> pk.Arm:
    """Return a 7R arm with a random DH table of quarter turns."""
    a, d = rng.uniform(0.0, 0.25, 7), rng.uniform(0.0, 0.25, 7)
    return pk.Arm.from_dh(
        a=a,
        alpha=rng.choice([-1.0, 1.0], 7) * np.pi / 2,
        d=d,
        theta=np.zeros(7),
        convention="standard",
        position_limits=np.deg2rad(160.0),
        name="random 7R",
        **_rods(a, d, np.linspace(4.0, 0.5, 7)),  # type: ignore[arg-type]
    )


ARMS: dict[str, Callable[[np.random.Generator], pk.Arm]] = {
    "planar 3R": lambda rng: planar(3, rng),
    "planar 4R": lambda rng: planar(4, rng),
    "planar 5R": lambda rng: planar(5, rng),
    "planar 6R": lambda rng: planar(6, rng),
    "rail": rail,
    "random 7R": random_arm,
    "UR10": ur10,
    "iiwa": iiwa,
    "Panda": lambda rng: panda(),
}


@lru_cache(maxsize=4)
def _draw(case: Case) -> pk.Tracking:
    rng = np.random.default_rng([case.seed, *case.arm.encode()])
    arm = ARMS[case.arm](rng)
    for _ in range(DRAWS):
        try:
            path = _path(arm, case, rng)
            return pk.Tracking(
                arm, path, objectives=[case.objective], cyclic=case.cyclic, limits=NONE, differences="backward"
            )
        except ParetoikError:
            continue
    raise AssertionError(f"{case.name}: no path that the arm can follow in {DRAWS} draws")


def _tool_pose(arm: pk.Arm, q: np.ndarray) -> pk.Pose:
    rotation, position = forward_kinematics(arm, q)
    return pk.Pose.from_matrix(rotation, position)


def _path(arm: pk.Arm, case: Case, rng: np.random.Generator) -> pk.Path | pk.Task:
    """Return a path between the positions of two postures, or a circle at one."""
    lower, upper = np.clip(arm.position_limits, -np.pi, np.pi).T
    q = rng.uniform(0.8 * lower, 0.8 * upper)
    ends = [q, np.clip(q + rng.normal(scale=0.7, size=arm.dof), 0.8 * lower, 0.8 * upper)]
    poses = [_tool_pose(arm, each) for each in ends]
    flat = case.arm == "rail" or arm.is_planar
    points = [pose.position[: 2 if flat else 3] for pose in poses]
    size = float(np.linalg.norm(points[1] - points[0]))
    if not 0.2 <= size <= 0.8:
        raise pk.InvalidInput(f"a path's length must be 0.2 to 0.8 m, got {size:.3g} m")
    settings = {"duration": float(rng.uniform(1.0, 2.0)), "samples": SAMPLES}
    posed = case.axes != "position"
    if case.cyclic:
        centre = pk.Pose(poses[0].position, poses[0].quaternion) if posed else points[0]
        path = pk.circle(centre, 0.3 * size, start_angle=float(rng.uniform(0, 2 * np.pi)), **settings)  # type: ignore[arg-type]
    elif posed:
        path = pk.line(poses[0], poses[1], **settings)  # type: ignore[arg-type]
    else:
        path = pk.line(points[0], points[1], **settings)  # type: ignore[arg-type]
    axes = {"position": "xy" if flat else "xyz", "axis": "xyz+z-axis", "pose": "pose"}[case.axes]
    return pk.Task(path, axes=axes)  # type: ignore[arg-type]


KINDS = (
    ("planar 4R", "position"),
    ("planar 5R", "position"),
    ("planar 6R", "position"),
    ("rail", "position"),
    ("random 7R", "axis"),
    ("random 7R", "pose"),
    ("UR10", "position"),
    ("UR10", "axis"),
    ("iiwa", "position"),
    ("iiwa", "axis"),
    ("iiwa", "pose"),
    ("Panda", "pose"),
)


def all_cases(seed: int) -> list[Case]:
    """Return 60 problems drawn from a seed: every kind as a line and a cycle for sums, and another draw for a peak."""
    sums = [
        Case(arm=arm, axes=axes, cyclic=cyclic, objective=objective, seed=seed)
        for arm, axes in KINDS
        for cyclic in (False, True)
        for objective in INTEGRALS
    ]
    peaks = [
        Case(arm=arm, axes=axes, cyclic=bool(i % 2), objective=PEAKS[i // 2 % 2], seed=seed + 1)
        for i, (arm, axes) in enumerate(KINDS)
    ]
    return sums + peaks
