"""Bodies of links: every piece is where Pinocchio puts its shape, and no file is opened that was not offered."""

from __future__ import annotations

import os
import re
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

import numpy as np
import pytest

from paretoik.collision.bodies import Primitive
from paretoik.collision.hulls import Hull
from paretoik.errors import InvalidInput, InvalidRobot
from paretoik.robot.arm import Arm
from paretoik.robot.chain import joint_motion
from paretoik.robot.pose import Pose
from paretoik.robot.urdf import check_robot
from paretoik.runs.fingerprint import fingerprint
from tests.collision.solids import block, depth_outside, ell, write
from tests.robot.random_urdfs import origin, random_robot
from tests.robot.urdf_text import LIMIT, joint

pytest.importorskip("trimesh")
pytest.importorskip("collada")
pinocchio = pytest.importorskip("pinocchio")
MESH = '<mesh filename="package://things/ell.stl"{}/>'


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def things(tmp_path):
    """Return the folder of a package with a mesh."""
    folder = tmp_path / "things"
    folder.mkdir()
    write(folder, "ell.stl", ell()[0] * 0.1)
    return folder


def shape(geometry, place=""):
    return f"<collision>{place}<geometry>{geometry}</geometry></collision>"


def random_shapes(text, seed):
    """Return a robot's text with up to three shapes of all kinds on each link."""
    rng = np.random.default_rng(seed)

    def some(match):
        shapes = []
        for kind in rng.choice(["box", "sphere", "cylinder", "mesh"], rng.integers(4)):
            a, b, c = rng.uniform(0.1, 0.5, 3)
            scale = " ".join(map(str, rng.uniform(0.5, 2, 3) * rng.choice([-1, 1], 3)))
            geometry = {
                "box": f'<box size="{a} {b} {c}"/>',
                "sphere": f'<sphere radius="{a}"/>',
                "cylinder": f'<cylinder radius="{a}" length="{b}"/>',
                "mesh": MESH.format(f' scale="{scale}"'),
            }[str(kind)]
            shapes.append(shape(geometry, re.sub("quat_xyzw.*?/>", 'rpy="1 2 3"/>', origin(rng))))
        return f"{match[1]}>{''.join(shapes)}{match[3] or '</link>'}"

    text = re.sub(r"(<link name=\"\w+\")(/>|>)(?:(?=<inertial)(<inertial.*?</link>)|(?:</link>)?)", some, text)
    return re.sub(r"quat_xyzw=\"[^\"]*\"", 'rpy="0.3 0.2 0.1"', text).replace(' version="1.1"', "")


def joint_frame(arm, q, joint):
    """Return the frame of an arm's joint in its base; its axis is z."""
    pose = Pose(np.zeros(3))
    for i in range(joint + 1):
        pose = pose @ arm.placements[i] @ joint_motion(arm.joint_types[i], q[i])
    return pose


def compare(file, arm, frozen, folders, count=3):
    """Compare the pieces of an arm with the geometry that Pinocchio reads; return the number of shapes."""
    model = pinocchio.buildModelFromUrdf(str(file))
    theirs = pinocchio.buildGeomFromUrdf(model, str(file), pinocchio.COLLISION, package_dirs=[*map(str, folders)])
    shapes = list[list]()  # pieces of one shape each
    for piece in arm.geometry.pieces:
        last = shapes[-1][-1] if shapes else None
        new = last is None or not isinstance(piece.shape, Hull) or last.pose is not piece.pose
        shapes.append([piece]) if new else shapes[-1].append(piece)
    by_link: dict[str, list] = {}
    for each in theirs.geometryObjects:
        by_link.setdefault(model.frames[each.parentFrame].name, []).append(each)
    assert sum(map(len, by_link.values())) == len(shapes)
    data, geometry = model.createData(), theirs.createData()
    rng = np.random.default_rng(0)
    for _ in range(count):
        q = rng.uniform(-1, 1, arm.dof)
        step = np.zeros(model.nv)
        for name, value in {**frozen, **dict(zip(arm.joint_names, q, strict=True))}.items():
            step[model.idx_vs[model.getJointId(name)]] = value
        place = pinocchio.integrate(model, pinocchio.neutral(model), step)
        pinocchio.updateGeometryPlacements(model, data, theirs, geometry, place)
        pinocchio.updateFramePlacements(model, data)
        waiting = {name: list(objects) for name, objects in by_link.items()}
        root = None
        for pieces in shapes:
            first = pieces[0]
            each = waiting[first.link].pop(0)
            ours = (joint_frame(arm, q, first.joint) @ first.pose).matrix
            found = geometry.oMg[theirs.getGeometryId(each.name)].homogeneous
            root = found @ np.linalg.inv(ours) if root is None else root  # the base in the world of the file
            assert np.abs(root @ ours - found).max() <= 1e-9
            check_size(pieces, each)
    return len(shapes)


