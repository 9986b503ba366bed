from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pinocchio
import pytest

from paretoik.robot.arm import Arm
from paretoik.robot.arms import marcos_nr, tringali_3r, wan_7r
from paretoik.robot.pose import Pose
from tests.robot.random_urdfs import random_body, random_robot

ROOT = Path(__file__).parents[2]
PANDA = ROOT / "problems" / "robots" / "panda.urdf"
JACO = ROOT / "tests" / "robots" / "jaco.urdf"


@dataclass(frozen=True)
class Oracle:
    """An arm and Pinocchio's model of it, whose frame ``tool`` is the arm's tool."""

    arm: Arm
    model: Any
    data: Any
    tool: int

    def positions(self, q: np.ndarray) -> np.ndarray:
        return pinocchio.integrate(self.model, pinocchio.neutral(self.model), q)

    def over(self, function: Callable[..., np.ndarray], *arrays: np.ndarray) -> np.ndarray:
        """Return function(q, ...) sample by sample, q in Pinocchio's own form."""
        return np.array([function(self.positions(q), *others) for q, *others in zip(*arrays, strict=True)])


def random_dh(seed: int, dof: int = 5) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    bodies = [random_body(rng) for _ in range(dof)]
    return {
        "a": rng.uniform(-0.5, 0.5, dof),
        "alpha": rng.uniform(-np.pi, np.pi, dof),
        "d": rng.uniform(-0.5, 0.5, dof),
        "theta": rng.uniform(-np.pi, np.pi, dof),
        "types": rng.choice(["revolute", "continuous", "prismatic"], dof).tolist(),
        "masses": [body.mass for body in bodies],
        "centers": [body.center for body in bodies],
        "inertias": [body.inertia for body in bodies],
    }


def random_arm(seed: int) -> Arm:
    rng = np.random.default_rng(seed)
    arm = Arm.from_dh(**random_dh(seed), convention="modified" if seed % 2 else "standard")
    pose = Pose(rng.normal(size=3), unit(rng.normal(size=4)))
    return arm.with_tool(pose, mass=0.4, center=rng.normal(size=3)).mounted(gravity=rng.normal(scale=5, size=3))


def unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def with_bodies(arm: Arm, seed: int) -> Arm:
    rng = np.random.default_rng(seed)
    return replace(arm, bodies=tuple(random_body(rng) for _ in range(arm.dof)))


def model_of(arm: Arm) -> Oracle:
    model = pinocchio.Model()
    model.gravity.linear = arm.gravity
    base = pinocchio.SE3(arm.base.rotation, arm.base.position)
    parent = 0
    for i, kind in enumerate(arm.joint_types):
        joint = pinocchio.JointModelPZ() if kind == "prismatic" else pinocchio.JointModelRZ()
        place = pinocchio.SE3(arm.placements[i].rotation, arm.placements[i].position)
        parent = model.addJoint(parent, joint, place if i else base * place, arm.joint_names[i])
        body = arm.bodies[i]
        inertia = pinocchio.Inertia(body.mass, body.center, body.inertia)
        model.appendBodyToJoint(parent, inertia, pinocchio.SE3.Identity())
    tool = pinocchio.SE3(arm.tool.rotation, arm.tool.position)
    number = model.addFrame(pinocchio.Frame("the tool", parent, 0, tool, pinocchio.FrameType.OP_FRAME))
    return Oracle(arm, model, model.createData(), number)


def oracle_of(file: Path | str, arm: Arm, tip: str, frozen: Mapping[str, float] | None = None) -> Oracle:
    """Return Pinocchio's own reading of a URDF, independent of ours, with joints locked at values."""
    model = pinocchio.buildModelFromXML(file.read_text() if isinstance(file, Path) else file)
    steps, joints = np.zeros(model.nv), {name: model.getJointId(name) for name in frozen or {}}
    for name, joint in joints.items():
        if model.nvs[joint] == 1:
            steps[model.idx_vs[joint]] = (frozen or {})[name]
    positions = pinocchio.integrate(model, pinocchio.neutral(model), steps)
    model = pinocchio.buildReducedModel(model, list(joints.values()), positions)
    return Oracle(arm, model, model.createData(), model.getFrameId(tip, pinocchio.FrameType.BODY))


def panda() -> Oracle:
    arm = Arm.from_urdf(PANDA, base="panda_link0", tip="panda_hand_tcp")
    return oracle_of(PANDA, arm, "panda_hand_tcp", {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0})


def jaco() -> Oracle:
    return oracle_of(JACO, Arm.from_urdf(JACO, tip="j2s6s200_end_effector"), "j2s6s200_end_effector")


def random_urdf(seed: int) -> Oracle:
    robot = random_robot(seed)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "random.urdf"
        file.write_text(robot.text)
        arm = Arm.from_urdf(file, tip=robot.tip, fixed=robot.fixed)
    return oracle_of(robot.text, arm, robot.tip, {**robot.frozen, **dict.fromkeys(robot.others, 0.0)})


ORACLES: dict[str, Callable[[], Oracle]] = {
    "planar 3R under gravity": lambda: model_of(tringali_3r("fitted").mounted(gravity=(0.0, -9.81, 0.0))),
    "planar 4R": lambda: model_of(with_bodies(marcos_nr(4), 1)),
    "Wan 7R": lambda: model_of(with_bodies(wan_7r(), 2)),
    "Panda": panda,
    "Jaco": jaco,
    **{f"random URDF {seed}": lambda seed=seed: random_urdf(seed) for seed in range(3)},
    **{f"random chain {seed}": lambda seed=seed: model_of(random_arm(seed)) for seed in range(3)},
}


@pytest.fixture(scope="session", params=ORACLES)
def oracle(request: pytest.FixtureRequest) -> Oracle:
    return ORACLES[request.param]()


@pytest.fixture(scope="session")
def panda_arm() -> Arm:
    return panda().arm


@pytest.fixture
def samples() -> Callable[[Arm, int], np.ndarray]:
    """Return random q, q̇, q̈ of an arm: (3, count, dof)."""
    return lambda arm, count=20: np.random.default_rng(42).normal(size=(3, count, arm.dof))


@pytest.fixture(scope="session")
def anyarm_of() -> Callable[[int], Arm]:
    """Return a random arm of five joints of all kinds, from a seed."""
    return random_arm


@pytest.fixture(scope="session")
def dh_table() -> Callable[[int], dict[str, Any]]:
    return random_dh


@pytest.fixture
def write_urdf(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes parts of a robot to a file."""

    def write(*parts: str, name: str = "robot.urdf") -> Path:
        file = tmp_path / name
        file.write_text(f'<robot name="r">{"".join(parts)}</robot>', encoding="utf-8")
        return file

    return write
