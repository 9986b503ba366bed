"""What every method is: named numbers, the ranges that they are searched in, and a way to follow a path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar, get_args

import numpy as np
from jaxtyping import Float, Shaped

from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.inputs import check_choice, check_text, finite_array, likely_spelling, read_list, shown
from paretoik.tables import field_representation, html_representation
from paretoik.task.objectives import Objective

if TYPE_CHECKING:
    from paretoik.resolution.traces import ResolvedMotion
    from paretoik.task.motion_task import MotionTask

Number: TypeAlias = float | np.ndarray
Scale = Literal["linear", "log", "integer"]
Tuned = TypeVar("Tuned", bound="Method")


@check_call
@dataclass(frozen=True)
class Parameter:
    """A number that is searched between ``lower`` and ``upper``.

    ``scale`` "log" searches its decimal logarithm, "integer" whole numbers. It sets the ``fields`` of the method, by
    default the one of its own name: one number may set several. Raises InvalidInput for bounds that are no range.
    """

    name: str
    lower: float
    upper: float
    _: KW_ONLY
    scale: Scale = "linear"
    fields: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_text("parameter: name", self.name)
        label = f"parameter {self.name}"
        check_choice(f"{label}: scale", self.scale, get_args(Scale))
        fields = read_list(f"{label}: fields", self.fields, str, "names of fields")
        lower, upper = (finite_array(f"{label}, {side}", getattr(self, side), ()) for side in ("lower", "upper"))
        if not lower <= upper:
            raise InvalidInput(f"{label}: a lower bound up to the upper one wanted, got {lower:g} to {upper:g}")
        if self.scale == "log" and not lower > 0:
            raise InvalidInput(f"{label}: a lower bound above 0 wanted on a log scale, got {lower:g}")
        if self.scale == "integer" and (lower % 1 or upper % 1):
            raise InvalidInput(f"{label}: whole bounds wanted on an integer scale, got {lower:g} to {upper:g}")
        object.__setattr__(self, "fields", fields or (self.name,))

    @property
    def gene_bounds(self) -> tuple[float, float]:
        """Lower and upper bound of the gene."""
        if self.scale == "log":
            return float(np.log10(self.lower)), float(np.log10(self.upper))
        margin = 1 - 1e-9 if self.scale == "integer" else 0.0  # the floor of the upper bound is within the range
        return float(self.lower), float(self.upper) + margin

    def decode(self, genes: Float[np.ndarray, " points"]) -> Shaped[np.ndarray, " points"]:
        """Return the values that genes stand for."""
        if self.scale == "log":
            return np.asarray(10.0**genes)
        return np.floor(genes).astype(int) if self.scale == "integer" else genes


@check_call
@dataclass(frozen=True, kw_only=True, eq=False)
class Criterion:
    """What a projection improves on the side: an objective that looks at one sample's postures, or rates, alone.

    ``gain`` scales its gradient and must not be negative. In ``WeightedGradientProjection`` its weight falls from 1
    where the criterion is bad to 0 where it is good, by H, its value over ``scale``: normalised to
    exp(reference − H) for what is minimised, to 1 − exp(reference − H) for what is maximised. So ``reference`` is the
    best H of what is minimised, and the worst tolerable one of what is maximised (Wan et al. 2018, Eqs. 27 and 28).
    A mean over time, as ``manipulability`` is, counts as its value at the sample: ``motion.duration`` is 1 s there.

    Raises InvalidInput for other objectives and for numbers out of range.
    """

    objective: Objective
    gain: Number = 1.0
    reference: float = 0.0
    scale: float = 1.0

    def __post_init__(self) -> None:
        if not isinstance(self.objective, Objective) or self.objective.form not in ("integral", "peak"):
            raise InvalidInput(
                f"criteria: wants as objective one of form integral or peak, got {shown(self.objective)}"
            )
        label = f"criterion {self.objective.name}"
        finite_array(f"{label}, reference", self.reference, ())
        if not finite_array(f"{label}, scale", self.scale, ()) > 0:
            raise InvalidInput(f"{label}: a positive scale wanted, got {self.scale}")
        if not (finite_array(f"{label}, gain", self.gain) >= 0).all():
            raise InvalidInput(f"{label}: a gain of 0 or more wanted, got {shown(self.gain)}")

    @property
    def parameter(self) -> Parameter:
        """The gain's default range; raises InvalidInput where the gain is an array already."""
        if np.ndim(self.gain):
            raise InvalidInput(f"criterion {self.objective.name}: one gain wanted, got {self.gain}")
        lower, upper = (float(self.gain or 1.0) * share for share in (1e-4, 10.0))
        return Parameter(f"gain of {self.objective.name}", lower, upper, scale="log")


def number(
    *, below: float = np.inf, search: tuple[float, float] | None = None, scale: Scale = "linear"
) -> dict[str, Any]:
    """Return the metadata of a field of 0 or more and less than ``below``, searched in ``search`` by default."""
    return {"below": below, "search": search, "scale": scale}


@check_call
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Method:
    """A way to resolve one motion, or a batch of them where its numbers are arrays; ``resolve`` takes any."""

    __repr__ = field_representation
    _repr_html_ = html_representation

    def __post_init__(self) -> None:
        for each in fields(self):
            if "below" not in each.metadata:
                continue
            upper, value, label = (
                each.metadata["below"],
                getattr(self, each.name),
                f"{type(self).__name__}: {each.name}",
            )
            values, bound = finite_array(label, value), "" if np.isinf(upper) else f" and less than {upper:g}"
            if not ((values >= 0) & (values < upper)).all():
                raise InvalidInput(f"{label} of 0 or more{bound} wanted, got {shown(value)}")

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
                hint = likely_spelling(name, names)
                raise InvalidInput(f"{type(self).__name__}: one of {', '.join(names)} wanted, got {shown(name)}{hint}")
        return replace(self, **values)

    def follow(
        self, task: MotionTask, start: Float[np.ndarray, "*batch dof"], *, tolerance: float | None = None
    ) -> ResolvedMotion:
        """Return the motions from ``start``, as ``resolve(..., unreachable="track")`` does."""
        from paretoik.resolution.follow import follow  # here: it takes its time to load

        return follow(task, self, start, tolerance=tolerance)


def broadcast_shape(method: Method, start: np.ndarray, shapes: Sequence[tuple[int, ...]]) -> tuple[int, ...]:
    """Return the batch that starts (*starts, dof) and a method's numbers make, or raise InvalidInput."""
    name, starts = type(method).__name__, start.shape[:-1]
    try:
        shape = np.broadcast_shapes(starts, *shapes)
    except ValueError:
        different = ", ".join(sorted({str(one) for one in shapes if one}))
        raise InvalidInput(
            f"{name}: starts of shape {starts} and numbers of {different} do not fit each other"
        ) from None
    if 0 in shape:
        raise InvalidInput(f"{name}: numbers wanted, got an empty array")
    return shape
