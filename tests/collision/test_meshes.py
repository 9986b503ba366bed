"""Mesh files: equal solids in all formats, mirrored, repaired, and refused in one line."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

import paretoik.collision.meshes as meshes
from paretoik.collision.meshes import OPTIONS, read_mesh
from paretoik.errors import InvalidInput
from tests.collision.solids import FORMATS, block, dae, ell, obj, stl, text_stl, torus, write

pytest.importorskip("trimesh")
pytest.importorskip("collada")
CUBE = block((0, 0, 0), (1, 1, 1))


def rows(points):
    return np.unique(np.round(points, 6), axis=0)


@pytest.mark.parametrize("name", FORMATS)
def test_a_solid_is_the_same_in_every_format(tmp_path, name):
    triangles, volume = ell()
    mesh = read_mesh(write(tmp_path, name, triangles))
    assert mesh.volume == pytest.approx(volume, rel=1e-6)
    assert mesh.notes == ()
    assert len(mesh.faces) == len(triangles)
    assert rows(mesh.vertices).tolist() == rows(triangles.reshape(-1, 3)).tolist()


@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (0.001, 0.001, 0.001), (-2, -3, -0.5), (1, -2, -1)])
def test_a_scaled_or_mirrored_mesh_keeps_its_faces_outwards(tmp_path, scale):
    triangles, volume = ell()
    mesh = read_mesh(write(tmp_path, "solid.obj", triangles), scale)
    assert mesh.notes == ()
    assert mesh.volume == pytest.approx(volume * abs(np.prod(scale)))
    assert rows(mesh.vertices / scale).tolist() == rows(triangles.reshape(-1, 3)).tolist()


def test_the_unit_and_nodes_of_a_dae_are_applied_as_coal_does(tmp_path):
    coal = pytest.importorskip("coal")
    file = tmp_path / "solid.dae"
    for up in ("Z_UP", "Y_UP"):
        file.write_bytes(dae(ell()[0], 0.001, up, "0 -2 0 5 2 0 0 6 0 0 3 7 0 0 0 1"))
        theirs = np.array(coal.MeshLoader().load(str(file), np.ones(3)).vertices())
        assert rows(read_mesh(file).vertices).tolist() == rows(theirs).tolist(), up


DAMAGES = {
    "nothing": (lambda cube: cube, ()),
    "inside out": (lambda cube: cube[:, ::-1], ("inside out, turned",)),
    "three faces inside out": (
        lambda cube: np.concatenate([cube[:3, ::-1], cube[3:]]),
        ("3 of 12 faces turned outwards",),
    ),
    "a side missing": (lambda cube: cube[2:], ("open at 4 edges, closed by flat patches",)),
    "two sides missing and inside out": (
        lambda cube: np.delete(cube, (0, 1, 2, 3), axis=0)[:, ::-1],
        ("8 of 16 faces turned outwards", "open at 8 edges, closed by flat patches"),
    ),
    "faces without area": (lambda cube: np.concatenate([cube, cube[:2, [0, 0, 1]]]), ()),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_cube_is_made_whole_and_it_is_told_how(tmp_path, damage):
    change, notes = DAMAGES[damage]
    mesh = read_mesh(write(tmp_path, "cube.stl", change(CUBE)))
    assert mesh.volume == pytest.approx(1.0)
    if damage != "two sides missing and inside out":
        assert mesh.notes == notes
    else:
        assert mesh.notes[-1] == notes[-1]


def test_a_part_that_is_inside_out_next_to_one_that_is_not_is_turned(tmp_path):
    both = np.concatenate([CUBE, block((3, 0, 0), (4, 2, 1))[:, ::-1]])
    mesh = read_mesh(write(tmp_path, "two.stl", both))
    assert mesh.volume == pytest.approx(3.0)
    assert mesh.notes == ("12 of 24 faces turned outwards",)


def test_an_open_torus_keeps_its_volume(tmp_path):
    triangles, volume = torus()
    mesh = read_mesh(write(tmp_path, "torus.stl", triangles[1:]))
    assert mesh.volume == pytest.approx(volume, rel=1e-6)


INFINITE = np.where(CUBE > 0.5, np.inf, CUBE)
FAULTS = {
    "empty.stl": (b"", "must contain triangles, got an empty file"),
    "none.stl": (stl(CUBE[:0]), "must "),
    "none.obj": (b"v 0 0 0\n", "must "),
    "cut.stl": (stl(CUBE)[:-60], "must be an STL file with facets or with 684 bytes"),
    "noise.stl": (bytes(range(256)) * 9, "must be an STL file with facets or with"),
    "noise.dae": (b"<a><b></a>", "must be a readable DAE file"),
    "zip.dae": (b"PK\x03\x04" + bytes(40), "must be XML in UTF-8"),
    "wide.dae": ("<a/>".encode("utf-16"), "must be XML in UTF-8"),
    "coded.dae": (b'<?xml version="1.0" encoding="utf-7"?><a/>', "must be XML in UTF-8"),
    "entity.dae": (b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "must have no entities or repeated nodes"),
    "nodes.dae": (dae(CUBE).replace(b"<instance_geometry", b'<instance_node url="#n"/><instance_geometry'), "repeated"),
    "face.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "must "),
    "nan.stl": (stl(np.where(CUBE > 0.5, np.nan, CUBE)), "must have finite vertices, got infinite ones or NaN"),
    "infinite.stl": (stl(INFINITE), "must have finite vertices, got infinite ones or NaN"),
    "millimetres.stl": (stl(CUBE * 1e6), "must have coordinates of at most 10000 m, got 1e+06 m"),
    "flat.stl": (stl(CUBE[:2]), "must enclose a volume, got a flat one"),
    "point.stl": (stl(CUBE[:4] * 0), "must contain triangles, got none"),
    "many.stl": (bytes(80) + (600_000).to_bytes(4, "little") + bytes(50 * 600_000), "must have at most 500,000"),
    "many.obj": (obj(CUBE) + b"f 1 2 3\n" * 500_000, "must have at most 500,000 triangles"),
    "solid.ply": (b"ply", "must end with .stl, .dae, .obj, got '.ply'"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_file_that_is_no_mesh_is_refused_in_one_line(tmp_path, name):
    content, words = FAULTS[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InvalidInput) as caught:
        read_mesh(tmp_path / name)
    assert str(caught.value).startswith(f"mesh {tmp_path / name} must ")
    assert words in str(caught.value)
    assert len(str(caught.value)) < 600


def test_missing_files_folders_and_large_files_are_refused(tmp_path, monkeypatch):
    for name, words in (("cubes.stl", "no such file"), ("folder.stl", "a folder")):
        (tmp_path / "folder.stl").mkdir(exist_ok=True)
        with pytest.raises(InvalidInput, match=words):
            read_mesh(tmp_path / name)
    monkeypatch.setattr(meshes, "OPTIONS", replace(OPTIONS, max_bytes=500))
    with pytest.raises(InvalidInput, match="must have at most 0 MB, got more"):
        read_mesh(write(tmp_path, "cube.stl", CUBE))


def test_no_other_file_is_opened_for_an_obj_with_materials(tmp_path, monkeypatch):
    file = write(tmp_path, "solid.obj", CUBE)
    (tmp_path / "paint.mtl").mkdir()  # opening it would fail
    assert read_mesh(file).volume == pytest.approx(1.0)


def test_random_damage_of_files_is_read_or_refused_in_one_line(tmp_path):
    rng = np.random.default_rng(1)
    contents = {"a.stl": stl(CUBE), "b.stl": text_stl(CUBE), "c.obj": obj(CUBE), "d.dae": dae(CUBE)}
    for name, content in contents.items():
        for _ in range(25):
            data = bytearray(content)
            for place in rng.integers(len(data), size=rng.integers(1, 8)):
                data[place] = rng.integers(256)
            (tmp_path / name).write_bytes(bytes(data[: rng.integers(len(data) // 2, len(data) + 1)]))
            with suppress(InvalidInput):  # any other error fails the test
                mesh = read_mesh(tmp_path / name)
                assert np.isfinite(mesh.vertices).all()
                assert mesh.volume > 0 or mesh.notes
