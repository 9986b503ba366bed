"""The recordings of plans, ε-fronts and refinements contain everything that a picture needs, at every instant."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.review.drawing.choice_layer import RecordedRun, recording_with_choice
from tests.review.reading import (
    FRAME,
    SECOND,
    blank_views,
    last_text,
    missing_entities,
    read,
    rows,
    shown,
    static_words,
    views,
)


def arm() -> pk.Arm:
    return pk.Arm.planar(lengths=[0.3, 0.3, 0.25], masses=[1, 1, 0.8], centers=[0.15] * 3, inertias=[0.01] * 3)


def problem(*objectives, samples: int = 26) -> pk.Tracking:
    return pk.Tracking(
        arm(),
        pk.line([0.6, -0.1], [0.4, 0.4], duration=1.0, samples=samples),
        objectives=list(objectives),
        limits=pk.Limits(position=2.5, velocity=4.0),
        obstacles=[pk.obstacles.Circle([0.75, 0.45], 0.05)],
        link_radius=0.01,
    )


ARM = [f"/arm/{part}" for part in ("axes/grid", "axes/labels", "base", "target", "obstacles", "chosen/links")]
ARM += [f"/arm/chosen/{part}" for part in ("path", "ghosts", "body", "joints")]
CHARTS = [
    f"/joint_charts/{kind}/{part}" for kind in ("position", "velocity", "torque") for part in ("curves", "cursor")
]
LIMITS = [f"/joint_charts/{kind}" for kind in ("position", "velocity")]


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan")
    tried = list[int]()

    def note(progress) -> None:
        if progress.stage == "sample":
            tried.append(int(progress.summary.split()[0]))

    found = pk.plan(problem(pk.kinetic_energy, samples=51), starts=4, out=folder, observe=note)
    return found, tried, folder / "review.rrd"


PLAN_INSTANTS = {
    "level": (0, 1, 2),
    "start": (1, 4, 6),
    "motion": (0, SECOND // 2, SECOND),
    "replay": (0, SECOND, 3 * SECOND),
}


def test_no_view_of_a_plan_is_blank_at_any_instant(plan):
    assert not blank_views(plan[2], PLAN_INSTANTS)


def test_a_plan_has_all_entities_at_every_instant(plan):
    panel = [f"/objective/{part}" for part in ("grid", "labels", "levels/names", "starts", "ends", "best", "final")]
    charts = [f"/charts/{chart}/{part}" for chart in ("best", "distinct") for part in ("curves", "cursor")]
    wanted = ["/legend/words", "/text", *ARM, *CHARTS, *panel, *charts]
    assert not missing_entities(plan[2], wanted, PLAN_INSTANTS)
    assert not missing_entities(plan[2], ["/arm/start/links", "/objective/cursor"], {"start": PLAN_INSTANTS["start"]})
    entities = read(plan[2])
    for chart in LIMITS:
        assert f"{chart}/limits" in entities or f"{chart}/limits_beyond" in entities
    assert static_words(entities["/objective/labels"])[-1] == "kinetic_energy [J s]"
    assert {
        "● start",
        "● best of a level or of the plan",
        "● optimum looked at",
        "● obstacle",
        "● limits: dashed",
    } <= set(static_words(entities["/legend/words"]))


def test_a_plan_ends_on_its_optima_and_its_best_moves(plan):
    found, _, file = plan
    entities = read(file)
    optima = rows(entities["/search/optima"], "level", "objective")
    np.testing.assert_array_equal(optima[max(optima)], [each.objective for each in found.optima])
    time = found.best.motion.time
    for kind, name in (("position", "q"), ("velocity", "dq")):
        series = rows(entities[f"/joints/{kind}"], "motion", "scalars")
        assert sorted(series) == np.round(time * SECOND).astype(int).tolist()
        np.testing.assert_array_equal(np.stack([series[at] for at in sorted(series)]), getattr(found.best.motion, name))
    words = last_text(entities["/text"], "level", 9)
    first, later = plan[1][0], sum(plan[1][1:])
    assert f"The first level had {first} starts; later levels begin" in words
    assert f"from the optima of the level before, {later} starts in all." in words
    assert words.startswith(f"# Optimum 0 (1 of {len(found.optima)}), the best")
    assert f"`{found.best.label}`" in words


def test_every_start_of_a_plan_leads_to_what_is_drawn_of_it(plan):
    _, tried, file = plan
    entities = read(file)
    starts, ends = (rows(entities["/search/level"], "level", name) for name in ("starts", "ends"))
    optima = rows(entities["/search/level"], "level", "optima")
    assert [len(starts[level]) for level in sorted(starts)] == tried
    for level in starts:
        reached = ends[level][np.isfinite(ends[level])]
        assert len(reached)
        # A start leads to one of the level's distinct optima, or to one that perturbation replaced.
        assert (reached >= optima[level].min() * (1 - 1e-6)).all()
        assert (ends[level] <= starts[level] * (1 + 1e-9))[np.isfinite(ends[level])].mean() > 0.5
    drawn = rows(entities["/objective/ends"], "start", "positions")
    counts = [len(drawn[number]) for number in sorted(drawn)]
    assert counts == sorted(counts)
    assert counts[-1] == sum(np.isfinite(each).sum() for each in ends.values())
    assert "leads to" in last_text(entities["/text"], "start", 1)
    for level, reached in ends.items():  # the best of each level is in its own band
        (place,) = rows(entities["/objective/best"], "level", "positions")[level]
        row = int(np.nanargmin(reached)) + sum(len(ends[each]) for each in ends if each < level)
        np.testing.assert_allclose(place, rows(entities["/objective/ends"], "level", "positions")[max(ends)][row])


@pytest.fixture(scope="module")
def fronts(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fronts")
    both = problem(pk.kinetic_energy, pk.torque_norm, samples=11)
    front = pk.epsilon_front(both, points=3, starts=3, out=folder / "front", observe=False)
    rough = pk.solve(both, population=16, generations=2, seed=1, observe=False)
    rough = rough[rough.ids[:3]]
    refined = pk.refine(rough, out=folder / "refined", observe=False)
    return folder, front, rough, refined


PANEL = "/front/kinetic_energy\\ -\\ torque_norm"
WANTED = [
    "/legend/words",
    "/text",
    *ARM,
    *CHARTS,
    *(f"{PANEL}/{part}" for part in ("grid", "labels", "front", "final")),
]
WANTED += [f"/arm/best\\ {name}/links" for name in ("kinetic_energy", "torque_norm")]


def test_an_epsilon_front_has_all_entities_at_every_level(fronts):
    folder, front, _, _ = fronts
    file = folder / "front" / "review.rrd"
    entities = read(file)
    levels = sorted(rows(entities["/search/front"], "level", "F"))
    assert len(levels) >= 3
    instants = {
        "level": (levels[0], levels[len(levels) // 2], levels[-1]),
        "motion": (0, SECOND // 2, SECOND),
        "replay": (0, SECOND, 9 * SECOND),
        "point": (0, len(front) - 1),
    }
    assert not blank_views(file, instants)
    assert not missing_entities(file, WANTED, instants)
    assert not missing_entities(file, [f"{PANEL}/epsilon"], {"level": (levels[-1],)})
    F = rows(entities["/search/front"], "level", "F")
    np.testing.assert_array_equal(F[levels[-1]].reshape(-1, 2), front.objectives)
    bounds = rows(entities[f"{PANEL}/epsilon/names"], "level", "labels")
    words = [str(each[0]).split(" ", 4) for each in bounds.values() if len(each)]
    bounded = {name: unit for _, name, _, _, unit in words}
    assert bounded
    assert bounded.items() <= dict(zip(front.names, front.units, strict=True)).items()
    assert "● ε: bound of this level" in static_words(entities["/legend/words"])


def test_a_refinement_shows_before_and_after_and_where_points_came_from(fronts):
    folder, _, rough, refined = fronts
    file = folder / "refined" / "review.rrd"
    entities = read(file)
    instants = {"refinement": (0, 1), "motion": (0, SECOND // 2, SECOND), "replay": (0, SECOND)}
    instants |= {"point": (0, len(refined) - 1)} if len(refined) > 1 else {}
    assert not blank_views(file, instants)
    assert not missing_entities(file, [*WANTED, f"{PANEL}/population"], instants)
    F = rows(entities["/search/front"], "refinement", "F")
    np.testing.assert_array_equal(F[0].reshape(-1, 2), rough.objectives)
    np.testing.assert_array_equal(F[1].reshape(-1, 2), refined.objectives)
    arrows = rows(entities[f"{PANEL}/moves"], "refinement", "vectors")
    assert len(arrows[0]) == 0
    assert 0 < len(arrows[1]) <= len(refined)
    words = rows(entities["/text"], "refinement", "text")
    assert str(words[0][0]).startswith("# Before")
    assert "Certificate" in str(words[1][0])


@pytest.mark.parametrize("timeline", ["level", "refinement"])
def test_a_choice_is_on_every_timeline_of_any_verbs_recording(fronts, timeline, tmp_path):
    folder, swept, _, refined = fronts
    front, file = (swept, folder / "front") if timeline == "level" else (refined, folder / "refined")
    recorded = RecordedRun(file / "review.rrd")
    assert recorded.timeline == timeline
    walked = {"point"} if len(front) > 1 else set()
    seconds = {name for name, begin in recorded.begins.items() if isinstance(begin, np.timedelta64)}
    assert (set(recorded.begins) - seconds, seconds) == ({timeline} | walked, {"motion", "replay"})
    content = recording_with_choice(front, front[int(front.ids[0])], recording=file / "review.rrd")
    (tmp_path / "choice.rrd").write_bytes(content)
    entities = read(tmp_path / "choice.rrd")
    everything = read(file / "review.rrd") | entities
    for name in recorded.begins:
        assert shown(entities, "/choice/arm/chosen/links", name, 1), name
        for view, origin in views(tmp_path / "choice.rrd").items():
            drawn = [path for path in shown(everything, origin, name, 1) if not path.endswith(FRAME)]
            assert drawn, (view, origin, name)
