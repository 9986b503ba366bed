"""The recordings of resolved motions and directional maxima contain everything that a picture needs."""

from __future__ import annotations

import numpy as np
import pytest

import paretoik as pk
from paretoik.capability import JointActuation, MotorCurve
from tests.api.problems import PATH
from tests.capability.test_geodesic import Even
from tests.review.reading import SECOND, blank_views, last_text, missing_entities, read, rows, static_words, views

START = [0.0, 0.327, -0.754]
MOVING = ["/legend/words", "/text", "/arm/axes/labels", "/arm/base", "/arm/target", "/arm/chosen/links"]
MOVING += ["/arm/chosen/path", "/arm/chosen/ghosts", "/charts/error/grid", "/charts/error/curves"]
MOVING += [
    f"/joint_charts/{kind}/{part}" for kind in ("position", "velocity", "torque") for part in ("curves", "cursor")
]


def test_a_resolved_motion_has_all_entities_at_every_instant(tmp_path):
    criteria = [pk.methods.Criterion(objective=pk.manipulability, gain=0.5)]
    motion = pk.resolve(
        pk.arms.tringali_3r(),
        pk.line((0.4678, 0.0), (0.0983, 0.1526), duration=1.0, samples=101),
        pk.methods.GradientProjection(criteria=criteria),
        start=START,
        limits=pk.Limits(position=2.0, velocity=6.0),
        obstacles=[pk.obstacles.Circle([0.1, 0.35], 0.05)],
        link_radius=0.01,
        unreachable="track",
        out=tmp_path,
    )
    file = tmp_path / "review.rrd"
    entities = read(file)
    instants = {"motion": (0, SECOND // 2, SECOND)}
    assert not blank_views(file, instants)
    own = ["/arm/obstacles", "/arm/chosen/body", "/charts/criteria/curves", "/charts/clearance/curves"]
    assert not missing_entities(file, [*MOVING, *own, "/charts/error/limits"], instants)
    assert any(f"/joint_charts/velocity/{part}" in entities for part in ("limits", "limits_beyond"))
    for kind, name in (("position", "q"), ("velocity", "dq"), ("torque", "torque")):
        series = rows(entities[f"/joints/{kind}"], "motion", "scalars")
        np.testing.assert_array_equal(np.stack([series[at] for at in sorted(series)]), getattr(motion, name))
    words = last_text(entities["/text"], "motion", 0)
    assert words.startswith("# GradientProjection")
    assert f"largest error {np.abs(motion.traces.errors).max():.3g} m" in words
    assert "manipulability" in words
    assert set(static_words(entities["/charts/error/labels"])) >= {"time [s]", "log10 of the task error [m]"}


def test_motions_with_several_settings_of_a_method_move_together_and_one_by_one(tmp_path):
    method = pk.methods.DampedLeastSquares(damping=np.array([0.01, 0.05, 0.2]))
    limits = pk.Limits(position=0.8, velocity=1.5)
    arm = pk.arms.tringali_3r()
    motion = pk.resolve(arm, PATH, method, start=START, limits=limits, unreachable="track", out=tmp_path)
    file = tmp_path / "review.rrd"
    entities = read(file)
    instants = {"motion": (0, SECOND), "solution": (0, 1, 2)}
    assert not blank_views(file, instants)
    assert not missing_entities(file, MOVING, instants)
    assert not missing_entities(file, ["/arm/motion\\ 1/links", "/arm/motion\\ 2/links"], {"motion": (0,)})
    texts = rows(entities["/text"], "solution", "text")
    assert [str(texts[number][0]).splitlines()[0] for number in range(3)] == [
        f"# DampedLeastSquares, motion {number} ({number + 1} of 3)" for number in range(3)
    ]
    for number, damping in enumerate((0.01, 0.05, 0.2)):
        words = str(texts[number][0])
        assert f"- damping: {damping} m/rad" in words
        assert _broken(words) == _worst(motion[number])
        assert _broken(words)
    marks = rows(entities["/charts/error/marks"], "solution", "positions")
    assert [len(marks[number]) for number in range(3)] == (motion.traces.status != "done").sum(axis=-1).tolist()
    assert {"● motion 0", "● motion 2"} <= set(static_words(entities["/legend/words"]))


def _broken(words: str) -> dict[str, str]:
    """Return the worst value of each joint limit that a text calls broken, by joint and kind."""
    lines = [line[4:] for line in words.splitlines() if "; broken by up to" in line]
    return {line.split("**")[0]: line.split("reaches ")[1].split()[0] for line in lines}


def _worst(motion) -> dict[str, str]:
    """Return the same from a motion whose joints are limited to 0.8 rad and 1.5 rad/s."""
    worst = {}
    for kind, limit, values in (("position", 0.8, motion.q), ("velocity", 1.5, motion.dq)):
        for joint, name in enumerate(motion.arm.joint_names):
            most = max(values[:, joint], key=abs)
            if abs(most) > limit:
                worst[f"{name}, {kind}"] = f"{most:.3g}"
    return worst


def test_a_note_says_how_many_of_many_motions_are_shown(tmp_path):
    starts = np.array(START) + np.linspace(0.0, 1e-7, 70)[:, None]
    pk.resolve(pk.arms.tringali_3r(), PATH, pk.methods.PseudoInverse(), start=starts, unreachable="track", out=tmp_path)
    entities = read(tmp_path / "review.rrd")
    assert len(rows(entities["/text"], "solution", "text")) == 60
    assert "60 of 70 motions are shown." in str(entities["/notes/left_out"][0].to_pydict())


def test_a_path_that_is_lost_is_recorded_as_far_as_the_arm_came(tmp_path):
    away = pk.line([0.4678, 0.0], [0.6, 0.1], duration=1.0, samples=51)
    with pytest.raises(pk.Infeasible) as lost:
        pk.resolve(pk.arms.tringali_3r(), away, pk.methods.PseudoInverse(), start=START, out=tmp_path)
    entities = read(tmp_path / "review.rrd")
    series = rows(entities["/joints/position"], "motion", "scalars")
    np.testing.assert_array_equal(np.stack([series[at] for at in sorted(series)]), lost.value.motion.q)
    assert "Why it ended" in last_text(entities["/text"], "motion", 0)


MAXIMA = ["/legend/words", "/text", "/maxima/axes/grid", "/maxima/axes/labels", "/maxima/corners", "/maxima/final"]
MAXIMA += ["/maxima/chosen/tip", "/arm/axes/labels", "/arm/base", "/arm/places", "/arm/direction/line"]
MAXIMA += ["/arm/chosen/links", "/charts/maximum/curves", "/charts/maximum/cursor"]


@pytest.mark.parametrize("quantity", ["velocity", "force"])
def test_directional_maxima_grow_direction_by_direction(tmp_path, quantity):
    arm, sliders = pk.arms.kim_3r(), pk.capability.kim_sliders()
    polygon = pk.directional_maxima(arm, sliders, (0.1, -0.15), 5, quantity=quantity, out=tmp_path)
    file = tmp_path / "review.rrd"
    entities = read(file)
    instants = {"direction": (1, 3, 5)}
    assert not blank_views(file, instants)
    own = [f"/charts/{name}/curves" for name in ("position", "torque", "sliders", "motor_speeds", "motor_efforts")]
    assert not missing_entities(file, [*MAXIMA, *own, "/maxima/outline"], instants)
    corners = rows(entities["/maxima/corners"], "direction", "positions")
    assert [len(corners[number]) for number in range(1, 6)] == [1, 2, 3, 4, 5]
    names = rows(entities["/maxima/chosen/name"], "direction", "labels")
    assert [str(names[number][0]) for number in range(1, 6)] == [f"direction {number}" for number in range(1, 6)]
    limited = "velocity" if quantity == "velocity" else "torque"
    assert f"/charts/{limited}/limits" in entities
    unit = "m/s" if quantity == "velocity" else "N"
    words = str(rows(entities["/text"], "direction", "text")[3][0])
    legend = static_words(entities["/legend/words"])
    assert "● limits of the motors: dashed" in legend
    assert ("● limits: dashed" in legend) == ("/charts/position/limits" in entities)
    assert f"{polygon.values[2]:.4g} {unit}" in words
    assert any(word.endswith(f"[{unit}]") for word in static_words(entities["/maxima/axes/labels"]))


def test_maxima_in_space_are_rays_on_axes_of_speed(tmp_path):
    arm = pk.Arm.from_dh(
        a=[0, 0, 0.4, 0.4], alpha=[0, np.pi / 2, 0, 0], d=[0.3, 0, 0, 0], theta=[0] * 4, convention="modified"
    ).with_tool(pk.Pose([0.3, 0, 0]), mass=1.0)
    motors = JointActuation(motors=MotorCurve(stall=[200.0] * 4, fastest=[2.0] * 4))
    pk.directional_maxima(arm, motors, (0.5, 0.2, 0.5), 3, starts=200, out=tmp_path)
    file = tmp_path / "review.rrd"
    instants = {"direction": (1, 3)}
    assert not blank_views(file, instants)
    assert not missing_entities(file, [path for path in MAXIMA if path != "/maxima/axes/grid"], instants)
    texts = rows(read(file)["/text"], "direction", "text").values()
    assert all("e-" not in line for text in texts for line in str(text[0]).split("## Run")[0].splitlines())
    words = static_words(read(file)["/maxima/axes/labels"])
    assert [f"{axis} [m/s]" for axis in "xyz"] == words[-3:]
    assert "/maxima" in views(file).values()


@pytest.mark.parametrize("axes", [2, 3])
def test_a_tool_path_is_walked_along(tmp_path, axes):
    model = Even(np.eye(axes), np.full(axes, -1.0), np.ones(axes))
    ends = np.full(axes, -0.5), np.linspace(0.4, 0.6, axes)
    pk.capability.time_optimal_control(model, *ends, period=0.05, gain=10.0, out=tmp_path)
    file = tmp_path / "review.rrd"
    entities = read(file)
    assert not missing_entities(file, ["/path/line", "/path/reference", "/path/ends", "/charts/speed/curves"], {})
    assert len(rows(entities["/path/tool"], "motion", "positions")) > 10
    assert "● reference" in static_words(entities["/legend/words"])
