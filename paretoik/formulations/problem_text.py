"""Problems in a few lines of text: what moves along what, for which objectives, and what to do next."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from paretoik.tables import columns, fit_screen
from paretoik.task.summary import objective_text, task_text

if TYPE_CHECKING:  # they write themselves with this
    from paretoik.formulations.closed_loop import ClosedLoop
    from paretoik.formulations.tracking import Tracking


def tracking_text(problem: Tracking) -> str:
    """Return a tracking problem in words."""
    summary = task_text(problem.task)
    return fit_screen(
        f"Tracking, {problem.n_var} genes\n{summary}\nnext: pk.solve(problem) or pk.epsilon_front(problem)"
    )


def problem_text(problem: Any) -> str:
    """Return a formulation in words: its size, objectives and constraints by name, and what to do with it."""
    objectives = map(objective_text, problem.names, problem.units, problem.maximised)
    rows = [("objectives", ", ".join(objectives)), ("constraints", ", ".join(problem.constraint_names) or "none")]
    head = f"{type(problem).__name__}, {problem.n_var} genes"
    return fit_screen("\n".join([head, columns(rows), "next: pk.solve(problem)"]))


def loop_text(loop: ClosedLoop) -> str:
    """Return a closed loop in words; its objectives are those of a step, by weight."""
    weights = ", ".join(f"{name} {weight:.0%}" for name, weight in loop.named_weights.items())
    summary = "\n".join(line for line in task_text(loop.task).splitlines() if not line.startswith("objectives"))
    search = f"{loop.population} individuals, {loop.generations} generations, seed {loop.seed}"
    return fit_screen(f"Closed loop\n{summary}\neach step: {weights}; {search}\nnext: pk.solve(loop)")
