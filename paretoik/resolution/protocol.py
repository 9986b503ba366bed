"""Protocol of methods: parameters, their search ranges, and motions along a path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, fields, replace
from functools import lru_cache
from typing import Any, Literal, Self, TypeAlias, get_args

import numpy as np
from jaxtyping import Float, Shaped

from paretoik.autodiff.differentiation import dependencies, gradient
from paretoik.autodiff.evaluator import Evaluator, compile_evaluator
from paretoik.autodiff.kinks import smooth_pieces
from paretoik.autodiff.tape import Expression, as_entry
from paretoik.collision.obstacles import HalfSpace
from paretoik.errors import InvalidInput
from paretoik.inputs import check_choice, check_text, finite_array, likely_spelling, read_list, shown
from paretoik.robot.kinematics import link_frames
from paretoik.tables import represented
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask
from paretoik.task.objectives import Objective
from paretoik.task.task import path_errors, path_jacobian
from paretoik.task.traced_motion import trace_sample, trace_sample_function

# The program of one step at a posture.


@dataclass(frozen=True, kw_only=True, eq=False)
class StepProgram:
    """The program of one step.

    The inputs are q, q̇, q̈, jerk (dof rows each) and a row of ``table``. The table (time, rows) has the targets of
    every sample, their travel to the next, and data of criteria that vary with time. Accelerations and jerks have no
    effect. The outputs are

    - the task errors, the travel of the target in the same coordinates, and the Jacobian by rows
    - value and gradient of every criterion, with respect to positions, or to velocities if it depends only on these
    - if requested, distance of every moving link from every obstacle, and its gradient with respect to positions; for
      a half-space, distances of both ends of links
    """

    program: Evaluator
    table: Float[np.ndarray, "time rows"]
    distances: int


@lru_cache(maxsize=64)  # a search over a method's parameters uses the same program in every generation
def step_program(task: MotionTask, criteria: tuple[Objective, ...], *, with_distances: bool = False) -> StepProgram:
    """Return the program of one step of a task, ``with_distances`` from obstacles if requested.

    Raises InvalidInput, naming the criterion, if it depends on more than one sample's positions and velocities.
    """
    motion = trace_sample(task, duration=1.0)  # so that a mean over time has the value of one sample
    trace, tape = motion.trace, motion.trace.tape
    travels = np.concatenate([each.displacements(task.times) for each in task.tasks], axis=1)
    targets, travel = (list(trace.inputs(width).entries) for width in (task.targets.shape[1], travels.shape[1]))
    q = list(motion.q.entries)
    components, links = path_errors(task.arm, task.tasks, q, targets), link_frames(task.arm, q)
    for each in task.tasks:
        components += each.displacement_components(task.arm, links, travel[: each.displacement_size])
        travel = travel[each.displacement_size :]
    outputs = [as_entry(tape, value) for value in (*components, *path_jacobian(task.arm, task.tasks, q))]
    inputs = [
        [as_entry(tape, each) for each in part.entries] for part in (motion.q, motion.dq, motion.ddq, motion.jerk)
    ]
    for criterion in criteria:
        label = f"criterion {criterion.name}"
        value = trace_sample_function(motion, label, criterion.function)
        if value is None:
            raise InvalidInput(f"{label} must depend on one sample only, got one that reads more")
        result = as_entry(tape, Expression(tape, as_entry(tape, value)) * 1.0)
        read = {order for order, part in enumerate(inputs) if set(part) & set(dependencies(tape, [result]))}
        if read & {2, 3} or not read:
            raise InvalidInput(f"{label} must be a function of positions and velocities only, got one that reads more")
        outputs += [result, *gradient(tape, result, inputs[0 if 0 in read else 1])]
    distances = list[int]()
    for obstacle, by_link in zip(task.obstacles, motion.distances, strict=True) if with_distances else ():
        values = [as_entry(tape, Expression(tape, as_entry(tape, value)) * 1.0) for value in by_link.entries.ravel()]
        if isinstance(obstacle, HalfSpace):  # both ends of a link that is parallel to the plane are near
            values = list(dict.fromkeys(piece for value in values for piece in smooth_pieces(tape, value, -1)))
        distances += values
    moving = [entry for entry in distances if set(dependencies(tape, [entry])) & set(inputs[0])]
    for entry in moving:
        outputs += [entry, *gradient(tape, entry, inputs[0])]
    return StepProgram(
        program=compile_evaluator(tape, outputs),
        distances=len(moving),
        table=np.concatenate([task.targets, travels, *(each[:, None] for each in trace.parameters.values())], axis=1),
    )


# The result of a method: a motion, and the traces of its steps.


STATUS = np.array(["done", "damped", "shortened", "held", "limited", "missed"])
DONE, DAMPED, SHORTENED, HELD, LIMITED, MISSED = range(6)  # indices into STATUS
UNWEIGHTED, LEAST_NORM, CLAMPING = range(3)  # kinds of joint weights


@represented
@dataclass(frozen=True, kw_only=True, eq=False)
class Traces:
    """The traces of a method's steps.

    A step leads to the sample after it; the number of steps is time − 1.

    errors: task errors at every sample [m, rad]
    velocities: commanded velocities [rad/s, m/s]
    damping: ρ
    weights: joint weights: W of the weighted least norm, E_c of the weighted gradient projection, else 1
    coefficients: coefficients of the criteria, NaN for a criterion that is not finite and was left out
    repulsion, projected: velocities added to the task's by the repulsion from joint limits, and by each criterion
    status: one word per step, see below

    - "done"
    - "damped"
    - "shortened" to a move of at most 1 rad or m of every joint
    - "held": joints follow only the repulsion, because the weighted Jacobian is singular and undamped
    - "limited": no velocities within limits satisfy the task, which is solved in least squares
    - "missed": Newton's method at the end of a step of ``ConstrainedQP`` does not converge
    """

    errors: Float[np.ndarray, "*batch time rows"]
    velocities: Float[np.ndarray, "*batch steps dof"]
    damping: Float[np.ndarray, "*batch steps"]
    weights: Float[np.ndarray, "*batch steps dof"]
    coefficients: Float[np.ndarray, "*batch steps criteria"]
    repulsion: Float[np.ndarray, "*batch steps dof"]
    projected: Float[np.ndarray, "*batch steps criteria dof"]
    status: Shaped[np.ndarray, "*batch steps"]

    def __getitem__(self, index: Any) -> Traces:
        return type(self)(**{each.name: np.asarray(getattr(self, each.name)[index]) for each in fields(self)})


@dataclass(frozen=True, kw_only=True, eq=False)
class ResolvedMotion(Motion):
    """A motion (*batch, time, dof) that a method resolved, and its ``traces``."""

    traces: Traces

    def __repr__(self) -> str:
        """Return the motion in words, with numbers of steps by status."""
        status, counts = np.unique(self.traces.status, return_counts=True)
        steps = ", ".join(f"{count} {name}" for name, count in zip(status, counts, strict=True))
        largest = np.abs(self.traces.errors).max(initial=0.0)
        return f"{super().__repr__()}\nsteps: {steps}; largest error of the task {largest:.2g}; more in .traces"

    def __getitem__(self, index: Any) -> ResolvedMotion:
        motion = super().__getitem__(index)
        assert isinstance(motion, ResolvedMotion)
        return replace(motion, traces=self.traces[index])

    @classmethod
    def of(
        cls,
        task: MotionTask,
        batch: tuple[int, ...],
        q: np.ndarray,
        traces: dict[str, np.ndarray],
        kind: type[Traces] = Traces,
    ) -> ResolvedMotion:
        """Return a batch from joint positions (motions, time, dof) and traces as in ``empty_traces``."""
        shaped = {name: each.reshape(*batch, *each.shape[1:]) for name, each in traces.items()}
        motion = task.motion(q.reshape(*batch, *q.shape[1:]))
        result = kind(**{**shaped, "status": STATUS[shaped["status"]]})
        return cls(**{each.name: getattr(motion, each.name) for each in fields(motion)}, traces=result)


def empty_traces(count: int, time: int, dof: int, rows: int, criteria: int) -> dict[str, np.ndarray]:
    """Return arrays for the traces of ``count`` motions; ``status`` has indices into STATUS."""
    steps = time - 1
    return {
        "errors": np.zeros((count, time, rows)),
        "damping": np.zeros((count, steps)),
        "weights": np.ones((count, steps, dof)),
        "coefficients": np.zeros((count, steps, criteria)),
        "repulsion": np.zeros((count, steps, dof)),
        "projected": np.zeros((count, steps, criteria, dof)),
        "velocities": np.zeros((count, steps, dof)),
        "status": np.zeros((count, steps), dtype=np.int8),
    }


# Methods and their parameters: values, ranges, and the scales on which they are searched.


Number: TypeAlias = float | np.ndarray
Scale = Literal["linear", "log", "integer"]


@dataclass(frozen=True)
class Parameter:
    """A parameter of a method that is tuned between bounds.

    name: name of the parameter
    lower, upper: bounds
    scale: "linear", "log" to search its decimal logarithm, or "integer" for whole numbers
    fields: fields of the method that the parameter sets, by default the field of the same name

    Raises InvalidInput for invalid bounds.
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
            raise InvalidInput(f"{label}: lower bound must be at most the upper one, got {lower:g} to {upper:g}")
        if self.scale == "log" and not lower > 0:
            raise InvalidInput(f"{label}: lower bound must be above 0 on a log scale, got {lower:g}")
        if self.scale == "integer" and (lower % 1 or upper % 1):
            raise InvalidInput(f"{label}: bounds must be whole on an integer scale, got {lower:g} to {upper:g}")
        object.__setattr__(self, "fields", fields or (self.name,))

    @property
    def gene_bounds(self) -> tuple[float, float]:
        """Lower and upper bound of the gene."""
        if self.scale == "log":
            return float(np.log10(self.lower)), float(np.log10(self.upper))
        margin = 1 - 1e-9 if self.scale == "integer" else 0.0  # genes are rounded down to values up to the upper bound
        return float(self.lower), float(self.upper) + margin

    def decode(self, genes: Float[np.ndarray, " points"]) -> Shaped[np.ndarray, " points"]:
        """Return the values of genes."""
        if self.scale == "log":
            return np.asarray(10.0**genes)
        return np.floor(genes).astype(int) if self.scale == "integer" else genes


