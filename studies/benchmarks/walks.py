"""Files between a call and its work: ``python -m studies.benchmarks.walks [--json FILE]``.

A walk is the chain of calls from the first function to the last one, at the first time that the last one is called.
Counted are the files of the library on it, and how often it comes back to a file that it had left. Frames of decorators
and of other libraries do not count.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

import paretoik as pk
from paretoik.task.objectives import Objective
from studies.benchmarks.checkouts import ROOT
from studies.reporting import Row, report, study_parser

LIBRARY = ROOT / "paretoik"


def walk(work: Callable[[], Any], first: tuple[str, str], last: tuple[str, str]) -> list[str]:
    """Return the files from the function ``first`` (file, name) to ``last``, equal neighbours once."""

    def is_function(frame: FrameType, function: tuple[str, str]) -> bool:
        return frame.f_code.co_name == function[1] and frame.f_code.co_filename == str(LIBRARY / function[0])

    found = list[str]()

    def observe(frame: FrameType, event: str, _: object) -> None:
        if event != "call" or not is_function(frame, last):
            return
        files, caller = list[str](), frame
        while True:
            file = caller.f_code.co_filename
            if file.startswith(str(LIBRARY)) and files[-1:] != [file]:
                files.append(file)
            if is_function(caller, first) or caller.f_back is None:
                break
            caller = caller.f_back
        if is_function(caller, first):
            sys.setprofile(None)
            found[:] = [Path(file).relative_to(LIBRARY).as_posix() for file in reversed(files)]

    sys.setprofile(observe)
    try:
        work()
    finally:
        sys.setprofile(None)
    assert found, f"{last} was not called from {first}"
    return found


def problem(*objectives: Objective) -> pk.Tracking:
    """Return a new problem: nothing of it is cached."""
    path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=11)
    return pk.Tracking(pk.arms.tringali_3r(), path, objectives=objectives or [pk.kinetic_energy, pk.torque_norm])


def walks(folder: Path) -> list[Row]:
    """Return a row for every walk."""
    front = pk.solve(problem(), population=12, generations=2, seed=1, observe=False)
    plan = pk.plan(problem(pk.kinetic_energy), starts=2, observe=False)
    minimise = ("nlp/minimise.py", "minimise")
    parts: list[tuple[str, Callable[[], Any], tuple[str, str], tuple[str, str], tuple[int, int]]] = [
        (
            "solve to the problem's evaluation",
            lambda: pk.solve(problem(), population=12, generations=2, seed=1, observe=False),
            ("api/solve.py", "solve"), ("formulations/tracking.py", "_evaluate"), (12, 8),
        ),
        (
            "refine to the solver",
            lambda: pk.refine(front, observe=False),
            ("api/refine.py", "refine"), minimise, (14, 10),
        ),
        (
            "epsilon_front to the solver",
            lambda: pk.epsilon_front(problem(), points=3, starts=2, observe=False),
            ("api/epsilon_front.py", "epsilon_front"), minimise, (14, 12),
        ),
        (
            "objective to its compiled derivatives",
            lambda: pk.plan(problem(pk.joint_drift), starts=2, observe=False),
            ("trajectory/transcription.py", "motion_program"), ("autodiff/evaluator.py", "compile_evaluator"), (10, 8),
        ),
        (
            "generation to the recording",
            lambda: pk.solve(problem(), population=12, generations=2, seed=1, out=folder / "run", observe=False),
            ("api/session.py", "record"), ("review/recording/recorder.py", "send"), (8, 4),
        ),
        (
            "export to the file's bytes",
            lambda: pk.export(plan.best.motion, folder / "motion.csv"),
            ("api/export.py", "export"), ("joint_trajectory/formats.py", "csv_bytes"), (10, 8),
        ),
    ]  # fmt: skip
    rows = list[Row]()
    for name, work, first, last, goals in parts:
        files = walk(work, first, last)
        count, note = len(set(files)), ", ".join(dict.fromkeys(files))
        for column, value, goal in zip(("files", "returns"), (count, len(files) - count), goals, strict=True):
            rows.append(Row("walks", name, column, "", value, reference=goal, source="goal", note=note))
            note = ""
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the walks, and write the rows where ``--json`` says."""
    options = study_parser("Files between a call and its work.").parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        report(walks(Path(folder)), json_file=options.json)


if __name__ == "__main__":
    main()
