"""Files from strangers run no code, copy nothing of the environment, and take neither memory nor time."""

from __future__ import annotations

import json
import os
import resource
import shutil
import struct
import subprocess
import sys
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import strangers
from commands import ENVIRONMENT, SMALL, done, forget_modules, gsl, refused

from gsl.core.budget import DEPTH, within
from gsl.core.trust import check_code, code_in, modules_in
from gsl.core.visible import visible
from gsl.core.yaml_tree import yaml_tree
from gsl.errors import ConfigError, InputError
from gsl.runner.request import NAME, hash_of
from gsl.storage.manifest import HASH, hash_entries
from gsl.storage.requests import seal, write_request

pytestmark = pytest.mark.slow

SECONDS = 30.0
SHORT = ("preset=toy", "task.duration=0.2", "workers=1")
LOG = "time,action.a,position.a\n" + "".join(f"{0.01 * k:.2f},{0.1 * k},{0.1 * k}\n" for k in range(50))
SIGNALS = "signals:\n  action: 'action.{joint}'\n  position: 'position.{joint}'\n"
MARK = "from pathlib import Path\nPath('ran').write_text('yes')\n\n\nclass Thing:\n    pass\n\n\ndef run():\n    pass\n"


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Path]:
    """A folder with a log, and a module that leaves a mark when it is imported; after each test there is none."""
    (tmp_path / "log.csv").write_text(LOG)
    (tmp_path / "evil.py").write_text(MARK)
    begin = time.process_time()
    yield tmp_path
    assert time.process_time() - begin < SECONDS
    assert not (tmp_path / "ran").exists()
    assert (tmp_path / "log.csv").read_text() == LOG


NAMED = {
    "a function that deletes": ("pathlib.Path.unlink", "self: log.csv"),
    "a pickle": ("joblib.load", "filename: evil.pkl"),
    "a copy": ("shutil.copyfile", "{src: log.csv, dst: ran}"),
    "a module of this folder": ("evil.Thing", ""),
    "a function of a library of gsl": ("gsl.worlds.environments.importlib.import_module", "name: evil"),
    "the command line itself": ("gsl.__main__.main", ""),
    "a reference": ("${mapping.name}", ""),
}


@pytest.mark.parametrize("check", ["check=true", "check=false"])
@pytest.mark.parametrize("name", NAMED)
def test_a_mapping_calls_nothing(name: str, check: str, place: Path) -> None:
    target, _ = NAMED[name]
    (place / "m.yaml").write_text(f"{SIGNALS}name: evil.Thing\nabout:\n  x:\n    _target_: {target}\n")
    said = refused("import", "source=log.csv", "mapping=m.yaml", check, folder=place)
    assert said.endswith("m.yaml: names a class, as _target_, and a mapping builds none; leave it out")


@pytest.mark.parametrize(
    "reference",
    ["${oc.env:HOME}", "${oc.decode:${oc.env:HOME}}", "a ${oc.env:HOME} b", "${oc.create:'{a: 1}'}", "${now:%Y}",
     "${hydra:runtime.cwd}", "${oc.dict.values:mapping}"],
)  # fmt: skip
def test_a_mapping_reads_no_variable_of_the_environment(reference: str, place: Path) -> None:
    (place / "m.yaml").write_text(f'{SIGNALS}about: {{x: "{reference}"}}\n')
    said = refused("import", "source=log.csv", "mapping=m.yaml", folder=place)
    assert "refers to '" in said and "m.yaml" in said
    assert os.environ["HOME"] not in said.replace(str(place), "")


FILES = {
    "world/theirs": "defaults: [nao_ideal, _self_]\n_target_: evil.Thing\n",
    "world/effect": "defaults: [nao_ideal, _self_]\neffects: {mine: {_target_: evil.Thing}}\n",
    "world/robot": "defaults: [nao_ideal, _self_]\nrobot: evil.run\n",
    "world/indirect": "defaults: [nao_ideal, _self_]\nhook: evil.run\nrobot: ${world.hook}\n",
    "world/environment": "_target_: gsl.worlds.gymnasium.GymnasiumWorld\nenv_id: evil:Thing\n",
    "world/variable": "defaults: [nao_ideal, _self_]\nrobot: ${oc.env:HOME}\n",
    "experiment/plugin": "# @package _global_\nhydra:\n  callbacks: {x: {_target_: evil.Thing}}\n",
    "experiment/launcher": "# @package hydra.job\nenv_set: {PYTHONPATH: .}\n",
    "experiment/placed": "# @package _global_\ndefaults: [/world@hydra.job: nao_ideal]\n",
    "experiment/trusting": "# @package _global_\ntrust: [evil]\nworld: {_target_: evil.Thing}\n",
}


