"""Algorithm 1 with a real robot in the loop: the chain stops, asks, takes the answer, and goes on."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commands import SMALL, done, gsl, refused
from strangers import seal

from gsl.core.trajectory import Batch, Trajectory
from gsl.runner.journal import ANSWER, RETURNS
from gsl.runner.request import read_request
from gsl.storage.answers import csv_episodes
from gsl.storage.trajectories import read, write
from gsl.worlds.external import ExternalRobot

pytestmark = pytest.mark.slow

FEW = ("recipe.forward=linear", "optimizer.generations=1")
STEADY = (*SMALL, *FEW, "accept=true", "recipe.spread=0.02")  # no neighbour falls
LOOP = ("iterate", *STEADY, "grounding=gat", "real=robot")
FIRST = "runs/loop/iteration_01"


def _asked(*words: str, folder: Path) -> str:
    """Run a command that has to wait for the robot and return the folder of its request."""
    said = done(*words, folder=folder)
    assert said.lines[-2].startswith("the real robot has to act: ")
    assert said.lines[-1].startswith("run `python runner.py` of runs/")
    return said.out.splitlines()[-1]


def _rehearsed(*words: str, folder: Path, tape: bool = False) -> list[str]:
    """Run a command until it needs no robot any more, a surrogate answering; return the requests."""
    asked = []
    while (said := done(*words, folder=folder)).out.splitlines()[-1].rpartition("/")[2] != words[0]:
        asked.append(said.out.splitlines()[-1])
        done("rehearse", f"request={asked[-1]}", "world=nao_worn", f"tape={str(tape).lower()}", folder=folder)
    return asked


@pytest.fixture(scope="module")
def direct(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("direct")
    done("iterate", *STEADY, "grounding=gat", "real=nao_worn", "name=loop", folder=folder)
    return folder


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    folder = tmp_path_factory.mktemp("loop")
    first = _asked(*LOOP, "name=loop", folder=folder)
    done(
        "rehearse",
        f"request={first}",
        "world=nao_worn",
        "episodes=[pi0_01,pi0_02,pi0_03,pi0_04]",
        "name=day_1",
        folder=folder,
    )
    again = gsl(*LOOP, "name=loop", folder=folder)
    assert "2 of 6 episodes are missing, 3 s in all (neighbour_01, neighbour_02)" in again.err
    done("answer", f"request={first}", f"logs={_rest(folder, first)}", "episodes=[neighbour_01,neighbour_02]",
         "name=day_2", folder=folder)  # fmt: skip
    return folder, [first, *_rehearsed(*LOOP, "name=loop", folder=folder)]


def _rest(folder: Path, request: str) -> str:
    """Return a foreign log of the last two episodes: joints in another order, no word of the request."""
    done("rehearse", f"request={request}", "world=nao_worn", f"out={folder / 'elsewhere'}", folder=folder)
    answers = dict(csv_episodes(folder / "elsewhere" / ANSWER, read_request(folder / request)))
    write(folder / "foreign.parquet", _turned([answers[name] for name in ("neighbour_01", "neighbour_02")]))
    return "foreign.parquet"


def _turned(episodes: list[Trajectory]) -> Batch:
    joints = ExternalRobot(robot="nao").layout.joints
    turned = tuple(
        replace(
            episode,
            action=episode.action[:, ::-1],
            position=episode.position[:, ::-1],
            velocity=episode.velocity[:, ::-1],
            sensors={name: values for name, values in episode.sensors.items() if name != "stopped"},
        )
        for episode in episodes
    )
    return Batch(turned, joints[::-1], 0.02, {"robot": "nao", "role": "imported"})


def test_the_loop_over_files_comes_to_what_the_surrogate_itself_would_have_come_to(
    loop: tuple[Path, list[str]], direct: Path
) -> None:
    folder, _ = loop
    for file in ("optimize/policies.json", "evaluate/evaluation.json", "evaluate/metrics.json"):
        assert (folder / FIRST / file).read_bytes() == (direct / FIRST / file).read_bytes(), file
    ours, theirs = (read(place / FIRST / "collect_real/trajectories.parquet") for place in (folder, direct))
    assert ours.metadata["episodes"] == theirs.metadata["episodes"]
    for episode, other in zip(ours.episodes, theirs.episodes, strict=True):
        assert episode.sensors.keys() == other.sensors.keys()
        for name in ("time", "action", "position", "velocity", "reward", "fell"):
            np.testing.assert_array_equal(getattr(episode, name), getattr(other, name), err_msg=name)
    for place in (folder, direct):
        page = (place / FIRST / "evaluate/report.html").read_text()
        assert "Joint by joint: π0" in page and "traces of LHipPitch" in page and "on the real side" in page


def test_the_robot_is_asked_four_times_in_a_round(loop: tuple[Path, list[str]]) -> None:
    _, asked = loop
    places = ["collect_real.request", *(f"evaluate.request/{name}" for name in ("choice", "check_*", "report"))]
    assert len(asked) == 4 and all(Path(folder).match(place) for folder, place in zip(asked, places, strict=True))


def test_what_was_answered_is_the_parent_of_what_was_made_of_it(loop: tuple[Path, list[str]]) -> None:
    folder, _ = loop
    made = json.loads((folder / FIRST / "collect_real/manifest.json").read_text())
    roles = {parent["role"] for parent in made["parents"]}
    assert roles == {"answer.day_1/answer.csv", "answer.day_2/answer.parquet"}
    text = done("show", "loop/iteration_01/collect_real", folder=folder).out
    assert "answer.day_2/answer.parquet" in text and "the same" in text
    assert "policies in the real world" in done("show", "loop/iteration_01/evaluate", folder=folder).out


def test_the_same_command_again_does_nothing(loop: tuple[Path, list[str]]) -> None:
    folder, _ = loop
    assert done(*LOOP, "name=loop", folder=folder).out.splitlines()[-1] == "runs/loop/iterate (unchanged)"


def test_a_tape_measure_gives_the_same_values_as_a_log_of_the_base(
    direct: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("tape")
    shutil.copytree(direct / FIRST / "optimize", folder / "found")
    _rehearsed("evaluate", *SMALL, "world=robot", "policies=found", "name=loop", folder=folder, tape=True)
    ours = json.loads((folder / "runs/loop/evaluate/evaluation.json").read_text())
    theirs = json.loads((direct / FIRST / "evaluate/evaluation.json").read_text())
    for phase in ("policies", "check", "confirmation"):
        for row, other in zip(ours[phase], theirs[phase], strict=True):
            assert row["values"] == pytest.approx(other["values"], rel=1e-9)
            assert row["outcome"] == pytest.approx(other["outcome"], rel=1e-9)


COLLECT = ("collect", *SMALL, "world=robot", "name=one", "recipe.spread=0.02")
ASKED = "runs/one/collect_real.request"


@pytest.fixture(scope="module")
def answered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A request with a whole answer in a folder of its own, runs/elsewhere."""
    folder = tmp_path_factory.mktemp("answered")
    assert _asked(*COLLECT, folder=folder) == ASKED
    done("rehearse", f"request={ASKED}", "world=nao_worn", "out=runs/elsewhere", folder=folder)
    return folder


