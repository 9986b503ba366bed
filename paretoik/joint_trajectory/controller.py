"""A robot's controller: its rate, the limits it enforces on every command, and what it wants at both ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from paretoik.arrays import read_only
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.inputs import check_flag, check_instance, check_text, finite_array, positive_number, read_list, shown
from paretoik.robot.arm import Arm, check_arm
from paretoik.robot.arm_inputs import joint_positions, limit_rows, symmetric_limits
from paretoik.tables import html_representation

JOINT_LIMITS = ("velocity", "acceleration", "jerk", "torque", "torque_rate")


@check_call
@dataclass(frozen=True, kw_only=True, eq=False)
class Braking:
    """How a velocity limit shrinks towards the ends of a joint's range, so that it can always brake.

    q̇ ≤ √(2 d (q⁺ − q)) − offset, not below 0, and likewise towards q⁻: with ``double_deceleration`` 2 d (dof,)
    [rad/s²], ``offset`` (dof,) [rad/s] and the ends ``position`` (dof, 2) [rad]. FCI documentation, Position-Based
    Velocity Limits.
    """

    double_deceleration: Float[np.ndarray, " dof"]
    offset: Float[np.ndarray, " dof"]
    position: Float[np.ndarray, "dof 2"]

    def __post_init__(self) -> None:
        for name in ("double_deceleration", "offset", "position"):
            object.__setattr__(self, name, read_only(finite_array(f"braking: {name}", getattr(self, name))))
        dof = self.double_deceleration.shape[:1]
        if self.offset.shape != dof or self.double_deceleration.ndim != 1 or self.position.shape != (*dof, 2):
            shapes = f"{self.double_deceleration.shape}, {self.offset.shape} and {self.position.shape}"
            raise InvalidInput(
                f"braking: double_deceleration, offset (dof,) and position (dof, 2) wanted, got shapes {shapes}"
            )

    def velocity_bounds(self, q: Float[np.ndarray, "time dof"]) -> Float[np.ndarray, "2 time dof"]:
        """Return the lower and upper velocities [rad/s] that leave room to brake at joint positions q."""
        q = np.atleast_2d(joint_positions(q, len(self.position)))
        room = np.stack([q - self.position[:, 0], self.position[:, 1] - q])
        speed = np.maximum(np.sqrt(np.maximum(self.double_deceleration * room, 0.0)) - self.offset, 0.0)
        return speed * np.array([-1.0, 1.0])[:, None, None]


@check_call
@dataclass(frozen=True, kw_only=True, eq=False)
class Controller:
    """What a robot's controller takes: joints by name, one command every 1/``rate`` [Hz], each within its limits.

    ``position`` as (lower, upper), symmetric, or an array (dof, 2) [rad, m], the others symmetric, a number or one a
    joint: ``velocity`` [rad/s], ``acceleration`` [rad/s²], ``jerk`` [rad/s³], ``torque`` [N m], ``torque_rate``
    [N m/s]; None where there is none, or none is published. Every motion must start and end at rest;
    ``rest_acceleration`` says that its acceleration must be 0 there too. ``source`` says where the figures are from.
    ``other_joint_names`` are what other files of the vendor's call the same joints. ``dataclasses.replace`` makes a
    controller that differs in one of these.

    Raises InvalidInput where a name repeats, or a figure is not positive or not one a joint.

    >>> mine = Controller(name="bench", joint_names=("joint1", "joint2"), rate=250, velocity=[1.5, 2.0])
    >>> mine.velocity
    array([1.5, 2. ])
    """

    name: str
    joint_names: Sequence[str]
    rate: float
    position: Any = None
    velocity: Any = None
    acceleration: Any = None
    jerk: Any = None
    torque: Any = None
    torque_rate: Any = None
    rest_acceleration: bool = False
    braking: Braking | None = None
    source: str = ""
    other_joint_names: Sequence[Sequence[str]] = ()

    def __post_init__(self) -> None:
        assign = object.__setattr__
        check_text("controller: name", self.name)
        check_text("controller: source", self.source)
        if self.braking is not None:
            check_instance("controller: braking", self.braking, Braking, "a Braking or None")
        names, about = check_joint_names("joint_names", self.joint_names), f"controller {self.name}"
        assign(self, "joint_names", names)
        lists = read_list("other_joint_names", self.other_joint_names, list | tuple, "lists of joint names")
        others = [check_joint_names("other_joint_names", each) for each in lists]
        if any(len(each) != len(names) for each in others):
            raise InvalidInput(f"{about}: other_joint_names: {len(names)} in each list wanted, got {shown(others)}")
        assign(self, "rate", positive_number(f"{about}: rate", self.rate, "Hz"))
        check_flag(f"{about}: rest_acceleration", self.rest_acceleration)
        position = self.position
        if isinstance(position, np.ndarray) and position.shape == (len(names), 2):
            position = tuple(position.T)
        assign(self, "position", limit_rows(f"{about}: position", position, len(names)))
        for kind in JOINT_LIMITS:
            assign(self, kind, symmetric_limits(f"{about}: {kind}", getattr(self, kind), len(names)))

    def __repr__(self) -> str:
        return f"Controller({self.name!r}, {self.rate:g} Hz, {len(self.joint_names)} joints)"

    _repr_html_ = html_representation

    def velocity_bounds(self, q: Float[np.ndarray, "time dof"]) -> Float[np.ndarray, "2 time dof"]:
        """Return the lower and upper velocity limits [rad/s] at joint positions q."""
        q = np.atleast_2d(joint_positions(q, len(self.joint_names)))
        bounds = np.stack(np.broadcast_arrays(-self.velocity, self.velocity))[:, None, :]
        if self.braking is None:
            return np.broadcast_to(bounds, (2, *q.shape))
        lower, upper = self.braking.velocity_bounds(q)
        return np.stack([np.maximum(bounds[0], lower), np.minimum(bounds[1], upper)])

    def moves(self, arm: Arm) -> bool:
        """Say whether the joints of an arm are the controller's, by name, prefixed or not."""
        return self._order(arm) is not None

    def arranged_for(self, arm: Arm) -> Controller:
        """Return the controller with its joints in the order of the arm's, matched by name, prefixed or not.

        Raises InvalidInput where they are not the same joints.
        """
        order = self._order(arm)
        if order is None:
            names = " or ".join(", ".join(each) for each in (self.joint_names, *self.other_joint_names))
            raise InvalidInput(
                f"controller {self.name}: wants the joints {names}, with one prefix or none, "
                f"got {', '.join(arm.joint_names)} of {arm.name}"
            )
        if order == list(range(len(order))):
            return self
        braking = self.braking
        if braking is not None:
            braking = Braking(**{each.name: getattr(braking, each.name)[order] for each in fields(Braking)})
        return replace(
            self,
            joint_names=[self.joint_names[i] for i in order],
            other_joint_names=[[names[i] for i in order] for names in self.other_joint_names],
            braking=braking,
            **{kind: getattr(self, kind)[order] for kind in ("position", *JOINT_LIMITS)},
        )

    def _order(self, arm: Arm) -> list[int] | None:
        """Return, for each joint of an arm, which of the controller's it is; None where they are not the same."""
        check_arm("arm", arm)
        for names in (self.joint_names, *self.other_joint_names):
            first = arm.joint_names[0]
            for prefix in (first.removesuffix(name) for name in names if first.endswith(name)):
                whole = [prefix + name for name in names]
                if sorted(whole) == sorted(arm.joint_names):
                    return [whole.index(joint) for joint in arm.joint_names]
        return None


def check_joint_names(name: str, values: object) -> tuple[str, ...]:
    """Return joint names; raises InvalidInput, by ``name``, for what is no list of different texts."""
    names = tuple(values) if isinstance(values, Sequence) and not isinstance(values, str) else ()
    if not names or not all(isinstance(value, str) and value for value in names):
        raise InvalidInput(f"{name}: a list of joint names wanted, got {shown(values)}")
    twice = next((joint for i, joint in enumerate(names) if joint in names[:i]), None)
    if twice is not None:
        raise InvalidInput(f"{name}: each joint once wanted, got {twice} twice")
    return names
