"""Gradients for fronts: polish every point to a certified optimum, and help a search on its way."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from paretoik.arrays import Genes
from paretoik.errors import InvalidInput
from paretoik.formulations.protocol import require_program
from paretoik.front.front import Front
from paretoik.loading import fingerprint
from paretoik.nlp.compiled.interior_point import Rules
from paretoik.nlp.dense_sqp import Caps
from paretoik.pareto import refine as smooth_front
from paretoik.pareto.gap_filling import front_rows, widest_gap
from paretoik.pareto.refine import SmoothProblem, least
from paretoik.search.ask_tell import Search
from paretoik.search.progress import Progress
from paretoik.self_motion.branches import branch_labels
from paretoik.task.motion_task import MotionTask
from paretoik.trajectory.certificates import certify
from paretoik.trajectory.epsilon import YIELD, polished_points
from paretoik.trajectory.polish import polish
from paretoik.trajectory.transcription import motion_program

EVERY = 10  # generations
SHARE = 0.3  # of the evaluations that may go into iterations
ALIKE = 1e-6  # of a range: what genes may say differently of a polished point
BRIEF = Rules(barrier=1e-2, iterations=5, radius=0.1)
NEARLY = 1e-3  # of all objectives, where one is minimised
GAPS = 4  # of the widest that are aimed at each time
Observed = Callable[[int, int], object]


def refine(front: Front, problem: Any = None, *, observe: Observed | None = None) -> Front:
    """Return the front with every motion polished to a local optimum no worse in any objective, and certified.

    ``problem`` is the one that the front solves: by default the one it came from. Points keep their ids; those that
    another one has come to dominate are left out. Polished motions are no longer what genes can say: ``genes`` is None,
    but for ``DirectionalMaxima`` and ``PointToPoint``, whose genes say all. ``observe`` is called with points done and
    wanted; where it returns true, the others stay as they are.

    A motion that could not be polished stays as it was, and its certificate says so.

    Raises
    ------
    InvalidInput
        Where the problem is not at hand, or an objective or limit has no derivative.
    """
    problem = front.problem if problem is None else problem
    if isinstance(problem, SmoothProblem):
        return _smooth_refined(front, problem, observe)
    if problem is not None:
        require_program("refine", problem)
    if problem is None or front.motions is None:
        raise InvalidInput("refine: a front with its motions and its problem wanted; refine(front, problem) names it")
    task = task_of("refine", problem)
    if tuple(o.name for o in task.objectives) != tuple(front.names):
        raise InvalidInput(f"refine: a problem with objectives {', '.join(front.names)} wanted, got another")
    ranges = spans(front)
    found = polished_points(task, np.asarray(front.motions.q), ranges, observe)
    q = np.array(front.motions.q)
    q[: len(found)][found.converged] = found.x[found.converged]
    settings = dict(front.provenance) | {"refined": {"points": len(front), "converged": int(found.converged.sum())}}
    return certified(problem, task, q, front.ids, ranges, settings)


def _smooth_refined(front: Front, problem: Any, observe: Observed | None) -> Front:
    """Return the front of a smooth program's points, each no worse than it was."""
    if front.genes is None or tuple(problem.names) != tuple(front.names):
        raise InvalidInput(f"refine: a front of {', '.join(problem.names)} with its genes wanted, got another")
    known = front.provenance.get("fingerprint")
    if known is not None and known != fingerprint(problem):
        raise InvalidInput("refine: the problem that the front solves wanted, but its fingerprint is another")
    ranges = spans(front)
    own = np.array(front.genes)
    begun = problem.unknowns(own)
    z, good = smooth_front.polished(problem.sketch(), begun, ranges, observe)
    worse = (front.minimised + ALIKE * ranges < problem.evaluate(problem.genes_of(z), return_values_of=["F"])).any(
        axis=1
    )
    z[worse], good[worse] = begun[worse], False
    settings = {**front.provenance, "refined": {"points": len(front), "converged": int(good.sum())}}
    return smooth_certified(
        problem, z, front.ids, ranges, settings, {i: own[i] for i in np.flatnonzero(worse).tolist()}
    )


def smooth_certified(
    problem: Any,
    z: np.ndarray,
    ids: np.ndarray,
    ranges: np.ndarray,
    provenance: dict[str, Any],
    given: dict[int, np.ndarray] | None = None,
) -> Front:
    """Return the front of these points of a smooth program with their certificates, but those that others dominate.

    ``given`` are genes of some of them, which those of the program's unknowns would not be as good as.
    """
    genes = problem.genes_of(z)
    for i, own in (given or {}).items():
        genes[i] = own
    F, G = problem.evaluate(genes, return_values_of=["F", "G"])
    sketch = problem.sketch()
    apart = (np.abs(F - z @ sketch.costs.T) > ALIKE * ranges).any(axis=1)
    z = np.where(apart[:, None], problem.unknowns(genes), z)  # what is certified is what is reported
    kept = front_rows(F / ranges)
    between = np.maximum(problem.between(genes[kept]), G[kept].max(axis=1))
    signs = np.where(problem.maximised, -1.0, 1.0)
    certificates = smooth_front.certified(sketch, z[kept], ranges, signs, between)
    return Front(
        ids=ids[kept],
        objectives=F[kept] * signs,
        names=problem.names,
        units=problem.units,
        maximised=problem.maximised,
        genes=genes[kept],
        motions=problem.decode(genes[kept]) if hasattr(problem, "decode") else None,
        violation=certificates.violation,
        certificates=certificates,
        provenance={"fingerprint": fingerprint(problem), **provenance},
        problem=problem,
    )


