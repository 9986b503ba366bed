"""What a user sees who types a name: one screen of text, and the same in a notebook."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from problems import marcos_2012
from tests.api.problems import tracking
from tests.closed_loop.postures import posture


@pytest.fixture(scope="module")
def items():
    problem = tracking(velocity=6.0)
    motions = problem.decode(problem.sample_starts(3, np.random.default_rng(0)))
    front = pk.Front(
        ids=np.arange(3), objectives=np.array([np.arange(3.0), -np.arange(3.0)]).T, names=["<f>", "g"],
        units=["J", ""], maximised=[False, False], motions=motions,
    )  # fmt: skip
    plan = pk.plan(tracking(pk.kinetic_energy), starts=4)
    loop = marcos_2012.loop(3, 0.7, start=posture(3), steps=5)
    choice = front.select(pk.Weights({"g": 1.0}))
    return {"front": front, "choice": choice, "plan": plan, "motions": motions, "motion": motions[1],
            "tracking": problem, "loop": loop, "arm": problem.task.arm}  # fmt: skip


SAID = {
    "front": ("3 points", "<f> 0 to 2 J"),
    "choice": ("point 2",),
    "plan": ("Plan of", "objective", ".best.motion"),
    "motions": ("motions 3", "21 samples", "joint3", "rad", "1 s"),
    "motion": ("one motion", "21 samples", "joint3"),
    "tracking": ("kinetic_energy [J s]", "velocity", "pk.solve", "genes"),
    "loop": ("joint_displacement 50%", "5", "pk.solve"),
    "arm": ("joint1, joint2, joint3",),
}


@pytest.mark.parametrize("name", SAID)
def test_each_fits_one_screen_and_says_what_it_is(items, name):
    text = repr(items[name])
    assert all(words in text for words in SAID[name]), text
    assert len(text.splitlines()) <= 24
    assert max(map(len, text.splitlines())) <= 400
    assert "array(" not in text


@pytest.mark.parametrize("name", SAID)
def test_a_notebook_shows_the_same_without_scripts(items, name):
    html = items[name]._repr_html_()
    assert "<script" not in html
    assert "<f>" not in html
    if name == "front":
        assert "&lt;f&gt; 0 to 2 J" in html


def test_the_numbers_of_a_motion_are_its_own(items):
    motion = items["motion"]
    line = next(line.split() for line in repr(motion).splitlines() if line.startswith("joint2"))
    numbers = (motion.q[:, 1].min(), motion.q[:, 1].max(), np.abs(motion.dq[:, 1]).max())
    assert line == ["joint2", "rad", *(f"{number:.4g}" for number in numbers)]
