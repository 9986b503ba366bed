"""Small dense programs for tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from paretoik.nlp.dense import DenseProgram
from paretoik.nlp.traced import trace_rows
from paretoik.pareto.cold_search import StartSearch
from paretoik.pareto.epsilon import epsilon_points


def sketched(unknowns, values, within=lambda x: ([], [])):
    """Objectives are the last unknowns, each no less than its value; ``within`` gives further rows."""

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
    """The program with its objectives divided by scales."""
    return replace(program, costs=program.costs / np.asarray(scales, dtype=float)[:, None])


def swept(program, starts, **settings):
    """The points of an ε-sweep from these starts, and the ranges."""
    cold = StartSearch(program_of=lambda scales: scaled(program, scales), starts=starts, n_obj=len(program.costs))
    return epsilon_points(lambda scales: scaled(program, scales), cold, len(program.costs), **settings)
