"""Expressions rewritten: substitution, and functions as maxima, minima, sums and norms of smoother ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

from paretoik.autodiff.differentiation import dependencies
from paretoik.autodiff.operations import NO_OPERAND, Op
from paretoik.autodiff.tape import Tape


def substitute(tape: Tape, outputs: Sequence[int], replacements: Mapping[int, int]) -> list[int]:
    """Return outputs with entries replaced by others of the same tape, wherever they occur."""
    new = dict(replacements)
    for i in dependencies(tape, outputs):
        op, *operands = tape.entries[i]
        if i in new or op in (Op.CONSTANT, Op.INPUT):
            continue
        changed = [new.get(k, k) for k in operands]
        if changed != operands:
            new[i] = tape.apply(op, *changed)
    return [new.get(i, i) for i in outputs]


def copy_entries(source: Tape, outputs: Sequence[int], target: Tape, inputs: Mapping[int, int]) -> list[int]:
    """Return outputs of one tape as entries of another, where ``inputs`` are the entries that its inputs stand for."""
    copies = dict(inputs)
    for i in dependencies(source, outputs):
        op, *operands = source.entries[i]
        if i in copies:
            continue
        if op is Op.CONSTANT:
            copies[i] = target.constant(source.values[i])
        else:
            copies[i] = target.apply(op, *(copies[k] if k != NO_OPERAND else k for k in operands))
    return [copies[i] for i in outputs]


def smooth_pieces(tape: Tape, i: int, sense: int = 1) -> list[int]:
    """Return entries whose maximum (``sense`` 1) or minimum (−1) is entry i: itself where it is smooth.

    Maxima, minima and absolute values are expanded, also within sums and multiples, up to 64 pieces of a sum.
    """
    op, a, b, _ = tape.entries[i]
    pieces = [i]
    if op is (Op.MAXIMUM if sense > 0 else Op.MINIMUM):
        pieces = [piece for k in _flatten(tape, i, op) for piece in smooth_pieces(tape, k, sense)]
    elif op is Op.ABSOLUTE and sense > 0:
        pieces = smooth_pieces(tape, a, 1) + _negate(tape, smooth_pieces(tape, a, -1))
    elif op is Op.NEGATE:
        pieces = _negate(tape, smooth_pieces(tape, a, -sense))
    elif op in (Op.ADD, Op.SUBTRACT):
        second_sense = sense if op is Op.ADD else -sense
        pairs = list(product(smooth_pieces(tape, a, sense), smooth_pieces(tape, b, second_sense)))
        pieces = [tape.apply(op, *pair) for pair in pairs] if len(pairs) <= 64 else [i]
    elif (multiple := _as_multiple(tape, i)) is not None:
        factor, other = multiple
        other_sense = sense if tape.values[factor] > 0 else -sense
        pieces = [tape.apply(op, factor, k) for k in smooth_pieces(tape, other, other_sense)]
    return list(dict.fromkeys(pieces))


def summands(tape: Tape, i: int) -> list[int]:
    """Return entries whose sum is entry i, expanded through sums, differences and multiples."""
    op, a, b, _ = tape.entries[i]
    if (multiple := _as_multiple(tape, i)) is not None:
        factor, other = multiple
        terms = summands(tape, other)
        return [tape.apply(op, factor, term) for term in terms] if len(terms) > 1 else [i]
    if op is Op.NEGATE:
        return _negate(tape, summands(tape, a)) if tape.entries[a][0] in (Op.ADD, Op.SUBTRACT) else [i]
    if op is Op.ADD:
        operands = _flatten(tape, i, op)
        return [term for k in operands for term in (summands(tape, k) if tape.entries[k][0] != op else [k])]
    return summands(tape, a) + _negate(tape, summands(tape, b)) if op is Op.SUBTRACT else [i]


def norm_terms(tape: Tape, i: int) -> tuple[float, list[int]] | None:
    """Return (factor > 0, entries) where entry i is factor · √Σ entries², a Euclidean norm; else None."""
    op, a, _, _ = tape.entries[i]
    if op is Op.SQUARE_ROOT:
        terms = [tape.entries[k] for k in _flatten(tape, a, Op.ADD)]
        squares = all(inner is Op.MULTIPLY and first == second for inner, first, second, _ in terms)
        return (1.0, [first for _, first, *_ in terms]) if squares else None
    if (multiple := _as_multiple(tape, i)) is not None:
        factor, other = multiple
        norm = norm_terms(tape, other)
        if norm is not None and tape.values[factor] > 0:
            return norm[0] * tape.values[factor], norm[1]
    return None


def _as_multiple(tape: Tape, i: int) -> tuple[int, int] | None:
    """Return (constant, other factor) where entry i is a multiple; else None."""
    op, a, b, _ = tape.entries[i]
    if op is not Op.MULTIPLY or not (a in tape.values or b in tape.values):
        return None
    return (a, b) if a in tape.values else (b, a)


def _flatten(tape: Tape, i: int, op: Op) -> list[int]:
    """Return the operands of a chain of one operation."""
    operands, pending = list[int](), [i]
    while pending:
        k = pending.pop()
        if tape.entries[k][0] is op:
            pending += [tape.entries[k][2], tape.entries[k][1]]
        else:
            operands.append(k)
    return operands


def _negate(tape: Tape, entries: Sequence[int]) -> list[int]:
    return [tape.apply(Op.NEGATE, i) for i in entries]
