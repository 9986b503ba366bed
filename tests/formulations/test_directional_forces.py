"""Forces in several directions from one posture: virtual work, linear programs, all postures, and laws of scale."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

import paretoik as pk
from paretoik.errors import InvalidInput
from tests.robot.planar_postures import all_postures, statics

PLACE = np.array([0.2, -0.15])
WAYS = np.array([[1.0, 0.0], [0.0, 1.0]])
ARM = pk.arms.kim_3r()
LENGTHS = np.array([0.114, 0.114, 0.129])
OF_KIM_3R = {"lengths": LENGTHS, "masses": np.full(3, 0.5), "centers": LENGTHS / 2, "gravity": (0.0, -9.81)}
MOTORS, SLIDERS = pk.capability.kim_joint_motors(), pk.capability.kim_sliders()
DRIVES = {"motors": MOTORS, "sliders": SLIDERS}
seeds = st.integers(min_value=0, max_value=2**32 - 1)


def forces(drive, ways=WAYS, arm=ARM, **changed):
    return pk.DirectionalMaxima(arm, drive, PLACE, ways, **{"quantity": "force", "starts": 60, **changed})


def random_genes(problem, count, rng):
    return problem.xl + rng.uniform(size=(count, problem.n_var)) * (problem.xu - problem.xl)


def gears(q, front):
    """Return the turn of rods' joints per move of either slider, by differences of the law of cosines."""
    angle, rod, step = q - SLIDERS.zero, SLIDERS.rod, 1e-7
    back = -front * np.cos(angle) + np.sqrt(rod**2 - (front * np.sin(angle)) ** 2)

    def turned(s, b):
        return np.arccos((rod**2 - s**2 - b**2) / (2 * s * b))

    with np.errstate(invalid="ignore", divide="ignore"):  # back sliders beyond their bounds
        ahead = turned(front + step, back) - turned(front - step, back)
        behind = turned(front, back + step) - turned(front, back - step)
        return back, np.abs(np.stack([ahead, behind], axis=-2)) / (2 * step)


def capacities(name, q, front):
    """Return the torques that joints can hold (postures, 3); NaN if the back slider exceeds its bounds."""
    if name == "motors":
        return np.broadcast_to(MOTORS.motors.stall, q.shape)
    back, ratios = gears(q, front)
    low, high = SLIDERS.back_bounds.T
    inside = (back >= low - 1e-7) & (back <= high + 1e-7)
    with np.errstate(divide="ignore"):
        return np.where(inside, (np.stack([c.stall for c in SLIDERS.curves]) / ratios).min(axis=-2), np.nan)


@pytest.mark.parametrize("name", DRIVES)
def test_individuals_push_until_a_motor_stalls(name):
    problem, rng = forces(DRIVES[name]), np.random.default_rng(0)
    genes = random_genes(problem, 2000, rng)
    at, G = problem.configuration(genes), problem.evaluate(genes, return_values_of=["G"])
    allowed = (G <= 0).all(axis=1)
    assert allowed.sum() >= 20
    q, front, values = at.q[allowed], at.front[allowed], at.values[allowed]
    tool, columns, load = statics(q, **OF_KIM_3R)
    assert tool == pytest.approx(np.tile(PLACE, (len(q), 1)), abs=1e-9)
    capacity = capacities(name, q, front)
    for k, way in enumerate(WAYS):
        torque = load + values[:, k, None] * np.einsum("paj,a->pj", columns, way)
        assert np.max(np.abs(torque) / capacity, axis=1) == pytest.approx(np.ones(len(q)), rel=1e-6)
    assert at.dq.shape == (len(genes), 0, 3)


@given(seed=seeds)
@settings(max_examples=10)
def test_the_greatest_force_is_the_least_work_of_stalled_motors_to_move_the_tool_by_a_unit(seed):
    """Check the dual program: least Σ stall |δq| − g δq over joint moves δq that move the tool by 1 along d."""
    rng = np.random.default_rng(seed)
    way = rng.normal(size=2)
    way /= np.linalg.norm(way)
    problem = forces(MOTORS, [way], starts=8)
    genes = random_genes(problem, 1, rng)
    at = problem.configuration(genes)
    assume(problem.evaluate(genes, return_values_of=["G"]).max() <= 0)
    _, columns, load = statics(at.q, **OF_KIM_3R)
    share, stall = way @ columns[0], MOTORS.motors.stall
    best = linprog(np.concatenate([stall - load[0], stall + load[0]]), A_eq=[[*share, *-share]], b_eq=[1.0])
    assert at.values[0, 0] == pytest.approx(best.fun, rel=1e-9)


