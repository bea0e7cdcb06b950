"""Worker processes outlive a change of folder: relative paths are those of the command all the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from commands import done

from gsl.storage.trajectories import read

pytestmark = pytest.mark.slow

LIFT = """<robot name="lift"><link name="base"/><link name="cart"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="rail" type="prismatic">
<parent link="base"/><child link="cart"/><axis xyz="1 0 0"/><limit lower="-{width}" upper="{width}" effort="40"
velocity="2"/></joint></robot>"""
COLLECT = (
    "collect",
    "world=urdf",
    "world.robot=lift.urdf",
    "task=excite",
    "policy.motions=[chirp]",
    "policy.repeats=1",
)


def test_workers_of_one_command_read_the_files_of_the_next(tmp_path: Path) -> None:
    swings = []
    for name, width in {"first": 0.1, "second": 0.3}.items():
        folder = tmp_path / name
        folder.mkdir()
        (folder / "lift.urdf").write_text(LIFT.format(width=width))
        done(*COLLECT, "workers=2", "name=z", folder=folder)
        (folder / "lift.urdf").unlink()  # nobody can read it any more
        log = read(folder / "runs/z/collect_real/trajectories.parquet")
        swings.append(max(np.ptp(episode.position) for episode in log.episodes))
    assert swings[1] > 1.5 * swings[0]
