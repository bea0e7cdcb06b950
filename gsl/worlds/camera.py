"""Pictures of a robot by Bullet's software renderer; besides engine.py the only file that imports pybullet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter

from gsl.core.body import Robot
from gsl.core.scratch import Scratch
from gsl.robots.urdf import urdf
from gsl.worlds.engine import quiet

TILE, TILES = 0.25, (34, 10)  # edge of a floor tile [m], how many ahead and aside
LIGHT = (1.2, -1.6, 2.2)  # direction towards it
SHADOW = 0.35  # how much darker the floor is in it
NEAR, FAR = 0.3, 12.0  # what is drawn [m]
_SKY_TOP, _SKY_LOW = np.array([205.0, 220.0, 238.0]), np.array([248.0, 249.0, 251.0])


@dataclass(frozen=True)
class View:
    """From where a picture is taken.

    Attributes:
        target: Point in the middle of the picture [m], shape (3,).
        distance: Of the camera from it [m].
        yaw, pitch: Direction of the camera [degrees]; yaw 0 looks ahead from behind, 90 from the right, pitch < 0 down.
        opening: Vertical angle of view [degrees].
    """

    target: Sequence[float]
    distance: float
    yaw: float = 145.0
    pitch: float = -12.0
    opening: float = 24.0


class Camera:
    """A robot on a tiled floor that is posed, not simulated.

    Args:
        robot: With its fixed joints; it shows its shapes.
    """

    def __init__(self, robot: Robot) -> None:
        with quiet(), Scratch() as folder:
            import pybullet

            self._bullet, self._client = pybullet, pybullet.connect(pybullet.DIRECT)
            for name, text in (("floor", _floor()), ("robot", urdf(robot, meshes=Path(folder)))):
                Path(folder, f"{name}.urdf").write_text(text)
            load = {"useFixedBase": True, "physicsClientId": self._client}
            self._floor = pybullet.loadURDF(f"{folder}/floor.urdf", **load)
            self._body = pybullet.loadURDF(f"{folder}/robot.urdf", **load)
        rows = [
            pybullet.getJointInfo(self._body, i, self._client)
            for i in range(pybullet.getNumJoints(self._body, self._client))
        ]
        self._joints = {row[1].decode(): row[0] for row in rows}
        self._centre = pybullet.getDynamicsInfo(self._body, -1, self._client)[3:5]
        self._place = [0.0, 0.0, 0.0]

    def close(self) -> None:
        """Free the client."""
        self._bullet.disconnect(self._client)

    def pose(self, angles: Mapping[str, float], place: Sequence[float], quaternion: Sequence[float]) -> None:
        """Put the robot somewhere.

        Args:
            angles: Joint positions by name [rad]; what is not named stays.
            place: Of the base's link frame in world axes [m], shape (3,).
            quaternion: Its orientation, x y z w.
        """
        b, client, self._place = self._bullet, self._client, list(place)
        b.resetBasePositionAndOrientation(
            self._body, *b.multiplyTransforms(list(place), list(quaternion), *self._centre), physicsClientId=client
        )
        for name, angle in angles.items():
            b.resetJointState(self._body, self._joints[name], float(angle), physicsClientId=client)

    def picture(self, view: View, width: int, height: int, *, finer: int = 2) -> np.ndarray:
        """Return an image, shape (height, width, 3) of uint8, drawn `finer` times as large and averaged."""
        size = (finer * width, finer * height)
        eye, lens = self._look(view, width / height)
        colours, depth, seen = self._draw(eye, lens, size)
        places = _places(depth, eye, lens)
        shade = 1.0 - SHADOW * gaussian_filter(self._shadow(places), 1.5 * finer)
        image = np.where((seen == self._floor)[..., None], colours * shade[..., None], colours)
        down = np.linspace(0.0, 1.0, size[1])[:, None, None]
        image = np.where((seen < 0)[..., None], (1.0 - down) * _SKY_TOP + down * _SKY_LOW, image)
        averaged: np.ndarray = image.reshape(height, finer, width, finer, 3).mean(axis=(1, 3)).round().astype(np.uint8)
        return averaged

    def project(self, points: np.ndarray, view: View, width: int, height: int) -> np.ndarray:
        """Return where points [m], shape (n, 3), are in a picture [pixels], shape (n, 2), right and down."""
        eye, lens = self._look(view, width / height)
        flat = _with_ones(points) @ _matrix(eye).T @ _matrix(lens).T
        return 0.5 * (1.0 + flat[:, :2] / flat[:, 3:] * [1.0, -1.0]) * [width, height]

    def _look(self, view: View, ratio: float) -> tuple[Sequence[float], Sequence[float]]:
        """Matrices of the camera's place and of its lens."""
        b = self._bullet
        eye = b.computeViewMatrixFromYawPitchRoll(list(view.target), view.distance, view.yaw - 90.0, view.pitch, 0.0, 2)
        return eye, b.computeProjectionMatrixFOV(view.opening, ratio, NEAR, FAR)

    def _draw(self, eye: Sequence[float], lens: Sequence[float], size: tuple[int, int]) -> tuple[np.ndarray, ...]:
        """Colours, depth and number of the body at every pixel."""
        _, _, pixels, depth, seen = self._bullet.getCameraImage(
            *size, eye, lens, lightDirection=LIGHT, lightColor=[1.0, 1.0, 1.0], shadow=0, lightAmbientCoeff=0.68,
            lightDiffuseCoeff=0.38, lightSpecularCoeff=0.05, renderer=self._bullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )  # fmt: skip
        shape = (size[1], size[0])
        return np.reshape(pixels, (*shape, 4))[..., :3].astype(float), np.reshape(depth, shape), np.reshape(seen, shape)

    def _shadow(self, places: np.ndarray) -> np.ndarray:
        """1 where the robot hides the light from a place, else 0: it is what the light itself sees there."""
        b, size = self._bullet, 400
        light = (np.array(self._place) + 3.0 * np.array(LIGHT) / np.linalg.norm(LIGHT)).tolist()
        eye = b.computeViewMatrix(light, self._place, [0.0, 0.0, 1.0])
        lens = b.computeProjectionMatrixFOV(20.0, 1.0, NEAR, FAR)
        robot = self._draw(eye, lens, (size, size))[2] == self._body
        flat = _with_ones(places) @ _matrix(eye).T @ _matrix(lens).T
        x, y = flat[..., 0] / flat[..., 3], -flat[..., 1] / flat[..., 3]
        column, row = (np.clip((0.5 * (part + 1.0) * size).astype(int), 0, size - 1) for part in (x, y))
        inside = (np.abs(x) < 1.0) & (np.abs(y) < 1.0)
        return np.where(inside, robot[row, column], False).astype(float)


