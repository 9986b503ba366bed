"""Small dense programs for tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from paretoik.nlp.dense.dense_program import DenseProgram
from paretoik.nlp.dense.traced_rows import trace_rows
from paretoik.pareto.certificates import certify
from paretoik.pareto.epsilon import epsilon_points
from paretoik.pareto.scalarisation import StartSearch

SHARES = np.array([0.2, 0.5, 0.8, 0.9])
ONES = np.ones(2)


def sketched(unknowns, values, within=lambda x: ([], [])):
    """Return a program; objectives are the last unknowns, above their values; ``within`` gives more rows."""

    def rows(z, parameters):
        x = z[:unknowns]
        objectives = values(x)
        equal, slack = within(x)
        return equal, [*(z[unknowns + k] - value for k, value in enumerate(objectives)), *slack]

    count = len(values(np.zeros(unknowns)))
    program = trace_rows(unknowns + count, 0, rows).at()
    names = tuple(f"f{k + 1}" for k in range(count))
    return DenseProgram(rows=program, costs=np.eye(unknowns + count)[unknowns:], objective_names=names)


def scaled(program, scales):
    """Return the program with its objectives divided by scales."""
    return replace(program, costs=program.costs / np.asarray(scales, dtype=float)[:, None])


def swept(program, starts, **settings):
    """Return the points of an ε-sweep from these starts, and the ranges."""
    cold = StartSearch(
        program_of=lambda scales: scaled(program, scales),
        starts=starts,
        names=tuple(map(str, range(len(program.costs)))),
    )
    return epsilon_points(lambda scales: scaled(program, scales), cold, len(program.costs), **settings)


def placed(values, x):
    """Return points of ``sketched`` programs: unknowns x, then the objectives' values."""
    x = np.atleast_2d(np.asarray(x, dtype=float))
    return np.array([[*one, *values(one)] for one in x])


def certificates(program, z, ranges=ONES, signs=ONES):
    """Return certificates of points that satisfy their limits between samples."""
    ranges, signs = np.asarray(ranges, dtype=float), np.asarray(signs, dtype=float)
    return certify(program, z, ranges=ranges, signs=signs, violation_between=np.zeros(len(z)))[0]


def ellipses(x):
    """Return the values of two bowls around (0, 0) and (1, 0.5) with different shapes and sizes."""
    return [x[0] ** 2 + 3 * x[1] ** 2, 10 * (2 * (x[0] - 1) ** 2 + (x[1] - 0.5) ** 2)]


def ellipses_best(share):
    """Return the minimum of share · first + (1 − share) · second."""
    one, other = 2 * share * np.diag([1.0, 3.0]), 20 * (1 - share) * np.diag([2.0, 1.0])
    return np.linalg.solve(one + other, other @ [1.0, 0.5])
