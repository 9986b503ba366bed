"""Traced arrays: code without coupling of samples gets NumPy's numbers; other code is detected."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from paretoik.autodiff.differentiation import gradient
from paretoik.autodiff.tape import Expression
from paretoik.autodiff.tracing import FUNCTIONS, NotLocal, TracedArray
from paretoik.errors import InvalidInput
from tests.autodiff.samples import ROW, SAMPLES, TABLE, TIME, TURNS, Q, R, V, numbers, traced


def agrees(function, *arrays, samples=SAMPLES):
    """Compare a function of traced arrays with NumPy."""
    trace, inputs = traced(*arrays, samples=samples)
    traced_value, expected = function(*inputs), function(*arrays)
    assert isinstance(traced_value, TracedArray)
    assert traced_value.shape == np.shape(expected)
    assert traced_value.ndim == np.ndim(expected)
    np.testing.assert_allclose(
        numbers(trace, traced_value, *arrays), np.asarray(expected, float), rtol=1e-12, atol=1e-13
    )


def accumulated(q):
    total = 0.0
    for j in range(3):
        total += q[..., j] ** 2
    total -= 1.0
    total *= np.sin(q[..., 0])
    return total


LOCAL = {
    "joints by a list": lambda q, v, r: q[..., [2, 0, 0]],
    "joints by an array": lambda q, v, r: q[:, np.array([2, 0])],
    "joints by a mask": lambda q, v, r: q[..., np.array([True, False, True])],
    "no joints": lambda q, v, r: q[..., []],
    "elements by two lists": lambda q, v, r: r[:, [0, 1], [1, 2]],
    "all, then a part": lambda q, v, r: r[..., :, 1:][:, 0, -1],
    "scalars": lambda q, v, r: 2 * q + 1 - q / 3 - 1 / (q + 9) + 2.0**q + np.float64(3) * q,
    "a row of numbers": lambda q, v, r: q * ROW + ROW,
    "times": lambda q, v, r: q[..., 0] * TIME + np.sin(TIME),
    "the duration": lambda q, v, r: q[..., 0] / (TIME[..., -1] - TIME[..., 0])[..., None],
    "arrays of two sizes": lambda q, v, r: r * q[..., None, :],
    "powers": lambda q, v, r: q**2 + np.abs(q) ** 1.5 + np.abs(q) ** [1, 2, 0.5] + np.abs(q) ** np.tanh(v),
    "functions of numbers": lambda q, v, r: np.sin(q) + np.exp(v) + np.hypot(q, v) + np.arctan2(q, v) + np.tanh(q),
    "functions of mixed numbers": lambda q, v, r: np.maximum(q, TABLE) + np.minimum(ROW, v) + np.hypot(q, 1.0),
    "comparisons": lambda q, v, r: (q > 0) * q + (q <= v) + (v >= 0) * 1.0 + (q == q) + (q != v),
    "both comparisons": lambda q, v, r: (q > 0) & (v > 0),
    "either comparison": lambda q, v, r: (q > 0) | ~(v > 0),
    "sum of comparisons": lambda q, v, r: ((q > 0) + (v > 0)) * 1.0,
    "sum of comparisons and truths": lambda q, v, r: ((q > 0) + np.array([True, False, True])) * 1.0,
    "count of comparisons": lambda q, v, r: np.sum(q > 0, axis=-1) + np.sum(v > 0, axis=-1),
    "sum of shares": lambda q, v, r: (q > 0).astype(float) + (v > 0).astype(float) + (q > 0).copy() * 1.0,
    "truths of numbers": lambda q, v, r: np.logical_and(q * 5, v) + 0.0,
    "all of them": lambda q, v, r: np.all(q > -1, axis=-1) + 0.0,
    "any of them": lambda q, v, r: (q > 1).any(axis=-1) + 0.0,
    "all and any of numbers": lambda q, v, r: (
        np.all(q, axis=-1) * 2.0 + np.any(np.stack([q, -q], axis=-1), axis=-1)[..., 0]
    ),
    "where": lambda q, v, r: np.where(q > 0, np.sqrt(np.abs(q)), v),
    "where, of numbers": lambda q, v, r: np.where(q[..., 0] > 0, 1.0, TIME),
    "where, by plain truths": lambda q, v, r: np.where(TABLE > 0, q, 0.0) + np.where(ROW > 0, v, 1),
    "clip": lambda q, v, r: np.clip(q, -0.5, 0.5) + v.clip(None, 1) + v.clip(-1) + np.clip(0.1, q, v),
    "clip by name": lambda q, v, r: np.clip(q, a_min=-0.5, a_max=ROW) + np.clip(v, min=0, max=TABLE),
    "sum": lambda q, v, r: np.sum(q, axis=-1),
    "sum of two axes": lambda q, v, r: np.sum(r, axis=(-2, -1)) + r.sum(axis=(2, 1)),
    "sum that keeps": lambda q, v, r: q.sum(axis=-1, keepdims=True) + r.sum((1, 2), keepdims=True)[..., 0],
    "sum of one axis of two": lambda q, v, r: r.sum(axis=1) + r.sum(-1),
    "sum of nothing": lambda q, v, r: q[..., :0].sum(axis=-1) + np.prod(q[..., :0], axis=-1),
    "reduce": lambda q, v, r: np.add.reduce(q, axis=-1) + np.maximum.reduce(r, axis=-1).sum(-1),
    "product": lambda q, v, r: np.prod(q, axis=-1) + q.prod(-1),
    "mean": lambda q, v, r: np.mean(q, axis=-1) + r.mean(axis=(1, 2)) + q.mean(-1, keepdims=True)[..., 0],
    "variance": lambda q, v, r: np.var(q, axis=-1) + np.std(r, axis=(1, 2), ddof=1) + np.ptp(q, axis=-1),
    "extremes": lambda q, v, r: np.max(q, axis=-1) + q.min(axis=-1) + np.amin(v, -1) + np.amax(v, axis=1),
    "norm": lambda q, v, r: np.linalg.norm(q, axis=-1) + np.linalg.norm(r, axis=(-2, -1)),
    "norms": lambda q, v, r: np.linalg.norm(q, 1, -1) + np.linalg.norm(v, np.inf, 1) + np.linalg.norm(v, 2, axis=-1),
    "norm that keeps": lambda q, v, r: q / np.linalg.norm(q, axis=-1, keepdims=True),
    "inner products": lambda q, v, r: np.einsum("...i,...i->...", q, v) + np.einsum("...i,i", q, ROW),
    "inner products with a table": lambda q, v, r: np.einsum("...i,...i->...", q, TABLE),
    "einsum in full": lambda q, v, r: np.einsum("ti, tij, tj -> t", q, r, v),
    "einsum of matrices": lambda q, v, r: np.einsum("...ij,...j->...i", r, q) + np.einsum("...ij,...i", r, q),
    "einsum transposes": lambda q, v, r: np.einsum("...ij->...ji", r) + np.einsum("ij,...jk->...ki", TURNS[0], r),
    "einsum sums": lambda q, v, r: np.einsum("...i->...", q) + np.einsum("...ij->...", r),
    "outer products": lambda q, v, r: np.einsum("...i,...j->...ij", q, v) + q[..., :, None] * v[..., None, :],
    "matrices": lambda q, v, r: r @ r + r @ TURNS + TURNS @ r + np.eye(3) @ r + r @ np.eye(3),
    "matrices and vectors": lambda q, v, r: (r @ v[..., None])[..., 0] + q @ TURNS[0] + r @ ROW + ROW @ r,
    "matrix by name": lambda q, v, r: np.matmul(q, ROW) + np.dot(q, ROW) + q.dot(ROW) + np.dot(ROW, r)[..., 0],
    "dot": lambda q, v, r: np.dot(q, TURNS[0]) + np.dot(2.0, q) + q.dot(3),
    "cross": lambda q, v, r: np.cross(q, v) + np.cross(q, ROW) + np.cross(TABLE, v) + np.linalg.cross(q, v),
    "cross of many": lambda q, v, r: np.cross(r, q[..., None, :]),
    "stack": lambda q, v, r: np.stack([q[..., 0], v[..., 1], TIME], axis=-1),
    "stack between": lambda q, v, r: np.stack([q, v, TABLE], axis=1) + np.stack((q, v, v), -2),
    "concatenate": lambda q, v, r: np.concatenate([q, TABLE, v[..., :1]], axis=-1),
    "joined, then changed": lambda q, v, r: np.add(np.stack([q, v], axis=-1), 1.0),
    "diff": lambda q, v, r: np.diff(q) + np.diff(v, axis=-1),
    "second diff": lambda q, v, r: np.diff(q, n=2, axis=1) + np.diff(r, 2, axis=-2)[..., 0, :1],
    "cumsum": lambda q, v, r: np.cumsum(q, axis=-1) + v.cumsum(1) + np.cumsum(r, axis=-2)[..., 2, :],
    "cumprod": lambda q, v, r: np.cumprod(q, axis=-1),
    "det": lambda q, v, r: np.linalg.det(r) + np.linalg.det(r[..., :2, :2]) + np.linalg.det(r[..., :1, 1:2]),
    "trace": lambda q, v, r: np.trace(r, axis1=-2, axis2=-1) + np.linalg.trace(r) + r.trace(0, 1, 2),
    "diagonal": lambda q, v, r: np.diagonal(r, axis1=1, axis2=2) + np.linalg.diagonal(r),
    "turned": lambda q, v, r: r.swapaxes(-1, -2) + np.swapaxes(r, 1, 2) + r.mT + np.matrix_transpose(r),
    "transposed": lambda q, v, r: r.transpose(0, 2, 1) + np.transpose(r, (0, 2, 1)) + np.moveaxis(r, -1, -2),
    "a series transposed": lambda q, v, r: q[..., 0].T,
    "thicker": lambda q, v, r: np.expand_dims(q, -1) + np.expand_dims(v, (2,)),
    "thinner": lambda q, v, r: np.squeeze(q[..., :1], axis=-1) + v[..., None].squeeze()[..., 0],
    "reshaped": lambda q, v, r: r.reshape(*r.shape[:-2], -1) + r.reshape(SAMPLES, 9) + r.reshape((-1, 9)),
    "reshaped back": lambda q, v, r: np.reshape(r, (SAMPLES, 9)).reshape(*r.shape),
    "moved about": lambda q, v, r: np.flip(q, axis=-1) + np.roll(v, 1, axis=-1) + np.take(q, [0, 0, 2], axis=-1),
    "repeated": lambda q, v, r: np.repeat(q, 2, axis=-1) + v.repeat([3, 2, 1], axis=1),
    "broadcast": lambda q, v, r: np.broadcast_to(q[..., None], r.shape) * r,
    "likes": lambda q, v, r: np.zeros_like(q) + 2 * np.ones_like(q) + np.full_like(v, 3.0) + q * 0,
    "copies": lambda q, v, r: q.copy() + np.copy(v) + q.astype(float) + v.astype(np.float64) + np.positive(q),
    "as truths": lambda q, v, r: q.astype(bool) * 1.0,
    "added up in a loop": lambda q, v, r: accumulated(q),
    "added up by sum": lambda q, v, r: sum(q[..., j] * v[..., j] for j in range(3)),
    "facts": lambda q, v, r: q * len(q) + q.shape[-1] + q.ndim + q.size + np.ndim(r) + np.shape(q)[0] + np.size(v),
}


@pytest.mark.parametrize("function", LOCAL.values(), ids=LOCAL.keys())
def test_functions_of_single_samples_are_numpys_with_visible_time_too(function):
    agrees(function, Q, V, R)
    agrees(function, Q, V, R, samples=None)


ACROSS = {
    "samples by a list": lambda q, v, r: q[[0, 1]],
    "samples by a mask": lambda q, v, r: q[TIME > 0.5],
    "rates": lambda q, v, r: np.diff(q, axis=-2),
    "rates of a series": lambda q, v, r: np.diff(q[..., 0]),
    "running sums": lambda q, v, r: np.cumsum(q[..., 0], axis=-1),
    "running sums of all": lambda q, v, r: np.cumsum(q),
    "total": lambda q, v, r: np.sum(q),
    "mean over time": lambda q, v, r: q.mean(axis=0),
    "reduce": lambda q, v, r: np.add.reduce(q),
    "norm of all": lambda q, v, r: np.linalg.norm(q),
    "inner product over time": lambda q, v, r: np.einsum("ti,ti->i", q, v),
    "time at the end": lambda q, v, r: np.einsum("i...,i...->...", q, v),
    "transposed": lambda q, v, r: q.T,
    "transposed by name": lambda q, v, r: np.transpose(q),
    "flat": lambda q, v, r: q.ravel(),
    "flattened": lambda q, v, r: q.reshape(-1),
    "rolled": lambda q, v, r: np.roll(q, 1, axis=0),
    "joined along time": lambda q, v, r: np.concatenate([q, v]),
    "stacked before time": lambda q, v, r: np.stack([q, v]),
    "trace over time": lambda q, v, r: np.trace(r),
    "matrix with time": lambda q, v, r: TURNS[0][:, :1] @ q[:, None, :] @ q.T,
    "series by series": lambda q, v, r: q[..., 0] @ v[..., 0],
    "one by one": lambda q, v, r: [row for row in q],  # noqa: C416
}


@pytest.mark.parametrize("function", ACROSS.values(), ids=ACROSS.keys())
def test_functions_along_time_are_detected(function):
    _, inputs = traced(Q, V, R)
    with pytest.raises(NotLocal):
        function(*inputs)


def test_the_functions_that_a_refusal_lists_are_all_tried_here():
    tried = {name for function in LOCAL.values() for name in function.__code__.co_names}
    assert {function.__name__ for function in FUNCTIONS} - {"ravel"} <= tried | {"matrix_transpose", "mT"}


@settings(max_examples=30)
@given(arrays.basic_indices((SAMPLES, 3, 2), allow_newaxis=True, max_dims=6))
def test_any_index_gives_what_numpy_gives_or_looks_along_time(index):
    source = np.arange(SAMPLES * 6.0).reshape(SAMPLES, 3, 2)
    trace, (array,) = traced(source)
    try:
        picked = array[index]
    except NotLocal:
        samples = source[index] // 6
        assert samples.shape[:1] != (SAMPLES,) or (np.moveaxis(samples, 0, -1) != np.arange(SAMPLES)).any()
        return
    np.testing.assert_array_equal(numbers(trace, picked, source), source[index])


@settings(max_examples=30)
@given(arrays.array_shapes(min_dims=0, max_dims=3, max_side=SAMPLES), st.booleans())
def test_plain_arrays_meet_traced_ones_where_numpy_lets_them(shape, wide):
    source, plain = (Q if wide else Q[:, 0]), np.random.default_rng(0).normal(size=shape)
    trace, (array,) = traced(source)
    try:
        expected = source * plain
    except ValueError:
        with pytest.raises(InvalidInput, match="do not broadcast"):
            array * plain
        return
    if expected.shape[0] != SAMPLES or expected.ndim > source.ndim:  # a batch: a traced motion is not a batch
        with pytest.raises(InvalidInput, match="do not broadcast"):
            array * plain
        return
    np.testing.assert_array_equal(numbers(trace, array * plain, source), expected)


def test_gradients_through_arrays_are_those_of_the_sample_alone():
    trace, (q, r) = traced(Q, R)
    value = np.linalg.norm(np.cross(r @ ROW, q), axis=-1) + np.linalg.det(r) * TIME
    (value,) = value.entries.ravel()
    slopes = [Expression(trace.tape, i) for i in gradient(trace.tape, value.index, trace.tape.inputs[:12])]
    gradients = numbers(trace, TracedArray(trace, slopes), Q, R)

    def real(flat):
        q, r = flat[:, :3], flat[:, 3:].reshape(-1, 3, 3)
        return np.linalg.norm(np.cross(r @ ROW, q), axis=-1) + np.linalg.det(r) * TIME

    flat = np.concatenate([Q, R.reshape(SAMPLES, 9)], axis=1)
    for k, step in enumerate(np.eye(12) * 1e-6):
        np.testing.assert_allclose(
            gradients[:, k], (real(flat + step) - real(flat - step)) / 2e-6, rtol=1e-6, atol=1e-8
        )
