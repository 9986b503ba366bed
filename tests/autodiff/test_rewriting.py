"""What is rewritten has the values of what it was: substitutions, pieces of maxima, summands and norms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from paretoik.autodiff.kinks import copy_entries, norm_terms, smooth_pieces, substitute, summands
from paretoik.autodiff.operations import Op
from paretoik.autodiff.tape import Tape
from tests.autodiff.trees import KINKED, SMOOTH, evaluated, points, seeds, taped, trees

LINEAR = {name: SMOOTH[name] for name in ("add", "subtract", "negative")} | {
    "twice": lambda a, b: 2.0 * a,
    "less": lambda a, b: -0.5 * a,
}
PIECEWISE = {name: KINKED[name] for name in ("absolute", "maximum", "minimum")}


@settings(max_examples=30)
@given(trees({**SMOOTH, **KINKED}), seeds)
def test_an_input_replaced_by_an_expression_gives_the_value_there(tree, seed):
    tape, value, variables = taped(tree)
    replacement = tape.apply(Op.MULTIPLY, variables[1], variables[2])
    (changed,) = substitute(tape, [value], {variables[0]: replacement})
    at = points(seed)
    there = np.vstack([at[1] * at[2], at[1:]])
    np.testing.assert_allclose(evaluated(tape, [changed], at), evaluated(tape, [value], there), rtol=1e-12, atol=1e-12)


@settings(max_examples=30)
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


def test_what_does_not_contain_the_entry_stays_the_same_entry():
    tape, value, variables = taped(lambda x, y, z: np.sin(y) + z)
    assert substitute(tape, [value], {variables[0]: variables[1]}) == [value]


@pytest.mark.parametrize(("sense", "reduce"), [(1, np.max), (-1, np.min)])
@settings(max_examples=30)
@given(trees({**LINEAR, **PIECEWISE}), seeds)
def test_a_function_is_the_maximum_or_the_minimum_of_its_pieces(sense, reduce, tree, seed):
    tape, value, _ = taped(tree)
    at, pieces = points(seed), smooth_pieces(tape, value, sense)
    np.testing.assert_allclose(
        reduce(evaluated(tape, pieces, at), axis=0), evaluated(tape, [value], at)[0], rtol=1e-12, atol=1e-12
    )


def test_pieces_of_a_sum_of_absolute_values_are_all_their_signs():
    tape, value, _ = taped(lambda x, y, z: np.abs(x) + np.abs(y) - np.minimum(z, 0.0))
    pieces = smooth_pieces(tape, value)
    assert len(pieces) == 8
    assert not {tape.entries[i][0] for i in pieces} & {Op.ABSOLUTE, Op.MAXIMUM, Op.MINIMUM}


@settings(max_examples=30)
@given(trees({**LINEAR, **PIECEWISE, "sin": SMOOTH["sin"]}), seeds)
def test_summands_sum_to_the_entry(tree, seed):
    tape, value, _ = taped(tree)
    at, terms = points(seed), summands(tape, value)
    np.testing.assert_allclose(
        evaluated(tape, terms, at).sum(axis=0), evaluated(tape, [value], at)[0], rtol=1e-12, atol=1e-12
    )


def test_sums_within_differences_and_multiples_are_expanded():
    tape, value, _ = taped(lambda x, y, z: 2.0 * (np.sin(x) - (np.cos(y) + np.abs(z))) + np.exp(x))
    assert len(summands(tape, value)) == 4


@settings(max_examples=20)
@given(seeds)
def test_a_norm_is_its_factor_times_the_root_of_its_terms_squares(seed):
    tape, value, _ = taped(lambda x, y, z: 3.0 * np.sqrt(x * x + np.sin(y) ** 2 + z * z))
    factor, terms = norm_terms(tape, value)
    at = points(seed)
    assert (factor, len(terms)) == (3.0, 3)
    lengths = factor * np.linalg.norm(evaluated(tape, terms, at), axis=0)
    np.testing.assert_allclose(lengths, evaluated(tape, [value], at)[0], rtol=1e-12)


@pytest.mark.parametrize(
    "function",
    [
        lambda x, y, z: -np.sqrt(x * x + y * y),
        lambda x, y, z: np.sqrt(x * x + y),
        lambda x, y, z: x * x + y * y,
        lambda x, y, z: np.sqrt(x * x + y * y) + z,
    ],
)
def test_what_is_no_norm_has_no_terms(function):
    tape, value, _ = taped(function)
    assert norm_terms(tape, value) is None
