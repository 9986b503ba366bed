"""The methods that resolve velocities, and their secondary criteria.

All have steps q̇ = D Jᵀ(J D Jᵀ + ρ²I)⁻¹ v + N z, with the task velocities v, a diagonal D and a projector N. They
differ in D, ρ and z; ``ConstrainedQP`` takes the nearest step within limits. A method's numbers and the gains of
criteria may be arrays (*batch,): one motion each.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, TypeVar, get_args

import numpy as np
from jaxtyping import Float

from paretoik.errors import InvalidInput
from paretoik.inputs import ArrayLike, check_choice, finite_array, read_list, shown
from paretoik.resolution.predictive import PredictiveKineticEnergy as PredictiveKineticEnergy
from paretoik.resolution.protocol import Criterion as Criterion
from paretoik.resolution.protocol import Method as Method
from paretoik.resolution.protocol import Number as Number
from paretoik.resolution.protocol import Parameter as Parameter
from paretoik.resolution.protocol import number
from paretoik.task.objectives import Objective

__all__ = [
    "ConstrainedQP",
    "Criterion",
    "DampedLeastSquares",
    "GradientProjection",
    "LeastSquaresVelocity",
    "Method",
    "Nedungadi",
    "Parameter",
    "PredictiveKineticEnergy",
    "PseudoInverse",
    "VelocityMethod",
    "WeightedGradientProjection",
    "WeightedLeastNorm",
]


def __dir__() -> list[str]:
    return __all__


Variant = Literal["paper", "consistent"]
Gradient = TypeVar("Gradient", bound="GradientProjection")
Weighted = TypeVar("Weighted", bound="WeightedGradientProjection")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class VelocityMethod(Method):
    """Base of methods with feedback of the tracking error.

    feedback: gain [1/s], at most 1/Δt; None for 1/Δt

    Source: Wan et al. 2018, Eqs. 32 and 33.
    """

    feedback: Number | None = None

    def __post_init__(self) -> None:
        """Check that numbers are within their ranges; ``resolve``, which knows the steps, checks the feedback."""
        super().__post_init__()
        if self.feedback is not None:
            finite_array(f"{type(self).__name__}: feedback", self.feedback)

    @property
    def criterion_list(self) -> tuple[Criterion, ...]:
        """The secondary criteria."""
        return ()

    def parameters(self, times: Float[np.ndarray, " time"]) -> tuple[Parameter, ...]:
        """Return the numbers that are searched by default; the feedback's range follows from the steps."""
        highest = 1.0 / float(np.diff(times).max())
        return (Parameter("feedback", 0.02 * highest, highest), *super().parameters(times))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PseudoInverse(VelocityMethod):
    """The least joint velocities that satisfy the task: q̇ = J⁺v.

    Singular postures are refused. Source: Whitney 1969.
    """


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class LeastSquaresVelocity(PseudoInverse):
    """The pseudoinverse without feedback, by Euler steps: the error of a step remains.

    Source: Tringali & Cocuzza 2021, LSV.
    """

    feedback: Number | None = 0.0


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class DampedLeastSquares(VelocityMethod):
    """Damped velocities near singular postures: ρ² = ρ_max²(1 − (σ_min/ε)²) if σ_min < ε.

    region: ε, in units of the Jacobian
    damping: ρ_max, in units of the Jacobian

    Source: Nakamura & Hanafusa 1986; Wan et al. 2018, Eqs. 3 and 4.
    """

    region: Number = field(default=0.02, metadata=number(search=(1e-3, 1e-1), scale="log"))
    damping: Number = field(default=0.02, metadata=number(search=(1e-3, 1e-1), scale="log"))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class WeightedLeastNorm(DampedLeastSquares):
    """Joints are slow when they approach their position limits, and free when they leave.

    A joint at or past its limit stays there: nothing pushes it back. Source: Chan & Dubey 1995; Wan et al. 2018,
    Eqs. 10, 11 and 14.
    """


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class GradientProjection(DampedLeastSquares):
    """The gradients of criteria, times their gains, projected onto the null space of the task.

    criteria: one or more criteria, or objectives, which are criteria of gain 1

    A criterion that depends on positions is differentiated by these, at the last velocities; one that depends only on
    velocities is differentiated by velocities. Raises InvalidInput for other objects, equal names, and numbers out of
    range. Source: Liégeois 1977; Wan et al. 2018, Eqs. 12 and 13.
    """

    criteria: Iterable[Criterion | Objective] | Criterion | Objective = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "criteria", self.criterion_list)
        names = [one.objective.name for one in self.criterion_list]
        if len(set(names)) != len(names):
            raise InvalidInput(f"criteria: names must differ, got {', '.join(names)}")

    @property
    def criterion_list(self) -> tuple[Criterion, ...]:
        """The criteria, all with gains; raises InvalidInput for other objects."""
        criteria = (self.criteria,) if isinstance(self.criteria, Criterion | Objective) else self.criteria
        listed = read_list("criteria", criteria, object, "objectives of form integral or peak")
        return tuple(one if isinstance(one, Criterion) else Criterion(objective=one) for one in listed)

    def parameters(self, times: Float[np.ndarray, " time"]) -> tuple[Parameter, ...]:
        """Return the numbers that are searched by default, with the gain of every criterion."""
        return (*super().parameters(times), *(one.parameter for one in self.criterion_list))

    def with_values(self: Gradient, values: Mapping[str, np.ndarray], times: Float[np.ndarray, " time"]) -> Gradient:
        """Return the method with values (motions,) for some of its numbers and of its criteria's gains."""
        gains = {one.parameter.name: one for one in self.criterion_list}
        criteria = [replace(one, gain=values.get(name, one.gain)) for name, one in gains.items()]
        return replace(
            super().with_values({k: v for k, v in values.items() if k not in gains}, times), criteria=criteria
        )


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class WeightedGradientProjection(GradientProjection):
    """Joints near position limits are clamped and repelled; criteria count only if they are bad.

    buffer: Ω, share of a joint's range at each end in which it is clamped
    repulsion: t_rmax, velocity of repulsion at a limit [rad/s, m/s]
    band: λ, share of a normalised criterion's range at each end in which its weight is constant
    priorities: order of the criteria (*batch, criteria), the lowest first; None for the order in which they are given
    variant: "paper" to project onto the null space of J E_c as printed, which disturbs the task near limits;
        "consistent" to project onto that of J, which does not disturb it without damping

    Raises InvalidInput for numbers out of range and another variant. Source: Wan et al. 2018, Eqs. 15 to 30, with
    signs that decrease criteria.
    """

    buffer: Number = field(default=0.25, metadata=number(below=0.5, search=(0.02, 0.48)))
    repulsion: Number = field(default=np.pi, metadata=number(search=(0.0, 2 * np.pi)))
    band: Number = field(default=0.3, metadata=number(below=0.5, search=(0.02, 0.48)))
    priorities: np.ndarray | None = None
    variant: Variant = "consistent"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.priorities is not None:
            finite_array("WeightedGradientProjection: priorities", self.priorities)
        check_choice("variant", self.variant, get_args(Variant))

    @property
    def _priority_names(self) -> list[str]:
        return [f"priority of {one.objective.name}" for one in self.criterion_list]

    def parameters(self, times: Float[np.ndarray, " time"]) -> tuple[Parameter, ...]:
        """Return the numbers that are searched by default; with several criteria also priorities, lowest first."""
        names = self._priority_names if len(self.criterion_list) > 1 else []
        return (*super().parameters(times), *(Parameter(name, 0.0, 1.0) for name in names))

    def with_values(self: Weighted, values: Mapping[str, np.ndarray], times: Float[np.ndarray, " time"]) -> Weighted:
        """Return the method with values (motions,) for some of its numbers, gains and priorities."""
        names = self._priority_names
        method = super().with_values({k: v for k, v in values.items() if k not in names}, times)
        if not any(name in values for name in names):
            return method
        default = np.linspace(0.0, 1.0, len(names)) if self.priorities is None else np.asarray(self.priorities)
        columns = np.broadcast_arrays(*(values.get(name, default[..., c]) for c, name in enumerate(names)))
        return replace(method, priorities=np.stack(columns, axis=-1))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ConstrainedQP(GradientProjection):
    """The nearest step to gradient projection within limits: a quadratic program of joint rates.

    joint_weights: weights W (dof,) of the rates, None for 1; a step minimises ½ (q̇ − z)ᵀ W (q̇ − z), z the criteria's
    feedback: None to compute a step again about its own end until that is on the path to 1e-12 and clear of obstacles;
        a number [1/s] for one computation, as in other methods, with clearance to first order

    Every step satisfies limits on positions, velocities and accelerations (from rest), and clearance from obstacles;
    rates leave enough distance to brake before limits. If limits leave no rates that satisfy the task, its error is
    minimised in least squares, damped by ``damping``, and the step's status is "limited".

    Raises InvalidInput for weights that are not positive and for numbers out of range. Source: Cheng, Chen & Sun 1994;
    Faverjon & Tournassoud 1987; Del Prete 2018.
    """

    joint_weights: ArrayLike | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.joint_weights is not None:
            weights = finite_array("ConstrainedQP: joint_weights", self.joint_weights)
            if not (weights > 0).all():
                raise InvalidInput(f"ConstrainedQP: joint_weights must be positive, got {weights.min():g}")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Nedungadi(Method):
    """The motion from a start along which the integral of kinetic energy is stationary.

    tolerance: tolerance of every integration step, a number or an array (*batch,)

    It begins with the velocities of least kinetic energy, and no torque drives the self-motion. It is exact, not by
    steps. Source: Nedungadi & Kazerounian 1989; Tringali & Cocuzza 2020, Eq. 20, with corrected sign. Raises
    InvalidInput for a tolerance that is not positive.
    """

    tolerance: Number = field(default=1e-8, metadata={"search": (1e-12, 1e-3), "scale": "log"})

    def __post_init__(self) -> None:
        if not (finite_array("Nedungadi: tolerance", self.tolerance) > 0).all():
            raise InvalidInput(f"Nedungadi: tolerance must be positive, got {shown(self.tolerance)}")