def check_size(pieces, each):
    """Check shapes in their own frames."""
    body, theirs = pieces[0].shape, each.geometry
    if isinstance(body, Primitive):
        got = {
            "box": lambda: 2 * theirs.halfSide,
            "sphere": lambda: [theirs.radius],
            "cylinder": lambda: [theirs.radius, 2 * theirs.halfLength],
        }[body.kind]()
        assert np.allclose(body.sizes, got)
    else:
        vertices = np.array(theirs.vertices() if hasattr(theirs, "vertices") else theirs.points())
        hulls = [piece.shape for piece in pieces]
        size = np.abs(vertices).max()
        assert depth_outside(hulls, vertices).max() <= 1e-6 * size
        corners = np.concatenate([hull.vertices for hull in hulls])
        assert np.allclose(corners.min(axis=0), vertices.min(axis=0), atol=1e-6 * size)
        assert np.allclose(corners.max(axis=0), vertices.max(axis=0), atol=1e-6 * size)


@pytest.mark.parametrize("seed", range(6))
def test_every_shape_of_a_random_robot_is_where_pinocchio_puts_it(tmp_path, things, seed):
    robot = random_robot(seed)
    file = tmp_path / "robot.urdf"
    file.write_text(random_shapes(robot.text, seed))
    arm = Arm.from_urdf(file, tip=robot.tip, fixed=robot.fixed, collision=True, packages={"things": things})
    assert compare(file, arm, robot.frozen, [tmp_path]) > 3


@pytest.mark.parametrize("seed", range(4))
def test_bodies_of_an_arm_with_fixed_joints_are_those_of_the_file_read_so(tmp_path, things, seed):
    robot = random_robot(seed)
    file = tmp_path / "robot.urdf"
    file.write_text(random_shapes(robot.text, seed))
    options = {"tip": robot.tip, "collision": True, "packages": {"things": things}}
    arm = Arm.from_urdf(file, fixed=robot.fixed, **options)
    for name in (arm.joint_names[0], arm.joint_names[-1]):
        fixed = arm.fixed({name: 0.3})
        again = Arm.from_urdf(file, fixed={**robot.fixed, name: 0.3}, **options)
        q = np.linspace(-0.5, 0.5, fixed.dof)
        for ours, theirs in zip(fixed.geometry.pieces, again.geometry.pieces, strict=True):
            poses = [joint_frame(each, q, piece.joint) @ piece.pose for each, piece in ((fixed, ours), (again, theirs))]
            assert (ours.link, ours.joint, ours.source) == (theirs.link, theirs.joint, theirs.source)
            assert np.abs(poses[0].matrix - poses[1].matrix).max() <= 1e-12


def small(write_urdf_to, *shapes, more=""):
    """Return a robot of two links; the shapes are on line 3 and following of the second one."""
    text = f'<robot name="r">\n<link name="a"/><link name="b">\n{os.linesep.join(shapes)}\n</link>\n'
    text += joint("j", "a", "b", inside=LIMIT) + more + "</robot>"
    write_urdf_to.write_text(text)
    return write_urdf_to


def test_tools_mounts_and_copies_keep_the_bodies(tmp_path):
    arm = Arm.from_urdf(small(tmp_path / "r.urdf", shape('<capsule radius="0.1" length="0.4"/>')), collision=True)
    (piece,) = arm.geometry.pieces
    assert piece.shape == Primitive(kind="capsule", sizes=(0.1, 0.4))
    assert piece.shape.volume == pytest.approx(np.pi * 0.01 * 0.4 + 4 / 3 * np.pi * 0.001)
    moved = arm.with_tool(Pose([1, 0, 0]), mass=1.0).mounted(base=Pose([0, 0, 2.0]))
    assert moved.geometry is arm.geometry
    plain = Arm.from_urdf(tmp_path / "r.urdf")
    assert plain.geometry is None
    assert fingerprint(plain) != fingerprint(arm)


