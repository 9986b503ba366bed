"""URDFs: the report, and the arm, which agrees with Pinocchio's reading of the same text."""

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
from paretoik.robot.body import inertia_fault, nearest_inertia
from paretoik.robot.dynamics import gravity_torques, inverse_dynamics
from paretoik.robot.kinematics import forward_kinematics, link_frames
from paretoik.robot.pose import Pose
from paretoik.robot.urdf import RobotReport, check_robot, report_text
from paretoik.robot.urdf_description import group_messages
from paretoik.task.limits import Limits
from paretoik.task.path import line
from paretoik.task.task import Task
from paretoik.task.validation import lacks_masses
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
    assert all(reason.startswith("a joint between") for reason in tally.refusals)
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
        ('<origin xyz="1e308 0 0"/>', "joint 'k': origin xyz must be at most"),
        ('<origin xyz="9e49 0 0"/>', "the robot: pose position must be at most"),
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


# The chain of a URDF: moving joints, frozen joints, and messages about them


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, "tip must be one of the leaves panda_hand_tcp, panda_leftfinger, panda_rightfinger, got none"),
        ({"tip": "hand"}, "tip must be one of panda_link0, .*, got 'hand'"),
        ({"base": "foot", "tip": "panda_hand"}, "base must be one of panda_link0, .*, got 'foot'"),
        (
            {"base": "panda_hand", "tip": "panda_link3"},
            "base must be a link that carries the tip 'panda_link3', got 'panda_hand'",
        ),
        ({"tip": "panda_hand", "fixed": {"elbow": 0.0}}, "fixed must name joints among panda_joint1, .*, got 'elbow'"),
        ({"tip": "panda_hand", "fixed": {"panda_joint1": np.nan}}, "joint 'panda_joint1': must be finite"),
        ({"tip": "panda_hand", "zero_limits": "ignore"}, "zero_limits must be one of None, unlimited, got 'ignore'"),
    ],
)
def test_unknown_names_and_values_are_refused(options, words):
    with pytest.raises(InvalidInput, match=words):
        Arm.from_urdf(PANDA, **options)


def test_joints_fixed_on_loading_are_the_whole_arm_held_there(panda_arm):
    held = Arm.from_urdf(PANDA, tip="panda_hand_tcp", fixed={"panda_joint3": 0.4})
    assert held.joint_names == tuple(f"panda_joint{i}" for i in (1, 2, 4, 5, 6, 7))
    q = np.random.default_rng(1).normal(size=(3, 4, 6))
    other = panda_arm.fixed(panda_joint3=0.4)
    assert inverse_dynamics(held, *q) == pytest.approx(inverse_dynamics(other, *q), rel=1e-12, abs=1e-12)
    assert any("'panda_joint3': on the chain, frozen at 0.4 rad" in notice for notice in held.notices)


def test_a_mimic_joint_off_the_chain_follows_its_frozen_leader():
    arm = Arm.from_urdf(PANDA, tip="panda_hand_tcp", fixed={"panda_finger_joint1": 0.03})
    left, right = (forward_kinematics(arm, np.zeros(7), f"panda_{side}finger")[1] for side in ("left", "right"))
    assert np.linalg.norm(left - right) == pytest.approx(0.06)


def test_a_base_above_the_root_leaves_out_what_is_before_it(panda_arm):
    arm = Arm.from_urdf(PANDA, base="panda_link2", tip="panda_hand_tcp")
    assert arm.joint_names == panda_arm.joint_names[2:]
    assert any("what is above it is left out" in notice for notice in arm.notices)
    q = np.random.default_rng(2).normal(size=5)
    whole = forward_kinematics(panda_arm, np.array([0.0, 0.0, *q]))[1]
    frame = forward_kinematics(panda_arm, np.zeros(7), "panda_link2")
    assert frame[1] + frame[0] @ forward_kinematics(arm, q)[1] == pytest.approx(whole)


@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_joints_with_several_freedoms_are_refused_by_name_on_the_chain_only(write_urdf, kind):
    with pytest.raises(
        InvalidRobot,
        match=f"joint 'j2': must have one freedom of its own on the chain from base to tip, got a {kind}",
    ):
        Arm.from_urdf(write_urdf(*chain_of_three(kind, "")))
    arm = Arm.from_urdf(write_urdf(*chain_of_three(), link("e"), joint("side", "a", "e", kind, "")), tip="d")
    assert arm.dof == 3
    assert any(f"'side': off the chain, frozen where its {kind} motion is zero" in notice for notice in arm.notices)


