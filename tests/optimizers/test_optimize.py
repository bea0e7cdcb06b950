"""A search keeps the best of each generation, and is the same search after a kill."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from commands import done
from scenarios import AIR, QUIET, REACH

from gsl.core.console import Silent
from gsl.core.interfaces import Step
from gsl.core.layout import Layout
from gsl.grounding.none import NoGrounding
from gsl.optimizers.cma_es import CmaEs
from gsl.stages.optimize import BEST, Optimize
from gsl.storage.generation_log import Generation, GenerationLog
from gsl.storage.policies import read_policies
from gsl.tasks.arm import Arm

pytestmark = pytest.mark.slow

SETTINGS = [
    *("name=kill", "grounding=none", "task=arm", "policy=linear", "world.floating=false", "world.settle=0.1"),
    *("optimizer.candidates=4", "optimizer.generations=5", "optimizer.sigma=0.2", "rollouts=1", "workers=1"),
    "task.duration=1.0",
]


def _search(generations: int, seed: int = 1) -> Optimize:
    optimizer = CmaEs(candidates=6, generations=generations, sigma=0.2)
    return Optimize(AIR, Arm(duration=1.0), REACH, NoGrounding(), optimizer, rollouts=1, workers=1, seed=seed)


def test_the_file_holds_pi0_and_the_best_of_each_generation(tmp_path: Path) -> None:
    metrics = _search(3).run(tmp_path, QUIET)
    records = read_policies(tmp_path / "policies.json").records
    assert [entry.name for entry in records] == ["pi0", "generation_01", "generation_02", "generation_03"]
    assert metrics["best_value_sim"] == max(entry.value_sim for entry in records[1:])
    assert records[0].parameters == dict(zip(REACH.names, REACH.initial, strict=True))


def test_the_arm_learns_to_reach_its_goal(tmp_path: Path) -> None:
    optimizer = CmaEs(candidates=8, generations=8, sigma=0.3)
    search = Optimize(AIR, Arm(), REACH, NoGrounding(), optimizer, rollouts=1, workers=1)
    search.run(tmp_path, QUIET)
    values = [record.value_sim for record in read_policies(tmp_path / "policies.json").records[1:]]
    assert max(values) > 20 * values[0] or max(values) > 20.0


def test_generations_read_from_the_log_are_not_run_again(tmp_path: Path) -> None:
    _search(2).run(tmp_path, QUIET)
    whole = (tmp_path / "policies.json").read_bytes()
    log = tmp_path / "generations.jsonl"
    first, second = log.read_text().splitlines(keepends=True)
    log.write_text(first + second[:20])  # as a kill leaves it
    _search(2).run(tmp_path, QUIET)
    assert (tmp_path / "policies.json").read_bytes() == whole
    assert log.read_text() == first + second


@pytest.mark.parametrize("index", [0.03, 0.3, 0.6, 0.97])
def test_a_flipped_bit_in_the_log_changes_nothing_of_the_search(tmp_path: Path, index: float) -> None:
    _search(2).run(tmp_path, QUIET)
    files = {name: (tmp_path / name).read_bytes() for name in ("policies.json", BEST, "generations.jsonl")}
    log = bytearray(files["generations.jsonl"])
    log[int(index * len(log))] ^= 1
    (tmp_path / "generations.jsonl").write_bytes(log)
    console = Recording()
    _search(2).run(tmp_path, console)
    assert {name: (tmp_path / name).read_bytes() for name in files} == files
    [line] = [text for text in console.said if "generations.jsonl" in text]
    assert f"damaged or incomplete and cut off; the work goes on after record {int(index > 0.5)}" in line


class Recording(Silent):
    """A console that keeps what it is told."""

    def __init__(self) -> None:
        self.said: list[str] = []

    def status(self, text: str) -> None:
        self.said.append(text)


def test_whatever_bit_is_flipped_the_log_returns_only_what_was_written(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    log = GenerationLog(tmp_path)
    written = [Generation(n, rng.normal(size=1).tolist(), [n]) for n in range(2)]
    for generation in written:
        log.append(generation)
    path = tmp_path / "generations.jsonl"
    whole = path.read_bytes()
    ends = [0, *np.flatnonzero(np.frombuffer(whole, np.uint8) == ord("\n")) + 1]
    for bit in range(8 * len(whole)):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        said: list[str] = []
        reader = GenerationLog(tmp_path, said.append)
        intact = int(np.searchsorted(ends, bit // 8, side="right")) - 1
        assert [reader.read(n) for n in range(2)] == [*written[:intact], *[None] * (2 - intact)]
        assert len(said) == 1
        assert path.read_bytes() == whole[: ends[intact]]


def test_a_line_that_is_missing_repeated_or_moved_ends_the_log(tmp_path: Path) -> None:
    log = GenerationLog(tmp_path)
    for n in range(3):
        log.append(Generation(n, [float(n)], [0]))
    path = tmp_path / "generations.jsonl"
    a, b, c = path.read_bytes().splitlines(keepends=True)
    cases: dict[tuple[bytes, ...], int] = {
        (a, c): 1,
        (b, c): 0,
        (a, b, b): 2,
        (a, c, b): 1,
        (a, b, b"[]\n"): 2,
        (a, b"\xff"): 1,
    }
    for lines, kept in cases.items():
        path.write_bytes(b"".join(lines))
        reader = GenerationLog(tmp_path)
        assert [reader.read(n) is not None for n in range(3)] == [n < kept for n in range(3)]


@dataclass(frozen=True)
class Anything(Arm):
    """Every step is worth as much."""

    worth: float = 0.0

    def start(self, layout: Layout, observation: np.ndarray, role: str) -> Anything:
        return self

    def step(self, before: np.ndarray, after: np.ndarray, fell: bool) -> Step:
        return Step(self.worth, ended=False)


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_of_equally_good_generations_the_last_one_is_the_best(tmp_path: Path, value: float) -> None:
    search = replace(_search(3), task=Anything(duration=0.1, worth=value))
    assert search.run(tmp_path, QUIET)["best_value_sim"] == pytest.approx(5 * value)
    assert [record.name for record in read_policies(tmp_path / BEST).records] == ["generation_03"]


def test_a_log_returns_its_values_to_the_bit(tmp_path: Path) -> None:
    values = np.random.default_rng(0).normal(size=5).tolist()
    GenerationLog(tmp_path).append(Generation(0, values, [0] * 5))
    assert GenerationLog(tmp_path).read(0) == Generation(0, values, [0] * 5)
    assert GenerationLog(tmp_path).read(1) is None


def test_cma_es_maximises() -> None:
    run = CmaEs(candidates=12, generations=60, sigma=0.5).start(np.zeros(4), np.array([1.0, 1.0, 10.0, 0.1]), 0)
    goal = np.array([1.0, -2.0, 20.0, 0.3])
    for _ in range(60):
        candidates = run.ask()
        run.tell([-float(np.sum(((c - goal) / [1.0, 1.0, 10.0, 0.1]) ** 2)) for c in candidates])
    np.testing.assert_allclose(candidates[0], goal, rtol=1e-2)


def test_cma_es_refuses_a_wrong_number_of_values() -> None:
    run = CmaEs(candidates=8, generations=2).start(np.ones(3), np.ones(3), 5)
    run.ask()
    with pytest.raises(ValueError, match="7"):
        run.tell([0.0] * 7)


def test_after_kill_9_a_search_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "gsl", "optimize", *SETTINGS]
    killed = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    log = tmp_path / "runs/kill/.optimize.partial/generations.jsonl"
    deadline = time.monotonic() + 60.0
    while not (log.exists() and log.read_text().count("\n") >= 2):
        assert killed.poll() is None and time.monotonic() < deadline, "the search ended before it could be killed"
        time.sleep(0.005)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    before = log.read_text()
    done("optimize", *SETTINGS, folder=tmp_path)
    done("optimize", *SETTINGS, "out=runs/whole", folder=tmp_path)
    resumed, whole = tmp_path / "runs/kill/optimize", tmp_path / "runs/whole"
    assert (resumed / "policies.json").read_bytes() == (whole / "policies.json").read_bytes()
    assert (resumed / "generations.jsonl").read_text().startswith(before.rpartition("\n")[0])
