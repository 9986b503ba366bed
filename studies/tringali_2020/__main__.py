"""The command: ``python -m studies.tringali_2020 [--quick] [--json FILE] [--out FOLDER] [--cluster ADDRESS]``."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from functools import partial

from paretoik.runs.distribution import Executor
from studies.processes import run_each, workers_of
from studies.reporting import Row, report, study_parser, tell
from studies.tringali_2020.candidates import Decline, declines, figure_1
from studies.tringali_2020.pictures import draw
from studies.tringali_2020.published import published_rows
from studies.tringali_2020.simulations import MASSES, NUMBERS, Simulation, line_rows, motion_rows, simulate, tables
from studies.tringali_2020.trade_off import TradeOff, figure_14, solve_trade_off, sweep_rows
from studies.tringali_2020.validation import bound_row, match_optima, table_4

FINE = 0.006  # rad: of the grid oracle's nodes


def run_study(
    *,
    starts: int,
    points: int,
    candidates: int,
    seeds: int,
    bounded: bool = True,
    rehearsed: bool = True,
    executor: Executor | None = None,
) -> tuple[list[Row], dict[str, list[Simulation]], list[Decline], list[TradeOff]]:
    """Return all rows, and the data of the pictures: simulations, declines and trade-offs of both arms.

    ``starts`` per plan, ``points`` of the front, ``candidates`` and ``seeds`` of Figure 1. ``bounded``: all motions are
    bounded from below, on a fine grid. ``rehearsed``: times are taken with everything compiled. Without an executor
    this process computes, as for timing.
    """
    tell("simulations")
    plan = partial(simulate, starts=starts, rehearsed=rehearsed)
    plans = {(masses, f"simulation {k}"): partial(plan, k, masses) for masses in MASSES for k in NUMBERS}
    planned = run_each(executor, plans)
    simulations = {masses: [planned[masses, f"simulation {k}"] for k in NUMBERS] for masses in MASSES}
    rows = simulation_rows(simulations, bounded, executor)
    tell("a line of 0.40 m")
    rows += _all(run_each(executor, {(m,): partial(line_rows, own, starts=starts) for m, own in simulations.items()}))
    tell("the search as published")
    rows += published_rows(simulations["fitted"], executor=executor)  # its candidates know no masses
    tell(f"Figure 1, {seeds} seeds")
    decline_curves = declines(count=candidates, seeds=seeds, executor=executor)
    rows += [row for decline in decline_curves for row in figure_1(decline)]
    tell("Figure 14")
    fronts = {(m,): partial(solve_trade_off, m, points=points, starts=starts, rehearsed=rehearsed) for m in MASSES}
    trades = list(run_each(executor, fronts).values())
    rows += [row for trade in trades for row in figure_14(trade)]
    sweeps = {(each.masses,): partial(sweep_rows, simulations[each.masses], each, points=points) for each in trades}
    return rows + _all(run_each(executor, sweeps)), simulations, decline_curves, trades


def simulation_rows(simulations: dict[str, list[Simulation]], bounded: bool, executor: Executor | None) -> list[Row]:
    """Return the rows of Table 4, of bounds if asked for, and of every simulation's table and motion."""
    tell("Table 4")
    names = match_optima(simulations["fitted"][0])
    tables_4 = {(m,): partial(table_4, own[0], names) for m, own in simulations.items()}
    rows = _all(run_each(executor, tables_4))
    if bounded:
        tell("bounds on all motions")
        bounds = {(masses,): partial(bound_row, own[0], resolution=FINE) for masses, own in simulations.items()}
        rows += run_each(executor, bounds).values()
    rows += [row for pair in zip(*simulations.values(), strict=True) for one in pair for row in tables(one)]
    return rows + [row for own in simulations.values() for row in motion_rows(own)]


def _all(rows: Mapping[tuple[str], list[Row]]) -> list[Row]:
    return [row for several in rows.values() for row in several]


def main(arguments: Sequence[str] | None = None) -> None:
    """Regenerate the paper's tables and figures, report the rows and draw the pictures."""
    options = study_parser(
        "Tringali & Cocuzza 2020.",
        quick="24 starts, no bound, 8 points of the front, 3 seeds of Figure 1",
        out="tringali_2020",
        cluster="simulations, bounds, published searches, seeds of Figure 1, fronts and sweeps",
    ).parse_args(arguments)
    with workers_of(options.cluster) as executor:
        run = partial(run_study, executor=executor)
        if options.quick:
            results = run(starts=24, points=8, candidates=3000, seeds=3, bounded=False)
        else:
            results = run(starts=48, points=20, candidates=round(10**4.5), seeds=12)
    rows, simulations, decline_curves, trades = results
    names = match_optima(simulations["fitted"][0])
    report(rows, json_file=options.json)
    pictures = draw(options.out, simulations, decline_curves, trades, names)
    print(f"{len(pictures)} pictures in {options.out}", file=sys.stderr)


if __name__ == "__main__":
    main()
