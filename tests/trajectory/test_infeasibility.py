"""No false refusals, and clear ones quickly, by the user's own samples, with the limit, the joint or the obstacle."""

from __future__ import annotations

import re

import numpy as np
import pytest

import paretoik as pk
from paretoik.trajectory.levels import coarsest_level, first_levels
from problems import tringali_2020

POSITION = np.deg2rad([90, 120, 120])


def refusal(*, samples=101, objective=pk.kinetic_energy, **settings):
    """The error that a plan of a line ends with."""
    path = tringali_2020.straight(samples)
    settings = {"differences": "backward", **settings}
    problem = pk.Tracking(pk.arms.tringali_3r(), path, objectives=[objective], **settings)
    with pytest.raises(pk.Infeasible) as raised:
        pk.plan(problem, starts=8)
    return raised.value


def test_finer_levels_come_after_the_coarsest():
    assert first_levels(26) == [0]
    assert first_levels(51) == [0, 1]
    assert first_levels(401) == [0, 1, 4]
    task = tringali_2020.simulation_1().task
    assert [len(coarsest_level(task, first).times) for first in first_levels(101)] == [26, 51, 101]


@pytest.mark.parametrize("samples", [26, 51])
def test_a_circle_nearly_at_full_reach_is_planned_for(samples):
    path = pk.circle([0.0, 0.0], 0.9999 * 0.4895, duration=2.0, samples=samples)
    planned = pk.plan(pk.Tracking(pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy], differences="backward"))
    assert planned.best.status == "converged"
    assert planned.best.objective == pytest.approx(1.566, abs=3e-3)


@pytest.mark.parametrize(
    ("limits", "limit"),
    [({"velocity": 1.0}, "velocity"), ({"position": 0.35}, "position"), ({"acceleration": 2.0}, "acceleration")],
)
def test_limits_that_clearly_contradict_the_path_are_named_by_joint_and_sample_of_the_users(limits, limit):
    error = refusal(limits=pk.Limits(**limits))
    assert error.limit.startswith(f"{limit} of joint")
    assert re.search(r"at sample \d+", str(error))
    for sample, time in re.findall(r"at sample (\d+) \(([\d.]+) s\)", str(error)):
        assert int(sample) == round(100 * float(time))
    assert len(error.motion.q) == 101
    assert re.search(r"; it may help: (a longer duration|another place of the path)", str(error))


def test_an_obstacle_on_the_path_is_blamed_by_number_and_link():
    with pytest.warns(RuntimeWarning, match=r"path: obstacle 2, a circle, is in its way: at sample \d+ .* link 3"):
        error = refusal(
            limits=pk.Limits(position=POSITION),
            obstacles=[pk.obstacles.Circle([1.0, 1.0], 0.1), pk.obstacles.Circle([0.3, 0.07], 0.03)],
        )
    assert error.limit == "clearance"
    assert "between link 3 and obstacle 2, a circle" in str(error)
    assert re.search(r"; none of \d+ postures tried at sample \d+ keeps the limits; it may help: obstacles", str(error))


def test_an_obstacle_without_which_there_is_a_motion_is_blamed_rather_than_joint_limits():
    with pytest.warns(RuntimeWarning, match="no motion along it is feasible"):
        error = refusal(
            limits=pk.Limits(position=POSITION, velocity=2.9, clearance=0.5),
            obstacles=[pk.obstacles.Circle([0.12, 0.12], 0.05)],
            link_radius=0.02,
        )
    assert error.limit == "clearance"


@pytest.mark.parametrize("samples", [3, 4, 5, 8])
def test_paths_of_few_samples_are_planned_for(samples):
    path = tringali_2020.straight(samples)
    planned = pk.plan(
        pk.Tracking(pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy], differences="backward"), starts=8
    )
    assert planned.best.status == "converged"
    assert planned.best.motion.tracking_error.max() <= 1e-10


def test_a_cycle_of_too_few_samples_is_refused_by_their_number():
    path = pk.circle([0.3, 0.0], 0.05, duration=1.0, samples=4)
    problem = pk.Tracking(
        pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy], cyclic=True, differences="backward"
    )
    with pytest.raises(pk.InvalidInput, match="path: at least 6 samples of a cyclic motion wanted, got 4"):
        pk.plan(problem)


def test_an_arm_without_masses_serves_kinematics_and_refuses_dynamics_by_name():
    arm, path = pk.Arm.planar(lengths=[0.3, 0.3, 0.2], name="bare"), tringali_2020.straight(8)
    planned = pk.plan(pk.Tracking(arm, path, objectives=[_effort], differences="backward"), starts=4)
    assert planned.best.status == "converged"
    for objective in (pk.kinetic_energy, pk.torque_norm, pk.peak_torque):
        with pytest.raises(pk.InvalidInput, match=f"objective {objective.name}: an arm with masses wanted, bare has"):
            pk.Tracking(arm, path, objectives=[objective], differences="backward")
    with pytest.raises(pk.InvalidInput, match="torque limit: an arm with masses wanted, bare has links without"):
        pk.Tracking(arm, path, objectives=[_effort], limits=pk.Limits(torque=1.0), differences="backward")


@pk.objective(unit="rad²/s", form="integral")
def _effort(motion):
    return np.sum(motion.dq**2, axis=-1)
