"""Moves along a front: the new point is certified and added.

It satisfies limits between samples if possible.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from jaxtyping import Float

from paretoik.errors import Infeasible, InvalidInput
from paretoik.formulations.motions import points_between, restore_motions
from paretoik.formulations.protocol import ProblemParts
from paretoik.front.certificates import Certificates, concatenate
from paretoik.front.choice import Prediction
from paretoik.front.front import Front
from paretoik.front.navigation import NavigationRequest
from paretoik.front.points import NAVIGATIONS, StoredJoints, StoredMotions, largest_id, take, widths_of
from paretoik.nlp.program import Program
from paretoik.pareto.certified_front import certify_individuals
from paretoik.pareto.continuation import Optimum, can_follow, guess_optimum
from paretoik.pareto.continuation import predict as predict_optimum
from paretoik.pareto.differentiable import Differentiable, Individuals
from paretoik.pareto.navigation import Aim, Destination, FrontPoints, Wish, move, reach
from paretoik.pareto.placement import POINT_TOLERANCE
from paretoik.runs.machine import single_blas_thread


@dataclass(frozen=True, kw_only=True)
class FrontNavigationOptions:
    """Settings of moves along a front."""

    rounds: int = 3  # largest number of times that a point is solved: with tighter limits, or from a better point
    between: float = 1e-8  # largest violation of limits between samples, as a share of their ranges
    tolerance: float = 10 * POINT_TOLERANCE  # distance below which points are the same
    met: float = 1e-6  # share of a requested change that may be missed without notice: solvers are inexact


OPTIONS = FrontNavigationOptions()

# Result of a move along a front: sentences for people, numbers for programs.


def describe_move(
    front: Front,
    after: Front,
    request: NavigationRequest,
    aim: Aim,
    destination: Destination,
    id: int,
    dominated: list[int],
    certificate: Certificates | None,
) -> dict[str, Any]:
    """Return the note of a move, with its text under "reason".

    ``dominated``: ids of the points that left the front
    """
    row = int(np.flatnonzero(after.ids == id)[0])
    change = after.objectives[row] - front.objectives[request.row]
    predicted = aim.predicted * aim.ranges * np.where(front.maximised, -1.0, 1.0) * destination.share
    followed, is_new = destination.followed, certificate is not None
    words = [_change_text(front, request, change, predicted, id, is_new), _way_text(front, request, destination)]
    if certificate is not None:
        residual, status = float(certificate.criticality[0]), str(certificate.status[0])
        at, between = float(certificate.violation[0]), float(certificate.violation_between[0])
        words.append(
            f"Certificate: {status}, residual {residual:.1e}, violation {at:.1e} at samples, {between:.1e} between."
        )
    if dominated:
        points = f"point{'s' * (len(dominated) != 1)} {', '.join(map(str, dominated))}"
        words.append(f"It dominates {points}, which left the front.")
    return {
        "from": int(front.ids[request.row]),
        "to": id,
        "new": is_new,
        "improve": front.names[request.improve],
        "by": request.by,
        "allow": [front.names[k] for k in request.payers],
        "change": dict(zip(front.names, change.tolist(), strict=True)),
        "predicted": {
            name: float(value) if np.isfinite(value) else None
            for name, value in zip(front.names, predicted, strict=True)
        },
        "share": destination.share,
        "followed": destination.arrived,
        "steps": 0 if followed is None else followed.steps,
        "corrections": 0 if followed is None else followed.corrections,
        "jump": destination.jump,
        "dominated": dominated,
        "reason": " ".join(words),
    }


def _change_text(
    front: Front, request: NavigationRequest, change: np.ndarray, predicted: np.ndarray, id: int, is_new: bool
) -> str:
    """Return every objective's change and the one predicted by exchange rates, as text."""
    parts = list[str]()
    for k in (request.improve, *request.payers):
        text = f"{front.names[k]} {change[k]:+.4g} {front.units[k]}".rstrip()
        if k == request.improve:
            share = abs(change[k]) / request.by
            text += " as asked" if abs(share - 1) <= OPTIONS.met else f", {share:.1%} of what was asked"
        elif np.isfinite(predicted[k]) and predicted[k] != 0:
            text += f" ({predicted[k]:+.4g} predicted by exchange rates)"
        parts.append(text)
    fixed = [k for k in range(len(front.names)) if k != request.improve and k not in request.payers]
    parts += [f"{front.names[k]} {change[k]:+.2g} {front.units[k]}, fixed".replace(" ,", ",") for k in fixed]
    where = f"new point {id}" if is_new else f"point {id}, which was known already and is no worse"
    return f"From point {front.ids[request.row]} to {where}: {'; '.join(parts)}."


