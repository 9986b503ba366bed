"""Random moves along certified fronts, with checks and comparisons with IPOPT and FATROP; losses first.

    python -m studies.benchmarks.navigation [--quick] [--moves N] [--seed S] [--problems NAME ...] [--json FILE]

Every move improves a random objective of a random point by 1 to 20 % of its range, at most up to the best value on the
front; one random objective pays, the others are held. A move is certified if its point has a residual of at most 1e-6
and satisfies its limits to 1e-8. It is best if no method, ours from every point of the front or a peer, found a payer
lower by more than 1e-5 of its range. Rates are those of a further move by 0.001 %. Peers start warm from the current
point, and cold from a random point; they get compiled code, except on the Panda, where that takes minutes. Times are
processor time, ours with everything that is followed and solved for a move.
"""

from __future__ import annotations

import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import paretoik as pk
from paretoik.errors import Infeasible
from paretoik.formulations.navigation import natural_weights
from paretoik.nlp.program import Program
from paretoik.pareto.differentiable import Differentiable
from paretoik.pareto.navigation import Aim, FrontPoints, Wish, reach
from problems import kim_2021, panda, tringali_2020
from studies.benchmarks.peers.programs import joint_program, staged_program
from studies.benchmarks.peers.solvers import COLD, WARM, Peer, compiled
from studies.benchmarks.planner.questions import tracking
from studies.reporting import Row, report, study_parser, tell

POST, RADIUS, THICKNESS, CLEARANCE = (0.33, -0.1), 0.04, 0.015, 0.005  # m: of post and links
SHORTEST, LONGEST = 0.01, 0.2  # of a range: lengths of moves
AROUND = 4  # points asked for around one
CRITICAL, VIOLATION, EQUAL = 1e-6, 1e-8, 1e-5  # of a certified move; share of a range of equal payers
# An exchange rate, of objectives with a least weight, must agree within a share with a further move. Its step is as
# small as residuals allow: on fronts of sliders the mean rate over 1e-3 is 1.65 times the certificate's, 1.04 over
# 1e-4 and 1.0001 over 1e-5.
WEIGHTY, AGREED, STEP = 1e-3, 0.05, 1e-5


@dataclass(frozen=True, kw_only=True)
class Case:
    """A problem, the size of its front, whether peers have a program of it, and whether that is compiled.

    The goals of its moves are a ``step`` [ms], ``certified`` ones and ``best`` known ones [%].
    """

    make: Callable[[], pk.Tracking | pk.DirectionalMaxima | pk.PointToPoint]
    points: int = 12
    has_peers: bool = True
    compiles: bool = True
    step: float | None = None
    certified: float | None = None
    best: float | None = None


def past_a_post() -> pk.Tracking:
    """Return the papers' line with a post next to it that the links must stay clear of."""
    return pk.Tracking(
        pk.arms.tringali_3r(),
        tringali_2020.straight(51),
        objectives=[pk.kinetic_energy, pk.torque_norm],
        limits=pk.Limits(position=np.deg2rad([90, 120, 120]), clearance=CLEARANCE),
        obstacles=[pk.obstacles.Circle(POST, RADIUS)],
        link_radius=THICKNESS,
        differences="backward",
    )


CASES = {
    "papers' arm, energy against torque": Case(
        make=tringali_2020.energy_torque, points=20, step=10.0, certified=99.5, best=98.0
    ),
    "papers' arm, circle": Case(make=partial(tracking, "simulation_5", both=True)),
    "papers' arm, past a post": Case(make=past_a_post, has_peers=False),
    "Panda, three objectives": Case(make=panda.across_the_table, compiles=False, step=100.0, certified=95.0, best=93.0),
    "directions, motors at the joints": Case(make=kim_2021.directions_jam, has_peers=False),
    "point to point, sliders": Case(make=kim_2021.point_to_point_dam, has_peers=False),
}
QUICK = tuple(CASES)[:1]


class Try(NamedTuple):
    """A peer's result for a move: its name, seconds, and the payer's value if it converged."""

    peer: str
    seconds: float
    value: float | None


class Tally:
    """Results of moves, one entry per move, by name: shares and seconds, ours and those of every peer."""

    def __init__(self) -> None:
        self.seen: defaultdict[str, list[Any]] = defaultdict(list)
        self.tries: defaultdict[str, list[Try]] = defaultdict(list)

    def add(self, **results: Any) -> None:
        """Record results by name."""
        for name, value in results.items():
            self.seen[name].append(value)

    def share(self, name: str) -> float:
        """Return the share of moves that are so [%]."""
        return 100 * float(np.mean(self.seen[name] or [np.nan]))

    def median(self, name: str) -> float:
        """Return the median of seconds [ms]."""
        return 1e3 * float(np.median(self.seen[name] or [np.nan]))


