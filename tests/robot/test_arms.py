"""The papers' arms agree with their tables."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.robot.arms import kim_3r, marcos_nr, tringali_3r, wan_7r
from paretoik.robot.kinematics import forward_kinematics
from problems import tringali_2020


def test_the_papers_paths_start_2_cm_inside_of_the_tringali_arms_reach():
    # Tringali & Cocuzza 2020, Table 1 and section 3.2: links of 0.176, 0.176 and 0.1375 m, a start at (0.4678, 0) m.
    arm = tringali_3r()
    assert forward_kinematics(arm, np.zeros(3))[1] == pytest.approx([0.4895, 0.0, 0.0])
    for path in (tringali_2020.straight(), tringali_2020.round_trip()):
        assert 0.4895 - np.linalg.norm(path.positions[0, :2]) == pytest.approx(0.0217, abs=1e-12)
    assert [body.mass for body in arm.bodies] == [0.615, 0.615, 0.307]


def test_the_marcos_arm_has_unit_links():
    assert forward_kinematics(marcos_nr(4), np.zeros(4))[1] == pytest.approx([4.0, 0.0, 0.0])
    assert forward_kinematics(marcos_nr(), np.array([np.pi / 2, 0.0, 0.0]))[1] == pytest.approx([0.0, 3.0, 0.0])


def test_the_wan_arm_at_zero_stands_where_its_table_says():
    # By hand from Table 1: the joints' z axes at q = 0 are z, -y, -z, -z, -z, y and z of the base.
    position = forward_kinematics(wan_7r(), np.zeros(7))[1]
    assert position == pytest.approx([0.45 + 0.4, 0.2975 + 0.197, 0.3555 + 0.293 - 0.255 + 0.104], abs=1e-12)
    assert wan_7r().position_limits[1] == pytest.approx(np.deg2rad([-33, 150]))


def test_the_kim_arm_hangs_under_gravity_with_masses_in_the_middle_of_its_links():
    arm = kim_3r()
    assert arm.gravity.tolist() == [0.0, -9.81, 0.0]
    assert forward_kinematics(arm, np.zeros(3))[1] == pytest.approx([0.114 + 0.114 + 0.129, 0.0, 0.0])
    assert [body.center[0] for body in arm.bodies] == pytest.approx([0.057, 0.057, 0.0645])
