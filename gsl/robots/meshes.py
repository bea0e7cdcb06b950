"""What is in the files of meshes, and their convex hulls; trimesh reads them, an extra."""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from gsl.core.body import MESH, Robot, Shape
from gsl.core.budget import MESH_BYTES, TEXT_BYTES, open_file, within
from gsl.errors import InputError
from gsl.robots.frames import euler

_NEEDED = {".dae": ("trimesh", "collada")}
_KEPT = 256  # files whose meshes are kept: more than a humanoid has
_STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])


class Part(NamedTuple):
    """A part of a mesh, of one colour.

    Attributes:
        vertices: Shape (n, 3) [m].
        faces: Corners of triangles, indices of vertices, shape (m, 3).
        colour: Red, green, blue; None where the file says none.
    """

    vertices: np.ndarray
    faces: np.ndarray
    colour: tuple[float, float, float] | None


def can_read(file: Path) -> bool:
    """Whether the libraries are there that read a mesh."""
    needed = _NEEDED.get(file.suffix.lower(), ("trimesh",))
    return all(importlib.util.find_spec(name) is not None for name in needed)


def problems_of(robot: Robot) -> list[str]:
    """Return what keeps meshes from being drawn, one line a file."""
    lines: dict[str, None] = {}
    for link in robot.links.values():
        for shape in link.looks:
            try:
                if shape.kind == MESH:
                    _read(Path(shape.file))
            except InputError as error:
                lines[str(error)] = None
    return list(lines)


def draw_parts(shape: Shape) -> list[Part]:
    """Return the parts of a mesh as `parts_of` does, none of one that cannot be read: the rest of the robot shows."""
    try:
        return parts_of(shape)
    except InputError:
        return []


def parts_of(shape: Shape) -> list[Part]:
    """Return the parts of a mesh in the axes of its link.

    Raises:
        InputError: The file cannot be read, is too large, or holds no mesh.
    """
    turn, mirrored = euler(*shape.turn), np.prod(shape.size) < 0.0
    return [
        Part(
            part.vertices * np.array(shape.size) @ turn.T + np.array(shape.centre),
            part.faces[:, ::-1] if mirrored else part.faces,
            part.colour,
        )
        for part in _read(Path(shape.file))
    ]


def hull_of(shape: Shape) -> Part:
    """Return the convex hull of a mesh in the axes of its link.

    Raises:
        InputError: As `parts_of`, or the mesh is flat.
    """
    points = np.concatenate([part.vertices for part in parts_of(shape)])
    try:
        hull = ConvexHull(points)
    except QhullError as error:
        raise InputError(f"{shape.file}: is flat: it has no convex hull; leave its hull out (hulls: false)") from error
    corners = np.unique(hull.simplices)
    numbers = np.full(len(points), -1)
    numbers[corners] = np.arange(len(corners))
    return Part(points[corners], numbers[hull.simplices], None)


def write_stl(path: Path, part: Part) -> None:
    """Write a part as a binary STL file."""
    faces = np.zeros(len(part.faces), dtype=_STL)
    faces["corners"] = corners = part.vertices[part.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces["normal"] = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    path.write_bytes(bytes(80) + np.uint32(len(faces)).tobytes() + faces.tobytes())


def _read(file: Path) -> tuple[Part, ...]:
    try:
        return _load(file, (file.resolve(), file.stat().st_mtime_ns))
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}") from error


@lru_cache(maxsize=_KEPT)
def _load(file: Path, which: tuple[Path, int]) -> tuple[Part, ...]:
    """Return what is in a file; one that was changed is read again."""
    import trimesh

    with open_file(file, MESH_BYTES) as source:
        data = source.read()
    try:
        if file.suffix.lower() == ".dae" and b"<!ENTITY" in data:
            raise ValueError("it defines entities, which no mesh needs")
        with within(f"{file}: reading it"):
            scene = trimesh.load_scene(
                io.BytesIO(data), file_type=file.suffix[1:].lower(), resolver=_Materials(file.parent), process=False
            )
            parts = tuple(_part(mesh) for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces))
    except InputError:
        raise
    except Exception as error:  # trimesh raises whatever the damage leads to
        words = "" if isinstance(error, ImportError) else " ".join(f": {error}".split())[:100]
        raise InputError(f"{file}: is no mesh of its kind, or damaged{words}") from error
    if not parts:
        raise InputError(f"{file}: holds no mesh")
    return parts


def _part(mesh: Any) -> Part:
    vertices, faces = np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64)
    if not np.isfinite(vertices).all() or faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError("a vertex is missing or no number")
    unit = str(mesh.metadata.get("units", "")).partition(" * meters")  # of a Collada file, as trimesh tells it
    return Part(vertices * (float(unit[0]) if unit[1] else 1.0), faces, _colour(mesh.visual))


def _colour(visual: Any) -> tuple[float, float, float] | None:
    if not visual.defined:
        return None
    main = getattr(getattr(visual, "material", visual), "main_color", None)
    if main is None:
        return None
    red, green, blue = (float(value) / 255.0 for value in np.asarray(main)[:3])
    return red, green, blue


class _Materials(Mapping[str, bytes]):
    """The materials (.mtl) beside a mesh, which trimesh asks for; no textures, and nothing from elsewhere."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def __getitem__(self, name: str) -> bytes:
        path = self._folder / Path(name).name
        if path.suffix.lower() != ".mtl" or not path.is_file() or path.resolve().parent != self._folder.resolve():
            raise KeyError(name)
        try:
            with open_file(path, TEXT_BYTES) as file:
                return file.read()
        except InputError as error:
            raise KeyError(name) from error

    def get(self, name: str, default: Any = None) -> Any:
        """As the mapping says; trimesh calls this one for textures too, of which there are none."""
        return self[name]

    def __iter__(self) -> Any:
        return iter(())

    def __len__(self) -> int:
        return 0