def _way_text(front: Front, request: NavigationRequest, destination: Destination) -> str:
    """Return how the point was reached and whether the front jumps, as text."""
    followed, name = destination.followed, front.names[request.improve]
    if destination.arrived and followed is not None:
        steps = f"{followed.steps} step{'s' * (followed.steps != 1)}"
        corrections = f"{followed.corrections} correction{'s' * (followed.corrections != 1)}"
        text = f"The branch was followed in {steps} with {corrections}: no jump."
        if destination.share < 1.0:
            text += f" No larger gain in {name} was found."
        return text
    if followed is None:
        cause = (
            "The branch cannot be followed, because functions have kinks or relate samples: the point was solved from "
            "the start and its neighbours."
        )
    elif followed.share == 0.0:
        cause = "The branch could not be followed: the point was solved from the start and its neighbours."
    elif followed.share < 1.0:
        cause = (
            f"The branch was followed {followed.share:.0%} of the way: the point was solved from there and from "
            "neighbours."
        )
    else:
        cause = "The branch leads to a worse point: another one was solved from neighbours."
    jump = (
        "The front jumps on the way: between the two motions there are motions worse than both."
        if destination.jump
        else "There is no jump on the way."
    )
    return f"{cause} {jump}"


# Moves along a front: goal, certificate, and new point.


_STARTS: WeakKeyDictionary[Front, dict[tuple[int, bytes, bytes, bytes], Optimum | None]] = WeakKeyDictionary()


def navigate(problem: Any, front: Front, request: NavigationRequest) -> Front:
    """Return the front with a request's certified point, or with a note if a better one is known.

    Raises Infeasible if no point is better in the requested objective.
    """
    formulation: Differentiable = problem
    task = ProblemParts(problem).task
    with single_blas_thread():
        program = formulation.program()
        points = FrontPoints(x=formulation.front_points(front), objectives=front.minimised)
        aim = _aim(front, request, program)
        began = time.process_time()
        destination = move(
            program,
            points,
            request.row,
            aim,
            lambda x, other, shares: points_between(task, np.stack([x, other]), shares)[0],
        )
        seconds = time.process_time() - began
        if destination is None:
            raise Infeasible(
                f"navigate: no point within all limits was found with {_wish(front, request)}, at the cost of "
                f"{', '.join(front.names[k] for k in request.payers)}"
            )
        individual, certificate = _certified(formulation, destination, aim)
        # Return a better point of the front if there is one, else the new point in place of those that it dominates.
        value, values = individual.objectives[0] / aim.ranges, front.minimised / aim.ranges
        better = np.flatnonzero((values <= value + OPTIONS.tolerance).all(axis=1))
        if len(better):
            id, dominated = int(front.ids[better[np.argmin(values[better].sum(axis=1))]]), np.zeros(0, dtype=int)
            joined = front
        else:
            id, dominated = largest_id(front) + 1, np.flatnonzero((value <= values).all(axis=1))
            joined = _add(problem, front, dominated, id, individual, certificate)
        left = [int(i) for i in front.ids[dominated]]
        new = None if len(better) else certificate
        note = {**describe_move(front, joined, request, aim, destination, id, left, new), "seconds": seconds}
    moves = [*front.provenance.get(NAVIGATIONS, ()), note]
    return replace(joined, provenance={**front.provenance, NAVIGATIONS: moves})


def predict(problem: Any, front: Front, request: NavigationRequest) -> Prediction:
    """Return the predicted result of a move, by derivatives at its start.

    Raises InvalidInput if optima cannot be followed, Infeasible if there is no prediction.
    """
    formulation: Differentiable = problem
    with single_blas_thread():
        program = formulation.program()
        if not can_follow(program):
            raise InvalidInput("predict: optima cannot be followed, because functions have kinks or relate samples")
        aim = _aim(front, request, program)
        # The optimum at the start is cached with the front, because user interfaces ask for it repeatedly.
        row, goal, optima = request.row, aim.at_share(0.0), _STARTS.setdefault(front, {})
        key = (row, goal.weights.tobytes(), goal.rows.tobytes(), goal.upper.tobytes())
        if key not in optima:
            (start,) = formulation.front_points(take(front, np.array([row])))
            optima[key] = guess_optimum(program, start, goal)
        optimum = optima[key]
        x = None if optimum is None else predict_optimum(program, optimum, aim.at_share)
        if x is None:
            raise Infeasible(f"predict: no prediction was found for {_wish(front, request)}")
        individual = formulation.individuals(x[None])
    return Prediction(
        objectives=individual.objectives[0] * np.where(front.maximised, -1.0, 1.0),
        names=front.names,
        units=front.units,
        motion=None if individual.motions is None else individual.motions[0],
    )


