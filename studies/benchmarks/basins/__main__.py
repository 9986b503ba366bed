"""How often the best optimum is found: our plan against multi-starts of IPOPT and FATROP; losses first.

    python -m studies.benchmarks.basins [--quick] [--problems TEXT ...] [--seed N] [--seeds N] [--cluster ADDRESS]
                                       [--json FILE]

Sixty problems drawn from a seed: planar 4R to 6R arms, a rail with a planar 3R arm, random 7R arms, UR10, iiwa and
Panda. Tasks are position, axis and full pose along lines and circles; objectives are kinetic energy, torque norm and,
once per kind of problem, a peak of velocity or torque. All use backward differences, as the peers' programs do. Ours
are plans at default settings over several seeds. A peer gets as much processor time as all of these together; its
starts alternate between starts like ours and plain rollouts. Its motions are led back to the path and judged by our
exact functions. FATROP's form has neither cycles nor variables of the whole motion, so it is left out of cycles and
peaks; IPOPT has peaks as epigraph variables. Building programs and making starts are not counted for peers; ours is a
whole plan.

The time to the best is the time of all tries divided by the number that ended there. A line is printed after every
problem, and --json writes the rows so far; the tables come at the end. Twenty seeds take hours, three about 40 minutes.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from studies.benchmarks.basins.cases import all_cases
from studies.benchmarks.basins.racing import OPTIONS, Race, race_named, table_rows
from studies.processes import each_result, workers_of
from studies.reporting import report, save_rows, study_parser, tell

SEEDS, QUICK_SEEDS = 20, 2
QUICK = 4  # problems


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark."""
    parser = study_parser(__doc__, quick="four problems, two seeds", cluster="each problem's race")
    parser.add_argument("--problems", nargs="+", metavar="TEXT", help="only problems whose names contain one of these")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seeds", type=int, help="plans of each problem")
    options = parser.parse_args(arguments)
    cases = all_cases(options.seed)
    if options.problems:
        cases = [case for case in cases if any(text in case.name for text in options.problems)]
    if options.quick:
        cases = cases[:QUICK]
    seeds = options.seeds or (QUICK_SEEDS if options.quick else SEEDS)
    calls = {(case.name,): partial(race_named, case.name, seed=options.seed, seeds=seeds) for case in cases}
    races, done = list[Race](), dict[tuple[str], Race]()
    with workers_of(options.cluster) as executor:
        for name, one in each_result(executor, calls, limit=OPTIONS.limit):
            done[name] = one
            races = [done[each] for each in calls if each in done]
            tell(one.summary)
            if options.json is not None:
                save_rows(table_rows(races), options.json)
    report(table_rows(races), json_file=options.json)


if __name__ == "__main__":
    main()
