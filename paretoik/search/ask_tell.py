"""Ask for genes, tell their objectives: a search whose caller evaluates the problem."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from pymoo.core.termination import NoTermination

from paretoik.arrays import Genes, Ids, Mask, Objectives
from paretoik.errors import InvalidInput
from paretoik.inputs import check_count, check_seed, check_size, integer_array, real_array, shown
from paretoik.search.archive import Archive, Failures
from paretoik.search.genes import SMALLEST_POPULATION, check_algorithm, check_problem, checked_genes
from paretoik.search.maximin import column, survivors
from paretoik.search.nsga2 import MaxiMinNSGA2
from paretoik.search.objectives import EQUALITY_TOLERANCE, TOLERANCE, column_tolerance, describe_objectives, violations
from paretoik.tables import html_representation, represented

if TYPE_CHECKING:
    from paretoik.front.front import Front

# Candidates, their outcomes, and the front of an archive.


@represented
@dataclass(frozen=True, eq=False)
class Candidates:
    """Genes ``X`` (n, genes) to evaluate, their ``ids`` (n,), and the index of their generation, from 0."""

    ids: Ids
    X: Genes
    generation: int


def outcome_of(problem: Any, results: Mapping[str, Any], rows: int) -> dict[str, np.ndarray]:
    """Return "F", "G", "H" and "cause" of individuals: NaN if missing, and "" if nothing failed."""
    columns = {"F": problem.n_obj, "G": problem.n_ieq_constr, "H": problem.n_eq_constr}
    tables = {k: np.asarray(results.get(k, np.full((rows, size), np.nan))) for k, size in columns.items()}
    causes = [str(cause) if cause else "" for cause in results.get("cause", [""] * rows)]
    return {**tables, "cause": np.array(causes, dtype=np.str_)}


def archive_front(search: Any, points: int | None) -> Front:
    """Return the front of a search's archive, thinned by MaxiMin to at most ``points`` points (None: all)."""
    from paretoik.front.front import Front  # imported here, because it is slow

    check_count("points", points)
    members, problem = search.archive.members, search.problem
    if members is not None and points is not None and len(members) > points:
        members = members[np.sort(survivors(members.F, np.zeros(len(members)), points).index)]
    X = np.empty((0, problem.n_var)) if members is None else members.X
    F = np.empty((0, problem.n_obj)) if members is None else members.F
    decode = getattr(problem, "decode", None)
    return Front(
        ids=np.empty(0, dtype=np.int64) if members is None else members.ids,
        objectives=np.where(search.maximised, -F, F),
        names=search.names,
        units=search.units,
        maximised=search.maximised,
        genes=X,
        motions=decode(X) if decode is not None and len(X) else None,
        violation=None if members is None else members.G.max(axis=1, initial=0.0),
    )


# A search whose caller evaluates the problem.


