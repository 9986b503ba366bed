"""What must hold for every arm: energies, symmetries, and the laws of tools, payloads, bases and frozen joints."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.robot import dynamics, kinematics
from paretoik.robot.arm import Arm, joint_motion
from paretoik.robot.arms import tringali_3r
from paretoik.robot.pose import Pose
from tests.robot.oracles import STEP, jacobian_rate, potential_energy

seeds = st.integers(0, 10**6)
turns = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda x: np.linalg.norm(x) > 0.1)
places = st.lists(st.floats(-2, 2), min_size=3, max_size=3)


def pose(place, turn):
    return Pose(place, np.array(turn) / np.linalg.norm(turn))


def same(first, second, tolerance=1e-12):
    scale = max(np.abs(first).max(), np.abs(second).max(), 1e-300)
    assert np.abs(first - second).max() <= tolerance * scale


def state_of(arm, seed, count=4):
    return np.random.default_rng(seed).normal(size=(3, count, arm.dof))


@given(seed=seeds)
@settings(max_examples=15, deadline=None)
def test_power_of_the_torques_is_the_rate_of_the_energy(anyarm_of, seed):
    arm = anyarm_of(seed)
    rng = np.random.default_rng(seed)
    size, pace, phase = rng.uniform(0.2, 1.5, (3, arm.dof))
    time = np.linspace(0, 3, 7)[:, None]
    q = size * np.sin(pace * time + phase)
    dq = size * pace * np.cos(pace * time + phase)
    ddq = -size * pace**2 * np.sin(pace * time + phase)
    later, faster = q + 1j * STEP * dq, dq + 1j * STEP * ddq
    energy = dynamics.kinetic_energy(arm, later, faster) + potential_energy(arm, later)
    torque = dynamics.inverse_dynamics(arm, q, dq, ddq)
    same(energy.imag / STEP, dynamics.power(torque, dq).sum(axis=-1), 1e-11)


@given(seed=seeds)
@settings(max_examples=15, deadline=None)
def test_inertia_matrix_is_symmetric_positive_and_gives_the_kinetic_energy(anyarm_of, seed):
    arm = anyarm_of(seed)
    q, dq, _ = state_of(arm, seed)
    inertia = dynamics.inertia_matrix(arm, q)
    assert np.array_equal(inertia, np.swapaxes(inertia, -1, -2))
    assert np.linalg.eigvalsh(inertia).min() > 0
    same(np.einsum("ni,nij,nj->n", dq, inertia, dq) / 2, dynamics.kinetic_energy(arm, q, dq))


@given(seed=seeds)
@settings(max_examples=15, deadline=None)
def test_torques_are_linear_in_the_accelerations_with_the_inertia_matrix_as_slope(anyarm_of, seed):
    arm = anyarm_of(seed)
    q, dq, ddq = state_of(arm, seed)
    still = dynamics.inverse_dynamics(arm, q, dq, np.zeros_like(q))
    moved = np.einsum("nij,nj->ni", dynamics.inertia_matrix(arm, q), ddq) + still
    same(dynamics.inverse_dynamics(arm, q, dq, ddq), moved)


@given(seed=seeds, place=places, turn=turns)
@settings(max_examples=15, deadline=None)
def test_turning_base_and_gravity_together_leaves_torques_and_kinetic_energy(anyarm_of, seed, place, turn):
    arm, base = anyarm_of(seed), pose(place, turn)
    turned = arm.mounted(base=base @ arm.base, gravity=base.rotation @ arm.gravity)
    q, dq, ddq = state_of(arm, seed)
    same(dynamics.inverse_dynamics(arm, q, dq, ddq), dynamics.inverse_dynamics(turned, q, dq, ddq))
    same(dynamics.kinetic_energy(arm, q, dq), dynamics.kinetic_energy(turned, q, dq))
    same(dynamics.inertia_matrix(arm, q), dynamics.inertia_matrix(turned, q))
    rotation, position = kinematics.forward_kinematics(arm, q)
    same(kinematics.forward_kinematics(turned, q)[0], base.rotation @ rotation)
    same(kinematics.forward_kinematics(turned, q)[1], base.apply(position))
    twist = np.kron(np.eye(2), base.rotation)
    same(kinematics.jacobian(turned, q), twist @ kinematics.jacobian(arm, q))


@given(seed=seeds, place=places, turn=turns)
@settings(max_examples=15, deadline=None)
def test_a_moved_base_changes_the_potential_energy_by_a_constant(anyarm_of, seed, place, turn):
    arm = anyarm_of(seed)
    base = pose(place, turn)
    turned = arm.mounted(base=base, gravity=base.rotation @ arm.gravity)
    q = state_of(arm, seed)[0]
    mass = sum(body.mass for body in arm.bodies)
    constant = mass * (turned.gravity @ base.position)
    same(potential_energy(turned, q) + constant, potential_energy(arm, q), 1e-11)


@given(seed=seeds, value=st.floats(-3, 3), joint=st.integers(0, 4))
@settings(max_examples=25, deadline=None)
def test_a_fixed_joint_is_the_full_arm_held_at_that_value(anyarm_of, seed, value, joint):
    arm = anyarm_of(seed)
    held = arm.fixed({arm.joint_names[joint]: value})
    rest = np.arange(arm.dof) != joint
    q, dq, ddq = state_of(arm, seed)
    q[:, joint], dq[:, joint], ddq[:, joint] = value, 0.0, 0.0
    for mine, whole in zip(
        kinematics.forward_kinematics(held, q[:, rest]), kinematics.forward_kinematics(arm, q), strict=True
    ):
        same(mine, whole)
    torque = dynamics.inverse_dynamics(held, q[:, rest], dq[:, rest], ddq[:, rest])
    same(torque, dynamics.inverse_dynamics(arm, q, dq, ddq)[:, rest], 1e-11)
    inertia = dynamics.inertia_matrix(arm, q)[:, rest][:, :, rest]
    same(dynamics.inertia_matrix(held, q[:, rest]), inertia, 1e-11)
    if joint:
        rise = potential_energy(arm, q) - potential_energy(held, q[:, rest])
        assert np.abs(rise).max() < 1e-10


@given(seed=seeds, place=places, turn=turns)
@settings(max_examples=15, deadline=None)
def test_a_tool_moves_the_tool_frame_and_its_mass_is_a_payload_there(anyarm_of, seed, place, turn):
    arm, tool = anyarm_of(seed), pose(place, turn)
    inertia = np.diag([0.02, 0.03, 0.04])
    equipped = arm.with_tool(tool, mass=1.5, center=tool.position, inertia=tool.rotation @ inertia @ tool.rotation.T)
    loaded = arm.with_tool(tool).with_payload(1.5, inertia=inertia)
    state = state_of(arm, seed)
    rotation, position = kinematics.forward_kinematics(arm, state[0])
    same(kinematics.forward_kinematics(equipped, state[0])[0], rotation @ tool.rotation)
    same(kinematics.forward_kinematics(equipped, state[0])[1], position + rotation @ tool.position)
    same(dynamics.inverse_dynamics(equipped, *state), dynamics.inverse_dynamics(loaded, *state))


@given(seed=seeds)
@settings(max_examples=15, deadline=None)
def test_a_point_payload_adds_its_own_newton_law_through_the_jacobian(anyarm_of, seed):
    arm = anyarm_of(seed)
    q, dq, ddq = state_of(arm, seed)
    jacobian = kinematics.jacobian(arm, q)[:, :3]
    push = np.einsum("nij,nj->ni", jacobian, ddq) + jacobian_rate(arm, q, dq)[:, :3] - arm.gravity
    extra = 2.5 * np.einsum("nij,ni->nj", jacobian, push)
    loaded = dynamics.inverse_dynamics(arm.with_payload(2.5), q, dq, ddq)
    same(loaded, dynamics.inverse_dynamics(arm, q, dq, ddq) + extra, 1e-11)


@pytest.mark.parametrize("convention", ["modified", "standard"])
@pytest.mark.parametrize("seed", range(4))
def test_dh_poses_are_products_of_the_conventions_matrices(dh_table, convention, seed):
    table = dh_table(seed)
    arm = Arm.from_dh(**table, convention=convention)
    for q in np.random.default_rng(seed).normal(size=(3, arm.dof)):
        product = np.eye(4)
        for i, kind in enumerate(table["types"]):
            slide = kind == "prismatic"
            theta = table["theta"][i] + (0.0 if slide else q[i])
            d = table["d"][i] + (q[i] if slide else 0.0)
            about_z = _turn_z(theta) @ _shift(0.0, d)
            about_x = _turn_x(table["alpha"][i]) @ _shift(table["a"][i], 0.0)
            product = product @ (about_x @ about_z if convention == "modified" else about_z @ about_x)
        rotation, position = kinematics.forward_kinematics(arm, q)
        same(rotation, product[:3, :3], 1e-14)
        same(position, product[:3, 3], 1e-14)


def _turn_z(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def _turn_x(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])


def _shift(x, z):
    matrix = np.eye(4)
    matrix[:3, 3] = x, 0, z
    return matrix


def test_dh_bodies_of_both_conventions_stand_in_their_own_link_frames(dh_table):
    table = dh_table(3)
    arm = Arm.from_dh(**table, convention="standard")
    frames = [_standard_frame(table, q, i) for q in [np.full(arm.dof, 0.3)] for i in range(arm.dof)]
    height = sum(
        mass * (frame[:3, :3] @ center + frame[:3, 3])[2]
        for mass, center, frame in zip(table["masses"], table["centers"], frames, strict=True)
    )
    same(potential_energy(arm, np.full(arm.dof, 0.3)), np.array(9.81 * height))


def _standard_frame(table, q, last):
    product = np.eye(4)
    for i in range(last + 1):
        slide = table["types"][i] == "prismatic"
        theta, d = table["theta"][i] + (0 if slide else q[i]), table["d"][i] + (q[i] if slide else 0)
        product = product @ _turn_z(theta) @ _shift(0, d) @ _shift(table["a"][i], 0) @ _turn_x(table["alpha"][i])
    return product


KERNELS = {
    "rotation": (lambda arm, q, dq, ddq: kinematics.forward_kinematics(arm, q)[0], lambda dof: (3, 3)),
    "position": (lambda arm, q, dq, ddq: kinematics.forward_kinematics(arm, q)[1], lambda dof: (3,)),
    "jacobian": (lambda arm, q, dq, ddq: kinematics.jacobian(arm, q), lambda dof: (6, dof)),
    "link_nodes": (lambda arm, q, dq, ddq: kinematics.link_nodes(arm, q), lambda dof: (dof + 2, 3)),
    "inverse_dynamics": (dynamics.inverse_dynamics, lambda dof: (dof,)),
    "inertia_matrix": (lambda arm, q, dq, ddq: dynamics.inertia_matrix(arm, q), lambda dof: (dof, dof)),
    "kinetic_energy": (lambda arm, q, dq, ddq: dynamics.kinetic_energy(arm, q, dq), lambda dof: ()),
}


@pytest.mark.parametrize("name", KERNELS)
@pytest.mark.parametrize("batch", [(), (0,), (2, 3, 4), (4, 2, 1000)])
def test_batches_of_any_shape_are_their_samples_one_by_one_to_the_bit(panda_arm, name, batch):
    kernel, shape = KERNELS[name]
    for arm in (panda_arm, tringali_3r("fitted").mounted(gravity=(0.0, -9.81, 0.0))):
        state = np.random.default_rng(1).normal(size=(3, *batch, arm.dof))
        whole = kernel(arm, *state)
        assert whole.shape == (*batch, *shape(arm.dof))
        assert whole.dtype == float
        flat, found = state.reshape(3, -1, arm.dof), whole.reshape(-1, *shape(arm.dof))
        for i in range(0, flat.shape[1], max(1, flat.shape[1] // 10)):
            assert np.array_equal(kernel(arm, *flat[:, i]), found[i])


@pytest.mark.parametrize("name", KERNELS)
def test_complex_input_with_a_vanishing_step_keeps_the_real_result(panda_arm, name):
    kernel, _ = KERNELS[name]
    state = np.random.default_rng(2).normal(size=(3, 5, 7))
    found = kernel(panda_arm, *(state + 1j * STEP))
    assert found.dtype == complex
    same(found.real, kernel(panda_arm, *state), 1e-14)


def test_kernels_leave_their_input_alone_and_take_it_in_any_order_of_memory(panda_arm):
    state = np.random.default_rng(3).normal(size=(3, 6, 5, 7))
    state.setflags(write=False)
    turned = [np.asfortranarray(array) for array in state]
    assert np.array_equal(dynamics.inverse_dynamics(panda_arm, *state), dynamics.inverse_dynamics(panda_arm, *turned))


def test_link_nodes_run_from_the_base_over_every_joint_to_the_tool(panda_arm):
    q = np.random.default_rng(4).normal(size=(3, 7))
    nodes = kinematics.link_nodes(panda_arm, q)
    names = ["base", *panda_arm.joint_names, "tool"]
    for i, name in enumerate(names):
        same(nodes[:, i], kinematics.forward_kinematics(panda_arm, q, name)[1], 1e-15)


def test_a_frame_before_a_joint_does_not_feel_it(panda_arm):
    q = np.random.default_rng(5).normal(size=(4, 7))
    jacobian = kinematics.jacobian(panda_arm, q, "panda_link4")
    assert np.all(jacobian[:, :, 4:] == 0.0)
    assert np.abs(jacobian[:, :, :4]).max() > 0.1


def test_joint_motion_turns_about_and_slides_along_z():
    assert joint_motion("revolute", np.pi / 2).apply([1.0, 0.0, 0.0]) == pytest.approx([0.0, 1.0, 0.0])
    assert joint_motion("prismatic", 0.3).apply([1.0, 0.0, 0.0]) == pytest.approx([1.0, 0.0, 0.3])
