"""Runs of the command line killed at moments spread over their whole length, and their results after resuming."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
import pyarrow.parquet as pq

from paretoik.runs.file_replacement import without_writers
from paretoik.runs.files import CHECKPOINT, JOURNAL, MOTIONS, OPTIMA, RUN, TABLE, can_resume
from studies.benchmarks.checkouts import ROOT
from studies.benchmarks.reliability.killed_run import FILE_PHASES, PHASES, Phase
from studies.benchmarks.scaling.local_cluster import local_cluster
from studies.reporting import Row, tell

Outcome = Literal["nothing yet", "whole", "went on", "refused", "another course", "another result"]
LOST: tuple[Outcome, ...] = ("refused", "another course", "another result")
PER_PHASE = 20  # goal: kills
SHORT = 0.02  # s: a phase that takes less is not killed in
TWICE, DAMAGED = 3, 2  # one of so many runs is killed again when it resumes; has a bit of its journal flipped first

ENERGY_TORQUE = "problems/tringali_2020.py:energy_torque"
SHARED: dict[str, tuple[str, ...]] = {
    "search": ("solve", ENERGY_TORQUE, "--population=60", "--generations=40", "--seed=1"),
    "search and refinement": (
        *("solve", ENERGY_TORQUE, "--refine", "--population=40", "--generations=12", "--points=8", "--seed=1"),
    ),
    "front": ("front", ENERGY_TORQUE, "--points=4", "--starts=8"),
    "refinement": ("refine", "SEARCH", "--problem", ENERGY_TORQUE),
}
COMMANDS: dict[str, tuple[str, ...]] = {
    **SHARED,
    "plan": ("plan", "problems/tringali_2020.py:simulation_2", "--starts=24"),
    "closed loop": ("solve", "problems/marcos_2012.py:circle_3r", "--generations=10", "--population=20"),
    **{f"{name}, workers": (*command, "--workers=2") for name, command in SHARED.items()},
    **{f"{name}, cluster": (*command, "--cluster", "CLUSTER") for name, command in SHARED.items()},
}
"""The commands by name; SEARCH is the folder of a whole search, CLUSTER the address of a scheduler."""


class WholeRun(NamedTuple):
    """A run that was never killed: its ``command``, the part that names the ``workers``, and its result.

    Its ``amounts`` of every phase are seconds, or numbers; digests of ``entries`` in the journal are by their keys.
    """

    name: str
    command: tuple[str, ...]
    workers: tuple[str, ...]
    result: str
    amounts: Mapping[Phase, float]
    seconds: float
    entries: Mapping[str, str]


class Kill(NamedTuple):
    """A kill of a run in a phase, the outcome, and the ``cause`` if refused.

    ``unsaved`` is the work since the journal's last entry [s], NaN while workers start; None if the run ended before.
    """

    name: str
    phase: Phase
    outcome: Outcome
    unsaved: float | None
    cause: str = ""


def whole_run(name: str, folder: Path, replacements: Mapping[str, str]) -> WholeRun:
    """Do a run without a kill; words of its command are replaced."""
    command = tuple(replacements.get(word, word) for word in COMMANDS[name])
    process = run_killed(command, folder, "else", np.inf)
    if process.returncode != 0:
        raise RuntimeError(f"{name}: {process.stderr}")
    workers = command[len(COMMANDS[name.partition(",")[0]]) :]
    return WholeRun(name=name, command=command, workers=workers, result=result_of(folder), **_last_words(process))


def kill(
    run: WholeRun, phase: Phase, amount: float, folder: Path, *, again: float | None = None, damaged: int | None = None
) -> Kill:
    """Kill a run in a phase, and again at ``again`` of it after it was resumed; then let it end.

    ``damaged`` is the seed of a bit that is flipped in its journal before it is resumed.
    """
    shutil.rmtree(folder, ignore_errors=True)
    process, unsaved = run_killed(run.command, folder, phase, amount), None
    if process.returncode == -signal.SIGKILL:
        done = _last_words(process)
        # Until the journal has a result workers are only starting.
        unsaved = float(done["unsaved"]) if done["results"] or not run.workers else np.nan
    for limit in (again, None):
        if not can_resume(folder):
            break
        if damaged is not None:  # one bit, anywhere
            file, rng = folder / CHECKPOINT / JOURNAL, np.random.default_rng(damaged)
            content = bytearray(file.read_bytes())
            if content:
                content[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
                file.write_bytes(content)
        problem = next(word for word in run.command if ".py:" in word)
        command = ("resume", str(folder), "--problem", problem, *run.workers)
        resumed = run_killed(command, folder, phase, np.inf if limit is None else limit, out=False)
        if resumed.returncode not in (0, -signal.SIGKILL):
            return Kill(run.name, phase, "refused", unsaved, resumed.stderr.strip().splitlines()[-2:][0])
        process = resumed
    return Kill(run.name, phase, _outcome(run, process, folder), unsaved)


def _last_words(process: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    """Return a process's words at its end; workers may have added theirs later."""
    done: dict[str, Any] = json.loads([line for line in process.stderr.splitlines() if line.startswith("{")][-1])
    return done


