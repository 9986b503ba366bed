"""The methods that resolve velocities, and what they improve on the side.

All make a step of the form q̇ = D Jᵀ(J D Jᵀ + ρ²I)⁻¹ v + N z, v what the tool must do, D a diagonal, N a projector. They
differ in D, in ρ and in z. A method's numbers and the gains of criteria may be arrays (*batch,): one motion each.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.robot.pose import finite_array
from paretoik.task.objectives import Objective, kinetic_energy

Number: TypeAlias = float | np.ndarray
Variant = Literal["paper", "consistent"]
POSITIVE, SHARE = {"within": (0.0, np.inf)}, {"within": (0.0, 0.5)}


@dataclass(frozen=True, kw_only=True, eq=False)
class Criterion:
    """What a projection improves on the side: an objective that looks at one sample's postures, or rates, alone.

    ``gain`` scales its gradient and must not be negative. In ``WeightedGradientProjection`` its weight falls from 1
    where the criterion is bad to 0 where it is good, told by H, its value over ``scale``: normalised to
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


class Method:
    """A way to resolve one motion; ``resolve`` takes any."""


def _check_ranges(method: Any) -> None:
    """Raise InvalidInput for a number outside of what its field is within."""
    for each in fields(method):
        if "within" not in each.metadata:
            continue
        low, high = each.metadata["within"]
        given, what = getattr(method, each.name), f"{type(method).__name__}: {each.name}"
        values, upper = finite_array(what, given), "" if np.isinf(high) else f" and less than {high:g}"
        if not ((values >= low) & (values < high)).all():
            raise InvalidInput(f"{what} of {low:g} or more{upper} wanted, got {given}")


@dataclass(frozen=True, kw_only=True, eq=False)
class VelocityMethod(Method):
    """What all have in common: ``feedback`` [1/s] of the tracking error, by default one over a step, which is the most.

    Source: Wan et al. 2018, Eqs. 32 and 33.
    """

    feedback: Number | None = None

    def __post_init__(self) -> None:
        """Check that numbers are within their ranges; of the feedback ``resolve`` does, which knows the steps."""
        _check_ranges(self)
        if self.feedback is not None:
            finite_array(f"{type(self).__name__}: feedback", self.feedback)