def test_links_with_visuals_only_are_named(tmp_path):
    seen = '<link name="c"><visual><geometry><sphere radius="1"/></geometry></visual></link>'
    more = seen + joint("k", "b", "c", "fixed", "")
    file = small(tmp_path / "r.urdf", shape('<sphere radius="0.1"/>'), more=more)
    arm = Arm.from_urdf(file, collision=True)
    assert arm.geometry.silent == ("c",)
    assert "links with visuals only collide with nothing: c" in arm.notices
    assert "links with visuals only collide with nothing: c" in check_robot(file, collision=True).warnings


def test_the_report_has_a_row_per_link(tmp_path, things):
    pytest.importorskip("coal")
    file = small(tmp_path / "r.urdf", shape(MESH.format("")), shape('<box size="1 1 1"/>'))
    report = check_robot(file, collision=True, packages={"things": things})
    names, row = report.collision
    assert dict(zip(names, row, strict=True)) == {
        "link": "b",
        "moved by": "j",
        "pieces": "3",
        "kinds": "hull × 2, box",
        "outside [mm]": "0.0",
        "volume [×]": "1.000",
    }
    assert "hull × 2, box" in repr(report)
    assert check_robot(file).collision == ()


# Faults


SHAPE_FAULTS = {
    "none": ("<collision/>", "line 3: link 'b': a collision must have one of box, cylinder, sphere, capsule, mesh"),
    "plane": (shape("<plane/>"), "a collision must have one of box, cylinder, sphere, capsule, mesh, got <plane>"),
    "two": (shape('<sphere radius="1"/><sphere radius="1"/>'), "got <sphere>, <sphere>"),
    "no size": (shape("<box/>"), "line 3: link 'b': <box> must have size, got none"),
    "two sizes": (shape('<box size="1 2"/>'), "box size must be 3 numbers, got '1 2'"),
    "negative": (shape('<sphere radius="-1"/>'), "sphere radius must be positive, got -1 m"),
    "zero": (shape('<cylinder radius="1" length="0"/>'), "cylinder length must be positive, got 0 m"),
    "huge": (shape('<sphere radius="1e9"/>'), "sphere radius must be at most 10000 m, got 1e+09 m"),
    "origin": (shape('<sphere radius="1"/>', '<origin xyz="1 2"/>'), "origin xyz must be 3 numbers, got '1 2'"),
    "macro": ("<collision><xacro:x/></collision>", "must be expanded by xacro, got the macro <xacro:x>"),
    "no name": (shape("<mesh/>"), "<mesh> must have filename, got none"),
    "scale": (shape(MESH.format(' scale="1 0 1"')), "mesh scale must be from 1e-06 to 1e+06 in size, got 1 0 1"),
    "missing": (shape('<mesh filename="none.stl"/>'), "line 3: link 'b': mesh"),
    "http": (shape('<mesh filename="http://a/b.stl"/>'), "must be package://NAME/..., file://... or a relative path"),
    "package": (
        shape('<mesh filename="package://thing/ell.stl"/>'),
        "must be in one of the packages things, got 'thing'; did you mean 'things'?",
    ),
    "above": (shape('<mesh filename="package://things/../../x.stl"/>'), "must be in the folder of the URDF or of one"),
    "absolute": (shape('<mesh filename="/etc/passwd.stl"/>'), "must be in the folder of the URDF or of one"),
    "file": (shape('<mesh filename="file:///etc/passwd.stl"/>'), "must be in the folder of the URDF or of one"),
    "link": (shape('<mesh filename="leads_out.stl"/>'), "must be in the folder of the URDF or of one"),
    "pipe": (shape('<mesh filename="pipe.stl"/>'), "must be a plain file, got something else"),
}


