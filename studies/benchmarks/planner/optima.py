"""Results of ours and peers: best optima, those of one basin, their number, and the grid oracle's bound."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from paretoik.nlp.minimise import minimise
from paretoik.task.motion_task import MotionTask
from paretoik.task.random_starts import MOTION_OPTIONS as STARTS
from paretoik.trajectory.grid_oracle import grid_oracle
from paretoik.trajectory.levels import OPTIONS
from paretoik.trajectory.motion_terms import joint_distance
from paretoik.trajectory.plan import Plan
from paretoik.trajectory.transcription import motion_program
from studies.benchmarks.peers.solvers import LABELS, Solved
from studies.benchmarks.planner.questions import Question
from studies.reporting import LOSS, Row, timed

BELOW = 1e-7  # relative: largest amount by which a peer's best may be below ours
COUNTED = "simulation_1"


def optima(row: str, task: MotionTask, plan: Plan, solves: Mapping[Question, Sequence[Solved]]) -> list[Row]:
    """Return the best objectives, and the number of distinct optima."""
    rows = []
    for question, each in solves.items():
        label = LABELS[question.solver]
        ended = distinct(task, [s for s in each if s.solved])
        theirs = [s for s in ended if np.abs(np.diff(s.q, axis=0)).max() <= STARTS.longest_jump]
        if not theirs:
            continue
        ours, best = plan.best.objective, theirs[0].value
        note = f"{LOSS if ours / best - 1 > BELOW else ''}relative gap {ours / best - 1:.1e}, goal {BELOW:g}"
        rows.append(Row("best optimum", row, f"objective, {label}", "", ours, reference=best, source=label, note=note))
        is_counted, jumps = row.startswith(COUNTED), len(ended) - len(theirs)
        note = f"{LOSS if len(plan.optima) < len(theirs) else ''}goal: no fewer; " if is_counted else ""
        if jumps:
            note += f"{jumps} of theirs left out: a joint jumps by more than {STARTS.longest_jump} rad between samples"
        optima, others = len(plan.optima), len(theirs)
        rows.append(Row("distinct optima", row, label, "", optima, reference=others, source=label, note=note))
    return rows


def oracle(row: str, task: MotionTask, plan: Plan) -> Row:
    """Return our best, and the best from the grid oracle's ways."""
    grid, seconds, _ = timed(lambda: grid_oracle(task))
    program = motion_program(task, np.array([plan.best.objective]))
    solutions = minimise(program, grid.q, np.ones((1, 1)), options=OPTIONS.cold[1])
    theirs = float(solutions.objectives[solutions.converged, 0].min(initial=np.inf)) * plan.best.objective
    below = plan.best.objective / theirs - 1
    proven = f"proven within {1 - grid.lower_bound / plan.best.objective:.1%} of the best of all motions"
    note = (
        (LOSS if below > BELOW else "")
        + f"relative gap {below:.1e}, goal {BELOW:g}; on the grid {grid.best:.6g}, "
        + (proven if grid.exact else "a source of starts")
        + f"; {seconds:.2g} s"
    )
    column = "objective, grid oracle polished"
    return Row("best optimum", row, column, "", plan.best.objective, reference=theirs, source="grid oracle", note=note)


def distinct(task: MotionTask, solved: Sequence[Solved]) -> list[Solved]:
    """Return one of every optimum, best first, distinguished as ``plan`` does."""
    chosen: list[Solved] = []
    for one in sorted(solved, key=lambda s: s.value):
        if not chosen or joint_distance(task, one.q, np.stack([other.q for other in chosen])).min() > OPTIONS.distinct:
            chosen.append(one)
    return chosen
