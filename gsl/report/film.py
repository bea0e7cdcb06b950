"""Films of trajectories: each in a strip of its own, from one camera that stands still, with a ruler on the floor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gsl.core.body import Robot
from gsl.core.trajectory import Trajectory
from gsl.errors import InputError
from gsl.report.film_strip import Scene, Strip, compose, see
from gsl.report.film_traces import draw_traces
from gsl.worlds.camera import Camera

WIDTH = 840  # of a film [pixels]
RATE = 10.0  # pictures a second: a GIF counts in hundredths of a second
SHEET = 8  # moments of a contact sheet: even in one, two and four columns
FORMATS = (".gif", ".mp4", ".png")
COLOURS = 96  # of a GIF
LONGEST = 1200  # pictures of a film, two minutes


class Shot(NamedTuple):
    """A trajectory to be shown.

    Attributes:
        who, where: Such as "generation_05" and "on the real side".
        trajectory: What is shown.
        colour: Of its curve, "#rrggbb".
        about: Under which conditions, such as the world, the command and the seed.
    """

    who: str
    where: str
    trajectory: Trajectory
    colour: str
    about: str = ""

    @property
    def title(self) -> str:
        """What is written above it."""
        return f"{self.who} {self.where}".strip()


def check_format(path: Path) -> None:
    """Refuse a film that cannot be written, before anything is simulated for it.

    Raises:
        InputError: Its name ends otherwise, or a library is missing.
    """
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"{path}: a film is .gif or .mp4, a contact sheet .png; choose such a name with out=")
    if path.suffix.lower() == ".mp4":
        try:
            import imageio_ffmpeg  # noqa: F401
        except ImportError as error:
            raise InputError(f"{path}: needs imageio-ffmpeg; pip install 'gsl[film]', or write a .gif") from error


def film(robot: Robot, joints: Sequence[str], shots: Sequence[Shot], path: Path, *, slow: float = 1.0) -> None:
    """Write a film, or a contact sheet if `path` ends in .png.

    Args:
        robot: It shows its shapes.
        joints: Names of the columns of all trajectories' positions, in order.
        shots: What is shown, one below the other, or side by side if nobody goes far.
        path: Of the file.
        slow: How many times slower than real time.

    Raises:
        InputError: The film would be longer than two minutes.
    """
    duration = max(float(shot.trajectory.time[-1]) for shot in shots)
    moments = np.linspace(0.0, duration, SHEET) if path.suffix == ".png" else np.arange(0.0, duration, 1 / RATE / slow)
    if len(moments) > LONGEST:
        seconds = len(moments) / RATE
        raise InputError(
            f"{path}: would last {seconds:.0f} s; {LONGEST / RATE:.0f} s are the most, choose a smaller slow="
        )
    scene = Scene.of(robot, [shot.trajectory for shot in shots], WIDTH)
    with closing(Camera(robot)) as camera:
        strips = [Strip(camera, robot, joints, scene, shot.title, shot.about, shot.trajectory) for shot in shots]
        if path.suffix == ".png":
            rows = _draw_sheet(strips, moments)
            background, place = draw_traces(joints, shots, rows.shape[1], robot.slides)
            _save_sheet(rows, see(background, *map(place, moments)), path)
            return
        background, place = draw_traces(joints, shots, scene.width * (len(shots) if scene.beside else 1), robot.slides)
        pictures = (
            compose([strip.picture(moment) for strip in strips], scene, see(background, place(moment)))
            for moment in moments
        )
        _save(pictures, path)


def _draw_sheet(strips: Sequence[Strip], moments: np.ndarray) -> np.ndarray:
    """Return moments in rows, the strips of one moment side by side."""
    pictures = [np.concatenate([strip.picture(moment) for strip in strips], axis=1) for moment in moments]
    columns = max(1, 2 * WIDTH // pictures[0].shape[1])
    rows = [np.concatenate(pictures[k : k + columns], axis=1) for k in range(0, len(pictures), columns)]
    return np.concatenate(rows, axis=0)


def _save_sheet(rows: np.ndarray, traces: np.ndarray, path: Path) -> None:
    from PIL import Image

    Image.fromarray(np.concatenate([rows, traces], axis=0)).save(path)


def _save(pictures: Iterator[np.ndarray], path: Path) -> None:
    """Write a film, picture by picture as MP4, at once as GIF."""
    if path.suffix == ".mp4":
        import imageio_ffmpeg

        first = next(pictures)
        writer = imageio_ffmpeg.write_frames(str(path), first.shape[1::-1], fps=RATE, macro_block_size=2)
        writer.send(None)
        for picture in chain([first], pictures):
            writer.send(np.ascontiguousarray(picture))
        writer.close()
        return
    from PIL import Image

    opening = Image.fromarray(next(pictures)).quantize(COLOURS, dither=Image.Dither.NONE)
    others = [Image.fromarray(picture).quantize(palette=opening, dither=Image.Dither.NONE) for picture in pictures]
    # of one palette, so that what stands still takes no room
    opening.save(path, save_all=True, append_images=others, duration=round(1000 / RATE), loop=0)
