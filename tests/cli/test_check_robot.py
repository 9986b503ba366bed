from __future__ import annotations

from tests.cli.commands import PANDA, strict


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


def test_what_check_robot_prints_is_as_wide_as_the_terminal(paretoik, monkeypatch):
    whole = strict(paretoik("check-robot", PANDA, "--json").out)["summary"]
    monkeypatch.setenv("COLUMNS", "50")
    lines = paretoik("check-robot", PANDA).out.splitlines()
    assert max(map(len, lines)) <= 50 < max(map(len, whole))
    assert " ".join(" ".join(lines).split()).startswith(" ".join(" ".join(whole).split()))
