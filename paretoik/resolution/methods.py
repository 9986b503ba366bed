"""The methods that resolve velocities, and their secondary criteria.

All have steps q̇ = D Jᵀ(J D Jᵀ + ρ²I)⁻¹ v + N z, with the task velocities v, a diagonal D and a projector N. They
differ in D, ρ and z; ``ConstrainedQP`` takes the nearest step within limits. A method's parameters and the gains of
criteria may be arrays (*batch,): one motion each.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal, Self, get_args

import numpy as np
from jaxtyping import Float

from paretoik.errors import InvalidInput
from paretoik.inputs import ArrayLike, check_choice, finite_array, read_list, shown
from paretoik.resolution.predictive import PredictiveKineticEnergy as PredictiveKineticEnergy
from paretoik.resolution.protocol import (
    CLAMPING,
    HELD,
    LEAST_NORM,
    UNWEIGHTED,
    ResolvedMotion,
    broadcast_shape,
    empty_traces,
    number,
    step_program,
)
from paretoik.resolution.protocol import Criterion as Criterion
from paretoik.resolution.protocol import Method as Method
from paretoik.resolution.protocol import Number as Number
from paretoik.resolution.protocol import Parameter as Parameter
from paretoik.task.limits import position_ranges
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from paretoik.task.retraction import task_errors

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


SETTINGS = "region", "damping", "buffer", "repulsion", "band"  # columns after the feedback; 0 if a method has none
Variant = Literal["paper", "consistent"]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class VelocityMethod(Method):
    """Base of methods with feedback of the tracking error.

    feedback: gain [1/s], at most 1/Δt; None for 1/Δt

    Source: Wan et al. 2018, Eqs. 32 and 33.
    """

    feedback: Number | None = None
    _weighting: ClassVar[int] = UNWEIGHTED

    def __post_init__(self) -> None:
        """Check the parameters' ranges; ``resolve`` compares the feedback with the steps."""
        super().__post_init__()
        if self.feedback is not None:
            finite_array(f"{type(self).__name__}: feedback", self.feedback)

    def parameters(self, times: Float[np.ndarray, " time"]) -> tuple[Parameter, ...]:
        """Return the parameters tuned by default; the steps determine the range of the feedback."""
        highest = 1.0 / float(np.diff(times).max())
        return (Parameter("feedback", 0.02 * highest, highest), *super().parameters(times))

    def follow(
        self, task: MotionTask, start: Float[np.ndarray, "*batch dof"], *, tolerance: float | None = None
    ) -> ResolvedMotion:
        """Return the motions from ``start``, broadcast with the parameters; ``tolerance`` has no effect."""
        from paretoik.resolution import step_kernels as kernels  # here: numba is slow to load

        criteria = self.criterion_list
        shape, settings, gains, q, traces = self._prepare(task, start)
        program = step_program(task, tuple(each.objective for each in criteria))
        bounds = task.bounds.get("position", task.arm.position_limits[None])
        bounds = np.concatenate([bounds, position_ranges(task.arm, bounds)[..., None]], axis=-1)
        scaling = [[each.objective.sign, each.reference, each.scale] for each in criteria]
        scales = np.array(scaling).reshape(len(criteria), 3)
        clamps = self._weighting == CLAMPING  # if so, criteria are normalised, and the projector may be the paper's
        modes = self._weighting, getattr(self, "variant", "") == "paper", clamps
        inputs = program.table, np.diff(task.times), bounds, (modes, settings, gains, scales)
        outputs = (q, *traces.values())

        def run(first: int, last: int) -> None:
            arrays = program.program.arrays  # with its own workspace: one per thread
            kernels.follow(first, last, arrays, *inputs, outputs)

        threads = max(min(os.cpu_count() or 1, len(q)), 1)
        cuts = np.linspace(0, len(q), threads + 1).astype(int).tolist()
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(run, cuts[:-1], cuts[1:]))
        return ResolvedMotion.of(task, shape, q, traces)

    def _prepare(
        self, task: MotionTask, start: np.ndarray
    ) -> tuple[tuple[int, ...], np.ndarray, np.ndarray, np.ndarray, dict[str, np.ndarray]]:
        """Return the batch's shape, settings, gains and ranks of criteria, postures, and empty traces.

        Settings are the feedback and ``SETTINGS`` of each motion; ranks begin at 0. Raises InvalidInput if parameters
        do not broadcast.
        """
        name, highest = type(self).__name__, 1.0 / float(np.diff(task.times).max())
        criteria, dof = self.criterion_list, task.arm.dof
        feedback = np.asarray(highest if self.feedback is None else self.feedback, dtype=float)
        if not ((feedback >= 0) & (feedback <= highest * (1 + 1e-12))).all():
            wish = f"feedback must be from 0 to {highest:.4g} 1/s, one over the longest step"
            raise InvalidInput(f"{name}: {wish}, got {self.feedback}")
        numbers = [feedback, *(np.asarray(getattr(self, each, 0.0), dtype=float) for each in SETTINGS)]
        numbers += [np.asarray(each.gain, dtype=float) for each in criteria]
        priorities = getattr(self, "priorities", None)
        ranks = np.arange(len(criteria)) if priorities is None else np.argsort(np.argsort(priorities, axis=-1), axis=-1)
        if ranks.shape[-1:] != (len(criteria),):
            wish = f"priorities must be one per criterion ({len(criteria)})"
            raise InvalidInput(f"{name}: {wish}, got {ranks.shape}")
        shape = broadcast_shape(self, start, [ranks.shape[:-1], *(each.shape for each in numbers)])
        columns = np.stack([np.broadcast_to(each, shape).ravel() for each in numbers], axis=1)
        settings, gains = np.split(columns, [1 + len(SETTINGS)], axis=1)
        ranks = np.broadcast_to(ranks, (*shape, len(criteria))).reshape(gains.shape)
        q = np.empty((len(columns), len(task.times), dof))
        q[:, 0] = np.broadcast_to(start, (*shape, dof)).reshape(-1, dof)
        traces = empty_traces(len(columns), len(task.times), dof, task.rows, len(criteria))
        return shape, np.ascontiguousarray(settings), np.stack([gains, ranks.astype(float)], axis=2), q, traces


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PseudoInverse(VelocityMethod):
    """The least joint velocities that satisfy the task: q̇ = J⁺v.

    Singular postures are refused. Source: Whitney 1969.
    """


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class LeastSquaresVelocity(PseudoInverse):
    """The pseudoinverse without feedback, by Euler steps.

    The error of each step remains. Source: Tringali & Cocuzza 2021, LSV.
    """

    feedback: Number | None = 0.0


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class DampedLeastSquares(VelocityMethod):
    """Damped velocities near singular postures.

    If σ_min < ε, ρ² = ρ_max²(1 − (σ_min/ε)²).

    region: ε, in units of the Jacobian
    damping: ρ_max, in units of the Jacobian

    Source: Nakamura & Hanafusa 1986; Wan et al. 2018, Eqs. 3 and 4.
    """

    region: Number = field(default=0.02, metadata=number(search=(1e-3, 1e-1), scale="log"))
    damping: Number = field(default=0.02, metadata=number(search=(1e-3, 1e-1), scale="log"))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class WeightedLeastNorm(DampedLeastSquares):
    """Joints are slowed down if they approach a near position limit, and move freely away from it.

    A joint at its limit or beyond stays there, as there is no repulsion. Source: Chan & Dubey 1995; Wan et al. 2018,
    Eqs. 10, 11 and 14.
    """

    _weighting: ClassVar[int] = LEAST_NORM


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class GradientProjection(DampedLeastSquares):
    """The criteria's gradients, times gains, projected onto the task's null space.

    criteria: one or more criteria, or objectives, which are criteria of gain 1

    A criterion that depends on positions is differentiated with respect to these, at the last velocities; a criterion
    of only velocities is differentiated with respect to velocities. Raises InvalidInput for other objects, equal names,
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
        """The criteria, all with gains; raises InvalidInput for other objects."""
        criteria = (self.criteria,) if isinstance(self.criteria, Criterion | Objective) else self.criteria
        listed = read_list("criteria", criteria, object, "objectives of form integral or peak")
        return tuple(one if isinstance(one, Criterion) else Criterion(objective=one) for one in listed)

    def parameters(self, times: Float[np.ndarray, " time"]) -> tuple[Parameter, ...]:
        """Return the parameters tuned by default, and each criterion's gain."""
        return (*super().parameters(times), *(one.parameter for one in self.criterion_list))

    def with_values(self, values: Mapping[str, np.ndarray], times: Float[np.ndarray, " time"]) -> Self:
        """Return the method with values (motions,) of named parameters or gains of criteria."""
        gains = {one.parameter.name: one for one in self.criterion_list}
        criteria = [replace(one, gain=values.get(name, one.gain)) for name, one in gains.items()]
        return replace(
            super().with_values({k: v for k, v in values.items() if k not in gains}, times), criteria=criteria
        )


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class WeightedGradientProjection(GradientProjection):
    """Joints near position limits are clamped and repelled.

    A criterion has weight only if its value is bad.

    buffer: Ω, share of a joint's range at each end in which it is clamped
    repulsion: t_rmax, velocity of repulsion at a limit [rad/s, m/s]
    band: λ, share of a normalised criterion's range at each end in which its weight is constant
    priorities: order of the criteria (*batch, criteria), the lowest first; None for the order in which they are given
    variant: "paper" to project onto the null space of J E_c as printed, which perturbs the task near limits;
        "consistent" to project onto the null space of J, which perturbs the task only if it is damped

    Raises InvalidInput for numbers out of range and another variant. Source: Wan et al. 2018, Eqs. 15 to 30, with
    signs that decrease criteria.
    """

    buffer: Number = field(default=0.25, metadata=number(below=0.5, search=(0.02, 0.48)))
    repulsion: Number = field(default=np.pi, metadata=number(search=(0.0, 2 * np.pi)))
    band: Number = field(default=0.3, metadata=number(below=0.5, search=(0.02, 0.48)))
    priorities: np.ndarray | None = None
    variant: Variant = "consistent"
    _weighting: ClassVar[int] = CLAMPING

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.priorities is not None:
            finite_array("WeightedGradientProjection: priorities", self.priorities)
        check_choice("variant", self.variant, get_args(Variant))

    @property
    def _priority_names(self) -> list[str]:
        return [f"priority of {one.objective.name}" for one in self.criterion_list]

    def parameters(self, times: Float[np.ndarray, " time"]) -> tuple[Parameter, ...]:
        """Return the parameters tuned by default, and priorities of several criteria."""
        names = self._priority_names if len(self.criterion_list) > 1 else []
        return (*super().parameters(times), *(Parameter(name, 0.0, 1.0) for name in names))

    def with_values(self, values: Mapping[str, np.ndarray], times: Float[np.ndarray, " time"]) -> Self:
        """Return the method with values (motions,) of named parameters, gains or priorities."""
        names = self._priority_names
        method = super().with_values({k: v for k, v in values.items() if k not in names}, times)
        if not any(name in values for name in names):
            return method
        default = np.linspace(0.0, 1.0, len(names)) if self.priorities is None else np.asarray(self.priorities)
        columns = np.broadcast_arrays(*(values.get(name, default[..., c]) for c, name in enumerate(names)))
        return replace(method, priorities=np.stack(columns, axis=-1))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ConstrainedQP(GradientProjection):
    """The step within limits that is nearest to that of gradient projection, by a quadratic program of joint rates.

    joint_weights: weights W (dof,) of the rates, None for 1; a step minimises ½ (q̇ − z)ᵀ W (q̇ − z), z the criteria's
        rates
    feedback: None to compute a step again about its own end until the end is on the path to 1e-12 and clear of
        obstacles; a number [1/s] for one computation, as in other methods, with clearance to first order

    Every step satisfies limits on positions, velocities and accelerations (from rest), and clearance from obstacles;
    rates leave enough distance to brake before limits. If no rates within limits satisfy the task, the task's error is
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

    def follow(
        self, task: MotionTask, start: Float[np.ndarray, "*batch dof"], *, tolerance: float | None = None
    ) -> ResolvedMotion:
        """Return the motions from ``start``, broadcast with the parameters; ``tolerance`` has no effect.

        Raises InvalidInput unless there is one joint weight per joint.
        """
        from paretoik.resolution.constrained import ACTIVE, ConstrainedTraces, follow_constrained  # here: slow to load

        shape, settings, gains, q, traces = self._prepare(task, start)
        dof = task.arm.dof
        weights = np.ones(dof) if self.joint_weights is None else np.asarray(self.joint_weights, dtype=float)
        if weights.shape != (dof,):
            raise InvalidInput(f"ConstrainedQP: joint_weights must have shape ({dof},), got {weights.shape}")
        exact = self.feedback is None
        follow_constrained(task, self.criterion_list, 1.0 / weights, settings, gains, q, traces, exact=exact)
        traces["active"] = ACTIVE[traces["active"]]
        return ResolvedMotion.of(task, shape, q, traces, ConstrainedTraces)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Nedungadi(Method):
    """Motion from a start, whose integral of kinetic energy is stationary.

    tolerance: tolerance of every integration step, a number or an array (*batch,)

    The motion begins with the velocities of least kinetic energy, and no torque drives the self-motion. It is
    integrated with adaptive steps, not with those of the samples. Source: Nedungadi & Kazerounian 1989; Tringali &
    Cocuzza 2020, Eq. 20, with corrected sign. Raises InvalidInput for a tolerance that is not positive.
    """

    tolerance: Number = field(default=1e-8, metadata={"search": (1e-12, 1e-3), "scale": "log"})

    def __post_init__(self) -> None:
        if not (finite_array("Nedungadi: tolerance", self.tolerance) > 0).all():
            raise InvalidInput(f"Nedungadi: tolerance must be positive, got {shown(self.tolerance)}")

    def follow(
        self, task: MotionTask, start: Float[np.ndarray, "*batch dof"], *, tolerance: float | None = None
    ) -> ResolvedMotion:
        """Return the motions from ``start``, stopped before a singularity; ``tolerance`` has no effect.

        In the traces, ``projected`` is the difference of the velocities from the least-norm solution of the task.
        """
        from paretoik.resolution.variational import extremal_paths  # here: slow to load

        shape = np.broadcast_shapes(start.shape[:-1], np.shape(self.tolerance))
        start, dof, samples = np.broadcast_to(start, (*shape, task.arm.dof)), task.arm.dof, len(task.times)
        allowed = np.broadcast_to(self.tolerance, shape).ravel()
        q, rates = extremal_paths(task, start.reshape(-1, dof), tolerance=allowed)
        complete = np.isfinite(q).all(axis=2)
        last = np.where(complete, np.arange(samples), 0).max(axis=1)  # motions end at their first incomplete sample
        index = np.minimum(np.arange(samples), last[:, None])
        q = np.take_along_axis(q, index[..., None], axis=1)
        dq = np.where(complete[..., None], rates, 0.0)[:, :-1]
        traces = empty_traces(len(q), samples, dof, task.rows, 1)
        traces["errors"][:], jacobian = task_errors(task.arm, task.tasks, q, task.targets)
        traces["velocities"][:] = dq
        traces["status"][~complete[:, 1:]] = HELD
        shortest = np.linalg.pinv(jacobian[:, :-1]) @ (jacobian[:, :-1] @ dq[..., None])
        traces["projected"][:, :, 0] = dq - shortest[..., 0]
        return ResolvedMotion.of(task, shape, q, traces)
