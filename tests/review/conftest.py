from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from paretoik.front.front import Front
from paretoik.review.recorder import Generation

NAMES = ("kinetic_energy", "torque_norm", "manipulability", "jerk", "$cost$")
UNITS = ("J s", "N²m²s", "", "rad²/s⁵", "€")
MAXIMISED = (False, False, True, False, False)


@dataclass(frozen=True, eq=False)
class Swing:
    """Motions of an arm of equal links, as much of a Motion as the review looks at."""

    q: np.ndarray
    time: np.ndarray
    planar: bool

    def __len__(self) -> int:
        return len(self.q)

    def __getitem__(self, index):
        return Swing(self.q[index], self.time[index], self.planar)

    @property
    def arm(self):
        dof = self.q.shape[-1]
        kinds = ("revolute",) * (dof - 1) + ("prismatic",)
        return SimpleNamespace(joint_names=tuple(f"j{n}" for n in range(dof)), joint_types=kinds, is_planar=self.planar)

    @property
    def dq(self) -> np.ndarray:
        return np.gradient(self.q, axis=-2)

    @property
    def torque(self) -> np.ndarray:
        return np.gradient(self.dq, axis=-2)

    @property
    def links(self) -> np.ndarray:
        angle = np.cumsum(self.q, axis=-1)
        height = np.zeros_like(angle) if self.planar else 0.5 * angle
        steps = np.stack([np.cos(angle), np.sin(angle), height], axis=-1)
        return np.concatenate([np.zeros_like(steps[..., :1, :]), np.cumsum(steps, axis=-2)], axis=-2)

    @property
    def tool(self) -> np.ndarray:
        return self.links[..., -1, : 2 if self.planar else 3]


def swing(points: int, *, planar: bool, dof: int = 3, samples: int = 11) -> Swing:
    time = np.tile(np.linspace(0.0, 1.0, samples), (points, 1))
    spread = np.linspace(0.2, 1.0, points)[:, None, None]
    return Swing(spread * np.sin(time)[..., None] * np.linspace(0.3, 1.0, dof), time, planar)


def trade_off(points: int, n_obj: int) -> np.ndarray:
    """Points on a sphere's corner, mutually non-dominated in the user's own sign."""
    if n_obj == 1:
        return np.full((1, 1), 0.25)
    directions = np.abs(np.random.default_rng(n_obj).normal(size=(points, n_obj)))
    minimised = 2.0 - directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return minimised * np.where(MAXIMISED[:n_obj], -1.0, 1.0)


@pytest.fixture
def make_front():
    def make(n_obj: int, *, points: int = 12, planar: bool = True, moving: bool = True) -> Front:
        objectives = trade_off(points, n_obj)
        motions = swing(len(objectives), planar=planar) if moving else None
        return Front(
            ids=np.arange(len(objectives)) + 100,
            objectives=objectives,
            names=NAMES[:n_obj],
            units=UNITS[:n_obj],
            maximised=MAXIMISED[:n_obj],
            motions=motions,
        )

    return make


@pytest.fixture
def make_generations():
    def make(n_obj: int, *, count: int = 4, points: int = 12) -> list[Generation]:
        sign = np.where(MAXIMISED[:n_obj], -1.0, 1.0)
        generations = []
        for number in range(count):
            front = trade_off(points, n_obj) + sign * (count - 1 - number)
            population = np.concatenate([front + sign, np.full((1, n_obj), np.nan)])
            ids = np.arange(len(front)) + 100
            generations.append(
                Generation(
                    number=number, population=population, front=front, front_ids=ids, hypervolume=number + 0.5, failed=1
                )
            )
        return generations

    return make
