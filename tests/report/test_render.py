"""Pictures and films of the robot: a camera that stands still, the way, the command, the fall."""

import json
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bodies import world
from PIL import Image

from gsl.cli import call
from gsl.commandline.robot_files import write_robot
from gsl.core.trajectory import Trajectory
from gsl.errors import ConfigError, InputError
from gsl.grounding.none import NoGrounding
from gsl.policies.policy import describe_command
from gsl.policies.walk_engine import WalkEngine
from gsl.report.console import Console
from gsl.report.film import RATE, SHEET, WIDTH, Shot, check_format, film
from gsl.report.film_traces import HEIGHT, draw_traces, shorten
from gsl.report.render import portrait
from gsl.robots.nao import nao
from gsl.rollout.rollout import Scenario, rollout
from gsl.tasks.walk import Walk
from gsl.worlds.camera import LIGHT, SHADOW, Camera, View

pytestmark = pytest.mark.slow

RED, GREEN = "#d55e00", "#009e73"


@pytest.fixture(scope="module")
def walk():
    """0.6 s in which the robot is carried 1.8 m ahead: its own steps would be too short to be seen."""
    scenario = Scenario(world(), Walk(duration=0.6), WalkEngine(), "sim", NoGrounding())
    env = scenario.make()
    walked = rollout(scenario, env, WalkEngine().initial, 0)
    env.close()
    carried = {"base.position.x": np.linspace(0.0, 1.8, len(walked.time))}
    return replace(walked, sensors={**walked.sensors, **carried}, fell=None)


def orange(image: np.ndarray) -> np.ndarray:
    """Where the robot's orange is."""
    colours = image.astype(int)
    return (colours[..., 0] > 180) & (colours[..., 2] < 80)


def sheet(shots: list[Shot], path: Path) -> np.ndarray:
    """The moments, without the traces below."""
    return whole_sheet(shots, path)[:-HEIGHT]


def whole_sheet(shots: list[Shot], path: Path) -> np.ndarray:
    film(nao(), nao().controlled, shots, path)
    return np.asarray(Image.open(path).convert("RGB"))


def test_the_portrait_shows_a_robot_on_a_floor(tmp_path: Path) -> None:
    portrait(nao(), tmp_path / "nao.png", width=200, height=225)
    image = np.asarray(Image.open(tmp_path / "nao.png"))
    assert image.shape == (225, 200, 3)
    assert 0.02 < orange(image).mean() < 0.3
    rows = np.flatnonzero(orange(image).any(axis=1))
    assert rows[0] < 0.25 * 225 and rows[-1] > 0.6 * 225, "from the ears to the knees"


def test_a_shadow_lies_where_the_robot_hides_the_light_and_no_view_forgets_another(tmp_path: Path) -> None:
    views = [View((0.0, 0.0, 0.3), distance, yaw=90.0) for distance in (3.0, 2.0)]
    place = np.array([0.2, 0.0, 0.33])
    hidden = place - np.array(LIGHT) * place[2] / LIGHT[2]  # where a ray through the robot's middle meets the floor
    with closing(Camera(nao())) as camera:
        pictures = []
        for where in (place, place + [90.0, 0.0, 0.0], place):  # the second time nobody is there
            camera.pose({}, where.tolist(), (0.0, 0.0, 0.0, 1.0))
            pictures.append([camera.picture(view, 400, 200, finer=1).astype(int) for view in views])
        for k, view in enumerate(views):
            right, down = camera.project(hidden[None], view, 400, 200)[0].astype(int)
            lit, shaded = pictures[1][k][down, right], pictures[0][k][down, right]
            np.testing.assert_allclose(shaded, (1.0 - SHADOW) * lit, atol=3)
            np.testing.assert_array_equal(pictures[0][k], pictures[2][k])
            assert orange(pictures[0][k]).any() and not orange(pictures[1][k]).any()