@pytest.fixture
def place(answered: Path, tmp_path: Path) -> Path:
    """A copy of it that a test may spoil."""
    shutil.copytree(answered / "runs", tmp_path / "runs")
    return tmp_path


def test_waiting_leaves_nothing_but_the_request_and_is_told_as_one_document(place: Path) -> None:
    before = (place / ASKED / "request.json").stat().st_mtime_ns
    said = json.loads(done(*COLLECT, "--json", folder=place).out)
    assert said["waiting"] == ASKED and said["missing"][:1] == ["pi0_01"]
    assert (place / ASKED / "request.json").stat().st_mtime_ns == before
    assert sorted(path.name for path in (place / "runs/one").iterdir()) == ["collect_real.request"]


def test_a_file_dropped_into_the_folder_is_taken(place: Path) -> None:
    (place / ASKED / ANSWER).write_bytes((place / "runs/elsewhere" / ANSWER).read_bytes())
    assert done(*COLLECT, folder=place).out.splitlines()[-1] == "runs/one/collect_real"
    assert done(*COLLECT, folder=place).out.splitlines()[-1] == "runs/one/collect_real (unchanged)"


def test_a_run_of_a_real_robot_is_repeated_from_its_answers_wherever_its_settings_point(place: Path) -> None:
    (place / ASKED / ANSWER).write_bytes((place / "runs/elsewhere" / ANSWER).read_bytes())
    done(*COLLECT, folder=place)
    made = place / "runs/one/collect_real"
    text = (made / "config.yaml").read_text()
    assert f"requests: {ASKED}" in text
    (made / "config.yaml").write_text(text.replace(ASKED, "away"))
    seal(made)
    done("rerun", "one/collect_real", folder=place)
    assert not (place / "away").exists()


