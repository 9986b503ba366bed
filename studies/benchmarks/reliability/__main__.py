"""Runs killed and resumed, journals cut and damaged, full disks: their losses; faults verified.

    python -m studies.benchmarks.reliability [--quick] [--kills N] [--runs NAME ...] [--parts PART ...]

Runs of the command line (a search, one with refinement, a plan, an ε-front, a refinement, a closed loop; except plan
and loop also with two worker processes and on a Dask cluster of two) are killed by SIGKILL, equally often in every
phase (ask, evaluate, refine, the rest; write, rename and fsync). The kills of a phase are shared among the runs that
have it and spread over all of it; every third run is killed again when it resumes. Its result is compared bit for bit
with that of a run that was never killed, and so is every entry that a resumed run takes from its journal or adds to it.
Every second journal has a bit flipped first. A kill loses the work since the last entry. Then a real journal is cut at
every byte of its end and has a bit flipped in every field of every frame, and a search runs on disks from 4 kB to a
size that it fills up on its way. The verifier checks good runs of every kind, and copies of them with one fault each.
Last come faults of users' own code, names and folders.
"""

from __future__ import annotations

import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from paretoik.runs.files import CHECKPOINT, JOURNAL
from studies.benchmarks.reliability.full_disk import (
    SmallDisk,
    disk_sizes,
    namespaces_can_mount,
    run_on_small_disk,
)
from studies.benchmarks.reliability.journals import count_flips, count_wrong_cuts
from studies.benchmarks.reliability.kills import (
    COMMANDS,
    Kill,
    Outcome,
    WholeRun,
    kill,
    result_of,
    run_killed,
    whole_run,
)
from studies.benchmarks.reliability.moments import Moment, spread_kills
from studies.benchmarks.reliability.phases import PHASES
from studies.benchmarks.reliability.user_faults import faults
from studies.benchmarks.reliability.verifier.counting import verifier_rows
from studies.benchmarks.scaling.local_cluster import local_cluster
from studies.reporting import Row, report, save_rows, study_parser, tell


@dataclass(frozen=True, kw_only=True)
class ReliabilityOptions:
    """Number of ``kills``, of ``quick`` ones, interval of ``twice`` and ``damaged`` ones; bytes of ``cuts``.

    ``disks`` are too small, ``quick_disks`` with --quick; one of ``large`` bytes is not. The journal that is cut is
    that of a search of ``generations``, stopped after ``seconds``. A phase that takes less than ``short`` seconds is
    not killed in.
    """

    kills: int = 280
    quick: int = 28
    workers: int = 2
    short: float = 0.02
    twice: int = 3
    damaged: int = 2
    cuts: int = 2000
    disks: int = 50
    quick_disks: int = 6
    generations: int = 10_000
    seconds: float = 2.0
    large: int = 2**30


OPTIONS = ReliabilityOptions()
LOST: tuple[Outcome, ...] = ("refused", "another course", "another result")
PARTS = ("kills", "journal", "disks", "verifier", "faults")


def main() -> None:
    """Run the benchmark."""
    parser = study_parser(__doc__ or "", quick=f"{OPTIONS.quick} kills")
    parser.add_argument("--kills", type=int, metavar="N", help=f"how many ({OPTIONS.kills})")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, metavar="PART", help=", ".join(PARTS))
    parser.add_argument(
        "--runs", nargs="+", choices=COMMANDS, default=list(COMMANDS), metavar="NAME", help="only some of them"
    )
    arguments = parser.parse_args()
    kills = arguments.kills or (OPTIONS.quick if arguments.quick else OPTIONS.kills)
    disks = OPTIONS.quick_disks if arguments.quick else OPTIONS.disks
    rows_of: dict[str, Callable[[Path], Iterable[Row]]] = {
        "kills": lambda folder: _kill_rows(folder, kills, arguments.runs),
        "journal": _journal_rows,
        "disks": lambda folder: _disk_rows(folder, disks),
        "verifier": verifier_rows,
        "faults": _fault_rows,
    }
    rows = list[Row]()
    for part in PARTS:
        if part in arguments.parts:
            with tempfile.TemporaryDirectory() as folder:
                rows += (of_part := list(rows_of[part](Path(folder))))
            report(of_part)
    if arguments.json is not None:
        save_rows(rows, arguments.json)


def _kill_rows(folder: Path, count: int, names: Sequence[str]) -> Iterator[Row]:
    kills = list[Kill]()
    with ExitStack() as stack:
        replacements = {"SEARCH": str(folder / "source")}
        whole_run("search", folder / "source", {})
        if any("--cluster" in COMMANDS[name] for name in names):
            replacements["CLUSTER"] = stack.enter_context(local_cluster(folder, OPTIONS.workers)).address
        runs = list[WholeRun]()
        for name in names:
            runs.append(whole_run(name, folder / "whole", replacements))
            shutil.rmtree(folder / "whole")
            tell(f"{name}: whole, {runs[-1].seconds:.1f} s, {len(runs[-1].entries)} entries")
        moments = spread_kills(runs, count, short=OPTIONS.short)
        for run in runs:
            kills += _kills(run, moments[run.name], folder)
            yield from _rows(run.name, [each for each in kills if each.name == run.name])
    yield from _phase_rows(kills)


