"""The first posture of a motion as a pymoo problem.

Source: Marcos et al. 2012, section 4.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from paretoik.arrays import Genes
from paretoik.closed_loop.control_step import rotation_rows
from paretoik.closed_loop.open_loop import posture_bounds
from paretoik.collision.obstacles import Obstacle
from paretoik.errors import InvalidInput
from paretoik.formulations.control_step import check_limits
from paretoik.formulations.formulation import Formulation, check_motions, of_genes
from paretoik.inputs import ArrayLike, read_list
from paretoik.robot.arm import Arm
from paretoik.search.nsga2 import MaxiMinNSGA2
from paretoik.search.operators import elitist_algorithm
from paretoik.task.limits import Constraint, Limits
from paretoik.task.motion import Motion
from paretoik.task.motion_task import evaluate_motions, examine_functions
from paretoik.task.objectives import Objective, joint_travel
from paretoik.task.path import Path
from paretoik.task.retraction import task_errors
from paretoik.task.task import Task
from paretoik.task.validation import motion_task
from paretoik.trajectory.infeasibility import explain_violation


class Posture(Formulation):
    """Find a collision-free first posture on a path: a vectorised pymoo problem.

    The objective is ``position_error`` [m], the distance of the tool from its target (Eqs. 18, 21, 22). If a task asks
    for orientation, it is ``tool_error``, the distance plus the angle [m + rad]. The user's own objectives come after
    it.

    The paper's search (OLGA) is ``pk.solve(posture, population=1600, generations=200, stagnation=False)``: ``pk.solve``
    runs the paper's genetic algorithm for one objective, and MaxiMinNSGA2 for several. Motions of a front stand still
    in their postures, ``front.motions.q[:, 0]``. A ``ClosedLoop`` without a start runs the same search, compiled.

    Parameters
    ----------
    arm
        Planar or spatial arm.
    path
        Path, Task or several of them; only the first sample counts.
    objectives
        User's functions decorated with ``@objective``, of any form. Their motions have three samples: the arm stands
        in its posture for one second. Velocities are 0, and torques are those of gravity.
    constraints
        User's functions decorated with ``@constraint``, of any form; their motions are the same.
    limits
        Limits on position, holding torque and clearance; None: the arm's own. Joints without limits range over two
        turns, as in the paper, prismatic ones over 1 m either way.
    obstacles
        Obstacles that the links stay clear of.
    link_radius
        Radius [m] of the links, which are capsules; or one per link, those of the base and after each joint.

    Notes
    -----
    Genes are joint positions [rad, m].

    Raises
    ------
    InvalidInput
        Names the argument that cannot be used.
    """

    def __init__(
        self,
        arm: Arm,
        path: Path | Task | Sequence[Path | Task],
        *,
        objectives: Sequence[Objective] = (),
        constraints: Sequence[Constraint] = (),
        limits: Limits | None = None,
        obstacles: Sequence[Obstacle] = (),
        link_radius: ArrayLike = 0.0,
    ) -> None:
        read_list("objectives", objectives, Objective, "a list of functions decorated with @objective")
        check_limits(limits, supported=("position", "torque", "clearance"), where="of a posture")
        checked = motion_task(
            arm,
            path,
            objectives=tuple(objectives) or [joint_travel],
            constraints=constraints,
            limits=limits,
            obstacles=obstacles,
            link_radius=link_radius,
            differences="backward",
            redundant=False,
        ).standing(np.linspace(0.0, 1.0, 3))
        at_rest = {kind: bounds for kind, bounds in checked.bounds.items() if kind == "torque"}
        self.task = replace(checked, objectives=tuple(objectives), bounds=at_rest)
        self._rotations = rotation_rows(self.task)
        turns = bool(self._rotations.any())
        error = "tool_error" if turns else "position_error"
        if error in (taken := [each.name for each in objectives]):
            raise InvalidInput(f"objectives must have names other than {error}, got {', '.join(taken)}")
        self.names, self.units, self.maximised = (error,), ("m + rad" if turns else "m",), (False,)
        self.add_objectives(objectives)
        self.constraint_names = self.task.limit_names
        low, high = posture_bounds(self.task).T
        super().__init__(low, high)
        examine_functions(self.task, self.decode(np.random.default_rng(0).uniform(low, high, (16, arm.dof))))

    def algorithm(self, population: int, *, offspring: int | None = None, initial: Genes | None = None) -> Any:
        """Return the paper's genetic algorithm, or MaxiMinNSGA2 for several objectives."""
        if self.n_obj == 1:
            return elitist_algorithm(population, offspring=offspring, initial=initial)
        return MaxiMinNSGA2(pop_size=population, n_offsprings=offspring, sampling=initial)

    @of_genes
    def decode(self, genes: Genes) -> Motion:
        """Return motions (points, 3, dof) that stand still in postures."""
        return self.task.motion(np.repeat(genes[:, None], len(self.task.times), axis=1))

    def encode(self, motions: Motion) -> tuple[Genes, np.ndarray]:
        """Return motions' first postures, clipped to bounds, and the distances from these [rad, m]."""
        check_motions(motions, self.task)
        first = np.array(motions.q[:, 0])
        genes = np.clip(first, self.xl, self.xu)
        return genes, np.abs(genes - first).max(axis=1)

    def explain(self, genes: Genes) -> list[str]:
        """Return a reason for each infeasible individual; "" if it is feasible."""
        return [explain_violation(self.task, motion) for motion in self.decode(genes)]

    def _evaluate(self, X: Genes, out: dict[str, object], *args: object, **kwargs: object) -> None:
        task = self.task
        error = task_errors(task.arm, task.tasks, X, task.targets[0])[0]
        distance, angle = (np.linalg.norm(error[:, rows], axis=1) for rows in (~self._rotations, self._rotations))
        values, limits, out["cause"] = evaluate_motions(task, self.decode(X), interruptible=False)
        out["F"] = np.column_stack([distance + angle, values])  # Eq. 18
        out["G"] = limits
