"""Random moves: made by us and by peers, judged, and counted in a table, losses first."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

import paretoik as pk
from paretoik.errors import Infeasible
from paretoik.formulations.navigation import natural_weights
from paretoik.nlp.program import Program
from paretoik.pareto.differentiable import Differentiable
from paretoik.pareto.navigation import Aim, FrontPoints, Wish, reach
from studies.benchmarks.navigation.cases import Case
from studies.benchmarks.peers.solvers import COLD, WARM, Peer
from studies.reporting import Row


@dataclass(frozen=True, kw_only=True)
class MoveOptions:
    """The lengths of random moves, and tolerances; all but ``critical`` and ``violation`` are shares of a range.

    A move goes from ``shortest`` to ``longest``; ``around`` is the number of points asked for around one. A move is
    certified up to a residual ``critical`` and a ``violation``, and equals another one within ``same``. If every
    objective has a ``weight``, the exchange rate must agree within the share ``rate`` with a further move by
    ``rate_step``. That step is as small as the residuals of both ends allow: fronts of sliders are so curved that the
    mean rate over 1e-3 is 1.65 times the certificate's, 1.04 over 1e-4 and 1.0001 over 1e-5.
    """

    shortest: float = 0.01
    longest: float = 0.2
    around: int = 4
    critical: float = 1e-6
    violation: float = 1e-8
    same: float = 1e-5
    rate: float = 0.05
    rate_step: float = 1e-5
    weight: float = 1e-3


OPTIONS = MoveOptions()


class Try(NamedTuple):
    """A peer's result for a move: its name, seconds, and the payer's value if it converged."""

    peer: str
    seconds: float
    value: float | None


@dataclass(eq=False)
class Tally:
    """Results of moves, one entry per move."""

    certified: list[bool] = field(default_factory=list)
    non_dominated: list[bool] = field(default_factory=list)
    followed: list[bool] = field(default_factory=list)
    best: list[bool] = field(default_factory=list)
    rate: list[bool] = field(default_factory=list)
    step: list[float] = field(default_factory=list)
    whole: list[float] = field(default_factory=list)
    predicted: list[bool] = field(default_factory=list)
    prediction: list[float] = field(default_factory=list)
    missed: list[float] = field(default_factory=list)
    peer_solved: dict[str, list[bool]] = field(default_factory=dict)
    peer_seconds: dict[str, list[float]] = field(default_factory=dict)

    unreachable: int = 0
    around: int = 0

    def add_tries(self, tries: Sequence[Try]) -> None:
        """Record the peers' results for a move that some method can make."""
        for each in tries:
            self.peer_seconds.setdefault(each.peer, []).append(each.seconds)
            self.peer_solved.setdefault(each.peer, []).append(each.value is not None)


def rows_of(name: str, case: Case, tally: Tally) -> list[Row]:
    """Return the rows of a case."""
    moves = len(tally.certified)

    def row(label: str, column: str, unit: str, ours: float, reference: float | None = None, source: str = "") -> Row:
        return Row(name, label, column, unit, ours, reference=reference, source=source)

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
        row("new points around one", f"of {OPTIONS.around}", "", tally.around),
        step,
        row("a step with its certificate", "median", "ms CPU", median(tally.whole)),
        row("predicted", f"of {len(tally.predicted)} followed", "%", share(tally.predicted)),
        row("a prediction", "median", "ms CPU", median(tally.prediction)),
        row("misses the certified point by", "median", "of a range", float(np.median(tally.missed or [np.nan]))),
    ]
    for peer, seconds in tally.peer_seconds.items():
        solved, name_only = tally.peer_solved[peer], peer.split()[0]
        rows.append(row("a step", f"beside {peer}", "ms CPU", median(tally.step), median(seconds), name_only))
        rows.append(row("converged", f"beside {peer}", "%", share(tally.certified), share(solved), name_only))
    lost = [each for each in rows if each.reference is not None and _is_lost(each, each.reference)]
    return [*lost, *(each for each in rows if each not in lost)]


def _is_lost(row: Row, reference: float) -> bool:
    """Return whether a time is longer, or a share smaller, than its reference."""
    return row.ours > reference if row.unit == "ms CPU" else row.ours < reference


def random_aim(front: pk.Front, objectives: int, rng: np.random.Generator) -> tuple[int, Aim]:
    """Return a row of a front and a random wish there."""
    widths, values = np.ptp(front.ranges, axis=1), front.minimised
    while True:
        row, k = int(rng.integers(len(front))), int(rng.integers(len(widths)))
        by = float(np.exp(rng.uniform(np.log(OPTIONS.shortest), np.log(OPTIONS.longest))))
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
    residual, violation = moved.certificates.criticality[choice.index], moved.certificates.violation[choice.index]
    to.certified.append(bool(note["share"] == 1.0 and residual <= OPTIONS.critical and violation <= OPTIONS.violation))
    ours = moved.minimised[choice.index]
    dominating = (front.minimised <= ours).all(axis=1) & (front.minimised < ours).any(axis=1)
    to.non_dominated.append(not dominating.any())
    to.best.append(bool(note["share"] == 1.0 and ours[payer] <= min([*values, np.inf]) + OPTIONS.same * widths[payer]))
    if note["followed"] and note["share"] == 1.0:
        _try_prediction(front, moved, id, wish, to)
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


def _try_prediction(front: pk.Front, moved: pk.Front, id: int, wish: Wish, to: Tally) -> None:
    """Predict a move that was followed, and compare the prediction with the point found."""
    choice, widths = moved.navigated, np.ptp(front.ranges, axis=1)
    assert choice is not None
    payer, by = front.names[wish.payers[0]], wish.by * float(widths[wish.improve])
    began = time.process_time()
    try:
        prediction = front.predict(id, improve=front.names[wish.improve], allow=payer, by=by)
    except Infeasible:
        to.predicted.append(False)
        return
    to.prediction.append(time.process_time() - began)
    to.predicted.append(True)
    to.missed.append(float((np.abs(prediction.objectives - choice.objectives) / widths).max()))


def _try_rate(moved: pk.Front, choice: pk.Choice, wish: Wish, to: Tally) -> None:
    """Compare a point's exchange rate, if it has one, with a small move."""
    assert moved.certificates is not None
    i, j = wish.improve, wish.payers[0]
    rate = moved.certificates.exchange_rates[choice.index, i, j]
    if not np.isfinite(rate) or moved.certificates.weights[choice.index].min() < OPTIONS.weight:
        return
    by = OPTIONS.rate_step * float(np.ptp(moved.ranges[i]))
    try:
        near = moved.navigate(choice, improve=moved.names[i], allow=moved.names[j], by=by).navigated
    except Infeasible:
        return
    assert near is not None
    change = near.objectives - choice.objectives
    to.rate.append(bool(abs(change[j] / change[i] / rate - 1.0) <= OPTIONS.rate))
