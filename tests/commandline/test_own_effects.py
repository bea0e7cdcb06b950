"""Effects of a user's own, in his folder: the page's example in stages, world files, Python, workers and searches."""

from __future__ import annotations

import importlib
import json
import pickle
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from commands import ENVIRONMENT, done, forget_modules, gsl, refused

from gsl import make_world, run
from gsl.commandline.help import write_help
from gsl.commandline.unusual_effects import list_unusual
from gsl.core.configuration import list_worlds
from gsl.core.plant import nominal
from gsl.diagnosis.hypothesis.candidates import library
from gsl.effects.effect import apply_all, build, effect_class, names, own, use_own
from gsl.errors import ConfigError
from gsl.robots.nao import nao
from gsl.testing import check_effect
from gsl.worlds.bullet import BulletWorld

pytestmark = pytest.mark.slow

PAGE = Path(__file__).parents[2] / "docs/howto/own-components.md"
MODULE, NAME = "cold_grease", "cold_grease"
OWN = ("--config-dir", "my_conf")
QUICK = ("preset=toy", "task.duration=0.4", "workers=1")
HOOKED = '''
from dataclasses import replace

import numpy as np

from cold_grease import *


@component
class Magnet(ColdGrease):
    """A magnet. Signature: a pull. Confused with gravity."""

    def apply(self, plant):
        return replace(plant, hook=lambda motion, time: self.thickness * np.ones(motion.shape[1]))
'''


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A user's folder with the page's example."""
    folder: Path = tmp_path_factory.mktemp("own")
    code = next(block for block in re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.S) if NAME in block)
    line = next(block for block in re.findall(r"```yaml\n(.*?)```", PAGE.read_text("utf-8"), re.S) if NAME in block)
    (folder / f"{MODULE}.py").write_text(code)
    (folder / "my_conf/effect").mkdir(parents=True)
    (folder / f"my_conf/effect/{NAME}.yaml").write_text(line)
    yield folder
    forget_modules(folder)


@pytest.fixture(autouse=True)
def apart(home: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Effects of one's own are forgotten after each test."""
    monkeypatch.syspath_prepend(str(home))
    monkeypatch.setenv("GSL_TRUST", "cold_grease edited numpy rangeless magnet hooked")
    yield
    use_own({})


@pytest.fixture
def mine(home: Path) -> type:
    """The page's class, in use."""
    kind: type = __import__(MODULE).ColdGrease
    use_own({NAME: kind})
    return kind


def test_the_pages_example_keeps_the_contract(mine: type) -> None:
    check_effect(mine(thickness=0.5))


def test_it_stands_beside_ours(mine: type) -> None:
    assert NAME in names() and effect_class(NAME) is mine and "backlash" in names()
    plant, still = (apply_all(nominal(nao()), build(effects)) for effects in ({NAME: {"thickness": 0.5}}, {}))
    np.testing.assert_allclose(plant.servo.viscous - still.servo.viscous, 0.15)


def test_it_is_searched_within_its_documented_range(mine: type) -> None:
    (candidate,) = (entry for entry in library(nao()) if entry.effect == NAME)
    np.testing.assert_array_equal(candidate.documented, [[0.0], [1.0]])
    assert candidate.free == ("thickness",) and candidate.scope == "all"


@pytest.mark.parametrize("effect", [f"{NAME}.thickness=3.9", "servo_gain.kp=0", f"{NAME}.thickness=5"])
def test_a_value_far_from_its_documented_range_is_a_warning(effect: str, home: Path) -> None:
    words = (*OWN, *QUICK, "world=nao_ideal", f"world.effects.{effect}", "name=far", "force=true")
    line = f"warning: world.effects.{NAME}.thickness = 5: far from its documented range, 0 to 1\n"
    assert (line in done("collect", *words, folder=home).err) == effect.endswith("=5")
    manifest = json.loads(next((home / "runs/far").glob("*/manifest.json")).read_text())
    assert manifest["command"].endswith(f"world.effects.{effect} name=far force=true")


@pytest.mark.parametrize("name", sorted(list_worlds() - {"gymnasium", "learned", "urdf"}))
def test_no_value_of_our_worlds_is_far_from_its_documented_range(name: str) -> None:
    world = make_world(name)
    effects, plant = getattr(world, "effects", {}), getattr(world, "plant", None)
    assert plant is None or not [*list_unusual(effects, plant.robot)]


def test_stages_take_it_from_the_folder(home: Path) -> None:
    done("collect", *OWN, *QUICK, "world=nao_ideal", f"world.effects.{NAME}.thickness=0.5", "name=with", folder=home)
    done("collect", *OWN, *QUICK, "world=nao_ideal", "name=without", folder=home)
    made, plain = (home / f"runs/{name}/collect_real/trajectories.parquet" for name in ("with", "without"))
    assert made.read_bytes() != plain.read_bytes()


def test_a_world_file_may_name_it(home: Path) -> None:
    (home / "my_conf/world").mkdir(exist_ok=True)
    text = f"defaults: [nao_ideal, _self_]\neffects:\n  {NAME}: {{thickness: 0.5, joints: legs}}\n"
    (home / "my_conf/world/cold.yaml").write_text(text)
    world = make_world("cold", config_dir=home / "my_conf")
    assert isinstance(world, BulletWorld)
    legs = world.plant.mask("legs")
    np.testing.assert_allclose(world.plant.servo.coulomb, np.where(legs, 0.05, 0.0))


