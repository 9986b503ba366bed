"""Figure 9 and Table 4: the motors' work on the way from p4 to p6, and the energy ∫ |effort · speed| dt of each.

The paper defines neither its energy nor how postures follow the path. Two choices are compared: the soonest postures
that do not jump, and, as in its models, the directional maxima themselves, which may jump.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

import paretoik as pk
from paretoik.capability.joint_capability import joint_speeds
from paretoik.robot.dynamics import gravity_torques
from studies.kim_2021.maxima import ENERGY_UNPRINTED, MECHANISMS, actuation_of, beside_paper, paper
from studies.kim_2021.postures import Mechanism, Profile, evenly, resolved
from studies.kim_2021.trajectories import Trajectory
from studies.reporting import Row

TABLE, JUMPING, SOONEST = "Table 4", "Table 4, by the maxima themselves", "postures along the trajectory of Figure 8"
COLUMNS = {"JAM": (("joint 1", "joint 2", "joint 3"),), "DAM": (("s1", "s2", "s3"), ("s1b", "s2b", "s3b"))}
EXCHANGED = "; the joints' work; a joint's two sliders may be exchanged, and their shares with them"


@dataclass(frozen=True, kw_only=True, eq=False)
class Driven:
    """The motors' efforts and speeds in the middles of a path's pieces, ``lasting`` (pieces,) [s].

    ``efforts`` [N m, N] and ``speeds`` [rad/s, m/s] are (pieces, motors, 3); ``sliders`` (pieces, 2, 3) [m] front and
    back, None for joint motors.
    """

    lasting: Float[np.ndarray, " pieces"]
    q: Float[np.ndarray, "pieces 3"]
    efforts: Float[np.ndarray, "pieces motors 3"]
    speeds: Float[np.ndarray, "pieces motors 3"]
    sliders: Float[np.ndarray, "pieces 2 3"] | None

    @property
    def times(self) -> Float[np.ndarray, " pieces"]:
        """The middles [s]."""
        middles: np.ndarray = np.cumsum(self.lasting) - self.lasting / 2
        return middles

    @property
    def energy(self) -> Float[np.ndarray, "motors 3"]:
        """∫ |effort · speed| dt of every motor [J]."""
        energies: np.ndarray = np.einsum("imj,i->mj", np.abs(self.efforts * self.speeds), self.lasting)
        return energies


class Postures(NamedTuple):
    """A mechanism's ways along its trajectory: ``soonest`` without a jump, and ``maxima`` that jump."""

    mechanism: str
    soonest: Profile
    driven: Driven
    maxima: Driven


def postures(one: Trajectory, *, pieces: int, cell: float) -> Postures:
    """Return the postures of a mechanism along its trajectory, by a grid of pieces, made four times finer."""
    mechanism = Mechanism(arm=pk.arms.kim_3r(), actuation=actuation_of(one.mechanism))
    soonest = resolved(mechanism, one.path, pieces=pieces, cell=cell)
    maxima = along_maxima(mechanism, evenly(one.path, 4 * pieces))
    return Postures(one.mechanism, soonest, along_profile(mechanism, soonest), maxima)


def along_profile(mechanism: Mechanism, profile: Profile) -> Driven:
    """Return the motors' work along a profile, with every slider in its best position at every moment."""
    seconds = np.diff(profile.times)
    q = profile.q[:-1] + profile.turned / 2
    rate, torque = profile.turned / seconds[:, None], gravity_torques(mechanism.arm, q)
    motors = mechanism.actuation
    if isinstance(motors, pk.capability.JointActuation):
        return Driven(lasting=seconds, q=q, efforts=torque[:, None], speeds=rate[:, None], sliders=None)
    capability = joint_speeds(motors, q, torque)
    front = np.where(rate >= 0, capability.front_high, capability.front_low)
    assert np.array_equal(motors.front_bounds, motors.back_bounds)
    back = motors.gears(q, front)[0]
    for i in range(1, len(front)):  # front and back sliders do not swap: with equal bounds, both are equally good
        swapped = np.abs(back[i] - front[i - 1]) < np.abs(front[i] - front[i - 1])
        front[i] = np.where(swapped, back[i], front[i])
    back, *gears = motors.gears(q, front)
    ratios = np.stack(gears, axis=1)
    efforts = ratios * torque[:, None]
    highest = np.stack([curve.speeds(efforts[:, m])[1] for m, curve in enumerate((motors.front, motors.back))], axis=1)
    directions = np.sign(ratios) * highest  # both push the joint up at full speed: the diamond is even
    speeds = directions * (rate / (ratios * directions).sum(axis=1))[:, None]
    return Driven(lasting=seconds, q=q, efforts=efforts, speeds=speeds, sliders=np.stack([front, back], axis=1))


