"""Half-spaces and links of several radii in views in space and in the plane."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import paretoik as pk
from paretoik.review.drawing.arm import ArmDrawing, bodies, extent
from paretoik.review.outlines import plane_polygon
from paretoik.review.recording.messages import Workcell

LOW, HIGH = np.array([-0.4, -0.5, 0.0]), np.array([0.8, 0.7, 0.9])
HALF_SPACES = [
    pk.obstacles.HalfSpace([0.0, 0.0, 0.05], [0.0, 0.0, 1.0]),
    pk.obstacles.HalfSpace([0.0, 0.0, 0.8], [0.0, 0.0, -1.0]),
    pk.obstacles.HalfSpace([-0.2, 0.0], [1.0, 0.3]),
    pk.obstacles.HalfSpace([0.1, 0.2, 0.3], [0.3, -0.5, 0.8]),
]


@pytest.mark.parametrize("half_space", HALF_SPACES, ids=str)
def test_a_slab_in_space_is_behind_its_plane_and_covers_it_in_the_scene(half_space):
    (box,) = bodies([half_space], LOW, HIGH)
    center, half = (np.asarray(each.as_arrow_array().to_pylist()[0]) for each in (box.centers, box.half_sizes))
    turn = Rotation.from_quat(box.quaternions.as_arrow_array().to_pylist()[0]).as_matrix()
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    corners = center + signs * half @ turn.T
    axes = len(half_space.point)
    depth = (corners[:, :axes] - half_space.point) @ half_space.normal
    np.testing.assert_allclose(depth[signs[:, 2] == 1], 0.0, atol=1e-6)
    assert (depth[signs[:, 2] == -1] < -1e-3).all()
    inside = (plane_polygon(half_space, (LOW, HIGH)) - center) @ turn
    assert (np.abs(inside) <= half + 1e-6).all()


def test_a_half_space_beyond_the_scene_has_no_slab():
    assert bodies([pk.obstacles.HalfSpace([0.0, 0.0, -5.0], [0.0, 0.0, 1.0])], LOW, HIGH) == []


def test_the_view_reaches_to_a_table_below_the_arm():
    nodes = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.5], [0.4, 0.0, 0.5]])
    table = pk.obstacles.HalfSpace([0.0, 0.0, -0.2], [0.0, 0.0, 1.0])
    np.testing.assert_allclose(extent(table, nodes)[:, 2], -0.2)
    drawing = ArmDrawing(entity="arm", workcell=Workcell(arm=pk.arms.wan_7r(), obstacles=(table,)), nodes=nodes)
    assert drawing.stage.ground.low[2] <= -0.2


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("arm", [pk.arms.tringali_3r(), pk.arms.wan_7r()], ids=lambda arm: arm.name)
def test_every_link_is_drawn_with_its_own_radius(arm):
    radii = tuple(0.01 * (1.0 + np.arange(arm.dof + 1)))
    links = pk.Motion(arm=arm, time=np.arange(3.0), q=np.full((3, arm.dof), 0.3)).links
    logged = {}

    class Log:
        def log(self, entity, item, **_):
            logged[entity] = item

    cells = [Workcell(arm=arm, link_radius=radius) for radius in (radii, 0.01)]
    many, one = (ArmDrawing(entity="arm", workcell=cell, nodes=links.reshape(-1, 3)) for cell in cells)
    *_, (name, _, fields, count) = many._parts(Log(), "chosen", links, None)
    sizes = np.abs(logged["arm/chosen/body"].radii.as_arrow_array().to_pylist())
    assert name == "body"
    assert len(sizes) == count
    ratios = set(np.round(sizes / sizes.min(), 6))
    assert len(ratios) == count
    assert len(fields["strips" if arm.is_planar else "lengths"]) == 3 * count
    *_, (name, _, _, count) = one._parts(Log(), "chosen", links, None)
    assert (name, len(logged["arm/chosen/body"].radii.as_arrow_array())) == ("body", 1)
    assert (count == 1) == arm.is_planar
