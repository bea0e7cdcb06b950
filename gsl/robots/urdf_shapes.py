"""What the links of a URDF look like: primitives, and meshes where they are found and can be read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as xml

from gsl.core.body import MESH, Shape
from gsl.robots.frames import rpy
from gsl.robots.mesh_files import find_mesh
from gsl.robots.meshes import can_read
from gsl.robots.urdf_numbers import find_only, read_number, read_numbers, read_origin

FORMS = ("box", "sphere", "cylinder", MESH)
_GREY = (0.75, 0.77, 0.8)


class Looks:
    """Reads shapes of links and keeps what it had to leave out.

    Args:
        urdf: The file, which meshes are looked for beside.
        root: Of its elements.
        hulls: Whether meshes collide, as convex hulls.
    """

    def __init__(self, urdf: Path, root: xml.Element, *, hulls: bool) -> None:
        self._urdf, self._hulls = urdf, hulls
        self._colours = {
            node.get("name"): colour for node in root.findall("material") if (colour := _colour(node)) is not None
        }
        self._left: dict[str, list[str]] = {}
        self._colliding: list[Path] = []

    def read(self, link: xml.Element) -> tuple[Shape, ...]:
        """Return what a link looks like and collides with; what collides shows where it has no other looks.

        Raises:
            ValueError: A number is missing or is none.
        """
        looks = [shape for node in link.findall("visual") for shape in self._shape(node, collides=False)]
        bodies = [shape for node in link.findall("collision") for shape in self._shape(node, collides=True)]
        return (*looks, *(replace(shape, shown=not looks) for shape in bodies))

    def remarks(self) -> list[str]:
        """Return which meshes are left out, and why."""
        return [
            f"{len(names)} {'mesh is' if len(names) == 1 else 'meshes are'} not drawn ({_list(names)}): {why}"
            for why, names in self._left.items()
        ]

    def hull_files(self) -> tuple[Path, ...]:
        """Return the files of the meshes that collide."""
        return tuple(dict.fromkeys(self._colliding))

    def _shape(self, node: xml.Element, *, collides: bool) -> list[Shape]:
        geometry = find_only(node, "geometry")
        forms = [form for form in geometry if form.tag in FORMS] if geometry is not None else []
        if not forms:
            return []
        if len(forms) > 1:
            raise ValueError(f"a <geometry> has {len(forms)} shapes where one counts; keep one")
        form = forms[0]
        (x, y, z), turn = read_origin(node)
        place = (float(x), float(y), float(z))
        bare = Shape(form.tag, (1.0, 1.0, 1.0), place, collides, self._colour_of(node), turn=rpy(turn))
        if form.tag == "box":
            return [replace(bare, size=read_numbers(form.get("size", ""), 3, "size of a <box>"))]
        if form.tag == MESH:
            return self._mesh(form, bare)
        names = ("radius",) if form.tag == "sphere" else ("radius", "length")
        return [replace(bare, size=tuple(read_number(form, name, f"<{form.tag}>") for name in names))]

    def _mesh(self, form: xml.Element, shape: Shape) -> list[Shape]:
        """Return the shape with its file, if it is found and can be read, and shows or collides."""
        if shape.collides and not self._hulls:
            return []
        name = form.get("filename", "")
        try:
            scale = read_numbers(form.get("scale", "1 1 1"), 3, "its scale")
            file = find_mesh(name, self._urdf)
        except ValueError as error:
            why = str(error)
        else:
            if can_read(file):
                self._colliding += [file] if shape.collides else []
                return [replace(shape, size=scale, file=str(file))]
            why = "pip install 'gsl[mesh]' brings what reads them"
        names = self._left.setdefault(why, [])
        names += [word] if (word := Path(name).name) not in names else []
        return []

    def _colour_of(self, node: xml.Element) -> tuple[float, float, float]:
        material = find_only(node, "material")
        own = None if material is None else _colour(material) or self._colours.get(material.get("name"))
        return own or _GREY


def _colour(material: xml.Element) -> tuple[float, float, float] | None:
    colour = find_only(material, "color")
    if colour is None:
        return None
    red, green, blue, _ = read_numbers(colour.get("rgba", ""), 4, "rgba of a <color>")
    return red, green, blue


def _list(names: list[str]) -> str:
    return f"{names[0]} and {len(names) - 1} more" if len(names) > 1 else names[0]
