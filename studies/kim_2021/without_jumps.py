"""Who is sooner from p4 straight to p6 if postures do not jump, under other assumptions than the usual ones."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from paretoik.errors import SolverFailed
from studies.kim_2021.continuous import resolved
from studies.kim_2021.profiles import Mechanism
from studies.kim_2021.sensitivity import Assumptions
from studies.kim_2021.setting import POSITIONS, beside_paper
from studies.reporting import Row

TABLE = "soonest from p4 straight to p6, postures not jumping"


def straight_rows(assumptions: Iterable[Assumptions], *, pieces: int, cell: float) -> list[Row]:
    """Return the ratio of both times for everything assumed; NaN where nothing holds on the way."""
    path = np.stack([POSITIONS["p4"], POSITIONS["p6"]])
    rows, known = [], dict[tuple[object, ...], float]()
    for assumed in assumptions:
        times = []
        for name, arm, motors in (("JAM", assumed.limited, assumed.motors), ("DAM", assumed.free, assumed.sliders)):
            key = (name, assumed.mass, assumed.shape, assumed.joint_ranges) if name == "JAM" else (name, assumed)
            if key not in known:
                try:
                    mechanism = Mechanism(arm=arm, actuation=motors)
                    known[key] = float(resolved(mechanism, path, pieces=pieces, cell=cell).times[-1])
                except SolverFailed:
                    known[key] = np.nan
            times.append(known[key])
        first, second = times
        sooner = "DAM is sooner" if second < first else "JAM is sooner"
        note = f"{sooner}: JAM {first:.3f} s, DAM {second:.3f} s"
        if np.isnan(first + second):
            note = f"{'JAM' if np.isnan(first) else 'DAM'}: no postures without a jump that can be held all the way"
        rows.append(beside_paper((TABLE, str(assumed), "DAM beside JAM"), "%", 100 * (second / first - 1), note))
    return rows
