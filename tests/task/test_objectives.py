"""Objectives: those of the library compared with plain loops, users' own, and refusals."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import paretoik as pk
from paretoik import Arm, Motion, line
from paretoik.collision.obstacles import Sphere
from paretoik.errors import EvaluationFailed, InvalidInput
from paretoik.robot.dynamics import inertia_matrix, inverse_dynamics
from paretoik.robot.kinematics import jacobian
from paretoik.task import objectives
from paretoik.task.objectives import Objective

LIMITED = Arm.planar(
    lengths=[0.3, 0.25, 0.2, 0.1],
    masses=[1.0, 0.8, 0.5, 0.2],
    centers=[0.15, 0.12, 0.1, 0.05],
    inertias=[0.01, 0.008, 0.004, 0.001],
    position_limits=([-1.0, -2.0, -np.inf, 0.5], [2.0, 2.0, np.inf, 0.5]),
    velocity_limits=[30.0, 40.0, np.inf, 50.0],
    name="limited arm",
)
PATH = line([0.5, 0.1], [0.3, 0.4], duration=2.0, samples=17)
BALL = Sphere([0.3, 0.3, 0.0], 0.05)
MOTIONS = {
    differences: Motion(
        arm=LIMITED,
        time=PATH.times + 0.02 * np.sin(np.pi * PATH.times),
        q=np.random.default_rng(0).normal(size=(3, 17, 4)),
        obstacles=(BALL,),
        link_radius=0.01,
        differences=differences,
    )
    for differences in ("backward", "central")
}
LIBRARY = [member for member in vars(objectives).values() if isinstance(member, Objective)]  # in their order
every_motion = pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS.keys())


def quadrature(motion, values):
    """Integrate one motion's values in a plain loop: rectangles at the right end, or trapezoids."""
    t, total = motion.time, 0.0
    for i in range(1, len(t)):
        height = values[i] if motion.differences == "backward" else (values[i] + values[i - 1]) / 2
        total += height * (t[i] - t[i - 1])
    return total


def nearness(value, lower, upper):
    """Return the nearness of a value to its limits, constant within a thousandth of the range."""
    edge = (upper - lower) / 1000
    value = min(max(value, lower + edge), upper - edge)
    return (upper - lower) ** 2 / (4 * (upper - value) * (value - lower))


LOADS = ("torque_norm", "mechanical_energy", "peak_torque")


def by_hand(name, motion):
    """Return an objective of a single motion, computed from q, q̇ and q̈ sample by sample."""
    arm, q, v, a = motion.arm, motion.q, motion.dq, motion.ddq
    samples = range(len(q))
    torques = [inverse_dynamics(arm, q[i], v[i], a[i]) for i in samples] if name in LOADS else []
    duration = motion.time[-1] - motion.time[0]
    if name == "kinetic_energy":
        return quadrature(motion, [0.5 * v[i] @ inertia_matrix(arm, q[i]) @ v[i] for i in samples])
    if name == "torque_norm":
        return quadrature(motion, [torque @ torque for torque in torques])
    if name == "mechanical_energy":
        return quadrature(motion, [sum(abs(torques[i][j] * v[i][j]) for j in range(4)) for i in samples])
    if name == "joint_travel":
        return quadrature(motion, [sum(abs(v[i][j]) for j in range(4)) for i in samples])
    if name == "joint_drift":
        return np.sqrt(sum((q[-1][j] - q[0][j]) ** 2 for j in range(4))) / 4
    if name == "joint_limit_distance":
        first, second = ((q[:, 0] - 0.5) / 3.0) ** 2, (q[:, 1] / 4.0) ** 2
        return quadrature(motion, (first + second) / 8) / duration
    if name == "joint_limit_nearness":
        return quadrature(motion, [nearness(q[i][0], -1.0, 2.0) + nearness(q[i][1], -2.0, 2.0) for i in samples])
    if name == "velocity_limit_nearness":
        limits = {0: 30.0, 1: 40.0, 3: 50.0}
        return quadrature(motion, [sum(nearness(v[i][j], -limits[j], limits[j]) for j in limits) for i in samples])
    if name == "manipulability":
        planes = [jacobian(arm, q[i])[:2] for i in samples]
        return quadrature(motion, [np.sqrt(np.linalg.det(plane @ plane.T)) for plane in planes]) / duration
    if name == "peak_velocity":
        return max(abs(v[i][j]) for i in samples for j in range(4))
    if name == "peak_torque":
        return max(abs(torques[i][j]) for i in samples for j in range(4))
    if name == "jerk":
        return quadrature(motion, [jerk @ jerk for jerk in motion.jerk])
    clearance = np.inf
    for nodes in motion.links:
        for start, end in pairwise(nodes):
            points = start + np.linspace(0, 1, 2001)[:, None] * (end - start)
            clearance = min(clearance, np.linalg.norm(points - BALL.center, axis=1).min())
    return clearance - BALL.radius - motion.link_radius


