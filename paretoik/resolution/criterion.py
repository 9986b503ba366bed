"""What a projection improves on the side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.inputs import finite_array
from paretoik.resolution.parameters import Number, Parameter
from paretoik.task.objectives import Objective


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
        """Check the numbers."""
        if not isinstance(self.objective, Objective) or self.objective.form not in ("integral", "peak"):
            raise InvalidInput(f"criteria: wants objectives of form integral or peak, got {self.objective!r}")
        what = f"criterion {self.objective.name}"
        finite_array(f"{what}, reference", self.reference, ())
        if not finite_array(f"{what}, scale", self.scale, ()) > 0:
            raise InvalidInput(f"{what}: a positive scale wanted, got {self.scale}")
        if not (finite_array(f"{what}, gain", self.gain) >= 0).all():
            raise InvalidInput(f"{what}: a gain of 0 or more wanted, got {self.gain}")

    @property
    def parameter(self) -> Parameter:
        """The gain's default range; raises InvalidInput where the gain is an array already."""
        if np.ndim(self.gain):
            raise InvalidInput(f"criterion {self.objective.name}: one gain wanted, got {self.gain}")
        lower, upper = (float(self.gain or 1.0) * share for share in (1e-4, 10.0))
        return Parameter(f"gain of {self.objective.name}", lower, upper, scale="log")
