"""What every method is: named numbers, the ranges that they are searched in, and a way to follow a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from jaxtyping import Float

from paretoik.errors import InvalidInput
from paretoik.inputs import finite_array
from paretoik.resolution.parameters import Parameter, Scale

if TYPE_CHECKING:
    from paretoik.resolution.traces import ResolvedMotion
    from paretoik.task.motion_task import MotionTask

Tuned = TypeVar("Tuned", bound="Method")


def number(
    *, below: float = np.inf, search: tuple[float, float] | None = None, scale: Scale = "linear"
) -> dict[str, Any]:
    """Return the metadata of a field of 0 or more and less than ``below``, searched in ``search`` by default."""
    return {"below": below, "search": search, "scale": scale}


@dataclass(frozen=True, kw_only=True, eq=False)
class Method:
    """A way to resolve one motion, or a batch of them where its numbers are arrays; ``resolve`` takes any."""

    def __post_init__(self) -> None:
        """Raise InvalidInput for a number outside the range of its field."""
        for each in fields(self):
            if "below" not in each.metadata:
                continue
            upper, value, what = each.metadata["below"], getattr(self, each.name), f"{type(self).__name__}: {each.name}"
            values, bound = finite_array(what, value), "" if np.isinf(upper) else f" and less than {upper:g}"
            if not ((values >= 0) & (values < upper)).all():
                raise InvalidInput(f"{what} of 0 or more{bound} wanted, got {value}")

    def parameters(self, times: Float[np.ndarray, " time"]) -> tuple[Parameter, ...]:
        """Return the numbers that are searched by default, on a path with these sample times [s]."""
        searched = [each for each in fields(self) if each.metadata.get("search") is not None]
        return tuple(Parameter(each.name, *each.metadata["search"], scale=each.metadata["scale"]) for each in searched)

    def with_values(self: Tuned, values: Mapping[str, np.ndarray], times: Float[np.ndarray, " time"]) -> Tuned:
        """Return the method with values (motions,) for some of its numbers, one motion each.

        Raises InvalidInput for what is none of its numbers, and for numbers out of range.
        """
        names = dict.fromkeys([each.name for each in self.parameters(times)])
        names.update(dict.fromkeys(each.name for each in fields(self)))
        for name in values:
            if name not in names:
                raise InvalidInput(f"{type(self).__name__}: one of {', '.join(names)} wanted, got {name!r}")
        return replace(self, **values)

    def follow(
        self, task: MotionTask, start: Float[np.ndarray, "*batch dof"], *, tolerance: float | None = None
    ) -> ResolvedMotion:
        """Return the motions from ``start``, as ``resolve(..., unreachable="track")`` does."""
        from paretoik.resolution.follow import follow  # here: it takes its time to load

        return follow(task, self, start, tolerance=tolerance)
