"""Cost, size and memory of a recording: ``python -m studies.benchmarks.recording [--memory] [--quick] [--json FILE]``.

A search of DTLZ2 with 200 individuals and four objectives runs alternately with and without a recording, in processes
of their own and with a folder. The recording's share is of the run's processor time: everything that the run does only
for it. Clock seconds are without those for completing the file.

``--memory`` runs ``energy_torque`` with 400 individuals for 20 and for 2,000 generations, recorded. Measured is the
largest resident memory of the run and of the recording process, completing the file included.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from studies.benchmarks.checkouts import ROOT
from studies.processes import children_of
from studies.reporting import Row, goal_row, losses_first, report, study_parser, tell

PROCESSES = Path("/proc")  # Linux
RECORDER = "paretoik.review.recording_child"
INTERVAL = 0.01  # s between looks; each reads the peak so far, so only growth in the last interval is missed


@dataclass(kw_only=True)
class PeakMemory:
    """The largest resident memory [bytes] of the ``run`` itself and of its ``recorder``, 0 without one."""

    run: int = 0
    recorder: int = 0


def run_watched(command: Sequence[str]) -> PeakMemory:
    """Run a command at the root of this checkout; return its peaks.

    Raises subprocess.CalledProcessError if the command fails.
    """
    peak = PeakMemory()
    child = subprocess.Popen(command, cwd=ROOT)
    while child.poll() is None:
        peak.run = max(peak.run, _peak_of(child.pid))
        for other in children_of(child.pid):
            with suppress(OSError):
                if RECORDER in (PROCESSES / str(other) / "cmdline").read_text(errors="replace"):
                    peak.recorder = max(peak.recorder, _peak_of(other))
        time.sleep(INTERVAL)
    if child.returncode:
        raise subprocess.CalledProcessError(child.returncode, command)
    return peak


def _peak_of(process: int) -> int:
    """Return the largest resident memory of a process so far [bytes], 0 after its end."""
    with suppress(OSError, ValueError):
        _, _, peak = (PROCESSES / str(process) / "status").read_text().partition("VmHWM:")
        return 1024 * int(peak.split(maxsplit=1)[0]) if peak else 0
    return 0


MEGABYTE = 1e6
RUN = """
import json, sys, time
from pathlib import Path
import paretoik as pk
from paretoik.api.session import Session
from paretoik.api.solve import FrontSearch
from paretoik.review.recording.recorder import Recorder
from pymoo.problems import get_problem

generations, out, records = int(sys.argv[1]), sys.argv[2], sys.argv[3] == "True"
spent, longest = [], 0
start, show, finish = Session.start_recording, FrontSearch._show, Recorder.finish

def opened(session, scene):
    started = time.thread_time()
    if records:
        start(session, scene)
    spent.append(time.thread_time() - started)

def timed(search, session, progress):  # without an observer there is no other reason to show anything
    global longest
    started = time.thread_time()
    show(search, session, progress)
    spent.append(time.thread_time() - started)
    file = Path(out, "review.rrd")
    longest = max(longest, file.stat().st_size if file.exists() else 0)

def measured(recorder, end):
    global finishing
    started = time.perf_counter()
    finish(recorder, end)
    finishing = time.perf_counter() - started

