"""Laws of ``resolve``: its methods agree with the papers' formulas and claims."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import paretoik as pk
from paretoik import Limits, Pose, line
from paretoik.errors import EvaluationFailed, Infeasible, InvalidInput, OutOfReach
from paretoik.resolution.methods import Criterion
from paretoik.robot import kinematics
from paretoik.robot.arms import tringali_3r, wan_7r
from tests.resolution.plainly import Plainly, coefficient, damping, repulsions, weights_of_clamping

START = np.array([0.0, 0.327, -0.754])
DOWN = line([0.468, 0.0], [0.368, 0.0], duration=1.0, samples=41)
FEEDBACK = 20.0
TIGHT = Limits(position=([-0.3, 0.1, -1.9], [0.35, 1.2, -0.6]))
BENT = np.array([0.3, -0.4, 0.5, -0.9, 0.4, 0.7, -0.3])


@pk.objective(unit="", form="integral")
def middle(motion):
    return np.sum((motion.q - 0.3) ** 2, axis=-1)


@pk.objective(unit="", form="integral", maximise=True)
def slowness(motion):
    return -np.sum(motion.dq**2, axis=-1)


def begun(arm, q):
    """Return a path that begins at a posture's place, of poses for a spatial arm."""
    rotation, position = kinematics.forward_kinematics(arm, q)
    if arm.is_planar:
        return line(position[:2], position[:2] + np.array([-0.08, 0.05]), duration=1.0, samples=41)
    first = Pose.from_matrix(rotation, position)
    last = Pose.from_rpy((0.1, -0.05, 0.05), (0.1, 0.0, 0.2)) @ Pose.from_matrix(rotation, position)
    return line(first, last, duration=1.0, samples=41)


ARMS = {"planar": (tringali_3r, START), "spatial": (wan_7r, BENT)}
every_arm = pytest.mark.parametrize("name", ARMS)


@cache
def followed(name, method, **settings):
    make, start = ARMS[name]
    arm = make()
    return pk.resolve(arm, begun(arm, start), method, start=start, unreachable="track", **settings)


def pseudoinverse(self, q, jacobian, v, dq):
    return np.linalg.pinv(jacobian) @ v


def damped_inverse(jacobian, region, maximum_damping):
    squared = damping(jacobian, region, maximum_damping)
    return jacobian.T @ np.linalg.inv(jacobian @ jacobian.T + squared * np.eye(len(jacobian)))


REGION, MOST = 0.2, 0.05  # wide enough to be met


def damped_least_squares(self, q, jacobian, v, dq):
    return damped_inverse(jacobian, REGION, MOST) @ v


def weighted_least_norm():
    before = [None]

    def rates(self, q, jacobian, v, dq):
        with np.errstate(invalid="ignore"):
            slope = np.abs(
                (self.upper - self.lower) ** 2
                * (2 * q - self.upper - self.lower)
                / (4 * (self.upper - q) ** 2 * (q - self.lower) ** 2)
            )
        slope = np.where(np.isfinite(self.upper - self.lower), slope, 0.0)
        nearer = slope >= (0 if before[0] is None else before[0])
        before[0] = slope
        half = np.diag(np.where(nearer, 1 + slope, 1.0) ** -0.5)
        return half @ damped_inverse(jacobian @ half, REGION, MOST) @ v

    return rates


def gradient_projection(self, q, jacobian, v, dq):
    inverse = damped_inverse(jacobian, REGION, MOST)
    z = -0.7 * 2 * (q - 0.3) + 0.1 * -2 * dq
    return inverse @ v + (np.eye(len(q)) - inverse @ jacobian) @ z


def weighted_projection(variant):
    def rates(self, q, jacobian, v, dq):
        e = weights_of_clamping(q, self.lower, self.upper, 0.3)
        clamped = np.diag(e)
        inverse = damped_inverse(jacobian @ clamped, REGION, MOST)
        first = coefficient(np.exp(0.01 - np.sum((q - 0.3) ** 2) / 2.0), 0.2)
        second = coefficient(1 - np.exp(-0.5 + np.sum(dq**2)), 0.2)
        z = -(1 - e) * repulsions(q, self.lower, self.upper, 0.3, 0.8)
        z -= 0.7 * first * np.exp(-e / 2) * 2 * (q - 0.3)  # the second in priority
        z += 0.1 * second * -2 * dq
        projector = clamped @ inverse @ jacobian if variant == "consistent" else inverse @ jacobian @ clamped
        return clamped @ inverse @ v + z - projector @ z

    return rates


