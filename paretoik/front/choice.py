"""A chosen point with what explains it, and the protocol of preferences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard, runtime_checkable

import numpy as np

from paretoik.arrays import Values
from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.inputs import shown
from paretoik.tables import field_representation, fit_screen, html_representation

if TYPE_CHECKING:  # a front hands out choices
    from paretoik.front.front import Front


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Another point beside the chosen one: by how much it is better and worse, by objective, in natural units.

    ``better_in`` names the objectives that it stands for: those it is the best of all points in, or, of a neighbour,
    those that it is the nearest point to gain in. All amounts are positive.
    """

    id: int
    better_in: tuple[str, ...]
    gains: Mapping[str, float]
    costs: Mapping[str, float]

    __repr__ = field_representation
    _repr_html_ = html_representation


@dataclass(frozen=True, kw_only=True)
class ExchangeRate:
    """What one unit of ``gain`` costs of ``cost`` at the chosen point, the other objectives unchanged.

    ``low`` to ``high`` in the units of ``cost`` per unit of ``gain``, from the certificate. The rates that gain the
    same objective hold within a tenth as far as point ``holds_to``, which gains ``holds_for``; ``fails_at`` is the next
    point, where they do not any more. None where there is no such point, or rates are missing.
    """

    gain: str
    cost: str
    low: float
    high: float
    holds_to: int | None = None
    holds_for: float = 0.0
    fails_at: int | None = None

    __repr__ = field_representation
    _repr_html_ = html_representation


@check_call
@dataclass(frozen=True, kw_only=True, eq=False)
class Choice:
    """One point of a front: its ``id``, its row ``index``, its motion and objectives, and the ``reason`` of the choice.

    The reason is made from the other fields. ``verdict`` is what the preference says, ``preference`` itself, ``score``
    what it makes least (None where it has no such number) and ``details`` its further numbers, by name. ``shares`` say
    how far each objective is from the best of its stored range, as a share of it. ``ends`` are the best points of the
    single objectives, ``neighbours`` for each objective the nearest point (in shares) that gains in it, ``rates`` the
    certified exchange rates, ``jumps`` the pairs of ids beside it between which the front jumps to another branch.
    """

    id: int
    index: int
    objectives: Values
    reason: str
    motion: Any = None
    verdict: str = ""
    preference: Any = None
    score: float | None = None
    details: Mapping[str, Any] = field(default_factory=dict)
    shares: Values = field(default_factory=lambda: np.empty(0))
    ends: tuple[Comparison, ...] = ()
    neighbours: tuple[Comparison, ...] = ()
    rates: tuple[ExchangeRate, ...] = ()
    jumps: tuple[tuple[int, int], ...] = ()

    def __repr__(self) -> str:
        return fit_screen(f"Choice of point {self.id}: {self.reason}")

    _repr_html_ = html_representation


@runtime_checkable
class Preference(Protocol):
    """A preference, which chooses one point of a front that has at least one; write your own like this.

    ``choose`` returns ``front.choice(row, verdict)``: the row of the point, and a sentence that says why. What the
    choice gains and costs beside other points is added by the front. Measure on ``front.shares``, which come from the
    stored ranges, so that more points do not move the choice; in ``front.minimised`` less is better of every objective.

    >>> import numpy as np, paretoik as pk
    >>> class Median:
    ...     def choose(self, front):
    ...         return front.choice(len(front) // 2, "Half of the points have less energy.")
    >>> front = pk.Front(ids=np.arange(3), objectives=np.array([[1.0, 9.0], [2.0, 4.0], [3.0, 1.0]]),
    ...                  names=["energy", "torque"], units=["J", "N m"], maximised=[False, False])
    >>> choice = front.select(Median())
    >>> choice.id, choice.verdict
    (1, 'Half of the points have less energy.')
    """

    def choose(self, front: Front) -> Choice:
        """Return the preferred point of `front`."""


def is_preference(value: object) -> TypeGuard[Preference]:
    """Say whether a value can choose a point; a class cannot, nor an array, whose ``choose`` is another one."""
    return callable(getattr(type(value), "choose", None)) and not isinstance(value, type | np.ndarray)


def check_preference(name: str, value: object) -> None:
    """Raise InvalidInput, by ``name``, unless a value is a preference or None."""
    if value is not None and not is_preference(value):
        raise InvalidInput(f"{name}: a preference wanted, such as Weights(...), got {shown(value)}")
