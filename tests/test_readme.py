"""The README's examples work as printed."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np

import paretoik as pk
from paretoik.loading import load_problem, load_value

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(text):
    return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)


def test_the_examples_run_as_printed(capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    names = {"__name__": "readme"}
    for block in blocks(README):
        exec(compile(block, "README.md", "exec"), names)
    printed = capsys.readouterr().out
    assert "has the least weighted sum" in printed
    assert "kinetic_energy" in printed


def test_the_problem_of_the_problems_readme_can_be_solved(tmp_path):
    readme = (ROOT / "problems" / "README.md").read_text(encoding="utf-8")
    example, controller = blocks(readme.partition("## One's own\n")[2])
    (tmp_path / "mine.py").write_text(f"{example}\n\n{controller}")
    shutil.copy(ROOT / "problems" / "robots" / "panda.urdf", tmp_path)
    problem = load_problem(f"{tmp_path / 'mine.py'}:reach")
    limits = load_value("controller", f"{tmp_path / 'mine.py'}:CONTROLLER")
    assert isinstance(limits, pk.controllers.Controller)
    assert tuple(limits.joint_names) == tuple(problem.task.arm.joint_names)
    front = pk.solve(problem, population=12, generations=2, seed=1)
    assert front.names == ("kinetic_energy", "elbow_height")
    assert front.motions.clearance.min() >= 0.01 - 1e-9
    np.testing.assert_allclose(
        front.motions.tool_rotation[..., 2],
        np.broadcast_to([0.0, 0.0, -1.0], (*front.motions.q.shape[:2], 3)),
        atol=1e-9,
    )


def test_where_the_papers_are_is_where_the_studies_say():
    """In lines ``file``: ``name``, ``name`` the file is there and defines the names."""
    readme = (ROOT / "studies" / "README.md").read_text(encoding="utf-8")
    places = re.findall(r"`([\w/]+\.py)`((?:(?:: |, )`\w+`)*)", readme.partition("## Places of the papers")[2])
    assert len(places) > 50
    for file, names in places:
        code = (ROOT / file).read_text(encoding="utf-8")
        for name in re.findall(r"`(\w+)`", names):
            assert re.search(rf"^ *(def|class) {name}\b|^ *{name}(: |\b.*=)", code, re.MULTILINE), (file, name)


def test_the_readme_has_at_most_150_lines_of_120_characters():
    lines = README.splitlines()
    assert len(lines) <= 150
    assert max(map(len, lines)) <= 120


def test_the_picture_and_the_problem_of_the_readme_exist():
    (picture,) = re.findall(r"!\[.*?\]\((.*?)\)", README)
    assert (ROOT / picture).is_file()
    assert (ROOT / "problems" / "tringali_2020.py").is_file()
    assert "paretoik solve problems/tringali_2020.py:energy_torque" in README