CRITERIA = [
    Criterion(objective=middle, gain=0.7, reference=0.01, scale=2.0),
    Criterion(objective=slowness, gain=0.1, reference=-0.5),
]
DAMPED = {"region": REGION, "damping": MOST, "feedback": FEEDBACK}
WEIGHTED = {"criteria": CRITERIA, "priorities": np.array([3.0, 1.0]), "buffer": 0.3, "repulsion": 0.8, "band": 0.2}
METHODS = {
    "pseudoinverse": (pk.methods.PseudoInverse(feedback=FEEDBACK), lambda: pseudoinverse),
    "damped": (pk.methods.DampedLeastSquares(**DAMPED), lambda: damped_least_squares),
    "least norm": (pk.methods.WeightedLeastNorm(**DAMPED), weighted_least_norm),
    "gradient": (pk.methods.GradientProjection(criteria=CRITERIA, **DAMPED), lambda: gradient_projection),
    "paper": (
        pk.methods.WeightedGradientProjection(variant="paper", **WEIGHTED, **DAMPED),
        lambda: weighted_projection("paper"),
    ),
    "consistent": (
        pk.methods.WeightedGradientProjection(**WEIGHTED, **DAMPED),
        lambda: weighted_projection("consistent"),
    ),
}


@every_arm
@pytest.mark.parametrize("method", METHODS)
def test_every_method_is_its_formula(method, name):
    chosen, rates = METHODS[method]
    motion = followed(name, chosen, limits=TIGHT if name == "planar" else None)
    assert np.abs(motion.q[-1] - motion.q[0]).max() > 0.05
    np.testing.assert_allclose(motion.q, Plainly(motion, rates(), FEEDBACK).followed(), rtol=0, atol=1e-10)


@every_arm
def test_the_consistent_variant_leaves_the_task_alone_where_nothing_is_damped(name):
    limits = TIGHT if name == "planar" else None
    method = pk.methods.WeightedGradientProjection(region=0.0, criteria=CRITERIA, repulsion=0.3)
    motion = followed(name, method, limits=limits)
    plainly = Plainly(motion, None, 0.0)
    disturbed = {}
    for variant in ("consistent", "paper"):
        motion = followed(
            name, pk.methods.WeightedGradientProjection(**{**vars(method), "variant": variant}), limits=limits
        )
        own = motion.traces.repulsion + motion.traces.projected.sum(axis=1)
        disturbed[variant] = max(np.abs(plainly.at(motion.q[k], k)[1] @ own[k]).max() for k in range(40))
        assert np.abs(own).max() > 0.1
    assert disturbed["consistent"] < 1e-12
    if name == "planar":
        assert disturbed["paper"] > 1e-3


@every_arm
def test_the_task_part_is_stationary_in_the_damped_problem(name):
    motion = followed(name, METHODS["consistent"][0], limits=TIGHT if name == "planar" else None)
    plainly, traces, looked = Plainly(motion, None, FEEDBACK), motion.traces, 0
    for k in range(40):
        task = traces.velocities[k] - traces.repulsion[k] - traces.projected[k].sum(axis=0)
        if traces.weights[k].min() > 0.01:
            jacobian = plainly.at(motion.q[k], k)[1]
            left = jacobian.T @ (plainly.wanted(motion.q[k], k) - jacobian @ task)
            assert np.abs(left - traces.damping[k] ** 2 * task / traces.weights[k] ** 2).max() < 1e-10
            looked += 1
    assert looked > 10


def test_a_clamped_joint_does_nothing_for_the_task():
    limits = Limits(position=([-0.3, 0.1, -0.754], [0.35, 1.2, 1.0]))
    motion = followed("planar", pk.methods.WeightedGradientProjection(repulsion=0.0), limits=limits)
    assert (motion.traces.velocities[:, 2] == 0.0).all()
    assert np.abs(motion.q[-1, :2] - START[:2]).min() > 0.05


