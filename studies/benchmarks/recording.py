"""Cost of a recording: ``python -m studies.benchmarks.recording [--quick] [--json FILE]``.

A search of DTLZ2 with 200 individuals and four objectives, whose front has up to 20,000 points, runs alternately with
and without a recording, each time in a process of its own and with a folder. The recording's share is of the run's
processor time. It counts everything that the run does only for the recording until it is finished: the run starts it,
collects what it shows, packs and sends it. Clock seconds are without those for completing the file; on a busy machine
they vary, and so do their ratios.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass

from studies.benchmarks.resident_memory import PeakMemory, run_watched
from studies.reporting import Row, report, study_parser, tell

MEGABYTE = 1e6
RUN = """
import json, sys, time
from pathlib import Path
import paretoik as pk
from paretoik.api.session import Session
from paretoik.api.search_front import FrontSearch
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
GOALS = {"size": 50.0, "overhead": 2.0}  # MB, % of a run


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


def tabulate(generations: int, pairs: Sequence[tuple[Cost, Cost]]) -> list[Row]:
    """Return the rows of runs without and with a recording, those that miss their goal first."""

    def row(
        column: str, unit: str, ours: float, reference: float | None = None, source: str = "", note: str = ""
    ) -> Row:
        return Row(
            table="recording",
            row=f"{generations} generations of 200 × 4",
            column=column,
            unit=unit,
            ours=ours,
            reference=reference,
            source=source,
            note=note,
        )

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


def main(arguments: Sequence[str] | None = None) -> None:
    """Run all, print the table, and write the rows if ``--json`` names a file."""
    parser = study_parser("Cost of a recording.", quick="60 generations, once")
    options = parser.parse_args(arguments)
    rows: list[Row] = []
    for generations, times in ((60, 1),) if options.quick else ((500, 3), (2000, 1)):
        pairs = []
        for turn in range(times):
            tell(f"{generations} generations, turn {turn + 1} of {times}")
            order = (False, True) if turn % 2 == 0 else (True, False)
            costs = {records: run(generations, records=records) for records in order}
            pairs.append((costs[False], costs[True]))
        rows += tabulate(generations, pairs)
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
