"""Links and joints that are not one tree, and mimic joints that follow nothing, are named with their line."""

from __future__ import annotations

import pytest

from paretoik.robot.urdf import check_robot
from tests.robot.faulty_urdfs import LIMIT, jointed, limited, robot
from tests.robot.urdf_text import joint, link

FAULTS = {
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


@pytest.mark.parametrize("name", FAULTS)
def test_what_keeps_links_and_joints_from_being_one_tree_is_named(tmp_path, name):
    content, words = FAULTS[name]
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
