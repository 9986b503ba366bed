"""From a URDF to an arm: every fault first, then the chain from base to tip as Pinocchio reads it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from paretoik.arrays import Matrix3
from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.robot.arm import EARTH, Arm, Frame, JointType
from paretoik.robot.body import Body, moved
from paretoik.robot.pose import Pose
from paretoik.robot.urdf_faults import MOMENTS, MOVING, JointFacts, LinkFacts, RobotFacts, read_facts

TINY = 1e-300


@dataclass(frozen=True, kw_only=True)
class RobotReport:
    """What a URDF holds: its faults, warnings about what loads but may surprise, and its facts in a few lines."""

    file: Path
    faults: tuple[str, ...]
    warnings: tuple[str, ...]
    summary: tuple[str, ...]


def check_robot(file: str | Path, base: str | None = None, tip: str | None = None) -> RobotReport:
    """Return what a URDF holds, between links ``base`` (default: the root) and ``tip`` (default: the only leaf).

    Reads the file without Pinocchio and never opens a mesh. Raises InvalidInput where there is no such file, or for
    links that it has not.
    """
    try:
        facts = read_facts(Path(file))
    except InvalidRobot as error:
        return RobotReport(file=Path(file), faults=error.faults, warnings=(), summary=())
    summary = [f"robot {facts.name}: {len(facts.links)} links, {len(facts.joints)} joints"]
    if facts.faults:
        return RobotReport(file=Path(file), faults=facts.faults, warnings=facts.warnings, summary=tuple(summary))
    summary.append(f"root {facts.roots[0]}, leaves {', '.join(facts.leaves)}")
    if tip is None and len(facts.leaves) > 1:
        summary.append("several leaves: name one as tip to see its chain")
        return RobotReport(file=Path(file), faults=(), warnings=facts.warnings, summary=tuple(summary))
    selection = _selected(str(file), facts, base, tip, {})
    summary.append(f"chain {selection.base} to {selection.tip}: {len(selection.moving)} moving joints")
    summary += [_described(joint) for joint in selection.moving]
    return RobotReport(
        file=Path(file),
        faults=selection.faults,
        warnings=(*facts.warnings, *selection.notices, *_zero_limits(selection)),
        summary=tuple(summary),
    )


def load(
    file: Path,
    *,
    base: str | None,
    tip: str | None,
    fixed: Mapping[str, float] | None,
    zero_limits: Literal["unlimited"] | None = None,
) -> Arm:
    """Return the arm between two links of a URDF; see ``Arm.from_urdf``.

    Raises InvalidRobot listing every fault, InvalidInput for unknown names, zero limits, or without Pinocchio.
    """
    facts = read_facts(file)
    if facts.faults:
        raise InvalidRobot(str(file), facts.faults)
    selection = _selected(str(file), facts, base, tip, dict(fixed or {}))
    if selection.faults:
        raise InvalidRobot(str(file), selection.faults)
    if zero_limits not in (None, "unlimited"):
        raise InvalidInput(f"zero_limits must be 'unlimited' or None, got {zero_limits!r}")
    if zero_limits is None and (zeros := _zero_limits(selection)):
        raise InvalidInput(f"{file}: {'; '.join(zeros)}")
    arm = _arm(facts, selection)
    return replace(arm, source=file)


@dataclass(frozen=True, kw_only=True)
class _Selection:
    """What of a robot becomes an arm: joints that move between base and tip, and the frozen ones that hang on them."""

    base: str
    tip: str
    moving: list[JointFacts]
    below: list[JointFacts]
    frozen: dict[str, float]
    faults: tuple[str, ...]
    notices: tuple[str, ...]


def _selected(
    source: str, facts: RobotFacts, base: str | None, tip: str | None, fixed: Mapping[str, float]
) -> _Selection:
    start, end = _ends(source, facts, base, tip)
    below = facts.below(start)
    chain = _chain(source, below, start, end)
    _check_fixed(source, below, fixed)
    moving = [joint for joint in chain if joint.kind != "fixed" and joint.name not in fixed]
    faults = [
        f"joint {joint.name!r}: {'mimic' if joint.mimic else joint.kind} joints cannot be on the chain from base to tip"
        for joint in moving
        if joint.mimic or joint.kind not in MOVING
    ]
    if not moving:
        faults.append(f"no joint moves between {start!r} and {end!r}")
    others = {joint.name: joint for joint in below if joint.kind != "fixed" and joint not in moving}
    frozen = {name: _frozen_value(name, others, fixed) for name in others}
    leaders = {joint.name for joint in moving}
    notices = [_frozen_notice(joint, frozen[name], chain, leaders) for name, joint in others.items()]
    if start != facts.roots[0]:
        notices.insert(0, f"base {start!r} is not the root {facts.roots[0]!r}: what is above it is left out")
    for name in _massless(facts, start, below, moving):
        if name == moving[-1].name:
            notices.append(f"joint {name!r}: moves no mass")
        else:
            faults.append(f"joint {name!r}: moves no mass, though other joints follow it")
    return _Selection(
        base=start,
        tip=end,
        moving=moving,
        below=below,
        frozen=frozen,
        faults=tuple(faults),
        notices=tuple(notices),
    )


def _ends(source: str, facts: RobotFacts, base: str | None, tip: str | None) -> tuple[str, str]:
    for what, link in (("base", base), ("tip", tip)):
        if link is not None and link not in facts.links:
            raise InvalidInput(f"{source}: {what} {link!r} is not a link; links: {', '.join(facts.links)}")
    if tip is None and len(facts.leaves) > 1:
        raise InvalidInput(f"{source}: several leaves, name one as tip: {', '.join(facts.leaves)}")
    return base or facts.roots[0], tip or facts.leaves[0]


def _chain(source: str, below: list[JointFacts], base: str, tip: str) -> list[JointFacts]:
    holder = {joint.child: joint for joint in below}
    chain: list[JointFacts] = []
    at = tip
    while at != base:
        if at not in holder:
            raise InvalidInput(f"{source}: link {tip!r} does not hang on link {base!r}")
        chain.append(holder[at])
        at = holder[at].parent
    return chain[::-1]


def _check_fixed(source: str, below: list[JointFacts], fixed: Mapping[str, float]) -> None:
    kinds = {joint.name: joint.kind for joint in below if joint.kind in MOVING}
    for name, value in fixed.items():
        if name not in kinds:
            raise InvalidInput(f"{source}: joint {name!r} cannot be fixed; joints that move: {', '.join(kinds)}")
        if not np.isfinite(value):
            raise InvalidInput(f"{source}: joint {name!r} wants a finite value to be fixed at, got {value}")


def _frozen_value(name: str, others: Mapping[str, JointFacts], fixed: Mapping[str, float]) -> float:
    """Return where a joint is frozen: as asked, as the frozen joint it mimics, or at 0."""
    factor, offset = 1.0, 0.0
    while name in others and name not in fixed and (mimic := others[name].mimic):
        name, gain, shift = mimic
        factor, offset = factor * gain, offset + factor * shift
    return factor * float(fixed.get(name, 0.0)) + offset


def _frozen_notice(joint: JointFacts, value: float, chain: list[JointFacts], leaders: set[str]) -> str:
    place = "on" if joint in chain else "off"
    if joint.kind not in MOVING:
        return f"joint {joint.name!r}: {place} the chain, frozen where its {joint.kind} motion is zero"
    unit = "m" if joint.kind == "prismatic" else "rad"
    outside = "" if joint.lower <= value <= joint.upper else ", outside its limits"
    leader = f", though it mimics {joint.mimic[0]!r}" if joint.mimic and joint.mimic[0] in leaders else ""
    return f"joint {joint.name!r}: {place} the chain, frozen at {value:g} {unit}{outside}{leader}"


def _massless(facts: RobotFacts, base: str, below: list[JointFacts], moving: list[JointFacts]) -> list[str]:
    """Return the moving joints whose link, with all that is held to it, has no mass; base to tip."""
    movers = {joint.name for joint in moving}
    carrier: dict[str, str | None] = {base: None}
    carried = dict.fromkeys((joint.name for joint in moving), 0.0)
    for joint in below:
        on = joint.name if joint.name in movers else carrier[joint.parent]
        carrier[joint.child] = on
        if on is not None:
            carried[on] += facts.links[joint.child].mass
    return [name for name, mass in carried.items() if mass == 0.0]


def _zero_limits(selection: _Selection) -> list[str]:
    return [
        f"joint {joint.name!r}: {what} limit is 0, pass zero_limits='unlimited' if it means none"
        for joint in selection.moving
        for what, limit in (("velocity", joint.velocity), ("effort", joint.effort))
        if limit == 0.0
    ]


def _described(joint: JointFacts) -> str:
    length, force = ("m", "N") if joint.kind == "prismatic" else ("rad", "N m")
    reach = f"{joint.lower:g} to {joint.upper:g} {length}" if np.isfinite(joint.upper - joint.lower) else "no end"
    return f"  {joint.name}: {joint.kind}, {reach}, {joint.velocity:g} {length}/s, {joint.effort:g} {force}"


def _arm(facts: RobotFacts, selection: _Selection) -> Arm:
    pinocchio = _pinocchio()
    model = _reduced_model(pinocchio, facts, selection)
    moving = selection.moving
    turns = [_onto_z(joint.axis) for joint in moving]
    placements, bodies = [], []
    before = Pose(np.zeros(3))
    for i, turn in enumerate(turns):
        placements.append(before.inverse() @ _pose(model.jointPlacements[i + 1]) @ turn)
        inertia = model.inertias[i + 1]
        body = Body(mass=float(inertia.mass), center=np.array(inertia.lever), inertia=np.array(inertia.inertia))
        bodies.append(moved(body, turn.inverse()))
        before = turn
    frames = {}
    for number, link in enumerate(facts.links):
        if not model.existFrame(f"link{number}"):
            continue
        frame = model.frames[model.getFrameId(f"link{number}")]
        joint = int(frame.parentJoint) - 1
        pose = _pose(frame.placement)
        frames[link] = Frame(link=joint, pose=turns[joint].inverse() @ pose if joint >= 0 else pose)
    kinds: tuple[JointType, ...] = tuple(joint.kind for joint in moving)  # type: ignore[misc]  # checked by _selected
    return Arm(
        name=facts.name,
        joint_names=tuple(joint.name for joint in moving),
        joint_types=kinds,
        placements=tuple(placements),
        bodies=tuple(bodies),
        tool=frames[selection.tip].pose,
        base=Pose(np.zeros(3)),
        gravity=np.array(EARTH),
        position_limits=np.array([[joint.lower, joint.upper] for joint in moving]),
        velocity_limits=np.array([joint.velocity or np.inf for joint in moving]),
        torque_limits=np.array([joint.effort or np.inf for joint in moving]),
        frames=frames,
        notices=(*facts.warnings, *selection.notices),
    )


def _pinocchio() -> Any:
    try:
        import pinocchio
    except ImportError:
        raise InvalidInput("reading a URDF wants Pinocchio, which is missing: pip install paretoik[urdf]") from None
    return pinocchio


def _reduced_model(pinocchio: Any, facts: RobotFacts, selection: _Selection) -> Any:
    """Return Pinocchio's model of the chain, with frozen joints locked and their masses merged."""
    model = pinocchio.buildModelFromXML(_plain_urdf(facts, selection))
    names = {name: f"joint{number}" for number, name in enumerate(facts.joints)}
    positions = np.zeros(model.nq)
    locked = []
    for name, value in selection.frozen.items():
        if model.existJointName(names[name]):
            joint = model.getJointId(names[name])
            positions[model.joints[joint].idx_q] = value
            locked.append(joint)
    return pinocchio.buildReducedModel(model, locked, positions) if locked else model