def number(
    *, below: float = np.inf, search: tuple[float, float] | None = None, scale: Scale = "linear"
) -> dict[str, Any]:
    """Return the metadata of a field.

    below: upper bound of values, excluded; the lower one is 0
    search: default range in which the field is tuned, None if it is not tuned by default
    scale: scale of the search
    """
    return {"below": below, "search": search, "scale": scale}


TRACKING_TOLERANCE = 0.01  # m or rad: largest distance from the path at which a motion follows it


@dataclass(frozen=True, kw_only=True, eq=False)
class Criterion:
    """A secondary criterion of a projection.

    objective: objective that depends only on one sample's postures or rates
    gain: factor of its gradient, 0 or more
    reference: best H of a minimised criterion, or worst tolerable H of a maximised one
    scale: divisor of its value, H = value / scale

    ``WeightedGradientProjection`` weighs a criterion from 1 (bad) to 0 (good), by exp(reference − H) if it is
    minimised, by 1 − exp(reference − H) if it is maximised (Wan et al. 2018, Eqs. 27 and 28). A mean over time, such as
    ``manipulability``, is the value at one sample, because ``motion.duration`` is 1 s.

    Raises InvalidInput for other objectives and for numbers out of range.
    """

    objective: Objective
    gain: Number = 1.0
    reference: float = 0.0
    scale: float = 1.0

    def __post_init__(self) -> None:
        if not isinstance(self.objective, Objective) or self.objective.form not in ("integral", "peak"):
            raise InvalidInput(f"criteria: objective must have form integral or peak, got {shown(self.objective)}")
        label = f"criterion {self.objective.name}"
        finite_array(f"{label}, reference", self.reference, ())
        if not finite_array(f"{label}, scale", self.scale, ()) > 0:
            raise InvalidInput(f"{label}: scale must be positive, got {self.scale}")
        if not (finite_array(f"{label}, gain", self.gain) >= 0).all():
            raise InvalidInput(f"{label}: gain must be 0 or more, got {shown(self.gain)}")

    @property
    def parameter(self) -> Parameter:
        """The gain's default range; raises InvalidInput if the gain is an array already."""
        if np.ndim(self.gain):
            raise InvalidInput(f"criterion {self.objective.name}: gain must be one number, got {self.gain}")
        lower, upper = (float(self.gain or 1.0) * share for share in (1e-4, 10.0))
        return Parameter(f"gain of {self.objective.name}", lower, upper, scale="log")


