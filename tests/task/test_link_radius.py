"""One radius of all links, or one per link: in clearances, derivatives, the compiled search, verification and texts."""

from __future__ import annotations

import re

import numpy as np
import pytest

import paretoik as pk
from paretoik.autodiff.differentiation import gradient
from paretoik.autodiff.evaluator import compile_evaluator
from paretoik.autodiff.tape import as_entry
from paretoik.closed_loop.admissible_steps import evaluate_distances
from paretoik.closed_loop.programs import required_distance, tabulate, trace_nodes
from paretoik.collision.obstacles import closest_pair, signed_distance
from paretoik.errors import InvalidInput
from paretoik.robot.kinematics import link_nodes
from paretoik.runs.fingerprint import fingerprint
from paretoik.task.traced_motion import trace_sample
from paretoik.verification.measured_motion import clearances, nearest_pair
from problems import marcos_2012
from tests.closed_loop.postures import posture

ARM = pk.arms.tringali_3r()
PATH = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=5)
OBSTACLES = [
    pk.obstacles.HalfSpace([0.0, -0.6], [0.1, 1.0], name="floor"),
    pk.obstacles.Circle([0.5, 0.4], 0.05, name="post"),
    pk.obstacles.Capsule([-0.4, 0.2, 0.1], [-0.4, 0.5, 0.0], 0.05),
    pk.obstacles.Box(pk.Pose.planar(-0.3, -0.4, 0.3), [0.1, 0.05]),
]
RADII = [0.0, 0.03, 0.01, 0.02]


def tracking(radius, **more):
    return pk.Tracking(ARM, PATH, objectives=[pk.kinetic_energy], obstacles=OBSTACLES, link_radius=radius, **more)


def postures(count=200):
    return np.random.default_rng(0).uniform(-2.0, 2.0, (count, 1, 3)).repeat(3, axis=1)


def motion(radius, q=None):
    q = postures() if q is None else q
    return pk.Motion(arm=ARM, time=np.arange(3.0), q=q, obstacles=tuple(OBSTACLES), link_radius=radius)


def test_clearance_is_the_least_distance_of_a_link_less_its_own_radius():
    nodes = motion(RADII).links
    least = np.full(nodes.shape[:2], np.inf)
    for obstacle in OBSTACLES:
        for link, radius in enumerate(RADII):
            distance = signed_distance(obstacle, nodes[..., link, :], nodes[..., link + 1, :])
            least = np.minimum(least, distance - radius)
    np.testing.assert_array_equal(motion(RADII).clearance, least)
    assert (motion(RADII).clearance != motion(max(RADII)).clearance).mean() > 0.2
    assert (motion(RADII).clearance >= motion(max(RADII)).clearance).all()


def test_equal_radii_are_the_same_as_one_number_bit_for_bit():
    np.testing.assert_array_equal(motion([0.02] * 4).clearance, motion(0.02).clearance)


def test_traced_clearances_and_their_gradients_are_those_of_the_motion():
    traced = trace_sample(tracking(RADII).task)
    tape = traced.trace.tape
    value = as_entry(tape, traced.clearance.entries)
    slopes = gradient(tape, value, [as_entry(tape, each) for each in traced.q.entries])
    evaluator = compile_evaluator(tape, [value, *slopes])
    q, h = postures()[:, 0], 1e-6

    def traced_at(q):
        inputs = np.zeros((len(tape.inputs), len(q)))
        inputs[:3] = q.T
        return evaluator(inputs)

    clear = motion(RADII).clearance[:, 0] > 1e-3
    np.testing.assert_allclose(traced_at(q)[0][clear], motion(RADII).clearance[clear, 0], atol=1e-14)
    smooth = 0
    for joint in range(3):
        step = h * np.eye(3)[joint]
        above, below = (traced_at(q + sign * step)[0] for sign in (1.0, -1.0))
        slope, error = traced_at(q)[1 + joint], (above - below) / (2 * h)
        smooth += np.isclose(slope, error, atol=1e-6)[clear].sum()
    assert smooth >= 0.98 * 3 * clear.sum()  # the rest is next to a kink


def test_the_compiled_search_has_the_same_distances():
    task = tracking(RADII).task
    required, widths = required_distance(task)
    q = postures()[:, 0]
    nodes, distances = trace_nodes(task)(q.T), np.zeros(len(q))
    evaluate_distances(tabulate(OBSTACLES), widths, nodes, len(q), distances)
    clear = motion(RADII).clearance[:, 0] > 1e-3
    np.testing.assert_allclose((distances - required)[clear], motion(RADII).clearance[clear, 0], atol=1e-14)
    assert required_distance(tracking(0.02).task)[0] == 0.02
    np.testing.assert_array_equal(required_distance(tracking(0.02).task)[1], np.zeros(4))


