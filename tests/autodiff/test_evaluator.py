"""Evaluators compute tapes for any number of points with few registers."""

from __future__ import annotations

import threading

import numpy as np
from hypothesis import given, settings

from paretoik.autodiff.differentiation import gradient, hessian
from paretoik.autodiff.evaluator import BLOCK_SIZE, compile_evaluator
from paretoik.autodiff.opcodes import NO_OPERAND, Fused
from paretoik.autodiff.tape import Tape
from tests.autodiff.trees import KINKED, SMOOTH, points, seeds, taped, trees


@settings(max_examples=15)
@given(trees({**SMOOTH, **KINKED}), seeds)
def test_an_evaluator_gives_the_same_bits_for_any_number_of_points(tree, seed):
    tape, value, variables = taped(tree)
    outputs = [value, *gradient(tape, value, variables), *hessian(tape, value, variables).values()]
    run = compile_evaluator(tape, outputs)
    at = points(seed, lanes=200)
    alone = np.concatenate([run(at[:, [lane]]) for lane in range(200)], axis=1)
    for lanes in (1, BLOCK_SIZE - 1, BLOCK_SIZE, BLOCK_SIZE + 1, 2 * BLOCK_SIZE, 200):
        np.testing.assert_array_equal(run(at[:, :lanes]), alone[:, :lanes])


@settings(max_examples=15)
@given(trees({**SMOOTH, **KINKED}), seeds)
def test_no_register_is_freed_before_its_value_was_last_read(tree, seed):
    tape, value, variables = taped(tree)
    outputs = [value, *gradient(tape, value, variables)]
    evaluator = compile_evaluator(tape, outputs)
    held = dict.fromkeys(range(len(evaluator.inputs) + len(evaluator.constants)), "given")
    for op, to, *operands in evaluator.code.tolist():
        own = () if op in set(Fused) else next(e for e in tape.entries if e[0] == op)[1:]
        count = sum(k != NO_OPERAND for k in own) if own else 3
        count, written = (1, [to, operands[1]]) if op == Fused.SINE_COSINE else (count, [to])
        assert all(k in held for k in operands[:count])
        for register in written:
            assert register not in operands[:count]
            assert held.get(register) != "given"
            assert register < evaluator.registers
            held[register] = "computed"
        assert len(set(written)) == len(written)
    assert all(register in held for register in evaluator.outputs)


def test_an_output_may_be_an_input_a_constant_or_another_output_again():
    tape = Tape()
    x, y = tape.input(), tape.input()
    both = x + y
    outputs = [y.index, tape.constant(3.0), both.index, both.index, (both * 2).index, x.index]
    values = compile_evaluator(tape, outputs)(np.array([[1.0, 2.0], [10.0, 20.0]]))
    np.testing.assert_array_equal(values, [[10, 20], [3, 3], [11, 22], [11, 22], [22, 44], [1, 2]])


def test_one_evaluator_runs_in_many_threads_at_once():
    tape, value, variables = taped(lambda x, y, z: np.hypot(np.sin(x * y), z) ** 2.5 / (1 + np.exp(x)))
    run = compile_evaluator(tape, [value, *gradient(tape, value, variables)])
    inputs = [points(seed, lanes=500) for seed in range(8)]
    expected = [run(at) for at in inputs]
    results = [None] * len(inputs)

    def work(k):
        for _ in range(50):
            results[k] = run(inputs[k])
            if not np.array_equal(results[k], expected[k]):
                return

    threads = [threading.Thread(target=work, args=(k,)) for k in range(len(inputs))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    np.testing.assert_array_equal(results, expected)
