"""Traced functions of motions: values of real motions, and derivatives compared with differences."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.autodiff.differentiation import gradient
from paretoik.autodiff.evaluator import compile_evaluator
from paretoik.autodiff.tape import as_entry
from paretoik.errors import EvaluationFailed, InvalidInput
from paretoik.task.random_starts import rollout_starts
from paretoik.task.traced_motion import trace_sample, trace_sample_function
from problems import panda, tringali_2020

LIMITED = pk.Arm.planar(
    lengths=[0.3, 0.25, 0.2, 0.1],
    masses=[1.0, 0.8, 0.5, 0.2],
    centers=[0.15, 0.12, 0.1, 0.05],
    inertias=[0.01, 0.008, 0.004, 0.001],
    position_limits=([-4.0, -4.0, -np.inf, -3.0], [4.0, 3.0, np.inf, 5.0]),
)
BENT = pk.line([0.5, 0.1], [0.3, 0.4], duration=2.0, samples=17)
TASKS = {
    "planar, central": pk.Tracking(LIMITED, BENT, objectives=[pk.kinetic_energy], differences="central", bases=1).task,
    "planar, backward": pk.Tracking(
        LIMITED, BENT, objectives=[pk.kinetic_energy], bases=1, differences="backward"
    ).task,
    "planar 3R": tringali_2020.simulation_4().task.subsample(21),
    "Panda": panda.across_the_table().task.subsample(11),
}
POSTURES = {name: rollout_starts(task, 2, np.random.default_rng(0))[0] for name, task in TASKS.items()}
SERIES = [
    pk.kinetic_energy,
    pk.torque_norm,
    pk.mechanical_energy,
    pk.joint_travel,
    pk.joint_limit_distance,
    pk.manipulability,
    pk.jerk,
    pk.peak_velocity,
    pk.peak_torque,
]
OWN = {
    "abs of joints": lambda motion: np.abs(motion.q).sum(axis=-1) + abs(motion.ddq[..., 0]),
    "norm of rates": lambda motion: np.linalg.norm(motion.dq, axis=-1) ** 3,
    "largest rate": lambda motion: np.max(np.abs(motion.dq), axis=-1),
    "smooth excess": lambda motion: np.sum(np.maximum(np.abs(motion.ddq) - 0.1, 0.0) ** 2, axis=-1),
    "work, not braking": lambda motion: np.where(motion.power > 0, motion.power, 0.0).sum(axis=-1),
    "where of a root": lambda motion: np.sum(np.where(motion.q > 0, np.sqrt(motion.q), -0.5 * motion.q), axis=-1),
    "clipped": lambda motion: np.clip(motion.torque[..., 0], -1.0, 1.0) * motion.q[..., 1],
    "tool from a point": lambda motion: np.linalg.norm(motion.tool - 0.2, axis=-1),
    "tool by time": lambda motion: np.sum((motion.tool - 0.1 * motion.time[..., None]) ** 2, axis=-1),
    "tool's turn": lambda motion: np.arccos(0.3 * np.linalg.trace(motion.tool_rotation)) * motion.q[..., 0],
    "tool's axis": lambda motion: motion.tool_rotation[..., :, 0] @ [0.3, -0.5, 0.2] + motion.q[..., 0],
    "height of links": lambda motion: np.sum(motion.links[..., 1], axis=-1) + motion.links[..., -2, 0],
    "links apart": lambda motion: np.linalg.norm(np.diff(motion.links, axis=-2)[..., 1:] * [1.0, 2.0], axis=-1).sum(-1),
    "power squared": lambda motion: np.einsum("...i,...i->...", motion.power, motion.power),
    "weighted": lambda motion: motion.dq[..., 0] ** 2 * np.exp(-motion.time) + motion.kinetic_energy * motion.cyclic,
    "by hand": lambda motion: sum((j + 1) * motion.q[..., j] ** 2 for j in range(motion.arm.dof)),
    "step by step": lambda motion: step_by_step(motion),
    "by the weights": lambda motion: motion.q[..., 0] * motion.weights + motion.link_radius,
}


def step_by_step(motion):
    total = np.zeros_like(motion.q[..., 0])
    for j in range(motion.arm.dof):
        total += motion.torque[..., j] * motion.ddq[..., j]
    return total


def inputs(motion, sample):
    """Return the inputs of a traced sample's programs at the samples of a real motion."""
    result = np.zeros((len(sample.trace.tape.inputs), len(motion.time)))
    joints = np.concatenate([motion.q, motion.dq, motion.ddq, motion.jerk], axis=1).T
    result[: len(joints)] = joints
    for i, values in sample.trace.parameters.items():
        result[sample.trace.tape.entries[i][1]] = values
    return result


