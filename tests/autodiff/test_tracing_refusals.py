"""Traced arrays refuse unsupported code in one line that names it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from paretoik.autodiff.tracing import NotLocal
from paretoik.errors import InvalidInput
from tests.autodiff.samples import ROW, SAMPLES, TABLE, TIME, Q, R, V, numbers, traced

PLAIN = Q.copy()
REFUSED = {
    "fft": (lambda q, v, r: np.fft.fft(q), "np.fft.fft has no derivative here; those that have: np.all"),
    "round": (lambda q, v, r: np.round(q), "np.round has no derivative here"),
    "round's method": (lambda q, v, r: q.round(2), "np.round has no derivative here"),
    "round by Python": (lambda q, v, r: round(q[..., 0]), "a plain number was asked"),
    "sort": (lambda q, v, r: np.sort(q), "np.sort has no derivative here"),
    "argmax": (lambda q, v, r: q.argmax(axis=-1), "np.argmax has no derivative here"),
    "inverse": (lambda q, v, r: np.linalg.inv(r), "np.linalg.inv has no derivative here"),
    "floor": (lambda q, v, r: np.floor(q), "np.floor has no derivative here; those that have: absolute"),
    "remainder": (lambda q, v, r: q % 1.0, "np.remainder has no derivative here"),
    "division": (lambda q, v, r: q // 1.0, "np.floor_divide has no derivative here"),
    "accumulate": (lambda q, v, r: np.add.accumulate(q, axis=-1), "np.add.accumulate has no derivative here"),
    "outer": (lambda q, v, r: np.multiply.outer(q, v), "np.multiply.outer has no derivative here"),
    "another reduce": (lambda q, v, r: np.subtract.reduce(q, axis=-1), "np.subtract.reduce has no derivative here"),
    "float": (lambda q, v, r: float(q[..., 0]), "a plain number was asked"),
    "int": (lambda q, v, r: int(q[..., 0]), "a plain number was asked"),
    "math": (lambda q, v, r: math.sin(q[..., 0]), "a plain number was asked"),
    "range": (lambda q, v, r: range(q[..., 0]), "a plain number was asked"),
    "item": (lambda q, v, r: q.item(), ".item of an array has no derivative here"),
    "tolist": (lambda q, v, r: q.tolist(), ".tolist of an array has no derivative here"),
    "no such thing": (lambda q, v, r: q.speed, ".speed of an array has no derivative here"),
    "if": (lambda q, v, r: 1 if (q > 0) else 0, "use np.where"),
    "and": (lambda q, v, r: q[..., 0] > 0 and v[..., 0] > 0, "use np.where"),
    "Python's max": (lambda q, v, r: max(q[..., 0], v[..., 0]), "use np.where"),
    "boolean indexing": (lambda q, v, r: q[q > 0], "an index cannot depend on the motion"),
    "an index": (lambda q, v, r: q[..., v[..., 0]], "an index cannot depend on the motion"),
    "an index of numbers": (lambda q, v, r: ROW[q[..., 0]], "plain number"),
    "take": (lambda q, v, r: np.take(ROW, q[..., 0]), "plain numbers were asked"),
    "assignment": (lambda q, v, r: q.__setitem__((..., 0), 1.0), "cannot be written where derivatives are taken"),
    "assignment to numbers": (lambda q, v, r: np.zeros(3).__setitem__(..., q[..., 0]), "plain number"),
    "in place": (lambda q, v, r: q.__iadd__(1.0), "np.add would change an array in place that others see"),
    "in place, of a part": (lambda q, v, r: (q * 2)[..., 0].__imul__(1.0), "np.multiply would change an array"),
    "in place, of numbers": (lambda q, v, r: PLAIN.__iadd__(q), "np.add would change an array in place"),
    "in place, larger": (lambda q, v, r: (q * 2).__iadd__(r), "do not go together|np.add would change an array"),
    "asarray": (lambda q, v, r: np.asarray(q), "plain numbers were asked"),
    "array": (lambda q, v, r: np.array([q[..., 0], q[..., 1]]), "np.stack for np.array"),
    "column_stack": (lambda q, v, r: np.column_stack([q, v]), "np.column_stack has no derivative here"),
    "complex": (lambda q, v, r: q * 1j, "values must be real numbers where derivatives are taken, got 1j"),
    "complex by the sample": (lambda q, v, r: q * TABLE.astype(complex), "real numbers .* got complex128"),
    "nothing": (lambda q, v, r: np.where(q > 0, q, None), "values must be real numbers .* got None"),
    "text": (lambda q, v, r: q + "1", "values must be real numbers"),
    "whole numbers": (lambda q, v, r: q.astype(int), r"astype\(int64\) has no derivative here"),
    "other joints": (lambda q, v, r: q[..., 3], "index 3 is out of bounds"),
    "other axes": (lambda q, v, r: q.sum(axis=-3), "axis -3"),
    "too many axes": (lambda q, v, r: q[..., 0, 0, 0], "indexing of shape"),
    "an index by name": (lambda q, v, r: q["elbow"], "indexing of shape"),
    "largest of nothing": (lambda q, v, r: q[..., :0].max(axis=-1), "np.maximum of nothing has no value"),
    "settings of a sum": (lambda q, v, r: np.sum(q, axis=-1, dtype=float), "np.sum: .*dtype"),
    "a type for a place": (lambda q, v, r: np.sum(q, -1, float), "np.sum: too many positional arguments"),
    "a first value": (lambda q, v, r: np.max(q, axis=-1, initial=9.0), "np.max: .*initial"),
    "a first value of reduce": (lambda q, v, r: np.maximum.reduce(q, axis=-1, initial=9.0), "reduce.initial"),
    "a mask for a function": (lambda q, v, r: np.add(q, v, where=TABLE > 0), r"np.add\(where=...\) has no derivative"),
    "a half where": (lambda q, v, r: np.where(q > 0), "np.where: missing a required argument"),
    "settings of clip": (lambda q, v, r: np.clip(q, 0, 1, casting="unsafe"), "np.clip: .*casting"),
    "another norm": (lambda q, v, r: np.linalg.norm(q, ord=3, axis=-1), r"np.linalg.norm\(ord=3\)"),
    "norm of a matrix": (lambda q, v, r: np.linalg.norm(r, ord=2, axis=(-2, -1)), r"np.linalg.norm\(ord=2\)"),
    "det of no square": (lambda q, v, r: np.linalg.det(r[..., :2]), "np.linalg.det must get square matrices"),
    "cross of pairs": (lambda q, v, r: np.cross(q[..., :2], v[..., :2]), "np.cross must get vectors of 3 numbers"),
    "einsum twice": (lambda q, v, r: np.einsum("...ii->...", r), r"np.einsum\('...ii->...'\) has no derivative"),
    "einsum of less": (lambda q, v, r: np.einsum("...i,...i->...", q), "np.einsum"),
    "einsum of more axes": (lambda q, v, r: np.einsum("tijk->t", r), "np.einsum: 'tijk' does not name the axes"),
    "einsum of strangers": (lambda q, v, r: np.einsum("...i->...k", q), "np.einsum"),
    "a matrix by a vector": (lambda q, v, r: r @ q, r"shapes \(6, 3, 3\) and \(6, 3\) have no matrix product"),
    "a number as a matrix": (lambda q, v, r: q @ 2.0, "have no matrix product"),
    "dot of stacks": (lambda q, v, r: np.dot(r, r), "np.dot of stacks of matrices"),
    "joints and series": (lambda q, v, r: q - q[..., 0], r"shapes \(6, 3\) and \(6,\) do not go together"),
    "matrices and joints": (lambda q, v, r: r * q, r"shapes \(6, 3, 3\) and \(6, 3\) do not go together"),
    "joints and times": (lambda q, v, r: q * TIME, r"shapes \(6, 3\) and \(6,\) do not go together"),
    "times of another motion": (lambda q, v, r: q[..., 0] * np.ones(4), "do not go together"),
    "a batch": (lambda q, v, r: q * np.ones((2, 6, 3)), "do not go together"),
    "stack of unequals": (lambda q, v, r: np.stack([q, v[..., :1]], axis=-1), "np.stack of shape"),
    "stack with a number": (lambda q, v, r: np.stack([q[..., 0], 1.0], axis=-1), "cannot be joined"),
    "reshape": (lambda q, v, r: q.reshape(SAMPLES, 2), "reshape of shape"),
}


@pytest.mark.parametrize(("function", "words"), REFUSED.values(), ids=REFUSED.keys())
def test_what_has_no_derivative_is_refused_in_one_line(function, words):
    _, inputs = traced(Q, V, R)
    with pytest.raises(InvalidInput, match=words) as refused:
        function(*inputs)
    assert not isinstance(refused.value, NotLocal)
    assert "\n" not in str(refused.value)
    np.testing.assert_array_equal(PLAIN, Q)


def test_an_array_changed_in_place_is_changed_under_all_its_names():
    trace, (q,) = traced(Q)
    total = q * 2
    same = total
    total += 1.0
    assert same is total
    np.testing.assert_allclose(numbers(trace, same, Q), 2 * Q + 1)
    total = q * 2
    part = total[..., 0]
    with pytest.raises(InvalidInput, match="use x = x \\+ y"):
        total += 1.0
    np.testing.assert_allclose(numbers(trace, part, Q), 2 * Q[..., 0])
