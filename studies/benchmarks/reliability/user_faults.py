"""Faults of users' own code, names and folders, and the outcome of each: one line of our own, or worse.

Observers raise in every stage of every verb. Modules, factories and objectives raise, by command, also what does not
derive from Exception. Objectives have invalid values, write to their motion, or sleep. Folders are used again after a
failure; names have escape sequences; a module next to the problem has the name of one of Python's own.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import paretoik as pk
from paretoik.errors import ParetoikError
from paretoik.runs.files import has_result
from studies.benchmarks.reliability.inputs.judging import outcome_of
from studies.reporting import Row, tell

ESCAPE = "\x1b[31m\x1b]0;title\x07"
LINE, SECONDS, LIMIT, SLEEP = 400, 180.0, 0.5, 600.0  # characters shown of output; s until an end, limit given, asleep
FEW = ("--population", "8", "--generations", "2")
SMALL: dict[str, Any] = {"population": 12, "generations": 4, "seed": 1}
Fault = tuple[str, str, str]  # kind, name, and what is wrong in the outcome: "" if nothing is


def fault_rows(folder: Path) -> Iterator[Row]:
    """Yield the number of bad outcomes of every kind of fault; each is printed."""
    counts, bad = Counter[str](), Counter[str]()
    for part in (_observers, _objectives, _used_folders, _sleepers, _commands, _shadows, _names):
        for kind, name, wrong in part(folder):
            counts[kind] += 1
            if wrong:
                bad[kind] += 1
                tell(f"{kind}: {name}: {wrong}")
    for kind, count in counts.items():
        yield Row("faults", kind, "bad", "", bad[kind], reference=0, source="goal", note=f"of {count}")


def problem(*objectives: Any, **limits: Any) -> pk.Tracking:
    """Return a small problem."""
    path = pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=21)
    goals = objectives or (pk.kinetic_energy, pk.torque_norm)
    limited = pk.Limits(**limits)
    return pk.Tracking(pk.arms.tringali_3r(), path, objectives=goals, limits=limited, coefficients=4, bases=2)


def _observers(folder: Path) -> Iterator[Fault]:
    """Raise in every stage, the first time and the last: the result is kept, and the observer named."""
    pk.solve(problem(), **SMALL, points=4, out=folder / "source", observe=False)
    source = pk.load_front(folder / "source", problem())
    circle = pk.circle((0.30, 0.10), 0.005, duration=1.0, samples=11)
    both = [pk.joint_displacement, pk.position_error]
    loop = pk.ClosedLoop(pk.arms.tringali_3r(), circle, objectives=both, population=12, generations=4)
    verbs: dict[str, Callable[..., Any]] = {
        "solve": partial(pk.solve, problem(), **SMALL, points=4, refine=True),
        "plan": partial(pk.plan, problem(pk.kinetic_energy), starts=4),
        "epsilon_front": partial(pk.epsilon_front, problem(), points=3, starts=4),
        "refine": partial(pk.refine, source),
        "a closed loop": partial(pk.solve, loop),
        "verify": lambda *, observe, out: pk.verify(folder / "source", problem(), observe=observe),
    }
    for verb, call in verbs.items():
        stages = list[str]()
        call(observe=lambda progress, stages=stages: stages.append(progress.stage), out=folder / verb)
        for stage in dict.fromkeys(each for each in stages if each != "compilation"):
            for last in sorted({1, stages.count(stage)}):
                seen = list[str]()

                def watch(progress: Any, stage: str = stage, last: int = last, seen: list[str] = seen) -> None:
                    seen.append(progress.stage)
                    if seen.count(stage) == last:
                        raise LookupError("no more")

                place = folder / f"{verb} {stage} {last}"
                wrong = _refusal(partial(call, observe=watch, out=place), "observe raised LookupError: no more")
                if stage in ("saving", "recording") and not has_result(place):
                    wrong = wrong or "its result is lost"
                yield "observers that raise", f"{verb}, {stage}, call {last}", wrong


ODD: dict[str, Callable[[Any], Any]] = {
    "masked": lambda motion: np.ma.array(motion.q[..., 0, 0], mask=True),
    "complex": lambda motion: motion.q[..., 0, 0] * 1j,
    "one row too many": lambda motion: motion.q[..., 0, :],
    "a column": lambda motion: motion.q[..., 0, :1],
    "text": lambda motion: "abc",
    "None": lambda motion: None,
    "objects": lambda motion: np.full(motion.q.shape[:-2], object()),
    "a generator": lambda motion: (row for row in motion.q),
    "a set": lambda motion: {1.0},
    "dates": lambda motion: np.zeros(motion.q.shape[:-2], dtype="datetime64[s]"),
    "NaN": lambda motion: motion.q[..., 0, 0] * np.nan,
    "infinite": lambda motion: motion.q[..., 0, 0] + np.inf,
}


def _solved_by(verb: str, values: Callable[[Any], Any], **settings: Any) -> Any:
    odd = pk.objective(unit="", form="general", name="odd")(values)
    if verb == "plan":
        return pk.plan(problem(odd), starts=2, observe=False, **settings)
    if verb == "solve":
        return pk.solve(problem(pk.kinetic_energy, odd), **SMALL, observe=False, **settings)
    return pk.epsilon_front(problem(pk.kinetic_energy, odd), points=2, starts=2, observe=False, **settings)


WRITES: dict[str, Callable[[Any], Any]] = {
    "q[...] = 0": lambda motion: motion.q.__setitem__(..., 0.0),
    "q += 1": lambda motion: motion.q.__iadd__(1.0),
    "q.sort()": lambda motion: motion.q.sort(axis=-1),
    "dq[...] = 0": lambda motion: motion.dq.__setitem__(..., 0.0),
    "time[...] = 0": lambda motion: motion.time.__setitem__(..., 0.0),
    "torque *= 0": lambda motion: motion.torque.__imul__(0.0),
    "np.copyto": lambda motion: np.copyto(motion.q, 0.0),
    "out=": lambda motion: np.add(motion.q, 1.0, out=motion.q),
}


def _objectives(_: Path) -> Iterator[Fault]:
    """Give objectives invalid values, or write to a motion: they are named, or what is written changes nothing."""
    for name, values in ODD.items():
        for verb in ("solve", "plan", "epsilon_front"):
            yield "odd values", f"{name}, {verb}", _refusal(partial(_solved_by, verb, values), "odd")
    for name, write in WRITES.items():

        def written(motion: Any, write: Callable[[Any], Any] = write) -> Any:
            write(motion)
            return motion.integral(motion.dq[..., 0] ** 2)

        for verb in ("solve", "plan"):
            wrong = _refusal(partial(_solved_by, verb, written), "odd")
            yield "objectives that write", f"{name}, {verb}", wrong


def _used_folders(folder: Path) -> Iterator[Fault]:
    """Run into the folder of a run that failed, again without permission to overwrite."""
    failing: dict[str, Callable[..., Any]] = {
        "infeasible": partial(pk.solve, problem(velocity=1e-3), **SMALL),
        "infeasible plan": partial(pk.plan, problem(pk.kinetic_energy, velocity=1e-3), starts=2),
        "every evaluation fails": partial(_solved_by, "solve", ODD["NaN"]),
        "no value in plan": partial(_solved_by, "plan", ODD["NaN"]),
    }
    for name, call in failing.items():
        place = folder / f"failed {name}"
        _refusal(partial(call, out=place), ".")
        wrong = ""
        try:
            pk.solve(problem(), **SMALL, out=place, observe=False)
        except ParetoikError as refusal:
            wrong = str(refusal)
        yield "failed folders", name, wrong


def _sleepers(_: Path) -> Iterator[Fault]:
    """Sleep in an objective from its first call in a verb on: a limit ends it, by name."""
    verbs: dict[str, Callable[..., Any]] = {
        "solve": partial(pk.solve, population=4, generations=1),
        "plan": pk.plan,
        "epsilon_front": pk.epsilon_front,
    }
    for verb, run in verbs.items():
        asleep = [False]

        def values(motion: Any, asleep: list[bool] = asleep) -> Any:
            if asleep[0]:
                time.sleep(SLEEP)
            return motion.q[..., 0, 0] ** 2

        odd = pk.objective(unit="", form="general", name="odd")(values)
        slow = problem(odd) if verb == "plan" else problem(pk.kinetic_energy, odd)
        asleep[0] = True
        wrong = _refusal(partial(run, slow, time_limit=LIMIT, observe=False), "odd took longer")
        yield "sleeping functions", f"{verb}, time_limit", wrong
        if verb == "solve":
            late = partial(run, slow, evaluation_timeout=LIMIT, workers=1, observe=False)
            yield "sleeping functions", f"{verb}, evaluation_timeout", _refusal(late, "took longer than|failed")


HEAD = """import sys, time
import numpy as np
import paretoik as pk

