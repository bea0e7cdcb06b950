"""TensorBoard's event files, written from the metrics of steps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gsl.errors import InputError
from gsl.storage.step_metrics import Step


def write_events(folder: Path, steps: Sequence[Step]) -> None:
    """Write the values of steps as scalars, each with the time at which its step was done.

    Raises:
        InputError: The library is missing.
    """
    try:
        from tensorboard.compat.proto.event_pb2 import Event
        from tensorboard.compat.proto.summary_pb2 import Summary
        from tensorboard.summary.writer.event_file_writer import EventFileWriter
    except ImportError as error:
        raise InputError(f"tensorboard={folder}: needs gsl[tensorboard]: pip install 'gsl[tensorboard]'") from error
    writer = EventFileWriter(str(folder))
    for step in steps:
        name = f"{step.series}_{step.run}" if step.run > 1 else step.series
        values = [
            Summary.Value(tag=f"{name}/{key}", simple_value=value)
            for key, value in step.values.items()
            if value is not None
        ]
        writer.add_event(Event(wall_time=step.time, step=step.step, summary=Summary(value=values)))
    writer.close()
