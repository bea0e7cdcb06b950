"""Files of fitted models: checkpoints with joints, history and encoding, found by the run that made them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

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
    artifact = resolve(reference, kind=MAKERS[kind])
    return artifact / FILES[kind] if artifact.is_dir() else artifact


def read_forward_model(reference: str) -> AnyForward:
    """Read a forward model.

    Raises:
        ArtifactError: There is none, or the file is damaged or of another kind or version.
    """
    model: AnyForward = _read(reference, FORWARD, StateForward.from_arrays, forward_from)
    return model


def read_inverse_model(reference: str) -> AnyInverse:
    """Read an inverse model; errors as those of `read_forward_model`."""
    model: AnyInverse = _read(reference, INVERSE, state_inverse_from, inverse_from)
    return model


def _read(reference: str, kind: str, of_states: Callable[..., Any], of_joints: Callable[..., Any]) -> Any:
    """Return a model of counts, or made by one of two functions of arrays and metadata."""
    path = model_file(reference, kind)
    arrays, about = read_checkpoint(path, kind=kind)
    space = about.get("space")
    make = Counts.from_arrays if space == Counts.space else of_joints if space is None else of_states
    try:
        return make(arrays, about)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, AssertionError, MemoryError) as error:
        raise ArtifactError(path, f"lacks part of the model, or is damaged ({error}); train it again") from error
