"""Runs killed and gone on with, journals cut and damaged: what is lost of them.

    python -m studies.benchmarks.reliability [--quick] [--kills N] [--json FILE]

Runs of the command line (a search, one with refinement, a plan, an ε-front, a refinement, a closed loop) are killed by
SIGKILL: half of them at times spread over all that they compute, half at what they do to files (open, make, rename,
remove, have on the disk), spread over all of it; every third is killed again as it goes on. What they come to is
compared with a run that nobody killed, bit for bit. A journal has what was computed up to a moment: its age at the kill
is the work that was lost, at most. Then a real journal is cut at every byte of its end and has bits flipped anywhere.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from paretoik.run_files import CHECKPOINT, JOURNAL
from studies.benchmarks.reliability.journals import count_flips, count_wrong_cuts
from studies.benchmarks.reliability.kills import COMMANDS, Kill, Kind, WholeRun, kill, run_killed, whole_run
from studies.reporting import Row, report, study_parser, tell


@dataclass(frozen=True, kw_only=True)
class ReliabilityOptions:
    """How many ``kills`` there are, ``quick`` ones, every so many ``twice``; bytes of ``cuts`` and bits of ``flips``.

    The journal that is cut is that of a search of so many ``generations``, stopped after so many ``seconds``.
    """

    kills: int = 240
    quick: int = 12
    twice: int = 3
    cuts: int = 2000
    flips: int = 1000
    generations: int = 10_000
    seconds: float = 2.0


OPTIONS = ReliabilityOptions()


def main() -> None:
    """Run the benchmark."""
    parser = study_parser(__doc__ or "", quick=f"{OPTIONS.quick} kills")
    parser.add_argument("--kills", type=int, metavar="N", help=f"how many ({OPTIONS.kills})")
    arguments = parser.parse_args()
    count = arguments.kills or (OPTIONS.quick if arguments.quick else OPTIONS.kills)
    with tempfile.TemporaryDirectory() as folder:
        rows = [*_kill_rows(Path(folder), count), *_journal_rows(Path(folder))]
    report(rows, json_file=arguments.json)


def _kill_rows(folder: Path, count: int) -> Iterator[Row]:
    search = folder / "search"
    for name in COMMANDS:
        tell(f"{name}: whole")
        run = whole_run(name, folder / name.replace(" ", "_"), search)
        kills = []
        for number, (kind, moment) in enumerate(_moments(run, -(-count // len(COMMANDS)))):
            again = run.seconds / 3 if number % OPTIONS.twice == 0 else None
            kills.append(kill(run, kind, moment, folder / "killed", again=again))
            tell(f"{name}: killed {len(kills)} times, {kills[-1].kind} {kills[-1].moment:.3g}: {kills[-1].outcome}")
        yield from _rows(name, kills)


def _moments(run: WholeRun, count: int) -> Iterator[tuple[Kind, float]]:
    """Yield kinds and moments of kills, spread evenly over a run."""
    for share in (np.arange(count // 2) + 0.5) / max(count // 2, 1):
        yield "event", 1 + int(share * run.events)
    for share in (np.arange(count - count // 2) + 0.5) / (count - count // 2):
        yield "time", float(share * run.seconds)


def _rows(name: str, kills: list[Kill]) -> Iterator[Row]:
    outcomes = Counter(each.outcome for each in kills)
    lost = outcomes["refused"] + outcomes["another result"]
    causes = ", ".join(sorted({each.cause for each in kills if each.cause}))
    words = ", ".join(f"{number} {outcome}" for outcome, number in outcomes.most_common())
    yield Row(table="kills", row=name, column="kills", unit="", ours=len(kills), note=words)
    yield Row(table="kills", row=name, column="lost", unit="", ours=lost, reference=0, source="goal", note=causes)
    unsaved = [each.unsaved for each in kills if np.isfinite(each.unsaved)]
    if unsaved:
        for column, value in (("work lost, median", np.median(unsaved)), ("work lost, most", max(unsaved))):
            yield Row(table="kills", row=name, column=column, unit="s", ours=float(value), reference=1, source="goal")


def _journal_rows(folder: Path) -> Iterator[Row]:
    tell("a journal, cut and damaged")
    content = _journal_of(COMMANDS["search"], folder / "journal")
    cuts = count_wrong_cuts(content, folder / "part", last=OPTIONS.cuts)
    flips = count_flips(content, folder / "part", flips=OPTIONS.flips)
    note = f"of {min(OPTIONS.cuts, len(content))} bytes at its end, {len(content)} in all"
    yield Row(table="journal", row="cuts", column="wrong", unit="", ours=cuts, reference=0, source="goal", note=note)
    note = ", ".join(f"{number} {outcome}" for outcome, number in flips.items())
    yield Row(
        table="journal",
        row="flipped bits",
        column="wrong",
        unit="",
        ours=flips["wrong"],
        reference=0,
        source="goal",
        note=note,
    )


def _journal_of(command: tuple[str, ...], folder: Path) -> bytes:
    """Return the journal of a command that its time limit stops."""
    limits = f"--generations={OPTIONS.generations}", f"--time-limit={OPTIONS.seconds}"
    run_killed((*command, *limits), folder, "time", np.inf)
    return (folder / CHECKPOINT / JOURNAL).read_bytes()


if __name__ == "__main__":
    main()
