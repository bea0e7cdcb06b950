"""A picture of the robot standing."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import numpy as np

from gsl.core.body import Robot, lump
from gsl.worlds.camera import Camera, View
from gsl.worlds.start import extent

FAR_ENOUGH = 2.5  # of the camera, in diagonals of the robot


def portrait(robot: Robot, path: Path, *, width: int = 800, height: int = 900) -> None:
    """Write a picture of the robot standing in its stance."""
    from PIL import Image

    body = lump(robot)
    positions = np.array([robot.stance.get(name, 0.0) for name in robot.motors])
    low, high = extent(body, positions)
    place = (0.0, 0.0, -low[2])
    with closing(Camera(robot)) as camera:
        camera.pose(dict(zip(robot.motors, positions, strict=True)), place, (0.0, 0.0, 0.0, 1.0))
        middle, size = 0.5 * (low + high) - [0.0, 0.0, low[2]], float(np.linalg.norm(high - low))
        image = camera.picture(View(middle.tolist(), FAR_ENOUGH * size), width, height)
    Image.fromarray(image).save(path)
