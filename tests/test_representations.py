"""A user who types a name sees one screen of text, and the same in a notebook."""

from __future__ import annotations

from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest

import paretoik as pk
from problems import kim_2021, marcos_2012
from tests.api.problems import QUICK, tracking
from tests.closed_loop.postures import posture

ROBOTS = Path(__file__).parents[1] / "problems" / "robots"


@pytest.fixture(scope="module")
def items():
    problem = tracking(velocity=6.0)
    motions = problem.decode(problem.sample_starts(3, np.random.default_rng(0)))
    front = pk.Front(
        ids=np.arange(3), objectives=np.array([np.arange(3.0), -np.arange(3.0)]).T, names=["<f>", "g"],
        units=["J", ""], maximised=[False, False], motions=motions,
    )  # fmt: skip
    plan = pk.plan(tracking(pk.kinetic_energy), starts=1)
    loop = marcos_2012.loop(3, 0.7, start=posture(3), steps=5)
    choice = front.select(pk.Weights({"g": 1.0}))
    starts = pk.solve(tracking(), **QUICK, refine=False, observe=False)
    return {"front": front, "front of starts": starts, "choice": choice, "plan": plan, "motions": motions,
            "motion": motions[1], "tracking": problem, "loop": loop, "arm": problem.task.arm}  # fmt: skip


@pytest.fixture(scope="module")
def nouns(items, tmp_path_factory):
    """One of every public class, and of the objects that users get from those, by name; also large ones."""
    arm, path = items["arm"], pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=101)
    panda = pk.Arm.from_urdf(ROBOTS / "panda.urdf", base="panda_link0", tip="panda_hand_tcp")
    across = pk.line([0.45, -0.25, 0.3], [0.45, 0.25, 0.3], duration=1.5, samples=26)
    start, qp = items["motion"].q[0], pk.methods.ConstrainedQP()
    resolved = pk.resolve(arm, items["tracking"].task.tasks[0].path, qp, start=start, limits=pk.Limits(position=3.0))
    maxima, reach = kim_2021.directions_dam(), kim_2021.point_to_point_dam()
    polygon = pk.directional_maxima(maxima.arm, maxima.actuation, maxima.position, directions=8)
    search, trajectory = pk.Search(items["tracking"], population=200), tmp_path_factory.mktemp("out") / "trajectory.csv"
    certificates = pk.refine(items["front of starts"]).certificates
    return {
        **items,
        "panda": panda,
        "long limits": pk.Limits(position=np.ones((101, 7)), velocity=np.deg2rad([90.0, 120.0, 120.0])),
        "many joints": pk.Arm.planar(lengths=[0.1] * 40),
        "panda tracking": pk.Tracking(panda, across, objectives=[pk.kinetic_energy, pk.joint_limit_distance]),
        "panda task": pk.Tracking(panda, across, objectives=[pk.kinetic_energy]).task,
        "path": path,
        "pose": pk.Pose([0.1, 0.2, 0.3]),
        "poses": panda.pose(np.zeros((50, 7))),
        "task": pk.Task(across, axes="xyz"),
        "resolved": resolved,
        "traces": resolved.traces,
        "state": items["motions"].state(0.5),
        "optimum": items["plan"].best,
        "large plan": replace(items["plan"], optima=items["plan"].optima * 60),
        "certificates": certificates,
        "one certificate": certificates[[0]],
        "search": search,
        "candidates": search.ask(),
        "trajectory": pk.export(items["motion"], trajectory),
        "robot": pk.check_robot(ROBOTS / "panda.urdf", base="panda_link0", tip="panda_hand_tcp"),
        "directional maxima": maxima,
        "point to point": reach,
        "polygon": polygon,
        **vars_of_capability(arm, path),
        **{type(each).__name__: each for each in (*PREFERENCES, *OBSTACLES, *METHODS, *OTHERS)},
    }


