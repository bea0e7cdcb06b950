"""Kills at random moments and before writes: started again, a command comes to the payload of an undisturbed run."""

from __future__ import annotations

import contextlib
import importlib.util
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from commands import ENVIRONMENT, SMALL, ending, eventually, gsl, session

from gsl.effects.effect import names
from gsl.runner.preflight import LOCK
from gsl.storage import manifest

FEW = {"command_latency", "servo_gain", "coulomb_friction"}  # effects that a diagnosis tries
AIR = ("real=air", "sim=nao_ideal", f"without=[{','.join(sorted({*names()} - FEW))}]", "workers=1")
PAIR = ("preset=toy", "task.duration=1.6", "workers=2")
METHODS = ("ane_01", "ane_02", "gat_005", "gat", "effects", "effects_gat")
LEFT_OUT = ("~worlds.nao_weak", *(f"~methods.{name}" for name in METHODS))
BLIND = (
    *("cases=2", "mix.foreign=120", "excitation.motions=[steps_large,triangle_fast]", "programmes=1", "workers=1"),
    *("excitation.repeated=[steps_large]", "excitation.duration=1.6"),
)
REVEALED = ("data=runs/blind/blind_make",)
ANSWERING = (*REVEALED, "most=1", "duels=0", "nulls=0", "workers=1")
FOLDED = (
    *("usual=[coulomb_friction]", "gat=null", "by=motion", "checks=motions", "folds=2"),
    *("most=1", "duels=0", "nulls=0"),
)
ASKED = "runs/asked/collect_real.request"  # what a robot was asked
SHARE = {  # those that take long
    **dict.fromkeys(("train-servo", "blind answer", "survey", "cross-validate"), 0.15),
    **dict.fromkeys(("iterate", "identify", "audit"), 0.6), "compare": 0.3,
}  # fmt: skip
KILLED = {
    "collect": ("role=real", *SMALL),
    "collect with two workers": ("role=real", *PAIR),
    "collect executor=dask": ("role=real", *PAIR),
    "collect --multirun": ("role=real", *SMALL, "seed=1,2"),
    "collect --multirun hydra/launcher=joblib": ("role=real", *SMALL, "seed=1,2"),
    "train-forward": ("data=chain/collect_real", "model=linear"),
    "train-inverse": ("data=chain/collect_sim",),
    "train-servo": ("real=air", "sim=nao_ideal", "workers=1"),
    "optimize": (*SMALL, "grounding=none"),
    "evaluate": ("policies=chain/optimize", *SMALL),
    "iterate": (*SMALL, "grounding=gat", "accept=true", "forward_model=linear"),
    "diagnose": (*AIR, "most=1", "duels=0", "nulls=0"),
    "identify": (*AIR, "evaluations=160"),
    "audit": AIR[:2],
    "cross-validate": (*AIR, *FOLDED),
    "export": ("world=nao_worn", "format=mjcf"),
    "import": ("source=runs/files/log.csv", "mapping=runs/files/mine.yaml"),
    "blind make": BLIND,
    "blind answer": ANSWERING,
    "blind reveal": (*REVEALED, "answers=runs/blind/blind_answer", "labels=runs/blind/blind_make_labels"),
    "answer": (f"request={ASKED}", "returns=runs/files/returns.csv", "out=runs/k/answer"),
    "rehearse": (f"request={ASKED}", "out=runs/k/rehearsal"),
    "survey": SMALL,
    "compare": ("preset=toy", "iterate.task.duration=1.6", "iterate.workers=1", "trials=1", *LEFT_OUT),
}  # fmt: skip
NEEDS = {"executor=dask": "distributed", "hydra/launcher=joblib": "hydra_plugins.hydra_joblib_launcher"}
STAYS = (".complete", ".trials.json.sha256", LOCK)  # the chain, the hash of a ledger, a file that the runner locks
LONGEST = 600.0  # [s] that a command may take on a busy machine
GONE = 20.0  # [s] in which what a killed command started has to end


def killed() -> list[str]:
    """Return the names of what is killed, without what needs a package that is not there."""
    missing = [word for word, package in NEEDS.items() if not _is_there(package)]
    return [name for name in KILLED if not any(name.endswith(word) for word in missing)]


