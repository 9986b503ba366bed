"""Results of ours and peers: best optima, those of one basin, their number, and the grid oracle's bound."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from paretoik.nlp.minimise import minimise
from paretoik.nlp.program import InteriorPointOptions
from paretoik.task.motion_task import MotionTask
from paretoik.task.starts import MOTION_OPTIONS as STARTS
from paretoik.trajectory.grid_oracle import grid_oracle
from paretoik.trajectory.levels import OPTIONS
from paretoik.trajectory.motion_terms import joint_distance
from paretoik.trajectory.plan import Plan
from paretoik.trajectory.transcription import motion_program
from studies.benchmarks.planner.peers import LABELS, PUSHES, Question, Settings, Solved, peer
from studies.benchmarks.planner.verdicts import LOSS, timed
from studies.reporting import Row

BELOW = 1e-7  # relative: largest amount by which a peer's best may be below ours
AGREED = 1e-9  # relative: optima of one basin
TIGHT: Settings = (("mu_init", 1e-8), ("tolerance", 1e-12), *((name, 1e-9) for name in PUSHES))
COUNTED = "simulation_1"


def optima(
    row: str, task: MotionTask, plan: Plan, solves: Mapping[Question, Sequence[Solved]], masses: str
) -> list[Row]:
    """Return the best objectives, the optima of one basin side by side, and their number."""
    rows = []
    program, factors = motion_program(task, np.array([plan.best.objective])), np.ones((1, 1))
    for question, each in solves.items():
        label = LABELS[question.solver]
        ended = distinct(task, [s for s in each if s.solved])
        theirs = [s for s in ended if np.abs(np.diff(s.q, axis=0)).max() <= STARTS.longest_jump]
        if not theirs:
            continue
        below = plan.best.objective / theirs[0].value - 1
        rows.append(
            Row(
                table="best optimum",
                row=row,
                column=f"objective, {label}",
                unit="",
                ours=plan.best.objective,
                reference=theirs[0].value,
                source=label,
                note=(LOSS if below > BELOW else "") + f"relative gap {below:.1e}, goal {BELOW:g}",
            )
        )
        tight = peer(question, TIGHT)
        basins = [optimum.motion.q for optimum in plan.optima] + [s.q for s in theirs]
        gaps = []
        for start in basins:
            end = tight.solve(start, masses)
            again = minimise(program, end.q[None], factors, options=InteriorPointOptions(barrier=1e-6, radius=0.02))
            if end.solved and again.converged[0] and joint_distance(task, end.q, again.x[0]) < OPTIONS.distinct:
                gaps.append(float(again.objectives[0, 0]) * plan.best.objective / end.value - 1)
        worst = max(np.abs(gaps), default=np.inf)
        rows.append(
            Row(
                table="optima of one basin",
                row=row,
                column=f"relative difference, {label}",
                unit="",
                ours=float(worst),
                note=(LOSS if worst > AGREED else "") + f"goal {AGREED:g}; {len(gaps)} of {len(basins)} ended in one",
            )
        )
        is_loss, jumps = len(plan.optima) < len(theirs) and row.startswith(COUNTED), len(ended) - len(theirs)
        left_out = (
            f"{jumps} of theirs left out: a joint jumps by more than {STARTS.longest_jump} rad between samples"
            if jumps
            else ""
        )
        rows.append(
            Row(
                table="distinct optima",
                row=row,
                column=label,
                unit="",
                ours=len(plan.optima),
                reference=len(theirs),
                source=label,
                note=f"{LOSS if is_loss else ''}goal: no fewer; {left_out}" if row.startswith(COUNTED) else left_out,
            )
        )
    return rows


def oracle(row: str, task: MotionTask, plan: Plan) -> Row:
    """Return our best, and the best from the grid oracle's ways."""
    grid, seconds, _ = timed(lambda: grid_oracle(task))
    program = motion_program(task, np.array([plan.best.objective]))
    solutions = minimise(program, grid.q, np.ones((1, 1)), options=OPTIONS.cold[1])
    theirs = float(solutions.objectives[solutions.converged, 0].min(initial=np.inf)) * plan.best.objective
    below = plan.best.objective / theirs - 1
    proven = f"proven within {1 - grid.lower_bound / plan.best.objective:.1%} of the best of all motions"
    return Row(
        table="best optimum",
        row=row,
        column="objective, grid oracle polished",
        unit="",
        ours=plan.best.objective,
        reference=theirs,
        source="grid oracle",
        note=(LOSS if below > BELOW else "")
        + f"relative gap {below:.1e}, goal {BELOW:g}; on the grid {grid.best:.6g}, "
        + (proven if grid.exact else "a source of starts")
        + f"; {seconds:.2g} s",
    )


def distinct(task: MotionTask, solved: Sequence[Solved]) -> list[Solved]:
    """Return one of every optimum, best first, distinguished as ``plan`` does."""
    chosen: list[Solved] = []
    for one in sorted(solved, key=lambda s: s.value):
        if not chosen or joint_distance(task, one.q, np.stack([other.q for other in chosen])).min() > OPTIONS.distinct:
            chosen.append(one)
    return chosen