def test_an_unanswered_request_follows_its_settings_and_keeps_what_is_not_its_own(place: Path) -> None:
    mine = [place / ASKED / name for name in ("robot.py", "notes.txt", "modules/mine.py")]
    for path in mine:
        path.write_text("mine = 1\n")
    assert "8 of 8 episodes" in done(*COLLECT, "episodes=6", folder=place).err
    assert [path.read_text() for path in mine] == ["mine = 1\n"] * 3
    assert len(read_request(place / ASKED)["episodes"]) == 8


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("request.json", "request.json: is damaged: it is not JSON"),
        ("README.txt", "README.txt: is in the way of a request, and not gsl's; move it"),
    ],
)
def test_a_request_takes_the_place_of_nothing_that_gsl_did_not_write(tmp_path: Path, name: str, problem: str) -> None:
    folder = tmp_path / ASKED
    folder.mkdir(parents=True)
    for file in (name, "notes.txt"):
        (folder / file).write_text("mine")
    assert problem in refused(*COLLECT, folder=tmp_path)
    assert {path.name: path.read_text() for path in folder.iterdir()} == {name: "mine", "notes.txt": "mine"}


def _lines(place: Path) -> list[str]:
    return (place / "runs/elsewhere" / ANSWER).read_text().splitlines(keepends=True)


def _changed(lines: list[str], column: str, value: str, row: int = 5) -> list[str]:
    cells = lines[row].rstrip("\n").split(",")
    cells[lines[1].strip().split(",").index(column)] = value
    return [*lines[:row], ",".join(cells) + "\n", *lines[row + 1 :]]


def _stretched(lines: list[str], factor: float) -> list[str]:
    """Return the lines of an answer as if time had gone faster."""
    at, cells = lines[1].strip().split(",").index("time"), [line.rstrip("\n").split(",") for line in lines[2:]]
    return [
        *lines[:2],
        *(",".join([*cell[:at], repr(factor * float(cell[at])), *cell[at + 1 :]]) + "\n" for cell in cells),
    ]


@pytest.mark.parametrize(
    ("spoil", "problem"),
    [
        (lambda lines: ["# gsl answer to request abc\n", *lines[1:]], "answers another request (abc, not "),
        (lambda lines: lines[1:], "does not say which request it answers; gsl answer request="),
        (lambda lines: [lines[0]], "is no CSV file with a row of names: "),
        (lambda lines: lines[:2], "has no rows"),
        (lambda lines: lines[: 2 + 40], "must be empty (NaN) in the last row of an episode"),
        (
            lambda lines: [line.replace("gyro.x", "gyro.y") for line in lines],
            "column gyro.y: there are several columns of this name",
        ),
        (lambda lines: ["\x80\x04K\x01.", *lines[2:]], "does not say which request it answers"),
        (lambda lines: _changed(lines, "gyro.x", "fast"), "column gyro.x: holds what is not a number"),
        (lambda lines: _changed(lines, "position.LKneePitch", ""), "column position.LKneePitch, row 3: is not a fini"),
        (lambda lines: _changed(lines, "fell", "maybe"), "column fell: must be true or false"),
        (lambda lines: _changed(lines, "episode", "x"), "column episode: must be whole numbers"),
        (lambda lines: _changed(lines, "step", "7"), "column step, row "),
        (lambda lines: [line.replace("LKneePitch", "LKnee") for line in lines[:2]] + lines[2:], "is missing, did you"),
        (lambda lines: [line.replace("gyro.x", "gyro.q") for line in lines[:2]] + lines[2:], "gyro.q: is unknown"),
        (lambda lines: [*lines[:2], *(f"9{line}" for line in lines[2:])], "there are 6 episodes in the request"),
        (lambda lines: _stretched(lines, 2.0), "pi0_01: row 1 comes 40 ms after the one before, not 20 ms; run it ag"),
        (lambda lines: _stretched(lines, 0.4), "pi0_01: row 1 comes 8 ms after the one before, not 20 ms; run it ag"),
    ],
)
def test_a_bad_answer_is_refused_in_one_line(
    place: Path, spoil: Callable[[list[str]], list[str]], problem: str
) -> None:
    (place / ASKED / ANSWER).write_text("".join(spoil(_lines(place))))
    said = refused(*COLLECT, folder=place)
    assert said.startswith(f"{ASKED}/{ANSWER}") and problem in said


