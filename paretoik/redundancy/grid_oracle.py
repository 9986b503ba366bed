"""The grid oracle: all motions over a grid of postures at once, by dynamic programming, where redundancy is one.

The postures that reach a sample lie on a few curves. They are traced and cut into nodes evenly spaced, and the nodes of
consecutive samples are joined wherever no joint goes too far. Where objectives and limits look at positions and
velocities only (backward differences), the best way through is exact on that grid. Where they look at accelerations,
states are pairs of consecutive nodes, on fewer samples: what comes out, led back to all samples, is a source of starts
and bounds nothing.

Source: Bellman 1957 (dynamic programming); Burdick 1989 (self-motion curves).
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import CubicHermiteSpline
from scipy.ndimage import minimum_filter1d
from scipy.spatial import cKDTree

from paretoik.errors import Infeasible, InvalidInput
from paretoik.redundancy.branches import labels
from paretoik.redundancy.self_motion import JUMP, postures, unreachable
from paretoik.task.limits import Constraint, excess
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import series
from paretoik.task.retraction import retract, task_errors

STRIDE = 0.1  # rad or m: how finely curves are traced before they are cut into nodes
SHARPEST = 0.9  # cosine of the turn from one stride to the next
STRIDES = 1200  # of one curve, at most
SEEDS = 48  # postures at either end of the path, carried along it to find the curves of every sample
PACE = 2.5  # times the pace that the path itself asks for: what joints without velocity limit may do
NODES = 12, 500_000  # in the furthest step of a joint, and at most in all
PAIR_NODES = 10, 30_000
COARSEST = 26  # samples, where accelerations count
LARGEST = 40_000_000  # transitions: more don't fit the memory of a small machine
BLOCK = 200_000  # samples evaluated at once
HOLDS = 1e-9  # of limits
APART = 0.15  # rad or m: ways through the grid nearer than this to a better one are not told apart from it
LOOKED_AT = 5  # samples at which different ways are told apart

Series = Callable[[Motion], np.ndarray]


@dataclass(frozen=True, kw_only=True, eq=False)
class GridOracle:
    """What the grid knows: motions ``q``, the best of each class and what is far from them, best on the grid first.

    ``labels`` are those of ``branches``, ``values`` the sums of objectives (minimised), ``violations`` the worst of the
    limits, ``resolution`` [rad, m] the distance of nodes, ``samples`` how many of the motion the grid has.

    Where ``exact``, no way through the grid is better than the first, and ``coarser`` is the best value on every second
    node; otherwise, where accelerations count, it is NaN.
    """

    q: Float[np.ndarray, "paths time dof"]
    values: Float[np.ndarray, " paths"]
    violations: Float[np.ndarray, " paths"]
    labels: tuple[str, ...]
    resolution: float
    samples: int
    exact: bool
    coarser: float

    @property
    def best(self) -> float:
        """What the best way through the grid is worth."""
        return float(self.values[0])

    @property
    def estimate(self) -> float:
        """Where the best value may tend to as nodes move together: an extrapolation, not a bound.

        As if it came nearer in proportion to the resolution, which it does where limits are active; where none is, it
        goes with the square, and this is too low.
        """
        return 2 * self.best - self.coarser


def grid_oracle(
    task: MotionTask,
    *,
    weights: Sequence[float] | None = None,
    resolution: float | None = None,
    classes: int = 8,
    seed: int = 0,
) -> GridOracle:
    """Return the best ways through a grid of all postures, one of each class, for one degree of redundancy.

    Parameters
    ----------
    task
        A motion task with integral objectives and backward differences.
    weights
        Of the objectives' sum, one each; all 1 by default.
    resolution
        The distance [rad, m] between nodes; by default a share of the furthest step of a joint between samples,
        or more where that would make too many nodes.
    classes
        The most motions returned, of every class first: how joints are bent, and how often they turn.
    seed
        Of the first postures; the curves through them hardly depend on it.

    Joints without velocity limit may go at a few times the pace that the path asks for.

    Raises
    ------
    InvalidInput
        Naming redundancy where it is not one, and whatever else is not supported; OutOfReach where the path is.
    Infeasible
        Where there is no way through the grid.
    """
    _check(task, resolution)
    rng = np.random.default_rng(seed)
    seeds, pace = _seeds(task, rng)
    terms = _terms(task, weights, np.stack([q[0] for q in seeds])[None])
    level = task.subsampled(_coarse(len(task.times))) if terms.second else task
    kept = np.searchsorted(task.times, level.times)
    windows = _windows(level, PACE * pace * (len(task.times) - 1) / (len(level.times) - 1))
    curves = _curves(level, [seeds[i] for i in kept])
    spacing = resolution or _spacing(curves, windows, second=terms.second)
    unrolled = np.zeros(task.arm.dof, dtype=bool)
    while True:
        grid = _grid(level, curves, spacing, windows, unrolled, terms)
        layers = (_pairs if terms.second else _singles)(level, grid, terms)
        best, states = _best(layers, level.cyclic)
        if not len(states):
            raise _no_way(level, layers, spacing)
        q = grid.motion(layers.through(states))
        wound = level.cyclic & (np.abs(q[-1] - q[0]) > 1.0)
        if not wound.any():
            break
        unrolled |= wound  # the best cycle ends whole turns away: turns of these joints must be told apart
    sparse = layers.only([rank % 2 == 0 for rank in grid.ranks])
    coarser = np.nan if terms.second else _best(sparse, level.cyclic)[0]
    ways = [states, *_ways(layers, level.cyclic, round(APART / spacing))]
    told = _told(task, level, grid, terms, np.stack([grid.motion(layers.through(way)) for way in ways]), classes)
    if not terms.second and not np.isclose(told["values"][0], best, rtol=1e-6, atol=0):
        raise InvalidInput("grid_oracle: objectives and limits must look at the postures and rates of one sample alone")
    return GridOracle(**told, resolution=spacing, samples=len(level.times), exact=not terms.second, coarser=coarser)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Terms:
    """What is summed and what may not exceed 0 at every sample; ``second`` where one of them looks at accelerations."""

    cost: Series
    postures: list[Series]
    rates: list[Series]
    second: bool

    def of(self, motion: Motion) -> np.ndarray:
        """Return the cost of every sample, infinite where a limit on rates does not hold."""
        held = self.held(motion, self.rates)
        return np.where(held, self.cost(motion) * motion.weights, np.inf)

    def held(self, motion: Motion, limits: list[Series]) -> np.ndarray:
        """Return at which samples limits hold."""
        return np.all([limit(motion) <= HOLDS for limit in limits], axis=0) | np.zeros(motion.q.shape[:-1], dtype=bool)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Grid:
    """Nodes of every sample (nodes, dof) and their ranks on their curves; ``turning`` joints are known modulo 2π."""

    nodes: list[np.ndarray]
    ranks: list[np.ndarray]
    turning: np.ndarray
    windows: np.ndarray

    def step(self, later: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Return the shortest way of every joint between postures."""
        apart = later - before
        return np.where(self.turning, apart - 2 * np.pi * np.round(apart / (2 * np.pi)), apart)

    def edges(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """Return all pairs of nodes of samples i − 1 and i with every joint's step within its window."""
        box = np.where(self.turning, 2 * np.pi / self.windows[i], 0.0)
        places = [np.where(self.turning, q % (2 * np.pi), q) / self.windows[i] for q in self.nodes[i - 1 : i + 1]]
        before, here = (cKDTree(np.where(self.turning & (at >= box), 0.0, at), boxsize=box) for at in places)
        pairs = here.sparse_distance_matrix(before, 1.0, p=np.inf, output_type="ndarray")
        order = np.lexsort((pairs["j"], pairs["i"]))
        return pairs["j"][order], pairs["i"][order]

    def motion(self, nodes: Sequence[int]) -> np.ndarray:
        """Return the motion (time, dof) through nodes, its joints continuous."""
        q = np.stack([there[k] for there, k in zip(self.nodes, nodes, strict=True)])
        return np.cumsum(np.concatenate([q[:1], self.step(q[1:], q[:-1])]), axis=0)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Layers:
    """A layered graph: ``start`` costs, and per step all transitions, sorted by the state that they end in.

    ``offsets`` (states + 1) says which end where, ``sources`` where they begin; ``nodes`` is the node of every state,
    ``before`` the one of the sample before the first layer, where states are pairs.
    """

    start: np.ndarray
    offsets: list[np.ndarray]
    sources: list[np.ndarray]
    costs: list[np.ndarray]
    nodes: list[np.ndarray]
    before: np.ndarray | None = None

    def forward(self, start: np.ndarray) -> list[np.ndarray]:
        """Return the least cost of coming to every state of every layer."""
        found = [start]
        for offsets, sources, costs in zip(self.offsets, self.sources, self.costs, strict=True):
            value, reached = np.full(len(offsets) - 1, np.inf), np.diff(offsets) > 0
            if len(costs):
                value[reached] = np.minimum.reduceat(found[-1][sources] + costs, offsets[:-1][reached])
            found.append(value)
        return found

    def backward(self) -> list[np.ndarray]:
        """Return the least cost of going on from every state of every layer."""
        found = [np.zeros(len(self.nodes[-1]))]
        for step in reversed(range(len(self.costs))):
            value = np.full(len(self.nodes[step]), np.inf)
            onward = np.repeat(found[0], np.diff(self.offsets[step])) + self.costs[step]
            np.minimum.at(value, self.sources[step], onward)
            found.insert(0, value)
        return found

    def way(self, came: list[np.ndarray], onward: list[np.ndarray], layer: int, state: int) -> list[int]:
        """Return the best way through a state, as a state of every layer."""
        states = [state]
        for step in reversed(range(layer)):
            part = slice(*self.offsets[step][states[0] : states[0] + 2])
            sources = self.sources[step][part]
            states.insert(0, int(sources[np.argmin(came[step][sources] + self.costs[step][part])]))
        for step in range(layer, len(self.costs)):
            leaving = np.flatnonzero(self.sources[step] == states[-1])
            ends = np.searchsorted(self.offsets[step], leaving, side="right") - 1
            states.append(int(ends[np.argmin(self.costs[step][leaving] + onward[step + 1][ends])]))
        return states

    def through(self, states: Sequence[int]) -> list[int]:
        """Return the nodes of a way, one a sample."""
        first = [] if self.before is None else [int(self.before[states[0]])]
        return first + [int(nodes[state]) for nodes, state in zip(self.nodes, states, strict=True)]

    def thinned(self, kept: list[np.ndarray], start: np.ndarray) -> _Layers:
        """Return the graph with only the transitions kept, and other costs of the first states."""
        ends = [np.repeat(np.arange(len(o) - 1), np.diff(o))[k] for o, k in zip(self.offsets, kept, strict=True)]
        return replace(
            self,
            start=start,
            offsets=[np.searchsorted(e, np.arange(len(o))) for e, o in zip(ends, self.offsets, strict=True)],
            sources=[s[k] for s, k in zip(self.sources, kept, strict=True)],
            costs=[c[k] for c, k in zip(self.costs, kept, strict=True)],
        )

    def only(self, marked: list[np.ndarray]) -> _Layers:
        """Return the graph over marked nodes (of every sample) only."""
        late = marked[-len(self.nodes) :]
        ends = [np.repeat(m[n], np.diff(o)) for m, n, o in zip(late[1:], self.nodes[1:], self.offsets, strict=True)]
        first = late[0][self.nodes[0]]
        if self.before is not None:
            first = first & marked[0][self.before]
        return self.thinned(ends, np.where(first, self.start, np.inf))


def _best(layers: _Layers, cyclic: bool, among: np.ndarray | None = None) -> tuple[float, list[int]]:
    """Return the least cost and its way, a closed one of a cycle; no way where there is none.

    Cycles by branch and bound over sets of first states: the best way from a set back into it bounds its cycles.
    """
    everywhere = np.arange(len(layers.start)) if among is None else among

    def bounded(first: np.ndarray) -> tuple[float, list[int]]:
        start = np.full(len(layers.start), np.inf)
        start[first] = layers.start[first]
        came = layers.forward(start)
        end = int(first[np.argmin(came[-1][first])] if cyclic else np.argmin(came[-1]))
        value = float(came[-1][end])
        return value, layers.way(came, [], len(came) - 1, end) if np.isfinite(value) else []

    value, states = bounded(everywhere)
    if not cyclic or not states or states[0] == states[-1]:
        return value, states
    worth = min(bounded(np.array([states[k]]))[0] for k in (0, -1))
    if np.isfinite(worth):
        layers = _promising(layers, worth)
    queue, count = [(value, 0, everywhere, states)], 1  # counted: arrays don't compare
    while queue:
        value, _, first, states = heapq.heappop(queue)
        if states[0] == states[-1]:
            return value, states
        ends = np.searchsorted(first, sorted((states[0], states[-1])))
        middle = int(ends.sum() + 1) // 2
        for part in (first[:middle], first[middle:]):
            value, states = bounded(part)
            if states:
                heapq.heappush(queue, (value, count, part, states))
                count += 1
    return np.inf, []


def _promising(layers: _Layers, worth: float) -> _Layers:
    """Return the graph without the transitions that no way at most so expensive takes."""
    came, onward, kept = layers.forward(layers.start), layers.backward(), []
    for step, offsets in enumerate(layers.offsets):
        least = came[step][layers.sources[step]] + layers.costs[step]
        kept.append(least + np.repeat(onward[step + 1], np.diff(offsets)) <= worth * (1 + 1e-9))
    return layers.thinned(kept, layers.start)


def _ways(layers: _Layers, cyclic: bool, nearby: int) -> list[list[int]]:
    """Return ways that are the best through a node and no worse than those through the nodes beside it."""
    came, onward, found = layers.forward(layers.start), layers.backward(), []
    last = len(layers.nodes) - 1
    for layer in [0] if cyclic else np.unique(np.linspace(0, last, LOOKED_AT).astype(int)):
        through, nodes = came[layer] + onward[layer], layers.nodes[layer]
        least = np.full(int(nodes.max()) + 1, np.inf)
        np.minimum.at(least, nodes, through)
        valleys = np.isfinite(least) & (least == minimum_filter1d(least, 2 * nearby + 1))
        for node in np.flatnonzero(valleys):
            states = np.flatnonzero(nodes == node)
            if cyclic:
                found.append(_best(layers, cyclic, states)[1])
            else:
                found.append(layers.way(came, onward, layer, int(states[np.argmin(through[states])])))
    return [way for way in found if way]


def _check(task: MotionTask, resolution: float | None) -> None:
    if task.redundancy != 1:
        raise InvalidInput(f"grid_oracle: redundancy 1 wanted, got {task.redundancy}")
    if task.differences != "backward" or task.stops:
        found = "end_velocity=0" if task.stops else f"{task.differences} differences"
        raise InvalidInput(f"grid_oracle: backward differences and a free end wanted, got {found}")
    if resolution is not None and not resolution > 0:
        raise InvalidInput(f"resolution: a positive distance in rad wanted, got {resolution}")


def _terms(task: MotionTask, weights: Sequence[float] | None, probe: np.ndarray) -> _Terms:
    """Return objectives and limits, sorted by what they look at."""
    shares = [1.0] * len(task.objectives) if weights is None else list(weights)
    if len(shares) != len(task.objectives):
        raise InvalidInput(f"weights: one an objective wanted, {len(task.objectives)} in all, got {len(shares)}")
    for kind, given, form in (("objective", task.objectives, "integral"), ("constraint", task.constraints, "peak")):
        for one in given:
            if one.form != form:
                raise InvalidInput(f"grid_oracle: {kind} {one.name}: form {form!r} wanted, got {one.form!r}")

    def cost(motion: Motion) -> np.ndarray:
        values = [o.sign * series(f"objective {o.name}", o.function, motion, o.form) for o in task.objectives]
        return np.asarray(np.tensordot(shares, values, axes=1))

    def joints(kind: str) -> Series:
        return lambda motion: excess(kind, task.bounds[kind], motion).max(axis=-1)

    def own(c: Constraint) -> Series:
        def over(motion: Motion) -> np.ndarray:
            values = series(f"constraint {c.name}", c.function, motion, c.form)
            return np.maximum(values - c.upper, c.lower - values) / c.scale

        return over

    limits = [joints(kind) for kind in task.bounds] + [own(c) for c in task.constraints]
    if task.obstacles:
        limits.append(lambda motion: task.least_clearance - motion.clearance)
    orders = [_order(task, limit, probe) for limit in limits]
    return _Terms(
        cost=cost,
        postures=[limit for limit, order in zip(limits, orders, strict=True) if order == 0],
        rates=[limit for limit, order in zip(limits, orders, strict=True) if order > 0],
        second=max([_order(task, cost, probe), *orders]) == 2,
    )


def _order(task: MotionTask, term: Series, q: np.ndarray) -> int:
    """Return the highest derivative that a function of motions looks at, by what becomes of it without them."""
    for order, rates in enumerate([(np.nan, np.nan), (0.1, np.nan), (0.1, 0.1)]):
        with np.errstate(all="ignore"):
            if not np.isnan(term(_instants(task, q, *rates))).any():
                return order
    raise InvalidInput("grid_oracle: objectives and limits must be numbers and look no further than accelerations")


def _instants(task: MotionTask, q: np.ndarray, dq: np.ndarray | float, ddq: np.ndarray | float) -> Motion:
    """Return rows (rows, time, dof) of postures with given rates; what comes before and after each is elsewhere."""
    motion = replace(task, cyclic=False).motion(q)
    rates = {"dq": dq, "ddq": ddq, "jerk": np.nan}  # these stand in for what Motion would find from the row itself
    vars(motion).update({name: np.broadcast_to(values, q.shape) for name, values in rates.items()})
    return motion


def _priced(
    task: MotionTask, term: Series, counts: Sequence[int], at: Callable[[int, np.ndarray], tuple[np.ndarray, ...]]
) -> list[np.ndarray]:
    """Return ``term`` of so many instants of every sample; ``at`` gives some of a sample's: (q, dq, ddq)."""
    if sum(counts) > LARGEST:
        raise InvalidInput(
            f"resolution: at most {LARGEST:.3g} transitions wanted, got {sum(counts):.3g}: make it coarser"
        )
    found = [np.empty(count) for count in counts]
    rows, most = max(1, BLOCK // len(counts)), max(counts)
    for first in range(0, most, rows):
        picks = [np.minimum(np.arange(first, min(first + rows, most)), max(count - 1, 0)) for count in counts]
        parts = [at(i, pick) for i, pick in enumerate(picks)]
        values = term(_instants(task, *(np.stack(part, axis=1) for part in zip(*parts, strict=True))))
        for i, count in enumerate(counts):
            found[i][first : first + rows] = values[: max(count - first, 0), i]
    return found


def _singles(task: MotionTask, grid: _Grid, terms: _Terms) -> _Layers:
    """Return the graph whose states are nodes."""
    nodes, steps = grid.nodes, np.diff(task.times, prepend=np.nan)
    pairs = [(np.zeros(0, dtype=int),) * 2] + [grid.edges(i) for i in range(1, len(nodes))]

    def at(i: int, pick: np.ndarray) -> tuple[np.ndarray, ...]:
        sources, ends = (side[pick] if len(side) else np.zeros_like(pick) for side in pairs[i])
        q = nodes[i][ends]
        dq = grid.step(q, nodes[i - 1][sources]) / steps[i] if i else np.zeros_like(q)
        return q, dq, np.zeros_like(q)

    costs = _priced(task, terms.of, [len(sources) for sources, _ in pairs], at)
    layers = _Layers(
        start=np.zeros(len(nodes[0])),
        offsets=[
            np.searchsorted(ends, np.arange(len(q) + 1)) for (_, ends), q in zip(pairs[1:], nodes[1:], strict=True)
        ],
        sources=[sources for sources, _ in pairs[1:]],
        costs=costs[1:],
        nodes=[np.arange(len(q)) for q in nodes],
    )
    return layers.thinned([np.isfinite(cost) for cost in layers.costs], layers.start)


def _pairs(task: MotionTask, grid: _Grid, terms: _Terms) -> _Layers:
    """Return the graph whose states are pairs of consecutive nodes; speeds change by half their range in a step."""
    nodes, steps, first = grid.nodes, np.diff(task.times, prepend=np.nan), 0 if task.cyclic else 1
    pairs = [grid.edges(i) for i in range(1, len(nodes))]
    dq = [grid.step(nodes[i + 1][b], nodes[i][a]) / steps[i + 1] for i, (a, b) in enumerate(pairs)]
    pairs.insert(0, pairs[-1] if task.cyclic else pairs[0])
    dq.insert(0, dq[-1] if task.cyclic else np.zeros_like(dq[0]))
    joined = [(np.zeros(0, dtype=int),) * 2]
    for i in range(1, len(nodes)):
        sources, ends = _joined(pairs[i - 1][1], pairs[i][0]) if i > first else (np.arange(len(dq[1])),) * 2
        near = np.abs(dq[i][ends] - dq[i - 1][sources]) * steps[i] <= grid.windows[i] / 2
        joined.append((sources[near.all(axis=1)], ends[near.all(axis=1)]) if i > first else (sources, ends))

    def at(i: int, pick: np.ndarray) -> tuple[np.ndarray, ...]:
        sources, ends = joined[i]
        if not len(ends):
            return nodes[i][np.zeros_like(pick)], *(np.zeros((len(pick), task.arm.dof)),) * 2
        here = dq[i][ends[pick]]
        return nodes[i][pairs[i][1][ends[pick]]], here, (here - dq[i - 1][sources[pick]]) / steps[i]

    costs = _priced(task, terms.of, [len(sources) for sources, _ in joined], at)
    layers = _Layers(
        start=np.zeros(len(dq[0])) if task.cyclic else costs[1],
        offsets=[np.searchsorted(joined[i][1], np.arange(len(dq[i]) + 1)) for i in range(1 + first, len(nodes))],
        sources=[sources for sources, _ in joined[1 + first :]],
        costs=costs[1 + first :],
        nodes=[ends for _, ends in pairs[first:]],
        before=None if task.cyclic else pairs[1][0],
    )
    return layers.thinned([np.isfinite(cost) for cost in layers.costs], layers.start)


def _joined(ends_before: np.ndarray, begins: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return all (first, second) pairs of which the second begins where the first, sorted by their ends, ends."""
    low, high = (np.searchsorted(ends_before, begins, side=side) for side in ("left", "right"))
    ends = np.repeat(np.arange(len(begins)), high - low)
    return np.arange(len(ends)) - np.repeat(np.cumsum(high - low) - high, high - low), ends


def _coarse(samples: int) -> int:
    while (samples - 1) // 2 + 1 >= COARSEST:
        samples = (samples - 1) // 2 + 1
    return samples


def _windows(task: MotionTask, pace: float) -> Float[np.ndarray, "time dof"]:
    """Return how far each joint may go to each sample."""
    limits = np.abs(task.bounds.get("velocity", np.full((1, task.arm.dof, 2), np.inf))).max(axis=-1)
    steps = np.diff(task.times)[:, None]
    steps = np.concatenate([steps[:1], steps])
    return np.minimum(limits * steps * (1 + HOLDS), pace)


def _seeds(task: MotionTask, rng: np.random.Generator) -> tuple[list[np.ndarray], float]:
    """Return postures of every sample on all curves that are connected to either end, and the path's pace.

    What comes into being halfway along the path is near nothing that could lead to it.
    """
    found: list[list[np.ndarray]] = [[] for _ in task.times]
    pace = [0.0]
    for way in (range(len(task.times)), reversed(range(len(task.times)))):
        q = np.empty((0, task.arm.dof))
        for i in way:
            led = retract(task.arm, task.tasks, q, *_aim(task, np.full(len(q), i), q)[1:])
            moved = np.abs(led.q - q).max(axis=1)
            on_path = led.on_path & (moved <= JUMP)
            q = led.q[on_path] if on_path.any() else postures(task, SEEDS, rng, sample=i)
            if not len(q):
                raise unreachable(task, rng, i)
            pace.append(float(np.median(moved[on_path])) if on_path.any() else 0.0)
            found[i].append(q)
    return [np.concatenate(parts) for parts in found], max(pace)


def _aim(task: MotionTask, samples: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the direction of self-motion at postures, the targets of their samples and the ways that lead to them."""
    targets = task.targets[samples]
    slopes = task_errors(task.arm, task.tasks, q, targets)[1]
    across, upper = np.linalg.qr(np.moveaxis(slopes, -1, 0).swapaxes(-1, -2), mode="complete")
    signs = np.where(np.diagonal(upper, axis1=-2, axis2=-1) < 0, -1.0, 1.0)
    return across[..., -1], targets, across[..., : task.rows] * signs[:, None, :]


def _curves(task: MotionTask, seeds: list[np.ndarray]) -> list[list[tuple[np.ndarray, np.ndarray]]]:
    """Return the self-motion curves of every sample, as strides (q, directions), until no seed is off all of them."""
    found: list[list[tuple[np.ndarray, np.ndarray]]] = [[] for _ in seeds]
    left = list(seeds)
    while rows := [i for i, q in enumerate(left) if len(q)]:
        traced = _traced(task, np.array(rows), np.stack([left[i][0] for i in rows]))
        for i, (q, directions) in zip(rows, traced, strict=True):
            found[i].append((q, directions))
            apart = _wrapped(task, left[i][:, None] - q)
            left[i] = left[i][np.linalg.norm(apart, axis=2).min(axis=1) > 0.75 * STRIDE]
    return found


def _traced(task: MotionTask, samples: np.ndarray, begin: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return one curve through each posture, by predictor and corrector, until it closes, stops or is too long."""
    q, (heading, targets, steep) = begin.copy(), _aim(task, samples, begin)
    first, stride, going, count = heading.copy(), np.full(len(q), STRIDE), np.arange(len(q)), np.zeros(len(q))
    strides = [(going, q.copy(), heading.copy())]
    for _ in range(STRIDES):
        reach = stride[going]
        trial = retract(task.arm, task.tasks, q[going] + reach[:, None] * heading[going], targets[going], steep[going])
        ahead, _, across = _aim(task, samples[going], trial.q)
        turn = np.sum(ahead * heading[going], axis=1)
        good = trial.on_path & (np.abs(turn) > SHARPEST)
        moved = going[good]
        q[moved], steep[moved], heading[moved] = trial.q[good], across[good], (ahead * np.sign(turn)[:, None])[good]
        count[moved] += 1
        back = _wrapped(task, begin[going] - q[going])
        closed = good & (np.linalg.norm(back, axis=1) < 0.6 * reach) & (count[going] > 3)
        closed &= np.sum(heading[going] * first[going], axis=1) > SHARPEST
        q[going[closed]] += back[closed]
        strides.append((moved, q[moved], heading[moved]))
        stride[going] = np.where(good, np.minimum(1.5 * reach, STRIDE), reach / 2)
        going = going[~closed & (stride[going] > 1e-4)]
        if not len(going):
            break
    rows, places, directions = (np.concatenate(parts) for parts in zip(*strides, strict=True))
    return [(places[rows == k], directions[rows == k]) for k in range(len(q))]


def _spacing(curves: list[list[tuple[np.ndarray, np.ndarray]]], windows: np.ndarray, *, second: bool) -> float:
    """Return the distance of nodes that tells enough speeds apart, or keeps the nodes few enough."""
    length = sum(np.linalg.norm(np.diff(q, axis=0), axis=1).sum() for here in curves for q, _ in here)
    shares, most = PAIR_NODES if second else NODES
    return float(max(windows[1:].max() / shares, length / most))


def _wrapped(task: MotionTask, apart: np.ndarray) -> np.ndarray:
    return np.where(task.arm.periodic, apart - 2 * np.pi * np.round(apart / (2 * np.pi)), apart)


def _grid(
    task: MotionTask,
    curves: list[list[tuple[np.ndarray, np.ndarray]]],
    spacing: float,
    windows: np.ndarray,
    unrolled: Bool[np.ndarray, " dof"],
    terms: _Terms,
) -> _Grid:
    """Return the nodes of every sample that keep the limits on postures."""
    cut = [[_cut(*curve, spacing) for curve in here] for here in curves]
    samples = np.repeat(np.arange(len(cut)), [sum(map(len, here)) for here in cut])
    q = np.concatenate([q for here in cut for q in here])
    rank = np.concatenate([np.arange(len(q)) for here in cut for q in here])
    led = retract(task.arm, task.tasks, q, *_aim(task, samples, q)[1:])
    ranges = _ranges(task, unrolled)
    nodes, ranks = [], []
    for i in range(len(cut)):
        mine = led.on_path & (samples == i)
        there, which = _lifted(led.q[mine], ranges, task.arm.periodic)
        nodes.append(there)
        ranks.append(rank[mine][which])
    if task.start is not None:
        nodes[0], ranks[0] = task.start[None], np.array([0])
    if task.cyclic:
        nodes[-1], ranks[-1] = nodes[0], ranks[0]

    def held(motion: Motion) -> np.ndarray:
        found = terms.held(motion, terms.postures)
        if not task.cyclic:
            found[:, 0] &= terms.held(motion, terms.rates)[:, 0]  # a motion begins at rest
        return found

    def at(i: int, pick: np.ndarray) -> tuple[np.ndarray, ...]:
        here = nodes[i][pick] if len(nodes[i]) else np.zeros((len(pick), task.arm.dof))
        return here, np.zeros_like(here), np.zeros_like(here)

    kept = [there > 0 for there in _priced(task, held, [len(there) for there in nodes], at)]
    if task.cyclic:
        kept[0] = kept[-1] = kept[0] & kept[-1]
    for i, k in enumerate(kept):
        if not k.any():
            raise Infeasible(f"no posture keeps the limits at sample {i} of {len(kept)} ({task.times[i]:.3g} s)")
    return _Grid(
        nodes=[there[k] for there, k in zip(nodes, kept, strict=True)],
        ranks=[rank[k] for rank, k in zip(ranks, kept, strict=True)],
        turning=task.arm.periodic & np.isnan(ranges[:, 0]),
        windows=windows,
    )


def _cut(q: np.ndarray, directions: np.ndarray, spacing: float) -> np.ndarray:
    """Return points evenly spaced along a curve given by strides."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
    apart = np.append(np.diff(s) > 1e-9, True)
    if apart.sum() < 2:
        return q[:1]
    places = np.linspace(0, s[-1], int(np.ceil(s[-1] / spacing)), endpoint=False)
    return np.asarray(CubicHermiteSpline(s[apart], q[apart], directions[apart])(places))


def _ranges(task: MotionTask, unrolled: np.ndarray) -> Float[np.ndarray, "dof 2"]:
    """Return where the turns of joints are told apart: within their limits; NaN for joints known modulo 2π."""
    ranges = task.arm.position_limits.copy()
    lower, upper = ranges.T
    ranges[np.isinf(lower) & np.isinf(upper)] = np.nan
    ranges[np.isinf(lower) & np.isfinite(upper), 0] = upper[np.isinf(lower) & np.isfinite(upper)] - 4 * np.pi
    ranges[np.isinf(upper) & np.isfinite(lower), 1] = lower[np.isinf(upper) & np.isfinite(lower)] + 4 * np.pi
    ranges[unrolled] = -2 * np.pi, 2 * np.pi
    return ranges


def _lifted(q: np.ndarray, ranges: np.ndarray, periodic: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes at all the turns that their joints' ranges hold, and which node each of them is."""
    which = np.arange(len(q))
    for j in np.flatnonzero(periodic):
        lower, upper = (-np.pi, np.pi) if np.isnan(ranges[j, 0]) else ranges[j]
        turns = 2 * np.pi * np.arange((upper - lower) // (2 * np.pi) + 1)
        place = (lower + (q[:, j] - lower) % (2 * np.pi) + turns[:, None]).ravel()
        q, which = np.tile(q, (len(turns), 1)), np.tile(which, len(turns))
        q[:, j] = place
        q, which = q[place <= upper], which[place <= upper]
    return q, which


def _told(
    task: MotionTask, level: MotionTask, grid: _Grid, terms: _Terms, ways: np.ndarray, classes: int
) -> dict[str, Any]:
    """Return the best motion of every class, by what it is worth on the grid, and what is far from them."""
    if task.cyclic:
        ways = ways[np.abs(ways[:, -1] - ways[:, 0]).max(axis=1) < 1e-6]
    motions = level.motion(ways)
    cost, kinds = motions.integral(terms.cost(motions)), labels(motions)
    change = ways[:, -1] - ways[:, 0]
    turns = np.round((change - grid.step(ways[:, -1], ways[:, 0])) / (2 * np.pi)).astype(int)
    found: dict[int, np.ndarray] = {}
    for far in (False, True):  # classes first: none is left out for what is only far
        for k in np.argsort(cost, kind="stable"):
            kept = list(found)
            known = any(kinds[k] == kinds[j] and (turns[k] == turns[j]).all() for j in kept)
            apart = np.sqrt(np.mean(np.sum(grid.step(ways[k], ways[kept]) ** 2, axis=-1), axis=-1)).min(initial=np.inf)
            q = _resampled(task, motions[k]) if len(kept) < classes and (apart > APART if far else not known) else None
            if q is not None:
                found[int(k)] = q
    kept = sorted(found, key=lambda k: cost[k])
    if not kept:
        raise Infeasible(f"every way through the grid of {len(level.times)} samples leaves the path between them")
    final = task.motion(np.stack([found[k] for k in kept]))
    return {
        "q": final.q,
        "values": final.integral(terms.cost(final)),
        "violations": task.violations(final).max(axis=1, initial=0.0),
        "labels": tuple(kinds[k] for k in kept),
    }


def _resampled(task: MotionTask, motion: Motion) -> np.ndarray | None:
    """Return a motion on all samples, None where it leaves the path between its own."""
    if len(motion.time) == len(task.times):
        return motion.q
    try:
        q = motion.at(task.times)
    except Infeasible:
        return None
    if task.start is not None:
        q[0] = task.start
    return q


def _no_way(task: MotionTask, layers: _Layers, spacing: float) -> Infeasible:
    """Return the error that says how far ways through the grid come."""
    came = [np.isfinite(value).any() for value in layers.forward(layers.start)]
    if all(came):
        return Infeasible("no way through the grid is closed: every one that keeps the limits ends in another posture")
    i = len(task.times) - len(came) + came.index(False)
    return Infeasible(
        f"no way through the grid, its nodes {spacing:.3g} rad apart, comes to sample {i} of {len(task.times)} "
        f"({task.times[i]:.3g} s) within the limits"
    )
