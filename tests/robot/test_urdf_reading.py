"""All faults of a URDF's links and joints are named at once with their lines, before an arm is built."""

from __future__ import annotations

import time
import tracemalloc

import numpy as np
import pytest

from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import forward_kinematics
from paretoik.robot.urdf import check_robot, report_text
from tests.robot.faulty_urdfs import BODY, ENDS, HEAD, JOINT, LIMIT, TAIL, jointed, limited, massed, moments, robot
from tests.robot.urdf_text import chain_of_three, joint, link


def test_a_name_of_nine_million_letters_is_refused_in_a_short_line(tmp_path):
    file = tmp_path / "robot.urdf"
    file.write_text(robot(more=f'<link name="{"x" * 9_000_000}"/>'), encoding="utf-8")
    faults = check_robot(file).faults
    assert len(faults) == 1
    assert len(faults[0]) < 200


MASS = '<mass value="1"/>'
FAULTS = {
    "text mass": (massed('<mass value="heavy"/>'), "line 4: link 'b': mass value must be a number, got 'heavy'"),
    "NaN mass": (massed('<mass value="nan"/>'), "line 4: link 'b': mass value must be a number, got 'nan'"),
    "infinite mass": (massed('<mass value="1e999"/>'), "line 4: link 'b': mass value must be finite, got '1e999'"),
    "negative mass": (massed('<mass value="-2"/>'), "line 4: link 'b': mass must not be negative, got -2 kg"),
    "missing mass": (massed(""), "line 4: link 'b': its <inertial> must have a <mass>, got none"),
    "mass without value": (massed("<mass/>"), "line 4: link 'b': <mass> must have value, got none"),
    "mass with a comma": (massed('<mass value="1,5"/>'), "must be a number, got '1,5'"),
    "mass with an underscore": (massed('<mass value="1_5"/>'), "must be a number, got '1_5'"),
    "mass in Arabic digits": (massed('<mass value="١"/>'), "must be a number, got '١'"),
    "two masses": (massed(MASS + MASS), "line 4: link 'b': must have one <mass>, got 2"),
    "two inertials": (robot(BODY + BODY), "line 4: link 'b': must have one <inertial>, got 2"),
    "missing inertia": (massed(MASS, ""), "line 4: link 'b': its <inertial> must have an <inertia>, got none"),
    "half an inertia": (massed(MASS, '<inertia ixx="1"/>'), "line 4: link 'b': <inertia> must have izz, got none"),
    "NaN inertia": (moments("NaN", 1, 1), "line 4: link 'b': inertia ixx must be a number, got 'NaN'"),
    "negative inertia": (moments(-1, 1, 1), "line 4: link 'b': inertia must be positive, got its smallest principal"),
    "indefinite inertia": (moments(1, 1, 1, xy=2), "line 4: link 'b': inertia must be positive"),
    "triangle": (
        moments(1, 1, 3),
        "line 4: link 'b': inertia must keep the triangle inequality, got principal moments 1, 1 ",
    ),
    "origin": (massed(MASS + '<origin xyz="0 0"/>'), "line 4: link 'b': origin xyz must be 3 numbers, got '0 0'"),
    "zero axis": (limited(LIMIT + '<axis xyz="0 0 0"/>'), "line 5: joint 'j': axis must not be zero, got 0 0 0"),
    "text axis": (limited(LIMIT + '<axis xyz="x"/>'), "line 5: joint 'j': axis xyz must be 3 numbers, got 'x'"),
    "NaN axis": (limited(LIMIT + '<axis xyz="0 nan 1"/>'), "line 5: joint 'j': axis xyz must be 3 numbers"),
    "axis without xyz": (limited(LIMIT + "<axis/>"), "line 5: joint 'j': <axis> must have xyz, got none"),
    "joint origin": (limited(LIMIT + '<origin rpy="0 0 inf"/>'), "line 5: joint 'j': origin rpy must be finite"),
    "swapped limits": (
        limited('<limit lower="1" upper="-1" velocity="1" effort="1"/>'),
        "line 5: joint 'j': limits must not be swapped, got lower 1 and upper -1",
    ),
    "NaN limit": (
        limited('<limit lower="nan" upper="1" velocity="1" effort="1"/>'),
        "line 5: joint 'j': limit lower must be a number, got 'nan'",
    ),
    "negative velocity": (
        limited('<limit lower="0" upper="1" velocity="-1" effort="1"/>'),
        "line 5: joint 'j': velocity limit must not be negative, got -1",
    ),
    "no velocity": (
        limited('<limit lower="0" upper="1" effort="1"/>'),
        "line 5: joint 'j': <limit> must have velocity, got none",
    ),
    "no limit": (limited(""), "line 5: joint 'j': a revolute joint must have a <limit>, got none"),
    "no limit on a slide": (limited("", "prismatic"), "a prismatic joint must have a <limit>, got none"),
    "unknown type": (limited(LIMIT, "ball"), "line 5: joint 'j': type must be one of revolute, continuous, "),
    "no type": (robot(joint=f'<joint name="j">{ENDS}</joint>'), "line 5: joint 'j': type must be one of"),
    "no child": (jointed('<parent link="a"/>' + LIMIT), "line 5: joint 'j': must name a child link, got none"),
    "mimic with text": (limited(LIMIT + '<mimic joint="j" multiplier="m"/>'), "mimic multiplier must be a number"),
    "origin with two rotations": (
        limited(LIMIT + '<origin rpy="0 0 0" quat_xyzw="0 0 0 1"/>'),
        "line 5: joint 'j': origin must have rpy or quat_xyzw, got both",
    ),
    "zero quaternion": (
        limited(LIMIT + '<origin quat_xyzw="0 0 0 0"/>'),
        "line 5: joint 'j': quat_xyzw must not be zero, got 0 0 0 0",
    ),
    "short quaternion": (limited(LIMIT + '<origin quat_xyzw="0 0 1"/>'), "origin quat_xyzw must be 4 numbers"),
    "far origin": (limited(LIMIT + '<origin xyz="1e200 0 0"/>'), "joint 'j': origin xyz must be at most 1e+50 m"),
    "text acceleration": (limited(LIMIT.replace("/>", ' acceleration="x"/>')), "limit acceleration must be a number"),
    "negative jerk": (limited(LIMIT.replace("/>", ' jerk="-1"/>')), "jerk limit must not be negative, got -1"),
    "macro in a link": (
        robot(body="<xacro:block/>"),
        "line 4: link 'b': must be expanded by xacro, got the macro <xacro:block>",
    ),
    "name of a frame": (robot(more='<link name="&lt;tool&gt;"/>'), "line 6: link '<tool>': name must be none of the"),
    "two links of a name": (
        robot(more='<link name="a"/>'),
        "line 6: link 'a': name must be its own, got that of line 3",
    ),
    "two joints of a name": (robot(more=JOINT), "line 6: joint 'j': name must be its own, got that of line 5"),
    "link without a name": (robot(more="<link/>"), "line 6: a <link> must have a name, got none"),
    "name of a novel": (
        robot(more=f'<link name="{"x" * 5000}"/>'),
        "name must have at most 200 characters as they are printed, got 5000",
    ),
    "name that is not printable": (
        robot(more=f'<link name="{chr(127) * 60}"/>'),
        "name must have at most 200 characters as they are printed, got 240",
    ),
    "no links": (HEAD + TAIL, "line 2: the robot must have a link, got none"),
    "text damping": (limited(LIMIT + '<dynamics damping="wet"/>'), "dynamics damping must be a number, got 'wet'"),
    "too many links": (
        robot(more="".join(f'<link name="n{i}"/>' for i in range(1000))),
        "the robot must have at most 1000 links, got 1002",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named_with_its_line_link_or_joint_and_value(tmp_path, name):
    content, words = FAULTS[name]
    file = tmp_path / "robot.urdf"
    file.write_text(content, encoding="utf-8")
    with pytest.raises(InvalidRobot) as caught:
        Arm.from_urdf(file)
    assert any(words in fault for fault in caught.value.faults), caught.value.faults
    assert check_robot(file).faults == caught.value.faults


def test_the_robot_that_the_faults_are_put_into_has_none(tmp_path):
    file = tmp_path / "robot.urdf"
    file.write_text(robot(), encoding="utf-8")
    assert check_robot(file).faults == ()
    assert Arm.from_urdf(file).dof == 1


def test_all_faults_of_a_file_are_listed_at_once_in_the_order_of_its_lines(tmp_path):
    body = '<inertial><mass value="-1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="9"/></inertial>'
    bad = '<limit lower="1" upper="-1" velocity="1" effort="1"/><axis xyz="0 0 0"/><mimic joint="none"/>'
    file = tmp_path / "robot.urdf"
    joint = f'<joint name="j" type="revolute">{ENDS}{bad}</joint>'
    file.write_text(robot(body, joint, '<link name="a"/><link name="c"/>'), encoding="utf-8")
    faults = check_robot(file).faults
    lines = [int(fault.split(":")[0].removeprefix("line ")) for fault in faults]
    assert lines == sorted(lines)
    assert len(faults) == 7
    for words in ("negative", "triangle", "swapped", "zero", "mimic a", "its own", "one root"):
        assert sum(words in fault for fault in faults) == 1


def test_of_very_many_faults_a_text_has_the_first_hundred_and_the_report_all(tmp_path):
    file = tmp_path / "robot.urdf"
    file.write_text(robot(more="<link/>\n" * 5000), encoding="utf-8")
    report = check_robot(file)
    assert len(report.faults) == 5000
    assert report_text(report).splitlines()[-2:] == [f"fault: {report.faults[99]}", "fault: and 4900 more"]
    with pytest.raises(InvalidRobot, match=r"got 5000 faults: line 6: .*; and 4900 more$") as refused:
        Arm.from_urdf(file)
    assert refused.value.faults == report.faults
    assert str(refused.value).count("; ") == 100


def test_numbers_are_read_alike_in_every_locale(write_urdf):
    import locale

    before = locale.setlocale(locale.LC_NUMERIC)
    try:
        for name in ("de_DE.UTF-8", "fr_FR.UTF-8", "C"):
            try:
                locale.setlocale(locale.LC_NUMERIC, name)
            except locale.Error:
                continue
            arm = Arm.from_urdf(write_urdf(*chain_of_three(inside=LIMIT + '<origin xyz="0.5 0 1.25e-1"/>')))
            assert forward_kinematics(arm, np.zeros(3))[1] == pytest.approx([0.5, 0.0, 0.125])
    finally:
        locale.setlocale(locale.LC_NUMERIC, before)


def test_mass_without_inertia_is_taken_as_a_point_with_a_warning(write_urdf):
    point = '<inertial><mass value="2"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    file = write_urdf(*chain_of_three(last=point))
    assert any("link 'd': has mass but no inertia" in warning for warning in check_robot(file).warnings)
    assert Arm.from_urdf(file).bodies[2].mass == 2.0


# Faults of trees and mimic joints


TREE_FAULTS = {
    "unknown parent": (
        jointed('<parent link="x"/><child link="b"/>' + LIMIT),
        "line 5: joint 'j': parent must be a link of the robot, got 'x'",
    ),
    "unknown child": (
        jointed('<parent link="a"/><child link="x"/>' + LIMIT),
        "line 5: joint 'j': child must be a link of the robot, got 'x'",
    ),
    "mimic of nothing": (
        limited(LIMIT + '<mimic joint="ghost"/>'),
        "line 5: joint 'j': must mimic a joint of the robot, got 'ghost'",
    ),
    "mimic of itself": (
        limited(LIMIT + '<mimic joint="j"/>'),
        "line 5: joint 'j': must mimic another joint, got itself",
    ),
    "two roots": (robot(more='<link name="c"/>'), "line 1: the robot must have one root link, got 2: 'a', 'c'"),
    "two parents": (
        robot(more='<joint name="k" type="fixed"><parent link="a"/><child link="b"/></joint>'),
        "line 6: link 'b': must be the child of one joint, got 'j' and 'k'",
    ),
    "loop": (
        robot(more='<joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint>'),
        "line 5: joints must form a tree, got the loop 'j', 'k'",
    ),
    "joint to itself": (
        jointed('<parent link="b"/><child link="b"/>' + LIMIT),
        "joints must form a tree, got the loop 'j'",
    ),
}


@pytest.mark.parametrize("name", TREE_FAULTS)
def test_what_keeps_links_and_joints_from_being_one_tree_is_named(tmp_path, name):
    content, words = TREE_FAULTS[name]
    file = tmp_path / "robot.urdf"
    file.write_text(content, encoding="utf-8")
    faults = check_robot(file).faults
    assert any(words in fault for fault in faults), faults


def test_each_of_two_loops_is_named_once(write_urdf):
    links = [link(name) for name in "abcde"]
    joints = [joint(f"{x}{y}", x, y, "fixed", "") for x, y in ("ab", "bc", "ca", "de", "ed")]
    loops = [fault for fault in check_robot(write_urdf(*links, *joints)).faults if "loop" in fault]
    assert [fault.split("the loop ")[-1] for fault in loops] == ["'ab', 'ca', 'bc'", "'de', 'ed'"]


def test_of_many_roots_ten_are_named(write_urdf):
    (fault,) = check_robot(write_urdf(*(link(f"n{i}") for i in range(12)))).faults
    assert "got 12: 'n0', " in fault
    assert fault.endswith("'n9', ...")


def test_a_chain_of_a_thousand_links_is_checked(write_urdf):
    parts = [*(link(f"n{i}") for i in range(1000)), *(joint(f"j{i}", f"n{i}", f"n{i + 1}") for i in range(999))]
    assert check_robot(write_urdf(*parts)).faults == ()


# Files that are not the XML of a robot, in bounded time and memory


NESTED = "<a>" * 100_000
LAUGHS = '<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]>'
UNREADABLE = {
    "empty": ("", "the file must describe a robot, got an empty file"),
    "blank": ("\n \n", "line 3: the file must be well-formed XML, got no element found"),
    "truncated": (robot()[:-20], "line 5: the file must be well-formed XML, got unclosed token"),
    "truncated in a tag": (robot()[:130], "the file must be well-formed XML, got "),
    "not XML": ("solid cube\nfacet", "line 1: the file must be well-formed XML, got syntax error"),
    "JSON": ('{"robot": 1}', "line 1: the file must be well-formed XML, got "),
    "NUL": (robot().replace("robot name", "robot\0name"), "line 2: the file must be well-formed XML, got "),
    "binary": (bytes(range(256)), "line 1: the file must be well-formed XML, got "),
    "wrong encoding": ('<?xml version="1.0" encoding="klingon"?><robot/>', "line 1: "),
    "several bytes a letter": ('<?xml version="1.0" encoding="shift_jis"?><robot/>', "line 1: "),
    "broken UTF-8": (b'<robot name="\xff\xfe"/>', "line 1: the file must be well-formed XML, got "),
    "another root": ("<html><body/></html>", "line 1: the root element must be <robot>, got <html>"),
    "two roots": (robot() + "<robot/>", "the file must be well-formed XML, got junk after document element"),
    "macro": (
        HEAD + '<xacro:include filename="x"/>' + TAIL,
        "line 3: the robot must be expanded by xacro, got the macro <xacro:include>",
    ),
    "DOCTYPE": ('<?xml version="1.0"?>\n<!DOCTYPE robot>' + robot()[21:], "line 2: the file must have no DOCTYPE"),
    "ENTITY": (f"{LAUGHS}<robot name='&b;'/>", "line 1: the file must have no DOCTYPE"),
    "external": ('<!DOCTYPE r SYSTEM "http://example.org/x.dtd"><robot/>', "line 1: the file must have no DOCTYPE"),
    "unknown entity": (HEAD + "&secret;" + TAIL, "line 3: the file must be well-formed XML, got undefined entity"),
    "deep": (HEAD + NESTED, "line 3: elements must be nested at most 64 deep"),
    "many elements": (HEAD + "<link/>\n" * 50_001 + TAIL, "line 50002: the file must have at most 50,000 elements"),
    "huge": (HEAD + " " * 10_000_000, "the file must have at most 10 MB, got a larger file"),
}


@pytest.mark.usefixtures("unchecked")  # which cost time and memory of their own
@pytest.mark.parametrize("name", UNREADABLE)
def test_a_file_that_is_no_robots_xml_is_one_error_with_its_line(tmp_path, name):
    content, words = UNREADABLE[name]
    file = tmp_path / "robot.urdf"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    start = time.perf_counter()
    with pytest.raises(InvalidRobot) as caught:
        Arm.from_urdf(file)
    assert time.perf_counter() - start < 10.0
    assert len(caught.value.faults) == 1
    assert words in caught.value.faults[0]
    assert str(caught.value).startswith(f"{file} must be a robot without faults, got 1 fault: ")
    assert "\n" not in str(caught.value)
    assert check_robot(file).faults == caught.value.faults


@pytest.mark.usefixtures("unchecked")  # which cost time and memory of their own
@pytest.mark.parametrize("name", ["deep", "many elements", "huge"])
def test_a_hostile_file_costs_bounded_memory(tmp_path, name):
    file = tmp_path / "robot.urdf"
    file.write_text(UNREADABLE[name][0], encoding="utf-8")
    tracemalloc.start()
    with pytest.raises(InvalidRobot):
        Arm.from_urdf(file)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 60e6


def test_a_missing_file_or_a_folder_is_told(tmp_path):
    with pytest.raises(InvalidInput, match="must be a plain file, got no such file"):
        Arm.from_urdf(tmp_path / "none.urdf")
    with pytest.raises(InvalidInput, match="must be a plain file, got a folder"):
        check_robot(tmp_path)


def test_every_truncation_of_a_good_file_is_refused(tmp_path):
    whole = robot()
    file = tmp_path / "robot.urdf"
    for length in range(len(whole)):
        file.write_text(whole[:length], encoding="utf-8")
        assert check_robot(file).faults, length


def test_transmissions_and_plug_ins_that_name_joints_are_not_joints(write_urdf):
    extra = '<transmission name="t"><joint name="j1"/></transmission><gazebo><link/><joint/></gazebo>'
    assert Arm.from_urdf(write_urdf(*chain_of_three(), extra)).dof == 3
