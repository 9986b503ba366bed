"""The nonlinear program of directional maxima, for arms of any kind.

The unknowns are the joint positions q, the front sliders s if there are any, and the following. For each direction d of
speeds, they are the motors' speeds u and the tool's speed v; for each direction of forces, the force f; if required,
the power of speeds. The tool is at its position and moves along d, or pushes along d at rest with the torques g(q) + Jᵀ
f d, and every motor is within its curve. All of these functions are smooth; maxima over positions of sliders are not.
Source: Kim, Choi & Jang 2021, Eq. 1, for speeds only and one direction at a time; forces are dual to speeds by virtual
work.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.capability.actuation import Actuation, DistributedActuation
from paretoik.capability.actuator_kernels import gears
from paretoik.capability.joint_capability import Quantity, joint_speeds, torque_capacity
from paretoik.capability.user_functions import Lanes, LanesOf
from paretoik.nlp.dense.traced_rows import AssembledRows, TracedRows, trace_rows
from paretoik.robot import dynamics, kinematics
from paretoik.robot.arm import Arm
from paretoik.robot.arm_arguments import TOOL_FRAME


@dataclass(frozen=True, kw_only=True)
class DirectionalProgram:
    """The program of an arm along several directions in one posture.

    quantities: quantities along the directions
    power: whether the power of the motors and its upper bound are unknowns

    Units of unknowns (``scale``): 1 rad (m), a rod's length, a motor's highest speed, and ``sizes`` (directions,) of
    speeds [m/s] or forces [N]; powers are in W.
    """

    arm: Arm
    actuation: Actuation
    quantities: tuple[Quantity, ...]
    power: bool = False

    @cached_property
    def sizes(self) -> dict[str, tuple[int, ...]]:
        """Shape of every part of the unknowns, in order."""
        dof, several, moving = self.arm.dof, len(self.actuation.curves), self.quantities.count("velocity")
        return {
            "q": (dof,),
            "front": (dof * (several - 1),),
            "motors": (moving, several, dof),
            "values": (len(self.quantities),),
            "work": (moving * self.power, dof),
            "power": (int(self.power),),
        }

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Slice of every part of the unknowns."""
        return consecutive_slices({name: int(np.prod(shape)) for name, shape in self.sizes.items()})

    @property
    def unknowns(self) -> int:
        """Number of unknowns."""
        return int(self.slices["power"].stop)

    def scale(self, sizes: Float[np.ndarray, " directions"]) -> Float[np.ndarray, " unknowns"]:
        """Return the unit of each unknown."""
        scale = np.ones(self.unknowns)
        if isinstance(self.actuation, DistributedActuation):
            scale[self.slices["front"]] = self.actuation.rod
        fastest = np.stack([curve.fastest for curve in self.actuation.curves])
        scale[self.slices["motors"]] = np.broadcast_to(fastest, self.sizes["motors"]).ravel()
        scale[self.slices["values"]] = sizes
        return scale

    def parts(
        self, z: Float[np.ndarray, " unknowns"], sizes: Float[np.ndarray, " directions"]
    ) -> dict[str, np.ndarray]:
        """Return the unknowns by name, in SI units."""
        values = z * self.scale(sizes)
        return {name: values[place].reshape(self.sizes[name]) for name, place in self.slices.items()}

    def initial_point(self, q: Float[np.ndarray, " dof"]) -> Float[np.ndarray, " unknowns"]:
        """Return the unknowns of a posture at rest, with sliders at their best positions."""
        z = np.zeros(self.unknowns)
        z[self.slices["q"]] = q
        if isinstance(self.actuation, DistributedActuation):
            capacity, front = torque_capacity(self.actuation, q)
            if "velocity" in self.quantities:
                speeds = joint_speeds(self.actuation, q, dynamics.gravity_torques(self.arm, q))
                front = np.where(np.isnan(speeds.high), front, speeds.front_high)
            front = np.where(np.isnan(capacity), self.actuation.front_bounds.mean(axis=1), front)
            z[self.slices["front"]] = front / self.actuation.rod
        return z

    def posture_lanes(self, samples: int) -> LanesOf:
        """Return how users' functions of motions at rest depend on the unknowns."""
        joints, rates = np.arange(self.arm.dof)[None], [0.0] * (3 * samples * self.arm.dof)
        lanes = Lanes(where=joints, parameters=np.zeros((1, 0)), inputs=lambda q, _: ([*(q * samples), *rates], 1.0))
        return lambda *_: [lanes]

    def program(
        self,
        position: Float[np.ndarray, " task"],
        directions: Float[np.ndarray, "directions task"],
        sizes: Float[np.ndarray, " directions"],
    ) -> AssembledRows:
        """Return the program at a position along directions; it is traced once for all of them."""
        return _transcribe(self).at(np.concatenate([position, directions.ravel(), sizes]))


def consecutive_slices(sizes: Mapping[str, int]) -> dict[str, slice]:
    """Return the slices of parts of these sizes, one after the other."""
    ends = np.cumsum([0, *sizes.values()]).tolist()
    return {name: slice(a, b) for name, a, b in zip(sizes, ends[:-1], ends[1:], strict=True)}