def test_weighted_projection_frees_a_joint_that_the_weighted_least_norm_keeps_at_its_limit():
    limits = Limits(position=([-3.0, -3.0, -0.80], [3.0, 3.0, 1.0]))
    least_norm, freed = (
        pk.resolve(tringali_3r(), DOWN.resample(201), method, start=START, limits=limits).q[-1, 2]
        for method in (pk.methods.WeightedLeastNorm(), pk.methods.WeightedGradientProjection())
    )
    assert least_norm < -0.75
    assert freed > -0.6


@pytest.mark.parametrize("method", ["least norm", "consistent"])
def test_a_batch_is_resolved_as_its_motions_are(method):
    arm, rng = wan_7r(), np.random.default_rng(0)
    starts = BENT + rng.uniform(-0.005, 0.005, (3, 7))
    chosen = METHODS[method][0]
    settings = {"path": begun(arm, BENT), "method": chosen, "unreachable": "track"}
    together = pk.resolve(arm, **settings, start=starts)
    assert together.q.shape == (3, 41, 7)
    for i, start in enumerate(starts):
        alone = pk.resolve(arm, **settings, start=start)
        np.testing.assert_array_equal(alone.q, together.q[i])
        np.testing.assert_array_equal(alone.traces.projected, together[i].traces.projected)


def test_open_loop_errors_stay_and_feedback_takes_them_away():
    drifting, corrected = (
        followed("planar", method) for method in (pk.methods.LeastSquaresVelocity(), pk.methods.PseudoInverse())
    )
    assert drifting.tracking_error[-1] > 10 * corrected.tracking_error[-1]
    half = pk.resolve(tringali_3r(), DOWN.resample(81), pk.methods.LeastSquaresVelocity(), start=START)
    whole = pk.resolve(tringali_3r(), DOWN, pk.methods.LeastSquaresVelocity(), start=START)
    assert half.tracking_error[-1] / whole.tracking_error[-1] == pytest.approx(0.5, abs=0.1)  # Euler's


def test_traces_are_what_happened():
    motion = followed("planar", METHODS["consistent"][0], limits=TIGHT)
    np.testing.assert_allclose(motion.dq[1:], motion.traces.velocities, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.abs(motion.traces.errors).max(axis=1), motion.tracking_error, rtol=0, atol=1e-15)


def test_a_singular_start_is_refused_or_held_or_damped():
    stretched, path = np.zeros(3), line([0.4895, 0.0], [0.40, 0.05], duration=1.0, samples=41)
    with pytest.raises(
        Infeasible, match=r"no velocities satisfy the task at sample 1 .* condition number is (inf|\d\.?\d*e\+1\d)"
    ):
        pk.resolve(tringali_3r(), path, pk.methods.PseudoInverse(), start=stretched)
    held = pk.resolve(tringali_3r(), path, pk.methods.PseudoInverse(), start=stretched, unreachable="track")
    assert (held.traces.status == "held").all()
    damped = pk.resolve(tringali_3r(), path, pk.methods.DampedLeastSquares(), start=stretched, unreachable="track")
    assert damped.traces.status[0] == "damped"
    assert np.abs(damped.traces.velocities).max() < 20.0


def test_without_a_start_one_is_found_far_from_singular():
    motion = pk.resolve(tringali_3r(), DOWN, pk.methods.PseudoInverse())
    assert motion.tracking_error.max() < 1e-3
    again = pk.resolve(tringali_3r(), DOWN, pk.methods.PseudoInverse())
    np.testing.assert_array_equal(motion.q, again.q)
    with pytest.raises(OutOfReach):
        pk.resolve(tringali_3r(), line([0.6, 0.0], [0.5, 0.0], duration=1.0, samples=11), pk.methods.PseudoInverse())


def test_a_criterion_means_the_same_whatever_the_duration():
    quick, slow = (
        pk.resolve(
            tringali_3r(),
            line([0.468, 0.0], [0.368, 0.0], duration=duration, samples=41),
            pk.methods.WeightedGradientProjection(
                criteria=[Criterion(objective=pk.manipulability, scale=0.01, reference=1.0)]
            ),
            start=START,
            limits=Limits(position=3.0),
            tolerance=0.2,
        )
        for duration in (1.0, 10.0)
    )
    np.testing.assert_allclose(quick.traces.projected[0], slow.traces.projected[0], atol=1e-12)
    np.testing.assert_allclose(quick.traces.coefficients[0], slow.traces.coefficients[0], atol=1e-12)