@pytest.mark.parametrize(
    ("rows", "problem"),
    [
        ("pi0_99,0.1,no", "the request has no episode 'pi0_99'; did you mean pi0_0"),
        ("name,metres\npi0_01,0.1", "needs the columns episode, distance (or value) and fell; it has name, metres"),
        ("pi0_01,far,no", "row 1: distance is 'far', not a number"),
        ("pi0_01,nan,no", "row 1: distance is 'nan', which nothing measures"),
        ("pi0_01,140,no", "row 1: a distance of 140 m; is it in metres?"),
        ("pi0_01,0.1,perhaps", "row 1: fell is 'perhaps'; write yes or no"),
        ("pi0_01,0.1,no\npi0_01,0.2,no", "pi0_01 is answered twice"),
    ],
)
def test_bad_returns_are_refused_in_one_line(place: Path, rows: str, problem: str) -> None:
    head = "" if rows.startswith("name") else "episode,distance,fell\n"
    (place / ASKED / RETURNS).write_text(f"{head}{rows}\n")
    said = refused(*COLLECT, folder=place)
    assert said.startswith(f"{ASKED}/{RETURNS}") and problem in said


def test_an_episode_answered_twice_and_a_request_that_changed_are_refused(place: Path) -> None:
    for name in ("answer_a.csv", "answer_b.csv"):
        (place / ASKED / name).write_text("".join(_lines(place)))
    assert "pi0_01 is answered twice, also in " in refused(*COLLECT, folder=place)
    assert "answers another request, which has changed since; move it" in refused(*COLLECT, "seed=9", folder=place)


def test_an_episode_that_breaks_off_without_a_fall_is_refused(place: Path) -> None:
    lines = _lines(place)
    cells = lines[2 + 20].rstrip("\n").split(",")
    names = lines[1].strip().split(",")
    last = ",".join("" if name.startswith("action.") else cell for name, cell in zip(names, cells, strict=True))
    (place / ASKED / ANSWER).write_text("".join([*lines[: 2 + 20], last + "\n"]))
    assert "pi0_01: has 20 of 80 steps and no fall; run it again, or say" in refused(*COLLECT, folder=place)
    (place / ASKED / RETURNS).write_text("episode,distance,fell\npi0_01,,yes\n")
    assert "5 of 6 episodes are missing" in done(*COLLECT, folder=place).err


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (("request=nowhere", "logs=x.csv"), "nowhere: is no request: it holds no request.json"),
        (("logs=x.csv",), "request: has no value yet; say request=..."),
        ((f"request={ASKED}",), "there is nothing to take in: say logs=, returns= or both"),
        ((f"request={ASKED}", "logs=none.csv"), "none.csv: there is no such path"),
        ((f"request={ASKED}", f"logs=runs/elsewhere/{ANSWER}", "episodes=[pi0_01]"), "holds 6 episodes, but 1 are nam"),
        ((f"request={ASKED}", f"logs=runs/elsewhere/{ANSWER}", "episodes=[pi9]"), "the request has no episode 'pi9'"),
        (
            (
                f"request={ASKED}",
                f"logs=runs/elsewhere/{ANSWER}",
                "episodes=[pi0_01,pi0_02,pi0_03,pi0_04,pi0_01,pi0_02]",
            ),
            "pi0_01 is named twice; every episode is one of its own",
        ),
    ],
)
def test_an_answer_from_elsewhere_is_refused_in_one_line(place: Path, words: tuple[str, ...], problem: str) -> None:
    assert problem in refused("answer", *words, folder=place)


