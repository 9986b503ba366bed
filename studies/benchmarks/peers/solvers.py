"""IPOPT and FATROP on the program of a motion: settings, results, and compilation.

    minimise  Σ_k w_k f_k(x) / r_k  subject to  rows(x), bounds of x, f_k(x) / r_k ≤ c_k

The parameters are (w, r). A program has runs of equal stages; shares f_k and rows are sums and lists of the stages'.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeAlias

import casadi
import numpy as np
from casadi import SX

from paretoik.task.motion_task import MotionTask

Solver: TypeAlias = Literal["ipopt", "fatrop"]

COMPILER = shutil.which("gcc") or shutil.which("cc")
LABELS: dict[Solver, str] = {"fatrop": "FATROP", "ipopt": "IPOPT"}
WIDENED = 1e-8  # FATROP relaxes bounds by this, times their size if above one


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The first ``barrier``, the ``push`` off bounds (None: the solver's own), and when to stop.

    A warm start that is pushed off its bounds goes elsewhere.
    """

    barrier: float = 1e-2
    push: float | None = None
    iterations: int = 100
    tolerance: float = 1e-8  # of stationarity

    def of(self, solver: Solver) -> dict[str, Any]:
        """Return the options of a solver."""
        pushes = ["bound_push", "bound_frac"]
        options: dict[str, Any] = {"print_level": 0, "mu_init": self.barrier, "max_iter": self.iterations}
        if solver == "fatrop":
            options |= {"tolerance": self.tolerance}
        else:
            options |= {"sb": "yes", "tol": self.tolerance, "constr_viol_tol": 1e-9, "bound_relax_factor": 0.0}
            pushes += [f"slack_{name}" for name in pushes]
        return options | ({} if self.push is None else dict.fromkeys(pushes, self.push))


COLD, WARM = Settings(), Settings(barrier=1e-4, push=1e-4)


@dataclass(frozen=True, kw_only=True, eq=False)
class Solved:
    """The result of a start: a motion (samples, dof), the objective, whether it converged, and its cost."""

    q: np.ndarray
    value: float
    solved: bool
    seconds: float
    cpu: float  # seconds too
    iterations: int

    @property
    def motion(self) -> np.ndarray | None:
        """The motion, None without convergence."""
        return self.q if self.solved else None


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """Equal stages in a row: a function (z, p, c) -> (objectives' shares, rows), the places of each z in x, each c.

    ``places`` and ``constants`` are (size, stages), bounds of the rows (rows, stages); ``equality`` is of the rows.
    """

    stage: Any
    places: np.ndarray
    constants: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    equality: list[bool]

    @property
    def count(self) -> int:
        """The number of stages."""
        return int(self.places.shape[1])


