import numpy as np

from paretoik.closed_loop.loop import choose, nondominated
from paretoik.closed_loop.step_evolution import Population


def test_the_least_weighted_sum_is_chosen_of_objectives_scaled_to_the_front():
    F = np.array([[0.0, 10.0], [1.0, 4.0], [10.0, 0.0]])
    assert choose(F, np.array([1.0, 0.0])) == 0
    assert choose(F, np.array([0.0, 1.0])) == 2
    assert choose(F, np.array([0.5, 0.5])) == 1
    assert choose(1e6 * F + 3, np.array([0.5, 0.5])) == 1
    assert choose(F[:1], np.array([0.5, 0.5])) == 0


def test_fronts_are_non_dominated_and_sorted_by_the_first_objective():
    F = np.array([[3.0, 0.0], [1.0, 1.0], [0.0, 3.0], [1.0, 2.0], [3.0, 0.0]])
    front = nondominated(Population(genes=np.arange(5.0)[:, None], F=F, q=np.zeros((5, 3))))
    np.testing.assert_array_equal(front.F, [[0.0, 3.0], [1.0, 1.0], [3.0, 0.0]])
