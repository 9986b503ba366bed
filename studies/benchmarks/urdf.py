"""Every URDF of public packages against Pinocchio: ``python -m studies.benchmarks.urdf [--packages NAME ...]``.

Chains run from the root to the leaves and between random links, with random joints fixed. On each, the arm is compared
with Pinocchio's model of the whole file: position and rotation of **every link of the file, by its name**, in the base
link; gravity torques; inverse dynamics. Errors are in m, entries of a rotation, and shares of the largest torque (at
least 1 N m) of a chain. A disagreement is a chain for which ``check_robot`` lists other faults than those that
``Arm.from_urdf`` refuses. Chains with repaired inertias are compared without inverse dynamics, since Pinocchio computes
with the written ones.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from typing import Any

import numpy as np

import paretoik as pk
from paretoik.errors import InvalidRobot
from paretoik.robot.dynamics import gravity_torques, inverse_dynamics
from studies.reporting import Row, goal_row, report, study_parser, tell

PACKAGES = ("example-robot-data", "dexmate-urdf", "pybullet")
QUANTITIES = {"position": "m", "rotation": "", "gravity torque": "share", "inverse dynamics": "share"}
GOAL = 1e-10
MOVING = ("revolute", "continuous", "prismatic")


@dataclass
class Tally:
    """Worst errors of a package's chains with their places, and refusals by reason."""

    files: int = 0
    chains: int = 0
    links: int = 0
    repaired: int = 0
    disagreements: int = 0
    errors: dict[str, float] = field(default_factory=lambda: dict.fromkeys(QUANTITIES, 0.0))
    worst: dict[str, str] = field(default_factory=dict)
    refusals: Counter[str] = field(default_factory=Counter)

    def add(self, errors: Mapping[str, float], where: str) -> None:
        """Keep the largest errors."""
        for name, error in errors.items():
            if not error <= self.errors[name]:
                self.errors[name], self.worst[name] = error, where


@dataclass(frozen=True)
class Peer:
    """Pinocchio's own reading of a whole file; joints that mimic others move like any other."""

    model: Any
    data: Any

    @classmethod
    def from_text(cls, text: str) -> Peer:
        """Return the model of a URDF; raises ValueError for what Pinocchio refuses."""
        import pinocchio

        model = pinocchio.buildModelFromXML(text)
        return cls(model, model.createData())

    def vector(self, values: Mapping[str, float]) -> np.ndarray:
        """Return joint values by name as a vector of velocities, 0 for others."""
        vector = np.zeros(self.model.nv)
        for name, value in values.items():
            joint = self.model.getJointId(name)
            vector[self.model.idx_vs[joint]] = value
        return vector

    def torques(self, arm: pk.Arm, frozen: Mapping[str, float], *state: np.ndarray) -> np.ndarray:
        """Return the torques of the arm's joints at q, dq, ddq (dof,), others frozen."""
        import pinocchio

        q, dq, ddq = (dict(zip(arm.joint_names, each, strict=True)) for each in state)
        place = pinocchio.integrate(self.model, pinocchio.neutral(self.model), self.vector({**frozen, **q}))
        torques = pinocchio.rnea(self.model, self.data, place, self.vector(dq), self.vector(ddq))
        return np.array([torques[self.model.idx_vs[self.model.getJointId(name)]] for name in arm.joint_names])

    def poses(self, arm: pk.Arm, frozen: Mapping[str, float], q: np.ndarray, base: str) -> dict[str, np.ndarray]:
        """Return the homogeneous matrix of every link in the base link."""
        import pinocchio

        values = {**frozen, **dict(zip(arm.joint_names, q, strict=True))}
        place = pinocchio.integrate(self.model, pinocchio.neutral(self.model), self.vector(values))
        pinocchio.framesForwardKinematics(self.model, self.data, place)
        bodies = {
            frame.name: pose.homogeneous
            for frame, pose in zip(self.model.frames, self.data.oMf, strict=True)
            if frame.type == pinocchio.FrameType.BODY
        }
        inverse = np.linalg.inv(bodies[base])
        return {name: inverse @ pose for name, pose in bodies.items()}