SHOWN = ("world/theirs", "world/effect", "world/robot", "world/environment", "experiment/plugin", "experiment/trusting")


@pytest.mark.parametrize(
    ("name", "how"),
    [
        *((name, how) for name in FILES for how in (("--cfg", "job"), ("--multirun",))),
        *((name, ("--help",)) for name in SHOWN),
    ],
)
def test_a_folder_of_configuration_runs_nothing(name: str, how: tuple[str, ...], place: Path) -> None:
    path = place / f"theirs/{name}.yaml"
    path.parent.mkdir(parents=True)
    path.write_text(FILES[name])
    said = gsl("collect", "--config-dir", "theirs", name.replace("/", "="), *how, folder=place)
    assert "internal error" not in said.err
    assert said.code == 2 or how in (("--help",), ("--cfg", "job"))
    assert not (place / "runs").exists()


def test_the_refusal_says_what_to_type_and_that_is_enough(place: Path) -> None:
    (place / "mine/world").mkdir(parents=True)
    (place / "lab_world.py").write_text(
        "from gsl.core.setting import component\nfrom gsl.worlds.bullet import BulletWorld\n\n\n"
        "@component\nclass Lab(BulletWorld):\n    pass\n"
    )
    (place / "mine/world/lab.yaml").write_text("defaults: [nao_ideal, _self_]\n_target_: lab_world.Lab\n")
    command = ("collect", "--config-dir", "mine", "world=lab", *SHORT, "name=x")
    said = gsl(*command, folder=place)
    assert said.code == 2
    assert "say trust=lab_world if" in said.err
    done(*command, "trust=lab_world", folder=place)
    forget_modules(place)
    manifest = json.loads((place / "runs/x/collect_real/manifest.json").read_text())
    assert manifest["trust"] == ["lab_world"]


REFERRING = {
    "robot: ${sim.robot}": "mapping.robot: refers to sim.robot, and this command has no such setting; ",
    "robot: ${mapping.robot}": "mapping.robot: refers to itself; ",
    "about: {x: ['${mapping.about.x[0]}']}": "mapping.about.x[0]: refers to itself; ",
    'about: {x: "${oc.select:}"}': "mapping.about.x: refers to a setting in a way that cannot be read; ",
}


@pytest.mark.parametrize("line", REFERRING)
def test_a_reference_to_nothing_is_told_in_our_words(line: str, place: Path) -> None:
    (place / "m.yaml").write_text(f"{SIGNALS}{line}\n")
    said = refused("import", "source=log.csv", "mapping=m.yaml", "--check", folder=place)
    assert said == f"{REFERRING[line]}write the value itself"


@pytest.mark.parametrize("key", ["force", "out", "executor", "address", "check", "accept", "memory"])
def test_a_setting_of_the_command_is_none_of_a_mapping(key: str, place: Path) -> None:
    (place / "m.yaml").write_text(f"{SIGNALS}{key}: true\n")
    said = refused("import", "source=log.csv", "mapping=m.yaml", folder=place)
    assert said == f"mapping.{key}: is a setting of the command, and not of mapping; type {key}=... yourself"


SHAPELESS = {
    "defaults: 3": "its `defaults:` are no list of files",
    "defaults: ['${x}']": "its `defaults:` are no list of files",
    "defaults: [_self_, _self_]": "its `defaults:` are no list of files",
    "defaults: [nao_ideal]\nnull: 4": "None is no name of a setting, which is a text",
    "defaults: [nao_ideal]\nx: !!set {a}": "holds what no setting can be, such as a set",
    "defaults: [nao_ideal, _self_]\neffects: [1]": "world/w.yaml: says a list where settings by name are",
}


@pytest.mark.parametrize("text", SHAPELESS)
def test_a_file_of_another_shape_is_told_in_our_words(text: str, place: Path) -> None:
    (place / "theirs/world").mkdir(parents=True)
    (place / "theirs/world/w.yaml").write_text(f"{text}\n")
    assert SHAPELESS[text] in refused("collect", "--config-dir", "theirs", "world=w", folder=place)


