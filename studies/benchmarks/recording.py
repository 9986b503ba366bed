"""Cost, size and memory of a recording: ``python -m studies.benchmarks.recording [--memory] [--quick] [--json FILE]``.

A search of DTLZ2 with 200 individuals and four objectives, whose front has up to 20,000 points, runs alternately with
and without a recording, each time in a process of its own and with a folder. The recording's share is of the run's
processor time. It counts everything that the run does only for the recording until it is finished: the run starts it,
collects what it shows, packs and sends it. Clock seconds are without those for completing the file; on a busy machine
they vary, and so do their ratios.

``--memory`` runs ``problems/tringali_2020.py:energy_torque`` with 400 individuals for 20 and for 2,000 generations,
each recorded, with a folder and in a process of its own. It does not stop when the front stagnates. Measured is the
largest resident memory of the run and of the recording process, until each ends: completing the file included.
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

from studies.benchmarks.checkouts import ROOT
from studies.reporting import Row, report, study_parser, tell

PROCESSES = Path("/proc")  # Linux
RECORDER = "paretoik.review.recording_child"
INTERVAL = 0.01  # s between looks; each reads the peak so far, so only growth in the last interval is missed


@dataclass(kw_only=True)
class PeakMemory:
    """The largest resident memory [bytes] of the ``run`` itself and of its ``recorder``, 0 without one."""

    run: int = 0
    recorder: int = 0


def run_watched(command: Sequence[str]) -> tuple[str, PeakMemory]:
    """Run a command at the root of this checkout; return its output and its peaks.

    Raises subprocess.CalledProcessError if the command fails.
    """
    peak = PeakMemory()
    with tempfile.TemporaryFile("w+", encoding="utf-8") as output:  # an unread pipe would fill up
        child = subprocess.Popen(command, cwd=ROOT, stdout=output)
        while child.poll() is None:
            peak.run = max(peak.run, _peak_of(child.pid))
            for other in _children(child.pid):
                if RECORDER in _command_line(other):
                    peak.recorder = max(peak.recorder, _peak_of(other))
            time.sleep(INTERVAL)
        if child.returncode:
            raise subprocess.CalledProcessError(child.returncode, command)
        output.seek(0)
        return output.read(), peak


def _peak_of(process: int) -> int:
    """Return the largest resident memory of a process so far [bytes], 0 after its end."""
    with suppress(OSError, ValueError):
        _, _, peak = (PROCESSES / str(process) / "status").read_text().partition("VmHWM:")
        return 1024 * int(peak.split(maxsplit=1)[0]) if peak else 0
    return 0


def _children(process: int) -> list[int]:
    """Return the processes that a process has started, from any of its threads."""
    children = list[int]()
    with suppress(OSError):
        for thread in (PROCESSES / str(process) / "task").iterdir():
            with suppress(OSError):
                children += [int(child) for child in (thread / "children").read_text().split()]
    return children


def _command_line(process: int) -> str:
    """Return the command line of a process, empty after its end."""
    with suppress(OSError):
        return (PROCESSES / str(process) / "cmdline").read_text(errors="replace").replace("\0", " ")
    return ""


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
front = pk.solve(
    problem, population=200, generations=generations, seed=1, stagnation=False, observe=False, out=out, overwrite=True
)
print(json.dumps({
    "clock": time.perf_counter() - clock - finishing, "processor": time.process_time() - processor,
    "finishing": finishing, "recording": sum(spent), "longest": longest,
    "size": Path(out, "review.rrd").stat().st_size if records else 0,
    "front": front.objectives.tolist(),
}))
"""
GOALS = {"size": 50.0, "overhead": 2.0, "memory": 1.5}  # MB; % of a run; ratio
SHORT, LONG, QUICK = 20, 2000, 100  # generations


@dataclass(frozen=True, kw_only=True)
class Cost:
    """A run: seconds of clock and processor, those of the recording and of finishing the file; sizes [bytes]; front.

    ``peak`` is the memory of the run and of the recording process, until both end.
    """

    clock: float
    processor: float
    recording: float
    finishing: float
    size: int
    longest: int
    peak: PeakMemory
    front: list[list[float]]


def run(generations: int, *, records: bool) -> Cost:
    """Return the cost of a run with a folder in a process of its own, with or without a recording."""
    with tempfile.TemporaryDirectory() as folder:
        printed, peak = run_watched([sys.executable, "-c", RUN, str(generations), folder, str(records)])
        return Cost(**json.loads(printed.splitlines()[-1]), peak=peak)


def recording_rows(generations: int, pairs: Sequence[tuple[Cost, Cost]]) -> list[Row]:
    """Return the rows of runs without and with a recording, those that miss their goal first."""

    def row(
        column: str, unit: str, ours: float, reference: float | None = None, source: str = "", note: str = ""
    ) -> Row:
        name = f"{generations} generations of 200 × 4"
        return Row("recording", name, column, unit, ours, reference=reference, source=source, note=note)

    without, recorded = zip(*pairs, strict=True)
    calm, busy = min(each.clock for each in without), min(each.clock for each in recorded)
    share = 100 * max(each.recording / each.processor for each in recorded)
    largest = max(max(each.size, each.longest) for each in recorded) / MEGABYTE
    same = all(one.front == other.front for one, other in pairs)
    first = recorded[0]
    ratios = ", ".join(f"{other.clock / one.clock:.3f}" for one, other in pairs)
    goals = [
        row("share of the run's processor time", "%", share, GOALS["overhead"], "goal"),
        row("file at its largest", "MB", largest, GOALS["size"], "goal", f"{first.size / MEGABYTE:.3g} MB at the end"),
    ]
    others = [
        row("time with a recording", "s", busy, calm, "without", f"best of {len(pairs)}; ratios {ratios}"),
        row("processor time with a recording", "s", first.processor, without[0].processor, "without"),
        row("recording a generation", "ms", 1e3 * first.recording / generations),
        row("completing the file", "s", first.finishing),
        row("memory of the run", "MB", first.peak.run / MEGABYTE, without[0].peak.run / MEGABYTE, "without"),
        row("memory of the process that records", "MB", first.peak.recorder / MEGABYTE, note="completing the file too"),
        row("same front", "", float(same), 1.0, "goal", "to the bit, of the same seed"),
    ]
    return [*sorted(goals, key=lambda each: each.ours <= (each.reference or 0.0)), *others]


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
            peaks.append(run_watched([sys.executable, "-c", LONG_RUN, str(generations), str(out)])[1])
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
        rows += recording_rows(generations, pairs)
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