@dataclass(frozen=True)
class Tree:
    """Links and joints of a URDF, read without the library."""

    links: tuple[str, ...]
    parents: Mapping[str, tuple[str, str]]  # of a link: the joint above it and that joint's parent
    types: Mapping[str, str]
    limits: Mapping[str, tuple[float, float]]
    mimics: Mapping[str, tuple[str, float, float]]

    @classmethod
    def from_text(cls, text: str) -> Tree:
        """Return the tree of a URDF; raises ValueError or KeyError if it has none."""
        robot = ElementTree.fromstring(text)
        parents, types, limits, mimics = {}, {}, {}, {}
        for joint in robot.findall("joint"):
            name, mimic, limit = joint.attrib["name"], joint.find("mimic"), joint.find("limit")
            parent, child = (joint.find(tag) for tag in ("parent", "child"))
            if parent is None or child is None:
                raise ValueError(f"{name} joins no two links")
            parents[child.attrib["link"]] = (name, parent.attrib["link"])
            types[name] = joint.attrib["type"]
            if mimic is not None:
                scale, offset = float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0))
                mimics[name] = (mimic.attrib["joint"], scale, offset)
            if limit is not None and types[name] != "continuous":
                limits[name] = (float(limit.get("lower", 0)), float(limit.get("upper", 0)))
        return cls(tuple(each.attrib["name"] for each in robot.findall("link")), parents, types, limits, mimics)

    @property
    def leaves(self) -> list[str]:
        """Links without a child."""
        carriers = {parent for _, parent in self.parents.values()}
        return [link for link in self.links if link not in carriers]

    def above(self, link: str) -> list[str]:
        """Return the links from a link's parent to the root."""
        line: list[str] = []
        while link in self.parents and len(line) < len(self.links):
            link = self.parents[link][1]
            line.append(link)
        return line

    def frozen_value(self, joint: str, fixed: Mapping[str, float]) -> float:
        """Return the position of a joint off the chain: its fixed value, its leader's times and plus, or 0."""
        if joint in fixed or joint not in self.mimics:
            return fixed.get(joint, 0.0)
        leader, multiplier, offset = self.mimics[joint]
        return multiplier * self.frozen_value(leader, fixed) + offset


def random_chains(
    tree: Tree, rng: np.random.Generator, leaves: int, pairs: int
) -> Iterator[tuple[str | None, str, dict[str, float]]]:
    """Yield base, tip and fixed joints: from the root to some leaves, then between random links.

    At least one joint that could move is between base and tip and not fixed.
    """
    movable = {link for link, (name, _) in tree.parents.items() if tree.types[name] in MOVING}
    for leaf in rng.permutation([link for link in tree.leaves if movable & {link, *tree.above(link)}])[:leaves]:
        yield None, str(leaf), {}
    for tip in rng.permutation([link for link in tree.links if movable & {link, *tree.above(link)}])[:pairs].tolist():
        line = [tip, *tree.above(tip)]
        first = next(row for row, link in enumerate(line) if link in movable)
        base = str(rng.choice(line[first + 1 :]))
        kept = tree.parents[line[first]][0]
        free = [name for name, kind in tree.types.items() if kind in MOVING and name not in (kept, *tree.mimics)]
        ranges = {name: np.clip(tree.limits.get(name, (-3.0, 3.0)), -3.0, 3.0) for name in free}
        chosen = [name for name, (lower, upper) in ranges.items() if lower <= upper and rng.random() < 0.2]
        yield base, tip, {name: float(rng.uniform(*ranges[name])) for name in chosen}


def compare_chain(
    text: str, arm: pk.Arm, base: str, fixed: Mapping[str, float], rng: np.random.Generator, samples: int = 2
) -> tuple[dict[str, float], int]:
    """Return the errors of an arm against Pinocchio's reading of its URDF, and how many links were compared."""
    tree, peer = Tree.from_text(text), Peer.from_text(_without_inertias(text, arm))
    others = [name for name, kind in tree.types.items() if kind in MOVING and name not in arm.joint_names]
    frozen = {name: tree.frozen_value(name, fixed) for name in others}
    q, dq, ddq = state = rng.normal(size=(3, samples, arm.dof))
    poses = [peer.poses(arm, frozen, each, base) for each in q]
    errors = dict.fromkeys(QUANTITIES, 0.0)
    for link in tree.links:
        theirs, ours = np.array([pose[link] for pose in poses]), arm.pose(q, frame=link).matrix
        difference = np.abs(ours - theirs).max(axis=0)
        errors["position"] = max(errors["position"], float(difference[:3, 3].max()))
        errors["rotation"] = max(errors["rotation"], float(difference[:3, :3].max()))
    still = np.zeros_like(q)
    holding = np.array([peer.torques(arm, frozen, *each) for each in zip(q, still, still, strict=True)])
    moving = np.array([peer.torques(arm, frozen, *each) for each in zip(*state, strict=True)])
    for name, ours, theirs in (
        ("gravity torque", gravity_torques(arm, q), holding),
        ("inverse dynamics", inverse_dynamics(arm, q, dq, ddq), moving),
    ):
        errors[name] = float(np.abs(ours - theirs).max() / max(1.0, np.abs(theirs).max()))
    if any("; repaired" in notice for notice in arm.notices):
        del errors["inverse dynamics"]
    return errors, len(tree.links)


