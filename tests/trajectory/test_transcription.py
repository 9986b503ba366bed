import numpy as np

from paretoik.task.random_starts import rollout_starts
from paretoik.trajectory.transcription import motion_program
from problems import tringali_2020


def sample_inputs(program, q, factors, multipliers):
    """Return inputs of the evaluators at a motion, with multipliers of sums and rows."""
    inputs = program.values(q).inputs
    _, sums, rows = program.evaluators.multipliers
    inputs[sums:rows] = factors[:, None] * program.task.weights
    inputs[rows:] = multipliers
    return inputs


def motion_of(task, seed=0):
    return rollout_starts(task, 8, np.random.default_rng(seed))[0]


def test_slopes_and_second_derivatives_are_those_of_central_differences():
    task = tringali_2020.simulation_5().task
    program = motion_program(task)
    evaluators, rng = program.evaluators, np.random.default_rng(0)
    first, second = evaluators.gradient_sparsity, evaluators.hessian_sparsity
    factors = rng.uniform(0.5, 2.0, size=program.sums)
    multipliers = rng.normal(size=(len(program.rows), len(task.times)))
    inputs = sample_inputs(program, motion_of(task), factors, multipliers)
    variables = program.stencil.coefficients.shape[0] * task.arm.dof
    functions = program.sums + len(program.rows)
    weights = inputs[evaluators.multipliers[1] :]

    def lagrangian_slope(at):
        table = np.zeros((variables, at.shape[1]))
        for k, j, values in zip(first.rows, first.columns, evaluators.gradient(at)[functions:], strict=True):
            table[j] += weights[k] * values
        return table

    slope, step = lagrangian_slope(inputs), 1e-6
    curvature = np.zeros((variables, variables, len(task.times)))
    for i, j, values in zip(second.rows, second.columns, evaluators.hessian(inputs), strict=True):
        curvature[i, j] = curvature[j, i] = values
    for j in range(variables):
        ahead, behind = inputs.copy(), inputs.copy()
        ahead[j] += step
        behind[j] -= step
        change = np.sum(weights * (evaluators.value(ahead) - evaluators.value(behind)), axis=0)
        assert np.allclose(slope[j], change / (2 * step), rtol=1e-6, atol=1e-7 * np.abs(slope).max())
        change = lagrangian_slope(ahead) - lagrangian_slope(behind)
        assert np.allclose(curvature[:, j], change / (2 * step), rtol=1e-6, atol=1e-7 * np.abs(curvature).max())
