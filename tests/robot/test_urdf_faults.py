"""Every fault of a URDF is named with its line, all of them at once, before anything is loaded."""

from __future__ import annotations

import time
import tracemalloc

import pytest

from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.robot.arm import Arm
from paretoik.robot.urdf import check_robot

INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
BODY = f'<inertial><mass value="1"/>{INERTIA}</inertial>'
LIMIT = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'
ENDS = '<parent link="a"/><child link="b"/>'
JOINT = f'<joint name="j" type="revolute">{ENDS}{LIMIT}</joint>'
HEAD = '<?xml version="1.0"?>\n<robot name="r">\n'
TAIL = "\n</robot>"


def robot(body=BODY, joint=JOINT, more=""):
    """Return a robot whose link b is on line 4 and whose joint is on line 5."""
    return f'{HEAD}<link name="a"/>\n<link name="b">{body}</link>\n{joint}\n{more}{TAIL}'


def massed(mass, inertia=INERTIA):
    return robot(f"<inertial>{mass}{inertia}</inertial>")


def moments(xx, yy, zz, xy=0):
    return massed('<mass value="1"/>', f'<inertia ixx="{xx}" ixy="{xy}" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/>')


def jointed(inside, kind="revolute"):
    return robot(joint=f'<joint name="j" type="{kind}">{inside}</joint>')


def limited(limit, kind="revolute"):
    return jointed(ENDS + limit, kind)


