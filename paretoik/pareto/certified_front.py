"""Certify a front's points, tighten limits between samples, and replace saddles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from paretoik.arrays import Genes, Ids, Point, Points
from paretoik.compilation_notices import computing_clock
from paretoik.errors import ParetoikError
from paretoik.front.certificates import Certificates
from paretoik.front.front import Front
from paretoik.front.hypervolume import ranges_of
from paretoik.front.points import confirmation, widths_of
from paretoik.nlp.minimise import chosen_solver
from paretoik.nlp.program import FEASIBLE, Program, Solver
from paretoik.pareto.certificates import OPTIONS as CERTIFICATES
from paretoik.pareto.certificates import certify
from paretoik.pareto.differentiable import Differentiable, Individuals
from paretoik.pareto.placement import front_rows
from paretoik.pareto.refine import refine
from paretoik.pareto.scalarisation import Observe
from paretoik.pareto.sweep import SweepProgress
from paretoik.progress import OPTIONS as TIME_LEFT
from paretoik.progress import Observer, RunProgress, count_observer, is_due, time_left
from paretoik.runs.distribution import workers
from paretoik.runs.fingerprint import fingerprint
from paretoik.runs.interruption import reserve_time
from paretoik.runs.journal import without_journal

# The time of certificates, and the part of a time limit that is reserved for them.


@dataclass(frozen=True, kw_only=True)
class CertificateTime:
    """Settings of the time for certificates and for tightening limits."""

    share: float = 0.2  # share of a time limit that is reserved for each later stage
    longest: float = 2.0  # largest number of seconds reserved per point for each later stage
    trials: float = 0.1  # largest share of the elapsed time for trials of later stages
    # step between tried points, as a share of the front; the golden ratio spreads any number of steps evenly
    spread: float = 0.618


TIME_OPTIONS = CertificateTime()


@dataclass(kw_only=True, eq=False)
class Certifier:
    """Refinement and certification of a formulation's points, with an observer.

    Trials on some points measure how long the stages after refinement take.
    """

    formulation: Differentiable
    solver: Solver = "auto"
    observe: Observer | None = None
    looks: list[float] = field(default_factory=list)  # seconds of each check for limits exceeded between samples
    tightenings: list[float] = field(default_factory=list)  # seconds of each tightening of a point that exceeds limits
    certificates: list[float] = field(default_factory=list)  # seconds of each certification of a point
    exceeding: int = 0  # number of checked points that exceed limits between samples
    seen: set[bytes] = field(default_factory=set)  # keys of the points that were checked
    spent: float = 0.0  # seconds of all measurements
    # elapsed seconds and number of solved levels after the last cold start of a sweep
    after_cold: tuple[float, int] | None = None

    @property
    def later_stages(self) -> tuple[str, ...]:
        """The stages after points are found."""
        return ("tightening", "certification") if self.formulation.tightens else ("certification",)

    def reserve_later(self, points: int) -> AbstractContextManager[None]:
        """Return a context that reserves part of the time for later stages."""
        stages = len(self.later_stages)
        return reserve_time(stages * TIME_OPTIONS.share, stages * points * TIME_OPTIONS.longest)

    def per_point(self) -> float:
        """Return the seconds per point of tightening and certification, divided by the number of workers."""
        share = self.exceeding / max(len(self.looks), 1)
        tightening = _mean(self.looks) + share * _mean(self.tightenings)
        return tightening / max(workers(), 1) + self.per_certificate()

    def per_certificate(self) -> float:
        """Return the seconds per point of certification, divided by the number of workers."""
        return _mean(self.certificates) / max(workers(), 1)

    def try_point(self, x: Point, ranges: Float[np.ndarray, " n_obj"], seconds: float) -> None:
        """Measure both later stages on a point, if earlier trials took little of the elapsed time ``seconds``.

        The clock decides which points are tried, so the journal of a run does not record them.
        """
        key, allowed = x.tobytes(), TIME_OPTIONS.trials * seconds
        if key in self.seen or seconds < TIME_LEFT.seconds or sum(self.looks) > allowed:
            return
        self.seen.add(key)
        clock = [computing_clock()]

        def lap() -> float:
            clock.append(computing_clock())
            return clock[-1] - clock[-2]

        with suppress(ParetoikError), without_journal():
            exceeds = bool(self.formulation.exceeded(self.formulation.individuals(x[None]))[0])
            self.looks.append(lap())
            self.exceeding += exceeds
            is_first = not (self.tightenings if exceeds else self.certificates)
            if is_first or (exceeds and self.spent <= allowed):
                held, programs = self.formulation.hold_between(x[None], ranges, solver=self.solver)
                self.tightenings += [lap()] if exceeds else []
                individuals = self.formulation.individuals(held)
                if not self.certificates:  # the first one also loads much code, and is not measured
                    certify_individuals(self.formulation, programs, individuals, 2 * ranges)
                lap()
                certify_individuals(self.formulation, programs, individuals, ranges)
                self.certificates.append(lap())
        self.spent += computing_clock() - clock[0]

    def point_progress(self, progress: SweepProgress, seconds: float, summary: str = "") -> RunProgress:
        """Return a sweep's progress, with the time left if an observer is due."""
        remaining = None
        if is_due(self.observe) and progress.ahead is not None:
            row = int(len(progress.front) * (TIME_OPTIONS.spread * len(self.looks) % 1))
            self.try_point(progress.x[progress.front[row]], progress.ranges, seconds)
            elapsed = seconds - self.spent
            self.after_cold = self.after_cold or (elapsed, progress.solved)
            began, solved = self.after_cold
            later = progress.total * self.per_point()
            if self.looks:
                remaining = time_left(progress.solved - solved, progress.ahead, elapsed - began, later)
        return RunProgress(
            stage="point",
            done=progress.done,
            total=progress.total,
            seconds=seconds,
            remaining=remaining,
            summary=", ".join(filter(None, [summary, progress.phase])),
            following=" and ".join(self.later_stages),
        )

    def certify(self, x: Points, ranges: Float[np.ndarray, " n_obj"], genes: Genes | None = None) -> CertifiedPoints:
        """Return certified points; limits exceeded between samples are tightened first."""
        formulation, observe = self.formulation, self.observe
        shown = count_observer(
            observe, "tightening", later=self.per_certificate, uniform=True, following="certification"
        )
        with reserve_time(TIME_OPTIONS.share, len(x) * TIME_OPTIONS.longest):
            held, programs = formulation.hold_between(x, ranges, solver=self.solver, observe=shown)
        individuals = formulation.individuals(held, genes)
        counted = count_observer(observe, "certification", uniform=True)
        certificates, better = certify_individuals(formulation, programs, individuals, ranges, counted)
        return CertifiedPoints(individuals=individuals, certificates=certificates, better=better)


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if values else 0.0


