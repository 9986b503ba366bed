"""Random moves along certified fronts: certified, non-dominated, rates right, beside IPOPT and FATROP; losses first.

    python -m studies.benchmarks.navigation [--quick] [--moves N] [--problems NAME ...] [--json FILE]

Every move improves a random objective of a random point by 1 to 20 % of its range, no further than the best of the
front, one random objective paying, the others held. A move counts as certified if its point has a residual of at most
1e-6 and keeps its limits to 1e-8, as best if no method found a payer lower by more than 1e-5 of its range: ours from
every point of the front, and the peers. Rates are those of a further move by 0.1 % against the certificate's. Peers
start warm from the point that is left, and cold from one that a seed draws among the front's; where there is a compiler
they get compiled code, on the Panda, whose code takes minutes to compile, CasADi's interpreter. FATROP cannot state a
cycle, and neither of them obstacles, directions or paths that are not given. Times are processor time, ours with all
that is followed and solved for a move.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

import paretoik as pk
from paretoik.errors import Infeasible
from paretoik.formulations.navigation import natural_weights
from paretoik.formulations.protocol import Differentiable
from paretoik.nlp.program import Program
from paretoik.pareto.goals import Aim, Wish
from paretoik.pareto.navigation import FrontPoints, reach
from problems import kim_2021, panda, tringali_2020
from studies.benchmarks.certified.staged import StagedProgram, staged_program
from studies.benchmarks.fronts.cases import trade_off_maker
from studies.benchmarks.fronts.programs import JointProgram, compiled_program, joint_program
from studies.benchmarks.planner.compiling import COMPILER
from studies.reporting import Row, report, study_parser, tell

LEAST, MOST, SMALL = 0.01, 0.2, 1e-3  # shares of a range
CRITICAL, VIOLATION, SAME, RATE = 1e-6, 1e-8, 1e-5, 0.05
POST, RADIUS, THICKNESS, CLEARANCE = (0.33, -0.1), 0.04, 0.015, 0.005  # m: of post and links
AROUND = 4  # points that are asked for around one


@dataclass(frozen=True, kw_only=True)
class Goals:
    """What a problem's moves are to reach: a step [ms], certified ones and best known ones [%]."""

    step: float | None = None
    certified: float | None = None
    best: float | None = None


@dataclass(frozen=True, kw_only=True)
class Case:
    """A problem, the points of its front, whether peers have a program of it, and whether that is compiled."""

    make: Callable[[], pk.Tracking | pk.DirectionalMaxima | pk.PointToPoint]
    points: int = 12
    has_peers: bool = True
    compiles: bool = True
    goals: Goals = Goals()


def past_a_post() -> pk.Tracking:
    """Return the papers' line with a post beside it that the links have to stay clear of."""
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
        make=tringali_2020.energy_torque, points=20, goals=Goals(step=10.0, certified=99.5, best=98.0)
    ),
    "papers' arm, circle": Case(make=trade_off_maker("simulation_5")),
    "papers' arm, past a post": Case(make=past_a_post, has_peers=False),
    "Panda, three objectives": Case(
        make=panda.across_the_table, compiles=False, goals=Goals(step=100.0, certified=95.0, best=93.0)
    ),
    "directions, motors at the joints": Case(make=kim_2021.directions_jam, has_peers=False),
    "point to point, sliders": Case(make=kim_2021.point_to_point_dam, has_peers=False),
}
QUICK = tuple(CASES)[:1]
Peer: TypeAlias = JointProgram | StagedProgram


class Try(NamedTuple):
    """What a peer made of a move: who, in how many seconds, and the payer's value where it arrived."""

    peer: str
    seconds: float
    value: float | None


@dataclass(eq=False)
class Tally:
    """What came of moves, one entry a move."""

    certified: list[bool] = field(default_factory=list)
    non_dominated: list[bool] = field(default_factory=list)
    followed: list[bool] = field(default_factory=list)
    best: list[bool] = field(default_factory=list)
    rate: list[bool] = field(default_factory=list)
    step: list[float] = field(default_factory=list)
    whole: list[float] = field(default_factory=list)
    peer_solved: dict[str, list[bool]] = field(default_factory=dict)
    peer_seconds: dict[str, list[float]] = field(default_factory=dict)

    unreachable: int = 0
    around: int = 0

    def add_tries(self, tries: Sequence[Try]) -> None:
        """Write down what peers made of a move that somebody can make."""
        for each in tries:
            self.peer_seconds.setdefault(each.peer, []).append(each.seconds)
            self.peer_solved.setdefault(each.peer, []).append(each.value is not None)