def _wish(front: Front, request: NavigationRequest) -> str:
    name, unit = front.names[request.improve], front.units[request.improve]
    return f"{name} better by {request.by:.4g} {unit}".rstrip() + f" than at point {front.ids[request.row]}"


def _aim(front: Front, request: NavigationRequest, program: Program) -> Aim:
    ranges = widths_of(front)
    return Aim(
        wish=Wish(improve=request.improve, payers=request.payers, by=request.by / ranges[request.improve]),
        ranges=ranges,
        start=front.minimised[request.row],
        weights=natural_weights(front, request.row) * ranges,
        objectives=len(program.upper),
    )


def natural_weights(front: Front, row: int) -> Float[np.ndarray, " n_obj"]:
    """Return the weights of minimised objectives at a point, in natural units; the main one is 1.

    They are the exchange rates, which do not depend on ranges; if a rate is missing, the certificate's weight.
    """
    assert front.certificates is not None
    weights = front.certificates.weights[row] / widths_of(front)
    main = int(np.argmax(front.certificates.weights[row]))
    signs = np.where(front.maximised, -1.0, 1.0)
    rates = -front.certificates.exchange_rates[row, :, main] * signs * signs[main]
    rates[main] = 1.0
    return np.where(np.isfinite(rates), rates, weights / weights[main])


def _certified(formulation: Differentiable, destination: Destination, aim: Aim) -> tuple[Individuals, Certificates]:
    """Return the point, a batch of one, with its certificate.

    If the point exceeds limits between samples, it is solved again with tighter limits. If it is a saddle, a better
    point next to it replaces it.
    """
    x, ranges = destination.x, aim.ranges
    goal = aim.at_share(destination.share)
    for _ in range(OPTIONS.rounds):
        constrained, programs = formulation.hold_between(x[None], ranges)
        x, program = constrained[0], programs[0]
        if not np.array_equal(x, destination.x) and (again := reach(program, x, goal)) is not None:
            between = formulation.individuals(np.stack([again, x])).violation_between
            x = again if between[0] <= max(OPTIONS.between, between[1]) else x
        individual = formulation.individuals(x[None])
        certificate, better = certify_individuals(formulation, program, individual, ranges)
        if better[0] is None:
            break
        improved = reach(formulation.program(), better[0], goal)
        x = better[0] if improved is None else improved
    return individual, certificate


def _add(
    problem: Any, front: Front, dominated: np.ndarray, id: int, individual: Individuals, certificate: Certificates
) -> Front:
    """Return the front with one more point, without the ``dominated`` rows."""
    stay, certificates = np.setdiff1d(np.arange(len(front)), dominated), front.certificates
    signs = np.where(front.maximised, -1.0, 1.0)
    assert certificates is not None
    genes = motions = None
    if front.genes is not None and individual.genes is not None:
        genes = np.concatenate([front.genes[stay], individual.genes])
    if front.motions is not None and individual.motions is not None:
        before, new = front.motions, individual.motions
        times = [np.broadcast_to(np.asarray(each.time, float), np.shape(each.q)[:-1]) for each in (before, new)]
        motions = StoredMotions(
            arm=StoredJoints(joint_names=tuple(new.arm.joint_names)),
            time=np.concatenate([times[0][stay], times[1]]),
            q=np.concatenate([np.asarray(before.q)[stay], new.q]),
        )
    violation = certificates.violation if front.violation is None else front.violation
    joined = replace(
        front,
        ids=np.append(front.ids[stay], id),
        objectives=np.concatenate([front.objectives[stay], individual.objectives * signs]),
        genes=genes,
        motions=motions,
        violation=np.append(violation[stay], certificate.violation),
        certificates=concatenate([certificates[stay], certificate]),
        problem=problem,
    )
    return replace(joined, motions=restore_motions(problem, joined))
