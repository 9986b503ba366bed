"""Inverse dynamics, inertia matrix, energies and power, for whole batches at once.

One recursion (Newton–Euler, in link frames) serves them all. Source: Featherstone, Rigid Body Dynamics Algorithms,
chapter 5; Luh, Walker & Paul 1980.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from paretoik.arrays import InertiaMatrices, Joints, Values
from paretoik.robot.arm import Arm
from paretoik.robot.chain import Constants, Link, constants, in_blocks, sines
from paretoik.robot.components import (
    ZERO,
    Component,
    Rows,
    Triple,
    add,
    apply,
    apply_transposed,
    cross,
    dot,
    minus,
    plus,
    scale,
    times,
    triple,
    turn,
    turn_back,
)
from paretoik.robot.kinematics import chain


def inverse_dynamics(arm: Arm, q: Joints, dq: Joints, ddq: Joints) -> Joints:
    """Return the joint torques (forces) τ = M q̈ + n(q, q̇), gravity included; all (*batch, dof) [N m, N].

    Raises InvalidInput where the arrays don't fit the arm.
    """
    return in_blocks(partial(torque_components, arm), arm, (arm.dof,), q, dq, ddq)


def torque_components(
    arm: Arm, q: Sequence[Component], dq: Sequence[Component], ddq: Sequence[Component]
) -> list[Component]:
    """Return the joint torques as components."""
    known = constants(arm)
    pull = scale(known.gravity, -1.0)
    return _newton_euler(known, q, _turns(known, q, pull), dq, ddq, pull)


def inertia_matrix(arm: Arm, q: Joints) -> InertiaMatrices:
    """Return M(q), (*batch, dof, dof) [kg m², kg m, kg]: its columns are the torques of unit accelerations.

    Raises InvalidInput where q doesn't fit the arm.
    """
    dof = arm.dof

    def kernel(q: Sequence[Component]) -> list[Component]:
        known = constants(arm)
        turns, still = _turns(known, q, ZERO), [0.0] * dof
        units = [[1.0 if i == j else 0.0 for i in range(dof)] for j in range(dof)]
        found = [_newton_euler(known, q, turns, still, unit, ZERO) for unit in units]
        # The column of joint j is exact from row j on; the rest is its mirror image, so that M is symmetric to the bit.
        return [found[min(i, j)][max(i, j)] for i in range(dof) for j in range(dof)]

    return in_blocks(kernel, arm, (dof, dof), q)


def kinetic_energy(arm: Arm, q: Joints, dq: Joints) -> Values:
    """Return ½ q̇ᵀ M q̇ (*batch,) [J].

    Raises InvalidInput where the arrays don't fit the arm.
    """
    return in_blocks(partial(energy_components, arm), arm, (1,), q, dq)[..., 0]


def energy_components(arm: Arm, q: Sequence[Component], dq: Sequence[Component]) -> list[Component]:
    """Return the kinetic energy, alone in a list, as a component."""
    known = constants(arm)
    spin, speed = ZERO, ZERO
    twice: Component = 0.0
    for link, x, (cosine, sine), rate in zip(known.links, q, _turns(known, q, ZERO), dq, strict=True):
        offset = _offset(link, x)
        speed = turn_back(apply_transposed(link.rotation, add(speed, cross(spin, offset))), cosine, sine)
        spin = turn_back(apply_transposed(link.rotation, spin), cosine, sine)
        if link.prismatic:
            speed = (speed[0], speed[1], plus(speed[2], rate))
        else:
            spin = (spin[0], spin[1], plus(spin[2], rate))
        turning = plus(dot(spin, apply(link.inertia, spin)), times(2.0, dot(speed, cross(spin, link.moment))))
        twice = plus(twice, plus(times(link.mass, dot(speed, speed)), turning))
    return [times(0.5, twice)]


def potential_energy(arm: Arm, q: Joints) -> Values:
    """Return −Σ mᵢ g·cᵢ (*batch,) [J], zero at the world's origin.

    Raises InvalidInput where q doesn't fit the arm.
    """
    gravity = triple(arm.gravity)

    def kernel(q: Sequence[Component]) -> list[Component]:
        known, links = constants(arm), chain(arm, q)
        weighed = add(scale(known.base_translation, known.base_mass), apply(known.base_rotation, known.base_moment))
        for link, rotation, origin in zip(known.links, links.rotations, links.origins, strict=True):
            weighed = add(weighed, add(scale(origin, link.mass), apply(rotation, link.moment)))
        return [times(-1.0, dot(gravity, weighed))]

    return in_blocks(kernel, arm, (1,), q)[..., 0]


def power(torque: Joints, dq: Joints) -> Joints:
    """Return each joint's mechanical power τᵢ q̇ᵢ (*batch, dof) [W]."""
    watts: Joints = np.multiply(torque, dq)
    return watts