def random_aim(front: pk.Front, objectives: int, rng: np.random.Generator) -> tuple[int, Aim]:
    """Return a row of a front and what is wished for there."""
    widths, values = np.ptp(front.ranges, axis=1), front.minimised
    while True:
        row, k = int(rng.integers(len(front))), int(rng.integers(len(widths)))
        by = float(np.exp(rng.uniform(np.log(LEAST), np.log(MOST))))
        if by <= (values[row, k] - values[:, k].min()) / widths[k]:
            break
    payer = int(rng.choice([j for j in range(len(widths)) if j != k]))
    weights = natural_weights(front, row) * widths
    wish = Wish(improve=k, payers=(payer,), by=by)
    return row, Aim(wish=wish, ranges=widths, start=values[row], weights=weights / weights.sum(), objectives=objectives)


def try_move(
    front: pk.Front, row: int, aim: Aim, peers: Mapping[str, Peer], rng: np.random.Generator, to: Tally
) -> None:
    """Move, and write down what came of it, beside what others find."""
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
        to.unreachable += not values
        if values:
            to.add_tries(tries)
            to.certified.append(False)
            to.best.append(False)
        return
    whole = time.process_time() - began
    choice, note = moved.navigated, moved.provenance["navigations"][-1]
    assert choice is not None
    assert moved.certificates is not None
    if note["share"] < 1.0 and not values:
        to.unreachable += 1
        return
    to.add_tries(tries)
    to.whole.append(whole)
    to.step.append(note["seconds"])
    to.followed.append(note["followed"])
    residual, violation = moved.certificates.kkt_residual[choice.index], moved.certificates.violation[choice.index]
    to.certified.append(bool(note["share"] == 1.0 and residual <= CRITICAL and violation <= VIOLATION))
    ours = moved.minimised[choice.index]
    dominating = (front.minimised <= ours).all(axis=1) & (front.minimised < ours).any(axis=1)
    to.non_dominated.append(not dominating.any())
    to.best.append(bool(note["share"] == 1.0 and ours[payer] <= min([*values, np.inf]) + SAME * widths[payer]))
    _try_rate(moved, choice, wish, to)


def _peers_tries(
    program: Program,
    points: FrontPoints,
    row: int,
    aim: Aim,
    peers: Mapping[str, Peer],
    rng: np.random.Generator,
) -> list[Try]:
    """Return what peers make of a move, each warm and cold."""
    payer, ceilings, tries = aim.wish.payers[0], aim.start.copy(), list[Try]()
    ceilings[aim.wish.improve] -= aim.wish.by * aim.ranges[aim.wish.improve]
    ceilings[payer] = np.inf
    starts = {"warm": points.x[row], "cold": points.x[int(rng.integers(len(points.x)))]}
    for name, peer in peers.items():
        for start, q in starts.items():
            began = time.process_time()
            motion, _ = peer.solve(q, payer, ceilings, aim.ranges, warm=start == "warm")
            seconds = time.process_time() - began
            value = None if motion is None else float(program.evaluate(motion)[0][payer])
            tries.append(Try(f"{name} {start}", seconds, value))
    return tries


def peers_of(case: Case, problem: object, folder: Path) -> dict[str, Peer]:
    """Return the peers that can state a problem, compiled into a folder."""
    if not case.has_peers or not isinstance(problem, pk.Tracking):
        return {}
    task, compiles = problem.task, case.compiles and COMPILER is not None
    name = "navigated_cycle" if task.cyclic else "navigated"
    peers: dict[str, Peer] = {"IPOPT": joint_program(task, compiled_program(task, name, folder) if compiles else "")}
    if not task.cyclic:
        peers["FATROP"] = staged_program(task, folder if compiles else None, name)
    return peers


