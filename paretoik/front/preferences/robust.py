"""A preference by weights that are not known exactly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Objectives, Values
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.front.front import Choice, Front
from paretoik.front.preferences.named_numbers import named_text
from paretoik.front.preferences.weights import check_weights, weights_by_axis, weights_in_words
from paretoik.front.reason import subject
from paretoik.front.subset import check_front
from paretoik.front.ties import first_row
from paretoik.inputs import finite_number, shown
from paretoik.tables import html_representation


@check_call
@dataclass(frozen=True, init=False, eq=False)
class Robust:
    """Weights that may each be wrong by a share ``uncertainty``, and the point regretted least whichever are right.

    The regret of a point under weights v is what another has less in v·Z. Weights w (their sum 1) lie in the box
    w(1 ± uncertainty); the regret is convex in them, so that it is largest at a vertex, and the point with the least
    largest regret is chosen (min-max regret; Savage 1951; Kouvelis and Yu 1997).

    ``Robust(kinetic_energy=0.3, torque_norm=0.7, uncertainty=0.2)``. Raises InvalidInput for weights as ``Weights``
    does, and for an uncertainty that is not between 0 and 1.
    """

    weights: Mapping[str, float]
    uncertainty: float

    def __init__(
        self, mapping: Mapping[str, float] | None = None, /, *, uncertainty: float = 0.2, **weights: float
    ) -> None:
        number = finite_number("robust uncertainty", uncertainty)
        if not 0 <= number <= 1:
            raise InvalidInput(f"robust uncertainty: wanted a share from 0 to 1, got {shown(uncertainty)}")
        object.__setattr__(self, "weights", check_weights("robust", mapping, weights))
        object.__setattr__(self, "uncertainty", number)

    def __repr__(self) -> str:
        return f"Robust({named_text(self.weights)}, uncertainty={self.uncertainty:g})"

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the point with the least largest regret; raises InvalidInput where a weight names no objective."""
        check_front(front)
        weights = weights_by_axis(front, self.weights, "robust")
        regrets, rivals = _largest_regrets(front.shares, weights, self.uncertainty)
        row = first_row(front, regrets)
        rival, regret = int(rivals[row]), float(regrets[row])
        worst = weights * (1 + self.uncertainty * np.sign(front.shares[row] - front.shares[rival]))
        text = (
            f"{subject(front, row)} has the least largest regret, {regret:.3g}, where each of the weights "
            f"{weights_in_words(front, weights)} may be wrong by {100 * self.uncertainty:.3g}%"
        )
        text += (
            f": at worst they are {weights_in_words(front, worst)}, and by these point {front.ids[rival]} "
            "has a weighted sum that is less by so much."
            if regret > 0
            else ": whichever they are, it has the least weighted sum."
        )
        return front.choice(
            row,
            text,
            preference=self,
            score=regret,
            details={
                "weights": dict(zip(front.names, weights.tolist(), strict=True)),
                "worst_weights": dict(zip(front.names, worst.tolist(), strict=True)),
                "rival": int(front.ids[rival]),
            },
        )


def _largest_regrets(
    shares: Objectives, weights: Float[np.ndarray, " n_obj"], uncertainty: float
) -> tuple[Values, np.ndarray]:
    """Return the largest regret of every point over the vertices of the box, and the row of the point that has less.

    Against one rival it is the largest v·(Z_p − Z_q) over the box, w·d + x w·|d|: no vertex need be listed.
    """
    regrets, rivals = np.empty(len(shares)), np.empty(len(shares), dtype=np.int64)
    for row, point in enumerate(shares):
        steps = point - shares
        against = steps @ weights + uncertainty * (np.abs(steps) @ weights)
        rivals[row] = against.argmax()
        regrets[row] = against[rivals[row]]
    return regrets, rivals
