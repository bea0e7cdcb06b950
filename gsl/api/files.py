"""Trajectory files."""

from __future__ import annotations

from pathlib import Path

from gsl.core.trajectory import Batch
from gsl.errors import ConfigError
from gsl.storage.trajectories import data_file
from gsl.storage.trajectories import read as read_file
from gsl.storage.trajectories import write as write_file


def read_trajectories(reference: Path | str) -> Batch:
    """Return the trajectories of a file, or of a run of collect or import.

    Raises:
        TrajectoryError: The file breaks the contract (docs/reference/files.md).
        ArtifactError: There is none.
    """
    return read_file(data_file(str(reference)))


def write_trajectories(path: Path | str, batch: Batch) -> None:
    """Write trajectories to a file, whole or not at all.

    Raises:
        TrajectoryError: They break the contract (docs/reference/files.md).
    """
    if not isinstance(batch, Batch):
        raise ConfigError("batch", "is no batch, as roll_out and read_trajectories return", given=str(batch))
    place = Path(path)
    if place.is_dir() or not place.parent.is_dir():
        raise ConfigError("path", "is no file in a folder that exists", given=str(path))
    if place.suffix not in (".parquet", ""):
        raise ConfigError("path", "is written as .parquet; gsl export writes other formats", given=str(path))
    write_file(place, batch)