def test_a_criterion_without_a_value_is_named_or_left_out():
    @pk.objective(unit="", form="integral")
    def rooted(motion):
        return np.sqrt(motion.q[..., 2] + 0.7)

    method = pk.methods.WeightedGradientProjection(criteria=[rooted])
    with pytest.raises(
        EvaluationFailed, match=r"criterion rooted must have a finite value .* none at sample 0 \(0 s\)"
    ):
        pk.resolve(tringali_3r(), DOWN, method, start=START)
    motion = pk.resolve(tringali_3r(), DOWN, method, start=START, unreachable="track")
    missing = np.isnan(motion.traces.coefficients[:, 0])
    assert missing[0]
    assert (motion.traces.projected[missing] == 0).all()
    assert motion.tracking_error.max() < 1e-2


def test_more_redundancy_and_several_tasks_are_resolved():
    arm = pk.Arm.planar(lengths=[1.0] * 5)
    q = np.array([0.3, 0.4, -0.5, 0.9, -0.4])
    nodes = kinematics.link_nodes(arm, q)
    hand = line(nodes[-1, :2], nodes[-1, :2] + np.array([-0.05, 0.1]), duration=1.0, samples=201)
    elbow = line(nodes[4, :2], nodes[4, :2] + np.array([-0.05, 0.05]), duration=1.0, samples=201)
    frames = [pk.Task(hand), pk.Task(elbow, frame="joint4")]
    motion = pk.resolve(arm, frames, pk.methods.PseudoInverse(), start=q)
    assert motion.traces.errors.shape == (201, 4)
    assert motion.tracking_error.max() < 1e-3


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"method": pk.methods.PseudoInverse}, "method must be one of pk.methods, such as PseudoInverse(), got <class"),
        ({"tolerance": 0.0}, "tolerance must be a positive distance in m or rad, got 0.0"),
        ({"start": [0.0, 1.0]}, "start must be joint positions (..., 3), got shape (2,)"),
        ({"start": [0.3, 0.2, 0.5]}, "start must be at most 0.01 m off the path's first sample, got "),
        ({"method": pk.methods.PseudoInverse(feedback=1000.0)}, "PseudoInverse: feedback must be from 0 to 40 1/s"),
        (
            {"method": pk.methods.GradientProjection(criteria=[Criterion(objective=pk.torque_norm)])},
            "criterion torque_norm must be a function of positions and velocities only",
        ),
        (
            {"method": pk.methods.WeightedGradientProjection(criteria=CRITERIA, priorities=np.zeros(3))},
            "WeightedGradientProjection: priorities must be one per criterion (2), got (3,)",
        ),
    ],
)
def test_what_cannot_be_used_is_refused_by_name(changed, said):
    arguments = {"method": pk.methods.PseudoInverse(), "start": START, **changed}
    with pytest.raises(InvalidInput, match=re.escape(said)):
        pk.resolve(tringali_3r(), DOWN, **arguments)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: pk.methods.WeightedGradientProjection(buffer=0.5),
            "buffer must be 0 or more and less than 0.5, got 0.5",
        ),
        (lambda: pk.methods.DampedLeastSquares(damping=np.nan), "DampedLeastSquares: damping: must be finite, got nan"),
        (lambda: pk.methods.Nedungadi(tolerance=0.0), "Nedungadi: tolerance must be positive, got 0.0"),
        (
            lambda: Criterion(objective=pk.joint_drift),
            "criteria: objective must have form integral or peak, got Obj",
        ),
        (lambda: Criterion(objective=middle, scale=0.0), "criterion middle: scale must be positive, got 0.0"),
    ],
)
def test_numbers_out_of_range_are_refused_by_name(make, said):
    with pytest.raises(InvalidInput, match=re.escape(said)):
        make()


# Large errors, and joints with only one limit.