@pytest.mark.parametrize("name", SHAPE_FAULTS)
def test_a_wrong_shape_is_one_fault_only_if_shapes_are_asked_for(tmp_path, things, name):
    text, words = SHAPE_FAULTS[name]
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "leads_out.stl").symlink_to(write(tmp_path, "out.stl", block((0, 0, 0), (1, 1, 1))))
    os.mkfifo(folder / "pipe.stl")
    file = small(folder / "r.urdf", text)
    assert Arm.from_urdf(file).geometry is None
    options = {"collision": True, "packages": {"things": things}}
    with pytest.raises(InvalidRobot) as caught:
        Arm.from_urdf(file, **options)
    (fault,) = caught.value.faults
    assert fault.startswith("line 3: link 'b': ")
    assert words in fault
    assert check_robot(file, **options).faults == (fault,)


def test_faults_of_shapes_and_of_the_arm_are_listed_together_by_line(tmp_path):
    wrong = '<inertial><mass value="-1"/></inertial>'
    file = small(tmp_path / "r.urdf", shape('<sphere radius="-1"/>'), wrong, shape('<mesh filename="x.stl"/>'))
    with pytest.raises(InvalidRobot) as caught:
        Arm.from_urdf(file, collision=True)
    assert [fault.partition(":")[0] for fault in caught.value.faults] == ["line 3", "line 4", "line 4", "line 5"]


def test_files_in_offered_folders_are_read_by_every_kind_of_name(tmp_path, things):
    folder = tmp_path / "robot"
    folder.mkdir()
    write(folder, "ell.stl", ell()[0])
    names = ["ell.stl", "../robot/ell.stl", f"file://{folder}/ell.stl", f"{things}/ell.stl", "package://things/ell.stl"]
    file = small(folder / "r.urdf", *(shape(f'<mesh filename="{name}"/>') for name in names))
    arm = Arm.from_urdf(file, collision=True, packages={"things": things})
    assert {piece.source.line for piece in arm.geometry.pieces} == {3, 4, 5, 6, 7}
    assert {piece.source.file for piece in arm.geometry.pieces} == {folder / "ell.stl", things / "ell.stl"}


@pytest.mark.parametrize(
    ("packages", "words"),
    [
        ("things", "packages must be folders by package"),
        ({1: "x"}, "packages must be folders by package"),
        ({"things": 5}, "packages['things'] must be a path, got 5"),
        ({"things": "none"}, "packages['things'] must be a folder, got no"),
    ],
)
def test_packages_that_are_no_folders_are_refused(tmp_path, unchecked, packages, words):
    file = small(tmp_path / "r.urdf", shape('<sphere radius="1"/>'))
    with pytest.raises(InvalidInput, match=re.escape(words)):
        Arm.from_urdf(file, collision=True, packages=packages)
    with pytest.raises(InvalidInput, match="collision must be True if packages are given, got False"):
        Arm.from_urdf(file, packages=packages)


def test_a_robot_of_primitives_needs_no_library_for_meshes(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "trimesh", None)
    file = small(tmp_path / "r.urdf", shape('<sphere radius="1"/>'))
    assert len(Arm.from_urdf(file, collision=True).geometry.pieces) == 1
    write(tmp_path, "cube.stl", block((0, 0, 0), (1, 1, 1)))
    small(tmp_path / "r.urdf", shape('<mesh filename="cube.stl"/>'))
    with pytest.raises(InvalidRobot, match=r'got no trimesh; pip install ".\[collision\]" installs it'):
        Arm.from_urdf(file, collision=True)


# Real arms, if their packages are installed


def robot_data():
    """Return the folder of the package example-robot-data."""
    try:
        found = [file for file in files("example-robot-data") or () if file.name == "panda.urdf"]
    except PackageNotFoundError:
        found = []
    if not found:
        pytest.skip("example-robot-data is not installed")
    return Path(found[0].locate()).resolve().parents[3]


REAL = {
    "panda_description/urdf/panda.urdf": ("panda_hand", 17),
    "ur_description/urdf/ur10_robot.urdf": ("tool0", 13),
    "talos_data/robots/talos_left_arm.urdf": ("wrist_left_ft_tool_link", 30),
}


@pytest.mark.parametrize("name", REAL)
def test_real_arms_have_few_pieces_where_pinocchio_puts_them(name):
    root = robot_data()
    tip, most = REAL[name]
    file = root / "robots" / name
    arm = Arm.from_urdf(file, tip=tip, collision=True, packages={"example-robot-data": root})
    assert len(arm.geometry.pieces) <= most
    assert compare(file, arm, {}, [root.parent]) >= 8
