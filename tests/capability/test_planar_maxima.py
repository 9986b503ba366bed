"""Planar arms with three joints, limits and weak motors, compared with a dense scan of their postures."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import paretoik as pk
from paretoik.capability.actuation import SHAPES
from paretoik.errors import Infeasible
from tests.robot.planar_postures import all_postures, statics

AROUND = 4000
ARMS = 60
GRAVITY = np.array([1.3, -9.7])


class Drawn:
    """A random arm, its motors, a position it reaches and directions, with formulae of its own."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.lengths, self.masses = rng.uniform(0.1, 0.5, 3), rng.uniform(0.2, 2.0, 3)
        self.centers = self.lengths * rng.uniform(0.2, 1.0, 3)
        middle, half = rng.uniform(-2.0, 2.0, 3), rng.uniform(0.3, 2.5, 3)
        without = rng.uniform(size=(2, 3)) < 0.2
        self.low, self.high = np.where(without, [[-np.inf], [np.inf]], [middle - half, middle + half])
        q = middle + half * rng.uniform(-1.0, 1.0, 3)
        (self.position,), _, (load,) = self.statics(q[None])
        self.stall = np.abs(load) * rng.uniform(1.0, rng.choice([1.02, 1.6]), 3) + 0.001
        self.fastest, self.shape = rng.uniform(0.5, 3.0, 3), SHAPES[seed % 3]
        turn = rng.uniform(-np.pi, np.pi, 5)
        self.directions = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        self.arm = pk.Arm.planar(
            lengths=self.lengths,
            masses=self.masses,
            centers=self.centers,
            inertias=[0.0] * 3,
            position_limits=(self.low, self.high),
        ).mounted(gravity=[*GRAVITY, 0.0])
        motors = pk.capability.MotorCurve(stall=self.stall, fastest=self.fastest, shape=self.shape)
        self.actuation = pk.capability.JointActuation(motors=motors)

    def maxima(self, quantity):
        return pk.directional_maxima(self.arm, self.actuation, self.position, self.directions, quantity=quantity)

    def statics(self, q):
        return statics(q, self.lengths, self.masses, self.centers, GRAVITY)

    def postures(self):
        """Return postures all around, with both bends of the elbow, within limits."""
        q = all_postures(self.lengths, self.position, np.linspace(-np.pi, np.pi, AROUND, endpoint=False))
        q = np.where(np.isfinite(self.low), q + 2 * np.pi * np.ceil((self.low - q) / (2 * np.pi)), q)
        q = np.where(np.isfinite(self.low), q, q - 2 * np.pi * np.maximum(np.ceil((q - self.high) / (2 * np.pi)), 0.0))
        return q[(q <= self.high).all(axis=1)]

    def values(self, q, quantity):
        """Return the maxima along each direction; NaN if some joint cannot hold."""
        _, columns, load = self.statics(q)
        share = load / self.stall
        held = (np.abs(share) <= 1.0).all(axis=1)
        if quantity == "force":
            pushed = np.einsum("paj,ka->pkj", columns, self.directions)
            left = np.where(pushed > 0, self.stall - load[:, None], self.stall + load[:, None])
            return np.where(held[:, None], (left / np.abs(pushed)).min(axis=2), np.nan)
        room = {"diamond": (1 - abs(share),) * 2, "box": (1 + 0 * share,) * 2}
        room["strip"] = np.minimum(1.0, 1 + share), np.minimum(1.0, 1 - share)
        low, high = (sign * each * self.fastest for sign, each in zip((-1, 1), room[self.shape], strict=True))
        speeds = [self.fastest_along(columns, low, high, way) for way in self.directions]
        return np.where(held[:, None], np.stack(speeds, axis=1), np.nan)

    @staticmethod
    def fastest_along(columns, low, high, way):
        """Solve a linear program with one equality: at its maximum all joints but one are at an end."""
        along, across = way @ columns, np.array([-way[1], way[0]]) @ columns
        best = np.zeros(len(columns))
        for free in range(3):
            i, j = [k for k in range(3) if k != free]
            for x, y in product((low[:, i], high[:, i]), (low[:, j], high[:, j])):
                with np.errstate(divide="ignore", invalid="ignore"):
                    z = -(across[:, i] * x + across[:, j] * y) / across[:, free]
                inside = (z >= low[:, free]) & (z <= high[:, free])
                speed = along[:, i] * x + along[:, j] * y + along[:, free] * np.where(inside, z, 0.0)
                best = np.where(inside, np.maximum(best, speed), best)
        return best


@pytest.fixture(scope="module", params=["velocity", "force"])
def compared(request):
    """Return for many arms: the arm, its maxima (None without any), and the maxima of all scanned postures."""
    cases = []
    for seed in range(ARMS):
        drawn = Drawn(seed)
        values = drawn.values(drawn.postures(), request.param)
        swept = np.nanmax(values, axis=0) if not np.isnan(values).all() else np.full(5, np.nan)
        try:
            polygon = drawn.maxima(request.param)
        except Infeasible:
            polygon = None
        cases.append((drawn, polygon, swept))
    return request.param, cases


def test_a_posture_is_found_if_one_holds(compared):
    held = [np.isfinite(swept).all() for *_, swept in compared[1]]
    assert sum(held) >= 0.9 * ARMS
    assert all(polygon is not None for (_, polygon, _), is_held in zip(compared[1], held, strict=True) if is_held)


def test_no_posture_of_thousands_exceeds_the_maxima(compared):
    shares = np.concatenate([swept / polygon.values for _, polygon, swept in compared[1] if np.isfinite(swept).all()])
    assert shares.max() <= 1 + 2e-3
    assert (shares <= 1 + 1e-6).mean() >= 0.95
    assert (shares >= 0.98).mean() >= 0.8  # and they come near


def test_found_maxima_are_possible_by_other_formulae(compared):
    quantity, cases = compared
    for drawn, polygon, _ in cases:
        if polygon is None:
            continue
        q = polygon.q
        tool, _, load = drawn.statics(q)
        assert tool == pytest.approx(np.tile(drawn.position, (5, 1)), abs=1e-12)
        assert (q >= drawn.low - 1e-9).all()
        assert (q <= drawn.high + 1e-9).all()
        assert np.abs(load / drawn.stall).max() <= 1 + 1e-9
        if quantity == "velocity":
            assert polygon.torque == pytest.approx(load, abs=1e-12)
        drawn.stall = drawn.stall * (1 + 1e-9)
        assert np.diagonal(drawn.values(q, quantity)) == pytest.approx(polygon.values, rel=1e-6, abs=1e-9)
