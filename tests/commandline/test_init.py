"""`gsl init` writes what the user then plays with; a robot's file is a parent of what was made with it."""

import json
import shlex
import shutil
from pathlib import Path

import pytest
import yaml
from commands import done, gsl, refused

from gsl.api import make_world
from gsl.errors import InputError
from gsl.robots.catalogue import robot

pytestmark = pytest.mark.slow

EXAMPLE = Path(__file__).parents[2] / "examples/arm.urdf"
SHORT = ("task.duration=1.6", "policy.motions=[triangle_slow]", "policy.repeats=1", "workers=1")


@pytest.fixture
def place(tmp_path: Path) -> Path:
    (tmp_path / "models").mkdir()
    shutil.copy(EXAMPLE, tmp_path / "models/arm.urdf")
    return tmp_path


def test_what_it_says_to_type_works(place: Path) -> None:
    said = json.loads(done("init", "urdf=models/arm.urdf", "name=mine", "--json", folder=place).out)
    picture, collect, diagnose = (shlex.split(line, comments=True)[1:] for line in said["next"])
    done(*picture, folder=place)
    done(*collect, *SHORT, folder=place)
    parents = json.loads((place / "runs/mine_sim/collect_real/manifest.json").read_text())["parents"]
    assert sorted(parent["role"] for parent in parents) == ["world.robot", "world.robot.urdf"]
    composed = json.loads(done(*diagnose, "--cfg", "job", "--json", folder=place).out)
    assert composed["sim"]["robot"] == "mine/robot.yaml"


def test_it_writes_out_what_the_urdf_alone_would_give(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done("init", "urdf=models/arm.urdf", "name=mine", "out=some/where", "period=0.005", folder=place)
    monkeypatch.chdir(place)
    alone, written = robot("models/arm.urdf"), robot("some/where/robot.yaml")
    assert written.controlled == alone.controlled
    for name in alone.motors:
        assert written.joint(name).armature == pytest.approx(alone.joint(name).armature, rel=1e-3)
        assert written.gains[name] == pytest.approx(alone.gains[name], rel=1e-3)
    world = yaml.safe_load((place / "some/where/world/mine.yaml").read_text())
    assert (world["robot"], world["period"]) == ("robot.yaml", 0.005)


def test_its_world_is_at_home_in_its_folder(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done("init", "urdf=models/arm.urdf", "name=mine", folder=place)
    before = (place / "mine/world/mine.yaml").read_text().replace("robot: robot.yaml", "robot: mine/robot.yaml")
    (place / "mine/world/before.yaml").write_text(before)  # as seen from where the command is typed
    (place / "notebooks").mkdir()
    monkeypatch.chdir(place / "notebooks")
    assert make_world("mine", config_dir="../mine").robot == "../mine/robot.yaml"  # type: ignore[attr-defined]
    with pytest.raises(InputError, match="no such file, as seen from the current folder; that of a world of yours"):
        make_world("before", config_dir="../mine")
    monkeypatch.chdir(place)
    assert make_world("before", config_dir="mine").robot == "mine/robot.yaml"  # type: ignore[attr-defined]


def test_it_takes_torque_and_speed_for_placeholders_and_a_choice_of_joints(place: Path) -> None:
    file = place / "models/arm.urdf"
    file.write_text(file.read_text().replace('effort="3"', 'effort="0"'))
    assert "joints.turn: has effort 0, a placeholder" in refused("init", f"urdf={file}", "name=mine", folder=place)
    done("init", f"urdf={file}", "name=mine", "effort=2.5", "joints=[elbow,turn]", folder=place)
    robot = yaml.safe_load((place / "mine/robot.yaml").read_text())
    assert [*robot["joints"]] == ["elbow", "turn"] and robot["joints"]["turn"]["effort"] == 2.5


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ("", "urdf: has no value"),
        ("urdf=models/arm.urdf", "name: has no value"),
        ("urdf=models/arm.urdf name=", "name=: has no value; write key=value"),
        ("urdf=models/arm.urdf name=my/arm", "name = my/arm: must be a word of letters, digits, _ and -"),
        ("urdf=models/arm.urdf name=urdf", "name = urdf: is that of a world or a robot that comes with gsl"),
        ("urdf=models/arm.urdf name=so101", "name = so101: is that of a world or a robot that comes with gsl"),
        ("urdf=models/arm.urdf name=pendulum", "name = pendulum: is that of a world or a robot that comes with gsl"),
        ("urdf=models/arm.urdf name=arm period=0", "period = 0: must be above 0 (s)"),
        ("urdf=models/arm.urdf name=arm nme=x", "nme: no such setting; did you mean name?"),
        ("urdf=models/none.urdf name=arm", "models/none.urdf: cannot be read: No such file or directory"),
        ("urdf=models name=arm", "models: cannot be read: is a folder"),
        ("urdf=models/arm.urdf name=models", "models: exists; choose another folder with out="),
        ("urdf=models/arm.urdf name=arm joints=elbo", "joints.elbo: the URDF has no such joint; did you mean elbow?"),
        ("urdf=models/arm.urdf name=arm effort=much", "effort = much: must be a number (N·m)"),
        ("urdf=models/arm.urdf name=arm effort=-1", "effort = -1: must be above 0 (N·m)"),
    ],
)
def test_what_is_wrong_is_one_line_and_nothing_is_written(arguments: str, line: str, place: Path) -> None:
    assert line in refused("init", *arguments.split(), folder=place)
    assert sorted(path.name for path in place.iterdir()) == ["models"]


