"""Expressions rewritten: entries replaced by others, and functions that are the largest or least of smoother ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

from paretoik.autodiff.differentiation import used
from paretoik.autodiff.tape import Op, Tape

MOST = 64  # pieces of a sum: that of seven absolute values would have 128


def substituted(tape: Tape, outputs: Sequence[int], replaced: Mapping[int, int]) -> list[int]:
    """Return outputs with entries replaced by others of the same tape, wherever they occur."""
    found = dict(replaced)
    for i in used(tape, outputs):
        op, *operands = tape.entries[i]
        if i in found or op in (Op.CONSTANT, Op.INPUT):
            continue
        changed = [found.get(k, k) for k in operands]
        if changed != operands:
            found[i] = tape.apply(op, *changed)
    return [found.get(i, i) for i in outputs]


def pieces(tape: Tape, i: int, side: int = 1) -> list[int]:
    """Return entries of which entry i is always the largest (``side`` 1) or the least (−1): itself where it is smooth.

    Maxima, minima and absolute values are taken apart, also in sums and multiples, while there are not too many.
    """
    op, a, b, _ = tape.entries[i]
    found = [i]
    if op is (Op.MAXIMUM if side > 0 else Op.MINIMUM):
        found = [piece for k in _joined(tape, i, op) for piece in pieces(tape, k, side)]
    elif op is Op.ABSOLUTE and side > 0:
        found = pieces(tape, a, 1) + _negated(tape, pieces(tape, a, -1))
    elif op is Op.NEGATE:
        found = _negated(tape, pieces(tape, a, -side))
    elif op in (Op.ADD, Op.SUBTRACT):
        pairs = list(product(pieces(tape, a, side), pieces(tape, b, side if op is Op.ADD else -side)))
        found = [tape.apply(op, *pair) for pair in pairs] if len(pairs) <= MOST else [i]
    elif op is Op.MULTIPLY and (a in tape.values or b in tape.values):
        factor, other = (a, b) if a in tape.values else (b, a)
        turned = side if tape.values[factor] > 0 else -side
        found = [tape.apply(op, factor, k) for k in pieces(tape, other, turned)]
    return list(dict.fromkeys(found))


def addends(tape: Tape, i: int) -> list[int]:
    """Return entries whose sum is entry i, taken apart as far as sums, differences and multiples go."""
    op, a, b, _ = tape.entries[i]
    if op is Op.MULTIPLY and (a in tape.values or b in tape.values):
        factor, other = (a, b) if a in tape.values else (b, a)
        terms = addends(tape, other)
        return [tape.apply(op, factor, term) for term in terms] if len(terms) > 1 else [i]
    if op is Op.NEGATE:
        return _negated(tape, addends(tape, a)) if tape.entries[a][0] in (Op.ADD, Op.SUBTRACT) else [i]
    if op is Op.ADD:
        return [term for k in _joined(tape, i, op) for term in (addends(tape, k) if tape.entries[k][0] != op else [k])]
    return addends(tape, a) + _negated(tape, addends(tape, b)) if op is Op.SUBTRACT else [i]


def squares(tape: Tape, i: int) -> tuple[float, list[int]] | None:
    """Return (factor > 0, entries) where entry i is factor times the root of the sum of their squares; else None."""
    op, a, b, _ = tape.entries[i]
    if op is Op.SQUARE_ROOT:
        terms = [tape.entries[k] for k in _joined(tape, a, Op.ADD)]
        plain = all(inner is Op.MULTIPLY and first == second for inner, first, second, _ in terms)
        return (1.0, [first for _, first, *_ in terms]) if plain else None
    if op is Op.MULTIPLY and (a in tape.values or b in tape.values):
        factor, other = (a, b) if a in tape.values else (b, a)
        known = squares(tape, other)
        if known is not None and tape.values[factor] > 0:
            return known[0] * tape.values[factor], known[1]
    return None


def _joined(tape: Tape, i: int, op: Op) -> list[int]:
    """Return the operands of a chain of one operation."""
    found, pending = list[int](), [i]
    while pending:
        k = pending.pop()
        if tape.entries[k][0] is op:
            pending += [tape.entries[k][2], tape.entries[k][1]]
        else:
            found.append(k)
    return found


def _negated(tape: Tape, entries: Sequence[int]) -> list[int]:
    return [tape.apply(Op.NEGATE, i) for i in entries]
