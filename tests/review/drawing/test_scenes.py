"""Recordings contain everything that a picture needs at every instant, and no view of a layout is blank."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.front.preferences.knee_and_compromise import compromise
from paretoik.review.drawing.choice_layer import RecordedRun, recording_with_choice
from paretoik.review.recording.messages import record_motion
from problems.kim_2021 import directions_dam, point_to_point_dam
from problems.marcos_2012 import loop
from tests.review.reading import (
    FRAME,
    SECOND,
    blank_views,
    missing_entities,
    read,
    rows,
    shown,
    static_words,
    views,
)


def planar() -> pk.Tracking:
    arm = pk.Arm.planar(lengths=[0.3, 0.3, 0.25], masses=[1, 1, 0.8], centers=[0.15] * 3, inertias=[0.01] * 3)
    varying = (3 + np.cos(2 * np.pi * np.linspace(0, 1, 11)))[:, None] * np.ones(3)
    return pk.Tracking(
        arm,
        pk.line([0.6, -0.1], [0.4, 0.4], duration=1.0, samples=11),
        objectives=[pk.kinetic_energy, pk.torque_norm],
        limits=pk.Limits(position=2.5, velocity=varying, torque=9.0, power=20.0, acceleration=90.0),
        obstacles=[
            pk.obstacles.Circle([0.75, 0.45], 0.05),
            pk.obstacles.Box(pk.Pose.planar(0.1, 0.6, 0.6), [0.12, 0.05]),
            pk.obstacles.Sphere([0.2, -0.5, 0.03], 0.1),
            pk.obstacles.Capsule([0.5, -0.6, -0.1], [0.8, -0.5, 0.1], 0.05),
            pk.obstacles.HalfSpace([-0.4, 0.0], [1.0, 0.1], name="wall"),
        ],
        link_radius=[0.0, 0.02, 0.015, 0.01],
    )


def spatial() -> pk.Tracking:
    arm = pk.Arm.from_dh(
        a=[0, 0, 0.4, 0.4], alpha=[0, np.pi / 2, 0, 0], d=[0.3, 0, 0, 0], theta=[0] * 4, convention="modified"
    ).with_tool(pk.Pose([0.3, 0, 0]), mass=1.0)
    return pk.Tracking(
        arm,
        pk.line([0.6, -0.1, 0.4], [0.6, 0.2, 0.5], duration=1.0, samples=11),
        objectives=[pk.kinetic_energy, pk.joint_travel, pk.torque_norm],
        obstacles=[
            pk.obstacles.Sphere([0.0, 0.9, 0.3], 0.1),
            pk.obstacles.Box(pk.Pose.from_rpy((-0.5, 0.0, 0.2), (0.3, 0.2, 0.4)), [0.1, 0.2, 0.05]),
            pk.obstacles.Capsule([-0.3, 0.8, 0.2], [-0.5, 0.9, 0.6], 0.04),
            pk.obstacles.Circle([-0.5, -0.6], 0.05),
            pk.obstacles.HalfSpace([0.0, 0.0, -0.1], [0.0, 0.1, 1.0], name="floor"),
        ],
        link_radius=[0.03, 0.02, 0.02, 0.02, 0.01],
    )


RUNS = {"planar": planar, "spatial": spatial, "directions": directions_dam, "point to point": point_to_point_dam}
INSTANTS = {
    "generation": (1, 2, 4),
    "motion": (0, SECOND // 2, SECOND),
    "replay": (0, SECOND, 9 * SECOND),
    "point": (0, 1),
}


def instants_of(name: str, front: pk.Front) -> dict[str, tuple[int, ...]]:
    """Return the instants of a run; arms that push in directions do not move, nor does a front of one point."""
    constant = {"motion": name == "directions", "point": len(front) == 1}
    return {timeline: times for timeline, times in INSTANTS.items() if not constant.get(timeline)}


@pytest.fixture(scope="module", params=RUNS)
def run(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    front = pk.solve(RUNS[request.param](), population=16, generations=4, seed=1, out=folder / "run", observe=False)
    return request.param, front, folder / "run" / "review.rrd"


def test_no_view_is_blank_at_any_instant(run):
    assert not blank_views(run[2], instants_of(run[0], run[1]))


def test_a_timeline_exists_if_something_changes_along_it(run):
    name, front, file = run
    timelines = RecordedRun(file).begins
    assert ("motion" in timelines) == (name != "directions")
    assert ("point" in timelines) == (len(front) > 1)


def test_an_arm_is_nowhere_seen_to_lag_behind_the_time(run):
    name, front, file = run
    if name == "directions":
        return
    entities, choice = read(file), compromise(front)
    strips = rows(entities["/arm/chosen/links"], "motion", "strips")
    time, end = np.array(sorted(strips)), choice.motion.time[-1] - choice.motion.time[0]
    assert np.diff(time).max() <= 1.02 * end * SECOND / 100
    samples = np.round((choice.motion.time - choice.motion.time[0]) * SECOND).astype(int)
    assert (np.abs(samples[:, None] - time).min(axis=1) <= 1).all()
    series = rows(entities["/joints/position"], "motion", "scalars")
    np.testing.assert_array_equal(np.stack([series[at] for at in sorted(series)]), choice.motion.q)
    cursors = rows(entities["/joint_charts/position/cursor"], "motion", "strips")
    across = np.array([cursors[at][0][0][0] for at in time.tolist()])
    np.testing.assert_allclose(np.diff(across) / np.diff(time), np.ptp(across) / np.ptp(time), rtol=1e-2)


def test_individuals_outside_the_axes_are_counted_in_words(run):
    _, front, file = run
    entities = read(file)
    texts = rows(entities["/text"], "generation", "text")
    (panel, *_) = {path.rsplit("/", 1)[0] for path in entities if path.endswith("/population") and "front" in path}
    drawn = rows(entities[f"{panel}/population"], "generation", "positions")
    everything = rows(entities["/search/population"], "generation", "F")
    for number, words in texts.items():
        count = len(everything[number]) // len(front.names)
        said = [line for line in str(words[0]).splitlines() if "outside the axes" in line]
        outside = int(said[0].split()[0]) if said else 0
        if number < max(texts):  # at the end the text is about the front
            assert count - len(drawn[number]) <= outside <= count
        if len(front.names) == 2 and number < max(texts):
            assert count - len(drawn[number]) == outside


def test_a_search_has_all_entities_at_every_instant(run):
    name, front, file = run
    entities = read(file)
    wanted = ["/legend/words", "/text", "/arm/axes/grid", "/arm/axes/labels", "/arm/base", "/arm/chosen/links"]
    wanted += [f"/arm/best\\ {objective}/links" for objective in front.names]
    if name in ("planar", "spatial"):
        wanted += ["/arm/target", "/arm/chosen/path", "/arm/chosen/ghosts", "/arm/chosen/body", "/arm/obstacles"]
        wanted += [f"/joint_charts/{kind}/curves" for kind in ("position", "velocity", "torque")]
    if name == "planar":
        wanted += [f"/joint_charts/{kind}/limits" for kind in ("position", "velocity", "torque")]
        for kind in ("power", "acceleration"):  # far from the motions' values, these are only named in words
            assert f"/joint_charts/{kind}/limits_beyond" in entities
    wanted += ["/arm/directions"] * (name == "directions") + ["/arm/places"] * (
        name in ("directions", "point to point")
    )
    legend = static_words(entities["/legend/words"])
    assert ("● directions" in legend) == (name == "directions")
    assert ("● position" in legend, "● important places" in legend) == (name == "directions", name == "point to point")
    panels = {"/".join(path.split("/")[:3]) for path in entities if path.startswith("/front/")}
    assert len(panels) == {2: 1, 3: 3}[len(front.names)]
    for panel in panels:
        wanted += [f"{panel}/{layer}" for layer in ("grid", "labels", "front", "final", "chosen", "ends")]
    fronts = rows(entities["/search/front"], "generation", "F")
    first = min(number for number, F in fronts.items() if F.size)
    late = {
        timeline: times[-1:] if first > 1 and timeline in ("generation", "replay") else times  # infeasible before
        for timeline, times in instants_of(name, front).items()
    }
    assert not missing_entities(file, wanted, late)


def test_the_text_describes_what_is_shown(run):
    _, front, file = run
    words = read(file)["/text"]
    by_generation = rows(words, "generation", "text")
    assert str(by_generation[1][0]).startswith("# Generation 1\n")
    last = str(by_generation[max(by_generation)][0])
    assert "compromise" in last
    assert " 1 points" not in last
    for name, unit in zip(front.names, front.units, strict=True):
        assert name in last
        assert unit.replace(" ", "\u00a0") in last  # no line ends within a unit
    assert "population: 16" in last
    along = rows(words, "point", "text")
    assert len(along) >= (min(len(front), 3) if len(front) > 1 else 0)
    assert all(str(text[0]).startswith("# Point ") for text in along.values())


def test_two_choices_are_shown_in_the_same_recording(run, tmp_path):
    _, front, file = run
    first, last = front[int(front.ids[0])], front[int(front.ids[-1])]
    (tmp_path / "choice.rrd").write_bytes(recording_with_choice(front, first, recording=file, compare=last))
    entities = read(tmp_path / "choice.rrd")
    for root, choice in (("choice", first), ("compared", last)):
        motion = record_motion(choice.motion, curves=False)
        timeline, count = ("generation", 1) if motion.is_standing else ("motion", len(motion.time))
        assert len(rows(entities[f"/{root}/arm/chosen/links"], timeline, "strips")) >= count
        assert str(rows_of_text(entities[f"/{root}/text"])).startswith(f"# Point {choice.id}, ")
    everything = entities | {path: batches for path, batches in read(file).items() if path not in entities}
    for view, origin in views(tmp_path / "choice.rrd").items():
        for timeline in {"motion", "generation"} & set(RecordedRun(file).begins):
            assert shown(everything, origin, timeline, 5), (view, origin, timeline)


def rows_of_text(batches: list) -> str:
    (column,) = [name for name in batches[0].schema.names if name.endswith(":text")]
    return batches[0].column(column).to_pylist()[0][0]


def test_a_closed_loop_opens_on_the_step_whose_search_was_recorded(tmp_path):
    problem = loop(3, 0.7, blocked=True, steps=30, population=20, generations=12)
    pk.solve(problem, out=tmp_path / "run", record_steps=[7], observe=False)
    file = tmp_path / "run" / "review.rrd"
    entities = read(file)
    for timeline, times in {"step": (0, 7, 30), "generation": (0, 5), "individual": (0, 3)}.items():
        for view, origin in views(file).items():
            for time in times:
                drawn = [path for path in shown(entities, origin, timeline, time) if not path.endswith(FRAME)]
                assert drawn, (view, origin, timeline, time)
    notes = rows(entities[r"/front/joint_displacement\ -\ position_error/note"], "step", "labels")
    assert notes[0].tolist() == ["no front before step 1"]
    charts = {path.split("/")[2] for path in entities if path.startswith("/joint_charts/")}
    assert charts == {"position", "velocity"}, "an arm without masses has no torque"
    assert not len(notes.get(1, ()))
    words = rows(entities["/text"], "step", "text")
    assert str(words[0][0]).startswith("# Step 0\n\nThe arm is at its start")
    assert str(words[1][0]).startswith("# Step 1\n")
    assert "/arm/obstacles/outlines" in entities
    assert "/step_7/arm/obstacles/outlines" in entities
    assert "The search of step 7 has a tab" in str(words[1][0])
    assert "The steps from 7 on, blue on the slider, are repeated" in str(words[1][0])
    searched = rows(entities["/step_7/text"], "generation", "text")
    assert all(str(searched[number][0]).startswith(f"# Step 7, generation {number}") for number in searched)
    one_by_one = rows(entities["/step_7/text"], "individual", "text")
    assert f", rank 4 of {len(one_by_one)} in joint_displacement\n" in str(one_by_one[3][0])
