"""Numerical steps on motions, compared with dense linear algebra: maps, transposes, frames, retraction."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paretoik.autodiff.evaluator import compile_evaluator
from paretoik.autodiff.tape import Tape, as_entry
from paretoik.trajectory import self_motion_kernel as steps

SAMPLES, DOF, ROWS, ORDERS, WIDTH = 5, 4, 2, 2, 3
FREE = DOF - ROWS
seeds = st.integers(0, 1000)


def stencil(rng):
    """Return neighbours and coefficients at every instant, and the unknowns of every sample; the first is fixed."""
    neighbours = np.clip(np.arange(SAMPLES)[:, None] + [-1, 0, 1], 0, SAMPLES - 1)
    first_unknown = np.append(-1, FREE * np.arange(SAMPLES - 1))
    return neighbours, rng.normal(size=(ORDERS, SAMPLES, WIDTH)), first_unknown


def frames(tracked):
    tangent, normal = np.empty((SAMPLES, DOF, FREE)), np.empty((SAMPLES, DOF, ROWS))
    triangle = np.zeros((SAMPLES, ROWS, ROWS))
    return steps.tangent_frames(tracked, tangent, normal, triangle), tangent, normal, triangle


def variables(q, neighbours, coefficients):
    u = np.empty((ORDERS * DOF, SAMPLES))
    steps.apply_stencil(q, neighbours, coefficients, u)
    return u


@settings(max_examples=20)
@given(seeds)
def test_gradients_go_back_by_the_transposes_of_stencils_and_of_steps(seed):
    rng = np.random.default_rng(seed)
    neighbours, coefficients, first_unknown = stencil(rng)
    q, by_u, scale = (
        rng.normal(size=(SAMPLES, DOF)),
        rng.normal(size=(ORDERS * DOF, SAMPLES)),
        rng.uniform(1, 2, SAMPLES),
    )
    by_q = np.zeros((SAMPLES, DOF))
    steps.add_transposed_stencil(by_u, scale, neighbours, coefficients, by_q)
    assert (by_q * q).sum() == pytest.approx((variables(q, neighbours, coefficients) * by_u * scale).sum(), abs=1e-12)
    tangent, step = rng.normal(size=(SAMPLES, DOF, FREE)), rng.normal(size=FREE * (SAMPLES - 1))
    dq, reduced = np.empty((SAMPLES, DOF)), np.empty(len(step))
    assert steps.expand_motion_step(step, tangent, first_unknown, dq) == np.abs(dq).max()
    assert not dq[0].any()
    steps.project_gradient(by_q, tangent, first_unknown, reduced)
    assert reduced @ step == pytest.approx((by_q * dq).sum(), abs=1e-12)


@settings(max_examples=10)
@given(seeds, st.integers(0, 2))
def test_the_hessian_of_an_instant_is_that_of_the_dense_chain_rule(seed, border):
    rng = np.random.default_rng(seed)
    neighbours, coefficients, first_unknown = stencil(rng)
    tangent, unknowns = rng.normal(size=(SAMPLES, DOF, FREE)), FREE * (SAMPLES - 1)
    phi = rng.normal(size=(2 * ORDERS * DOF, 2 * ORDERS * DOF))  # the curve's u, then the spline's
    phi += phi.T
    chain = rng.normal(size=(ORDERS * DOF, ORDERS * DOF, SAMPLES))
    columns, dq = [], np.empty((SAMPLES, DOF))
    for unit in np.eye(unknowns):
        steps.expand_motion_step(unit, tangent, first_unknown, dq)
        columns.append(variables(dq, neighbours, coefficients))
    spline = np.array(columns)
    maps = np.concatenate([np.einsum("uvi,avi->aui", chain, spline), spline], axis=1)
    size = unknowns - border * FREE
    A, B, C = (
        np.zeros((size, 3 * FREE)),
        np.zeros((unknowns - size, size)),
        np.zeros((unknowns - size, unknowns - size)),
    )
    local, half = np.zeros((2, 2 * ORDERS * DOF, WIDTH * FREE))
    for i in range(SAMPLES):
        steps.add_hessian(i, phi, (neighbours, coefficients, first_unknown), tangent, chain, local, half, (A, B, C))
    band = np.array([[A[i, i - k] if 0 <= i - k < A.shape[1] else 0.0 for k in range(size)] for i in range(size)])
    lower = np.tril(np.einsum("aui,uv,bvi->ab", maps, phi, maps))
    np.testing.assert_allclose(band, lower[:size, :size], atol=1e-11)
    np.testing.assert_allclose(B, lower[size:, :size], atol=1e-11)
    np.testing.assert_allclose(np.tril(C), lower[size:, size:], atol=1e-11)
    np.testing.assert_allclose(C, C.T, atol=1e-11)


@settings(max_examples=20)
@given(seeds)
def test_frames_span_the_null_space_and_multipliers_leave_no_gradient_across_it(seed):
    rng = np.random.default_rng(seed)
    tracked = rng.normal(size=(ROWS + ROWS * DOF, SAMPLES))
    jacobian = tracked[ROWS:].T.reshape(SAMPLES, ROWS, DOF)
    regular, tangent, normal, triangle = frames(tracked)
    assert regular
    basis = np.concatenate([normal, tangent], axis=2)
    np.testing.assert_allclose(basis.swapaxes(1, 2) @ basis, np.tile(np.eye(DOF), (SAMPLES, 1, 1)), atol=1e-13)
    np.testing.assert_allclose(jacobian @ tangent, 0.0, atol=1e-13)
    np.testing.assert_allclose(normal @ triangle, jacobian.swapaxes(1, 2), atol=1e-13)
    gradient, multipliers = rng.normal(size=(SAMPLES, DOF)), np.zeros((ROWS, SAMPLES))
    steps.path_multipliers(gradient, normal, triangle, multipliers)
    rest = gradient + np.einsum("srj,rs->sj", jacobian, multipliers)
    np.testing.assert_allclose(np.einsum("sji,sj->si", normal, rest), 0.0, atol=1e-10)


def test_there_are_no_frames_at_a_singularity():
    assert not frames(np.zeros((ROWS + ROWS * DOF, SAMPLES)))[0]


@pytest.mark.parametrize(("start", "arrives"), [(1.2, True), (0.8, True), (0.05, False)])
def test_motions_are_led_back_across_their_path_unless_they_are_too_far(start, arrives):
    tape = Tape()
    x, y = tape.input(), tape.input()
    circle = compile_evaluator(tape, [as_entry(tape, value) for value in (x * x + y * y - 1.0, 2.0 * x, 2.0 * y)])
    angles = np.linspace(0.0, 2.0, SAMPLES)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    q, inputs, tracked = start * directions, np.zeros((2, SAMPLES)), np.empty((3, SAMPLES))
    tangent, normal, triangle = np.empty((SAMPLES, 2, 1)), np.empty((SAMPLES, 2, 1)), np.zeros((SAMPLES, 1, 1))
    assert steps.tangent_frames(circle(np.ascontiguousarray(q.T)), tangent, normal, triangle)
    assert steps.retract_motion(circle.arrays, inputs, q, normal, triangle, tracked) == arrives
    if arrives:
        np.testing.assert_allclose(q, directions, atol=1e-12)


def test_the_last_sample_moves_with_the_one_before_as_far_as_its_path_lets_it():
    rng = np.random.default_rng(0)
    _, tangent, normal, _ = frames(rng.normal(size=(ROWS + ROWS * DOF, SAMPLES)))
    before = tangent[-2].copy()
    steps.tie_last_sample(tangent, normal)
    np.testing.assert_allclose(tangent[-1], before - normal[-1] @ normal[-1].T @ before, atol=1e-14)
    np.testing.assert_array_equal(tangent[-2], before)
