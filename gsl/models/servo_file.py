"""Files of learned servos: what a world's `servo:` names, a path or a run."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from gsl.core.checkpoint import read_checkpoint
from gsl.errors import ArtifactError, ConfigError
from gsl.models.servo import ServoModel
from gsl.models.servo_members import ServoMembers

FILE = "servo_model.safetensors"
MAKER = "train_servo"


def servo_file(reference: str) -> Path:
    """Return the checkpoint that a file, an artifact or a run stands for, as seen from the current folder.

    Raises:
        ConfigError: There is none.
    """
    places = [Path(reference), Path("runs", reference)]
    made = [f"{MAKER}{kind}" for kind in ("", "_on_effects", "_members", "_on_effects_members")]
    inside = ("", *(f"{home}{name}" for home in ("", "iteration_01/") for name in made))
    for path in [place / below / FILE for place in places for below in inside] + places[:1]:
        if path.is_file():
            return path
    raise ConfigError(
        "servo",
        f"there is no learned servo in this path or run; gsl {MAKER.replace('_', '-')} makes one",
        given=reference,
    )


def read_servo(reference: str, member: int = 0) -> ServoModel:
    """Read a learned servo, or another member of it than the first.

    Raises:
        ConfigError: There is none.
        ArtifactError: The file is damaged or of another kind or version.
    """
    return read_members(reference).member(member, reference)


def read_members(reference: str) -> ServoMembers:
    """Read all members of a learned servo; errors as those of `read_servo`."""
    path = servo_file(reference)
    return _read(path, (path.resolve(), path.stat().st_mtime_ns))


@lru_cache(maxsize=8)
def _read(path: Path, which: tuple[Path, int]) -> ServoMembers:
    arrays, about = read_checkpoint(path, kind=ServoModel.kind)
    try:
        return ServoMembers.from_arrays(arrays, about)
    except (LookupError, ValueError, TypeError, AttributeError, ArithmeticError, AssertionError) as error:
        raise ArtifactError(path, f"is no learned servo of this version ({error}); train it again") from error
