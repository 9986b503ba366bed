"""A control step's search and its peers: ``python -m studies.benchmarks.closed_loop [--quick] [--json FILE]``.

Processor time per generation, kinematics included: ours, pymoo with the same operators, pymoo with a compiled
evaluation, and pygmo's NSGA-II (its own operators) with the same compiled evaluation of whole populations. All run on
one step, one after the other. Rows have medians over several rounds: of the times, and of the ratios within a round,
which a busy machine changes less. Further rows: the time of an
exact step, and whether our fronts equal those of the readable path in pymoo.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from problems.marcos_2012 import Links
from studies.benchmarks.closed_loop.contestants import (
    GENERATIONS,
    PYGMO,
    STEPS,
    engine,
    equivalence_rows,
    loop_of,
    pygmo_nsga2,
    pymoo,
    seconds,
)
from studies.marcos_2012.exact_loop import exact_steps
from studies.reporting import Row, report, study_parser

ARMS: tuple[Links, ...] = (3, 4)
EXACT, GOAL_EXACT = 100, 1e-4  # samples of a loop, and seconds a step
GOALS = {"pymoo": 300.0, "pygmo's NSGA-II": 50.0}


def speed_rows(links: Links, rounds: int, slow_generations: int) -> list[Row]:
    """Return microseconds per generation of all methods on the first step of an arm, each compared with ours."""
    loop = loop_of(links)
    step = loop.step_state(1)
    contestants: dict[str, tuple[Callable[[int, int], np.ndarray], int, int]] = {  # generations, searches a round
        "ours": (engine(loop, step), GENERATIONS, 10),
        "pymoo": (pymoo(loop, step, compiled=False), slow_generations, 1),
        "pymoo, compiled evaluation": (pymoo(loop, step, compiled=True), slow_generations, 1),
    }
    if PYGMO:
        contestants["pygmo's NSGA-II"] = pygmo_nsga2(loop, step), GENERATIONS, 1
    for run, *_ in contestants.values():
        run(0, 2)
    taken = np.array([[seconds(*each, seed) for each in contestants.values()] for seed in range(rounds)])
    rows = []
    for name, each in zip(contestants, taken.T, strict=True):
        ratios, goal = each / taken[:, 0], GOALS.get(name)
        ratio = float(np.median(ratios))
        prefix = "LOSS: " if goal is not None and ratio < goal else ""
        times = f"{prefix}{ratio:.0f} times ours" + (f", goal {goal:.0f}" if goal else "")
        note = "" if name == "ours" else f"{times}; in rounds {ratios.min():.0f} to {ratios.max():.0f}"
        row = f"{links}R, population {loop.population}"
        rows.append(Row("a generation, processor time", row, name, "µs", 1e6 * float(np.median(each)), note=note))
    return rows


def exact_rows(rounds: int) -> list[Row]:
    """Return the time of an exact step, without obstacles and with the paper's two, over the first steps of a loop."""
    rows = []
    for links in ARMS:
        for blocked in (False, True):
            loop = loop_of(links, blocked=blocked)
            follow = partial(exact_steps, loop.task.truncate(EXACT), loop.start, weight=0.5)
            follow()
            seconds_taken = []
            for _ in range(rounds):
                started = time.thread_time()
                follow()
                seconds_taken.append((time.thread_time() - started) / (EXACT - 1))
            goal = GOAL_EXACT if links == 3 and not blocked else None
            prefix = "LOSS" if goal is not None and min(seconds_taken) > goal else ""
            rows.append(
                Row(
                    "an exact step, processor time",
                    f"{links}R",
                    "with two obstacles" if blocked else "no obstacles",
                    "µs",
                    1e6 * min(seconds_taken),
                    reference=None if goal is None else 1e6 * goal,
                    source="goal",
                    note=prefix,
                )
            )
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark from the command line."""
    options = study_parser(__doc__, quick="3 rounds, 5 seeds on one step").parse_args(arguments)
    if not PYGMO:
        print("left out: pygmo, which is not installed")
    rounds, slow = (3, 20) if options.quick else (9, 60)
    rows = [row for links in ARMS for row in speed_rows(links, rounds, slow)]
    rows += exact_rows(rounds)
    rows += equivalence_rows(5, STEPS[:1]) if options.quick else equivalence_rows(31)
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
