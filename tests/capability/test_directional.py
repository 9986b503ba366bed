"""Directional maxima: laws, brute force over postures, and the program with all unknowns free."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import paretoik as pk
from paretoik.capability.actuation import SHAPES as ACTUATION_SHAPES
from paretoik.capability.directional_program import DirectionalProgram
from paretoik.capability.joint_capability import values_at
from paretoik.capability.postures import ASCENT_OPTIONS as OPTIONS
from paretoik.capability.postures import maximise_from, sample_holdable_postures, sample_postures_at
from paretoik.errors import Infeasible, OutOfReach
from paretoik.nlp.dense.dense_program import DenseProgram
from paretoik.nlp.minimise import minimise
from paretoik.robot import kinematics
from tests.capability.drives import motors, planar

PLACE = np.array([0.2, -0.15])
ARM = pk.arms.kim_3r()
DRIVES = {"motors": pk.capability.kim_joint_motors(), "sliders": pk.capability.kim_sliders()}
SHAPES = ("diamond", "strip", "box")
seeds = st.integers(0, 10**6)


def driven(shape="diamond"):
    motors = pk.capability.MotorCurve(stall=[12.3, 3.5, 3.5], fastest=np.deg2rad([3.3, 13.2, 13.2]), shape=shape)
    return pk.capability.JointActuation(motors=motors)


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize("quantity", ["velocity", "force"])
def test_no_posture_of_many_exceeds_the_maxima(drive, quantity):
    polygon = pk.directional_maxima(ARM, DRIVES[drive], PLACE, quantity=quantity)
    q = sample_postures_at(ARM, PLACE, 2000, np.random.default_rng(1))
    values = values_at(ARM, DRIVES[drive], polygon.directions, quantity, q)
    assert (np.nanmax(values, axis=0) <= polygon.values * (1 + 1e-9)).all()
    assert (np.nanmax(values, axis=0) >= 0.9 * polygon.values).all()  # and they come near


@pytest.mark.parametrize("actuation", [driven("strip"), DRIVES["sliders"]], ids=["strip", "sliders"])
def test_the_full_program_from_many_starts_never_beats_the_search_over_postures(actuation):
    polygon = pk.directional_maxima(ARM, actuation, PLACE, 2)
    unscaled = DirectionalProgram(arm=ARM, actuation=actuation, quantities=("velocity",))
    cost = np.zeros(unscaled.unknowns)
    cost[unscaled.slices["values"]] = -1.0
    starts = sample_postures_at(ARM, PLACE, 200, np.random.default_rng(0))
    held = starts[~np.isnan(values_at(ARM, actuation, polygon.directions, "velocity", starts)).any(axis=1)][:4]
    for direction, value in zip(polygon.directions, polygon.values, strict=True):
        program = DenseProgram(rows=unscaled.program(PLACE, direction[None], np.array([value])), costs=cost[None])
        starts = np.array([unscaled.initial_point(q) for q in held])
        ends = minimise(program, starts, np.ones((1, 1)), options=OPTIONS.sqp, solver="sqp")
        shares = ends.x[ends.violation <= 1e-9][:, unscaled.slices["values"]]
        assert max(shares) == pytest.approx(1.0, abs=1e-7)


@pytest.mark.parametrize("drive", DRIVES)
def test_the_ascent_of_other_arms_finds_the_same_maxima(drive):
    for quantity in ("velocity", "force"):
        polygon = pk.directional_maxima(ARM, DRIVES[drive], PLACE, 3, quantity=quantity)
        starts = sample_holdable_postures(ARM, DRIVES[drive], PLACE, 400, np.random.default_rng(3))
        q = maximise_from(ARM, DRIVES[drive], PLACE, polygon.directions, quantity, starts)
        values = np.diagonal(values_at(ARM, DRIVES[drive], polygon.directions, quantity, q))
        assert values == pytest.approx(polygon.values, rel=1e-8)


@pytest.mark.parametrize("drive", DRIVES)
def test_stated_postures_speeds_and_efforts_are_consistent(drive):
    actuation = DRIVES[drive]
    polygon = pk.directional_maxima(ARM, actuation, PLACE)
    columns = kinematics.jacobian(ARM, polygon.q)[:, :2]
    assert kinematics.forward_kinematics(ARM, polygon.q)[1][:, :2] == pytest.approx(np.tile(PLACE, (16, 1)), abs=1e-12)
    assert np.einsum("kaj,kj->ka", columns, polygon.dq) == pytest.approx(polygon.vertices, abs=1e-12)
    if polygon.sliders is None:
        room = actuation.motors.slacks(polygon.motor_efforts[:, 0], polygon.motor_speeds[:, 0])
        assert polygon.motor_efforts[:, 0] == pytest.approx(polygon.torque)
    else:
        back, a, b = actuation.gears(polygon.q, polygon.sliders[:, 0])
        assert back == pytest.approx(polygon.sliders[:, 1])
        assert a * polygon.motor_speeds[:, 0] + b * polygon.motor_speeds[:, 1] == pytest.approx(polygon.dq, abs=1e-12)
        work = (polygon.motor_efforts * polygon.motor_speeds).sum(axis=1)
        assert work == pytest.approx(polygon.torque * polygon.dq, abs=1e-12)
        room = actuation.front.slacks(polygon.motor_efforts, polygon.motor_speeds)
    assert room.min() >= -1e-9
    assert room.min(axis=(-1, -2)).max() <= 1e-9  # some motor is at its limit


@given(seed=seeds)
@settings(max_examples=3)
def test_turning_arm_gravity_position_and_directions_changes_nothing(seed):
    turn = np.random.default_rng(seed).uniform(-np.pi, np.pi)
    cosine, sine = np.cos(turn), np.sin(turn)
    rotation = np.array([[cosine, -sine], [sine, cosine]])
    base = pk.Pose([0.3, -0.1, 0.0], [np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)])
    turned = ARM.mounted(base=base, gravity=[*(rotation @ [0.0, -9.81]), 0.0])
    for actuation in DRIVES.values():
        one = pk.directional_maxima(ARM, actuation, PLACE, 5)
        other = pk.directional_maxima(turned, actuation, rotation @ PLACE + [0.3, -0.1], one.directions @ rotation.T)
        assert other.values == pytest.approx(one.values, rel=1e-9)


@pytest.mark.parametrize(
    ("position", "payload", "error", "said"),
    [
        ([0.4, -0.15], 0.0, OutOfReach, "0.4272001873 m from the first joint; the arm reaches from 0 m to 0.357 m"),
        ([0.2, -0.15], 20.0, Infeasible, "joint2 must bear a torque of at most 3.5 N m"),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_what_cannot_be_is_refused_by_name(position, payload, error, said):
    with pytest.raises(error, match=said):
        pk.directional_maxima(ARM.with_payload(payload), DRIVES["motors"], position)


def test_sliders_that_reach_no_posture_are_named_with_the_angle():
    with pytest.raises(
        Infeasible, match=r"joint\d must have a rod's angle that its sliders can reach, 10° to 117.4° .* toggles"
    ):
        pk.directional_maxima(ARM, pk.capability.kim_sliders(base_angle=np.deg2rad(60.0)), PLACE)


# Maxima over postures: the same in any turn of joints and rods, from any seed, and in closed form.


WAYS = np.array([[1.0, 0.2], [-0.3, 1.0], [-1.0, -0.7], [0.6, -1.0]])
QUANTITIES = ("velocity", "force")
UNIT = WAYS / np.linalg.norm(WAYS, axis=1, keepdims=True)


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_limits_a_turn_away_change_no_maximum(quantity):
    actuation = motors([9.0, 7.0, 5.0, 3.0])
    low, high = np.array([-1.5, -2.0, 0.2, -2.0]), np.array([1.5, 2.0, 2.5, 2.0])
    one, other = (
        pk.directional_maxima(
            planar(4, limits=(low + turn, high + turn)), actuation, [0.5, 0.2], UNIT, quantity=quantity, starts=100
        )
        for turn in (0.0, 2 * np.pi * np.array([1, -1, 0, 2]))
    )
    assert other.values == pytest.approx(one.values, rel=1e-7)
    assert (other.q[:, 3] >= low[3] + 4 * np.pi - 1e-9).all()


@pytest.mark.parametrize("shape", ACTUATION_SHAPES)
def test_an_arm_of_two_joints_does_what_its_two_postures_allow(shape):
    arm, actuation, place = planar(2, mass=1.0), motors([6.0, 2.0], shape), np.array([0.35, 0.1])
    directions = UNIT[:2]
    reach = np.linalg.norm(place)
    elbow = np.arccos(reach**2 / (2 * 0.3**2) - 1.0) * np.array([1.0, -1.0])
    q = np.stack([np.arctan2(place[1], place[0]) - elbow / 2, elbow], axis=1)
    x = np.stack([np.cos(q[:, 0]), np.cos(q.sum(axis=1))])
    load = 9.81 * 0.15 * np.array([3 * x[0] + x[1], x[1]]).T
    share = load / actuation.motors.stall
    assert (np.abs(share) < 1.0).all()
    room = {"diamond": [1 - abs(share)] * 2, "box": [1 + 0 * share] * 2}
    room["strip"] = [np.minimum(1.0, 1 + share), np.minimum(1.0, 1 - share)]
    low, high = (sign * each * actuation.motors.fastest for sign, each in zip((-1, 1), room[shape], strict=True))
    first = np.array([[-place[1], place[0]]] * 2)
    second = 0.3 * np.stack([-np.sin(q.sum(axis=1)), np.cos(q.sum(axis=1))], axis=1)
    table = np.stack([first, second], axis=2)
    turned = np.stack([np.linalg.solve(table[k], directions.T).T for k in range(2)])
    largest = np.where(turned > 0, high[:, None], low[:, None]) / turned
    assert pk.directional_maxima(arm, actuation, place, directions).values == pytest.approx(
        largest.min(axis=2).max(axis=0)
    )
    pushed = np.einsum("pja,ka->pkj", np.swapaxes(table, 1, 2), directions)
    stall = actuation.motors.stall
    largest = np.where(pushed > 0, stall - load[:, None], -stall - load[:, None]) / pushed
    forces = pk.directional_maxima(arm, actuation, place, directions, quantity="force")
    assert forces.values == pytest.approx(largest.min(axis=2).max(axis=0))


@pytest.mark.parametrize(("dof", "joint"), [(3, 1), (4, 3)])
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_a_motor_that_bears_any_load_is_the_limit_of_a_very_strong_one(dof, joint, quantity):
    arm, stall = planar(dof), np.array([9.0, 6.0, 4.0, 3.0])[:dof]
    one, other = (
        pk.directional_maxima(
            arm,
            motors(np.where(np.arange(dof) == joint, joint_stall, stall)),
            [0.5, 0.2],
            UNIT[:2],
            quantity=quantity,
            starts=60,
        )
        for joint_stall in (np.inf, 1e9)
    )
    assert np.isfinite(one.values).all()
    assert one.values == pytest.approx(other.values, rel=1e-6)
