"""The robot as files that other programs and people can look at: its URDF and a picture of it standing."""

from __future__ import annotations

from pathlib import Path

from gsl.report.console import Console
from gsl.report.render import portrait
from gsl.robots.catalogue import robot
from gsl.robots.urdf import urdf
from gsl.storage.whole import explained


def write_robot(name: str, folder: Path, console: Console) -> None:
    """Write <name>.urdf and, of a robot that has shapes, <name>.png.

    Args:
        name: Of the robot, such as `nao`, or its file.
        folder: Where to; made if it does not exist.
        console: Where to say so.

    Raises:
        InputError: if there is no such robot, or its file describes none.
    """
    body = robot(name)
    model, picture = folder / f"{body.name}.urdf", folder / f"{body.name}.png"
    shown = any(link.shapes for link in body.links.values())
    files = [str(model), str(picture)] if shown else [str(model)]
    remarks = [*body.remarks, *([] if shown else ["no picture: none of its links has a shape that could be shown"])]
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
        model.write_text(urdf(body), encoding="utf-8")
        if shown:
            portrait(body, picture)
    about = f"{body.name}: {len(body.controlled)} controlled joints, {len(body.links)} links, {body.mass:.3f} kg"
    told = [about, *(f"remark: {remark}" for remark in remarks), *files]
    document = {
        "robot": body.name,
        "mass_kg": body.mass,
        "joints": list(body.controlled),
        "remarks": remarks,
        "files": files,
    }
    console.result(document, text="\n".join(told))
