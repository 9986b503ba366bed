"""NSGA-II with MaxiMin selection, branch-wise mating and mixed seeding, as a pymoo algorithm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pymoo.algorithms.base.genetic import GeneticAlgorithm
from pymoo.core.crossover import Crossover
from pymoo.core.individual import Individual
from pymoo.core.mutation import Mutation
from pymoo.core.population import Population
from pymoo.core.sampling import Sampling
from pymoo.core.variable import get
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM
from pymoo.util.display.multi import MultiObjectiveOutput

from paretoik.arrays import Genes, Ids, Mask, Objectives, Values
from paretoik.errors import InvalidInput
from paretoik.inputs import check_count, check_instance, check_size, shown
from paretoik.search.genes import (
    SMALLEST_POPULATION,
    check_bounds,
    check_sampling,
    check_sizes,
    has_real_genes,
    operators_for,
    samples_bits,
    seeded_population,
    widths_of,
    within_reach,
)
from paretoik.search.maximin import MaxiMin, check_infeasible_share, column, dominates
from paretoik.search.objectives import EQUALITY_TOLERANCE, TOLERANCE, Integers
from paretoik.tables import html_representation

# Mating: tournaments, crossover within a species, mutation, and migration to another species.
#
# A problem may offer ``species(X) -> (points,)``, integer labels. Children of two labels are infeasible, so only
# individuals with equal labels mate. It may also offer ``species_gene``, the index of a gene whose integer part is the
# label, and ``n_species``: crossover and mutation do not change that gene, but a few offspring get another label. If
# the problem offers ``translated(X, labels) -> X``, their other genes are translated to the new label.


@dataclass(frozen=True, kw_only=True)
class MatingOptions:
    """Settings of mating; they have no source."""

    # share of tournaments that is spread evenly over species, because a worse species may win in the end
    even_share: float = 0.5
    migration_probability: float = 0.05  # probability that an offspring moves to another species
    rounds: int = 20  # largest number of rounds of mating until all offspring are new


OPTIONS = MatingOptions()


@dataclass(frozen=True, eq=False)
class Parents:
    """A population as arrays with one row per individual."""

    X: Genes
    F: Objectives
    violation: Values
    rank: Ids
    spacing: Values
    species: Ids


class BranchwiseMating:
    """pymoo mating on whole arrays: binary tournaments by rank, then spacing; then the two operators.

    crossover: pymoo operator of real genes. If it has two parents, both win a tournament; if three, as in
        ``Differential``, only the first one does, and the others are drawn from its species.
    mutation: pymoo operator of real genes
    infeasible_parents: whether an infeasible point beats a feasible one that it dominates
    """

    def __init__(self, crossover: Any, mutation: Any, *, infeasible_parents: bool = False) -> None:
        if crossover.n_parents not in (2, 3):
            raise InvalidInput(f"crossover must be an operator of 2 or 3 parents, got {crossover.n_parents}")
        self.crossover = crossover
        self.mutation = mutation
        self.infeasible_parents = infeasible_parents
        self.widths: Values = np.zeros(1)  # width of the widest population so far, along every gene

    def do(self, problem: Any, pop: Any, n_offsprings: int, *, random_state: np.random.Generator, **kwargs: Any) -> Any:
        """Return a pymoo population of ``n_offsprings`` that differ from each other and from the parents.

        If there are too few different genes, the last ones are copies.
        """
        X = column(pop, "X")
        self.widths = np.maximum(self.widths, widths_of(X))
        parents = Parents(
            X=X,
            F=column(pop, "F"),
            violation=column(pop, "CV")[:, 0],
            rank=np.array([individual.data["rank"] for individual in pop]),
            spacing=np.array([individual.data["crowding"] for individual in pop]),
            species=problem.species(X) if hasattr(problem, "species") else np.zeros(len(X), dtype=np.int64),
        )
        seen = {row.tobytes() for row in X + 0.0}
        offspring: list[Genes] = []
        for attempt in range(OPTIONS.rounds):
            for row in self._offspring(problem, parents, n_offsprings - len(offspring), random_state):
                key = (row + 0.0).tobytes()
                if len(offspring) < n_offsprings and (key not in seen or attempt == OPTIONS.rounds - 1):
                    seen.add(key)
                    offspring.append(row)
            if len(offspring) == n_offsprings:
                break
        return Population.new("X", np.array(offspring))

    def _offspring(self, problem: Any, parents: Parents, count: int, rng: np.random.Generator) -> Genes:
        matings = -(-count // self.crossover.n_offsprings)
        pool = np.concatenate([rng.permutation(len(parents.X)) for _ in range(-(-2 * matings // len(parents.X)))])
        rivals = pool[: 2 * matings].reshape(2, matings)
        labels, members = np.unique(parents.species, return_index=True)
        if len(labels) > 1:  # rivals of some tournaments are of one species; each species is equally likely
            even = np.less(rng.random(matings), OPTIONS.even_share)
            individuals = members[rng.integers(0, len(labels), size=int(even.sum()))]
            for rival in rivals:
                rival[even] = _draw_from_species(parents.species, individuals, rng)
        first = self._select_winners(parents, rivals[0], rivals[1], rng)
        others = np.split(_draw_from_species(parents.species, np.concatenate((first, first)), rng), 2)
        if self.crossover.n_parents == 2:
            others = [self._select_winners(parents, others[0], others[1], rng)]
        couples = parents.X[np.stack((first, *others))]
        reach = within_reach(problem, parents.X, self.widths)
        children = np.array(self.crossover._do(reach, couples, random_state=rng))
        uncrossed = rng.random(matings) >= get(self.crossover.prob)
        children[:, uncrossed] = couples[: len(children), uncrossed]
        gene = getattr(problem, "species_gene", None)
        if gene is not None:
            children[..., gene] = couples[: len(children), :, gene]
        X = children.reshape(-1, problem.n_var)
        mutated = np.array(self.mutation._do(reach, X, random_state=rng))
        unchanged = rng.random(len(X)) > get(self.mutation.prob)
        mutated[unchanged] = X[unchanged]
        if gene is None:
            return mutated
        mutated[:, gene] = X[:, gene]
        migrants = np.flatnonzero(rng.random(len(X)) < OPTIONS.migration_probability)
        if problem.n_species > 1 and migrants.size:
            step = rng.integers(1, problem.n_species, size=migrants.size)
            labels = (np.floor(X[migrants, gene]).astype(np.int64) + step) % problem.n_species
            if hasattr(problem, "translated"):
                mutated[migrants] = problem.translated(mutated[migrants], labels)
            else:
                mutated[migrants, gene] = labels + 0.5
        return mutated

    def _select_winners(self, parents: Parents, a: Integers, b: Integers, rng: np.random.Generator) -> Integers:
        """Return the index of each pair's better one: less violation, better rank, larger spacing; random if tied."""
        won: Mask = np.zeros(len(a), dtype=bool)
        tied: Mask = np.ones(len(a), dtype=bool)
        for key in (parents.violation, parents.rank, -parents.spacing):
            won |= tied & (key[a] < key[b])
            tied &= key[a] == key[b]
        won |= tied & (rng.random(len(a)) < 0.5)
        if self.infeasible_parents:
            mixed = (parents.violation[a] > 0) != (parents.violation[b] > 0)
            won = np.where(mixed & dominates(parents.F[a], parents.F[b]), True, won)
            won = np.where(mixed & dominates(parents.F[b], parents.F[a]), False, won)
        return np.where(won, a, b)


