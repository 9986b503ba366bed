"""From a URDF to an arm: validate the whole file, select the chain from base to tip, then build."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.inputs import file_path
from paretoik.robot.arm import Arm
from paretoik.robot.urdf_builder import build_arm
from paretoik.robot.urdf_chain import find_zero_limits, select_chain
from paretoik.robot.urdf_description import JointDescription
from paretoik.robot.urdf_validation import read_robot


@dataclass(frozen=True, kw_only=True)
class RobotReport:
    """What a URDF holds: its faults, warnings about what loads but may surprise, and a summary in a few lines."""

    file: Path
    faults: tuple[str, ...]
    warnings: tuple[str, ...]
    summary: tuple[str, ...]


def check_robot(file: str | Path, base: str | None = None, tip: str | None = None) -> RobotReport:
    """Return what a URDF holds, between links ``base`` (default: the root) and ``tip`` (default: the only leaf).

    Never opens a mesh. Raises InvalidInput where there is no such file, or for links that it has not.
    """
    file = file_path("file", file)
    try:
        robot = read_robot(file)
    except InvalidRobot as error:
        return RobotReport(file=file, faults=error.faults, warnings=(), summary=())
    summary = [f"robot {robot.name}: {len(robot.links)} links, {len(robot.joints)} joints"]
    if robot.faults:
        return RobotReport(file=file, faults=robot.faults, warnings=robot.warnings, summary=tuple(summary))
    summary.append(f"root {robot.roots[0]}, leaves {', '.join(robot.leaves)}")
    if tip is None and len(robot.leaves) > 1:
        summary.append("several leaves: name one as tip to see its chain")
        return RobotReport(file=file, faults=(), warnings=robot.warnings, summary=tuple(summary))
    chain = select_chain(str(file), robot, base, tip, {})
    summary.append(f"chain {chain.base} to {chain.tip}: {len(chain.moving)} moving joints")
    summary += [_summarise(joint) for joint in chain.moving]
    return RobotReport(
        file=file,
        faults=chain.faults,
        warnings=(*robot.warnings, *chain.notices, *find_zero_limits(chain)),
        summary=tuple(summary),
    )


def from_urdf(
    file: Path,
    *,
    base: str | None,
    tip: str | None,
    fixed: Mapping[str, float] | None,
    zero_limits: Literal["unlimited"] | None = None,
) -> Arm:
    """Return the arm between two links of a URDF; see ``Arm.from_urdf``.

    Raises InvalidRobot listing every fault, InvalidInput for unknown names or zero limits.
    """
    if not isinstance(fixed, Mapping | None):
        raise InvalidInput(f"fixed: values by joint wanted, such as {{'joint1': 0.3}}, got {fixed!r}")
    robot = read_robot(file)
    if robot.faults:
        raise InvalidRobot(str(file), robot.faults)
    chain = select_chain(str(file), robot, base, tip, dict(fixed or {}))
    if chain.faults:
        raise InvalidRobot(str(file), chain.faults)
    if zero_limits not in (None, "unlimited"):
        raise InvalidInput(f"zero_limits must be 'unlimited' or None, got {zero_limits!r}")
    if zero_limits is None and (zeros := find_zero_limits(chain)):
        raise InvalidInput(f"{file}: {'; '.join(zeros)}")
    return replace(build_arm(str(file), robot, chain), source=file)


def _summarise(joint: JointDescription) -> str:
    length, force = ("m", "N") if joint.type == "prismatic" else ("rad", "N m")
    limits = f"{joint.lower:g} to {joint.upper:g} {length}" if np.isfinite(joint.upper - joint.lower) else "no end"
    return f"  {joint.name}: {joint.type}, {limits}, {joint.velocity:g} {length}/s, {joint.effort:g} {force}"
