"""What of a URDF becomes an arm: the chain, what hangs on it, its limits, and what is said about the rest."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

import numpy as np
import pytest

from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import inverse_dynamics
from paretoik.robot.kinematics import tool_pose
from paretoik.robot.urdf import check_robot

ROOT = Path(__file__).parents[2]
PANDA = ROOT / "problems" / "robots" / "panda.urdf"
JACO = ROOT / "tests" / "robots" / "jaco.urdf"
BODY = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="4"/>'


def link(name, body=BODY):
    return f'<link name="{name}">{body}</link>'


def joint(name, parent, child, kind="revolute", inside=LIMIT):
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


@pytest.fixture
def written(tmp_path):
    """Return a function that writes parts of a robot to a file."""

    def write(*parts, name="robot.urdf"):
        file = tmp_path / name
        file.write_text(f'<robot name="r">{"".join(parts)}</robot>', encoding="utf-8")
        return file

    return write


def three(middle="revolute", inside=LIMIT, last=BODY):
    """Return links a-b-c-d with joints j1, j2 (of a kind) and j3."""
    links = [link("a"), link("b"), link("c"), link("d", last)]
    return [*links, joint("j1", "a", "b"), joint("j2", "b", "c", middle, inside), joint("j3", "c", "d")]


def test_the_panda_has_seven_joints_its_files_limits_and_its_fingers_frozen(panda_arm):
    assert panda_arm.joint_names == tuple(f"panda_joint{i}" for i in range(1, 8))
    assert set(panda_arm.joint_types) == {"revolute"}
    assert panda_arm.position_limits[3].tolist() == [-3.0718, -0.0698]
    assert panda_arm.velocity_limits.tolist() == [2.175] * 4 + [2.61] * 3
    assert panda_arm.torque_limits.tolist() == [87.0] * 4 + [12.0] * 3
    assert panda_arm.gravity.tolist() == [0.0, 0.0, -9.81]
    assert panda_arm.bodies[6].mass == pytest.approx(0.735522 + 0.73 + 2 * 0.015)
    assert panda_arm.source == PANDA
    assert any("'panda_finger_joint1': off the chain, frozen at 0 m" in notice for notice in panda_arm.notices)


def test_frames_of_merged_links_are_named_and_stand_where_the_file_says(panda_arm):
    q = np.random.default_rng(0).normal(size=(3, 7))
    flange, hand = (tool_pose(panda_arm, q, name) for name in ("panda_link8", "panda_hand"))
    tip = tool_pose(panda_arm, q)[1]
    assert np.linalg.norm(tip - flange[1], axis=-1) == pytest.approx(0.1034)
    assert flange[1] + 0.1034 * flange[0][..., 2] == pytest.approx(tip)
    assert hand[1] == pytest.approx(flange[1])


def test_the_jaco_has_continuous_joints_without_ends_and_passes_our_validation():
    report = check_robot(JACO, tip="j2s6s200_end_effector")
    assert report.faults == ()
    arm = Arm.from_urdf(JACO, tip="j2s6s200_end_effector")
    assert arm.joint_types.count("continuous") == 3
    assert np.isinf(arm.position_limits[[0, 3, 5]]).all()
    assert arm.bodies[5].mass == pytest.approx(0.99 + 4 * 0.01)  # the four finger links are fixed to the hand


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


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, "several leaves, name one as tip: panda_hand_tcp, panda_leftfinger, panda_rightfinger"),
        ({"tip": "hand"}, "tip 'hand' is not a link; links: panda_link0"),
        ({"base": "foot", "tip": "panda_hand"}, "base 'foot' is not a link"),
        ({"base": "panda_hand", "tip": "panda_link3"}, "link 'panda_link3' does not hang on link 'panda_hand'"),
        ({"tip": "panda_hand", "fixed": {"elbow": 0.0}}, "joint 'elbow' cannot be fixed; joints that move: panda_j"),
        ({"tip": "panda_hand", "fixed": {"panda_joint1": np.nan}}, "joint 'panda_joint1' wants a finite value"),
        ({"tip": "panda_hand", "zero_limits": "ignore"}, "zero_limits must be 'unlimited' or None, got 'ignore'"),
    ],
)
def test_unknown_names_and_values_are_refused(options, words):
    with pytest.raises(InvalidInput, match=words):
        Arm.from_urdf(PANDA, **options)


def test_joints_fixed_on_loading_are_the_whole_arm_held_there(panda_arm):
    held = Arm.from_urdf(PANDA, tip="panda_hand_tcp", fixed={"panda_joint3": 0.4})
    assert held.joint_names == tuple(f"panda_joint{i}" for i in (1, 2, 4, 5, 6, 7))
    q = np.random.default_rng(1).normal(size=(3, 4, 6))
    again = panda_arm.fixed(panda_joint3=0.4)
    assert inverse_dynamics(held, *q) == pytest.approx(inverse_dynamics(again, *q), rel=1e-12, abs=1e-12)
    assert any("'panda_joint3': on the chain, frozen at 0.4 rad" in notice for notice in held.notices)


def test_a_mimic_joint_off_the_chain_follows_its_frozen_leader():
    arm = Arm.from_urdf(PANDA, tip="panda_hand_tcp", fixed={"panda_finger_joint1": 0.03})
    left, right = (tool_pose(arm, np.zeros(7), f"panda_{side}finger")[1] for side in ("left", "right"))
    assert np.linalg.norm(left - right) == pytest.approx(0.06)


def test_a_base_above_the_root_leaves_out_what_is_before_it(panda_arm):
    arm = Arm.from_urdf(PANDA, base="panda_link2", tip="panda_hand_tcp")
    assert arm.joint_names == panda_arm.joint_names[2:]
    assert any("what is above it is left out" in notice for notice in arm.notices)
    q = np.random.default_rng(2).normal(size=5)
    whole = tool_pose(panda_arm, np.array([0.0, 0.0, *q]))[1]
    frame = tool_pose(panda_arm, np.zeros(7), "panda_link2")
    assert frame[1] + frame[0] @ tool_pose(arm, q)[1] == pytest.approx(whole)


@pytest.mark.parametrize("axis", ["1 0 0", "0 1 0", "0 0 1", "-1 0 0", "0 -1 0", "0 0 -1", "1 1 1", "0.6 0 -0.8"])
@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
def test_a_joint_moves_about_or_along_the_axis_of_its_file(written, axis, kind):
    file = written(link("a"), link("b"), joint("j", "a", "b", kind, LIMIT + f'<axis xyz="{axis}"/>'))
    arm = Arm.from_urdf(file)
    direction = np.array(axis.split(), float) / np.linalg.norm(np.array(axis.split(), float))
    rotation, position = tool_pose(arm, np.array([0.7]))
    if kind == "prismatic":
        assert rotation == pytest.approx(np.eye(3))
        assert position == pytest.approx(0.7 * direction)
    else:
        assert rotation @ direction == pytest.approx(direction)
        assert np.trace(rotation) == pytest.approx(1 + 2 * np.cos(0.7))
        away = np.cross(direction, np.roll(direction, 1) + np.array([0.0, 0.0, 0.1]))
        assert np.cross(away, rotation @ away) @ direction > 0  # turns the right-handed way
    assert tool_pose(arm, np.zeros(1))[0] == pytest.approx(np.eye(3))


@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_joints_with_several_freedoms_are_refused_by_name_on_the_chain_only(written, kind):
    with pytest.raises(InvalidRobot, match=f"joint 'j2': {kind} joints cannot be on the chain"):
        Arm.from_urdf(written(*three(kind, "")))
    arm = Arm.from_urdf(written(*three(), link("e"), joint("side", "a", "e", kind, "")), tip="d")
    assert arm.dof == 3
    assert any(f"'side': off the chain, frozen where its {kind} motion is zero" in notice for notice in arm.notices)


def test_a_mimic_joint_is_refused_by_name_on_the_chain_unless_it_is_fixed(written):
    file = written(*three(inside=LIMIT + '<mimic joint="j1"/>'))
    with pytest.raises(InvalidRobot, match="joint 'j2': mimic joints cannot be on the chain"):
        Arm.from_urdf(file)
    assert Arm.from_urdf(file, fixed={"j2": 0.5}).joint_names == ("j1", "j3")


def test_a_frozen_joint_that_mimics_a_moving_one_is_told(written):
    parts = [*three(), link("e"), joint("side", "d", "e", inside=LIMIT + '<mimic joint="j1" offset="0.25"/>')]
    arm = Arm.from_urdf(written(*parts), tip="d")
    assert "joint 'side': off the chain, frozen at 0.25 rad, though it mimics 'j1'" in arm.notices


def test_a_frozen_joint_outside_its_limits_is_told(written):
    limit = '<limit lower="0.1" upper="1" velocity="1" effort="1"/>'
    arm = Arm.from_urdf(written(*three(), link("e"), joint("side", "d", "e", inside=limit)), tip="d")
    assert "joint 'side': off the chain, frozen at 0 rad, outside its limits" in arm.notices


@pytest.mark.parametrize("what", ["velocity", "effort"])
def test_a_zero_limit_is_a_warning_and_a_required_choice(written, what):
    limit = '<limit lower="-1" upper="1" velocity="3" effort="4"/>'.replace(
        {"velocity": '"3"', "effort": '"4"'}[what], '"0"'
    )
    file = written(*three(inside=limit))
    report = check_robot(file)
    assert report.faults == ()
    assert any(f"joint 'j2': {what} limit is 0" in warning for warning in report.warnings)
    with pytest.raises(InvalidInput, match=rf"joint 'j2': {what} limit is 0, pass zero_limits='unlimited'"):
        Arm.from_urdf(file)
    arm = Arm.from_urdf(file, zero_limits="unlimited")
    limits = {"velocity": arm.velocity_limits, "effort": arm.torque_limits}[what]
    assert np.isposinf(limits[1])
    assert np.isfinite(limits[[0, 2]]).all()


def test_infinite_limits_are_read_as_none(written):
    limit = '<limit lower="-inf" upper="INF" velocity="Infinity" effort="inf"/>'
    arm = Arm.from_urdf(written(*three(inside=limit)))
    assert arm.position_limits[1].tolist() == [-np.inf, np.inf]
    assert np.isposinf(arm.velocity_limits[1])
    assert np.isposinf(arm.torque_limits[1])


def test_a_massless_moving_link_before_other_joints_is_a_fault_and_at_the_end_a_notice(written):
    parts = three()
    parts[2] = link("c", "")
    with pytest.raises(InvalidRobot, match="joint 'j2': moves no mass, though other joints follow it"):
        Arm.from_urdf(written(*parts))
    arm = Arm.from_urdf(written(*three(last="")))
    assert "joint 'j3': moves no mass" in arm.notices
    assert arm.bodies[2].mass == 0.0


def test_a_massless_flange_takes_the_mass_of_what_is_fixed_to_it(written):
    parts = [*three(last=""), link("hand"), joint("mount", "d", "hand", "fixed", "")]
    arm = Arm.from_urdf(written(*parts))
    assert arm.bodies[2].mass == 1.0
    assert not any("moves no mass" in notice for notice in arm.notices)


def test_a_chain_without_a_moving_joint_is_refused(written):
    file = written(link("a"), link("b"), joint("j", "a", "b", "fixed", ""))
    with pytest.raises(InvalidRobot, match="no joint moves between 'a' and 'b'"):
        Arm.from_urdf(file)


def test_names_may_be_of_any_alphabet_and_even_of_pinocchios_own(written):
    parts = [link("universe"), link("колено"), link("手 &lt;1&gt;")]
    joints = [joint("root_joint", "universe", "колено"), joint("関節", "колено", "手 &lt;1&gt;")]
    arm = Arm.from_urdf(written(*parts, *joints, name="robö.urdf"))
    assert arm.joint_names == ("root_joint", "関節")
    assert "手 <1>" in arm.frames


def test_links_called_tool_or_base_do_not_hide_the_arms_own_frames(written):
    parts = [link("base"), link("tool"), link("tip"), joint("j1", "base", "tool")]
    origin = '<origin xyz="1 0 0"/>'
    arm = Arm.from_urdf(written(*parts, joint("j2", "tool", "tip", inside=LIMIT + origin)))
    assert tool_pose(arm, np.zeros(2))[1] == pytest.approx([1.0, 0.0, 0.0])


def test_meshes_are_never_opened_and_the_network_is_never_asked(written, monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("the network was asked")

    monkeypatch.setattr(socket, "socket", refuse)
    shapes = [
        f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
        for name in ("http://example.org/a.stl", "../../../etc/passwd", "package://none/a.dae", "file:///none")
    ]
    arm = Arm.from_urdf(written(link("a"), link("b", "".join(shapes) + BODY), joint("j", "a", "b")))
    assert arm.dof == 1


def test_numbers_are_read_alike_in_every_locale(written):
    import locale

    before = locale.setlocale(locale.LC_NUMERIC)
    try:
        for name in ("de_DE.UTF-8", "fr_FR.UTF-8", "C"):
            try:
                locale.setlocale(locale.LC_NUMERIC, name)
            except locale.Error:
                continue
            arm = Arm.from_urdf(written(*three(inside=LIMIT + '<origin xyz="0.5 0 1.25e-1"/>')))
            assert tool_pose(arm, np.zeros(3))[1] == pytest.approx([0.5, 0.0, 0.125])
    finally:
        locale.setlocale(locale.LC_NUMERIC, before)


def test_a_missing_pinocchio_is_told_with_the_command_that_brings_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(InvalidInput, match=r"pip install paretoik\[urdf\]"):
        Arm.from_urdf(PANDA, tip="panda_hand_tcp")
    assert check_robot(PANDA).faults == ()


def test_transmissions_and_plug_ins_that_name_joints_are_not_joints(written):
    extra = '<transmission name="t"><joint name="j1"/></transmission><gazebo><link/><joint/></gazebo>'
    assert Arm.from_urdf(written(*three(), extra)).dof == 3


def test_mass_without_inertia_is_taken_as_a_point_with_a_warning(written):
    point = '<inertial><mass value="2"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    file = written(*three(last=point))
    assert any("link 'd': has mass but no inertia" in warning for warning in check_robot(file).warnings)
    assert Arm.from_urdf(file).bodies[2].mass == 2.0
