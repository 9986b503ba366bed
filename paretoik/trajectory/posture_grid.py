"""The grid that motions are sought on where redundancy is one: the postures of every sample, cut into nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from paretoik.robot.scales import joint_scales
from paretoik.self_motion.curves import Curve, resample_curve, self_motion_frames, unwrap_nodes, unwrapped_ranges
from paretoik.self_motion.start_postures import wrap_difference
from paretoik.task.limits import LIMIT_TOLERANCE
from paretoik.task.motion_task import MotionTask
from paretoik.task.retraction import retract
from paretoik.trajectory.grid_terms import At
from paretoik.trajectory.layered_graph import LayeredGraph


@dataclass(frozen=True, kw_only=True, eq=False)
class PostureGrid:
    """Nodes of every sample (nodes, dof) and the node that comes next on the curve of each, −1 where none does.

    ``turning`` joints are known modulo 2π; ``windows`` (time, dof) is how far a joint may go to each sample, distances
    of joints are measured in ``scales``.
    """

    nodes: list[Float[np.ndarray, "_ dof"]]
    next_node: list[Int[np.ndarray, " _"]]
    turning: Bool[np.ndarray, " dof"]
    windows: Float[np.ndarray, "time dof"]
    scales: Float[np.ndarray, " dof"]

    def step(self, later: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return the shortest way of every joint between postures."""
        return wrap_difference(later - before, self.turning)

    def edges(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """Return all pairs of nodes of samples i − 1 and i with every joint's step within its window.

        Sorted by the second, then by the first.
        """
        box = np.where(self.turning, 2 * np.pi / self.windows[i], 0.0)
        places = [np.where(self.turning, q % (2 * np.pi), q) / self.windows[i] for q in self.nodes[i - 1 : i + 1]]
        before, here = (cKDTree(np.where(self.turning & (at >= box), 0.0, at), boxsize=box) for at in places)
        pairs = here.sparse_distance_matrix(before, 1.0, p=np.inf, output_type="ndarray")
        order = np.lexsort((pairs["j"], pairs["i"]))
        return pairs["j"][order], pairs["i"][order]

    def at_rest(self, i: int, pick: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return some nodes of a sample at rest: (q, dq, ddq)."""
        q = self.nodes[i][pick] if len(self.nodes[i]) else np.zeros((len(pick), len(self.turning)))
        return q, np.zeros_like(q), np.zeros_like(q)

    def motion(self, nodes: Sequence[int]) -> np.ndarray:
        """Return the motion (time, dof) through nodes, its joints continuous."""
        q = np.stack([there[k] for there, k in zip(self.nodes, nodes, strict=True)])
        return np.cumsum(np.concatenate([q[:1], self.step(q[1:], q[:-1])]), axis=0)

    def select(self, mask: Sequence[Bool[np.ndarray, " _"]]) -> PostureGrid:
        """Return the grid of the nodes of ``mask``."""
        next_node = []
        for ahead, k in zip(self.next_node, mask, strict=True):
            place = np.append(np.where(k, np.cumsum(k) - 1, -1), -1)  # the last entry: next of none is none
            next_node.append(place[ahead[k]])
        return PostureGrid(
            nodes=[q[k] for q, k in zip(self.nodes, mask, strict=True)],
            next_node=next_node,
            turning=self.turning,
            windows=self.windows,
            scales=self.scales,
        )


def step_windows(task: MotionTask, pace: float) -> Float[np.ndarray, "time dof"]:
    """Return how far [rad, m] each joint may go to each sample, at most ``pace`` [rad, the arm's length].

    Next to nothing where it may not move at all.
    """
    limits = np.abs(task.bounds.get("velocity", np.full((1, task.arm.dof, 2), np.inf))).max(axis=-1)
    steps = np.diff(task.times)[:, None]
    steps = np.concatenate([steps[:1], steps])
    scales = joint_scales(task.arm)
    return np.maximum(np.minimum(limits * steps * (1 + LIMIT_TOLERANCE), pace * scales), LIMIT_TOLERANCE * scales)


def posture_grid(
    task: MotionTask,
    curves: list[list[Curve]],
    spacing: float,
    windows: np.ndarray,
    unrolled: Bool[np.ndarray, " dof"],
    beyond: float = 0.0,
) -> PostureGrid:
    """Return the nodes of every sample, ``spacing`` apart on its curves, joints at most ``beyond`` past their ranges.

    Both are in rad, slides in lengths of the arm. Turns of ``unrolled`` joints are told apart.
    """
    cut = [[resample_curve(task.arm, curve, spacing) for curve in here] for here in curves]
    samples = np.repeat(np.arange(len(cut)), [sum(len(q) for q, _ in here) for here in cut])
    q = np.concatenate([q for here in cut for q, _ in here])
    retracted = retract(task.arm, task.tasks, q, *self_motion_frames(task, samples, q)[1:])
    scales = joint_scales(task.arm)
    ranges = unwrapped_ranges(task, unrolled) + np.array([-beyond, beyond]) * scales[:, None]
    turning = task.arm.periodic & np.isnan(ranges[:, 0])
    nodes, next_node = [], []
    for i, here in enumerate(cut):
        rows = samples == i
        there, which = unwrap_nodes(retracted.q[rows], ranges, task.arm.periodic)
        firsts = np.cumsum([0] + [len(q) for q, _ in here[:-1]])
        ahead = np.concatenate([np.where(n < 0, -1, n + first) for (_, n), first in zip(here, firsts, strict=True)])
        mask = retracted.on_path[rows][which]
        nodes.append(there[mask])
        next_node.append(_next_nodes(nodes[i] / scales, which[mask], ahead, turning, spacing))
    if task.start is not None:
        nodes[0], next_node[0] = task.start[None], np.array([-1])
    if task.cyclic:
        nodes[-1], next_node[-1] = nodes[0], next_node[0]
    return PostureGrid(nodes=nodes, next_node=next_node, turning=turning, windows=windows, scales=scales)


def _next_nodes(q: np.ndarray, which: np.ndarray, ahead: np.ndarray, turning: np.ndarray, spacing: float) -> np.ndarray:
    """Return the next of every node, in the same turn: ``ahead`` is the next of each place ``which`` nodes are at."""
    order = np.argsort(which, kind="stable")
    low, high = (np.searchsorted(which[order], ahead[which], side=side) for side in ("left", "right"))
    next_index = np.full(len(q), -1)
    for turn in range(int((high - low).max(initial=0))):
        candidate = order[np.minimum(low + turn, len(q) - 1)]
        near = np.linalg.norm(wrap_difference(q[candidate] - q, turning), axis=1) < 2 * spacing
        next_index = np.where((low + turn < high) & near, candidate, next_index)
    return next_index


def transitions(task: MotionTask, grid: PostureGrid) -> tuple[list[tuple[np.ndarray, np.ndarray]], At]:
    """Return all edges to every sample, none to the first, and what gives (q, dq, ddq) at the end of some of them."""
    pairs = [(np.zeros(0, dtype=int),) * 2] + [grid.edges(i) for i in range(1, len(grid.nodes))]
    steps = np.diff(task.times, prepend=np.nan)

    def at(i: int, pick: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        sources, ends = (side[pick] if len(side) else np.zeros_like(pick) for side in pairs[i])
        q = grid.nodes[i][ends]
        dq = grid.step(q, grid.nodes[i - 1][sources]) / steps[i] if i else np.zeros_like(q)
        return q, dq, np.zeros_like(q)

    return pairs, at


def build_graph(grid: PostureGrid, pairs: list[tuple[np.ndarray, np.ndarray]], costs: list[np.ndarray]) -> LayeredGraph:
    """Return the graph whose states are nodes and whose transitions are edges."""
    return LayeredGraph(
        start=np.zeros(len(grid.nodes[0])),
        offsets=[
            np.searchsorted(ends, np.arange(len(q) + 1)) for (_, ends), q in zip(pairs[1:], grid.nodes[1:], strict=True)
        ],
        sources=[sources for sources, _ in pairs[1:]],
        costs=costs[1:],
        nodes=[np.arange(len(q)) for q in grid.nodes],
    )