NESTED = "<a>" * 100_000
LAUGHS = '<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]>'
UNREADABLE = {
    "empty": ("", "the file is empty"),
    "blank": ("\n \n", "line 3: not well-formed XML, no element found"),
    "truncated": (robot()[:-20], "line 5: not well-formed XML, unclosed token"),
    "truncated in a tag": (robot()[:130], "not well-formed XML"),
    "not XML": ("solid cube\nfacet", "line 1: not well-formed XML, syntax error"),
    "JSON": ('{"robot": 1}', "line 1: not well-formed XML"),
    "NUL": (robot().replace("robot name", "robot\0name"), "line 2: not well-formed XML"),
    "binary": (bytes(range(256)), "line 1: not well-formed XML"),
    "wrong encoding": ('<?xml version="1.0" encoding="klingon"?><robot/>', "line 1: not"),
    "several bytes a letter": ('<?xml version="1.0" encoding="shift_jis"?><robot/>', "line 1: not"),
    "broken UTF-8": (b'<robot name="\xff\xfe"/>', "line 1: not well-formed XML"),
    "another root": ("<html><body/></html>", "line 1: the root element must be <robot>, got <html>"),
    "two roots": (robot() + "<robot/>", "not well-formed XML, junk after document element"),
    "macro": (HEAD + '<xacro:include filename="x"/>' + TAIL, "line 3: <xacro:include> is a macro"),
    "DOCTYPE": ('<?xml version="1.0"?>\n<!DOCTYPE robot>' + robot()[21:], "line 2: a DOCTYPE is refused"),
    "ENTITY": (f"{LAUGHS}<robot name='&b;'/>", "line 1: a DOCTYPE is refused"),
    "external": ('<!DOCTYPE r SYSTEM "http://example.org/x.dtd"><robot/>', "line 1: a DOCTYPE is refused"),
    "unknown entity": (HEAD + "&secret;" + TAIL, "line 3: not well-formed XML, undefined entity"),
    "deep": (HEAD + NESTED, "line 3: elements nested deeper than 64"),
    "many elements": (HEAD + "<link/>\n" * 50_001 + TAIL, "line 50002: more than 50,000 elements"),
    "huge": (HEAD + " " * 10_000_000, "the file is larger than 10 MB"),
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
    assert str(caught.value).startswith(f"{file}: 1 fault: ")
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
    "missing mass": (massed(""), "line 4: link 'b': its <inertial> has no <mass>"),
    "mass without value": (massed("<mass/>"), "line 4: link 'b': <mass> lacks value"),
    "mass with a comma": (massed('<mass value="1,5"/>'), "must be a number, got '1,5'"),
    "mass with an underscore": (massed('<mass value="1_5"/>'), "must be a number, got '1_5'"),
    "mass in Arabic digits": (massed('<mass value="١"/>'), "must be a number, got '١'"),
    "two masses": (massed(MASS + MASS), "line 4: link 'b': wants one <mass>, has 2"),
    "two inertials": (robot(BODY + BODY), "line 4: link 'b': wants one <inertial>, has 2"),
    "missing inertia": (massed(MASS, ""), "line 4: link 'b': its <inertial> has no <inertia>"),
    "half an inertia": (massed(MASS, '<inertia ixx="1"/>'), "line 4: link 'b': <inertia> lacks izz"),
    "NaN inertia": (moments("NaN", 1, 1), "line 4: link 'b': inertia ixx must be a number, got 'NaN'"),
    "negative inertia": (moments(-1, 1, 1), "line 4: link 'b': inertia must be positive, its least principal"),
    "indefinite inertia": (moments(1, 1, 1, xy=2), "line 4: link 'b': inertia must be positive"),
    "triangle": (moments(1, 1, 3), "line 4: link 'b': inertia breaks the triangle inequality: principal moments 1, 1 "),
    "origin": (massed(MASS + '<origin xyz="0 0"/>'), "line 4: link 'b': origin xyz must be 3 numbers, got '0 0'"),
    "zero axis": (limited(LIMIT + '<axis xyz="0 0 0"/>'), "line 5: joint 'j': axis must not be zero"),
    "text axis": (limited(LIMIT + '<axis xyz="x"/>'), "line 5: joint 'j': axis xyz must be 3 numbers, got 'x'"),
    "NaN axis": (limited(LIMIT + '<axis xyz="0 nan 1"/>'), "line 5: joint 'j': axis xyz must be 3 numbers"),
    "axis without xyz": (limited(LIMIT + "<axis/>"), "line 5: joint 'j': <axis> lacks xyz"),
    "joint origin": (limited(LIMIT + '<origin rpy="0 0 inf"/>'), "line 5: joint 'j': origin rpy must be finite"),
    "swapped limits": (
        limited('<limit lower="1" upper="-1" velocity="1" effort="1"/>'),
        "line 5: joint 'j': limits are swapped, lower 1 and upper -1",
    ),
    "NaN limit": (
        limited('<limit lower="nan" upper="1" velocity="1" effort="1"/>'),
        "line 5: joint 'j': limit lower must be a number, got 'nan'",
    ),
    "negative velocity": (
        limited('<limit lower="0" upper="1" velocity="-1" effort="1"/>'),
        "line 5: joint 'j': velocity limit must not be negative, got -1",
    ),
    "no velocity": (limited('<limit lower="0" upper="1" effort="1"/>'), "line 5: joint 'j': <limit> lacks velocity"),
    "no limit": (limited(""), "line 5: joint 'j': a revolute joint wants a <limit>, has none"),
    "no limit on a slide": (limited("", "prismatic"), "a prismatic joint wants a <limit>, has none"),
    "unknown type": (limited(LIMIT, "ball"), "line 5: joint 'j': type must be one of revolute, continuous, "),
    "no type": (robot(joint=f'<joint name="j">{ENDS}</joint>'), "line 5: joint 'j': type must be one of"),
    "unknown parent": (
        jointed('<parent link="x"/><child link="b"/>' + LIMIT),
        "line 5: joint 'j': parent link 'x' does not exist",
    ),
    "unknown child": (
        jointed('<parent link="a"/><child link="x"/>' + LIMIT),
        "line 5: joint 'j': child link 'x' does not exist",
    ),
    "no child": (jointed('<parent link="a"/>' + LIMIT), "line 5: joint 'j': names no child link"),
    "mimic of nothing": (
        limited(LIMIT + '<mimic joint="ghost"/>'),
        "line 5: joint 'j': mimics joint 'ghost', which does not exist",
    ),
    "mimic of itself": (limited(LIMIT + '<mimic joint="j"/>'), "line 5: joint 'j': mimics itself"),
    "mimic with text": (limited(LIMIT + '<mimic joint="j" multiplier="m"/>'), "mimic multiplier must be a number"),
    "two links of a name": (robot(more='<link name="a"/>'), "line 6: link 'a': name already used on line 3"),
    "two joints of a name": (robot(more=JOINT), "line 6: joint 'j': name already used on line 5"),
    "link without a name": (robot(more="<link/>"), "line 6: a <link> has no name"),
    "name of a novel": (robot(more=f'<link name="{"x" * 5000}"/>'), "name is 5000 characters long"),
    "two roots": (robot(more='<link name="c"/>'), "line 1: the robot must have one root link, has 2: 'a', 'c'"),
    "no links": (HEAD + TAIL, "line 2: the robot has no link"),
    "two parents": (
        robot(more='<joint name="k" type="fixed"><parent link="a"/><child link="b"/></joint>'),
        "line 6: link 'b': is the child of two joints, 'j' and 'k'",
    ),
    "loop": (
        robot(more='<joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint>'),
        "line 5: joints form a loop: 'j', 'k'",
    ),
    "joint to itself": (jointed('<parent link="b"/><child link="b"/>' + LIMIT), "joints form a loop: 'j'"),
    "text damping": (limited(LIMIT + '<dynamics damping="wet"/>'), "dynamics damping must be a number, got 'wet'"),
    "too many links": (
        robot(more="".join(f'<link name="n{i}"/>' for i in range(1000))),
        "the robot has 1002 links, at most 1000 are read",
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
    for words in ("negative", "triangle", "swapped", "zero", "mimics", "already used", "one root"):
        assert sum(words in fault for fault in faults) == 1


def test_of_very_many_faults_the_first_hundred_are_listed(tmp_path):
    file = tmp_path / "robot.urdf"
    file.write_text(robot(more="<link/>\n" * 5000), encoding="utf-8")
    faults = check_robot(file).faults
    assert len(faults) == 101
    assert faults[-1] == "and 4900 more"


def test_a_missing_file_or_a_folder_is_told(tmp_path):
    with pytest.raises(InvalidInput, match="no such file"):
        Arm.from_urdf(tmp_path / "none.urdf")
    with pytest.raises(InvalidInput, match="is not a regular file"):
        check_robot(tmp_path)


def test_every_truncation_of_a_good_file_is_refused(tmp_path):
    whole = robot()
    file = tmp_path / "robot.urdf"
    for length in range(len(whole)):
        file.write_text(whole[:length], encoding="utf-8")
        assert check_robot(file).faults, length
