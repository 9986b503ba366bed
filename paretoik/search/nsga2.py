"""NSGA-II with MaxiMin selection, branch-wise mating and mixed seeding, as a pymoo algorithm."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pymoo.algorithms.base.genetic import GeneticAlgorithm
from pymoo.core.crossover import Crossover
from pymoo.core.individual import Individual
from pymoo.core.mutation import Mutation
from pymoo.core.population import Population
from pymoo.core.sampling import Sampling
from pymoo.operators.crossover.sbx import SBX
from pymoo.operators.mutation.pm import PM
from pymoo.util.display.multi import MultiObjectiveOutput

from paretoik.call_arguments import check_call
from paretoik.errors import InvalidInput
from paretoik.inputs import check_count, check_instance, check_size, shown
from paretoik.search.constraints import EQUALITY_TOLERANCE, TOLERANCE
from paretoik.search.mating import BranchwiseMating
from paretoik.search.maximin import MaxiMin, check_infeasible_share, column
from paretoik.search.seeding import SMALLEST_POPULATION, check_bounds, check_sizes, seeded_population
from paretoik.search.variables import Operators, check_sampling, has_real_genes, operators_for, samples_bits
from paretoik.tables import html_representation


@check_call
class MaxiMinNSGA2(GeneticAlgorithm):  # type: ignore[misc]  # pymoo has no types
    """NSGA-II whose survival is MaxiMin; for ``pymoo.optimize.minimize``, pymoo's ask and tell, and ``Search``.

    ``pop_size`` at least 4; ``n_offsprings`` a generation, as many if None. ``sampling`` is what the first population
    starts with, an array of genes, a pymoo Sampling or a Population, whose evaluated individuals are not evaluated
    again, and is topped up to ``pop_size`` by ``seeded_population``. ``crossover`` (two parents) and ``mutation`` are
    pymoo operators, by default SBX(eta=15, prob=0.9) and PM(eta=20). The rest is explained at ``MaxiMin``.

    Genes may be of any kind: real numbers without bounds want ``sampling``; integers, binary and named variables are
    sampled and varied by pymoo's own operators. They are binary too where ``sampling`` is, as pymoo's ZDT5 wants it.

    Raises InvalidInput for a size or bound that cannot be used, and for a misspelt option of pymoo's ``minimize``.
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
                check_instance(name, operator, kind, "an operator of pymoo's or None")
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
            eliminate_duplicates=False,  # seeding and mating see to it, on arrays
            output=MultiObjectiveOutput(),
            advance_after_initial_infill=True,
        )
        self.sampling, self.crossover, self.mutation = sampling, crossover, mutation
        self.tournament_type = "comp_by_rank_and_crowding"  # of pymoo's own mating
        self._branchwise = branchwise
        self._operators: Operators | None = None  # of genes that are no real numbers

    def __repr__(self) -> str:
        return f"MaxiMinNSGA2(pop_size={self.pop_size})"

    _repr_html_ = html_representation

    def setup(self, problem: Any, **options: Any) -> Any:
        """Prepare for a problem; the options are pymoo's (seed, termination, callback, verbose, ...)."""
        check_sizes(problem)
        binary = samples_bits(self.sampling)
        if has_real_genes(problem) and not binary:
            check_bounds(problem, initial=self.sampling)
            self.mating, self._operators = self._branchwise, None
        else:
            operators = operators_for(problem, self.crossover, self.mutation, binary=binary)
            self.mating, self._operators = operators.mating, operators
        for name in options:
            if name not in self.__dict__ and name not in ("verbose", "progress"):
                raise InvalidInput(f"minimize: one of pymoo's options wanted, got {shown(name)}")
        return super().setup(problem, **options)

    def _initialize_infill(self) -> Any:
        initial = self.sampling
        if isinstance(initial, Sampling):
            initial = initial.do(self.problem, self.pop_size, random_state=self.random_state)
        if self._operators is not None:
            return self._sampled(initial, self._operators)
        individuals = initial if isinstance(initial, Population) else Population()
        X = individuals.get("X") if isinstance(initial, Population) else initial
        X = seeded_population(self.problem, self.pop_size, X, rng=self.random_state)
        by_genes = {np.asarray(individual.X, dtype=float).tobytes(): individual for individual in individuals}
        return Population([by_genes.get(row.tobytes()) or Individual(X=row) for row in X])

    def _sampled(self, initial: Any, operators: Operators) -> Any:
        """Return the first population of genes that are no real numbers: what is given, and others by pymoo."""
        first = initial if isinstance(initial, Population) else Population.new("X", [] if initial is None else initial)
        if len(first) > self.pop_size:
            raise InvalidInput(f"sampling: at most {self.pop_size} individuals wanted, got {len(first)}")
        if len(first) < self.pop_size and operators.sampling is None:
            raise InvalidInput(f"sampling: {self.pop_size} individuals wanted for such genes, got {len(first)}")
        for _ in range(10):
            if len(first) < self.pop_size:
                more = operators.sampling.do(self.problem, self.pop_size - len(first), random_state=self.random_state)
                first = Population.merge(first, operators.duplicates.do(more, first))
        if len(first) < self.pop_size:  # there are not so many
            spare = self.pop_size - len(first)
            first = Population.merge(first, operators.sampling.do(self.problem, spare, random_state=self.random_state))
        return first

    def _set_optimum(self, **kwargs: Any) -> None:
        violation = column(self.pop, "CV")[:, 0]
        rank = np.array([individual.data["rank"] for individual in self.pop])
        front = (violation <= 0.0) & (rank == 0)
        self.opt = self.pop[front] if front.any() else self.pop[[int(np.argmin(violation))]]
