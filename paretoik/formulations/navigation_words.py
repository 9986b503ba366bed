"""What became of a move along a front: in words for people, in numbers for machines."""

from __future__ import annotations

from typing import Any

import numpy as np

from paretoik.front.certificates import Certificates
from paretoik.front.front import Front
from paretoik.front.navigation import NavigationRequest
from paretoik.pareto.goals import Aim
from paretoik.pareto.navigation import Destination

MET = 1e-6  # share of a wish that may miss without a word: what solvers leave open


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
    """Return the note of a move from a front to the one after it, its words under "reason"; ``dominated`` went."""
    start = int(front.ids[request.row])
    row = int(np.flatnonzero(after.ids == id)[0])
    signs = np.where(front.maximised, -1.0, 1.0)
    change = after.objectives[row] - front.objectives[request.row]
    predicted = aim.predicted * aim.ranges * signs * destination.share
    is_new = certificate is not None
    words = [
        _moved(front, request, change, predicted, start, id, is_new),
        _how(front, request, destination, is_new),
        *([] if certificate is None else [_certified(certificate)]),
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
    """Return by how much every objective changed, and what exchange rates had promised."""
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
            text += f" From there on nothing better in {name} was found that the others pay for."
        return text
    if followed is None:
        cause = (
            "Optima cannot be followed past kinks, or where functions relate samples: it was solved from the start and "
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
        "The front jumps on the way: between the two motions others are worse than both."
        if destination.jump
        else "There is no jump on the way."
    )
    return f"{cause} {jump}"


def _certified(certificate: Certificates) -> str:
    residual, status = float(certificate.criticality[0]), str(certificate.status[0])
    at, between = float(certificate.violation[0]), float(certificate.violation_between[0])
    return f"Certificate: {status}, residual {residual:.1e}, violation {at:.1e} at samples, {between:.1e} between."


def _points(ids: list[int]) -> str:
    return f"point{'s' * (len(ids) != 1)} {', '.join(map(str, ids))}"
