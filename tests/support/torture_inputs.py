"""Inputs that make no sense, drawn by hypothesis: settings, and files of all kinds, damaged or invented."""

from __future__ import annotations

import contextlib
import copy
import io
import json
import shutil
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from commands import SMALL, Said, done, gsl
from strangers import seal
from torture_code import CANARY, CODES, MODULE, YAMLS_WITH_CODE, Pickled, Watch, has_code

from gsl.runner.request import NAME as REQUEST
from gsl.runner.request import hash_of
from gsl.storage.manifest import HASH, hash_entries
from gsl.storage.manifest import NAME as MANIFEST

SLOW_CPU = 30.0  # [s] after which an input counts as a hang,
SLOW = 120.0  # [s] of a clock, on a busy machine
ROOT = Path(__file__).parents[2]
COMMANDS = (
    *("collect", "train-forward", "train-inverse", "train-servo", "train-grounding", "optimize", "diagnose"),
    *("identify", "cross-validate", "evaluate", "survey", "answer", "rehearse", "iterate", "import", "compare"),
    *("audit", "wiring", "export", "blind make", "blind answer", "blind reveal", "blind wiring"),
)
READERS = ("show", "verify", "lineage", "diff", "metrics", "export")
LINES = (
    *("", "-1", "0", "1e999", "nan", "null", "true", "[]", "{}", "[", "{a: 1", "'", "../x", "/", ".", "*", "a b", "~"),
    *("9" * 400, "${name}", "${nothing}", "${oc.env:HOME}", "${name", "{_target_: os.system}", "???", "1,2", "a=b"),
    *("\n", "x" * 5000, "\u202e", "\x1b[2J", "tcp://127.0.0.1:1", "dask", "range(1,3)", "glob(*)", "choice(1,2)"),
)
KEYS = (
    *("name", "out", "force", "trust", "seed", "workers", "world", "task", "policy", "preset", "recipe", "episodes"),
    *("world.effects.backlash.width", "world.effects", "world.period", "task.duration", "spread", "initial", "role"),
    *("a.b", "_target_", "hydra.run.dir", "world._target_", "effects", "++x", "~world", "policy.file", "experiment"),
    *("executor", "address", "sim", "real", "grounding", "grounding.alpha", "data", "mapping", "source", "request"),
    *("world.x._target_", "policy._target_", "task._target_", "optimizer._target_", "sim._target_"),
    *("optimizer", "budget.rollouts", "methods.gat", "trials", "hydra/launcher", "hydra.sweeper.params", "known"),
)
DOUBLED = "".join(f"a{k}: &a{k} [*a{k - 1}, *a{k - 1}]\n" for k in range(1, 30))
REFERRED = "".join(f'a{k}: "${{.a{k - 1}}}${{.a{k - 1}}}"\n' for k in range(1, 40))
YAMLS = (
    *("a: &a [*a]\n", "!!python/object/apply:os.system [echo]\n", "a: 1\na: 2\n", "- 1\n", "&a : *a\n", "? [x]\n: 1\n"),
    *("a: !!float 1e999\n", "<<: 3\n", "a: 2026-99-99\n", "a: 0o9\n", "\t\n", "%YAML 9.9\n---\n", "--- a\n--- b\n"),
    *(
        "a: 1:99:99",
        "defaults: [nao_ideal, _self_, hydra]\n",
        "defaults: [/x@_global_: y]\n",
        "# @package hydra\na: 1\n",
    ),
    *("a: ${a}\n", "a0: &a0 [x, x]\n" + DOUBLED, "a0: xx\n" + REFERRED, "[" * 3000, "{a: " * 300, "a: 'x", "a: |\n"),
    *('a: "\\uD800"\n', "a: " + "9" * 5000 + "\n"),
)
JSONS = ("", "[]", "{}", "[[]]", "[" * 3000, "9" * 5000, '"\\ud800"', "NaN", '{"a": 1, "a": 2}')


