"""Planar arms under gravity, with motors and rods that drive them."""

from __future__ import annotations

import numpy as np

import paretoik as pk


def planar(links, length=0.3, mass=0.4, limits=None):
    arm = pk.Arm.planar(
        lengths=[length] * links,
        masses=[mass] * links,
        centers=[length / 2] * links,
        inertias=[0.0] * links,
        position_limits=limits,
    )
    return arm.mounted(gravity=[0.0, -9.81, 0.0])


def motors(stall, shape="diamond"):
    fastest = np.linspace(1.0, 2.0, len(stall))
    return pk.capability.JointActuation(motors=pk.capability.MotorCurve(stall=stall, fastest=fastest, shape=shape))


def rods(dof, zero):
    curve = pk.capability.MotorCurve(
        stall=[195.9, 95.8, 75.8, 55.8][:dof], fastest=[1.8e-3, 7.1e-3, 7.1e-3, 7.1e-3][:dof]
    )
    return pk.capability.DistributedActuation(front=curve, rod=0.080, front_bounds=(0.037, 0.077), zero=zero)


def sliders(shape="diamond", bend=1.0, **changed):
    """Return the actuation of two joints, each with a rod and two sliders."""
    motors = pk.capability.MotorCurve(stall=[60.0, 40.0], fastest=[0.01, 0.02], shape=shape)
    geometry = {"rod": [0.08, 0.09], "front_bounds": (0.03, 0.075), "back_bounds": (0.02, 0.085), "zero": [0.3, -0.2]}
    return pk.capability.DistributedActuation(front=motors, bend=bend, **{**geometry, **changed})