def run_case(name: str, moves: int, seed: int, folder: Path) -> list[Row]:
    """Return the rows of a case after a number of random moves."""
    case, tally, rng = CASES[name], Tally(), np.random.default_rng(seed)
    tell(f"{name}: its front")
    problem = case.make()
    front = pk.epsilon_front(problem, points=case.points, starts=12, seed=0, observe=False)
    bounds, peers = len(problem.program().upper), dict[str, Peer]()
    if case.has_peers and isinstance(problem, pk.Tracking):
        task, into = problem.task, folder if case.compiles else None
        peers["IPOPT"] = compiled(joint_program(task), f"navigated{'_cycle' * task.cyclic}", into)
        if not task.cyclic:
            peers["FATROP"] = compiled(staged_program(task), "navigated_staged", into)
    denser = front.refine_around(int(front.ids[len(front) // 2]), points=AROUND)  # this compiles, too
    for i in range(moves):
        if i % 10 == 0:
            tell(f"{name}: move {i} of {moves}")
        row, aim = random_aim(front, bounds, rng)
        try_move(front, row, aim, peers, rng, tally)
    return rows_of(name, case, tally, len(np.setdiff1d(denser.ids, front.ids)))


def rows_of(name: str, case: Case, tally: Tally, around: int) -> list[Row]:
    """Return the rows of a case, losses first; ``around`` is the number of new points around one."""

    def row(label: str, column: str, unit: str, ours: float, reference: float | None = None, source: str = "") -> Row:
        return Row(name, label, column, unit, ours, reference=reference, source=source)

    def counted(of: str) -> str:
        return f"of {len(tally.seen[of])}"

    moves, step = f"{counted('certified')} moves", tally.median("step")
    rows = [
        row("certified", moves, "%", tally.share("certified"), case.certified, "goal"),
        row("best known", moves, "%", tally.share("best"), case.best, "goal"),
        row("non-dominated by the front it left", counted("non_dominated"), "%", tally.share("non_dominated")),
        row("followed along its branch", counted("followed"), "%", tally.share("followed")),
        row("rates within 5 % of a small move", counted("rate"), "%", tally.share("rate")),
        row("out of reach for all methods", "moves", "", len(tally.seen["unreachable"])),
        row("new points around one", f"of {AROUND}", "", around),
        row("a step", "median", "ms CPU", step, case.step, "goal"),
        row("a step with its certificate", "median", "ms CPU", tally.median("whole")),
        row("predicted", f"{counted('predicted')} followed", "%", tally.share("predicted")),
        row("a prediction", "median", "ms CPU", tally.median("prediction")),
        row("misses the certified point by", "median", "of a range", tally.median("missed") / 1e3),
    ]
    for peer, tries in tally.tries.items():
        solved, only = 100 * float(np.mean([one.value is not None for one in tries])), peer.split()[0]
        seconds = 1e3 * float(np.median([one.seconds for one in tries]))
        rows.append(row("a step", f"beside {peer}", "ms CPU", step, seconds, only))
        rows.append(row("converged", f"beside {peer}", "%", tally.share("certified"), solved, only))

    def is_lost(each: Row) -> bool:  # a time is longer, or a share smaller, than its reference
        sign = 1 if each.unit == "ms CPU" else -1
        return each.reference is not None and sign * each.ours > sign * each.reference

    return sorted(rows, key=lambda each: not is_lost(each))


def random_aim(front: pk.Front, objectives: int, rng: np.random.Generator) -> tuple[int, Aim]:
    """Return a row of a front and a random wish there."""
    widths, values = np.ptp(front.ranges, axis=1), front.minimised
    while True:
        row, k = int(rng.integers(len(front))), int(rng.integers(len(widths)))
        by = float(np.exp(rng.uniform(np.log(SHORTEST), np.log(LONGEST))))
        if by <= (values[row, k] - values[:, k].min()) / widths[k]:
            break
    payer = int(rng.choice([j for j in range(len(widths)) if j != k]))
    weights = natural_weights(front, row) * widths
    wish = Wish(improve=k, payers=(payer,), by=by)
    return row, Aim(wish=wish, ranges=widths, start=values[row], weights=weights / weights.sum(), objectives=objectives)


def try_move(
    front: pk.Front, row: int, aim: Aim, peers: Mapping[str, Peer], rng: np.random.Generator, to: Tally
) -> None:
    """Move, and record the result and the peers' results."""
    formulation: Differentiable = front.problem
    program, points = formulation.program(), FrontPoints(x=formulation.front_points(front), objectives=front.minimised)
    goal, wish, widths = aim.at_share(1.0), aim.wish, aim.ranges
    payer, names = wish.payers[0], front.names
    values = [program.evaluate(x)[0][payer] for one in points.x if (x := reach(program, one, goal)) is not None]
    tries = _peers_tries(program, points, row, aim, peers, rng)
    values += [each.value for each in tries if each.value is not None]
    id, by = int(front.ids[row]), wish.by * float(widths[wish.improve])
    began = time.process_time()
    try:
        moved = front.navigate(id, improve=names[wish.improve], allow=names[payer], by=by)
    except Infeasible:
        moved = None
    whole, note = time.process_time() - began, None if moved is None else moved.provenance["navigations"][-1]
    if not values and (note is None or note["share"] < 1.0):
        to.add(unreachable=True)
        return
    for each in tries:
        to.tries[each.peer].append(each)
    if moved is None or note is None:
        to.add(certified=False, best=False)
        return
    choice, is_whole = moved.navigated, note["share"] == 1.0
    assert choice is not None
    assert moved.certificates is not None
    residual, violation = moved.certificates.criticality[choice.index], moved.certificates.violation[choice.index]
    ours = moved.minimised[choice.index]
    dominating = (front.minimised <= ours).all(axis=1) & (front.minimised < ours).any(axis=1)
    to.add(
        whole=whole,
        step=note["seconds"],
        followed=note["followed"],
        certified=bool(is_whole and residual <= CRITICAL and violation <= VIOLATION),
        non_dominated=not dominating.any(),
        best=bool(is_whole and ours[payer] <= min([*values, np.inf]) + EQUAL * widths[payer]),
    )
    if note["followed"] and is_whole:  # compare a prediction with the point found
        began = time.process_time()
        try:
            prediction = front.predict(id, improve=names[wish.improve], allow=names[payer], by=by)
        except Infeasible:
            to.add(predicted=False)
        else:
            missed = float((np.abs(prediction.objectives - choice.objectives) / widths).max())
            to.add(prediction=time.process_time() - began, predicted=True, missed=missed)
    _try_rate(moved, choice, wish, to)


def _peers_tries(
    program: Program, points: FrontPoints, row: int, aim: Aim, peers: Mapping[str, Peer], rng: np.random.Generator
) -> list[Try]:
    """Return the peers' results for a move, each warm and cold."""
    payer, ceilings, tries = aim.wish.payers[0], aim.start.copy(), list[Try]()
    ceilings[aim.wish.improve] -= aim.wish.by * aim.ranges[aim.wish.improve]
    ceilings[payer] = np.inf
    starts = {"warm": points.x[row], "cold": points.x[int(rng.integers(len(points.x)))]}
    for name, peer in peers.items():
        for start, q in starts.items():
            began = time.process_time()
            motion = peer.solve(q, payer, ceilings, aim.ranges, WARM if start == "warm" else COLD).motion
            seconds = time.process_time() - began
            value = None if motion is None else float(program.evaluate(motion)[0][payer])
            tries.append(Try(f"{name} {start}", seconds, value))
    return tries


def _try_rate(moved: pk.Front, choice: pk.Choice, wish: Wish, to: Tally) -> None:
    """Compare a point's exchange rate, if it has one, with a small move."""
    assert moved.certificates is not None
    i, j = wish.improve, wish.payers[0]
    rate = moved.certificates.exchange_rates[choice.index, i, j]
    if not np.isfinite(rate) or moved.certificates.weights[choice.index].min() < WEIGHTY:
        return
    by = STEP * float(np.ptp(moved.ranges[i]))
    try:
        near = moved.navigate(choice, improve=moved.names[i], allow=moved.names[j], by=by).navigated
    except Infeasible:
        return
    assert near is not None
    change = near.objectives - choice.objectives
    to.add(rate=bool(abs(change[j] / change[i] / rate - 1.0) <= AGREED))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark from the command line."""
    parser = study_parser(__doc__, quick="the papers' arm alone, 12 moves")
    parser.add_argument("--moves", type=int, help="moves a problem (167: 1,000 in all; 12 with --quick)")
    parser.add_argument("--seed", type=int, default=0, help="of the moves (0)")
    parser.add_argument("--problems", nargs="+", choices=list(CASES), metavar="NAME", help="only these problems")
    options = parser.parse_args(arguments)
    moves = options.moves if options.moves is not None else 12 if options.quick else 167
    if moves < 1:
        parser.error(f"--moves must be at least 1, got {moves}")
    if options.seed < 0:
        parser.error(f"--seed must be at least 0, got {options.seed}")
    with tempfile.TemporaryDirectory() as folder:
        names = options.problems or (QUICK if options.quick else CASES)
        rows = [row for name in names for row in run_case(name, moves, options.seed, Path(folder))]
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
