"""How the gain of sliders over joint motors depends on numbers that the paper does not print."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import Any, Literal

import numpy as np

import paretoik as pk
from paretoik.capability.actuation import LEAST_ROD_ANGLE
from paretoik.errors import Infeasible
from studies.kim_2021.polygons import EQUAL
from studies.kim_2021.setting import DIRECTIONS, POSITIONS, beside_paper, paper
from studies.reporting import Row

TABLE = "what the paper does not print, one change at a time"
FLOOR = "what the least rod angle of 10° costs sliders: their speed below that with a smaller one"
NEAREST = "which settings come near the paper's statements at p6"
LEAST_ANGLES = (5.0, 10.0, 20.0, 30.0)  # degrees
SMALLER_ANGLES = (5.0, 2.0, 0.1)  # degrees: at 0.1° almost nothing is left out
SHOWN = 5
MASSES = (0.0, 0.1, 0.25, 0.5, 0.8)  # kg a link


@dataclass(frozen=True, kw_only=True)
class Assumptions:
    """The assumptions: kg per link, degrees, the bend of joints, motor curves, whether JAM has DAM's joints.

    ``joint_ranges`` gives JAM the joint ranges that rods and sliders impose on DAM; without them, its joints turn
    freely.
    """

    mass: float = 0.5
    base_angle: float = -120.0
    bend: Literal[-1, 1] = 1
    least_angle: float = float(np.rad2deg(LEAST_ROD_ANGLE))
    shape: Literal["diamond", "strip"] = "diamond"
    joint_ranges: bool = False

    def __str__(self) -> str:
        changed = [field.name for field in fields(self) if getattr(self, field.name) != field.default]
        words = [
            f"{name.replace('_', ' ')} {value:g}"
            if isinstance(value := getattr(self, name), int | float)
            else str(value)
            for name in changed
            if name != "joint_ranges"
        ]
        return ", ".join(words + ["JAM with DAM's joint ranges"] * self.joint_ranges) or "as is"

    @property
    def motors(self) -> pk.capability.JointActuation:
        """JAM."""
        known = pk.capability.kim_joint_motors().motors
        return pk.capability.JointActuation(motors=_shaped(known, self.shape))

    @property
    def sliders(self) -> pk.capability.DistributedActuation:
        """DAM."""
        known = pk.capability.kim_sliders(float(np.deg2rad(self.base_angle)), self.bend)
        return pk.capability.DistributedActuation(
            front=_shaped(known.front, self.shape),
            rod=known.rod,
            front_bounds=known.front_bounds,
            zero=known.zero,
            bend=known.bend,
            least_angle=np.deg2rad(self.least_angle),
        )

    @property
    def free(self) -> pk.Arm:
        """The arm with these masses, as DAM has it: its rods limit its joints."""
        return pk.arms.kim_3r([self.mass] * 3)

    @property
    def limited(self) -> pk.Arm:
        """The arm as JAM has it."""
        if not self.joint_ranges:
            return self.free
        known = self.sliders
        ends = known.angle_bounds.T * known.bend + known.zero
        return replace(self.free, position_limits=np.sort(ends, axis=0).T)


def gains(assumed: Assumptions, names: Sequence[str], directions: int = DIRECTIONS) -> np.ndarray:
    """Return the gain of DAM (positions, directions). Raises Infeasible if either cannot hold the arm."""
    shares = []
    for name in names:
        speeds = []
        for what, arm, motors in (
            ("JAM", assumed.limited, assumed.motors),
            ("DAM", assumed.free, assumed.sliders),
        ):
            try:
                speeds.append(pk.directional_maxima(arm, motors, POSITIONS[name], directions).values)
            except Infeasible as fault:
                raise Infeasible(f"{what} at {name}: {fault}", limit=fault.limit) from fault
        shares.append(speeds[1] / speeds[0] - 1.0)
    return np.array(shares)


def changes(*, angles: Sequence[float]) -> Iterator[Assumptions]:
    """Yield the assumptions, first as they are, then with one changed at a time."""
    yield Assumptions()
    usual = Assumptions()
    for name, values in (
        ("mass", MASSES),
        ("base_angle", angles),
        ("bend", (-1,)),
        ("least_angle", LEAST_ANGLES),
        ("shape", ("strip",)),
        ("joint_ranges", (True,)),
    ):
        for value in values:
            if value != getattr(usual, name):
                changed: Any = {name: value}
                yield replace(usual, **changed)


def sensitivity_rows(*, angles: Sequence[float]) -> list[Row]:
    """Return the gains at p6 and at all nine positions for every change; NaN and the reason if nothing holds."""
    rows = []
    for assumed in changes(angles=angles):
        for name, places in (("p6", ("p6",)), ("all nine", tuple(POSITIONS))):
            row = f"{name}: {assumed}"
            try:
                gain = gains(assumed, places)
            except Infeasible as fault:
                rows.append(beside_paper((TABLE, row, "gain mean"), "%", np.nan, f"cannot hold: {fault}"))
                continue
            better = np.count_nonzero(gain > EQUAL)
            note = f"least {100 * gain.min():+.1f} %, largest {100 * gain.max():+.1f} %"
            note += f"; DAM is faster in {better} of {gain.size} directions"
            rows.append(beside_paper((TABLE, row, "gain mean"), "%", 100 * gain.mean(), note))
    return rows


def floor_rows() -> list[Row]:
    """Return by how much the default least rod angle lowers the sliders' speeds at the nine positions.

    At a toggle the rod lies along both links: there sliders turn a joint ever faster, over ever shorter ways.
    """
    usual = _slider_speeds(Assumptions())
    rows = []
    for angle in SMALLER_ANGLES:
        cost = 100 * (1.0 - usual / _slider_speeds(Assumptions(least_angle=angle)))
        note = f"none in {np.count_nonzero(cost < 0.1)} of {cost.size} directions, largest {cost.max():.0f} %"
        rows.append(beside_paper((FLOOR, f"against {angle:g}°", "cost mean"), "%", cost.mean(), note))
    return rows


def _slider_speeds(assumed: Assumptions) -> np.ndarray:
    """Return the directional maxima of DAM (positions, directions) [m/s]."""
    arm, sliders = assumed.free, assumed.sliders
    return np.array([pk.directional_maxima(arm, sliders, place, DIRECTIONS).values for place in POSITIONS.values()])


def nearest_rows(*, angles: Sequence[float], masses: Sequence[float] = MASSES) -> list[Row]:
    """Return how many combinations hold the arm and agree with the paper, and the nearest ones."""
    printed = paper()["Figures 5 and 6", "p6", "gain largest"]
    tried, feasible = 0, list[tuple[Assumptions, np.ndarray]]()
    shapes: tuple[Literal["diamond", "strip"], ...] = ("diamond", "strip")
    bends: tuple[Literal[-1, 1], ...] = (1, -1)
    for mass, angle, bend, shape, ranges in product(masses, angles, bends, shapes, (False, True)):
        assumed = Assumptions(mass=mass, base_angle=angle, bend=bend, shape=shape, joint_ranges=ranges)
        tried += 1
        try:
            feasible.append((assumed, 100 * gains(assumed, ("p6",))[0]))
        except Infeasible:
            continue
    better = [(assumed, gain) for assumed, gain in feasible if gain.min() > 100 * EQUAL]
    rows = [
        beside_paper(
            (NEAREST, "combinations", "tried"), "", tried, "mass, base angle, bend, curve, JAM's joint ranges"
        ),
        beside_paper((NEAREST, "combinations", "in which both hold the arm at p6"), "", len(feasible)),
        beside_paper((NEAREST, "combinations", "in which DAM is faster in all 16 directions"), "", len(better)),
    ]
    for assumed, gain in sorted(better, key=lambda one: abs(one[1].max() - printed))[:SHOWN]:
        note = f"gain least {gain.min():+.1f} %, mean {gain.mean():+.1f} %; looked up afterwards, used nowhere else"
        rows.append(_near(assumed, gain, printed, note))
    for assumed, gain in sorted(feasible, key=lambda one: abs(one[1].max() - printed))[:1]:
        note = f"nearest of all that hold: DAM is faster in {np.count_nonzero(gain > 0)} of {len(gain)} directions"
        rows.append(_near(assumed, gain, printed, note))
    return rows


def _near(assumed: Assumptions, gain: np.ndarray, printed: float, note: str) -> Row:
    return Row(
        table=NEAREST,
        row=str(assumed),
        column="gain largest",
        unit="%",
        ours=float(gain.max()),
        reference=printed,
        note=note,
    )


def _shaped(curve: pk.capability.MotorCurve, shape: Literal["diamond", "strip"]) -> pk.capability.MotorCurve:
    return pk.capability.MotorCurve(stall=curve.stall, fastest=curve.fastest, shape=shape)
