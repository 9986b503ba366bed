"""Studies print the same rows with a real Dask cluster of two workers and without one."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from studies.benchmarks.scaling.local_cluster import local_cluster

ROOT = Path(__file__).parents[2]
TIMED = ("s", "ms", "µs", "CPU s")  # units of clock times


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    pytest.importorskip("distributed", reason="Dask is not installed: pip install paretoik[cluster]")
    with local_cluster(tmp_path_factory.mktemp("dask"), 2) as cluster:
        yield cluster.address


def rows_of(study, folder, *options):
    """Return the rows of a study, except clock times."""
    file = folder / "rows.json"
    folder.mkdir()
    command = [sys.executable, "-m", f"studies.{study}", "--quick", "--json", str(file), *options]
    process = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stderr
    rows = [row for row in json.loads(file.read_text()) if row["unit"] not in TIMED]
    assert rows
    return [{name: value for name, value in row.items() if name != "note"} for row in rows]


@pytest.mark.slow
@pytest.mark.parametrize("study", ["marcos_2012", "tringali_2020"])
def test_a_study_on_a_cluster_comes_to_the_same_rows(study, address, tmp_path):
    pictures = [] if "." in study else ["--out", str(tmp_path / "pictures")]
    alone = rows_of(study, tmp_path / "alone", *pictures)
    assert rows_of(study, tmp_path / "cluster", *pictures, "--cluster", address) == alone