def test_a_table_with_fewer_names_than_episodes_is_refused_in_one_line(place: Path) -> None:
    done("answer", f"request={ASKED}", f"logs=runs/elsewhere/{ANSWER}", "out=runs/table", folder=place)
    batch = read(place / "runs/table/answer.parquet")
    metadata = {**batch.metadata, "episodes": batch.metadata["episodes"][:2]}
    write(place / ASKED / "answer_mine.parquet", replace(batch, metadata=metadata))
    assert "holds 6 episodes, but 2 are named" in refused(*COLLECT, folder=place)


def test_what_is_logged_after_a_fall_is_cut_off(place: Path) -> None:
    lines = _lines(place)
    for row in range(2 + 30, 2 + 40):  # it falls, and gets up again
        lines = _changed(lines, "fell", "true", row)
    (place / ASKED / ANSWER).write_text("".join(lines))
    done(*COLLECT, folder=place)
    first, second, *_ = read(place / "runs/one/collect_real/trajectories.parquet").episodes
    assert len(first) == 30 and first.ended_in_a_fall
    assert len(second) == 80 and not second.ended_in_a_fall


def test_a_sense_with_blanks_that_nobody_asked_for_is_left_out(place: Path) -> None:
    lines = _lines(place)
    more = [
        ",".join([line[:-1], voltage]) + "\n"
        for line, voltage in zip(lines[1:], ["voltage", "21.5"] * 999, strict=False)
    ]
    more = [line.replace(",21.5\n", ",\n") if number % 3 else line for number, line in enumerate(more)]
    more = [line.replace(",voltage\n", ",20\n") if number else line for number, line in enumerate(more)]
    (place / ASKED / ANSWER).write_text("".join([lines[0], *more]))
    done(*COLLECT, folder=place)
    (episode, *_) = read(place / "runs/one/collect_real/trajectories.parquet").episodes
    assert "voltage" not in episode.sensors and "gyro.x" in episode.sensors


def test_an_answer_to_another_request_is_not_taken_in_and_a_part_is_known_by_its_numbers(place: Path) -> None:
    lines = _lines(place)
    (place / "foreign.csv").write_text("".join(["# gsl answer to request abc\n", *lines[1:]]))
    assert "foreign.csv: answers another request (abc" in refused(
        "answer", f"request={ASKED}", "logs=foreign.csv", folder=place
    )
    part = [line for line in lines[2:] if line.startswith(("1,", "3,"))]
    (place / "part.csv").write_text("".join([*lines[:2], *part]))
    done("answer", f"request={ASKED}", "logs=part.csv", folder=place)
    assert "4 of 6 episodes are missing, 6 s in all (pi0_01, pi0_03, " in done(*COLLECT, folder=place).err


@pytest.mark.parametrize(
    ("text", "problem"),
    [(None, "request.json: is missing beside an answer to it; put"), ("{", "request.json: is dama")],
)
def test_a_request_that_is_lost_beside_its_answer_is_told(place: Path, text: str | None, problem: str) -> None:
    (place / ASKED / ANSWER).write_bytes((place / "runs/elsewhere" / ANSWER).read_bytes())
    (place / ASKED / "request.json").unlink()
    if text:
        (place / ASKED / "request.json").write_text(text)
    assert problem in refused(*COLLECT, folder=place)


@pytest.mark.parametrize("name", ["runner.py", "modules"])
def test_a_runner_that_was_deleted_is_written_anew(place: Path, name: str) -> None:
    path = place / ASKED / name
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    assert "parts of its runner were missing; they are written anew" in done(*COLLECT, folder=place).err
    assert path.exists()


