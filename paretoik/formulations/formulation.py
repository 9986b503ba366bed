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
from paretoik.collision.obstacles import LinkRadius
from paretoik.errors import InvalidInput
from paretoik.inputs import finite_array, shown
from paretoik.search.operators import Seeded
from paretoik.tables import columns, fit_screen, html_representation
from paretoik.task.limits import JOINT_UNITS, Bounds, joint_units
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective

# Text of a motion problem, a few lines.


def task_rows(task: MotionTask) -> list[tuple[str, str]]:
    """Return the arm, path, frames, limits and obstacles of a task as rows of text."""
    start = "free" if task.start is None else "given"
    if task.cyclic:
        start += ", closed"
    limits, names = list[str](), list(task.limit_names)
    for kind, bounds in task.bounds.items():
        joints = [joint for joint in task.arm.joint_names if f"{kind} of {joint}" in names]
        names = [name for name in names if name not in {f"{kind} of {joint}" for joint in joints}]
        if joints:
            who = "" if len(joints) == task.arm.dof else f" of {', '.join(joints)}"
            limits.append(f"{kind}{who} {_bounds_text(bounds, joint_units(task.arm, JOINT_UNITS[kind]))}")
    if task.obstacles:
        names[names.index("clearance")] = f"clearance {task.min_clearance:g} m"
    rows = [
        ("arm", f"{task.arm.name}, {task.arm.dof} joints, {task.redundancy} of them redundant"),
        ("path", f"{len(task.times)} samples, {task.times[-1]:.4g} s, start {start}"),
        ("follows it", "; ".join(f"{each.frame.strip('<>')}: {each.axes}" for each in task.tasks)),
        ("limits", "; ".join([*limits, *names]) or "none"),
    ]
    if task.obstacles:
        kinds = dict[str, list[str]]()  # names by shape, "" for an obstacle without one
        for obstacle in task.obstacles:
            kinds.setdefault(type(obstacle).__name__, []).append(obstacle.name)
        shapes = ", ".join(f"{len(names)} {kind}{_in_brackets(names)}" for kind, names in kinds.items())
        rows.append(("obstacles", f"{shapes}; links of radius {_radius_text(task.link_radius)} m"))
    return rows


def _radius_text(radius: LinkRadius) -> str:
    least, most = np.min(radius), np.max(radius)
    return f"{least:g}" if least == most else f"{least:g} to {most:g}"


def _in_brackets(names: Sequence[str]) -> str:
    given = [name for name in names if name]
    return f" ({', '.join(given)})" if given else ""


def _bounds_text(bounds: Bounds, unit: str) -> str:
    """Return the finite bounds of joints as text: the narrowest and the widest if they differ."""
    low, high = (each[np.isfinite(each)] for each in (bounds[..., 0], bounds[..., 1]))
    if np.array_equal(-bounds[..., 0], bounds[..., 1]):
        text = f"±{high.min():.4g}" + (f" to ±{high.max():.4g}" if high.max() > high.min() else "")
    elif not len(low) or not len(high):
        text = f"up to {high.max():.4g}" if len(high) else f"from {low.min():.4g}"
    else:
        text = f"from {low.min():.4g} to {high.max():.4g}"
    return f"{text} {unit}"


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
    next_step = "pk.solve(problem)"  # the call that a user would make next
    _repr_html_ = html_representation

    def __init__(self, low: Float[np.ndarray, " genes"], high: Float[np.ndarray, " genes"]) -> None:
        """Make a problem with the named objectives and constraints, and genes from ``low`` to ``high``."""
        counts = {"n_obj": len(self.names), "n_ieq_constr": len(self.constraint_names)}
        super().__init__(n_var=len(low), xl=low, xu=high, **counts)

    def __repr__(self) -> str:
        task, arm = getattr(self, "task", None), getattr(self, "arm", None)
        rows = [] if arm is None else [("arm", f"{arm.name}, {arm.dof} joints")]
        rows = task_rows(task) if isinstance(task, MotionTask) else rows
        rows.append(("objectives", ", ".join(map(objective_text, self.names, self.units, self.maximised))))
        told = ("tracking", "evaluation", *(() if task is None else task.limit_names))
        rows.append(("constraints", ", ".join(name for name in self.constraint_names if name not in told)))
        text = columns([row for row in rows if row[1]])
        return fit_screen(f"{type(self).__name__}, {self.n_var} genes\n{text}\nnext: {self.next_step}")

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
