"""A report is one page that contains the front, loads nothing, and trusts no text."""

from __future__ import annotations

import base64
import gzip
import hashlib
import re
from dataclasses import replace

import numpy as np
import pytest

import paretoik as pk
from paretoik.front.choice_tree import Choices, KeptChoice
from paretoik.front.front import Front
from paretoik.front.points import StoredJoints, StoredMotions
from paretoik.front.preferences.knee_and_compromise import compromise
from paretoik.review.report import Report, ReportMotions, ReportOptions, Steps
from tests.review.page_reading import Page, unpacked
from tests.review.pictures.test_certificates import certified

HOSTILE = "</script><script>alert(1)</script>"


@pytest.fixture(scope="module")
def problem():
    path = pk.line([0.4678, 0.0], [0.0983, 0.1526], duration=1.0, samples=25)
    limits = pk.Limits(velocity=np.linspace(3.0, 5.0, 75).reshape(25, 3), torque=2.0)
    obstacle = pk.obstacles.Circle([0.3, 0.3], 0.05)
    return pk.Tracking(
        pk.arms.tringali_3r(), path, objectives=[pk.kinetic_energy, pk.torque_norm], limits=limits,
        obstacles=[obstacle], link_radius=0.01, bases=2,
    )  # fmt: skip


@pytest.fixture(scope="module")
def front(problem):
    motions = problem.decode(problem.sample_starts(9, np.random.default_rng(0)))
    return Front(
        ids=np.arange(9) * 7, objectives=np.array([np.arange(9.0), -np.arange(9.0) ** 0.5]).T, names=problem.names,
        units=problem.units, maximised=[False, False], motions=motions, problem=problem,
        provenance={"settings": {"seed": 3, "name": "<b>"}, "versions": {"numpy": "2"}, "status": "generations"},
    )  # fmt: skip


def page(front: Front, **parts) -> Page:
    return Page(Report(front=front, title="a front", **parts).page())


def kept(reason: str, *points: int) -> Choices:
    """Return choices of these points; the last is the present one."""
    entries = [
        KeptChoice(
            id=place, parent=place - 1 or None, point=point, preference={"text": reason}, objectives={}, reason=reason,
            time="2026-01-01T00:00:00+00:00",
        )
        for place, point in enumerate(points, 1)
    ]  # fmt: skip
    return Choices(entries=tuple(entries), current=len(entries))


def test_a_page_loads_nothing(front):
    text = Report(front=front, title="a front").page()
    links = [
        (tag, name, value)
        for tag, attributes, _ in Page(text).elements
        for name, value in attributes.items()
        if name in ("src", "href", "srcset", "action", "data", "poster", "background")
    ]
    assert links == [("link", "href", "data:,")]
    assert set(re.findall(r"https?://[^\s\"'`]+", text)) == {"http://www.w3.org/2000/svg"}  # a name, not a place
    assert not re.search(r"@import|url\(|\bfetch\(|XMLHttpRequest|WebSocket|EventSource|sendBeacon|import\(", text)


