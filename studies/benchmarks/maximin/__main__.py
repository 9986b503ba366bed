"""MaxiMin against pymoo's algorithms: same evaluations, same first populations, seeds interleaved; losses first.

    python -m studies.benchmarks.maximin [--quick] [--goals | --peers NAME ...] [--seeds N] [--problems NAME ...]
                                         [--runs FOLDER] [--cluster ADDRESS] [--json FILE]

There are two of ours: ``MaxiMinNSGA2``, and pymoo's own NSGA-II with our survival, ``NSGA2(survival=MaxiMin())``; only
the mating differs between them. Peers have pymoo's defaults: NSGA-II with crowding, and with its crowding "pcd" (two
objectives only) and "mnn", NSGA-III and MOEA/D (without constraints only) with one reference direction per individual,
SMS-EMOA (not with five objectives) and AGE-MOEA. --peers selects some of them; --goals selects those of our goals,
crowding and SMS-EMOA. Problems are ZDT, DTLZ, WFG, MW, CTP, DASCMOP, BNH, OSY and TNK of pymoo, the 55 of COCO's
bbob-biobj if its package ``coco-experiment`` is installed, a steep tail and ``energy_torque``; ``--problems`` takes
names and families.

The final populations are judged by hypervolume (reference 1.1), IGD+ and additive epsilon, normalised by the union of
all fronts. A run without a feasible point counts as
the corner of the hypervolume. On the steep tail only the useful corner counts, and ours is also compared with a run
that is told of that corner by ``ranges=``.

A loss or a win is a significant Mann-Whitney test; "equal" (or "within margin") are two one-sided tests against the
peer scaled by one minus and one plus the margin of the indicator. Both are corrected by Holm over the table of each of
ours; the rest is undecided. A12 is the probability that one of our runs is the better one. Control-C judges the seeds
that are done. With --runs every run is stored, and a later call with the same folder resumes, or adds problems and
peers. Runs of ours are repeated after any change of ``paretoik/search``, those of the peers with another pymoo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from studies.benchmarks.maximin.cases import BIOBJECTIVE, COCO, Case, cases
from studies.benchmarks.maximin.judging import comparison_rows, cost_rows, goal_rows, judge
from studies.benchmarks.maximin.runs import CROWDING, HYPERVOLUME, LEFT_OUT, PEERS, run_all
from studies.reporting import report, study_parser

QUICK = {"ZDT1": 50, "ZDT5": 50, "DTLZ2-3": 40, "MW3": 50, "steep tail": 50}


def choose_cases(names: Sequence[str], *, quick: bool) -> list[Case]:
    """Choose cases by their names or families and, for --quick, shorten them."""
    every = cases()
    families = list(dict.fromkeys(case.family for case in every.values()))
    unknown = sorted(set(names) - set(every) - set(families))
    if unknown:
        wish = f"some of {', '.join(families)}, or of their problems' names such as {next(iter(every))}"
        raise SystemExit(f"--problems must be {wish}, got {', '.join(unknown)}")
    selected = set(names or (QUICK if quick else every))
    chosen = [case for case in every.values() if {case.name, case.family} & selected]
    return [replace(case, generations=QUICK.get(case.name, 50)) for case in chosen] if quick else chosen


def tell_left_out(chosen: Sequence[Case], *, quick: bool) -> None:
    """Print which runs are shorter, and which are left out and why."""
    if quick:
        print(f"quick: {', '.join(f'{case.name} {case.generations} generations' for case in chosen)} only")
    print("\n".join(f"left out: {what}" for what in LEFT_OUT))
    if not COCO:
        print(f"left out: {BIOBJECTIVE}, whose package coco-experiment is not installed")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark from the command line."""
    parser = study_parser(__doc__, quick="five problems, few generations, 11 seeds", cluster="all runs")
    parser.add_argument("--seeds", type=int, help="runs of each method (31; 11 with --quick)")
    parser.add_argument("--problems", nargs="+", default=[], metavar="NAME", help="only these problems or families")
    beside = parser.add_mutually_exclusive_group()
    beside.add_argument("--goals", action="store_true", help=f"against {CROWDING} and {HYPERVOLUME} only")
    beside.add_argument("--peers", nargs="+", choices=PEERS, metavar="NAME", help=f"only some of {', '.join(PEERS)}")
    parser.add_argument("--runs", type=Path, metavar="FOLDER", help="store every run here, and read the stored ones")
    options = parser.parse_args(arguments)
    seeds = options.seeds if options.seeds is not None else (11 if options.quick else 31)
    if seeds < 2:
        parser.error(f"--seeds must be at least 2, got {seeds}")
    chosen = choose_cases(options.problems, quick=options.quick)
    peers = (CROWDING, HYPERVOLUME) if options.goals else options.peers
    if peers is not None:
        chosen = [replace(case, peers=tuple(peers)) for case in chosen]
    tell_left_out(chosen, quick=options.quick)
    runs = run_all(chosen, seeds, options.runs, cluster=options.cluster)
    if min((len(each) for each in runs.values()), default=0) < 2:
        parser.exit(1, "interrupted before two seeds were done: nothing to judge\n")
    judged = judge(runs, chosen)
    rows = [*comparison_rows(judged), *cost_rows(judged, chosen), *goal_rows(judged, chosen)]
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
