"""Export a simulator, or trajectories, for other tools, with a list of what their format cannot hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from gsl.core.console import Console
from gsl.core.interfaces import World
from gsl.core.setting import component, setting
from gsl.errors import ConfigError
from gsl.export.bam import export_bam
from gsl.export.isaac import export_isaac
from gsl.export.logs import WRITERS
from gsl.export.mjcf import export_mjcf
from gsl.export.parts import Export, Simulator
from gsl.export.plain_json import export_json
from gsl.export.servo_network import export_servo
from gsl.export.urdf_dynamics import export_urdf
from gsl.robots.catalogue import files
from gsl.storage.artifact import LACKING
from gsl.storage.manifest import NOT_HELD
from gsl.storage.trajectories import data_file, read
from gsl.worlds.bullet import BulletWorld

_OWN = ("config.yaml", "log.txt")  # what any artifact has
Format = Literal["mjcf", "isaac_lab", "bam", "urdf", "json", "servo", "lerobot", "minari", "csv", "mcap", "rerun"]


@component
class ExportStage:
    """Writes files of a format into its folder, and `not_held.txt`."""

    kind: ClassVar[str] = "export"

    format: Annotated[Format, setting("of the files")]
    world: Annotated[World | None, setting("simulator to export; for mjcf, isaac_lab, bam, urdf, json and servo")] = (
        None
    )
    trajectories: Annotated[
        str | None, setting("file or run to export; for lerobot, minari, csv, mcap and rerun", min_length=1)
    ] = None
    actuator: Annotated[str, setting("bam's name of the servo, such as xl330", min_length=1)] = "unknown"
    description: Annotated[str, setting("what trajectories are of, in words", min_length=1)] = "gsl"

    def __post_init__(self) -> None:
        """Refuse a format without what it is of."""
        if self.format in WRITERS:
            if self.trajectories is None:
                raise ConfigError("trajectories", f"is missing; format={self.format} is of trajectories=RUN")
        elif not isinstance(self.world, BulletWorld):
            problem = (
                "has no joints with servos" if self.world else f"is missing; format={self.format} is of world=NAME"
            )
            raise ConfigError("world", problem)

    def parents(self) -> Mapping[str, Path]:
        """Return the trajectories, if any."""
        return {} if self.trajectories is None else {"trajectories": data_file(self.trajectories)}

    def run(self, folder: Path, console: Console) -> Mapping[str, Any]:
        """Write the files."""
        lacking: list[str] = []
        if self.format in WRITERS:
            assert self.trajectories is not None, "checked before"
            batch = read(data_file(self.trajectories))
            missing = WRITERS[self.format](folder, batch, self.description)
        else:
            export = self._simulator()
            for name, contents in export.files.items():
                data = contents if isinstance(contents, bytes) else contents.encode()
                (folder / name).write_bytes(data)
            missing, lacking = list(export.missing), list(export.lacking)
        (folder / NOT_HELD).write_text("".join(f"{line}\n" for line in missing), encoding="utf-8")
        for line in missing:
            console.status(f"not held: {line}")
        names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
        return {
            "format": self.format,
            "files": [name for name in names if name not in _OWN and not name.startswith(".")],
            "not_held": missing,
            LACKING: lacking,
        }

    def _simulator(self) -> Export:
        world = self.world
        assert isinstance(world, BulletWorld), "checked before"
        simulator = Simulator(world.plant, world.step, world.period, world.floating, world.plant.robot.name)
        own = next((path for path in files(world.robot) if path.suffix == ".urdf"), None)
        ways: Mapping[str, Callable[[], Export]] = {
            "mjcf": lambda: export_mjcf(simulator),
            "isaac_lab": lambda: export_isaac(simulator),
            "bam": lambda: export_bam(simulator, self.actuator),
            "urdf": lambda: export_urdf(simulator, own),
            "json": lambda: export_json(simulator),
            "servo": lambda: export_servo(simulator),
        }
        return ways[self.format]()
