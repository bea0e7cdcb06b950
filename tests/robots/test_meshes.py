"""Meshes of a URDF: where they are looked for, what is read of them, what collides."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import trimesh

from gsl.core.body import MESH, Joint, Link, Robot, Shape
from gsl.core.budget import MESH_BYTES
from gsl.errors import InputError
from gsl.robots.catalogue import read_files, robot
from gsl.robots.mesh_files import find_mesh
from gsl.robots.meshes import can_read, draw_parts, hull_of, parts_of, problems_of
from gsl.worlds.camera import Camera, View
from gsl.worlds.start import extent, lowest_point

pytestmark = pytest.mark.slow

ARM = """<robot name="arm"><material name="paint"><color rgba="0.9 0.1 0.1 1"/></material>
<link name="base"/>
<link name="bar"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<visual><origin xyz="0 0 1" rpy="0 0 1.5707963267948966"/><geometry><mesh filename="{file}" scale="{scale}"/></geometry>
<material name="paint"/></visual>
<collision><geometry><mesh filename="{file}"/></geometry></collision>
<collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="base"/><child link="bar"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
EDGES = (0.4, 0.2, 0.6)


@pytest.fixture
def made(tmp_path: Path) -> Callable[..., Path]:
    """A robot whose bar is a box of EDGES, in a package's folder `arm/urdf`."""

    def make(file: str = "../meshes/bar.stl", scale: str = "1 1 1") -> Path:
        home = tmp_path / "arm" / "urdf"
        for folder in (home, tmp_path / "arm/meshes", tmp_path / "other"):
            folder.mkdir(parents=True, exist_ok=True)
        box = trimesh.creation.box(extents=EDGES)
        for kind in ("stl", "obj", "dae"):
            box.export(tmp_path / f"arm/meshes/bar.{kind}")
        box.export(tmp_path / "other/bar.stl")
        (home / "arm.urdf").write_text(ARM.format(file=file, scale=scale))
        return home / "arm.urdf"

    return make


def bar(file: Path) -> Shape:
    (shape,) = [shape for shape in robot(str(file)).links["bar"].looks if shape.kind == MESH]
    return shape


@pytest.mark.parametrize("kind", ["stl", "obj", "dae"])
def test_a_mesh_stands_where_its_origin_says(made: Callable[..., Path], kind: str) -> None:
    shape = bar(made(f"../meshes/bar.{kind}", "1 2 0.5"))
    points = np.concatenate([part.vertices for part in parts_of(shape)])
    half = 0.5 * np.array([2.0 * EDGES[1], EDGES[0], 0.5 * EDGES[2]])  # turned by a quarter about z
    np.testing.assert_allclose(points.min(axis=0), [0.0, 0.0, 1.0] - half, atol=1e-6)
    np.testing.assert_allclose(points.max(axis=0), [0.0, 0.0, 1.0] + half, atol=1e-6)


def test_a_collada_file_in_inches_is_read_in_metres(made: Callable[..., Path], tmp_path: Path) -> None:
    file = made("../meshes/bar.dae")
    mesh = tmp_path / "arm/meshes/bar.dae"
    inches = '<unit name="inch" meter="0.0254"/>'
    mesh.write_text(mesh.read_text().replace("</asset>", f"{inches}</asset>", 1))
    points = np.concatenate([part.vertices for part in parts_of(bar(file))])
    assert np.ptp(points[:, 2]) == pytest.approx(0.0254 * EDGES[2])


def test_a_mirrored_mesh_keeps_its_outside(made: Callable[..., Path]) -> None:
    for scale in ("1 1 1", "-1 1 1"):
        (part,) = parts_of(bar(made(scale=scale)))
        assert trimesh.Trimesh(part.vertices, part.faces).volume == pytest.approx(np.prod(EDGES), rel=1e-5)