def test_an_effect_of_somebody_else_is_not_imported(place: Path) -> None:
    (place / "theirs/effect").mkdir(parents=True)
    (place / "theirs/effect/slop.yaml").write_text("_target_: evil.Thing\n")
    for how in ((), ("--cfg", "job"), ("--help",)):
        said = gsl("collect", "--config-dir", "theirs", "world.effects.slop.x=1", *how, folder=place)
        assert how == ("--help",) or (said.code == 2 and "say trust=evil if" in said.err)


def test_a_run_of_somebody_else_is_repeated_with_their_code_only_if_it_is_trusted(artifact: Path, place: Path) -> None:
    path = artifact / "config.yaml"
    path.write_text(path.read_text().replace("gsl.stages.importing.Import", "evil.Thing"))
    strangers.seal(artifact)
    said = gsl("rerun", "a", folder=place)
    assert said.code == 2 and "_target_ = evil.Thing: is code that is not gsl's; say trust=evil if" in said.err


@pytest.mark.parametrize("entry", ["_target_: joblib.load", "x: [{_target_: gsl.effects.backlash.Backlash}]"])
def test_a_mapping_names_no_class_wherever_it_stands(entry: str, place: Path) -> None:
    (place / "theirs/mapping").mkdir(parents=True)
    for path in ("m.yaml", "theirs/mapping/m.yaml"):
        (place / path).write_text(f"{SIGNALS}{entry}\n")
    for words in (("mapping=m.yaml",), ("--config-dir", "theirs", "mapping=m")):
        assert "names a class, as _target_" in refused("import", "source=log.csv", *words, folder=place)


def test_a_misspelt_module_to_trust_is_named(place: Path) -> None:
    said = gsl("import", "source=log.csv", "trust=[evil,evli,numpy.linalg]", "--check", folder=place)
    assert said.err.count("warning: trust=") == 1
    assert "warning: trust=evli is no module of this folder, nor of an installed package" in said.err
    assert "trust=evil.Thing is no module" in gsl("import", "trust=evil.Thing", "--check", folder=place).err
    (place / "far/away").mkdir(parents=True)  # without __init__.py
    (place / "far/away/mine.py").touch()
    said = gsl("import", "source=log.csv", "trust=[far.away.mine,far.away.none]", "--check", folder=place)
    assert "far.away.none is no module" in said.err and "far.away.mine" not in said.err
    assert refused("import", "trsut=evil", "--check", folder=place) == "trsut: no such setting; did you mean trust?"


@pytest.mark.parametrize("source", ["../../etc", "/etc", "logs/../../etc"])
def test_a_mapping_chooses_no_source_outside_of_the_folder(source: str, place: Path) -> None:
    (place / "m.yaml").write_text(f"{SIGNALS}source: {source}\n")
    said = refused("import", "mapping=m.yaml", folder=place)
    assert said == f"mapping.source = {source}: leads out of this folder; type source=... yourself"
    done("import", "mapping=m.yaml", "source=log.csv", "--check", folder=place)


def test_what_is_typed_is_the_users_own_word(place: Path) -> None:
    said = refused("collect", "world._target_=no_such_module.World", folder=place)
    assert said.startswith(
        "world._target_ = no_such_module.World: cannot be loaded: there is no module no_such_module in "
    )
    said = refused("collect", "trust=true", folder=place)
    assert said == "trust = true: names the modules whose code may run, such as trust=my_module"


def test_plugins_of_hydra_and_libraries_in_the_current_folder_are_not_imported(place: Path) -> None:
    for name in ("hydra_plugins/evil_plugin/__init__.py", "bottleneck/__init__.py", "numexpr.py", "sitecustomise.py"):
        path = place / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(MARK)
    environment = {**ENVIRONMENT, "PYTHONPATH": str(Path(__file__).parents[2])}
    words = [sys.executable, "-m", "gsl", "import", "source=log.csv", "mapping=plain", "--check"]
    ended = subprocess.run(words, cwd=place, env=environment, capture_output=True, text=True, check=True)
    assert "nothing is written" in ended.stdout


