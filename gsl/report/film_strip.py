"""One trajectory in a film: the robot in front of a camera that stands still, a ruler, the time, the way, the fall."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from gsl.core.body import Robot, lump
from gsl.core.trajectory import Trajectory
from gsl.report.style import INK, REAL
from gsl.worlds.camera import Camera, View
from gsl.worlds.start import HELD_AT, extent

OPENING = 24.0  # vertical angle of view [degrees]: a long lens, in which the ruler stays even
FARTHEST = 10.0  # of the camera [m]; the picture ends at 12
ROOM = 1.5  # height of a picture in heights of the robot
WIDEST, FLATTEST = 4.2, 2.0  # width through height: at most; where strips are put below each other
STEPS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0)  # of a ruler [m]
MARKS = 14  # of a ruler, at most
LETTERS, SMALL = 15, 12  # [pixels]
PLACE = 150  # of the way and the time at the right [pixels]
LIFT = 0.05  # of a robot that is held, above the floor on which another one walks, in its heights
STILL = 0.01  # way of a base that is held [m]


@dataclass(frozen=True)
class Scene:
    """What all strips of a film share.

    Attributes:
        view: Of the camera.
        width, height: Of a strip [pixels].
        beside: Whether strips stand side by side.
        marks: Where the ruler has its marks [m], shape (n, 3).
        start: Where the way begins [m].
        held: At which height a base is shown that is held in the air [m].
    """

    view: View
    width: int
    height: int
    beside: bool
    marks: np.ndarray
    start: float
    held: float

    @classmethod
    def of(cls, robot: Robot, trajectories: Sequence[Trajectory], width: int) -> Scene:
        """Return the scene in which all trajectories are seen whole in a film of so many pixels."""
        low, high = extent(lump(robot), np.array([robot.stance.get(name, 0.0) for name in robot.motors]))
        size = high - low
        way = np.concatenate([places(trajectory) for trajectory in trajectories])
        walking = any(walks(trajectory) for trajectory in trajectories)
        in_the_air = not all(walks(trajectory) for trajectory in trajectories)
        span = max(size[2], size[0]) if in_the_air else size[2]  # there limbs may turn from lying to standing
        first, last = way[:, 0].min() - 0.75 * span, way[:, 0].max() + 0.75 * span
        floor = 0.0 if walking else HELD_AT + low[2]
        held = float(LIFT * size[2] - low[2]) if walking else HELD_AT
        tall = ROOM * span
        ratio = float(np.clip((last - first) / tall, 0.8, WIDEST))
        beside = ratio < FLATTEST
        wide = _even(width / 2.0) if beside else width
        distance = min(max(tall, (last - first) / ratio) / 2.0 / math.tan(math.radians(OPENING / 2.0)), FARTHEST)
        side = float(way[:, 1].mean())
        middle = (0.5 * float(first + last), side, float(floor) + 0.31 * ROOM * float(size[2]))
        start = float(places(trajectories[0])[0, 0])
        view = View(middle, distance, yaw=90.0, pitch=-8.0, opening=OPENING)
        along = _ruler(float(first), float(last), start)
        marks = np.column_stack([along, np.full(len(along), side - 0.3 * size[2]), np.full(len(along), floor)])
        return cls(view, wide, _even(wide / ratio), beside, marks, start, held)


class Strip:
    """A trajectory that can be looked at, at any time.

    Args:
        camera: Of the robot.
        robot: Who moves.
        joints: Names of the columns of its positions.
        scene: What is seen of the world.
        title: Who moves and where.
        about: Under which conditions.
        trajectory: How.
    """

    def __init__(
        self,
        camera: Camera,
        robot: Robot,
        joints: Sequence[str],
        scene: Scene,
        title: str,
        about: str,
        trajectory: Trajectory,
    ) -> None:
        self._camera, self._robot, self._scene = camera, robot, scene
        self._joints, self._title, self._about, self._trajectory = joints, title, about, trajectory
        self._places, self._turns = places(trajectory, scene.held), turns(trajectory)
        self._ruler = camera.project(scene.marks, scene.view, scene.width, scene.height)
        fell = trajectory.fell
        self._fall = math.inf if fell is None or not fell.any() else float(trajectory.time[int(np.argmax(fell))])

    def picture(self, moment: float) -> np.ndarray:
        """Return what is seen at a time [s], shape (height, width, 3) of uint8; the last state where it has ended."""
        from PIL import Image, ImageDraw

        time, scene = self._trajectory.time, self._scene
        row = int(np.clip(np.searchsorted(time, moment + 1e-9, side="right") - 1, 0, len(time) - 1))
        angles = dict(zip(self._joints, self._trajectory.position[row], strict=True))
        angles |= {motor: angles[driver] for motor, driver in self._robot.coupled.items() if driver in angles}
        self._camera.pose(angles, self._places[row].tolist(), self._turns[row].tolist())
        image = Image.fromarray(self._camera.picture(scene.view, scene.width, scene.height, finer=1))
        draw = ImageDraw.Draw(image)
        self._draw_ruler(draw)
        draw.text((10, 6), self._title, fill=INK, font=_font(bold=True))
        beyond = 10 + draw.textlength(f"{self._title}  ", font=_font(bold=True))
        beside = beyond + draw.textlength(self._about, font=_font(SMALL)) < scene.width - PLACE
        draw.text((beyond, 8) if beside else (10, 28), self._about, fill=INK, font=_font(SMALL))
        draw.text((scene.width - 10, 6), self._say(row, moment), fill=INK, font=_font(), anchor="ra")
        if moment >= self._fall:
            draw.text(
                (scene.width - 10, 28), f"fell after {self._fall:.1f} s", fill=REAL, font=_font(bold=True), anchor="ra"
            )
        return np.asarray(image)

    def _say(self, row: int, moment: float) -> str:
        clock = f"{min(moment, float(self._trajectory.time[-1])):5.1f} s"
        way = round(self._places[row, 0] - self._scene.start, 2) + 0.0  # which makes 0 of -0
        return f"{way:.2f} m   {clock}" if walks(self._trajectory) else clock

    def _draw_ruler(self, draw: Any) -> None:
        """Draw marks on the floor with their distance from the start."""
        if not walks(self._trajectory):
            return
        draw.line([tuple(point) for point in self._ruler], fill=INK, width=1)
        for (x, y), along in zip(self._ruler, self._scene.marks[:, 0] - self._scene.start, strict=True):
            draw.line([(x, y), (x, y + 6)], fill=INK, width=1)
            if 2 * LETTERS < x < self._scene.width - 2 * LETTERS:
                unit = " m" if abs(along) < 1e-9 else ""  # once, at the start
                draw.text((x, y + 8), f"{along:g}{unit}", fill=INK, font=_font(), anchor="ma")


def compose(strips: Sequence[np.ndarray], scene: Scene, traces: np.ndarray) -> np.ndarray:
    """Return one picture of the strips, with the traces below."""
    whole = np.concatenate(strips, axis=1 if scene.beside else 0)
    return np.concatenate([whole, traces], axis=0)


def see(background: np.ndarray, *columns: float) -> np.ndarray:
    """Return the traces with a line at each time that is shown, at a column [pixels]."""
    shown = background.copy()
    shown[:, np.clip(np.round(columns).astype(int), 0, background.shape[1] - 1)] = (0, 0, 0)
    return shown


def places(trajectory: Trajectory, held: float = HELD_AT) -> np.ndarray:
    """Return where the base is [m], shape (T + 1, 3); where nobody knows, held in the air at a height [m]."""
    if not walks(trajectory):
        return np.tile([0.0, 0.0, held], (len(trajectory.time), 1))
    return np.column_stack([trajectory.sensors[f"base.position.{axis}"] for axis in "xyz"])


def turns(trajectory: Trajectory) -> np.ndarray:
    """Return the base's orientation x y z w, shape (T + 1, 4)."""
    names = [f"base.orientation.{part}" for part in "xyzw"]
    if not all(name in trajectory.sensors for name in names):
        return np.tile([0.0, 0.0, 0.0, 1.0], (len(trajectory.time), 1))
    return np.column_stack([trajectory.sensors[name] for name in names])


def walks(trajectory: Trajectory) -> bool:
    """Whether a trajectory says that its base went anywhere."""
    names = [f"base.position.{axis}" for axis in "xyz"]
    return all(name in trajectory.sensors and np.isfinite(trajectory.sensors[name]).all() for name in names) and any(
        np.ptp(trajectory.sensors[name]) > STILL for name in names
    )


def _ruler(first: float, last: float, start: float) -> np.ndarray:
    """Return where the marks are [m]: the finest step that has not too many of them."""
    step = next((step for step in STEPS if (last - first) / step <= MARKS), STEPS[-1])
    numbers = np.arange(math.ceil((first - start) / step), math.floor((last - start) / step) + 1)
    return start + step * numbers


def _even(number: float) -> int:
    """Return the nearest even number of pixels, as films want them."""
    return 2 * round(number / 2)


@cache
def _font(height: int = LETTERS, *, bold: bool = False) -> Any:
    import matplotlib
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(matplotlib.get_data_path(), "fonts", "ttf", name)), height)
