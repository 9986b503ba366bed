"""Rows and unknowns that users' functions of motions add to a small dense program.

A term to be small is the sum of ``tops``, unknowns that are at least its values: one a sample and its interval of an
integral, else one. A term that is bounded has its bound in place of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from paretoik.capability.smooth_functions import SmoothTerm
from paretoik.nlp.traced import Part, trace_rows
from paretoik.task.motion import Motion

Inputs = Callable[[list[Any], list[Any]], tuple[list[Any], Any]]
"""Of unknowns and parameters: the inputs of a term, and the interval that its values count for."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lanes:
    """Samples of a motion, or all of it: a term's ``inputs`` of the unknowns ``where`` of a program, and parameters."""

    where: Int[np.ndarray, "lanes unknowns"]
    parameters: Float[np.ndarray, "lanes parameters"]
    inputs: Inputs


LanesOf = Callable[[SmoothTerm, list[int]], list[Lanes]]
"""Of a term and the samples that it is wanted at: lanes for all of these, in order; one for a whole motion."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TermRows:
    """Terms of motions of so many ``samples``, their unknowns beyond the ``first`` of a program.

    ``intervals`` are the unknowns that stand for intervals, in units of ``pace`` [s]; none where times are fixed. Their
    mean is an unknown too where a term at one sample reads the duration.
    """

    terms: tuple[SmoothTerm, ...]
    samples: int
    first: int
    intervals: Int[np.ndarray, " intervals"]
    pace: float = 1.0

    @property
    def reads_duration(self) -> bool:
        """Whether there is an unknown for the mean interval: the first."""
        return any(term.reads_duration for term in self.terms)

    def lanes(self, term: SmoothTerm) -> list[int]:
        """Return the samples that a term's lanes stand for; the first has no interval to be summed."""
        return list(range(int(term.is_sum), self.samples if term.local else 1))

    @cached_property
    def places(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """The unknowns of every term: its tops, and its epigraph variables (lanes, variables)."""
        places, end = list[tuple[np.ndarray, np.ndarray]](), self.first + self.reads_duration
        for term in self.terms:
            lanes = len(self.lanes(term))
            tops, variables = lanes if term.is_sum else int(term.term.is_objective), len(term.units)
            numbers = end + np.arange(tops + lanes * variables)
            places.append((numbers[:tops], numbers[tops:].reshape(lanes, variables)))
            end += len(numbers)
        return places

    @property
    def unknowns(self) -> int:
        """Number of all unknowns, those of the program included."""
        return self.first + self.reads_duration + sum(a.size + b.size for a, b in self.places)

    @property
    def costs(self) -> Float[np.ndarray, "objectives unknowns"]:
        """The gradients of the objectives, minimised, in their own units."""
        objectives = [
            (one.term.factor, tops)
            for one, (tops, _) in zip(self.terms, self.places, strict=True)
            if one.term.is_objective
        ]
        costs = np.zeros((len(objectives), self.unknowns))
        for row, (factor, tops) in zip(costs, objectives, strict=True):
            row[tops] = 1.0 / abs(factor)
        return costs

    def values(self, motions: Motion) -> Float[np.ndarray, "points unknowns"]:
        """Return the unknowns beyond those of the program that belong to motions (points, time, dof)."""
        columns = [motions.duration[:, None] / (self.pace * len(self.intervals))] if self.reads_duration else []
        for term, (tops, _) in zip(self.terms, self.places, strict=True):
            values, variables = term.evaluate(motions)
            if term.is_sum:
                intervals = np.diff(motions.time)
                columns.append(values[:, 1:, 0] * intervals)
                variables = variables[:, 1:] * intervals[..., None] / self.pace
            elif len(tops):
                columns.append(values.max(axis=(1, 2))[:, None])
            columns.append(variables.reshape(len(motions), -1))
        return np.concatenate(columns, axis=1) if columns else np.zeros((len(motions), 0))

    def parts(self, lanes_of: LanesOf) -> tuple[Part, ...]:
        """Return the rows."""
        parts = [self._mean_interval()] if self.reads_duration else []
        for term, (tops, variables) in zip(self.terms, self.places, strict=True):
            samples, done = self.lanes(term), 0
            for lanes in lanes_of(term, samples):
                count = len(lanes.where)
                rows = slice(done, done + count)
                top = tops[rows, None] if term.is_sum else np.tile(tops, (count, 1))
                numbers = term.parameters[samples[rows]] if term.local else term.parameters
                mean = np.full((count, int(term.reads_duration)), self.first)
                parts.append(self._part(term, lanes, np.concatenate([variables[rows], mean, top], axis=1), numbers))
                done += count
            if term.is_sum and not term.term.is_objective:
                parts.append(_bounded_sum(tops, term.term.upper))
        return tuple(parts)

    def _part(self, term: SmoothTerm, lanes: Lanes, unknowns: np.ndarray, numbers: np.ndarray) -> Part:
        """Return the rows of a term in lanes, of its own ``unknowns``.

        These are epigraph variables, then the mean interval and a top where it has them.
        """
        size, width, end = lanes.where.shape[1], lanes.parameters.shape[1], lanes.where.shape[1] + len(term.units)
        has_top = unknowns.shape[1] > len(term.units) + term.reads_duration

        def rows(z: list[Any], p: list[Any]) -> tuple[list[Any], list[Any]]:
            inputs, interval = lanes.inputs(z[:size], p[:width])
            if term.local:
                inputs = [*inputs, z[end] * (self.pace * len(self.intervals)) if term.reads_duration else 1.0]
            share = interval * (1 / self.pace) if term.is_sum else 1.0
            values, ties = term.rows(inputs, p[width:], [variable / share for variable in z[size:end]])
            top, weight = z[-1] if has_top else term.term.upper, interval if term.is_sum else 1.0
            return [], [*(top - weight * value for value in values), *(share * tie for tie in ties)]

        where = np.concatenate([lanes.where, unknowns], axis=1)
        parameters = np.concatenate([lanes.parameters, numbers], axis=1)
        return Part(program=trace_rows(where.shape[1], parameters.shape[1], rows), where=where, parameters=parameters)

    def _mean_interval(self) -> Part:
        count = len(self.intervals)
        program = trace_rows(count + 1, 0, lambda z, _: ([z[-1] - sum(z[:-1], start=0.0) * (1 / count)], []))
        return Part(program=program, where=np.append(self.intervals, self.first)[None], parameters=np.zeros((1, 0)))


def _bounded_sum(tops: np.ndarray, upper: float) -> Part:
    program = trace_rows(len(tops), 0, lambda z, _: ([], [upper - sum(z, start=0.0)]))
    return Part(program=program, where=tops[None], parameters=np.zeros((1, 0)))
