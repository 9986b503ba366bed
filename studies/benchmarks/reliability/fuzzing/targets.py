"""What is fuzzed: readers of URDFs and of run folders, and command lines; wrong outcomes are defects."""

from __future__ import annotations

import functools
import hashlib
import io
import json
import os
import re
import shutil
import sys
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, chdir, contextmanager, redirect_stderr, redirect_stdout
from hashlib import sha256
from pathlib import Path
from unittest.mock import patch

import numpy as np
import typer

import paretoik as pk
from paretoik.cli import main
from paretoik.cli.app import app
from paretoik.errors import InvalidRobot, ParetoikError
from paretoik.front.choice_tree import read_choices
from paretoik.front.points import StoredJoints, StoredMotions
from paretoik.inputs import cause_of
from paretoik.robot.arm import Arm
from paretoik.robot.urdf import check_robot
from paretoik.robot.urdf_reading import read_robot
from paretoik.runs.files import CHECKPOINT, CHOICES, JOURNAL, MOTIONS, RUN, TABLE, run_bytes
from paretoik.runs.journal import Journal, key_of
from studies.benchmarks.reliability.inputs.judging import message_faults


class Defect(Exception):  # noqa: N818  the name says what it is
    """An error that is not ours, a warning, or a bad message; its text is one line."""


@contextmanager
def refusals(*names: str) -> Iterator[None]:
    """Run the body: an error of ours that has one of the ``names`` is a refusal; raise Defect for others."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            yield
        except ParetoikError as refusal:
            check_message(str(refusal), *names)
        except Defect:
            raise
        except Exception as error:
            frames = [each for each in traceback.extract_tb(error.__traceback__) if "/paretoik/" in each.filename]
            place = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "no file of ours"
            raise Defect(f"{cause_of(error)} in {place}") from error


def check_message(message: str, *names: str) -> None:
    """Raise Defect unless a message is one line with one of the ``names``, a wish and a fact."""
    faults = message_faults(message, is_named=any(name in message for name in names))
    if faults:
        raise Defect(f"{', '.join(faults)}: {' '.join(message.split())[:300]}")


def kind_of(defect: Defect) -> str:
    """Return a defect without its numbers and quotes: equal for inputs with the same defect."""
    return re.sub(r"'[^']*'|\"[^\"]*\"|/\S*|[\d.e+-]+", "~", str(defect))


TIPS = 3  # chains built from a robot


class UrdfFiles:
    """Reads bytes as a URDF, in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "robot.urdf"

    def __call__(self, data: bytes) -> None:
        """Check bytes, and build every chain from the root to one of the first leaves; raise Defect."""
        self._file.write_bytes(data)
        with refusals(self._file.name):
            report = check_robot(self._file)
            for fault in report.faults:  # the report names the file
                check_message(fault, "")
            tips = [None] if report.faults else read_robot(self._file).leaves[:TIPS]
            for tip in tips:
                with refusals(self._file.name):
                    try:
                        arm = Arm.from_urdf(self._file, tip=tip, zero_limits="unlimited")
                    except InvalidRobot as refusal:  # lists all faults, however many
                        for fault in refusal.faults:
                            check_message(fault, "")
                        continue
                    for q in (np.zeros(arm.dof), np.ones(arm.dof)):
                        if not (np.isfinite(arm.pose(q).position).all() and np.isfinite(arm.jacobian(q)).all()):
                            raise Defect("an arm whose poses are not finite")


STORED_JOURNAL = f"{CHECKPOINT}/{JOURNAL}"
FILES = (RUN, TABLE, MOTIONS, CHOICES, STORED_JOURNAL)