def test_colours_are_the_materials_of_the_whole_file_or_those_of_the_mesh(
    made: Callable[..., Path], tmp_path: Path
) -> None:
    shape = bar(made())
    assert shape.colour == (0.9, 0.1, 0.1) and parts_of(shape)[0].colour is None
    (tmp_path / "arm/meshes/bar.mtl").write_text("newmtl blue\nKd 0 0 1\nmap_Kd ../../secret.png\n")
    mesh = tmp_path / "arm/meshes/bar.obj"
    made()
    mesh.write_text("mtllib bar.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl blue\nf 1 2 3\nf 1 2 4\n")
    (part,) = parts_of(Shape(MESH, (1.0, 1.0, 1.0), file=str(mesh)))
    assert part.colour == (0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    "name",
    [
        *("../meshes/bar.stl", "package://arm/meshes/bar.stl", "package://arm_description/meshes/bar.stl"),
        *("package://other/bar.stl", "file://{home}/arm/meshes/bar.stl", "../../other/bar.stl"),
    ],
)
def test_meshes_are_found_beside_the_file_and_in_packages(made: Callable[..., Path], name: str, tmp_path: Path) -> None:
    file = made()
    (tmp_path / "arm/package.xml").write_text("<package><name> arm_description </name></package>")
    assert find_mesh(name.format(home=tmp_path), file) in [tmp_path / "arm/meshes/bar.stl", tmp_path / "other/bar.stl"]


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("none.stl", "not there"),
        ("package://elsewhere/bar.stl", "outside of its folder"),
        ("package://arm/../../../far/bar.stl", "outside of its folder"),
        ("../../../far/bar.stl", "outside of its folder"),
        ("link.stl", "outside of its folder"),
        ("file:///etc/passwd.stl", "outside of its folder"),
        ("../../../../../../../../../etc/hostname", "no STL, OBJ or DAE file"),
        ("bar.glb", "no STL, OBJ or DAE file"),
        ("", "no STL, OBJ or DAE file"),
    ],
)
def test_meshes_elsewhere_are_not_looked_at(made: Callable[..., Path], name: str, why: str, tmp_path: Path) -> None:
    deep = made().parent / "a/b"
    deep.mkdir(parents=True)
    far = deep.parents[1] / "far"
    far.mkdir()
    trimesh.creation.box(extents=EDGES).export(far / "bar.stl")
    (deep / "arm").mkdir()
    (deep / "link.stl").symlink_to(tmp_path / "other/bar.stl")
    with pytest.raises(ValueError, match=why):
        find_mesh(name, deep / "arm.urdf")


def test_what_is_left_out_is_told(made: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    remarks = robot(str(made("none.stl"))).remarks
    assert "1 mesh is not drawn (none.stl): not there" in remarks
    assert (
        "1 mesh is not drawn (bar.stl): its scale must be 3 finite numbers, not '1 1'"
        in robot(str(made(scale="1 1"))).remarks
    )
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    body = robot(str(made()))
    assert "1 mesh is not drawn (bar.stl): pip install 'gsl[mesh]' brings what reads them" in body.remarks
    assert [shape.kind for shape in body.links["bar"].looks] == ["sphere"]  # what collides, for want of other looks


def test_libraries_that_are_missing_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    there = importlib.util.find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "collada" else there(name))
    assert can_read(Path("a.stl")) and can_read(Path("a.OBJ")) and not can_read(Path("a.dae"))


@pytest.mark.parametrize(
    ("kind", "content", "line"),
    [
        ("stl", b"solid nothing", "holds no mesh"),
        ("obj", b"v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n", "is no mesh of its kind, or damaged"),
        ("obj", b"# empty\n", "holds no mesh"),
        ("dae", b'<!DOCTYPE a [<!ENTITY b "c">]><COLLADA/>', "damaged: it defines entities"),
        ("dae", b"\x00\x01", "is no mesh of its kind, or damaged"),
        ("stl", b"\x00" * 80 + b"\xff\xff\xff\xff", "is no mesh of its kind, or damaged"),
    ],
)
def test_a_damaged_mesh_leaves_the_rest_to_be_drawn(
    made: Callable[..., Path], kind: str, content: bytes, line: str, tmp_path: Path
) -> None:
    file, mesh = made(f"../meshes/bar.{kind}"), tmp_path / f"arm/meshes/bar.{kind}"
    mesh.write_bytes(content)
    body = robot(str(file))
    (problem,) = problems_of(body)
    assert problem.startswith(f"{mesh}: ") and line in problem and "\n" not in problem
    assert draw_parts(bar(file)) == []
    with closing(Camera(body)) as camera:
        assert camera.picture(View((0.0, 0.0, 0.0), 3.0), 40, 40).shape == (40, 40, 3)


