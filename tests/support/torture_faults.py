"""Faults of the machine: bits that flip, a disk that gets full, workers and schedulers that die, clocks that jump."""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from commands import ENVIRONMENT, SMALL, Said, eventually, gsl, session, started
from torture_inputs import judge
from torture_kills import GONE, KILLED, PAIR, again, payloads

MANY = ("optimize", "name=k", *PAIR, "grounding=none", "preset.generations=6")
STUDY = ("compare", "name=k", *KILLED["compare"], "trials=2")
FULL = ("collect", "train-forward", "train-inverse", "evaluate")
SOON = 10.0  # [s] in which a lost scheduler is said


def flip(folder: Path, number: int, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Flip bits in files of artifacts; `gsl verify` has to name the file."""
    files = sorted(path for path in (folder / "runs/chain").rglob("*") if path.is_file() and path.stat().st_size)
    for _ in range(number):
        path = files[rng.integers(len(files))]
        whole = path.read_bytes()
        path.write_bytes(_flipped(whole, rng))
        said = gsl("verify", "chain", folder=folder)
        counts["flipped bits"] += 1
        counts["! flip not seen"] += said.code != 1 or path.name not in said.err
        path.write_bytes(whole)


def _flipped(whole: bytes, rng: np.random.Generator) -> bytes:
    damaged = bytearray(whole)
    damaged[rng.integers(len(whole))] ^= 1 << int(rng.integers(8))
    return bytes(damaged)


def fill(folder: Path, number: int, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Let no file get longer than a random size, or no more be made, as on a full disk: one line and no artifact."""
    for index in range(number):
        name = FULL[index % len(FULL)]
        most = int(rng.integers(1, 3000))
        words = [sys.executable, "-m", "gsl", name, "name=k", *KILLED[name]]
        if index // len(FULL) % 2 and (count := int(rng.integers(2, 7))) and _is_mounted(folder / "runs/k", count):
            process = subprocess.run(words, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True)
            counts["! half an artifact"] += bool(payloads(folder / "runs/k"))
            subprocess.run(["umount", folder / "runs/k"], check=True)
            (folder / "runs/k").rmdir()
            counts["disks without room for a file"] += 1
        else:
            process = subprocess.run(
                words,
                cwd=folder,
                env=ENVIRONMENT,
                capture_output=True,
                text=True,
                preexec_fn=lambda most=most: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most)),
            )
            counts["full disks"] += 1
        said = Said(process.returncode, process.stdout, process.stderr)
        counts["! full disk not said"] += said.code == 0 or "cannot be written" not in said.err
        counts["! half an artifact"] += (folder / "runs/k").exists()
        judge(said, (name, f"{most} bytes"), counts)
        shutil.rmtree(folder / "runs/k", ignore_errors=True)


def _is_mounted(folder: Path, count: int) -> bool:
    """Mount a disk on which there can be so many files and folders, its own included, if this user may."""
    folder.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", f"size=20m,nr_inodes={count}", "tmpfs", folder]
    if shutil.which("mount") and subprocess.run(words, capture_output=True).returncode == 0:
        return True
    folder.rmdir()
    return False


