"""The grid oracle: the best motions over a grid of postures, for one degree of redundancy, by dynamic programming.

The postures of a sample are on a few curves, cut into evenly spaced nodes; two nodes of consecutive samples are joined
if no joint moves too far. If objectives and limits depend only on positions and velocities (backward differences), the
best path is exact on this grid, and ``lower_bound`` bounds all motions between its nodes. If they depend on
accelerations, states are pairs of nodes on fewer samples; the paths are then only starts, and there is no bound.

Source: Bellman 1957 (dynamic programming); Burdick 1989 (self-motion curves).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from paretoik.errors import EvaluationFailed, Infeasible, InvalidInput
from paretoik.robot.kinematics import joint_scales
from paretoik.stop_flag import check_interruption
from paretoik.task.limits import LIMIT_TOLERANCE, Constraint, relative_violation
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import evaluate_function
from paretoik.task.random_starts import wrap_difference
from paretoik.task.retraction import retract
from paretoik.task.self_motion import (
    Curve,
    branch_labels,
    count_nodes,
    node_spacing,
    postures_along_path,
    resample_curve,
    self_motion_frames,
    trace_curves,
    unwrap_nodes,
    unwrapped_ranges,
)
from paretoik.trajectory.levels import coarsest_level
from paretoik.trajectory.shortest_paths import LayeredGraph, distinct_paths, shortest_path

Series = Callable[[Motion], np.ndarray]
At = Callable[[int, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]  # (q, dq, ddq) of some items of a sample


@dataclass(frozen=True, kw_only=True)
class GridOptions:
    """Settings of a grid and its results."""

    pace: float = 2.5  # largest pace of joints without velocity limit, as a multiple of the path's own pace
    quick_nodes: int = 30_000  # largest number of nodes of a quick grid
    distinct: float = 0.15  # rad or arm lengths, RMS: a path nearer to a better one counts as equal to it
    transitions: int = 40_000_000  # largest number of transitions: more do not fit into a small machine's memory
    block: int = 200_000  # number of samples that are evaluated at once
    cell: int = 2  # for the bound: nodes by which steps of a cell's corners may exceed those of motions in it
    margin: int = 4  # for the bound: number of nodes by which windows and joint ranges are extended


OPTIONS = GridOptions()


@dataclass(frozen=True, kw_only=True, eq=False)
class Terms:
    """The cost of a motion, and its worst excess over limits.

    The excess is at most 0 if limits are satisfied, −1 without limits.
    """

    cost: Series
    postures: Series  # excess over limits on postures
    rates: Series  # excess over limits on rates
    second: bool  # whether a cost or a limit depends on accelerations

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
    """Return the highest derivative in which NaN changes a function's values."""
    for order, rates in enumerate([(np.nan, np.nan), (0.1, np.nan), (0.1, 0.1)]):
        with np.errstate(all="ignore"):
            try:
                values = term(instant_motions(task, q, *rates))
            except EvaluationFailed as error:
                raise InvalidInput(f"grid_oracle: functions must accept NaN in rates: {error}") from error
        if not np.isnan(values).any():
            return order
    raise InvalidInput("grid_oracle: objectives and limits must be finite functions of q, dq and ddq, got NaN")


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
    limit, total = OPTIONS.transitions, sum(counts)
    if total > limit:
        raise InvalidInput(f"resolution must give at most {limit:.3g} transitions, got {total:.3g}; make it coarser")
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
    """Nodes (nodes, dof) of every sample, and each node's next one on its curve."""

    nodes: list[Float[np.ndarray, "_ dof"]]
    next_node: list[Int[np.ndarray, " _"]]  # index of each node's next one; −1 at the end of a curve
    turning: Bool[np.ndarray, " dof"]  # joints whose position is known modulo 2π
    windows: Float[np.ndarray, "time dof"]  # largest step (time, dof) of each joint to each sample
    scales: Float[np.ndarray, " dof"]  # units of joint distances

    def step(self, later: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return every joint's shortest displacement between postures."""
        return wrap_difference(later - before, self.turning)

    def edges(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the pairs of nodes that a step to sample i joins.

        The pairs are sorted by the second node, then by the first.
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

    Distances are in rad, or arm lengths if prismatic. Joints are at most ``beyond`` past their ranges. Different turns
    of ``unrolled`` joints are different nodes.
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
        # next node in the same turn; ``kept`` has the nodes' indices on the curves, ``ahead`` each index's next one
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
    """Return all edges to every sample, and their (q, dq, ddq)."""
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


# A lower bound on all motions, for redundancy one and without accelerations
#
# At every sample a motion is in a cell: between two neighbouring nodes. Round every sample independently to one of
# these two, with probabilities that make the mean the motion's own place. The mean cost of the rounded paths is the sum
# of each transition's cost, interpolated between the corners of its cell; it exceeds the motion's cost by at most
# the interpolation error. Some rounded path costs at most the mean. So the best path through the grid, with that error
# subtracted from every transition and limits relaxed by their change within a cell, is a lower bound.
#
# The error is estimated from second differences D between neighbouring transitions of all cells around. If costs are
# smooth, it is ⅛ max D; if they have a kink and are convex along the curves, ½ max D. At a kink D jumps from node to
# node, so that ⅛ max D + ⅜ (max D − min D) is valid for both. The change of limits within a cell is estimated from
# first differences.


def lower_bound(task: MotionTask, grid: PostureGrid, terms: Terms, spacing: float) -> float:
    """Return a lower bound on every motion within the grid's windows.

    It is infinite if no motion satisfies the limits. ``grid`` has all nodes, and some beyond the joints' ranges.
    """
    wide = replace(grid, windows=grid.windows + OPTIONS.margin * spacing * grid.scales)
    pairs, edge = transitions(task, wide)
    counts = [len(sources) for sources, _ in pairs]
    costs = evaluate_at(task, terms.sample_costs, counts, edge)
    rates = evaluate_at(task, terms.rates, counts, edge)
    postures = evaluate_at(task, terms.postures, [len(q) for q in grid.nodes], grid.at_rest)
    nodes = [_may_satisfy(excess, [_neighbours(ahead)]) for excess, ahead in zip(postures, grid.next_node, strict=True)]
    masks = []
    for i, (sources, ends) in enumerate(pairs[1:], 1):
        around = _neighbouring_transitions(sources, ends, grid.next_node[i - 1], grid.next_node[i])
        costs[i] -= sum(_interpolation_error(costs[i], pair, around) for pair in around)
        steps = np.abs(grid.step(grid.nodes[i][ends], grid.nodes[i - 1][sources]))
        near = steps <= grid.windows[i] + OPTIONS.cell * spacing * grid.scales
        masks.append(near.all(axis=1) & nodes[i - 1][sources] & nodes[i][ends] & _may_satisfy(rates[i], around))
    layers = build_graph(grid, pairs, costs).prune(masks, np.where(nodes[0], 0.0, np.inf))
    return shortest_path(layers, task.cyclic)[0]


Pair = tuple[np.ndarray, np.ndarray]  # indices of the neighbours on both sides, −1 without a neighbour


def _neighbours(ahead: np.ndarray) -> Pair:
    """Return each node's next and previous one on its curve."""
    behind = np.full(len(ahead), -1)
    inner = np.flatnonzero(ahead >= 0)
    behind[ahead[inner]] = inner
    return ahead, behind


def _neighbouring_transitions(
    sources: np.ndarray, ends: np.ndarray, before: np.ndarray, here: np.ndarray
) -> list[Pair]:
    """Return the neighbours of each transition.

    The first pair begins at the next and the previous node, the second pair ends at them.
    """
    width = len(before)
    keys = ends * width + sources  # ascending

    def at(source: np.ndarray, end: np.ndarray) -> np.ndarray:
        key = end * width + source
        place = np.minimum(np.searchsorted(keys, key), len(keys) - 1)
        return np.where((source >= 0) & (end >= 0) & (keys[place] == key), place, -1)

    (later, earlier), (up, down) = (_neighbours(ahead) for ahead in (before, here))
    return [
        (at(later[sources], ends), at(earlier[sources], ends)),
        (at(sources, up[ends]), at(sources, down[ends])),
    ]


def _interpolation_error(values: np.ndarray, pair: Pair, around: list[Pair]) -> np.ndarray:
    """Return the largest interpolation error in the cells around, estimated from second differences."""
    after, before = pair
    second_differences = values[after] + values[before] - 2 * values
    convex = np.maximum(np.where((after >= 0) & (before >= 0), second_differences, np.nan), 0.0)  # NaN stays NaN
    largest, smallest = _neighbourhood_max(convex, around), -_neighbourhood_max(-convex, around)
    return np.where(largest >= smallest, largest / 8 + 3 / 8 * (largest - smallest), 0.0)


def _neighbourhood_max(values: np.ndarray, around: list[Pair]) -> np.ndarray:
    """Return the largest value of each and its neighbours; NaN only if all are NaN."""
    for pair in around:
        values = np.fmax.reduce([values, *(np.where(side >= 0, values[side], np.nan) for side in pair)])
    return values


def _may_satisfy(excess: np.ndarray, around: list[Pair]) -> np.ndarray:
    """Return which nodes or transitions may satisfy limits within an adjacent cell."""
    margin: np.ndarray | float = 0.0
    for pair in around:  # first differences between neighbours
        differences = [np.where(side >= 0, np.abs(excess[side] - excess), 0.0) for side in pair]
        margin = margin + _neighbourhood_max(np.max(differences, axis=0), around)
    return np.asarray(excess <= LIMIT_TOLERANCE + margin)


# The grid oracle: all motions over a grid.


@dataclass(frozen=True, kw_only=True, eq=False)
class GridOracle:
    """The best motion of every class on the grid, and motions far from these.

    The bound's error is proportional to the square of the resolution, or to the resolution if limits are active.
    """

    q: Float[np.ndarray, "paths time dof"]  # joint positions of the motions, best first
    values: Float[np.ndarray, " paths"]  # sums of objectives (minimised)
    violations: Float[np.ndarray, " paths"]  # worst violation of limits
    labels: tuple[str, ...]  # branch labels of the motions
    resolution: float  # distance of neighbouring nodes [rad, the arm's length]
    samples: int  # number of samples on the grid
    exact: bool  # whether no path through the grid is better than the first motion
    # bound on all motions on the traced curves within the same pace; NaN if not ``exact``, or if ``quick``
    lower_bound: float

    @property
    def best(self) -> float:
        """The objective value of the best path through the grid."""
        return float(self.values[0])


def grid_oracle(
    task: MotionTask, *, resolution: float | None = None, classes: int = 8, quick: bool = False
) -> GridOracle:
    """Return the best paths through a grid of postures, one per class.

    task: motion task with redundancy one, integral objectives, whose sum is minimised, and backward differences
    resolution: distance [rad, the arm's length] between nodes; None for a share of a joint's largest step between
        samples, or more if nodes would be too many
    classes: largest number of motions; the first ones are one per class (bends of joints and their turns)
    quick: whether to leave out the bound, and to refuse slow problems

    Joints without velocity limit may move at a few times the pace that the path needs. Raises InvalidInput if the task
    is unsupported, or slow despite ``quick`` (accelerations, very many nodes); OutOfReach if the path is out of reach;
    Infeasible if no path through the grid exists.
    """
    if task.redundancy != 1:
        raise InvalidInput(f"grid_oracle: redundancy must be 1, got {task.redundancy}")
    if task.differences != "backward" or task.ends_at_rest:
        wrong = "end_velocity=0" if task.ends_at_rest else f"{task.differences} differences"
        raise InvalidInput(f"grid_oracle: task must have backward differences and no end_velocity, got {wrong}")
    if resolution is not None and not resolution > 0:
        raise InvalidInput(f"resolution must be a positive distance in rad, got {resolution}")
    # nodes on the curves of postures, and windows of steps
    seeds, pace = postures_along_path(task, np.random.default_rng(0))
    terms = build_terms(task, np.stack([q[0] for q in seeds])[None])
    if quick and terms.second:
        raise InvalidInput("grid_oracle: objectives and limits must not depend on accelerations if quick=True")
    level = coarsest_level(task) if terms.second else task
    sample_index = np.searchsorted(task.times, level.times)
    windows = step_windows(level, OPTIONS.pace * pace * (len(task.times) - 1) / (len(level.times) - 1))
    curves = trace_curves(level, [seeds[i] for i in sample_index])
    spacing = resolution or node_spacing(task.arm, curves, windows, second=terms.second)
    unrolled = np.zeros(task.arm.dof, dtype=bool)
    if quick and count_nodes(task, curves, spacing) > OPTIONS.quick_nodes:
        limit = OPTIONS.quick_nodes
        raise InvalidInput(f"grid_oracle: quick=True allows at most {limit} nodes, got more, {spacing:g} rad apart")
    while True:  # the shortest path: cost to a state = min over transitions of (cost to its source + transition)
        grid = _feasible_grid(level, posture_grid(level, curves, spacing, windows, unrolled), terms)
        layers = (_pair_graph if terms.second else _node_graph)(level, grid, terms)
        layers = layers.prune([np.isfinite(cost) for cost in layers.costs], layers.start)
        best, states = shortest_path(layers, level.cyclic)
        if not len(states):
            raise _no_path_error(level, layers, spacing)
        q = grid.motion(layers.node_path(states))
        wound = level.cyclic & level.arm.periodic & (np.abs(q[-1] - q[0]) > 1.0)
        if not wound.any():
            break
        unrolled |= wound  # the best cycle ends whole turns away from its start: tell turns of these joints apart
    paths = [states, *distinct_paths(layers, level.cyclic, round(OPTIONS.distinct / spacing))]
    motions = np.stack([grid.motion(layers.node_path(path)) for path in paths])
    selection = _select_paths(task, level, grid, terms, motions, classes)
    if not terms.second and not np.isclose(selection["values"][0], best, rtol=1e-6, atol=0):
        raise InvalidInput("grid_oracle: objectives and limits must depend only on the posture and rates of one sample")
    bound = np.nan  # lower bound of all motions
    if not quick and not terms.second:
        every = posture_grid(level, curves, spacing, windows, unrolled, beyond=OPTIONS.margin * spacing)
        bound = lower_bound(level, every, terms, spacing)
    return GridOracle(
        **selection, resolution=spacing, samples=len(level.times), exact=not terms.second, lower_bound=bound
    )


def _node_graph(task: MotionTask, grid: PostureGrid, terms: Terms) -> LayeredGraph:
    pairs, at = transitions(task, grid)
    counts = [len(sources) for sources, _ in pairs]
    return build_graph(grid, pairs, evaluate_at(task, terms.feasible_costs, counts, at))


def _pair_graph(task: MotionTask, grid: PostureGrid, terms: Terms) -> LayeredGraph:
    """Return the graph of pairs of consecutive nodes.

    A joint's speed changes by at most half its range in a step.
    """
    nodes, steps, first = grid.nodes, np.diff(task.times, prepend=np.nan), 0 if task.cyclic else 1
    pairs = [grid.edges(i) for i in range(1, len(nodes))]
    dq = [grid.step(nodes[i + 1][b], nodes[i][a]) / steps[i + 1] for i, (a, b) in enumerate(pairs)]
    pairs.insert(0, pairs[-1] if task.cyclic else pairs[0])
    dq.insert(0, dq[-1] if task.cyclic else np.zeros_like(dq[0]))
    transitions_of = [(np.zeros(0, dtype=int),) * 2]
    for i in range(1, len(nodes)):
        if i > first:
            # all transitions from a pair to a pair that begins at its second node
            begins = pairs[i][0]
            low, high = (np.searchsorted(pairs[i - 1][1], begins, side=side) for side in ("left", "right"))
            ends = np.repeat(np.arange(len(begins)), high - low)
            sources = np.arange(len(ends)) - np.repeat(np.cumsum(high - low) - high, high - low)
        else:
            sources, ends = (np.arange(len(dq[1])),) * 2
        near = np.abs(dq[i][ends] - dq[i - 1][sources]) * steps[i] <= grid.windows[i] / 2
        transitions_of.append((sources[near.all(axis=1)], ends[near.all(axis=1)]) if i > first else (sources, ends))

    def at(i: int, pick: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        sources, ends = transitions_of[i]
        if not len(ends):
            return grid.at_rest(i, np.zeros_like(pick))
        here = dq[i][ends[pick]]
        return nodes[i][pairs[i][1][ends[pick]]], here, (here - dq[i - 1][sources[pick]]) / steps[i]

    costs = evaluate_at(task, terms.feasible_costs, [len(sources) for sources, _ in transitions_of], at)
    return LayeredGraph(
        start=np.zeros(len(dq[0])) if task.cyclic else costs[1],
        offsets=[
            np.searchsorted(transitions_of[i][1], np.arange(len(dq[i]) + 1)) for i in range(1 + first, len(nodes))
        ],
        sources=[sources for sources, _ in transitions_of[1 + first :]],
        costs=costs[1 + first :],
        nodes=[ends for _, ends in pairs[first:]],
        before=None if task.cyclic else pairs[1][0],
    )


def _feasible_grid(task: MotionTask, grid: PostureGrid, terms: Terms) -> PostureGrid:
    """Return the grid of the nodes that satisfy the limits on postures."""

    def satisfies(motion: Motion) -> np.ndarray:
        satisfied = np.asarray(terms.postures(motion) <= LIMIT_TOLERANCE)
        if not task.cyclic:
            satisfied[:, 0] &= (terms.rates(motion) <= LIMIT_TOLERANCE)[:, 0]  # the motion begins at rest
        return satisfied

    feasible = [there > 0 for there in evaluate_at(task, satisfies, [len(there) for there in grid.nodes], grid.at_rest)]
    if task.cyclic:
        feasible[0] = feasible[-1] = feasible[0] & feasible[-1]
    for i, k in enumerate(feasible):
        if not k.any():
            time = f"{task.times[i]:.3g} s"
            raise Infeasible(f"no posture satisfies the limits at sample {i} of {len(feasible)} ({time})")
    return grid.select(feasible)


def _select_paths(
    task: MotionTask, level: MotionTask, grid: PostureGrid, terms: Terms, paths: np.ndarray, classes: int
) -> dict[str, Any]:
    """Return each class's best motion, then motions far from these."""
    if task.cyclic:
        paths = paths[np.abs((paths[:, -1] - paths[:, 0]) / grid.scales).max(axis=1) < 1e-6]
    motions = level.motion(paths)
    cost, kinds = motions.integral(terms.cost(motions)), branch_labels(motions)
    change = paths[:, -1] - paths[:, 0]
    turns = np.round((change - grid.step(paths[:, -1], paths[:, 0])) / (2 * np.pi)).astype(int)
    selected: dict[int, np.ndarray] = {}
    for far in (False, True):  # classes first, so that no distant motion takes the place of a class
        for k in np.argsort(cost, kind="stable").tolist():
            indices = list(selected)
            is_known = any(kinds[k] == kinds[j] and (turns[k] == turns[j]).all() for j in indices)
            square = np.sum((grid.step(paths[k], paths[indices]) / grid.scales) ** 2, axis=-1)
            distance = np.sqrt(np.mean(square, axis=-1)).min(initial=np.inf)
            chosen = distance > OPTIONS.distinct if far else not is_known
            if len(indices) < classes and chosen:
                with suppress(Infeasible):  # the motion leaves the path between its samples
                    whole = len(level.times) == len(task.times)
                    selected[k] = np.array(motions[k].q if whole else motions[k].at(task.times))
                    if task.start is not None:
                        selected[k][0] = task.start
    order = sorted(selected, key=lambda k: cost[k])
    if not order:
        raise Infeasible(f"every motion through the grid of {len(level.times)} samples leaves the path between them")
    final = task.motion(np.stack([selected[k] for k in order]))
    return {
        "q": final.q,
        "values": final.integral(terms.cost(final)),
        "violations": task.violations(final).max(axis=1, initial=0.0),
        "labels": tuple(kinds[k] for k in order),
    }


def _no_path_error(task: MotionTask, layers: LayeredGraph, spacing: float) -> Infeasible:
    """Return the error, which names the sample that paths reach."""
    reached = [np.isfinite(value).any() for value in layers.forward(layers.start)]
    if all(reached):
        return Infeasible("no motion through the grid is closed: all that satisfy the limits end in another posture")
    i = len(task.times) - len(reached) + reached.index(False)
    return Infeasible(
        f"no motion through the grid (nodes {spacing:.3g} rad apart) reaches sample {i} of {len(task.times)} "
        f"({task.times[i]:.3g} s) within the limits"
    )
