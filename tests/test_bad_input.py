"""Inputs that once ended in an error from inside: the public face refuses each in one line."""

from __future__ import annotations

import numpy as np
import pytest

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
    "position_limits: must hold": lambda: arm(position_limits={}),
    "velocity_limits: must hold real numbers, got text": lambda: arm(velocity_limits="fast"),
    "file: a path wanted, got None": lambda: pk.Arm.from_urdf(None),
    "file: a path wanted, got 5": lambda: pk.check_robot(5),
    "joint 'panda_joint1': must hold": lambda: pk.Arm.from_urdf(PANDA, tip="panda_hand", fixed={"panda_joint1": "x"}),
    "joint 'panda_joint1': a value from": lambda: pk.Arm.from_urdf(PANDA, tip="panda_hand", fixed={"panda_joint1": 99}),
    "fixed: values by joint wanted": lambda: pk.Arm.from_urdf(PANDA, tip="panda_hand", fixed=["panda_joint1"]),
    "joint joint1: must hold": lambda: arm().fixed(joint1="x"),
    "joint joint1: a value from -1 to 1 wanted, got 3": lambda: arm(position_limits=1.0).fixed(joint1=3),
    "pose: a Pose wanted, got 5": lambda: arm().with_tool(5),
    "base: a Pose wanted, got 5": lambda: arm().mounted(base=5),
    "gravity: must hold": lambda: arm().mounted(gravity="down"),
    "payload: mass: must hold": lambda: arm().with_payload("heavy"),
    "margin: must hold": lambda: tracking(margin="x"),
    "clearance limit: must hold": lambda: tracking(clearance=None),
    "position limit: must hold": lambda: tracking(position=HUGE),
    "velocity limit: must hold": lambda: tracking(velocity=True),
    "path: a Path wanted": lambda: pk.Task(5),
    "axes must be one of": lambda: pk.Task(PATH, axes=[]),
    "seed: an integer of at least 0 wanted": lambda: pk.Tracking(
        arm(), PATH, objectives=[pk.kinetic_energy], seed="a", coefficients=4, differences="backward"
    ),
    "motion: time: must hold": lambda: pk.Motion(arm=arm(), time="x", q=np.zeros((3, 3))),
    "objective kinetic_energy: a Motion wanted, got int": lambda: pk.kinetic_energy(5),
    "unit: printable text wanted, got 5": lambda: own(unit=5),
    "name: printable text wanted, got 5": lambda: own(name=5),
    "maximise: True or False wanted, got 'no'": lambda: own(maximise="no"),
    "front names: .*'=x'": lambda: pk.solve(tracking(own(name="=x"))),
    "front names: .*' x '": lambda: pk.epsilon_front(tracking(own(name=" x "), pk.jerk)),
    "front names: .*'id'": lambda: pk.plan(tracking(own(name="id"))),
    "every evaluation failed, the first with: objective worn raised Attr": lambda: pk.plan(raising()),
    "generations: an integer of at least 1 wanted, got '3'": lambda: solve(generations="3"),
    "out: a path wanted, got 5": lambda: solve(out=5),
    "initial: genes, motions or a front wanted, got int": lambda: solve(initial=5),
    "initial: must be an array of numbers, got rows": lambda: solve(initial=[[1, 2], [3]]),
    "time limit: must hold": lambda: solve(time_limit="x"),
    "time limit: must be finite, got inf": lambda: solve(time_limit=np.inf),
    "target: wants 2 numbers, one an objective, got 5": lambda: solve(target=5),
    "target: must hold": lambda: solve(target="ab"),
    "algorithm: a pymoo algorithm wanted": lambda: solve(algorithm="nsga2"),
    "observe: a function wanted, got 5": lambda: solve(observe=5),
    "refine: True or False wanted, got 'no'": lambda: solve(refine="no"),
    "overwrite: True or False wanted, got 'no'": lambda: solve(overwrite="no"),
    "stagnation: True or False wanted, got 5": lambda: solve(stagnation=5),
    "refine: a front wanted, got None": lambda: pk.refine(None),
    "problem: a pymoo problem wanted, such as Tracking, got None": lambda: pk.Search(None),
    "plan: a problem with gradients wanted": lambda: pk.plan(pk.Tracking),
    "initial: motions wanted, got int": lambda: pk.plan(tracking(pk.kinetic_energy), initial=5),
    "folder: a path wanted, got None": lambda: pk.load_front(None),
    "folder: a path wanted, got 5": lambda: pk.Front.load(5),
    "weights: numbers by objective wanted": lambda: pk.Weights([1, 2]),
    "weights: wanted a finite number >= 0 for torque, got 1000": lambda: pk.Weights(torque=HUGE),
    "select: a preference wanted": lambda: solve().select(None),
    "select: a preference wanted, such as .*class": lambda: solve().select(pk.Weights),
    "objectives: a list of them wanted, got 5": lambda: loop(objectives=5),
    "limits: Limits wanted, got 5": lambda: loop(limits=5),
    "longest_step: must hold": lambda: loop(longest_step="far"),
    "warm_start: True or False wanted": lambda: loop(warm_start="no"),
}


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("words", INPUTS)
def test_what_makes_no_sense_is_refused_in_one_line(words):
    with pytest.raises(pk.ParetoikError, match=words) as refused:
        INPUTS[words]()
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 300
