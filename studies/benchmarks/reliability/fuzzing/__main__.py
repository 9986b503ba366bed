"""Random files and command lines, led by coverage, for the readers of URDFs, run folders and command lines.

    python -m studies.benchmarks.reliability.fuzzing [--seconds N] [--targets NAME ...] [--crashes FOLDER]

Each target is fuzzed from the inputs in tests/fuzzing/corpus on. Every new kind of defect is printed in one line with
its file: copied into the corpus, it is a test. Atheris is needed (pip install ".[bench]").
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from studies.benchmarks.reliability.fuzzing.targets import TARGETS, inputs
from studies.reporting import Row, report, study_parser, tell

SECONDS, QUICK_SECONDS = 600, 10  # of a target
WORKER = "studies.benchmarks.reliability.fuzzing.worker"
UNITS = re.compile(r"stat::number_of_executed_units:\s*(\d+)")


def main() -> None:
    """Fuzz all targets, one after the other."""
    parser = study_parser(__doc__ or "", quick=f"{QUICK_SECONDS} s a target")
    parser.add_argument("--seconds", type=int, default=SECONDS, metavar="N", help="seconds per target (%(default)s)")
    parser.add_argument("--targets", nargs="+", choices=TARGETS, default=list(TARGETS), metavar="TARGET")
    parser.add_argument("--crashes", type=Path, metavar="FOLDER", help="folder for inputs with defects")
    arguments = parser.parse_args()
    if find_spec("atheris") is None:
        parser.error('atheris must be installed (pip install ".[bench]"), got none')
    seconds = QUICK_SECONDS if arguments.quick else arguments.seconds
    crashes = arguments.crashes or Path(tempfile.mkdtemp(prefix="crashes-"))
    rows = [row for target in arguments.targets for row in _fuzz(target, seconds, crashes / target)]
    report(rows, json_file=arguments.json)


def _fuzz(target: str, seconds: int, crashes: Path) -> Iterator[Row]:
    """Yield the numbers of inputs and of kinds of defects; a process that ends is replaced by another."""
    crashes.mkdir(parents=True, exist_ok=True)
    executed, defects, ends, until = 0, 0, 0, time.monotonic() + seconds
    with tempfile.TemporaryDirectory() as work:
        while (remaining := int(until - time.monotonic())) > 0:
            command = [sys.executable, "-m", WORKER, target, str(crashes), work, str(remaining)]
            process = subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
            )
            assert process.stdout is not None
            for line in process.stdout:
                if line.startswith("defect "):
                    defects += 1
                    tell(f"{target}: {line.strip()}")
                elif "Test unit written to" in line or line.startswith("SUMMARY"):
                    tell(f"{target}: {line.strip()}")
                executed += int(match[1]) if (match := UNITS.match(line)) else 0
            if process.wait() != 0:
                ends += 1
                tell(f"{target}: the process ended with {process.returncode}")
                time.sleep(1.0)  # a process that cannot begin must not fill the screen
    note = f"from {len(list(inputs(target)))} inputs, in {seconds} s"
    yield Row("fuzzing", target, "inputs", "", executed, note=note)
    for column, count in (("kinds of defects", defects), ("processes that ended", ends)):
        yield Row("fuzzing", target, column, "", count, reference=0, source="goal")


if __name__ == "__main__":
    main()