Session.start_recording, FrontSearch._show, Recorder.finish, finishing = opened, timed, measured, 0.0
problem = get_problem("dtlz2", n_var=13, n_obj=4)
pk.solve(problem, population=200, generations=2, seed=1, observe=False)  # loads and compiles
spent.clear()
clock, processor = time.perf_counter(), time.process_time()
pk.solve(
    problem, population=200, generations=generations, seed=1, stagnation=False, observe=False, out=out, overwrite=True
)
print(json.dumps({
    "clock": time.perf_counter() - clock - finishing, "processor": time.process_time() - processor,
    "recording": sum(spent), "longest": longest,
    "size": Path(out, "review.rrd").stat().st_size if records else 0,
}))
"""
GOALS = {"size": 50.0, "overhead": 2.0, "memory": 1.5}  # MB; % of a run; ratio
SHORT, LONG, QUICK = 20, 2000, 100  # generations


class Cost(NamedTuple):
    """A run: seconds of clock and processor, those of the recording; sizes of its file [bytes], at its largest too."""

    clock: float
    processor: float
    recording: float
    size: int
    longest: int


def run(generations: int, *, records: bool) -> Cost:
    """Return the cost of a run with a folder in a process of its own, with or without a recording."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-c", RUN, str(generations), folder, str(records)]
        printed = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True).stdout
        return Cost(**json.loads(printed.splitlines()[-1]))


LONG_RUN = """
import sys
import paretoik as pk
from problems.tringali_2020 import energy_torque

generations, out = int(sys.argv[1]), sys.argv[2]
pk.solve(
    energy_torque(), population=400, generations=generations, seed=1, stagnation=False, observe=False, out=out
)
"""


def memory_rows(long: int) -> list[Row]:
    """Run a short and a long search; return the rows of their memory, the goal is for the sum."""
    peaks, recording = list[PeakMemory](), 0
    for generations in (SHORT, long):
        tell(f"{generations:,} generations")
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder, "run")
            peaks.append(run_watched([sys.executable, "-c", LONG_RUN, str(generations), str(out)]))
            recording = (out / "review.rrd").stat().st_size
    short, other = peaks
    processes = (
        ("both", short.run + short.recorder, other.run + other.recorder, f"goal: at most {GOALS['memory']:g}"),
        ("the run", short.run, other.run, ""),
        ("the process that records", short.recorder, other.recorder, f"{recording / MEGABYTE:.3g} MB of recording"),
    )
    table, source, rows = f"{long:,} generations of 400 beside {SHORT}", f"{SHORT} generations", list[Row]()
    for name, before, after, note in processes:
        reference = before / MEGABYTE
        rows.append(Row(table, name, "memory", "MB", after / MEGABYTE, reference=reference, source=source))
        rows.append(Row(table, name, "ratio", "", after / before, note=note))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Run all, print the table, and write the rows if ``--json`` names a file."""
    parser = study_parser(__doc__, quick="60 generations, once; 100 for the memory")
    parser.add_argument("--memory", action="store_true", help="of a long run, compared with a short one")
    options = parser.parse_args(arguments)
    rows: list[Row] = memory_rows(QUICK if options.quick else LONG) if options.memory else []
    for generations, times in () if options.memory else ((60, 1),) if options.quick else ((500, 3), (2000, 1)):
        pairs = []
        for turn in range(times):
            tell(f"{generations} generations, turn {turn + 1} of {times}")
            order = (False, True) if turn % 2 == 0 else (True, False)
            costs = {records: run(generations, records=records) for records in order}
            pairs.append((costs[False], costs[True]))
        # The rows of runs without and with a recording, those that miss their goal first
        place = "recording", f"{generations} generations of 200 × 4"
        without, recorded = zip(*pairs, strict=True)
        calm, busy = min(each.clock for each in without), min(each.clock for each in recorded)
        share = 100 * max(each.recording / each.processor for each in recorded)
        largest = max(max(each.size, each.longest) for each in recorded) / MEGABYTE
        note = f"best of {len(pairs)}; ratios {', '.join(f'{other.clock / one.clock:.3f}' for one, other in pairs)}"
        at_end = f"{recorded[0].size / MEGABYTE:.3g} MB at the end"
        goals = [
            goal_row(*place, "share of the run's processor time", "%", share, GOALS["overhead"]),
            goal_row(*place, "file at its largest", "MB", largest, GOALS["size"], at_end),
        ]
        time = Row(*place, "time with a recording", "s", busy, reference=calm, source="without", note=note)
        rows += [*losses_first(goals), time]
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