def test_a_sheet_shows_the_way_from_a_camera_that_stands_still(walk, tmp_path: Path) -> None:
    image = sheet([Shot("", "", walk, RED)], tmp_path / "walk.png")
    halves = np.split(image, 2, axis=1)
    moments = [part for row in zip(*(np.split(half, SHEET // 2) for half in halves), strict=True) for part in row]
    middles = [np.flatnonzero(orange(moment).any(axis=0)).mean() for moment in moments]
    steps = np.diff(middles)
    assert (steps > 0).all() and np.ptp(steps) < 0.4 * steps.mean(), "equal ways in equal times, to a tick"
    floor = [moment[-40:-20, -40:] for moment in moments]
    assert all(np.array_equal(part, floor[0]) for part in floor[:4]), "the floor does not move"


def test_two_sides_stand_beside_each_other(walk, tmp_path: Path) -> None:
    alone = sheet([Shot("a", "", walk, RED)], tmp_path / "one.png")
    both = sheet([Shot("a", "", walk, RED), Shot("a", "", walk, GREEN)], tmp_path / "two.png")
    assert both.shape[1] == alone.shape[1] == 2 * WIDTH
    assert both.shape[0] == 2 * alone.shape[0]
    left, right = np.split(both, 2, axis=1)
    np.testing.assert_array_equal(left, right)


def test_a_sheet_marks_the_command_over_time_and_says_the_conditions(walk, tmp_path: Path) -> None:
    plain = whole_sheet([Shot("a", "", walk, RED)], tmp_path / "plain.png")
    marked = whole_sheet([Shot("a", "", walk, RED, "nao_worn, forward 1 m/s, seed 1")], tmp_path / "marked.png")
    marks = (plain[-HEIGHT:] == 0).all(axis=(0, 2))
    assert np.count_nonzero(marks) == SHEET and np.ptp(np.diff(np.flatnonzero(marks))) <= 1
    differs = np.split((plain != marked).any(axis=2)[:-HEIGHT], SHEET // 2)
    assert all(part[:40].any() and not part[40:].any() for part in differs), "once a moment, above the robot"
    assert describe_command(WalkEngine(left=-0.1)) == ["walk_engine", "forward 1 m/s", "left -0.1 m/s"]


def test_a_fall_is_marked_when_it_happens(walk, tmp_path: Path) -> None:
    fell = walk.time >= 0.5 * walk.time[-1]
    strips = [
        np.split(sheet([Shot("", "", walked, RED)] * 2, tmp_path / "walk.png"), SHEET)
        for walked in (walk, replace(walk, fell=fell))
    ]
    differ = [not np.array_equal(upright, fallen) for upright, fallen in zip(*strips, strict=True)]
    assert differ == [False] * 4 + [True] * 4


@pytest.mark.parametrize("slow", [1.0, 2.0])
def test_a_film_lasts_as_long_as_the_walk_and_longer_in_slow_motion(walk, tmp_path: Path, slow: float) -> None:
    film(nao(), nao().controlled, [Shot("walk", "", walk, RED)], tmp_path / "walk.gif", slow=slow)
    shown = Image.open(tmp_path / "walk.gif")
    assert shown.n_frames * shown.info["duration"] / 1000 == pytest.approx(slow * walk.time[-1], abs=1 / RATE)
    assert shown.size[1] > HEIGHT


def test_a_log_in_which_the_base_is_held_shows_no_way(walk, tmp_path: Path) -> None:
    still = {name: np.full_like(values, values[0]) for name, values in walk.sensors.items()}
    image = sheet([Shot("", "", replace(walk, sensors=still), RED)], tmp_path / "held.png")
    columns = np.flatnonzero(orange(image[: len(image) // 2, : WIDTH // 2]).any(axis=0))
    assert columns.mean() == pytest.approx(WIDTH / 4, abs=WIDTH / 20), "in the middle"


def test_a_walk_and_a_log_in_the_air_are_both_seen_whole(walk, tmp_path: Path) -> None:
    still = {name: np.full_like(values, values[0]) for name, values in walk.sensors.items()}
    held = replace(walk, sensors=still, action=walk.action + 0.1)
    image = sheet([Shot("a", "", walk, RED), Shot("b", "", held, GREEN)], tmp_path / "both.png")
    first = image[: len(image) // SHEET]
    walking, hanging = (np.flatnonzero(orange(half).any(axis=1)) for half in np.split(first, 2, axis=1))
    assert np.ptp(hanging) == pytest.approx(np.ptp(walking), rel=0.1)
    assert 0.1 * len(first) < hanging[0] < walking[0]
    pictures = [draw_traces(nao().controlled, [Shot("a", "", walk, RED), Shot("b", "", other, GREEN)], 800)[0]
                for other in (replace(held, action=walk.action), held)]  # fmt: skip
    assert not np.array_equal(*pictures), "the second command is drawn where it is another"


def test_a_film_has_a_format(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.gif or \.mp4"):
        check_format(tmp_path / "walk.avi")


def test_the_robot_command_names_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_robot("nao", f"out={tmp_path / 'out'}", Console(json=True))
    document = json.loads(capsys.readouterr().out)
    assert [Path(name).name for name in document["files"]] == ["nao.urdf", "nao.png"]
    assert all(Path(name).stat().st_size > 1000 for name in document["files"])


def test_an_unknown_robot_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="did you mean nao"):
        write_robot("nao6", str(tmp_path), Console())


def test_the_robot_command_takes_no_setting_for_a_folder(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="one setting, out=DIR"):
        write_robot("nao", "force=true", Console())


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of its own: a search of two generations, and its measurement."""
    place = tmp_path_factory.mktemp("runs") / "toy"
    common = ["preset=toy", "workers=1"]
    search = ["grounding=none", "task.duration=1", "optimizer.generations=2"]
    assert call(["optimize", *common, *search, f"out={place}/optimize"]) == 0
    assert call(["evaluate", *common, "task.duration=1", f"policies={place}/optimize", f"out={place}/evaluate"]) == 0
    return place


def test_render_shows_a_policy_on_both_sides(toy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert call(["render", f"{toy}/evaluate", f"out={tmp_path}/new/walk.png", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert Path(document["film"]).stat().st_size > 10_000
    assert [title.partition(" ")[2] for title in document["shown"]] == ["on the real side", "in simulation"]


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["policy=generation_1"], "did you mean generation_"),
        (["out=walk.avi"], ".gif or .mp4"),
        (["speed=2"], "no such setting"),
        (["slow=0"], "slow"),
        (["slow=fast"], "must be a number"),
        (["slow"], "name=value"),
        (["beside=first"], "beside: is for a log, and this is evaluate"),
    ],
)
def test_render_refuses_in_one_line(
    toy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str],
    words: list[str], problem: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert call(["render", f"{toy}/evaluate", *words]) == 2
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert problem in line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("width", [320, 700])
@pytest.mark.parametrize("name", ["rise", "panda_finger_joint1", "left_gripper_parallel_slider_joint"])
def test_a_name_of_a_joint_that_slides_fits_into_the_strip(name: str, width: int) -> None:
    time = np.linspace(0.0, 3.0, 150)
    way = 0.9 * np.sin(3.0 * time)[:, None]
    shot = Shot("", "simulator", Trajectory(time, way[:-1], way, way), RED)
    picture, _ = draw_traces([name], [shot], width, [name])
    edge = np.concatenate([picture[[0, -1]].reshape(-1, 3), picture[:, [0, -1]].reshape(-1, 3)])
    assert picture.shape == (HEIGHT, width, 3) and (edge > 200).all(), "nothing is cut off"
    assert (picture[-20:, : width // 2] < 100).any(), "the name is there"


def test_a_long_name_loses_its_middle() -> None:
    assert shorten("left_gripper_joint", 20) == "left_gripper_joint"
    assert shorten("left_gripper_joint", 11) == "left_…joint"
