"""One solve over growing numbers of samples: from the same start, to the same tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import InteriorPointOptions
from paretoik.trajectory.plan_starts import initial_motions
from paretoik.trajectory.transcription import motion_program
from studies.benchmarks.planner.peers import TOLERANCE, Question, peer, task_of
from studies.benchmarks.planner.verdicts import timed, versus
from studies.reporting import Row, tell

COUNTS = (51, 101, 201, 401)
TABLE = "growth"
RULES = InteriorPointOptions(tolerance=TOLERANCE)
NEAR_LINEAR = 1.15  # exponent of the seconds per iteration


def growth(problems: Sequence[str], *, seed: int, repeats: int, samples: Sequence[int] = COUNTS) -> list[Row]:
    """Return seconds and iterations at all sample counts, and the exponents of their growth."""
    return [row for name in problems for row in _one(name, seed=seed, repeats=repeats, samples=samples)]


def _one(name: str, *, seed: int, repeats: int, samples: Sequence[int]) -> list[Row]:
    whole = task_of(name, "printed", max(samples))
    starts = initial_motions(whole, starts=6, seed=seed)
    coarse = whole.subsample(starts.shape[1])
    seconds, iterations = list[np.ndarray](), list[tuple[int, int]]()
    rows = []
    chosen = 0
    for count in samples:
        tell(f"growth: {name}, {count} samples")
        task = task_of(name, "printed", count)
        q = np.asarray(coarse.motion(starts).at(task.times))
        program = motion_program(task, np.array([float(task.objectives[0](task.motion(q[0])))]))
        theirs = peer(Question(solver="fatrop", problem=name, samples=count))
        if not seconds:
            both = [
                minimise(program, one[None], np.ones((1, 1))).converged[0] and theirs.solve(one).solved for one in q
            ]
            assert any(both), f"{name} must have a start that leads both to an optimum"
            chosen = both.index(True)
        start = q[chosen]
        seconds_taken = []
        for _ in range(repeats):
            solutions, ours, _ = timed(partial(minimise, program, start[None], np.ones((1, 1)), options=RULES))
            other = theirs.solve(start)
            seconds_taken.append((ours, other.seconds))
        seconds.append(np.median(seconds_taken, axis=0))
        iterations.append((int(solutions.iterations[0]), other.iterations))
        ended = "" if solutions.converged[0] and other.solved else "; NOT converged"
        rows.append(
            versus(
                table=TABLE,
                row=name,
                column=f"{count} samples, FATROP",
                unit="s",
                ours=float(seconds[-1][0]),
                theirs=float(seconds[-1][1]),
                source="FATROP",
                note=f"iterations {iterations[-1][0]} and {iterations[-1][1]}{ended}",
            )
        )
    for what, values, goal in (
        ("exponent of the seconds", np.array(seconds), None),
        ("exponent of an iteration's seconds", np.array(seconds) / np.array(iterations), NEAR_LINEAR),
    ):
        slopes = np.polyfit(np.log(samples), np.log(values), 1)[0]
        is_loss = goal is not None and slopes[0] > goal
        goal_note = "" if goal is None else f"{'LOSS: ' if is_loss else ''}goal {goal:g}"
        rows.append(
            Row(
                table=TABLE,
                row=name,
                column=what,
                unit="",
                ours=float(slopes[0]),
                reference=float(slopes[1]),
                source="FATROP",
                note=goal_note,
            )
        )
    return rows