PATH = pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=21)

def small(*objectives):
    return pk.Tracking(pk.arms.tringali_3r(), PATH, objectives=objectives, coefficients=4, bases=2)

class Own(BaseException):
    pass

class Untold(Exception):
    def __str__(self):
        raise ValueError
"""
RAISES = {
    "sys.exit(0)": "sys.exit(0)",
    "sys.exit()": "sys.exit()",
    "GeneratorExit": "raise GeneratorExit",
    "BaseException": "raise Own('two\\nlines')",
    "no text": "raise Untold",
    "an escape sequence": f"raise ValueError({ESCAPE!r})",
    "sleep": "time.sleep(600)",
}
PLACES = {
    "module": "{code}\ndef mine() -> pk.Tracking:\n    return small(pk.kinetic_energy, pk.torque_norm)\n",
    "factory": "def mine() -> pk.Tracking:\n    {code}\n    return small(pk.kinetic_energy, pk.torque_norm)\n",
    "objective": '@pk.objective(unit="", form="general")\ndef odd(motion):\n    {code}\n'
    "    return motion.q[..., 0, 0]\n\n"
    "def mine() -> pk.Tracking:\n    return small(pk.kinetic_energy, odd)\n",
}


def _commands(folder: Path) -> Iterator[Fault]:
    """Raise, or sleep, in modules, factories and objectives of a command: one line, and exit code 2 or 4."""
    for place, text in PLACES.items():
        for name, code in RAISES.items():
            file = folder / f"mine_{place}_{list(RAISES).index(name)}.py"
            file.write_text(HEAD + text.format(code=code))
            limits = {"sleep": ["--time-limit", "1"]}.get(name, [])
            words = ["solve", f"{file}:mine", "--out", str(folder / file.stem), *FEW]
            yield "commands", f"{name} in a {place}", _command(*words, "--quiet", *limits)
            if name == "sleep" and place == "objective":
                wrong = _command(*words, "--quiet", "--overwrite", "--evaluation-timeout", "0.3")
                yield "commands", f"evaluation timeout in an {place}", wrong


def _command(*words: str, codes: tuple[int, ...] = (2, 4)) -> str:
    """Return what is wrong with how a command ends and what it prints."""
    try:
        ended = subprocess.run(
            [sys.executable, "-m", "paretoik", *words], capture_output=True, text=True, timeout=SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        return f"does not end within {SECONDS:g} s"
    if ended.returncode not in codes:
        return f"exit code {ended.returncode}: {ended.stderr[-LINE:]!r}"
    printed = ended.stdout + ended.stderr
    lines = [line for line in ended.stderr.splitlines() if not line.startswith(("compiling", "note:"))]
    if "Traceback" in printed or (0 not in codes and (len(lines) != 1 or not lines[0].startswith("error: "))):
        return f"not one line: {ended.stderr[-LINE:]!r}"
    return "" if re.sub(r"[\n\t]", "", printed).isprintable() else f"steers a terminal: {printed[-LINE:]!r}"


def _shadows(folder: Path) -> Iterator[Fault]:
    """Put modules with names of Python's own next to the problem: they never run."""
    place = folder / "shadowed"
    place.mkdir()
    for name in ("secrets", "queue", "numpy", "json", "signal", "pickle", "random", "sitecustomize"):
        (place / f"{name}.py").write_text(f"open({str(place / 'ran')!r}, 'a').write({name!r})\nraise SystemExit(9)\n")
    (place / "mine.py").write_text(HEAD + PLACES["factory"].format(code="pass"))
    for name, options in {"alone": [], "with workers": ["--workers", "2"]}.items():
        words = ["solve", f"{place / 'mine.py'}:mine", "--out", str(place / name), *FEW]
        wrong = _command(*words, "--quiet", *options, codes=(0,))
        ran = (place / "ran").read_text() if (place / "ran").exists() else ""
        yield "shadowed modules", name, wrong or (ran and f"ran: {ran}")


