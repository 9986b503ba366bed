"""What the README shows works as printed."""

from __future__ import annotations

import re
from pathlib import Path

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def test_the_example_runs_as_printed(capsys):
    (example,) = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    exec(compile(example, "README.md", "exec"), {"__name__": "readme"})
    assert "has the least weighted sum" in capsys.readouterr().out


def test_its_picture_and_its_problem_exist():
    root = Path(__file__).parents[1]
    (picture,) = re.findall(r"!\[.*?\]\((.*?)\)", README)
    assert (root / picture).is_file()
    assert (root / "problems" / "tringali_2020.py").is_file()
    assert "paretoik solve problems/tringali_2020.py:energy_torque" in README
