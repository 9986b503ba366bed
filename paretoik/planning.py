"""The verbs of the face that take gradients: plan one motion's optima, find a certified front, polish one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from paretoik.errors import InvalidInput
from paretoik.front.front import Front
from paretoik.refinement.certificates import certify
from paretoik.refinement.epsilon import epsilon_points, front_rows, polished_points
from paretoik.refinement.multistart import Plan, planned
from paretoik.search.seeding import check_size
from paretoik.solving import fingerprint
from paretoik.task.motion import Motion
from paretoik.task.motion_task import MotionTask


def plan(
    problem: Any,
    *,
    starts: int = 48,
    seed: int = 0,
    initial: Motion | None = None,
    observe: Callable[[int, int, int], object] | None = None,
) -> Plan:
    """Return all distinct locally optimal motions of a ``Tracking`` with one objective that its starts lead to.

    Parameters
    ----------
    problem
        A ``Tracking`` with one integral objective.
    starts, seed
        Number of roll-outs to start from, and the seed of their chance: the same seed gives the same plan.
    initial
        Motions of the problem, on its path, to start from as well.
    observe
        Called after every level of samples, coarse to fine, with its samples, starts and distinct optima.

    ``plan.best.motion`` and ``plan.best.objective`` are the best, ``plan.optima`` all of them, best first. "Optimum" is
    meant locally. Source: Tringali & Cocuzza 2020, section 3.1.

    Raises
    ------
    InvalidInput
        Naming what cannot be used: several objectives, or one whose derivative cannot be had; OutOfReach where the
        path leaves what the arm can reach.
    Infeasible
        Where no motion within the limits was found, with the least-violating one and the limit that binds.
    EvaluationFailed
        Where motions within the limits were found, but none of them could be made optimal.

    >>> import paretoik as pk
    >>> path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=51)
    >>> found = plan(pk.Tracking(pk.tringali_3r(), path, objectives=[pk.kinetic_energy]), starts=24)
    >>> round(found.best.objective, 3)
    0.038
    """
    check_size("starts", starts, 1)
    check_size("seed", seed, 0)
    task = _task("plan", problem)
    if len(task.objectives) != 1:
        names = ", ".join(o.name for o in task.objectives)
        raise InvalidInput(f"plan: one objective wanted, got {len(task.objectives)}: {names}")
    return planned(task, starts=starts, seed=seed, given=_given(task, initial), observe=observe)


def epsilon_front(
    problem: Any,
    *,
    points: int = 20,
    starts: int = 48,
    seed: int = 0,
    observe: Callable[[int, int], object] | None = None,
) -> Front:
    """Return a front of certified motions of a ``Tracking``: one objective minimised, the others kept below ε.

    Parameters
    ----------
    problem
        A ``Tracking`` with two or more integral objectives.
    points
        About so many points, ends included; with three and more objectives a grid of ε decides.
    starts, seed
        As for ``plan``, which finds each objective's own optima first.
    observe
        Called with the points found so far and those wanted.

    Every point has its certificate in ``front.certificates``; "optimal" is meant locally. Source: Tringali & Cocuzza
    2020, section 4.3.

    Raises
    ------
    InvalidInput
        Naming what cannot be used; OutOfReach where the path leaves what the arm can reach.
    Infeasible
        Where no motion within the limits was found, with the least-violating one and the limit that binds.
    EvaluationFailed
        Where an end of the front could not be made optimal.
    """
    check_size("points", points, 2)
    check_size("starts", starts, 1)
    check_size("seed", seed, 0)
    task = _task("epsilon_front", problem)
    if len(task.objectives) < 2:
        raise InvalidInput("epsilon_front: two objectives or more wanted, got one: plan finds its optima")
    found = epsilon_points(task, points=points, starts=starts, seed=seed, observe=observe)
    ids = np.arange(len(found.q))
    settings = {"points": points, "starts": starts, "seed": seed}
    return _certified(problem, task, found.q, ids, found.ranges, {"settings": settings, "status": "epsilon"})


def refine(front: Front, problem: Any = None) -> Front:
    """Return the front with every motion polished to a local optimum no worse in any objective, and certified.

    ``problem`` is the one that the front solves: by default the one it came from. Points keep their ids; those that
    another one has come to dominate are left out. Polished motions are no longer what genes can say: ``genes`` is None.

    A motion that could not be polished stays as it was, and its certificate says so.

    Raises
    ------
    InvalidInput
        Where the problem is not at hand, or an objective or limit has no derivative.
    """
    problem = front.problem if problem is None else problem
    if problem is None or front.motions is None:
        raise InvalidInput("refine: a front with its motions and its problem wanted; refine(front, problem) names it")
    task = _task("refine", problem)
    if tuple(o.name for o in task.objectives) != tuple(front.names):
        raise InvalidInput(f"refine: a problem with objectives {', '.join(front.names)} wanted, got another")
    spread = np.ptp(front.minimised, axis=0)
    ranges = np.where(spread > 0, spread, np.maximum(np.abs(front.minimised).max(axis=0), 1.0))
    found = polished_points(task, np.asarray(front.motions.q), ranges)
    q = np.where(found.converged[:, None, None], found.q, front.motions.q)
    settings = dict(front.provenance) | {"refined": {"points": len(front), "converged": int(found.converged.sum())}}
    return _certified(problem, task, q, front.ids, ranges, settings)


def _certified(
    problem: Any, task: MotionTask, q: np.ndarray, ids: np.ndarray, ranges: np.ndarray, provenance: dict[str, Any]
) -> Front:
    motions = task.motion(q)
    objectives = np.stack([o(motions) for o in task.objectives], axis=1)
    signs = np.array([o.sign for o in task.objectives])
    kept = front_rows(objectives * signs / ranges)
    certificates = certify(task, q[kept], ranges)
    return Front(
        ids=ids[kept],
        objectives=objectives[kept],
        names=[o.name for o in task.objectives],
        units=[o.unit for o in task.objectives],
        maximised=[o.maximise for o in task.objectives],
        motions=motions[kept],
        violation=certificates.violation,
        certificates=certificates,
        provenance={"fingerprint": fingerprint(problem), **provenance},
        problem=problem,
    )


def _task(verb: str, problem: Any) -> MotionTask:
    task = getattr(problem, "task", None)
    if not isinstance(task, MotionTask):
        raise InvalidInput(f"{verb}: a Tracking problem wanted, got {type(problem).__name__}")
    return task


def _given(task: MotionTask, initial: Motion | None) -> np.ndarray | None:
    if initial is None:
        return None
    q = initial.q if initial.q.ndim == 3 else initial.q[None]
    if initial.arm.joint_names != task.arm.joint_names or q.shape[1] != len(task.times):
        raise InvalidInput(
            f"initial: motions of {task.arm.name} with {len(task.times)} samples wanted, got {initial.arm.name} with "
            f"{q.shape[1]}"
        )
    off = float(task.motion(q).tracking_error.max())
    if off > 1e-6:
        raise InvalidInput(f"initial: motions on the path wanted, got one that is {off:.3g} m or rad off")
    return np.array(q)
