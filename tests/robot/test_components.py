"""Component algebra agrees with NumPy and simplifies 0 and 1; batches have any shape, type and order."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.robot import components, dynamics, kinematics
from paretoik.robot.arms import tringali_3r
from paretoik.robot.components import to_vector

RNG = np.random.default_rng(0)
A = RNG.normal(size=(3, 5))  # a vector of components over five samples


def test_products_and_sums_with_zero_and_one_are_folded_away():
    x = A[0]
    assert components.times(0.0, x) == 0.0
    assert components.times(x, 1.0) is x
    assert components.plus(0.0, x) is x
    assert components.minus(x, 0.0) is x
    assert np.array_equal(components.times(-1.0, x), -x)
    assert np.array_equal(components.minus(0.0, x), -x)
    vector = tuple(A)
    assert components.dot(to_vector(np.array([0.0, 1.0, 0.0])), vector) is vector[1]


KERNELS = {
    "rotation": (lambda arm, q, dq, ddq: kinematics.forward_kinematics(arm, q)[0], lambda dof: (3, 3)),
    "position": (lambda arm, q, dq, ddq: kinematics.forward_kinematics(arm, q)[1], lambda dof: (3,)),
    "jacobian": (lambda arm, q, dq, ddq: kinematics.jacobian(arm, q), lambda dof: (6, dof)),
    "link_nodes": (lambda arm, q, dq, ddq: kinematics.link_nodes(arm, q), lambda dof: (dof + 2, 3)),
    "inverse_dynamics": (dynamics.inverse_dynamics, lambda dof: (dof,)),
    "inertia_matrix": (lambda arm, q, dq, ddq: dynamics.inertia_matrix(arm, q), lambda dof: (dof, dof)),
    "kinetic_energy": (lambda arm, q, dq, ddq: dynamics.kinetic_energy(arm, q, dq), lambda dof: ()),
}


@pytest.mark.parametrize("name", KERNELS)
@pytest.mark.parametrize("batch", [(), (0,), (4, 2, 1000)])
def test_batches_of_any_shape_are_their_samples_one_by_one_to_the_bit(panda_arm, name, batch):
    kernel, shape = KERNELS[name]
    for arm in (panda_arm, tringali_3r("fitted").mounted(gravity=(0.0, -9.81, 0.0))):
        state = np.random.default_rng(1).normal(size=(3, *batch, arm.dof))
        whole = kernel(arm, *state)
        assert whole.shape == (*batch, *shape(arm.dof))
        assert whole.dtype == float
        flat, result = state.reshape(3, -1, arm.dof), whole.reshape(-1, *shape(arm.dof))
        for i in range(0, flat.shape[1], max(1, flat.shape[1] // 10)):
            assert np.array_equal(kernel(arm, *flat[:, i]), result[i])
