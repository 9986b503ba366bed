"""The interior-point method's steps that depend on the program.

Every class of kernels implements all of them. A kernel is a NamedTuple of arrays, passed by reference, that describes
one program to compiled code:

    minimise    weights · F(x)
    subject to  h(x) = 0,  c(x) ≥ 0,  rows · F(x) ≤ upper

The method moves along h(x) = 0: ``linearise`` finds a basis Z of the null space of ∂h/∂x, steps are Z · (reduced
step), and ``retract`` leads back. The Newton matrix, reduced to Z, is banded with a border (``cholesky``). numba
chooses the implementation by the kernel's class when it compiles the method (``implement``), so no call is indirect.
Every kernel also has these fields:

longest_step      longest step, in units of x
penalty           usual penalty
implied_slacks    whether slacks follow from c (``elastic``)
large_multiplier  mean multiplier above which errors are relative to the mean (Wächter & Biegler 2006, Eq. 5)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.extending import overload

from paretoik.compilation.array_tuples import Reference

JIT_OPTIONS = {"nogil": True, "error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def implement(step: Callable[..., Any], kernel_class: type) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Register the decorated function as a step for a class of kernels."""

    def register(function: Callable[..., Any]) -> Callable[..., Any]:
        def choose(kernel: Any, *others: Any) -> Callable[..., Any] | None:
            suits = isinstance(kernel, Reference) and kernel.target.instance_class is kernel_class
            return function if suits else None

        overload(step, strict=False, jit_options=JIT_OPTIONS)(choose)
        return function

    return register


def dimensions(kernel: Any, x: Any) -> Any:
    """Return the Newton matrix's (size, band, border) and the number of entries of c."""


def objective_scale(kernel: Any, weights: Any) -> Any:
    """Return the size of weights · F, to which penalty, barrier and tolerances are relative."""


def allocate_workspace(kernel: Any, x: Any) -> Any:
    """Return the arrays that the other steps write into."""


def add_auxiliary(kernel: Any, work: Any, x: Any) -> Any:
    """Return a copy of x with the auxiliary unknowns that follow from it, if there are any."""


def remove_auxiliary(kernel: Any, x: Any) -> Any:
    """Return x without its auxiliary unknowns."""


def set_smoothing(kernel: Any, work: Any, mu: Any) -> Any:
    """Smooth kinks for a barrier μ; return whether objectives and constraints depend on it."""


def restore(kernel: Any, work: Any, x: Any) -> Any:
    """Move x onto h(x) = 0, in place; return the largest |h| that is left, 0 on success."""


def evaluate(kernel: Any, work: Any, x: Any, F: Any, c: Any) -> Any:
    """Write objectives F and the first entries of c at x."""


def linearise(kernel: Any, work: Any, x: Any) -> Any:
    """Prepare first derivatives and the basis Z at x; return False if ∂h/∂x lacks full rank."""


def reduced_gradient(kernel: Any, work: Any, weights: Any, multipliers: Any, out: Any) -> Any:
    """Write Zᵀ ∇(weights · F − multipliers · c); c is left out if there are no multipliers."""


def prepare_multipliers(kernel: Any, work: Any, weights: Any) -> Any:
    """Prepare the Hessian's weights, and the multipliers of h from the last reduced gradient."""


def residual_norm(kernel: Any, residual: Any) -> Any:
    """Return a reduced gradient's norm, which the stationarity tolerance bounds."""


def assemble(kernel: Any, work: Any, stiffness: Any, A: Any, B: Any, C: Any) -> Any:
    """Write Zᵀ (∇²L + ∂cᵀ diag(stiffness) ∂c) Z; return the size of its diagonal, the scale of δ I."""


def expand_step(kernel: Any, work: Any, step: Any, dx: Any) -> Any:
    """Write dx = Z · step; return the largest entry."""


def directional_derivatives(kernel: Any, work: Any, dx: Any, dF: Any, dc: Any) -> Any:
    """Write the derivatives of F and c along dx."""


def row_width(kernel: Any, work: Any) -> Any:
    """Return the largest number of entries in a row of ∂c Z."""


def constraint_rows(kernel: Any, work: Any, columns: Any, entries: Any) -> Any:
    """Write the rows of ∂c Z at the linearised x: a row has ``entries`` at ``columns``.

    Unused entries are 0 at column 0.
    """


def retract(kernel: Any, work: Any, x: Any, dx: Any, length: Any, trial: Any) -> Any:
    """Write the retraction of x + length · dx onto h = 0; return whether it was reached."""
