import numpy as np
import pytest
from pymoo.optimize import minimize

import paretoik as pk
from paretoik.closed_loop.objectives import Step, of_step, step_objective
from paretoik.closed_loop.step import ControlStep
from paretoik.errors import InvalidInput
from paretoik.formulations.closed_loop import ClosedLoop
from paretoik.formulations.closed_loop_result import chosen
from problems import marcos_2012
from tests.closed_loop.postures import posture


@pytest.fixture(params=[3, 4])
def step(request):
    loop = marcos_2012.loop(request.param, 0.7, start=posture(request.param), steps=4, as_printed=True)
    return ControlStep(loop.instant(1), loop.objectives)


def forward(q):
    angles = np.cumsum(q, axis=-1)
    return np.stack([np.cos(angles).sum(axis=-1), np.sin(angles).sum(axis=-1)], axis=-1)


def test_genes_extend_the_jacobian_to_a_square_system(step):
    genes = np.random.default_rng(0).uniform(-1, 1, size=(20, step.n_var))
    q, instant = step.decode(genes), step.instant
    wanted, jacobian = instant.asked()
    moved = q - instant.previous
    np.testing.assert_allclose(moved @ jacobian.T, np.tile(wanted, (20, 1)), atol=1e-12)
    rows = genes.reshape(20, step.rows, step.row)
    np.testing.assert_allclose(np.einsum("prk,pk->pr", rows[..., :-1], moved), rows[..., -1], atol=1e-9)


def test_objectives_are_those_of_the_paper_by_hand(step):
    instant, genes = step.instant, np.random.default_rng(1).uniform(-1, 1, size=(30, step.n_var))
    q = step.decode(genes)
    moved = (q - instant.previous) / 1e-3
    away = (q - instant.home) / 1e-3
    target = np.array([0.7 + 0.5 * np.cos(7e-3), 0.5 * np.sin(7e-3)])
    F = step.evaluate(genes, return_values_of=["F"])
    np.testing.assert_allclose(F[:, 0], (moved**2).sum(1) + (away**2).sum(1), rtol=1e-9)
    np.testing.assert_allclose(F[:, 1], np.linalg.norm(forward(q) - target, axis=1), rtol=1e-9, atol=1e-15)


def test_a_singular_system_is_worth_nothing(step):
    genes = np.zeros((1, step.n_var))
    assert np.isnan(step.decode(genes)).all()
    assert np.isinf(step.evaluate(genes, return_values_of=["F"])).all()


def test_any_pymoo_algorithm_solves_a_step(step):
    found = minimize(step, step.algorithm(24), ("n_gen", 12), seed=1)
    drawn = step.evaluate(np.random.default_rng(0).uniform(-1, 1, size=(500, step.n_var)), return_values_of=["F"])
    assert found.F.shape[1] == 2
    assert np.all(found.F.min(axis=0) < 0.1 * np.median(drawn, axis=0))
    assert (found.G <= 0).all()


def test_the_least_weighted_sum_is_chosen_of_objectives_scaled_to_the_front():
    F = np.array([[0.0, 10.0], [1.0, 4.0], [10.0, 0.0]])
    assert chosen(F, np.array([1.0, 0.0])) == 0
    assert chosen(F, np.array([0.0, 1.0])) == 2
    assert chosen(F, np.array([0.5, 0.5])) == 1
    assert chosen(1e6 * F + 3, np.array([0.5, 0.5])) == 1
    assert chosen(F[:1], np.array([0.5, 0.5])) == 0


@step_objective(unit="rad")
def elbow(step: Step):
    return np.abs(step.motion.q[..., 1])


@pk.objective(unit="rad", form="general")
def whole(motion):
    return motion.q[..., 0, 0]


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"weights": [1.0, 2.0, 3.0]}, "weights"),
        ({"weights": [-1.0, 2.0]}, "weights: none below 0"),
        ({"longest_step": 0.0}, "longest_step: a positive number wanted"),
        ({"population": 2}, "population: an integer of at least 4"),
        ({"start": [0.0, 1.0]}, "start"),
        ({"objectives": []}, "objectives: wants at least one"),
        ({"start": [4.0, 0.0, 0.0], "limits": pk.Limits(position=3.0)}, "start: .* must lie within -3 to 3, got 4"),
        (
            {"obstacles": [pk.obstacles.Circle([0.5, 0.2], 1.0)]},
            "start: must be clear of obstacles, got -.* from obstacle 1 of 1",
        ),
        ({"limits": pk.Limits(torque=3.0)}, "limits: of position, velocity and clearance wanted .*, got torque"),
        ({"weights": pk.Weights(elbow=1.0)}, "weights: wanted names among joint_displacement, position_error"),
        ({"objectives": [elbow, elbow]}, "names must differ"),
        ({"objectives": [elbow, whole]}, "objective whole looks at a whole motion"),
    ],
)
def test_what_cannot_be_used_is_named(settings, said):
    path = marcos_2012.round_trip(0.7, 4)
    with pytest.raises(InvalidInput, match=said):
        ClosedLoop(pk.arms.marcos_nr(3), path, **{"start": posture(3), **settings})


def test_times_that_are_not_even_are_refused():
    path = pk.poses([0.0, 0.1, 0.5, 0.6], [pk.Pose(np.array([1.2, y, 0.0])) for y in (0.0, 0.01, 0.02, 0.03)])
    with pytest.raises(InvalidInput, match="evenly spaced"):
        ClosedLoop(pk.arms.marcos_nr(4), pk.Task(path, axes="xy"), start=posture(4))


def test_an_objective_that_looks_at_other_samples_is_named():
    @step_objective(unit="rad")
    def mean(step):
        return step.motion.q[..., 0].mean(axis=-1)

    loop = ClosedLoop(pk.arms.marcos_nr(3), marcos_2012.round_trip(0.7, 4), objectives=[elbow, mean], start=posture(3))
    with pytest.raises(InvalidInput, match="objective mean"):
        loop.search()


def test_maximised_and_library_objectives_are_steps_objectives():
    assert of_step(pk.manipulability).sign == -1.0
    assert of_step(elbow) is elbow
