"""The test problems: pymoo's, COCO's with two objectives if its package is installed, and two of our own."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np
from pymoo.core.problem import Problem
from pymoo.problems import get_problem

from paretoik.arrays import Genes
from problems.tringali_2020 import energy_torque

POPULATION = {2: 100, 3: 91, 5: 126}  # by objectives: the number of reference directions of NSGA-III and MOEA/D
BIOBJECTIVE = "bbob-biobj"
COCO = bool(importlib.util.find_spec("cocoex"))
DIMENSION = 5  # of COCO's problems
DIFFICULTY = 4  # of DASCMOP: convergence, diversity and feasibility each made hard by a quarter


@dataclass(frozen=True, kw_only=True)
class Case:
    """A problem, its budget, the box outside which points count as absent; ``peers`` None means all."""

    name: str
    family: str
    make: Callable[[], Any]
    n_obj: int = 2
    generations: int
    constrained: bool = False
    box: tuple[tuple[float, ...], tuple[float, ...]] | None = None  # lower, upper
    peers: tuple[str, ...] | None = None
    binary: bool = False  # genes that pymoo calls real


class SteepTail(Problem):  # type: ignore[misc]  # pymoo has no types
    """f1 = x1, f2 = g / x1 with x1 from 0.001: only a small part of the front, a corner, is useful."""

    def __init__(self) -> None:
        super().__init__(n_var=10, n_obj=2, xl=np.r_[1e-3, np.zeros(9)], xu=np.ones(10))

    def _evaluate(self, x: Genes, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        g = 1.0 + 9.0 * x[:, 1:].mean(axis=1)
        out["F"] = np.column_stack((x[:, 0], g / x[:, 0]))


class Biobjective(Problem):  # type: ignore[misc]  # pymoo has no types
    """A problem of COCO's suite bbob-biobj, first instance, within the bounds that COCO gives.

    Source: Brockhoff, Auger, Hansen & Tušar 2022, "Using well-understood single-objective functions in multiobjective
    black-box optimization test suites".
    """

    def __init__(self, function: int, dimension: int = DIMENSION) -> None:
        coco: Any = importlib.import_module("cocoex")  # imported here: optional
        suite = coco.Suite(BIOBJECTIVE, "instances: 1", f"dimensions: {dimension}")
        self.function = suite.get_problem_by_function_dimension_instance(function, dimension, 1)
        super().__init__(n_var=dimension, n_obj=2, xl=self.function.lower_bounds, xu=self.function.upper_bounds)

    def _evaluate(self, x: Genes, out: dict[str, Any], *args: Any, **kwargs: Any) -> None:
        out["F"] = np.array([self.function(row) for row in x])


def pymoo_case(name: str, generations: int, *settings: int, n_obj: int = 2, n_var: int | None = None) -> Case:
    """Return a case of one of pymoo's problems, with that many variables if it is free."""
    sizes = {} if n_var is None else {"n_var": n_var, "n_obj": n_obj}
    make = partial(get_problem, name.lower(), *settings, **sizes)
    family = name.rstrip("0123456789")
    return Case(name=name, family=family, make=make, n_obj=n_obj, generations=generations)


def _unconstrained_cases() -> Iterator[Case]:
    yield from (replace(pymoo_case(f"ZDT{k}", 250), binary=k == 5) for k in range(1, 7))
    distances = {1: 5, 7: 20}  # variables for a point's distance from the front
    for n_obj, numbers in ((3, range(1, 8)), (5, (1, 2, 7))):
        for k in numbers:
            n_var, generations = n_obj - 1 + distances.get(k, 10), 400 if k in (1, 3) else 250
            case = pymoo_case(f"DTLZ{k}", generations, n_obj=n_obj, n_var=n_var)
            yield replace(case, name=f"{case.name}-{n_obj}")
    yield from (pymoo_case(f"WFG{k}", 150, n_var=24) for k in range(1, 10))


def _constrained_cases() -> Iterator[Case]:
    for k in range(1, 15):
        yield pymoo_case(f"MW{k}", 200, n_obj=3 if k in (4, 8, 14) else 2)
    for k in range(1, 9):
        yield pymoo_case(f"CTP{k}", 100)
    for k in range(1, 10):
        yield pymoo_case(f"DASCMOP{k}", 200, DIFFICULTY, n_obj=3 if k > 6 else 2)
    yield from (pymoo_case(name, 100) for name in ("BNH", "OSY", "TNK"))


def _other_cases() -> Iterator[Case]:
    for k in range(1, 56) if COCO else ():
        name, make = f"{BIOBJECTIVE} f{k:02d}", partial(Biobjective, k)
        yield Case(name=name, family=BIOBJECTIVE, make=make, generations=100)
    box = ((0.0, 1.0), (1.0, 20.0))
    yield Case(name="steep tail", family="steep tail", make=SteepTail, generations=150, box=box)
    energy = "energy_torque"
    yield Case(name=energy, family=energy, make=energy_torque, generations=60, constrained=True)


@cache
def cases() -> dict[str, Case]:
    """Every problem by name."""
    constrained = [replace(case, constrained=True) for case in _constrained_cases()]
    return {case.name: case for case in (*_unconstrained_cases(), *constrained, *_other_cases())}


@cache
def problem_of(name: str) -> Any:
    """Return a case's problem, built once per process."""
    return cases()[name].make()
