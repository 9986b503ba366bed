"""Epigraph reformulation: same values and derivatives, smooth, with active constraints."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from paretoik.autodiff.differentiation import dependencies, gradient
from paretoik.autodiff.evaluator import compile_evaluator
from paretoik.autodiff.kinks import (
    NONSMOOTH,
    copy_entries,
    norm_terms,
    reformulate_choices,
    reformulate_kinks,
    remaining_kinks,
    smooth_pieces,
    substitute,
)
from paretoik.autodiff.opcodes import Op
from paretoik.autodiff.tape import Tape, as_entry, where
from paretoik.errors import InvalidInput
from tests.autodiff.trees import KINKED, SMOOTH, evaluated, points, seeds, taped, trees

PROBES = np.random.default_rng(0).normal(scale=2.0, size=(3, 200))
CONVEX = {
    "maximum of three": lambda x, y, z: np.maximum(np.maximum(x, y), z),
    "absolute in a maximum": lambda x, y, z: np.maximum(np.abs(x), y) + z,
    "minimum, subtracted": lambda x, y, z: z - 2.0 * np.minimum(x, y),
    "squared absolute": lambda x, y, z: (np.abs(x) + 1.0) ** 2 + y,
    "growing in both": lambda x, y, z: np.exp(np.maximum(x, 0.0)) + np.hypot(y, 1.0) + z,
}
UNCHANGED = {
    "concave": (lambda x, y, z: y - np.abs(x), 1),
    "minimum": (lambda x, y, z: np.minimum(x, y) + z, 1),
    "convex but to be large": (lambda x, y, z: np.abs(x) + y, -1),
    "of no sense": (lambda x, y, z: np.abs(x) + y, 0),
    "flat at the kink": (lambda x, y, z: np.maximum(x, 0.0) ** 2 + y, 1),
    "growing and falling": (lambda x, y, z: np.abs(x) * z, 1),
}


def reformulation(function, sense=1, excluded=()):
    tape = Tape()
    x, y, z = (tape.input() for _ in range(3))
    entry = as_entry(tape, function(x, y, z))
    return tape, entry, reformulate_kinks(tape, [entry], [sense], PROBES, excluded)


def inputs_with_nodes(tape, result, points):
    """Return inputs at which every epigraph variable equals its node."""
    inputs = np.concatenate([points, np.zeros((len(tape.inputs) - 3, points.shape[1]))])
    for _ in result.nodes:  # a node may contain the variable of another
        for variable, values in zip(
            result.epigraph_variables, compile_evaluator(tape, result.nodes)(inputs), strict=True
        ):
            inputs[tape.entries[variable][1]] = values
    return inputs


@pytest.mark.parametrize("function", CONVEX.values(), ids=CONVEX.keys())
def test_values_are_those_of_the_function_where_variables_are_those_of_their_nodes(function):
    tape, entry, result = reformulation(function)
    inputs = inputs_with_nodes(tape, result, PROBES)
    old, new = compile_evaluator(tape, [entry, *result.functions])(inputs)
    assert remaining_kinks(tape, result) == []
    np.testing.assert_allclose(new, old, rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(new, function(*PROBES), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("function", CONVEX.values(), ids=CONVEX.keys())
def test_constraints_hold_and_one_of_each_pair_with_equality(function):
    tape, _, result = reformulation(function)
    values = compile_evaluator(tape, result.constraints)(inputs_with_nodes(tape, result, PROBES))
    assert len(values) == 2 * len(result.nodes)
    pairs = values.reshape(len(result.nodes), 2, -1)
    np.testing.assert_allclose(pairs.min(axis=1), 0.0, rtol=0, atol=1e-14)
    assert pairs.max(axis=1).max() > 0.1


@pytest.mark.parametrize("function", CONVEX.values(), ids=CONVEX.keys())
def test_multipliers_of_active_constraints_give_the_gradient(function):
    """∂f/∂x + Σ λ ∂c/∂x with ∂f/∂v = Σ λ ∂c/∂v is the function's gradient at an optimum in the variables v."""
    tape, entry, result = reformulation(function)
    inputs = inputs_with_nodes(tape, result, PROBES[:, :20])
    variables = [*tape.inputs[:3], *result.epigraph_variables]
    expected = compile_evaluator(tape, gradient(tape, entry, tape.inputs[:3]))(inputs)
    of_function = compile_evaluator(tape, gradient(tape, result.functions[0], variables))(inputs)
    slopes = np.array([compile_evaluator(tape, gradient(tape, c, variables))(inputs) for c in result.constraints])
    values = compile_evaluator(tape, result.constraints)(inputs)
    for point in range(inputs.shape[1]):
        active = values[:, point] <= 1e-12
        multipliers = np.linalg.solve(slopes[active, 3:, point].T, of_function[3:, point])
        assert np.all(multipliers >= 0)
        lagrangian_gradient = of_function[:3, point] - multipliers @ slopes[active, :3, point]
        np.testing.assert_allclose(lagrangian_gradient, expected[:, point], rtol=1e-10, atol=1e-10)


