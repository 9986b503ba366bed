"""Inverse dynamics, inertia matrix, kinetic energy and power, in batches.

One recursion (Newton–Euler, in link frames) gives torques and inertia.
Source: Featherstone, Rigid Body Dynamics Algorithms, chapter 5; Luh, Walker & Paul 1980.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from paretoik.arrays import InertiaMatrices, Joints, Values
from paretoik.robot.chain import SerialChain
from paretoik.robot.components import (
    ZERO,
    Component,
    Matrix,
    Vector,
    add,
    apply,
    apply_transposed,
    cross,
    dot,
    evaluate_in_blocks,
    minus,
    plus,
    rotate_about_z,
    rotate_back_about_z,
    scale,
    times,
)
from paretoik.robot.kinematics import ArmConstants, LinkConstants, arm_constants, joint_cosines_and_sines


def inverse_dynamics(arm: SerialChain, q: Joints, dq: Joints, ddq: Joints) -> Joints:
    """Return torques τ = M q̈ + n(q, q̇) (*batch, dof) [N m, N], gravity included."""
    return evaluate_in_blocks(partial(torque_components, arm), arm, (arm.dof,), q, dq, ddq)


def gravity_torques(arm: SerialChain, q: Joints) -> Joints:
    """Return the torques (*batch, dof) [N m, N] that hold the arm at rest."""
    return inverse_dynamics(arm, q, np.zeros_like(q), np.zeros_like(q))


def torque_components(
    arm: SerialChain, q: Sequence[Component], dq: Sequence[Component], ddq: Sequence[Component]
) -> list[Component]:
    """Return the joint torques as components."""
    constants = arm_constants(arm)
    acceleration = scale(constants.gravity, -1.0)  # gravity acts like a base that accelerates upwards
    return _newton_euler(constants, q, _cosines_and_sines(constants, q, acceleration), dq, ddq, acceleration)


def inertia_matrix(arm: SerialChain, q: Joints) -> InertiaMatrices:
    """Return M(q) (*batch, dof, dof) [kg m², kg m, kg], by torques of unit accelerations."""
    dof = arm.dof

    def kernel(q: Sequence[Component]) -> list[Component]:
        constants = arm_constants(arm)
        cosines_and_sines, zeros = _cosines_and_sines(constants, q, ZERO), [0.0] * dof
        units = [[1.0 if i == j else 0.0 for i in range(dof)] for j in range(dof)]
        columns = [_newton_euler(constants, q, cosines_and_sines, zeros, unit, ZERO) for unit in units]
        # The column of joint j is exact from row j on; the rest is mirrored, so that M is exactly symmetric.
        return [columns[min(i, j)][max(i, j)] for i in range(dof) for j in range(dof)]

    return evaluate_in_blocks(kernel, arm, (dof, dof), q)


def kinetic_energy(arm: SerialChain, q: Joints, dq: Joints) -> Values:
    """Return ½ q̇ᵀ M q̇ (*batch,) [J]."""
    return evaluate_in_blocks(partial(energy_components, arm), arm, (1,), q, dq)[..., 0]


def energy_components(arm: SerialChain, q: Sequence[Component], dq: Sequence[Component]) -> list[Component]:
    """Return the kinetic energy as a component, in a list of one."""
    constants = arm_constants(arm)
    angular_velocity, velocity = ZERO, ZERO
    doubled: Component = 0.0
    cosines_and_sines = _cosines_and_sines(constants, q, ZERO)
    for link, x, (cosine, sine), rate in zip(constants.links, q, cosines_and_sines, dq, strict=True):
        origin = _origin(link, x)
        velocity = add(velocity, cross(angular_velocity, origin))
        velocity = rotate_back_about_z(apply_transposed(link.rotation, velocity), cosine, sine)
        angular_velocity = rotate_back_about_z(apply_transposed(link.rotation, angular_velocity), cosine, sine)
        if link.prismatic:
            velocity = (velocity[0], velocity[1], plus(velocity[2], rate))
        else:
            angular_velocity = (angular_velocity[0], angular_velocity[1], plus(angular_velocity[2], rate))
        rotational = plus(
            dot(angular_velocity, apply(link.inertia, angular_velocity)),
            times(2.0, dot(velocity, cross(angular_velocity, link.first_moment))),
        )
        doubled = plus(doubled, plus(times(link.mass, dot(velocity, velocity)), rotational))
    return [times(0.5, doubled)]


def _cosines_and_sines(
    constants: ArmConstants, q: Sequence[Component], acceleration: Vector
) -> list[tuple[Component, Component]]:
    """Return cosines and sines; (1, 0) for the first joint if gravity is along its axis."""
    x, y, _ = apply_transposed(constants.links[0].rotation, acceleration)
    if isinstance(x, float) and isinstance(y, float) and x == y == 0.0:
        return [(1.0, 0.0), *joint_cosines_and_sines(constants.links[1:], q[1:])]
    return joint_cosines_and_sines(constants.links, q)


def _newton_euler(
    constants: ArmConstants,
    q: Sequence[Component],
    cosines_and_sines: Sequence[tuple[Component, Component]],
    dq: Sequence[Component],
    ddq: Sequence[Component],
    acceleration: Vector,
) -> list[Component]:
    """Return torques by the recursion.

    acceleration: acceleration of the base minus gravity, in the base frame
    """
    omega, omega_rate, gradient = ZERO, ZERO, (ZERO, ZERO, ZERO)
    forces, moments, origins = [], [], []
    for i, link in enumerate(constants.links):
        origin, (cosine, sine) = _origin(link, q[i]), cosines_and_sines[i]
        acceleration = add(acceleration, apply(gradient, origin))
        acceleration, omega, omega_rate = (
            rotate_back_about_z(apply_transposed(link.rotation, vector), cosine, sine)
            for vector in (acceleration, omega, omega_rate)
        )
        if link.prismatic:
            coriolis = scale(cross(omega, (0.0, 0.0, dq[i])), 2.0)
            acceleration = add(add(acceleration, coriolis), (0.0, 0.0, ddq[i]))
        else:
            omega_rate = (
                plus(omega_rate[0], times(omega[1], dq[i])),
                minus(omega_rate[1], times(omega[0], dq[i])),
                plus(omega_rate[2], ddq[i]),
            )
            omega = (omega[0], omega[1], plus(omega[2], dq[i]))
        # [ω̇]× + [ω]×[ω]×: times a link's point, this is the point's acceleration relative to the origin
        x, y, z = omega
        xx, yy, zz, xy, xz, yz = times(x, x), times(y, y), times(z, z), times(x, y), times(x, z), times(y, z)
        gradient = (
            (times(-1.0, plus(yy, zz)), minus(xy, omega_rate[2]), plus(xz, omega_rate[1])),
            (plus(xy, omega_rate[2]), times(-1.0, plus(xx, zz)), minus(yz, omega_rate[0])),
            (minus(xz, omega_rate[1]), plus(yz, omega_rate[0]), times(-1.0, plus(xx, yy))),
        )
        forces.append(add(scale(acceleration, link.mass), apply(gradient, link.first_moment)))
        moments.append(_moment(link, gradient, acceleration))
        origins.append(origin)
    torque: list[Component] = [0.0] * len(constants.links)
    force, moment = ZERO, ZERO
    for i, link in reversed(list(enumerate(constants.links))):
        force, moment = add(force, forces[i]), add(moment, moments[i])
        torque[i] = force[2] if link.prismatic else moment[2]
        if i > 0:
            force, moment = (
                apply(link.rotation, rotate_about_z(vector, *cosines_and_sines[i])) for vector in (force, moment)
            )
            moment = add(moment, cross(origins[i], force))
    return torque


def _moment(link: LinkConstants, gradient: Matrix, acceleration: Vector) -> Vector:
    """Return ∫ r × r̈ dm about the link's origin. It is the axial vector of ∫ r̈ rᵀ dm."""

    def entry(row: int, column: int) -> Component:
        return plus(
            dot(gradient[row], link.second_moments[column]), times(acceleration[row], link.first_moment[column])
        )

    return minus(entry(2, 1), entry(1, 2)), minus(entry(0, 2), entry(2, 0)), minus(entry(1, 0), entry(0, 1))


def _origin(link: LinkConstants, q: Component) -> Vector:
    """Return the origin of a link in the previous frame; a prismatic joint shifts it."""
    if not link.prismatic:
        return link.translation
    axis = (link.rotation[0][2], link.rotation[1][2], link.rotation[2][2])
    return add(link.translation, scale(axis, q))
