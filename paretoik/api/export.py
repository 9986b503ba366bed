"""Hand one motion to a robot: sampled at its controller's rate, checked against its limits, and written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from paretoik.errors import InvalidInput
from paretoik.front.front import Choice
from paretoik.inputs import check_call, check_flag, check_mapping, file_path, positive_number, shown
from paretoik.joint_trajectory.controllers import Controller, find_controller
from paretoik.joint_trajectory.fitting import LimitUse, fit_motion
from paretoik.joint_trajectory.formats import Format, check_bag, find_format, write_trajectory
from paretoik.joint_trajectory.trajectory import JointTrajectory, same_joints, sample_motion, time_scaling
from paretoik.runs.files import check_target, to_json
from paretoik.task.motion import Motion

MADE = ("made by", "arm", "controller", "controller rate", "rate", "time_scale", "ramp", "use of limits")


@check_call
def export(
    motion: Choice | Motion,
    file: str | Path,
    *,
    format: Format | None = None,
    rate: float | None = None,
    controller: str | Controller | None = None,
    joint_names: Sequence[str] | None = None,
    time_scale: float = 1.0,
    slow_down: bool = False,
    ramp: float = 0.0,
    metadata: Mapping[str, Any] | None = None,
    overwrite: bool = False,
) -> JointTrajectory:
    """Write one motion as a trajectory for a robot, and return what was written.

    The motion's own curve is sampled at ``rate`` [Hz]: positions, velocities and accelerations, its duration rounded up
    to whole periods. ``format`` is "csv", "parquet", "npz", "joint-trajectory" (ROS 2, as YAML) or "ros2-bag" (a
    folder); else the ending of ``file`` says it. Columns are in the order of the arm's joints, or of ``joint_names``.

    Without a ``rate`` it is the controller's, or as many samples as the motion has where there is no controller.

    The motion keeps the limits of ``controller``, one of ``pk.controllers`` or its name, or "franka", "ur" or "kinova":
    positions; velocities, accelerations and jerks, as differences of what is sent and of the curve; torques of an arm
    with masses; rest at both ends. Whatever ``rate`` is, all that is looked at at the controller's own; from samples at
    a lower one it interpolates a motion of its own, which is not checked. Without a controller nothing is checked.

    ``time_scale`` ≥ 1 slows the motion down; with ``slow_down`` it is slowed down further, as little as the limits ask
    for; ``ramp`` [s] lets it start from rest and come to rest, each within that time. All three keep to the curve, and
    change when the arm is where. ``metadata`` is kept in the file with what made it, which it may not say otherwise;
    ``objectives`` of a choice may be named in it.

    Raises InvalidInput for what cannot be exported so, or a file that is there without ``overwrite``; Infeasible, by
    joint, quantity, time, value and limit, where the controller would refuse.
    """
    target = file_path("file", file)
    kind = find_format(target, format)
    check_flag("slow_down", slow_down)
    check_flag("overwrite", overwrite)
    one, about = _one_motion(motion)
    names = one.arm.joint_names if joint_names is None else same_joints(joint_names, one.arm.joint_names)
    its = None if controller is None else find_controller(controller, one.arm)
    scaling = time_scaling(float(one.duration), _rate(rate, its, one), time_scale=time_scale, ramp=ramp)
    notes = _notes(metadata, about)
    if kind == "ros2-bag":
        check_bag(target, overwrite=overwrite)
    else:
        check_target("export", target, overwrite=overwrite)
    if its is None:
        if slow_down:
            raise InvalidInput("slow_down: a controller, whose limits say how much, wanted, got none")
        trajectory, uses = sample_motion(one, scaling), list[LimitUse]()
    else:
        trajectory, scaling, uses = fit_motion(one, scaling, its, slower=slow_down)
    made = (
        f"paretoik {version('paretoik')}",
        one.arm.name,
        *((None, None) if its is None else (its.name, its.rate)),
        scaling.rate,
        scaling.factor,
        scaling.ramp,
        {use.quantity: use.use for use in uses},
    )
    trajectory = replace(trajectory.reorder(names), metadata=dict(zip(MADE, made, strict=True)) | about | notes)
    write_trajectory(trajectory, target, kind)
    return trajectory


def _one_motion(motion: Choice | Motion) -> tuple[Motion, dict[str, Any]]:
    about: dict[str, Any] = {}
    if isinstance(motion, Choice):
        about = {"point": motion.id, "objectives": motion.objectives, "reason": motion.reason}
        motion = motion.motion
        if motion is not None and not isinstance(motion, Motion):
            raise InvalidInput(
                "motion: a choice whose front knows its arm wanted, got one without; open the run with its problem: "
                "pk.load_front(folder, problem), or --problem FILE.py:NAME"
            )
    if not isinstance(motion, Motion):
        raise InvalidInput(f"motion: a Motion or the Choice of one wanted, got {shown(motion)}")
    if motion.q.ndim != 2:
        raise InvalidInput(f"motion: one motion wanted, got a batch of {motion.q.shape[:-2]}; pick one: motions[0]")
    return motion, about


def _notes(metadata: Mapping[str, Any] | None, about: Mapping[str, Any]) -> dict[str, Any]:
    """Return a user's own metadata; raises InvalidInput where it has a name of ours, or what JSON cannot hold."""
    if metadata is not None:
        check_mapping("metadata", metadata, "entries by name")
    notes: dict[str, Any] = to_json(dict(metadata or {}), name="metadata")
    ours = next((name for name in notes if name in {*MADE, *about} - {"objectives"}), None)
    if ours is not None:
        raise InvalidInput(f"metadata: wanted other names than those of what export says itself, got {shown(ours)}")
    return notes


def _rate(rate: float | None, controller: Controller | None, motion: Motion) -> float:
    if rate is not None:
        return positive_number("rate", rate, "Hz")
    return (len(motion.time) - 1) / float(motion.duration) if controller is None else controller.rate
