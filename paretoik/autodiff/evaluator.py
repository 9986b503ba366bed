"""A compiled evaluator: programs of expressions, run for many lanes (samples, motions) at once.

A program is data: operations on registers, allotted so that a register is reused when its value is no longer wanted.
One compiled function runs every program; nothing has to be compiled for a new arm or a new objective. A product that
only one sum or difference wants is made with it, in one operation: a third fewer are left.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from paretoik.autodiff.differentiation import used
from paretoik.autodiff.tape import NOTHING, Op, Tape

LANES = 128  # that many at once: fewer cost more for reading the code, more no longer fit into the cache


class Fused(IntEnum):
    """What a program can do besides the operations of a tape: a product in a sum or a difference, a sine and cosine."""

    MULTIPLY_ADD = len(Op)  # first · second + third
    MULTIPLY_SUBTRACT = len(Op) + 1  # first · second − third
    SUBTRACT_PRODUCT = len(Op) + 2  # third − first · second
    SINE_COSINE = len(Op) + 3  # of the first; the cosine goes to the second register named


@dataclass(frozen=True, eq=False)
class Program:
    """Operations (op, target, operands) on registers: first the ``inputs`` that are used, then the constants."""

    code: Int[np.ndarray, "operations 5"]
    constants: Float[np.ndarray, " constants"]
    inputs: Int[np.ndarray, " inputs"]
    outputs: Int[np.ndarray, " outputs"]
    registers: int

    def __call__(self, inputs: Float[np.ndarray, "inputs lanes"]) -> Float[np.ndarray, "outputs lanes"]:
        """Return the outputs (outputs, lanes) at all inputs (inputs, lanes) of the tape."""
        given = np.ascontiguousarray(inputs, dtype=float)
        found = np.empty((len(self.outputs), given.shape[1]))
        runner()(self.parts, given, found)
        return found

    @property
    def parts(self) -> tuple[np.ndarray, ...]:
        """Code, constants, inputs, outputs and room for the registers, as compiled code takes them."""
        return self.code, self.constants, self.inputs, self.outputs, np.empty((self.registers, LANES))


def program(tape: Tape, outputs: Sequence[int]) -> Program:
    """Return the program that computes entries of a tape from all its inputs."""
    order = used(tape, outputs)
    steps, both = _steps(tape, order, outputs)
    last = dict.fromkeys(outputs, len(tape.entries))
    for i, (_, operands) in steps.items():
        for operand in operands:
            last[operand] = max(last.get(operand, -1), i)
    constants = [i for i in order if i in tape.values]
    inputs = [i for i in order if tape.entries[i][0] is Op.INPUT]
    place = {entry: number for number, entry in enumerate((*inputs, *constants))}
    count = len(place)
    free: list[int] = []
    code: list[tuple[int, ...]] = []
    for i, (op, operands) in steps.items():
        found = both.get(i, (i,))
        for each in found:
            if free:
                place[each] = free.pop()
            else:
                place[each], count = count, count + 1
        registers = [place[found[0]], *(place[k] for k in operands), *(place[k] for k in found[1:])]
        code.append((op, *registers, *[0] * (4 - len(registers))))
        # Given back only now: what is read and what is written must not overlap.
        free += [place[k] for k in dict.fromkeys(operands) if last[k] == i and tape.entries[k][0] > Op.INPUT]
    return Program(
        code=np.array(code, dtype=np.int32).reshape(-1, 5),
        constants=np.array([tape.values[i] for i in constants]),
        inputs=np.array([tape.entries[i][1] for i in inputs], dtype=np.int32),
        outputs=np.array([place[i] for i in outputs], dtype=np.int32),
        registers=max(count, 1),
    )


def _steps(
    tape: Tape, order: Sequence[int], outputs: Sequence[int]
) -> tuple[dict[int, tuple[int, list[int]]], dict[int, tuple[int, int]]]:
    """Return what is to be done for which entry, in order, as (operation, operands), and entries found by one step."""
    operands = {
        i: [k for k in tape.entries[i][1:] if k != NOTHING]
        for i in order
        if tape.entries[i][0] not in (Op.CONSTANT, Op.INPUT)
    }
    wanted = Counter(outputs)
    for each in operands.values():
        wanted.update(each)
    steps = {i: (int(tape.entries[i][0]), each) for i, each in operands.items()}
    for i, each in operands.items():
        op = tape.entries[i][0]
        if op in (Op.ADD, Op.SUBTRACT):
            for product, other in (each, each[::-1]):
                if tape.entries[product][0] is Op.MULTIPLY and wanted[product] == 1:
                    fused = Fused.SUBTRACT_PRODUCT if product == each[1] else Fused.MULTIPLY_SUBTRACT
                    steps[i] = (int(Fused.MULTIPLY_ADD if op is Op.ADD else fused), [*operands[product], other])
                    del steps[product]
                    break
    waves = {
        op: {each[0]: i for i, each in operands.items() if tape.entries[i][0] is op} for op in (Op.SINE, Op.COSINE)
    }
    both = dict[int, tuple[int, int]]()
    for angle, sine in waves[Op.SINE].items():
        if angle in waves[Op.COSINE]:
            pair = sine, waves[Op.COSINE][angle]
            steps[min(pair)] = int(Fused.SINE_COSINE), [angle]
            del steps[max(pair)]
            both[min(pair)] = pair
    return steps, both


@cache
def runner() -> Any:
    """Return the compiled function run(parts, given, found); compiled once, then cached."""
    from paretoik.autodiff.interpreter import run  # here: numba takes its time

    return run
