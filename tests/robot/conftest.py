from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pinocchio
import pytest

from paretoik.robot.arm import Arm
from paretoik.robot.arms import marcos_nr, tringali_3r, wan_7r
from paretoik.robot.body import Body
from paretoik.robot.pose import Pose

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


def random_body(rng: np.random.Generator) -> Body:
    points = rng.normal(scale=0.1, size=(6, 3)) + rng.normal(scale=0.2, size=3)
    mass = rng.uniform(0.2, 3.0)
    offsets = points - points.mean(axis=0)
    inertia = mass / 6 * (np.sum(offsets**2) * np.eye(3) - offsets.T @ offsets)
    return Body(mass=mass, center=points.mean(axis=0), inertia=inertia)


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


def oracle_of(file: Path | str, arm: Arm, tip: str, frozen: tuple[str, ...] = ()) -> Oracle:
    """Return Pinocchio's own reading of a URDF, untouched by ours."""
    model = pinocchio.buildModelFromXML(file.read_text() if isinstance(file, Path) else file)
    if frozen:
        numbers = [model.getJointId(name) for name in frozen]
        model = pinocchio.buildReducedModel(model, numbers, pinocchio.neutral(model))
    return Oracle(arm, model, model.createData(), model.getFrameId(tip, pinocchio.FrameType.BODY))


def panda() -> Oracle:
    arm = Arm.from_urdf(PANDA, base="panda_link0", tip="panda_hand_tcp")
    return oracle_of(PANDA, arm, "panda_hand_tcp", ("panda_finger_joint1", "panda_finger_joint2"))


def jaco() -> Oracle:
    return oracle_of(JACO, Arm.from_urdf(JACO, tip="j2s6s200_end_effector"), "j2s6s200_end_effector")


def tilted_urdf(seed: int) -> str:
    """Return a chain of every kind of joint about slanted axes, with a massless flange in its middle."""
    rng = np.random.default_rng(seed)
    kinds = ["revolute", "continuous", "prismatic", "fixed", "revolute", "continuous"]
    words = [
        " ".join(repr(float(x)) for x in row) for row in rng.normal(scale=0.7, size=(len(kinds), 9)).reshape(-1, 3)
    ]
    parts = ['<robot name="tilted"><link name="l0"/>']
    for i, kind in enumerate(kinds):
        body = random_body(rng)
        xx, xy, xz, yy, yz, zz = body.inertia[np.triu_indices(3)].tolist()
        inertial = (
            f'<inertial><origin xyz="{words[3 * i]}" rpy="{words[3 * i + 1]}"/><mass value="{body.mass}"/>'
            f'<inertia ixx="{xx}" ixy="{xy}" ixz="{xz}" iyy="{yy}" iyz="{yz}" izz="{zz}"/></inertial>'
        )
        axis = unit(rng.normal(size=3))
        parts.append(
            f'<link name="l{i + 1}">{"" if kind == "fixed" else inertial}</link>'
            f'<joint name="j{i}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="{words[3 * i + 2]}" rpy="{words[3 * i]}"/><axis xyz="{axis[0]} {axis[1]} {axis[2]}"/>'
            f'<limit lower="-3" upper="3" velocity="1" effort="9"/></joint>'
        )
    return "".join(parts) + "</robot>"


def tilted() -> Oracle:
    text = tilted_urdf(7)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "tilted.urdf"
        file.write_text(text)
        return oracle_of(text, Arm.from_urdf(file), "l6")


ORACLES: dict[str, Callable[[], Oracle]] = {
    "planar 3R": lambda: model_of(tringali_3r()),
    "planar 3R under gravity": lambda: model_of(tringali_3r("fitted").mounted(gravity=(0.0, -9.81, 0.0))),
    "planar 4R": lambda: model_of(with_bodies(marcos_nr(4), 1)),
    "Wan 7R": lambda: model_of(with_bodies(wan_7r(), 2)),
    "Panda": panda,
    "Jaco": jaco,
    "tilted URDF": tilted,
    **{f"random chain {seed}": lambda seed=seed: model_of(random_arm(seed)) for seed in range(6)},
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
