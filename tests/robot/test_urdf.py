"""URDFs: the report, and the arm, which agrees with Pinocchio's reading of the same text."""

from __future__ import annotations

import socket
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.robot.arm import Arm
from paretoik.robot.body import inertia_fault, nearest_inertia
from paretoik.robot.dynamics import gravity_torques
from paretoik.robot.pose import Pose
from paretoik.robot.urdf import check_robot
from paretoik.task.limits import Limits
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


@settings(max_examples=5)
@given(seed=st.integers(0, 10**9))
def test_every_link_and_torque_of_random_chains_is_that_of_pinocchio(tmp_path_factory, seed):
    check_random_robot(tmp_path_factory.getbasetemp(), seed)


def test_every_urdf_of_the_repository_has_a_tip_here():
    root = Path(__file__).parents[2]
    assert set(FILES) == {*(root / "problems" / "robots").glob("*.urdf"), *(root / "tests" / "robots").glob("*.urdf")}


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_chains_of_the_repositorys_robots_are_those_that_pinocchio_reads(file):
    tally = Tally()
    compare_file(file, tally, np.random.default_rng(1), leaves=2, pairs=4)
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


def test_a_report_without_a_tip_names_the_leaves_to_choose_from():
    report = check_robot(PANDA)
    assert report.faults == ()
    assert "root panda_link0, leaves panda_hand_tcp, panda_leftfinger, panda_rightfinger" in report.summary
    assert report.summary[-1].endswith("a link that carries them all: panda_link7, panda_link8, panda_hand")


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


# The chain of a URDF: moving joints, frozen joints, and messages about them


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, "tip must be one of the leaves panda_hand_tcp, panda_leftfinger, panda_rightfinger, got none"),
        (
            {"base": "panda_hand", "tip": "panda_link3"},
            "base must be an ancestor of the tip 'panda_link3', got 'panda_hand'",
        ),
        ({"tip": "panda_hand", "fixed": {"elbow": 0.0}}, "fixed must name joints among panda_joint1, .*, got 'elbow'"),
    ],
)
def test_unknown_names_and_values_are_refused(options, words):
    with pytest.raises(InvalidInput, match=words):
        Arm.from_urdf(PANDA, **options)


@pytest.mark.parametrize("kind", ["planar", "floating"])
def test_joints_with_several_freedoms_are_refused_by_name_on_the_chain_only(write_urdf, kind):
    with pytest.raises(
        InvalidRobot,
        match=f"joint 'j2': must have one degree of freedom of its own on the chain from base to tip, got a {kind}",
    ):
        Arm.from_urdf(write_urdf(*chain_of_three(kind, "")))
    arm = Arm.from_urdf(write_urdf(*chain_of_three(), link("e"), joint("side", "a", "e", kind, "")), tip="d")
    assert arm.dof == 3
    assert any(f"'side': off the chain, frozen at zero {kind} motion" in notice for notice in arm.notices)


def test_a_mimic_joint_is_refused_by_name_on_the_chain_unless_it_or_its_leader_is_fixed(write_urdf):
    file = write_urdf(*chain_of_three(inside=LIMIT + '<mimic joint="j1" multiplier="-2" offset="0.25"/>'))
    with pytest.raises(
        InvalidRobot, match=r"joint 'j2': must have one degree of freedom of its own on the chain .*, got a mimic"
    ):
        Arm.from_urdf(file)
    assert Arm.from_urdf(file, fixed={"j2": 0.5}).joint_names == ("j1", "j3")
    arm = Arm.from_urdf(file, fixed={"j1": 0.5})
    assert arm.joint_names == ("j3",)
    assert "joint 'j2': on the chain, frozen at -0.75 rad" in arm.notices


def test_a_massless_moving_link_is_told_and_serves_kinematics_alone(write_urdf):
    parts = chain_of_three()
    parts[2] = link("c", "")
    arm = Arm.from_urdf(write_urdf(*parts))
    words = "joint 'j2': its link has no mass, though other joints follow: torques and energies are refused"
    assert words in arm.notices
    assert lacks_masses(arm)
    arm = Arm.from_urdf(write_urdf(*chain_of_three(last="")))
    assert "joint 'j3': its link has no mass" in arm.notices
    assert arm.bodies[2].mass == 0.0
    assert not lacks_masses(arm)


