"""Where the meshes are that a URDF names: beside it, or in its package; never further away.

    meshes/arm.stl, ../meshes/arm.stl         as seen from the URDF
    package://arm_description/meshes/arm.stl  in a folder above the URDF of that name, or whose package.xml says it
    file:///home/me/arm/meshes/arm.stl        as it is, if it lies where the above may

A URDF may be somebody else's: it names no file beyond those folders, and links that lead out of them are not followed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

from gsl.core.budget import TEXT_BYTES, read_text
from gsl.errors import InputError

SUFFIXES = (".stl", ".obj", ".dae")
ABOVE = 2  # folders above the URDF that a path may lead through: robot/urdf/v2/arm.urdf, robot/meshes/arm.stl
PACKAGE_ABOVE = 6  # folders above the URDF in which its package is looked for
_PACKAGE, _FILE = "package://", "file://"
_NAME = re.compile(r"<name>\s*([\w.-]+)\s*</name>")


def find_mesh(name: str, urdf: Path) -> Path:
    """Return the file of a mesh.

    Args:
        name: As the URDF writes it.
        urdf: The file that names it.

    Raises:
        ValueError: It says in a few words why there is none.
    """
    if not name.lower().endswith(SUFFIXES):
        raise ValueError("no STL, OBJ or DAE file")
    home = urdf.resolve().parent
    places = list(_in_packages(name, home) if name.startswith(_PACKAGE) else _beside(name, home))
    there = [(root, path) for root, path in places if path.is_file()]
    if not there:
        raise ValueError("not there" if places else "outside of its folder")
    inside = [path for root, path in there if path.resolve().is_relative_to(root)]
    if not inside:
        raise ValueError("outside of its folder")
    return inside[0].resolve()


def _beside(name: str, home: Path) -> Iterator[tuple[Path, Path]]:
    """Yield the folder that a path may not lead out of, with the path."""
    text = unquote(name.removeprefix(_FILE)) if name.startswith(_FILE) else name
    for root in _above(home, ABOVE):
        path = home / text
        if path.resolve().is_relative_to(root):
            yield root, path


def _in_packages(name: str, home: Path) -> Iterator[tuple[Path, Path]]:
    package, _, rest = name.removeprefix(_PACKAGE).partition("/")
    for folder in _above(home, PACKAGE_ABOVE):
        if folder.name == package or _says(folder / "package.xml") == package:
            yield folder, folder / rest
        if (folder / package).is_dir():
            yield folder / package, folder / package / rest


def _above(home: Path, count: int) -> list[Path]:
    """Return a folder and those above it, but for the root of all files and where people have theirs."""
    shared = {Path(home.anchor), *Path.home().parents, Path.home()}
    return [folder for folder in (home, *home.parents[:count]) if folder not in shared or folder == home]


def _says(file: Path) -> str:
    """Return the name that a package.xml says, nothing if there is none."""
    if not file.is_file():
        return ""
    try:
        named = _NAME.search(read_text(file, TEXT_BYTES))
    except InputError:
        return ""
    return named.group(1) if named else ""