class Search:
    """An evolutionary search by generations: ``ask`` for genes, ``tell`` their objectives and constraints.

    The problem is a pymoo problem with real genes. It may name its objectives (``names``, ``units``, ``maximised``),
    turn genes into motions (``decode(X)``), and offer its own ``algorithm(population, offspring=, initial=)``.

    - ``population``: individuals per generation
    - ``seed``: source of all random numbers
    - ``initial``: genes (rows, genes) of the first generation
    - ``algorithm``: any pymoo genetic algorithm with its own sizes and settings (it is copied); None: the problem's
      own, or MaxiMinNSGA2
    - ``offspring``: children per generation; None: the algorithm's default, one per individual
    - ``anchors``: number of first generations in which each objective is searched separately; then all objectives are
      searched together, from the best of each. This finds ends of a front in basins that are otherwise dominated.

    Further attributes:

    - ``archive``: all non-dominated points so far
    - ``generation``: number of completed generations, which is the index of the current one
    - ``evaluations``: number of evaluations in completed generations, including failed ones
    - ``population``: minimised objectives (individuals, n_obj) of the population, inf for failed individuals

    Raises InvalidInput, with name and value, for an invalid size, seed, bound or initial gene.
    """

    def __init__(
        self,
        problem: Any,
        *,
        population: int = 100,
        seed: int = 0,
        initial: ArrayLike | None = None,
        algorithm: Any = None,
        offspring: int | None = None,
        anchors: int = 0,
    ) -> None:
        check_problem(problem, initial=initial)
        check_seed("seed", seed)
        check_size("population", population, SMALLEST_POPULATION)
        check_count("offspring", offspring)
        check_size("anchors", anchors, 0)
        if algorithm is not None and (initial is not None or offspring is not None or anchors):
            raise InvalidInput(
                "algorithm must have its own sampling and offspring, got initial=, offspring= or anchors= as well"
            )
        check_algorithm(algorithm)
        initial = None if initial is None else checked_genes(problem, initial)
        self.problem = problem
        self._prototype = algorithm
        self._size, self._offspring, self.seed, self._initial = int(population), offspring, int(seed), initial
        self._stages = problem.n_obj if anchors and problem.n_obj > 1 else 0  # objectives first searched separately
        self._anchors, self._stage = anchors, 0
        self._anchor_genes: Genes = np.empty((0, problem.n_var))  # best genes of each stage
        self.names, self.units, self.maximised = describe_objectives(problem)
        self._algorithm = self._new_algorithm(initial)
        survival = self._algorithm.survival
        tolerance = column_tolerance("tolerance", getattr(survival, "tolerance", TOLERANCE), problem.n_ieq_constr)
        equality_tolerance = getattr(survival, "equality_tolerance", EQUALITY_TOLERANCE)
        self.tolerances: dict[str, Any] = {"tolerance": tolerance, "equality_tolerance": equality_tolerance}
        self.archive = Archive(names=self.names, **self.tolerances)
        self.generation, self.evaluations = 0, 0
        self.population: Objectives = np.empty((0, problem.n_obj))
        self._suggested: Genes = np.empty((0, problem.n_var))
        self._candidates: Candidates | None = None
        self._infills: Any = None
        self._outcome: dict[str, np.ndarray] = {}
        self._causes: dict[int, str] = {}  # reasons of failure by id
        self._evaluated: Mask = np.zeros(0, dtype=bool)

    def __repr__(self) -> str:
        return f"Search of {type(self.problem).__name__}: generation {self.generation}, {self.evaluations} evaluations"

    _repr_html_ = html_representation

    @property
    def failed(self) -> Failures:
        """Number of failed evaluations, and the cause of the first."""
        return self.archive.failed

    @property
    def front(self) -> Front:
        """The archive's front in the user's own sign, with motions if the problem decodes genes."""
        return self.front_of(None)

    front_of = archive_front

    def ask(self) -> Candidates:
        """Return the candidates to evaluate; the same object until all of them are told."""
        if self._candidates is None:
            self._infills = self._algorithm.ask()
            if self._infills is None:
                raise InvalidInput(f"algorithm must return new genes, got none in generation {self.generation}")
            n = len(self._infills)
            X = column(self._infills, "X")
            now, self._suggested = self._suggested[:n], self._suggested[n:]
            X[n - len(now) :] = now
            X.flags.writeable = False
            for individual, genes in zip(self._infills, X, strict=True):
                individual.X = genes
            ids = np.arange(self.evaluations, self.evaluations + n)
            ids.flags.writeable = False
            self._candidates = Candidates(ids, X, self.generation)
            self._outcome, self._causes = outcome_of(self.problem, {}, n), {}
            self._evaluated = np.zeros(n, dtype=bool)
        return self._candidates

    def suggest(self, X: ArrayLike) -> None:
        """Add genes (rows, genes) to the next generations; each row replaces one offspring."""
        self._suggested = np.concatenate((self._suggested, checked_genes(self.problem, X, "suggested")))

    def tell(
        self,
        ids: ArrayLike,
        F: ArrayLike,
        G: ArrayLike | None = None,
        *,
        H: ArrayLike | None = None,
        causes: Mapping[int, str] | None = None,
    ) -> None:
        """Tell objectives and constraints of ids, in any order and in any number of parts.

        ``F`` (n, n_obj) is minimised; a feasible point has ``G`` (n, n_ieq) <= 0 and ``H`` (n, n_eq) = 0. An individual
        with values that are not finite has failed; ``causes`` may give reasons. The generation is complete when every
        id is told.

        Raises InvalidInput for an id that is unknown or told twice, or an array of another shape; then nothing changes.
        """
        numbers = integer_array("ids", ids)
        if numbers.ndim != 1:
            raise InvalidInput(f"ids must be a list of integers, got shape {numbers.shape}")
        if self._candidates is None:
            raise InvalidInput("ids must be those of candidates from ask(), got ids before ask()")
        first, last = int(self._candidates.ids[0]), int(self._candidates.ids[-1])
        for number in numbers[(numbers < first) | (numbers > last)]:
            raise InvalidInput(f"ids must be among those asked, {first} to {last}, got {number}")
        rows = numbers - first
        unique, counts = np.unique(rows, return_counts=True)
        for row in unique[(counts > 1) | self._evaluated[unique]]:
            raise InvalidInput(f"ids must be told once each, got {first + row} again")
        if not isinstance(causes, Mapping | None):
            raise InvalidInput(f"causes must be a mapping from ids to text, got {shown(causes)}")
        tables = {}
        for name, values in (("F", F), ("G", G), ("H", H)):
            table = np.empty((len(rows), 0)) if values is None else real_array(name, values)
            if table.shape != (shape := (len(rows), self._outcome[name].shape[1])):
                fact = "nothing" if values is None else f"shape {table.shape}"
                raise InvalidInput(f"{name} must be real numbers of shape {shape}, got {fact}")
            tables[name] = table.astype(float)
        for name, table in tables.items():
            self._outcome[name][rows] = table
        self._causes.update(causes or {})
        self._evaluated[rows] = True
        if self._evaluated.all():
            self._advance(self._candidates)

    def _advance(self, candidates: Candidates) -> None:
        F, G, H, ids = self._outcome["F"], self._outcome["G"], self._outcome["H"], candidates.ids
        self.archive.add(ids, candidates.X, F, G, self.generation, H=H, causes=self._causes)
        violation = violations(F, G, H, **self.tolerances)
        usable = np.where(np.isfinite(F).all(axis=1, keepdims=True), F, np.inf)
        axes = slice(self._stage, self._stage + 1) if self._stage < self._stages else slice(None)
        for row, individual in enumerate(self._infills):
            individual.data["objectives"] = usable[row]
            individual.F, individual.G, individual.H = usable[row, axes], G[row], H[row]
            individual.CV = violation[row : row + 1]
            individual.evaluated = {"F", "G", "H"}
        self._algorithm.evaluator.n_eval += len(ids)
        self._algorithm.tell(infills=self._infills)
        self.population = np.array([individual.data["objectives"] for individual in self._algorithm.pop])
        self.generation += 1
        self.evaluations += len(ids)
        self._candidates = self._infills = None
        if self._stage < self._stages and self.generation == (self._stage + 1) * self._anchors:
            # next: search one objective from the initial genes, or all objectives from the best of each
            best = column(self._algorithm.pop, "X")[: self._size // (4 * self._stages)]
            self._anchor_genes = np.concatenate((self._anchor_genes, best))
            self._stage += 1
            initial, members = self._initial, self.archive.members
            if self._stage == self._stages:
                initial = self._anchor_genes
                if members is not None:
                    spread = survivors(members.F, np.zeros(len(members)), self._size // 2).index
                    initial = np.concatenate((members.X[spread], initial))
                initial = np.unique(initial, axis=0)
            self._algorithm = self._new_algorithm(initial)

    def _new_algorithm(self, initial: ArrayLike | None) -> Any:
        """Return a new algorithm, ready for ``ask``. Every stage has its own random numbers."""
        if self._prototype is not None:
            algorithm = copy.deepcopy(self._prototype)
        elif hasattr(self.problem, "algorithm"):
            algorithm = self.problem.algorithm(self._size, offspring=self._offspring, initial=initial)
        else:
            algorithm = MaxiMinNSGA2(pop_size=self._size, n_offsprings=self._offspring, sampling=initial)
        seed = seed_of(self.seed, self._stage) if self._stages else self.seed
        return algorithm.setup(self.problem, seed=seed, termination=NoTermination())


def seed_of(seed: int, part: int) -> int:
    """Return the seed of a part of a search: a stage or an island."""
    return int(np.random.SeedSequence([seed, part]).generate_state(1)[0])
