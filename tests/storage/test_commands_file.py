"""Command files: what is written is read, what a robot must not be asked is refused, the rest is played."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import done, gsl

from gsl.errors import ArtifactError
from gsl.policies.excitation import Excitation
from gsl.robots.nao import nao
from gsl.storage.commands import Commands, read_commands, write_commands
from gsl.storage.trajectories import read

PERIOD = 0.02
MENU = Excitation(robot="nao", duration=1.5)
LINE = ("collect", "task=excite", "workers=1", "name=x")


def a_file(path: Path, **changes: Any) -> Path:
    """Write a command file of two episodes, one of them shorter."""
    long, short = MENU.commands("chirp", "a", PERIOD), MENU.commands("steps_large", "b", PERIOD)[:40]
    commands = Commands("nao", nao().controlled, PERIOD, (("fast", long), ("short", short)), {"why": "to see"})
    write_commands(path, commands)
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))
    return path


def test_a_command_file_is_read_as_it_was_written_whatever_the_order_of_its_joints(tmp_path: Path) -> None:
    read_once = read_commands(a_file(tmp_path / "one.json"), nao())
    turned = [{"name": name, "action": action[:, ::-1].tolist()} for name, action in read_once.episodes]
    other = a_file(tmp_path / "two.json", joints=nao().controlled[::-1], episodes=turned)
    for (name, action), (again, same) in zip(read_once.episodes, read_commands(other, nao()).episodes, strict=True):
        assert name == again
        np.testing.assert_array_equal(action, same)
    np.testing.assert_array_equal(read_once.episodes[0][1], MENU.commands("chirp", "a", PERIOD))
    assert read_once.about == {"why": "to see"} and read_once.control_period == PERIOD


def test_collect_plays_a_command_file_and_knows_when_it_changed(tmp_path: Path) -> None:
    a_file(tmp_path / "experiment.json")
    line = (*LINE, "policy.file=experiment.json")
    done(*line, folder=tmp_path)
    batch = read(tmp_path / "runs/x/collect_real/trajectories.parquet")
    assert [entry["policy"] for entry in batch.metadata["episodes"]] == ["fast", "short"]
    wanted = read_commands(tmp_path / "experiment.json", nao()).episodes
    for episode, (_, action) in zip(batch.episodes, wanted, strict=True):
        np.testing.assert_array_equal(episode.action, action)
    assert "(unchanged)" in done(*line, folder=tmp_path).out
    a_file(tmp_path / "experiment.json", about={"why": "again"})
    assert "policy.file" in gsl(*line, folder=tmp_path).err


def changed(row: int, joint: int, value: Any) -> Callable[[dict[str, Any]], None]:
    return lambda stored: stored["episodes"][0]["action"][row].__setitem__(joint, value)


BAD: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "another version": (lambda stored: stored.update(schema_version=2), "schema_version 2 is unknown"),
    "no version": (lambda stored: stored.pop("schema_version"), "schema_version None is unknown"),
    "no joints": (lambda stored: stored.pop("joints"), "has no joints"),
    "another robot": (lambda stored: stored.update(robot="pepper"), "is for the robot 'pepper', not for nao"),
    "a joint it does not have": (
        lambda stored: stored["joints"].__setitem__(3, "LKneePich"),
        "the robot has no joint called 'LKneePich'; did you mean LKneePitch",
    ),
    "a joint twice": (lambda stored: stored["joints"].__setitem__(0, "LKneePitch"), "different names"),
    "a joint missing": (lambda stored: stored["joints"].pop(), "the joint RShoulderRoll is missing"),
    "no period": (lambda stored: stored.update(control_period=0), "control_period 0 must be a positive number"),
    "no episodes": (lambda stored: stored.update(episodes=[]), "there is no episode"),
    "no name": (lambda stored: stored["episodes"][1].pop("name"), "episode 1: has no name"),
    "no action": (lambda stored: stored["episodes"][0].pop("action"), "episode fast: action must be rows of 15"),
    "a short row": (lambda stored: stored["episodes"][0]["action"][7].pop(), "episode fast: action must be rows of 15"),
    "a text": (changed(7, 3, "far"), "episode fast: action must be rows of 15"),
    "a null": (changed(7, 3, None), "episode fast, row 7, LKneePitch: the target is not a finite number"),
    "a NaN": (changed(7, 3, float("nan")), "episode fast, row 7, LKneePitch: the target is not a finite number"),
    "beyond a limit": (changed(7, 3, 2.2), "row 7, LKneePitch: the target of 2.2 rad is above the limit, 2.113 rad"),
    "too abrupt": (changed(7, 3, 1.4), "row 7, LKneePitch: the target jumps by"),
    "too fast": (
        lambda stored: [
            row.__setitem__(3, 0.9 + 0.1 * min(k, 9)) for k, row in enumerate(stored["episodes"][0]["action"])
        ],
        "row 7, LKneePitch: the target moves 0.7",
    ),
}


@pytest.mark.parametrize(("change", "problem"), BAD.values(), ids=BAD.keys())
def test_a_bad_command_file_is_one_clear_line(
    tmp_path: Path, change: Callable[[dict[str, Any]], Any], problem: str
) -> None:
    path = a_file(tmp_path / "bad.json")
    stored = json.loads(path.read_text())
    change(stored)
    path.write_text(json.dumps(stored))
    with pytest.raises(ArtifactError) as caught:
        read_commands(path, nao())
    assert str(caught.value).startswith(f"{path}: ") and problem in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("contents", [b"", b"{", b"[]", b"\xff\xfe"])
def test_what_is_no_command_file_is_refused(tmp_path: Path, contents: bytes) -> None:
    (tmp_path / "bad.json").write_bytes(contents)
    for path in (tmp_path / "bad.json", tmp_path, tmp_path / "none.json"):
        with pytest.raises(ArtifactError):
            read_commands(path, nao())


def test_collect_says_what_is_wrong_with_a_file(tmp_path: Path) -> None:
    a_file(tmp_path / "slow.json", control_period=0.04)
    for name, problem in {
        "slow.json": "control_period is 0.04 s, but the world's is 0.02 s; say world.period=...",
        "none.json": "there is no such path and no such run in runs",
    }.items():
        said = gsl(*LINE, f"policy.file={name}", folder=tmp_path)
        assert (said.code, said.lines) == (2, [f"gsl collect: {name}: {problem}"])