def holds(task, q, function):
    """Compare a function's values and slopes with those of real motions near it in some direction."""
    motion, sample = task.motion(q), trace_sample(task)
    tape, n = sample.trace.tape, task.arm.dof
    value = as_entry(tape, trace_sample_function(sample, "it", function))
    run = compile_evaluator(tape, [value, *gradient(tape, value, tape.inputs[: 4 * n])])
    result = run(inputs(motion, sample))
    expected = np.asarray(function(motion), dtype=float)
    assert expected.shape == motion.time.shape
    assert np.ptp(expected) > 0
    scale = np.abs(expected).max()
    np.testing.assert_allclose(result[0], expected, rtol=1e-12, atol=1e-12 * scale)
    step = 1e-6
    direction = step * np.random.default_rng(1).normal(size=q.shape)
    if task.cyclic:
        direction[-1] = direction[0]
    ahead, behind = (task.motion(q + sign * direction) for sign in (1, -1))
    change = (inputs(ahead, sample) - inputs(behind, sample))[: 4 * n] / (2 * step)
    slope = np.sum(result[1:] * change, axis=0)
    differences = (np.asarray(function(ahead)) - np.asarray(function(behind))) / (2 * step)
    np.testing.assert_allclose(slope, differences, rtol=1e-5, atol=1e-6 * max(np.abs(slope).max(), scale))


@pytest.mark.parametrize("name", ["planar, backward", "Panda"])
@pytest.mark.parametrize("objective", SERIES, ids=lambda objective: objective.name)
def test_the_librarys_objectives_are_those_of_real_motions_with_their_slopes(objective, name):
    holds(TASKS[name], POSTURES[name], objective.function)


@pytest.mark.parametrize("function", OWN.values(), ids=OWN.keys())
def test_users_own_are_those_of_real_motions_with_their_slopes(function):
    with np.errstate(invalid="ignore"):
        holds(TASKS["planar, central"], POSTURES["planar, central"], function)


def test_what_an_objective_wants_is_said_as_on_real_motions():
    path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=31)
    task = pk.Tracking(
        pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy], bases=1, differences="backward"
    ).task
    with pytest.raises(InvalidInput, match=r"^objective it: joint_limit_distance must have position limits"):
        trace_sample_function(trace_sample(task), "objective it", pk.joint_limit_distance.function)
    with pytest.raises(InvalidInput, match=r"^objective it: obstacle_clearance must have obstacles"):
        trace_sample_function(trace_sample(task), "objective it", pk.obstacle_clearance.function)


@pytest.mark.parametrize("name", ["planar, central", "Panda"])
def test_a_traced_motion_has_the_shapes_of_the_real_ones_and_all_that_does_not_depend_on_joints(name):
    task = TASKS[name]
    real, sample = task.motion(POSTURES[name]), trace_sample(task)
    for what in ("q", "dq", "torque", "power", "tool", "tool_rotation", "links", "kinetic_energy"):
        result, expected = getattr(sample, what), getattr(real, what)
        assert (result.shape, len(result), result.dtype) == (expected.shape, len(expected), expected.dtype)
    for what in ("arm", "tasks", "obstacles", "link_radius", "differences", "cyclic"):
        assert getattr(sample, what) == getattr(real, what)
    np.testing.assert_array_equal(sample.time, real.time)
    np.testing.assert_array_equal(sample.weights, real.weights)


@pytest.mark.parametrize(
    "function",
    [
        lambda motion: motion.q[..., 0, 0] - motion.q[..., -1, 0],
        lambda motion: motion.integral(motion.q[..., 0]),
        pk.joint_drift.function,
    ],
)
def test_what_looks_from_one_sample_at_another_has_no_local_value(function):
    assert trace_sample_function(trace_sample(TASKS["planar, central"]), "it", function) is None


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda motion: np.abs(np.fft.fft(motion.q[..., 0])), "np.fft.fft has no derivative here"),
        (lambda motion: motion.torques, "motion.torques must be a field of motions, got none; did you mean 'torque'"),
        (lambda motion: motion.q, r"must return one number per sample .*, got shape \(17, 4\)"),
    ],
)
def test_what_cannot_be_traced_is_refused_by_name_in_one_line(function, words):
    with pytest.raises(InvalidInput, match=words) as refused:
        trace_sample_function(trace_sample(TASKS["planar, central"]), "objective mine", function)
    assert str(refused.value).startswith("objective mine: ")


def test_what_a_function_raises_itself_is_not_hidden():
    def broken(motion):
        raise KeyError("mine")

    with pytest.raises(EvaluationFailed, match="objective broken raised KeyError: 'mine'"):
        trace_sample_function(trace_sample(TASKS["planar, central"]), "objective broken", broken)
