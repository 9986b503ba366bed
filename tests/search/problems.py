"""Small problems for the tests of the search."""

from __future__ import annotations

import numpy as np
from pymoo.core.problem import Problem


class Parabolas(Problem):
    """Squared distances to points on the first axis; counts its calls."""

    def __init__(self, n_obj=2, n_var=3, constrained=False):
        super().__init__(n_var=n_var, n_obj=n_obj, n_ieq_constr=int(constrained), xl=-2.0, xu=2.0)
        self.calls = 0

    def _evaluate(self, x, out, *args, **kwargs):
        self.calls += 1
        centres = np.zeros((self.n_obj, self.n_var))
        centres[:, 0] = np.linspace(0, 1, self.n_obj)
        out["F"] = ((x[:, None] - centres) ** 2).sum(axis=2)
        if self.n_ieq_constr:
            out["G"] = 0.3 - x[:, :1]


class Branches(Problem):
    """Four species by the integer part of gene 0, each with its own optimum; crossing them is visible."""

    n_species = 4
    species_gene = 0

    def __init__(self):
        super().__init__(n_var=3, n_obj=2, xl=np.array([0.0, -1, -1]), xu=np.array([4.0, 1, 1]))

    def species(self, X):
        return np.minimum(np.floor(X[:, 0]).astype(int), 3)

    def _evaluate(self, x, out, *args, **kwargs):
        height = 0.3 * self.species(x)
        out["F"] = np.column_stack((x[:, 1] ** 2 + height, (x[:, 1] - 1) ** 2 + x[:, 2] ** 2 + height))


class Constant(Problem):
    """Every objective of every point is 1."""

    def __init__(self, n_obj):
        super().__init__(n_var=2, n_obj=n_obj, xl=0.0, xu=1.0)

    def _evaluate(self, x, out, *args, **kwargs):
        out["F"] = np.ones((len(x), self.n_obj))
