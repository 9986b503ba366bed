"""A choice is exported to a robot: what is written, its metadata, and what is refused before any work."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import paretoik as pk
from paretoik.errors import Infeasible, InvalidInput
from paretoik.joint_trajectory.controllers import Controller
from paretoik.robot.dynamics import inverse_dynamics
from paretoik.task.motion_task import finer_motion
from tests.joint_trajectory.motions import PANDA, bench, swing

SWING = swing()


def test_a_choice_says_in_the_file_which_point_it_is_and_what_made_it(front, tmp_path):
    choice = front.select(pk.Weights(kinetic_energy=1))
    trajectory = pk.export(choice, tmp_path / "first.npz", rate=250, metadata={"cell": "bench 3"})
    about = trajectory.metadata
    assert (about["point"], about["reason"], about["cell"]) == (choice.id, choice.reason, "bench 3")
    np.testing.assert_array_equal(about["objectives"], choice.objectives)
    assert (about["arm"], about["controller"], about["rate"], about["time_scale"]) == (
        choice.motion.arm.name, None, 250.0, 1.0
    )  # fmt: skip
    assert about["made by"] == f"paretoik {pk.__version__}"
    with np.load(tmp_path / "first.npz") as stored:
        np.testing.assert_array_equal(stored["q"], trajectory.q)
    state = choice.motion.state(trajectory.time)
    for values, own in zip((trajectory.q, trajectory.dq, trajectory.ddq), state, strict=True):
        np.testing.assert_allclose(values, own, atol=1e-7)


def test_metadata_cannot_use_names_that_export_writes(front, tmp_path):
    choice = front.select(pk.Weights(kinetic_energy=1))
    for name in ("point", "reason", "made by", "use of limits"):
        with pytest.raises(InvalidInput, match=f"got '{name}'"):
            pk.export(choice, tmp_path / "a.csv", metadata={name: "mine"})
    named = {"kinetic_energy": "0.5 J s"}
    assert pk.export(choice, tmp_path / "a.csv", metadata={"objectives": named}).metadata["objectives"] == named


def test_a_controller_gives_its_rate_and_the_use_of_its_limits(tmp_path):
    trajectory = pk.export(SWING, tmp_path / "swing.csv", controller="franka")
    assert (trajectory.metadata["controller"], trajectory.metadata["rate"], len(trajectory.time)) == (
        "panda",
        1000,
        2001,
    )
    uses = trajectory.metadata["use of limits"]
    assert uses["velocity"] == pytest.approx((np.abs(trajectory.dq) / pk.controllers.PANDA.velocity).max(), rel=1e-6)
    assert max(uses.values()) < 1


def test_the_limits_of_a_users_own_controller_must_hold(tmp_path):
    own = Controller(name="bench", joint_names=PANDA.joint_names, rate=125, velocity=0.3)
    with pytest.raises(
        Infeasible, match=r"controller bench: velocity of panda_joint7 is .* rad/s at 1 s, its limit 0\.3"
    ):
        pk.export(SWING, tmp_path / "swing.csv", controller=own)
    assert not (tmp_path / "swing.csv").exists()
    trajectory = pk.export(SWING, tmp_path / "swing.csv", controller=own, slow_down=True)
    assert np.abs(trajectory.dq).max() <= 0.3
    assert trajectory.metadata["time_scale"] == pytest.approx(trajectory.time[-1] / 2)


@pytest.mark.parametrize("turned", [False, True])
def test_limits_are_those_of_the_joints_by_name_in_whatever_order_they_are_written(turned, tmp_path):
    order = slice(None, None, -1 if turned else 1)
    own = bench(PANDA, velocity=[9, 9, 9, 9, 9, 9, 0.1][order], joint_names=PANDA.joint_names[order])
    with pytest.raises(Infeasible, match="velocity of panda_joint7"):
        pk.export(SWING, tmp_path / "a.csv", controller=own, joint_names=PANDA.joint_names[::-1])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"rate": "1 kHz"}, "rate: must contain real numbers, got text"),
        ({"controller": "abb"}, "controller must be one of franka, ur, kinova, panda"),
        ({"slow_down": "yes"}, "slow_down must be True or False, got 'yes'"),
        ({"slow_down": True}, "slow_down must come with a controller, whose limits it satisfies, got none"),
        ({"overwrite": 1}, "overwrite must be True or False, got 1"),
        ({"file": None}, "file must be a path, got None"),
        ({"file": "a\0b.csv"}, r"file must be a path, got 'a\x00b.csv'"),
        ({"file": ".", "format": "csv"}, "export must be a file to write into, got the folder ."),
        (
            {"file": "/", "format": "ros2-bag", "overwrite": True},
            "bag must be a folder of its own to write into, got the folder /",
        ),
        ({"file": "x" * 300 + ".csv"}, "file must be a path, got 'xxx"),
        ({"motion": None}, "motion must be a Motion or a Choice that has one, got None"),
        (
            {"metadata": {"rate": 7}},
            "metadata must not use the names of entries that export writes, got 'rate'",
        ),
        ({"metadata": {"by": object()}}, "metadata.by must be JSON data, got object"),
    ],
)
def test_what_cannot_be_exported_is_refused_in_one_line_and_nothing_written(changed, message, tmp_path, unchecked):
    arguments = {"motion": SWING, "file": tmp_path / "swing.csv", "rate": 100, **changed}
    with pytest.raises(InvalidInput, match=re.escape(message)) as refused:
        pk.export(arguments.pop("motion"), arguments.pop("file"), **arguments)
    assert "\n" not in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_a_batch_and_a_motion_without_its_arm_are_refused(front, run, tmp_path):
    with pytest.raises(
        InvalidInput, match=r"motion must be one motion, got a batch of \(\d+,\); pick one: motions\[0\]"
    ):
        pk.export(front.motions, tmp_path / "a.csv", rate=100)
    stored = pk.Front.load(run[0])
    with pytest.raises(
        InvalidInput, match="motion must be a choice from a front with its arm, got a front without arm; load"
    ):
        pk.export(stored.choice(0, "mine"), tmp_path / "a.csv", rate=100)


VALUES = {"position": "q", "velocity": "dq", "acceleration": "ddq", "torque": "torque"}  # of a motion
RATES = (100.0, 250.0, 1000.0)
PLANAR = pk.arms.tringali_3r(), pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=21)
GOALS = [pk.kinetic_energy, pk.torque_norm]


def active_problem(arm, path, kind, seed, goals):
    """Return a problem with a limit of one random joint that the best motion without limits violates."""
    rng = np.random.default_rng(seed)
    boundless = pk.Limits(velocity=np.inf, torque=np.inf)
    best = pk.plan(pk.Tracking(arm, path, objectives=goals[:1], limits=boundless), starts=3).best.motion
    values, joint = getattr(best, VALUES[kind.removeprefix("varying ")]), rng.integers(arm.dof)
    middle, half = np.zeros(arm.dof), np.abs(values).max(axis=0)
    if kind == "position":
        middle, half = (values.max(axis=0) + values.min(axis=0)) / 2, np.ptp(values, axis=0) / 2
    half = np.maximum(half, 0.05 * half.max()) * np.where(np.arange(arm.dof) == joint, rng.uniform(0.96, 0.99), 1.5)
    if kind == "varying velocity":
        half = rng.uniform(1.0, 1.05, (len(path.times), 1)) * half
    limits = pk.Limits(velocity=np.inf, torque=np.inf) if kind == "position" else pk.Limits()
    limits = replace(limits, **{kind.removeprefix("varying "): (middle - half, middle + half)})
    return pk.Tracking(arm, path, objectives=goals, limits=limits)


def assert_exportable(task, motion, file):
    """Assert that a controller with a task's limits accepts a motion, and that its own samples satisfy them."""
    bounds = {kind: np.broadcast_to(each, (len(task.times), task.arm.dof, 2)) for kind, each in task.bounds.items()}
    widest = {kind: np.abs(each).max(axis=(0, 2)) for kind, each in bounds.items()}
    if "position" in bounds:
        widest["position"] = tuple(bounds["position"][0].T)
    for rate in RATES:
        its = Controller(name="same", joint_names=task.arm.joint_names, rate=rate, **widest)
        pk.export(motion, file, controller=its, ramp=0.2, slow_down=True, overwrite=True)
        sent = pk.export(motion, file, rate=rate, overwrite=True)
        torque = inverse_dynamics(task.arm, sent.q, sent.dq, sent.ddq)
        values = {"position": sent.q, "velocity": sent.dq, "acceleration": sent.ddq, "torque": torque}
        for kind, each in bounds.items():
            for j in range(task.arm.dof):
                lower, upper = (np.interp(sent.time, task.times, side) for side in each[:, j].T)
                assert (values[kind][:, j] >= lower).all()
                assert (values[kind][:, j] <= upper).all()


@pytest.mark.parametrize("kind", [*VALUES, "varying velocity"])
def test_an_optimum_passes_the_controller_with_the_limits_that_it_was_planned_with(kind, tmp_path):
    problem = active_problem(*PLANAR, kind, 0, GOALS[:1])
    best = pk.plan(problem, starts=3).best
    assert best.status == "converged"
    assert best.violation_between == 0.0
    shares = [problem.task.violations(each).max() for each in (best.motion, finer_motion(best.motion, 20))]
    assert max(shares) > -1e-3  # the bound of a velocity, or the limited value itself, is at its limit
    assert_exportable(problem.task, best.motion, tmp_path / "motion.npz")