@every_motion
@pytest.mark.parametrize("objective", LIBRARY, ids=lambda objective: objective.name)
def test_the_librarys_objectives_are_what_plain_loops_make_them(objective, motion):
    chosen = motion if objective.name != "obstacle_clearance" else motion[:1]
    expected = [by_hand(objective.name, single) for single in chosen]
    np.testing.assert_allclose(objective(chosen), expected, rtol=1e-9 if len(chosen) > 1 else 1e-5, atol=1e-12)


def test_the_library_has_the_promised_names_units_and_senses():
    assert [(o.name, o.unit, o.form, o.maximise) for o in LIBRARY] == [
        ("kinetic_energy", "J s", "integral", False),
        ("torque_norm", "N²m²s", "integral", False),
        ("mechanical_energy", "J", "integral", False),
        ("joint_travel", "rad", "integral", False),
        ("joint_drift", "rad", "terminal", False),
        ("joint_limit_distance", "", "integral", False),
        ("joint_limit_nearness", "s", "integral", False),
        ("velocity_limit_nearness", "s", "integral", False),
        ("manipulability", "", "integral", True),
        ("peak_velocity", "rad/s", "peak", False),
        ("peak_torque", "N m", "peak", False),
        ("jerk", "rad²/s⁵", "integral", False),
        ("obstacle_clearance", "m", "peak", True),
    ]
    assert all(getattr(pk, o.name) is o for o in LIBRARY)


def test_the_papers_energy_of_a_turning_rod():
    arm = Arm.planar(lengths=[1.0, 1.0, 1.0], masses=[3.0, 0.0, 0.0], centers=[0.5, 0, 0], inertias=[0.25, 0, 0])
    t = np.linspace(0, 2, 201)
    q = np.stack([1.5 * t, 0 * t, 0 * t], axis=-1)
    motion = Motion(arm=arm, time=t, q=q, differences="central")
    assert pk.kinetic_energy(motion) == pytest.approx(0.5 * (0.25 + 3 * 0.25) * 1.5**2 * 2, rel=1e-12)
    assert pk.joint_travel(motion) == pytest.approx(3.0, rel=1e-12)
    assert pk.joint_drift(motion) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(
    ("form", "maximise", "expected"),
    [
        ("integral", False, lambda motion, v: [quadrature(single, row) for single, row in zip(motion, v, strict=True)]),
        ("peak", False, lambda motion, v: v.max(axis=1)),
        ("peak", True, lambda motion, v: v.min(axis=1)),
        ("terminal", False, lambda motion, v: v[:, -1]),
        ("general", True, lambda motion, v: v[:, -1]),
    ],
)
def test_a_users_objective_is_made_into_what_its_form_says(form, maximise, expected):
    @pk.objective(unit="rad", form=form, maximise=maximise)
    def own(motion):
        values = motion.q[..., 0]
        return values if form in ("integral", "peak") else values[..., -1]

    motion = MOTIONS["central"]
    np.testing.assert_allclose(own(motion), expected(motion, motion.q[..., 0]), rtol=1e-12)
    assert own.sign == (-1 if maximise else 1)
    assert (own.name, own.unit, own.form) == ("own", "rad", form)


class Raising:
    def __array__(self, *_, **__):
        return 1 / 0


@pytest.mark.parametrize(
    ("form", "returns", "words"),
    [
        (
            "integral",
            lambda motion: None,
            r"must return shape \(\*batch, time\), here \(3, 17\), got None \(is a return missing\?\)",
        ),
        (
            "integral",
            lambda motion: motion.q,
            r"\(integral\) .*, here \(3, 17\), got \(3, 17, 4\); .* 17 times of each",
        ),
        ("integral", lambda motion: motion.q[..., 0] * 1j, "odd must return real numbers, got complex128"),
        (
            "integral",
            lambda motion: np.ma.masked_less(motion.q[..., 0], np.inf),
            "odd must return real numbers, got masked ones",
        ),
        ("integral", lambda motion: Raising(), "odd .* must return shape .*, got ZeroDivisionError: division by zero"),
        (
            "terminal",
            lambda motion: [[1.0], [2.0, 3.0], []],
            r"odd \(terminal\) must return shape .*, got rows of unequal length",
        ),
    ],
)
def test_a_function_that_returns_something_else_is_refused_by_name(form, returns, words):
    odd = pk.objective(unit="", form=form, name="odd")(returns)
    with pytest.raises(InvalidInput, match=words) as refused:
        odd(MOTIONS["backward"])
    assert str(refused.value).startswith("objective odd ")


def test_a_function_that_writes_into_its_input_cannot():
    motion = MOTIONS["backward"]
    before = motion.q.copy()

    def vandal(motion):
        motion.q[...] = 0.0
        return motion.q[..., 0]

    with pytest.raises(EvaluationFailed, match=r"objective vandal raised ValueError: .*read-only"):
        pk.objective(unit="", form="peak")(vandal)(motion)
    np.testing.assert_array_equal(motion.q, before)
