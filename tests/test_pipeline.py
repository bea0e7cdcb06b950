"""The chain of commands as a user types it: every stage by the real command line, on toy sizes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

SMALL = ["preset=toy", "task.duration=1.6", "name=chain", "workers=1"]


def gsl(*arguments: str, folder: Path, code: int = 0) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gsl", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == code, f"{arguments} ended with {done.returncode}: {done.stderr[-2000:]}"
    assert "Traceback" not in done.stderr
    return done


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("chain")
    for role in ("real", "sim"):
        gsl("collect", f"role={role}", *SMALL, folder=folder)
    gsl("train-forward", "preset=toy", "name=chain", "model=linear", folder=folder)
    gsl("train-inverse", "preset=toy", "name=chain", folder=folder)
    gsl("optimize", *SMALL, "grounding=gat", "accept=true", folder=folder)
    gsl("evaluate", *SMALL, folder=folder)
    return folder


def test_every_stage_leaves_a_complete_artifact(chain: Path) -> None:
    for stage in ("collect_real", "collect_sim", "train_forward", "train_inverse", "optimize", "evaluate"):
        folder = chain / "runs/chain" / stage
        manifest = json.loads((folder / "manifest.json").read_text())
        assert set(manifest["files"]) <= {path.name for path in folder.iterdir()}
        assert {"config.yaml", "metrics.json", "log.txt"} <= {path.name for path in folder.iterdir()}
    parents = {
        parent["role"] for parent in json.loads((chain / "runs/chain/optimize/manifest.json").read_text())["parents"]
    }
    assert parents == {"grounding.forward_model", "grounding.inverse_model"}


def test_nothing_half_written_is_left_behind(chain: Path) -> None:
    assert not [path for path in (chain / "runs/chain").iterdir() if path.name.startswith(".")]


def test_the_same_command_again_does_nothing(chain: Path) -> None:
    before = (chain / "runs/chain/collect_real/trajectories.parquet").stat().st_mtime_ns
    assert "unchanged" in gsl("collect", *SMALL, folder=chain).stdout
    assert (chain / "runs/chain/collect_real/trajectories.parquet").stat().st_mtime_ns == before


def test_another_setting_is_refused_and_named(chain: Path) -> None:
    done = gsl("collect", *SMALL, "seed=2", folder=chain, code=2)
    assert "seed" in done.stderr and "force=true" in done.stderr


def test_results_are_the_only_thing_on_stdout(chain: Path) -> None:
    document = json.loads(gsl("evaluate", *SMALL, "--json", folder=chain).stdout)
    assert document["metrics"]["real_episodes"] > 0 and document["unchanged"] is True


def test_a_stage_says_what_it_is_made_of(chain: Path) -> None:
    assert "collect" in gsl("runs", folder=chain).stdout
    shown = json.loads(gsl("show", "chain/evaluate", "--json", folder=chain).stdout)
    assert shown["manifest"]["kind"] == "evaluate"


def test_a_grounding_that_fails_its_check_is_refused_with_the_reason(chain: Path) -> None:
    settings = ["grounding=gat", "grounding.alpha=1.0", "grounding.noise=0.3", "out=runs/refused"]
    done = gsl("optimize", *SMALL, *settings, folder=chain, code=1)
    assert "refused" in done.stderr and "accept=true" in done.stderr
    assert not (chain / "runs/refused").exists()


def test_a_truncated_file_is_one_clear_line(chain: Path) -> None:
    whole = (chain / "runs/chain/collect_real/trajectories.parquet").read_bytes()
    (chain / "half.parquet").write_bytes(whole[: len(whole) // 2])
    done = gsl("train-forward", "data=half.parquet", "out=runs/half", folder=chain, code=2)
    assert "half.parquet" in done.stderr and len(done.stderr.strip().splitlines()) == 1


def test_a_damaged_artifact_is_named(chain: Path) -> None:
    checkpoint = chain / "runs/chain/train_forward/forward_model.safetensors"
    whole = checkpoint.read_bytes()
    checkpoint.write_bytes(whole[:-40])
    try:
        done = gsl("optimize", *SMALL, "grounding=gat", "out=runs/damaged", folder=chain, code=2)
    finally:
        checkpoint.write_bytes(whole)
    assert "forward_model.safetensors" in done.stderr


def test_an_artifact_of_the_wrong_kind_is_named(chain: Path) -> None:
    done = gsl("evaluate", "policies=chain/collect_real", "out=runs/wrong", folder=chain, code=2)
    assert "collect" in done.stderr


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("stage", ["collect", "optimize"])
def test_an_interrupt_leaves_nothing_half_written(tmp_path: Path, stage: str, stop: signal.Signals) -> None:
    settings = ["grounding=none"] if stage == "optimize" else ["episodes=500"]
    command = [sys.executable, "-m", "gsl", stage, *settings, "name=stopped"]
    running = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                               start_new_session=True)  # fmt: skip
    deadline = time.monotonic() + 60.0
    while not list(tmp_path.glob("runs/stopped/.*")) and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(2.0)
    os.killpg(running.pid, stop) if stop == signal.SIGINT else running.send_signal(stop)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 130 and "interrupted" in said and "Traceback" not in said
    assert not (tmp_path / "runs/stopped" / stage).exists()


def test_a_run_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "runs").write_text("a file where the folder should be")
    done = gsl("collect", *SMALL, folder=tmp_path, code=1)
    assert "runs" in done.stderr and len(done.stderr.strip().splitlines()) == 1


def test_iterate_runs_the_whole_chain_and_says_what_it_cost(tmp_path: Path) -> None:
    settings = ["iterate", "preset=toy", "name=whole", "task.duration=1.6", "accept=true", "beside=true", "--json"]
    document = json.loads(gsl(*settings, folder=tmp_path).stdout)
    home = tmp_path / "runs/whole"
    assert {path.name for path in (home / "iteration_01").iterdir()} >= {
        "collect_real",
        "optimize",
        "evaluate",
        "evaluate_none",
    }
    measured = json.loads((home / "iteration_01/evaluate/metrics.json").read_text())
    collected = json.loads((home / "iteration_01/collect_real/metrics.json").read_text())
    assert document["metrics"]["real_episodes"] == measured["real_episodes"] + collected["real_episodes"]
    assert {"policies.json", "learning_curve.png", "joint_trace.png", "table.md"} <= {
        p.name for p in (home / "iterate").iterdir()
    }
