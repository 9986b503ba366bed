"""Export one motion to a robot as a checked, sampled trajectory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from paretoik.errors import InvalidInput
from paretoik.front.front import Choice
from paretoik.inputs import check_flag, check_mapping, file_path, positive_number, shown
from paretoik.joint_trajectory.controllers import Controller, find_controller
from paretoik.joint_trajectory.fitting import LimitUse, fit_motion
from paretoik.joint_trajectory.formats import Format, check_bag, find_format, write_trajectory
from paretoik.joint_trajectory.trajectory import JointTrajectory, same_joints, sample_motion, time_scaling
from paretoik.runs.files import check_target, to_json
from paretoik.task.motion import Motion

MADE = ("made by", "arm", "controller", "controller rate", "rate", "time_scale", "ramp", "use of limits")


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
    """Write one motion as a trajectory for a robot, and return it.

    Parameters
    ----------
    motion
        Motion, or choice from a front.
    file
        Path of the file to write, or of the folder for "ros2-bag".
    format
        Format: "csv", "parquet", "npz", "joint-trajectory" (ROS 2 YAML), "ros2-bag"; default: by ``file``'s ending.
    rate
        Sample rate [Hz]; default: the controller's, or without a controller the motion's own.
    controller
        Controller whose limits must hold, a name in ``pk.controllers``, "franka", "ur" or "kinova"; default: no check.
    joint_names
        Order of the joints in columns; default: that of the arm.
    time_scale
        Factor ≥ 1 by which the motion is slowed down (default 1).
    slow_down
        Whether to slow down further, as little as the limits require (default False).
    ramp
        Duration [s] of each ramp, from rest at the start and to rest at the end (default 0).
    metadata
        Further entries of the file; they may replace a choice's ``objectives``, but no other entry of export.
    overwrite
        Whether to replace a file that exists (default False).

    Returns
    -------
    JointTrajectory
        Positions, velocities and accelerations of the motion's own curve; its duration is rounded up to whole periods.

    Raises
    ------
    InvalidInput
        If an argument cannot be used, or the file exists and ``overwrite`` is False.
    Infeasible
        If the controller would refuse the motion; the error names joint, quantity, time, value and limit.

    Notes
    -----
    Limits of a controller are: positions; velocities, accelerations and jerks, as differences of the samples and as
    derivatives of the curve; torques of an arm with masses; rest at both ends. They are checked at the controller's own
    rate. From samples at a lower ``rate`` the controller interpolates a motion of its own, which is not checked.

    ``time_scale``, ``slow_down`` and ``ramp`` keep the curve and change only its timing.
    """
    target = file_path("file", file)
    kind = find_format(target, format)
    check_flag("slow_down", slow_down)
    check_flag("overwrite", overwrite)
    one, about = _one_motion(motion)
    names = one.arm.joint_names if joint_names is None else same_joints(joint_names, one.arm.joint_names)
    its = None if controller is None else find_controller(controller, one.arm)
    if rate is not None:
        rate = positive_number("rate", rate, "Hz")
    elif its is not None:
        rate = its.rate
    else:
        rate = (len(one.time) - 1) / float(one.duration)
    scaling = time_scaling(float(one.duration), rate, time_scale=time_scale, ramp=ramp)
    if metadata is not None:
        check_mapping("metadata", metadata, "entries by name")
    notes: dict[str, Any] = to_json(dict(metadata or {}), name="metadata")
    ours = next((name for name in notes if name in {*MADE, *about} - {"objectives"}), None)
    if ours is not None:
        raise InvalidInput(f"metadata must not use the names of entries that export writes, got {shown(ours)}")
    if kind == "ros2-bag":
        check_bag(target, overwrite=overwrite)
    else:
        check_target("export", target, overwrite=overwrite)
    if its is None:
        if slow_down:
            raise InvalidInput("slow_down must come with a controller, whose limits it satisfies, got none")
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
                "motion must be a choice from a front with its arm, got a front without arm; load the run with its "
                "problem: pk.load_front(folder, problem), or --problem FILE.py:NAME"
            )
    if not isinstance(motion, Motion):
        raise InvalidInput(f"motion must be a Motion or a Choice that has one, got {shown(motion)}")
    if motion.q.ndim != 2:
        raise InvalidInput(f"motion must be one motion, got a batch of {motion.q.shape[:-2]}; pick one: motions[0]")
    return motion, about
