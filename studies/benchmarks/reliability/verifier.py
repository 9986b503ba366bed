"""Faults planted in good runs for the verifier: edits by someone with bad intent (digests are made new), and forgeries.

A forgery is a run presented as that of a stricter problem, whose limits or obstacles its motions violate.
"""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import paretoik as pk
from paretoik.formulations.protocol import at_samples_of
from paretoik.robot.kinematics import jacobian
from paretoik.runs.files import RUN, array_bytes, result_files
from paretoik.runs.fingerprint import fingerprint
from paretoik.task.motion_task import finer_motion
from studies.benchmarks.reliability.good_runs import ARM, KINDS, LIMITS, make_run, tracking
from studies.reporting import Row, tell


@dataclass
class Edited:
    """The contents of a run, to be changed in place."""

    entries: dict[str, Any]
    table: dict[str, list[Any]]
    arrays: dict[str, dict[str, np.ndarray]]

    @property
    def motions(self) -> dict[str, np.ndarray]:
        """The arrays of the run's motions."""
        return self.arrays["motions.npz"]


Change = Callable[[Edited], object]


def edit(source: Path, folder: Path, change: Change) -> Path:
    """Copy a run, change it, and make new digests."""
    shutil.copytree(source, folder)
    entries = json.loads((folder / RUN).read_text())
    names = [name for name in entries.pop("files") if not name.endswith(".npz")]
    table_name = names[0] if names else None
    table = pq.ParquetFile(folder / table_name).read(use_threads=False) if table_name else None
    run = Edited(
        entries={name: value for name, value in entries.items() if name not in ("format", "digest")},
        table={} if table is None else table.to_pydict(),
        arrays={file.name: dict(np.load(file)) for file in folder.glob("*.npz")},
    )
    change(run)
    contents = {name: array_bytes(values) for name, values in run.arrays.items()}
    if table_name:
        sink = io.BytesIO()
        pq.write_table(pa.table(run.table), sink)
        contents[table_name] = sink.getvalue()
    for name, content in result_files(run.entries, contents).items():
        (folder / name).write_bytes(content)
    return folder


def motions(name: str, place: Any, function: Callable[[Any], Any]) -> Change:
    """Change a part of an array of the motions."""

    def change(run: Edited) -> None:
        run.motions[name][place] = function(run.motions[name][place])

    return change


def column(name: str, function: Callable[[Any], Any], row: int | None = None) -> Change:
    """Change one row of a column of the table, or all."""

    def change(run: Edited) -> None:
        values = run.table[name]
        chosen = range(len(values)) if row is None else [range(len(values))[row]]
        run.table[name] = [function(value) if i in chosen else value for i, value in enumerate(values)]

    return change


def all_of(*changes: Change) -> Change:
    """Change several things."""

    def change(run: Edited) -> None:
        for each in changes:
            each(run)

    return change


def plus(amount: float) -> Callable[[Any], Any]:
    """Return the addition of an amount."""
    return lambda value: value + amount


def times(factor: float) -> Callable[[Any], Any]:
    """Return the multiplication by a factor."""
    return lambda value: factor * value


def slide_along_the_self_motion(run: Edited) -> None:
    """Move a posture along the self-motion by 1e-6: the path is missed by only 1e-12."""
    q = run.motions["q"][0, 5]
    run.motions["q"][0, 5] = q + 1e-6 * np.linalg.svd(jacobian(pk.arms.tringali_3r(), q)[:2])[2][-1]


def leave_out_a_motion(run: Edited) -> None:
    """Leave out the first motion, not its row of the table."""
    for name in ("id", "q", "time", *(["genes"] if "genes" in run.motions else [])):
        run.motions[name] = run.motions[name][1:]


def add_point(run: Edited, row: int) -> None:
    """Add a copy of a row with another id."""
    for name, values in run.table.items():
        values.append(values[row] if name != "id" else max(values) + 1)
    for name, array in run.motions.items():
        if name != "joint_names":
            run.motions[name] = np.concatenate([array, array[[row]]])
    run.motions["id"][-1] = run.table["id"][-1]


def add_dominated_point(run: Edited) -> None:
    """Add a point that is a little worse than the first."""
    add_point(run, 0)
    run.table["kinetic_energy"][-1] *= 1.01
    run.entries["points"] += 1