def _kills(run: WholeRun, moments: Sequence[Moment], folder: Path) -> Iterator[Kill]:
    for number, (phase, amount) in enumerate(moments):
        again = amount / 2 if number % OPTIONS.twice == 0 else None
        damaged = number if number % OPTIONS.damaged == 0 else None
        killed = kill(run, phase, amount, folder / "killed", again=again, damaged=damaged)
        tell(f"{run.name}: {number + 1} of {len(moments)}, {phase} {amount:.3g}: {killed.outcome} {killed.cause}")
        yield killed


def _phase_rows(kills: Sequence[Kill]) -> Iterator[Row]:
    for phase in PHASES:
        met = [each for each in kills if each.phase == phase and np.isfinite(each.orphaned)]
        lost = sum(each.outcome in LOST for each in met)
        note = "refused, or by another course or to another result" if lost else ""
        yield Row(table="phases", row=phase, column="kills", unit="", ours=len(met), reference=20, source="goal")
        yield Row(table="phases", row=phase, column="lost", unit="", ours=lost, reference=0, source="goal", note=note)


def _rows(name: str, kills: list[Kill]) -> Iterator[Row]:
    outcomes = Counter(each.outcome for each in kills)
    lost = sum(outcomes[each] for each in LOST)
    causes = ", ".join(sorted({each.cause for each in kills if each.cause}))
    words = ", ".join(f"{number} {outcome}" for outcome, number in outcomes.most_common())
    yield Row(table="kills", row=name, column="kills", unit="", ours=len(kills), note=words)
    yield Row(table="kills", row=name, column="lost", unit="", ours=lost, reference=0, source="goal", note=causes)
    unsaved = [each.unsaved for each in kills if np.isfinite(each.unsaved)]
    if unsaved:
        for column, value in (("work lost, median", np.median(unsaved)), ("work lost, most", max(unsaved))):
            yield Row(table="kills", row=name, column=column, unit="s", ours=float(value), reference=1, source="goal")
    orphaned = [each.orphaned for each in kills if np.isfinite(each.orphaned)]
    yield Row(
        table="kills", row=name, column="other processes lived on, most", unit="s", ours=max(orphaned, default=0.0)
    )


def _journal_rows(folder: Path) -> Iterator[Row]:
    tell("a journal, cut and damaged")
    content = _journal_of(COMMANDS["search"], folder / "journal")
    cuts = count_wrong_cuts(content, folder / "part", last=OPTIONS.cuts)
    flips = count_flips(content, folder / "part")
    note = f"of {min(OPTIONS.cuts, len(content))} bytes at its end, {len(content)} in all"
    yield Row(table="journal", row="cuts", column="wrong", unit="", ours=cuts, reference=0, source="goal", note=note)
    note = ", ".join(f"{number} {outcome}" for outcome, number in flips.items())
    yield Row(
        table="journal",
        row="flipped bits",
        column="wrong",
        unit="",
        ours=flips["wrong"] + flips["refused"],
        reference=0,
        source="goal",
        note=note,
    )


def _disk_rows(folder: Path, count: int) -> Iterator[Row]:
    """Yield the outcomes of a search on disks that are too small, and its delay against a large one."""
    if not namespaces_can_mount():
        print("left out: small disks, as this system lets no user mount any")
        return
    whole = run_on_small_disk("search", OPTIONS.large, folder, "")
    result = result_of(folder / "copy" / "run")
    disks = list[SmallDisk]()
    for size in disk_sizes(count):
        disks.append(run_on_small_disk("search", size, folder, result))
        tell(f"a disk of {size / 2**20:.3g} MB: {disks[-1].outcome}")
    outcomes = Counter(each.outcome for each in disks)
    words = ", ".join(f"{number} {outcome}" for outcome, number in outcomes.most_common())
    longer = max(each.seconds for each in disks) - whole.seconds
    lost = next((each.words for each in disks if each.outcome == "lost"), "")
    place = partial(Row, table="full disks", row="search")
    yield place(column="disks", unit="", ours=len(disks), note=words)
    yield place(column="lost", unit="", ours=outcomes["lost"], reference=0, source="goal", note=lost)
    yield place(column="longer than on a large one, most", unit="s", ours=longer, reference=10, source="goal")


def _fault_rows(folder: Path) -> Iterator[Row]:
    counts, bad = Counter[str](), Counter[str]()
    for fault in faults(folder):
        counts[fault.kind] += 1
        if fault.wrong:
            bad[fault.kind] += 1
            tell(f"{fault.kind}: {fault.name}: {fault.wrong}")
    for kind, count in counts.items():
        place = partial(Row, table="faults", row=kind, unit="")
        yield place(column="bad", ours=bad[kind], reference=0, source="goal", note=f"of {count}")


def _journal_of(command: tuple[str, ...], folder: Path) -> bytes:
    """Return the journal of a command that its time limit stops."""
    limits = f"--generations={OPTIONS.generations}", f"--time-limit={OPTIONS.seconds}"
    run_killed((*command, *limits), folder, "else", np.inf)
    return (folder / CHECKPOINT / JOURNAL).read_bytes()


if __name__ == "__main__":
    main()
