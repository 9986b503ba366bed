"""One control step: start, target, and decoding of genes. Source: Marcos et al. 2012, section 4.1."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from paretoik.arrays import Genes
from paretoik.closed_loop.objectives import Step
from paretoik.collision.obstacles import clearance, describe_obstacle
from paretoik.errors import Infeasible
from paretoik.robot.kinematics import link_nodes
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import task_errors

HISTORY = 3  # configurations before a step: enough for a jerk


class EngineOptions(NamedTuple):
    """Settings of a step's search and of the test for admissible steps."""

    crossover_probability: float = 0.5  # p_c of Marcos et al. 2012, section 5.1
    mutation_probability: float = 0.5  # p_m, ibid.
    gene_bound: float = 1.0  # largest magnitude of a gene, ibid.
    max_redraws: int = 100  # largest number of redraws of inadmissible chromosomes (no bound in section 5.2)
    bound_tolerance: float = 1e-10  # rad or m: rounding error of a shortened step at its bounds
    shortest_interval: float = 2.0**-8  # share of a step: intervals not proven clear are halved down to this
    interval_batch: int = 64  # number of intervals whose midpoints are evaluated together
    interval_depth: int = 16  # number of batches that fit on the stack of intervals
    singular_ratio: float = 1e-9  # ratio of a Jacobian's singular values below which the arm counts as singular


OPTIONS = EngineOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class StepState:
    """The state before the step to sample ``sample`` of the path."""

    task: MotionTask
    sample: int
    history: Float[np.ndarray, "history dof"]  # last joint positions; the last row is the present one
    home: Float[np.ndarray, " dof"]  # joint positions in which the loop began
    lower: Float[np.ndarray, " dof"]  # rad, m: lower bounds of the joints' moves
    upper: Float[np.ndarray, " dof"]  # rad, m: upper bounds of the joints' moves
    swept: bool  # whether the whole step must be clear of obstacles, not only its end
    standoff: float  # m: distance from obstacles at the end of a swept step, beyond the required one

    @property
    def previous(self) -> Float[np.ndarray, " dof"]:
        """Joint positions in which the step begins."""
        return self.history[-1]

    @property
    def dt(self) -> float:
        """Duration of the step [s]."""
        return float(self.task.times[self.sample] - self.task.times[self.sample - 1])

    @property
    def target(self) -> Float[np.ndarray, " numbers"]:
        """Target of the tool, as in ``MotionTask.targets``."""
        return self.task.targets[self.sample]

    @property
    def bounded(self) -> bool:
        """Whether any joint has a bounded move."""
        return bool(np.isfinite([self.lower, self.upper]).any())

    def linearise(self) -> tuple[Float[np.ndarray, " rows"], Float[np.ndarray, "rows dof"]]:
        """Return (Δx, J): tool error and Jacobian before the step. Source: Eqs. 8 and 9."""
        return task_errors(self.task.arm, self.task.tasks, self.previous, self.target)

    @cached_property
    def shortest_and_null_space(self) -> tuple[Float[np.ndarray, " dof"], Float[np.ndarray, "dof redundancy"]]:
        """Shortest step that makes Δx, and null space of the Jacobian, before the step.

        Raises Infeasible if the arm is singular: no finite step makes every Δx there.
        """
        error, jacobian = self.linearise()
        left, sizes, right = np.linalg.svd(jacobian)
        if not sizes[-1] > OPTIONS.singular_ratio * sizes[0]:
            raise Infeasible(
                f"step {self.sample} ({self.task.times[self.sample]:.3g} s): the Jacobian must have full rank, got the "
                f"condition number {sizes[0] / max(sizes[-1], 1e-300):.3g}"
            )
        shortest = right[: len(error)].T @ ((left.T @ error) / sizes)
        return shortest, np.ascontiguousarray(right[len(error) :].T)

    def decode(self, genes: Genes) -> Float[np.ndarray, "points dof"]:
        """Return the joint positions after the steps of genes (J*, Δx*); NaN if the extended Jacobian is singular.

        With Δq = shortest + N y, the system of Eqs. 7, 12 and 13 reduces to J* N y = Δx* − J* shortest.
        """
        shortest, null_space = self.shortest_and_null_space
        n, r = null_space.shape
        rows = genes.reshape(len(genes), r, n + 1)
        matrix, rhs = rows[..., :-1] @ null_space, rows[..., -1] - rows[..., :-1] @ shortest
        singular = np.linalg.det(matrix) == 0
        matrix[singular], rhs[singular] = np.eye(r), np.nan
        base: np.ndarray = self.previous + shortest
        return base + np.linalg.solve(matrix, rhs[..., None])[..., 0] @ null_space.T

    def shorten(self, q: Float[np.ndarray, "points dof"]) -> Float[np.ndarray, "points dof"]:
        """Return the joint positions of steps whose self-motion is reduced until joints are within bounds."""
        shortest, _ = self.shortest_and_null_space
        self_motion = np.nan_to_num(q - self.previous - shortest)
        outside = (shortest + self_motion < self.lower) | (shortest + self_motion > self.upper)
        bound = np.where(self_motion > 0, self.upper, self.lower)
        share = (bound - shortest) / np.where(outside & (self_motion != 0), self_motion, 1.0)
        scale = np.where(outside, np.clip(share, 0.0, 1.0), 1.0).min(axis=1, keepdims=True)
        return np.where(scale < 1, self.previous + shortest + scale * self_motion, q)

    def motions(self, q: Float[np.ndarray, "points dof"]) -> Motion:
        """Return the motions (points, 4, dof) that end with steps to joint positions."""
        before = np.broadcast_to(self.history, (len(q), *self.history.shape))
        return self.ending.motion(np.concatenate([before, q[:, None]], axis=1))

    @cached_property
    def ending(self) -> MotionTask:
        """Task of ``motions``: the tool's target is that of the step."""
        return self.task.standing(self.dt * np.arange(HISTORY + 1), self.sample)

    def steps(self, q: Float[np.ndarray, "points dof"]) -> Step:
        """Return steps to joint positions, in the form that objectives take."""
        motions = self.motions(q)
        error = task_errors(self.task.arm, self.task.tasks, motions.q, self.target)[0]
        rotations = rotation_rows(self.task)
        return Step(
            motion=motions,
            home=self.home,
            position_error=error[..., ~rotations],
            rotation_error=error[..., rotations],
            dt=self.dt,
        )

    def is_admissible(self, q: Float[np.ndarray, "points dof"]) -> Bool[np.ndarray, " points"]:
        """Return which steps are within their bounds and clear of obstacles."""
        return (self.excess_over_bounds(q) <= 0) & (self.clearance_left(q) > 0)

    def excess_over_bounds(self, q: Float[np.ndarray, "points dof"]) -> Float[np.ndarray, " points"]:
        """Return the largest excess [rad, m] over the bounds of joints' moves; not positive if within them."""
        moved = q - self.previous
        return np.maximum(moved - self.upper, self.lower - moved).max(axis=1) - OPTIONS.bound_tolerance

    def clearance_left(self, q: Float[np.ndarray, "points dof"]) -> Float[np.ndarray, " points"]:
        """Return the clearance [m] of steps, positive if they are proven clear.

        If the whole step must be clear, it is halved until, in each interval, no point of the arm moves farther than
        the sum of the distances from obstacles at both ends. Steps too near for this proof count as not clear.
        """
        end = excess_clearance(self.task, q)
        left = end - self.standoff
        if not self.swept:
            return left
        moved = q - self.previous
        travel, width = np.abs(moved) @ reach_by_joint(self.task), 1.0
        index, begin = np.arange(len(q)), np.zeros(len(q))
        low, high = excess_clearance(self.task, self.previous[None]).repeat(len(q)), end
        while True:
            spare = low + high - travel[index] * width
            waiting = (left[index] > 0) & (spare <= 0)
            if width <= OPTIONS.shortest_interval:
                np.minimum.at(left, index[waiting], spare[waiting])
                return left
            index, begin, low, high = index[waiting], begin[waiting], low[waiting], high[waiting]
            if not index.size:
                return left
            width /= 2
            middle = excess_clearance(self.task, self.previous + (begin + width)[:, None] * moved[index])
            blocked = middle <= 0
            np.minimum.at(left, index[blocked], middle[blocked])
            index, begin = np.tile(index, 2), np.concatenate([begin, begin + width])
            low, high = np.concatenate([low, middle]), np.concatenate([middle, high])


