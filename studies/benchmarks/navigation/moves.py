"""Random moves: made by us and by peers, and judged."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

import paretoik as pk
from paretoik.errors import Infeasible
from paretoik.formulations.navigation import natural_weights
from paretoik.nlp.program import Program
from paretoik.pareto.differentiable import Differentiable
from paretoik.pareto.navigation import Aim, FrontPoints, Wish, reach
from studies.benchmarks.navigation.cases import Peer
from studies.benchmarks.navigation.options import OPTIONS
from studies.benchmarks.navigation.tally import Tally, Try


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
    program: Program,
    points: FrontPoints,
    row: int,
    aim: Aim,
    peers: Mapping[str, Peer],
    rng: np.random.Generator,
) -> list[Try]:
    """Return the peers' results for a move, each warm and cold."""
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
