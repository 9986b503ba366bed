"""One target led by coverage, in a process of its own: ``python -m ...fuzzing.worker TARGET CRASHES WORK SECONDS``.

Atheris feeds it inputs; each new kind of defect is printed in one line and its input stored in the folder of crashes. A
crash of a library, or a hang, ends the process and also leaves its input there.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

HANG = 120  # s: an input that takes longer never ends
LONGEST = 8192  # bytes of an input
READERS = [
    "paretoik.cli",
    "paretoik.front",
    "paretoik.inputs",
    "paretoik.runs.journal",
    "paretoik.robot.urdf",
    "paretoik.robot.urdf_reading",
    "paretoik.runs.files",
    "paretoik.verification",
    "typer",
]
"""The traced modules: those that read bytes, and none that numba compiles."""


def main() -> None:
    """Fuzz a target until the time is over."""
    import atheris  # imported here: an extra of the benchmark

    name, crashes, work, seconds = sys.argv[1], Path(sys.argv[2]), sys.argv[3], sys.argv[4]
    with atheris.instrument_imports(include=READERS):
        from studies.benchmarks.reliability.fuzzing.targets import CORPUS, TARGETS, Defect, keep, kind_of
    target, kinds = TARGETS[name](Path(tempfile.mkdtemp())), set[str]()

    def once(data: bytes) -> Any:
        try:
            target(data)
        except Defect as defect:
            kind = kind_of(defect)
            if kind not in kinds:
                kinds.add(kind)
                print(f"defect {keep(crashes, data)}: {defect}", flush=True)

    limits = [f"-max_total_time={seconds}", f"-timeout={HANG}", f"-max_len={LONGEST}"]
    options = [*limits, "-print_final_stats=1"]
    files = [work, str(CORPUS / name)]
    atheris.Setup([sys.argv[0], *options, f"-artifact_prefix={crashes}/", "-verbosity=0", *files], once)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
