"""Evaluators of expressions: instructions on registers, for many points at once.

Points are samples or motions. An evaluator is data. One compiled function interprets all evaluators, so a new arm or
objective needs no compilation. A register is used again when its value is no longer needed. A product that only one sum
or difference uses is fused with it, which saves a third of the instructions.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from paretoik.autodiff.differentiation import dependencies
from paretoik.autodiff.opcodes import NO_OPERAND, Fused, Op
from paretoik.autodiff.tape import Tape

BLOCK_SIZE = 128  # number of points: smaller blocks spend more time on reading code, larger ones exceed the cache


@dataclass(frozen=True, eq=False)
class Evaluator:
    """Instructions (op, target, operands) on registers; the first registers have inputs, then constants."""

    code: Int[np.ndarray, "instructions 5"]
    constants: Float[np.ndarray, " constants"]
    inputs: Int[np.ndarray, " inputs"]
    outputs: Int[np.ndarray, " outputs"]
    registers: int

    def __call__(self, inputs: Float[np.ndarray, "inputs points"]) -> Float[np.ndarray, "outputs points"]:
        """Return the outputs at points, from all inputs of the tape."""
        from paretoik.autodiff.interpreter import run  # here: numba is slow to import

        rows = np.ascontiguousarray(inputs, dtype=float)
        results = np.empty((len(self.outputs), rows.shape[1]))
        run(self.arrays, rows, results)
        return results

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """Return code, constants, inputs, outputs and new registers for compiled code."""
        size = self.registers * BLOCK_SIZE
        memory = np.empty(size + 7)
        first = -memory.ctypes.data % 64 // 8  # vector instructions are slower across a 64-byte boundary
        registers = memory[first : first + size].reshape(self.registers, BLOCK_SIZE)
        return self.code, self.constants, self.inputs, self.outputs, registers


def compile_evaluator(tape: Tape, outputs: Sequence[int]) -> Evaluator:
    """Return the evaluator that computes entries of a tape from all its inputs."""
    order = dependencies(tape, outputs)
    instructions, pairs = _fuse(tape, order, outputs)
    last_use = dict.fromkeys(outputs, len(tape.entries))
    for i, (_, operands) in instructions.items():
        for operand in operands:
            last_use[operand] = max(last_use.get(operand, -1), i)
    constants = [i for i in order if i in tape.values]
    inputs = [i for i in order if tape.entries[i][0] is Op.INPUT]
    register = {entry: number for number, entry in enumerate((*inputs, *constants))}
    count = len(register)
    free: list[int] = []
    code: list[tuple[int, ...]] = []
    for i, (op, operands) in instructions.items():
        targets = pairs.get(i, (i,))
        for target in targets:
            if free:
                register[target] = free.pop()
            else:
                register[target], count = count, count + 1
        registers = [register[targets[0]], *(register[k] for k in operands), *(register[k] for k in targets[1:])]
        code.append((op, *registers, *[0] * (4 - len(registers))))
        # registers are freed only now, because targets and operands of an instruction must not overlap
        free += [register[k] for k in dict.fromkeys(operands) if last_use[k] == i and tape.entries[k][0] > Op.INPUT]
    return Evaluator(
        code=np.array(code, dtype=np.int32).reshape(-1, 5),
        constants=np.array([tape.values[i] for i in constants]),
        inputs=np.array([tape.entries[i][1] for i in inputs], dtype=np.int32),
        outputs=np.array([register[i] for i in outputs], dtype=np.int32),
        registers=max(count, 1),
    )


def _fuse(
    tape: Tape, order: Sequence[int], outputs: Sequence[int]
) -> tuple[dict[int, tuple[int, list[int]]], dict[int, tuple[int, int]]]:
    """Return every entry's instruction (op, operands) in order, and pairs of entries that share one."""
    operands = {
        i: [k for k in tape.entries[i][1:] if k != NO_OPERAND]
        for i in order
        if tape.entries[i][0] not in (Op.CONSTANT, Op.INPUT)
    }
    uses = Counter(outputs)
    for each in operands.values():
        uses.update(each)
    instructions = {i: (int(tape.entries[i][0]), each) for i, each in operands.items()}
    for i, each in operands.items():
        op = tape.entries[i][0]
        if op in (Op.ADD, Op.SUBTRACT):
            for product, other in (each, each[::-1]):
                if tape.entries[product][0] is Op.MULTIPLY and uses[product] == 1:
                    fused = Fused.SUBTRACT_PRODUCT if product == each[1] else Fused.MULTIPLY_SUBTRACT
                    instructions[i] = (int(Fused.MULTIPLY_ADD if op is Op.ADD else fused), [*operands[product], other])
                    del instructions[product]
                    break
    by_angle = {
        op: {each[0]: i for i, each in operands.items() if tape.entries[i][0] is op} for op in (Op.SINE, Op.COSINE)
    }
    pairs = dict[int, tuple[int, int]]()
    for angle, sine in by_angle[Op.SINE].items():
        if angle in by_angle[Op.COSINE]:
            pair = sine, by_angle[Op.COSINE][angle]
            instructions[min(pair)] = int(Fused.SINE_COSINE), [angle]
            del instructions[max(pair)]
            pairs[min(pair)] = pair
    return instructions, pairs