def test_an_edited_urdf_is_noticed_and_a_moved_one_is_not(place: Path) -> None:
    def collect(file: str, *more: str) -> tuple[int, str, str]:
        return gsl("collect", "world=urdf", f"world.robot={file}", "task=excite", *SHORT, *more, folder=place)

    assert collect("models/arm.urdf")[0] == 0
    shutil.copy(place / "models/arm.urdf", place / "moved.urdf")
    assert collect("moved.urdf")[1].strip().endswith("(unchanged)")
    (place / "moved.urdf").write_text(EXAMPLE.read_text().replace('mass value="0.3"', 'mass value="0.31"'))
    code, _, message = collect("moved.urdf")
    assert code == 2 and "was built otherwise (changed: the data of world.robot)" in message


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (
            "world=urdf world.robot=none.urdf task=excite",
            "none.urdf: there is no such file, as seen from the current folder",
        ),
        ("world=urdf task=excite", "world.robot: has no value yet; say world.robot=..."),
        (
            "world=urdf world.robot=models/arm.urdf world.floating=true",
            "the arm has no feet to stand on; say floating=",
        ),
        ("world=nao_ideal world.robot=models/arm.urdf", "the arm has no feet to stand on; say floating=false"),
        (
            "world=so101 preset=toy workers=1",
            "policy: needs foot_force, which this world does not observe; a robot without feet",
        ),
        ("world=nao_ideal world.robot=models/arm", "no robot called 'models/arm'"),
    ],
)
def test_a_world_without_its_robot(arguments: str, line: str, place: Path) -> None:
    assert line in refused("collect", *arguments.split(), folder=place)


def test_a_policy_for_feet_is_refused_before_anything_is_collected(place: Path) -> None:
    line = refused("iterate", "sim=so101", "real=so101", "preset=toy", "workers=1", "name=none", folder=place)
    assert line.startswith("policy: needs foot_force, ") and "docs/howto/own-policy.md" in line
    assert not (place / "runs/none/iteration_01").exists()


def test_a_log_that_lacks_a_joint(place: Path) -> None:
    arm = ("world=urdf", "world.robot=models/arm.urdf", "task=excite", *SHORT)
    done("collect", *arm, "name=log", folder=place)
    (place / "more.urdf").write_text(EXAMPLE.read_text().replace('"elbow"', '"wrist"'))
    line = refused("diagnose", "real=log", "sim=urdf", "sim.robot=more.urdf", "out=runs/refused", folder=place)
    message = (
        "It lacks wrist; choose the simulator with sim=, or hold the joint in a robot file (docs/howto/own-robot.md)"
    )
    assert message in line


PAGE = (Path(__file__).parents[2] / "docs/howto/own-robot.md").read_text()
TYPED = [line.partition("#")[0].split()[2:] for line in PAGE.splitlines() if line.startswith("$ gsl ")]
WRITTEN = [part.partition("```")[0] for part in PAGE.split("```yaml\n")[1:]]


@pytest.mark.parametrize("words", TYPED, ids=" ".join)
def test_what_the_page_types_can_be_typed(words: list[str], tmp_path: Path) -> None:
    (tmp_path / "examples").mkdir()
    shutil.copy(EXAMPLE, tmp_path / "examples/arm.urdf")
    done(*words, *([] if words[0] in ("robot", "init") else ["--cfg", "job"]), folder=tmp_path)


@pytest.mark.parametrize("number", range(len(WRITTEN)))
def test_the_robot_files_of_the_page_are_robots(number: int, tmp_path: Path) -> None:
    for folder in ("examples", "arm"):
        (tmp_path / folder).mkdir()
    shutil.copy(EXAMPLE, tmp_path / "examples/arm.urdf")
    (tmp_path / "arm/robot.yaml").write_text(WRITTEN[number])
    assert len(robot(str(tmp_path / "arm/robot.yaml")).controlled) == 2
