"""Files of learned servos: what a world's `servo:` names, a path or a run."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from gsl.core.checkpoint import read_checkpoint
from gsl.errors import ArtifactError, ConfigError
from gsl.models.servo import ServoModel

FILE = "servo_model.safetensors"
MAKER = "train_servo"


def servo_file(reference: str) -> Path:
    """Return the checkpoint that a file, an artifact or a run stands for, as seen from the current folder.

    Raises:
        ConfigError: There is none.
    """
    places = [Path(reference), Path("runs", reference)]
    inside = ("", MAKER, f"iteration_01/{MAKER}")
    for path in [place / below / FILE for place in places for below in inside] + places[:1]:
        if path.is_file():
            return path
    raise ConfigError(
        "servo",
        f"there is no learned servo in this path or run; gsl {MAKER.replace('_', '-')} makes one",
        given=reference,
    )


def read_servo(reference: str) -> ServoModel:
    """Read a learned servo.

    Raises:
        ConfigError: There is none.
        ArtifactError: The file is damaged or of another kind or version.
    """
    path = servo_file(reference)
    return _read(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=8)
def _read(path: Path, changed: int) -> ServoModel:
    arrays, about = read_checkpoint(path, kind=ServoModel.kind)
    try:
        return ServoModel.from_arrays(arrays, about)
    except (KeyError, ValueError, TypeError) as error:
        raise ArtifactError(path, f"is no learned servo of this version ({error}); train it again") from error
