"""Pictures of fronts and comparisons."""

from __future__ import annotations

import io
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

import paretoik as pk
from paretoik.errors import InvalidInput
from paretoik.front.comparison import Comparison
from paretoik.front.front import Front
from paretoik.front.preferences import Weights
from paretoik.review.pictures.certificates import certificates_picture
from paretoik.review.pictures.fronts import (
    comparison_picture,
    front_picture,
    highlighted,
    stroboscopic,
)
from tests.review.pictures.test_certificates import certified


@pytest.mark.parametrize(
    ("n_obj", "planar", "moving"),
    [(1, True, False), (2, False, True), (3, True, True), (5, False, False)],
)
def test_every_front_gets_a_small_picture_with_content(n_obj, planar, moving, tmp_path, make_front):
    front = make_front(n_obj, points=30, planar=planar, moving=moving)
    file = tmp_path / "front.png"
    front_picture(front, file, front.select(Weights({front.names[0]: 1.0})))
    assert file.stat().st_size < 150_000
    with Image.open(file) as picture:
        pixels = np.asarray(picture.convert("L"))
    assert min(pixels.shape) > 300
    assert 0.005 < (pixels < 128).mean() < 0.5


def test_an_empty_front_gets_a_picture_that_says_so(tmp_path, make_front):
    front_picture(make_front(2, points=0), tmp_path / "front.png")
    assert (tmp_path / "front.png").stat().st_size > 1000


def test_the_extremes_and_the_choice_are_shown(make_front):
    front = make_front(2)
    choice = front.select(Weights({front.names[0]: 1.0, front.names[1]: 1.0}))
    shown = {point.index: point.reason for point in highlighted(front, choice)}
    assert shown == {0: "best kinetic_energy", choice.index: "chosen", len(front) - 1: "best torque_norm"}


def test_a_place_that_cannot_be_written_is_refused(tmp_path, make_front):
    (tmp_path / "taken").touch()
    with pytest.raises(InvalidInput, match=r"must be writable, got (File exists|Not a directory)"):
        front_picture(make_front(2, moving=False), tmp_path / "taken" / "front.png")


@pytest.fixture
def blank(monkeypatch):
    """Save blank pictures, for tests that only need the calls: drawing takes a second."""
    one = io.BytesIO()
    Image.new("RGB", (1, 1)).save(one, format="png")
    monkeypatch.setattr(Figure, "savefig", lambda figure, file, **_: file.write(one.getvalue()))


@pytest.mark.usefixtures("blank")
def test_pictures_say_which_limit_is_exceeded_between_samples_and_when(tmp_path, monkeypatch):
    path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=13)
    arm, objectives = pk.arms.tringali_3r(), [pk.kinetic_energy, pk.torque_norm]
    words = []
    monkeypatch.setattr(Figure, "supxlabel", lambda figure, text, **style: words.append(" ".join(text.split())))
    for limit, said in ((np.inf, 0), (1.0, 2)):
        problem = pk.Tracking(
            arm, path, objectives=objectives, limits=pk.Limits(velocity=limit), differences="central", bases=1
        )
        motions = problem.decode(problem.sample_starts(3, np.random.default_rng(0)))
        values = np.array([np.arange(3.0), -np.arange(3.0)]).T
        front = Front(
            ids=np.arange(3), objectives=values, names=problem.names, units=problem.units, maximised=[False, False],
            motions=motions, problem=problem,
        )  # fmt: skip
        front_picture(front, tmp_path / "front.png")
        certificates_picture(certified(front, ["minimum"]), tmp_path / "certificates.png")
        assert len(words) == said
    assert all("velocity of joint" in each and " s)" in each and "help" in each for each in words)


@pytest.mark.usefixtures("blank")
def test_jumps_are_drawn_apart_from_branches(tmp_path, monkeypatch, make_front):
    drawn = []
    plot = Axes.plot

    def record(axes, *values, **style):
        drawn.append((np.size(values[0]), style.get("linestyle", "-"), style.get("label")))
        return plot(axes, *values, **style)

    monkeypatch.setattr(Axes, "plot", record)
    front = certified(make_front(2, points=9, moving=False), ["minimum"])

    def high(jumping):
        """Return barriers in the gaps of these rows."""
        rows = np.isin(np.arange(8), jumping)[:, None, None]
        return SimpleNamespace(values_between=lambda front, shares: np.where(rows, np.inf, front.minimised[:-1, None]))

    for jumping, branches in (([], [9]), ([3], [4, 5]), ([0, 3], [1, 3, 5])):
        drawn.clear()
        front_picture(replace(front, problem=high(jumping)), tmp_path / "front.png")
        assert [size for size, line, _ in drawn[1:] if line == "-"][: len(branches)] == branches
        assert [size for size, line, _ in drawn if line == ":"] == [2] * len(jumping)
        assert [text for _, _, text in drawn if text] == ["jump"] * bool(jumping)
        drawn.clear()
        certificates_picture(replace(front, problem=high(jumping)), tmp_path / "certificates.png")
        assert sum(size == 2 and line == ":" for size, line, _ in drawn) == len(jumping)


@pytest.mark.parametrize("planar", [True, False])
def test_every_obstacle_is_in_the_picture_of_a_motion(planar, make_front):
    motion = make_front(2, points=2, planar=planar).motions[0]
    ball = pk.obstacles.Sphere([0.5, 0.5, 0.2], 0.3)
    figure = Figure()
    FigureCanvasAgg(figure)
    axes = figure.subplots(subplot_kw={} if planar else {"projection": "3d"})
    stroboscopic(axes, replace(motion, obstacles=(ball,)))
    if planar:
        (patch,) = axes.patches
        reached = patch.get_xy()
        np.testing.assert_allclose(np.ptp(reached, axis=0), 2 * np.sqrt(0.3**2 - 0.2**2), rtol=0.01)
    else:
        reached = np.concatenate([np.stack(line.get_data_3d(), axis=1) for line in axes.lines[:3]])
        np.testing.assert_allclose(np.ptp(reached, axis=0), 0.6, rtol=0.01)


@pytest.mark.parametrize("n_obj", [1, 2, 3, 5])
def test_every_comparison_gets_a_small_picture_with_content(n_obj, tmp_path, make_front):
    front = make_front(n_obj, points=20, moving=False)
    shifted = replace(front, objectives=front.objectives * 1.1, ranges=front.ranges)
    comparison = Comparison(fronts=(front, shifted, front), labels=("$a$", "$a$", "b"))
    file = tmp_path / "fronts.png"
    comparison_picture(comparison, file)
    assert file.stat().st_size < 150_000
    with Image.open(file) as picture:
        pixels = np.asarray(picture.convert("L"))
    assert 0.003 < (pixels < 200).mean() < 0.5
