"""Pictures of the robot are files of the promised size that show something."""

import json
from pathlib import Path

import numpy as np
import pytest
from bodies import world
from PIL import Image

from gsl.commandline.robot_files import write_robot
from gsl.errors import ConfigError
from gsl.grounding.none import NoGrounding
from gsl.policies.walk_engine import WalkEngine
from gsl.report.console import Console
from gsl.report.render import portrait, walk_strip
from gsl.robots.nao import nao
from gsl.rollout.rollout import Scenario, rollout
from gsl.tasks.walk import Walk


@pytest.fixture(scope="module")
def walk():
    scenario = Scenario(world(), Walk(duration=0.6), WalkEngine(), "sim", NoGrounding())
    env = scenario.make()
    yield rollout(scenario, env, WalkEngine().initial, 0)
    env.close()


def test_the_portrait_shows_a_robot_on_a_floor(tmp_path: Path) -> None:
    portrait(nao(), tmp_path / "nao.png", width=200, height=225)
    image = np.asarray(Image.open(tmp_path / "nao.png")).astype(int)
    assert image.shape == (225, 200, 3)
    orange = (image[..., 0] > 180) & (image[..., 2] < 80)
    assert 0.02 < orange.mean() < 0.3
    rows = np.flatnonzero(orange.any(axis=1))
    assert rows[0] < 0.25 * 225 and rows[-1] > 0.6 * 225, "from the ears to the knees"


def test_a_strip_has_its_frames_side_by_side(walk, tmp_path: Path) -> None:
    walk_strip(nao(), walk, tmp_path / "walk.png", frames=3, height=100)
    image = np.asarray(Image.open(tmp_path / "walk.png")).astype(int)
    assert image.shape == (100, 3 * 62, 3)
    frames = np.split(image, 3, axis=1)
    assert all(np.abs(one - other).mean() > 0.3 for one, other in zip(frames, frames[1:], strict=False))


def test_the_robot_command_names_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_robot("nao", tmp_path / "out", Console(json=True))
    document = json.loads(capsys.readouterr().out)
    assert [Path(name).name for name in document["files"]] == ["nao.urdf", "nao.png"]
    assert all(Path(name).stat().st_size > 1000 for name in document["files"])


def test_an_unknown_robot_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="did you mean nao"):
        write_robot("nao6", tmp_path, Console())
