"""Which mechanism is sooner from p4 straight to p6 without jumps, under other assumptions than the usual ones."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

import numpy as np

from paretoik.errors import SolverFailed
from paretoik.runs.distribution import Executor
from studies.kim_2021.continuous import resolved
from studies.kim_2021.profiles import Mechanism
from studies.kim_2021.sensitivity import Assumptions
from studies.kim_2021.setting import MECHANISMS, POSITIONS, beside_paper
from studies.processes import run_each
from studies.reporting import Row

TABLE = "soonest from p4 straight to p6, postures not jumping"


def straight_time(name: str, assumed: Assumptions, pieces: int, cell: float) -> float:
    """Return a mechanism's least time to p6 [s], NaN if nothing holds on the way."""
    arm, motors = (assumed.limited, assumed.motors) if name == "JAM" else (assumed.free, assumed.sliders)
    path = np.stack([POSITIONS["p4"], POSITIONS["p6"]])
    try:
        return float(resolved(Mechanism(arm=arm, actuation=motors), path, pieces=pieces, cell=cell).times[-1])
    except SolverFailed:
        return np.nan


def _key(name: str, assumed: Assumptions) -> tuple[str, str]:
    """Return what a mechanism's time depends on; for joint motors rods count only if they limit the joints."""
    if name == "JAM" and not assumed.joint_ranges:
        return name, str(Assumptions(mass=assumed.mass, shape=assumed.shape))
    return name, str(assumed)


def straight_rows(
    assumptions: Iterable[Assumptions], *, pieces: int, cell: float, executor: Executor | None = None
) -> list[Row]:
    """Return the ratio of both times for every assumption; NaN if nothing holds on the way."""
    listed, rows = list(assumptions), []
    times = run_each(
        executor,
        {_key(name, one): partial(straight_time, name, one, pieces, cell) for one in listed for name in MECHANISMS},
    )
    for assumed in listed:
        first, second = (times[_key(name, assumed)] for name in MECHANISMS)
        sooner = "DAM is sooner" if second < first else "JAM is sooner"
        note = f"{sooner}: JAM {first:.3f} s, DAM {second:.3f} s"
        if np.isnan(first + second):
            note = f"{'JAM' if np.isnan(first) else 'DAM'}: no postures without a jump that can be held all the way"
        rows.append(beside_paper((TABLE, str(assumed), "DAM beside JAM"), "%", 100 * (second / first - 1), note))
    return rows
