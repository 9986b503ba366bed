"""A command line of any words: it ends with a documented exit code, and refuses in one line."""

from __future__ import annotations

import functools
import io
import os
import shutil
import sys
from contextlib import ExitStack, chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import patch

import typer

from paretoik.cli import main
from studies.benchmarks.reliability.fuzzing.defect import Defect, check_message, refusals
from studies.benchmarks.reliability.fuzzing.run_folders import whole_run

CODES = (0, 2, 3, 4, 5, 6, 7)  # the documented ones of commands that end by themselves
FILES = {
    "robot.urdf": '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">'
    '<parent link="a"/><child link="b"/></joint></robot>',
    "faulty.urdf": '<robot name="r"><link name="a"/><link name="a"/></robot>',
    "no_problem.py": "value = 3\n",
    "tiny.py": "from pymoo.problems import get_problem\n\ntiny = get_problem('zdt1', n_var=2)\n",
}
SCREENS = ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")  # no viewer may open


class CommandLines:
    """Reads bytes as the words of a command line, NUL between them, in a folder with a run, robots and a module."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "project"
        self._folder.mkdir()
        run = {f"run/{name}": content for name, content in whole_run(folder / "run").items()}
        self._contents = run | {name: text.encode() for name, text in FILES.items()}
        self._get_command = functools.cache(typer.main.get_command)  # otherwise all signatures are read every time

    def __call__(self, data: bytes) -> None:
        """Run a command; raise Defect."""
        self.run([os.fsdecode(word) for word in data.split(b"\0")])

    def run(self, words: list[str]) -> None:
        """Run the words of a command; raise Defect."""
        self._make_project()
        out, err = io.StringIO(), io.StringIO()
        code: object = None
        argv = patch.object(sys, "argv", ["paretoik", *words])
        with ExitStack() as stack:
            for context in (refusals(), chdir(self._folder), redirect_stdout(out), redirect_stderr(err), argv):
                stack.enter_context(context)
            stack.enter_context(patch.object(typer.main, "get_command", self._get_command))
            stack.enter_context(patch.dict(os.environ))
            stack.enter_context(patch.object(sys, "path", [*sys.path]))
            for name in SCREENS:
                os.environ.pop(name, None)
            for name in FILES:
                sys.modules.pop(Path(name).stem, None)  # of another target's folder
            try:
                main()
            except SystemExit as end:
                code = 0 if end.code is None else end.code
        _check(code, out.getvalue(), err.getvalue(), several=words[0] == "list")

    def _make_project(self) -> None:
        """Make the folder new, as the last command may have left anything there."""
        shutil.rmtree(self._folder)
        for name, content in self._contents.items():
            (self._folder / name).parent.mkdir(parents=True, exist_ok=True)
            (self._folder / name).write_bytes(content)


def _check(code: object, out: str, err: str, *, several: bool) -> None:
    """Raise Defect; a command for ``several`` files has one line for each that it refuses."""
    if code not in CODES:
        raise Defect(f"exit code {code}")
    for text in (out, err):
        if "Traceback (most recent" in text:
            raise Defect("a traceback is printed")
    refusal = [line for line in err.splitlines() if line.startswith("error: ")]
    if code == 2 and "fault: " not in out and not out.lstrip().startswith(("Usage", "{")):
        if not refusal or (len(refusal) > 1 and not several):
            raise Defect(f"exit code 2 with {len(refusal)} lines of errors")
        for line in refusal:
            check_message(line, ": ")
