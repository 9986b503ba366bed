""""""

from __future__ import annotations

from tests.cli.commands import PANDA, ROOT, Ended, strict


def test_list_shows_each_problem_with_what_it_is(paretoik, monkeypatch):
    monkeypatch.chdir(ROOT)
    ended = paretoik("list")
    names = [line.split()[0] for line in ended.out.splitlines()]
    assert ended.code == 0
    assert {"problems/tringali_2020.py:energy_torque", "problems/panda.py:across_the_table"} <= set(names)
    assert all(len(line.split()) > 3 for line in ended.out.splitlines())


def test_functions_that_may_be_problems_are_named_with_what_lists_them(paretoik, mine):
    ended = paretoik("list", mine)
    assert ended.err == (
        f"note: {mine} has functions that do not say what they return and may be problems too: tracking; "
        "annotate the return type, such as -> Tracking, to list them\n"
    )


def test_a_file_that_cannot_be_listed_does_not_hide_the_others(paretoik, mine, tmp_path):
    (tmp_path / "torn.py").write_text("def f(:")
    ended = paretoik("list", tmp_path / "torn.py", mine, "--json")
    assert ended.code == 2
    assert [line.split()[0] for line in ended.err.splitlines()] == ["note:", "error:"]
    assert {"problem": f"{mine}:good", "about": "[bold]Good[/bold] for tests."} in strict(ended.out)


def test_list_without_any_file_says_where_it_looked(paretoik, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert paretoik("list") == Ended(
        2, "", f"error: files must not be empty, got none, and there is no problems/*.py in {tmp_path}\n"
    )


def test_check_robot_lists_the_chain_and_ends_with_0_or_every_fault_and_2(paretoik, tmp_path):
    sound = paretoik("check-robot", PANDA, "--tip", "panda_hand")
    assert sound.code == 0
    assert sound.out.endswith("no faults\n")
    assert "panda_joint7: revolute" in sound.out
    (tmp_path / "lame.urdf").write_text("<robot name='lame'><link name='a'/><link name='b'/></robot>")
    lame = paretoik("check-robot", tmp_path / "lame.urdf")
    assert lame.code == 2
    assert "fault: " in lame.out
    said = strict(paretoik("check-robot", tmp_path / "lame.urdf", "--json").out)
    assert [f"fault: {fault}" for fault in said["faults"]] == [
        line for line in lame.out.splitlines() if line.startswith("fault")
    ]


def test_check_robot_takes_soft_limits_and_repairs_inertias_when_asked(paretoik, tmp_path):
    soft = paretoik("check-robot", PANDA, "--tip", "panda_hand", "--soft")
    assert "panda_joint1: revolute, -2.8973 to 2.8973 rad" in soft.out
    file = tmp_path / "wrong.urdf"
    file.write_text(
        "<robot name='r'><link name='a'/><link name='b'><inertial><mass value='1'/>"
        "<inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='9'/></inertial></link>"
        "<joint name='j' type='continuous'><parent link='a'/><child link='b'/></joint></robot>"
    )
    wrong = paretoik("check-robot", file)
    assert wrong.code == 2
    assert "--repair-inertias" in wrong.out
    repaired = paretoik("check-robot", file, "--repair-inertias")
    assert repaired.code == 0
    assert " ".join(repaired.out.split()).endswith("its principal moments are now 4.5, 4.5 and 9 kg m² no faults")


def test_check_robot_shows_the_bodies_of_links_when_asked(paretoik, tmp_path):
    file = tmp_path / "box.urdf"
    file.write_text(
        "<robot name='r'><link name='a'/><link name='b'><collision><geometry><box size='1 2 3'/></geometry></collision>"
        "</link><joint name='j' type='continuous'><parent link='a'/><child link='b'/></joint></robot>"
    )
    shown = paretoik("check-robot", file, "--collision", "--package", f"things={tmp_path}")
    assert "b     j         1       box    0.0           1.000" in shown.out
    (row,) = strict(paretoik("check-robot", file, "--collision", "--json").out)["collision"]
    assert row["link"] == "b"
    assert paretoik("check-robot", file, "--collision", "--package", "things").code == 2
