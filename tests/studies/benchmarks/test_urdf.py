"""URDFs against Pinocchio: equal quantities are compared, and a wrong arm is detected."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

import paretoik as pk
from studies.benchmarks import urdf

ROOT = Path(__file__).parents[3]
PANDA = ROOT / "problems" / "robots" / "panda.urdf"
TEXT = PANDA.read_text()
BASE, TIP = "panda_link2", "panda_hand"


def errors_of(arm: pk.Arm) -> dict[str, float]:
    errors, links = urdf.compare_chain(TEXT, arm, BASE, {}, np.random.default_rng(0))
    assert links == 13
    return errors


def test_a_right_arm_has_no_errors_and_a_wrong_one_is_detected():
    arm = pk.Arm.from_urdf(PANDA, base=BASE, tip=TIP)
    assert max(errors_of(arm).values()) < 1e-13
    light = replace(arm, bodies=(*arm.bodies[:-1], replace(arm.bodies[-1], mass=0.9 * arm.bodies[-1].mass)))
    swapped = replace(arm, frames={**arm.frames, "panda_link5": arm.frames["panda_link7"]})
    wrong = {
        "gravity": (replace(arm, gravity=np.array([0.0, 0.0, -9.81])), {"gravity torque", "inverse dynamics"}),
        "mass": (light, {"gravity torque", "inverse dynamics"}),
        "frame": (swapped, {"position", "rotation"}),
    }
    for name, (other, seen) in wrong.items():
        assert {quantity for quantity, error in errors_of(other).items() if error > 1e-3} == seen, name


def test_frozen_joints_are_fixed_follow_their_leader_or_stay_at_zero():
    tree = urdf.Tree.from_text(TEXT)
    assert tree.frozen_value("panda_finger_joint2", {"panda_finger_joint1": 0.02}) == 0.02
    assert tree.frozen_value("panda_finger_joint2", {"panda_finger_joint2": 0.01}) == 0.01
    assert tree.frozen_value("panda_joint3", {}) == 0.0
    follower = urdf.Tree(("a",), {}, {}, {}, {"x": ("y", 2.0, 1.0), "y": ("z", -1.0, 0.5)})
    assert follower.frozen_value("x", {"z": 3.0}) == -4.0


def test_random_chains_have_a_joint_between_their_ends_and_values_within_limits():
    tree = urdf.Tree.from_text(TEXT)
    chains = list(urdf.random_chains(tree, np.random.default_rng(0), leaves=3, pairs=10))
    assert [chain[0] for chain in chains[:3]] == [None] * 3
    assert len(chains) == 13
    for base, tip, fixed in chains[3:]:
        line = [tip, *tree.above(tip)]
        between = [tree.parents[link][0] for link in line[: line.index(base)]]
        assert any(tree.types[name] in urdf.MOVING and name not in fixed for name in between)
        assert all(tree.limits[name][0] <= value <= tree.limits[name][1] for name, value in fixed.items())


def test_the_study_reports_links_errors_and_refusals(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(urdf, "package_files", lambda package: [PANDA] if package == "ours" else [])
    urdf.main(["--quick", "--packages", "ours", "none", "--json", str(tmp_path / "rows.json")])
    rows = {row["column"]: row["ours"] for row in json.loads((tmp_path / "rows.json").read_text())}
    assert rows["files"] == 1
    assert rows["links"] == 13 * rows["chains"] > 0
    assert max(value for column, value in rows.items() if column.startswith("worst")) < 1e-12
    assert rows["disagreements"] == 0
    assert "none: not installed" in capsys.readouterr().err


def test_a_refused_chain_is_counted_by_its_reason(tmp_path):
    file = tmp_path / "robot.urdf"
    file.write_text(TEXT.replace('name="panda_joint4" type="revolute"', 'name="panda_joint4" type="planar"'))
    tally = urdf.Tally()
    urdf.compare_file(file, tally, np.random.default_rng(0), leaves=1, pairs=0)
    (reason,) = tally.refusals
    assert reason.endswith("got a planar one")
    assert tally.disagreements == tally.chains == 0


def test_packages_that_are_not_installed_have_no_files():
    assert urdf.package_files("no-such-package-here") == []