@dataclass(frozen=True, kw_only=True, eq=False)
class Peer:
    """A motion's program for a solver: runs over x, and parameters p (weights, ranges); shares of peaks are in x.

    ``bounds`` (2, numbers) are those of x, ``tops`` the places of the peaks' epigraph variables by objective, ``sums``
    those of objectives' last sums. Without sums, several objectives are the last rows. ``pack`` returns x of a motion
    and ranges, ``unpack`` the motion. A program without runs has its ``statement`` and the bounds of its ``rows``.
    """

    solver: Solver
    task: MotionTask
    bounds: np.ndarray
    pack: Callable[[np.ndarray, np.ndarray], np.ndarray]
    unpack: Callable[[np.ndarray], np.ndarray]
    runs: tuple[Run, ...] = ()
    tops: dict[int, int] = field(default_factory=dict)
    sums: dict[int, int] = field(default_factory=dict)
    statement: dict[str, Any] = field(default_factory=dict)
    rows: np.ndarray = field(default_factory=lambda: np.empty((2, 0)))
    library: str = ""
    _solvers: dict[Settings, Any] = field(default_factory=dict)

    def build(self, settings: Settings = COLD) -> Any:
        """Return CasADi's solver with settings, built once."""
        if settings not in self._solvers:
            what: Any = self.library or self.statement or state(self, SX)
            options = self.structure | {self.solver: settings.of(self.solver)}
            options |= {"expand": True} if self.statement else {}
            self._solvers[settings] = casadi.nlpsol("peer", self.solver, what, options)
        return self._solvers[settings]

    @property
    def structure(self) -> dict[str, Any]:
        """Options of CasADi that all settings share."""
        equality = [kind for run in self.runs for kind in run.equality * run.count]
        stages = {"structure_detection": "auto", "equality": equality} if self.solver == "fatrop" else {}
        return {"print_time": False, "error_on_fail": False, **stages}

    @property
    def capped(self) -> dict[int, int]:
        """The places of objectives in the last rows, counted from their end."""
        count = len(self.task.objectives)
        return {k: k - count for k in range(count)} if count > 1 and self.solver == "ipopt" else {}

    @cached_property
    def row_bounds(self) -> np.ndarray:
        """Bounds of all rows; nothing is capped yet."""
        if not self.runs:
            return self.rows
        both = [[getattr(run, side).T.ravel() for run in self.runs] for side in ("lower", "upper")]
        free = np.full(len(self.capped), np.inf)
        return np.stack([np.concatenate([*both[0], -free]), np.concatenate([*both[1], free])])

    def solve(
        self,
        q: np.ndarray,
        main: int = 0,
        ceilings: np.ndarray | None = None,
        ranges: np.ndarray | None = None,
        settings: Settings = COLD,
    ) -> Solved:
        """Return the least of objective ``main`` from a motion, others below ceilings, all divided by their ranges."""
        count, bounds, rows = len(self.task.objectives), self.bounds.copy(), self.row_bounds.copy()
        ranges = np.ones(count) if ranges is None else ranges
        caps = np.full(count, np.inf) if ceilings is None else ceilings / ranges
        for places, upper in ((self.sums, bounds[1]), (self.capped, rows[1])):
            for objective, place in places.items():
                upper[place] = caps[objective]
        if self.solver == "fatrop":
            bounds, rows = narrow(*bounds), narrow(*rows)
        solver, x0 = self.build(settings), casadi.DM(self.pack(q, ranges))
        sides = zip(("lbx", "ubx", "lbg", "ubg"), (*bounds, *rows), strict=True)
        known = {name: casadi.DM(side) for name, side in sides}
        p = casadi.DM(np.concatenate([np.arange(count) == main, ranges]))
        started, cpu = time.perf_counter(), time.process_time()
        solution = solver(x0=x0, p=p, **known)
        seconds, cpu = time.perf_counter() - started, time.process_time() - cpu
        stats = solver.stats()
        return Solved(
            q=self.unpack(np.asarray(solution["x"]).ravel()),
            value=float(solution["f"]),
            solved=bool(stats["success"]),
            seconds=seconds,
            cpu=cpu,
            iterations=int(stats["iter_count"]),
        )


def state(peer: Peer, symbols: Any) -> dict[str, Any]:
    """Return the program, its stages written out (SX; CasADi evaluates these fastest) or its runs as calls (MX)."""
    count = len(peer.task.objectives)
    x, p = symbols.sym("x", peer.bounds.shape[1]), symbols.sym("p", 2 * count)
    totals, rows = symbols.zeros(count), list[Any]()
    for run in peer.runs:
        if symbols is casadi.MX:
            share, row = run.stage.map(run.count)(_gathered(x, run), casadi.repmat(p, 1, run.count), run.constants)
            totals += casadi.sum2(share)
            rows.append(casadi.vec(row))
            continue
        for place, constants in zip(run.places.T, run.constants.T, strict=True):
            share, row = run.stage(x[place.tolist()], p, constants)
            totals += share
            rows.append(row)
    shares = casadi.vertcat(*(x[peer.tops[k]] if k in peer.tops else totals[k] for k in range(count))) / p[count:]
    last = [shares] if peer.capped else []
    return {"x": x, "p": p, "f": casadi.dot(p[:count], shares), "g": casadi.vertcat(*rows, *last)}


def _gathered(x: Any, run: Run) -> Any:
    return casadi.reshape(x[run.places.T.ravel().tolist()], *run.places.shape)


