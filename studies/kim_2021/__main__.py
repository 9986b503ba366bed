"""The command: ``python -m studies.kim_2021 [--quick] [--json FILE] [--out FOLDER] [--cluster ADDRESS]``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from paretoik.runs.distribution import Executor
from studies.kim_2021.energies import posture_rows, postures, table_4
from studies.kim_2021.fronts import MECHANISMS, race_fronts, race_rows, time_energy, time_energy_rows
from studies.kim_2021.maxima import all_surrogates, polygon_rows, polygons, surrogate_rows
from studies.kim_2021.one_posture import all_cases, one_posture_rows
from studies.kim_2021.pictures import draw
from studies.kim_2021.racing import many_starts, polygon_race, step_race
from studies.kim_2021.trajectories import cheating, figure_8, trajectory
from studies.processes import Result, run_each, workers_of
from studies.reporting import Row, report, study_parser, tell


@dataclass(frozen=True, kw_only=True)
class Effort:
    """Amount of work: positions per side, samples and pieces of a path, starts, rounds, steps, points."""

    grid: int = 9
    samples: int = 200
    pieces: int = 24
    cell: float = 0.1
    starts: int = 12
    positions: int = 3
    rounds: int = 96
    steps: int = 100
    shared: int = 24
    points: int = 12
    moments: int = 17
    searches: int = 32


QUICK = Effort(
    grid=5, samples=50, pieces=8, cell=0.6, starts=2, positions=1, rounds=16, steps=20, shared=6, points=3, moments=9,
    searches=8,
)  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> None:
    """Regenerate the paper's table and figures, report the rows and draw the pictures."""
    options = study_parser(
        "Kim, Choi & Jang 2021.",
        quick="coarse grids, few starts, few rounds",
        out="kim_2021",
        cluster="postures along paths, fronts and IPOPT's runs",
    ).parse_args(arguments)
    with workers_of(options.cluster) as executor:
        rows, pictures = run_study(QUICK if options.quick else Effort(), options.out, executor)
    report(rows, json_file=options.json)
    print(f"{len(pictures)} pictures in {options.out}", file=sys.stderr)


def run_study(effort: Effort, folder: Path, executor: Executor | None = None) -> tuple[list[Row], list[Path]]:
    """Return all rows, and the pictures drawn into a folder; progress is printed on stderr."""
    tell("Figures 5 and 6")
    corners = polygons()
    rows = polygon_rows(corners)
    tell("Equation 5")
    models = all_surrogates(count=effort.grid)
    rows += [row for surrogates in models.values() for row in surrogate_rows(surrogates)]
    tell("Figure 8")
    trajectories = {name: trajectory(surrogates, samples=effort.samples) for name, surrogates in models.items()}
    rows += figure_8(trajectories) + cheating(trajectories)
    tell("Figure 9 and Table 4")
    along = partial(postures, pieces=effort.pieces, cell=effort.cell)
    ways = {name: one for (name,), one in run_each(executor, _calls(along, trajectories)).items()}
    rows += posture_rows(ways, trajectories) + table_4(ways)
    tell("IPOPT from many starts")
    rows += many_starts(effort.starts, np.random.default_rng(0), positions=effort.positions, executor=executor)
    tell("one posture for two directions")
    shared = all_cases(effort.shared, executor=executor)
    rows += [row for one in shared for row in one_posture_rows(one)]
    tell("time against energy")
    front = partial(time_energy, points=effort.points, starts=effort.searches, samples=effort.moments)
    fronts = list(run_each(executor, _calls(front, {name: name for name in MECHANISMS})).values())
    rows += [row for one in fronts for row in time_energy_rows(one)]
    tell("the same with IPOPT")
    race = partial(race_fronts, starts=effort.searches // 4, samples=effort.moments)
    rows += [
        row
        for one in run_each(executor, _calls(race, {one.name: one for one in fronts})).values()
        for row in race_rows(one)
    ]
    tell("times of maxima and steps")
    rows += polygon_race(rounds=effort.rounds)
    rows += [row for one in trajectories.values() for row in step_race(one, steps=effort.steps)]
    return rows, draw(folder, corners, trajectories, ways)


def _calls(function: Callable[[Any], Result], arguments: Mapping[str, Any]) -> dict[tuple[str], Callable[[], Result]]:
    """Return one call of a function per argument, by the argument's name."""
    return {(name,): partial(function, argument) for name, argument in arguments.items()}


if __name__ == "__main__":
    main()
