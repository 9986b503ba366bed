"""The method that looks a few samples ahead: its numbers, and how they follow from times of the path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.inputs import finite_array, shown
from paretoik.resolution.method import Method, Number, Parameter, number
from paretoik.task.objectives import Objective, kinetic_energy

Predictive = TypeVar("Predictive", bound="PredictiveKineticEnergy")


@check_call
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PredictiveKineticEnergy(Method):
    """The null space of the task is used to minimise the kinetic energy over a few samples ahead.

    ``objective`` may be another integral one of positions, velocities and accelerations: the torque norm, for one.
    ``horizon`` h is the number of samples ahead, ``prediction_step`` ΔT [s] the time between, by default 0.2 of the
    path's duration over h, and ``update_interval`` [s] that between predictions, by default half of it. The last sample
    counts ``terminal`` times more: what comes after the horizon costs as well. ``feedback`` [1/s] of the tracking error
    is 0 by default: open loop, as in the paper. These may be arrays (*batch,).

    Raises InvalidInput for numbers out of range. Source: Tringali & Cocuzza 2021, PMKE.
    """

    objective: Objective = kinetic_energy
    horizon: int | np.ndarray = 2
    prediction_step: Number | None = None
    update_interval: Number | None = None
    terminal: Number = field(default=0.0, metadata=number(search=(0.0, 4.0)))
    feedback: Number = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        finite_array("PredictiveKineticEnergy: horizon", self.horizon)
        horizon = np.asarray(self.horizon)
        if horizon.dtype.kind not in "iu" or not (horizon >= 1).all():
            raise InvalidInput(
                f"PredictiveKineticEnergy: a horizon of 1 sample or more wanted, got {shown(self.horizon)}"
            )
        for name in ("prediction_step", "update_interval"):
            value = getattr(self, name)
            if value is not None and not (finite_array(f"PredictiveKineticEnergy: {name}", value) > 0).all():
                raise InvalidInput(f"PredictiveKineticEnergy: {name} of more than 0 s wanted, got {shown(value)}")
        if not (finite_array("PredictiveKineticEnergy: feedback", self.feedback) >= 0).all():
            raise InvalidInput(f"PredictiveKineticEnergy: feedback of 0 or more wanted, got {shown(self.feedback)}")
        if not isinstance(self.objective, Objective):
            raise InvalidInput(f"PredictiveKineticEnergy: an objective wanted, got {shown(self.objective)}")

    def parameters(self, times: Float[np.ndarray, " time"]) -> tuple[Parameter, ...]:
        """Return the numbers that are searched by default.

        Beside its fields these are ``prediction_time`` [s], the horizon times the prediction step, and
        ``update_share``, the update interval over the prediction time.

        Raises InvalidInput for a path of fewer than three samples.
        """
        if len(times) < 3:
            raise InvalidInput(f"path: at least 3 samples wanted, got {len(times)}")
        return (
            Parameter("horizon", 1, min(6, (len(times) - 1) // 2), scale="integer"),
            Parameter("prediction_time", 0.0, 0.5 * float(times[-1] - times[0])),
            Parameter("update_share", 0.0, 1.0),
            *super().parameters(times),
        )

    def with_values(
        self: Predictive, values: Mapping[str, np.ndarray], times: Float[np.ndarray, " time"]
    ) -> Predictive:
        """Return the method with values (motions,) for some of its numbers.

        Times become whole samples: at least one, and as many as fit into the path.
        """
        dt, derived = float(times[1] - times[0]), ("prediction_time", "update_share")
        fields = {name: value for name, value in values.items() if name not in derived}
        horizon = np.asarray(values.get("horizon", self.horizon))
        if "prediction_time" in values:
            stride = np.maximum(np.floor(values["prediction_time"] / dt / horizon + 1e-9), 1)
            fields["prediction_step"] = stride * dt
        elif "prediction_step" in values:
            longest = (len(times) - 1) // horizon
            fields["prediction_step"] = np.clip(np.round(values["prediction_step"] / dt), 1, longest) * dt
        if "update_share" in values:
            step = fields.get("prediction_step", self.prediction_step)
            stride = 0.2 * (times[-1] - times[0]) / horizon / dt if step is None else np.asarray(step) / dt
            fields["update_interval"] = np.maximum(np.round(values["update_share"] * stride * horizon), 1) * dt
        elif "update_interval" in values:
            fields["update_interval"] = np.maximum(np.round(values["update_interval"] / dt), 1) * dt
        return super().with_values(fields, times)