class RunFolders:
    """Reads bytes as one file of a run: the first says which, and whether the others get new digests."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "run"
        self.contents = whole_run(self._folder)

    def __call__(self, data: bytes) -> None:
        """Open a run with one file replaced, by every reader; raise Defect."""
        if not data:
            return
        name, is_anew = FILES[data[0] // 2 % len(FILES)], bool(data[0] % 2)
        contents = {**self.contents, name: data[1:]}
        for file, content in (with_digests(contents) if is_anew else contents).items():
            (self._folder / file).parent.mkdir(exist_ok=True)
            (self._folder / file).write_bytes(content)
        names = ("run", *FILES)
        with refusals(*names):
            front = pk.Front.load(self._folder)
            assert repr(front)
            front.select("compromise")
        with refusals(*names):
            assert repr(read_choices(self._folder))
        with refusals(*names):
            Journal(self._folder / STORED_JOURNAL).close()
        with refusals(*names):
            assert repr(pk.verify(self._folder))


def whole_run(folder: Path) -> dict[str, bytes]:
    """Write a small run with choices and a journal, and return the contents of its files by name."""
    shutil.rmtree(folder, ignore_errors=True)
    q = np.linspace(0.0, 1.0, 3 * 5 * 2).reshape(3, 5, 2)
    motions = StoredMotions(arm=StoredJoints(joint_names=("a", "b")), time=np.tile(np.arange(5.0), (3, 1)), q=q)
    front = pk.Front(
        ids=np.array([0, 3, 7]),
        objectives=np.array([[1.0, 3.0], [2.0, 2.0], [3.0, 1.0]]),
        names=["f", "g"],
        units=["J", ""],
        maximised=[False, False],
        motions=motions,
        violation=np.zeros(3),
        provenance={"status": "generations", "seed": 1},
    )
    front.save(folder)
    front.select("compromise")
    journal = Journal(folder / STORED_JOURNAL)
    journal.append(key_of("key"), {"F": np.ones((2, 2)), "names": np.array(["x"])})
    journal.close()
    return {file: (folder / file).read_bytes() for file in FILES}


def with_digests(contents: dict[str, bytes]) -> dict[str, bytes]:
    """Return files with digests that fit; digests of invalid JSON stay as they are."""
    contents = dict(contents)
    for file in (RUN, CHOICES):
        try:
            entries = json.loads(contents[file])
            if file == RUN:
                entries["files"] = {
                    each: hashlib.sha256(contents[each]).hexdigest() if each in contents else digest
                    for each, digest in entries["files"].items()
                }
            version = entries.pop("format")
            entries.pop("digest", None)
            contents[file] = run_bytes(entries).replace(b'"format": 1', f'"format": {json.dumps(version)}'.encode(), 1)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            continue
    return contents


CODES = (0, 2, 3, 4, 5, 6, 7)  # the documented ones of commands that end by themselves
PROJECT = {
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
        self._contents = run | {name: text.encode() for name, text in PROJECT.items()}
        self._get_command = functools.cache(typer.main.get_command)  # otherwise all signatures are read every time

    def __call__(self, data: bytes) -> None:
        """Run a command; raise Defect."""
        self.run([os.fsdecode(word) for word in data.split(b"\0")])

    def run(self, words: list[str]) -> None:
        """Run the words of a command; raise Defect."""
        shutil.rmtree(self._folder)  # the last command may have left anything there
        for name, content in self._contents.items():
            (self._folder / name).parent.mkdir(parents=True, exist_ok=True)
            (self._folder / name).write_bytes(content)
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
            for name in PROJECT:
                sys.modules.pop(Path(name).stem, None)  # of another target's folder
            try:
                main()
            except SystemExit as end:
                code = 0 if end.code is None else end.code
        _check(code, out.getvalue(), err.getvalue(), several=words[0] == "list")


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
            if not line.endswith("--help'"):  # of the parser of command lines
                check_message(line, ": ")


VALUES = (
    *("", " ", "0", "-1", "2", "0.5", "nan", "inf", "1e309", "9" * 30, "x", "\u20ac", "../x", "-x", "=x", "a,b", ","),
    *(
        "run",
        "robot.urdf",
        "new",
        "new.csv",
        "new.png",
        "no_problem.py",
        "no_problem.py:value",
        "tiny.py:tiny",
        "os:abort",
    ),
    *("f", "f=1", "f=1,g=2", "f=nan,g=1", "f=1,f=2", "f=", "=1", "f<=2", "f>=3,f<=1", "f=improve,g=free", "f=10%,g"),
    *("csv", "npz", "ros2-bag", "franka", "gen3", "sqp", "auto", "tcp://", "http://127.0.0.1", "a", "b", "b,a"),
)
"""The values of options; none makes a command compute for long, or connect to anything."""

ARGUMENTS = {
    "list": "no_problem.py",
    "solve": "tiny.py:tiny --out run --population 4 --generations 2",  # only with --overwrite: it searches and records
    "plan": "tiny.py:tiny --out new",
    "front": "tiny.py:tiny --out new",
    "refine": "run --out new",
    "check-robot": "robot.urdf",
}
"""The argument of a verb, by its name; that of the others is the run."""
LEFT_OUT = ("--live", "--workers")  # a viewer, and processes that take seconds to begin


class VerbOptions(CommandLines):
    """Reads bytes as a verb and its options: one byte for the verb, then two for an option and its value.

    An option beyond the last is a word without a meaning.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        # The options of every verb: their names, and whether they are flags
        group = typer.main.get_command(app)
        self.options = {
            verb: [
                (name, bool(getattr(parameter, "is_flag", False)))
                for parameter in command.params
                if parameter.param_type_name == "option"
                for name in (*parameter.opts, *parameter.secondary_opts)
                if name not in LEFT_OUT
            ]
            for verb, command in group.commands.items()  # type: ignore[attr-defined]
        }

    def __call__(self, data: bytes) -> None:
        """Run a verb with options; raise Defect."""
        if data:
            self.run(self.words(data))

    def words(self, data: bytes) -> list[str]:
        """Return the words of the command line that bytes, at least one, stand for."""
        verb = list(self.options)[data[0] % len(self.options)]
        words = [verb, *ARGUMENTS.get(verb, "run").split()]
        for which, value in zip(data[1::2], data[2::2], strict=False):
            name, is_flag = [*self.options[verb], ("", False)][which % (len(self.options[verb]) + 1)]
            words += [name] * bool(name) + [VALUES[value % len(VALUES)]] * (not is_flag)
        return words


CORPUS = Path(__file__).parents[4] / "tests" / "fuzzing" / "corpus"
TARGETS: dict[str, Callable[[Path], UrdfFiles | RunFolders | CommandLines]] = {
    "urdf": UrdfFiles,
    "folders": RunFolders,
    "commands": CommandLines,
    "options": VerbOptions,
}


def inputs(target: str) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the bytes of every input of a target, in order."""
    for file in sorted((CORPUS / target).iterdir()):
        yield file.name, file.read_bytes()


def keep(folder: Path, data: bytes) -> Path:
    """Write an input into a folder, named by the beginning of its digest, and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / sha256(data).hexdigest()[:16]
    file.write_bytes(data)
    return file
