"""Absolute values, maxima and minima in what is minimised or bounded: slack variables in their place.

Where a function that is to be small grows with |x|, or max(x, y), that number may be any v ≥ x, −x (x, y): at an
optimum it is the least of them. What is left is smooth. Where it falls with it instead, the kink points away from any
optimum, and where it is flat at the kink, there is none: both are left alone.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.autodiff.differentiation import gradient, used
from paretoik.autodiff.evaluator import program
from paretoik.autodiff.rewriting import substituted
from paretoik.autodiff.tape import Op, Tape
from paretoik.errors import InvalidInput

KINKED = frozenset({Op.ABSOLUTE, Op.MAXIMUM, Op.MINIMUM})
NOTHING = 1e-12  # slopes below are none
MEETS = 1e-6  # as a share of a choice's values: pieces nearer than this meet


@dataclass(frozen=True, kw_only=True, eq=False)
class Smoothed:
    """Functions on a tape without the kinks that matter: with ``slacks``, inputs that stand for ``nodes``.

    ``rows`` are the entries that then have to be at least 0.
    """

    functions: list[int]
    slacks: list[int]
    nodes: list[int]
    rows: list[int]


def smoothed(
    tape: Tape,
    functions: Sequence[int],
    sides: Sequence[int],
    probes: Float[np.ndarray, "inputs lanes"],
    without: Collection[int] = (),
) -> Smoothed:
    """Return functions with slacks in place of kinks; ``sides`` are 1 for what should be small, −1 large, 0 neither.

    ``probes`` are inputs of the tape at which slopes are looked at; entries ``without`` are left as they are.
    """
    count, wanted, left = len(functions), list(sides), set(without)
    found, slacks, nodes = list(functions), list[int](), list[int]()
    while kinked := [i for i in used(tape, found) if tape.entries[i][0] in KINKED and i not in left]:
        node = max(kinked)  # the outermost first: what is inside it belongs to its rows then
        slack = tape.input().index
        changed = substituted(tape, found, {node: slack})
        if not _grows(tape, node, slack, changed, wanted, probes):
            left.add(node)
            continue
        op, a, b, _ = tape.entries[node]
        if op is Op.ABSOLUTE:
            b = tape.apply(Op.NEGATE, a)
        pairs = [(a, slack), (b, slack)] if op is Op.MINIMUM else [(slack, a), (slack, b)]
        found = changed + [tape.apply(Op.SUBTRACT, *pair) for pair in pairs]
        wanted += [-1, -1]
        slacks.append(slack)
        nodes.append(node)
    return Smoothed(functions=found[:count], slacks=slacks, nodes=nodes, rows=found[count:])


def spelled_out(
    tape: Tape,
    functions: Sequence[int],
    names: Sequence[str],
    probes: Float[np.ndarray, "inputs lanes"],
    without: Collection[int] = (),
) -> list[int]:
    """Return functions with maxima and minima where choices (np.where) between two pieces are just that.

    Raises InvalidInput, naming the function, where the pieces do not meet where the choice changes.
    """
    replaced: dict[int, int] = {}
    for name, function in zip(names, functions, strict=True):
        for node in used(tape, [function]):
            if tape.entries[node][0] is not Op.CHOOSE or node in replaced or node in without:
                continue
            _, condition, first, second = tape.entries[node]
            at = _boundary(tape, condition, probes)
            if at.shape[1] == 0:
                continue
            apart = np.abs(np.subtract(*program(tape, [first, second])(at)))
            if not np.nanmax(apart, initial=0.0) <= MEETS * (1 + np.nanmax(np.abs(program(tape, [node])(probes)))):
                raise InvalidInput(
                    f"{name}: jumps where the condition of np.where changes: pieces that meet are wanted"
                )
            chosen, one, other = program(tape, [node, first, second])(probes)
            if np.all(chosen >= np.maximum(one, other) - NOTHING):
                replaced[node] = tape.apply(Op.MAXIMUM, first, second)
            elif np.all(chosen <= np.minimum(one, other) + NOTHING):
                replaced[node] = tape.apply(Op.MINIMUM, first, second)
    return substituted(tape, functions, replaced)


def _boundary(
    tape: Tape, condition: int, probes: Float[np.ndarray, "inputs lanes"]
) -> Float[np.ndarray, "inputs pairs"]:
    """Return inputs, to rounding, where a condition changes between pairs of probes."""
    truth = program(tape, [condition])
    holds = truth(probes)[0] != 0
    pairs = min(int(holds.sum()), int((~holds).sum()))
    inside, outside = probes[:, holds][:, :pairs], probes[:, ~holds][:, :pairs]
    for _ in range(60):
        middle = (inside + outside) / 2
        within = truth(middle)[0] != 0
        inside, outside = np.where(within, middle, inside), np.where(within, outside, middle)
    return inside


def _grows(
    tape: Tape, node: int, slack: int, functions: list[int], sides: list[int], probes: Float[np.ndarray, "inputs lanes"]
) -> bool:
    """Return whether functions get worse with the slack, and have a kink where its operands meet."""
    op, a, b, _ = tape.entries[node]
    meeting = [a, b] if b >= 0 else [tape.constant(0.0)]
    values = program(tape, [node, *meeting])(_wide(tape, probes))
    slopes = [gradient(tape, f, [slack])[0] for f in functions]
    given = [_wide(tape, probes) for _ in values]
    for table, value in zip(given, values, strict=True):
        table[tape.entries[slack][1]] = value
    with np.errstate(all="ignore"):
        found = np.nan_to_num(program(tape, slopes)(np.concatenate(given, axis=1)))
    signs = np.array(sides) * (-1.0 if op is Op.MINIMUM else 1.0)
    worse = signs[:, None] * found
    if np.any((signs == 0) & (np.abs(found) > NOTHING).any(axis=1)) or np.any(worse < -NOTHING):
        return False
    return bool(np.any(worse[:, probes.shape[1] :] > NOTHING))


def _wide(tape: Tape, probes: np.ndarray) -> np.ndarray:
    return np.pad(probes, ((0, len(tape.inputs) - len(probes)), (0, 0)))
