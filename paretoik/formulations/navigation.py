"""Moves along a front: the point of a move is limited between samples, certified, and added to the front."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Point
from paretoik.errors import Infeasible, InvalidInput
from paretoik.formulations.motions import points_between, restore_motions
from paretoik.formulations.protocol import Differentiable, Individuals, exceeded_between
from paretoik.front.certificates import Certificates, concatenate
from paretoik.front.choice import Prediction
from paretoik.front.front import Front
from paretoik.front.navigation import NavigationRequest
from paretoik.front.points import NAVIGATIONS, StoredJoints, StoredMotions, largest_id, take, widths_of
from paretoik.nlp.program import Goal, Program
from paretoik.pareto.certificates import certify
from paretoik.pareto.continuation import Optimum, can_follow, guess_optimum
from paretoik.pareto.continuation import predict as predict_optimum
from paretoik.pareto.navigation import Aim, Destination, FrontPoints, Wish, move, reach
from paretoik.pareto.placement import POINT_TOLERANCE
from paretoik.runs.machine import single_blas_thread

# Result of a move along a front: sentences for people, numbers for machines.


MET = 1e-6  # share of a wish that may be missed without a remark, since solvers are inexact


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
    """Return the note of a move, its text under "reason"; ``dominated`` points left the front."""
    start = int(front.ids[request.row])
    row = int(np.flatnonzero(after.ids == id)[0])
    signs = np.where(front.maximised, -1.0, 1.0)
    change = after.objectives[row] - front.objectives[request.row]
    predicted = aim.predicted * aim.ranges * signs * destination.share
    is_new = certificate is not None
    words = [
        _moved(front, request, change, predicted, start, id, is_new),
        _how(front, request, destination, is_new),
        *([] if certificate is None else [_certified_words(certificate)]),
        *([f"It dominates {_points(dominated)}, which left the front."] if dominated else []),
    ]
    followed = destination.followed
    return {
        "from": start,
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


def _moved(
    front: Front,
    request: NavigationRequest,
    change: np.ndarray,
    predicted: np.ndarray,
    start: int,
    id: int,
    is_new: bool,
) -> str:
    """Return the change of every objective, and the change that exchange rates predicted."""
    parts = list[str]()
    for k in (request.improve, *request.payers):
        text = f"{front.names[k]} {change[k]:+.4g} {front.units[k]}".rstrip()
        if k == request.improve:
            share = abs(change[k]) / request.by
            text += " as asked" if abs(share - 1) <= MET else f", {share:.1%} of what was asked"
        elif np.isfinite(predicted[k]) and predicted[k] != 0:
            text += f" ({predicted[k]:+.4g} by the exchange rates there)"
        parts.append(text)
    fixed = [k for k in range(len(front.names)) if k != request.improve and k not in request.payers]
    parts += [f"{front.names[k]} {change[k]:+.2g} {front.units[k]}, held".replace(" ,", ",") for k in fixed]
    where = f"new point {id}" if is_new else f"point {id}, known already and no worse"
    return f"From point {start} to {where}: {'; '.join(parts)}."


def _how(front: Front, request: NavigationRequest, destination: Destination, is_new: bool) -> str:
    """Return how the point was reached, and whether the front jumps on the way."""
    followed, name = destination.followed, front.names[request.improve]
    if destination.arrived and followed is not None:
        steps = f"{followed.steps} step{'s' * (followed.steps != 1)}"
        corrections = f"{followed.corrections} correction{'s' * (followed.corrections != 1)}"
        text = f"Its branch was followed in {steps} with {corrections}: no jump."
        if destination.share < 1.0:
            text += f" From there on no better {name} was found that the others pay for."
        return text
    if followed is None:
        cause = (
            "Optima cannot be followed past kinks or if functions relate samples: it was solved from the start and "
            "its neighbours."
        )
    elif followed.share == 0.0:
        cause = "Its branch could not be followed: it was sought from the start and its neighbours."
    elif followed.share < 1.0:
        cause = (
            f"Its branch was followed {followed.share:.0%} of the way: it was sought from there and from neighbours."
        )
    else:
        cause = "Its branch leads to a worse point: it was sought from neighbours."
    jump = (
        "The front jumps on the way: between the two motions there are motions worse than both."
        if destination.jump
        else "There is no jump on the way."
    )
    return f"{cause} {jump}"


def _certified_words(certificate: Certificates) -> str:
    residual, status = float(certificate.criticality[0]), str(certificate.status[0])
    at, between = float(certificate.violation[0]), float(certificate.violation_between[0])
    return f"Certificate: {status}, residual {residual:.1e}, violation {at:.1e} at samples, {between:.1e} between."


def _points(ids: list[int]) -> str:
    return f"point{'s' * (len(ids) != 1)} {', '.join(map(str, ids))}"


# Moves along a front: goal, certificate, and new point.


@dataclass(frozen=True, kw_only=True)
class FrontNavigationOptions:
    """Settings of points that satisfy limits between samples.

    ``rounds`` is the number of times that a point is solved again for its tighter limits, or left for a better one. It
    may exceed limits between samples by a share ``between`` of their ranges. Points within ``tolerance`` are the same.
    """

    rounds: int = 3
    between: float = 1e-8
    tolerance: float = 10 * POINT_TOLERANCE


OPTIONS = FrontNavigationOptions()
_STARTS: WeakKeyDictionary[Front, dict[tuple[int, bytes, bytes, bytes], Optimum | None]] = WeakKeyDictionary()


@dataclass(frozen=True, kw_only=True, eq=False)
class Arrival:
    """The certified point of a move, as a batch of one individual."""

    individual: Individuals
    certificate: Certificates


def navigate(problem: Any, front: Front, request: NavigationRequest) -> Front:
    """Return the front with the certified point of a request, or with a note of the better point.

    Raises Infeasible if no point is better in the requested objective.
    """
    formulation: Differentiable = problem
    between = _between(problem)
    with single_blas_thread():
        program = formulation.program()
        points = FrontPoints(x=formulation.front_points(front), objectives=front.minimised)
        aim = _aim(front, request, program)
        began = time.process_time()
        destination = move(program, points, request.row, aim, between)
        seconds = time.process_time() - began
        if destination is None:
            raise Infeasible(
                f"navigate must make {_wish(front, request)}, but found no point within all limits "
                f"at the cost of {', '.join(front.names[k] for k in request.payers)}"
            )
        arrival = _certified(formulation, destination, aim, between)
        moved = _joined(problem, front, request, aim, destination, arrival)
    *others, note = moved.provenance[NAVIGATIONS]
    return replace(moved, provenance={**moved.provenance, NAVIGATIONS: [*others, {**note, "seconds": seconds}]})


def predict(problem: Any, front: Front, request: NavigationRequest) -> Prediction:
    """Return the predicted result of the move that a request asks for, by derivatives at its start.

    Raises InvalidInput if optima cannot be followed, and Infeasible if derivatives give no prediction.
    """
    formulation: Differentiable = problem
    with single_blas_thread():
        program = formulation.program()
        if not can_follow(program):
            raise InvalidInput(
                "predict must have optima that can be followed, got kinks, or functions that relate samples"
            )
        aim = _aim(front, request, program)
        optimum = _start(formulation, program, front, request.row, aim.at_share(0.0))
        x = None if optimum is None else predict_optimum(program, optimum, aim.at_share)
        if x is None:
            raise Infeasible(f"predict must make {_wish(front, request)}, which derivatives there do not reach")
        individual = formulation.individuals(x[None])
    return Prediction(
        objectives=individual.objectives[0] * np.where(front.maximised, -1.0, 1.0),
        names=front.names,
        units=front.units,
        motion=None if individual.motions is None else individual.motions[0],
    )


def _start(formulation: Differentiable, program: Program, front: Front, row: int, goal: Goal) -> Optimum | None:
    """Return a point of a front as the optimum of a goal; it is cached with the front, since sliders ask again."""
    optima, key = (
        _STARTS.setdefault(front, {}),
        (row, goal.weights.tobytes(), goal.rows.tobytes(), goal.upper.tobytes()),
    )
    if key not in optima:
        (x,) = formulation.front_points(take(front, np.array([row])))
        optima[key] = guess_optimum(program, x, goal)
    return optima[key]


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
    """Return the weights of the minimised objectives at a point, in natural units, the largest 1.

    They follow from the exchange rates, which do not depend on ranges; without these, from the weights themselves.
    """
    assert front.certificates is not None
    weights = front.certificates.weights[row] / widths_of(front)
    main = int(np.argmax(front.certificates.weights[row]))
    signs = np.where(front.maximised, -1.0, 1.0)
    rates = -front.certificates.exchange_rates[row, :, main] * signs * signs[main]
    rates[main] = 1.0
    return np.where(np.isfinite(rates), rates, weights / weights[main])


def _between(problem: Any) -> Callable[[Point, Point, Float[np.ndarray, " shares"]], np.ndarray]:
    return lambda x, other, shares: points_between(getattr(problem, "task", None), np.stack([x, other]), shares)[0]


def _certified(formulation: Differentiable, destination: Destination, aim: Aim, between: Any) -> Arrival:
    """Return the point with its certificate; it satisfies limits between samples if possible.

    The point is solved again with its tighter limits. A saddle is replaced by the better point next to it.
    """
    x, ranges = destination.x, aim.ranges
    goal = aim.at_share(destination.share)
    for _ in range(OPTIONS.rounds):
        constrained, programs = formulation.hold_between(x[None], ranges)
        x, program = constrained[0], programs[0]
        if not np.array_equal(x, destination.x):
            again = reach(program, x, goal)
            x = x if again is None or not _keeps_limits(formulation, again, x) else again
        arrival, better = _certificate(formulation, program, x, aim)
        if better is None:
            break
        again = reach(formulation.program(), better, goal)
        x = better if again is None else again
    return arrival


def _keeps_limits(formulation: Differentiable, x: Point, other: Point) -> bool:
    """Return whether a point satisfies its limits between samples, or violates them no more than another."""
    both = formulation.individuals(np.stack([x, other])).violation_between
    return bool(both[0] <= max(OPTIONS.between, both[1]))


def _certificate(formulation: Differentiable, program: Program, x: Point, aim: Aim) -> tuple[Arrival, Point | None]:
    individual = formulation.individuals(x[None])
    certificates, better = certify(
        program,
        individual.x,
        ranges=aim.ranges,
        signs=np.where(formulation.maximised, -1.0, 1.0),
        violation_between=individual.violation_between,
        exceeded=exceeded_between(formulation, individual),
        discretisation=individual.discretisation,
    )
    return Arrival(individual=individual, certificate=certificates), better[0]


def _joined(
    problem: Any, front: Front, request: NavigationRequest, aim: Aim, destination: Destination, arrival: Arrival
) -> Front:
    """Return the front with the point, without the points it dominates, and with a note of the move in provenance."""
    assert front.certificates is not None
    value, values = arrival.individual.objectives[0] / aim.ranges, front.minimised / aim.ranges
    better = np.flatnonzero((values <= value + OPTIONS.tolerance).all(axis=1))
    moves = list(front.provenance.get(NAVIGATIONS, ()))
    if len(better):
        id, dominated = int(front.ids[better[np.argmin(values[better].sum(axis=1))]]), np.zeros(0, dtype=int)
        joined = front
    else:
        id = largest_id(front) + 1
        dominated = np.flatnonzero((value <= values).all(axis=1))
        joined = _add(problem, front, dominated, id, arrival)
    note = describe_move(
        front,
        joined,
        request,
        aim,
        destination,
        id,
        [int(i) for i in front.ids[dominated]],
        None if len(better) else arrival.certificate,
    )
    provenance = {**front.provenance, NAVIGATIONS: [*moves, note]}
    return replace(joined, provenance=provenance)


def _add(problem: Any, front: Front, dominated: np.ndarray, id: int, arrival: Arrival) -> Front:
    """Return the front with a point added and the rows ``dominated`` removed."""
    stay = np.setdiff1d(np.arange(len(front)), dominated)
    individual, certificates = arrival.individual, front.certificates
    assert certificates is not None
    genes = None
    if front.genes is not None and individual.genes is not None:
        genes = np.concatenate([front.genes[stay], individual.genes])
    motions = None
    if front.motions is not None and individual.motions is not None:
        new = individual.motions
        motions = StoredMotions(
            arm=StoredJoints(joint_names=tuple(new.arm.joint_names)),
            time=np.concatenate([_times(front.motions)[stay], _times(new)]),
            q=np.concatenate([np.asarray(front.motions.q)[stay], new.q]),
        )
    signs = np.where(front.maximised, -1.0, 1.0)
    violation = certificates.violation if front.violation is None else front.violation
    joined = Front(
        ids=np.append(front.ids[stay], id),
        objectives=np.concatenate([front.objectives[stay], individual.objectives * signs]),
        names=front.names,
        units=front.units,
        maximised=front.maximised,
        genes=genes,
        motions=motions,
        violation=np.append(violation[stay], arrival.certificate.violation),
        certificates=concatenate([certificates[stay], arrival.certificate]),
        ranges=front.ranges,
        provenance=front.provenance,
        problem=problem,
    )
    return replace(joined, motions=restore_motions(problem, joined))


def _times(motions: Any) -> np.ndarray:
    return np.broadcast_to(np.asarray(motions.time, dtype=float), np.shape(motions.q)[:-1])
