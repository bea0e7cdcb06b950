"""Pictures of a robot by Bullet's software renderer; besides engine.py the only file that imports pybullet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter

from gsl.core.body import Robot
from gsl.core.scratch import Scratch
from gsl.robots.urdf import urdf
from gsl.worlds.engine import quiet

TILE, TILES = 0.25, (34, 10)  # edge of a floor tile [m], how many ahead and aside
LIGHT = (1.2, -1.6, 2.2)  # direction towards it
SHADOW = 0.35  # how much darker the floor is in it
LIT = 300  # width and height of what the light sees [pixels]: fine enough for a shadow that is blurred
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


class Ground(NamedTuple):
    """What is seen where no robot is.

    Attributes:
        image: Floor and sky, shape (height, width, 3) of float32.
        depth: Of every pixel, shape (height, width).
        floor: Whether a pixel shows the floor, shape (height, width).
    """

    image: np.ndarray
    depth: np.ndarray
    floor: np.ndarray


class Camera:
    """A robot on a tiled floor that is posed, not simulated.

    The floor stands still, so it is drawn once for each view: its tiles take longer to draw than the robot.

    Args:
        robot: With its fixed joints; it shows its shapes.
    """

    def __init__(self, robot: Robot) -> None:
        with quiet(), Scratch() as folder:
            import pybullet

            self._bullet = pybullet
            self._bare, self._client = (pybullet.connect(pybullet.DIRECT) for _ in range(2))
            for name, text in (("floor", _floor()), ("robot", urdf(robot, meshes=Path(folder)))):
                Path(folder, f"{name}.urdf").write_text(text)
            pybullet.loadURDF(f"{folder}/floor.urdf", useFixedBase=True, physicsClientId=self._bare)
            self._body = pybullet.loadURDF(f"{folder}/robot.urdf", useFixedBase=True, physicsClientId=self._client)
        rows = [
            pybullet.getJointInfo(self._body, i, self._client)
            for i in range(pybullet.getNumJoints(self._body, self._client))
        ]
        self._joints = {row[1].decode(): row[0] for row in rows}
        self._centre = pybullet.getDynamicsInfo(self._body, -1, self._client)[3:5]
        self._place = [0.0, 0.0, 0.0]
        self._seen: tuple[View, tuple[int, int], Ground] | None = None

    def close(self) -> None:
        """Free the clients."""
        for client in (self._bare, self._client):
            self._bullet.disconnect(client)

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
        ground = self._ground(view, size)
        image = ground.image.copy()
        (left, upper, right, lower), shadow = self._shadow(eye, lens, size, 1.5 * finer)
        part = np.s_[upper:lower, left:right]
        image[part] *= 1.0 - SHADOW * (shadow * ground.floor[part])[..., None]
        colours, depth, seen = self._draw(self._client, eye, lens, size)
        robot = (seen >= 0) & (depth <= ground.depth)
        image[robot] = colours[robot]
        averaged: np.ndarray = image.reshape(height, finer, width, finer, 3).mean(axis=(1, 3)) if finer > 1 else image
        return averaged.round().astype(np.uint8)

    def project(self, points: np.ndarray, view: View, width: int, height: int) -> np.ndarray:
        """Return where points [m], shape (n, 3), are in a picture [pixels], shape (n, 2), right and down."""
        eye, lens = self._look(view, width / height)
        flat = np.column_stack([points, np.ones(len(points))]) @ _matrix(eye).T @ _matrix(lens).T
        return 0.5 * (1.0 + flat[:, :2] / flat[:, 3:] * [1.0, -1.0]) * [width, height]

    def _look(self, view: View, ratio: float) -> tuple[Sequence[float], Sequence[float]]:
        """Matrices of the camera's place and of its lens."""
        b = self._bullet
        eye = b.computeViewMatrixFromYawPitchRoll(list(view.target), view.distance, view.yaw - 90.0, view.pitch, 0.0, 2)
        return eye, b.computeProjectionMatrixFOV(view.opening, ratio, NEAR, FAR)

    def _ground(self, view: View, size: tuple[int, int]) -> Ground:
        """What is seen without the robot; kept until another view is wanted."""
        if self._seen is None or self._seen[:2] != (view, size):
            colours, depth, seen = self._draw(self._bare, *self._look(view, size[0] / size[1]), size)
            down = np.linspace(0.0, 1.0, size[1])[:, None, None]
            sky = (1.0 - down) * _SKY_TOP + down * _SKY_LOW
            image = np.where((seen < 0)[..., None], sky, colours).astype(np.float32)
            self._seen = view, size, Ground(image, depth, seen >= 0)
        return self._seen[2]

    def _draw(
        self, client: int, eye: Sequence[float], lens: Sequence[float], size: tuple[int, int]
    ) -> tuple[np.ndarray, ...]:
        """Colours, depth and number of the body at every pixel, below 0 where there is none."""
        _, _, pixels, depth, seen = self._bullet.getCameraImage(
            *size, eye, lens, lightDirection=LIGHT, lightColor=[1.0, 1.0, 1.0], shadow=0, lightAmbientCoeff=0.68,
            lightDiffuseCoeff=0.38, lightSpecularCoeff=0.05, renderer=self._bullet.ER_TINY_RENDERER,
            physicsClientId=client,
        )  # fmt: skip
        shape = (size[1], size[0])
        return np.reshape(pixels, (*shape, 4))[..., :3], np.reshape(depth, shape), np.reshape(seen, shape)

    def _shadow(
        self, eye: Sequence[float], lens: Sequence[float], size: tuple[int, int], blur: float
    ) -> tuple[tuple[int, int, int, int], np.ndarray]:
        """How much of the light the robot hides from the floor, 0 to 1, and where in the picture that is [pixels].

        It is what the light itself sees of the robot: the floor is a plane, so one picture is the other in perspective.
        """
        from PIL import Image

        b, light = self._bullet, (np.array(self._place) + 3.0 * np.array(LIGHT) / np.linalg.norm(LIGHT)).tolist()
        towards = b.computeViewMatrix(light, self._place, [0.0, 0.0, 1.0])
        beam = b.computeProjectionMatrixFOV(20.0, 1.0, NEAR, FAR)
        robot = self._draw(self._client, towards, beam, (LIT, LIT))[2] >= 0
        floor = _onto(towards, beam, (LIT, LIT)) @ np.linalg.inv(_onto(eye, lens, size))
        ways = (floor / floor[2, 2]).ravel()[:8].tolist()
        mask = Image.fromarray(np.where(robot, 255, 0).astype(np.uint8)).transform(
            size, Image.Transform.PERSPECTIVE, ways, Image.Resampling.BILINEAR
        )
        left, upper, right, lower = mask.getbbox() or (0, 0, 0, 0)
        edge = round(4.0 * blur)  # beyond it nothing is left of the blur
        box = max(left - edge, 0), max(upper - edge, 0), min(right + edge, size[0]), min(lower + edge, size[1])
        return box, gaussian_filter(np.asarray(mask.crop(box), dtype=np.float32) / 255.0, blur)


def _matrix(column_major: Sequence[float]) -> np.ndarray:
    return np.reshape(column_major, (4, 4)).T


def _onto(eye: Sequence[float], lens: Sequence[float], size: tuple[int, int]) -> np.ndarray:
    """Return the matrix from x, y, 1 of the floor [m] to right, down [pixels] and 1, but for a factor, shape (3, 3)."""
    x, y, _, w = (_matrix(lens) @ _matrix(eye))[:, [0, 1, 3]]
    return np.array([0.5 * size[0] * (w + x), 0.5 * size[1] * (w - y), w])


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
