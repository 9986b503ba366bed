"""One good call of every public callable: its required arguments, so that only one of them is bad."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property, partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

import paretoik as pk
from paretoik.joint_trajectory.controllers import Braking
from problems import kim_2021, marcos_2012, wan_2018
from studies.benchmarks.reliability.inputs.surfaces import Argument, Surface

URDF = Path(__file__).parents[4] / "problems" / "robots" / "panda.urdf"
QUICK: dict[str, dict[str, object]] = {
    "constraint": {"lower": 0.0},
    "Robust": {"weights": {"kinetic_energy": 1.0}},
    "solve": {"population": 8, "generations": 1, "seed": 0},
    "plan": {"starts": 2},
    "epsilon_front": {"points": 2, "starts": 2},
    "Classify": {"improve": ["kinetic_energy"], "free": ["torque_norm"]},
    "Lexicographic": {"order": ["kinetic_energy"]},
    "Arm.from_urdf": {"base": "panda_link0", "tip": "panda_hand_tcp"},
    "check_robot": {"base": "panda_link0", "tip": "panda_hand_tcp"},
    "Search.tell": {"G": np.full((8, 2), -1.0)},
    "directional_maxima": {"starts": 8, "directions": 4},
}
"""Settings that keep a call short if a supposedly bad value is accepted."""

ALSO: dict[str, tuple[str, ...]] = {"compare": ("fronts",), "resume": ("problem",)}
"""Arguments that a good call has, although their names are not required."""

STARS: dict[str, dict[str, object]] = {
    "Arm.fixed": {"joints": "joint1"},
    "Aspiration": {"values": "kinetic_energy"},
    "Bounds": {"bounds": "kinetic_energy"},
    "Front.where": {"named": "kinetic_energy"},
    "Robust": {"weights": "kinetic_energy"},
    "Weights": {"weights": "kinetic_energy"},
}
"""The names of arguments that can come in any number."""

PARTS: dict[str, tuple[str, ...]] = {
    "Front.select(preference)": ("weights",),
    "Bounds(then)": ("weights",),
    "Search.suggest(X)": ("suggested",),
    "Arm.from_urdf(file)": ("noise",),
    "capability.DistributedActuation(front_bounds)": ("front",),
    "capability.DistributedActuation(back_bounds)": ("back",),
    "capability.DistributedActuation(least_angle)": ("angle",),
    "verify(problem)": ("Pinocchio",),
    "resume(problem)": ("run",),
    "Path.standing(times)": ("samples",),
    "Arm.with_payload(center)": ("centre of gravity",),
    "Arm.with_tool(center)": ("centre of gravity",),
}
"""Other names of an argument in messages: a thing made of it, or its name in words."""


class Examples:
    """Good arguments, and the arms, problems, fronts and plans that they need, made when first needed in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._files = count()

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

    def arguments(self, surface: Surface, bad: Argument) -> dict[str, object]:
        """Return good arguments by name: required ones, and those that keep a call short, except the bad one."""
        # no run has a choice
        required = [each.name for each in surface.arguments if each.is_required or each.name == "choice"]
        needed = [name for name in (*required, *ALSO.get(surface.name, ())) if name != bad.name]
        quick = {name: value for name, value in QUICK.get(surface.name, {}).items() if name != bad.name}
        keys = {name: f"{surface.name}.{name}" for name in needed}
        return {name: self._makers[key if key in self._makers else name]() for name, key in keys.items()} | quick

    def owner(self, surface: Surface) -> Any:
        """Return the object that a method belongs to."""
        assert surface.owner is not None
        return self._owner(surface.owner.__name__)

    @cache  # noqa: B019, lives as long as the examples
    def _owner(self, name: str) -> Any:
        return self._owners[name]()

    @cached_property
    def _owners(self) -> dict[str, Callable[[], Any]]:
        return {
            "Arm": lambda: self.arm,
            "Front": lambda: self.front,
            "Limits": pk.Limits,
            "Motion": lambda: self.motion,
            "Path": lambda: self.path,
            "Pose": lambda: pk.Pose((0.1, 0.2, 0.3)),
            "Search": lambda: self.search,
            "MaxiMinNSGA2": pk.MaxiMinNSGA2,
            "Aspiration": lambda: pk.Aspiration(kinetic_energy=0.1),
            "Bounds": lambda: pk.Bounds(kinetic_energy=(None, 1.0)),
            "Classify": lambda: pk.Classify(0, improve=["kinetic_energy"], free=["torque_norm"]),
            "Compromise": pk.Compromise,
            "Knee": pk.Knee,
            "Lexicographic": lambda: pk.Lexicographic("kinetic_energy"),
            "Robust": lambda: pk.Robust(kinetic_energy=1.0),
            "Weights": lambda: pk.Weights(kinetic_energy=1.0),
            "Tracking": lambda: self.problem,
            "Formulation": lambda: self.problem,
            "ControlStep": partial(marcos_2012.first_step, 3),
            "Posture": partial(marcos_2012.first_posture, 3),
            "DirectionalMaxima": kim_2021.directions_jam,
            "PointToPoint": kim_2021.point_to_point_jam,
            "Tuning": partial(wan_2018.weighted_gains, 2),
            "Braking": lambda: Braking(double_deceleration=np.ones(3), offset=np.zeros(3), position=np.ones((3, 2))),
            "Controller": partial(pk.controllers.Controller, name="ours", joint_names=self.arm.joint_names, rate=100.0),
        }

    @cached_property
    def _makers(self) -> dict[str, Callable[[], object]]:
        capability = pk.capability
        return {
            "arm": lambda: self.arm,
            "path": lambda: self.path,
            "problem": lambda: self.problem,
            "plan.problem": lambda: self.single,
            "front": lambda: self.front,
            "fronts": lambda: (self.front, self.front),
            "motion": lambda: self.motion,
            "reference": lambda: self.motion,
            "objectives": lambda: [pk.kinetic_energy, pk.torque_norm],
            "objective": lambda: pk.kinetic_energy,
            "method": pk.methods.PseudoInverse,
            "controller": lambda: "ur5e",
            "folder": lambda: self.run_folder,
            "load_plan.folder": lambda: self.plan_folder,
            "resume.folder": lambda: self.stopped_folder,
            "Front.save.folder": lambda: self.folder / "saved",
            "file": lambda: URDF,
            "export.file": lambda: self.folder / f"motion{next(self._files)}.csv",
            "unit": lambda: "m",
            "form": lambda: "integral",
            "name": lambda: "tool",
            "q": lambda: np.zeros(3),
            "ControlStep.q": lambda: np.array([0.0, 0.327, -0.754]),
            "preference": pk.Knee,
            "choice": lambda: int(self.front.ids[1]),
            "current": lambda: 0,
            "improve": lambda: "kinetic_energy",
            "samples": lambda: 11,
            "axis": lambda: 0,
            "value": lambda: 1.0,
            "index": lambda: 0,
            "id": lambda: 0,
            "verdict": lambda: "It is.",
            "points": lambda: 3,
            "lengths": lambda: [0.2, 0.2, 0.1],
            **{name: (lambda: [0.1, 0.2, 0.1]) for name in ("a", "alpha", "d", "theta")},
            "convention": lambda: "modified",
            "pose": lambda: pk.Pose.planar(0.1, 0.0),
            "mass": lambda: 0.5,
            "center": lambda: (0.3, 0.0),
            "obstacles.Sphere.center": lambda: (0.3, 0.0, 0.1),
            "obstacles.Box.center": lambda: (0.3, 0.0, 0.1),
            "half_sizes": lambda: (0.1, 0.1, 0.1),
            "normal": lambda: (0.0, 0.0, 1.0),
            "point": lambda: (0.3, 0.0, 0.1),
            "radius": lambda: 0.05,
            "start": lambda: (0.3, 0.0),
            "end": lambda: (0.2, 0.1),
            "obstacles.Capsule.start": lambda: (0.3, 0.0, 0.1),
            "obstacles.Capsule.end": lambda: (0.3, 0.1, 0.1),
            "duration": lambda: 1.0,
            "waypoints.points": lambda: [(0.3, 0.0), (0.3, 0.1), (0.2, 0.1)],
            "times": lambda: [0.0, 1.0],
            "poses": lambda: [pk.Pose((0.3, 0.0, 0.0)), pk.Pose((0.3, 0.1, 0.0))],
            "position": lambda: (0.1, 0.2, 0.3),
            "x": lambda: 0.1,
            "y": lambda: 0.2,
            "matrix": lambda: np.eye(3),
            "rpy": lambda: (0.1, 0.2, 0.3),
            "xyzw": lambda: (0.0, 0.0, 0.0, 1.0),
            "Pose.apply.points": lambda: np.zeros((2, 3)),
            "t": lambda: np.linspace(0.1, 0.9, 5),
            "Path.rates.times": lambda: np.linspace(0.1, 0.9, 5),
            "Path.standing.times": lambda: np.linspace(0.0, 1.0, 5),
            "series": lambda: np.ones(11),
            "Path.times": lambda: self.path.times,
            "Path.positions": lambda: self.path.positions,
            "Path.quaternions": lambda: None,
            "curve": lambda: self.path.curve,
            "Motion.time": lambda: self.motion.time,
            "Motion.q": lambda: self.motion.q,
            "Front.ids": lambda: np.array([0, 1]),
            "Front.objectives": lambda: np.array([[0.0, 1.0], [1.0, 0.0]]),
            "Front.names": lambda: ["a", "b"],
            "Front.units": lambda: ["", "m"],
            "Front.maximised": lambda: [False, False],
            "X": lambda: np.full((1, self.problem.n_var), 0.5),
            "ids": lambda: self.search.ask().ids,
            "F": lambda: np.ones((8, 2)),
            "Controller.name": lambda: "ours",
            "joint_names": lambda: self.arm.joint_names,
            "rate": lambda: 100.0,
            "double_deceleration": lambda: np.ones(3),
            "offset": lambda: np.zeros(3),
            "controllers.Braking.position": lambda: np.ones((3, 2)),
            "lower": lambda: 0.0,
            "upper": lambda: 1.0,
            "minimum": lambda: 1,
            "size": lambda: 5,
            "actuation": capability.kim_joint_motors,
            "DirectionalMaxima.arm": pk.arms.kim_3r,
            "PointToPoint.arm": pk.arms.kim_3r,
            "directional_maxima.arm": pk.arms.kim_3r,
            "DirectionalMaxima.position": lambda: (0.2, 0.2),
            "directional_maxima.position": lambda: (0.2, 0.2),
            "DirectionalMaxima.directions": lambda: [(1.0, 0.0), (0.0, 1.0)],
            "target": lambda: (0.2, 0.25),
            "model": lambda: self.model,
            "capability.fastest_path.start": lambda: (0.15, 0.15),
            "capability.time_optimal_control.start": lambda: (0.15, 0.15),
            "capability.path_time.points": lambda: [(0.15, 0.15), (0.2, 0.2)],
            **{name: partial(self.speeds.__getitem__, name) for name in ("positions", "directions", "speeds")},
            "stall": lambda: [1.0, 1.0, 1.0],
            "fastest": lambda: [1.0, 1.0, 1.0],
            "motors": lambda: capability.MotorCurve(stall=[1.0, 1.0, 1.0], fastest=[1.0, 1.0, 1.0]),
            "capability.DistributedActuation.front": lambda: capability.MotorCurve(stall=[1.0] * 3, fastest=[1.0] * 3),
            "rod": lambda: 0.1,
            "front_bounds": lambda: (0.02, 0.08),
            "axes": lambda: self.model.axes,
            "polynomials": lambda: self.ellipsoids.polynomials,
            "capability.AxesEllipses.lower": lambda: self.model.lower,
            "capability.AxesEllipses.upper": lambda: self.model.upper,
            "capability.PolynomialEllipsoids.lower": lambda: self.model.lower,
            "capability.PolynomialEllipsoids.upper": lambda: self.model.upper,
        }
