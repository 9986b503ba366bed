"""Results do not depend on units: the same motions, the same number of optima, and the same front."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest

import paretoik as pk
from paretoik.task.random_starts import rollout_starts
from paretoik.trajectory.transcription import motion_program
from tests.trajectory.scaled_problems import Units, of_a_panda, on_a_rail, past_an_obstacle, straight

OTHERS = {
    "hundredths of a second": Units(time=0.01),
    "a thousand seconds": Units(time=1000.0),
    "millimetres": Units(length=1e-3),
    "a hundredth of a metre": Units(length=0.01),
    "a hundred metres": Units(length=100.0),
    "milligrams": Units(mass=1e-6),
    "thousands of tons": Units(mass=1e6),
    "a millionth of the objective": Units(objective=1e-6),
    "a million times the objective": Units(objective=1e6),
    "all of them": Units(time=30.0, length=0.02, mass=300.0, objective=1e-4),
}
SI = Units()
POWERS_OF_TWO = Units(time=2.0**5, length=2.0**-6, mass=2.0**8, objective=2.0**-13)  # which round nothing

PROBLEMS = {
    "torques and powers": partial(
        straight, objectives=["torque_norm"], limits={"velocity": 3.8, "torque": 0.4, "power": 0.7}
    ),
    "accelerations": partial(
        straight, objectives=["kinetic_energy"], limits={"velocity": 3.8, "acceleration": 40.0}, differences="central"
    ),
    "a spline": partial(
        straight, objectives=["torque_norm"], limits={"velocity": 3.8, "torque": 0.4}, differences="spline", samples=26
    ),
    "an obstacle": partial(past_an_obstacle, objectives=["kinetic_energy"]),
    "a rail": partial(on_a_rail, objectives=["kinetic_energy"]),
    "a rail, spline": partial(on_a_rail, objectives=["kinetic_energy"], differences="spline"),
    "a panda": partial(of_a_panda, objectives=["kinetic_energy"]),
}
SLOW = ("an obstacle", "a rail, spline", "a panda")
FRONTS = {
    "energy and torque": partial(straight, objectives=["kinetic_energy", "torque_norm"], samples=26),
    "a rail": partial(on_a_rail, objectives=["kinetic_energy", "mechanical_energy"], joints=2),
    "a peak": partial(straight, objectives=["kinetic_energy", "peak_torque"], samples=26),
    "a panda": partial(of_a_panda, objectives=["kinetic_energy", "torque_norm"]),
}


@cache
def planned(name, units):
    return pk.plan(PROBLEMS[name](units), starts=8, seed=0)


def assert_same(values, motions, other_values, other_motions, units, names):
    """The same values and motions except for their units."""
    factors = np.array([units.of_objective(name) for name in names])
    np.testing.assert_allclose(np.asarray(other_values) / factors, values, rtol=1e-6)
    lengths = np.where(motions.arm.periodic, 1.0, units.length)
    np.testing.assert_allclose(other_motions.q / lengths, motions.q, rtol=0, atol=1e-6)


def is_quick(name, unit):
    """Return whether the default run has a case: one problem in units of each kind, and most in all at once."""
    kinds = ("a thousand seconds", "a hundredth of a metre", "milligrams")
    return (unit == "all of them" and name not in SLOW) or (name == "torques and powers" and unit in kinds)


CASES = [
    pytest.param(name, unit, marks=[] if is_quick(name, unit) else pytest.mark.slow)
    for name in PROBLEMS
    for unit in OTHERS
]


@pytest.mark.parametrize(("name", "unit"), CASES)
def test_a_plan_is_the_same_in_every_unit(name, unit):
    one, other, units = planned(name, SI), planned(name, OTHERS[unit]), OTHERS[unit]
    assert len(other.optima) == len(one.optima)
    assert [each.label for each in other.optima] == [each.label for each in one.optima]
    for optimum, scaled in zip(one.optima, other.optima, strict=True):
        objective = PROBLEMS[name].keywords["objectives"]
        assert_same([optimum.objective], optimum.motion, [scaled.objective], scaled.motion, units, objective)


@pytest.mark.parametrize("unit", OTHERS)
def test_violations_are_shares_of_what_the_problem_itself_is_like(unit):
    """Limits that are all 0 have no size of their own, and neither has a clearance of 0."""
    above, below = (0.0, np.inf), (-np.inf, 0.0)
    limits = {"velocity": above, "acceleration": below, "torque": above, "power": below}
    shares = []
    for units in (SI, OTHERS[unit]):
        task = past_an_obstacle(units, ["kinetic_energy"], limits=limits, clearance=0.0).task
        program, q = motion_program(task), rollout_starts(task, 4, np.random.default_rng(0))
        violations = task.violations(task.motion(q))
        assert violations.max() > 0.1
        shares.append(np.concatenate([violations.ravel(), *(program.evaluate(one)[2] for one in q)]))
    np.testing.assert_allclose(shares[1], shares[0], rtol=1e-6, atol=1e-9)


def assert_same_front(verb, name, units):
    one, other = verb(FRONTS[name](SI)), verb(FRONTS[name](units))
    assert len(other) == len(one)
    assert_same(one.objectives, one.motions, other.objectives, other.motions, units, one.names)


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name != "a rail")) for name in FRONTS])
def test_a_certified_front_is_the_same_in_other_units(name):
    assert_same_front(partial(pk.epsilon_front, points=4, starts=8), name, POWERS_OF_TWO)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name == "a panda")) for name in FRONTS]
)
def test_a_search_is_the_same_in_other_units(name):
    """Evolution ends elsewhere after the smallest rounding, and these units cause no rounding."""
    assert_same_front(partial(pk.solve, population=16, generations=5, seed=1), name, POWERS_OF_TWO)
