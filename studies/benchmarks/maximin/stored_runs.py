"""Runs stored in a folder, so that hours of them can be stopped and resumed: one file per problem, method and seed."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

import numpy as np
import pymoo

import paretoik.search
from paretoik.front.storage import array_bytes
from paretoik.runs.file_replacement import replace_file
from studies.benchmarks.maximin.methods import BOXED, ONE_LINE, OURS
from studies.benchmarks.maximin.single_run import Run


def stored_run(folder: Path, case_name: str, name: str, seed: int, generations: int) -> Path:
    """Return the file of a run; a change of our search, or of pymoo's version, changes the file."""
    made_by = f"search_{_digest_of_search()}" if name in (OURS, ONE_LINE, BOXED) else f"pymoo_{pymoo.__version__}"
    method = "".join(letter if letter.isalnum() else "_" for letter in name)
    return folder / made_by / case_name.replace(" ", "_") / f"{method}_{generations}_{seed}.npz"


def load_run(file: Path) -> Run | None:
    """Return a stored run; None if it is missing."""
    if not file.exists():
        return None
    with np.load(file, allow_pickle=False) as stored:
        return Run(stored["F"], float(stored["seconds"]))


def save_run(file: Path, run: Run) -> None:
    """Write a run; a process killed meanwhile leaves no half-written file."""
    replace_file(file, array_bytes({"F": run.F, "seconds": np.array(run.seconds)}))


@cache
def _digest_of_search() -> str:
    folder = Path(paretoik.search.__path__[0])
    sources = sorted(folder.rglob("*.py"))
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:12]