@represented
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Method:
    """A way to resolve one motion, or a batch of motions.

    Its parameters are arrays for a batch; ``resolve`` takes any method.
    """

    def __post_init__(self) -> None:
        for each in fields(self):
            if "below" not in each.metadata:
                continue
            upper, value = each.metadata["below"], getattr(self, each.name)
            label = f"{type(self).__name__}: {each.name}"
            values, bound = finite_array(label, value), "" if np.isinf(upper) else f" and less than {upper:g}"
            if not ((values >= 0) & (values < upper)).all():
                raise InvalidInput(f"{label} must be 0 or more{bound}, got {shown(value)}")

    @property
    def criterion_list(self) -> tuple[Criterion, ...]:
        """The secondary criteria; none by default."""
        return ()

    def parameters(self, times: Float[np.ndarray, " time"]) -> tuple[Parameter, ...]:
        """Return the parameters that are tuned by default on a path with these sample times [s]."""
        searched = [each for each in fields(self) if each.metadata.get("search") is not None]
        return tuple(Parameter(each.name, *each.metadata["search"], scale=each.metadata["scale"]) for each in searched)

    def with_values(self, values: Mapping[str, np.ndarray], times: Float[np.ndarray, " time"]) -> Self:
        """Return the method with a value per motion (motions,) for named parameters; raises InvalidInput."""
        searched = [each.name for each in self.parameters(times)]
        names = dict.fromkeys([*searched, *(each.name for each in fields(self))])
        for name in values:
            if name not in names:
                hint = likely_spelling(name, names)
                wish = f"must be one of {', '.join(names)}"
                raise InvalidInput(f"{type(self).__name__}: parameter {wish}, got {shown(name)}{hint}")
        return replace(self, **values)

    def follow(
        self, task: MotionTask, start: Float[np.ndarray, "*batch dof"], *, tolerance: float | None = None
    ) -> ResolvedMotion:
        """Return the motions from ``start``, broadcast with the method's parameters.

        tolerance: distance from the path [m, rad] above which nothing is predicted, None for 0.01

        Raises InvalidInput for invalid starts and parameters.
        """
        raise InvalidInput(f"method must be one of pk.methods, such as PseudoInverse(), got {shown(self)}")


def broadcast_shape(method: Method, start: np.ndarray, shapes: Sequence[tuple[int, ...]]) -> tuple[int, ...]:
    """Return the batch shape of starts (*starts, dof) and parameters; raises InvalidInput if they do not broadcast."""
    name, starts = type(method).__name__, start.shape[:-1]
    try:
        shape = np.broadcast_shapes(starts, *shapes)
    except ValueError:
        others = ", ".join(sorted({str(one) for one in shapes if one}))
        raise InvalidInput(f"{name}: starts must broadcast with parameters of shape {others}, got {starts}") from None
    if 0 in shape:
        raise InvalidInput(f"{name}: starts and parameters must not be empty, got an empty array")
    return shape
