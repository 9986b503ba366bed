"""The same problems in other units: of time, length and mass, and of the objective."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import paretoik as pk
from problems import panda, tringali_2020


@dataclass(frozen=True, kw_only=True)
class Units:
    """Factors of the numbers of seconds, metres and kilograms, and of an objective's numbers."""

    time: float = 1.0
    length: float = 1.0
    mass: float = 1.0
    objective: float = 1.0

    def of(self, kind, arm):
        """Factors of a limit on joints, (dof,)."""
        joint = np.where(arm.periodic, 1.0, self.length)
        energy = self.mass * self.length**2 / self.time**2
        return {
            "position": joint,
            "velocity": joint / self.time,
            "acceleration": joint / self.time**2,
            "torque": energy / joint,
            "power": np.full(arm.dof, energy / self.time),
        }[kind]

    def of_objective(self, name):
        """Factor of an objective."""
        energy = self.mass * self.length**2 / self.time**2
        return {
            "kinetic_energy": energy * self.time,
            "torque_norm": energy**2 * self.time,  # of revolute joints
            "mechanical_energy": energy,
            "peak_torque": energy,
            "joint_travel": 1.0,
        }[name] * self.objective


def scaled_pose(pose, units):
    return pk.Pose(units.length * pose.position, pose.quaternion)


def scaled_arm(arm, units):
    """The arm with all its numbers in other units, its own limits too."""
    bodies = [
        replace(
            body,
            mass=units.mass * body.mass,
            center=units.length * body.center,
            inertia=units.mass * units.length**2 * body.inertia,
        )
        for body in arm.bodies
    ]
    return replace(
        arm,
        placements=tuple(scaled_pose(pose, units) for pose in arm.placements),
        bodies=tuple(bodies),
        tool=scaled_pose(arm.tool, units),
        base=scaled_pose(arm.base, units),
        gravity=units.length / units.time**2 * arm.gravity,
        position_limits=units.of("position", arm)[:, None] * arm.position_limits,
        velocity_limits=units.of("velocity", arm) * arm.velocity_limits,
        torque_limits=units.of("torque", arm) * arm.torque_limits,
    )


def scaled_objective(name, units):
    """An objective of the library times the unit of objectives."""
    of_library = getattr(pk, name)
    return replace(of_library, function=lambda motion: units.objective * of_library.function(motion))


def problem(arm, path, units, objectives, limits=None, clearance=0.0, **settings):
    """A problem of a scaled arm, its limits given in the original's units: symmetric, or (lower, upper)."""
    bounds = {}
    for kind, value in (limits or {}).items():
        scale = units.of(kind, arm)
        bounds[kind] = tuple(scale * side for side in value) if isinstance(value, tuple) else scale * np.asarray(value)
    return pk.Tracking(
        arm,
        path,
        objectives=[scaled_objective(name, units) for name in objectives],
        limits=pk.Limits(**bounds, clearance=units.length * clearance),
        **{"differences": "backward", "bases": 4} | settings,
    )


JOINTS = {"position": tringali_2020.POSITION, "velocity": tringali_2020.VELOCITY}


def straight(units, objectives, samples=51, limits=JOINTS, **settings):
    """A planar 3R arm along a line."""
    arm = scaled_arm(pk.arms.tringali_3r(), units)
    start, end = units.length * np.array(tringali_2020.START), units.length * np.array(tringali_2020.END)
    path = pk.line(start, end, duration=units.time, samples=samples)
    return problem(arm, path, units, objectives, limits, **settings)


def past_an_obstacle(units, objectives, clearance=0.005, **settings):
    """The arm along the line, with a disc next to it."""
    disc = pk.obstacles.Circle(units.length * np.array([0.3, -0.12]), units.length * 0.05)
    radius = units.length * 0.01
    return straight(units, objectives, obstacles=[disc], link_radius=radius, clearance=clearance, **settings)


def on_a_rail(units, objectives, joints=3, samples=26, **settings):
    """A planar arm on a rail along x."""
    lengths, masses = np.array([0.4, 0.35, 0.25])[:joints], np.array([3.0, 2.0, 1.4, 0.8])[: joints + 1]
    rods = [np.eye(3) * mass * length**2 / 12 for mass, length in zip(masses[1:], lengths, strict=True)]
    arm = pk.Arm.from_dh(
        a=[0.0, 0.0, *lengths[:-1]],
        alpha=[0.0, -np.pi / 2, *[0.0] * (joints - 1)],
        d=np.zeros(joints + 1),
        theta=np.zeros(joints + 1),
        types=["prismatic", *["revolute"] * joints],
        masses=masses,
        centers=[[0.0, 0.0, 0.0], *[[length / 2, 0.0, 0.0] for length in lengths]],
        inertias=[np.zeros((3, 3)), *rods],
        convention="modified",
        position_limits=[0.6, *[2.8] * joints],
        velocity_limits=[1.0, *[3.0] * joints],
        name="rail",
    )
    along_x = np.eye(4)
    along_x[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    arm = arm.with_tool(pk.Pose([lengths[-1], 0.0, 0.0])).mounted(base=pk.Pose.from_matrix(along_x), gravity=[0, 0, 0])
    start, end = units.length * np.array([-0.3, 0.5]), units.length * np.array([0.5, 0.45])
    path = pk.line(start, end, duration=units.time, samples=samples)
    return problem(scaled_arm(arm, units), path, units, objectives, **settings)


def of_a_panda(units, objectives, samples=26, **settings):
    """The Panda across a table, under gravity."""
    ends = [pk.Pose.from_rpy((0.45, y, 0.3), panda.DOWN) for y in (-0.25, 0.25)]
    path = pk.line(*(scaled_pose(pose, units) for pose in ends), duration=1.5 * units.time, samples=samples)
    return problem(scaled_arm(panda.panda(), units), path, units, objectives, **settings)