# Certification of a front, and replacement of its saddles.


@dataclass(frozen=True, kw_only=True)
class CertifiedFrontOptions:
    """Settings of certified fronts."""

    rounds: int = 3  # largest number of rounds in which better points next to saddles are refined
    tolerance: float = 1e-9  # largest rise of an objective that counts as 0, as a share of its range
    between: float = 1e-8  # largest violation between samples that counts as 0, as a share of a limit's range


OPTIONS = CertifiedFrontOptions()


def certify_individuals(
    formulation: Differentiable,
    programs: Program | Sequence[Program],
    individuals: Individuals,
    ranges: Float[np.ndarray, " n_obj"],
    observe: Observe | None = None,
) -> tuple[Certificates, list[Point | None]]:
    """Return individuals' certificates, and a better point for each saddle."""
    return certify(
        programs,
        individuals.x,
        ranges=ranges,
        signs=np.where(formulation.maximised, -1.0, 1.0),
        violation_between=individuals.violation_between,
        exceeded=formulation.exceeded(individuals),
        discretisation=individuals.discretisation,
        observe=observe,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class CertifiedPoints:
    """Points with their certificates, and a ``better`` point next to each saddle."""

    individuals: Individuals
    certificates: Certificates
    better: list[Point | None]

    def replace_rows(
        self,
        formulation: Differentiable,
        rows: Int[np.ndarray, " rows"],
        others: CertifiedPoints,
        other_rows: Int[np.ndarray, " rows"],
    ) -> CertifiedPoints:
        """Return points with ``rows`` replaced by ``other_rows`` of others.

        In the other rows ``better`` becomes None.
        """
        order = np.arange(len(self.better))
        order[rows] = len(order) + other_rows
        before, after = self.individuals, others.individuals
        genes = None
        if before.genes is not None and after.genes is not None:
            genes = np.concatenate([before.genes, after.genes])[order]
        better: list[Point | None] = [None] * len(order)
        for row, other_row in zip(rows, other_rows, strict=True):
            better[row] = others.better[other_row]
        return CertifiedPoints(
            individuals=formulation.individuals(np.concatenate([before.x, after.x])[order], genes),
            certificates=self.certificates.replace_rows(rows, others.certificates[other_rows]),
            better=better,
        )


def certified_front(
    certifier: Certifier,
    x: Points,
    ids: Ids,
    ranges: Float[np.ndarray, " n_obj"],
    provenance: Mapping[str, Any],
    *,
    before: Front | None = None,
) -> Front:
    """Return the front of the nondominated points among these, with certificates.

    - A point that is worse than its former version on the front ``before`` is replaced by it.
    - If a point exceeds limits between samples, they are tightened if the formulation can do so; the certificate is for
      the tightened limits.
    - A saddle is replaced by the refined better point next to it.
    - Minima of the front ``before`` stay, with their certificates, if no better point is found.
    """
    formulation = certifier.formulation
    individuals = formulation.individuals(x)
    if before is not None:
        individuals = no_worse(formulation, individuals, before, ranges)
    rows = front_rows(individuals.objectives / ranges)
    genes = None if individuals.genes is None else individuals.genes[rows]
    points = _leave_saddles(certifier, certifier.certify(individuals.x[rows], ranges, genes), ranges)
    if before is not None:
        points = _keep_minima(formulation, points, before, rows, ranges)
    individuals, ids = points.individuals, ids[rows]
    rows = front_rows(individuals.objectives / ranges)
    final = ranges_of(individuals.objectives[rows]) if len(rows) else ranges  # objective ranges of the final front
    confirmed = int((points.certificates.criticality[rows] <= CERTIFICATES.critical).sum())
    certificates = points.certificates[rows].rescale(ranges, final)
    method = chosen_solver(formulation.program(ranges), certifier.solver)
    return Front(
        ids=ids[rows],
        objectives=individuals.objectives[rows] * np.where(formulation.maximised, -1.0, 1.0),
        names=formulation.names,
        units=formulation.units,
        maximised=formulation.maximised,
        genes=None if individuals.genes is None else individuals.genes[rows],
        motions=None if individuals.motions is None else individuals.motions[rows],
        violation=certificates.violation,
        certificates=certificates,
        provenance={
            "fingerprint": fingerprint(formulation),
            **provenance,
            **confirmation(method, confirmed, len(rows)),
            **formulation.added_samples,
        },
        problem=formulation,
    )


def _leave_saddles(
    certifier: Certifier, points: CertifiedPoints, ranges: Float[np.ndarray, " n_obj"]
) -> CertifiedPoints:
    """Return points with saddles replaced by refined points that are worse in no objective."""
    formulation = certifier.formulation
    for _ in range(OPTIONS.rounds):
        saddles = np.array([i for i, better in enumerate(points.better) if better is not None], dtype=int)
        if not len(saddles):
            break
        x = np.stack([better for better in points.better if better is not None])
        x, _ = refine(formulation.program(ranges), x, len(ranges), solver=certifier.solver)
        refined = certifier.certify(x, ranges)
        rise = refined.individuals.objectives - points.individuals.objectives[saddles]
        allowed = np.maximum(points.certificates.violation_between[saddles], OPTIONS.between)
        holds = refined.certificates.violation_between <= allowed  # NaN after a signal, if the violation is unknown
        accepted = np.flatnonzero(holds & (rise <= OPTIONS.tolerance * ranges).all(axis=1))
        points = points.replace_rows(formulation, saddles[accepted], refined, accepted)
    return points


def _keep_minima(
    formulation: Differentiable,
    points: CertifiedPoints,
    before: Front,
    rows: Int[np.ndarray, " points"],
    ranges: Float[np.ndarray, " n_obj"],
) -> CertifiedPoints:
    """Return points, each replaced by its former minimum on ``before`` unless it dominates that.

    A point may be worse than before because its limits were tightened again, for another motion. ``rows`` are the rows
    of the points on ``before``.
    """
    if before.certificates is None:
        return points
    former = before.certificates.rescale(widths_of(before), ranges)[rows]
    minima = (former.status == "minimum") & (former.criticality <= CERTIFICATES.critical)
    minima &= former.violation_between <= OPTIONS.between
    rise = (points.individuals.objectives - before.minimised[rows]) / ranges
    better = (rise < -OPTIONS.tolerance).any(axis=1) & (rise <= OPTIONS.tolerance).all(axis=1)
    unchanged = np.flatnonzero(minima & ~better)
    if not len(unchanged):
        return points
    rows = rows[unchanged]
    genes = None if before.genes is None else before.genes[rows]
    as_before = CertifiedPoints(
        individuals=formulation.individuals(formulation.front_points(before)[rows], genes),
        certificates=former[unchanged],
        better=[None] * len(unchanged),
    )
    return points.replace_rows(formulation, unchanged, as_before, np.arange(len(unchanged)))


def no_worse(
    formulation: Differentiable,
    individuals: Individuals,
    before: Front,
    ranges: Float[np.ndarray, " n_obj"],
) -> Individuals:
    """Return individuals; feasible former ones on the front ``before`` replace those that became worse."""
    worse = ~(individuals.objectives <= before.minimised + OPTIONS.tolerance * ranges).all(axis=1)  # true for NaN too
    if before.violation is not None:
        worse &= before.violation <= FEASIBLE
    if not worse.any():
        return individuals
    x = individuals.x.copy()
    x[worse] = formulation.front_points(before)[worse]
    if individuals.genes is None or before.genes is None:
        return formulation.individuals(x)
    genes = individuals.genes.copy()
    genes[worse] = before.genes[worse]
    return formulation.individuals(x, genes)
