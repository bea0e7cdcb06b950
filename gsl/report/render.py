"""Pictures of the robot: standing, and as a strip of a walk posed from logged angles."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.trajectory import Trajectory
from gsl.worlds.camera import Camera, View
from gsl.worlds.start import extent

FAR_ENOUGH = 2.5  # of the camera, in diagonals of the robot


def portrait(robot: Robot, path: Path, *, width: int = 800, height: int = 900) -> None:
    """Write a picture of the robot standing in its stance."""
    body = lump(robot)
    positions = np.array([robot.stance.get(name, 0.0) for name in robot.motors])
    low, high = extent(body, positions)
    place = (0.0, 0.0, -low[2])
    with _camera(robot) as camera:
        camera.pose(dict(zip(robot.motors, positions, strict=True)), place, (0.0, 0.0, 0.0, 1.0))
        middle, size = 0.5 * (low + high) - [0.0, 0.0, low[2]], float(np.linalg.norm(high - low))
        _write(camera.picture(View(middle.tolist(), FAR_ENOUGH * size), width, height), path)


def walk_strip(robot: Robot, trajectory: Trajectory, path: Path, *, frames: int = 8, height: int = 260) -> None:
    """Write equally spaced moments of a walk side by side, seen from the side."""
    rows = np.linspace(0, len(trajectory), frames).round().astype(int)
    with _camera(robot) as camera:
        pictures = [_frame(camera, robot, trajectory, row, round(0.62 * height), height) for row in rows]
    _write(np.concatenate(pictures, axis=1), path)


def _frame(camera: Camera, robot: Robot, trajectory: Trajectory, row: int, width: int, height: int) -> np.ndarray:
    sensors = trajectory.sensors
    place = [float(sensors[f"base.position.{axis}"][row]) for axis in "xyz"]
    turn = [float(sensors[f"base.orientation.{part}"][row]) for part in "xyzw"]
    angles = dict(zip(robot.controlled, trajectory.position[row], strict=True))
    angles |= {motor: angles[driver] for motor, driver in robot.coupled.items()}
    camera.pose(angles, place, turn)
    middle = (place[0], place[1], 0.27)
    return camera.picture(View(middle, 1.7, yaw=115.0, pitch=-8.0), width, height)


@contextmanager
def _camera(robot: Robot) -> Iterator[Camera]:
    camera = Camera(robot)
    try:
        yield camera
    finally:
        camera.close()


def _write(image: np.ndarray, path: Path) -> None:
    from PIL import Image

    Image.fromarray(image).save(path)