def add_a_better_optimum_last(run: Edited) -> None:
    """Add an optimum that is better than the first, behind all."""
    add_point(run, -1)
    run.table["kinetic_energy"][-1] = 0.9 * run.table["kinetic_energy"][0]


def rename_objective(run: Edited) -> None:
    """Give an objective another name."""
    run.entries["objectives"][0]["name"] = "energy"
    run.table["energy"] = run.table.pop("kinetic_energy")


def deny_criticality(run: Edited) -> None:
    """Bend motions along the self-motion and compute their objectives again; certificates stay as they were."""
    problem = at_samples_of(tracking(), run.motions["q"])
    for row, q in enumerate(run.motions["q"].copy()):
        bumped = q + 0.05 * np.sin(np.linspace(0.0, np.pi, len(q)))[:, None] * np.array([1.0, -1.0, 0.5])
        motion = problem.task.motion(problem.task.motion(bumped).at(problem.task.times))
        run.motions["q"][row] = motion.q
        for objective in problem.task.objectives:
            run.table[objective.name][row] = float(objective(motion))
        for name in ("violation", "violation_between"):
            run.table[name][row] = max(float(problem.task.violations(motion).max()), 0.0)


def swap_weights(run: Edited) -> None:
    """Swap the weights of both objectives, and make exchange rates that fit."""
    weights = run.motions["weights"] = run.motions["weights"][:, ::-1].copy()
    for row, (first, second) in enumerate(weights):
        for name in ("exchange_rates", "exchange_intervals"):
            run.motions[name][row, 0, 1] *= (first / second) ** 2
            run.motions[name][row, 1, 0] *= (second / first) ** 2


def rewrite(function: Callable[[dict[str, Any]], Any]) -> Change:
    """Change the entries of run.json."""
    return lambda run: function(run.entries)


def objective(number: int, **values: Any) -> Change:
    """Change what run.json says of an objective."""
    return rewrite(lambda entries: entries["objectives"][number].update(values))