def _without_inertias(text: str, arm: pk.Arm) -> str:
    """Return a URDF with zero inertias of links that the arm takes as point masses."""
    points = {notice.split("'")[1] for notice in arm.notices if "taken as a point mass" in notice}
    robot = ElementTree.fromstring(text)
    for link in robot.findall("link"):
        for inertia in link.iter("inertia") if link.attrib.get("name") in points else ():
            inertia.attrib.update(dict.fromkeys(inertia.attrib, "0"))
    return ElementTree.tostring(robot, encoding="unicode") if points else text


def compare_file(file: Path, tally: Tally, rng: np.random.Generator, leaves: int, pairs: int) -> None:
    """Compare chains of a file, and add the results."""
    tally.files += 1
    data = file.read_bytes()
    try:
        text = re.sub(r"^\s*<\?xml[^>]*\?>", "", data.decode("utf-8-sig"))
        tree = Tree.from_text(text)
        Peer.from_text(text)
    except Exception as error:  # the text has no encoding, is no tree, or Pinocchio refuses it
        tally.refusals[f"Pinocchio or the XML: {type(error).__name__}"] += 1
        return
    for base, tip, fixed in random_chains(tree, rng, leaves, pairs):
        options: dict[str, Any] = {"base": base, "tip": tip, "fixed": fixed}
        faults = pk.check_robot(file, **options).faults
        arm: pk.Arm | None = None
        refused: tuple[str, ...] = ()
        try:
            arm = pk.Arm.from_urdf(file, **options, zero_limits="unlimited")
        except InvalidRobot as error:
            refused = error.faults
        tally.disagreements += faults != refused
        if refused and all("; repair_inertias" in fault for fault in refused):
            arm = pk.Arm.from_urdf(file, **options, zero_limits="unlimited", repair_inertias=True)
            tally.repaired += 1
        if arm is None:
            # the subject of a fault, without its line and names
            reason = re.sub(r"^(line \d+: )?((link|joint) '[^']*': )?|, got principal.*|;.*", "", refused[0])
            tally.refusals[re.sub(r"'[^']*'", "...", reason)] += 1
            continue
        errors, links = compare_chain(text, arm, base or tree.above(tip)[-1], fixed, rng)
        tally.chains, tally.links = tally.chains + 1, tally.links + links
        tally.add(errors, f"{file.name}, {base or 'root'} to {tip}")


def package_files(package: str) -> list[Path]:
    """Return the URDFs of a package; none if it is not installed."""
    try:
        return sorted(Path(str(each.locate())) for each in files(package) or () if each.suffix == ".urdf")
    except PackageNotFoundError:
        return []


def tally_rows(name: str, tally: Tally) -> list[Row]:
    """Return the rows of a package."""
    table, disagree = "URDFs against Pinocchio", "check_robot against from_urdf"
    counts = {"files": tally.files, "chains": tally.chains, "links": tally.links, "inertias repaired": tally.repaired}
    rows = [Row(table, name, column, "", value) for column, value in counts.items()]
    for quantity, unit in QUANTITIES.items():
        worst, note = tally.errors[quantity], tally.worst.get(quantity, "")
        rows.append(goal_row(table, name, f"worst {quantity}", unit, worst, GOAL, note))
    rows.append(goal_row(disagree, name, "disagreements", "", tally.disagreements, 0))
    return rows + [Row("refused chains", name, reason, "", count) for reason, count in tally.refusals.most_common()]


def main(arguments: Sequence[str] | None = None) -> None:
    """Compare the files, print the tables, and write the rows if ``--json`` names a file."""
    parser = study_parser(__doc__, quick="every tenth file, two chains each")
    parser.add_argument("--packages", nargs="+", default=list(PACKAGES), metavar="NAME", help="installed packages")
    parser.add_argument("--seed", type=int, default=0, help="of chains, fixed joints and postures")
    options = parser.parse_args(arguments)
    rows = list[Row]()
    for package in options.packages:
        found = package_files(package)[:: 10 if options.quick else 1]
        tell(f"{package}: {len(found)} URDFs" if found else f"{package}: not installed, or without URDFs")
        tally, rng = Tally(), np.random.default_rng(options.seed)
        for file in found:
            compare_file(file, tally, rng, *((1, 1) if options.quick else (4, 4)))
        rows += tally_rows(package, tally) if found else []
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
