"""The result of a method: a motion, and what happened at every step."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from jaxtyping import Float, Shaped

from paretoik.call_arguments import check_call
from paretoik.tables import field_representation, html_representation
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask

STATUS = np.array(["done", "damped", "shortened", "held", "limited", "missed"])
DONE, DAMPED, SHORTENED, HELD, LIMITED, MISSED = range(6)  # indices into STATUS


@dataclass(frozen=True, kw_only=True, eq=False)
class Traces:
    """What a method did at every step, to the sample after it; steps = time − 1.

    ``errors`` [m, rad] are the task errors at every sample, ``velocities`` [rad/s, m/s] the commanded ones, ``damping``
    ρ, ``weights`` those of the joints: W of the weighted least norm, E_c of the weighted gradient projection, else 1.
    ``coefficients`` are those of the criteria, NaN where one is not finite and was left out; ``repulsion`` and
    ``projected`` the velocities added to the task's: by the repulsion from joint limits, and by each criterion.
    ``status`` says of each step whether it was "done", "damped", "shortened" to a move of at most 1 rad or m of every
    joint, "held": the weighted Jacobian is singular and undamped, so that joints follow the repulsion alone, or
    "limited": limits leave no velocities that do the task, which gives way in least squares, or "missed": Newton's
    method, by which a step of ``ConstrainedQP`` ends on the path, does not converge.
    """

    errors: Float[np.ndarray, "*batch time rows"]
    velocities: Float[np.ndarray, "*batch steps dof"]
    damping: Float[np.ndarray, "*batch steps"]
    weights: Float[np.ndarray, "*batch steps dof"]
    coefficients: Float[np.ndarray, "*batch steps criteria"]
    repulsion: Float[np.ndarray, "*batch steps dof"]
    projected: Float[np.ndarray, "*batch steps criteria dof"]
    status: Shaped[np.ndarray, "*batch steps"]

    __repr__ = field_representation
    _repr_html_ = html_representation

    def __getitem__(self, index: Any) -> Traces:
        return type(self)(**{each.name: np.asarray(getattr(self, each.name)[index]) for each in fields(self)})


@check_call
@dataclass(frozen=True, kw_only=True, eq=False)
class ResolvedMotion(Motion):
    """A motion (*batch, time, dof) that a method resolved, and its ``traces``."""

    traces: Traces

    def __repr__(self) -> str:
        """Return the motion in words, and how many steps ended how."""
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
        """Return joint positions (motions, time, dof) and arrays as ``empty_traces`` makes them, as a batch."""
        shaped = {name: each.reshape(*batch, *each.shape[1:]) for name, each in traces.items()}
        motion = task.motion(q.reshape(*batch, *q.shape[1:]))
        result = kind(**{**shaped, "status": STATUS[shaped["status"]]})
        return cls(**{each.name: getattr(motion, each.name) for each in fields(motion)}, traces=result)


def empty_traces(count: int, time: int, dof: int, rows: int, criteria: int) -> dict[str, np.ndarray]:
    """Return arrays for the traces of ``count`` motions, to be filled; ``status`` as indices into STATUS."""
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