def _is_there(package: str) -> bool:
    try:
        return importlib.util.find_spec(package) is not None
    except ModuleNotFoundError:
        return False


def kill(folder: Path, name: str, number: int, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Kill a command so many times, by turns at a random moment and before a write."""
    words, run = _words(name), folder / "runs/k"
    _prepare(folder, name)
    begin = time.monotonic()
    with _started(words, 0, folder) as process:
        process.communicate()
    if process.returncode != 0:
        counts[f"! {name} fails"] += 1
        return
    seconds, writes, wanted = time.monotonic() - begin, int((folder / "writes").read_text()), payloads(run)
    shutil.rmtree(run)
    for tried in range(2 * number):
        if counts[f"kills of {name}"] == number:
            break
        at = int(rng.integers(1, writes + 1)) if tried % 2 else 0
        _prepare(folder, name)
        with _started(words, at, folder) as process:
            # Before a fifth of the time there is nothing but imports.
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.communicate(timeout=LONGEST if at else seconds * rng.uniform(0.2, 1.0))
            process.kill()
            process.communicate()
            counts[f"kills of {name}" if process.returncode == -9 else "kills that came too late"] += 1
            counts["! left running"] += not eventually(lambda: not session(process.pid), seconds=GONE)  # noqa: B023
        again(folder, words, wanted, counts)
    counts["kills"] += counts[f"kills of {name}"]


def again(folder: Path, words: tuple[str, ...], wanted: dict[str, str], counts: Counter[str]) -> None:
    """Start a command again, look at all that it has to come to, and take it away."""
    run = folder / "runs/k"
    if payloads(run):
        damaged = gsl("verify", "k", folder=folder)
        counts["! damaged after a kill"] += _bad(damaged.code != 0, words, damaged.err)
    said = gsl(*words, folder=folder)
    counts["! restart refused"] += _bad(said.code != 0, words, said.err)
    counts["! another payload"] += _bad(payloads(run) != wanted, words, said.err)
    left = [path for path in (folder / "runs").rglob(".*") if path.name not in STAYS]
    counts["! left behind"] += _bad(bool(left), words, f"{left}")
    shutil.rmtree(run, ignore_errors=True)
    for path in left:
        path.unlink() if path.is_file() else shutil.rmtree(path, ignore_errors=True)


def _bad(wrong: bool, words: tuple[str, ...], problem: str) -> bool:
    if wrong:
        sys.stderr.write(f"! {' '.join(words)[:200]}: {problem[-400:]}\n")
    return wrong


def payloads(run: Path) -> dict[str, str]:
    """Return the hash of the contents of each artifact of a run."""
    folders = (path.parent.relative_to(run) for path in run.rglob("manifest.json"))
    complete = (folder for folder in folders if not any(part.startswith(".") for part in folder.parts))
    return {folder.as_posix(): manifest.read(run / folder).contents for folder in complete}


def _words(name: str) -> tuple[str, ...]:
    return (*name.replace(" with two workers", "").split(), "name=k", *KILLED[name])


def _prepare(folder: Path, name: str) -> None:
    """Put down what a command has to find in its run: a blind benchmark draws from a secret."""
    if name == "blind make":
        labels = folder / "runs/k/blind_make_labels"
        labels.mkdir(parents=True, exist_ok=True)
        (labels / "secret.txt").write_text("the same in every run\n")


def shares(number: int) -> dict[str, int]:
    """Return how often each command is killed, so that it is so many times in all; each at least once."""
    names = killed()
    whole = sum(SHARE.get(name, 1.0) for name in names)
    counts = {name: max(1, int(number * SHARE.get(name, 1.0) / whole)) for name in names}
    for name in (name for name in names if name not in SHARE):
        if sum(counts.values()) < number:
            counts[name] += 1
    return counts


@contextlib.contextmanager
def _started(words: tuple[str, ...], at: int, folder: Path) -> Iterator[subprocess.Popen[str]]:
    """Start a command in a session of its own, to be killed before write number `at` if that is not 0."""
    killer = str(Path(__file__).with_name("torture_killer.py"))
    process = subprocess.Popen(
        [sys.executable, killer, str(at), str(folder / "writes"), *words], cwd=folder, env=ENVIRONMENT, text=True,
        start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    with ending(process):
        yield process