def all_forces(name, q):
    """Return the greatest forces (postures, 2) over all sliders; NaN if the arm cannot be held."""
    if name == "motors":
        capacity = capacities(name, q, 0.0)
    else:
        q = SLIDERS.zero + (q - SLIDERS.zero) % (2 * np.pi)
        places = np.linspace(*SLIDERS.front_bounds[0], 401)  # a joint's slider holds for all directions at once
        with np.errstate(invalid="ignore"):
            capacity = np.max([np.nan_to_num(capacities(name, q, place)) for place in places], axis=0)
        floor = SLIDERS.least_angle
        capacity = np.where((q - SLIDERS.zero >= floor) & (q - SLIDERS.zero <= np.pi - floor), capacity, 0.0)
    _, columns, load = statics(q, **OF_KIM_3R)
    share = np.einsum("ka,paj->pkj", WAYS, columns)
    with np.errstate(divide="ignore"):  # some bear nothing
        left = (capacity[:, None] - np.sign(share) * load[:, None]) / np.abs(share)
    return np.where((np.abs(load) < capacity).all(axis=1)[:, None], left.min(axis=2), np.nan)


@pytest.mark.parametrize("name", DRIVES)
def test_no_posture_pushes_harder_both_ways_than_the_refined_front(name):
    refined = pk.solve(forces(DRIVES[name]), population=32, generations=10, seed=1, points=12, refine=True)
    assert (refined.certificates.status == "minimum").all()
    assert refined.certificates.criticality.max() <= 1e-7
    everything = all_forces(name, all_postures(LENGTHS, PLACE, np.linspace(-np.pi, np.pi, 20_000, endpoint=False)))
    everything = everything[np.isfinite(everything).all(axis=1)]
    size = everything.max(axis=0)
    for one in refined.objectives / size:
        assert (everything / size - one).min(axis=1).max() <= 1e-6  # none is better in both
    for one in everything[:: max(1, len(everything) // 500)] / size:
        assert (refined.objectives / size - one).min(axis=1).max() >= -0.05  # and the refined front covers all
    assert refined.objectives.max(axis=0) / size == pytest.approx([1.0, 1.0], abs=1e-3)


@pytest.mark.parametrize("name", DRIVES)
def test_speed_times_force_is_no_more_than_motors_and_weight_can_give(name):
    """Check virtual work along one direction: f v = Σ (τ − g) q̇, |τ| ≤ stall, |q̇| ≤ the highest of all gears."""
    drive = DRIVES[name]
    problem = forces(drive, [WAYS[1], WAYS[1]], quantity=["velocity", "force"])
    genes = random_genes(problem, 5000, np.random.default_rng(3))
    genes = genes[(problem.evaluate(genes, return_values_of=["G"]) <= 0).all(axis=1)]
    at = problem.configuration(genes)
    assert len(genes) >= 20
    load, capacity = statics(at.q, **OF_KIM_3R)[2], capacities(name, at.q, at.front)
    work = ((capacity + np.abs(load)) * np.abs(at.dq[:, 0])).sum(axis=1)
    assert (at.values.prod(axis=1) <= work * (1 + 1e-6)).all()


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"quantity": ["force"]}, r"a list of 2, one per direction, got \['force'\]"),
        ({"power": True}, "power must be False if all quantities are forces, got True"),
    ],
)
def test_what_cannot_be_is_refused_by_name(changed, message):
    with pytest.raises(InvalidInput, match=message):
        forces(MOTORS, **changed)


def test_forces_that_no_motor_bounds_are_refused_by_direction():
    endless = pk.capability.MotorCurve(stall=[np.inf] * 3, fastest=[1.0] * 3)
    with pytest.raises(InvalidInput, match="must have a motor with a finite stall, got none"):
        forces(pk.capability.JointActuation(motors=endless))
    first = pk.capability.MotorCurve(stall=[12.3, np.inf, np.inf], fastest=[1.0] * 3)
    one = pk.capability.JointActuation(motors=first)  # bears no force that points away from it
    assert np.isfinite(forces(one).sizes).all()
    with pytest.raises(InvalidInput, match=r"direction 2 must load a motor of Kim 3R, got \["):
        forces(one, [WAYS[0], PLACE])


def test_an_individual_whose_force_has_no_bounds_fails_and_says_so(monkeypatch):
    problem = forces(MOTORS)
    genes = random_genes(problem, 4, np.random.default_rng(0))
    at = problem.configuration(genes)
    at.values[1, 0] = np.inf
    monkeypatch.setattr(problem, "configuration", lambda _: at)
    F, G, causes = problem.evaluate(genes, return_values_of=["F", "G", "cause"])
    assert np.isfinite(F).all()
    assert G[1].max() > 0
    assert [bool(cause) for cause in causes] == [False, True, False, False]
