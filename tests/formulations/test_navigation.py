"""Moves along fronts of real problems: their points fulfil the request, are certified and new, and moves reverse."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import paretoik as pk
from paretoik.errors import Infeasible, InvalidInput
from paretoik.formulations.navigation import natural_weights
from paretoik.front.hypervolume import non_dominated
from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import violation_of
from paretoik.pareto.continuation import can_follow
from paretoik.pareto.navigation import OPTIONS, Aim, Wish


def line(samples):
    return pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=samples)


def tracking(*objectives, path=None, differences="spline", **limits):
    limits = {"position": np.deg2rad([90, 120, 120]), "velocity": 3.8, **limits}
    return pk.Tracking(
        pk.arms.tringali_3r(),
        line(21) if path is None else path,
        objectives=objectives,
        limits=pk.Limits(**limits),
        differences=differences,
        bases=2,
    )


def directions():
    return pk.DirectionalMaxima(pk.arms.kim_3r(), pk.capability.kim_joint_motors(), (0.15, 0.25), 2)


def sliders(cls, *arguments, **settings):
    return cls(pk.arms.kim_3r(), pk.capability.kim_sliders(), *arguments, **settings)


def speed_and_force():
    """Return speed upwards against force upwards: fast gears are weak."""
    ways = [[0.0, 1.0], [0.0, 1.0]]
    return sliders(pk.DirectionalMaxima, (0.2, -0.15), ways, quantity=("velocity", "force"), power=False)


def point_to_point():
    return sliders(pk.PointToPoint, (0.1, -0.15), (0.2, -0.15), samples=9, coefficients=5, bases=2)


MAKERS = {
    "two": lambda: tracking(pk.kinetic_energy, pk.torque_norm),
    "three": lambda: tracking(pk.kinetic_energy, pk.torque_norm, pk.joint_travel),
    "maximised": lambda: tracking(pk.kinetic_energy, pk.manipulability),
    "kinked": lambda: tracking(pk.kinetic_energy, pk.peak_velocity),
    "directions": directions,
    "point to point": point_to_point,
}


@cache
def front_of(name):
    return pk.epsilon_front(MAKERS[name](), points=5, starts=2, observe=False)


SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in ("two", "three", "point to point")]


@pytest.fixture(scope="module", params=["maximised", "kinked", "directions", *SLOW])
def front(request):
    return front_of(request.param)


@pytest.fixture(scope="module")
def plain():
    return front_of("two")


def inner_points(front):
    """Return the points that are not an end of the front."""
    ends = set(np.concatenate([front.minimised.argmin(axis=0), front.minimised.argmax(axis=0)]).tolist())
    return [int(front.ids[i]) for i in range(len(front)) if i not in ends]


def assert_kept(front, moved):
    """Check that points of the front are unchanged, unless they are dominated."""
    for id in front.ids:
        if id in moved.ids:
            before, after = front[int(id)], moved[int(id)]
            assert np.array_equal(before.objectives, after.objectives)
            if before.motion is not None:
                assert np.array_equal(before.motion.q, after.motion.q)
        else:
            assert int(id) in moved.provenance["navigations"][-1]["dominated"]


def test_a_move_gains_what_was_asked_is_certified_and_new(front):
    start = inner_points(front)[0]
    for k, name in enumerate(front.names):
        moved = front.navigate(start, improve=name)
        new, note = moved.navigated, moved.provenance["navigations"][-1]
        assert note["to"] == new.id
        change = (new.objectives - front[start].objectives)[k]
        assert abs(change) == pytest.approx(note["by"] * note["share"], rel=1e-5)
        assert (change > 0) == front.maximised[k]
        if note["new"]:
            assert new.id > front.ids.max()
            assert len(moved) == len(front) + 1 - len(note["dominated"])
            assert moved.certificates.criticality[new.index] <= 1e-6
            assert moved.certificates.violation[new.index] <= 1e-8
            assert non_dominated(moved.minimised).all()
        assert_kept(front, moved)
        assert new.verdict.startswith(f"From point {start} to ")


def assert_predicts(front, start, name):
    """Check that a followed move leads to its prediction, and that the prediction changes nothing."""
    wish = {"improve": name, "by": 0.01 * float(np.ptp(front.ranges[front.names.index(name)]))}
    note = front.navigate(start, **wish).provenance["navigations"][-1]
    assert note["followed"]
    prediction, ids = front.predict(start, **wish), front.ids.copy()
    change, led = prediction.objectives - front[start].objectives, np.array([note["change"][k] for k in front.names])
    widths = np.ptp(front.ranges, axis=1)
    assert change / widths == pytest.approx(led / widths, abs=1e-4)
    assert not hasattr(prediction, "id")
    assert np.array_equal(front.ids, ids)
    assert front.navigated is None
    if prediction.motion is not None and hasattr(front.problem, "task"):
        values = [each(prediction.motion) for each in front.problem.task.objectives]
        assert prediction.objectives == pytest.approx(np.array(values), rel=1e-9)


def test_a_prediction_is_where_a_small_move_leads(front):
    start, last = inner_points(front)[1], front.names[0]
    if can_follow(front.problem.program()):
        assert_predicts(front, start, last)
    else:
        with pytest.raises(InvalidInput, match="predict: optima cannot be followed"):
            front.predict(start, improve=last)


def test_moves_and_predictions_compute_with_one_blas_thread():
    threads = set[int]()

    @pk.objective(unit="rad²/s²", form="integral")
    def wrist_effort(motion):
        blas = [library for library in threadpool_info() if library["prefix"] == "libscipy_openblas"]
        threads.update(library["num_threads"] for library in blas)
        return motion.dq[..., -1] ** 2

    front = pk.epsilon_front(
        tracking(pk.kinetic_energy, wrist_effort, path=line(11)), points=3, starts=2, observe=False
    )
    with threadpool_limits(limits=3, user_api="blas"):
        for verb in (front.navigate, front.predict):
            threads.clear()
            verb(int(front.ids[1]), improve="wrist_effort")
            assert threads == {1}, verb


def test_small_moves_cost_what_exchange_rates_say():
    front = front_of("maximised")
    start = inner_points(front)[1]
    row = int(np.flatnonzero(front.ids == start)[0])
    moved = front.navigate(start, improve="kinetic_energy", by=2e-3 * float(np.ptp(front.ranges[0])))
    change = moved.navigated.objectives - front.objectives[row]
    assert change[1] / change[0] == pytest.approx(front.certificates.exchange_rates[row, 0, 1], rel=0.05)
    assert moved.provenance["navigations"][-1]["predicted"]["manipulability"] == pytest.approx(change[1], rel=0.05)


def test_a_part_of_a_front_never_reuses_an_id_of_the_whole(plain):
    part = plain[[id for id in plain.ids.tolist() if id != plain.ids.max()]]
    part = part.where(kinetic_energy=(None, float(np.sort(part.objectives[:, 0])[-2])))
    for start in part.ids.tolist()[1:3]:
        moved = part.navigate(start, improve="kinetic_energy")
        assert moved.provenance["navigations"][-1]["new"]
        assert moved.navigated.id > plain.ids.max()


def test_held_objectives_get_no_worse():
    front = front_of("three")
    start = max(front.ids, key=lambda id: front.certificates.weights[front[int(id)].index, 1:].min())
    before = front[int(start)]
    moved = front.navigate(before, improve="kinetic_energy", hold="joint_travel", by=0.02 * np.ptp(front.ranges[0]))
    change = moved.navigated.objectives - before.objectives
    widths = np.ptp(front.ranges, axis=1)
    assert change[2] <= 1e-7 * widths[2]
    assert change[0] < 0.0 < change[1]


def test_a_move_and_its_reverse_lead_back_to_the_start(plain):
    start = plain[inner_points(plain)[1]]
    by = 0.04 * float(np.ptp(plain.ranges[0]))
    there = plain.navigate(start, improve="kinetic_energy", by=by)
    torque = float(there.navigated.objectives[1] - start.objectives[1])
    back = there.navigate(there.navigated, improve="torque_norm", by=torque)
    assert back.navigated.id == start.id  # the point that is known already
    assert len(back) == len(there)
    assert "known already" in back.navigated.reason


def test_two_half_moves_lead_to_the_point_of_the_whole_move(plain):
    start, by = inner_points(plain)[1], 0.04 * float(np.ptp(plain.ranges[0]))
    whole = plain.navigate(start, improve="kinetic_energy", by=by).navigated
    half = plain.navigate(start, improve="kinetic_energy", by=by / 2)
    rest = half.navigate(half.navigated, improve="kinetic_energy", by=by / 2).navigated
    assert rest.objectives == pytest.approx(whole.objectives, rel=1e-6)
    assert rest.motion.q == pytest.approx(whole.motion.q, abs=1e-5)


def test_a_move_keeps_its_limits_between_samples(plain):
    moved = plain.navigate(inner_points(plain)[1], improve="torque_norm")
    assert moved.certificates.violation_between[moved.navigated.index] <= 1e-4


def best_from_all_points(problem, front, row, wish, barriers):
    """Return the least value of the payer that the solver finds from any point of the front; inf without any."""
    program, widths = problem.program(), np.ptp(front.ranges, axis=1)
    weights = natural_weights(front, row) * widths
    aim = Aim(
        wish=wish,
        ranges=widths,
        start=front.minimised[row],
        weights=weights / weights.sum(),
        objectives=len(program.upper),
    )
    goal, x, values = aim.at_share(1.0), problem.front_points(front), [np.inf]
    for barrier in barriers:
        upper = np.tile(goal.upper, (len(x), 1))
        solutions = minimise(program, x, goal.weights[None], upper, barrier, rows=goal.rows)
        for one in solutions.x[solutions.converged]:
            F, equalities, inequalities = program.evaluate(one)
            if violation_of(program, F, equalities, inequalities, goal.rows, goal.upper) <= 1e-8:
                values.append(F[wish.payers[0]])
    return min(values)


@pytest.mark.slow
def test_no_start_of_the_front_beats_a_move_next_to_a_jump_with_any_barrier():
    problem = tracking(pk.kinetic_energy, pk.torque_norm, path=line(51), differences="backward")
    front = pk.epsilon_front(problem, points=14, starts=12, observe=False)
    ((before, after),) = front.jumps
    widths, moves = np.ptp(front.ranges, axis=1), [(0, 0.05), (0, 0.15), (1, 0.05)]
    for id in (before, after, after + 1):
        for improve, by in moves:
            row, payer = front[id].index, 1 - improve
            wish = Wish(improve=improve, payers=(payer,), by=by)
            best = best_from_all_points(problem, front, row, wish, (*OPTIONS.barriers, OPTIONS.high))
            moved = front.navigate(id, improve=front.names[improve], by=by * widths[improve])
            assert moved.minimised[moved.navigated.index, payer] <= best + 1e-5 * widths[payer]


@pytest.mark.slow
def test_no_move_is_refused_if_any_point_of_the_front_leads_there():
    problem = pk.DirectionalMaxima(pk.arms.kim_3r(), pk.capability.kim_joint_motors(), (0.15, 0.25), 4)
    front = pk.epsilon_front(problem, points=12, starts=12, observe=False)
    widths, count = np.ptp(front.ranges, axis=1), 0
    for row, improve in ((row, k) for row in range(1, 4) for k in range(len(widths))):
        wish = Wish(improve=improve, payers=((improve + 1) % len(widths),), by=0.05)
        if np.isfinite(best_from_all_points(problem, front, row, wish, OPTIONS.barriers)):
            payer = front.names[wish.payers[0]]
            front.navigate(int(front.ids[row]), improve=front.names[improve], allow=payer, by=wish.by * widths[improve])
            count += 1
    assert count > 0


@pytest.mark.parametrize(
    ("verb", "words"),
    [("navigate", "no point within all limits was found"), ("predict", "no prediction was found for")],
)
def test_a_wish_beyond_the_front_is_refused(plain, verb, words):
    with pytest.raises(Infeasible, match=words):
        getattr(plain, verb)(inner_points(plain)[-1], improve="torque_norm", by=100 * float(np.ptp(plain.ranges[1])))


def test_a_move_along_a_front_without_curvature_finds_a_point():
    front = pk.epsilon_front(directions(), points=9, starts=8, observe=False, seed=3)
    moved = front.navigate(3, improve="speed_1", by=0.00137)
    change = moved.navigated.objectives - front[3].objectives
    assert change[front.names.index("speed_1")] == pytest.approx(0.00137, rel=1e-5)
    assert moved.certificates.criticality[moved.navigated.index] <= 1e-6


@pytest.mark.parametrize("make", [speed_and_force, pytest.param(point_to_point, marks=pytest.mark.slow)])
def test_branches_of_sliders_are_followed(make):
    front = pk.epsilon_front(make(), points=5, starts=4, observe=False)
    start = inner_points(front)[1]
    by = 0.02 * float(np.ptp(front.ranges[0]))
    note = front.navigate(start, improve=front.names[0], by=by).provenance["navigations"][-1]
    assert note["followed"]
    assert note["share"] == 1.0


def test_refinement_around_a_point_adds_certified_points(plain):
    start = inner_points(plain)[1]
    denser = plain.refine_around(start, points=4)
    new = [int(id) for id in denser.ids if id not in plain.ids]
    assert len(new) == 4
    assert denser.certificates.criticality.max() <= 1e-6
    here = denser[start].objectives[0]
    assert sum(denser[id].objectives[0] < here for id in new) == 2
    assert_kept(plain, denser)