@lru_cache(maxsize=32)
def _transcribe(settings: DirectionalProgram) -> TracedRows:
    arm, task, count = settings.arm, 2 if settings.arm.is_planar else 3, len(settings.quantities)

    def rows(z: list[Any], parameters: list[Any]) -> tuple[list[Any], list[Any]]:
        position, sizes = parameters[:task], parameters[-count:]
        directions = np.array(parameters[task:-count], dtype=object).reshape(count, task)
        scale: Any = settings.scale(np.ones(count)).astype(object)
        scale[settings.slices["values"]] = sizes
        at = {
            name: (np.array(z, dtype=object) * scale)[place].reshape(settings.sizes[name])
            for name, place in settings.slices.items()
        }
        q = list(at["q"])
        links = kinematics.link_frames(arm, q)
        frame = arm.frame(TOOL_FRAME)
        place = kinematics.frame_components(arm, links, frame)[1]
        columns = [pair[0][:task] for pair in kinematics.jacobian_components(arm, links, frame, place)]
        load = dynamics.torque_components(arm, q, [0.0] * arm.dof, [0.0] * arm.dof)
        equal: list[Any] = [place[a] - position[a] for a in range(task)]
        ratios, slacks = ratios_and_slacks(arm, settings.actuation, q, list(at["front"]))
        if "velocity" not in settings.quantities:  # rows of speeds contain these slacks too
            slacks += stall_slacks(settings.actuation, ratios, load)
        for k, (quantity, direction) in enumerate(zip(settings.quantities, directions, strict=True)):
            value, before = at["values"][k], settings.quantities[:k].count("velocity")
            if quantity == "force":
                force = [sum(c * d for c, d in zip(column, direction, strict=True)) for column in columns]
                torque = [gravity + value * share for gravity, share in zip(load, force, strict=True)]
                slacks += stall_slacks(settings.actuation, ratios, torque)
                continue
            motors = at["motors"][before]
            speeds = [sum(r * u for r, u in zip(ratios[j], motors[:, j], strict=True)) for j in range(arm.dof)]
            for a in range(task):
                moved = sum(column[a] * speed for column, speed in zip(columns, speeds, strict=True))
                equal.append((moved - value * direction[a]) / sizes[k])
            for m, curve in enumerate(settings.actuation.curves):
                effort = np.array([ratios[j][m] * load[j] for j in range(arm.dof)], dtype=object)
                slacks += list(curve.slacks(effort, motors[m]).ravel())
            if settings.power:
                work = at["work"][before]
                for j in range(arm.dof):
                    slacks += [work[j] - load[j] * speeds[j], work[j] + load[j] * speeds[j]]
                slacks.append(at["power"][0] - sum(work))
        return equal, slacks

    return trace_rows(settings.unknowns, task + (task + 1) * count, rows)


def stall_slacks(actuation: Actuation, ratios: list[tuple[Any, ...]], torque: list[Any]) -> list[Any]:
    """Return the slacks of motors at rest under torques [N m, N]. Motors with an infinite stall have none."""
    slacks = list[Any]()
    for m, curve in enumerate(actuation.curves):
        for j in np.flatnonzero(np.isfinite(curve.stall)):
            share = ratios[j][m] * torque[j] / curve.stall[j]
            slacks += [1.0 - share, 1.0 + share]
    return slacks


def ratios_and_slacks(
    arm: Arm, actuation: Actuation, q: list[Any], front: list[Any]
) -> tuple[list[tuple[Any, ...]], list[Any]]:
    """Return joints' speeds per speed of their motors, and the slacks of positions and sliders."""
    lower, upper = arm.position_limits.T
    slacks = [q[j] - lower[j] for j in np.flatnonzero(np.isfinite(lower))]
    slacks += [upper[j] - q[j] for j in np.flatnonzero(np.isfinite(upper))]
    if not isinstance(actuation, DistributedActuation):
        return [(1.0,)] * len(q), slacks
    ratios = list[tuple[Any, ...]]()
    for j, (back, a, b) in enumerate(gear_ratios(actuation, q, front)):
        rod, angle = actuation.rod[j], actuation.bend[j] * (q[j] - actuation.zero[j])
        ratios.append((actuation.bend[j] * a, actuation.bend[j] * b))
        for place, (low, high) in ((front[j], actuation.front_bounds[j]), (back, actuation.back_bounds[j])):
            slacks += [(place - low) / rod, (high - place) / rod]
        slacks.append(np.sin(angle) - np.sin(actuation.least_angle[j]))  # away from both toggles, in every turn
    return ratios, slacks


def gear_ratios(actuation: DistributedActuation, q: list[Any], front: list[Any]) -> list[tuple[Any, Any, Any]]:
    """Return each joint's back slider [m] and its ratios A and B [rad/m]."""
    angles = [sign * (x - zero) for sign, x, zero in zip(actuation.bend, q, actuation.zero, strict=True)]
    return [
        gears.py_func(np.sin(angle), np.cos(angle), s, rod)
        for angle, s, rod in zip(angles, front, actuation.rod, strict=True)
    ]
