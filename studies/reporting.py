"""Shared parts of all studies: arguments, progress, rows of a table and their JSON, figures."""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import KW_ONLY, asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from rich.console import Console
from rich.table import Table

from paretoik.review.palette import PAPER

REPORTED = Path(__file__).parent / "reported"
WIDTH = 180  # characters per line in a file or a pipe
BEGIN = time.perf_counter()
LOSS = "LOSS: "


@cache
def paper_numbers(study: str) -> dict[tuple[str, str, str], float]:
    """Return the printed numbers of a study's paper, by table, row and column."""
    with (REPORTED / f"{study}.csv").open(encoding="utf-8") as file:
        return {(row["table"], row["row"], row["column"]): float(row["paper"]) for row in csv.DictReader(file)}


@dataclass(frozen=True)
class Row:
    """One number of a table: ours, a ``reference`` if there is one, and a note.

    ``source``: origin of the reference: "paper", "goal", or the name of a peer.
    """

    table: str
    row: str
    column: str
    unit: str
    ours: float
    _: KW_ONLY
    reference: float | None = None
    source: str = "paper"
    note: str = ""


def versus(
    table: str,
    row: str,
    column: str,
    unit: str,
    ours: float,
    theirs: float,
    *,
    goal: float | None = None,
    source: str = "peer",
    note: str = "",
) -> Row:
    """Return a row whose note has the ratio of ours to theirs and the goal, if any; lower is better."""
    ratio = ours / theirs if np.isfinite(theirs) and theirs > 0 else (0.0 if np.isfinite(ours) else np.inf)
    lost = goal is not None and not ratio <= goal
    parts = [f"ratio {ratio:.3g}", *([f"goal {goal:g}"] if goal is not None else []), *([note] if note else [])]
    finite_theirs = float(theirs) if np.isfinite(theirs) else None
    words = (LOSS if lost else "") + ", ".join(parts)
    return Row(table, row, column, unit, float(ours), reference=finite_theirs, source=source, note=words)


def goal_row(
    table: str, row: str, column: str, unit: str, ours: float, goal: float, note: str = "", *, least: bool = False
) -> Row:
    """Return a row with its goal, an upper bound, or a lower one if ``least``; NaN is a loss."""
    is_met = ours >= goal if least else ours <= goal
    note = ("" if is_met else LOSS) + (note or "goal")
    return Row(table, row, column, unit, float(ours), reference=float(goal), source="goal", note=note)


def losses_first(rows: Sequence[Row]) -> list[Row]:
    """Return the rows, losses first; tables with a loss then come first too."""
    return sorted(rows, key=lambda row: not row.note.startswith(LOSS))


def timed(work: Callable[[], Any]) -> tuple[Any, float, float]:
    """Return the result of work, its duration [s], and the processor time of all threads [s]."""
    started, cpu = time.perf_counter(), time.process_time()
    result = work()
    return result, time.perf_counter() - started, time.process_time() - cpu


def study_parser(description: str, *, quick: str = "", out: str = "", cluster: str = "") -> argparse.ArgumentParser:
    """Return a parser of --json, and of each of the options below that is given.

    quick: help of --quick
    out: default of --out, a folder of pictures in runs/
    cluster: what the workers of --cluster compute
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE", help="file to write the rows to")
    if quick:
        parser.add_argument("--quick", action="store_true", help=quick)
    if out:
        parser.add_argument("--out", type=Path, default=Path("runs") / out, help="folder for the pictures")
    if cluster:
        text = f"address of a Dask scheduler, tcp://HOST:PORT: its workers compute {cluster}, instead of this machine"
        parser.add_argument("--cluster", metavar="ADDRESS", help=text)
    return parser


def tell(what: str) -> None:
    """Print on stderr what is being done, and when."""
    print(f"{time.perf_counter() - BEGIN:6.1f} s  {what}", file=sys.stderr, flush=True)


def report(rows: Sequence[Row], *, json_file: Path | None = None) -> None:
    """Print rows, one table per ``table``, and write them as JSON if a file is named."""
    console = Console(markup=False)  # "[nan, nan]" must not be read as markup
    if not console.is_terminal:
        console.width = WIDTH
    for name in dict.fromkeys(row.table for row in rows):
        headings = ("row", "column", "unit", "ours", "reference", "source", "note")
        table = Table(*headings, title=name, title_justify="left")
        for row in rows:
            if row.table == name:
                reference = ("", "") if row.reference is None else (f"{row.reference:.5g}", row.source)
                table.add_row(row.row, row.column, row.unit, f"{row.ours:.5g}", *reference, row.note)
        console.print(table)
    if json_file is not None:
        save_rows(rows, json_file)


def save_rows(rows: Sequence[Row], file: Path) -> None:
    """Write rows as strict JSON: infinities and NaN are written as null."""
    records = [{**asdict(row), "source": None if row.reference is None else row.source} for row in rows]
    for record in records:
        record |= {key: None for key, value in record.items() if isinstance(value, float) and not math.isfinite(value)}
    file.write_text(json.dumps(records, indent=2, allow_nan=False) + "\n")


@contextmanager
def drawing(file: Path, size: tuple[float, float]) -> Iterator[Figure]:
    """Yield a figure of a size [inches], write it into a file and print its name."""
    tell(file.name)
    with matplotlib.rc_context({**PAPER.style, "font.size": 9.5, "axes.titlesize": 9.5}):
        figure = Figure(figsize=size, dpi=125, layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08))
        yield figure
        figure.savefig(file)
