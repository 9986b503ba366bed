"""Epigraph reformulation of absolute values, maxima and minima in objectives and constraints.

    minimise    f(x, max(x, y))    becomes    minimise    f(x, v)  subject to  v ≥ x,  v ≥ y

|x| is the maximum of x and −x. The reformulation is valid if f increases with v: at an optimum v is then the smallest
possible, and the program is smooth. If f decreases with v, the kink is concave and is no minimiser. If f is constant in
v, there is no kink. In these two cases the kink stays as it is.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.differentiation import dependencies, gradient
from paretoik.autodiff.evaluator import compile_evaluator
from paretoik.autodiff.opcodes import NO_OPERAND, Op
from paretoik.autodiff.tape import Tape
from paretoik.errors import InvalidInput

# Rewriting of expressions: substitution; functions as maxima, minima, sums and norms of smoother ones.


def substitute(tape: Tape, outputs: Sequence[int], replacements: Mapping[int, int]) -> list[int]:
    """Return outputs with some entries of the tape replaced by others, everywhere."""
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
    """Return outputs of one tape as entries of another; ``inputs`` maps the first one's inputs to entries."""
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
    """Return the smooth entries whose maximum (``sense`` 1) or minimum (−1) is entry i; [i] if it is smooth.

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
    """Return entries whose sum is entry i: sums, differences and multiples are expanded."""
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
    """Return (factor, entries) of a norm factor · √Σ entries² with a positive factor; else None."""
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
    """Return (constant, other factor) if entry i is a multiple; else None."""
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


# Epigraph variables in place of kinks.


NONSMOOTH = frozenset({Op.ABSOLUTE, Op.MAXIMUM, Op.MINIMUM})


@dataclass(frozen=True, kw_only=True)
class KinkOptions:
    """Tolerances of kinks.

    rounding: largest derivative or difference that counts as 0, as a share of the largest
    jump: largest difference of a choice's pieces at a point where its condition changes, as a share of its values
    bisections: number of bisections that find such a point
    """

    rounding: float = 1e-12
    jump: float = 1e-6
    bisections: int = 60


OPTIONS = KinkOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Reformulation:
    """Smooth functions on a tape.

    epigraph_variables: inputs that replace the entries ``nodes``
    constraints: entries that must be ≥ 0, two per variable: variable − piece for a maximum or absolute value, else
        piece − variable
    signs: 1 for a maximum or absolute value, −1 for a minimum
    """

    functions: list[int]
    epigraph_variables: list[int]
    nodes: list[int]
    constraints: list[int]
    signs: list[int]


def reformulate_kinks(
    tape: Tape,
    functions: Sequence[int],
    senses: Sequence[int],
    probes: Float[np.ndarray, "inputs points"],
    excluded: Collection[int] = (),
) -> Reformulation:
    """Return functions with epigraph variables in place of kinks.

    senses: 1 for functions that should be small, −1 for large, 0 for neither
    probes: values of the tape's inputs at which derivatives are tested
    excluded: entries that stay as they are
    """
    count, all_senses, unchanged = len(functions), list(senses), set(excluded)
    current, variables, nodes, signs = list(functions), list[int](), list[int](), list[int]()
    while kinks := [i for i in dependencies(tape, current) if tape.entries[i][0] in NONSMOOTH and i not in unchanged]:
        node = max(kinks)  # the outermost first: kinks inside it then belong to its constraints
        variable = tape.input().index
        substituted = substitute(tape, current, {node: variable})
        if not _is_convex_kink(tape, node, variable, substituted, all_senses, probes):
            unchanged.add(node)
            continue
        op, a, b, _ = tape.entries[node]
        if op is Op.ABSOLUTE:
            b = tape.apply(Op.NEGATE, a)
        pairs = [(a, variable), (b, variable)] if op is Op.MINIMUM else [(variable, a), (variable, b)]
        current = substituted + [tape.apply(Op.SUBTRACT, *pair) for pair in pairs]
        all_senses += [-1, -1]
        variables.append(variable)
        nodes.append(node)
        signs.append(-1 if op is Op.MINIMUM else 1)
    return Reformulation(
        functions=current[:count],
        epigraph_variables=variables,
        nodes=nodes,
        constraints=current[count:],
        signs=signs,
    )


def reformulate_choices(
    tape: Tape,
    functions: Sequence[int],
    names: Sequence[str],
    probes: Float[np.ndarray, "inputs points"],
    excluded: Collection[int] = (),
) -> list[int]:
    """Return functions with choices (np.where) replaced by equal maxima or minima.

    Raises InvalidInput, naming the function, if the pieces do not meet where the condition changes.
    """
    replacements: dict[int, int] = {}
    for name, function in zip(names, functions, strict=True):
        for node in dependencies(tape, [function]):
            if tape.entries[node][0] is not Op.WHERE or node in replacements or node in excluded:
                continue
            _, condition, first, second = tape.entries[node]
            # inputs at which a condition changes, by bisection between pairs of probes
            holds = compile_evaluator(tape, [condition])
            true = holds(probes)[0] != 0
            pairs = min(int(true.sum()), int((~true).sum()))
            boundary, outside = probes[:, true][:, :pairs], probes[:, ~true][:, :pairs]
            for _ in range(OPTIONS.bisections):
                middle = (boundary + outside) / 2
                is_inside = holds(middle)[0] != 0
                boundary, outside = np.where(is_inside, middle, boundary), np.where(is_inside, outside, middle)
            if boundary.shape[1] == 0:
                continue
            jumps = np.abs(np.subtract(*compile_evaluator(tape, [first, second])(boundary)))
            value, one, other = compile_evaluator(tape, [node, first, second])(probes)
            size = np.nanmax(np.abs(value))
            if not np.nanmax(jumps, initial=0.0) <= OPTIONS.jump * size:
                raise InvalidInput(
                    f"{name} must have pieces that meet where the condition of np.where changes, got a jump"
                )
            if np.all(value >= np.maximum(one, other) - OPTIONS.rounding * size):
                replacements[node] = tape.apply(Op.MAXIMUM, first, second)
            elif np.all(value <= np.minimum(one, other) + OPTIONS.rounding * size):
                replacements[node] = tape.apply(Op.MINIMUM, first, second)
    return substitute(tape, functions, replacements)


def remaining_kinks(
    tape: Tape, reformulation: Reformulation, excluded: Collection[int] = ()
) -> list[tuple[int, int, int]]:
    """Return the kinks that a reformulation left: (index of a function, two entries that meet).

    Kinks of constraints count for every function that contains their variables.
    """
    smooth = reformulation
    reached = [set(dependencies(tape, [entry])) for entry in (*smooth.functions, *smooth.constraints)]
    owners = [{k} for k in range(len(smooth.functions))]
    for variable in smooth.epigraph_variables:  # outermost first
        users = [owner for owner, entries in zip(owners, reached, strict=False) if variable in entries]
        owners += 2 * [set().union(*users)]
    kinks = dict[tuple[int, int, int], None]()
    for owner, entries in zip(owners, reached, strict=True):
        for node in sorted(entries - set(excluded)):
            op, a, b, _ = tape.entries[node]
            if op in NONSMOOTH:
                kinks |= {(k, a, tape.constant(0.0) if op is Op.ABSOLUTE else b): None for k in sorted(owner)}
    return list(kinks)


def _is_convex_kink(
    tape: Tape,
    node: int,
    variable: int,
    functions: list[int],
    senses: list[int],
    probes: Float[np.ndarray, "inputs points"],
) -> bool:
    """Return whether a node's kink is convex for functions.

    No function may improve if the node's variable grows, and one must worsen if the variable equals an operand.
    """
    op, a, b, _ = tape.entries[node]
    operands = [a, b] if b >= 0 else [tape.constant(0.0)]
    values = compile_evaluator(tape, [node, *operands])(_pad(tape, probes))
    derivatives = [gradient(tape, f, [variable])[0] for f in functions]
    inputs = [_pad(tape, probes) for _ in values]
    for rows, value in zip(inputs, values, strict=True):
        rows[tape.entries[variable][1]] = value
    with np.errstate(all="ignore"):
        rates = np.nan_to_num(compile_evaluator(tape, derivatives)(np.concatenate(inputs, axis=1)))
    signs = np.array(senses) * (-1.0 if op is Op.MINIMUM else 1.0)
    worsening, rounding = signs[:, None] * rates, OPTIONS.rounding * np.abs(rates).max(axis=1, initial=0.0)[:, None]
    both_ways = (signs == 0) & (np.abs(rates) > rounding).any(axis=1)
    if np.any(both_ways) or np.any(worsening < -rounding):
        return False
    return bool(np.any((worsening > rounding)[:, probes.shape[1] :]))


def _pad(tape: Tape, probes: np.ndarray) -> np.ndarray:
    """Return probes with zeros added for the tape's newer inputs."""
    return np.pad(probes, ((0, len(tape.inputs) - len(probes)), (0, 0)))
