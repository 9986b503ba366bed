"""Whether the arm meets an obstacle, at the steps and between them: by the oracle's geometry, not the search's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from paretoik.closed_loop.extended_jacobian import link_lengths, shapes
from paretoik.formulations.closed_loop_result import ClosedLoopRun
from problems import marcos_2012
from studies.reporting import Row

BETWEEN = 20  # times finer than the steps


def meets(run: ClosedLoopRun, *, finer: int = BETWEEN) -> tuple[int, float]:
    """Return at how many places of a finer grid the arm meets an obstacle, and the longest step of a joint [rad]."""
    from paretoik.closed_loop.exact_step import hits  # here: numba takes its time

    lengths, (circles, boxes) = link_lengths(run.task.arm), shapes(run.task.obstacles)
    q = run.q
    share = np.linspace(0, 1, finer, endpoint=False)[:, None, None]
    every = (q[:-1] + share * (q[1:] - q[:-1])).reshape(-1, q.shape[1])
    count = sum(bool(hits(lengths, np.ascontiguousarray(one), circles, boxes)) for one in every)
    return count, float(np.abs(np.diff(q, axis=0)).max())


def collision_rows(
    printed: Sequence[tuple[str, ClosedLoopRun]], starts: dict[tuple[int, float], np.ndarray], *, steps: int, seed: int
) -> list[Row]:
    """Return where arms meet obstacles: as the paper reads, and by default."""
    rows = [_row("as printed, steps of any length", name, run) for name, run in printed]
    for (links, distance), start in starts.items():
        loop = marcos_2012.loop(
            3 if links == 3 else 4, distance, weight=0.5, blocked=True, steps=steps, start=start, seed=seed
        )
        rows.append(_row("steps of at most 0.1 rad", f"{links}R, r = {distance}, w = 0.5", loop.run()))
    return rows


def _row(reading: str, name: str, run: ClosedLoopRun) -> Row:
    met, longest = meets(run)
    return Row(
        table=f"places between steps where the arm meets an obstacle, {BETWEEN} a step",
        row=reading,
        column=name,
        unit="",
        ours=met,
        note=f"longest step of a joint {longest:.3g} rad",
    )