def feed(folder: Path, number: int, seed: int, counts: Counter[str]) -> None:
    """Give commands so many inputs; each has to end in one line and an exit code, and to write nothing elsewhere."""
    from hypothesis import HealthCheck, Phase, given, settings
    from hypothesis import seed as seeded
    from hypothesis import strategies as st

    inputs = Inputs(folder)
    (folder / "canary_module.py").write_text(MODULE)
    plugin = folder / "hydra_plugins/stranger"
    plugin.mkdir(parents=True)
    (plugin / "__init__.py").write_text(MODULE)
    before, watch, canary = _sizes(folder), Watch(folder), folder / CANARY

    @seeded(seed)
    @settings(
        max_examples=number, database=None, deadline=None, phases=[Phase.generate], suppress_health_check=[*HealthCheck]
    )
    @given(st.data())
    def give(data: Any) -> None:
        inputs.clear()
        words = inputs.draw(data.draw)
        counts["inputs with code"] += has_code(words, inputs.mine)
        watch.elsewhere.clear()
        begin, busy = time.monotonic(), time.process_time()
        said = gsl(*words, folder=folder)
        took, worked = time.monotonic() - begin, time.process_time() - busy
        counts["inputs"] += 1
        counts[f"inputs, exit code {said.code}"] += 1
        judge(said, words, counts)
        if canary.exists():
            counts["! code executed without trust="] += 1
            sys.stderr.write(f"! code executed: {words}\n")
            canary.unlink()
        if watch.elsewhere:
            counts["! written elsewhere"] += 1
            sys.stderr.write(f"! written elsewhere: {words}: {watch.elsewhere[:3]}\n")
        if worked > SLOW_CPU or took > SLOW:
            counts["! hang"] += 1
            sys.stderr.write(f"! hang ({worked:.0f} s of CPU, {took:.0f} s): {words}\n")

    give()
    inputs.clear()
    counts["! written elsewhere"] += _sizes(folder) != before


def judge(said: Said, words: tuple[str, ...], counts: Counter[str]) -> None:
    """Count what a command must not say."""
    bad = {"! internal error": "internal error" in said.err, "! traceback": "Traceback" in said.err}
    bad["! exit code"] = said.code not in (0, 1, 2)
    bad["! said nothing"] = said.code in (1, 2) and not (said.err + said.out).strip()
    bad["! escape sequence"] = "\x1b" in said.err + said.out
    for name in (name for name, holds in bad.items() if holds):
        counts[name] += 1
        sys.stderr.write(f"{name}: {[word[:80] for word in words]}: {said.lines[-1:]}\n")


def _sizes(folder: Path) -> dict[Path, int]:
    return {path: path.stat().st_size for path in folder.rglob("*") if path.is_file()}


