"""Functions that run the command line, and the problems of its tests."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import pytest

import paretoik as pk
from paretoik.runs.files import RUN, read_run

ROOT = Path(__file__).parents[2]
PANDA = str(ROOT / "problems" / "robots" / "panda.urdf")
SMALL = ("--population", "8", "--generations", "3")
MINE = """
import time

from paretoik import Limits, Tracking, kinetic_energy, line, objective, torque_norm
from paretoik.robot.arms import tringali_3r

PATH = line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=21)

@objective(unit="", form="general")
def worn(motion):
    raise RuntimeError("the bearing\\nis worn")

@objective(unit="", form="general")
def chatty(motion):
    print("chatter")
    return motion.q[..., 0, 0]

def tracking(*objectives, **limits):
    return Tracking(
        tringali_3r(), PATH, objectives=objectives, limits=Limits(**limits), coefficients=4, bases=2
    )

def good() -> Tracking:
    '''[bold]Good[/bold] for tests.'''
    return tracking(kinetic_energy, torque_norm)

def impossible() -> Tracking:
    return tracking(kinetic_energy, torque_norm, velocity=1e-3)

def failing() -> Tracking:
    return tracking(kinetic_energy, worn)

@objective(unit="", form="general")
def asleep(motion):
    time.sleep(60)

def sleeping() -> Tracking:
    return tracking(kinetic_energy, asleep)

def talking() -> Tracking:
    print("hello")
    return tracking(kinetic_energy, chatty)
"""


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    code: int
    out: str
    err: str


def load_front(run: Path) -> pk.Front:
    """Return the front of a run with the problem that the run names."""
    return pk.load_front(run, read_run(run / RUN)["problem"])


def strict(text: str) -> object:
    return json.loads(text, parse_constant=pytest.fail)


def started(mine: str, out: Path) -> subprocess.Popen[str]:
    """Return a run in its own process that has finished one generation and would take long."""
    endless = "--population", "40", "--generations", "100000"
    process = start_process("solve", f"{mine}:good", "--out", out, *endless)
    assert process.stderr is not None
    assert first_progress(process.stderr).startswith("generation 1/100000, front ")
    return process


def start_process(*words: str | Path) -> subprocess.Popen[str]:
    """Return a process that runs the command line."""
    return subprocess.Popen(
        [sys.executable, "-m", "paretoik", *map(str, words)],
        cwd=ROOT,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def first_progress(stderr: Iterable[str]) -> str:
    """Return the first line with counts: no notice of compilation, nor of the beginning."""
    return next(line for line in stderr if not line.startswith(("compiling ", "beginning")))
