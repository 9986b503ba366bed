"""A URDF checked and loaded: the report, and the arm, which is the one that Pinocchio reads from the same text."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.robot.arm import Arm
from paretoik.robot.kinematics import forward_kinematics, link_frames
from paretoik.robot.pose import Pose
from paretoik.robot.urdf import check_robot
from paretoik.task.path import line
from paretoik.task.task import Task
from studies.benchmarks.urdf import Tally, Tree, compare_chain, compare_file, random_chains
from tests.robot.conftest import JACO, PANDA
from tests.robot.random_urdfs import random_robot
from tests.robot.urdf_text import BODY, LIMIT, chain_of_three, joint, link

FILES = {PANDA: "panda_hand_tcp", JACO: "j2s6s200_end_effector"}


def agree_with_pinocchio(file: Path, arm: Arm, base: str, fixed: dict[str, float], seed: int) -> None:
    errors, links = compare_chain(file.read_text(), arm, base, fixed, np.random.default_rng(seed))
    assert links == len([*arm.frames]) - arm.dof  # the file's links, and the joints that move
    assert max(errors.values()) <= 1e-12, errors


def check_random_robot(folder: Path, seed: int) -> None:
    """Check the chain of a random robot, and chains between random links of it with random joints fixed."""
    robot, rng = random_robot(seed), np.random.default_rng(seed)
    file = folder / f"{seed}.urdf"
    file.write_text(robot.text)
    agree_with_pinocchio(file, Arm.from_urdf(file, tip=robot.tip, fixed=robot.fixed), robot.links[0], robot.fixed, seed)
    for base, tip, fixed in random_chains(Tree.from_text(robot.text), rng, leaves=1, pairs=3):
        options = {"base": base, "tip": tip, "fixed": fixed}
        faults = check_robot(file, **options).faults
        if faults:
            with pytest.raises(InvalidRobot) as refused:
                Arm.from_urdf(file, **options)
            assert refused.value.faults == faults
        else:
            agree_with_pinocchio(file, Arm.from_urdf(file, **options), base or robot.links[0], fixed, seed)


@settings(max_examples=8)
@given(seed=st.integers(0, 10**9))
def test_every_link_and_torque_of_random_chains_is_that_of_pinocchio(tmp_path_factory, seed):
    check_random_robot(tmp_path_factory.getbasetemp(), seed)


@pytest.mark.slow
@settings(max_examples=300)
@given(seed=st.integers(0, 10**9))
def test_every_link_and_torque_of_many_random_chains_is_that_of_pinocchio(tmp_path_factory, seed):
    check_random_robot(tmp_path_factory.getbasetemp(), seed)


def test_every_urdf_of_the_repository_has_a_tip_here():
    root = Path(__file__).parents[2]
    assert set(FILES) == {*(root / "problems" / "robots").glob("*.urdf"), *(root / "tests" / "robots").glob("*.urdf")}


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_chains_of_the_repositorys_robots_are_those_that_pinocchio_reads(file):
    tally = Tally()
    compare_file(file, tally, np.random.default_rng(1), leaves=3, pairs=6)
    assert tally.chains >= 4
    assert tally.disagreements == 0
    assert all(reason.startswith("a joint that moves wanted") for reason in tally.refusals)
    assert max(tally.errors.values()) <= 1e-12, tally.worst


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
    flange, hand = (forward_kinematics(panda_arm, q, name) for name in ("panda_link8", "panda_hand"))
    tip = forward_kinematics(panda_arm, q)[1]
    assert np.linalg.norm(tip - flange[1], axis=-1) == pytest.approx(0.1034)
    assert flange[1] + 0.1034 * flange[0][..., 2] == pytest.approx(tip)
    assert hand[1] == pytest.approx(flange[1])


def test_the_jaco_has_continuous_joints_without_ends():
    arm = Arm.from_urdf(JACO, tip="j2s6s200_end_effector")
    assert arm.joint_types.count("continuous") == 3
    assert np.isinf(arm.position_limits[[0, 3, 5]]).all()
    assert arm.bodies[5].mass == pytest.approx(0.99 + 4 * 0.01)  # the four finger links are fixed to the hand


@pytest.mark.parametrize("axis", ["1 0 0", "0 1 0", "0 0 1", "-1 0 0", "0 -1 0", "0 0 -1", "1 1 1", "0.6 0 -0.8"])
@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
def test_a_joint_moves_about_or_along_the_axis_of_its_file(write_urdf, axis, kind):
    file = write_urdf(link("a"), link("b"), joint("j", "a", "b", kind, LIMIT + f'<axis xyz="{axis}"/>'))
    arm = Arm.from_urdf(file)
    direction = np.array(axis.split(), float) / np.linalg.norm(np.array(axis.split(), float))
    rotation, position = forward_kinematics(arm, np.array([0.7]))
    if kind == "prismatic":
        assert rotation == pytest.approx(np.eye(3))
        assert position == pytest.approx(0.7 * direction)
    else:
        assert rotation @ direction == pytest.approx(direction)
        assert np.trace(rotation) == pytest.approx(1 + 2 * np.cos(0.7))
        away = np.cross(direction, np.roll(direction, 1) + np.array([0.0, 0.0, 0.1]))
        assert np.cross(away, rotation @ away) @ direction > 0  # turns the right-handed way
    assert forward_kinematics(arm, np.zeros(1))[0] == pytest.approx(np.eye(3))


def test_infinite_limits_are_read_as_none(write_urdf):
    limit = '<limit lower="-inf" upper="INF" velocity="Infinity" effort="inf"/>'
    arm = Arm.from_urdf(write_urdf(*chain_of_three(inside=limit)))
    assert arm.position_limits[1].tolist() == [-np.inf, np.inf]
    assert np.isposinf(arm.velocity_limits[1])
    assert np.isposinf(arm.torque_limits[1])


def test_a_massless_flange_takes_the_mass_of_what_is_fixed_to_it(write_urdf):
    parts = [*chain_of_three(last=""), link("hand"), joint("mount", "d", "hand", "fixed", "")]
    arm = Arm.from_urdf(write_urdf(*parts))
    assert arm.bodies[2].mass == 1.0
    assert not any("moves no mass" in notice for notice in arm.notices)


def test_a_link_with_inertia_and_no_mass_adds_its_inertia(write_urdf):
    ring = BODY.replace('mass value="1"', 'mass value="0"')
    parts = [*chain_of_three(), link("ring", ring), joint("mount", "d", "ring", "fixed", '<origin xyz="9 9 9"/>')]
    body = Arm.from_urdf(write_urdf(*parts)).bodies[2]
    assert body.mass == 1.0
    assert body.center.tolist() == [0.0, 0.0, 0.0]
    assert body.inertia == pytest.approx(2 * np.eye(3))


@pytest.mark.parametrize(
    ("inside", "words"),
    [
        ('<origin xyz="1e308 0 0"/>', "joint 'k': origin xyz: at most"),
        ('<origin xyz="9e49 0 0"/>', "the robot: pose position: at most"),
    ],
)
def test_offsets_that_are_too_large_alone_or_together_are_refused(write_urdf, inside, words):
    parts = [*chain_of_three(), link("e"), link("f")]
    parts += [joint("k", "d", "e", "fixed", inside), joint("m", "e", "f", "fixed", inside)]
    with pytest.raises(InvalidRobot, match=words):
        Arm.from_urdf(write_urdf(*parts))


def test_names_may_be_of_any_alphabet_and_even_of_pinocchios_own(write_urdf):
    parts = [link("universe"), link("колено"), link("手 &lt;1&gt;")]
    joints = [joint("root_joint", "universe", "колено"), joint("関節", "колено", "手 &lt;1&gt;")]
    arm = Arm.from_urdf(write_urdf(*parts, *joints, name="robö.urdf"))
    assert arm.joint_names == ("root_joint", "関節")
    assert "手 <1>" in arm.frames


def test_links_called_tool_and_base_are_those_of_the_file_and_the_arms_own_frames_have_other_names(write_urdf):
    turned = '<origin xyz="0 0 1" rpy="0 0 1.5"/>'
    parts = [link("root"), link("base"), link("tool"), link("tip"), joint("mount", "root", "base", "fixed", turned)]
    origin = '<origin xyz="1 0 0"/>'
    parts += [joint("j1", "base", "tool"), joint("j2", "tool", "tip", inside=LIMIT + origin)]
    arm = Arm.from_urdf(write_urdf(*parts))
    q = np.zeros(2)
    np.testing.assert_allclose(arm.pose(q, frame="base").matrix, Pose.from_rpy([0, 0, 1], [0, 0, 1.5]).matrix)
    np.testing.assert_allclose(arm.pose(q, frame="tool").matrix, arm.pose(q, frame="base").matrix)
    np.testing.assert_allclose(arm.pose(q).matrix, arm.pose(q, frame="tip").matrix)
    longer = arm.with_tool(Pose([0.0, 0.0, 0.5]))
    np.testing.assert_allclose(longer.pose(q, frame="<tool>").matrix, longer.pose(q).matrix)
    assert longer.pose(q).position[2] == pytest.approx(1.5)
    assert longer.pose(q, frame="tool").position[2] == pytest.approx(1.0)
    assert Arm.from_urdf(write_urdf(*parts), base="base").pose(q, frame="root").position[2] == pytest.approx(-1.0)


def test_a_path_for_a_link_called_tool_is_followed_by_that_link(write_urdf):
    parts = [link("tool"), link("a"), link("b"), joint("j1", "tool", "a")]
    arm = Arm.from_urdf(write_urdf(*parts, joint("j2", "a", "b", inside=LIMIT + '<origin xyz="1 0 0"/>')))
    path = line([0.5, 0.0, 0.0], [0.6, 0.0, 0.0], duration=1.0, samples=3)
    links = link_frames(arm, [0.0, 0.0])
    for frame, place in ({"frame": "tool"}, 0.0), ({}, 1.0):
        task = Task(path, axes="xyz", **frame)
        assert task.errors(arm, links, task.targets(path.times)[0])[0] == pytest.approx(0.5 - place)


def test_meshes_are_never_opened_and_the_network_is_never_asked(write_urdf, monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("the network was asked")

    monkeypatch.setattr(socket, "socket", refuse)
    shapes = [
        f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
        for name in ("http://example.org/a.stl", "../../../etc/passwd", "package://none/a.dae", "file:///none")
    ]
    arm = Arm.from_urdf(write_urdf(link("a"), link("b", "".join(shapes) + BODY), joint("j", "a", "b")))
    assert arm.dof == 1


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
    assert report.summary[-1].endswith("a link that all of them hang from: panda_link7, panda_link8, panda_hand")


def test_leaves_that_hang_from_the_root_alone_leave_nothing_to_propose(write_urdf):
    file = write_urdf(link("a"), link("b"), link("c"), joint("j1", "a", "b"), joint("j2", "a", "c"))
    assert check_robot(file).summary[-1] == "several leaves: name one as tip to see its chain"


@pytest.mark.parametrize("what", ["velocity", "effort"])
def test_a_zero_limit_is_a_warning_and_a_required_choice(write_urdf, what):
    limit = '<limit lower="-1" upper="1" velocity="3" effort="4"/>'.replace(
        {"velocity": '"3"', "effort": '"4"'}[what], '"0"'
    )
    file = write_urdf(*chain_of_three(inside=limit))
    report = check_robot(file)
    assert report.faults == ()
    assert any(f"joint 'j2': {what} limit must not be 0, got 0" in warning for warning in report.warnings)
    with pytest.raises(InvalidInput, match=rf"joint 'j2': {what} limit must not be 0, got 0; zero_limits='unlimited'"):
        Arm.from_urdf(file)
    arm = Arm.from_urdf(file, zero_limits="unlimited")
    limits = {"velocity": arm.velocity_limits, "effort": arm.torque_limits}[what]
    assert np.isposinf(limits[1])
    assert np.isfinite(limits[[0, 2]]).all()


def test_the_jaco_passes_our_validation():
    assert check_robot(JACO, tip="j2s6s200_end_effector").faults == ()


def test_a_urdf_is_read_and_built_without_pinocchio(monkeypatch):
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    assert check_robot(PANDA).faults == ()
    assert Arm.from_urdf(PANDA, tip="panda_hand_tcp").dof == 7