def along_maxima(mechanism: Mechanism, points: Float[np.ndarray, "n 2"]) -> Driven:
    """Return the motors' work in the maximising postures."""
    change, middle = np.diff(points, axis=0), (points[1:] + points[:-1]) / 2
    maxima = [
        pk.directional_maxima(mechanism.arm, mechanism.actuation, place, way[None])
        for place, way in zip(middle, change, strict=True)
    ]
    seconds = np.linalg.norm(change, axis=1) / np.array([each.values[0] for each in maxima])
    return Driven(
        lasting=seconds,
        q=np.array([each.q[0] for each in maxima]),
        efforts=np.stack([each.motor_efforts[0] for each in maxima]),
        speeds=np.stack([each.motor_speeds[0] for each in maxima]),
        sliders=None if maxima[0].sliders is None else np.stack([each.sliders[0] for each in maxima]),  # type: ignore[index]  # all or none
    )


def posture_rows(by_mechanism: dict[str, Postures], trajectories: dict[str, Trajectory]) -> list[Row]:
    """Return the soonest arrival at p6 on the trajectory's path without jumps, and the claimed one."""
    rows = []
    for name, one in by_mechanism.items():
        claimed, soonest = trajectories[name].run.arrival, one.soonest.times[-1]
        prefix = "LOSS: " if soonest > 1.01 * claimed else ""
        note = f"{prefix}{100 * (soonest / claimed - 1):+.1f} % relative to the arrival by ellipses, {claimed:.4g} s"
        rows.append(beside_paper((SOONEST, name, "soonest, postures do not jump"), "s", soonest, note))
    first, second = (by_mechanism[name].soonest.times[-1] for name in MECHANISMS)
    prefix = "LOSS: DAM is later" if second > first else ""
    return [*rows, beside_paper((SOONEST, "DAM beside JAM", "soonest"), "%", 100 * (second / first - 1), prefix)]


def table_4(by_mechanism: dict[str, Postures]) -> list[Row]:
    """Return the energy of every motor, for both kinds of postures."""
    rows = []
    for table, what in ((TABLE, "driven"), (JUMPING, "maxima")):
        totals = []
        for name, one in by_mechanism.items():
            energy = 1e3 * getattr(one, what).energy
            totals.append(float(energy.sum()))
            values = dict(zip(np.ravel(COLUMNS[name]).tolist(), energy.ravel(), strict=True)) | {"total": totals[-1]}
            for column, ours in values.items():
                printed = paper()[TABLE, name, column]
                more = EXCHANGED if (name, column) == ("DAM", "total") else ""
                note = f"{100 * (ours / printed - 1):+.0f} %{more}; {ENERGY_UNPRINTED}"
                rows.append(Row(table, name, column, "mJ", ours, reference=printed, note=note))
        share, printed = 100 * (totals[1] / totals[0] - 1), paper()[TABLE, "DAM beside JAM", "total"]
        note = f"{'LOSS: DAM takes more; ' if share > 0 else ''}{ENERGY_UNPRINTED}"
        rows.append(Row(table, "DAM beside JAM", "total", "%", share, reference=printed, note=note))
    return rows
