"""Code that runs in a process of its own, on the packages of one checkout of this repository."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


def run_in(checkout: Path, code: str, *, cache: Path, threads: int | None = None) -> dict[str, Any]:
    """Return the JSON object that is the last line of a program's output.

    ``cache`` is the folder of compiled code; ``threads=1`` keeps linear algebra on one thread. Raises RuntimeError,
    with the last line of its errors, if the program fails.
    """
    environment = {**os.environ, "PYTHONPATH": str(checkout), "NUMBA_CACHE_DIR": str(cache)}
    process = subprocess.run(
        [sys.executable, "-c", code],
        cwd=checkout,
        env=environment | (ONE_THREAD if threads == 1 else {}),
        capture_output=True,
        text=True,
        check=False,
    )
    if process.returncode:
        raise RuntimeError(f"{checkout}: {process.stderr.strip().splitlines()[-1]}")
    result: dict[str, Any] = json.loads(process.stdout.strip().splitlines()[-1])
    return result
