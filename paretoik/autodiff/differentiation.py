"""Derivatives of expressions, written on the same tape: gradients backwards, second derivatives forwards over them.

At a kink, that of an absolute value, a maximum or a choice, the derivative is the one of the piece that is taken there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from paretoik.autodiff.tape import NOTHING, Op, Tape
from paretoik.errors import InvalidInput

PIECEWISE = frozenset({Op.MAXIMUM, Op.MINIMUM, Op.CHOOSE})
FLAT = frozenset({Op.CONSTANT, Op.SIGN, Op.LESS, Op.LESS_EQUAL})


def used(tape: Tape, outputs: Sequence[int]) -> list[int]:
    """Return the entries that outputs depend on, themselves included, in order."""
    found, pending = set(outputs), list(outputs)
    while pending:
        op, *operands = tape.entries[pending.pop()]
        if op not in (Op.CONSTANT, Op.INPUT):
            fresh = [i for i in operands if i != NOTHING and i not in found]
            found.update(fresh)
            pending.extend(fresh)
    return sorted(found)


def gradient(tape: Tape, output: int, wrt: Sequence[int]) -> list[int]:
    """Return the entries of ∂output/∂input for each input of ``wrt``."""
    adjoint: dict[int, int] = {output: tape.constant(1.0)}
    doubtful: set[int] = set()  # reached through a piece that may not be taken: its slopes may not even be numbers
    for i in reversed(used(tape, [output])):
        seed = adjoint.get(i)
        if seed is None:
            continue
        doubt = i in doubtful
        for operand, slope in slopes(tape, i):
            if doubt or tape.entries[i][0] in PIECEWISE:
                doubtful.add(operand)
            part = tape.apply(Op.WEIGH if doubt else Op.MULTIPLY, seed, slope)
            adjoint[operand] = tape.apply(Op.ADD, adjoint[operand], part) if operand in adjoint else part
    nothing = tape.constant(0.0)
    return [adjoint.get(i, nothing) for i in wrt]


def tangents(tape: Tape, outputs: Sequence[int], along: Mapping[int, int]) -> list[int]:
    """Return the entries of the rates of change of many outputs where inputs change at the rates ``along``."""
    nothing = tape.constant(0.0)
    tangent: dict[int, int] = dict(along)
    for i in used(tape, outputs):
        if i in along or tape.entries[i][0] in (Op.CONSTANT, Op.INPUT):
            continue
        op, a, b, c = tape.entries[i]
        if op is Op.CHOOSE:  # what is not taken may not even be a number
            total = tape.apply(op, a, tangent.get(b, nothing), tangent.get(c, nothing))
        elif op is Op.WEIGH:  # nor what weighs nothing
            parts = (tape.apply(op, tangent.get(a, nothing), b), tape.apply(op, a, tangent.get(b, nothing)))
            total = tape.apply(Op.ADD, *parts)
        else:
            total = nothing
            times = Op.WEIGH if op in PIECEWISE else Op.MULTIPLY
            for operand, slope in slopes(tape, i, among=tangent):
                total = tape.apply(Op.ADD, total, tape.apply(times, slope, tangent[operand]))
        if total != nothing:
            tangent[i] = total
    return [tangent.get(i, nothing) for i in outputs]


def hessian(tape: Tape, output: int, wrt: Sequence[int]) -> dict[tuple[int, int], int]:
    """Return the entries of ∂²output/∂wrt[i]∂wrt[j] that are not always 0, for i ≥ j."""
    nothing = tape.constant(0.0)
    first, one = gradient(tape, output, wrt), tape.constant(1.0)
    found = {}
    for j, variable in enumerate(wrt):
        for i, value in enumerate(tangents(tape, first[j:], {variable: one}), start=j):
            if value != nothing:
                found[i, j] = value
    return found


def slopes(tape: Tape, i: int, among: dict[int, int] | None = None) -> list[tuple[int, int]]:
    """Return (operand, entry of the partial derivative) of an entry; with ``among`` only of the operands in it."""
    op, a, b, c = tape.entries[i]
    apply, constant = tape.apply, tape.constant
    if op is Op.INPUT or op in FLAT:
        return []
    wanted = [k for k in (a, b, c) if k != NOTHING and (among is None or k in among)]
    if not wanted:
        return []
    found: list[tuple[int, int]] = []
    if op is Op.ADD:
        found = [(a, constant(1.0)), (b, constant(1.0))]
    elif op is Op.SUBTRACT:
        found = [(a, constant(1.0)), (b, constant(-1.0))]
    elif op in (Op.MULTIPLY, Op.WEIGH):
        found = [(a, b), (b, a)]
    elif op is Op.DIVIDE:
        inverse = apply(Op.DIVIDE, constant(1.0), b)
        found = [(a, inverse), (b, apply(Op.NEGATE, apply(Op.MULTIPLY, i, inverse)))]
    elif op is Op.ARC_TANGENT:
        size = apply(Op.ADD, apply(Op.MULTIPLY, a, a), apply(Op.MULTIPLY, b, b))
        found = [(a, apply(Op.DIVIDE, b, size)), (b, apply(Op.NEGATE, apply(Op.DIVIDE, a, size)))]
    elif op in (Op.MAXIMUM, Op.MINIMUM):
        first = apply(Op.LESS_EQUAL, b, a) if op is Op.MAXIMUM else apply(Op.LESS_EQUAL, a, b)
        found = [(a, first), (b, apply(Op.SUBTRACT, constant(1.0), first))]
    elif op is Op.POWER:
        found = [(a, apply(Op.MULTIPLY, b, apply(Op.POWER, a, apply(Op.SUBTRACT, b, constant(1.0)))))]
        if b not in tape.values:
            found.append((b, apply(Op.WEIGH, i, apply(Op.LOGARITHM, a))))
    elif op is Op.CHOOSE:
        taken = [apply(Op.CHOOSE, a, constant(1.0), constant(0.0)), apply(Op.CHOOSE, a, constant(0.0), constant(1.0))]
        found = [(b, taken[0]), (c, taken[1])]
    else:
        found = [(a, _slope(tape, op, i, a))]
    return [(operand, slope) for operand, slope in found if operand in wanted]


def _slope(tape: Tape, op: Op, i: int, a: int) -> int:
    """Return the derivative of a function of one number; ``i`` is its own entry."""
    apply, constant = tape.apply, tape.constant
    if op is Op.NEGATE:
        return constant(-1.0)
    if op is Op.SINE:
        return apply(Op.COSINE, a)
    if op is Op.COSINE:
        return apply(Op.NEGATE, apply(Op.SINE, a))
    if op is Op.SQUARE_ROOT:
        # The length of nothing grows in no direction more than in another.
        return apply(Op.CHOOSE, i, apply(Op.DIVIDE, constant(0.5), i), constant(0.0))
    if op is Op.EXPONENTIAL:
        return i
    if op is Op.LOGARITHM:
        return apply(Op.DIVIDE, constant(1.0), a)
    if op is Op.TANH:
        return apply(Op.SUBTRACT, constant(1.0), apply(Op.MULTIPLY, i, i))
    if op is Op.ABSOLUTE:
        return apply(Op.SIGN, a)
    if op in (Op.ARC_SINE, Op.ARC_COSINE):
        rest = apply(Op.SQUARE_ROOT, apply(Op.SUBTRACT, constant(1.0), apply(Op.MULTIPLY, a, a)))
        return apply(Op.DIVIDE, constant(1.0 if op is Op.ARC_SINE else -1.0), rest)
    raise InvalidInput(f"{op.name.lower()} has no derivative")
