"""Common parts of formulations: first generations for pymoo, and texts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float
from pymoo.core.problem import Problem
from pymoo.core.sampling import Sampling
from pymoo.operators.sampling.lhs import LatinHypercubeSampling
from pymoo.operators.sampling.rnd import FloatRandomSampling

from paretoik.arrays import Genes
from paretoik.closed_loop.objectives import StepObjective
from paretoik.errors import InvalidInput
from paretoik.inputs import finite_array, shown
from paretoik.search.operators import Seeded
from paretoik.tables import columns, fit_screen, html_representation
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective

# Text of a motion problem, a few lines.


def task_text(task: MotionTask) -> str:
    """Return the arm, path, objectives and limits of a task as text."""
    start = "free" if task.start is None else "given"
    if task.cyclic:
        start += ", closed"
    limits, names = list[str](), list(task.limit_names)
    for kind in task.bounds:  # a limit on all joints is named by its quantity, a limit on some joints with their names
        joints = [joint for joint in task.arm.joint_names if f"{kind} of {joint}" in names]
        names = [name for name in names if name not in {f"{kind} of {joint}" for joint in joints}]
        if joints:
            limits.append(f"{kind} of " + ("all joints" if len(joints) == task.arm.dof else ", ".join(joints)))
    rows = [
        ("arm", f"{task.arm.name}, {task.arm.dof} joints, {task.redundancy} of them redundant"),
        ("path", f"{len(task.times)} samples, {task.times[-1]:.4g} s, start {start}"),
        ("objectives", ", ".join(objective_text(each.name, each.unit, each.maximise) for each in task.objectives)),
        ("limits", ", ".join([*limits, *names]) or "none"),
    ]
    if task.obstacles:
        rows.append(("obstacles", f"{len(task.obstacles)}, links of radius {task.link_radius:g} m"))
    return columns(rows)


def objective_text(name: str, unit: str, maximised: bool) -> str:
    """Return an objective's name and unit, and whether it is maximised."""
    return name + (f" [{unit}]" if unit else "") + (" (maximised)" if maximised else "")


# Common parts of formulations.


RANDOM = (FloatRandomSampling, LatinHypercubeSampling)  # samplings that do not use the problem


Self = TypeVar("Self", bound="Formulation")
Decoded = TypeVar("Decoded")


def of_genes(decode: Callable[[Self, Genes], Decoded]) -> Callable[[Self, Genes], Decoded]:
    """Return the method with a check of its genes (points, n_var)."""

    @wraps(decode)
    def checked(self: Self, genes: Genes) -> Decoded:
        return decode(self, self.check_genes("genes", genes, 2))

    return checked


def check_motions(motions: object, task: MotionTask, *, samples: int | None = None) -> None:
    """Raise InvalidInput unless these are motions of a task's joints, with ``samples`` if given."""
    shape = motions.q.shape if isinstance(motions, Motion) else ()
    if len(shape) != 3 or shape[2] != task.arm.dof or (samples is not None and shape[1] != samples):
        raise InvalidInput(
            f"motions must be a Motion (points, {samples or 'time'}, {task.arm.dof}), got {shown(motions)}"
        )


class Formulation(Problem):  # type: ignore[misc]  # pymoo is not typed
    """A vectorised pymoo problem with its own first generation for any pymoo algorithm.

    Random genes rarely satisfy tight limits, but pymoo takes a sampling only from the algorithm. pymoo passes the
    algorithm to ``evaluate`` and copies what this returns into the algorithm's individuals. Therefore, if an algorithm
    samples at random, ``evaluate`` replaces its first generation by that of ``sampling()``. Algorithms with their own
    genes or sampling keep these.
    """

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    maximised: tuple[bool, ...] = ()
    constraint_names: tuple[str, ...]
    _repr_html_ = html_representation

    def __init__(self, low: Float[np.ndarray, " genes"], high: Float[np.ndarray, " genes"]) -> None:
        """Make a problem with the named objectives and constraints, and genes from ``low`` to ``high``."""
        counts = {"n_obj": len(self.names), "n_ieq_constr": len(self.constraint_names)}
        super().__init__(n_var=len(low), xl=low, xu=high, **counts)

    def __repr__(self) -> str:
        objectives = map(objective_text, self.names, self.units, self.maximised)
        rows = [("objectives", ", ".join(objectives)), ("constraints", ", ".join(self.constraint_names) or "none")]
        head = f"{type(self).__name__}, {self.n_var} genes"
        return fit_screen("\n".join([head, columns(rows), "next: pk.solve(problem)"]))

    def __str__(self) -> str:
        return repr(self)  # in place of pymoo's text

    def add_objectives(self, objectives: Sequence[Objective | StepObjective]) -> None:
        """Append names, units and senses of objectives."""
        self.names += tuple(each.name for each in objectives)
        self.units += tuple(each.unit for each in objectives)
        self.maximised += tuple(each.maximise for each in objectives)

    def sampling(self) -> Sampling:
        """Return a pymoo sampling: first the problem's own starts, then random genes."""
        return Seeded(None)

    def check_genes(self, name: str, X: object, *dimensions: int) -> Genes:
        """Return genes as a finite array, its ndim among ``dimensions``. Raises InvalidInput, with ``name``."""
        genes = finite_array(name, X)
        if genes.ndim not in dimensions or genes.shape[-1] != self.n_var:
            raise InvalidInput(f"{name} must be rows of {self.n_var} genes, got shape {genes.shape}")
        return genes

    def evaluate(self, X: Genes, *args: Any, algorithm: Any = None, **kwargs: Any) -> Any:
        """Evaluate genes as pymoo's problems do. ``algorithm``: the algorithm that asks."""
        X = self.check_genes("X", X, 1, 2)
        sampling = getattr(getattr(algorithm, "initialization", None), "sampling", None)
        if algorithm is None or algorithm.is_initialized or type(sampling) not in RANDOM:
            return super().evaluate(X, *args, **kwargs)
        X = self.sampling().do(self, len(X), random_state=algorithm.random_state).get("X")
        return {**super().evaluate(X, *args, **kwargs), "X": X}