def fault(folder: Path, name: str, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Let one fault happen."""
    FAULTS[name](folder, rng, counts)
    counts[name] += 1


def _undisturbed(folder: Path, words: tuple[str, ...]) -> dict[str, str]:
    said = gsl(*words, folder=folder)
    assert said.code == 0, said.err
    wanted = payloads(folder / "runs/k")
    shutil.rmtree(folder / "runs/k")
    return wanted


def kill_workers(
    folder: Path, rng: np.random.Generator, counts: Counter[str], *more: str, command: tuple[str, ...] = MANY
) -> None:
    """Kill processes beside the command while it runs: it goes on."""
    wanted = _undisturbed(folder, command)
    with started(*command, *more, folder=folder) as process:
        assert eventually(lambda: len(session(process.pid)) > 3), "no workers"
        for _ in range(3):
            time.sleep(rng.uniform(1.0, 4.0))
            workers = [worker for worker in session(process.pid) if worker != process.pid and _is_worker(worker)]
            if workers and process.poll() is None:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(workers[rng.integers(len(workers))], signal.SIGKILL)
        _, said = process.communicate()
    judge(Said(process.returncode, "", said), command, counts)
    counts["! killed worker ends the command"] += process.returncode != 0
    counts["! another payload"] += payloads(folder / "runs/k") != wanted
    shutil.rmtree(folder / "runs/k", ignore_errors=True)


def _is_worker(number: int) -> bool:
    """Whether a process does jobs; trackers of resources do not."""
    try:
        return "tracker" not in Path(f"/proc/{number}/cmdline").read_text()
    except OSError:
        return False


def kill_dask_workers(folder: Path, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Do so with workers of a local dask cluster."""
    kill_workers(folder, rng, counts, "executor=dask")


def kill_study(folder: Path, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Kill workers of a study on dask, then the study itself: it comes to what it comes to on this machine."""
    kill_workers(folder, rng, counts, "executor=dask", command=STUDY)
    wanted = _undisturbed(folder, STUDY)
    with started(*STUDY, "executor=dask", folder=folder) as process:
        assert eventually(lambda: any((folder / "runs/k").rglob("manifest.json"))), "no trial is complete"
        time.sleep(rng.uniform(0.0, 5.0))
        process.kill()
        process.communicate()
        counts["! left running"] += not eventually(lambda: not session(process.pid), seconds=GONE)
    again(folder, (*STUDY, "executor=dask"), wanted, counts)


def kill_scheduler(folder: Path, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Kill the scheduler of a cluster: one line within seconds, and without it the search goes on from where it is."""
    wanted = _undisturbed(folder, MANY)
    port = int(rng.integers(20_000, 30_000))
    at = f"tcp://127.0.0.1:{port}"
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--port", str(port), "--no-dashboard"]
    work = [sys.executable, "-m", "distributed.cli.dask_worker", at, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    scheduler = subprocess.Popen(dask, **quiet)
    worker = subprocess.Popen(work, **quiet)
    try:
        words = (*MANY, "executor=dask", f"address={at}")
        with started(*words, folder=folder) as process:
            progress = folder / "runs/k/.optimize.partial/generations.jsonl"
            eventually(lambda: process.poll() is not None or progress.exists() and progress.stat().st_size > 0)
            scheduler.kill()
            begin = time.monotonic()
            _, said = process.communicate()
        took = time.monotonic() - begin
        judge(Said(process.returncode, "", said), words, counts)
        counts["! lost scheduler not said"] += process.returncode != 1 or at not in said.splitlines()[-1] or took > SOON
        again(folder, MANY, wanted, counts)
    finally:
        for victim in (scheduler, worker):
            victim.kill()
            victim.wait()


def damage_progress(folder: Path, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Flip a bit in the progress of a search that was killed: it comes to the same policies."""
    wanted = _undisturbed(folder, MANY)
    progress = folder / "runs/k/.optimize.partial/generations.jsonl"
    with started(*MANY, folder=folder) as process:
        assert eventually(lambda: progress.exists() and progress.read_bytes().count(b"\n") > 1)
        process.kill()
        process.communicate()
    progress.write_bytes(_flipped(progress.read_bytes(), rng))
    again(folder, MANY, wanted, counts)


def damage_compiled(folder: Path, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Flip bits in compiled code: it is compiled again, and a line says so."""
    words, cache = ("collect", "name=k", "role=real", *SMALL), folder / "numba"
    environment = {**ENVIRONMENT, "NUMBA_CACHE_DIR": str(cache)}
    files = []
    for _ in range(2):
        process = subprocess.run(
            [sys.executable, "-m", "gsl", *words], cwd=folder, env=environment, capture_output=True, text=True
        )
        judge(Said(process.returncode, "", process.stderr), words, counts)
        files.append(payloads(folder / "runs/k"))
        shutil.rmtree(folder / "runs/k", ignore_errors=True)
        for path in [path for path in cache.rglob("*.nbc")]:
            path.write_bytes(_flipped(path.read_bytes(), rng))
    counts["! damaged code not said"] += "compiled code is damaged" not in process.stderr
    counts["! another payload"] += files[0] != files[1] or not files[0]
    shutil.rmtree(cache)


def start_twice(folder: Path, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Start a command twice at once: one is refused in a line or finds everything done."""
    wanted = _undisturbed(folder, MANY)
    with started(*MANY, folder=folder) as first:
        time.sleep(rng.uniform(0.0, 4.0))
        with started(*MANY, folder=folder) as second:
            for process in (first, second):
                _, said = process.communicate()
                judge(Said(process.returncode, "", said), MANY, counts)
                refused = process.returncode == 2 and "another process is building it" in said
                counts["! second start"] += process.returncode != 0 and not refused
    counts["! another payload"] += payloads(folder / "runs/k") != wanted
    shutil.rmtree(folder / "runs/k")


def shift_clocks(folder: Path, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Give all files times of years ago or ahead: nothing is built again."""
    for path in (folder / "runs/chain").rglob("*"):
        moment = time.time() + rng.uniform(-3e8, 3e8)
        os.utime(path, (moment, moment))
    said = gsl("evaluate", "name=chain", *SMALL, folder=folder)
    counts["! clocks matter"] += said.code != 0 or "(unchanged)" not in said.out
    counts["! damaged by clocks"] += gsl("verify", "chain", folder=folder).code != 0


def interrupt(folder: Path, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Send Ctrl-C or SIGTERM at a random moment: 130, one line, nothing runs on, and the next start goes on."""
    wanted = _undisturbed(folder, MANY)
    with started(*MANY, folder=folder) as process:
        time.sleep(rng.uniform(2.0, 8.0))
        with contextlib.suppress(ProcessLookupError):
            if rng.integers(2):
                os.killpg(process.pid, signal.SIGINT)
            else:
                process.send_signal(signal.SIGTERM)
        _, said = process.communicate()
        counts["! left running"] += not eventually(lambda: not session(process.pid), seconds=10.0)
    counts["! interruption"] += process.returncode not in (0, 130) or "Traceback" in said
    again(folder, MANY, wanted, counts)


FAULTS: Mapping[str, Callable[[Path, np.random.Generator, Counter[str]], None]] = {
    "worker processes killed": kill_workers,
    "damaged progress": damage_progress,
    "damaged compiled code": damage_compiled,
    "two starts at once": start_twice,
    "clocks that jump": shift_clocks,
    "interruptions": interrupt,
    "workers of dask killed": kill_dask_workers,
    "scheduler of dask killed": kill_scheduler,
    "study on dask killed, and its workers": kill_study,
}
