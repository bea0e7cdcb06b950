"""Two tiny stages and a world, for tests of the command line."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Annotated, Any, ClassVar

from gsl.core.setting import component, setting
from gsl.core.validation import make
from gsl.errors import GslError
from gsl.report.console import Console


@component
class ExampleBacklash:
    width: Annotated[float, setting("full width of the play", unit="rad", ge=0)]


@component
class ExampleWorld:
    control_period: Annotated[float, setting("time between two actions", unit="s", gt=0)]
    iterations: Annotated[int, setting("solver iterations", ge=1)] = 50
    effects: Annotated[Mapping[str, Any], setting("effects by name")] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, values in self.effects.items():
            if isinstance(values, Mapping):
                make(ExampleBacklash, values, where=f"effects.{name}")


@component
class Count:
    kind: ClassVar[str] = "collect"
    world: ExampleWorld
    episodes: Annotated[int, setting("trajectories to collect", gt=0)]
    seed: Annotated[int, setting("seed of the first episode")] = 0
    fails: Annotated[str, setting("how to fail")] = ""

    def parents(self) -> Mapping[str, Path]:
        return {}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        if self.fails == "known":
            raise GslError("the robot is on fire; put it out")
        if self.fails == "bug":
            raise ZeroDivisionError("division by zero\nin two lines")
        if self.fails == "ctrl-c":
            raise KeyboardInterrupt
        if self.fails == "slow":
            console.status("working")
            time.sleep(30)
        with console.progress(self.episodes, "counting") as progress:
            for _ in range(self.episodes):
                progress.advance()
        (folder / "count.txt").write_text(f"{self.episodes}\n")
        console.table("count", ["what", "number"], [("episodes", self.episodes), ("process", os.getpid())])
        return {"episodes": self.episodes, "seed": self.seed, "iterations": self.world.iterations}


@component
class Compare:
    kind: ClassVar[str] = "evaluate"
    sim: ExampleWorld
    real: ExampleWorld
    subject: str
    episodes: Annotated[int, setting("episodes in each", gt=0)]
    trust: Annotated[tuple[str, ...], setting("modules whose classes files may name")] = ()

    def parents(self) -> Mapping[str, Path]:
        return {}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        (folder / "trust.txt").write_text(" ".join(self.trust))
        return {"trust": list(self.trust)}
