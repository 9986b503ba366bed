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


def test_what_check_robot_prints_is_as_wide_as_the_terminal(paretoik, monkeypatch):
    whole = strict(paretoik("check-robot", PANDA, "--json").out)["summary"]
    monkeypatch.setenv("COLUMNS", "50")
    lines = paretoik("check-robot", PANDA).out.splitlines()
    assert max(map(len, lines)) <= 50 < max(map(len, whole))
    assert " ".join(" ".join(lines).split()).startswith(" ".join(" ".join(whole).split()))
