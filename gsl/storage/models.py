"""Files of fitted models: checkpoints with joints, history and encoding, found by the run that made them."""

from __future__ import annotations

from pathlib import Path

from gsl.core.checkpoint import read_checkpoint
from gsl.errors import ArtifactError
from gsl.models.counts import Counts
from gsl.models.ensemble import Forward, forward_from
from gsl.models.forward import ForwardModel
from gsl.models.inverse import KIND as INVERSE
from gsl.models.inverse import InverseModel, inverse_from
from gsl.models.servo import ServoModel
from gsl.models.servo_file import FILE as SERVO_FILE
from gsl.models.servo_file import MAKER
from gsl.models.servo_members import ServoMembers
from gsl.models.states import NearestChoice, StateForward, StateInverse, state_inverse_from
from gsl.storage.checkpoints import write_checkpoint
from gsl.storage.references import resolve

FORWARD = ForwardModel.kind
SERVO = ServoModel.kind
FILES = {FORWARD: "forward_model.safetensors", INVERSE: "inverse_model.safetensors", SERVO: SERVO_FILE}
MAKERS = {FORWARD: "train_forward", INVERSE: "train_inverse", SERVO: MAKER}


AnyForward = Forward | StateForward | Counts
AnyInverse = InverseModel | StateInverse | NearestChoice | Counts


def write_model(folder: Path, model: AnyForward | AnyInverse | ServoModel | ServoMembers) -> Path:
    """Write a model into a folder under the name of its kind and return the file."""
    about = model.description()
    path = folder / FILES[about["kind"]]
    write_checkpoint(path, model.arrays(), about)
    return path


def model_file(reference: str, kind: str) -> Path:
    """Return the file of the model of a `kind` that a path, an artifact or a run's name stands for."""
    found = resolve(reference, kind=MAKERS[kind])
    return found / FILES[kind] if found.is_dir() else found


def read_forward_model(reference: str) -> AnyForward:
    """Read a forward model.

    Raises:
        ArtifactError: There is none, or the file is damaged or of another kind or version.
    """
    path = model_file(reference, FORWARD)
    arrays, about = read_checkpoint(path, kind=FORWARD)
    with _understood(path):
        if about.get("space") == Counts.space:
            return Counts.from_arrays(arrays, about)
        return StateForward.from_arrays(arrays, about) if "space" in about else forward_from(arrays, about)


def read_inverse_model(reference: str) -> AnyInverse:
    """Read an inverse model; errors as those of `read_forward_model`."""
    path = model_file(reference, INVERSE)
    arrays, about = read_checkpoint(path, kind=INVERSE)
    with _understood(path):
        if about.get("space") == Counts.space:
            return Counts.from_arrays(arrays, about)
        return state_inverse_from(arrays, about) if "space" in about else inverse_from(arrays, about)


class _understood:
    """Turns what is missing in a checkpoint into one line."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        if isinstance(error, (KeyError, IndexError, TypeError, AssertionError)):
            raise ArtifactError(self._path, f"lacks part of the model ({error}); train it again") from error