def test_verification_measures_the_same_clearances_and_nearest_pairs():
    nodes = motion(RADII).links[:, 0]
    np.testing.assert_allclose(clearances(OBSTACLES, nodes, tuple(RADII)), motion(RADII).clearance[:, 0], atol=1e-7)
    words = [
        (closest_pair(OBSTACLES, each, tuple(RADII)), nearest_pair(OBSTACLES, each, tuple(RADII))) for each in nodes
    ]
    assert np.mean([one == other for one, other in words]) > 0.98  # two links may share the nearest joint
    assert len({one for one, _ in words}) > 4


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("radius", "message"),
    [
        ([0.1] * 5, "link_radius must be one number or one per link (4), got 5 numbers"),
        ([0.1], "link_radius must be one number or one per link (4), got 1 number"),
        ([], "link_radius must be one number or one per link (4), got 0 numbers"),
        ([[0.1] * 4], "link_radius must be one number or one per link (4), got shape (1, 4)"),
        ([0.1, -0.2, 0.1, 0.1], "link_radius must be 0 m or more, got -0.2 for link 1"),
        ([0.1, np.nan, 0.1, 0.1], "link_radius: must be finite, got nan at index 1"),
        (-0.1, "link_radius must be 0 m or more, got -0.1"),
        ("thin", "link_radius: must contain real numbers, got text"),
    ],
)
def test_a_wrong_radius_is_refused_in_one_line_that_has_the_number_of_links(radius, message):
    for make in (tracking, motion):
        with pytest.raises(InvalidInput, match=f"^{re.escape(message)}$"):
            make(radius)


def test_every_problem_takes_one_radius_per_link():
    q, loop_arm = posture(3), pk.arms.marcos_nr(3)
    loop = marcos_2012.round_trip(0.7, 4)
    made = [
        tracking(RADII).task,
        pk.ClosedLoop(loop_arm, loop, start=q, link_radius=RADII).task,
        pk.ControlStep(loop_arm, loop, q, link_radius=RADII).task,
        pk.Posture(ARM, PATH.resample(3), objectives=[pk.manipulability], link_radius=RADII).task,
    ]
    assert all(task.link_radius == tuple(RADII) for task in made)
    resolved = pk.resolve(
        ARM, PATH, pk.methods.DampedLeastSquares(), start=[0.3, 0.3, 0.3], unreachable="track", link_radius=RADII
    )
    assert resolved.link_radius == tuple(RADII)


def test_radii_count_in_the_fingerprint_and_are_in_the_text_of_the_problem():
    assert fingerprint(tracking(RADII)) != fingerprint(tracking(0.02))
    assert fingerprint(tracking(RADII)) == fingerprint(tracking(np.array(RADII)))
    assert "links of radius 0 to 0.03 m" in repr(tracking(RADII))
    assert "links of radius 0.02 m" in repr(tracking(0.02))


def test_the_message_about_the_base_has_its_own_radius():
    near = [pk.obstacles.Circle([-0.1, -0.1], 0.1, name="post")]
    with pytest.raises(
        InvalidInput, match=r"the obstacle post, a circle, must be clear of the base.*it has a radius of 0.05 m"
    ):
        pk.Tracking(ARM, PATH, objectives=[pk.kinetic_energy], obstacles=near, link_radius=[0.05, 0.0, 0.0, 0.0])
    pk.Tracking(ARM, PATH, objectives=[pk.kinetic_energy], obstacles=near, link_radius=[0.03, 0.0, 0.0, 0.0])


def test_nodes_and_links_are_as_many_as_the_message_says():
    for arm in (ARM, pk.arms.wan_7r()):
        assert link_nodes(arm, np.zeros(arm.dof)).shape == (arm.dof + 2, 3)


def test_an_end_that_no_joint_moves_counts_with_the_radius_of_its_own_link():
    floor = [pk.obstacles.HalfSpace([0.0, -0.02], [0.0, 1.0], name="floor")]
    said = "the obstacle floor, a half-space, must be clear of the end of link 1 that no joint moves"
    with pytest.raises(InvalidInput, match=said):
        pk.Tracking(ARM, PATH, objectives=[pk.kinetic_energy], obstacles=floor, link_radius=[0.0, 0.03, 0.0, 0.0])
    pk.Tracking(ARM, PATH, objectives=[pk.kinetic_energy], obstacles=floor, link_radius=[0.0, 0.01, 0.0, 0.0])
