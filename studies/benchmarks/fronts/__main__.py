"""Gains by MaxiMin, seeding and refinement, and comparisons of whole fronts with peers; losses first.

    python -m studies.benchmarks.fronts [--quick] [--seeds N] [--problems NAME ...] [--cluster ADDRESS] [--json FILE]

The methods: all eight cells of a factorial (selection by MaxiMin or pymoo's crowding; seeded or random start; refined
or not), our ``pk.solve`` with and without ``refine``, pymoo's NSGA-II, NSGA-III and SMS-EMOA, pygmo's NSGA-II and
MOEA/D (if pygmo is installed), and ε-constraints from many starts by FATROP, IPOPT and our own solver. There are two
budgets: equal evaluations, an iteration with derivatives counting as one, and equal CPU time, that of pymoo's NSGA-II
for those evaluations. Peers get our batched evaluation, encoding, seeds and archive; a method that finds more hands in
100 points spread by MaxiMin. Points that the verifier refuses (violation > 1e-8, tracking > 1e-6) are absent, for every
method.

Cells differ in nothing else: same operators, same mating. MaxiMin means our whole survival, with its places for
infeasible points and for species. Statistics are those of ``studies.benchmarks.maximin``; effects are contrasts of the
cells' means, seeds as blocks. Control-C judges the seeds that are done.
"""

from __future__ import annotations

from collections.abc import Sequence

from studies.benchmarks.fronts.cases import CASES, POPULATION, SAME
from studies.benchmarks.fronts.methods import PYGMO
from studies.benchmarks.fronts.running import (
    KINDS,
    Found,
    all_scores,
    comparison_rows,
    comparisons,
    effect_rows,
    effects,
    left_rows,
    run_all,
)
from studies.benchmarks.peers.solvers import COMPILER
from studies.benchmarks.reference_front import reference_front
from studies.reporting import Row, report, study_parser
from studies.significance import union

QUICK = ("energy_torque", "simulation 1")
QUICK_EVALUATIONS = 1200


def rows_of(results: Found) -> list[Row]:
    """Judge all runs: of a case against the union of its fronts under all budgets and the stored front."""
    compared, added, spent = [], [], []
    for case in dict.fromkeys(name for name, _ in results):
        fronts = [
            one.F for (name, _), runs in results.items() if name == case for each in runs.values() for one in each
        ]
        fronts += [reference_front()] if case == "energy_torque" else []
        reference = union(fronts)
        if not len(reference):
            print(f"{case}: no method found a point that the verifier accepts: not judged")
            continue
        for (name, kind), runs in results.items():
            if name == case:
                scores = all_scores(runs, reference)
                compared += comparisons(case, kind, scores)
                added += effects(f"{case}, equal {kind}", scores)
                spent += left_rows(case, kind, runs, scores)
    return [*comparison_rows(compared), *effect_rows(added), *spent]


def tell_left_out(chosen: Sequence[str]) -> None:
    """Print which methods are left out, and why."""
    print(SAME)
    print("left out: pymoo's pcd crowding, which crashes with three objectives")
    if not PYGMO:
        print("left out: pygmo, which is not installed")
    for case in chosen:
        if not CASES[case].staged:
            print(f"left out: ε-constraints by FATROP on {case}")
    if COMPILER is None:
        print("no C compiler: FATROP and IPOPT run with CasADi's own evaluation")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark from the command line."""
    parser = study_parser(
        __doc__, quick="two problems, few evaluations, 3 seeds", cluster="all runs (they see this machine's files)"
    )
    parser.add_argument("--seeds", type=int, help="runs of each method (31; 3 with --quick)")
    parser.add_argument("--problems", nargs="+", choices=list(CASES), metavar="NAME", help="only these problems")
    parser.add_argument("--evaluations", type=int, help="equal evaluations, in place of each problem's own")
    options = parser.parse_args(arguments)
    seeds = options.seeds if options.seeds is not None else 3 if options.quick else 31
    if seeds < 2:
        parser.error(f"--seeds must be at least 2, got {seeds}")
    evaluations = options.evaluations or (QUICK_EVALUATIONS if options.quick else None)
    if evaluations is not None and evaluations < 4 * POPULATION:
        parser.error(f"--evaluations must be at least {4 * POPULATION}, got {evaluations}")
    chosen = options.problems or (QUICK if options.quick else list(CASES))
    tell_left_out(chosen)
    if options.quick:
        print(f"quick: {', '.join(chosen)} only, {evaluations} evaluations, {seeds} seeds: too few to prove much")
        print("quick: FATROP and IPOPT with CasADi's own evaluation, not compiled")
    results = run_all(chosen, KINDS, seeds, evaluations, compiling=not options.quick, cluster=options.cluster)
    if min((len(runs) for each in results.values() for runs in each.values()), default=0) < 2:
        parser.exit(1, "interrupted before two seeds were done: nothing to judge\n")
    report(rows_of(results), json_file=options.json)


if __name__ == "__main__":
    main()