def _outcome(run: WholeRun, process: subprocess.CompletedProcess[str], folder: Path) -> Outcome:
    if not ((folder / RUN).exists() and "files" in json.loads((folder / RUN).read_text())):
        return "nothing yet"
    if result_of(folder) != run.result:
        return "another result"
    if process.returncode == -signal.SIGKILL:
        return "whole"  # it had its result
    # A resumed run reads the latest entries, not those that led to them.
    if not _last_words(process)["entries"].items() <= run.entries.items():
        return "another course"
    return "went on" if "resume" in process.args else "whole"


def result_of(folder: Path) -> str:
    """Return the digest of a run's result: its table and its motions, bit for bit."""
    digest = sha256()
    with without_writers(folder):
        table = OPTIMA if (folder / OPTIMA).exists() else TABLE
        for name, column in pq.read_table(folder / table).to_pydict().items():
            digest.update(f"{name}{column}".encode())
        with np.load(folder / MOTIONS, allow_pickle=False) as arrays:
            for name in sorted(arrays.files):
                digest.update(name.encode() + arrays[name].tobytes())
    return digest.hexdigest()


def run_killed(
    command: tuple[str, ...], folder: Path, phase: Phase, amount: float, *, out: bool = True
) -> subprocess.CompletedProcess[str]:
    """Run a command of ``paretoik`` into a folder, or on one without ``out``, in a process that kills itself."""
    killed = [sys.executable, "-m", "studies.benchmarks.reliability.killed_run", str(folder), phase, str(amount)]
    arguments = [*command, "--quiet", *(("--out", str(folder)) if out else ())]
    return subprocess.run([*killed, *arguments], cwd=ROOT, capture_output=True, text=True, check=False)


def spread_kills(runs: Sequence[WholeRun], count: int) -> dict[str, list[tuple[Phase, float]]]:
    """Return phases and amounts of ``count`` kills by the names of runs; a short phase gets none.

    Every phase has an even share of the kills, and every run that has the phase an even share of these, at even
    distances: a run may have no refinement, and another one nothing else.
    """
    moments: dict[str, list[tuple[Phase, float]]] = {run.name: [] for run in runs}
    having = {phase: [run for run in runs if run.amounts.get(phase, 0.0) > SHORT] for phase in PHASES}
    phases = [phase for phase in PHASES if having[phase]]
    for phase, kills in zip(phases, np.array_split(np.arange(count), len(phases)), strict=True):
        for run, share in zip(having[phase], np.array_split(kills, len(having[phase])), strict=True):
            for number in range(len(share)):
                amount = (number + 0.5) / len(share) * run.amounts[phase]
                moments[run.name].append((phase, 1 + int(amount) if phase in FILE_PHASES else amount))
    return moments


def kill_rows(folder: Path, count: int, names: Sequence[str]) -> Iterator[Row]:
    """Kill runs of these names ``count`` times in all; yield what was lost of each, and in each phase."""
    kills, runs = list[Kill](), list[WholeRun]()
    with ExitStack() as stack:
        replacements = {"SEARCH": str(folder / "source")}
        whole_run("search", folder / "source", {})
        if any("--cluster" in COMMANDS[name] for name in names):
            replacements["CLUSTER"] = stack.enter_context(local_cluster(folder, 2)).address
        for name in names:
            runs.append(whole_run(name, folder / "whole", replacements))
            shutil.rmtree(folder / "whole")
            tell(f"{name}: whole, {runs[-1].seconds:.1f} s, {len(runs[-1].entries)} entries")
        moments = spread_kills(runs, count)
        for run in runs:
            for number, (phase, amount) in enumerate(moments[run.name]):
                again = amount / 2 if number % TWICE == 0 else None
                damaged = number if number % DAMAGED == 0 else None
                kills.append(kill(run, phase, amount, folder / "killed", again=again, damaged=damaged))
                told = f"{phase} {amount:.3g}: {kills[-1].outcome} {kills[-1].cause}"
                tell(f"{run.name}: {number + 1} of {len(moments[run.name])}, {told}")
            its, row = [each for each in kills if each.name == run.name], partial(Row, "kills", run.name)
            outcomes = Counter(each.outcome for each in its)
            causes = ", ".join(sorted({each.cause for each in its if each.cause}))
            words = ", ".join(f"{number} {outcome}" for outcome, number in outcomes.most_common())
            yield row("kills", "", len(its), note=words)
            yield row("lost", "", sum(outcomes[each] for each in LOST), reference=0, source="goal", note=causes)
            unsaved = [each.unsaved for each in its if each.unsaved is not None and np.isfinite(each.unsaved)]
            if unsaved:
                yield row("work lost, median", "s", float(np.median(unsaved)), reference=1, source="goal")
                yield row("work lost, most", "s", max(unsaved), reference=1, source="goal")
    for phase in PHASES:
        met = [each for each in kills if each.phase == phase and each.unsaved is not None]
        lost = sum(each.outcome in LOST for each in met)
        note = "refused, or by another course or to another result" if lost else ""
        yield Row("phases", phase, "kills", "", len(met), reference=PER_PHASE, source="goal")
        yield Row("phases", phase, "lost", "", lost, reference=0, source="goal", note=note)
