"""Peers' programs as C: one small function per stage, called in a loop, and the Hessian assembled from stages.

This compiles in seconds instead of minutes for all stages written out, and runs as fast.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi
import numpy as np

from studies.benchmarks.planner.peers import Question, program_of, signature
from studies.benchmarks.planner.programs import INERTIA, Program, Run

COMPILER = shutil.which("gcc") or shutil.which("cc")


def loop_stages(program: Program) -> dict[str, Any]:
    """Return the program with the stages of a run as one call over a matrix."""
    x, p = casadi.MX.sym("x", len(program.lower)), casadi.MX.sym("p", INERTIA)
    totals: Any = casadi.MX.zeros(program.totals)
    rows: list[Any] = []
    for run in program.runs:
        total, row = run.stage.map(run.count)(_gathered(x, run), casadi.repmat(p, 1, run.count))
        totals += casadi.sum2(total)
        rows.append(casadi.vec(row))
    return {"x": x, "p": p, "f": totals[0], "g": casadi.vertcat(*rows, *casadi.vertsplit(totals)[1:])}


def _gathered(x: Any, run: Run) -> Any:
    return casadi.reshape(x[run.places.T.ravel().tolist()], *run.places.shape)


def blockwise(program: Program, like: Any) -> Any:
    """Return the Lagrangian's Hessian assembled from stages' blocks, a function with the names of ``like``."""
    x, p, factor, multipliers = (casadi.MX.sym(f"v{i}", *like.size_in(i)) for i in range(4))
    # a multiplier of a row that is a total belongs to every stage
    shared = casadi.vertcat(factor, *casadi.vertsplit(multipliers)[program.rows("lower").size - program.totals + 1 :])
    elements, row_at, column_at, begin = [], [], [], 0
    for run in program.runs:
        z, q, t, m = (casadi.SX.sym("z", n) for n in (run.places.shape[0], INERTIA, program.totals, len(run.lower)))
        total, row = run.stage(z, q)
        H = casadi.hessian(casadi.dot(t, total) + casadi.dot(m, row), z)[0]
        block = casadi.Function("block", [z, q, t, m], [H])
        run_multipliers = casadi.reshape(multipliers[begin : begin + run.lower.size], *run.lower.shape)
        begin += run.lower.size
        every = [casadi.repmat(v, 1, run.count) for v in (p, shared)]
        elements.append(block.map(run.count)(_gathered(x, run), *every, run_multipliers).nz[:])
        i, j = (np.array(side, dtype=int) for side in H.sparsity().get_triplet())
        row_at.append(run.places.T[:, i].ravel())
        column_at.append(run.places.T[:, j].ravel())
    size = len(program.lower)
    keys, where = np.unique(np.concatenate(column_at) * size + np.concatenate(row_at), return_inverse=True)
    pattern = casadi.Sparsity.triplet(size, size, (keys % size).tolist(), (keys // size).tolist())
    adding = casadi.Sparsity.triplet(len(keys), len(where), where.tolist(), list(range(len(where))))
    whole = casadi.MX(pattern, casadi.DM(adding, 1.0) @ casadi.vertcat(*elements))
    values = {"hess_gamma_x_x": whole, "triu_hess_gamma_x_x": casadi.triu(whole)}
    if "grad_gamma_x" in like.name_out():
        f, g = casadi.Function("both", *signature(loop_stages(program)))(x, p)
        values["grad_gamma_x"] = casadi.gradient(factor * f + casadi.dot(multipliers, g), x)
    outputs = [values[name] for name in like.name_out()]
    return casadi.Function("nlp_hess_l", [x, p, factor, multipliers], outputs, like.name_in(), like.name_out())


def compiled(question: Question, folder: Path) -> tuple[Question, float]:
    """Return the question with its functions compiled into a library in ``folder``, and the seconds for that."""
    assert COMPILER is not None
    started, program = time.perf_counter(), program_of(question)
    problem: dict[str, Any] = loop_stages(program)
    name = "_".join(part for part in (question.solver, question.problem, question.main, str(question.samples)) if part)
    name += f"_below_{question.capped}" if question.capped else ""
    options: dict[str, Any] = {"print_time": False, question.solver: {"print_level": 0}}
    solver = casadi.nlpsol("peer", question.solver, problem, options)
    generator = casadi.CodeGenerator(f"{name}.c")
    generator.add(casadi.Function("nlp", *signature(problem), ["x", "p"], ["f", "g"]))
    for part in solver.get_function():
        function = solver.get_function(part)
        generator.add(blockwise(program, function) if part == "nlp_hess_l" else function)
    source = generator.generate(f"{folder}{os.sep}")
    library = folder / f"{name}.so"
    subprocess.run([COMPILER, "-O2", "-fPIC", "-shared", source, "-o", library], check=True)
    return replace(question, library=str(library)), time.perf_counter() - started
