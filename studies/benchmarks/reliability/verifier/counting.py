"""Numbers of planted faults that the verifier catches, and of alarms on good runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import paretoik as pk
from studies.benchmarks.reliability.verifier.editing import edit
from studies.benchmarks.reliability.verifier.faults import FAULTS
from studies.benchmarks.reliability.verifier.forgeries import FORGERIES, forge
from studies.benchmarks.reliability.verifier.good_runs import KINDS, make_run
from studies.reporting import Row, tell


@dataclass(frozen=True, kw_only=True)
class Verdicts:
    """A kind of run: its alarms without a fault, the faults planted in it, and those not caught."""

    alarms: tuple[str, ...]
    planted: tuple[str, ...]
    missed: tuple[str, ...]


def verifier_rows(folder: Path, kinds: Sequence[str] = tuple(KINDS)) -> Iterator[Row]:
    """Yield the verifier's results on good runs of these kinds, and on all faults planted in them."""
    row = partial(Row, table="verifier", unit="")
    planted = missed = 0
    for kind in kinds:
        verdicts = _verify_kind(kind, folder / kind.replace(" ", "_"))
        alarms, faults, unseen = verdicts.alarms, len(verdicts.planted), len(verdicts.missed)
        planted, missed = planted + faults, missed + unseen
        yield row(row=kind, column="false alarms", ours=len(alarms), reference=0, source="goal", note="; ".join(alarms))
        if faults:
            note = f"missed: {', '.join(verdicts.missed)}" if unseen else ""
            yield row(
                row=kind, column="faults caught", ours=faults - unseen, reference=faults, source="planted", note=note
            )
    yield row(row="all", column="faults caught", ours=planted - missed, reference=planted, source="planted")


def _verify_kind(kind: str, folder: Path) -> Verdicts:
    """Make a good run of a kind; verify it, and copies of it with one fault each."""
    tell(f"the verifier on {kind}")
    problem, subject = make_run(kind, folder / "good")
    alarms = [f"{row.subject}: {row.detail}" for row in pk.verify(folder / "good", subject, observe=False).failures]
    wrong = list[tuple[str, Path, Any, str]]()
    for name, (where, change, failing) in FAULTS.items():
        if where == kind:
            wrong.append((name, edit(folder / "good", folder / str(len(wrong)), change), subject, failing))
    for name, (where, stricter, failing) in FORGERIES.items():
        if where == kind:
            other = stricter(pk.load_front(folder / "good", problem))
            wrong.append((name, forge(folder / "good", folder / str(len(wrong)), other), other, failing))
    missed = [name for name, place, other, failing in wrong if not _fails(place, other, failing)]
    return Verdicts(alarms=tuple(alarms), planted=tuple(name for name, *_ in wrong), missed=tuple(missed))


def _fails(folder: Path, problem: Any, subject: str) -> bool:
    return subject in {row.subject for row in pk.verify(folder, problem, observe=False).failures}
