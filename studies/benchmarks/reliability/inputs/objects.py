"""The arms, problems, fronts and plans of good calls."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

import paretoik as pk
from problems import kim_2021, marcos_2012, wan_2018


class Objects:
    """The objects of good arguments, made when first needed, in a folder of their own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @cached_property
    def arm(self) -> pk.Arm:
        """A planar arm of three joints."""
        return pk.arms.tringali_3r()

    @cached_property
    def path(self) -> pk.Path:
        """A line that the arm follows."""
        return pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=21)

    @cached_property
    def problem(self) -> pk.Tracking:
        """A problem of two objectives, with gradients."""
        objectives = [pk.kinetic_energy, pk.torque_norm]
        return pk.Tracking(self.arm, self.path, objectives=objectives, coefficients=4, bases=2, differences="backward")

    @cached_property
    def single(self) -> pk.Tracking:
        """A problem of one objective, to be planned."""
        return pk.Tracking(
            self.arm, self.path, objectives=[pk.kinetic_energy], coefficients=4, bases=2, differences="backward"
        )

    @cached_property
    def front(self) -> pk.Front:
        """A certified front, which has its problem and a folder."""
        return pk.epsilon_front(self.problem, points=3, starts=4, out=self.folder / "run")

    @cached_property
    def run_folder(self) -> Path:
        """The folder of the run that found the front, wherever it is saved later."""
        assert self.front.folder is not None
        return self.front.folder

    @cached_property
    def plan_folder(self) -> Path:
        """The folder of a plan."""
        pk.plan(self.single, starts=2, out=self.folder / "plan")
        return self.folder / "plan"

    @cached_property
    def stopped_folder(self) -> Path:
        """The folder of a search that was stopped after its first generation."""

        def stop(_: object) -> None:
            raise RuntimeError("stop")

        with suppress(pk.InvalidInput):
            pk.solve(self.problem, population=8, generations=2, out=self.folder / "stopped", observe=stop)
        return self.folder / "stopped"

    @property
    def formulations(self) -> dict[str, Callable[[], Any]]:
        """Problems of every kind, by the name of their class."""
        return {
            "Tracking": lambda: self.problem,
            "Formulation": lambda: self.problem,
            "ControlStep": partial(marcos_2012.first_step, 3),
            "Posture": partial(marcos_2012.first_posture, 3),
            "DirectionalMaxima": kim_2021.directions_jam,
            "PointToPoint": kim_2021.point_to_point_jam,
            "Tuning": partial(wan_2018.weighted_gains, 2),
        }

    @cached_property
    def motion(self) -> pk.Motion:
        """One motion."""
        time = np.linspace(0.0, 1.0, 11)
        return pk.Motion(arm=self.arm, time=time, q=np.outer(np.sin(time), [0.2, 0.5, 0.9]))

    @cached_property
    def search(self) -> pk.Search:
        """A search that was told of its first points."""
        search = pk.Search(self.problem, population=8, seed=0)
        candidates = search.ask()
        values = self.problem.evaluate(candidates.X, return_as_dictionary=True)
        search.tell(candidates.ids, values["F"], values["G"])
        return search

    @cached_property
    def speeds(self) -> dict[str, np.ndarray]:
        """Speeds sampled at places (n, 2) in directions (m, 2)."""
        angles = np.linspace(0.0, 2 * np.pi, 8, endpoint=False)
        grid = np.stack(np.meshgrid([0.1, 0.2, 0.3], [0.1, 0.2, 0.3]), axis=-1).reshape(-1, 2)
        directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        return {"positions": grid, "directions": directions, "speeds": 1.0 + 0.1 * np.ones((len(grid), len(angles)))}

    @cached_property
    def model(self) -> Any:
        """A model of speeds."""
        return pk.capability.fit_axes(**self.speeds)

    @cached_property
    def ellipsoids(self) -> Any:
        """Another one."""
        return pk.capability.fit_ellipsoids(*self.speeds.values(), degree=1)
