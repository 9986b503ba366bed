"""A file that is not the XML of a robot is one error with its line, in bounded time and memory."""

from __future__ import annotations

import time
import tracemalloc

import pytest

from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.robot.arm import Arm
from paretoik.robot.urdf import check_robot
from tests.robot.faulty_urdfs import HEAD, TAIL, robot
from tests.robot.urdf_text import chain_of_three

NESTED = "<a>" * 100_000
LAUGHS = '<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]>'
UNREADABLE = {
    "empty": ("", "a robot wanted, got an empty file"),
    "blank": ("\n \n", "line 3: well-formed XML wanted, got no element found"),
    "truncated": (robot()[:-20], "line 5: well-formed XML wanted, got unclosed token"),
    "truncated in a tag": (robot()[:130], "well-formed XML wanted, got "),
    "not XML": ("solid cube\nfacet", "line 1: well-formed XML wanted, got syntax error"),
    "JSON": ('{"robot": 1}', "line 1: well-formed XML wanted, got "),
    "NUL": (robot().replace("robot name", "robot\0name"), "line 2: well-formed XML wanted, got "),
    "binary": (bytes(range(256)), "line 1: well-formed XML wanted, got "),
    "wrong encoding": ('<?xml version="1.0" encoding="klingon"?><robot/>', "line 1: "),
    "several bytes a letter": ('<?xml version="1.0" encoding="shift_jis"?><robot/>', "line 1: "),
    "broken UTF-8": (b'<robot name="\xff\xfe"/>', "line 1: well-formed XML wanted, got "),
    "another root": ("<html><body/></html>", "line 1: the root element must be <robot>, got <html>"),
    "two roots": (robot() + "<robot/>", "well-formed XML wanted, got junk after document element"),
    "macro": (
        HEAD + '<xacro:include filename="x"/>' + TAIL,
        "line 3: a robot that xacro has expanded wanted, got the macro <xacro:include>",
    ),
    "DOCTYPE": ('<?xml version="1.0"?>\n<!DOCTYPE robot>' + robot()[21:], "line 2: a robot without DOCTYPE wanted"),
    "ENTITY": (f"{LAUGHS}<robot name='&b;'/>", "line 1: a robot without DOCTYPE wanted"),
    "external": ('<!DOCTYPE r SYSTEM "http://example.org/x.dtd"><robot/>', "line 1: a robot without DOCTYPE wanted"),
    "unknown entity": (HEAD + "&secret;" + TAIL, "line 3: well-formed XML wanted, got undefined entity"),
    "deep": (HEAD + NESTED, "line 3: elements nested at most 64 deep wanted"),
    "many elements": (HEAD + "<link/>\n" * 50_001 + TAIL, "line 50002: at most 50,000 elements wanted, got more"),
    "huge": (HEAD + " " * 10_000_000, "at most 10 MB wanted, got a larger file"),
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
    assert str(caught.value).startswith(f"{file}: a robot without faults wanted, got 1 fault: ")
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
    with pytest.raises(InvalidInput, match="a plain file wanted, got no such file"):
        Arm.from_urdf(tmp_path / "none.urdf")
    with pytest.raises(InvalidInput, match="a plain file wanted, got a folder"):
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
