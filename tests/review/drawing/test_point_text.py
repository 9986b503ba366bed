"""The texts next to a picture: whole words, units, and a reason if there is nothing to see."""

from __future__ import annotations

import numpy as np
import pytest

from paretoik.front.certificates import Certificates
from paretoik.front.front import Front
from paretoik.review.drawing.point_text import point_text, step_text, text_of
from paretoik.review.drawing.search_drawing import search_charts
from paretoik.review.recording.messages import RecordedPoint
from paretoik.review.recording.recorder import Generation, SearchedFront
from paretoik.review.words import run_text


def scene(timeline: str = "generation") -> SearchedFront:
    return SearchedFront(names=("energy", "reach"), units=("J s", ""), maximised=(False, True), timeline=timeline)


def generation(front: list[list[float]], **more) -> Generation:
    F = np.array(front, dtype=float).reshape(-1, 2)
    population = np.array([[1.0, 2.0], [2.0, 3.0], [4.0, 5.0]])
    return Generation(number=3, population=population, front=F, front_ids=np.arange(len(F)), **more)


def test_an_empty_front_says_why_it_is_empty():
    words = text_of(scene(), generation([]))
    assert "0 points on the front." in words
    assert "None of the 3 individuals satisfies all limits and constraints of the problem" in words
    assert "satisfies all limits" not in text_of(scene(), generation([[1.0, 2.0]]))


@pytest.mark.parametrize("timeline", ["generation", "step"])
def test_one_point_is_counted_in_the_singular(timeline):
    chosen = np.array([1.0, 2.0]) if timeline == "step" else None
    words = (step_text if chosen is not None else text_of)(scene(timeline), generation([[1.0, 2.0]], chosen=chosen))
    assert "1 point on " in words
    assert "1 points" not in words


def test_numbers_of_a_generation_have_their_units():
    point = RecordedPoint(id=0, objectives=np.array([1.5, 2.0]))
    both = generation([[1.0, 2.0], [2.0, 3.0]], hypervolume=0.5, points=(point,))
    words = text_of(scene(), both)
    assert "hypervolume 0.5\u00a0J\u00a0s." in words  # no line ends within a unit
    assert "best 1\u00a0J\u00a0s, compromise 1.5\u00a0J\u00a0s" in words
    assert "**reach [1]**: best 3, compromise 2" in words  # a quantity without a unit is marked once
    titles = [chart.labels[1] for chart in search_charts(scene(), [both])]
    assert titles[0] == "hypervolume [J s]"
    assert titles[2] == "best reach [1] ↑"


def certified() -> Front:
    """Return a front of objectives with and without a unit, each point with exchange rates."""
    rates = np.array([[[-1.0, -0.003096], [-323.0, -1.0]]] * 2)
    return Front(
        ids=np.arange(2),
        objectives=np.array([[1.0, 3.0], [2.0, 2.0]]),
        names=("energy", "distance"),
        units=("J s", ""),
        maximised=(False, False),
        certificates=Certificates(
            violation=np.zeros(2),
            violation_between=np.zeros(2),
            criticality=np.zeros(2),
            weights=np.full((2, 2), 0.5),
            exchange_rates=rates,
            exchange_intervals=np.full((2, 2, 2, 2), np.nan),
            status=np.array(["minimum", "minimum"]),
        ),
    )


def test_a_quantity_without_a_unit_is_a_number_in_rates_and_steps():
    words = point_text(certified(), 0, chosen=None).replace("\u00a0", " ")
    assert "- 1 J s more of energy: -0.003096 of distance [1]\n" in words
    assert "- 1 more of distance [1]: -323 J s of energy" in words
    step = generation([[1.0, 2.0], [2.0, 3.0]], chosen=np.array([1.0, 2.0]))
    assert "**reach**: chosen 2; front: 2 to 3" in step_text(scene("step"), step)
    assert "  " not in words + step_text(scene("step"), step)


def test_a_run_is_told_in_words():
    settings, counts = (
        {"refine": False, "solver": "auto"},
        {"starts": 1, "optima": 2, "converged": 1, "seconds": 1.6678},
    )
    words = run_text({"status": "optima", "settings": settings, "counts": counts})
    assert "- ended: all starts were tried" in words
    assert "- refine: no" in words
    assert "solver" not in words  # nothing was solved
    assert "- took 1 start, 2 optima, 1.668 s" in words
    assert "- 1 point converged" in words
    assert "- took 14 bounds ε" in run_text({"counts": {"levels": 14}})
    assert "- points of the front, at most: 200" in run_text({"settings": {"population": 60, "points": 200}})
    assert "- points of the front: 12" in run_text({"settings": {"points": 12}})
    assert "- starts per redundant degree: 2" in run_text({"settings": {"starts": 2}, "counts": {"optima": 11}})
    assert "- ended: interrupted" in run_text({"status": "interrupted"})


def test_individuals_that_dominate_the_front_are_said_to_break_a_limit():
    words = text_of(scene(), generation([[2.0, 3.0]]))  # [1, 2] and [4, 5] do not dominate: more reach is better
    assert "look" not in words
    words = text_of(scene(), generation([[2.0, 2.0]]))
    assert "2 individuals look better than the front and break a limit or a constraint." in words
    assert "look" not in text_of(scene("level"), generation([[2.0, 2.0]]))