def test_the_log_of_another_episode_is_noticed(place: Path) -> None:
    names = "[neighbour_01,neighbour_02,pi0_01,pi0_02,pi0_03,pi0_04]"
    said = done("answer", f"request={ASKED}", f"logs=runs/elsewhere/{ANSWER}", f"episodes={names}", folder=place)
    assert "neighbour_01: half of its actions are " in said.err and "is it the log of another episode" in said.err


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (("episodes=[pi0_09]",), "the runner ended with exit code 2: runner.py: there is no episode pi0_09; there is"),
        (("world.floating=false",), "world.floating: the request is for a robot on the ground"),
        (("world.period=0.01",), "world: is no stand-in for nao: it has other joints or another rate"),
        (("world=robot",), "world: a real robot somewhere else cannot be simulated; it serves as real= of iterate"),
    ],
)
def test_a_rehearsal_that_cannot_be_is_refused_in_one_line(place: Path, words: tuple[str, ...], problem: str) -> None:
    code = 1 if "runner" in problem else 2
    assert refused("rehearse", f"request={ASKED}", *words, folder=place, code=code).startswith(problem)


def test_a_robot_that_is_asked_for_no_sensors_is_rehearsed_without(tmp_path: Path) -> None:
    words = ("world=robot", "world.floating=false", "world.sensors=[]", "task=excite", "policy.motions=[steps_large]")
    words = ("collect", *words, "policy.duration=1.5", "policy.repeats=1", "workers=1", "name=air")
    request = _asked(*words, folder=tmp_path)
    done("rehearse", f"request={request}", "world=nao_worn", "world.floating=false", folder=tmp_path)
    done(*words, folder=tmp_path)
    log = read(tmp_path / "runs/air/collect_real/trajectories.parquet")
    assert not [name for name in log.episodes[0].sensors if name.startswith("gyro")]


def test_a_rehearsal_runs_no_code_that_gsl_did_not_write(place: Path) -> None:
    (place / ASKED / "runner.py").write_text("import os\n")
    assert "is not what this gsl writes, and is not run here" in refused("rehearse", f"request={ASKED}", folder=place)


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (("world.sensors=[gyro]",), "policy: needs foot_force, which the robot does not tell; say world.sensors="),
        (("world.sensors=[gyro,gyro]",), "world.sensors = gyro, gyro: names one twice"),
        (("world.ramp=0.1",), "world.ramp = 0.1: must be at least 1 (s)"),
        (("world.requests=null",), "world.requests: a real robot needs a folder for its requests"),
        (("world.robot=nobody",), "no robot called 'nobody'"),
        (("world.robot=so101",), "floating = true: the so101 has no feet to stand on; say floating=false"),
    ],
)
def test_a_robot_that_cannot_be_asked_is_refused_in_one_line(
    tmp_path: Path, words: tuple[str, ...], problem: str
) -> None:
    assert problem in refused(*COLLECT, *words, folder=tmp_path)


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (("iterate", "sim=robot"), "sim: is a real robot, which cannot play the simulator's part"),
        (("collect", "role=sim", "world=robot"), "world: is a real robot, which cannot play the simulator's part"),
        (("optimize", "world=robot", "grounding=none"), "world: a real robot somewhere else cannot be simulated; it"),
    ],
)
def test_a_real_robot_is_no_simulator(tmp_path: Path, words: tuple[str, ...], problem: str) -> None:
    assert refused(*words, *SMALL, "name=one", folder=tmp_path).startswith(problem)


def test_an_excitation_in_the_air_goes_out_as_a_table_of_commands(tmp_path: Path) -> None:
    words = ("collect", "world=robot", "task=excite", "preset=toy", "policy.motions=[steps_large]", "name=air")
    asked = _asked(*words, "workers=1", folder=tmp_path)
    request = read_request(tmp_path / asked)
    assert request["place"] == "held in the air" and len(request["episodes"][0]["commands"]) == 175
    done("rehearse", f"request={asked}", "world=nao_worn", "world.floating=false", folder=tmp_path)
    assert done(*words, "workers=1", folder=tmp_path).out.splitlines()[-1] == "runs/air/collect_real"