def request(folder: Path, target: str) -> None:
    """Write the request that a stranger would: its hash is right."""
    settings = {"joints": ["a"], "control_period": 0.02, "observes": {"position": 1, "velocity": 1}}
    limits = {"lower": [-1.0], "upper": [1.0], "speed": [2.0], "step": [0.05], "path": [0.2], "window": 0.1}
    episode = {"name": "x", "policy": "x", "parameters": [0.0], "seed": 1, "posture": [0.0], "steps": 5}
    asked = {
        **settings, "about": "", "robot": "r", "place": "held in the air", "limits": limits,
        "ramp": {"seconds": 1.0, "speed": 0.5, "within": 0.1}, "policy": {"_target_": "gsl.policies.linear.Linear"},
        "action_noise": 0.0, "task": {}, "until_fall": False, "distance": False, "episodes": [episode],
    }  # fmt: skip
    write_request(folder, seal(asked), [])
    changed = {**asked, "policy": {"_target_": target}, "schema_version": 1}
    (folder / NAME).write_text(json.dumps({**changed, "hash": hash_of(changed)}))


@pytest.mark.parametrize("target", ["evil.Thing", "os.getcwd", "gsl.worlds.environments.made", "gsl.__main__.main"])
def test_a_request_calls_nothing(target: str, place: Path) -> None:
    """`answer`, `rehearse` and the runner have one way in."""
    request(place / "asked", target)
    (place / "asked/modules/evil.py").write_text(MARK)
    said = [
        refused("answer", "request=asked", "logs=log.csv", folder=place),
        refused("rehearse", "request=asked", folder=place),
    ]
    runner = [sys.executable, "asked/runner.py", "--dry-run"]
    result = subprocess.run(runner, cwd=place, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    for message in (*said, result.stdout):
        assert "policy._target_" in message or "policy = " in message, message


@pytest.mark.parametrize("name", ["argparse.py", "numpy/__init__.py", "json.pyc", "gsl/runner/evil.py", "link"])
def test_a_module_beside_those_of_a_request_is_not_run(name: str, place: Path) -> None:
    """It would stand in for one of Python's own."""
    request(place / "asked", "gsl.policies.linear.Linear")
    path = place / "asked/modules" / name
    path.parent.mkdir(exist_ok=True)
    path.symlink_to(place) if name == "link" else path.write_text(MARK)
    said = refused("rehearse", "request=asked", folder=place)
    assert "is none of gsl's modules" in said


def test_compiled_code_beside_a_request_is_not_read(place: Path) -> None:
    import py_compile

    request(place / "asked", "gsl.policies.linear.Linear")
    source = place / "asked/modules/gsl/runner/main.py"
    whole = source.read_bytes()
    about = source.stat()
    source.write_text(MARK + "#" * (about.st_size - len(MARK)))
    os.utime(source, ns=(about.st_mtime_ns, about.st_mtime_ns))
    py_compile.compile(str(source))
    source.write_bytes(whole)
    os.utime(source, ns=(about.st_mtime_ns, about.st_mtime_ns))
    assert gsl("rehearse", "request=asked", folder=place).code == 2  # no world is a robot of one joint
    words = [sys.executable, "-I", "-c", "import sys; sys.path[0:0]=['asked/modules']; import gsl.runner.main"]
    subprocess.run(words, cwd=place, env=ENVIRONMENT, capture_output=True, check=False)
    assert (place / "ran").exists()  # Python would have read it
    (place / "ran").unlink()
    words[2:2] = ["-X", "pycache_prefix=none"]
    subprocess.run(words, cwd=place, env=ENVIRONMENT, capture_output=True, check=True)


BOMB = "a: &a [x, x]\n" + "".join(
    f"{b}: &{b} [*{a}, *{a}]\n" for a, b in zip("abcdefghijkl", "bcdefghijklm", strict=True)
)
HOSTILE = {
    "nested aliases": f"{SIGNALS}about:\n" + "".join(f"  {line}\n" for line in (BOMB * 1).splitlines())
    + "".join(f"  z{k}: [*m, *m, *m, *m, *m, *m, *m, *m]\n" for k in range(9)),
    "an alias of itself": f"{SIGNALS}about: &a [*a]\n",
    "too deep": f"{SIGNALS}about: {'[' * 5000}{']' * 5000}\n",
    "deep": f"{SIGNALS}about: {'[' * 2 * DEPTH}{']' * 2 * DEPTH}\n",
    "no UTF-8": f"{SIGNALS}name: ".encode() + b"\xff\xfe\n",
    "a huge number": f"{SIGNALS}period: {'9' * 6000}\n",
    "no mapping": "- 1\n",
    "a tag": f"{SIGNALS}about: !!python/object/apply:os.getcwd []\n",
    "a large file": SIGNALS + "# " + "x" * 2_000_000,
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_a_mapping_has_a_budget(name: str, place: Path) -> None:
    text = HOSTILE[name]
    (place / "m.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    assert "m.yaml" in refused("import", "source=log.csv", "mapping=m.yaml", folder=place)


def test_references_that_multiply_have_a_budget(place: Path) -> None:
    levels = "".join(f"  b{k + 1}: '${{mapping.about.b{k}}}${{mapping.about.b{k}}}'\n" for k in range(60))
    (place / "m.yaml").write_text(f"{SIGNALS}about:\n  b0: xxxxxxxxxxxxxxxx\n{levels}")
    assert "they get too large" in refused("import", "source=log.csv", "mapping=m.yaml", folder=place)


def test_a_pattern_of_paths_has_a_budget(place: Path) -> None:
    (place / ("a" * 200 + ".csv")).write_text(LOG)
    fields = "".join(f"{{f{k}}}" for k in range(10))
    (place / "m.yaml").write_text(f"{SIGNALS}path: '{fields}!'\n")
    said = refused("import", f"source={'a' * 200}.csv", "mapping=m.yaml", folder=place)
    assert said.startswith("mapping.path")


def header(path: Path, count: int, kind: bytes = b"\x02\x00") -> None:
    """Write an archive of an array whose header says that it is `count` bytes long, of blanks."""
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("q.npy", "w", force_zip64=True) as file,
    ):
        file.write(b"\x93NUMPY" + kind + struct.pack("<I", count))
        for _ in range(count // 10_000_000):
            file.write(b" " * 10_000_000)


def test_an_array_whose_header_asks_for_gigabytes_takes_none(place: Path) -> None:
    header(place / "a.npz", 200_000_000)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert "is no numpy array" in refused("import", "source=a.npz", "mapping=plain", folder=place)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # kB


@pytest.mark.parametrize("at", range(0, 400, 37))
def test_a_damaged_archive_is_one_line(at: int, place: Path) -> None:
    np.savez_compressed(place / "good.npz", q=np.arange(20.0).reshape(10, 2), time=np.arange(10.0))
    content = bytearray((place / "good.npz").read_bytes())
    content[at % len(content)] ^= 0xFF
    (place / "a.npz").write_bytes(content)
    said = gsl("import", "source=a.npz", "mapping=plain", folder=place)
    assert (said.code, len(said.lines)) == (2, 1)
    assert "internal error" not in said.err


def test_a_table_of_very_many_columns_is_refused(place: Path) -> None:
    names = [f"c{k}" for k in range(300_000)]
    (place / "wide.csv").write_text(",".join(names) + "\n" + ",".join(["1"] * len(names)) + "\n")
    assert "has 300,000 columns" in refused("import", "source=wide.csv", "mapping=plain", folder=place)


@pytest.mark.parametrize(
    ("count", "problem"), [(3000, "3,001 joints or links; 500 are read"), (128, "128 joints that move; 120 are simu")]
)
def test_a_robot_of_very_many_joints_is_refused(count: int, problem: str, place: Path) -> None:
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>' for k in range(count)
    )  # fmt: skip
    links = "".join(f'<link name="l{k}"/>' for k in range(count + 1))
    (place / "long.urdf").write_text(f'<robot name="r">{links}{joints}</robot>')
    said = refused("robot", "long.urdf", folder=place)
    assert said.startswith(f"long.urdf: has {problem}")


@pytest.fixture(scope="module")
def imported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("imported")
    (folder / "log.csv").write_text(LOG)
    done("import", "source=log.csv", "mapping=plain", "name=a", folder=folder)
    return folder / "runs"


@pytest.fixture
def artifact(imported: Path, place: Path) -> Path:
    shutil.copytree(imported, place / "runs")
    return place / "runs/a/import"


def changed(artifact: Path, **entries: object) -> None:
    """Change a manifest as a stranger would: its own hash is right."""
    stored = json.loads((artifact / "manifest.json").read_text())
    stored = {key: value for key, value in stored.items() if key != HASH} | entries
    (artifact / "manifest.json").write_text(json.dumps({**stored, HASH: hash_entries(stored)}))


@pytest.mark.parametrize("name", ["../../../secret.json", "/etc/hostname", "a/../../../../secret.json"])
def test_a_manifest_reads_nothing_outside_of_its_artifact(name: str, artifact: Path, place: Path) -> None:
    (place / "secret.json").write_text('{"word": "swordfish"}')
    changed(artifact, metrics=name)
    said = gsl("show", "a", folder=place)
    assert said.code == 2 and "swordfish" not in said.out + said.err
    assert gsl("runs", folder=place).code == 0


def test_a_link_out_of_an_artifact_is_not_followed(artifact: Path, place: Path) -> None:
    (place / "secret.json").write_text('{"word": "swordfish"}')
    (artifact / "metrics.json").unlink()
    (artifact / "metrics.json").symlink_to(place / "secret.json")
    said = gsl("show", "a", folder=place)
    assert said.code == 2 and "swordfish" not in said.out + said.err


def test_a_file_of_512_gigabytes_is_not_read(artifact: Path, place: Path) -> None:
    with (artifact / "big.bin").open("wb") as file:
        file.truncate(512_000_000_000)
    files = json.loads((artifact / "manifest.json").read_text())["files"]
    changed(artifact, files={**files, "big.bin": {"sha256": "0" * 64, "bytes": 512_000_000_000}})
    begin = time.process_time()
    said = gsl("import", "source=log.csv", "mapping=plain", "name=a", folder=place)
    assert said.code == 2 and "are read" in said.err
    assert time.process_time() - begin < SECONDS
    (artifact / "big.bin").unlink()


@pytest.mark.parametrize("text", ["[" * 100_000, "{", "\xff", '{"schema_version": 1}', f'{{"a": {"9" * 6000}}}', "[]"])
def test_a_damaged_manifest_is_one_line(text: str, artifact: Path, place: Path) -> None:
    (artifact / "manifest.json").write_bytes(text.encode("latin-1"))
    for command in (("show", "a"), ("runs",), ("train-forward", "data=a")):
        assert "internal error" not in gsl(*command, folder=place).err


@pytest.mark.parametrize("out", [".", "/", ".."])
def test_an_artifact_has_a_folder_of_its_own(out: str, place: Path) -> None:
    assert "out = " in refused("collect", f'out="{out}"', folder=place)


def test_escape_sequences_are_shown_as_text(place: Path) -> None:
    evil = "\x1b]0;owned\x07\x1b[2J\u202edrow\x9b1m"
    assert visible(evil) == "\\u001b]0;owned\\u0007\\u001b[2J\\u202edrow\\u009b1m"
    assert json.loads(visible(json.dumps(evil, ensure_ascii=False))) == evil
    (place / f"log{evil.replace('/', '')}.csv").write_text(LOG.replace(".a", f".{evil}"))
    (place / "m.yaml").write_text(f"{SIGNALS}name: 'x'\n")
    for more in ((), ("--json",)):
        said = gsl("import", "source=log?*.csv", "mapping=m.yaml", "check=true", *more, folder=place)
        assert "\x1b" not in said.out + said.err and "\x9b" not in said.out + said.err
        assert "\\u001b" in said.out + said.err


ARM = (
    '<robot name="arm"><link name="base"/><link name="l"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"'
    ' ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="revolute"><parent link="base"/><child link="l"/>'
    '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>'
)


def test_the_files_of_a_robot_are_written_over_nobodys(place: Path) -> None:
    (place / "arm.urdf").write_text(ARM)
    said = refused("robot", "arm.urdf", "out=.", folder=place)
    assert said == "arm.urdf: exists, and is not what would be written; move it, or say another out="
    assert (place / "arm.urdf").read_text() == ARM
    for _ in range(2):
        done("robot", "arm.urdf", "out=there", folder=place)


def test_code_is_found_wherever_plain_data_names_it() -> None:
    document = {
        "a": [{"_target_": "os.system"}],
        "world": {"_target_": "gsl.worlds.bullet.BulletWorld", "robot": "x.y"},
    }
    assert [path for path, _, _ in code_in(document)] == ["a.0._target_", "world.robot"]
    assert modules_in(document) == ("os", "x")
    check_code(document, ["os", "x"])
    with pytest.raises(ConfigError, match=r"a\.0\._target_ = os\.system: is of Python's own library"):
        check_code(document, ["x"])
    two = {"a": {"_target_": "lab.A"}, "b": {"_target_": "mine.B"}}
    with pytest.raises(ConfigError, match=r"a\._target_ = lab\.A: .* say 'trust=\[mine,lab\]'"):
        check_code(two, ["misspelt", "mine"])
    check_code({"_target_": "lab.robots.World"}, ["lab"])
    with pytest.raises(ConfigError):
        check_code({"_target_": "laboratory.World"}, ["lab"])


def test_a_budget_of_time_ends_a_pattern_that_never_would() -> None:
    import re

    begin = time.process_time()
    with pytest.raises(InputError, match="matching takes more than 0.5 s"), within("matching", seconds=0.5):
        re.fullmatch("(a+)+b", "a" * 60)
    assert time.process_time() - begin < 5.0


def test_a_yaml_file_is_read_as_it_is(tmp_path: Path) -> None:
    assert yaml_tree(tmp_path, "a: &a [1, 2]\nb: *a\n") == {"a": [1, 2], "b": [1, 2]}


def test_settings_of_hydra_of_another_kind_are_one_line(tmp_path: Path) -> None:
    said = gsl("collect", "--cfg", "job", *["hydra.sweeper.params={_target_: os.system}"] * 2, folder=tmp_path)
    assert said.code == 2 and len(said.lines) == 1 and "hydra: its settings cannot be read" in said.lines[0]


def test_a_robot_of_a_world_file_is_what_a_function_of_robots_builds(tmp_path: Path) -> None:
    world = tmp_path / "theirs/world/w.yaml"
    world.parent.mkdir(parents=True)
    for robot, problem in (
        ("gsl.robots.catalogue.names", "is no function that builds a robot"),
        ("gsl.robots.catalogue.robot", "is no function that builds a robot of nothing"),
        ("gsl.robots.hinges.math", "is no function that builds a robot of nothing"),
        ("gsl_experiments.commands.main", "world.robot"),
        ("../elsewhere/arm.txt", "no robot called '../elsewhere/arm.txt'"),
    ):
        world.write_text(f"defaults: [urdf, _self_]\nrobot: {robot}\n")
        words = ("collect", "--config-dir=theirs", "world=w", "task=excite", *SMALL)
        assert problem in refused(*words, folder=tmp_path), robot


def test_a_world_of_a_stranger_takes_a_servo_of_its_own_place_or_the_users_alone(tmp_path: Path) -> None:
    here = tmp_path / "here"
    world = here / "theirs/world/w.yaml"
    world.parent.mkdir(parents=True)
    for place in (tmp_path / "elsewhere", here / "theirs/air", here / "runs/air"):
        place.mkdir(parents=True)
        (place / "servo_model.safetensors").touch()
    (here / "runs/link").symlink_to(tmp_path / "elsewhere")
    words = ("collect", "--config-dir=theirs", "world=w", *SMALL)
    out, damaged = "is named by a file and leads out of its folder and of yours", "is not a checkpoint"
    for servo, typed, problem in (
        (str(tmp_path / "elsewhere"), (), out),
        ("../elsewhere", (), out),
        ("link", (), out),
        ("${name}", ("name=link",), damaged),
        ("../elsewhere", ("world.servo=../elsewhere",), damaged),
        ("theirs/air", (), damaged),
        ("air", (), damaged),
    ):
        world.write_text(f"defaults: [learned, _self_]\nservo: {servo}\n")
        assert problem in refused(*words, *typed, folder=here), (servo, typed)
    world.with_name("v.yaml").write_text("defaults: [learned, _self_]\nservo: ../elsewhere\n")
    assert out in "".join(gsl(*words[:2], "--multirun", "world=nao_ideal,v", *SHORT, folder=here).lines)
    experiment = here / "theirs/experiment/e.yaml"  # a grounding that hides among the values of a preset
    experiment.parent.mkdir()
    hidden = "preset: {g: {_target_: gsl.grounding.servo.LearnedServo, servo: ../elsewhere}}"
    experiment.write_text(f"# @package _global_\n{hidden}\ngrounding: ${{preset.g}}\n")
    assert out in refused("optimize", words[1], "experiment=e", folder=here)
