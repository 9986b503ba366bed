"""Derivatives of expressions, on the same tape: gradients by a reverse sweep, second derivatives forwards over it.

The derivative of each operation stands in ``operation_derivatives``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from paretoik.autodiff.operation_derivatives import partial_derivatives
from paretoik.autodiff.operations import NO_OPERAND, PIECEWISE, Op
from paretoik.autodiff.tape import Tape


def dependencies(tape: Tape, outputs: Sequence[int]) -> list[int]:
    """Return the entries that outputs depend on, themselves included, in order."""
    visited, pending = set(outputs), list(outputs)
    while pending:
        op, *operands = tape.entries[pending.pop()]
        if op not in (Op.CONSTANT, Op.INPUT):
            unvisited = [i for i in operands if i != NO_OPERAND and i not in visited]
            visited.update(unvisited)
            pending.extend(unvisited)
    return sorted(visited)


def gradient(tape: Tape, output: int, wrt: Sequence[int]) -> list[int]:
    """Return the entries of ∂output/∂input for each input of ``wrt``."""
    adjoint: dict[int, int] = {output: tape.constant(1.0)}
    masked: set[int] = set()  # reached through a piece that may not be taken, whose derivatives may be inf or NaN
    for i in reversed(dependencies(tape, [output])):
        seed = adjoint.get(i)
        if seed is None:
            continue
        multiply = Op.MASKED_MULTIPLY if i in masked else Op.MULTIPLY
        for operand, partial in partial_derivatives(tape, i):
            if i in masked or tape.entries[i][0] in PIECEWISE:
                masked.add(operand)
            term = tape.apply(multiply, seed, partial)
            adjoint[operand] = tape.apply(Op.ADD, adjoint[operand], term) if operand in adjoint else term
    zero = tape.constant(0.0)
    return [adjoint.get(i, zero) for i in wrt]


def tangents(tape: Tape, outputs: Sequence[int], direction: Mapping[int, int]) -> list[int]:
    """Return the entries of the directional derivatives of outputs; ``direction`` gives that of each input."""
    zero = tape.constant(0.0)
    tangent: dict[int, int] = dict(direction)
    for i in dependencies(tape, outputs):
        if i in direction or tape.entries[i][0] in (Op.CONSTANT, Op.INPUT):
            continue
        op, a, b, c = tape.entries[i]
        if op is Op.WHERE:  # the piece that is not taken may be inf or NaN
            total = tape.apply(op, a, tangent.get(b, zero), tangent.get(c, zero))
        elif op is Op.MASKED_MULTIPLY:  # and so may the factor of a zero
            terms = (tape.apply(op, tangent.get(a, zero), b), tape.apply(op, a, tangent.get(b, zero)))
            total = tape.apply(Op.ADD, *terms)
        else:
            total = zero
            multiply = Op.MASKED_MULTIPLY if op in PIECEWISE else Op.MULTIPLY
            for operand, partial in partial_derivatives(tape, i, wrt=tangent):
                total = tape.apply(Op.ADD, total, tape.apply(multiply, partial, tangent[operand]))
        if total != zero:
            tangent[i] = total
    return [tangent.get(i, zero) for i in outputs]


def hessian(tape: Tape, output: int, wrt: Sequence[int]) -> dict[tuple[int, int], int]:
    """Return the entries of ∂²output/∂wrt[i]∂wrt[j] that are not always 0, for i ≥ j."""
    zero = tape.constant(0.0)
    first, one = gradient(tape, output, wrt), tape.constant(1.0)
    second = {}
    for j, variable in enumerate(wrt):
        for i, value in enumerate(tangents(tape, first[j:], {variable: one}), start=j):
            if value != zero:
                second[i, j] = value
    return second
