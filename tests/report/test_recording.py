"""A recording for the viewer holds the robot, its ghost and the curves; a ghost does what its model does."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from commands import done, refused

from gsl.commandline.view import replay_in_the_air
from gsl.errors import InputError
from gsl.report.recording import record_shots
from gsl.robots.catalogue import robot
from gsl.robots.nao import nao
from gsl.storage.trajectories import read

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a log of the plain simulator in the air."""
    folder = tmp_path_factory.mktemp("view")
    short = ("policy.motions=[steps_large]", "policy.duration=1.5", "policy.repeats=1", "policy.variants=[a]")
    done("collect", "name=air", "task=excite", "world=nao_ideal", "workers=1", *short, folder=folder)
    return folder


def test_the_ghost_of_a_log_of_the_plain_simulator_stays_on_the_robot(home: Path) -> None:
    batch = read(home / "runs/air/collect_real/trajectories.parquet")
    body, episode = robot("nao"), batch.episodes[0]
    ghost = replay_in_the_air(body, batch.joints, episode)
    error = np.sqrt(np.mean((ghost.position - episode.position) ** 2))
    travel = np.sqrt(np.mean((episode.position - episode.position[0]) ** 2))
    assert ghost.position.shape == episode.position.shape
    assert error < 0.02 * travel


def test_a_recording_holds_robot_ghost_and_curves(home: Path) -> None:
    rerun = pytest.importorskip("rerun")
    assert rerun
    assert done("view", "air", "out=air.rrd", folder=home).out == "air.rrd\n"
    written = (home / "air.rrd").read_bytes()
    assert written[:3] == b"RRF"
    joints = read(home / "runs/air/collect_real/trajectories.parquet").joints
    assert written.count(b"TimeSeries") >= len(joints)  # the viewer's own layout has no plot
    assert all(written.count(f"joints/{joint}/ghost".encode()) for joint in joints)


def test_a_viewer_that_does_not_start_is_told_after_the_way_out(monkeypatch: pytest.MonkeyPatch) -> None:
    class Stream:
        def __init__(self, name: str) -> None:
            """Take any name."""

        def spawn(self) -> None:
            raise RuntimeError("no executable " + "in the path " * 60)

    monkeypatch.setitem(sys.modules, "rerun", SimpleNamespace(RecordingStream=Stream))
    with pytest.raises(InputError, match=r"^write a file with out=motion\.rrd; .* no executable .{1,200}$"):
        record_shots(nao(), [], [], None)


def test_a_wrong_word_or_a_missing_viewer_is_one_line(home: Path) -> None:
    assert "out=" in refused("view", "air", "out=air.gif", folder=home)
    assert "no such setting" in refused("view", "air", "slow=2", folder=home)
    assert "name=value" in refused("view", "air", "air.rrd", folder=home)
    try:
        import rerun  # noqa: F401
    except ImportError:
        assert "pip install 'gsl[rerun]'" in refused("view", "air", "out=air.rrd", folder=home)
