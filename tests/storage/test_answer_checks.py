"""An answer with the right mark is looked at as an import looks at a log, and against the commands asked for."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commands import SMALL, done, gsl, refused

from gsl.core.trajectory import Trajectory
from gsl.errors import InputError
from gsl.runner.journal import ANSWER
from gsl.runner.request import read_request
from gsl.storage.answer_checks import check_answers
from gsl.storage.answers import Answered, read_answers

COLLECT = ("collect", *SMALL, "world=robot", "name=one", "recipe.spread=0.02")

pytestmark = pytest.mark.slow

ASKED = "runs/one/collect_real.request"
AIR = ("collect", "world=robot", "task=excite", "preset=toy", "policy.motions=[steps_large]", "name=one", "workers=1")
KNEE, SHOULDER = 3, 4


@pytest.fixture(scope="module")
def walks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("walks")
    gsl(*COLLECT, folder=folder)
    done("rehearse", f"request={ASKED}", "world=nao_worn", "out=runs/elsewhere", folder=folder)
    return folder


@pytest.fixture(scope="module")
def air(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("air")
    gsl(*AIR, folder=folder)
    words = ("world=nao_worn", "world.floating=false", "out=runs/elsewhere")
    done("rehearse", f"request={ASKED}", *words, folder=folder)
    return folder


def answers(folder: Path, place: Path) -> tuple[dict, dict[str, Answered]]:
    """The request of a folder and a whole answer to it, beside the request as a robot would bring it."""
    shutil.copytree(folder / ASKED, place / ASKED)
    shutil.copy(folder / "runs/elsewhere" / ANSWER, place / ASKED)
    request = read_request(place / ASKED)
    return request, read_answers(place / ASKED, request)


def spoilt(answered: dict[str, Answered], name: str, how: Callable[[Trajectory], Trajectory]) -> dict[str, Answered]:
    log = answered[name].trajectory
    assert log is not None
    return {**answered, name: replace(answered[name], trajectory=how(log))}


def test_a_rehearsal_raises_no_suspicion(walks: Path, air: Path, tmp_path: Path) -> None:
    for number, folder in enumerate((walks, air)):
        assert check_answers(*answers(folder, tmp_path / str(number))) == []


def test_of_a_log_of_something_else_it_is_warned_alone(walks: Path, tmp_path: Path) -> None:
    request, answered = answers(walks, tmp_path)
    foreign = {name: replace(answer, path=Path("answer.parquet")) for name, answer in answered.items()}
    off = spoilt(foreign, "pi0_01", lambda log: replace(log, action=log.action + 0.3))
    assert any("pi0_01: half of its actions are 0.3 rad or more off" in line for line in check_answers(request, off))


def beyond(part: str, value: float) -> Callable[[Trajectory], Trajectory]:
    def spoil(log: Trajectory) -> Trajectory:
        values = getattr(log, part).copy()
        values[20, KNEE] = value
        return replace(log, **{part: values})

    return spoil


def frozen(log: Trajectory) -> Trajectory:
    return replace(log, position=np.tile(log.position[:1], (len(log.position), 1)))


def dithering(log: Trajectory) -> Trajectory:
    """The log of motors without power, whose encoders see noise."""
    noise = np.sin(np.arange(log.position.size)).reshape(log.position.shape)
    return replace(log, position=log.position[:1] + 1e-3 * noise)


def stuck(log: Trajectory) -> Trajectory:
    """The log of a joint that nobody reads any more from a row on, while it is sent far away and back."""
    position = log.position.copy()
    position[30:] = position[30]
    return replace(log, position=position)


def away(log: Trajectory) -> Trajectory:
    return replace(log, position=log.position + 0.9 * (np.arange(log.position.shape[1]) == SHOULDER))


def cut_off(log: Trajectory, steps: int) -> Trajectory:
    rows = steps + 1
    sensors = {name: values[:rows] for name, values in log.sensors.items()}
    position, velocity = log.position[:rows], log.velocity[:rows]
    return Trajectory(
        log.time[:rows], log.action[:steps], position, velocity, sensors=sensors, fell=np.arange(rows) == steps
    )


def in_degrees(log: Trajectory) -> Trajectory:
    return replace(log, position=np.rad2deg(log.position), velocity=np.rad2deg(log.velocity))


CASES = [
    (beyond("position", 1e300), "column position.LKneePitch, row 20: pi0_01: is 1e+300, which nothing measures"),
    (beyond("velocity", 1e300), "column velocity.LKneePitch, row 20: pi0_01: is 1e+300, which nothing measures"),
    (in_degrees, "rad, but goes from"),
    (beyond("position", 3.0), "row 20: pi0_01: is at 3 rad, but goes from -0.09233 to 2.113 rad: is it in degrees"),
    (lambda log: replace(log, action=log.action + 0.3), "pi0_01: 100 % of its actions are up to 0.3 rad off what was"),
    (lambda log: replace(log, action=log.action[::-1]), "pi0_01: "),
    (
        lambda log: replace(log, sensors={**log.sensors, "gyro.x": log.sensors["gyro.x"] + 1e300}),
        "column gyro.x, row 0",
    ),
]


@pytest.mark.parametrize(("how", "problem"), CASES)
def test_an_answer_that_cannot_be_one_is_refused(
    walks: Path, tmp_path: Path, how: Callable[[Trajectory], Trajectory], problem: str
) -> None:
    request, answered = answers(walks, tmp_path)
    with pytest.raises(InputError) as error:
        check_answers(request, spoilt(answered, "pi0_01", how))
    assert problem in str(error.value) and str(error.value).startswith(str(tmp_path)) and "\n" not in str(error.value)


@pytest.mark.parametrize("how", [frozen, dithering, stuck])
def test_a_joint_that_stands_still_under_commands_is_refused_unless_it_ended_the_episode(
    air: Path, tmp_path: Path, how: Callable[[Trajectory], Trajectory]
) -> None:
    request, answered = answers(air, tmp_path)
    name = next(iter(answered))
    with pytest.raises(InputError, match=r"position\.\w+ stands still from row \d+ on for 1 s, though it was sent 0\."):
        check_answers(request, spoilt(answered, name, how))
    ended = spoilt(answered, name, how)
    check_answers(request, {**ended, name: replace(ended[name], stopped=True)})


def test_a_joint_far_from_all_it_was_sent_is_refused(air: Path, tmp_path: Path) -> None:
    request, answered = answers(air, tmp_path)
    name = next(iter(answered))
    with pytest.raises(InputError, match=r"rad off all that it was sent in 0\.3 s; run it again, or take it in with"):
        check_answers(request, spoilt(answered, name, away))


def test_commands_are_compared_with_those_that_were_asked_for(air: Path, tmp_path: Path) -> None:
    request, answered = answers(air, tmp_path)
    name = next(iter(answered))
    with pytest.raises(InputError, match=rf"{name}: \d+ % of its actions are up to 0\.3 rad off what was asked for"):
        late = np.r_[np.zeros(20), np.full(len(answered[name].trajectory) - 20, 0.3)]
        knee = late[:, None] * (np.arange(len(request["joints"])) == KNEE)
        check_answers(request, spoilt(answered, name, lambda log: replace(log, action=log.action + knee)))


def test_one_log_for_two_episodes_is_refused_where_they_ask_for_different_things(walks: Path, tmp_path: Path) -> None:
    request, answered = answers(walks, tmp_path)
    twin = {**answered, "neighbour_01": replace(answered["pi0_01"])}
    foreign = {name: replace(answer, path=Path("answer.parquet")) for name, answer in twin.items()}
    with pytest.raises(InputError, match="pi0_01 and neighbour_01 have the same log, to 1e-05 rad; each of them"):
        check_answers(request, foreign)
    alike = {**answered, "pi0_02": answered["pi0_01"]}
    assert check_answers(request, alike) == [
        "pi0_01 and pi0_02 have the same log, to 1e-05 rad: is it of a simulation without noise?"
    ]
    noise = 1e-7 * np.random.default_rng(0).standard_normal(answered["pi0_01"].trajectory.position.shape)
    nearly = spoilt(twin, "neighbour_01", lambda log: replace(log, position=log.position + noise))
    cut = spoilt(twin, "neighbour_01", lambda log: cut_off(log, 40))
    for copied in (nearly, cut):
        with pytest.raises(InputError, match="pi0_01 and neighbour_01 have the same log"):
            check_answers(request, {name: replace(answer, path=Path("a.parquet")) for name, answer in copied.items()})
    clocked = {name: replace(answer, trajectory=replace(answer.trajectory, time=answer.trajectory.time + 1e-4 * (
        np.arange(len(answer.trajectory.time)) > 0))) for name, answer in alike.items()}  # fmt: skip
    with pytest.raises(InputError, match="pi0_01 and pi0_02 have the same log"):
        check_answers(request, clocked)


def test_a_log_that_runs_backwards_is_told(walks: Path, tmp_path: Path) -> None:
    request, answered = answers(walks, tmp_path)
    turned = spoilt(
        answered, "pi0_01", lambda log: replace(log, position=log.position[::-1], velocity=log.velocity[::-1])
    )
    assert "pi0_01: its velocities go against its positions; is it turned round in time?" in check_answers(
        request, turned
    )


@pytest.mark.parametrize(
    ("row", "problem"),
    [
        ("pi0_01,1e300,no", "row 1: value is '1e300', which nothing measures"),
        ("pi0_01,nan,no", "row 1: value is 'nan', which nothing measures"),
    ],
)
def test_a_measured_value_that_cannot_be_one_is_refused(walks: Path, tmp_path: Path, row: str, problem: str) -> None:
    request, _ = answers(walks, tmp_path)
    (tmp_path / ASKED / "returns.csv").write_text(f"episode,value,fell\n{row}\n")
    with pytest.raises(InputError, match=problem):
        read_answers(tmp_path / ASKED, request)


def test_the_stages_look_at_answers(walks: Path, tmp_path: Path) -> None:
    answers(walks, tmp_path)
    path = tmp_path / ASKED / ANSWER
    lines = path.read_text().splitlines(keepends=True)
    names = lines[1].strip().split(",")
    at = [names.index(name) for name in names if name.startswith("action.")][KNEE]
    cells = [line.rstrip("\n").split(",") for line in lines[2:]]
    moved = [[*row[:at], row[at] and repr(float(row[at]) + 0.3), *row[at + 1 :]] for row in cells]
    path.write_text("".join([*lines[:2], *(",".join(row) + "\n" for row in moved)]))
    said = refused(*COLLECT, folder=tmp_path)
    assert said.startswith(f"{ASKED}/{ANSWER}: pi0_01: 100 % of its actions are up to 0.3 rad off what was asked for")
    path.rename(tmp_path / "mine.csv")
    warnings = done("answer", f"request={ASKED}", "logs=mine.csv", folder=tmp_path).err
    assert "warning: pi0_01: half of its actions are 0.3 rad or more off what the policy does" in warnings
