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
    "lengths: must be an array of numbers, got rows": lambda: arm(lengths=[1, [2]]),
    "lengths: must be an array of numbers, got an object whose reading raised": lambda: arm(lengths=Foreign()),
    "lengths: must contain real numbers, got masked": lambda: arm(lengths=np.ma.array([0.1, 0.2], mask=[0, 1])),
    "lengths must be at most 1e\\+50, got 1e\\+308": lambda: arm(lengths=[1e308]),
    "lengths must be at least 1e-50, got 1e-300": lambda: arm(lengths=[0.1, 1e-300]),
    "line end must be at most 1e\\+50 m, got 1e\\+308 m": lambda: pk.line([0.0, 0.0], [1e308, 0.0], duration=1.0),
    "duration must be at least 1e-50 s": lambda: pk.line([0.0, 0.0], [1.0, 0.0], duration=1e-320),
    "position limit of joint1 must be at most": lambda: tracking(position={"joint1": (-1e60, 1.0)}),
    "file must be a path, got 5": lambda: pk.check_robot(5),
    "joint 'panda_joint1' must be from": lambda: pk.Arm.from_urdf(PANDA, tip="panda_hand", fixed={"panda_joint1": 99}),
    "joint joint1 must be from -1 to 1, got 3": lambda: arm(position_limits=1.0).fixed(joint1=3),
    "pose must be a Pose, got 5": lambda: arm().with_tool(5),
    "position limit: must contain": lambda: tracking(position=HUGE),
    "seed must be an integer of at least 0": lambda: pk.Tracking(
        arm(), PATH, objectives=[pk.kinetic_energy], seed="a", coefficients=4, differences="backward"
    ),
    "motion: time: must contain": lambda: pk.Motion(arm=arm(), time="x", q=np.zeros((3, 3))),
    "objective kinetic_energy must get a Motion, got int": lambda: pk.kinetic_energy(5),
    "unit must be printable text, got 5": lambda: own(unit=5),
    "front names .*'=x'": lambda: pk.solve(tracking(own(name="=x"))),
    "every evaluation failed, the first with: objective worn raised Attr": lambda: pk.plan(raising()),
    "initial must be genes, motions or a front, got int": lambda: solve(initial=5),
    "initial: must be an array of numbers, got rows": lambda: solve(initial=[[1, 2], [3]]),
    "time limit: must be finite, got inf": lambda: solve(time_limit=np.inf),
    "target must be 2 numbers, one per objective, got 5": lambda: solve(target=5),
    "algorithm must be a pymoo algorithm": lambda: solve(algorithm="nsga2"),
    "observe must be a function, got 5": lambda: solve(observe=5),
    "refine must be True or False, got 'no'": lambda: solve(refine="no"),
    "problem must be a pymoo problem, such as Tracking, got None": lambda: pk.Search(None),
    "plan: the problem must have gradients": lambda: pk.plan(pk.Tracking),
    "folder must be a path, got None": lambda: pk.load_front(None),
    "weights: torque must be a finite number >= 0, got 1000": lambda: pk.Weights(torque=HUGE),
    "select: must be a preference, such as .*class": lambda: solve().select(pk.Weights),
    "limits must be Limits, got 5": lambda: loop(limits=5),
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
@settings(max_examples=15, deadline=None)
def test_problems_of_any_size_have_finite_values_or_are_refused_beyond_what_numbers_hold(quantity, exponent):
    size = 10.0**exponent
    if 1e-45 < size < 1e45:
        problem = of_size(quantity, size)
        assert np.isfinite(problem.evaluate(np.full((1, problem.n_var), 0.5), return_values_of=["F"])).all()
    elif size > 1e51 or (size < 1e-51 and quantity in ("duration", "lengths")):
        with pytest.raises(pk.InvalidInput, match=r"1e[+-]50( m| s)?, got"):
            of_size(quantity, size)
