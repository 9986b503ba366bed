"""The command: ``python -m studies.tringali_2020 [--quick] [--json FILE] [--out FOLDER]``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from studies.reporting import Row, report, study_parser, tell
from studies.tringali_2020.candidates import Decline, declines, figure_1
from studies.tringali_2020.pictures import draw
from studies.tringali_2020.published import published_rows
from studies.tringali_2020.simulations import MASSES, NUMBERS, Simulation, line_rows, motion_rows, simulate, tables
from studies.tringali_2020.sweeps import sweep_rows
from studies.tringali_2020.trade_off import TradeOff, figure_14, solve_trade_off
from studies.tringali_2020.validation import bound_row, match_optima, table_4

FINE = 0.006  # rad: of the grid oracle's nodes


def run_study(
    *,
    starts: int,
    points: int,
    candidates: int,
    seeds: int,
    finer: int | None,
    bounded: bool = True,
    rehearsed: bool = True,
) -> tuple[list[Row], dict[str, list[Simulation]], list[Decline], list[TradeOff]]:
    """Return all rows, and what the pictures show: simulations, declines and trade-offs of both arms.

    ``starts`` a plan, ``points`` of the front, so many ``candidates`` of so many ``seeds`` for Figure 1, and a number
    of samples to which Table 4 is repeated. ``bounded``, all motions are bounded from below, on a fine grid.
    ``rehearsed``, times are taken with everything compiled.
    """

    def plan(number: int, masses: str, samples: int | None = None) -> Simulation:
        tell(f"simulation {number}, {masses} masses" + (f", {samples} samples" if samples else ""))
        return simulate(number, masses, starts=starts, samples=samples, rehearsed=rehearsed)

    simulations = {masses: [plan(number, masses) for number in NUMBERS] for masses in MASSES}
    names = match_optima(simulations["fitted"][0])
    rows: list[Row] = []
    for first, *_ in simulations.values():
        repeated = None if finer is None else plan(1, first.masses, finer)
        tell(f"Table 4, {first.masses} masses")
        rows += table_4(first, names, repeated)
        if bounded:
            tell(f"a bound on all motions, {first.masses} masses")
            rows.append(bound_row(first, resolution=FINE))
    rows += [row for pair in zip(*simulations.values(), strict=True) for one in pair for row in tables(one)]
    for masses, own in simulations.items():
        rows += motion_rows(own)
        tell(f"a line of 0.40 m, {masses} masses")
        rows += line_rows(own, starts=starts)
    rows += published_rows(simulations["fitted"])  # its candidates know no masses
    tell(f"Figure 1, {seeds} seeds")
    decline_curves = declines(count=candidates, seeds=seeds)
    rows += [row for decline in decline_curves for row in figure_1(decline)]
    trades = []
    for masses, own in simulations.items():
        tell(f"Figure 14, {masses} masses")
        trades.append(solve_trade_off(masses, points=points, starts=starts, rehearsed=rehearsed))
        rows += figure_14(trades[-1]) + sweep_rows(own, trades[-1], points=points)
    return rows, simulations, decline_curves, trades


def main(arguments: Sequence[str] | None = None) -> None:
    """Regenerate the paper's tables and figures, report the rows and draw the pictures."""
    options = study_parser(
        "Tringali & Cocuzza 2020.",
        quick="24 starts, no bound, 8 points of the front, 3 seeds of Figure 1",
        out="tringali_2020",
    ).parse_args(arguments)
    if options.quick:
        results = run_study(starts=24, points=8, candidates=3000, seeds=3, finer=None, bounded=False)
    else:
        results = run_study(starts=48, points=20, candidates=round(10**4.5), seeds=12, finer=401)
    rows, simulations, decline_curves, trades = results
    names = match_optima(simulations["fitted"][0])
    report(rows, json_file=options.json)
    pictures = draw(options.out, simulations, decline_curves, trades, names)
    print(f"{len(pictures)} pictures in {options.out}", file=sys.stderr)


if __name__ == "__main__":
    main()