def spans(front: Front) -> np.ndarray:
    """Return the ranges that objectives are divided by: those of the front, or what they are at most."""
    spread = np.ptp(front.minimised, axis=0)
    found: np.ndarray = np.where(spread > 0, spread, np.maximum(np.abs(front.minimised).max(axis=0), 1.0))
    return found


def certified(
    problem: Any, task: MotionTask, q: np.ndarray, ids: np.ndarray, ranges: np.ndarray, provenance: dict[str, Any]
) -> Front:
    """Return the front of these motions with their certificates, but those that others dominate."""
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


class Improver:
    """Suggests genes to a search: a few iterations from points of its front, as ``evolve`` asks for them.

    At the ends of the front an objective is minimised; in the widest gaps, and at the best point of every branch, one
    with the others kept below the middle of the gap, or where they are. What is suggested is evaluated by the search
    like any other genes. ``spent`` counts iterations, each as one evaluation.

    Raises InvalidInput where the problem is no ``Tracking``, or an objective or limit has no derivative.
    """

    def __init__(self, search: Search) -> None:
        self.search, self.spent = search, 0
        self._task = task_of("refine", search.problem)
        self._program = motion_program(self._task)

    def __call__(self, progress: Progress) -> Genes | None:
        """Return genes to be evaluated next, or None."""
        front = self.search.archive.members
        late = self.spent > SHARE * progress.evaluations
        if progress.generation % EVERY or late or front is None or len(front) < 2:
            return None
        chosen, factors, caps = self._aims(front.F, self.search.problem.decode(front.X).q)
        motions = self._task.motion(chosen)
        found = polish(self._program, motions.q, factors, caps, BRIEF)
        self.spent += int(found.iterations.sum())
        better = np.isfinite(found.objectives).all(axis=1)
        genes: Genes = self.search.problem.encode(self._task.motion(found.x[better]))[0]
        return genes

    def _aims(self, F: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return motions to start from, and what is to be minimised and kept below what from each."""
        count, ranges = F.shape[1], np.maximum(np.ptp(F, axis=0), 1e-12)
        shares = F / ranges
        rows, mains, levels = list[int](), list[int](), list[np.ndarray]()
        for k in range(count):
            rows.append(int(np.argmin(F[:, k])))
            mains.append(k)
            levels.append(np.full(count, np.inf))
        apart = np.linalg.norm(shares[:, None] - shares[None], axis=2)
        np.fill_diagonal(apart, np.inf)
        nearest = apart.argmin(axis=1)
        for turn, i in enumerate(np.argsort(-apart.min(axis=1))[:GAPS] if count > 1 else ()):
            main = turn % count
            rows.append(int(i))
            mains.append(main)
            levels.append((F[i] + F[nearest[i]]) / 2)
        names = np.array(branch_labels(self._task.motion(q)))
        for name in np.unique(names):
            mine = np.flatnonzero(names == name)
            rows.append(int(mine[np.argmin(shares[mine].sum(axis=1))]))
            mains.append(len(rows) % count)
            levels.append(F[rows[-1]])
        caps = np.full((len(rows), len(self._program.totals)), np.inf)
        factors = np.zeros_like(caps)
        factors[:, :count] = YIELD / ranges
        factors[np.arange(len(rows)), mains] = 1.0 / ranges[mains]
        caps[:, :count] = np.array(levels)
        caps[np.arange(len(rows)), mains] = np.inf
        return q[rows], factors, caps


class SmoothImprover:
    """Suggests genes of a ``SmoothProblem`` to a search, as ``Improver`` does for motions.

    At the ends of the front an objective is minimised nearly alone, from there and from a start of its own; in the
    widest gap the sum, with the others kept below the middle.
    """

    def __init__(self, search: Search, seed: int) -> None:
        self.search, self.spent = search, 0
        self._sketch = search.problem.sketch()
        self._rng = np.random.default_rng(seed)

    def __call__(self, progress: Progress) -> Genes | None:
        """Return genes to be evaluated next, or None."""
        front, problem = self.search.archive.members, self.search.problem
        if progress.generation % EVERY or self.spent > SHARE * progress.evaluations or front is None or len(front) < 2:
            return None
        ranges = np.maximum(np.ptp(front.F, axis=0), 1e-12)
        shares, count = self._sketch.costs / ranges[:, None], len(ranges)
        found = list[np.ndarray]()
        for k in range(count):
            starts = [front.X[np.argmin(front.F[:, k])], problem.candidates(1, self._rng)[0]]
            found += self._least(shares[k] + NEARLY * shares.sum(axis=0), np.array(starts), None)
        if count > 1:
            i, j = widest_gap(front.F / ranges)
            main = int(np.argmin(np.abs(front.F[i] - front.F[j]) / ranges))
            others = np.arange(count) != main
            middle = (front.F[i] + front.F[j])[others] / (2 * ranges[others])
            caps = Caps(rows=shares[others], most=middle)
            found += self._least(shares[main] + NEARLY * shares.sum(axis=0), front.X[[i]], caps)
        return problem.genes_of(np.array(found)) if found else None

    def _least(self, cost: np.ndarray, genes: np.ndarray, caps: Caps | None) -> list[np.ndarray]:
        starts = self.search.problem.unknowns(genes)
        ends = [least(self._sketch, cost, z, caps) for z in starts if np.isfinite(z).all()]
        kept = [end for end in ends if end is not None]
        self.spent += sum(end.iterations for end in kept)
        return [end.z for end in kept]


def task_of(verb: str, problem: Any) -> MotionTask:
    """Return what a ``Tracking`` asks for; raise InvalidInput, naming the verb, for other problems."""
    require_program(verb, problem)
    task = getattr(problem, "task", None)
    if not isinstance(task, MotionTask):
        raise InvalidInput(f"{verb}: a Tracking problem wanted, got {type(problem).__name__}")
    return task
