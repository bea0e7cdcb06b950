"""The robot as files that other programs and people can look at: its URDF and a picture of it standing."""

from __future__ import annotations

from pathlib import Path

from gsl.commandline.own_word import find_own_modules
from gsl.core.budget import holds
from gsl.core.trust import modules_in
from gsl.errors import ConfigError, InputError
from gsl.report.console import Console
from gsl.report.render import portrait
from gsl.robots.catalogue import robot
from gsl.robots.meshes import problems_of
from gsl.robots.urdf import urdf
from gsl.storage.whole import claim, explain_refusal


def write_robot(name: str, out: str, console: Console) -> None:
    """Write <name>.urdf and, of a robot that has shapes, <name>.png.

    Args:
        name: Of the robot, such as `nao`, or its file.
        out: As it is typed, out=DIR or DIR: the folder, made if it does not exist.
        console: Where to say so.

    Raises:
        ConfigError: if another setting is typed.
        InputError: if there is no such robot, its file describes none, or another file is in the way.
    """
    key, equals, value = out.partition("=")
    if equals and key != "out":
        raise ConfigError(key, "gsl robot has one setting, out=DIR", given=value)
    folder = Path(value if equals else out)
    find_own_modules(modules_in({"robot": name}))
    body = robot(name)
    model, picture = folder / f"{body.name}.urdf", folder / f"{body.name}.png"
    shown = any(link.looks for link in body.links.values())
    files = [str(model), str(picture)] if shown else [str(model)]
    remarks = [*body.remarks, *(f"not drawn: {problem}" for problem in problems_of(body))]
    remarks += [] if shown else ["no picture: none of its links has a shape that could be shown"]
    with claim(folder):
        folder.mkdir(parents=True, exist_ok=True)
    with explain_refusal(folder):
        text = urdf(body)
        _check_free(model, picture if shown else None, text)
        model.write_text(text, encoding="utf-8")
        if shown:
            portrait(body, picture)
    about = f"{body.name}: {len(body.controlled)} controlled joints, {len(body.links)} links, {body.mass:.3f} kg"
    lines = [about, *(f"remark: {remark}" for remark in remarks), *files]
    document = {
        "robot": body.name,
        "mass_kg": body.mass,
        "joints": list(body.controlled),
        "remarks": remarks,
        "files": files,
    }
    console.result(document, text="\n".join(lines))


def _check_free(model: Path, picture: Path | None, text: str) -> None:
    """Refuse to write over what is not of this robot: the same URDF, with a picture beside it, is written again."""
    again = not model.is_symlink() and holds(model, text.encode())
    taken = [path for path in (model, picture) if path is not None and (path.exists() or path.is_symlink())]
    if taken and not again or picture is not None and picture.is_symlink():
        raise InputError(f"{taken[0]}: exists, and is not what would be written; move it, or say another out=")
