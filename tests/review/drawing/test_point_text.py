"""The texts next to a picture: whole words, units, and a reason if there is nothing to see."""

from __future__ import annotations

import numpy as np

from paretoik.review.drawing.point_text import text_of
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