def _names(folder: Path) -> Iterator[Fault]:
    """Give folders, files and joints names with escape sequences: text, pages and pictures have none."""
    place = folder / f"run{ESCAPE}"
    file = folder / f"mine{ESCAPE}.py"
    file.write_text(HEAD + PLACES["factory"].format(code="pass"))
    reference = f"{file}:mine"
    urdf = Path(pk.__file__).parents[1] / "problems" / "robots" / "panda.urdf"
    robot = folder / "robot.urdf"
    robot.write_text(urdf.read_text().replace('"panda_joint1"', '"joint\u009b31m"'))
    commands = {
        "solve": ["solve", reference, "--out", str(place), *FEW],
        "resume": ["resume", str(place), "--problem", reference],
        "verify": ["verify", str(place), "--problem", reference],
        "select": ["select", str(place), "--knee", "--problem", reference],
        "report": ["report", str(place), "--problem", reference],
        "compare": ["compare", str(place), str(place)],
        "list": ["list", str(file)],
        "show": ["show", str(place / "nothing")],
        "check-robot": ["check-robot", str(robot), "--base", "panda_link0", "--tip", "panda_hand_tcp"],
        "a missing robot": ["check-robot", str(folder / f"none{ESCAPE}.urdf")],
    }
    for name, words in commands.items():
        wrong = _command(*words, codes=tuple(range(8)))
        is_bad = wrong.startswith(("steers", "not one line: 'Traceback", "does not end"))
        yield "names that steer", name, wrong if is_bad else ""
    for page in sorted([*place.rglob("*.html"), *place.rglob("*.svg")]):
        text = page.read_text(errors="replace")
        yield "names that steer", page.suffix, "" if "\x1b" not in text else "an escape sequence"


def _refusal(call: Callable[[], object], words: str) -> str:
    """Return the fault of what a call raises: it must be one printable line of our own with the words."""
    began = time.monotonic()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        outcome = outcome_of(call, words)
    if outcome.verdict == "good":
        return "" if time.monotonic() - began < SECONDS else "too late"
    return outcome.words