def test_a_page_allows_its_own_scripts_and_no_network(front):
    read = page(front)
    (policy,) = [values["content"] or "" for tag, values, _ in read.elements if "http-equiv" in values]
    rules = dict(rule.split(maxsplit=1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    assert "connect-src" not in rules
    (bundle,) = read.texts("script", id="bundle")
    scripts = [text for tag, values, parts in read.elements if tag == "script" and not values for text in parts]
    plotly = gzip.decompress(base64.b64decode(bundle)).decode()
    digests = {base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in (*scripts, plotly)}
    assert set(rules["script-src"].split()) == {f"'sha256-{digest}'" for digest in digests}
    assert "plotly.js v" in plotly[:200]


def test_the_same_run_makes_the_same_page(front):
    assert Report(front=front, title="t").page() == Report(front=replace(front), title="t").page()


@pytest.mark.parametrize("n_obj", [1, 2, 3, 5])
def test_the_table_and_the_data_are_those_of_the_front(n_obj, make_front):
    front = certified(make_front(n_obj, points=14), ["minimum", "saddle"])
    read = page(front)
    assert read.data["ids"] == front.ids.tolist() == list(read.table)
    np.testing.assert_array_equal(read.data["values"], front.objectives)
    for row, cells in enumerate(read.table.values()):
        np.testing.assert_allclose(np.array(cells[:n_obj], dtype=float), front.objectives[row], rtol=1e-5)
        between = front.certificates.violation_between[row]
        assert cells[n_obj : n_obj + 3][1] == f"{between:.1e}"
        assert cells[n_obj + 3] == front.certificates.status[row]
    rates = np.array(read.data["rates"], dtype=float)  # None is NaN
    np.testing.assert_allclose(rates, front.certificates.exchange_intervals, rtol=1e-4)


def test_text_stays_text(front):
    hostile = replace(
        front, names=[HOSTILE, "<img src=x onerror=alert(1)>"], units=["<u>", "&amp;"], ranges=front.ranges,
        provenance={HOSTILE: HOSTILE, "settings": {"x": "<script>"}}, problem=None,
    )  # fmt: skip
    plain, read = page(front, choices=kept("r", 14)), page(hostile, choices=kept(HOSTILE, 14), notes=[HOSTILE])
    tags = [[tag for tag, _, _ in each.elements if tag in ("script", "img", "u", "b")] for each in (plain, read)]
    assert tags[0] == tags[1]
    assert f"{HOSTILE} [<u>]" in [text.strip() for text in read.texts("th")]
    assert read.data["objectives"][0]["name"] == HOSTILE
    assert HOSTILE in read.texts("p")
    assert HOSTILE in read.texts("p", **{"class": "reason"})


def test_kept_choices_are_listed_and_marked(front):
    read = page(front, choices=kept("because", 14, 21))
    assert read.data["marks"]["21"].startswith("chosen")
    assert "once" not in read.data["marks"]["21"]
    assert read.data["marks"]["14"].startswith("chosen before")
    assert read.data["start"] == 21
    assert read.texts("p", **{"class": "reason"})[:2] == ["because", "because"]
    assert "the present choice" in read.texts("span", **{"class": "mark"})


def test_blocks_unpack_to_their_motions(front):
    read = page(front)
    description, blocks = read.data["motions"], read.data["blocks"]
    assert list(map(int, blocks)) == front.ids.tolist()
    motions = front.motions
    parts = (motions.time[..., None], motions.q, motions.dq, motions.ddq, motions.torque, motions.power)
    nodes = motions.links[..., :2].reshape(*motions.q.shape[:2], -1)
    channels = np.moveaxis(np.concatenate([*parts, nodes], axis=-1), -1, 1)
    allowed = 0.51 * np.ptp(channels, axis=(0, 2)) / 65535 + 1e-9 * np.abs(channels).max(axis=(0, 2))
    for row, number in enumerate(front.ids):
        deviation = np.abs(unpacked(description, blocks[str(number)]) - channels[row])
        assert (deviation <= allowed[:, None]).all()


def test_limits_obstacles_and_path_are_those_of_the_problem(front, problem):
    described = page(front).data["motions"]
    bounds = problem.task.bounds
    assert described["limits"].keys() == bounds.keys()
    np.testing.assert_allclose(described["limits"]["velocity"]["upper"], bounds["velocity"][..., 1].T, rtol=1e-5)
    np.testing.assert_allclose(described["limits"]["velocity"]["times"], problem.task.times, rtol=1e-5)
    assert described["limits"]["torque"]["upper"] == [[2.0]] * 3
    assert described["limits"]["torque"]["times"] is None
    (obstacle,) = described["arm"]["obstacles"]
    np.testing.assert_allclose(np.linalg.norm(np.array(obstacle) - [0.3, 0.3], axis=1), 0.05, rtol=1e-3)
    np.testing.assert_allclose(described["arm"]["paths"][0], problem.task.tasks[0].path.positions, atol=1e-5)
    assert described["arm"]["radius"] == 0.01
    assert [each["name"] for each in described["quantities"]] == [
        "position", "velocity", "acceleration", "torque", "power",
    ]  # fmt: skip


def test_motions_without_space_are_left_out_with_a_note(front):
    whole = Report(front=front, title="t").page()
    size = len(whole.encode()) - 2_500
    text = Report(front=front, title="t", options=ReportOptions(size=size)).page()
    assert len(text.encode()) <= size
    read = Page(text)
    kept = set(map(int, read.data["blocks"]))
    assert 2 <= len(kept) < len(front)
    assert {0, 56, int(compromise(front).id)} <= kept  # ends and compromise first
    (told,) = read.texts("p", id="left-out")
    count, ids = re.fullmatch(r".*motions of (\d+) points.*:\s(.*)\.", told, re.DOTALL).groups()
    assert {int(word) for word in ids.split(",")} == set(front.ids.tolist()) - kept
    assert int(count) == len(front) - len(kept)


def long_front(problem, *, count: int, samples: int) -> Front:
    """Return ``count`` points with motions of noise, which compresses badly."""
    motions = problem.decode(problem.sample_starts(3, np.random.default_rng(1)))
    rows, places = np.resize(np.arange(3), count), np.linspace(0.0, 1.0, count)
    noise = np.random.default_rng(0).normal(size=(count, samples, 3))
    return Front(
        ids=np.arange(count) + 100_000, objectives=np.array([places, -places]).T, names=("a", "b"), units=("", ""),
        maximised=(False, False),
        motions=replace(
            motions[rows], time=np.linspace(0.0, 9.0, samples), tasks=(), q=motions.q[rows][:, :1] + noise
        ),
    )  # fmt: skip


def test_an_empty_front_says_so(make_front):
    assert "No feasible point." in page(make_front(2, points=0, moving=False)).texts("p")


def test_motions_without_their_arm_are_positions(make_front):
    front = make_front(2)
    joints = StoredJoints(joint_names=front.motions.arm.joint_names)
    stored = StoredMotions(arm=joints, time=front.motions.time, q=front.motions.q)
    described = page(replace(front, motions=stored)).data["motions"]
    assert [each["name"] for each in described["quantities"]] == ["position"]
    assert "arm" not in described


def test_the_steps_of_a_loop_are_in_the_data(make_front):
    rng = np.random.default_rng(0)
    steps = Steps(times=np.arange(5.0), chosen=rng.uniform(size=(5, 2)), best=np.zeros((5, 2)), worst=np.ones((5, 2)))
    read = page(make_front(2, points=1), steps=steps)
    np.testing.assert_allclose(read.data["steps"]["chosen"], steps.chosen, rtol=1e-4)


def test_directions_of_a_postures_front_are_arrows(front):
    class Directed:
        directions = np.array([[1.0, 0.0], [0.0, 1.0]])

    described = ReportMotions(front=replace(front, problem=Directed())).description()
    assert [(each["axis"], each["along"]) for each in described["arm"]["arrows"]] == [(0, [1.0, 0.0]), (1, [0.0, 1.0])]


def test_thousands_of_points_fit_into_five_megabytes_with_the_list_of_what_is_left_out(problem):
    front = long_front(problem, count=2100, samples=101)
    text = Report(front=front, title="t").page()
    assert 4_900_000 < len(text.encode()) <= 5_000_000
    read = Page(text)
    (told,) = read.texts("p", id="left-out")
    assert len(read.table) == 2000
    assert set(map(int, re.findall(r"\d{6}", told))) == set(read.table) - set(map(int, read.data["blocks"]))


def test_a_page_without_space_for_its_table_has_fewer_points_and_says_so(make_front):
    front = make_front(3, points=200, moving=False)
    size = len(Report(front=front, title="t").page().encode()) - 10_000
    text = Report(front=front, title="t", options=ReportOptions(size=size)).page()
    assert len(text.encode()) <= size
    assert len(Page(text).table) == 100
    assert any(words.startswith("100 more points") for words in Page(text).texts("p"))