def test_at_a_kink_the_multipliers_span_the_subgradients():
    tape, _, result = reformulation(lambda x, y, z: np.abs(x) + y)
    (variable,) = result.epigraph_variables
    inputs = np.zeros((4, 1))
    by_x, by_v = (
        np.array([compile_evaluator(tape, gradient(tape, c, [of]))(inputs)[0, 0] for c in result.constraints])
        for of in (tape.inputs[0], variable)
    )
    np.testing.assert_array_equal(by_v, [1.0, 1.0])  # multipliers sum to 1
    assert sorted(-by_x) == [-1.0, 1.0]  # ends of the subdifferential of |x| at 0


def choice(function):
    tape = Tape()
    x = tape.input()
    node = function(x)
    (result,) = reformulate_choices(tape, [node.index], ["effort"], PROBES[:1])
    return tape, node.index, result


@pytest.mark.parametrize(
    ("function", "op"),
    [
        (lambda x: where(np.less(1.0, x), 2.0 * x - 1.0, x), Op.MAXIMUM),
        (lambda x: where(np.less(1.0, x), x, 2.0 * x - 1.0), Op.MINIMUM),
        (lambda x: where(np.less(np.abs(x), 1.0), 1.0 + 0.0 * x, x * x), Op.MAXIMUM),
    ],
)
def test_a_choice_between_pieces_that_meet_is_their_maximum_or_minimum(function, op):
    tape, node, result = choice(function)
    assert tape.entries[node][0] is Op.WHERE
    assert tape.entries[result][0] is op
    old, new = compile_evaluator(tape, [node, result])(PROBES[:1])
    np.testing.assert_array_equal(old, new)


def test_a_jump_is_refused_by_name():
    with pytest.raises(
        InvalidInput, match=r"^effort must have pieces that meet where the condition of np\.where changes"
    ):
        choice(lambda x: where(np.less(0.3, x), x + 1.0, x))


@pytest.mark.parametrize(("function", "sense"), UNCHANGED.values(), ids=UNCHANGED.keys())
def test_kinks_that_no_optimum_lies_at_stay_with_their_operands(function, sense):
    tape, entry, result = reformulation(function, sense)
    assert result.functions == [entry]
    assert result.epigraph_variables == result.nodes == result.constraints == []
    nodes = [i for i in dependencies(tape, [entry]) if tape.entries[i][0] in NONSMOOTH]
    remaining = remaining_kinks(tape, result)
    assert [(owner, first) for owner, first, _ in remaining] == [(0, tape.entries[node][1]) for node in nodes]
    assert remaining_kinks(tape, result, nodes) == []


# Rewritten expressions keep their values: substitutions, pieces of maxima, summands and norms.


LINEAR = {name: SMOOTH[name] for name in ("add", "subtract", "negative")} | {
    "twice": lambda a, b: 2.0 * a,
    "less": lambda a, b: -0.5 * a,
}
PIECEWISE = {name: KINKED[name] for name in ("absolute", "maximum", "minimum")}


@settings(max_examples=15)
@given(trees({**SMOOTH, **KINKED}), seeds)
def test_an_input_replaced_by_an_expression_gives_the_value_there(tree, seed):
    tape, value, variables = taped(tree)
    replacement = tape.apply(Op.MULTIPLY, variables[1], variables[2])
    (changed,) = substitute(tape, [value], {variables[0]: replacement})
    at = points(seed)
    there = np.vstack([at[1] * at[2], at[1:]])
    np.testing.assert_allclose(evaluated(tape, [changed], at), evaluated(tape, [value], there), rtol=1e-12, atol=1e-12)


@settings(max_examples=15)
@given(trees({**SMOOTH, **KINKED}), seeds)
def test_a_copy_on_another_tape_has_the_value_where_its_inputs_are(tree, seed):
    tape, value, variables = taped(tree)
    target = Tape()
    first, second = target.input().index, target.input().index
    stand_ins = [target.apply(Op.MULTIPLY, first, second), second, first]
    (copied,) = copy_entries(tape, [value], target, dict(zip(variables, stand_ins, strict=True)))
    at = points(seed)
    there = np.stack([at[0] * at[1], at[1], at[0]])
    np.testing.assert_allclose(
        evaluated(target, [copied], at[:2]), evaluated(tape, [value], there), rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize(("sense", "reduce"), [(1, np.max), (-1, np.min)])
@settings(max_examples=15)
@given(trees({**LINEAR, **PIECEWISE}), seeds)
def test_a_function_is_the_maximum_or_the_minimum_of_its_pieces(sense, reduce, tree, seed):
    tape, value, _ = taped(tree)
    at, pieces = points(seed), smooth_pieces(tape, value, sense)
    np.testing.assert_allclose(
        reduce(evaluated(tape, pieces, at), axis=0), evaluated(tape, [value], at)[0], rtol=1e-12, atol=1e-12
    )


@settings(max_examples=8)
@given(seeds)
def test_a_norm_is_its_factor_times_the_root_of_its_terms_squares(seed):
    tape, value, _ = taped(lambda x, y, z: 3.0 * np.sqrt(x * x + np.sin(y) ** 2 + z * z))
    factor, terms = norm_terms(tape, value)
    at = points(seed)
    assert (factor, len(terms)) == (3.0, 3)
    lengths = factor * np.linalg.norm(evaluated(tape, terms, at), axis=0)
    np.testing.assert_allclose(lengths, evaluated(tape, [value], at)[0], rtol=1e-12)