def _turns(known: Constants, q: Sequence[Component], pull: Triple) -> list[tuple[Component, Component]]:
    """Return ``sines``, but for a first joint that has nothing to turn: the base's ``pull`` lies on its axis."""
    x, y, _ = apply_transposed(known.links[0].rotation, pull)
    if isinstance(x, float) and isinstance(y, float) and x == y == 0.0:
        return [(1.0, 0.0), *sines(known.links[1:], q[1:])]
    return sines(known.links, q)


def _newton_euler(
    known: Constants,
    q: Sequence[Component],
    turns: Sequence[tuple[Component, Component]],
    dq: Sequence[Component],
    ddq: Sequence[Component],
    pull: Triple,
) -> list[Component]:
    """Return joint torques; ``pull`` is the acceleration of the base (minus gravity) in the base frame."""
    spin, swing, rates = ZERO, ZERO, (ZERO, ZERO, ZERO)
    forces, moments, offsets = [], [], []
    for i, link in enumerate(known.links):
        offset, (cosine, sine) = _offset(link, q[i]), turns[i]
        pull = add(pull, apply(rates, offset))
        pull, spin, swing = (
            turn_back(apply_transposed(link.rotation, vector), cosine, sine) for vector in (pull, spin, swing)
        )
        if link.prismatic:
            pull = add(add(pull, scale(cross(spin, (0.0, 0.0, dq[i])), 2.0)), (0.0, 0.0, ddq[i]))
        else:
            swing = (
                plus(swing[0], times(spin[1], dq[i])),
                minus(swing[1], times(spin[0], dq[i])),
                plus(swing[2], ddq[i]),
            )
            spin = (spin[0], spin[1], plus(spin[2], dq[i]))
        rates = _rates(spin, swing)
        forces.append(add(scale(pull, link.mass), apply(rates, link.moment)))
        moments.append(_moment(link, rates, pull))
        offsets.append(offset)

    torque: list[Component] = [0.0] * len(known.links)
    force, moment = ZERO, ZERO
    for i in reversed(range(len(known.links))):
        force, moment = add(force, forces[i]), add(moment, moments[i])
        torque[i] = force[2] if known.links[i].prismatic else moment[2]
        if i == 0:
            break
        cosine, sine = turns[i]
        force = apply(known.links[i].rotation, turn(force, cosine, sine))
        moment = add(apply(known.links[i].rotation, turn(moment, cosine, sine)), cross(offsets[i], force))
    return torque


def _rates(spin: Triple, swing: Triple) -> Rows:
    """Return [ω̇]× + [ω]×[ω]×: times a point of the link, that point's acceleration past the origin's."""
    x, y, z = spin
    xx, yy, zz, xy, xz, yz = times(x, x), times(y, y), times(z, z), times(x, y), times(x, z), times(y, z)
    return (
        (times(-1.0, plus(yy, zz)), minus(xy, swing[2]), plus(xz, swing[1])),
        (plus(xy, swing[2]), times(-1.0, plus(xx, zz)), minus(yz, swing[0])),
        (minus(xz, swing[1]), plus(yz, swing[0]), times(-1.0, plus(xx, yy))),
    )


def _moment(link: Link, rates: Rows, pull: Triple) -> Triple:
    """Return ∫ r × r̈ dm about the link's origin: the axial vector of ∫ r̈ rᵀ dm."""

    def entry(row: int, column: int) -> Component:
        return plus(dot(rates[row], link.second[column]), times(pull[row], link.moment[column]))

    return minus(entry(2, 1), entry(1, 2)), minus(entry(0, 2), entry(2, 0)), minus(entry(1, 0), entry(0, 1))


def _offset(link: Link, q: Component) -> Triple:
    """Return the origin of a link in the frame of the one before, a sliding joint's travel included."""
    if not link.prismatic:
        return link.translation
    axis = (link.rotation[0][2], link.rotation[1][2], link.rotation[2][2])
    return add(link.translation, scale(axis, q))
