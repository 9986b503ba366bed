"""Random robots as URDF text: every kind of joint and axis, fixed links with mass, turned inertial frames, branches."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from paretoik.robot.body import Body

MOVING = ("revolute", "continuous", "prismatic")


@dataclass
class RandomRobot:
    """A URDF's text, the tip of its chain, and values of frozen joints: 0 off the chain, except for ``fixed``."""

    text: str = ""
    tip: str = ""
    links: list[str] = field(default_factory=list)
    fixed: dict[str, float] = field(default_factory=dict)
    frozen: dict[str, float] = field(default_factory=dict)
    others: list[str] = field(default_factory=list)  # joints of several freedoms


def random_body(rng: np.random.Generator) -> Body:
    points = rng.normal(scale=0.1, size=(6, 3)) + rng.normal(scale=0.2, size=3)
    mass = rng.uniform(0.2, 3.0)
    offsets = points - points.mean(axis=0)
    inertia = mass / 6 * (np.sum(offsets**2) * np.eye(3) - offsets.T @ offsets)
    return Body(mass=mass, center=points.mean(axis=0), inertia=inertia)


def random_robot(seed: int) -> RandomRobot:
    """Return a chain of 5 to 10 joints with side branches on some of its links; three joints move at least.

    Some links are called base and tool, some joints mimic one that is frozen, and some origins are quaternions.
    """
    rng = np.random.default_rng(seed)
    robot = RandomRobot()
    kinds = [*rng.choice([*MOVING, "fixed", "fixed"], rng.integers(2, 8)).tolist(), "revolute", "revolute", "prismatic"]
    kinds = rng.permutation(kinds).tolist()
    names = [f"l{i}" for i in range(len(kinds) + 1)]
    for own in ("base", "tool"):
        names[rng.integers(len(names))] = own
    parts = [link(names[0], rng, massless=bool(rng.integers(2)))]
    robot.links.append(names[0])
    for i, kind in enumerate(kinds):
        parent, child, name = names[i], names[i + 1], f"j{i}"
        parts += [link(child, rng, massless=kind == "fixed" and rng.random() < 0.4)]
        parts += [joint(name, kind, parent, child, rng, freeze(robot, name, rng) if kind == "continuous" else "")]
        robot.links.append(child)
        if rng.random() < 0.5:
            parts += branch(robot, i, child, rng)
    robot.tip = names[-1]
    robot.text = f'<robot name="random" version="1.1">{"".join(parts)}</robot>'
    return robot


def freeze(robot: RandomRobot, name: str, rng: np.random.Generator) -> str:
    """Return the mimic element of a joint, or nothing; a joint that mimics a frozen one or is fixed is frozen, too."""
    choice = rng.random()
    if choice < 0.3 and robot.frozen:
        leader = str(rng.choice([*robot.frozen]))
        multiplier, offset = (float(value) for value in rng.uniform(-1.5, 1.5, 2))
        robot.frozen[name] = multiplier * robot.frozen[leader] + offset
        return f'<mimic joint="{leader}" multiplier="{multiplier}" offset="{offset}"/>'
    if choice < 0.6:
        robot.fixed[name] = robot.frozen[name] = float(np.clip(rng.normal(), -3.0, 3.0))
    return ""


def branch(robot: RandomRobot, number: int, parent: str, rng: np.random.Generator) -> list[str]:
    """Return one link or two off the chain; their joints are frozen at 0 or, by name, elsewhere."""
    parts = []
    for step in range(rng.integers(1, 3)):
        child, name, inside = f"side{number}_{step}", f"s{number}_{step}", ""
        kind = str(rng.choice([*MOVING, "fixed", "floating"]))
        if kind in MOVING:
            inside = freeze(robot, name, rng)
            robot.frozen.setdefault(name, 0.0)
        parts += [link(child, rng, massless=rng.random() < 0.3), joint(name, kind, parent, child, rng, inside)]
        robot.links.append(child)
        if kind == "floating":
            robot.others.append(name)
        parent = child
    return parts


def link(name: str, rng: np.random.Generator, *, massless: bool) -> str:
    if massless:
        return f'<link name="{name}"/>'
    body = random_body(rng)
    xx, xy, xz, yy, yz, zz = body.inertia[np.triu_indices(3)].tolist()
    return (
        f'<link name="{name}"><inertial>{origin(rng)}<mass value="{body.mass}"/>'
        f'<inertia ixx="{xx}" ixy="{xy}" ixz="{xz}" iyy="{yy}" iyz="{yz}" izz="{zz}"/></inertial></link>'
    )


def joint(name: str, kind: str, parent: str, child: str, rng: np.random.Generator, inside: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{origin(rng)}{axis(rng)}'
        f'<limit lower="-3" upper="3" velocity="1" effort="9"/>{inside}</joint>'
    )


def origin(rng: np.random.Generator) -> str:
    """Return a random origin, one of right angles, one with a quaternion of any length, or none."""
    choice = rng.integers(7)
    xyz = rng.normal(scale=0.7, size=3)
    rpy = rng.normal(scale=2.0, size=3) if choice else rng.integers(-2, 3, 3) * np.pi / 2
    turn = f'quat_xyzw="{words(rng.normal(size=4))}"' if choice == 6 else f'rpy="{words(rpy)}"'
    return "" if choice == 1 else f'<origin xyz="{words(xyz)}" {turn}/>'


def axis(rng: np.random.Generator) -> str:
    """Return an axis: a coordinate axis, forwards or backwards, a slanted one of any length, or none."""
    choice = rng.integers(6)
    if choice == 0:
        return ""
    vector = rng.normal(size=3) if choice < 3 else rng.choice([-1.0, 1.0]) * np.eye(3)[rng.integers(3)]
    length = 1.0 if choice % 2 else rng.uniform(0.2, 5.0)
    return f'<axis xyz="{words(length * vector)}"/>'


def words(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