def vars_of_capability(arm, path):
    """Models of speeds, results computed with them, and searches for a method's parameters and a posture."""
    places = np.array([[x, y] for x in np.linspace(0.0, 1.0, 6) for y in np.linspace(0.0, 1.0, 6)])
    angles = np.linspace(0.0, np.pi, 8, endpoint=False)
    directions, speeds = np.stack([np.cos(angles), np.sin(angles)], axis=1), np.ones((len(places), 8))
    model = pk.capability.fit_ellipsoids(places, directions, speeds)
    return {
        "ellipsoids": model,
        "axes": pk.capability.fit_axes(places, directions, speeds * (1.0 + 0.1 * np.cos(angles) ** 2)),
        "errors": pk.capability.fit_errors(model, places, directions, speeds),
        "fastest": pk.capability.fastest_path(model, [0.1, 0.1], [0.9, 0.8]),
        "control": pk.capability.time_optimal_control(model, [0.1, 0.1], [0.9, 0.8], period=0.05, gain=10.0),
        "controlled": pk.TimeOptimalControl(model, period=0.05),
        "tuning": pk.Tuning(arm, path, pk.methods.DampedLeastSquares()),
        "posture": pk.Posture(arm, path, link_radius=0.01),
        "control step": pk.ControlStep(arm, path, [0.0, 0.327, -0.754], longest_step=1.0),
    }


PREFERENCES = (
    pk.Weights(energy=0.3), pk.Knee(), pk.Compromise(), pk.Aspiration(energy=1.0), pk.Robust(energy=0.3),
    pk.Lexicographic("energy", "torque"), pk.Bounds(energy=(None, 1.0)), pk.Classify(3, improve=["a"], free=["b"]),
)  # fmt: skip
OBSTACLES = (
    pk.obstacles.Circle([0.3, 0.1], 0.05), pk.obstacles.Sphere([0.3, 0.1, 0.0], 0.05),
    pk.obstacles.Capsule([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.1), pk.obstacles.Box(pk.Pose([0.1, 0.2, 0.3]), [1, 1, 1]),
    pk.obstacles.HalfSpace([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], name="table"),
)  # fmt: skip
METHODS = tuple(
    kind() for kind in vars(pk.methods).values()
    if isinstance(kind, type) and issubclass(kind, pk.methods.Method) and kind.__module__.startswith("paretoik")
)  # fmt: skip
OTHERS = (
    pk.MaxiMin(), pk.MaxiMinNSGA2(pop_size=60), pk.capability.kim_joint_motors(), pk.capability.kim_sliders(),
    pk.capability.MotorCurve(stall=[1.0, 2.0], fastest=[3.0, 4.0]),
)  # fmt: skip


def public_classes():
    """The public classes whose objects users hold: neither errors nor protocols."""
    names = [(pk, name) for name in pk.__all__] + [(pk.capability, name) for name in pk.capability.__all__]
    kinds = {getattr(space, name) for space, name in names}
    return {
        kind for kind in kinds if isinstance(kind, type) and not issubclass(kind, Exception) and not is_protocol(kind)
    }


def is_protocol(kind):
    return getattr(kind, "_is_protocol", False)


def test_what_is_looked_at_here_is_every_public_noun(nouns):
    seen = {type(each) for each in nouns.values()}
    assert {kind.__name__ for kind in public_classes() - seen} == set()


def test_every_noun_fits_one_screen_at_the_prompt_and_in_print(nouns):
    for name, noun in nouns.items():
        for text in (repr(noun), str(noun)):
            lines = text.splitlines()
            assert len(lines) <= 25, (name, text)
            assert max(map(len, lines)) <= 120, (name, text)
            assert "object at 0x" not in text, (name, text)
            assert "array(" not in text, (name, text)


def test_a_notebook_shows_the_text_of_every_noun_as_text(nouns):
    for name, noun in nouns.items():
        head, _, text = noun._repr_html_().partition(">")
        assert head.startswith("<pre "), name
        assert "<" not in text.removesuffix("</pre>"), name  # neither scripts nor names that look like HTML
        assert unescape(text.removesuffix("</pre>")) == repr(noun), name


def test_a_name_that_looks_like_html_stays_text(nouns):
    for preference in (pk.Weights({"<script>": 0.3}), pk.Lexicographic("<b>", "&amp;"), pk.Aspiration({"<i>": 1.0})):
        html = preference._repr_html_()
        assert unescape(html).count("<") > html.count("<") == 2, html


def test_the_numbers_of_a_motion_are_its_own(items):
    motion = items["motion"]
    line = next(line.split() for line in repr(motion).splitlines() if line.startswith("joint2"))
    numbers = (motion.q[:, 1].min(), motion.q[:, 1].max(), np.abs(motion.dq[:, 1]).max())
    assert line == ["joint2", "rad", *(f"{number:.4g}" for number in numbers)]
