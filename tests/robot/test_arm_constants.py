"""An arm's constants: regrouped inertias give the same torques with fewer entries, right angles are exact."""

from __future__ import annotations

import numpy as np

from paretoik.robot.arms import tringali_3r
from paretoik.robot.kinematics import arm_constants, joint_cosines_and_sines


def test_links_of_a_planar_arm_keep_two_moments_each():
    for link in arm_constants(tringali_3r()).links:
        assert link.mass == 0.0  # on the axis, it belongs to the link before
        assert link.first_moment[1:] == (0.0, 0.0)
        assert link.first_moment[0] > 0.0


def test_the_first_links_regrouped_inertia_is_that_of_the_arm_without_bends():
    # Khalil & Kleinfinger 1987: J_i + m_i c_i² + l_i² times the mass of all links further out.
    arm = tringali_3r()
    masses, centers = [body.mass for body in arm.bodies], [body.center[0] for body in arm.bodies]
    inertias, lengths = [body.inertia[2, 2] for body in arm.bodies], [0.176, 0.176, 0.1375]
    for i, link in enumerate(arm_constants(arm).links):
        expected = inertias[i] + masses[i] * centers[i] ** 2 + lengths[i] ** 2 * sum(masses[i + 1 :])
        np.testing.assert_allclose(link.inertia[2][2], expected, rtol=1e-14)


def test_rotations_by_right_angles_hold_only_zeros_and_ones(panda_arm):
    rotations = np.array([link.rotation for link in arm_constants(panda_arm).links[:-1]])
    assert np.isin(np.abs(rotations), [0.0, 1.0]).all()


def test_prismatic_joints_do_not_rotate(anyarm_of):
    arm = anyarm_of(4)
    assert "prismatic" in arm.joint_types
    for joint_type, (cosine, sine) in zip(
        arm.joint_types, joint_cosines_and_sines(arm_constants(arm).links, np.full(5, 0.4)), strict=True
    ):
        expected = (1.0, 0.0) if joint_type == "prismatic" else (np.cos(0.4), np.sin(0.4))
        assert (cosine, sine) == expected
