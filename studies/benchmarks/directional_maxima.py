"""Postures that are fast in several directions: MaxiMin against pymoo, refined and certified; losses first.

    python -m studies.benchmarks.directional_maxima [--quick] [--seeds N] [--refined N] [--cluster ADDRESS]
                                                   [--json FILE]

Peers have pymoo's defaults, the same first genes and equal evaluations; fronts are judged as in ``benchmarks.maximin``,
certified ones included. ``pk.solve(refine=True)`` is compared with the best of these, with fewer seeds. Its rows say
how many points are certified minima, and how far their greatest values are from directional maxima, which bound them.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
from pymoo.optimize import minimize

import paretoik as pk
from paretoik.arrays import Objectives
from paretoik.search.genes import seeded_population
from problems import kim_2021
from studies.benchmarks.maximin import OURS, POPULATION, pymoo_algorithm
from studies.processes import run_each, workers_of
from studies.reporting import Row, report, study_parser
from studies.significance import MARGIN, compare, comparison_row, decide, scores

REFINED, GENERATIONS = "MaxiMin, refined", 26
PEERS = ("NSGA-II", "NSGA-III", "SMS-EMOA")
TABLE, CERTIFIED, COST = "MaxiMin beside pymoo, medians", "fronts that are refined", "median CPU time of a run"
WAN = ([0.5, 0.3, -0.2], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # m, and directions


def _kim(motors: str, **settings: Any) -> pk.DirectionalMaxima:
    """Return postures of Kim's arm at its place, by its "joint_motors" or "sliders"."""
    actuation = getattr(pk.capability, f"kim_{motors}")()
    return pk.DirectionalMaxima(pk.arms.kim_3r(), actuation, kim_2021.PLACE, kim_2021.WAYS, **settings)


def _spatial() -> pk.DirectionalMaxima:
    arm = pk.arms.wan_7r()
    return pk.DirectionalMaxima(arm, pk.capability.JointActuation.of(arm), *WAN, power=False)


CASES: dict[str, Callable[[], pk.DirectionalMaxima]] = {
    "joint motors: speeds, power": kim_2021.directions_jam,
    "sliders: speeds, power": kim_2021.directions_dam,
    "sliders: speeds, manipulability": partial(_kim, "sliders", power=False, objectives=[pk.manipulability]),
    "joint motors: forces": partial(_kim, "joint_motors", quantity="force"),
    "sliders: speed, force": kim_2021.speed_force_dam,
    "seven joints in space: speeds": _spatial,
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """The final front of a method with one seed, minimised, its CPU seconds, and the front itself if it is refined."""

    F: Objectives
    seconds: float
    front: pk.Front | None = None


@cache
def problem_of(case: str) -> pk.DirectionalMaxima:
    """Return the problem of a case, made once in each process."""
    return CASES[case]()


def run(case: str, name: str, seed: int) -> Run:
    """Return the run of a method on a case; by names so that it can run in another process."""
    problem = problem_of(case)
    size, begun = POPULATION[problem.n_obj], time.process_time()
    if name == REFINED:
        front = pk.solve(problem, population=size, generations=GENERATIONS, seed=seed, refine=True)
        return Run(F=front.minimised, seconds=time.process_time() - begun, front=front)
    first = seeded_population(problem, size, rng=np.random.default_rng([seed, size]))
    begun = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the peers' own warnings about divisions
        ours = pk.MaxiMinNSGA2(pop_size=size, sampling=first)
        method = ours if name == OURS else pymoo_algorithm(name, problem.n_obj, first)
        result = minimize(problem, method, ("n_gen", GENERATIONS), seed=seed)
    F = np.empty((0, problem.n_obj)) if result.F is None else np.atleast_2d(result.F)
    return Run(F=F, seconds=time.process_time() - begun)


def judge(runs: dict[tuple[str, str], list[Run]], cases: Sequence[str]) -> list[Row]:
    """Return comparisons of ours with every peer, losses first."""
    compared = []
    for case in cases:
        union = np.concatenate([one.F for (name, _), members in runs.items() if name == case for one in members])
        table = {name: [scores(one.F, union) for one in runs[case, name]] for name in (OURS, REFINED, *PEERS)}
        for indicator in MARGIN:
            values = {name: np.array([each[indicator] for each in scored]) for name, scored in table.items()}
            compared += [compare(case, indicator, peer, values[OURS], values[peer]) for peer in PEERS]
            best = max if indicator == "hypervolume" else min
            peer = best(PEERS, key=lambda name: float(np.median(values[name])))
            compared.append(compare(f"{case}, refined", indicator, peer, values[REFINED], values[peer]))
    return [comparison_row(TABLE, one, one.verdict) for one in decide(compared)]


def certified_rows(case: str, problem: pk.DirectionalMaxima, members: Sequence[Run]) -> list[Row]:
    """Return the share of refined points that are minima, and the greatest values against the bound."""
    fronts = [one.front for one in members if one.front is not None]
    certificates = [front.certificates for front in fronts if front.certificates is not None]
    minima = np.concatenate([each.status == "minimum" for each in certificates])
    quantities = problem.quantities
    each = [
        pk.directional_maxima(problem.arm, problem.actuation, problem.position, way[None], quantity=quantity).values
        for way, quantity in zip(problem.directions, quantities, strict=True)
    ]
    shares = np.array([front.objectives[:, : len(each)].max(axis=0) for front in fronts]) / np.concatenate(each)
    over = "LOSS: above the bound; " if shares.max() > 1 + 1e-6 else ""
    note = f"{over}medians by direction {', '.join(f'{share:.6f}' for share in np.median(shares, axis=0))}"
    rows = [
        ("points that are certified minima", "%", 100 * minima.mean(), f"of {len(minima)}"),
        ("greatest value beside its directional maximum, least of all seeds", "", float(shares.min()), note),
    ]
    return [Row(CERTIFIED, case, name, unit, float(v), note=n) for name, unit, v, n in rows]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run all methods, seeds interleaved, and report."""
    parser = study_parser(__doc__, quick="two seeds of the planar cases", cluster="all runs")
    parser.add_argument("--seeds", type=int, default=31)
    parser.add_argument("--refined", type=int, default=5, help="number of seeds whose fronts are refined too")
    options = parser.parse_args(arguments)
    cases, seeds = (list(CASES)[:5], 2) if options.quick else (list(CASES), options.seeds)
    methods = {name: min(seeds, options.refined) if name == REFINED else seeds for name in (OURS, REFINED, *PEERS)}
    calls = {
        (case, name, f"seed {seed}"): partial(run, case, name, seed)
        for seed in range(seeds)
        for case in cases
        for name, count in methods.items()
        if seed < count
    }
    with workers_of(options.cluster) as executor:
        results = run_each(executor, calls)
    runs = {
        (case, name): [results[case, name, f"seed {seed}"] for seed in range(count)]
        for case in cases
        for name, count in methods.items()
    }
    rows = judge(runs, cases)
    rows += [row for case in cases for row in certified_rows(case, problem_of(case), runs[case, REFINED])]
    for (case, name), members in runs.items():
        rows.append(Row(COST, case, name, "s", float(np.median([one.seconds for one in members]))))
    report(rows, json_file=options.json)


if __name__ == "__main__":
    from studies.benchmarks.directional_maxima import main as named_main  # workers know its functions by this name

    named_main()