def _try_rate(moved: pk.Front, choice: pk.Choice, wish: Wish, to: Tally) -> None:
    """Compare the exchange rate of a point with a small move, where it has one."""
    assert moved.certificates is not None
    i, j = wish.improve, wish.payers[0]
    rate = moved.certificates.exchange_rates[choice.index, i, j]
    if not np.isfinite(rate) or moved.certificates.weights[choice.index].min() < SMALL:
        return
    by = SMALL * float(np.ptp(moved.ranges[i]))
    try:
        near = moved.navigate(choice, improve=moved.names[i], allow=moved.names[j], by=by).navigated
    except Infeasible:
        return
    assert near is not None
    change = near.objectives - choice.objectives
    to.rate.append(bool(abs(change[j] / change[i] / rate - 1.0) <= RATE))


def rows_of(name: str, case: Case, tally: Tally) -> list[Row]:
    """Return the rows of a case."""
    moves = len(tally.certified)

    def row(label: str, column: str, unit: str, ours: float, reference: float | None = None, source: str = "") -> Row:
        return Row(table=name, row=label, column=column, unit=unit, ours=ours, reference=reference, source=source)

    def share(values: Sequence[bool]) -> float:
        return 100 * float(np.mean(values)) if values else np.nan

    def median(values: Sequence[float]) -> float:
        return 1e3 * float(np.median(values)) if values else np.nan

    goals = case.goals
    step = row("a step", "median", "ms CPU", median(tally.step), goals.step, "goal")
    rows = [
        row("certified", f"of {moves} moves", "%", share(tally.certified), goals.certified, "goal"),
        row("best known", f"of {moves} moves", "%", share(tally.best), goals.best, "goal"),
        row("non-dominated by the front it left", f"of {len(tally.non_dominated)}", "%", share(tally.non_dominated)),
        row("followed along its branch", f"of {len(tally.followed)}", "%", share(tally.followed)),
        row("rates within 5 % of a small move", f"of {len(tally.rate)}", "%", share(tally.rate)),
        row("out of reach for all methods", "moves", "", tally.unreachable),
        row("new points around one", f"of {AROUND}", "", tally.around),
        step,
        row("a step with its certificate", "median", "ms CPU", median(tally.whole)),
    ]
    for peer, seconds in tally.peer_seconds.items():
        solved, name_only = tally.peer_solved[peer], peer.split()[0]
        rows.append(row("a step", f"beside {peer}", "ms CPU", median(tally.step), median(seconds), name_only))
        rows.append(row("converged", f"beside {peer}", "%", share(tally.certified), share(solved), name_only))
    lost = [each for each in rows if each.reference is not None and _is_lost(each, each.reference)]
    return [*lost, *(each for each in rows if each not in lost)]


def _is_lost(row: Row, reference: float) -> bool:
    """Return whether a time is longer, or a share smaller, than what it is held against."""
    return row.ours > reference if row.unit == "ms CPU" else row.ours < reference


def run_case(name: str, moves: int, folder: Path) -> list[Row]:
    """Return the rows of a case after so many moves."""
    case, tally, rng = CASES[name], Tally(), np.random.default_rng(0)
    tell(f"{name}: its front")
    problem = case.make()
    front = pk.epsilon_front(problem, points=case.points, starts=12, seed=0, observe=False)
    peers, bounds = peers_of(case, problem, folder), len(problem.program().upper)
    denser = front.refine_around(int(front.ids[len(front) // 2]), points=AROUND)  # compiled once, too
    tally.around = len(np.setdiff1d(denser.ids, front.ids))
    for i in range(moves):
        if i % 10 == 0:
            tell(f"{name}: move {i} of {moves}")
        row, aim = random_aim(front, bounds, rng)
        try_move(front, row, aim, peers, rng, tally)
    return rows_of(name, case, tally)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the benchmark from the command line."""
    parser = study_parser(__doc__, quick="the papers' arm alone, 12 moves")
    parser.add_argument("--moves", type=int, help="moves a problem (167: 1,000 in all; 12 with --quick)")
    parser.add_argument("--problems", nargs="+", choices=list(CASES), metavar="NAME", help="only these problems")
    options = parser.parse_args(arguments)
    moves = options.moves if options.moves is not None else 12 if options.quick else 167
    if moves < 1:
        parser.error(f"--moves: at least 1 wanted, got {moves}")
    with tempfile.TemporaryDirectory() as folder:
        names = options.problems or (QUICK if options.quick else CASES)
        rows = [row for name in names for row in run_case(name, moves, Path(folder))]
    report(rows, json_file=options.json)


if __name__ == "__main__":
    main()
