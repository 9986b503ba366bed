"""Inputs that once ended in an error from inside: the public face refuses each in one line."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import paretoik as pk
from tests.api.problems import PATH, tracking

PANDA = "problems/robots/panda.urdf"
HUGE = 10**400


def arm(**settings):
    return pk.Arm.planar(**{"lengths": [0.2, 0.2, 0.1], **settings})


def own(**settings):
    return pk.objective(**{"unit": "m", "form": "integral", **settings})(lambda motion: motion.dq[..., 0] ** 2)


def solve(**settings):
    return pk.solve(tracking(), **{"population": 8, "generations": 1, **settings})


def loop(**settings):
    path = pk.circle([0.3, 0.0], 0.05, duration=1.0, samples=11, timing="uniform")
    return pk.ClosedLoop(pk.arms.tringali_3r(), path, **settings)


def raising():
    @pk.objective(unit="", form="integral")
    def worn(motion):
        return motion.bearing

    return tracking(worn)


class Foreign:
    def __array__(self, *args, **kwargs):
        raise RuntimeError("not from here")


INPUTS = {
    "lengths: must hold real numbers, got text": lambda: arm(lengths=["a"]),
    "lengths: must hold real numbers, got object": lambda: arm(lengths=[HUGE]),
    "lengths: must be an array of numbers, got rows": lambda: arm(lengths=[1, [2]]),
    "lengths: must hold real numbers, got complex": lambda: arm(lengths=[1j]),
    "lengths: must be an array of numbers, got RuntimeError: not": lambda: arm(lengths=Foreign()),
    "lengths: must hold real numbers, got masked": lambda: arm(lengths=np.ma.array([0.1, 0.2], mask=[0, 1])),
    "masses: must hold": lambda: arm(masses=["a", "b", "c"]),
    "centers: must hold": lambda: arm(centers="x"),
    "inertias: must hold": lambda: arm(inertias={}),
    "lengths must be at most 1e\\+50, got 1e\\+308": lambda: arm(lengths=[1e308]),
    "lengths must be at least 1e-50, got 1e-300": lambda: arm(lengths=[0.1, 1e-300]),
    "masses must be at most 1e\\+50, got 1e\\+155": lambda: arm(masses=[1.0, 1e155, 1.0]),
    "payload: mass must be at most 1e\\+50 kg": lambda: arm().with_payload(1e60),
    "pose position must be at most 1e\\+50 m": lambda: pk.Pose([0.0, -1e60, 0.0]),
    "line end must be at most 1e\\+50 m, got 1e\\+308 m": lambda: pk.line([0.0, 0.0], [1e308, 0.0], duration=1.0),
    "duration must be at most 1e\\+50 s": lambda: pk.line([0.0, 0.0], [1.0, 0.0], duration=1e60),
    "duration must be at least 1e-50 s": lambda: pk.line([0.0, 0.0], [1.0, 0.0], duration=1e-320),
    "velocity limit must be at most 1e\\+50, got 1e\\+308": lambda: tracking(velocity=1e308),
    "position limit of joint1 must be at most": lambda: tracking(position={"joint1": (-1e60, 1.0)}),
    "velocity_limits must be at least 1e-50": lambda: arm(velocity_limits=1e-60),
    "position_limits: must hold": lambda: arm(position_limits={}),
    "velocity_limits: must hold real numbers, got text": lambda: arm(velocity_limits="fast"),
    "file must be a path, got None": lambda: pk.Arm.from_urdf(None),
    "file must be a path, got 5": lambda: pk.check_robot(5),
    "joint 'panda_joint1': must hold": lambda: pk.Arm.from_urdf(PANDA, tip="panda_hand", fixed={"panda_joint1": "x"}),
    "joint 'panda_joint1' must be from": lambda: pk.Arm.from_urdf(PANDA, tip="panda_hand", fixed={"panda_joint1": 99}),
    "fixed must be values by joint": lambda: pk.Arm.from_urdf(PANDA, tip="panda_hand", fixed=["panda_joint1"]),
    "joint joint1: must hold": lambda: arm().fixed(joint1="x"),
    "joint joint1 must be from -1 to 1, got 3": lambda: arm(position_limits=1.0).fixed(joint1=3),
    "pose must be a Pose, got 5": lambda: arm().with_tool(5),
    "base must be a Pose, got 5": lambda: arm().mounted(base=5),
    "gravity: must hold": lambda: arm().mounted(gravity="down"),
    "payload: mass: must hold": lambda: arm().with_payload("heavy"),
    "margin: must hold": lambda: tracking(margin="x"),
    "clearance limit: must hold": lambda: tracking(clearance=None),
    "position limit: must hold": lambda: tracking(position=HUGE),
    "velocity limit: must hold": lambda: tracking(velocity=True),
    "path must be a Path": lambda: pk.Task(5),
    "axes must be one of": lambda: pk.Task(PATH, axes=[]),
    "seed must be an integer of at least 0": lambda: pk.Tracking(
        arm(), PATH, objectives=[pk.kinetic_energy], seed="a", coefficients=4, differences="backward"
    ),
    "motion: time: must hold": lambda: pk.Motion(arm=arm(), time="x", q=np.zeros((3, 3))),
    "objective kinetic_energy must get a Motion, got int": lambda: pk.kinetic_energy(5),
    "unit must be printable text, got 5": lambda: own(unit=5),
    "name must be printable text, got 5": lambda: own(name=5),
    "maximise must be True or False, got 'no'": lambda: own(maximise="no"),
    "front names .*'=x'": lambda: pk.solve(tracking(own(name="=x"))),
    "front names .*' x '": lambda: pk.epsilon_front(tracking(own(name=" x "), pk.jerk)),
    "front names .*'id'": lambda: pk.plan(tracking(own(name="id"))),
    "every evaluation failed, the first with: objective worn raised Attr": lambda: pk.plan(raising()),
    "generations must be an integer of at least 1, got '3'": lambda: solve(generations="3"),
    "out must be a path, got 5": lambda: solve(out=5),
    "initial must be genes, motions or a front, got int": lambda: solve(initial=5),
    "initial: must be an array of numbers, got rows": lambda: solve(initial=[[1, 2], [3]]),
    "time limit: must hold": lambda: solve(time_limit="x"),
    "time limit: must be finite, got inf": lambda: solve(time_limit=np.inf),
    "target must be 2 numbers, one per objective, got 5": lambda: solve(target=5),
    "target: must hold": lambda: solve(target="ab"),
    "algorithm must be a pymoo algorithm": lambda: solve(algorithm="nsga2"),
    "observe must be a function, got 5": lambda: solve(observe=5),
    "refine must be True or False, got 'no'": lambda: solve(refine="no"),
    "overwrite must be True or False, got 'no'": lambda: solve(overwrite="no"),
    "stagnation must be True or False, got 5": lambda: solve(stagnation=5),
    "front must be a Front, got None": lambda: pk.refine(None),
    "problem must be a pymoo problem, such as Tracking, got None": lambda: pk.Search(None),
    "plan: the problem must have gradients": lambda: pk.plan(pk.Tracking),
    "initial must be motions, got int": lambda: pk.plan(tracking(pk.kinetic_energy), initial=5),
    "folder must be a path, got None": lambda: pk.load_front(None),
    "folder must be a path, got 5": lambda: pk.Front.load(5),
    "weights must be numbers by objective": lambda: pk.Weights([1, 2]),
    "weights must be a finite number >= 0 for torque, got 1000": lambda: pk.Weights(torque=HUGE),
    "select: must be a preference": lambda: solve().select(None),
    "select: must be a preference, such as .*class": lambda: solve().select(pk.Weights),
    "objectives must be a list, got 5": lambda: loop(objectives=5),
    "limits must be Limits, got 5": lambda: loop(limits=5),
    "longest_step: must hold": lambda: loop(longest_step="far"),
    "warm_start must be True or False": lambda: loop(warm_start="no"),
}


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("words", INPUTS)
def test_what_makes_no_sense_is_refused_in_one_line(words):
    with pytest.raises(pk.ParetoikError, match=words) as refused:
        INPUTS[words]()
    assert "\n" not in str(refused.value)


def of_size(quantity: str, size: float) -> pk.Tracking:
    unit = size if quantity == "lengths" else 1.0
    masses = np.full(3, size if quantity == "masses" else 1.0)
    limits = pk.Limits(velocity=size) if quantity == "velocity" else None
    duration = size if quantity == "duration" else 1.0
    three = arm(lengths=[0.2 * unit] * 3, masses=masses, centers=[0.1 * unit] * 3, inertias=0.01 * masses)
    path = pk.line([0.4 * unit, 0.0], [0.3 * unit, 0.1 * unit], duration=duration, samples=9)
    objectives = [pk.kinetic_energy, pk.torque_norm]
    return pk.Tracking(three, path, objectives=objectives, limits=limits, coefficients=4, bases=2)


@given(st.sampled_from(["duration", "lengths", "masses", "velocity"]), st.floats(-320, 308))
@settings(max_examples=30, deadline=None)
def test_problems_of_any_size_have_finite_values_or_are_refused_beyond_what_numbers_hold(quantity, exponent):
    size = 10.0**exponent
    if 1e-45 < size < 1e45:
        problem = of_size(quantity, size)
        assert np.isfinite(problem.evaluate(np.full((1, problem.n_var), 0.5), return_values_of=["F"])).all()
    elif size > 1e51 or (size < 1e-51 and quantity in ("duration", "lengths")):
        with pytest.raises(pk.InvalidInput, match=r"1e[+-]50( m| s)?, got"):
            of_size(quantity, size)
