"""Kills, faults and rubbish: python tests/support/torture.py [kills=60 flips=2000 inputs=3000 disks=10 seed=1].

Whatever happens, a command ends in one line and an exit code of its own, and the next start comes to the payload of an
undisturbed run. Every case is drawn from the seed.
"""

from __future__ import annotations

import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from commands import ENVIRONMENT, SMALL, Said, done, gsl, started

from gsl.storage import manifest

KILLED = {
    "optimize": ("name=k", *SMALL, "grounding=none"),
    "collect": ("name=k", "role=real", *SMALL),
    "train-forward": ("name=k", "data=chain/collect_real", "model=linear"),
    "train-inverse": ("name=k", "data=chain/collect_sim"),
    "evaluate": ("name=k", "policies=chain/optimize", *SMALL),
    "iterate": ("name=k", *SMALL, "grounding=gat", "accept=true", "forward_model=linear"),
}
SLOWEST = 30.0  # [s] after which an input counts as a hang
BYTES = (
    *(b"\x00", b"\xff", b"-1", b"1e999", b"nan", b"null", b"{", b"]", b"\n", b",", b"../"),
    *(b"${oc.env:HOME}", b"9" * 40),
)
WORDS = (
    *("", "-1", "0", "1e999", "nan", "null", "true", "[]", "{}", "[", "{a: 1", "'", "../x", "/", ".", "*", "a b"),
    *("9" * 400, "${name}", "${nothing}", "{_target_: os.system}", "???", "1,2", "a=b", "\x00", "\n", "x" * 5000),
    "\u202e",
)
KEYS = (
    *("name", "out", "force", "trust", "seed", "workers", "world", "task", "policy", "preset", "recipe", "episodes"),
    *("world.effects.backlash.width", "world.effects", "world.period", "task.duration", "spread", "initial", "role"),
    *("a.b", "_target_", "hydra.run.dir", "world._target_", "effects", "++x", "~world", "policy.file", "experiment"),
)


def campaign(place: Path, *, kills: int, flips: int, inputs: int, disks: int, seed: int) -> Counter[str]:
    """Return how often what was tried, and how often what must not happen did: its name begins with a !.

    Args:
        place: Folder in which the chain of all stages has run as runs/chain; what is tried happens in copies of it.
        kills: Commands killed at a random moment and started again.
        flips: Bits flipped in files of artifacts.
        inputs: Command lines and files of rubbish.
        disks: Commands on a disk that gets full.
        seed: Of all randomness.
    """
    rng, counts = np.random.default_rng(seed), Counter[str]()
    for part, number in ((kill, kills), (flip, flips), (feed, inputs), (fill, disks)):
        with tempfile.TemporaryDirectory(prefix="torture-") as home:
            folder = Path(home)
            shutil.copytree(place / "runs/chain", folder / "runs/chain")
            if number:
                part(folder, number, rng, counts)
    return counts