def test_a_mimic_joint_is_refused_by_name_on_the_chain_unless_it_or_its_leader_is_fixed(write_urdf):
    file = write_urdf(*chain_of_three(inside=LIMIT + '<mimic joint="j1" multiplier="-2" offset="0.25"/>'))
    with pytest.raises(
        InvalidRobot, match=r"joint 'j2': must have one freedom of its own on the chain .*, got a mimic"
    ):
        Arm.from_urdf(file)
    assert Arm.from_urdf(file, fixed={"j2": 0.5}).joint_names == ("j1", "j3")
    arm = Arm.from_urdf(file, fixed={"j1": 0.5})
    assert arm.joint_names == ("j3",)
    assert "joint 'j2': on the chain, frozen at -0.75 rad" in arm.notices


def test_a_frozen_joint_that_mimics_a_moving_one_is_told(write_urdf):
    parts = [*chain_of_three(), link("e"), joint("side", "d", "e", inside=LIMIT + '<mimic joint="j1" offset="0.25"/>')]
    arm = Arm.from_urdf(write_urdf(*parts), tip="d")
    assert "joint 'side': off the chain, frozen at 0.25 rad, though it mimics 'j1'" in arm.notices


def test_a_frozen_joint_outside_its_limits_is_told(write_urdf):
    limit = '<limit lower="0.1" upper="1" velocity="1" effort="1"/>'
    arm = Arm.from_urdf(write_urdf(*chain_of_three(), link("e"), joint("side", "d", "e", inside=limit)), tip="d")
    assert "joint 'side': off the chain, frozen at 0 rad, outside its limits" in arm.notices


def test_a_massless_moving_link_is_told_and_serves_kinematics_alone(write_urdf):
    parts = chain_of_three()
    parts[2] = link("c", "")
    arm = Arm.from_urdf(write_urdf(*parts))
    assert (
        "joint 'j2': moves no mass, though other joints follow it: no torques and energies of this arm" in arm.notices
    )
    assert lacks_masses(arm)
    arm = Arm.from_urdf(write_urdf(*chain_of_three(last="")))
    assert "joint 'j3': moves no mass" in arm.notices
    assert arm.bodies[2].mass == 0.0
    assert not lacks_masses(arm)


def test_gravity_points_down_in_the_world_of_the_root_for_a_base_on_a_tilted_mount(write_urdf):
    mount = joint("mount", "world", "a", "fixed", '<origin rpy="1.5707963267948966 0 0"/>')
    lever = BODY.replace("<mass", '<origin xyz="0.6 0 0"/><mass')
    swing = joint("j", "a", "b", inside=LIMIT + '<axis xyz="0 0 1"/>')
    arm = Arm.from_urdf(write_urdf(link("world"), link("a"), link("b", lever), mount, swing), base="a")
    assert gravity_torques(arm, np.zeros((1, 1)))[0] == pytest.approx([5.886])
    assert any("base 'a' is tilted against the root 'world': gravity is (" in notice for notice in arm.notices)


def test_limits_of_urdf_1_2_are_the_arms_and_those_of_jerk_are_told(write_urdf):
    limit = LIMIT.replace("/>", ' acceleration="7" deceleration="5" jerk="90"/>')
    arm = Arm.from_urdf(write_urdf(*chain_of_three(inside=limit)))
    assert arm.acceleration_limits.tolist() == [np.inf, 5.0, np.inf]
    assert arm.jerk_limits.tolist() == [np.inf, 90.0, np.inf]
    assert any("jerk limits of 1 joints, from 'j2' on, do not bind motions" in notice for notice in arm.notices)
    assert Limits().bounds(arm, 3)["acceleration"][0, 1].tolist() == [-5.0, 5.0]
    assert Limits(acceleration=np.inf).bounds(arm, 3).keys() == {"position", "velocity", "torque"}
    assert arm.fixed(j1=0.0).acceleration_limits.tolist() == [5.0, np.inf]


