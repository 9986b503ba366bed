"""The house is in order: quick to import, its public names known, nothing in it that does not belong."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import paretoik

ROOT = Path(__file__).parents[1]


def tracked() -> list[Path]:
    found = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if found.returncode:
        pytest.skip("not a git checkout")
    return [ROOT / line for line in found.stdout.splitlines() if (ROOT / line).is_file()]


def test_importing_paretoik_loads_nothing_heavy():
    heavy = ("pymoo", "cvxpy", "numba", "matplotlib", "rerun", "scipy", "pinocchio")
    script = f"import sys, paretoik; print([name for name in {heavy} if name in sys.modules])"
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_the_public_names_are_those_of_the_snapshot():
    snapshot = (Path(__file__).parent / "public_names.txt").read_text().split()
    assert sorted(paretoik.__all__) == snapshot


@pytest.mark.parametrize("name", sorted(paretoik.__all__))
def test_each_public_name_loads_and_says_what_it_is(name):
    found = getattr(paretoik, name)
    assert (found.__doc__ or getattr(found, "function", found).__doc__ or "").strip()


def test_no_file_names_a_machine_or_a_registry():
    place = re.compile(rb"/(tm[p]|wor[k]|roo[t]|hom[e])/[a-z]|py[p]i[.]org|pythonhoste[d]|npmj[s][.]")
    assert [str(path) for path in tracked() if place.search(path.read_bytes())] == []


def test_no_tracked_file_is_large():
    assert [str(path) for path in tracked() if path.stat().st_size > 200_000] == []


def test_types_are_shipped():
    assert (ROOT / "paretoik" / "py.typed").is_file()