def test_a_world_from_python_may_have_it(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(home)
    world = make_world("nao_ideal", config_dir=home / "my_conf", effects={NAME: {"thickness": 1.0}})
    assert isinstance(world, BulletWorld)
    assert world.plant.servo.coulomb.min() == pytest.approx(0.1)
    make_world("nao_ideal")
    assert not own(), "another world has none of it"
    changed = replace(world, effects={**world.effects, "zero_offset": {"offset": 0.01}})
    assert changed.plant.servo.coulomb.min() == pytest.approx(0.1), "and whoever makes another of it has it"
    made = run("collect", world=world, name="still", episodes=1, workers=1, task={"duration": 0.1})
    assert NAME in made.artifact.config["world"]["effects"], "and it has it all the same"
    plain = run("collect", world="nao_ideal", name="plain", episodes=1, workers=1, task={"duration": 0.1})
    assert not any(NAME in parent.role for parent in plain.artifact.manifest.parents)


@pytest.mark.parametrize(
    ("typed", "line"),
    [
        (f"{NAME}.thicknes=0.5", f"world.effects.{NAME}.thicknes: no such setting; did you mean thickness?"),
        (f"{NAME}.thickness=-1", f"world.effects.{NAME}.thickness = -1: must be at least 0"),
        ("cold_greas.thickness=0.5", f"world.effects.cold_greas: no such effect; did you mean {NAME}?"),
        (f"{NAME}.joints=leg", f"world.effects.{NAME}.thickness: has no value"),
    ],
)
def test_bounds_and_slips_are_said_as_of_ours(typed: str, line: str, home: Path) -> None:
    said = refused("collect", *OWN, "world=nao_ideal", f"world.effects.{typed}", "name=refused", folder=home)
    assert said.startswith(line)


def test_help_lists_it(home: Path) -> None:
    text = write_help("collect", config_dir=home / "my_conf")
    assert re.search(rf"{NAME}\.thickness +of the grease", text)


def test_without_the_folder_nobody_knows_it(home: Path) -> None:
    said = refused("collect", "world=nao_ideal", f"world.effects.{NAME}.thickness=0.5", "name=refused", folder=home)
    assert said.startswith(f"world.effects.{NAME}: no such effect")


def test_a_file_that_names_a_class_loads_none() -> None:
    with pytest.raises(ConfigError, match="effects.x._target_ = shutil.rmtree: is no effect that is loaded"):
        build({"x": {"_target_": "shutil.rmtree", "path": "/"}})
    with pytest.raises(ConfigError, match="keep it as effect/x.yaml in the folder of --config-dir"):
        build({"x": {"_target_": "not_imported.Effect"}})


def test_after_an_edit_of_the_class_an_artifact_is_another(home: Path) -> None:
    path = home / "edited.py"
    path.write_text((home / f"{MODULE}.py").read_text())
    (home / "my_conf/effect/edited.yaml").write_text("_target_: edited.ColdGrease\n")
    command = ("collect", *OWN, *QUICK, "world=nao_ideal", "name=edited")
    done(*command, folder=home)
    path.write_text(path.read_text().replace("0.3 * more", "0.4 * more"))
    assert "edited.py: was changed after it was loaded; start Python anew" in refused(*command, folder=home, code=1)
    importlib.reload(sys.modules["edited"])
    assert "was built otherwise" in refused(*command, folder=home)
    (home / "my_conf/effect/edited.yaml").unlink()


@pytest.mark.parametrize("hooked", [False, True])
def test_a_worker_process_has_it_too(hooked: bool, home: Path) -> None:
    (home / "magnet.py").write_text(HOOKED)
    kind = __import__("magnet").Magnet if hooked else __import__(MODULE).ColdGrease
    use_own({NAME: kind})
    world = BulletWorld(robot="nao", effects={NAME: {"thickness": 0.5}})
    (home / "world.pickle").write_bytes(pickle.dumps(world))
    asked = "import pickle; from gsl.effects.effect import names; import numpy as np\n" \
            "world = pickle.load(open('world.pickle', 'rb'))\n" \
            "print('cold_grease' in names(), world.plant.servo.viscous[0], world.plant.hook is not None)"  # fmt: skip
    environment = {**ENVIRONMENT, "PYTHONPATH": f"{home}:{PAGE.parents[1]}"}
    said = subprocess.run([sys.executable, "-c", asked], cwd=home, env=environment, capture_output=True, text=True)
    assert said.stdout.split() == ["True", f"{world.plant.servo.viscous[0]}", str(hooked)], said.stderr


@pytest.mark.parametrize(
    ("content", "line"),
    [
        ("_target_: cold_grease.Grease\n", "effect/bad.yaml._target_ = cold_grease.Grease: cannot be loaded"),
        ("_target_: cold_grease.ColdGrease\nthickness: 1.0\n", "effect/bad.yaml: has one line, `_target_"),
        ("_target_: numpy.ndarray\n", "effects.bad = ndarray: is no effect; it needs @component"),
        ("_target_: [\n", "my_conf/effect/bad.yaml: is not YAML, or damaged"),
        ("_target_: rangeless.Rangeless\n", "effects.bad.thickness: needs a documented range"),
    ],
)
def test_a_folder_that_is_wrong_is_one_line(content: str, line: str, home: Path) -> None:
    code = (home / f"{MODULE}.py").read_text().replace("lower=0.0, upper=1.0, ", "")
    (home / "rangeless.py").write_text(code.replace("ColdGrease", "Rangeless"))
    bad = home / "my_conf/effect/bad.yaml"
    bad.write_text(content)
    try:
        said = gsl("collect", *OWN, "world=nao_ideal", "name=refused", folder=home)
    finally:
        bad.unlink()
    assert (said.code, said.lines[-1].startswith(f"gsl collect: {line}")) == (2, True), said.lines[-1]
