"""Configurations are composed, checked and built; whatever is wrong is one line."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from example_stage import ExampleWorld

from gsl.cli import call
from gsl.commandline.composer import compose
from gsl.commandline.config import prepare, resolve
from gsl.commandline.failure import describe_failure
from gsl.commandline.hydra_door import open_hydra
from gsl.commandline.multirun import job_level
from gsl.commandline.plugins import folders
from gsl.core.configuration import configuration_folder
from gsl.core.described import describe, restore
from gsl.errors import ConfigError

pytestmark = pytest.mark.slow

CONF = Path(__file__).parents[1] / "support/conf_example"


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("GSL_CONFIG_DIR", str(CONF))
    monkeypatch.setenv("GSL_TRUST", "example_stage")
    return tmp_path


def test_a_stage_leaves_its_artifact_where_the_configuration_says(
    elsewhere: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(["collect", "episodes=2"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "runs/example/collect"
    assert (elsewhere / "runs/example/collect/count.txt").read_text() == "2\n"
    assert (elsewhere / "runs/example/collect/manifest.json").is_file()
    assert call(["collect", "episodes=2"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "runs/example/collect (unchanged)"
    assert call(["collect", "episodes=2", "out=elsewhere/mine"]) == 0
    assert (elsewhere / "elsewhere/mine/manifest.json").is_file()


def test_json_is_exactly_one_document(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["collect", "--json", "world.iterations=7"]) == 0
    assert json.loads(capsys.readouterr().out)["metrics"] == {"episodes": 3, "seed": 1, "iterations": 7}
    assert call(["collect", "--json", "world.iterations=0", "force=true"]) == 2
    error = {"error": "world.iterations = 0: must be at least 1", "exit_code": 2}
    assert json.loads(capsys.readouterr().out) == error


def test_the_composed_configuration_can_be_looked_at(elsewhere: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["evaluate", "--cfg", "job", "--json", "subject=s", "sim=worn", "real=ideal", "preset=toy"]) == 0
    composed = json.loads(capsys.readouterr().out)
    assert composed["episodes"] == 1
    assert "mine" in composed["sim"]["effects"]
    assert composed["real"]["effects"] == {}
    assert not (elsewhere / "runs").exists()


def test_what_is_looked_at_begins_with_the_settings_of_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["evaluate", "--cfg", "job", "subject=s"]) == 0
    shown = yaml.safe_load(capsys.readouterr().out)
    assert [isinstance(value, dict) for value in shown.values()] == sorted(isinstance(v, dict) for v in shown.values())
    assert [*shown][-1] == "preset" and {"name", "episodes"} < {*shown}


def test_a_value_of_a_preset_counts_where_a_setting_selects_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("GSL_CONFIG_DIR")
    assert call(["optimize", "preset.screening=5", "--cfg", "job", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["screening"] == 5


def test_an_experiment_is_a_whole_scenario(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["collect", "--cfg", "job", "--json", "experiment=long"]) == 0
    assert json.loads(capsys.readouterr().out)["episodes"] == 9


def test_a_command_key_reaches_a_stage_that_has_such_a_field(elsewhere: Path) -> None:
    assert call(["evaluate", "subject=s", "trust=[lab,mine.robots]"]) == 0
    assert (elsewhere / "runs/example/compared/trust.txt").read_text() == "example_stage lab mine.robots"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["wrld=worn"], "wrld: no such setting; did you mean world?"),
        (["world.control_perod=1"], "world.control_perod: no such setting; did you mean world.control_period?"),
        (["control_period=1"], "control_period: no such setting; did you mean world.control_period?"),
        (["+world.foo=1"], "world.foo: no such setting; there is control_period, effects, iterations"),
        (["sim=ideal"], "sim: no such setting"),
        (
            ["world=wrn"],
            "no world called wrn; did you mean worn? There is cliff_walking, cliff_walking_noisy, go2_in_air, "
            "gymnasium, half_cheetah, half_cheetah_noisy, hopper, hopper_heavy, ideal, inverted_pendulum, "
            "inverted_pendulum_heavy, inverted_pendulum_noisy, learned, nao_drawn_a, nao_drawn_b, nao_harsh, "
            "nao_ideal, nao_motors, nao_motors_late, nao_uneven, nao_weak, nao_weak_uneven, nao_worn, plain, robot, "
            "so101, so101_anchor_lab, so101_bam_m1, so101_bam_m3, so101_bam_m4, so101_diagnosed, so101_menagerie, "
            "so101_robotstudio, so101_typing_task, so101_usd_drive, so101_workshop, urdf, walker2d, walker2d_heavy, "
            "worn, xl330_bam_m1, xl330_bam_m3, xl330_bam_m4, xl330_pendulum",
        ),
        (
            ["experiment=lng"],
            "no experiment called lng; did you mean long? There is arm, cliff_walking, environments, gymnasium, "
            "linear_walk, long",
        ),
        (["episodes=four"], "episodes = four: must be a whole number"),
        (["episodes=-1"], "episodes = -1: must be above 0"),
        (["episodes"], "episodes: has no value; write key=value"),
        (["episodes=[1"], "episodes = [1: cannot be read"),
        (["episodes=1,2"], "episodes: several values need --multirun; a list is written 'episodes=[1,2]'"),
        (["real=a,b"], "real: several values need --multirun; several logs are one folder of files"),
        (["episodes=${nope}"], "episodes: refers to nope, and this command has no such setting"),
        (["force=maybe"], "force = maybe: must be true or false"),
        (["name="], "name: must not be empty"),
        (["world=plain"], "world.effects.mine.width = -1: must be at least 0 (rad)"),
        (["world=worn", "world.effects.mine.width=-2"], "world.effects.mine.width = -2: must be at least 0 (rad)"),
        (["world.effects.bakclash.width=1"], "world.effects.bakclash: no such effect; did you mean backlash?"),
        (["world._target_=no.Where"], "world._target_ = no.Where: cannot be loaded"),
        (["hydra/launcher=basik"], "no hydra/launcher called basik; did you mean basic?"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_what_is_wrong_is_one_line(
    arguments: list[str], message: str, elsewhere: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(["collect", *arguments]) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith(f"gsl collect: {message}")
    assert printed.err.count("\n") == 1
    assert printed.out == ""
    assert not (elsewhere / "runs").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["evaluate"], "gsl evaluate: subject: has no value yet; say subject=...\n"),
        (["evaluate", "world=worn", "subject=s"], "gsl evaluate: world: has a role here; say "),
        (["evaluate", "real=wrn", "subject=s"], "gsl evaluate: no world called wrn; did you mean worn?"),
        (["colect"], "gsl colect: No such command 'colect'. Did you mean 'collect'?\n"),
        (["collect", "--jsn"], "gsl collect: No such option: --jsn"),
        (["collect", "--config-dir", "nowhere"], "gsl collect: --config-dir nowhere: there is no such folder\n"),
        (["show", "nothing"], "gsl show: nothing: there is no such path"),
    ],
)
def test_wrong_usage_is_one_line_too(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(arguments) == 2
    printed = capsys.readouterr().err
    assert printed.startswith(message)
    assert printed.count("\n") == 1


@pytest.mark.parametrize(
    ("how", "exit_code", "message"),
    [
        ("known", 1, "gsl collect: the robot is on fire; put it out\n"),
        (
            "bug",
            1,
            "gsl collect: example_stage.Count.run failed (example_stage.py, line 50): ZeroDivisionError: division by",
        ),
        ("ctrl-c", 130, "gsl collect: interrupted; what is complete stays, and the same command does the rest\n"),
    ],
)
def test_a_stage_that_fails_leaves_nothing_behind(
    how: str, exit_code: int, message: str, elsewhere: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(["collect", f"fails={how}"]) == exit_code
    assert capsys.readouterr().err.startswith(message)
    assert [path for path in elsewhere.rglob("*") if path.is_file()] == []


def test_a_fault_of_gsls_is_an_internal_error() -> None:
    line = "internal error: ZeroDivisionError: division by zero in two lines; GSL_TRACEBACK=1 shows where"
    assert describe_failure(ZeroDivisionError("division by zero\nin two lines")) == (line, 1)


@pytest.mark.parametrize("failure", [MemoryError("Unable to allocate 7 TiB"), OSError(12, "Cannot allocate memory")])
def test_a_lack_of_memory_is_one_line(failure: Exception) -> None:
    line = "there is not enough memory for this; free some, or try workers=1, or less at once"
    assert describe_failure(failure) == (line, 1)


def test_a_traceback_is_there_for_who_asks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GSL_TRACEBACK", "1")
    with pytest.raises(ZeroDivisionError):
        call(["collect", "fails=bug"])


def test_each_job_of_a_multirun_has_its_own_artifact(elsewhere: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["collect", "-m", "--json", "seed=1,2", "world=ideal,worn", "world.iterations=7"]) == 0
    jobs = json.loads(capsys.readouterr().out)["jobs"]
    assert [job["metrics"]["seed"] for job in jobs] == [1, 1, 2, 2]
    assert all((elsewhere / job["folder"] / "manifest.json").is_file() for job in jobs)
    assert jobs[1]["folder"] == "runs/example/seed=1,world=worn/collect"
    assert {path.name for path in (elsewhere / "runs").iterdir()} == {"example"}


def test_a_failing_job_does_not_stop_the_others(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["collect", "-m", "--json", "fails=known,''"]) == 1
    first, second = json.loads(capsys.readouterr().out)["jobs"]
    assert first["error"] == "the robot is on fire; put it out"
    assert second["exit_code"] == 0


def test_a_multirun_is_checked_before_it_starts(elsewhere: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["collect", "-m", "seed=1,2", "episodez=3,4"]) == 2
    assert "episodez: no such setting; did you mean episodes" in capsys.readouterr().err
    assert not (elsewhere / "runs").exists()


@pytest.mark.parametrize("show", [(), ("--cfg", "job")])
def test_a_glob_takes_files_of_a_group_and_nothing_else(
    show: tuple[str, ...], elsewhere: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(["collect", "-m", *show, "force=glob(*)"]) == 2
    assert capsys.readouterr().err == "gsl collect: force = glob(*): fits no file of a group\n"
    assert call(["collect", "-m", *show, "preset=glob(no_such*)"]) == 2
    assert not (elsewhere / "runs").exists()
    assert call(["collect", "-m", "--cfg", "job", "preset=glob(*)"]) == 0


def test_a_job_is_named_by_what_is_particular_about_it() -> None:
    assert job_level(["seed=1", "++a.b=0.5", "n=3"], ["seed", "a.b"], 4) == "seed=1,a.b=0.5"
    assert job_level(["world@sim=x/y"], ["world@sim"], 4) == "sim=x_y"
    assert job_level(["n=3"], [], 4) == "4"
    assert job_level(["n=" + "x" * 200], ["n"], 4) == "4"


def test_a_file_of_the_user_wins_over_ours(elsewhere: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mine = elsewhere / "mine"
    (mine / "preset").mkdir(parents=True)
    (mine / "preset/quick.yaml").write_text("episodes: 77\n")
    (mine / "collect.yaml").write_text((CONF / "collect.yaml").read_text().replace("world: ideal", "preset@p: quick"))
    assert call(["collect", "--config-dir", str(mine), "--cfg", "job", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["episodes"] == 77


def test_a_file_of_a_folder_below_a_group_is_taken(elsewhere: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (elsewhere / "mine/experiment/arms").mkdir(parents=True)
    (elsewhere / "mine/experiment/arms/both.yaml").write_text("# @package _global_\nepisodes: 7\n")
    line = ["collect", "--config-dir", "mine", "+experiment/arms=both", "--cfg", "job", "--json"]
    assert call(line) == 0
    assert json.loads(capsys.readouterr().out)["episodes"] == 7


@pytest.mark.parametrize("mapping", ["world={step: 0.002}", "++world.step=0.002"])
def test_the_last_word_counts(
    mapping: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("GSL_CONFIG_DIR")
    for words in (["world.step=0.001", mapping], [mapping, "world.step=0.001"]):
        assert call(["collect", "--cfg", "job", "--json", *words]) == 0
        last = 0.002 if words[-1] == mapping else 0.001
        assert json.loads(capsys.readouterr().out)["world"]["step"] == last


@pytest.mark.parametrize("word", ["~hydra", "hydra=other", "++hydra=null"])
def test_settings_of_hydras_own_end_in_one_line(word: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["collect", word]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_help_shows_groups_settings_and_effects(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["evaluate", "--help"]) == 0
    text = capsys.readouterr().out
    (worlds,) = [line.split() for line in text.splitlines() if line.startswith("  real ")]
    assert {"ideal", "nao_ideal", "nao_worn", "worn*"} < set(worlds)
    assert "  control_period  0.02 s" in text
    assert "episodes in each" in text
    assert "backlash.width" in text


def test_help_says_what_a_preset_means_and_what_two_share_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["iterate", "--help"]) == 0
    text = capsys.readouterr().out
    preset = text.partition("Settings of preset=quick")[2].partition("\n\n")[0].splitlines()[1:]
    recipe = text.partition("Settings of recipe=default")[2].partition("\n\n")[0].splitlines()[1:]
    assert all(len(line.split("  ")) > 2 and line.split("  ")[-1].strip() for line in [*preset, *recipe])
    assert not any("cheetah" in line for line in preset)  # to which nothing here refers
    assert text.count("penalty on the weights of the linear model") == 1
    assert len(text.splitlines()) < 220


OF_ENVIRONMENTS = {  # what is for gymnasium environments, or for files that somebody brings
    "policy": ("mlp", "action_table", "onnx", "python", "sb3", "torch"),
    "optimizer": ("policy_iteration", "sb3", "trpo", "trpo_pendulum", "trpo_long"),
    "grounding": ("random_choice",),
    "trial": ("gymnasium",),
}
HELD = (  # robots without feet
    *("go2_in_air", "so101", "so101_anchor_lab", "so101_bam_m1", "so101_bam_m3", "so101_bam_m4", "so101_diagnosed"),
    *("so101_menagerie", "so101_robotstudio", "so101_typing_task", "so101_usd_drive", "so101_workshop", "urdf"),
    *("xl330_bam_m1", "xl330_bam_m3", "xl330_bam_m4", "xl330_pendulum"),
)
EXAMPLE = Path(__file__).parents[2] / "examples/arm.urdf"
# logs, with servos
REPLAYING = ("audit", "train_servo", "diagnose", "identify", "cross_validate", "blind_make", "blind_wiring")
NEEDED = {  # what has no default
    "audit": ("real=logs",),
    "diagnose": ("real=logs",),
    "export": ("format=json",),
    "identify": ("real=logs",),
    "train_servo": ("real=logs",),
    "cross_validate": ("real=logs", "by=kp"),
    "rehearse": ("request=asked",),
    "answer": ("request=asked",),
}


def _choices() -> Iterator[tuple[str, ...]]:
    """Commands with choices as they are typed: each command once, and each option wherever a group is chosen."""
    conf, seen = configuration_folder(), set[str]()
    for command in sorted(path for folder in (conf, *folders()) for path in folder.glob("*.yaml")):
        if command.stem == "wiring":  # of policies that somebody brings
            continue
        defaults = yaml.safe_load(command.read_text()).get("defaults", [])
        groups = [
            next(iter(entry)).lstrip("/")
            for entry in defaults
            if isinstance(entry, dict) and not next(iter(entry)).startswith("override")
        ]
        shares = [typed for typed in _shares(groups, conf, command.stem) if typed]
        for number in range(max(map(len, shares), default=0)):
            chosen = [typed[min(number, len(typed) - 1)] for typed in shares]
            pairs = {re.sub(r"[.].*=", "=", word) for word in chosen}  # worlds.nao_worn=nao_weak: one of worlds
            if number == 0 or not pairs <= seen:
                yield command.stem.replace("_", "-"), *chosen, *NEEDED.get(command.stem, ())
            seen |= pairs
    experiments = sorted(option.stem for option in (conf / "experiment").glob("*.yaml"))
    cart = ("sim.env_id=examples.cart:Cart", "real.env_id=examples.cart:Cart")
    for name in experiments:
        if name == "environments":
            yield (
                "compare",
                f"experiment={name}",
                *(f"{place}.env_id=CartPole-v1" for place in ("iterate.sim", "worlds.real")),
            )
        else:
            yield "iterate", f"experiment={name}", *(cart if name == "gymnasium" else ())
    for grounding in ("none", "ane", "gat", "sgat"):
        yield "iterate", "experiment=gymnasium", f"grounding={grounding}", *cart
    for command in ("collect world", "evaluate world", "iterate real"):
        yield command.split()[0], f"{command.split()[1]}=robot"
    for world in HELD:
        mine = (f"robot={EXAMPLE}",) if world == "urdf" else ()
        yield "collect", f"world={world}", *(f"world.{setting}" for setting in mine), "task=excite"
        yield "diagnose", f"sim={world}", *(f"sim.{setting}" for setting in mine), "real=logs"
    others = (
        path for path in sorted((conf / "world").glob("[!n]*.yaml")) if path.stem not in (*HELD, "robot", "learned")
    )
    for world in others:
        place = ("world.env_id=examples.cart:Cart",) if world.stem == "gymnasium" else ()
        policy = "action_table" if world.stem.startswith("cliff") else "mlp"
        for command in ("collect", "optimize"):
            yield command, f"world={world.stem}", *place, "task=own_reward", f"policy={policy}"


def _shares(groups: list[str], conf: Path, command: str) -> Iterator[list[str]]:
    """Yield what each group takes, line by line; the methods of a study, or its worlds, share the options."""
    kinds = [group.partition(".")[0] for group in groups]
    for place, (group, kind) in enumerate(zip(groups, kinds, strict=True)):
        typed = _typed(group, conf, command)
        yield typed[kinds[:place].count(kind) :: kinds.count(kind)] or typed[-1:]


def _typed(group: str, conf: Path, command: str) -> list[str]:
    folder, _, role = group.partition("@")
    options = (option.stem for option in sorted((conf / folder).glob("*.yaml")))
    if role.endswith("excitation"):  # the policy that a diagnosis plays
        return [f"{role}=excitation"]
    if command in ("reproduce_fig11", "reproduce_fig12", "reproduce_fig13", "reproduce_garat"):
        return [f"{folder}={name}" for name in ("toy", "study")] if folder == "preset" else []
    if command in REPLAYING:
        options = (name for name in options if not name.startswith("nao_motors"))
    mine = (name for name in options if name not in OF_ENVIRONMENTS.get(folder, ()))
    robots = (name for name in mine if folder != "world" or name.startswith("nao"))
    return [f"{role or folder}={name}" for name in robots if name != "excite" or command == "collect"]


@pytest.mark.parametrize("line", list(_choices()), ids=" ".join)
def test_every_option_of_ours_composes_and_builds(line: tuple[str, ...]) -> None:
    command, *choices = line
    with open_hydra(None):
        composition = compose(command, choices)
        stage, settings, _ = prepare(resolve(composition), composition.trust)
    assert stage.kind in (command.replace("-", "_"), command.partition("-")[0])
    assert restore(describe(stage), trust=composition.trust) == stage
    assert not {"preset", "recipe", "name", "out"} & settings.keys()


def test_a_saved_component_is_built_again() -> None:
    saved = {"_target_": "gsl.storage.importers.signal.Signal", "column": "mine"}
    assert restore(saved).column == "mine"


def test_a_saved_text_is_no_reference() -> None:
    text = "${oc.create:'{_target_: os.getcwd}'}"
    assert restore({"_target_": "gsl.storage.importers.signal.Signal", "column": text}).column == text


@pytest.mark.parametrize(
    "saved",
    [
        {"_target_": "os.getcwd"},
        {"_target_": "gsl.__main__.main"},
        {"_target_": "gsl.runner.bridge.read"},
        {"_target_": "gsl.worlds.environments.importlib.import_module", "name": "antigravity"},
        {"_target_": "gsl.worlds.environments.Path"},
        {"_target_": "gsl.worlds.environments.made", "name": "CartPole-v1", "kwargs": {}},
        {"_target_": "gsl.commandline.config.CommandSettings", "name": "mine"},
        {"_target_": "gsl.storage.importers.signal.Signal", "column": {"_target_": "os.getcwd"}},
        {"_target_": "gsl.storage.importers.signal.Signal", "column": [{"_target_": "os.getcwd"}]},
        {"_target_": "gsl.worlds.bullet.BulletWorld", "robot": "os.getcwd"},
        {"_target_": "gsl.worlds.gymnasium.GymnasiumWorld", "env_id": "os:getcwd"},
        {"_target_": "${oc.env:HOME}"},
        {"_target_": "gsl.no_such.Thing"},
        {"_target_": 3},
    ],
)
def test_a_saved_component_names_classes_of_gsl_and_plain_values_only(saved: dict[str, object]) -> None:
    with pytest.raises(ConfigError):
        restore(saved)


def test_a_saved_component_of_the_users_own_needs_trust() -> None:
    saved = {"_target_": "example_stage.ExampleWorld", "control_period": 0.02}
    with pytest.raises(ConfigError, match="trust=example_stage if you know"):
        restore(saved)
    assert restore(saved, trust=["example_stage"]) == ExampleWorld(control_period=0.02)
