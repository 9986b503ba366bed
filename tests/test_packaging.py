"""A pip user gets a wheel with one top-level name, which installs and imports away from this checkout."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import paretoik

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.slow  # it builds the package and makes an environment

PROBE = """
import paretoik, sys
print(paretoik.__file__, paretoik.__version__, paretoik.kinetic_energy.name, "problems" in sys.modules)
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    subprocess.run(command, check=True, capture_output=True)
    (built,) = folder.glob("*.whl")
    return built


def test_the_wheel_holds_every_file_of_paretoik_and_nothing_else(wheel):
    held = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    ours = {
        str(file.relative_to(ROOT))
        for file in (ROOT / "paretoik").rglob("*")
        if file.is_file() and "__pycache__" not in file.parts
    }
    assert held == ours
    assert {"paretoik/py.typed", "paretoik/__init__.pyi", "paretoik/__main__.py"} <= held


def test_the_wheel_carries_its_licence_and_its_version(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert f"paretoik-{paretoik.__version__}.dist-info/METADATA" in names
    assert f"paretoik-{paretoik.__version__}.dist-info/licenses/LICENSE" in names


def test_the_wheel_imports_in_an_environment_of_its_own(wheel, tmp_path):
    environment = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--system-site-packages", str(environment)], check=True)
    python = str(environment / "bin" / "python")
    # The dependencies are those of the environment that runs the tests, which need not be the system's.
    (site,) = environment.glob("lib/python*/site-packages")
    (site / "dependencies.pth").write_text(str(Path(pytest.__file__).parents[1]))
    command = [python, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--ignore-installed", str(wheel)]
    subprocess.run(command, check=True, cwd=tmp_path)
    said = subprocess.run(
        [python, "-c", PROBE], check=True, cwd=tmp_path, capture_output=True, text=True
    ).stdout.split()
    assert Path(said[0]).is_relative_to(environment)
    assert said[1:] == [paretoik.__version__, "kinetic_energy", "False"]
    script = [str(environment / "bin" / "paretoik"), "--version"]
    assert (
        subprocess.run(script, check=True, capture_output=True, text=True).stdout
        == f"paretoik {paretoik.__version__}\n"
    )