@dataclass(frozen=True, kw_only=True, eq=False)
class PseudoInverse(VelocityMethod):
    """The least joint velocities that do the task: q̇ = J⁺v. It refuses singular postures. Source: Whitney 1969."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LeastSquaresVelocity(PseudoInverse):
    """The pseudoinverse without feedback, by Euler steps: what the error of a step was, stays.

    Source: Tringali & Cocuzza 2021, LSV.
    """

    feedback: Number | None = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class DampedLeastSquares(VelocityMethod):
    """Near singular postures velocities are damped and the task gives way: ρ² = ρ_max²(1 − (σ_min/ε)²), σ_min < ε.

    ``region`` is ε, ``damping`` ρ_max, both in units of the Jacobian. Source: Nakamura & Hanafusa 1986; Wan et al.
    2018, Eqs. 3 and 4.
    """

    region: Number = field(default=0.02, metadata=POSITIVE)
    damping: Number = field(default=0.02, metadata=POSITIVE)


@dataclass(frozen=True, kw_only=True, eq=False)
class WeightedLeastNorm(DampedLeastSquares):
    """Joints are slowed as they come nearer to their position limits, and free as they leave.

    A joint at its limit, or past it, stays there: the method has nothing that pushes it back.
    Source: Chan & Dubey 1995; Wan et al. 2018, Eqs. 10, 11 and 14.
    """


@dataclass(frozen=True, kw_only=True, eq=False)
class GradientProjection(DampedLeastSquares):
    """The gradients of criteria, times their gains, projected onto what the task leaves free.

    An objective alone is a criterion of gain 1. What reads positions is differentiated by these, at the last
    velocities; what reads velocities alone by them. Raises InvalidInput for what is neither, names that do not differ,
    and numbers out of range. Source: Liégeois 1977; Wan et al. 2018, Eqs. 12 and 13.
    """

    criteria: Sequence[Criterion | Objective] | Criterion | Objective = ()

    @property
    def settled(self) -> tuple[Criterion, ...]:
        """The criteria, all of them with gains; raises InvalidInput for what is none."""
        given = (self.criteria,) if isinstance(self.criteria, Criterion | Objective) else self.criteria
        if not isinstance(given, Iterable):
            raise InvalidInput(f"criteria: wants objectives of form integral or peak, got {given!r}")
        return tuple(one if isinstance(one, Criterion) else Criterion(objective=one) for one in given)

    def __post_init__(self) -> None:
        """Check numbers and criteria."""
        super().__post_init__()
        object.__setattr__(self, "criteria", self.settled)
        names = [one.objective.name for one in self.settled]
        if len(set(names)) != len(names):
            raise InvalidInput(f"criteria: names must differ, got {', '.join(names)}")


@dataclass(frozen=True, kw_only=True, eq=False)
class WeightedGradientProjection(GradientProjection):
    """Joints near position limits are clamped and pushed back; criteria count where they are bad.

    ``buffer`` Ω is the share of a joint's range, at either end, in which it is clamped; ``repulsion`` t_rmax [rad/s,
    m/s] the velocity that pushes it back at its limit; ``band`` λ the share of a normalised criterion's range, at
    either end, in which its weight no longer changes. Of several criteria the first weighs most, or as ``priorities``
    (*batch, criteria) say, the lowest first.

    ``variant="paper"`` projects onto the null space of J E_c, as printed, which near limits disturbs the task;
    "consistent" onto that of J, which does not where nothing is damped.

    Raises InvalidInput for numbers out of range and another variant. Source: Wan et al. 2018, Eqs. 15 to 30, with the
    signs by which criteria are descended.
    """

    buffer: Number = field(default=0.25, metadata=SHARE)
    repulsion: Number = field(default=np.pi, metadata=POSITIVE)
    band: Number = field(default=0.3, metadata=SHARE)
    priorities: np.ndarray | None = None
    variant: Variant = "consistent"

    def __post_init__(self) -> None:
        """Check numbers and variant."""
        super().__post_init__()
        if self.priorities is not None:
            finite_array("WeightedGradientProjection: priorities", self.priorities)
        if self.variant not in get_args(Variant):
            raise InvalidInput(f"variant must be one of {', '.join(get_args(Variant))}, got {self.variant!r}")


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictiveKineticEnergy(Method):
    """What the task leaves free leads to where the kinetic energy over a few samples ahead is least.

    ``objective`` may be another integral one of positions, velocities and accelerations: the torque norm, for one.
    ``horizon`` h is how many samples ahead are looked at, ``prediction_step`` ΔT [s] how far apart they are, by default
    0.2 of the path's duration over h, and ``update_interval`` [s] how often, by default half of that. The last of them
    counts ``terminal`` times more: what comes after the horizon costs as well. These may be arrays (*batch,).
    ``feedback`` [1/s] of the tracking error, one number, is 0 by default: open loop, as in the paper.

    Raises InvalidInput for numbers out of range. Source: Tringali & Cocuzza 2021, PMKE.
    """

    objective: Objective = kinetic_energy
    horizon: int | np.ndarray = 2
    prediction_step: Number | None = None
    update_interval: Number | None = None
    terminal: Number = field(default=0.0, metadata=POSITIVE)
    feedback: float = 0.0

    def __post_init__(self) -> None:
        """Check the numbers."""
        _check_ranges(self)
        finite_array("PredictiveKineticEnergy: horizon", self.horizon)
        ahead = np.asarray(self.horizon)
        if ahead.dtype.kind not in "iu" or not (ahead >= 1).all():
            raise InvalidInput(f"PredictiveKineticEnergy: a horizon of 1 sample or more wanted, got {self.horizon}")
        for name in ("prediction_step", "update_interval"):
            given = getattr(self, name)
            if given is not None and not (finite_array(f"PredictiveKineticEnergy: {name}", given) > 0).all():
                raise InvalidInput(f"PredictiveKineticEnergy: {name} of more than 0 s wanted, got {given}")
        if not finite_array("PredictiveKineticEnergy: feedback", self.feedback, ()) >= 0:
            raise InvalidInput(f"PredictiveKineticEnergy: feedback of 0 or more wanted, got {self.feedback}")
        if not isinstance(self.objective, Objective):
            raise InvalidInput(f"PredictiveKineticEnergy: an objective wanted, got {self.objective!r}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Nedungadi(Method):
    """The motion along which the kinetic energy's integral is stationary, from the start on: exact, not by steps.

    It begins with the velocities of least kinetic energy, and no torque drives the self-motion. ``tolerance`` is that
    of every integration step. Source: Nedungadi & Kazerounian 1989; Tringali & Cocuzza 2020, Eq. 20, its sign
    corrected. Raises InvalidInput for a tolerance that is not positive.
    """

    tolerance: float = 1e-8

    def __post_init__(self) -> None:
        """Check the tolerance."""
        if not finite_array("Nedungadi: tolerance", self.tolerance, ()) > 0:
            raise InvalidInput(f"Nedungadi: a positive tolerance wanted, got {self.tolerance}")