FAULTS: dict[str, tuple[str, Change, str]] = {
    "a joint off by 1e-6": ("search", motions("q", (0, 5, 1), plus(1e-6)), "tracking at samples"),
    "a posture moved along the self-motion by 1e-6": ("search", slide_along_the_self_motion, "objective torque_norm"),
    "columns swapped": ("search", motions("q", ..., lambda q: q[..., [1, 0, 2]]), "tracking at samples"),
    "names of joints swapped": ("search", motions("joint_names", [0, 1], lambda names: names[::-1]), "joint names"),
    "a joint of another name": ("search", motions("joint_names", 2, lambda _: "wrist"), "joint names"),
    "times that go back": ("search", motions("time", (0, [4, 5]), lambda time: time[::-1]), "times"),
    "times stretched": ("search", motions("time", ..., times(1.001)), "times of the path"),
    "a time shifted": ("search", motions("time", (0, 4), plus(1e-4)), "times of the path"),
    "a motion reversed": ("search", motions("q", 0, lambda q: q[::-1].copy()), "tracking at samples"),
    "not a number": ("search", motions("q", (0, 3, 0), times(np.nan)), "finite motions"),
    "motions exchanged": ("search", motions("q", [0, -1], lambda q: q[::-1]), "objective kinetic_energy"),
    "a motion missing": ("search", leave_out_a_motion, "ids"),
    "an objective edited": ("search", column("kinetic_energy", times(1 - 1e-6), 0), "objective kinetic_energy"),
    "objectives improved": (
        "search",
        all_of(column("kinetic_energy", times(0.9)), column("torque_norm", times(0.9))),
        "objective torque_norm",
    ),
    "objectives swapped": (
        "search",
        lambda run: run.table.update(kinetic_energy=run.table["torque_norm"], torque_norm=run.table["kinetic_energy"]),
        "objective kinetic_energy",
    ),
    "a user's objective edited": ("obstacles", column("wrist_effort", times(1 + 1e-6), -1), "objective wrist_effort"),
    "a maximised objective edited": (
        "obstacles",
        column("obstacle_clearance", plus(1e-6), -1),
        "objective obstacle_clearance",
    ),
    "an id twice": (
        "search",
        all_of(
            motions("id", [0, 1], lambda ids: ids[[0, 0]]),
            lambda run: run.table["id"].__setitem__(1, run.table["id"][0]),
        ),
        "ids",
    ),
    "a dominated point": ("search", add_dominated_point, "non-domination"),
    "another number of points": ("search", rewrite(lambda e: e.update(points=e["points"] + 1)), "ids"),
    "another unit": ("search", objective(0, unit="J"), "objectives' names"),
    "another sense": ("search", objective(1, maximised=True), "objectives' names"),
    "another name": ("search", rename_objective, "objectives' names"),
    "a range turned": ("search", rewrite(lambda entries: entries["objectives"][0]["range"].reverse()), "ranges"),
    "another fingerprint": ("search", rewrite(lambda entries: entries.update(fingerprint="0" * 64)), "problem"),
    "another violation": ("search", column("violation", lambda _: 0.25, 0), "violation in the table"),
    "a certificate of another motion": ("certified", deny_criticality, "criticality by differences"),
    "weights swapped": ("certified", swap_weights, "weights by differences"),
    "an exchange rate edited": (
        "certified",
        all_of(*(motions(f"exchange_{name}", (1, 0, 1), times(1.2)) for name in ("rates", "intervals"))),
        "exchange rates",
    ),
    "an interval without its rate": (
        "certified",
        motions("exchange_intervals", (1, 0, 1), times(1.2)),
        "exchange intervals",
    ),
    "a negative weight": ("certified", motions("weights", 1, lambda _: [1.5, -0.5]), "weights"),
    "a status that is none": ("certified", column("status", lambda _: "global minimum", 0), "certificates"),
    "a cycle opened": ("certified cyclic", motions("q", (0, -1, 0), plus(2 * np.pi)), "closure"),
    "an optimum edited": ("plan", column("kinetic_energy", times(1 - 1e-6), 0), "objective kinetic_energy"),
    "the best optimum last": ("plan", add_a_better_optimum_last, "order of optima"),
    "an error of a loop edited": (
        "closed loop",
        rewrite(lambda e: e.update(position_error=e["position_error"] / 2)),
        "position_error of the loop",
    ),
    "a drift of a loop edited": ("closed loop", rewrite(lambda e: e.update(drift=0.0)), "drift of the loop"),
    "a jump in a loop": ("closed loop", motions("q", (0, 8), plus(0.3)), "length of steps"),
    "a speed that no motor has": ("directional maxima", column("speed_1", times(1.1)), "objective speed_1"),
    "a posture off its position": ("directional maxima", motions("q", 0, plus(1e-6)), "position of the tool"),
    "a motion too fast for its motors": (
        "point to point",
        all_of(motions("time", ..., times(0.9)), column("duration", times(0.9))),
        "motors",
    ),
    "a duration edited": ("point to point", column("duration", times(0.99)), "objective duration"),
    "an energy edited": ("point to point", column("energy", times(0.99)), "objective energy"),
    "a target missed": ("point to point", motions("q", (0, -1, 0), plus(1e-6)), "ends"),
    "a maximum edited": (
        "polygon",
        lambda run: run.arrays["polygon.npz"].update(values=1.1 * run.arrays["polygon.npz"]["values"]),
        "values",
    ),
    "maxima missing": ("polygon", lambda run: run.arrays["polygon.npz"].pop("values"), "files"),
    "an error hidden": ("resolved", rewrite(lambda entries: entries.update(largest_error=0.0)), "largest error"),
    "a resolved motion off its path": ("resolved", motions("q", (0, 6, 0), plus(0.1)), "tracking"),
    "a tuned speed too good for its motion": ("tuning", column("speed_ratio", times(0.01), 0), "objective speed_ratio"),
    "a tuned margin too good for its motion": (
        "tuning",
        column("limit_margin", plus(0.6), -1),
        "objective limit_margin",
    ),
    "a tuned speed edited": (
        "tuning from one start",
        column("speed_ratio", times(1 + 1e-6), 0),
        "objective speed_ratio",
    ),
    "a tuned motion off its path": ("tuning", motions("q", (0, 6, 0), plus(0.3)), "objective tracking_error"),
    "a tuned motion from another start": ("tuning", motions("q", (0, 0), plus(1e-6)), "start"),
}
"""By name: the kind of run, the change, and the subject of the check that must fail."""