def compiled(peer: Peer, name: str, folder: Path | None) -> Peer:
    """Return a program compiled into a folder, if there is one and a compiler.

    Functions of stages are called in a loop, and the Hessian is assembled from stages: this compiles in seconds instead
    of minutes for all stages written out, and runs as fast.
    """
    if folder is None or COMPILER is None:
        return peer
    program, generator = state(peer, casadi.MX), casadi.CodeGenerator(f"{name}.c")
    x, p, f, g = (program[name] for name in "xpfg")
    generator.add(casadi.Function("nlp", [x, p], [f, g], ["x", "p"], ["f", "g"]))
    solver = casadi.nlpsol("peer", peer.solver, program, {**peer.structure, peer.solver: {"print_level": 0}})
    for part in solver.get_function():
        function = solver.get_function(part)
        generator.add(blockwise(peer, function) if part == "nlp_hess_l" else function)
    source, library = generator.generate(f"{folder}{os.sep}"), folder / f"{name}.so"
    subprocess.run([COMPILER, "-O2", "-fPIC", "-shared", source, "-o", library], check=True)
    return replace(peer, library=str(library), _solvers={})


def blockwise(peer: Peer, like: Any) -> Any:
    """Return the Lagrangian's Hessian assembled from stages' blocks, a function with the names of ``like``."""
    x, p, factor, multipliers = (casadi.MX.sym(f"v{i}", *like.size_in(i)) for i in range(4))
    count = len(peer.task.objectives)
    of_shares = factor * p[:count]
    if peer.capped:  # a multiplier of a row that is a total belongs to every stage
        of_shares += multipliers[multipliers.numel() - count :]
    shared = of_shares / p[count:]
    elements, row_at, column_at, begin = [], [], [], 0
    for run in peer.runs:
        sizes = run.places.shape[0], 2 * count, run.constants.shape[0], count, len(run.lower)
        z, q, c, t, m = (casadi.SX.sym("z", n) for n in sizes)
        share, row = run.stage(z, q, c)
        H = casadi.hessian(casadi.dot(t, share) + casadi.dot(m, row), z)[0]
        block = casadi.Function("block", [z, q, c, t, m], [H])
        of_rows = casadi.reshape(multipliers[begin : begin + run.lower.size], *run.lower.shape)
        begin += run.lower.size
        every = [casadi.repmat(p, 1, run.count), run.constants, casadi.repmat(shared, 1, run.count)]
        elements.append(block.map(run.count)(_gathered(x, run), *every, of_rows).nz[:])
        i, j = (np.array(side, dtype=int) for side in H.sparsity().get_triplet())
        row_at.append(run.places.T[:, i].ravel())
        column_at.append(run.places.T[:, j].ravel())
    size = peer.bounds.shape[1]
    keys, where = np.unique(np.concatenate(column_at) * size + np.concatenate(row_at), return_inverse=True)
    pattern = casadi.Sparsity.triplet(size, size, (keys % size).tolist(), (keys // size).tolist())
    adding = casadi.Sparsity.triplet(len(keys), len(where), where.tolist(), list(range(len(where))))
    whole = casadi.MX(pattern, casadi.DM(adding, 1.0) @ casadi.vertcat(*elements))
    values = {"hess_gamma_x_x": whole, "triu_hess_gamma_x_x": casadi.triu(whole)}
    if "grad_gamma_x" in like.name_out():
        program = state(peer, casadi.MX)
        f, g = casadi.Function("both", [program["x"], program["p"]], [program["f"], program["g"]])(x, p)
        values["grad_gamma_x"] = casadi.gradient(factor * f + casadi.dot(multipliers, g), x)
    outputs = [values[name] for name in like.name_out()]
    return casadi.Function("nlp_hess_l", [x, p, factor, multipliers], outputs, like.name_in(), like.name_out())


def narrow(lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Return bounds (2, ...) that are narrower by as much as FATROP widens them, which CasADi cannot turn off."""
    sides = np.stack([lower, upper])
    touched = np.isfinite(sides) & (lower < upper)
    moves = np.array([[WIDENED], [-WIDENED]]) * np.maximum(1.0, np.abs(np.where(touched, sides, 0.0)))
    return np.where(touched, sides + moves, sides)