def test_soft_limits_are_told_or_taken(write_urdf):
    soft = '<safety_controller soft_lower_limit="-0.5" soft_upper_limit="9" k_velocity="1"/>'
    file = write_urdf(*chain_of_three(inside=LIMIT + soft))
    arm, safe = Arm.from_urdf(file), Arm.from_urdf(file, soft=True)
    assert arm.position_limits[1].tolist() == [-1.0, 2.0]
    assert "soft limits of 1 joints, from 'j2' on, are not used: soft=True uses them" in arm.notices
    assert safe.position_limits[1].tolist() == [-0.5, 2.0]
    assert not any("soft" in notice for notice in safe.notices)
    apart = write_urdf(*chain_of_three(inside=LIMIT + soft.replace('"-0.5"', '"3"')))
    assert Arm.from_urdf(apart).dof == 3
    with pytest.raises(InvalidRobot, match="joint 'j2': soft limits must overlap its limits"):
        Arm.from_urdf(apart, soft=True)
    assert check_robot(apart, soft=True).faults
    gains = write_urdf(*chain_of_three(inside=LIMIT + '<safety_controller k_velocity="1"/>'))
    assert not any("soft" in notice for notice in Arm.from_urdf(gains).notices)


def test_a_quaternion_in_a_file_of_urdf_1_0_is_read_and_told(write_urdf):
    turn = '<origin quat_xyzw="0 0 2 2"/>'
    file = write_urdf(*chain_of_three(inside=LIMIT + turn))
    assert Arm.from_urdf(file).pose(np.zeros(3)).rotation[:2, 0] == pytest.approx([0.0, 1.0])
    told = [warning for warning in check_robot(file).warnings if "quat_xyzw" in warning]
    assert len(told) == 2
    assert "quat_xyzw is of URDF 1.1" in told[0]
    assert "quat_xyzw has length 2.82843" in told[1]


def test_a_chain_without_a_moving_joint_is_refused(write_urdf):
    file = write_urdf(link("a"), link("b"), joint("j", "a", "b", "fixed", ""))
    with pytest.raises(InvalidRobot, match="a joint between 'a' and 'b' must move"):
        Arm.from_urdf(file)


WRONG = BODY.replace('izz="1"', 'izz="9"')


@pytest.mark.parametrize(
    ("parent", "moved", "taken"),
    [("a", 0.0, "no joint moves it, left out"), ("d", 1.0, "off the chain, taken as a point mass")],
)
def test_an_antenna_with_a_wrong_inertia_is_a_point_mass_and_is_told(write_urdf, parent, moved, taken):
    parts = [*chain_of_three(), link("antenna", WRONG), joint("mast", parent, "antenna", "fixed", "")]
    file = write_urdf(*parts)
    arm = Arm.from_urdf(file, tip="d")
    words = "link 'antenna': inertia must keep the triangle inequality"
    assert next(notice for notice in arm.notices if words in notice).endswith(f"; {taken}")
    assert arm.bodies[2].mass == 1.0 + moved
    np.testing.assert_array_equal(arm.bodies[2].inertia, np.eye(3))
    report = check_robot(file, tip="d")
    assert report.faults == ()
    assert any(words in warning for warning in report.warnings)
    if parent == "d":
        assert any(words in fault for fault in check_robot(file).faults)  # it is the only leaf, and so the tip
        with pytest.raises(InvalidRobot, match=words):
            Arm.from_urdf(file, tip="antenna")


@pytest.mark.parametrize("frozen", [False, True])
def test_a_link_that_no_joint_moves_may_have_any_inertia(write_urdf, frozen):
    mount = joint("mount", "world", "a", "revolute" if frozen else "fixed")
    right = write_urdf(link("world"), mount, *chain_of_three(), name="right.urdf")
    wrong = write_urdf(link("world", WRONG), mount, *chain_of_three(), name="wrong.urdf")
    options = {"tip": "d", "fixed": {"mount": 0.3} if frozen else None}
    arm, other = Arm.from_urdf(wrong, **options), Arm.from_urdf(right, **options)
    words = "link 'world': inertia must keep the triangle inequality"
    assert next(notice for notice in arm.notices if words in notice).endswith("; no joint moves it, left out")
    q = np.random.default_rng(3).normal(size=(3, 3))
    np.testing.assert_array_equal(inverse_dynamics(arm, *q), inverse_dynamics(other, *q))
    with pytest.raises(InvalidRobot, match="link 'd': inertia must keep the triangle inequality"):
        Arm.from_urdf(write_urdf(*chain_of_three(last=WRONG)), tip="d")


