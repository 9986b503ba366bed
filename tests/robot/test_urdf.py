"""A URDF checked and loaded: the report, and the choice that limits of zero require."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from paretoik.errors import InvalidInput
from paretoik.robot.arm import Arm
from paretoik.robot.urdf import check_robot
from tests.robot.conftest import JACO, PANDA
from tests.robot.urdf_text import chain_of_three


def test_a_report_tells_the_chain_joint_by_joint():
    report = check_robot(PANDA, "panda_link0", "panda_hand_tcp")
    assert report.faults == ()
    text = "\n".join(report.summary)
    assert "robot panda: 13 links, 12 joints" in text
    assert "chain panda_link0 to panda_hand_tcp: 7 moving joints" in text
    assert "panda_joint4: revolute, -3.0718 to -0.0698 rad, 2.175 rad/s, 87 N m" in text
    assert sum("frozen" in warning for warning in report.warnings) == 2
    assert any("damping or friction of 9 joints" in warning for warning in report.warnings)


def test_a_report_without_a_tip_names_the_leaves_to_choose_from():
    report = check_robot(PANDA)
    assert report.faults == ()
    assert "root panda_link0, leaves panda_hand_tcp, panda_leftfinger, panda_rightfinger" in report.summary


@pytest.mark.parametrize("what", ["velocity", "effort"])
def test_a_zero_limit_is_a_warning_and_a_required_choice(write_urdf, what):
    limit = '<limit lower="-1" upper="1" velocity="3" effort="4"/>'.replace(
        {"velocity": '"3"', "effort": '"4"'}[what], '"0"'
    )
    file = write_urdf(*chain_of_three(inside=limit))
    report = check_robot(file)
    assert report.faults == ()
    assert any(f"joint 'j2': {what} limit is 0" in warning for warning in report.warnings)
    with pytest.raises(InvalidInput, match=rf"joint 'j2': {what} limit is 0, pass zero_limits='unlimited'"):
        Arm.from_urdf(file)
    arm = Arm.from_urdf(file, zero_limits="unlimited")
    limits = {"velocity": arm.velocity_limits, "effort": arm.torque_limits}[what]
    assert np.isposinf(limits[1])
    assert np.isfinite(limits[[0, 2]]).all()


def test_the_jaco_passes_our_validation():
    assert check_robot(JACO, tip="j2s6s200_end_effector").faults == ()


def test_a_urdf_is_read_and_built_without_pinocchio(monkeypatch):
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    assert check_robot(PANDA).faults == ()
    assert Arm.from_urdf(PANDA, tip="panda_hand_tcp").dof == 7
