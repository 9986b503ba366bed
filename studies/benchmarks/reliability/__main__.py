"""Runs killed and resumed, journals cut and damaged, full disks: their losses; faults verified.

    python -m studies.benchmarks.reliability [--quick] [--kills N] [--runs NAME ...] [--parts PART ...]

Runs of the command line are killed by SIGKILL, equally often in every phase, spread over all of it; every third run is
killed again when it resumes, and every second journal has a bit flipped first. A result is compared bit for bit with
that of a run that was never killed, and so is every entry of its journal. Then a real journal is cut and damaged, a
search runs on small disks, the verifier checks good runs of every kind and copies with one fault each, and users' own
faults come.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

from studies.benchmarks.reliability.damage import disk_rows, journal_rows
from studies.benchmarks.reliability.kills import COMMANDS, kill_rows
from studies.benchmarks.reliability.user_faults import fault_rows
from studies.benchmarks.reliability.verifier import verifier_rows
from studies.reporting import Row, report, save_rows, study_parser

KILLS, QUICK_KILLS = 280, 28
DISKS, QUICK_DISKS = 50, 6


def main() -> None:
    """Run the benchmark."""
    parser, runs = study_parser(__doc__ or "", quick=f"{QUICK_KILLS} kills"), list(COMMANDS)
    parts = ("kills", "journal", "disks", "verifier", "faults")
    parser.add_argument("--kills", type=int, metavar="N", help=f"how many ({KILLS})")
    parser.add_argument("--parts", nargs="+", choices=parts, default=parts, metavar="PART", help=", ".join(parts))
    parser.add_argument("--runs", nargs="+", choices=runs, default=runs, metavar="NAME", help="only some of them")
    arguments = parser.parse_args()
    kills = arguments.kills or (QUICK_KILLS if arguments.quick else KILLS)
    rows_of: dict[str, Callable[[Path], Iterable[Row]]] = {
        "kills": lambda folder: kill_rows(folder, kills, arguments.runs),
        "journal": journal_rows,
        "disks": lambda folder: disk_rows(folder, QUICK_DISKS if arguments.quick else DISKS),
        "verifier": verifier_rows,
        "faults": fault_rows,
    }
    rows = list[Row]()
    for part in (part for part in parts if part in arguments.parts):
        with tempfile.TemporaryDirectory() as folder:
            rows += (of_part := list(rows_of[part](Path(folder))))
        report(of_part)
    if arguments.json is not None:
        save_rows(rows, arguments.json)


if __name__ == "__main__":
    main()
