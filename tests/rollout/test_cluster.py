"""Jobs on a dask cluster come to what they come to here, whatever worker dies; a scheduler that is gone is one line."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import SMALL, done, eventually, gsl, refused, started
from scenarios import QUIET, walk
from torture_kills import payloads

from gsl.errors import GslError
from gsl.rollout import parallel
from gsl.rollout.cluster import Cluster, executing
from gsl.rollout.parallel import Job

distributed = pytest.importorskip("distributed")
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("default")]  # other people's libraries may warn

NOWHERE = "tcp://127.0.0.1:9"  # a port of the system at which nobody listens
SOON = 10.0  # [s]
SEARCH = ("optimize", "name=k", "preset=toy", "task.duration=0.8", "workers=2", "grounding=none")


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """A scheduler with two workers, each of two threads as `dask worker` starts them by default."""
    with distributed.LocalCluster(2, threads_per_worker=2, dashboard_address=None, silence_logs=60) as cluster:
        yield cluster.scheduler_address


@contextlib.contextmanager
def scheduler(folder: Path, port: int) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """A scheduler and a worker as their own commands start them."""
    address = f"tcp://127.0.0.1:{port}"
    lines = {"dask_scheduler": ("--port", str(port)), "dask_worker": (address, "--nthreads", "1", "--no-nanny")}
    started = [
        subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{name}", *words, "--no-dashboard"],
            cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        for name, words in lines.items()
    ]  # fmt: skip
    try:
        yield address, started[0]
    finally:
        for process in started:
            process.kill()
            process.wait()


def played(cluster: Cluster | None, function: Callable[[bytes, Job], Any] = parallel.play_trajectory) -> list[bytes]:
    """Return all bytes of six rollouts."""
    scenario, rng = walk(), np.random.default_rng(0)
    start, scale = scenario.policy.initial, scenario.policy.scale
    jobs = [Job(start + 0.02 * scale * rng.standard_normal(len(start)), 10 + k) for k in range(6)]
    with executing(cluster), QUIET.progress(len(jobs), "") as progress:
        trajectories = parallel.in_parallel(function, scenario, jobs, 1, progress)
    return [entry.position.tobytes() + entry.velocity.tobytes() + entry.reward.tobytes() for entry in trajectories]


def _dies_once(marker: Path, frozen: bytes, job: Job) -> Any:
    if job.seed == 12 and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return parallel.play_trajectory(frozen, job)


def _dies(frozen: bytes, job: Job) -> Any:
    os.kill(os.getpid(), signal.SIGKILL)


def _fails(frozen: bytes, job: Job) -> Any:
    raise FileNotFoundError(2, "No such file or directory", "of a job")


def test_two_workers_come_to_the_bytes_of_this_process_though_one_is_killed(address: str, tmp_path: Path) -> None:
    alone = played(None)
    assert played(Cluster(address)) == alone
    assert played(Cluster(address), partial(_dies_once, tmp_path / "died")) == alone
    assert (tmp_path / "died").exists()


def test_a_job_that_kills_every_worker_is_one_line(address: str) -> None:
    with pytest.raises(GslError, match=f"^{address}: a job has killed several workers; look at their free memory"):
        played(Cluster(address), _dies)


def test_an_error_of_a_job_is_not_one_of_the_scheduler(address: str) -> None:
    with pytest.raises(GslError, match="_fails failed.*of a job"):
        played(Cluster(address), _fails)


def test_a_command_comes_to_the_same_payload_on_a_cluster_of_this_machine(tmp_path: Path) -> None:
    done(*SEARCH, "workers=1", folder=tmp_path)
    alone = payloads(tmp_path / "runs/k")
    done(*SEARCH, "executor=dask", "out=runs/dask/optimize", folder=tmp_path)
    assert payloads(tmp_path / "runs/dask") == alone
    assert "(unchanged)" in done(*SEARCH, "executor=dask", f"address={NOWHERE}", folder=tmp_path).out  # it asks nobody


def test_workers_that_do_not_start_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*words: Any, **settings: Any) -> None:
        raise RuntimeError("Nanny failed to start.")  # what dask says of a script without a main part, for instance

    monkeypatch.setattr(distributed, "LocalCluster", fail)
    with pytest.raises(
        GslError, match=r"^dask cannot start its workers here \(Nanny failed to start\.\); look at free"
    ):
        played(Cluster(None))


def test_trials_of_a_study_go_to_the_workers(address: str, tmp_path: Path) -> None:
    left = ("ane_01", "ane_02", "gat", "gat_005", "effects", "effects_gat")
    words = ("compare", "preset=toy", "trials=1", "iterate.task.duration=0.6", "iterate.workers=1", "~worlds.nao_weak")
    few = ("preset.generations=1", "preset.candidates=4", "preset.rollouts=1", "preset.episodes=1")
    words = (*words, *(f"~methods.{name}" for name in left), *few)
    done(*words, "name=here", folder=tmp_path)
    said = done(*words, "name=there", "executor=dask", f"address={address}", folder=tmp_path)
    assert "collecting" not in said.err  # nothing is rolled out in this process
    assert payloads(tmp_path / "runs/here") == payloads(tmp_path / "runs/there")
    done("verify", "there", folder=tmp_path)
    (tmp_path / "runs/there/nao_worn/none/trial_01/evaluate/metrics.json").write_text("{}")
    assert gsl(*words, "name=there", folder=tmp_path).code == 2  # a link of the study, though a worker has built it


def test_a_scheduler_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    begin = time.monotonic()
    said = refused(*SEARCH, "executor=dask", f"address={NOWHERE}", folder=tmp_path, code=1)
    assert time.monotonic() - begin < SOON
    assert said == (
        f"{NOWHERE}: no dask scheduler answers there; "
        "the same command goes on once there is one, or with executor=local"
    )


LONG = (*SEARCH, "preset.generations=8", "preset.candidates=4", "preset.rollouts=1")  # not over when its first is


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What the long search comes to undisturbed."""
    folder = tmp_path_factory.mktemp("whole")
    done(*LONG, "workers=1", folder=folder)
    return payloads(folder / "runs/k")


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGSTOP], ids=["dies", "hangs"])
def test_a_search_goes_on_without_its_scheduler(end: signal.Signals, whole: dict[str, str], tmp_path: Path) -> None:
    port = 20_000 + os.getpid() % 10_000 + (end == signal.SIGKILL)
    progress = tmp_path / "runs/k/.optimize.partial/generations.jsonl"
    with (
        scheduler(tmp_path, port) as (address, process),
        started(*LONG, "executor=dask", f"address={address}", folder=tmp_path) as search,
    ):
        assert eventually(lambda: progress.exists() and progress.stat().st_size > 0)
        process.send_signal(end)
        begin = time.monotonic()
        _, said = search.communicate()
        assert time.monotonic() - begin < SOON
        assert search.returncode == 1
        assert said.splitlines()[-1].startswith(f"gsl optimize: {address}: no dask scheduler answers there; ")
    begun = progress.read_bytes()
    assert begun
    done(*LONG, "workers=1", folder=tmp_path)
    assert payloads(tmp_path / "runs/k") == whole


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("collect", f"address={NOWHERE}"), f"address = {NOWHERE}: is of a dask scheduler; say executor=dask, too"),
        (("collect", "executor=dask", "address=host"), "address = host: must be the address that `dask scheduler`"),
        (("train-inverse", "executor=dask"), "executor = dask: this command gives nothing to workers; leave it out"),
        (("collect", "executor=ray"), "executor = ray: must be one of 'local' or 'dask'"),
    ],
)
def test_what_cannot_be_is_refused(words: tuple[str, ...], said: str, chain: Path) -> None:
    settings = SMALL if words[0] == "collect" else ("data=chain/collect_sim",)
    assert refused(*words, *settings, folder=chain).startswith(said)