def test_a_mesh_has_a_budget(made: Callable[..., Path]) -> None:
    shape = bar(made())
    with Path(shape.file).open("r+b") as file:
        file.truncate(MESH_BYTES + 1)
    with pytest.raises(InputError, match="100,000,001 bytes; 100,000,000 are read at most"):
        parts_of(shape)


def test_a_picture_shows_it_in_its_colour(made: Callable[..., Path]) -> None:
    body = robot(str(made()))
    low, high = extent(body, np.zeros(1))
    np.testing.assert_allclose([low[2], high[2]], [0.0, 1.3], atol=1e-6)
    with closing(Camera(body)) as camera:
        middle = camera.picture(View((0.0, 0.0, 1.0), 3.0), 60, 60)[30, 30].astype(float)
    assert middle[0] > 2.0 * middle[1]


def test_a_hull_holds_all_and_is_a_file_of_the_world(made: Callable[..., Path]) -> None:
    file = made()
    assert not [shape for shape in robot(str(file)).links["bar"].shapes if shape.collides and shape.kind == MESH]
    own = file.with_name("robot.yaml")
    own.write_text("urdf: arm.urdf\nhulls: true\n")
    (shape,) = [s for s in robot(str(own)).links["bar"].shapes if s.collides and s.kind == MESH]
    assert not shape.shown
    hull = hull_of(shape)
    assert trimesh.Trimesh(hull.vertices, hull.faces).convex_hull.volume == pytest.approx(np.prod(EDGES), rel=1e-5)
    assert {"robot", "robot.urdf", "robot.bar.stl"} == read_files(str(own)).keys()
    own.write_text("urdf: arm.urdf\n")
    assert {"robot", "robot.urdf"} == read_files(str(own)).keys()


def test_a_flat_mesh_has_no_hull(tmp_path: Path) -> None:
    mesh = tmp_path / "flat.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 3 4\n")
    with pytest.raises(InputError, match="is flat: it has no convex hull"):
        hull_of(Shape(MESH, (1.0, 1.0, 1.0), file=str(mesh)))


def test_what_falls_comes_to_rest_on_its_hull(tmp_path: Path) -> None:
    """A block on a stalk, its hull below: its lowest vertices carry it, at half the height of the block."""
    mesh = tmp_path / "block.stl"
    trimesh.creation.box(extents=(0.3, 0.3, 0.1)).export(mesh)
    sole = Shape(MESH, (1.0, 1.0, 1.0), (0.0, 0.0, 0.05), collides=True, file=str(mesh))
    base = Link("base", 2.0, np.zeros(3), 0.02 * np.eye(3), (sole,))
    top = Link("top", 0.1, np.zeros(3), 1e-3 * np.eye(3))
    joint = Joint("j", "base", "top", np.array([0.0, 0.0, 0.1]), np.array([0.0, 0.0, 1.0]), -1.0, 1.0, 1.0, 1.0, 0.01)
    body = Robot("block", {"base": base, "top": top}, (joint,), ("j",), feet={"left": "base"}, gains={"j": (5.0, 0.5)})
    assert lowest_point(body, np.zeros(1)) == pytest.approx(0.0, abs=1e-9)
    from gsl.core.plant import nominal
    from gsl.worlds.engine import Engine
    from gsl.worlds.physics import Physics
    from gsl.worlds.start import resting

    engine = Engine(nominal(body), Physics(0.002, 50, 0.02, floating=True))
    begin = resting(body, np.zeros(1), np.zeros(1), floating=True)
    engine.load(begin.reading, begin.commands)
    for _ in range(50):
        engine.run(np.zeros(1))
    reading = engine.read()
    engine.close()
    assert abs(reading.place[2]) < 2e-3 and reading.up > 0.9999
    assert reading.foot_force[0] == pytest.approx(2.1 * 9.81, rel=0.02)
