"""Moves along a front: requests that are refused before any work, and the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from paretoik.errors import Infeasible, InvalidInput
from paretoik.front.certificates import concatenate
from paretoik.front.front import Front
from tests.front.random_fronts import minima

NAMES = ("energy", "torque", "travel")


class NeverMoved:
    """A problem that must not be asked."""

    def navigate(self, front, request):
        raise AssertionError("the problem must not be asked")

    predict = navigate


def certified(residual=0.0, weights=None):
    weights = np.full((3, 3), 1 / 3) if weights is None else np.asarray(weights)
    return minima(weights, -np.ones((3, 3, 3)), np.asarray(residual))


def front(**parts):
    defaults = {
        "ids": np.array([4, 7, 9]),
        "objectives": np.array([[1.0, 3.0, 0.2], [2.0, 2.0, 0.1], [3.0, 1.0, 0.3]]),
        "names": NAMES,
        "units": ("J", "N m", "rad"),
        "maximised": (False,) * 3,
        "certificates": certified(),
        "problem": NeverMoved(),
    }
    return Front(**{**defaults, **parts})


@pytest.mark.parametrize(
    ("wish", "words"),
    [
        ({"choice": 5}, "navigate: ids must be those of the front's points (3 from 4 to 9), got 5"),
        ({"improve": "time"}, "names among energy, torque, travel, got 'time'"),
        ({"allow": "energy"}, "other than the one to improve, got energy"),
        ({"allow": "torque", "hold": "torque"}, "not in hold, got torque"),
        ({"by": np.nan}, "by: must be finite"),
        ({"by": 0.1, "to": 1.0}, "by= or to=, got both"),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_an_invalid_request_is_refused_in_one_line_also_as_a_prediction(wish, words):
    wish = {"choice": 7, "improve": "energy", **wish}
    choice, messages = wish.pop("choice"), {}
    for verb in ("navigate", "predict"):
        with pytest.raises(InvalidInput) as caught:
            getattr(front(), verb)(choice, **wish)
        messages[verb] = str(caught.value)
    assert words in messages["navigate"]
    assert "\n" not in messages["navigate"]
    assert messages["predict"] == messages["navigate"].replace("navigate:", "predict:")


def test_a_front_without_moves_is_refused_in_one_line():
    for parts, words in (
        ({"certificates": None}, "the front must have certificates, as from refine(front)"),
        ({"problem": None}, "the front must have its problem, got none"),
        ({"problem": object()}, "the problem must have gradients, such as Tracking, got object"),
        ({"certificates": certified(residual=1e-3)}, "the point must be critical, got point 7 of criticality 1.0e-03"),
        (
            {"certificates": certified(residual=[0.0, 2e-6, 1e-9])},
            "point 7 of criticality 2.0e-06: critical points are 4, 9",
        ),
        ({"certificates": certified(residual=np.nan)}, "the point must be critical, got point 7 of criticality nan"),
    ):
        for move in (
            lambda one: one.navigate(7, improve="energy"),
            lambda one: one.predict(7, improve="energy"),
            lambda one: one.refine_around(7),
        ):
            with pytest.raises(InvalidInput) as caught:
                move(front(**parts))
            assert words in str(caught.value)


def test_a_point_that_a_move_led_to_says_how_whenever_it_is_named():
    one = front()
    assert one.navigated is None
    assert one[9].verdict == "Point 9 was picked by its id."
    moves = [{"to": 9, "reason": "From 7 to 9."}, {"to": 4, "reason": "From 9 to 4."}]
    moved = replace(one, provenance={"navigations": moves})
    assert [point.verdict for point in moved] == ["From 9 to 4.", "Point 7 was picked by its id.", "From 7 to 9."]
    assert moved.navigated.reason == moved[4].reason
    assert moved.navigated.reason.startswith("- From 9 to 4.\n- It has energy 1 J")


def test_the_problem_gets_the_request():
    class Asked:
        def navigate(self, front, request):
            self.request = request
            return front

    problem = Asked()
    one = front(problem=problem, maximised=(False, False, True), objectives=front().objectives * [1, 1, -1])
    one.navigate(one[7], improve="torque", to=1.75, hold="travel")
    assert (problem.request.row, problem.request.improve, problem.request.payers) == (1, 1, (0,))
    assert problem.request.by == pytest.approx(0.25)
    one.navigate(7, improve="energy")
    assert problem.request.by == pytest.approx(0.05 * 2.0)
    assert problem.request.payers == (1, 2)
    one.navigate(9, improve="travel", by=0.01, allow=["energy"])
    assert problem.request.payers == (0,)
    near = replace(one, ranges=np.array([[0.0, 100.0], [0.0, 100.0], [-1.0, 1.0]]))
    near.navigate(7, improve="energy")
    assert problem.request.by == pytest.approx(0.5)  # half of the remaining gain


def test_a_share_that_leads_nowhere_costs_no_point_that_was_found():
    class OneInThreeIsInfeasible:
        asked = 0

        def navigate(self, front, request):
            self.asked += 1
            if self.asked % 3 == 0:
                raise Infeasible("navigate: found no point")
            new = front.objectives[request.row] + np.where(np.arange(3) == request.improve, -request.by, request.by)
            return replace(
                front,
                ids=np.append(front.ids, front.ids.max() + 1),
                objectives=np.vstack([front.objectives, new]),
                certificates=concatenate([front.certificates, front.certificates[:1]]),
            )

    problem = OneInThreeIsInfeasible()
    denser = front(problem=problem).refine_around(7, points=4)
    assert problem.asked == 4
    assert len(denser) == 3 + 3
