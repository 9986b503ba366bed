"""The grid of motions for redundancy one: nodes at every sample.

The nodes are postures on the curves of the sample.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from paretoik.errors import EvaluationFailed, InvalidInput
from paretoik.robot.kinematics import joint_scales
from paretoik.stop_flag import check_interruption
from paretoik.task.limits import LIMIT_TOLERANCE, Constraint, relative_violation
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import evaluate_function
from paretoik.task.random_starts import wrap_difference
from paretoik.task.retraction import retract
from paretoik.task.self_motion import Curve, resample_curve, self_motion_frames, unwrap_nodes, unwrapped_ranges
from paretoik.trajectory.shortest_paths import LayeredGraph

# Costs and limits of motions on a grid of postures, by the number of consecutive samples that they depend on.


Series = Callable[[Motion], np.ndarray]
At = Callable[[int, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]  # (q, dq, ddq) of some items of a sample


@dataclass(frozen=True, kw_only=True)
class GridOptions:
    """Settings of a grid and its results."""

    pace: float = 2.5  # largest pace of joints without velocity limit, as a multiple of the path's own pace
    quick_nodes: int = 30_000  # largest number of nodes of a quick grid
    distinct: float = 0.15  # rad or arm lengths, RMS: a path nearer to a better one counts as equal to it
    transitions: int = 40_000_000  # largest number of transitions: more do not fit the memory of a small machine
    block: int = 200_000  # number of samples that are evaluated at once
    cell: int = 2  # nodes by which a step between a cell's corners exceeds the step of a motion in it (for the bound)
    margin: int = 4  # number of nodes beyond windows and ranges of joints that have transitions (for the bound)


OPTIONS = GridOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Terms:
    """The cost of a motion, and its excess over limits.

    The excess is that of the worst limit, on postures and on rates: at most 0 if limits are satisfied, −1 without
    limits.

    second: whether a cost or a limit depends on accelerations
    """

    cost: Series
    postures: Series
    rates: Series
    second: bool

    def sample_costs(self, motion: Motion) -> np.ndarray:
        """Return every sample's share of the integral of the cost."""
        return self.cost(motion) * motion.weights

    def feasible_costs(self, motion: Motion) -> np.ndarray:
        """Return every sample's cost, infinite if a limit on rates is violated."""
        return np.where(self.rates(motion) <= LIMIT_TOLERANCE, self.sample_costs(motion), np.inf)


def build_terms(task: MotionTask, probe: np.ndarray) -> Terms:
    """Return objectives and limits, sorted by the derivatives that they depend on."""
    for kind, functions, form in (("objective", task.objectives, "integral"), ("constraint", task.constraints, "peak")):
        for one in functions:
            if one.form != form:
                raise InvalidInput(f"grid_oracle: {kind} {one.name}: form must be {form!r}, got {one.form!r}")

    def cost(motion: Motion) -> np.ndarray:
        return np.sum(
            [o.sign * evaluate_function(f"objective {o.name}", o.function, motion, o.form) for o in task.objectives],
            axis=0,
        )

    def joint_excess(kind: str) -> Series:
        return lambda motion: relative_violation(kind, task.bounds[kind], motion).max(axis=-1)

    def constraint_excess(c: Constraint) -> Series:
        def excess_of(motion: Motion) -> np.ndarray:
            values = evaluate_function(f"constraint {c.name}", c.function, motion, c.form)
            return np.maximum(values - c.upper, c.lower - values) / c.scale

        return excess_of

    def worst(limits: list[Series]) -> Series:
        nothing = [lambda motion: np.full(motion.q.shape[:-1], -1.0)]
        return lambda motion: np.max([limit(motion) for limit in limits or nothing], axis=0)

    limits = [joint_excess(kind) for kind in task.bounds] + [constraint_excess(c) for c in task.constraints]
    if task.obstacles:
        limits.append(lambda motion: (task.min_clearance - motion.clearance) / task.clearance_range)
    orders = [derivative_order(task, limit, probe) for limit in limits]
    return Terms(
        cost=cost,
        postures=worst([limit for limit, order in zip(limits, orders, strict=True) if order == 0]),
        rates=worst([limit for limit, order in zip(limits, orders, strict=True) if order > 0]),
        second=max([derivative_order(task, cost, probe), *orders]) == 2,
    )


def derivative_order(task: MotionTask, term: Series, q: np.ndarray) -> int:
    """Return the highest derivative that a function of motions depends on.

    A function does not depend on a derivative if NaN there has no effect.
    """
    for order, rates in enumerate([(np.nan, np.nan), (0.1, np.nan), (0.1, 0.1)]):
        with np.errstate(all="ignore"):
            try:
                values = term(instant_motions(task, q, *rates))
            except EvaluationFailed as error:
                raise InvalidInput(f"grid_oracle: functions must accept NaN in rates, got {error}") from error
        if not np.isnan(values).any():
            return order
    raise InvalidInput("grid_oracle: objectives and limits must be numbers and look no further than accelerations")


