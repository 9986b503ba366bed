"""All faults of a URDF's links and joints are named at once with their lines, before an arm is built."""

from __future__ import annotations

import time
import tracemalloc

import pytest

from paretoik.errors import InvalidRobot
from paretoik.robot.arm import Arm
from paretoik.robot.urdf import check_robot
from tests.robot.faulty_urdfs import ENDS, HEAD, LIMIT, TAIL, jointed, limited, massed, moments, robot
from tests.robot.urdf_text import chain_of_three

MASS = '<mass value="1"/>'
FAULTS = {
    "text mass": (massed('<mass value="heavy"/>'), "line 4: link 'b': mass value must be a number, got 'heavy'"),
    "infinite mass": (massed('<mass value="1e999"/>'), "line 4: link 'b': mass value must be finite, got '1e999'"),
    "negative mass": (massed('<mass value="-2"/>'), "line 4: link 'b': mass must not be negative, got -2 kg"),
    "missing mass": (massed(""), "line 4: link 'b': its <inertial> must have a <mass>, got none"),
    "mass in Arabic digits": (massed('<mass value="١"/>'), "must be a number, got '١'"),
    "two masses": (massed(MASS + MASS), "line 4: link 'b': must have one <mass>, got 2"),
    "indefinite inertia": (moments(1, 1, 1, xy=2), "line 4: link 'b': inertia must be positive"),
    "triangle": (
        moments(1, 1, 3),
        "line 4: link 'b': inertia must satisfy the triangle inequality, got principal moments 1, 1 ",
    ),
    "origin": (massed(MASS + '<origin xyz="0 0"/>'), "line 4: link 'b': origin xyz must be 3 numbers, got '0 0'"),
    "zero axis": (limited(LIMIT + '<axis xyz="0 0 0"/>'), "line 5: joint 'j': axis must not be zero, got 0 0 0"),
    "swapped limits": (
        limited('<limit lower="1" upper="-1" velocity="1" effort="1"/>'),
        "line 5: joint 'j': limits must not be swapped, got lower 1 and upper -1",
    ),
    "no velocity": (
        limited('<limit lower="0" upper="1" effort="1"/>'),
        "line 5: joint 'j': <limit> must have velocity, got none",
    ),
    "no limit on a slide": (limited("", "prismatic"), "a prismatic joint must have a <limit>, got none"),
    "unknown type": (limited(LIMIT, "ball"), "line 5: joint 'j': type must be one of revolute, continuous, "),
    "no child": (jointed('<parent link="a"/>' + LIMIT), "line 5: joint 'j': must name a child link, got none"),
    "origin with two rotations": (
        limited(LIMIT + '<origin rpy="0 0 0" quat_xyzw="0 0 0 1"/>'),
        "line 5: joint 'j': origin must have rpy or quat_xyzw, got both",
    ),
    "zero quaternion": (
        limited(LIMIT + '<origin quat_xyzw="0 0 0 0"/>'),
        "line 5: joint 'j': quat_xyzw must not be zero, got 0 0 0 0",
    ),
    "macro in a link": (
        robot(body="<xacro:block/>"),
        "line 4: link 'b': must be expanded by xacro, got the macro <xacro:block>",
    ),
    "two links of a name": (
        robot(more='<link name="a"/>'),
        "line 6: link 'a': name must be unique, got that of line 3",
    ),
    "unknown parent": (
        jointed('<parent link="x"/><child link="b"/>' + LIMIT),
        "line 5: joint 'j': parent must be a link of the robot, got 'x'",
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
    "name of a novel": (
        robot(more=f'<link name="{"x" * 5000}"/>'),
        "name must have at most 200 characters as they are printed, got 5000",
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
    for words in ("negative", "triangle", "swapped", "zero", "mimic a", "unique", "one root"):
        assert sum(words in fault for fault in faults) == 1


def test_mass_without_inertia_is_taken_as_a_point_with_a_warning(write_urdf):
    point = '<inertial><mass value="2"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    file = write_urdf(*chain_of_three(last=point))
    assert any("link 'd': has mass but no inertia" in warning for warning in check_robot(file).warnings)
    assert Arm.from_urdf(file).bodies[2].mass == 2.0


# Files that are not the XML of a robot, in bounded time and memory


NESTED = "<a>" * 100_000
LAUGHS = '<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]>'
UNREADABLE = {
    "empty": ("", "the file must describe a robot, got an empty file"),
    "truncated in a tag": (robot()[:130], "the file must be well-formed XML, got "),
    "binary": (bytes(range(256)), "line 1: the file must be well-formed XML, got "),
    "another root": ("<html><body/></html>", "line 1: the root element must be <robot>, got <html>"),
    "macro": (
        HEAD + '<xacro:include filename="x"/>' + TAIL,
        "line 3: the robot must be expanded by xacro, got the macro <xacro:include>",
    ),
    "ENTITY": (f"{LAUGHS}<robot name='&b;'/>", "line 1: the file must have no DOCTYPE"),
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
@pytest.mark.parametrize("name", ["deep", "huge"])
def test_a_hostile_file_costs_bounded_memory(tmp_path, name):
    file = tmp_path / "robot.urdf"
    file.write_text(UNREADABLE[name][0], encoding="utf-8")
    tracemalloc.start()
    with pytest.raises(InvalidRobot):
        Arm.from_urdf(file)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 60e6


def test_every_truncation_of_a_good_file_is_refused(tmp_path):
    whole = robot()
    file = tmp_path / "robot.urdf"
    for length in range(0, len(whole), 3):
        file.write_text(whole[:length], encoding="utf-8")
        assert check_robot(file).faults, length


def test_transmissions_and_plug_ins_that_name_joints_are_not_joints(write_urdf):
    extra = '<transmission name="t"><joint name="j1"/></transmission><gazebo><link/><joint/></gazebo>'
    assert Arm.from_urdf(write_urdf(*chain_of_three(), extra)).dof == 3