def test_without_a_tip_faults_are_those_of_every_chain_and_others_are_warnings(write_urdf):
    hands = [link("e", WRONG), link("f", WRONG), joint("k", "d", "e"), joint("m", "d", "f", inside="")]
    report = check_robot(write_urdf(*chain_of_three(), *hands))
    assert report.faults == ()
    assert [warning.split("'")[1] for warning in report.warnings] == ["e", "f", "m"]
    assert all(warning.endswith("; it matters on a chain that it is on") for warning in report.warnings)
    with pytest.raises(InvalidRobot, match="link 'e': inertia must keep"):
        Arm.from_urdf(report.file, tip="e")
    parts = chain_of_three()
    parts[2] = link("c", WRONG)
    assert [fault.split("'")[1] for fault in check_robot(write_urdf(*parts, *hands)).faults] == ["c"]


def test_faults_of_parts_off_the_chain_are_warnings_that_say_what_becomes_of_them(write_urdf):
    heavy = BODY.replace('value="1"', 'value="heavy"')
    away = '<origin xyz="0 0"/>'
    parts = [
        *chain_of_three(),
        link("camera", heavy),
        link("mast"),
        link("flag"),
        joint("lens", "d", "camera", "fixed"),
    ]
    parts += [joint("ball", "c", "mast", "ball", ""), joint("rope", "mast", "flag", inside=away)]
    parts += [
        link("finger"),
        link("thumb"),
        joint("f", "d", "finger", inside=LIMIT + '<mimic joint="x" offset="0.2"/>'),
    ]
    parts += [joint("t", "d", "thumb", inside=LIMIT + '<mimic joint="t" multiplier="2"/>')]
    file = write_urdf(*parts)
    arm, report = Arm.from_urdf(file, tip="d"), check_robot(file, tip="d")
    assert report.faults == ()
    assert {*arm.notices} <= {*report.warnings}
    assert arm.bodies[2].mass == 3.0  # with finger and thumb, without the camera
    assert "mast" in arm.frames
    assert "flag" not in arm.frames
    assert "joint 'f': off the chain, frozen at 0.2 rad" in arm.notices
    for words in (
        "link 'camera': mass value must be a number, got 'heavy'; off the chain, left out",
        "joint 'ball': type must be one of",
        "joint 'f': must mimic a joint of the robot, got 'x'; off the chain, frozen",
        "joint 't': must mimic another joint, got itself; off the chain, frozen",
        "joint 'rope': origin xyz must be 3 numbers, got '0 0'; off the chain, with all that it carries, left out",
    ):
        assert any(words in warning for warning in report.warnings), words
    for tip in ("camera", "mast", "flag", "finger", "thumb"):
        assert check_robot(file, tip=tip).faults
        with pytest.raises(InvalidRobot):
            Arm.from_urdf(file, tip=tip)


def test_macros_in_shapes_are_a_warning_and_others_a_fault_of_what_they_are_in(write_urdf):
    shape = '<visual><xacro:mesh name="x"/></visual>'
    parts = [*chain_of_three(last=shape + BODY), link("e", "<xacro:block/>"), joint("k", "c", "e", "fixed", "")]
    file = write_urdf(*parts)
    report = check_robot(file, tip="d")
    assert report.faults == ()
    assert any("1 macros of xacro, in parts that are not read" in warning for warning in report.warnings)
    assert Arm.from_urdf(file, tip="d").dof == 3
    assert "must be expanded by xacro, got the macro <xacro:block>" in check_robot(file, tip="e").faults[0]


