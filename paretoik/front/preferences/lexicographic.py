"""A lexicographic preference: the first objective decides, the second among what is as good, and so on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.front.front import Choice, Front
from paretoik.front.preference_options import OPTIONS
from paretoik.front.preferences.named_numbers import named_numbers
from paretoik.front.subset import check_front, check_known
from paretoik.front.ties import first_row
from paretoik.inputs import likely_spelling, shown
from paretoik.tables import html_representation


@check_call
@dataclass(frozen=True, init=False, eq=False)
class Lexicographic:
    """Objectives in the order of their importance, each with how far from its best value is still as good.

    Of all points those within the tolerance of the best first objective remain, of these those within that of the best
    second one, and so on; of several that remain the one with the lowest sum of shares is chosen. Source: Miettinen
    1999, section 4.2; tolerances as in its section 4.2.2.

    ``Lexicographic("kinetic_energy", "torque_norm", tolerances={"kinetic_energy": 0.01})``: ``tolerances`` are in the
    objective's own units, ``tolerance_shares`` are shares of its stored range; an objective has one of them or none,
    which is 0. Without a tolerance a later objective decides only among equal values.

    Raises InvalidInput where a name comes twice, none comes, or a tolerance is negative or of no such objective.
    """

    order: tuple[str, ...]
    tolerances: Mapping[str, float]
    tolerance_shares: Mapping[str, float]

    def __init__(
        self,
        *order: str,
        tolerances: Mapping[str, float] | None = None,
        tolerance_shares: Mapping[str, float] | None = None,
    ) -> None:
        if not order or not all(isinstance(name, str) for name in order):
            raise InvalidInput(
                'lexicographic: names of objectives wanted, the most important first, as in Lexicographic("duration", '
                f'"energy"), got {shown(order[0] if len(order) == 1 else order)}'
            )
        twice = [name for name in order if order.count(name) > 1]
        if twice:
            raise InvalidInput(f"lexicographic: wanted each objective once, got {twice[0]} twice")
        amounts, shares = (
            named_numbers(
                f"lexicographic {field}",
                each,
                {},
                accept=lambda size: 0.0 <= size < np.inf,
                requirement="a tolerance >= 0",
            )
            for field, each in (("tolerances", tolerances), ("tolerance_shares", tolerance_shares))
        )
        for field, named in (("tolerances", amounts), ("tolerance_shares", shares)):
            for name in named.keys() - set(order):
                hint = likely_spelling(name, order)
                raise InvalidInput(
                    f"lexicographic {field}: wanted those of {', '.join(order)}, got {shown(name)}{hint}"
                )
        both = [name for name in amounts if name in shares]
        if both:
            raise InvalidInput(
                f"lexicographic: wanted one tolerance for {both[0]}, got one in units and one as a share"
            )
        assign = object.__setattr__
        assign(self, "order", order)
        assign(self, "tolerances", MappingProxyType(dict(amounts)))
        assign(self, "tolerance_shares", MappingProxyType(dict(shares)))

    def __repr__(self) -> str:
        parts = [repr(name) for name in self.order]
        for field, values in (("tolerances", self.tolerances), ("tolerance_shares", self.tolerance_shares)):
            parts += [f"{field}={dict(values)}"] if values else []
        return f"Lexicographic({', '.join(parts)})"

    _repr_html_ = html_representation

    def choose(self, front: Front) -> Choice:
        """Return the point that the order leads to; raises InvalidInput where a name is no objective."""
        check_front(front)
        check_known(front, "lexicographic", self.order)
        among, words, remaining = np.ones(len(front), dtype=bool), [], {}
        for name in self.order:
            axis = front.names.index(name)
            width = float(np.ptp(front.ranges[axis]))
            tolerance = self.tolerances.get(name, self.tolerance_shares.get(name, 0.0) * width)
            best = float(front.minimised[among, axis].min())
            among &= front.minimised[:, axis] <= best + tolerance + OPTIONS.rounding * width
            remaining[name] = int(among.sum())
            words.append(_step_in_words(front, axis, best, tolerance, remaining[name]))
        row = first_row(front, np.zeros(len(front)), among)
        last = f"point {front.ids[row]}" + ", whose sum of shares is the lowest" * (remaining[name] > 1)
        return front.choice(
            row,
            f"Of {len(front)} points {'; of these '.join(words)}: {last}.",
            preference=self,
            details={"remaining": remaining},
        )


def _step_in_words(front: Front, axis: int, best: float, tolerance: float, count: int) -> str:
    value = f"{front.names[axis]}, {-best if front.maximised[axis] else best:.4g}"
    if tolerance:
        within = f"{tolerance:.3g} {front.units[axis]}".rstrip()
        return (
            f"{count} {'is' if count == 1 else 'are'} within {within} of the best {value} {front.units[axis]}".rstrip()
        )
    return f"{count} {'has' if count == 1 else 'have'} the best {value} {front.units[axis]}".rstrip()
