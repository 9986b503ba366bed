"""What an arm refuses, and what its derived forms keep."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.errors import InvalidInput
from paretoik.robot.arm import Arm
from paretoik.robot.arms import marcos_nr, tringali_3r, wan_7r
from paretoik.robot.body import Body, combine_bodies, inertia_fault, transform_body
from paretoik.robot.dynamics import inverse_dynamics
from paretoik.robot.kinematics import forward_kinematics, jacobian
from paretoik.robot.pose import Pose

DH = {"a": [0.1, 0.2], "alpha": [0.0, 1.0], "d": [0.0, 0.1], "theta": [0.0, 0.0], "convention": "modified"}


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Arm.planar(lengths=[1.0, 0.0]), "lengths wants positive"),
        (lambda: Arm.planar(lengths=[]), "at least one moving joint"),
        (lambda: Arm.planar(lengths=[1.0, np.nan]), "lengths wants a list of finite numbers"),
        (lambda: Arm.planar(lengths=[1.0], masses=[1.0, 2.0]), "masses wants 1 finite"),
        (lambda: Arm.planar(lengths=[1.0], masses=[-1.0]), "must not be negative"),
        (lambda: Arm.planar(lengths=[1.0], position_limits=(1.0, -1.0)), "position_limits of joint 1: wants lower"),
        (lambda: Arm.planar(lengths=[1.0], position_limits=[1.0, 2.0]), "position_limits wants one value or 1"),
        (lambda: Arm.planar(lengths=[1.0], velocity_limits=0.0), "velocity_limits wants positive"),
        (lambda: Arm.planar(lengths=[1.0], torque_limits=[np.nan]), "torque_limits wants positive"),
        (lambda: Arm.from_dh(**{**DH, "convention": "craig"}), "convention must be"),
        (lambda: Arm.from_dh(**{**DH, "d": [0.0]}), "d wants 2 finite"),
        (lambda: Arm.from_dh(**DH, types=["revolute"]), "types wants 2"),
        (lambda: Arm.from_dh(**DH, types=["revolute", "planar"]), "joint type must be one of"),
        (lambda: Arm.from_dh(**DH, joint_names=["a", "a"]), "joint names must differ"),
        (lambda: Arm.from_dh(**DH, joint_names=["a"]), "joint_names wants 2"),
        (lambda: Arm.from_dh(**DH, masses=[1.0, 1.0], centers=np.zeros((1, 3))), "centers and inertias want shapes"),
        (lambda: Arm.from_dh(**DH, masses=[1.0, -1.0]), "link 2: mass must be"),
        (lambda: tringali_3r("guessed"), "masses must be 'printed' or 'fitted', got 'guessed'"),
        (lambda: marcos_nr(5), "links must be 3 or 4, got 5"),
        (lambda: tringali_3r().fixed(joint9=0.0), "joint 'joint9' is not on"),
        (lambda: tringali_3r().fixed(joint1=np.inf), "joint joint1: wants a finite value"),
        (lambda: tringali_3r().fixed(joint1=0, joint2=0, joint3=0), "last moving joint"),
        (lambda: tringali_3r().mounted(gravity=(0.0, 9.81)), "gravity wants three"),
        (lambda: tringali_3r().with_payload(np.nan), "payload: mass must be a finite number"),
        (lambda: tringali_3r().with_payload(1.0, center=(0.0, 0.0)), "payload: centre of gravity"),
        (lambda: tringali_3r().with_payload(1.0, inertia=np.diag([1.0, 1.0, 3.0])), "triangle inequality"),
        (lambda: tringali_3r().frame("hand"), "frame 'hand' is not on"),
        (lambda: jacobian(tringali_3r(), np.zeros((4, 2))), r"has 3 joints; got an array of shape \(4, 2\)"),
        (lambda: inverse_dynamics(tringali_3r(), *[np.zeros(3)] * 2, np.zeros((2, 3))), "must have one shape"),
    ],
)
def test_bad_input_is_refused_in_one_line_with_name_and_value(make, words):
    with pytest.raises(InvalidInput, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_limits_given_as_number_array_or_pair_become_rows():
    arm = Arm.planar(lengths=[1.0, 1.0], position_limits=([-1.0, -2.0], 3.0), velocity_limits=2.0)
    assert arm.position_limits.tolist() == [[-1.0, 3.0], [-2.0, 3.0]]
    assert arm.velocity_limits.tolist() == [2.0, 2.0]
    assert np.isposinf(arm.torque_limits).all()


def test_an_arm_cannot_be_changed():
    arm = tringali_3r()
    with pytest.raises(AttributeError):
        arm.name = "other"
    with pytest.raises(ValueError, match="read-only"):
        arm.position_limits[0, 0] = 0.0


def test_fixing_a_joint_keeps_the_other_joints_limits_and_names():
    arm = tringali_3r().fixed(joint2=0.5)
    assert arm.joint_names == ("joint1", "joint3")
    assert arm.position_limits == pytest.approx(tringali_3r().position_limits[[0, 2]])


def test_turning_joints_are_periodic_and_sliding_ones_are_not():
    assert Arm.from_dh(**DH, types=["continuous", "prismatic"]).periodic.tolist() == [True, False]


@pytest.mark.parametrize(
    ("inertia", "words"),
    [
        (np.diag([1.0, 2.0, 2.5]), None),
        (np.diag([1.0, 1.0, 2.0]), None),
        (np.diag([1e-25, 1e-25, 1e-20]), None),
        (np.diag([-1.0, 2.0, 2.0]), "positive"),
        (np.diag([1.0, 1.0, 2.1]), "triangle"),
        (np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), "symmetric"),
    ],
)
def test_only_the_inertia_of_a_real_body_passes(inertia, words):
    fault = inertia_fault(inertia)
    assert fault is None if words is None else words in fault


def test_two_bodies_merged_in_any_order_or_frame_are_one():
    rng = np.random.default_rng(0)
    first, second = (Body(mass=m, center=rng.normal(size=3), inertia=np.diag([1.0, 2.0, 2.5])) for m in (1.0, 2.0))
    pose = Pose(rng.normal(size=3), np.array([0.5, 0.5, -0.5, 0.5]))
    whole = transform_body(combine_bodies(first, second), pose)
    again = combine_bodies(transform_body(second, pose), transform_body(first, pose))
    assert whole.pseudo_inertia == pytest.approx(again.pseudo_inertia, abs=1e-13)
    assert whole.mass == 3.0


def test_massless_bodies_merge_without_dividing_by_zero():
    none = Body(mass=0.0, center=np.zeros(3), inertia=np.zeros((3, 3)))
    assert combine_bodies(none, none).mass == 0.0


def test_the_papers_start_is_within_reach_of_the_tringali_arm_at_the_printed_place():
    # Tringali & Cocuzza 2020, section 3.2: both trajectories start at (0.4678, 0) m, 2.2 cm inside of full reach.
    arm = tringali_3r()
    assert forward_kinematics(arm, np.zeros(3))[1] == pytest.approx([0.4895, 0.0, 0.0])
    assert np.linalg.norm([0.4678, 0.0]) < 0.4895
    assert [body.mass for body in arm.bodies] == [0.615, 0.615, 0.307]


def test_the_marcos_arm_has_unit_links():
    assert forward_kinematics(marcos_nr(4), np.zeros(4))[1] == pytest.approx([4.0, 0.0, 0.0])
    assert forward_kinematics(marcos_nr(), np.array([np.pi / 2, 0.0, 0.0]))[1] == pytest.approx([0.0, 3.0, 0.0])


def test_the_wan_arm_at_zero_stands_where_its_table_says():
    # By hand from Table 1: the joints' z axes at q = 0 are z, -y, -z, -z, -z, y and z of the base.
    position = forward_kinematics(wan_7r(), np.zeros(7))[1]
    assert position == pytest.approx([0.45 + 0.4, 0.2975 + 0.197, 0.3555 + 0.293 - 0.255 + 0.104], abs=1e-12)
    assert wan_7r().position_limits[1] == pytest.approx(np.deg2rad([-33, 150]))
