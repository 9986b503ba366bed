"""Tests of the exact step: ``python -m studies.benchmarks.closed_loop.exactness [--quick] [--json FILE]``.

It is compared with dense searches by NumPy, on steps of random arms with three or four links, with or without
obstacles. Joints move freely or, as in the default loop, by at most a longest step and clear of obstacles all the way.
A dense search evaluates steps at all distances from the one of least displacement, then finer around the best of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from paretoik import Arm, ClosedLoop, line, obstacles
from paretoik.closed_loop.control_step import HISTORY, StepState
from paretoik.collision.obstacles import Obstacle
from paretoik.errors import Infeasible, InvalidInput
from paretoik.robot.kinematics import forward_kinematics
from studies.marcos_2012.exact_loop import OPTIONS, exact_step
from studies.reporting import Row, goal_row, report, study_parser, tell

WEIGHTS = (1.0, 0.9, 0.5, 0.1, 0.0)  # of the displacement
GOAL = 1e-6
DRAWN = {3: 6000, 4: 30_000}
TINY = 1e-12  # a smaller range is rounding
ZOOMS, KEPT, POINTS = 11, 5, 150  # of a dense search: rounds, steps to search around, steps around each


def exactness_rows(each: int, steps: int) -> list[Row]:
    """Return, per kind of step, the most by which a dense search is better, over ``steps`` of ``each`` arms."""
    rows = []
    for links in (3, 4):
        for longest in (np.inf, 0.1):
            for blocked in (False, True):
                steps_of = [step for seed in range(each) for step in random_steps(links, seed, steps, longest, blocked)]
                tell(f"{links}R, longest step {longest:g}{', obstacles' if blocked else ''}: {len(steps_of)} steps")
                worst = max(advantage(step, k) for k, step in enumerate(steps_of))
                end = ", obstacles" if blocked else ""
                kind = f"{links}R, steps {'of any length' if np.isinf(longest) else 'swept'}{end}"
                place = "the exact step beside dense searches", kind, "a dense search is better by", "of the range"
                rows.append(goal_row(*place, worst, GOAL, f"{len(steps_of)} steps of {each} arms"))
    return rows


def random_steps(links: int, seed: int, count: int, longest: float, blocked: bool) -> Iterator[StepState]:
    """Return random possible steps of a random arm's loop, each from joint positions of its own."""
    rng = np.random.default_rng([links, seed, blocked])
    arm = Arm.planar(lengths=rng.uniform(0.3, 1.5, links))
    while count > 0:
        home = rng.uniform(-2.5, 2.5, links)
        q = home + rng.normal(0.0, 0.3, links)
        tool = forward_kinematics(arm, q)[1][:2]
        target = tool + rng.normal(size=2) * 10 ** rng.uniform(-3.5, -1.0)
        around: list[Obstacle] = [obstacles.Circle(rng.uniform(-1.0, 1.0, 2) * links, 0.2 * links) for _ in range(3)]
        around += [obstacles.Box(rng.uniform(-1.0, 1.0, 2) * links, rng.uniform(0.1, 0.3, 2) * links)]
        path = line(tool, target, duration=1.0, samples=3, timing="uniform")
        try:
            loop = ClosedLoop(arm, path, start=home, longest_step=longest, obstacles=around if blocked else ())
        except InvalidInput:  # an obstacle meets the arm: draw others
            continue
        step = loop.step_state(2, np.tile(q, (HISTORY, 1)))
        if np.linalg.cond(step.linearise()[1]) < 1e4 and step.is_admissible(q[None])[0]:
            yield step
            count -= 1


def advantage(step: StepState, seed: int) -> float:
    """Return by how much a dense search of a step is better than the exact one, in ranges of the exact front.

    This is the most over displacement, error and weighted sums; it is not positive if the search is not better. If no
    step is admissible, none must be found.
    """
    weights = np.array([[weight, 1.0 - weight] for weight in WEIGHTS])
    try:
        exact = np.stack([exact_step(step, weight=weight) for weight in WEIGHTS])
    except Infeasible:
        return np.inf if dense_search(step, weights[:1], seed)[0] < np.inf else -np.inf
    if not step.is_admissible(exact).all():
        return np.inf
    F = objectives(step, exact)
    scaled = weights / np.maximum(np.abs(F[0] - F[-1]), TINY)
    return max(np.einsum("wk,wk->w", F, scaled) - dense_search(step, scaled, seed))


def objectives(step: StepState, q: np.ndarray) -> np.ndarray:
    """Return displacement [rad²] and error [m] (points, 2) of steps: Eqs. 17, without Δt, and 18."""
    offsets = [place.position[0] for place in (*step.task.arm.placements[1:], step.task.arm.tool)]
    tool = np.exp(1j * np.cumsum(q, axis=1)) @ np.array(offsets)
    moved = ((q - step.previous) ** 2 + (q - step.home) ** 2).sum(axis=1)
    return np.stack([moved, np.abs(tool - step.target[0] - 1j * step.target[1])], axis=1)


def dense_search(step: StepState, weights: np.ndarray, seed: int) -> np.ndarray:
    """Return the least weighted sums (of each row of weights) of steps drawn at all distances, then about the best."""
    rng, links = np.random.default_rng(seed), len(step.home)
    error, jacobian = step.linearise()
    null = np.linalg.svd(jacobian)[2][2:].T
    shortest = step.previous + np.linalg.pinv(jacobian) @ error
    center = shortest - 0.5 * null @ null.T @ (shortest - step.home)

    def values(y: np.ndarray) -> np.ndarray:
        q = center + y @ null.T
        admissible = step.is_admissible(q) & (np.abs(y).max(axis=1) <= OPTIONS.farthest)
        return np.where(admissible[:, None], objectives(step, q) @ weights.T, np.inf)

    farthest = min(OPTIONS.farthest, 2.0 * links * float(np.max(step.upper)))
    half = DRAWN[links] // 2
    radius = np.concatenate([[0.0], farthest * 10 ** rng.uniform(-8, 0, half), farthest * rng.uniform(0, 1, half)])
    direction = rng.normal(size=(len(radius), links - 2))
    first = radius[:, None] * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    drawn = values(first)
    best = drawn.min(axis=0)
    for k in range(len(weights)):
        kept, spread = first[np.argsort(drawn[:, k])[:KEPT]], 0.3
        for _ in range(ZOOMS):
            about = rng.normal(size=(KEPT, POINTS, links - 2)) * spread * np.linalg.norm(kept, axis=1)[:, None, None]
            y = np.concatenate([kept, (kept[:, None] + about).reshape(-1, links - 2)])
            errors = values(y)[:, k]
            kept, spread = y[np.argsort(errors)[:KEPT]], 0.4 * spread
            best[k] = min(best[k], errors.min())
    least: np.ndarray = best
    return least


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the comparison from the command line."""
    options = study_parser(__doc__, quick="2 arms of each kind, 3 steps of each").parse_args(arguments)
    report(exactness_rows(2, 3) if options.quick else exactness_rows(40, 7), json_file=options.json)


if __name__ == "__main__":
    main()
