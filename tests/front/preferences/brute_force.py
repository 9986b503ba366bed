"""Preferences by plain loops over the points of a front, written only from their definitions."""

from __future__ import annotations

from itertools import product

from paretoik.front.front import Front

EPSILON = 1e-9  # scores that differ by less are equal


def shares(front: Front) -> list[list[float]]:
    """Return Z = (f − ideal)/(nadir − ideal) of every point, on the stored ranges."""
    return [
        [
            0.0 if low == high else ((high - f) if worse else (f - low)) / (high - low)
            for f, (low, high), worse in zip(point, front.ranges.tolist(), front.maximised, strict=True)
        ]
        for point in front.objectives.tolist()
    ]


def share(front: Front, axis: int, value: float) -> float:
    """Return a value of an objective as a share of its range."""
    low, high = front.ranges[axis].tolist()
    return 0.0 if low == high else ((high - value) if front.maximised[axis] else (value - low)) / (high - low)


def first(front: Front, scores: list[float], among: list[int] | None = None) -> int:
    """Return the id with the least score; ties go to the lowest ΣZ, the best f1, f2, ..., the lowest id."""
    Z, rows = shares(front), list(range(len(front))) if among is None else list(among)
    least = min(scores[row] for row in rows)
    rows = [row for row in rows if scores[row] <= least + EPSILON]
    least = min(sum(Z[row]) for row in rows)
    rows = [row for row in rows if sum(Z[row]) <= least + EPSILON]
    signs = [-1.0 if flag else 1.0 for flag in front.maximised]

    def key(row: int) -> tuple[float, ...]:
        return (*(s * f for s, f in zip(signs, front.objectives[row].tolist(), strict=True)), float(front.ids[row]))

    return int(front.ids[min(rows, key=key)])


def dot(weights: list[float], point: list[float]) -> float:
    return sum(w * z for w, z in zip(weights, point, strict=True))


def weighted(front: Front, weights: list[float]) -> int:
    return first(front, [dot(weights, point) / sum(weights) for point in shares(front)])


def compromise(front: Front) -> int:
    return first(front, [max(point) + 1e-4 * sum(point) for point in shares(front)])


def aspiration(front: Front, wishes: dict[str, float]) -> int:
    wish = {front.names.index(name): value for name, value in wishes.items()}
    scores = []
    for point in shares(front):
        excess = [point[axis] - share(front, axis, value) for axis, value in wish.items()]
        scores.append(max(excess) + 1e-4 * (sum(excess) + sum(z for axis, z in enumerate(point) if axis not in wish)))
    return first(front, scores)


def lexicographic(front: Front, order: list[str], tolerances: dict[str, float]) -> int:
    """Return the lexicographic choice; tolerances are shares of the ranges."""
    Z, rows = shares(front), list(range(len(front)))
    for name in order:
        axis = front.names.index(name)
        best = min(Z[row][axis] for row in rows)
        rows = [row for row in rows if Z[row][axis] <= best + tolerances.get(name, 0.0) + EPSILON]
    return first(front, [0.0] * len(front), rows)


def robust(front: Front, weights: list[float], uncertainty: float) -> int:
    """Return the least largest regret over all vertices of the box of weights."""
    Z = shares(front)
    worst = [0.0] * len(Z)
    for signs in product((1 - uncertainty, 1 + uncertainty), repeat=len(weights)):
        vertex = [s * w / sum(weights) for s, w in zip(signs, weights, strict=True)]
        sums = [dot(vertex, point) for point in Z]
        worst = [max(before, one - min(sums)) for before, one in zip(worst, sums, strict=True)]
    return first(front, worst)


def knee(front: Front) -> int | None:
    """Return the id of the knee of a front of at least two objectives, or None."""
    Z = shares(front)
    ideal = [min(column) for column in zip(*Z, strict=True)]
    best = [row for row, p in enumerate(Z) if all(z <= z0 + EPSILON for z, z0 in zip(p, ideal, strict=True))]
    if best:
        return first(front, [0.0] * len(Z), best)
    if len(front.names) == 2:
        ends = [Z[front.ids.tolist().index(first(front, [point[axis] for point in Z]))] for axis in range(2)]
        (a, b), (c, d) = ends
        below = [((b - d) * (a - x) + (c - a) * (b - y)) / ((c - a) * (b - d)) for x, y in Z]
        return first(front, [-depth for depth in below]) if max(below) > EPSILON else None
    ratios = []
    for p in Z:
        exchanges = []
        for q in Z:
            steps = [v - u if abs(v - u) > EPSILON else 0.0 for u, v in zip(p, q, strict=True)]
            cost, gain = sum(s for s in steps if s > 0), -sum(s for s in steps if s < 0)
            exchanges += [cost / gain] if gain > 0 else []
        ratios.append(min(exchanges))
    return first(front, [-ratio for ratio in ratios])


def classified(front: Front, start: int, classes: dict[str, str], values: dict[str, float]) -> int:
    """Return the best point in the classes by name: improve, improve_to, keep, relax_to, free."""
    Z = shares(front)
    now, wanted, rows = Z[front.ids.tolist().index(start)], [], []
    for row, point in enumerate(Z):
        allowed, goal = True, []
        for axis, name in enumerate(front.names):
            match classes[name]:
                case "improve":
                    goal.append(point[axis])
                case "improve_to":
                    goal.append(point[axis] - share(front, axis, values[name]))
            limit = {"free": float("inf"), "relax_to": share(front, axis, values.get(name, 0.0))}
            allowed &= point[axis] <= limit.get(classes[name], now[axis]) + EPSILON
        wanted.append(max(goal) + 1e-4 * sum(point))
        rows += [row] if allowed else []
    return first(front, wanted, rows)