LONG = DOWN.resample(101)
WAYS = [
    pk.methods.PseudoInverse(),
    pk.methods.DampedLeastSquares(),
    pk.methods.WeightedLeastNorm(),
    pk.methods.WeightedGradientProjection(),
    pk.methods.PredictiveKineticEnergy(feedback=50.0),
]
every_method = pytest.mark.parametrize("method", WAYS, ids=lambda one: type(one).__name__)


@pytest.mark.filterwarnings("ignore:waypoints")  # there and back, the curve overshoots
@every_method
def test_a_motion_that_loses_a_path_out_of_reach_finds_it_again(method):
    corners = [[0.4678, 0.0], [0.7, 0.0], [0.4678, 0.0], [0.4, 0.05]]
    path = pk.waypoints(corners, duration=1.0, samples=201)
    motion = pk.resolve(tringali_3r(), path, method, start=START, unreachable="track")
    assert motion.tracking_error.max() > 0.9 * (0.7 - 0.49)
    assert motion.tracking_error[-1] < 1e-4
    assert np.abs(np.diff(motion.q, axis=0)).max() <= 1.0 + 1e-12
    assert np.abs(motion.q).max() < np.pi  # it did not spin in between


@every_method
def test_a_step_too_long_is_shortened_in_all_its_parts_or_refused(method):
    path = pk.waypoints([[0.4678, 0.0], [0.7, 0.0], [0.4, 0.05]], duration=1.0, samples=101)
    motion = pk.resolve(tringali_3r(), path, method, start=START, unreachable="track")
    traces, short = motion.traces, motion.traces.status == "shortened"
    assert short.any()
    assert np.abs(traces.velocities[short] * 0.01).max(axis=1) == pytest.approx(1.0, rel=1e-12)
    with pytest.raises(Infeasible, match=r"off the path at sample|more than 1 rad or m in the step at sample"):
        pk.resolve(tringali_3r(), path, method, start=START)


def turned(arm, q, about, angle):
    """Return a path from a posture's place whose first orientation differs from the posture's by an angle."""
    rotation, position = kinematics.forward_kinematics(arm, q)
    off = rotation @ Rotation.from_rotvec(angle * np.array(about) / np.linalg.norm(about)).as_matrix()
    first = Pose.from_matrix(off, position)
    last = Pose.from_rpy((0.05, -0.05, 0.05), (0.3, 0.2, -0.4)) @ first
    return line(first, last, duration=1.0, samples=1001)


@pytest.mark.parametrize("angle", [1.0, np.pi])
def test_a_large_error_of_orientation_is_made_good(angle):
    arm = wan_7r()
    path = turned(arm, BENT, (1.0, -2.0, 0.5), angle)
    motion = pk.resolve(arm, path, pk.methods.PseudoInverse(feedback=10.0), start=BENT, unreachable="track")
    sizes = np.linalg.norm(motion.traces.errors[:, 3:], axis=1)
    decayed = angle * (1.0 - 10.0 * 0.001) ** np.arange(1001)
    assert sizes[:601] == pytest.approx(decayed[:601], rel=0.05)  # later it meets the limit of its reach
    assert np.linalg.norm(motion.traces.errors[:601, :3], axis=1).max() < 0.01


@pytest.mark.parametrize("side", ["upper", "lower"])
@pytest.mark.parametrize(
    "method", [pk.methods.WeightedLeastNorm(), pk.methods.WeightedGradientProjection()], ids=["WLN", "WGPM"]
)
def test_a_joint_with_one_limit_is_kept_from_it_as_with_a_turn_between_two(method, side):
    upper, lower = np.array([0.35, 1.2, -0.5]), np.array([-0.3, 0.1, -1.9])
    one = (np.full(3, -np.inf), upper) if side == "upper" else (lower, np.full(3, np.inf))
    two = (upper - 2 * np.pi, upper) if side == "upper" else (lower, lower + 2 * np.pi)
    alone, both = (
        pk.resolve(tringali_3r(), LONG, method, start=START, limits=Limits(position=each), unreachable="track")
        for each in (one, two)
    )
    assert (both.traces.weights != 1.0).any()
    np.testing.assert_allclose(alone.q, both.q, rtol=0, atol=1e-12)
