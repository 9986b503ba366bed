"""The methods that resolve velocities, and what they improve on the side.

All make a step of the form q̇ = D Jᵀ(J D Jᵀ + ρ²I)⁻¹ v + N z, v what the tool must do, D a diagonal, N a projector. They
differ in D, in ρ and in z; ``ConstrainedQP`` makes the step nearest to it within limits. A method's numbers and the
gains of criteria may be arrays (*batch,): one motion each.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, TypeVar, get_args

import numpy as np
from jaxtyping import Float

from paretoik.errors import InvalidInput
from paretoik.inputs import ArrayLike, check_call, check_choice, finite_array, read_list, shown
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

Variant = Literal["paper", "consistent"]
Gradient = TypeVar("Gradient", bound="GradientProjection")
Weighted = TypeVar("Weighted", bound="WeightedGradientProjection")


@check_call
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class VelocityMethod(Method):
    """Task velocities with ``feedback`` [1/s] of the tracking error, by default 1/Δt: more would overshoot.

    Source: Wan et al. 2018, Eqs. 32 and 33.
    """

    feedback: Number | None = None

    def __post_init__(self) -> None:
        """Check that numbers are within their ranges; of the feedback ``resolve`` does, which knows the steps."""
        super().__post_init__()
        if self.feedback is not None:
            finite_array(f"{type(self).__name__}: feedback", self.feedback)

    @property
    def criterion_list(self) -> tuple[Criterion, ...]:
        """What is improved on the side."""
        return ()

    def parameters(self, times: Float[np.ndarray, " time"]) -> tuple[Parameter, ...]:
        """Return the numbers that are searched by default; the feedback's range follows from the steps."""
        highest = 1.0 / float(np.diff(times).max())
        return (Parameter("feedback", 0.02 * highest, highest), *super().parameters(times))


@check_call
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PseudoInverse(VelocityMethod):
    """The least joint velocities that do the task: q̇ = J⁺v. It refuses singular postures. Source: Whitney 1969."""


@check_call
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class LeastSquaresVelocity(PseudoInverse):
    """The pseudoinverse without feedback, by Euler steps: what the error of a step was, stays.

    Source: Tringali & Cocuzza 2021, LSV.
    """

    feedback: Number | None = 0.0


@check_call
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class DampedLeastSquares(VelocityMethod):
    """Near singular postures velocities are damped and the task gives way: ρ² = ρ_max²(1 − (σ_min/ε)²), σ_min < ε.

    ``region`` is ε, ``damping`` ρ_max, both in units of the Jacobian. Source: Nakamura & Hanafusa 1986; Wan et al.
    2018, Eqs. 3 and 4.
    """

    region: Number = field(default=0.02, metadata=number(search=(1e-3, 1e-1), scale="log"))
    damping: Number = field(default=0.02, metadata=number(search=(1e-3, 1e-1), scale="log"))


@check_call
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class WeightedLeastNorm(DampedLeastSquares):
    """Joints are slowed as they come nearer to their position limits, and free as they leave.

    A joint at its limit, or past it, stays there: the method has nothing that pushes it back.
    Source: Chan & Dubey 1995; Wan et al. 2018, Eqs. 10, 11 and 14.
    """


@check_call
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class GradientProjection(DampedLeastSquares):
    """The gradients of criteria, times their gains, projected onto what the task leaves free.

    An objective alone is a criterion of gain 1. What reads positions is differentiated by these, at the last
    velocities; what reads velocities alone by them. Raises InvalidInput for what is neither, names that do not differ,
    and numbers out of range. Source: Liégeois 1977; Wan et al. 2018, Eqs. 12 and 13.
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
        """The criteria, all of them with gains; raises InvalidInput for what is none."""
        criteria = (self.criteria,) if isinstance(self.criteria, Criterion | Objective) else self.criteria
        listed = read_list("criteria", criteria, object, "objectives of form integral or peak")
        return tuple(one if isinstance(one, Criterion) else Criterion(objective=one) for one in listed)

    def parameters(self, times: Float[np.ndarray, " time"]) -> tuple[Parameter, ...]:
        """Return the numbers that are searched by default, the gain of every criterion among them."""
        return (*super().parameters(times), *(one.parameter for one in self.criterion_list))

    def with_values(self: Gradient, values: Mapping[str, np.ndarray], times: Float[np.ndarray, " time"]) -> Gradient:
        """Return the method with values (motions,) for some of its numbers and of its criteria's gains."""
        gains = {one.parameter.name: one for one in self.criterion_list}
        criteria = [replace(one, gain=values.get(name, one.gain)) for name, one in gains.items()]
        return replace(
            super().with_values({k: v for k, v in values.items() if k not in gains}, times), criteria=criteria
        )


@check_call
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class WeightedGradientProjection(GradientProjection):
    """Joints near position limits are clamped and repelled; criteria count where they are bad.

    ``buffer`` Ω is the share of a joint's range, at either end, in which it is clamped; ``repulsion`` t_rmax [rad/s,
    m/s] its velocity of repulsion at its limit; ``band`` λ the share of a normalised criterion's range, at
    either end, in which its weight no longer changes. Of several criteria the first weighs most, or as ``priorities``
    (*batch, criteria) say, the lowest first.

    ``variant="paper"`` projects onto the null space of J E_c, as printed, which near limits disturbs the task;
    "consistent" onto that of J, which does not where nothing is damped.

    Raises InvalidInput for numbers out of range and another variant. Source: Wan et al. 2018, Eqs. 15 to 30, with the
    signs by which criteria are descended.
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
        """Return the numbers that are searched by default; of several criteria the lowest priority comes first."""
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


@check_call
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ConstrainedQP(GradientProjection):
    """The step of gradient projection that is nearest within limits: a quadratic program of joint rates.

    Limits on positions, velocities and accelerations, from rest on, and clearance from obstacles are kept at every
    step; rates leave enough way to brake before limits. ``joint_weights`` (dof,) W, by default 1, weigh the rates:
    the least ½ (q̇ − z)ᵀ W (q̇ − z) does the task, z being the criteria's. With ``feedback=None`` a step is solved for
    again about its own end until that is on the path to 1e-12 and clear of obstacles; with a number once, as by other
    methods, and clearance is kept to first order. Where limits leave no rates that do the task, it gives way in least
    squares, damped by ``damping``, and the step's status is "limited".

    Raises InvalidInput for weights that are not positive and for numbers out of range. Source: Cheng, Chen & Sun 1994;
    Faverjon & Tournassoud 1987; Del Prete 2018.
    """

    joint_weights: ArrayLike | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.joint_weights is not None:
            weights = finite_array("ConstrainedQP: joint_weights", self.joint_weights)
            if not (weights > 0).all():
                raise InvalidInput(f"ConstrainedQP: positive joint_weights wanted, got {weights.min():g}")


@check_call
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Nedungadi(Method):
    """The motion along which the kinetic energy's integral is stationary, from the start on: exact, not by steps.

    It begins with the velocities of least kinetic energy, and no torque drives the self-motion. ``tolerance`` is that
    of every integration step; it may be an array (*batch,). Source: Nedungadi & Kazerounian 1989; Tringali & Cocuzza
    2020, Eq. 20, its sign corrected. Raises InvalidInput for a tolerance that is not positive.
    """

    tolerance: Number = field(default=1e-8, metadata={"search": (1e-12, 1e-3), "scale": "log"})

    def __post_init__(self) -> None:
        if not (finite_array("Nedungadi: tolerance", self.tolerance) > 0).all():
            raise InvalidInput(f"Nedungadi: a positive tolerance wanted, got {shown(self.tolerance)}")