def _draw_from_species(species: Integers, individuals: Integers, rng: np.random.Generator) -> Integers:
    """Return a random member of each individual's species, possibly itself."""
    by_species = np.argsort(species, kind="stable")
    labels, first, sizes = np.unique(species[by_species], return_index=True, return_counts=True)
    group = np.searchsorted(labels, species[individuals])
    mates: Integers = by_species[first[group] + rng.integers(0, sizes[group])]
    return mates


# NSGA-II with MaxiMin selection.


class MaxiMinNSGA2(GeneticAlgorithm):  # type: ignore[misc]  # pymoo has no types
    """NSGA-II whose survival is MaxiMin; for ``pymoo.optimize.minimize``, pymoo's ask and tell, and ``Search``.

    Genes may be of any kind. Real numbers without bounds need ``sampling``. pymoo's own operators sample and vary
    integers, binary and named variables. Genes are binary, too, if ``sampling`` is, as pymoo's ZDT5 needs.

    - ``pop_size``: individuals, at least 4
    - ``n_offsprings``: offspring per generation; None: as many as individuals
    - ``sampling``: first individuals: genes, a pymoo Sampling or a Population, whose evaluated individuals are not
      evaluated again; ``seeded_population`` adds the others
    - ``crossover``: pymoo operator of two or three parents; None: SBX(eta=15, prob=0.9)
    - ``mutation``: pymoo operator; None: PM(eta=20)
    - ``ranges``, ``infeasible_share``, ``tolerance``, ``equality_tolerance``: see ``MaxiMin``

    Raises InvalidInput for an invalid size or bound, and for a misspelt option of pymoo's ``minimize``.
    """

    def __init__(
        self,
        pop_size: int = 100,
        *,
        n_offsprings: int | None = None,
        sampling: ArrayLike | Sampling | None = None,
        crossover: Any = None,
        mutation: Any = None,
        ranges: ArrayLike | None = None,
        infeasible_share: float = 0.0,
        tolerance: ArrayLike = TOLERANCE,
        equality_tolerance: ArrayLike = EQUALITY_TOLERANCE,
    ) -> None:
        check_size("pop_size", pop_size, SMALLEST_POPULATION)
        check_count("n_offsprings", n_offsprings)
        check_infeasible_share(infeasible_share)
        check_sampling(sampling)
        for name, operator, kind in (("crossover", crossover, Crossover), ("mutation", mutation, Mutation)):
            if operator is not None:
                check_instance(name, operator, kind, "a pymoo operator or None")
        branchwise = BranchwiseMating(
            SBX(eta=15, prob=0.9) if crossover is None else crossover,
            PM(eta=20) if mutation is None else mutation,
            infeasible_parents=infeasible_share > 0.0,
        )
        super().__init__(
            pop_size=int(pop_size),
            n_offsprings=n_offsprings,
            survival=MaxiMin(
                ranges=ranges,
                infeasible_share=infeasible_share,
                tolerance=tolerance,
                equality_tolerance=equality_tolerance,
            ),
            mating=branchwise,
            eliminate_duplicates=False,  # seeding and mating remove duplicates, on arrays
            output=MultiObjectiveOutput(),
            advance_after_initial_infill=True,
        )
        self.sampling, self.crossover, self.mutation = sampling, crossover, mutation
        self.tournament_type = "comp_by_rank_and_crowding"  # for pymoo's own mating
        self._branchwise = branchwise
        self._own_operators: tuple[Any, Any] | None = None  # sampling and mating of genes that are not real

    def __repr__(self) -> str:
        return f"MaxiMinNSGA2(pop_size={self.pop_size})"

    _repr_html_ = html_representation

    def setup(self, problem: Any, **options: Any) -> Any:
        """Prepare for a problem. ``options``: those of pymoo (seed, termination, callback, verbose, ...)."""
        check_sizes(problem)
        binary = samples_bits(self.sampling)
        if has_real_genes(problem) and not binary:
            check_bounds(problem, initial=self.sampling)
            self.mating, self._own_operators = self._branchwise, None
        else:
            self._own_operators = operators_for(problem, self.crossover, self.mutation, binary=binary)
            self.mating = self._own_operators[1]
        for name in options:
            if name not in self.__dict__ and name not in ("verbose", "progress"):
                raise InvalidInput(f"minimize must get only options of pymoo, got {shown(name)}")
        return super().setup(problem, **options)

    def _initialize_infill(self) -> Any:
        initial = self.sampling
        if isinstance(initial, Sampling):
            initial = initial.do(self.problem, self.pop_size, random_state=self.random_state)
        if self._own_operators is None:
            individuals = initial if isinstance(initial, Population) else Population()
            X = individuals.get("X") if isinstance(initial, Population) else initial
            X = seeded_population(self.problem, self.pop_size, X, rng=self.random_state)
            by_genes = {np.asarray(individual.X, dtype=float).tobytes(): individual for individual in individuals}
            return Population([by_genes.get(row.tobytes()) or Individual(X=row) for row in X])
        # genes that are not real numbers: given ones, then samples by pymoo
        sampling, mating = self._own_operators
        first = initial if isinstance(initial, Population) else Population.new("X", [] if initial is None else initial)
        if len(first) > self.pop_size:
            raise InvalidInput(f"sampling must have at most {self.pop_size} individuals, got {len(first)}")
        if len(first) < self.pop_size and sampling is None:
            raise InvalidInput(
                f"sampling must have all {self.pop_size} individuals, got {len(first)}: pymoo cannot sample such genes"
            )
        for attempt in range(11):
            if len(first) < self.pop_size:
                more = sampling.do(self.problem, self.pop_size - len(first), random_state=self.random_state)
                if attempt < 10:  # after that, too few different genes exist
                    more = mating.eliminate_duplicates.do(more, first)
                first = Population.merge(first, more)
        return first

    def _set_optimum(self, **kwargs: Any) -> None:
        violation = column(self.pop, "CV")[:, 0]
        rank = np.array([individual.data["rank"] for individual in self.pop])
        front = (violation <= 0.0) & (rank == 0)
        self.opt = self.pop[front] if front.any() else self.pop[[int(np.argmin(violation))]]