def instant_motions(task: MotionTask, q: np.ndarray, dq: np.ndarray | float, ddq: np.ndarray | float) -> Motion:
    """Return rows (rows, time, dof) of independent postures with given rates."""
    motion = replace(task, cyclic=False).motion(q)
    rates = {"dq": dq, "ddq": ddq, "jerk": np.nan}  # these replace the rates that ``Motion`` would compute from the row
    vars(motion).update({name: np.broadcast_to(values, q.shape) for name, values in rates.items()})
    return motion


def evaluate_at(task: MotionTask, term: Series, counts: Sequence[int], at: At) -> list[np.ndarray]:
    """Return ``term`` at every sample's instants.

    ``counts`` are the numbers of instants; ``at`` returns (q, dq, ddq) of some of them.
    """
    if sum(counts) > OPTIONS.transitions:
        raise InvalidInput(
            f"resolution must give at most {OPTIONS.transitions:.3g} transitions, got {sum(counts):.3g}: make it "
            "coarser"
        )
    values_at = [np.empty(count) for count in counts]
    rows, longest = max(1, OPTIONS.block // len(counts)), max(counts)
    for first in range(0, longest, rows):
        check_interruption()
        picks = [np.minimum(np.arange(first, min(first + rows, longest)), max(count - 1, 0)) for count in counts]
        parts = [at(i, pick) for i, pick in enumerate(picks)]
        values = term(instant_motions(task, *(np.stack(part, axis=1) for part in zip(*parts, strict=True))))
        for i, count in enumerate(counts):
            values_at[i][first : first + rows] = values[: max(count - first, 0), i]
    return values_at


# The grid of postures, and its transitions.


@dataclass(frozen=True, kw_only=True, eq=False)
class PostureGrid:
    """Nodes of every sample, and each node's next on its curve.

    Nodes are (nodes, dof); the next node is −1 at the end of a curve.

    turning: joints whose position is known modulo 2π
    windows: largest step (time, dof) of each joint to each sample
    scales: units of joint distances
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
        """Return the pairs of nodes that a step can join.

        The nodes are those of samples i − 1 and i. Joint steps between the two nodes are at most the windows. The pairs
        are sorted by the second node, then by the first.
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
        """Return the motion (time, dof) through nodes, with continuous joints."""
        q = np.stack([there[k] for there, k in zip(self.nodes, nodes, strict=True)])
        return np.cumsum(np.concatenate([q[:1], self.step(q[1:], q[:-1])]), axis=0)

    def select(self, mask: Sequence[Bool[np.ndarray, " _"]]) -> PostureGrid:
        """Return the grid with only the nodes of ``mask``."""
        next_node = []
        for ahead, k in zip(self.next_node, mask, strict=True):
            place = np.append(np.where(k, np.cumsum(k) - 1, -1), -1)  # the last entry maps −1 (no next node) to −1
            next_node.append(place[ahead[k]])
        return replace(self, nodes=[q[k] for q, k in zip(self.nodes, mask, strict=True)], next_node=next_node)


def step_windows(task: MotionTask, pace: float) -> Float[np.ndarray, "time dof"]:
    """Return each joint's largest step [rad, m] to each sample.

    It is at most ``pace`` [rad, the arm's length]. It is tiny instead of 0 for a joint that must not move.
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
    """Return the nodes of every sample, ``spacing`` apart on its curves.

    Joints are at most ``beyond`` past their ranges. Spacing and ``beyond`` are in rad, slides in arm lengths. Different
    turns of ``unrolled`` joints are different nodes.
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
        # each node's next one in the same turn: ``kept`` are the nodes' places, ``ahead`` the next places of all places
        scaled, kept = nodes[i] / scales, which[mask]
        order = np.argsort(kept, kind="stable")
        low, high = (np.searchsorted(kept[order], ahead[kept], side=side) for side in ("left", "right"))
        following = np.full(len(scaled), -1)
        for turn in range(int((high - low).max(initial=0))):
            candidate = order[np.minimum(low + turn, len(scaled) - 1)]
            near = np.linalg.norm(wrap_difference(scaled[candidate] - scaled, turning), axis=1) < 2 * spacing
            following = np.where((low + turn < high) & near, candidate, following)
        next_node.append(following)
    if task.start is not None:
        nodes[0], next_node[0] = task.start[None], np.array([-1])
    if task.cyclic:
        nodes[-1], next_node[-1] = nodes[0], next_node[0]
    return PostureGrid(nodes=nodes, next_node=next_node, turning=turning, windows=windows, scales=scales)


def transitions(task: MotionTask, grid: PostureGrid) -> tuple[list[tuple[np.ndarray, np.ndarray]], At]:
    """Return all edges to every sample, and their (q, dq, ddq).

    The first sample has no edges. The second value is the function of (q, dq, ddq) at the ends of edges.
    """
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
