"""Memory of a long run: ``python -m studies.benchmarks.memory [--quick] [--json FILE]``.

``problems/tringali_2020.py:energy_torque`` with 400 individuals, recorded and with a folder, runs for 20 and for 2,000
generations, each in a process of its own. It does not stop when the front stagnates. Measured is the largest resident
memory of the run and of the recording process, until each ends: completing the file included.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from studies.benchmarks.resident_memory import PeakMemory, run_watched
from studies.reporting import Row, report, study_parser, tell

MEGABYTE = 1e6
RUN = """
import sys
import paretoik as pk
from problems.tringali_2020 import energy_torque

generations, population, out = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
pk.solve(
    energy_torque(), population=population, generations=generations, seed=1, stagnation=False, observe=False, out=out
)
"""


@dataclass(frozen=True, kw_only=True)
class MemoryOptions:
    """The ``population`` of both runs, the generations of the ``short`` and the ``long`` one (``quick`` with --quick).

    ``goal`` is the largest ratio of the long run's memory to that of the short one.
    """

    population: int = 400
    short: int = 20
    long: int = 2000
    quick: int = 100
    goal: float = 1.5


OPTIONS = MemoryOptions()


def measure(generations: int) -> tuple[PeakMemory, int]:
    """Return the peaks of a run of some generations, and the bytes of its recording."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "run")
        _, peak = run_watched([sys.executable, "-c", RUN, str(generations), str(OPTIONS.population), str(out)])
        return peak, (out / "review.rrd").stat().st_size


def tabulate(long: int, peaks: Sequence[PeakMemory], recording: int) -> list[Row]:
    """Return the rows of a long run and the short one; the goal is for the sum."""
    short, other = peaks
    processes = (
        ("both", short.run + short.recorder, other.run + other.recorder, f"goal: at most {OPTIONS.goal:g}"),
        ("the run", short.run, other.run, ""),
        ("the process that records", short.recorder, other.recorder, f"{recording / MEGABYTE:.3g} MB of recording"),
    )
    table = f"{long:,} generations of {OPTIONS.population} beside {OPTIONS.short}"
    rows = []
    for name, before, after, note in processes:
        rows.append(
            Row(
                table=table,
                row=name,
                column="memory",
                unit="MB",
                ours=after / MEGABYTE,
                reference=before / MEGABYTE,
                source=f"{OPTIONS.short} generations",
            )
        )
        rows.append(Row(table=table, row=name, column="ratio", unit="", ours=after / before, note=note))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Run both, print the table, and write the rows if ``--json`` names a file."""
    parser = study_parser(__doc__ or "", quick=f"{OPTIONS.quick} generations")
    options = parser.parse_args(arguments)
    long = OPTIONS.quick if options.quick else OPTIONS.long
    tell(f"{OPTIONS.short} generations")
    short, _ = measure(OPTIONS.short)
    tell(f"{long:,} generations")
    other, recording = measure(long)
    report(tabulate(long, (short, other), recording), json_file=options.json)


if __name__ == "__main__":
    main()