def test_gravity_points_down_in_the_world_of_the_root_for_a_base_on_a_tilted_mount(write_urdf):
    mount = joint("mount", "world", "a", "fixed", '<origin rpy="1.5707963267948966 0 0"/>')
    lever = BODY.replace("<mass", '<origin xyz="0.6 0 0"/><mass')
    swing = joint("j", "a", "b", inside=LIMIT + '<axis xyz="0 0 1"/>')
    arm = Arm.from_urdf(write_urdf(link("world"), link("a"), link("b", lever), mount, swing), base="a")
    assert gravity_torques(arm, np.zeros((1, 1)))[0] == pytest.approx([5.886])
    assert any("base 'a' is tilted relative to the root 'world': gravity is (" in notice for notice in arm.notices)


def test_limits_of_urdf_1_2_are_the_arms_and_those_of_jerk_are_told(write_urdf):
    limit = LIMIT.replace("/>", ' acceleration="7" deceleration="5" jerk="90"/>')
    arm = Arm.from_urdf(write_urdf(*chain_of_three(inside=limit)))
    assert arm.acceleration_limits.tolist() == [np.inf, 5.0, np.inf]
    assert arm.jerk_limits.tolist() == [np.inf, 90.0, np.inf]
    assert any("jerk limits of 1 joints (first: 'j2') do not limit motions" in notice for notice in arm.notices)
    assert Limits().bounds(arm, 3)["acceleration"][0, 1].tolist() == [-5.0, 5.0]
    assert Limits(acceleration=np.inf).bounds(arm, 3).keys() == {"position", "velocity", "torque"}
    assert arm.fixed(j1=0.0).acceleration_limits.tolist() == [5.0, np.inf]


def test_soft_limits_are_told_or_taken(write_urdf):
    soft = '<safety_controller soft_lower_limit="-0.5" soft_upper_limit="9" k_velocity="1"/>'
    file = write_urdf(*chain_of_three(inside=LIMIT + soft))
    arm, safe = Arm.from_urdf(file), Arm.from_urdf(file, soft=True)
    assert arm.position_limits[1].tolist() == [-1.0, 2.0]
    assert "soft limits of 1 joints (first: 'j2') are not used: soft=True uses them" in arm.notices
    assert safe.position_limits[1].tolist() == [-0.5, 2.0]
    assert not any("soft" in notice for notice in safe.notices)
    apart = write_urdf(*chain_of_three(inside=LIMIT + soft.replace('"-0.5"', '"3"')))
    assert Arm.from_urdf(apart).dof == 3
    with pytest.raises(InvalidRobot, match="joint 'j2': soft limits must overlap its limits"):
        Arm.from_urdf(apart, soft=True)
    assert check_robot(apart, soft=True).faults
    gains = write_urdf(*chain_of_three(inside=LIMIT + '<safety_controller k_velocity="1"/>'))
    assert not any("soft" in notice for notice in Arm.from_urdf(gains).notices)


WRONG = BODY.replace('izz="1"', 'izz="9"')


@pytest.mark.parametrize(
    ("parent", "moved", "taken"),
    [("a", 0.0, "no joint moves it, left out"), ("d", 1.0, "off the chain, taken as a point mass")],
)
def test_an_antenna_with_a_wrong_inertia_is_a_point_mass_and_is_told(write_urdf, parent, moved, taken):
    parts = [*chain_of_three(), link("antenna", WRONG), joint("mast", parent, "antenna", "fixed", "")]
    file = write_urdf(*parts)
    arm = Arm.from_urdf(file, tip="d")
    words = "link 'antenna': inertia must satisfy the triangle inequality"
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
        "joint 'rope': origin xyz must be 3 numbers, got '0 0'; off the chain, left out with all that it carries",
    ):
        assert any(words in warning for warning in report.warnings), words
    for tip in ("camera", "mast", "flag", "finger", "thumb"):
        assert check_robot(file, tip=tip).faults
        with pytest.raises(InvalidRobot):
            Arm.from_urdf(file, tip=tip)


@pytest.mark.parametrize("moments", [(1, 1, 9), (-1, 2, 2)])
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