def rotation_rows(task: MotionTask) -> Bool[np.ndarray, " rows"]:
    """Return which rows of the task errors are rotations [rad]."""
    return np.concatenate([np.arange(each.rows) >= each.position_rows for each in task.tasks])


def reach_by_joint(task: MotionTask) -> Float[np.ndarray, " dof"]:
    """Return the largest move [m] of the arm's points per move of each joint by 1 rad or 1 m.

    No point beyond a joint is farther from it than the total length of the links after it. A prismatic joint moves all
    points after it by its own move; its largest extension adds to the length after previous joints.
    """
    arm = task.arm
    offsets = [float(np.linalg.norm(place.position)) for place in (*arm.placements[1:], arm.tool)]
    prismatic = ~arm.periodic
    extension = np.where(prismatic, np.abs(arm.position_limits).max(axis=1), 0.0)
    lengths = np.cumsum((offsets + np.append(extension[1:], 0.0))[::-1])[::-1]
    return np.where(prismatic, 1.0, lengths)


def excess_clearance(task: MotionTask, q: Float[np.ndarray, "*batch dof"]) -> Float[np.ndarray, "*batch"]:
    """Return the clearance [m] of configurations beyond the required one; inf without obstacles."""
    if not task.obstacles:
        return np.full(q.shape[:-1], np.inf)
    return np.asarray(clearance(task.obstacles, link_nodes(task.arm, q), task.link_radius) - task.min_clearance)


def describe_nearest_obstacle(task: MotionTask, q: Float[np.ndarray, " dof"]) -> str:
    """Return the nearest obstacle to a configuration in words: its name, or else its number and size."""
    nodes = link_nodes(task.arm, q)
    distances = [float(clearance([obstacle], nodes, task.link_radius)) for obstacle in task.obstacles]
    k = int(np.argmin(distances))
    if task.obstacles[k].name:
        return describe_obstacle(task.obstacles, k)
    return f"obstacle {k + 1} of {len(distances)}, {task.obstacles[k]}"
