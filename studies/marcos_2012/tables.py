"""Tables 1 to 4, ours compared with the paper and the oracle, with reasons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TypeAlias

import numpy as np

from paretoik.formulations.closed_loop import mean_position_error
from paretoik.runs.distribution import Executor
from paretoik.task.objectives import joint_drift
from studies.marcos_2012.loops import Cell, CellLoop, follow
from studies.processes import run_each
from studies.reporting import Row, paper_numbers

Starts: TypeAlias = Mapping[tuple[int, float], np.ndarray]  # by number of links and distance
MEASURES = {"mean position error": mean_position_error, "drift": joint_drift}  # Eqs. 23 and 25
GOALS = 0.005, 0.03  # share of the oracle's, for w ≥ 0.5 and three links
WARM = 20  # generations, a tenth of the paper's
SAME = 0.05  # of the paper's number
ALIKE = 0.01  # of the printed number: smaller differences agree
SEEDS, SHORT = 11, 100  # of four links, and steps that each follows
paper = partial(paper_numbers, "marcos_2012")


def cell_measures(one: CellLoop) -> list[tuple[str, str, str, float, float]]:
    """Return (table, what, unit, ours, oracle's) of a cell's position error (Eq. 23) and drift (Eq. 25)."""
    names = ("Table 3", "Table 4") if one.cell.blocked else ("Table 1", "Table 2")
    return [
        (table, what, measure.unit, float(measure(one.run.motion)), float(measure(one.exact)))
        for table, (what, measure) in zip(names, MEASURES.items(), strict=True)
    ]


def table_rows(loops: Sequence[CellLoop]) -> list[Row]:
    """Return Tables 1 to 4 (Eqs. 23 and 25); the note says why ours differs, and the exact loop's number."""
    rows = []
    for one in loops:
        cell = one.cell
        for name, what, unit, ours, exact in cell_measures(one):
            with_them = "with two obstacles" if cell.blocked else "no obstacles"
            rows.append(
                Row(
                    table=f"{name}: {what}, {with_them}",
                    row=cell.row,
                    column=cell.arm,
                    unit=unit,
                    ours=ours,
                    reference=paper()[name, cell.row, cell.arm],
                    note=f"{_reason(ours, exact, paper()[name, cell.row, cell.arm])}; "
                    f"exact {exact:.4g}, ours {100 * (ours / exact - 1):+.2f} % relative to it",
                )
            )
    return sorted(rows, key=lambda row: (row.table, row.row, row.column))


def _reason(ours: float, exact: float, printed: float) -> str:
    """Return why a cell differs from the paper's, judged by the exact loop from the same start."""
    if abs(ours / printed - 1) <= ALIKE:
        return f"the same within {ALIKE:.0%}"
    searched = "the search has not converged"
    if abs(exact / printed - 1) <= ALIKE:
        return f"{searched}: the exact loop is as printed"
    start = "the exact loop is off as well: it depends on the start, which is not printed, or on the time grid"
    return start if abs(ours / exact - 1) <= ALIKE else f"{start}; {searched}"


def reproduced_rows(loops: Sequence[CellLoop]) -> list[Row]:
    """Return how many cells of each table are within 5 % of print, and why the others are not, if known.

    If the exact loop is as far off, no search could reproduce the cell: it depends on the start, which the paper does
    not print, or on the time grid. Otherwise the search has not converged, or ours has and the paper's has not.
    """
    rows = []
    groups: dict[tuple[str, str], list[tuple[str, float, float, float]]] = {}
    for one in loops:
        for name, _, _, ours, exact in cell_measures(one):
            printed = paper()[name, one.cell.row, one.cell.arm]
            groups.setdefault((name, one.cell.arm), []).append((one.cell.row, ours, exact, printed))
    for (name, arm), cells in sorted(groups.items()):
        off = [cell for cell in cells if abs(cell[1] / cell[3] - 1) > SAME]
        bound = [cell for cell in off if abs(cell[2] / cell[3] - 1) > SAME]
        known = [cell for cell in bound if abs(cell[1] / cell[2] - 1) <= SAME]
        reasons = {
            "the exact loop, which ours agrees with, is off as well": known,
            "the exact loop is off as well": [cell for cell in bound if cell not in known],
            "the exact loop is not": [cell for cell in off if cell not in bound],
        }
        reasons_text = [
            f"{reason}: {', '.join(f'{row} ({ours / printed:.3g} times)' for row, ours, _, printed in some)}"
            for reason, some in reasons.items()
            if some
        ]
        rows.append(
            Row(
                table=f"cells within {SAME:.0%} of the paper's, and which are not",
                row=name,
                column=arm,
                unit="",
                ours=len(cells) - len(off),
                reference=len(cells),
                source="cells",
                note="; ".join(reasons_text),
            )
        )
    return rows


def oracle_rows(loops: Sequence[CellLoop]) -> list[Row]:
    """Return the largest distance of three links from the oracle, for a displacement weight of half or more."""
    rows = []
    selection = [one for one in loops if one.cell.links == 3 and one.cell.weight >= 0.5]
    for blocked in dict.fromkeys(one.cell.blocked for one in selection):
        for (what, measure), goal in zip(MEASURES.items(), GOALS, strict=True):
            errors = [
                (abs(float(measure(one.run.motion) / measure(one.exact)) - 1), one.cell.row)
                for one in selection
                if one.cell.blocked == blocked
            ]
            worst, where = max(errors)
            prefix = "LOSS: " if worst > goal else ""
            rows.append(
                Row(
                    table="beside the oracle, 3R, w of 0.5 and more",
                    row="with two obstacles" if blocked else "no obstacles",
                    column=what,
                    unit="relative",
                    ours=worst,
                    reference=goal,
                    source="goal",
                    note=f"{prefix}goal; worst of {len(errors)} cells: {where}",
                )
            )
    return rows


def spread_rows(
    starts: Starts, *, seeds: int = SEEDS, steps: int = SHORT, executor: Executor | None = None
) -> list[Row]:
    """Return the spread of four links over seeds, compared with the oracle."""
    cells = {
        Cell(links=4, distance=distance, blocked=False, weight=0.5): start
        for (links, distance), start in starts.items()
        if links == 4
    }
    calls = {
        (cell.row, f"seed {seed}"): partial(follow, cell, start, steps=steps, seed=seed)
        for cell, start in cells.items()
        for seed in range(seeds)
    }
    results, rows = run_each(executor, calls), []
    for cell in cells:
        loops = [results[cell.row, f"seed {seed}"] for seed in range(seeds)]
        for what, measure in MEASURES.items():
            values = [float(measure(one.run.motion)) for one in loops]
            low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
            rows.append(
                Row(
                    table=f"4R over {seeds} seeds, {steps} steps: median beside the oracle",
                    row=cell.row,
                    column=what,
                    unit=measure.unit,
                    ours=float(middle),
                    reference=float(measure(loops[0].exact)),
                    source="exact steps",
                    note=f"quartiles {low:.4g} and {high:.4g}",
                )
            )
    return rows


def warm_rows(starts: Starts, *, seed: int, steps: int = SHORT, executor: Executor | None = None) -> list[Row]:
    """Return the effect of starting each search with the population of the last step, against random restarts."""
    calls, rows = {}, []
    for (links, distance), start in starts.items():
        cell = Cell(links=4 if links == 4 else 3, distance=distance, blocked=False, weight=0.5)
        for warm, generations in ((False, 200), (False, WARM), (True, WARM)):
            setting = f"{'warm starts' if warm else 'random restarts'}, {generations} generations"
            calls[f"{cell.arm}, r = {distance}", setting] = partial(
                follow, cell, start, steps=steps, seed=seed, generations=generations, warm_start=warm
            )
    for (name, setting), one in run_each(executor, calls).items():
        for _, what, unit, ours, exact in cell_measures(one):
            rows.append(
                Row(
                    table=f"warm starts, w = 0.5, {steps} steps, beside the oracle",
                    row=f"{name}: {setting}",
                    column=what,
                    unit=unit,
                    ours=ours,
                    reference=exact,
                    source="exact steps",
                    note=f"{100 * (ours / exact - 1):+.2f} %",
                )
            )
    return rows


def time_rows(loops: Sequence[CellLoop], seconds: float) -> list[Row]:
    """Return the times of the loops: processor time per generation and in all, and wall time with the exact steps."""
    rows = []
    for links in sorted({one.cell.links for one in loops}):
        same_arm = [one for one in loops if one.cell.links == links]
        generations = sum((len(one.run.q) - 1) * 200 for one in same_arm)
        rows.append(
            Row(
                table="time",
                row=f"{links}R",
                column="a generation, processor time",
                unit="µs",
                ours=1e6 * sum(one.seconds for one in same_arm) / generations,
                note=f"{len(same_arm)} loops of {len(same_arm[0].run.q) - 1} steps",
            )
        )
    searches, note = sum(one.seconds for one in loops), f"{len(loops)} loops"
    rows.append(Row(table="time", row="all", column="searches, processor time", unit="s", ours=searches, note=note))
    rows.append(Row(table="time", row="all", column="searches and exact steps", unit="s", ours=seconds, note=note))
    return rows
