"""Derivatives of expressions on the same tape.

Gradients are taken in reverse mode, second derivatives forward over reverse.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence

from paretoik.autodiff.opcodes import NO_OPERAND, PIECEWISE, PIECEWISE_CONSTANT, Op
from paretoik.autodiff.tape import Tape
from paretoik.errors import InvalidInput

# The derivative of every elementary operation, as entries of the same tape. At a kink (absolute value, maximum, choice)
# it is the derivative of the active piece.


def partial_derivatives(tape: Tape, i: int, wrt: Container[int] | None = None) -> list[tuple[int, int]]:
    """Return (operand, entry of ∂entry i/∂operand) for operands in ``wrt`` (None: all)."""
    op, a, b, c = tape.entries[i]
    apply, constant = tape.apply, tape.constant
    if op is Op.INPUT or op in PIECEWISE_CONSTANT:
        return []
    requested = [k for k in (a, b, c) if k != NO_OPERAND and (wrt is None or k in wrt)]
    if not requested:
        return []
    partials: list[tuple[int, int]] = []
    if op is Op.ADD:
        partials = [(a, constant(1.0)), (b, constant(1.0))]
    elif op is Op.SUBTRACT:
        partials = [(a, constant(1.0)), (b, constant(-1.0))]
    elif op in (Op.MULTIPLY, Op.MASKED_MULTIPLY):
        partials = [(a, b), (b, a)]
    elif op is Op.DIVIDE:
        inverse = apply(Op.DIVIDE, constant(1.0), b)
        partials = [(a, inverse), (b, apply(Op.NEGATE, apply(Op.MULTIPLY, i, inverse)))]
    elif op is Op.ARC_TANGENT:
        square = apply(Op.ADD, apply(Op.MULTIPLY, a, a), apply(Op.MULTIPLY, b, b))
        partials = [(a, apply(Op.DIVIDE, b, square)), (b, apply(Op.NEGATE, apply(Op.DIVIDE, a, square)))]
    elif op in (Op.MAXIMUM, Op.MINIMUM):
        first = apply(Op.LESS_EQUAL, b, a) if op is Op.MAXIMUM else apply(Op.LESS_EQUAL, a, b)
        partials = [(a, first), (b, apply(Op.SUBTRACT, constant(1.0), first))]
    elif op is Op.POWER:
        partials = [(a, apply(Op.MULTIPLY, b, apply(Op.POWER, a, apply(Op.SUBTRACT, b, constant(1.0)))))]
        if b not in tape.values:
            partials.append((b, apply(Op.MASKED_MULTIPLY, i, apply(Op.LOGARITHM, a))))
    elif op is Op.WHERE:
        partials = [
            (b, apply(Op.WHERE, a, constant(1.0), constant(0.0))),
            (c, apply(Op.WHERE, a, constant(0.0), constant(1.0))),
        ]
    else:
        partials = [(a, unary_derivative(tape, op, i, a))]
    return [(operand, partial) for operand, partial in partials if operand in requested]


def unary_derivative(tape: Tape, op: Op, i: int, a: int) -> int:
    """Return the derivative of entry i, a function of one operand, at its operand a."""
    apply, constant = tape.apply, tape.constant
    if op is Op.NEGATE:
        return constant(-1.0)
    if op is Op.SINE:
        return apply(Op.COSINE, a)
    if op is Op.COSINE:
        return apply(Op.NEGATE, apply(Op.SINE, a))
    if op is Op.SQUARE_ROOT:
        # 0 at 0: the norm of a zero vector has no preferred direction.
        return apply(Op.WHERE, i, apply(Op.DIVIDE, constant(0.5), i), constant(0.0))
    if op is Op.EXPONENTIAL:
        return i
    if op is Op.LOGARITHM:
        return apply(Op.DIVIDE, constant(1.0), a)
    if op is Op.TANH:
        return apply(Op.SUBTRACT, constant(1.0), apply(Op.MULTIPLY, i, i))
    if op is Op.ABSOLUTE:
        return apply(Op.SIGN, a)
    if op in (Op.ARC_SINE, Op.ARC_COSINE):
        root = apply(Op.SQUARE_ROOT, apply(Op.SUBTRACT, constant(1.0), apply(Op.MULTIPLY, a, a)))
        return apply(Op.DIVIDE, constant(1.0 if op is Op.ARC_SINE else -1.0), root)
    raise InvalidInput(f"{op.name.lower()} has no derivative")


# Gradients and second derivatives of expressions.


def dependencies(tape: Tape, outputs: Sequence[int]) -> list[int]:
    """Return the entries that outputs depend on, including the outputs, in order."""
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
    masked: set[int] = set()  # entries in a piece that may be inactive; their derivatives may be inf or NaN
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
    """Return the entries of directional derivatives of outputs; ``direction`` has the tangent of each input."""
    zero = tape.constant(0.0)
    tangent: dict[int, int] = dict(direction)
    for i in dependencies(tape, outputs):
        if i in direction or tape.entries[i][0] in (Op.CONSTANT, Op.INPUT):
            continue
        op, a, b, c = tape.entries[i]
        if op is Op.WHERE:  # the inactive piece may be inf or NaN
            total = tape.apply(op, a, tangent.get(b, zero), tangent.get(c, zero))
        elif op is Op.MASKED_MULTIPLY:  # the factor of a zero may be inf or NaN too
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
    """Return the nonzero entries of ∂²output/∂wrt[i]∂wrt[j], for i ≥ j."""
    zero = tape.constant(0.0)
    first, one = gradient(tape, output, wrt), tape.constant(1.0)
    second = {}
    for j, variable in enumerate(wrt):
        for i, value in enumerate(tangents(tape, first[j:], {variable: one}), start=j):
            if value != zero:
                second[i, j] = value
    return second