def test_a_light_link_with_a_wrong_inertia_is_judged_by_the_body_that_it_is_a_part_of(write_urdf):
    light = BODY.replace('"1"', '"1e-8"').replace('izz="1e-8"', 'izz="9e-8"')
    parts = [*chain_of_three(), link("sticker", light), joint("glue", "d", "sticker", "fixed", "")]
    arm = Arm.from_urdf(write_urdf(*parts))
    assert any("link 'sticker': inertia must keep" in notice and "has a real one" in notice for notice in arm.notices)
    moments = np.linalg.eigvalsh(arm.bodies[2].inertia)
    np.testing.assert_allclose(moments, [1 + 1e-8, 1 + 1e-8, 1 + 9e-8], rtol=1e-15)


@pytest.mark.parametrize("moments", [(1, 1, 9), (-1, 2, 2), (-1, -1, -1)])
def test_a_repaired_inertia_is_that_of_a_real_body_and_is_told(write_urdf, moments):
    xx, yy, zz = moments
    body = f'<inertial><mass value="1"/><inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/></inertial>'
    file = write_urdf(*chain_of_three(last=body))
    with pytest.raises(InvalidRobot, match="repair_inertias=True"):
        Arm.from_urdf(file)
    arm = Arm.from_urdf(file, repair_inertias=True)
    assert inertia_fault(arm.bodies[2].inertia) is None
    told = [notice for notice in arm.notices if "link 'd': inertia must" in notice]
    assert len(told) == 1
    expected = np.sort(np.diag(nearest_inertia(np.diag(np.array(moments, float)))))
    assert told[0].endswith("now {:.4g}, {:.4g} and {:.4g} kg m²".format(*expected))
    assert told[0] in check_robot(file, repair_inertias=True).warnings
    assert check_robot(file, repair_inertias=True).faults == ()


def test_every_fault_of_a_file_that_is_no_tree_is_listed_wherever_it_is(write_urdf):
    parts = [*chain_of_three(), link("antenna", WRONG), link("e", "<inertial/>"), link("alone")]
    file = write_urdf(*parts, joint("k", "d", "e", "fixed", ""), joint("mast", "a", "antenna", "fixed", ""))
    with pytest.raises(InvalidRobot) as refused:
        Arm.from_urdf(file, tip="d")
    assert any("triangle" in fault for fault in refused.value.faults)
    assert any("<mass>" in fault for fault in refused.value.faults)


def test_very_many_warnings_are_grouped_before_they_are_counted(write_urdf):
    parts = [
        part
        for number in range(150)
        for part in (link(f"plate{number}", WRONG), joint(f"k{number}", "a", f"plate{number}", "fixed", ""))
    ]
    report = check_robot(write_urdf(*chain_of_three(), *parts), tip="d")
    assert len([warning for warning in report.warnings if "triangle" in warning]) == 150
    (line,) = [line for line in report_text(report).splitlines() if line.startswith("warning")]
    assert line.startswith("warning: each of 150 links, 'plate0', 'plate1', 'plate2' and 147 more: inertia must keep")


def test_of_very_many_warnings_that_differ_the_first_hundred_are_in_the_text():
    warnings = tuple(f"line {number}: warning {number}" for number in range(130))
    text = report_text(RobotReport(file=Path("r.urdf"), faults=(), warnings=warnings, summary=()))
    assert text.splitlines()[99:] == ["warning: line 99: warning 99", "warning: and 30 more", "no faults"]


def test_equal_messages_of_no_link_or_joint_are_one():
    several = ["line 2: friction is not modelled"] * 2
    assert group_messages(several) == several[:1]
    assert group_messages([*several, "joint 'a': moves no mass", *several, "joint 'b': moves no mass"]) == [
        several[0],
        "each of 2 joints, 'a' and 'b': moves no mass",
    ]


def test_what_is_said_alike_of_several_links_is_one_line_of_the_report_and_each_a_warning_of_it(write_urdf):
    names = [f"antenna{number}" for number in range(5)]
    parts = [part for name in names for part in (link(name, WRONG), joint(f"mast_{name}", "a", name, "fixed", ""))]
    report = check_robot(write_urdf(*chain_of_three(), *parts), tip="d")
    assert [warning.split("'")[1] for warning in report.warnings] == names
    assert [line for line in report_text(report).splitlines() if line.startswith("warning")] == [
        "warning: each of 5 links, 'antenna0', 'antenna1', 'antenna2' and 2 more: inertia must keep the triangle "
        "inequality, got principal moments 1, 1 and 9 kg m²; no joint moves it, left out"
    ]
