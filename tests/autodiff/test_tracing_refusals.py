"""Traced arrays refuse unsupported code in one line that names it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from paretoik.autodiff.tracing import NotLocal
from paretoik.errors import InvalidInput
from tests.autodiff.samples import ROW, SAMPLES, TABLE, Q, R, V, numbers, traced

PLAIN = Q.copy()
REFUSED = {
    "fft": (lambda q, v, r: np.fft.fft(q), "np.fft.fft has no derivative here; functions that have one: np.all"),
    "round by Python": (lambda q, v, r: round(q[..., 0]), "cannot become a plain number"),
    "inverse": (lambda q, v, r: np.linalg.inv(r), "np.linalg.inv has no derivative here"),
    "floor": (lambda q, v, r: np.floor(q), "np.floor has no derivative here; functions that have one: absolute"),
    "accumulate": (lambda q, v, r: np.add.accumulate(q, axis=-1), "np.add.accumulate has no derivative here"),
    "another reduce": (lambda q, v, r: np.subtract.reduce(q, axis=-1), "np.subtract.reduce has no derivative here"),
    "math": (lambda q, v, r: math.sin(q[..., 0]), "cannot become a plain number"),
    "item": (lambda q, v, r: q.item(), ".item of an array has no derivative here"),
    "no such thing": (lambda q, v, r: q.speed, ".speed of an array has no derivative here"),
    "if": (lambda q, v, r: 1 if (q > 0) else 0, "use np.where"),
    "Python's max": (lambda q, v, r: max(q[..., 0], v[..., 0]), "use np.where"),
    "boolean indexing": (lambda q, v, r: q[q > 0], "an index cannot depend on the motion"),
    "an index of numbers": (lambda q, v, r: ROW[q[..., 0]], "plain number"),
    "take": (lambda q, v, r: np.take(ROW, q[..., 0]), "cannot become plain numbers"),
    "assignment": (lambda q, v, r: q.__setitem__((..., 0), 1.0), "is not possible where derivatives are taken"),
    "assignment to numbers": (lambda q, v, r: np.zeros(3).__setitem__(..., q[..., 0]), "plain number"),
    "in place": (lambda q, v, r: q.__iadd__(1.0), "np.add would change an array in place that shares memory"),
    "in place, of a part": (lambda q, v, r: (q * 2)[..., 0].__imul__(1.0), "np.multiply would change an array"),
    "in place, of numbers": (lambda q, v, r: PLAIN.__iadd__(q), "np.add would change an array in place"),
    "asarray": (lambda q, v, r: np.asarray(q), "cannot become plain numbers"),
    "array": (lambda q, v, r: np.array([q[..., 0], q[..., 1]]), "np.stack instead of np.array"),
    "complex by the sample": (lambda q, v, r: q * TABLE.astype(complex), "real numbers .* got complex128"),
    "whole numbers": (lambda q, v, r: q.astype(int), r"astype\(int64\) has no derivative here"),
    "other joints": (lambda q, v, r: q[..., 3], "index 3 is out of bounds"),
    "too many axes": (lambda q, v, r: q[..., 0, 0, 0], "indexing of shape"),
    "largest of nothing": (lambda q, v, r: q[..., :0].max(axis=-1), "np.maximum of an empty array has no value"),
    "settings of a sum": (lambda q, v, r: np.sum(q, axis=-1, dtype=float), "np.sum must get only arguments .*dtype"),
    "a first value of reduce": (lambda q, v, r: np.maximum.reduce(q, axis=-1, initial=9.0), "reduce.initial"),
    "a half where": (lambda q, v, r: np.where(q > 0), "np.where must get .*missing a required argument"),
    "another norm": (lambda q, v, r: np.linalg.norm(q, ord=3, axis=-1), r"np.linalg.norm\(ord=3\)"),
    "det of no square": (lambda q, v, r: np.linalg.det(r[..., :2]), "np.linalg.det must get square matrices"),
    "cross of pairs": (lambda q, v, r: np.cross(q[..., :2], v[..., :2]), "np.cross must get vectors of 3 numbers"),
    "einsum twice": (lambda q, v, r: np.einsum("...ii->...", r), r"np.einsum\('...ii->...'\) has no derivative"),
    "einsum of more axes": (lambda q, v, r: np.einsum("tijk->t", r), "np.einsum: 'tijk' does not name the axes"),
    "a matrix by a vector": (lambda q, v, r: r @ q, r"shapes \(6, 3, 3\) and \(6, 3\) have no matrix product"),
    "dot of stacks": (lambda q, v, r: np.dot(r, r), "np.dot of stacks of matrices"),
    "joints and series": (lambda q, v, r: q - q[..., 0], r"shapes \(6, 3\) and \(6,\) do not broadcast"),
    "times of another motion": (lambda q, v, r: q[..., 0] * np.ones(4), "do not broadcast"),
    "stack of unequals": (lambda q, v, r: np.stack([q, v[..., :1]], axis=-1), "np.stack of shape"),
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