def kill(folder: Path, number: int, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Kill commands at random moments; started again they have to come to the payload of an undisturbed run."""
    whole: dict[str, tuple[float, dict[str, str]]] = {}
    for index in range(number):
        name = list(KILLED)[index % len(KILLED)]
        command, run = (name, *KILLED[name]), folder / "runs/k"
        if name not in whole:
            begin = time.monotonic()
            with started(*command, folder=folder) as process:
                process.communicate()
            whole[name] = time.monotonic() - begin, payloads(run)
            shutil.rmtree(run)
        seconds, wanted = whole[name]
        with started(*command, folder=folder) as process:
            try:
                process.communicate(timeout=seconds * rng.uniform(0.3, 1.0))  # before that there is nothing but imports
                counts["kills that came too late"] += 1
            except subprocess.TimeoutExpired:
                counts["kills"] += 1
        counts["! damaged after a kill"] += bool(run.exists() and [*run.rglob("manifest.json")]) and (
            gsl("verify", "k", folder=folder).code != 0
        )
        said = gsl(*command, folder=folder)
        counts["! restart refused"] += said.code != 0
        counts["! another payload"] += payloads(run) != wanted
        counts["! left behind"] += any(path.name.startswith(".") for path in run.rglob("*"))
        shutil.rmtree(run)


def flip(folder: Path, number: int, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Flip bits in files of artifacts; `gsl verify` has to name the file."""
    files = sorted(path for path in (folder / "runs/chain").rglob("*") if path.is_file() and path.stat().st_size)
    for _ in range(number):
        path = files[rng.integers(len(files))]
        whole = path.read_bytes()
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        said = gsl("verify", "chain", folder=folder)
        counts["flips"] += 1
        counts["! flip not seen"] += said.code != 1 or path.name not in said.err
        path.write_bytes(whole)


def feed(folder: Path, number: int, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Give commands what makes no sense: settings, and files with bytes put in, taken away or exchanged."""
    before = {path: path.stat().st_size for path in folder.rglob("*") if path.is_file()}
    for arguments in rubbish(folder, number, rng):
        begin = time.monotonic()
        said = gsl(*arguments, folder=folder)
        counts["inputs"] += 1
        counts[f"inputs, exit code {said.code}"] += 1
        counts["! hang"] += time.monotonic() - begin > SLOWEST
        _judge(said, arguments, counts)
        for name in ("fuzz", "unnamed", "chain_rerun"):
            shutil.rmtree(folder / "runs" / name, ignore_errors=True)
        for path in (folder / "fuzz").glob("*"):
            path.unlink()
    after = {path: path.stat().st_size for path in folder.rglob("*") if path.is_file()}
    counts["! written elsewhere"] += after != before


def rubbish(folder: Path, number: int, rng: np.random.Generator) -> Iterator[tuple[str, ...]]:
    """Yield command lines that hold rubbish or name files of it."""
    runs, mine = folder / "runs/chain", folder / "fuzz"
    mine.mkdir(exist_ok=True)
    made: tuple[tuple[str, tuple[str, ...], tuple[str, ...]], ...] = (
        ("optimize/policies.json", ("evaluate", "policies="), SMALL),
        ("collect_real/trajectories.parquet", ("train-forward", "data="), ("model=linear",)),
        ("collect_sim/trajectories.parquet", ("train-inverse", "data="), ()),
        ("evaluate/policies.json", ("collect", "initial="), SMALL),
        ("optimize/best_in_simulation.json", ("import", "source="), ("mapping=xl330_pendulum", "--check")),
    )
    for index in range(number):
        if index % 2:
            source, (command, setting), more = made[index // 2 % len(made)]
            path = mine / Path(source).name
            path.write_bytes(mangled((runs / source).read_bytes(), rng))
            yield (command, f"{setting}{path}", "name=fuzz", *more)
        else:
            drawn = [f"{rng.choice(KEYS)}={rng.choice(WORDS)}" for _ in range(rng.integers(1, 4))]
            yield (str(rng.choice(["collect", "optimize", "evaluate", "diagnose", "iterate"])), "--cfg", "job", *drawn)


def mangled(contents: bytes, rng: np.random.Generator) -> bytes:
    """Return bytes with some of them exchanged, put in or taken away."""
    made = bytearray(contents)
    for _ in range(rng.integers(1, 4)):
        at, length = int(rng.integers(len(made) + 1)), int(rng.integers(1, 40))
        match int(rng.integers(4)):
            case 0:
                made[at : at + 1] = BYTES[rng.integers(len(BYTES))]
            case 1:
                del made[at : at + length]
            case 2:
                made[at : at + length] = rng.bytes(length)
            case _:
                del made[at:]
    return bytes(made)


def fill(folder: Path, number: int, rng: np.random.Generator, counts: Counter[str]) -> None:
    """Let no file get longer than a random size, as on a full disk: one line, exit code 1, and no artifact."""
    for index in range(number):
        name = list(KILLED)[1 + index % (len(KILLED) - 2)]
        most = int(rng.integers(1, 3000))
        process = subprocess.run(
            [sys.executable, "-m", "gsl", name, *KILLED[name]],
            cwd=folder,
            env=ENVIRONMENT,
            capture_output=True,
            text=True,
            preexec_fn=lambda most=most: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most)),
        )
        said = Said(process.returncode, process.stdout, process.stderr)
        counts["full disks"] += 1
        counts["! full disk not said"] += said.code == 0 or "cannot be written" not in said.err
        counts["! half an artifact"] += (folder / "runs/k").exists()
        _judge(said, (name, f"{most} bytes"), counts)
        shutil.rmtree(folder / "runs/k", ignore_errors=True)


def _judge(said: Said, arguments: tuple[str, ...], counts: Counter[str]) -> None:
    bad = {"! internal error": "internal error" in said.err, "! traceback": "Traceback" in said.err}
    bad["! exit code"] = said.code not in (0, 1, 2)
    for name in (name for name, holds in bad.items() if holds):
        counts[name] += 1
        sys.stderr.write(f"{name}: {[word[:80] for word in arguments]}: {said.lines[-1:]}\n")


def payloads(run: Path) -> dict[str, str]:
    """Return the hash of the contents of each artifact of a run."""
    folders = (path.parent for path in run.rglob("manifest.json"))
    return {folder.relative_to(run).as_posix(): manifest.read(folder).contents for folder in folders}


def chain(place: Path) -> Path:
    """Run every stage once, small."""
    for role in ("real", "sim"):
        done("collect", f"role={role}", "name=chain", *SMALL, folder=place)
    done("train-forward", "name=chain", "model=linear", folder=place)
    done("train-inverse", "name=chain", folder=place)
    done("optimize", "name=chain", *SMALL, "grounding=gat", "accept=true", folder=place)
    done("evaluate", "name=chain", *SMALL, folder=place)
    return place


if __name__ == "__main__":
    settings = {"kills": 60, "flips": 2000, "inputs": 3000, "disks": 10, "seed": 1}
    settings |= {name: int(value) for name, value in (word.split("=") for word in sys.argv[1:])}
    with tempfile.TemporaryDirectory(prefix="torture-") as home:
        result = campaign(chain(Path(home)), **settings)
    for what, count in sorted(result.items()):
        sys.stdout.write(f"{count:6d}  {what}\n")
    sys.exit(any(count for what, count in result.items() if what.startswith("!")))