LIMITED = {"position": "q", "velocity": "dq", "acceleration": "ddq", "torque": "torque", "power": "power"}
"""The limits of a problem, and the arrays of a motion that they bound."""


def forge(source: Path, folder: Path, problem: pk.Tracking) -> Path:
    """Copy a run as one of another problem that no motion violates, not between samples either."""
    other = rewrite(lambda entries: entries.update(fingerprint=fingerprint(problem)))
    return edit(source, folder, all_of(other, column("violation_between", lambda _: 0.0)))


def thin_obstacle(front: pk.Front) -> pk.Tracking:
    """Return the problem with a disc that a motion's tool meets only between two instants."""
    motion: Any = front.motions[0]  # type: ignore[index]
    for q in motion.at(motion.time[:-1] + 0.25 * np.diff(motion.time)):
        disc = pk.obstacles.Circle(ARM.pose(q).position[:2], 0.004)
        if replace(motion.instants, obstacles=(disc,)).clearance.min() > 1e-3:
            return tracking(obstacles=[disc])
    raise AssertionError("no place that the tool passes between instants")


def exceeded_between(front: pk.Front) -> pk.Tracking:
    """Return the problem with a limit that motions satisfy at all instants, and exceed between them."""
    assert isinstance(front.motions, pk.Motion)
    for kind in ("power", "torque", "position"):
        limit = largest(front, kind)
        if np.abs(getattr(finer_motion(front.motions), LIMITED[kind])).max() > (1 + 2e-4) * limit:
            return tracking(limits={**LIMITS, kind: limit})
    raise AssertionError("no limit that is largest between instants")


def exceeded(front: pk.Front, kind: str) -> pk.Tracking:
    """Return the problem with a limit that a motion exceeds by a hundredth at an instant."""
    return tracking(limits={**LIMITS, kind: 0.99 * largest(front, kind)})


def largest(front: pk.Front, kind: str) -> float:
    """Return the largest absolute value that a limit bounds, at the motions' instants."""
    assert isinstance(front.motions, pk.Motion)
    return float(np.abs(getattr(front.motions.instants, LIMITED[kind])).max(axis=(1, 2)).max())


FORGERIES: dict[str, tuple[str, Callable[[pk.Front], pk.Tracking], str]] = {
    **{f"{kind} limit exceeded": ("search", partial(exceeded, kind=kind), f"{kind} limits") for kind in LIMITED},
    "a collision between samples": ("search", thin_obstacle, "clearance between samples"),
    "a limit exceeded between samples": ("certified", exceeded_between, "limits between samples"),
}
"""By name: the kind of run, the problem that its front is presented for, the subject of the check that must fail."""


def verifier_rows(folder: Path, kinds: Sequence[str] = tuple(KINDS)) -> Iterator[Row]:
    """Yield the verifier's results on good runs of these kinds, and on all faults planted in them, one each."""
    total = caught = 0
    for kind in kinds:
        tell(f"the verifier on {kind}")
        place = folder / kind.replace(" ", "_")
        problem, subject = make_run(kind, place / "good")
        alarms = [f"{row.subject}: {row.detail}" for row in pk.verify(place / "good", subject, observe=False).failures]
        yield Row("verifier", kind, "false alarms", "", len(alarms), reference=0, source="goal", note="; ".join(alarms))
        planted = [
            (name, edit(place / "good", place / name, change), subject, failing)
            for name, (where, change, failing) in FAULTS.items()
            if where == kind
        ]
        for name, (where, stricter, failing) in FORGERIES.items():
            if where == kind:
                other = stricter(pk.load_front(place / "good", problem))
                planted.append((name, forge(place / "good", place / name, other), other, failing))
        missed = [
            name
            for name, run, other, failing in planted
            if failing not in {row.subject for row in pk.verify(run, other, observe=False).failures}
        ]
        total, found = total + len(planted), len(planted) - len(missed)
        caught += found
        if planted:
            note = f"missed: {', '.join(missed)}" if missed else ""
            yield Row("verifier", kind, "faults caught", "", found, reference=len(planted), source="planted", note=note)
    yield Row("verifier", "all", "faults caught", "", caught, reference=total, source="planted")
