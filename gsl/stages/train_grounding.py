"""Train a grounding: let one with a model of its own learn from trajectories, most of them real."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from gsl.core.console import Console
from gsl.core.interfaces import REAL, SIM, Evidence, Trainable
from gsl.core.setting import component, setting
from gsl.errors import ConfigError
from gsl.grounding.preparation import KIND, MAKER, MODEL, check_own
from gsl.storage.checkpoints import write_checkpoint
from gsl.storage.trajectories import data_file, read, write
from gsl.training.data import FALLS, HELDOUT, aggregate, earlier_batch, of_policy, parts


@component
class TrainGrounding:
    """Lets a grounding learn from a part of the real trajectories, and stores the others beside its model."""

    kind: ClassVar[str] = MAKER

    grounding: Annotated[Trainable, setting("what learns")]
    real: Annotated[str | None, setting("real trajectories: a file, or a run or artifact of collect")] = None
    sim: Annotated[str | None, setting("simulated trajectories of the same policies")] = None
    heldout: Annotated[float, setting("share of the real trajectories that is held out", gt=0, lt=1)] = 0.2
    seed: Annotated[int, setting("of the split and of the fit", ge=0)] = 1
    earlier: Annotated[tuple[str, ...], setting("real trajectories of earlier policies, to learn from as well")] = ()

    def __post_init__(self) -> None:
        """Refuse a grounding without the trajectories that it needs.

        Raises:
            ConfigError: They are missing, or its class could not learn.
        """
        check_own(self.grounding)
        for role in self.grounding.needs:
            if getattr(self, role) is None:
                raise ConfigError(
                    role, f"is missing; the grounding learns from {role} trajectories: a run of gsl collect"
                )

    def parents(self) -> Mapping[str, Path]:
        """Return the files of trajectories, or the artifacts."""
        named: dict[str, str] = {}
        for role in (REAL, SIM):
            if (reference := getattr(self, role)) is not None:
                named[role] = reference
        named |= {f"earlier_{n}": path for n, path in enumerate(self.earlier, start=1)}
        files = {name: data_file(reference, SIM if name == SIM else REAL) for name, reference in named.items()}
        return {role: path if path == Path(named[role]) else path.parent for role, path in files.items()}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write what was learned, and the real trajectories that it was not learned from."""
        console.phase("the grounding learns")
        real, count = None, 0
        if self.real is not None:
            newest = parts(data_file(self.real, REAL), other=SIM, share=self.heldout, seed=self.seed)
            data = aggregate(newest, [earlier_batch(data_file(path, REAL), newest.training) for path in self.earlier])
            episodes = (*data.training.episodes, *data.validation.episodes)
            labels = [label for part in (data.training, data.validation) for label in part.metadata["episodes"]]
            real = replace(data.training, episodes=episodes, metadata={**data.training.metadata, "episodes": labels})
            own = [episode for part in data for episode in of_policy(part, pi0=True)]
            falls = float(np.mean([episode.ended_in_a_fall for episode in own])) if own else 0.0
            write(folder / HELDOUT, replace(data.heldout, metadata={**data.heldout.metadata, FALLS: falls}))
            count = len(real)
        sim = None if self.sim is None else read(data_file(self.sim, SIM))
        learned = self.grounding.learn(Evidence(real, sim), self.seed)
        arrays = _arrays(learned)
        name = f"{type(self.grounding).__module__}.{type(self.grounding).__qualname__}"
        write_checkpoint(folder / MODEL, arrays, {"kind": KIND, "class": name})
        return {"trajectories": count, "arrays": {key: list(values.shape) for key, values in arrays.items()}}


def _arrays(learned: Any) -> dict[str, np.ndarray]:
    """Return what a grounding has learned as arrays of numbers.

    Raises:
        ConfigError: It is something else.
    """
    if not isinstance(learned, Mapping):
        raise ConfigError("grounding", f"its learn() returned {type(learned).__name__}, not arrays by name")
    arrays = {str(name): np.asarray(values) for name, values in learned.items()}
    for name, values in arrays.items():
        if values.dtype.kind not in "biuf":
            raise ConfigError("grounding", f"its learn() returned {values.dtype} as {name}, which are no numbers")
    return arrays