def _plain_urdf(facts: RobotFacts, selection: _Selection) -> str:
    """Return what is below the base as a URDF without shapes, its names numbered, continuous joints as revolute."""
    links = {name: f"link{number}" for number, name in enumerate(facts.links)}
    joints = {name: f"joint{number}" for number, name in enumerate(facts.joints)}
    kept = [selection.base, *(joint.child for joint in selection.below)]
    parts = [_plain_link(facts.links[name], links[name]) for name in kept]
    for joint in selection.below:
        kind = {"continuous": "revolute", "planar": "fixed", "floating": "fixed"}.get(joint.kind, joint.kind)
        parts.append(
            f'<joint name="{joints[joint.name]}" type="{kind}">'
            f"<origin xyz={_words(joint.xyz)} rpy={_words(joint.rpy)}/>"
            f'<parent link="{links[joint.parent]}"/><child link="{links[joint.child]}"/>'
            f'<axis xyz={_words(joint.axis)}/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
        )
    return f'<?xml version="1.0"?><robot name="arm">{"".join(parts)}</robot>'


def _plain_link(link: LinkFacts, name: str) -> str:
    moments = " ".join(f"{key}={_words([value])}" for key, value in zip(MOMENTS, link.moments, strict=True))
    return (
        f'<link name="{name}"><inertial><origin xyz={_words(link.xyz)} rpy={_words(link.rpy)}/>'
        f"<mass value={_words([link.mass])}/><inertia {moments}/></inertial></link>"
    )


def _words(values: Sequence[float]) -> str:
    """Return numbers as a quoted attribute; one too small for some parsers is written as 0."""
    return '"' + " ".join(repr(value if abs(value) > TINY else 0.0) for value in values) + '"'


def _onto_z(axis: tuple[float, ...]) -> Pose:
    """Return the turn that takes z to ``axis`` (of length 1); exact where the axis is a coordinate axis."""
    z = np.array(axis)
    least = int(np.argmin(np.abs(z)))
    x = np.eye(3)[least] - z[least] * z
    x /= np.linalg.norm(x)
    turn: Matrix3 = np.column_stack([x, np.cross(z, x), z])
    return Pose.from_matrix(turn)


def _pose(placement: Any) -> Pose:
    return Pose.from_matrix(np.array(placement.rotation), np.array(placement.translation))
