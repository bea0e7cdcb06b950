"""Kills, faults and rubbish: python tests/support/torture.py [kills=240 inputs=10000 flips=2000 disks=20 faults=1].

Whatever happens, a command ends in one line and an exit code of its own, and the next start comes to the payload of an
undisturbed run. Cases are drawn from `seed=1`. They run in slices, each in a process of its own and two at a time. What
a slice has shown is kept in `at=build/torture`, so that a campaign that was stopped goes on.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from commands import SMALL, done
from torture_faults import FAULTS, fault, fill, flip
from torture_inputs import ROOT, feed
from torture_kills import ANSWERING, ASKED, BLIND, kill, shares

from gsl.storage.hashing import sources_hash

SIZES = {"kills": 240, "faults": 1, "inputs": 10_000, "flips": 2000, "disks": 20}
SLICE = {"inputs": 200, "flips": 500, "disks": 10}  # cases
LANES = 2
LONGEST = 1800.0  # [s] of a slice; one that takes longer hangs
MOST = 2e9  # [bytes] of a process


class Slice(NamedTuple):
    """Cases of a part: of a command or fault, where these are apart, from `start` on."""

    part: str
    name: str
    start: int
    count: int


PARTS: Mapping[str, Callable[[Path, Slice, int, Counter[str]], None]] = {
    "kills": lambda folder, of, seed, counts: kill(folder, of.name, of.count, drawn(seed, of), counts),
    "faults": lambda folder, of, seed, counts: fault(folder, of.name, drawn(seed, of), counts),
    "inputs": lambda folder, of, seed, counts: feed(folder, of.count, seed + of.start, counts),
    "flips": lambda folder, of, seed, counts: flip(folder, of.count, drawn(seed, of), counts),
    "disks": lambda folder, of, seed, counts: fill(folder, of.count, drawn(seed, of), counts),
}


def drawn(seed: int, of: Slice) -> np.random.Generator:
    """Return the randomness of a slice."""
    return np.random.default_rng([seed, zlib.crc32(f"{of.part} {of.name}".encode()), of.start])


def slices(sizes: Mapping[str, int]) -> Iterator[Slice]:
    """Yield all slices of a campaign, those that take long first."""
    if sizes["kills"]:
        yield from (Slice("kills", name, 0, count) for name, count in shares(sizes["kills"]).items())
    yield from (Slice("faults", name, number, 1) for name in FAULTS for number in range(sizes["faults"]))
    for part, most in SLICE.items():
        yield from (Slice(part, "", at, min(most, sizes[part] - at)) for at in range(0, sizes[part], most))


def run(place: Path, of: Slice, seed: int) -> Counter[str]:
    """Return how often what was tried, and how often what must not happen did: its name begins with a !.

    Args:
        place: Folder in which every stage has run as runs/chain; what is tried happens in a copy of it.
        of: What to try.
        seed: Of all randomness.
    """
    counts = Counter[str]()
    with tempfile.TemporaryDirectory(prefix="torture-") as home:
        folder = Path(home)
        shutil.copytree(place / "runs", folder / "runs")
        PARTS[of.part](folder, of, seed, counts)
    return counts


def campaign(place: Path, seed: int, sizes: Mapping[str, int]) -> Iterator[dict[str, Any]]:
    """Yield what each slice has shown: those that are there already, and the others as they end."""
    results = place / f"{sources_hash()[:12]}_{seed}.jsonl"
    lines = results.read_text().splitlines() if results.exists() else []
    there = {Slice(*row["slice"]): row for row in map(json.loads, lines)}
    wanted = list(slices(sizes))
    yield from (there[of] for of in wanted if of in there)
    with ThreadPoolExecutor(LANES) as lanes, results.open("a") as file:
        for row in lanes.map(lambda of: _apart(place, of, seed), [of for of in wanted if of not in there]):
            file.write(json.dumps(row) + "\n")
            file.flush()
            yield row


def _apart(place: Path, of: Slice, seed: int) -> dict[str, Any]:
    begin = time.monotonic()
    words = [sys.executable, __file__, "slice", json.dumps(of), f"seed={seed}", f"at={place}"]
    try:
        process = subprocess.run(words, stdout=subprocess.PIPE, text=True, timeout=LONGEST)
        row = json.loads(process.stdout.splitlines()[-1])  # before that, what processes of a launcher say
    except (ValueError, IndexError, subprocess.TimeoutExpired) as error:
        row = {"counts": {"! slice without a result": 1}, "bytes": 0}
        sys.stderr.write(f"! {of}: {type(error).__name__}\n")
    return {"slice": of, "seconds": round(time.monotonic() - begin), **row}


def peak() -> float:
    """Return the most memory that this process or one it waited for had [bytes]."""
    whose = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return 1024.0 * max(resource.getrusage(usage).ru_maxrss for usage in whose)


def chain(place: Path) -> Path:
    """Run every stage once, small."""
    for role in ("real", "sim"):
        done("collect", f"role={role}", "name=chain", *SMALL, folder=place)
    done("train-forward", "name=chain", "model=linear", folder=place)
    done("train-inverse", "name=chain", folder=place)
    done("optimize", "name=chain", *SMALL, "grounding=gat", "accept=true", folder=place)
    done("evaluate", "name=chain", *SMALL, folder=place)
    return place


def air(place: Path) -> Path:
    """Record a few motions in the air, ask a robot, and make files that commands begin with."""
    motions = ("policy.motions=[steps_large,triangle_slow]", "policy.duration=1.5", "workers=1")
    done("collect", "role=real", "name=air", "task=excite", "world=nao_worn", *motions, folder=place)
    done("collect", "role=real", "world=robot", "name=asked", *SMALL, folder=place)
    done("blind", "make", "name=blind", *BLIND, folder=place)
    done("blind", "answer", "name=blind", *ANSWERING, folder=place)
    write_log(place / "runs/files")
    write_returns(place / "runs/files/returns.csv", place / ASKED / "request.json")
    return place


def write_returns(path: Path, request: Path) -> None:
    """Write what somebody measured of the episodes of a request."""
    names = [episode["name"] for episode in json.loads(request.read_text())["episodes"]]
    path.write_text("episode,distance,fell\n" + "".join(f"{name},0.3,no\n" for name in names))


def write_log(folder: Path) -> None:
    """Write a log of a pendulum and its mapping."""
    folder.mkdir(parents=True, exist_ok=True)
    moments = np.arange(40) * 0.02
    angles = np.sin(np.arange(40) * 0.1)
    lines = (f"{a:.3f},{b:.6f},{0.9 * b:.6f}\n" for a, b in zip(moments, angles, strict=True))
    (folder / "log.csv").write_text("time,action.joint,position.joint\n" + "".join(lines))
    mapping = yaml.safe_load((ROOT / "conf/mapping/plain.yaml").read_text())
    (folder / "mine.yaml").write_text(yaml.safe_dump(mapping | {"robot": "pendulum", "joints": ["joint"]}))


def table(rows: list[dict[str, Any]], seed: int) -> str:
    """Return what was tried, how often, what went wrong, and the command that tries it again, as a table of a page."""
    lines = ["| tried | how often | went wrong | again with |", "|---|---|---|---|"]
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault(tuple(row["slice"][:2]), []).append(row)
    for (part, name), mine in sorted(groups.items(), key=lambda group: (list(PARTS).index(group[0][0]), group[0][1])):
        good, bad = _counted(mine)
        size = sum(row["slice"][3] for row in mine)
        lines += [f"| {part} {f'`{name}`' if name else ''} | {good} | {bad or 0} | `{part}={size} seed={seed}` |"]
    lines += ["", f"Most memory of a process: {max(row['bytes'] for row in rows) / 1e9:.2f} GB."]
    lines += [f"Time on {LANES} lanes: {sum(row['seconds'] for row in rows) / 60 / LANES:.0f} min."]
    return "\n".join(lines)


def _counted(rows: list[dict[str, Any]]) -> tuple[str, str]:
    """Return what was tried and what went wrong."""
    counts = sum((Counter(row["counts"]) for row in rows), Counter[str]())
    items = sorted(item for item in counts.items() if item[1])
    good = "; ".join(f"{count:,} {what}" for what, count in items if what[0] != "!")
    return good, "; ".join(f"**{count:,} {what[2:]}**" for what, count in items if what[0] == "!")


def main(words: list[str]) -> int:
    """Run the campaign, or one slice of it, and return the exit code."""
    settings = dict(word.split("=", 1) for word in words if "=" in word and not word.startswith("["))
    place, seed = Path(settings.pop("at", "build/torture")).absolute(), int(settings.pop("seed", 1))
    if words[:1] == ["slice"]:
        with contextlib.redirect_stdout(sys.stderr):
            counts = run(place, Slice(*json.loads(words[1])), seed)
        sys.stdout.write("\n" + json.dumps({"counts": counts, "bytes": peak()}))
        return 0
    if unknown := settings.keys() - SIZES.keys():
        sys.stderr.write(f"no part of the campaign: {', '.join(unknown)}; there is {', '.join(SIZES)}\n")
        return 2
    sizes = SIZES | {name: int(value) for name, value in settings.items()}
    made = place / "runs/.complete"
    if not made.exists() or made.read_text() != sources_hash():
        shutil.rmtree(place / "runs", ignore_errors=True)
        place.mkdir(parents=True, exist_ok=True)
        air(chain(place))
        made.write_text(sources_hash())
    rows = []
    for row in campaign(place, seed, sizes):
        rows.append(row)
        wrong = {what: count for what, count in row["counts"].items() if what[0] == "!" and count}
        sys.stderr.write(f"{Slice(*row['slice'])}: {row['seconds']} s {wrong or ''}\n")
    sys.stdout.write(table(rows, seed) + "\n")
    bad = any(count for row in rows for what, count in row["counts"].items() if what[0] == "!")
    return int(bad or max(row["bytes"] for row in rows) > MOST)


if __name__ == "__main__":
    os.environ["PYTHONUNBUFFERED"] = "1"
    sys.exit(main(sys.argv[1:]))
