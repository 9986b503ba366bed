"""A nonlinear program by its functions, in SciPy's form: of a motion (CasADi's derivatives) or a dense program."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import casadi
import numpy as np
from jaxtyping import Float
from scipy import sparse
from scipy.optimize import Bounds, NonlinearConstraint, minimize

from paretoik.nlp.dense.dense_program import DenseProgram
from studies.benchmarks.peers.solvers import Peer, state

Vector = Float[np.ndarray, " numbers"]
Output = tuple[casadi.Sparsity, Callable[..., Any]]  # the pattern, and a function for the entries
Method = Literal["SLSQP", "trust-constr"]
ITERATIONS: dict[Method, int] = {"SLSQP": 300, "trust-constr": 1000}
TOLERANCE = 1e-8  # of stationarity, IPOPT's default


@dataclass(frozen=True, kw_only=True, eq=False)
class Nlp:
    """Minimise f(x) subject to ``lower`` ≤ g(x) ≤ ``upper``, with x within ``bounds`` (2, unknowns).

    ``hessian`` is of f + multipliers · g; f is linear if IPOPT solves it.
    """

    value: Callable[[Vector], float]
    gradient: Callable[[Vector], Vector]
    rows: Callable[[Vector], Vector]
    jacobian: Callable[[Vector], sparse.csr_array]
    hessian: Callable[[Vector, Vector], sparse.csr_array]
    lower: Vector
    upper: Vector
    bounds: Float[np.ndarray, "2 unknowns"]


def motion_nlp(peer: Peer, scale: float) -> Nlp:
    """Return a program of a task with one objective, divided by ``scale``, over joint positions."""
    statement = state(peer, casadi.SX)
    x, p, f, g = (statement[name] for name in "xpfg")
    numbers = np.array([1.0, scale])
    multipliers = casadi.SX.sym("multipliers", g.numel())
    second = casadi.hessian(f + casadi.dot(multipliers, g), x)[0]
    outputs = f, casadi.gradient(f, x), g, casadi.jacobian(g, x)
    value, gradient, rows, jacobian = (casadi.Function("part", [x, p], [each]) for each in outputs)
    hessian = casadi.Function("hessian", [x, p, multipliers], [second])
    return Nlp(
        value=lambda z: float(value(z, numbers)),
        gradient=lambda z: np.asarray(gradient(z, numbers)).ravel(),
        rows=lambda z: np.asarray(rows(z, numbers)).ravel(),
        jacobian=lambda z: sparse.csr_array(jacobian(z, numbers).sparse()),
        hessian=lambda z, v: sparse.csr_array(hessian(z, numbers, v).sparse()),
        lower=peer.row_bounds[0],
        upper=peer.row_bounds[1],
        bounds=peer.bounds,
    )


def dense_nlp(program: DenseProgram, weights: Vector) -> Nlp:
    """Return a dense program with one weighted sum of its objectives."""
    costs, rows = weights @ program.costs, program.rows
    equalities, inequalities = (len(part) for part in rows.rows(np.full(len(costs), 0.1)))
    count = equalities + inequalities
    return Nlp(
        value=lambda z: float(costs @ z),
        gradient=lambda z: costs,
        rows=lambda z: np.concatenate(rows.rows(z)),
        jacobian=lambda z: sparse.csr_array(rows.jacobian(z)),
        hessian=lambda z, v: sparse.csr_array(rows.hessian(z, v)),
        lower=np.zeros(count),
        upper=np.append(np.zeros(equalities), np.full(inequalities, np.inf)),
        bounds=np.tile([[-np.inf], [np.inf]], (1, len(costs))),
    )


class _Callback(casadi.Callback):
    """NumPy functions as a function of CasADi, from dense vectors to dense matrices."""

    def __init__(self, name: str, inputs: dict[str, int], outputs: dict[str, Output]) -> None:
        casadi.Callback.__init__(self)
        self.inputs, self.outputs = inputs, outputs
        self.construct(name, {})

    def get_n_in(self) -> int:
        return len(self.inputs)

    def get_n_out(self) -> int:
        return len(self.outputs)

    def get_name_in(self, i: int) -> str:
        return list(self.inputs)[i]

    def get_name_out(self, i: int) -> str:
        return list(self.outputs)[i]

    def get_sparsity_in(self, i: int) -> casadi.Sparsity:
        return casadi.Sparsity.dense(list(self.inputs.values())[i], 1)

    def get_sparsity_out(self, i: int) -> casadi.Sparsity:
        return list(self.outputs.values())[i][0]

    def eval(self, arguments: Sequence[Any]) -> list[Any]:
        vectors = [np.asarray(argument).ravel() for argument in arguments]
        return [function(*vectors) for _, function in self.outputs.values()]


def _sparse(matrix: Callable[..., Any], samples: Sequence[tuple[Vector, ...]], *, upper: bool = False) -> Output:
    """Return a matrix with the sparsity pattern at samples of its arguments."""
    nonzero = np.any([matrix(*arguments).toarray() != 0 for arguments in samples], axis=0)
    row, column = np.nonzero(np.triu(nonzero) if upper else nonzero)
    rows, columns = nonzero.shape
    pattern: Any = casadi.Sparsity.triplet(rows, columns, row.tolist(), column.tolist())
    row, column = (np.array(places, dtype=int) for places in pattern.get_triplet())
    return pattern, lambda *arguments: casadi.DM(pattern, matrix(*arguments).toarray()[row, column])


def ipopt_solver(nlp: Nlp, x: Vector) -> Callable[[Vector], Vector | None]:
    """Return IPOPT's result from a point, None if it does not converge; derivatives are the program's.

    Their patterns are those near a point ``x``.
    """
    size, count = nlp.bounds.shape[1], len(nlp.lower)
    rng = np.random.default_rng(0)
    near = [(x + 1e-3 * rng.normal(size=size), np.zeros(0), np.ones(1), rng.normal(size=count)) for _ in range(3)]
    inputs = {"x": size, "p": 0}
    value: Output = casadi.Sparsity.dense(1, 1), lambda z, *_: nlp.value(z)
    rows: Output = casadi.Sparsity.dense(count, 1), lambda z, *_: nlp.rows(z)
    gradient: Output = casadi.Sparsity.dense(size, 1), lambda z, *_: nlp.gradient(z)
    jacobian = _sparse(lambda z, *_: nlp.jacobian(z), near)
    hessian = _sparse(lambda z, p, factor, multipliers: nlp.hessian(z, multipliers), near, upper=True)
    parts = {
        "f": _Callback("f", {"x": size}, {"f": value}),
        "g": _Callback("g", {"x": size}, {"g": rows}),
        "grad_f": _Callback("nlp_grad_f", inputs, {"f": value, "grad_f_x": gradient}),
        "jac_g": _Callback("nlp_jac_g", inputs, {"g": rows, "jac_g_x": jacobian}),
        "hess_lag": _Callback("nlp_hess_l", {**inputs, "lam_f": 1, "lam_g": count}, {"triu_hess_gamma_x_x": hessian}),
    }
    symbol = casadi.MX.sym("x", size)
    statement: Any = {"x": symbol, "f": parts["f"](symbol), "g": parts["g"](symbol)}
    derivatives: Any = {name: parts[name] for name in ("grad_f", "jac_g", "hess_lag")}
    quiet: Any = {
        "print_time": False,
        "error_on_fail": False,
        "no_nlp_grad": True,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
    }
    accuracy: Any = {"ipopt.tol": TOLERANCE, "ipopt.max_iter": ITERATIONS["SLSQP"], "ipopt.bound_relax_factor": 0.0}
    solver = casadi.nlpsol("peer", "ipopt", statement, {**quiet, **accuracy, **derivatives})

    def solve(z: Vector) -> Vector | None:
        end = solver(x0=z, lbx=nlp.bounds[0], ubx=nlp.bounds[1], lbg=nlp.lower, ubg=nlp.upper)
        assert parts  # CasADi holds no reference to its callbacks
        return np.asarray(end["x"]).ravel() if solver.stats()["success"] else None

    return solve


def solve_with_scipy(nlp: Nlp, x: Vector, method: Method, seconds: float) -> Vector | None:
    """Return the result of a method of SciPy, None if it reports failure or takes longer than the limit."""
    end = time.process_time() + seconds

    def stop(*_: Any) -> None:
        if time.process_time() > end:
            raise StopIteration

    tolerances = {"ftol": 1e-12} if method == "SLSQP" else {"gtol": TOLERANCE, "xtol": 1e-12, "sparse_jacobian": True}
    result = minimize(
        nlp.value,
        x,
        jac=nlp.gradient,
        hess=None if method == "SLSQP" else lambda z: nlp.hessian(z, np.zeros(len(nlp.lower))),
        method=method,
        bounds=Bounds(*nlp.bounds),
        constraints=_slsqp_rows(nlp) if method == "SLSQP" else _trust_rows(nlp),
        callback=stop,
        options={"maxiter": ITERATIONS[method], **tolerances},
    )
    good = result.success if method == "SLSQP" else result.status in (1, 2)
    return np.asarray(result.x) if good else None


def _trust_rows(nlp: Nlp) -> NonlinearConstraint:
    def curvature(z: Vector, multipliers: Vector) -> sparse.csr_array:
        both = nlp.hessian(z, multipliers) - nlp.hessian(z, np.zeros(len(multipliers)))
        return sparse.csr_array(both)

    return NonlinearConstraint(nlp.rows, nlp.lower, nlp.upper, jac=nlp.jacobian, hess=curvature)


def _slsqp_rows(nlp: Nlp) -> list[dict[str, Any]]:
    equal = nlp.lower == nlp.upper
    above, below = ~equal & np.isfinite(nlp.lower), ~equal & np.isfinite(nlp.upper)
    return [
        {
            "type": "eq",
            "fun": lambda z: nlp.rows(z)[equal] - nlp.lower[equal],
            "jac": lambda z: nlp.jacobian(z).toarray()[equal],
        },
        {
            "type": "ineq",
            "fun": lambda z: np.append((nlp.rows(z) - nlp.lower)[above], (nlp.upper - nlp.rows(z))[below]),
            "jac": lambda z: np.concatenate([(J := nlp.jacobian(z).toarray())[above], -J[below]]),
        },
    ]