def _with_ones(points: np.ndarray) -> np.ndarray:
    return np.concatenate([points, np.ones_like(points[..., :1])], axis=-1)


def _matrix(column_major: Sequence[float]) -> np.ndarray:
    return np.reshape(column_major, (4, 4)).T


def _places(depth: np.ndarray, eye: Sequence[float], lens: Sequence[float]) -> np.ndarray:
    """World coordinates [m] of what every pixel shows, shape (height, width, 3)."""
    height, width = depth.shape
    x, y = np.meshgrid((np.arange(width) + 0.5) / width * 2.0 - 1.0, 1.0 - (np.arange(height) + 0.5) / height * 2.0)
    flat = np.stack([x, y, 2.0 * depth - 1.0, np.ones_like(x)], axis=-1)
    places: np.ndarray = flat @ np.linalg.inv(_matrix(lens) @ _matrix(eye)).T
    places = places[..., :3] / places[..., 3:]
    return places


def _floor() -> str:
    """URDF of a floor of tiles in two shades, from a little behind the origin to far ahead."""
    tiles = "".join(
        f'<visual><origin xyz="{(i - 8) * TILE:.3f} {(j - TILES[1] // 2) * TILE:.3f} -0.01"/>'
        f'<geometry><box size="{TILE} {TILE} 0.02"/></geometry>'
        f'<material name="shade{(i + j) % 2}"><color rgba="{shade} {shade} {shade + 0.02} 1"/></material></visual>\n'
        for i in range(TILES[0])
        for j in range(TILES[1])
        for shade in [(0.78, 0.86)[(i + j) % 2]]
    )
    body = f'<inertial><mass value="0"/>\n{_NO_INERTIA}</inertial>\n{tiles}'
    return f'<robot name="floor"><link name="floor">{body}</link></robot>'


_NO_INERTIA = '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>'