class Inputs:
    """Command lines, and the files that they name, which lie in fuzz/ below `folder`."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.mine, runs = folder, folder / "fuzz", folder / "runs/chain"
        self.fresh = {path.relative_to(folder).parts[1] for path in (folder / "runs").iterdir()}
        self.artifacts = sorted(path.parent for path in runs.rglob("manifest.json"))
        self.policies = json.loads((runs / "optimize/policies.json").read_text())
        self.world = yaml.safe_load((ROOT / "conf/world/nao_worn.yaml").read_text())
        self.mapping = yaml.safe_load((ROOT / "conf/mapping/plain.yaml").read_text())
        self.mapping |= {"robot": "pendulum", "joints": ["joint"]}
        self.urdf = (ROOT / "examples/arm.urdf").read_bytes()
        time_, angle = np.arange(40) * 0.02, np.sin(np.arange(40) * 0.1)
        rows = zip(time_, angle, 0.9 * angle, strict=True)
        self.csv = "time,action.joint,position.joint\n" + "".join(f"{a:.3f},{b:.6f},{c:.6f}\n" for a, b, c in rows)
        packed = io.BytesIO()
        np.savez_compressed(packed, **{"time": time_, "action.joint": angle, "position.joint": 0.9 * angle})
        self.npz = packed.getvalue()
        packed = io.BytesIO()
        np.savez(packed, **{"time": time_, "action.joint": np.array([Pickled()] * 40, dtype=object)})
        self.pickled = packed.getvalue()
        self.json = [{"time": a, "action.joint": b, "position.joint": b} for a, b in zip(time_, angle, strict=True)]
        self.request = self._asked()

    def _asked(self) -> Path:
        asked = self.folder / "runs/asked/collect_real.request"
        if not asked.exists():
            done("collect", "role=real", "world=robot", "name=asked", *SMALL, folder=self.folder)
        return asked

    def clear(self) -> None:
        """Take away what the last input has left."""
        shutil.rmtree(self.mine, ignore_errors=True)
        self.mine.mkdir()
        for path in (self.folder / "runs").iterdir():
            if path.name not in {*self.fresh, "asked"}:
                shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink()

    def draw(self, draw: Callable[[Any], Any]) -> tuple[str, ...]:
        """Return a command line; its files are there."""
        from hypothesis import strategies as st

        kinds = (
            *(self._settings,) * 5, *(self._yaml,) * 2, *(self._artifact,) * 5, *(self._import,) * 4,
            self._policies, self._trajectories, self._robot, self._request,
        )  # fmt: skip
        words: tuple[str, ...] = draw(st.sampled_from(kinds))(draw)
        return tuple(word.replace("\0", "0") for word in words)

    def _settings(self, draw: Any) -> tuple[str, ...]:
        from hypothesis import strategies as st

        words = draw(st.lists(st.tuples(st.sampled_from(KEYS), _word()).map("=".join), min_size=1, max_size=3))
        flags = draw(st.sampled_from([("--cfg", "job"), ("--cfg", "job", "--multirun"), ("--cfg", "job", "--json")]))
        return (*draw(st.sampled_from(COMMANDS)).split(), *flags, *words)

    def _yaml(self, draw: Any) -> tuple[str, ...]:
        from hypothesis import strategies as st

        group = draw(st.sampled_from(["world", "preset", "task", "effect", "policy", "experiment", "grounding"]))
        place = self.mine / group / "mine.yaml"
        place.parent.mkdir()
        place.write_bytes(self._document(draw, self.world, YAMLS, yaml.safe_dump))
        choice = () if group == "effect" else (f"{group}=mine",)
        how = ("name=fuzz", *SMALL) if draw(st.integers(0, 3)) == 0 else ("--cfg", "job")
        return ("collect", f"--config-dir={self.mine}", *how, *choice)

    def _artifact(self, draw: Any) -> tuple[str, ...]:
        from hypothesis import strategies as st

        folder = self.mine / "artifact"
        shutil.copytree(draw(st.sampled_from(self.artifacts)), folder)
        documents = [path.name for path in sorted(folder.iterdir()) if path.suffix in (".json", ".yaml")]
        path = folder / draw(st.sampled_from([MANIFEST, *documents]))
        if path.suffix == ".yaml":
            text = self._document(draw, yaml.safe_load(path.read_bytes()), YAMLS, yaml.safe_dump)
        else:
            text = self._document(draw, json.loads(path.read_bytes()), JSONS, json.dumps)
        path.write_bytes(text)
        if draw(st.booleans()):  # a stranger's hashes may be right
            _seal(path)
        command = draw(st.sampled_from([*READERS, "train-forward", "evaluate", "rerun"]))
        if command == "rerun" and path.name == "metrics.json":
            command = "show"  # all else would be as it was, and a run of seconds
        if command in ("train-forward", "evaluate"):
            return (command, f"{'data' if command == 'train-forward' else 'policies'}={folder}", "name=fuzz")
        if command == "diff":
            return (command, str(folder), str(draw(st.sampled_from(self.artifacts))))
        if command == "export":
            return (command, f"trajectories={folder}", "format=csv", "name=fuzz")
        return (command, str(folder), *(["out=runs/fuzz"] if command == "rerun" else []))

    def _import(self, draw: Any) -> tuple[str, ...]:
        from hypothesis import strategies as st

        kind = draw(st.sampled_from(["csv", "json", "npz"]))
        log = {"csv": self.csv.encode(), "json": json.dumps(self.json).encode(), "npz": self.npz}[kind]
        mapping = yaml.safe_dump(self.mapping).encode()
        if draw(st.booleans()):
            mapping = self._document(draw, self.mapping, YAMLS, yaml.safe_dump)
        else:
            log = _damaged(draw, log) if kind != "json" else self._document(draw, self.json, JSONS, json.dumps)
        if kind == "npz" and draw(st.integers(0, 3)) == 0:
            log = self.pickled
        (self.mine / f"log.{kind}").write_bytes(log)
        (self.mine / "mine.yaml").write_bytes(mapping)
        more = draw(st.sampled_from([("--check",), ("--check",), ("name=fuzz",)]))
        return ("import", f"source={self.mine / f'log.{kind}'}", f"mapping={self.mine / 'mine.yaml'}", *more)

    def _policies(self, draw: Any) -> tuple[str, ...]:
        path = self.mine / "policies.json"
        path.write_bytes(self._document(draw, self.policies, JSONS, json.dumps))
        return ("evaluate", f"policies={path}", "name=fuzz", *SMALL)

    def _trajectories(self, draw: Any) -> tuple[str, ...]:
        path = self.mine / "trajectories.parquet"
        path.write_bytes(_damaged(draw, (self.folder / "runs/chain/collect_real/trajectories.parquet").read_bytes()))
        return ("train-forward", f"data={path}", "name=fuzz", "model=linear")

    def _robot(self, draw: Any) -> tuple[str, ...]:
        from hypothesis import strategies as st

        path = self.mine / "mine.urdf"
        path.write_bytes(_damaged(draw, self.urdf))
        if draw(st.booleans()):
            return ("robot", str(path), f"out={self.mine / 'out'}")
        return ("init", f"urdf={path}", "name=mine", f"out={self.mine / 'out'}")

    def _request(self, draw: Any) -> tuple[str, ...]:
        from hypothesis import strategies as st

        folder = self.mine / "request"
        shutil.copytree(self.request, folder)
        path = folder / "request.json"
        path.write_bytes(self._document(draw, json.loads(path.read_bytes()), JSONS, json.dumps))
        if draw(st.booleans()):
            _seal(path)
        if draw(st.booleans()):
            return ("rehearse", f"request={folder}")
        (self.mine / "log.csv").write_bytes(_damaged(draw, self.csv.encode()))
        return ("answer", f"request={folder}", f"logs={self.mine / 'log.csv'}")

    def _document(self, draw: Any, tree: Any, odd: tuple[str, ...], dump: Callable[[Any], str]) -> bytes:
        """Return a document in which entries are exchanged, or bytes; or another one altogether."""
        from hypothesis import strategies as st

        match draw(st.sampled_from(["entries", "entries", "bytes", "odd", "other", "code"])):
            case "code" if dump is yaml.safe_dump:
                return str(draw(st.sampled_from(YAMLS_WITH_CODE))).encode()
            case "code":
                code = draw(st.sampled_from(CODES))
                return dump({**tree, "x": code} if isinstance(tree, dict) else code).encode()
            case "entries":
                return dump(_exchanged(draw, tree)).encode("utf-8", "surrogatepass")
            case "bytes":
                return _damaged(draw, dump(tree).encode())
            case "odd":
                return str(draw(st.sampled_from(odd))).encode()
            case _:
                return dump(draw(_tree())).encode("utf-8", "surrogatepass")


def _seal(path: Path) -> None:
    """Set the hash that goes with a changed document right; one that is no mapping has none."""
    if path.name != MANIFEST and path.name != REQUEST:
        seal(path.parent)
        return
    with contextlib.suppress(ValueError, RecursionError):
        stored = json.loads(path.read_bytes())
        if isinstance(stored, dict):
            entries = {key: value for key, value in stored.items() if key not in (HASH, "hash")}
            own = {HASH: hash_entries(entries)} if path.name == MANIFEST else {"hash": hash_of(entries)}
            path.write_text(json.dumps({**entries, **own}))


def _text() -> Any:
    from hypothesis import strategies as st

    return st.text(st.characters(exclude_categories=["Cs"]), max_size=20)


def _word() -> Any:
    from hypothesis import strategies as st

    return st.one_of(st.sampled_from(LINES), _text(), st.integers().map(str), st.floats().map(str))


def _tree() -> Any:
    from hypothesis import strategies as st

    leaves = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), _word())
    return st.recursive(
        leaves, lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(_text(), inner, max_size=4))
    )


def _exchanged(draw: Any, tree: Any) -> Any:
    """Return a document with some entries exchanged, taken away or renamed."""
    from hypothesis import strategies as st

    tree = copy.deepcopy(tree)
    for _ in range(draw(st.integers(1, 3))):
        node = tree
        while isinstance(node, dict | list) and node:
            key = draw(st.sampled_from([*node] if isinstance(node, dict) else range(len(node))))
            inner = node[key]
            if isinstance(inner, dict | list) and inner and draw(st.integers(0, 3)):
                node = inner
                continue
            _change(draw, node, key)
            break
    return tree


def _change(draw: Any, node: Any, key: Any) -> None:
    from hypothesis import strategies as st

    change = draw(st.sampled_from(["exchange", "exchange", "remove", "rename"]))
    if change == "exchange":
        node[key] = copy.deepcopy(draw(st.one_of(_tree(), st.sampled_from(CODES))))  # which is changed later
    elif change == "remove" or isinstance(node, list):
        del node[key]
    else:
        node[draw(_text())] = node.pop(key)


def _damaged(draw: Any, contents: bytes) -> bytes:
    """Return bytes with some of them exchanged, put in or taken away."""
    from hypothesis import strategies as st

    made = bytearray(contents)
    for _ in range(draw(st.integers(1, 3))):
        at, length = draw(st.integers(0, len(made))), draw(st.integers(1, 40))
        match draw(st.sampled_from(["word", "less", "other", "end"])):
            case "word":
                made[at : at + 1] = draw(_word()).encode()
            case "less":
                del made[at : at + length]
            case "other":
                made[at : at + length] = draw(st.binary(min_size=1, max_size=40))
            case _:
                del made[at:]
    return bytes(made)
